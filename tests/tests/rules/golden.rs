//! A small picture for each type of ray and each way of listing: see `golden.rs` beside this folder.

use beamfarm_shared::exr::pixel_hash;
use beamfarm_tests::render::{average, scene};

const SCENE: &str = r#"
[image]
width = 36
height = 24
[render]
passes = 3
paths = 600
seed = 11
[camera]
origin = [0.2, 1.3, 4.5]
target = [0, 0.6, 0]
fov = 42
[media.fog]
type = "homogeneous"
sigma_a = 0.05
sigma_s = [0.5, 0.4, 0.3]
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.silver]
type = "mirror"
[materials.satin]
type = "rough_conductor"
alpha = 0.2
preset = "copper"
[materials.boundary]
type = "null"
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ scale = 4 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
name = "mirror"
type = "rectangle"
material = "silver"
transform = [{ scale = 0.8 }, { rotate = { axis = [0, 1, 0], angle = 25 } }, { translate = [-1, 0.8, -0.8] }]
[[shapes]]
name = "glass"
type = "sphere"
center = [0.8, 0.45, 0.8]
radius = 0.4
material = "glass"
[[shapes]]
name = "ball"
type = "sphere"
center = [0, 0.35, 0]
radius = 0.35
material = "satin"
[[shapes]]
name = "box"
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = [0.4, 0.6, 0.4] }, { translate = [1, 0.7, -0.6] }]
[[shapes]]
name = "lamp"
type = "disc"
emission = { radiance = [9, 8, 6] }
transform = [{ scale = 0.35 }, { look_at = { origin = [-1.5, 2.5, 1.5], target = [0, 0.3, 0] } }]
[[lights]]
name = "spot"
type = "spot"
position = [2.5, 3, 1]
target = [0.6, 0.2, 0]
intensity = [20, 24, 30]
cutoff_angle = 28
[[lights]]
name = "sky"
type = "environment"
radiance = [0.1, 0.12, 0.2]
"#;

const RULES: [(&str, &str); 10] = [
    (
        r#"rays = ["camera"] | exclude = ["ball", "sky"]"#,
        "24679fd5f8d5bd724ad544928569c62b29d2d03af98276178ec52cf26d45275b",
    ),
    (
        r#"rays = ["camera"] | include = ["floor", "mirror", "box"]"#,
        "3b73dbe66d8415f751c664ec09079a7392a6cf4374d6d263aabd68f338b5a0a9",
    ),
    (
        r#"on = ["mirror", "ball"] | rays = ["reflected"] | exclude = ["glass", "lamp"]"#,
        "77785678273ffa4c8e137b584bd6f168e039869a397570ee39857b69dcd0fead",
    ),
    (
        r#"on = ["mirror"] | rays = ["reflected"] | include = ["ball"]"#,
        "114a5181288d3a6cf08443f2608c4e78a8299cdf7602d800cc8cd5cea6bc28c0",
    ),
    (
        r#"on = ["glass"] | rays = ["refracted"] | exclude = ["floor"]"#,
        "7ec3bc1d317d5d75b08d031836d63c66f8bc70e2511c1a2efafb455089d1c607",
    ),
    (
        r#"rays = ["refracted"] | include = ["glass", "mirror"]"#,
        "bffd1ce83548a728c0b0f20f0ebec4754684ae8de83ce4e4d4c30759966360fb",
    ),
    (
        r#"on = ["floor"] | rays = ["shadow"] | exclude = ["lamp", "ball"]"#,
        "487eef674b2489434797113a3bda3bf1765457dc6c13d942ef607927fd660ba2",
    ),
    (
        r#"on = ["ball"] | rays = ["shadow"] | include = ["spot"]"#,
        "3d635dfd68c7ad2b0d7efac36f1c4b905f503e488416c7899cc48b0e57193d2e",
    ),
    (
        r#"on = ["floor", "box", "spot"] | rays = ["photon"] | exclude = ["glass", "spot"]"#,
        "a9f1eead863d413be08bcfb8db4a1abd9869871de0fcbdb55784251eb489351a",
    ),
    (
        r#"on = ["spot", "glass", "floor"] | rays = ["photon"] | include = ["glass", "lamp"]"#,
        "fad1053f54f27b8bfb72b9dbf18d031618ee6bb9165fa59384638e57381d0fa7",
    ),
];

#[test]
fn hashes_of_pictures_with_rules() {
    let plain = pixel_hash(&average(&scene(SCENE)).beauty);
    let mut hashes = Vec::new();
    for (rule, _) in RULES {
        let text = format!("{SCENE}[[rules]]\n{}\n", rule.replace(" | ", "\n"));
        hashes.push(pixel_hash(&average(&scene(&text)).beauty));
    }
    assert!(hashes.iter().all(|hash| *hash != plain));
    let found: Vec<(&str, &str)> = RULES
        .iter()
        .map(|(rule, _)| *rule)
        .zip(hashes.iter().map(String::as_str))
        .collect();
    assert_eq!(found, RULES);
}
