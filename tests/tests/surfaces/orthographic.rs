//! The orthographic camera: where its rays are, and that its picture is that of the path tracer and of a very distant
//! camera.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, blocks_by, blur, images, is_long, plan_of, reference_images, scene};
use beamfarm_image::film::Film;
use beamfarm_image::job::{ReferenceSettings, Technique, Techniques};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::Scene;
use beamfarm_render::world::camera::{Camera, Projection};

fn loaded(image: &str, camera: &str) -> Camera {
    let text = format!(
        "image = {{ width = 40, height = 20{image} }}
        camera = {{ origin = [1, 2, 3], target = [1, 2, -1], projection = \"orthographic\", view_width = 4{camera} }}"
    );
    scene(&text).description().camera
}

/// Rays start on the camera's plane, which spans four units from the left of the image to the right, and go forward.
#[test]
fn rays_are_parallel_and_pixels_square() {
    for (image, camera, corner, middle) in [
        ("", "", [-2.0, 1.0], [0.0, 0.0]),
        ("", ", flip_x = true", [2.0, 1.0], [0.0, 0.0]),
        ("", ", principal_point = [0.1, 0.2]", [-1.6, 0.6], [0.4, -0.4]),
        (
            ", crop = { x = 10, y = 5, width = 20, height = 10 }",
            "",
            [-1.0, 0.5],
            [0.0, 0.0],
        ),
        (
            ", crop = { x = 30, width = 10, height = 4 }",
            "",
            [1.0, 1.0],
            [1.5, 0.8],
        ),
    ] {
        let camera = loaded(image, camera);
        let size = Vec2::new(camera.width as f32, camera.height as f32);
        for (at, expected) in [(0.0, corner), (0.5, middle)] {
            let ray = camera.ray(size * at, Vec2::new(0.1, 0.9));
            assert_eq!(ray.dir, Vec3::NEG_Z);
            let off = ray.origin - Vec3::from((Vec2::from(expected), 0.0));
            assert!(off.length() < 1e-6, "{image} {camera:?} at {at}: {}", ray.origin);
        }
    }
}

/// All rays of an image point meet in one point of the focal plane, the one straight ahead.
#[test]
fn points_in_focus_are_sharp() {
    let camera = loaded("", ", aperture = 0.4, focus_distance = 2.5");
    let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
    for _ in 0..200 {
        let image = rng.next_2d() * Vec2::new(40.0, 20.0);
        let sharp = Camera {
            aperture: 0.0,
            ..camera
        }
        .ray(image, Vec2::ZERO)
        .at(2.5);
        for _ in 0..10 {
            let ray = camera.ray(image, rng.next_2d());
            let on_lens = ray.origin - Vec3::Z * 2.5 - sharp;
            assert!(on_lens.z.abs() < 1e-6 && on_lens.length() <= 0.4 + 1e-6);
            assert!((ray.at(2.5 / -ray.dir.z) - sharp).length() < 1e-5);
        }
    }
}

/// A floor seen from above at 30 degrees: each pixel shows the square that its ray meets, computed by hand.
#[test]
fn a_floor_shows_its_squares_where_they_are() {
    let scene = scene(
        r#"
[image]
width = 32
height = 16
[camera]
origin = [0, 4, 6.9282032]
target = [0, 0, 0]
projection = "orthographic"
view_width = 8
[materials.squares]
type = "diffuse"
reflectance = { checkerboard = [1.0, 0.0], uv = [{ scale = [10, 10, 1] }] }
[[shapes]]
type = "rectangle"
material = "squares"
transform = [{ scale = 10 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[lights]]
type = "environment"
radiance = 1.0
"#,
    );
    let images = reference_images(
        &scene,
        ReferenceSettings {
            seed: 1,
            max_depth: None,
        },
        1,
        16,
    );
    let film: Film = images.last().unwrap();
    let (mut white, mut black) = (0, 0);
    for y in 0..16 {
        for x in 0..32 {
            // A pixel is a quarter of a unit; a step up in the image is two on the floor, away from the camera.
            let side = |x: usize, y: usize| {
                let place = [0.25 * (x as f64 - 16.0), -2.0 * 0.25 * (8.0 - y as f64)];
                // Four squares, one unit wide, meet at the floor's middle.
                place.map(|along| along.floor() as i64)
            };
            let (low, high) = (side(x, y), [x + 1, y + 1]);
            let inner = side(high[0], high[1]);
            let is_cut = [0, 1].iter().any(|&i| inner[i] != low[i] && !is_edge(high[i], i));
            assert!(!is_cut, "squares are whole pixels");
            // Seen from above, v grows away from the camera, against y of the image.
            let is_white = (low[0] + low[1]).rem_euclid(2) == 1;
            let value = film.pixels[y * 32 + x][0];
            let expected = if is_white { 1.0 } else { 0.0 };
            assert!(
                (f64::from(value) - expected).abs() < 0.2,
                "{x}, {y}: {value}, not {expected}"
            );
            if is_white { white += 1 } else { black += 1 }
        }
    }
    assert_eq!(white, black);
}

/// Whether a pixel's far side is a square's side: every four columns, every two rows.
fn is_edge(at: usize, axis: usize) -> bool {
    at.is_multiple_of([4, 2][axis])
}

/// A ball of glass in a box of fog on a floor, in front of a wall: caustics on both.
const STAGE: &str = r#"
[render]
passes = PASSES
paths = 6000
radius = 0.03
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.2, 0.3]
sigma_s = [0.9, 0.7, 0.5]
phase = { type = "hg", g = 0.4 }
[materials.red]
type = "diffuse"
reflectance = [0.7, 0.3, 0.2]
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.edge]
type = "null"
[[shapes]]
type = "rectangle"
material = "red"
transform = [{ scale = 2 }, { rotate = { axis = [1, 0, 0], angle = -90 } }, { translate = [0, -0.81, 0] }]
[[shapes]]
type = "rectangle"
material = "red"
transform = [{ scale = 2 }, { translate = [0, 0, -1.1] }]
[[shapes]]
type = "cube"
material = "edge"
interior = "fog"
transform = [{ scale = 0.8 }]
[[shapes]]
type = "sphere"
center = [0.1, -0.3, 0.0]
radius = 0.35
material = "glass"
exterior = "fog"
[[shapes]]
type = "sphere"
center = [-0.2, 0.55, 0.2]
radius = 0.2
emission = { radiance = [6.0, 5.0, 4.0] }
"#;

fn stage(camera: &str, image: &str, passes: u64) -> Scene {
    let stage = STAGE.replace("PASSES", &passes.to_string());
    scene(&format!("image = {{ {image} }}\ncamera = {{ {camera} }}\n{stage}"))
}

const ALL: &str = "width = 32, height = 32";
const EYE: &str = "target = [0, -0.1, 0], projection = \"orthographic\", view_width = 2.4";

fn by(scene: &Scene, media: Technique, seed: u64) -> Blocks {
    let techniques = Techniques {
        media: Some(media),
        ..scene.description().defaults.techniques
    };
    blocks_by(scene, techniques, seed, 8)
}

/// The path tracer's picture, and that of a camera 500 units away, for which the whole stage has the same scale within
/// four thousandths. The camera's plane lies in front of the stage, or cuts through the fog and the ball, where it is
/// much wider than far away. Significance 1e-2 for all blocks together.
#[test]
fn the_picture_is_that_of_the_path_tracer_and_of_a_camera_far_away() {
    let mut suite = Suite::new(1e-2);
    let settings = ReferenceSettings {
        seed: 5,
        max_depth: None,
    };
    let far = stage(
        "target = [0, -0.1, 0], origin = [150, 124.9, 460.298816], fov = 0.27501924",
        ALL,
        300,
    );
    for (name, eye) in [
        ("before it", "origin = [0.9, 0.65, 2.7617929]"),
        ("within it", "origin = [0.03, -0.075, 0.09205976]"),
    ] {
        let scene = stage(&format!("{eye}, {EYE}"), ALL, 300);
        assert_eq!(scene.description().camera.projection, Projection::Orthographic);
        let truth = Blocks::new(
            reference_images(&scene, settings, if is_long() { 200 } else { 48 }, 8),
            8,
        );
        for (seed, technique) in (0..).zip([Technique::Photons, Technique::Paths]) {
            // The two cameras differ only in which beams are near.
            if technique == Technique::Paths && !is_long() {
                continue;
            }
            let found = by(&scene, technique, seed);
            suite.same_blocks(&format!("{name}, {technique:?}"), &found, &truth, 5e-3);
            assert!(found.noise(&truth) < 0.02 * blur(), "{name}: {}", found.noise(&truth));
        }
        if name == "before it" {
            let found = by(&far, Technique::Photons, 7);
            suite.same_blocks("far away", &found, &truth, 8e-3);
            assert!(found.noise(&truth) < 0.02 * blur(), "{}", found.noise(&truth));
        }
    }
    suite.finish();
}

/// A window of the image is that part of the image. Significance 1e-2 for all blocks.
#[test]
fn a_window_is_a_part_of_the_picture() {
    let camera = format!("origin = [0.9, 0.65, 2.7617929], {EYE}, aperture = 0.05, focus_distance = 2.5");
    let whole = stage(&camera, ALL, 200);
    let plan = plan_of(&whole);
    let cut = |whole: Film| {
        let mut film = Film::new(16, 8);
        for (y, row) in film.pixels.chunks_exact_mut(16).enumerate() {
            row.copy_from_slice(&whole.pixels[(16 + y) * 32 + 8..][..16]);
        }
        film
    };
    let picked = Blocks::new(
        (0..images(200)).map(|i| cut(render_pass(&whole, &plan, i).expect("a pass").film)),
        8,
    );
    let window = stage(
        &camera,
        "width = 32, height = 32, crop = { x = 8, y = 16, width = 16, height = 8 }",
        200,
    );
    let part = blocks(&window, 8);
    let mut suite = Suite::new(1e-2);
    suite.same_blocks("window", &part, &picked, 5e-3);
    suite.finish();
}
