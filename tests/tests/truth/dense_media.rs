//! Media that are dense compared with the scene, where beams must still bring their light.

use beamfarm_harness::differential::{Effort, examine};
use beamfarm_harness::render::scene;
use beamfarm_image::job::JobSettings;
use beamfarm_render::plan::RenderPlan;

/// A ball of frosted glass filled with something dense, under a lamp.
const BALL: &str = r#"
[image]
width = 24
height = 24
[render]
paths = 4000
media = "photons"
[camera]
origin = [-1.2, 0.8, 0.3]
target = [0, 0.15, 0]
fov = 24
[materials.paint]
type = "diffuse"
reflectance = 0.58
two_sided = true
[materials.frosted]
type = "rough_dielectric"
alpha = 0.4
ior = 1.5
[media.dense]
type = "homogeneous"
sigma_t = 65
albedo = [0.83, 0.08, 0.52]
phase = { type = "hg", g = 0.3 }
[[shapes]]
type = "rectangle"
material = "paint"
transform = [{ scale = 2 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "disc"
material = "paint"
emission = { radiance = [10, 15, 14] }
transform = [{ scale = 0.24 }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [-0.2, 1.1, -0.3] }]
[[shapes]]
type = "sphere"
material = "frosted"
interior = "dense"
center = [0, 0.17, 0]
radius = 0.16
"#;

/// Narrow kernels are for beams in the dense medium. On surfaces they would make spots of light that most pictures
/// lack.
#[test]
fn surfaces_keep_their_kernels_beside_dense_media() {
    let ball = scene(BALL);
    let settings = ball.description().defaults.job_settings();
    let plan = RenderPlan::new(&ball, settings);
    let usual = RenderPlan::new(
        &ball,
        JobSettings {
            techniques: Default::default(),
            ..settings
        },
    );
    assert!(plan.estimators.any_beams() && !usual.estimators.any_beams());
    assert_eq!(plan.radii.smooth_ceiling, usual.radii.smooth_ceiling);
    // A sixth of the mean free path.
    let widest = plan.widest_beams[0].smooth;
    assert!((widest * 6.0 * 65.0 - 1.0).abs() < 1e-5, "{widest}");
    assert!(widest < 0.1 * plan.radii.smooth_ceiling);
}

/// The light that leaves the ball is what the path tracer finds.
#[test]
fn light_that_dense_media_send_through_frosted_glass_is_all_there() {
    let effort = Effort {
        images: 64,
        samples: 16,
        significance: 1e-4,
        seconds: 60.0,
    };
    let verdict = examine(&scene(BALL), &effort);
    assert!(!verdict.is_fault() && verdict.is_settled(), "{verdict}");
}
