//! Scenes in which every surface and every point in space sees radiance 1, so that the image is 1.

use crate::render::{Blocks, scene_with};
use crate::{MeanEstimate, Suite};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;

/// A ball of glass in [`closed_box`].
pub const GLASS_BALL: &str = r#"
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [-0.3, -0.2, 0.0]
radius = 0.4
material = "glass"
"#;

/// A mirror ball next to it.
pub const MIRROR_BALL: &str = r#"
[materials.silver]
type = "mirror"
[[shapes]]
type = "sphere"
center = [0.5, -0.3, -0.2]
radius = 0.3
material = "silver"
"#;

/// Surfaces with several lobes or with partial transmission, in the same box.
pub const COATS_VEILS_AND_PANES: &str = r#"
[materials.coat]
type = "plastic"
reflectance = 1.0
[materials.veil]
type = "diffuse"
reflectance = 1.0
two_sided = true
opacity = 0.6
[materials.pane]
type = "thin_dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [-0.3, -0.2, 0.0]
radius = 0.4
material = "coat"
[[shapes]]
type = "sphere"
center = [0.5, -0.3, -0.2]
radius = 0.3
material = "veil"
[[shapes]]
type = "rectangle"
material = "pane"
transform = [{ scale = 0.4 }, { rotate = { axis = [0, 1, 0], angle = 40 } }, { translate = [0.4, 0.4, 0.1] }]
"#;

/// Surfaces that are diffuse on both sides: a ball of wax-like skin, and a leaf.
pub const LEAVES: &str = r#"
[materials.skin]
type = "translucent"
reflectance = 0.3
transmittance = 0.7
[[shapes]]
type = "sphere"
center = [-0.3, -0.2, 0.0]
radius = 0.4
material = "skin"
[[shapes]]
type = "rectangle"
material = "skin"
transform = [{ scale = 0.4 }, { rotate = { axis = [0, 1, 0], angle = 40 } }, { translate = [0.4, 0.4, 0.1] }]
"#;

/// A white ball and one of glass.
pub const WHITE_AND_GLASS: &str = r#"
[materials.white]
type = "diffuse"
reflectance = 1.0
[materials.frosted]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [-0.6, 0.0, 0.0]
radius = 0.5
material = "white"
[[shapes]]
type = "sphere"
center = [0.6, 0.0, 0.0]
radius = 0.5
material = "frosted"
"#;

/// Walls that reflect `rho` and emit the rest: a closed box whose inside has radiance 1.
pub fn closed_box(rho: f32, rest: &str) -> String {
    format!(
        r#"
[image]
width = 32
height = 32
[render]
passes = 24
paths = 20000
radius = 0.05
seed = 3
[camera]
origin = [0.1, 0.2, 0.9]
target = [0.0, 0.1, 0.0]
fov = 70.0
[materials.wall]
type = "diffuse"
reflectance = {rho}
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
emission = {{ radiance = {} }}
{rest}
"#,
        1.0 - rho
    )
}

/// A sky of radiance 1 around things that absorb nothing.
pub fn under_the_sky(rest: &str) -> String {
    format!(
        r#"
[image]
width = 32
height = 32
[render]
passes = 24
paths = 20000
radius = 0.05
seed = 5
[camera]
origin = [0.0, 0.0, 4.0]
target = [0.0, 0.0, 0.0]
fov = 40.0
[[lights]]
type = "environment"
radiance = 1.0
{rest}
"#
    )
}

/// Adds tests that the image's mean, and that of each quarter, is 1 in every channel. Returns the standard error of the
/// channel with the least noise.
///
/// Kernels lose light where they reach beyond an edge or a boundary, in proportion to their radius. So each pass is
/// also rendered with twice the radius, and the two extrapolated to radius zero must give 1. There is no allowance.
pub fn is_one(suite: &mut Suite, name: &str, toml: &str, assets: &[(&str, &[u8])], passes: u64) -> f64 {
    let scene = scene_with(toml, assets);
    let settings = scene.description().defaults.job_settings();
    let narrow = RenderPlan::new(&scene, settings);
    let mut wide = narrow.clone();
    wide.radii.floor *= 2.0;
    wide.radii.ceiling *= 2.0;
    wide.radii.smooth_ceiling *= 2.0;
    let images = (0..passes).map(|pass_index| {
        let mut film = render_pass(&scene, &narrow, pass_index).expect("a pass").film;
        let other = render_pass(&scene, &wide, pass_index).expect("a pass").film;
        let values = film.pixels.iter_mut().flatten();
        for (value, wide) in values.zip(other.pixels.iter().flatten()) {
            *value = 2.0 * *value - wide;
        }
        film
    });
    let found = Blocks::new(images, scene.description().camera.width as usize / 2);
    let quarters = found.blocks.iter().enumerate();
    let parts = quarters.map(|(i, quarter)| (format!("{name}, quarter {i}"), quarter));
    for (name, means) in parts.chain([(name.to_owned(), &found.whole)]) {
        for (c, mean) in means.iter().enumerate() {
            suite.mean(format!("{name}, channel {c}"), mean, 1.0);
        }
    }
    let errors = found.whole.iter().map(MeanEstimate::std_error);
    errors.fold(f64::INFINITY, f64::min)
}
