//! Vertex colours of meshes: interpolated over triangles, multiplied by images, reflected and emitted.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, blur, reference_images, scene_with};
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::world::Scene;

/// The square [-1, 1]^2 in the xy plane. Its colours are (x + 1) / 2, (y + 1) / 4 and 1/4, the same in both triangles.
const SQUARE: &[u8] =
    b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float u\nproperty float v\nproperty float red\nproperty float green\nproperty float blue\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n\
    -1 -1 0 0 0 0 0 0.25\n1 -1 0 1 0 1 0 0.25\n1 1 0 1 1 1 0.5 0.25\n-1 1 0 0 1 0 0.5 0.25\n4 0 1 2 3\n";

fn square(what: &str) -> Scene {
    let text = format!(
        r#"
[image]
width = 8
height = 8
[render]
passes = 200
[camera]
origin = [0, 0, 1]
target = [0, 0, 0]
projection = "orthographic"
view_width = 2
[[lights]]
type = "environment"
radiance = 1.0
[[shapes]]
type = "mesh"
file = "square.ply"
{what}
"#
    );
    scene_with(&text, &[("square.ply", SQUARE)])
}

/// A channel's mean over a block of 4 x 4 pixels, a quarter of the square.
fn expected(block: usize, channel: usize) -> f64 {
    let (x, y) = ([-0.5, 0.5][block % 2], [0.5, -0.5][block / 2]);
    [0.5 * (x + 1.0), 0.25 * (y + 1.0), 0.25][channel]
}

/// The picture of the square [-1, 1]^2 with colours (x + 1) / 2, (y + 1) / 4 and 1/4, times `by`.
pub(super) fn check(name: &str, found: &Blocks, by: [f64; 3], suite: &mut Suite) {
    for (i, block) in found.blocks.iter().enumerate() {
        for (channel, mean) in block.iter().enumerate() {
            // In an even sky of 1 a surface's radiance is its reflectance.
            let expected = expected(i, channel) * by[channel];
            suite.mean_within(format!("{name}, {i}, {channel}"), mean, expected, 1e-5);
            assert!(
                mean.std_error() < 0.04 * blur() * expected,
                "{name}: {}",
                mean.std_error()
            );
        }
    }
}

/// By passes and by the path tracer: as reflectance, in a blend, where the mesh stands itself and where it is one of
/// several instances.
#[test]
fn a_square_reflects_what_its_vertices_say() {
    let mut suite = Suite::new(1e-2);
    let colored = "[materials.colored]\ntype = \"diffuse\"\nreflectance = { attribute = \"color\" }\n";
    let own = square(&format!("material = \"colored\"\n{colored}"));
    check("diffuse", &blocks(&own, 4), [1.0; 3], &mut suite);
    let settings = ReferenceSettings {
        seed: 2,
        max_depth: None,
    };
    let reference = Blocks::new(reference_images(&own, settings, 40, 8), 4);
    check("reference", &reference, [1.0; 3], &mut suite);
    let blend = format!(
        "material = \"half\"\n[materials.half]\ntype = \"blend\"\nmaterials = [\"black\", \"colored\"]\nweight = 0.5\n\
         [materials.black]\ntype = \"diffuse\"\nreflectance = 0\n{colored}"
    );
    check("blend", &blocks(&square(&blend), 4), [0.5; 3], &mut suite);
    suite.finish();
}

/// Normal maps follow v on both halves of mirrored UVs, as the tangents of glTF and Blender do.
#[test]
fn normal_maps_of_mirrored_uv() {
    let mirrored = String::from_utf8(SQUARE.to_vec()).expect("text");
    let mirrored = mirrored
        .replace("-1 -1 0 0 0", "-1 -1 0 1 0")
        .replace("1 -1 0 1 0 1", "1 -1 0 0 0 1")
        .replace("1 1 0 1 1", "1 1 0 0 1")
        .replace("-1 1 0 0 1", "-1 1 0 1 1");
    for (bytes, along_u) in [(SQUARE, 1.0), (mirrored.as_bytes(), -1.0)] {
        let color = "[0.65, 0.75, 0.9]";
        let text = format!(
            "image = {{ width = 8, height = 8 }}\ncamera = {{ origin = [0, 0, 1], target = [0, 0, 0], fov = 40 }}\n\
             [[lights]]\ntype = \"environment\"\nradiance = 1.0\n[[shapes]]\ntype = \"mesh\"\nfile = \"square.ply\"\n\
             material = \"m\"\n[materials.m]\ntype = \"diffuse\"\ntwo_sided = true\n\
             normal_map = {{ checkerboard = [{color}, {color}] }}\n"
        );
        let scene = scene_with(&text, &[("square.ply", bytes)]);
        // From the camera, looking down at the middle.
        let ray = Ray {
            origin: scene.description().camera.position + Vec3::new(0.3, 0.2, 0.0),
            dir: Vec3::NEG_Z,
        };
        let mut hit = scene.first_hit(&ray, |_| false).expect("the square");
        let material = scene.material(&hit);
        let _ = scene.interaction(material, &mut hit, ray.dir, None);
        let expected = Vec3::new(0.3 * along_u, 0.5, 0.8).normalize();
        assert!((hit.ns - expected).length() < 1e-4, "{along_u}: {} {expected}", hit.ns);
    }
}

/// The emitted light is that of the vertices times `scale`.
#[test]
fn a_square_emits_what_its_vertices_say() {
    let glowing = square("emission = { radiance = { attribute = \"color\" }, scale = [2, 3, 4] }");
    assert_eq!(glowing.description().lights.len(), 2);
    let mut suite = Suite::new(1e-2);
    check("emission", &blocks(&glowing, 4), [2.0, 3.0, 4.0], &mut suite);
    // A graph may use them too, even if the material itself does not.
    let graph = "emission = { radiance = { texture = \"brighter\" } }\n[textures.brighter]\nnode = \"vector_math\"\n\
                 operation = \"multiply\"\na = { attribute = \"color\" }\nb = [2, 3, 4]";
    let glowing = square(graph);
    assert_eq!(glowing.description().lights.len(), 2);
    check("a graph", &blocks(&glowing, 4), [2.0, 3.0, 4.0], &mut suite);
    suite.finish();
}
