//! Hashes of small images. They change when the renderer computes something else: then look at the pictures, check the
//! tests of estimators, and commit the new hashes with a message that says why. They never change with the machine, the
//! number of threads, or the build. Those of pictures with visibility rules are in `rules/golden.rs`.

use crate::rules::golden::RULES;
use beamfarm_harness::render::{average, plan_of, scene, with_threads};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::job::EngineKind;
use beamfarm_proto::FileHash;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::estimators::Caustics;

const FOG_HASH: &str = "57ee5f97b60be6c387cf4d42b1d9e229e67b670a4671ee72ed5f17170835e4eb";
const SMOKE_HASH: &str = "fe8e53942e846d565cb420b899b2e4e77f8288b82a19c2c1ec196187146c847b";
const SURFACES_HASH: &str = "fd8ff2cff4ed3ead6b6f6adf88d6d540c81b735da763af8c248777ce8a6348ae";
const LAMPS_HASH: &str = "8af16d14e5d1558e1d4e664ce3b671b7f5d4575b900560be0c0fbe5ef51cc3fc";

/// The number of the current bits, and a hash of all hashes.
const NUMBERED: (&str, &str) = (
    "cpu 6",
    "c92cda1d97a0dbe6f8e4550f28bb7cbe57fd7b737ecdc2c2a7800cd62ae12eae",
);

const FOG: &str = r#"
[image]
width = 37
height = 29
[render]
passes = 5
paths = 700
seed = 42
[world]
medium = "fog"
[camera]
origin = [0.1, 0.3, 2.8]
target = [0.0, 0.0, 0.0]
fov = 45.0
aperture = 0.02
[media.fog]
type = "homogeneous"
sigma_a = [0.05, 0.1, 0.2]
sigma_s = [0.4, 0.3, 0.2]
phase = { type = "hg", g = 0.6 }
[media.amber]
type = "homogeneous"
sigma_t = [0.5, 1.0, 4.0]
albedo = 0.8
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.steel]
type = "rough_conductor"
alpha = 0.2
preset = "chromium"
[[shapes]]
type = "cube"
flip_normals = true
transform = [{ scale = 3.0 }]
[[shapes]]
type = "sphere"
center = [-0.5, 0.0, 0.0]
radius = 0.5
material = "glass"
interior = "amber"
[[shapes]]
type = "disc"
material = "steel"
transform = [{ rotate = { axis = [1, 0, 0], angle = -80 } }, { translate = [0.4, -0.6, 0.0] }]
[[lights]]
type = "spot"
position = [-1.0, 2.0, 0.5]
target = [-0.4, 0.0, 0.0]
intensity = 20.0
[[shapes]]
type = "sphere"
center = [1.0, 1.0, -0.5]
radius = 0.1
emission = { power = [5, 4, 3] }
"#;

const SMOKE: &str = r#"
[image]
width = 36
height = 26
[render]
passes = 4
paths = 600
seed = 43
[camera]
origin = [0.1, 0.6, 3.4]
target = [0.0, 0.4, 0.0]
fov = 45.0
[media.smoke]
type = "heterogeneous"
sigma_a = [0.2, 0.4, 0.3]
sigma_s = [2.0, 1.5, 1.0]
phase = { type = "hg", g = 0.4 }
[media.smoke.density]
min = [-1.2, 0, -1.2]
max = [1.2, 1.6, 1.2]
voxel = 0.08
height = { scale = 0.9 }
blobs = [{ center = [0, 0.5, 0], radius = 0.5, density = 2 }]
noise = { size = 0.6, contrast = 3 }
[media.veil]
type = "heterogeneous"
sigma_a = 0.0
sigma_s = 0.4
transmittance = "ratio_tracking"
density = { min = [0.6, 0.7, -0.3], max = [1.1, 1.3, 0.3], noise = { size = 0.3 } }
[materials.boundary]
type = "null"
[[shapes]]
type = "rectangle"
transform = [{ scale = 3.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "cube"
material = "boundary"
interior = "smoke"
transform = [{ scale = [1.2, 0.8, 1.2] }, { translate = [0, 0.801, 0] }]
[[shapes]]
type = "sphere"
center = [0.85, 1.0, 0.0]
radius = 0.25
material = "boundary"
interior = "veil"
exterior = "smoke"
[[lights]]
type = "spot"
position = [-1.5, 2.5, 0.8]
target = [0.0, 0.3, 0.0]
intensity = 30.0
[[lights]]
type = "environment"
radiance = [0.05, 0.06, 0.08]
"#;

const SURFACES: &str = r#"
[image]
width = 40
height = 24
[render]
passes = 5
paths = 500
seed = 7
schedule = "beam"
[camera]
origin = [0.0, 1.0, 4.0]
target = [0.0, 0.3, 0.0]
fov = 40.0
[materials.frosted]
type = "rough_dielectric"
ior = 1.5
alpha = 0.15
[materials.gold]
type = "conductor"
preset = "gold"
[[shapes]]
type = "rectangle"
transform = [{ scale = 4.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "sphere"
center = [-0.6, 0.5, 0.0]
radius = 0.5
material = "frosted"
[[shapes]]
type = "sphere"
center = [0.7, 0.5, 0.0]
radius = 0.5
material = "gold"
[[lights]]
type = "directional"
direction = [0.3, -1.0, -0.4]
irradiance = 2.0
[[lights]]
type = "environment"
radiance = [0.2, 0.3, 0.5]
"#;

/// A lamp whose caustics photons and camera paths share, and one whose caustics come by photons alone.
const LAMPS: &str = r#"
[image]
width = 40
height = 24
[render]
passes = 5
paths = 500
seed = 3
[camera]
origin = [0.0, 1.0, 4.0]
target = [0.0, 0.5, 0.0]
fov = 40.0
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.silver]
type = "rough_conductor"
alpha = 0.05
preset = "silver"
[[shapes]]
type = "rectangle"
transform = [{ scale = 4.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "sphere"
center = [-0.6, 0.5, 0.0]
radius = 0.5
material = "glass"
[[shapes]]
type = "sphere"
center = [0.7, 0.5, 0.0]
radius = 0.5
material = "silver"
[[shapes]]
type = "sphere"
center = [0.0, 2.0, 1.0]
radius = 0.5
emission = { radiance = [3.0, 2.0, 1.0] }
[[lights]]
type = "point"
position = [2.0, 2.0, 0.0]
intensity = [0.5, 1.0, 1.5]
"#;

/// A job may resume only where its passes' bits have the same number; the number grows whenever one of the hashes
/// changes.
#[test]
fn bits_have_a_number() {
    let rules = RULES.iter().map(|(_, hash)| *hash);
    let all: Vec<&str> = [FOG_HASH, SMOKE_HASH, SURFACES_HASH, LAMPS_HASH]
        .into_iter()
        .chain(rules)
        .collect();
    let found = FileHash::of(all.concat().as_bytes()).to_string();
    assert_eq!(
        (&*EngineKind::Cpu.identity(), &*found),
        NUMBERED,
        "passes have other bits: raise the number in `EngineKind`, keep a job folder of it in tests/data/versions/jobs, and \
         name both here"
    );
}

#[test]
fn hashes_of_small_images() {
    let hash = |toml| pixel_hash(&average(&scene(toml)).beauty);
    let lamps = scene(LAMPS);
    let plan = plan_of(&lamps);
    assert_eq!(
        [0, 1].map(|light| plan.estimators.caustics_of(light)),
        [Caustics::Photons, Caustics::Shared]
    );
    assert_eq!(
        [
            ("fog", hash(FOG)),
            ("smoke", hash(SMOKE)),
            ("surfaces", hash(SURFACES)),
            ("lamps", hash(LAMPS))
        ],
        [
            ("fog", FOG_HASH.into()),
            ("smoke", SMOKE_HASH.into()),
            ("surfaces", SURFACES_HASH.into()),
            ("lamps", LAMPS_HASH.into())
        ]
    );
}

#[test]
fn the_number_of_threads_changes_nothing() {
    for toml in [FOG, SMOKE, SURFACES, LAMPS] {
        let scene = scene(toml);
        let plan = plan_of(&scene);
        let hashes: Vec<String> = [1, 2, 3, 8]
            .into_iter()
            .map(|threads| with_threads(threads, || render_pass(&scene, &plan, 3).expect("a pass")))
            .map(|image| pixel_hash(&image.film))
            .collect();
        assert!(hashes.iter().all(|h| *h == hashes[0]), "{hashes:?}");
    }
}
