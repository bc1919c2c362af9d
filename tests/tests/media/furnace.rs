//! The furnace: where every surface and every point in space sees radiance 1, the image is 1, whatever it contains.

use beamfarm_harness::Suite;
use beamfarm_harness::furnace::{
    COATS_VEILS_AND_PANES, GLASS_BALL, LEAVES, MIRROR_BALL, WHITE_AND_GLASS, closed_box, is_one, under_the_sky,
};
use beamfarm_harness::render::{blur, images};

/// For each test, over all its images, channels and quarters.
const SIGNIFICANCE: f64 = 1e-3;

/// Standard error of an image's mean at which a loss of 1 % is visible.
const SHARP: f64 = 1.5e-3;

/// The image is 1, with so little noise that a loss of 1 % would be found.
fn is_one_sharply(name: &str, toml: &str, passes: u64) {
    let mut suite = Suite::new(SIGNIFICANCE);
    let error = is_one(&mut suite, name, toml, &[], images(passes));
    suite.finish();
    assert!(error < SHARP * blur(), "{name}: {error}");
}

#[test]
fn closed_box_of_diffuse_walls() {
    is_one_sharply("walls", &closed_box(0.6, ""), 400);
}

#[test]
fn closed_box_with_glass_and_mirror() {
    let balls = format!("{GLASS_BALL}{MIRROR_BALL}");
    is_one_sharply("glass and mirror", &closed_box(0.5, &balls), 400);
}

#[test]
fn closed_box_with_coats_veils_and_panes() {
    is_one_sharply("coats", &closed_box(0.5, COATS_VEILS_AND_PANES), 400);
}

#[test]
fn closed_box_with_leaves() {
    is_one_sharply("leaves", &closed_box(0.5, LEAVES), 400);
}

/// Beams close to the camera make the noise large: this finds losses of some percent; the clouds below find smaller
/// ones.
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
    let mut suite = Suite::new(SIGNIFICANCE);
    is_one(&mut suite, "fog", &closed_box(0.5, fog), &[], 16);
    let with_glass = format!("{GLASS_BALL}{fog}");
    is_one(&mut suite, "fog and glass", &closed_box(0.5, &with_glass), &[], 16);
    suite.finish();
}

#[test]
fn white_surfaces_under_the_sky() {
    is_one_sharply("white and glass", &under_the_sky(WHITE_AND_GLASS), 48);
}

/// A ball of a medium that fills the picture, under the sky; `absorbed` is the share lost at each scattering.
fn cloud(sigma_t: [f64; 3], absorbed: f64) -> String {
    let [sigma_a, sigma_s] = [absorbed, 1.0 - absorbed].map(|share| sigma_t.map(|s| share * s));
    let cloud = format!(
        r#"
[media.cloud]
type = "homogeneous"
sigma_a = {sigma_a:?}
sigma_s = {sigma_s:?}
phase = {{ type = "hg", g = 0.5 }}
[materials.boundary]
type = "null"
[[shapes]]
type = "sphere"
center = [0.0, 0.0, 0.0]
radius = 0.6
material = "boundary"
interior = "cloud"
"#
    );
    under_the_sky(&cloud).replace("fov = 40.0", "fov = 14.0")
}

/// Clouds whose light comes by beams, and by camera paths, with their numbers of passes.
const CLOUDS: [(&str, [f64; 3], u64); 2] = [
    ("thin cloud", [0.8, 1.0, 1.2], 32),
    ("dense cloud", [2.0, 3.0, 6.0], 200),
];

#[test]
fn clouds_that_absorb_nothing_under_the_sky() {
    for (name, sigma_t, passes) in CLOUDS {
        is_one_sharply(name, &cloud(sigma_t, 0.0), passes);
    }
}

/// The same clouds, where each scattering loses 1 % of the light: the test above would fail.
#[test]
#[ignore = "for those who change the test above"]
fn clouds_that_lose_one_percent_are_found_out() {
    for (name, sigma_t, passes) in CLOUDS {
        let mut suite = Suite::new(SIGNIFICANCE);
        is_one(&mut suite, name, &cloud(sigma_t, 0.01), &[], images(passes));
        assert!(!suite.failures().is_empty(), "{name}");
    }
}
