//! Pictures of scenes with dispersion.

use beamfarm_harness::Suite;
use beamfarm_harness::differential::{Effort, examine};
use beamfarm_harness::furnace::{GLASS_BALL, closed_box, is_one, under_the_sky};
use beamfarm_harness::render::{Blocks, is_long, reference_images, scene, with_threads};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::film::Film;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_image::layer::Layer;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// For each test.
const SIGNIFICANCE: f64 = 1e-3;

/// The same with glass that splits light.
fn dispersive(toml: &str) -> String {
    let split = toml.replace("ior = 1.5", "ior = { nd = 1.6, abbe = 20.0 }");
    assert_ne!(split, toml);
    split
}

#[test]
fn a_furnace_with_dispersive_glass_is_white_in_the_mean() {
    let mut suite = Suite::new(SIGNIFICANCE);
    is_one(&mut suite, "box", &dispersive(&closed_box(0.5, GLASS_BALL)), &[], 64);
    let glasses = format!("{GLASS_BALL}{FROSTED}");
    is_one(&mut suite, "sky", &dispersive(&under_the_sky(&glasses)), &[], 64);
    suite.finish();
}

const FROSTED: &str = r#"
[materials.frosted]
type = "rough_dielectric"
ior = 1.5
alpha = 0.05
[[shapes]]
type = "sphere"
center = [0.6, 0.2, 0.0]
radius = 0.4
material = "frosted"
"#;

#[test]
fn the_path_tracer_finds_the_same_furnace() {
    let scene = scene(&dispersive(&closed_box(0.5, GLASS_BALL)));
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    let found = Blocks::new(reference_images(&scene, settings, 32, 4), 16);
    let mut suite = Suite::new(SIGNIFICANCE);
    for (i, block) in found.blocks.iter().chain([&found.whole]).enumerate() {
        for (c, mean) in block.iter().enumerate() {
            suite.mean_within(format!("block {i}, channel {c}"), mean, 1.0, 1e-5);
        }
    }
    suite.finish();
}

/// A ball and a slab of dispersive glass above a floor of two colours, lit by a lamp of some size, seen past and
/// through them.
const ROOM: &str = r#"
[image]
width = 32
height = 32
[render]
seed = 11
[camera]
origin = [0.0, 1.4, 3.2]
target = [0.0, 0.5, 0.0]
fov = 45.0
[materials.glass]
type = "dielectric"
ior = { nd = 1.7, abbe = 12.0 }
specular_transmittance = [1.0, 0.9, 0.7]
[materials.frosted]
type = "rough_dielectric"
ior = { cauchy = [1.5, 0.03] }
alpha = 0.3
[materials.floor]
type = "diffuse"
reflectance = { checkerboard = [[0.7, 0.2, 0.2], [0.3, 0.5, 0.7]], uv = [{ scale = 4 }] }
two_sided = true
[[shapes]]
type = "sphere"
center = [-0.5, 0.6, 0.0]
radius = 0.45
material = "glass"
[[shapes]]
type = "cube"
material = "frosted"
transform = [{ scale = [0.3, 0.35, 0.2] }, { rotate = { axis = [0, 1, 0], angle = 30 } }, { translate = [0.6, 0.5, 0.2] }]
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{ scale = 2.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
"#;

const LAMP: &str = r#"
[[shapes]]
type = "sphere"
center = [0.4, 2.6, -0.3]
radius = 0.2
emission = { radiance = [12.0, 10.0, 8.0] }
"#;

const POINT: &str = r#"
[[lights]]
type = "spot"
position = [-0.5, 2.5, 0.1]
target = [-0.4, 0.5, 0.0]
power = 20.0
"#;

const SKY: &str = r#"
[[lights]]
type = "environment"
radiance = [0.7, 0.8, 1.0]
"#;

const FOG: &str = r#"
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.02
sigma_s = [0.1, 0.12, 0.16]
"#;

const EFFORT: Effort = Effort {
    images: 64,
    samples: 4,
    significance: SIGNIFICANCE,
    seconds: 60.0,
};

/// Caustics by photons and by camera paths, rough glass, and light that is split on the way to a surface and again on
/// the way to the camera.
#[test]
fn passes_and_path_tracer_agree_where_light_is_split() {
    for (name, rest, air) in [("lamp", LAMP, ""), ("lamp in fog", LAMP, FOG), ("sky", SKY, "")] {
        if name == "lamp" && !is_long() {
            continue;
        }
        let verdict = examine(&scene(&format!("{ROOM}{rest}{air}")), &EFFORT);
        assert!(verdict.is_settled(), "{name}: {verdict}");
    }
}

fn with_layers(toml: &str) -> (Scene, RenderPlan) {
    let scene = scene(toml);
    let mut settings = scene.description().defaults.job_settings();
    settings.paths_per_pass = 4000;
    let layers = [Layer::Direct, Layer::Surface, Layer::Volume];
    let plan = RenderPlan::new(&scene, settings).with_layers(&scene, &layers).unwrap();
    (scene, plan)
}

/// Layers hold the weights of wavelengths as the picture does.
#[test]
fn parts_sum_to_the_picture() {
    let (scene, plan) = with_layers(&format!("{ROOM}{LAMP}{POINT}{FOG}"));
    let image = render_pass(&scene, &plan, 2).expect("a pass");
    let mut has_colour = false;
    for (i, pixel) in image.film.pixels.iter().enumerate() {
        for (c, value) in pixel.iter().enumerate() {
            let sum: f32 = image.layers.iter().map(|layer| layer.pixels[i][c]).sum();
            assert!(
                (sum - value).abs() <= 1e-4 * (1.0 + value.abs()),
                "pixel {i}, channel {c}"
            );
            has_colour |= *value < 0.0;
        }
    }
    assert!(has_colour, "no colour outside of sRGB");
}

#[test]
fn bits_do_not_depend_on_threads() {
    let (scene, plan) = with_layers(&format!("{ROOM}{LAMP}{POINT}{FOG}"));
    let hashes = [1, 4].map(|threads| {
        let image = with_threads(threads, || render_pass(&scene, &plan, 5).expect("a pass"));
        let hash = |film: &Film| pixel_hash(film);
        [hash(&image.film), hash(&image.layers[1]), hash(&image.layers[2])]
    });
    assert_eq!(hashes[0], hashes[1]);
}

/// A dispersive material that no surface uses changes nothing: the same bits.
#[test]
fn glass_that_nothing_is_made_of_changes_nothing() {
    let plain = ROOM
        .replace("ior = { nd = 1.7, abbe = 12.0 }", "ior = 1.7")
        .replace("ior = { cauchy = [1.5, 0.03] }", "ior = 1.5");
    let unused = "[materials.flint]\ntype = \"dielectric\"\nior = { preset = \"sf11\" }\n";
    let hashes = ["", unused].map(|rest| {
        let (scene, plan) = with_layers(&format!("{plain}{LAMP}{FOG}{rest}"));
        pixel_hash(&render_pass(&scene, &plan, 0).expect("a pass").film)
    });
    assert_eq!(hashes[0], hashes[1]);
}
