//! A small picture for each type of ray and each way of listing: see `golden.rs` beside this folder.

use beamfarm_harness::render::{average, scene};
use beamfarm_image::exr::pixel_hash;

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
        "572cd084e7e9def79f3476a7dd0f06456a0588efbff744f5f50301c746ea9fa6",
    ),
    (
        r#"rays = ["camera"] | include = ["floor", "mirror", "box"]"#,
        "8d29e7aaf88dfeab62cfb0a45abff9ebeb7d724262c5a2b3410719912b253696",
    ),
    (
        r#"on = ["mirror", "ball"] | rays = ["reflected"] | exclude = ["glass", "lamp"]"#,
        "b9975c4f4f58951990f8b8da6a666004085ada3e776e7cb3b3faba44cbfb71ef",
    ),
    (
        r#"on = ["mirror"] | rays = ["reflected"] | include = ["ball"]"#,
        "17b8be1bc463bb01e2c8fc8e7cba6a0c8b54fd811dae08b38d02c5660449819d",
    ),
    (
        r#"on = ["glass"] | rays = ["refracted"] | exclude = ["floor"]"#,
        "2463e28c8a01847202c83d26b657bb98cb535dd4ced63d3b5ec52382360d480d",
    ),
    (
        r#"rays = ["refracted"] | include = ["glass", "mirror"]"#,
        "588a48395c8ed2eb3b2e8bedf90331707fdf1b6df732501364930a215fc8b6d4",
    ),
    (
        r#"on = ["floor"] | rays = ["shadow"] | exclude = ["lamp", "ball"]"#,
        "4b059b74c3e09138b9783aceaa7d1b42dff7c34897e7e272205249fc260da1fb",
    ),
    (
        r#"on = ["ball"] | rays = ["shadow"] | include = ["spot"]"#,
        "5945016e49e545452b8fc23276d2b676da5244be55e473904b51c2d31c835497",
    ),
    (
        r#"on = ["floor", "box", "spot"] | rays = ["photon"] | exclude = ["glass", "spot"]"#,
        "c46f9888110dda939f669b03541bd8b0496e3cc8767d2ade3322d13160f216e1",
    ),
    (
        r#"on = ["spot", "glass", "floor"] | rays = ["photon"] | include = ["glass", "lamp"]"#,
        "3ddcde5d413b7b5bacc5ba1d88d561a00c67fe3721c7ee88e1d7fa4ced30a055",
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
