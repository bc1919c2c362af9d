//! No path grows heavy however often it is scattered: slabs and sheets from thin to dense, with colours in which light
//! dies and others in which it does not.

use beamfarm_harness::render::scene;
use beamfarm_render::cpu::beam::trace::trace_photons;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::estimators::{Caustics, MediumLight, SurfaceLight};
use beamfarm_render::world::Scene;

const DEPTHS: [f64; 4] = [1e-3, 1.0, 30.0, 1e3];
const ALBEDOS: [&str; 4] = ["1.0", "[1.0, 0.0, 0.5]", "[0.98, 0.5, 0.01]", "[0.0, 0.9999, 0.0]"];
/// Extinctions of the three channels, relative to the given one.
const COLOURS: [[f64; 3]; 3] = [[1.0, 1.0, 1.0], [1.0, 0.01, 3.0], [0.1, 1.0, 0.01]];
/// Half the slab's thickness over half its sides.
const THICKNESSES: [f64; 2] = [1.0, 1e-2];

/// A slab of a medium of this optical depth, in surroundings that shine.
fn slabs(render: &str, light: &str) -> impl Iterator<Item = (String, Scene)> {
    let all = THICKNESSES.into_iter().flat_map(|thickness| {
        let depths = DEPTHS.into_iter().flat_map(move |depth| {
            COLOURS.into_iter().map(move |colour| {
                let sigma_t = colour.map(|c| depth * c / (2.0 * thickness));
                (thickness, sigma_t, depth)
            })
        });
        depths.flat_map(|(thickness, sigma_t, depth)| {
            [-0.8, 0.0, 0.9]
                .into_iter()
                .zip(ALBEDOS.into_iter().cycle().skip((thickness * 7.0) as usize))
                .map(move |(g, albedo)| {
                    // After more than 1,024 scatterings paths do grow heavier, but hardly any comes back.
                    let albedo = match depth > 100.0 {
                        true => albedo.replace("1.0", "0.99").replace("0.9999", "0.99"),
                        false => albedo.to_owned(),
                    };
                    (thickness, sigma_t, albedo, g)
                })
        })
    });
    let (render, light) = (render.to_owned(), light.to_owned());
    all.map(move |(thickness, sigma_t, albedo, g)| {
        let name = format!("thickness {thickness}, sigma_t {sigma_t:?}, albedo {albedo}, g {g}");
        let text = format!(
            r#"
[image]
width = 16
height = 16
[render]
{render}
[camera]
origin = [0.5, 1.0, 3.0]
target = [0.0, 0.0, 0.0]
fov = 40.0
[media.slab]
type = "homogeneous"
sigma_t = {sigma_t:?}
albedo = {albedo}
phase = {{ type = "hg", g = {g} }}
[materials.boundary]
type = "null"
[[shapes]]
type = "cube"
material = "boundary"
interior = "slab"
transform = [{{ scale = [1.0, 1.0, {thickness}] }}]
{light}
"#
        );
        let slab = scene(&text);
        (name, slab)
    })
}

/// In an even sky of radiance 1 nothing is brighter, and no sample exceeds it by more than many scatterings near a face
/// may add, each of them at most half of the light.
#[test]
fn camera_paths_stay_light() {
    let sky = "[[lights]]\ntype = \"environment\"\nradiance = 1.0";
    for (name, slab) in slabs("paths = 500", sky) {
        let settings = slab.description().defaults.job_settings();
        let mut plan = RenderPlan::new(&slab, settings);
        plan.estimators.media = vec![MediumLight::Paths];
        plan.estimators.surfaces = SurfaceLight::Paths(vec![Caustics::Paths]);
        (plan.beams, plan.surface_photons) = (false, false);
        let (mut brightest, mut sum, mut count) = (0.0f32, 0.0f64, 0.0f64);
        for pass in 0..8 {
            for value in render_pass(&slab, &plan, pass)
                .expect("a pass")
                .film
                .pixels
                .iter()
                .flatten()
            {
                brightest = brightest.max(*value);
                sum += f64::from(*value);
                count += 1.0;
            }
        }
        assert!(brightest < 60.0, "{name}: {brightest}");
        let mean = sum / count;
        assert!(mean < 1.05, "{name}: {mean}");
    }
}

/// Photons share the light's flux: a channel has at most the sum of all three, and a beam at most that times the
/// reciprocal of the share of its kernel that lies in the medium.
#[test]
fn photons_stay_light() {
    let lamp = "[[shapes]]\ntype = \"sphere\"\ncenter = [0.0, 2.0, 1.5]\nradius = 0.5\nemission = { power = 1.0 }";
    let paths = 2000;
    let mut beams = 0;
    for (name, slab) in slabs(&format!("paths = {paths}\nradius = 1e-4\ntargeting = \"off\""), lamp) {
        let settings = slab.description().defaults.job_settings();
        let plan = RenderPlan::new(&slab, settings);
        let photons = trace_photons(&slab, &plan, 0);
        let of_beams = photons.beams.iter().chain(&photons.smooth_beams);
        let powers: Vec<f32> = of_beams.map(|beam| beam.power.max_element()).collect();
        beams += powers.len();
        let heaviest = powers.iter().copied().fold(0.0, f32::max);
        let most = 3.0 * 16.0 / paths as f32;
        assert!(heaviest <= 1.001 * most, "{name}: {heaviest} for {most}");
        let heavy = powers.iter().filter(|power| **power > 2.0 * 3.01 / paths as f32);
        let share = heavy.count() as f64 / powers.len().max(1) as f64;
        assert!(share < 0.02, "{name}: {share}");
    }
    assert!(beams > 10_000, "{beams}");
}
