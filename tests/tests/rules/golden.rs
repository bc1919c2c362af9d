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
        "b22f14497154525bc7b068673bf5266b8741b93e8d54f434995eaf6e837b8d8c",
    ),
    (
        r#"rays = ["camera"] | include = ["floor", "mirror", "box"]"#,
        "75d4edd9f818b3ef233f024e006c9fd0214694835577385c214fa6990c369933",
    ),
    (
        r#"on = ["mirror", "ball"] | rays = ["reflected"] | exclude = ["glass", "lamp"]"#,
        "25c47764d0ef76cb3459d3d92025dcb4ab3b134910c8bda300467533faaec69f",
    ),
    (
        r#"on = ["mirror"] | rays = ["reflected"] | include = ["ball"]"#,
        "498fda13a91a1920e9950dbe5be529ca3271218edc306e4d61e6d5066a5a99e2",
    ),
    (
        r#"on = ["glass"] | rays = ["refracted"] | exclude = ["floor"]"#,
        "7a81f176f36f13e9734918410563d7ecc1dd1b2020a4358650a72309eb5e58ca",
    ),
    (
        r#"rays = ["refracted"] | include = ["glass", "mirror"]"#,
        "95b69801526e4ba5cea642ae29d9a3979dcc5f31f2314e09d1c3951060fb72b4",
    ),
    (
        r#"on = ["floor"] | rays = ["shadow"] | exclude = ["lamp", "ball"]"#,
        "dd83b4b310670e8df289a53e143e57d055b48c28d83b2091d10ae66ded7c1481",
    ),
    (
        r#"on = ["ball"] | rays = ["shadow"] | include = ["spot"]"#,
        "af79e1f3b229a9717aa1a8416cc06e9a37a31e60a7218d301618d280e42a9b36",
    ),
    (
        r#"on = ["floor", "box", "spot"] | rays = ["photon"] | exclude = ["glass", "spot"]"#,
        "287583cb05bb1079f06f8be8e08a8bffbd9910383bc27e6cf9b212a7b411cf2d",
    ),
    (
        r#"on = ["spot", "glass", "floor"] | rays = ["photon"] | include = ["glass", "lamp"]"#,
        "1962626eeba8a716fa13dfb8c8491fca220fddb60b5257e2d76ce771669b073e",
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
