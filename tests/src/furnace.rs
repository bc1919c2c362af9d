//! Scenes in which every surface and every point of space sees radiance 1, so that the image is 1.

use crate::render::{average, scene_with};

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
