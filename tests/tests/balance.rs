//! Light from surfaces to surfaces by gather rays alone and by gather rays and photons together: the same on average.

use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::RenderPlan;
use beamfarm_tests::Suite;
use beamfarm_tests::render::{Blocks, scene};
use beamfarm_tests::z_test::two_sided;

/// A closed room with a small lamp near a wall, a large one, a point light, and surfaces that scatter in all ways that
/// are not specular.
const ROOM: &str = r#"
[image]
width = 24
height = 24
[render]
passes = 1500
paths = 3000
radius = 0.03
seed = 21
[camera]
origin = [0.0, 0.0, 0.95]
target = [0.0, -0.1, -1.0]
fov = 70.0
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.5, 0.3]
two_sided = true
[materials.steel]
type = "rough_conductor"
alpha = 0.25
preset = "iridium"
[materials.varnish]
type = "rough_plastic"
alpha = 0.2
reflectance = [0.2, 0.4, 0.6]
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [0.6, 0.75, -0.6]
radius = 0.08
emission = { radiance = 20.0 }
[[shapes]]
type = "rectangle"
transform = [{ scale = [0.3, 0.2, 1] }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [-0.95, 0.2, -0.3] }]
emission = { radiance = 3.0 }
[[shapes]]
type = "sphere"
center = [-0.45, -0.6, -0.5]
radius = 0.35
material = "steel"
[[shapes]]
type = "sphere"
center = [0.4, -0.65, -0.4]
radius = 0.3
material = "COAT"
[[lights]]
type = "point"
position = [0.2, 0.3, 0.4]
intensity = 0.3
"#;

/// Significance 1e-2 for all blocks of both rooms together.
#[test]
fn photons_take_over_what_gather_rays_leave() {
    let mut suite = Suite::new(1e-2);
    for coat in ["varnish", "wall"] {
        let scene = scene(&ROOM.replace("COAT", coat));
        let both = [false, true].map(|balanced| {
            let mut settings = scene.description().defaults.job_settings();
            settings.seed += u64::from(balanced);
            let mut plan = RenderPlan::new(&scene, settings);
            plan.photons_at_first_surface = balanced;
            plan.photons_on_gloss = false;
            let passes = 0..scene.description().defaults.passes;
            Blocks::new(passes.map(|i| render_pass(&scene, &plan, i).film), 6)
        });
        let [alone, together] = &both;
        for (i, (a, b)) in alone.blocks.iter().zip(&together.blocks).enumerate() {
            for c in 0..3 {
                let off = a[c].mean() - b[c].mean();
                // Kernels blur what photons bring: another 0.5 %.
                let error = a[c].std_error().hypot(b[c].std_error());
                let error = error.hypot(5e-3 * a[c].mean());
                let name = format!("{coat}, block {i}, channel {c}: {off:e} off, error {error:e}");
                suite.p_value(name, two_sided(off / error));
                assert!(error < 0.05 * a[c].mean(), "{error} of {}", a[c].mean());
            }
        }
    }
    suite.finish();
}
