//! The furnace: where every surface and every point of space sees radiance 1, the image is 1, whatever is in it.
//!
//! Kernels lose a little light where they reach beyond an edge or a boundary, in proportion to their radius: the scenes
//! name a small fixed radius, and the bounds below allow for what it costs.

use beamfarm_tests::render::{average, scene};

/// Walls that reflect `rho` and emit the rest: a closed box whose inside has radiance 1.
fn closed_box(rho: f32, rest: &str) -> String {
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
fn under_the_sky(rest: &str) -> String {
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
fn is_one(name: &str, toml: &str, bias: f64) {
    let scene = scene(toml);
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

const GLASS: &str = r#"
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [-0.3, -0.2, 0.0]
radius = 0.4
material = "glass"
"#;

#[test]
fn closed_box_of_diffuse_walls() {
    is_one("walls", &closed_box(0.6, ""), 0.004);
}

#[test]
fn closed_box_with_glass_and_mirror() {
    let mirror = r#"
[materials.silver]
type = "mirror"
[[shapes]]
type = "sphere"
center = [0.5, -0.3, -0.2]
radius = 0.3
material = "silver"
"#;
    is_one(
        "glass and mirror",
        &closed_box(0.5, &format!("{GLASS}{mirror}")),
        0.006,
    );
}

#[test]
fn closed_box_full_of_a_medium_that_absorbs_nothing() {
    let fog = r#"
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.0
sigma_s = [0.5, 1.0, 0.2]
phase = { type = "hg", g = 0.5 }
"#;
    is_one("fog", &closed_box(0.5, fog), 0.012);
    is_one(
        "fog and glass",
        &closed_box(0.5, &format!("{GLASS}{fog}")),
        0.015,
    );
}

#[test]
fn white_surfaces_under_the_sky() {
    let white = r#"
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
    is_one("white and glass", &under_the_sky(white), 0.006);
}

#[test]
fn a_cloud_that_absorbs_nothing_under_the_sky() {
    let cloud = r#"
[media.cloud]
type = "homogeneous"
sigma_a = 0.0
sigma_s = [1.0, 2.0, 4.0]
[materials.boundary]
type = "null"
[[shapes]]
type = "sphere"
center = [0.0, 0.0, 0.0]
radius = 1.0
material = "boundary"
interior = "cloud"
"#;
    is_one("cloud", &under_the_sky(cloud), 0.02);
}
