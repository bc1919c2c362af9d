//! Panoramas: passes against the path tracer, for every technique.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks_by, blur, is_long, reference_images, scene};
use beamfarm_image::job::{ReferenceSettings, Technique, Techniques};

/// A room of fog with a lamp, a glass ball next to the camera, and behind the camera a ball with a light in it.
fn room(camera: &str, [width, height]: [u32; 2]) -> String {
    format!(
        r#"
[image]
width = {width}
height = {height}
[render]
passes = 800
paths = 3000
radius = 0.05
[camera]
origin = [0.1, 0.0, 0.1]
target = [0.4, 0.1, -0.9]
{camera}
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.8, 0.6, 0.4]
phase = {{ type = "hg", g = 0.3 }}
[materials.wall]
type = "diffuse"
reflectance = [0.6, 0.5, 0.4]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.4, -0.5, -0.4]
radius = 0.3
material = "glass"
exterior = "fog"
interior = "fog"
[[shapes]]
type = "sphere"
center = [0.0, 0.2, 0.8]
radius = 0.1
material = "wall"
emission = {{ radiance = [2, 3, 5] }}
[[shapes]]
type = "rectangle"
transform = [{{ scale = 0.3 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [-0.3, 0.98, -0.3] }}]
emission = {{ radiance = [9, 8, 6] }}
"#
    )
}

const PHOTONS: Option<Technique> = Some(Technique::Photons);
const PATHS: Option<Technique> = Some(Technique::Paths);

#[test]
fn panoramas_have_the_light_of_the_path_tracer() {
    let mut suite = Suite::new(1e-2);
    for (camera, size) in [
        ("projection = \"equirectangular\"", [32, 16]),
        ("projection = \"fisheye\"\nmapping = \"equisolid\"\nfov = 250", [24, 24]),
        ("projection = \"cylindrical\"\nfov = 300", [32, 8]),
    ] {
        let scene = scene(&room(camera, size));
        let settings = ReferenceSettings {
            seed: 5,
            max_depth: None,
        };
        let truth = Blocks::new(
            reference_images(&scene, settings, if is_long() { 480 } else { 240 }, 8),
            8,
        );
        for (seed, [media, surfaces, caustics]) in (0..).zip([[PHOTONS; 3], [PATHS, PATHS, None]]) {
            let techniques = Techniques {
                media,
                surfaces,
                caustics,
                aimed: None,
            };
            let found = blocks_by(&scene, techniques, seed, 8);
            suite.same_blocks(&format!("{camera}, {techniques}"), &found, &truth, 5e-3);
            assert!(
                found.noise(&truth) < 0.03 * blur(),
                "{camera}, {techniques}: {}",
                found.noise(&truth)
            );
        }
    }
    suite.finish();
}
