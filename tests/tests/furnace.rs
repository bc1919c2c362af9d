//! The furnace: where every surface and every point of space sees radiance 1, the image is 1, whatever is in it.
//!
//! Kernels lose a little light where they reach beyond an edge or a boundary, in proportion to their radius: the scenes
//! name a small fixed radius, and the bounds below allow for what it costs.

use beamfarm_tests::furnace::{closed_box, is_one, under_the_sky};

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
    is_one("walls", &closed_box(0.6, ""), &[], 0.004);
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
        &[],
        0.006,
    );
}

#[test]
fn closed_box_with_coats_veils_and_panes() {
    let things = r#"
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
    is_one("coats", &closed_box(0.5, things), &[], 0.006);
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
    is_one("fog", &closed_box(0.5, fog), &[], 0.012);
    is_one(
        "fog and glass",
        &closed_box(0.5, &format!("{GLASS}{fog}")),
        &[],
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
    is_one("white and glass", &under_the_sky(white), &[], 0.006);
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
    is_one("cloud", &under_the_sky(cloud), &[], 0.02);
}
