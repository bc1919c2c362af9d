//! Energy balance of photon tracing: what walls and media absorb is what the light emits.

use beamfarm_harness::render::{plan_of, scene};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::cpu::beam::trace::trace_photons;
use beamfarm_render::math::Rgb;

/// A lamp behind glass in a closed box of fog. Kernels are so narrow that none reaches over an edge, where powers are
/// larger. Because of the glass every photon that reaches a wall is stored (light straight from its source is not).
const BOX: &str = r#"
[image]
width = 8
height = 8
[render]
paths = 2000
radius = 1e-4
[world]
medium = "fog"
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, 0.0, 0.0]
fov = 40.0
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.3, 0.0]
sigma_s = [0.4, 0.1, 0.7]
phase = { type = "hg", g = -0.3 }
[materials.wall]
type = "diffuse"
reflectance = [0.8, 0.5, 0.2]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [0.2, 0.1, -0.3]
radius = 0.2
material = "glass"
[[lights]]
type = "point"
position = [0.22, 0.1, -0.3]
power = [10.0, 20.0, 30.0]
"#;

#[test]
fn what_is_emitted_is_absorbed() {
    let scene = scene(BOX);
    let plan = plan_of(&scene);
    let medium = &scene.description().media[0];
    let sigma_t = medium.sigma_t();
    let absorbed_by_walls = Rgb::ONE - Rgb::new(0.8, 0.5, 0.2);
    let mut total = [(); 3].map(|_| MeanEstimate::new());
    for pass in 0..300 {
        let photons = trace_photons(&scene, &plan, pass);
        assert!(!photons.beams.is_empty() && !photons.smooth_beams.is_empty());
        assert!(!photons.surface.is_empty());
        for c in 0..3 {
            let walls: f64 = photons.surface.iter().map(|p| p.power[c] as f64).sum();
            // A long beam keeps the flux of its start; the medium absorbs, in expectation, the absorbed share of what
            // is lost along it.
            let lost: f64 = photons
                .beams
                .iter()
                .chain(&photons.smooth_beams)
                .map(|b| b.power[c] as f64 * -libm::expm1(-(sigma_t[c] * b.length) as f64))
                .sum();
            let share = ((sigma_t[c] - medium.sigma_s()[c]) / sigma_t[c]) as f64;
            total[c].add(walls * absorbed_by_walls[c] as f64 + lost * share);
        }
    }
    // Significance 1e-3.
    let mut suite = Suite::new(1e-3);
    for (c, expected) in [10.0, 20.0, 30.0].into_iter().enumerate() {
        suite.mean(format!("channel {c}"), &total[c], expected);
    }
    suite.finish();
}
