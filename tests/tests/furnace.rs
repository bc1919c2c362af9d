//! The furnace: where every surface and every point of space sees radiance 1, the image is 1, whatever is in it.
//!
//! Kernels lose a little light where they reach beyond an edge or a boundary, in proportion to their radius: the scenes
//! name a small fixed radius, and the bounds below allow for what it costs.

use beamfarm_tests::furnace::{
    COATS_VEILS_AND_PANES, GLASS_BALL, MIRROR_BALL, WHITE_AND_GLASS, closed_box, is_one,
    under_the_sky,
};

#[test]
fn closed_box_of_diffuse_walls() {
    is_one("walls", &closed_box(0.6, ""), &[], 0.004);
}

#[test]
fn closed_box_with_glass_and_mirror() {
    is_one(
        "glass and mirror",
        &closed_box(0.5, &format!("{GLASS_BALL}{MIRROR_BALL}")),
        &[],
        0.006,
    );
}

#[test]
fn closed_box_with_coats_veils_and_panes() {
    is_one("coats", &closed_box(0.5, COATS_VEILS_AND_PANES), &[], 0.006);
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
        &closed_box(0.5, &format!("{GLASS_BALL}{fog}")),
        &[],
        0.015,
    );
}

#[test]
fn white_surfaces_under_the_sky() {
    is_one(
        "white and glass",
        &under_the_sky(WHITE_AND_GLASS),
        &[],
        0.006,
    );
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
