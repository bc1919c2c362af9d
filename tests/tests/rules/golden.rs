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
        "dabda76c2675fdc20507ca1293373420647e2860142ffd57ef51c55b124871a9",
    ),
    (
        r#"rays = ["camera"] | include = ["floor", "mirror", "box"]"#,
        "9d6a3db63cbf9ffacf31dadfa9b94eb7376cd8780cab629fed635fe06791cb07",
    ),
    (
        r#"on = ["mirror", "ball"] | rays = ["reflected"] | exclude = ["glass", "lamp"]"#,
        "cbeb6a58c649bd1f02d43cc840248b789b05e503cf033bbb8ac0bca842561387",
    ),
    (
        r#"on = ["mirror"] | rays = ["reflected"] | include = ["ball"]"#,
        "6529c680d5c8bcb2fe277220e877daa43d533cce914474068e5c08dcefca892b",
    ),
    (
        r#"on = ["glass"] | rays = ["refracted"] | exclude = ["floor"]"#,
        "5dfeb61d2ab0a84d8480eef36f5617bf2b11191418e2224059a42b609308d9f9",
    ),
    (
        r#"rays = ["refracted"] | include = ["glass", "mirror"]"#,
        "a42e9bcd3bbc0f11131e4ad1511db948eb43463dc86d26bc488659ef0660a1ef",
    ),
    (
        r#"on = ["floor"] | rays = ["shadow"] | exclude = ["lamp", "ball"]"#,
        "c27f69ed46964f54769b53cee607728b57dd9fec2b8efc31aa83c0122f52d9cb",
    ),
    (
        r#"on = ["ball"] | rays = ["shadow"] | include = ["spot"]"#,
        "8be8b62a7e0dc9ea7747887b880130cd1f3f988dd8cc5a82dd218cc2d69462d4",
    ),
    (
        r#"on = ["floor", "box", "spot"] | rays = ["photon"] | exclude = ["glass", "spot"]"#,
        "68454846da80ff221aa42e2113600665f4d6081eb6a8ad9c26d40ea061ce959c",
    ),
    (
        r#"on = ["spot", "glass", "floor"] | rays = ["photon"] | include = ["glass", "lamp"]"#,
        "9d9a828a5bfd110f0ec09bafea4f7570d6f6197b6b222050602fc980b0c63b08",
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
