//! Scenes in which every surface and every point of space sees radiance 1, so that the image is 1.

use crate::render::{average, scene_with};

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

/// A mirror beside it.
pub const MIRROR_BALL: &str = r#"
[materials.silver]
type = "mirror"
[[shapes]]
type = "sphere"
center = [0.5, -0.3, -0.2]
radius = 0.3
material = "silver"
"#;

/// What has more than one lobe, or lets light pass beside it, in the same box.
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
radius = 0.01
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
radius = 0.01
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

/// The image's mean is 1 within five standard errors and the kernels' loss; so is the mean of every quarter of rows.
///
/// # Panics
/// When it is not.
pub fn is_one(name: &str, toml: &str, assets: &[(&str, &[u8])], bias: f64) {
    let scene = scene_with(toml, assets);
    let image = average(&scene);
    let rows = image.beauty.height as usize / 4;
    let width = image.beauty.width as usize;
    for (quarter, (pixels, errors)) in image
        .beauty
        .pixels
        .chunks(rows * width)
        .zip(image.standard_error.pixels.chunks(rows * width))
        .enumerate()
    {
        for c in 0..3 {
            let n = pixels.len() as f64;
            let mean = pixels.iter().map(|p| p[c] as f64).sum::<f64>() / n;
            // Pixels of a pass share its photons, so their errors may all be of one sign.
            let error = errors.iter().map(|p| p[c] as f64).sum::<f64>() / n;
            let bound = bias + 5.0 * error / (n / 64.0).sqrt().max(1.0);
            assert!(
                (mean - 1.0).abs() < bound,
                "{name}: channel {c} of quarter {quarter} is {mean}, bound {bound}"
            );
        }
    }
}
