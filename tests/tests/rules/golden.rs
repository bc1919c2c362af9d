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
        "ee2e6fdbb569d4fee94555ac39b5710fb22cb4903961d71a463065602e69add0",
    ),
    (
        r#"rays = ["camera"] | include = ["floor", "mirror", "box"]"#,
        "7161c2dd3e16ce9a40dc80e3206687c9d1d517add9f526cb3d1446a332614dd6",
    ),
    (
        r#"on = ["mirror", "ball"] | rays = ["reflected"] | exclude = ["glass", "lamp"]"#,
        "d3ef302b00fbc4444dbc51c853d47fdba92a60f4351d2dc029f2089c9f3123f3",
    ),
    (
        r#"on = ["mirror"] | rays = ["reflected"] | include = ["ball"]"#,
        "0f3fc7d8f4f7938bdf46e59ac64b1b5a5dcdea8f60644ec2958bf8ff74c6fa9d",
    ),
    (
        r#"on = ["glass"] | rays = ["refracted"] | exclude = ["floor"]"#,
        "8c7ff0ad811e3af9f7fb290e34e62b41c6673903a70135963fd780995c8953d0",
    ),
    (
        r#"rays = ["refracted"] | include = ["glass", "mirror"]"#,
        "66257d6c91775b27f3fafd9b5a08b5ac418d542f4eb6dfb00d7ead0786aba906",
    ),
    (
        r#"on = ["floor"] | rays = ["shadow"] | exclude = ["lamp", "ball"]"#,
        "e2e5cd62e3dbedcdf8ce79bfeadaf9a3b396ab077344af333a3ab1904fa2b648",
    ),
    (
        r#"on = ["ball"] | rays = ["shadow"] | include = ["spot"]"#,
        "eb1e5e0c6640ee2f4bd6125cc9c8c2568d16d4150aeb4055d567ee241b05b74b",
    ),
    (
        r#"on = ["floor", "box", "spot"] | rays = ["photon"] | exclude = ["glass", "spot"]"#,
        "0e7a53ae80dc5e866ec538887edc355ba0c09fd084bb8e202b9859827acec7f1",
    ),
    (
        r#"on = ["spot", "glass", "floor"] | rays = ["photon"] | include = ["glass", "lamp"]"#,
        "d53c41622b6a5bf782c0dbf576e7c03c8992effef41da35c2cdb598350747794",
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
