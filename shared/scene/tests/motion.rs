//! Passes of scenes in which things move, against what blur is by hand and against the path tracer.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_image::layer::Layer;
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::cpu::reference::render_sample;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

fn scene(text: &str) -> Scene {
    scene_with(text, &[])
}

fn scene_with(text: &str, files: &[(&str, &str)]) -> Scene {
    let description = beamfarm_scene::load(&bundle(text, files));
    Scene::new(description.unwrap_or_else(|error| panic!("{error}")))
}

fn bundle(text: &str, files: &[(&str, &str)]) -> Bundle {
    let files = files.iter().copied().chain([("moving.toml", text)]);
    Bundle {
        scene: "moving.toml".into(),
        files: files.map(|(name, bytes)| (name.into(), bytes.into())).collect(),
    }
}

fn average(scene: &Scene, passes: u64) -> Average {
    let plan = RenderPlan::new(scene, scene.description().defaults.job_settings());
    let camera = &scene.description().camera;
    let mut sum = TreeSum::new(camera.width, camera.height);
    for pass_index in 0..passes {
        let pass = render_pass(scene, &plan, pass_index).expect("a pass");
        assert_eq!(pass.stats.non_finite, 0);
        sum.insert(Node::leaf(pass_index, pass.film)).unwrap();
    }
    sum.average().unwrap()
}

/// A card that shines moves by four pixels while the shutter is open: each pixel shows it for the time that it is
/// there. Within six of the standard errors that the image has, which tests them as well: fifteen degrees of freedom,
/// so that one of 48 pixels is beyond them with a probability of a tenth of a percent.
#[test]
fn a_moving_edge_is_a_ramp() {
    let text = "\
[image]
width = 16
height = 3
[animation]
frames = [1, 10]
frame = 2
shutter = [0, 0.5]
[camera]
origin = [8, 1.5, 10]
target = [8, 1.5, 0]
fov = 77.31961650818018
[[shapes]]
type = \"rectangle\"
emission = { radiance = [1, 2, 3] }
transform = [{ scale = [2, 4, 1] }, { translate = { keys = [[0, [-12, 0, 0]], [10, [68, 0, 0]]] } }]
";
    // 16 pixels are 16 units wide at the card; it is from x - 2 to x + 2, and x goes from 4 to 8 in half a frame.
    let scene = scene(text);
    let motion = scene.description().motion.as_ref().unwrap();
    assert_eq!(motion.shutter(), [2.0, 2.5]);
    const PASSES: u64 = 256;
    let image = average(&scene, PASSES);
    let (mut squares, mut variances) = (0.0, 0.0);
    for (i, pixel) in image.beauty.pixels.iter().enumerate() {
        let left = (i % 16) as f64;
        // Over places in the pixel and times: the card is there while its middle is within 2 of the place.
        let exposed = |place: f64| {
            let (from, to) = ((place - 2.0 - 4.0) / 4.0, (place + 2.0 - 4.0) / 4.0);
            (to.min(1.0) - from.max(0.0)).max(0.0)
        };
        let steps = 1000;
        let places = (0..steps).map(|step| exposed(left + (f64::from(step) + 0.5) / f64::from(steps)));
        let expected = places.sum::<f64>() / f64::from(steps);
        for (channel, radiance) in [1.0, 2.0, 3.0].into_iter().enumerate() {
            let error = f64::from(pixel[channel]) - radiance * expected;
            let sigma = f64::from(image.standard_error.pixels[i][channel]);
            assert!(error.abs() < 6.0 * sigma + 1e-5, "pixel {i}: {error} +- {sigma}");
            squares += (error / radiance) * (error / radiance);
            variances += (sigma / radiance) * (sigma / radiance);
        }
    }
    // The errors are what they are said to be, and smaller than those of times drawn at random, whose variance is that
    // of a coin's throws.
    let ratio = squares / variances;
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    assert!(libm::sqrt(variances / (16.0 * 9.0)) < 0.5 * libm::sqrt(0.25 / PASSES as f64));
}

const CAUSTIC: &str = "\
[image]
width = 24
height = 18
[animation]
frames = [1, 10]
shutter = [0, 1]
[render]
paths = 20000
[camera]
origin = { keys = [[1, [0, 3, 6]], [10, [3, 3, 6]]] }
target = [0, 0, 0]
fov = 40
[media.fog]
type = \"homogeneous\"
sigma_a = 0.02
sigma_s = 0.08
[materials.glass]
type = \"dielectric\"
ior = 1.5
[materials.floor]
type = \"diffuse\"
reflectance = 0.6
[[shapes]]
type = \"cube\"
material = \"air\"
interior = \"fog\"
transform = [{ scale = 8 }]
[materials.air]
type = \"null\"
[[shapes]]
type = \"sphere\"
radius = 0.8
material = \"glass\"
exterior = \"fog\"
transform = [{ translate = { keys = [[1, [-1, 1, 0]], [2, [1, 1, 0]], [10, [1, 1, 0]]] } }]
[[shapes]]
type = \"rectangle\"
material = \"floor\"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 6 }]
[[shapes]]
type = \"sphere\"
radius = 0.3
center = { keys = [[1, [0, 4, -1]], [2, [1, 4, 1]], [10, [1, 4, 1]]] }
emission = { radiance = { keys = [[1, 20], [2, [60, 40, 20]], [10, 20]] } }
";

/// The whole of it, caustics of moving lights through moving glass in fog seen by a moving camera: the means of blocks
/// within five standard errors of the difference, and a part for radii.
#[test]
fn passes_and_the_path_tracer_see_the_same_blur() {
    let scene = scene(CAUSTIC);
    let image = average(&scene, 96);
    let settings = ReferenceSettings::default();
    const SAMPLES: u64 = 1024;
    const SIDE: usize = 6;
    let blocks = |pixels: &[[f32; 3]]| {
        let mut sums = vec![0.0; 4 * 3];
        for (i, pixel) in pixels.iter().enumerate() {
            let (x, y) = (i % 24 / SIDE, i / 24 / SIDE);
            let value: f32 = pixel.iter().sum();
            sums[y * 4 + x] += f64::from(value) / (3 * SIDE * SIDE) as f64;
        }
        sums
    };
    let ours = blocks(&image.beauty.pixels);
    let errors = blocks(&image.standard_error.pixels);
    let mut sums = vec![[0.0; 2]; ours.len()];
    // Replications of the path tracer's turns are independent of each other.
    const TURNS: u64 = 16;
    for start in (0..SAMPLES).step_by(TURNS as usize) {
        let mut turn = vec![0.0; ours.len()];
        for sample in start..start + TURNS {
            let film = render_sample(&scene, &settings, sample, || true).unwrap();
            turn.iter_mut()
                .zip(blocks(&film.pixels))
                .for_each(|(sum, x)| *sum += x / TURNS as f64);
        }
        for (sum, x) in sums.iter_mut().zip(turn) {
            *sum = [sum[0] + x, sum[1] + x * x];
        }
    }
    let count = (SAMPLES / TURNS) as f64;
    for (block, ((ours, error), [sum, squares])) in ours.iter().zip(errors).zip(sums).enumerate() {
        let mean = sum / count;
        let variance = (squares / count - mean * mean) / (count - 1.0);
        // Errors of neighbouring pixels are not independent: those of a block are at most their mean.
        let sigma = libm::sqrt(variance + error * error);
        assert!(
            (ours - mean).abs() < 5.0 * sigma + 0.01 * mean,
            "block {block}: {ours} for {mean} +- {sigma}"
        );
    }
}

/// A pass is that of the scene as it stands at its moment; in the same place of render space its pixels are the same.
#[test]
fn scenes_that_stand_still_have_no_motion() {
    let still = CAUSTIC.replace("shutter = [0, 1]", "shutter = [0, 0]");
    let blurs = |text: &str| scene(text).description().motion.as_ref().map(|motion| motion.blurs());
    assert_eq!(blurs(&still), Some(false));
    let late = CAUSTIC.replace("shutter = [0, 1]", "frame = 3\nshutter = [0, 1]");
    let late = late.replace("{ keys = [[1, [0, 3, 6]], [10, [3, 3, 6]]] }", "[0, 3, 6]");
    assert_eq!(blurs(&late.replace("[10, 20]]", "[10, [60, 40, 20]]]")), Some(false));
    assert_eq!(blurs(CAUSTIC), Some(true));
}

const MESH: &str = "\
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
4 0 0
0 4 Z
3 0 1 2
";

#[test]
fn meshes_lie_between_their_frames() {
    let text = "\
[image]
width = 4
height = 4
[animation]
frames = [1, 3]
frame = 1
shutter = [0, 0.5]
[camera]
origin = [0, 0, 5]
target = [0, 0, 0]
fov = 40
[[shapes]]
type = \"mesh\"
file = \"wave_##.ply\"
";
    let (one, two) = (MESH.replace('Z', "0"), MESH.replace('Z', "2"));
    let scene = scene_with(text, &[("wave_01.ply", &one), ("wave_02.ply", &two)]);
    let motion = scene.description().motion.as_ref().unwrap();
    let top = |time: f64| {
        let scene = Scene::new(motion.at(time).unwrap());
        let beamfarm_render::world::geometry::Shape::Mesh { mesh, .. } = &scene.description().objects[0].shape else {
            panic!("no mesh");
        };
        mesh.positions.iter().map(|p| p.z).fold(f32::MIN, f32::max) + 5.0
    };
    for (time, expected) in [(1.0, 0.0), (1.25, 0.5), (1.5, 1.0)] {
        assert!((top(time) - expected).abs() < 1e-6, "{time}: {}", top(time));
    }
    let mut bundle = bundle(text, &[("wave_01.ply", &one)]);
    let said = |bundle: &Bundle| beamfarm_scene::load(bundle).unwrap_err().to_string();
    assert!(
        said(&bundle).contains("moving.toml:14: ") && said(&bundle).contains("\"wave_02.ply\""),
        "{}",
        said(&bundle)
    );
    let more = two
        .replace("vertex 3", "vertex 4")
        .replace("\n3 0 1 2", "\n9 9 9\n3 0 1 2");
    bundle.files.insert("wave_02.ply".into(), more.into());
    assert!(
        said(&bundle).contains("it has 4 vertices and 1 triangles, the mesh before it 3 vertices"),
        "{}",
        said(&bundle)
    );
}

/// Against the projection of where things are: a square that goes to the right, a ball that comes nearer, and what is
/// behind them all while the camera turns; with the shutter open and closed.
#[test]
fn vectors_of_motion_are_those_of_projected_points() {
    let text = "\
[image]
width = 40
height = 30
[animation]
frame = 2
shutter = [0, 0]
[camera]
origin = [0, 0, 10]
target = { keys = [[1, [0, 0, 0]], [5, [0, 0, 0]]] }
fov = 40
[[lights]]
type = \"environment\"
radiance = 1
[[shapes]]
type = \"rectangle\"
transform = [{ translate = { keys = [[1, [-1.5, -1, 0]], [5, [2.5, 1, 0]]] } }]
[[shapes]]
type = \"sphere\"
radius = 0.8
center = { keys = [[1, [0, 3, -1]], [5, [0, 3, 3]]] }
";
    // Pixels to the unit of x / z.
    let scale = 20.0 / libm::tan(20f64.to_radians());
    let vectors = |text: &str| {
        let scene = scene(text);
        let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
        let plan = plan.with_layers(&scene, &[Layer::Normal, Layer::Motion]).unwrap();
        render_pass(&scene, &plan, 0).expect("a pass").layers
    };
    let open = text.replace("shutter = [0, 0]", "shutter = [0, 0.5]");
    for text in [text, open.as_str()] {
        let layers = vectors(text);
        let (mut squares, mut balls) = (0, 0);
        for (i, [u, v, _]) in layers[1].pixels.iter().enumerate() {
            let normal = layers[0].pixels[i];
            if normal[2] > 0.999 && i / 40 > 10 {
                // One unit a frame to the right, half a one up, ten away.
                assert!((f64::from(*u) - scale * 0.1).abs() < 0.02, "{u}");
                assert!((f64::from(*v) - scale * 0.05).abs() < 0.02, "{v}");
                squares += 1;
            } else if normal != [0.0; 3] && i / 40 <= 10 {
                // What comes nearer goes outwards, as far as it is from the middle.
                let at = [(i % 40) as f64 + 0.5 - 20.0, 15.0 - (i / 40) as f64 - 0.5];
                let distance = (10.0, 10.0 - 1.0);
                let rate = 1.0 / (distance.0 - 0.5);
                assert!(
                    f64::from(*u) * at[0] >= -0.1 && f64::from(*v) > 0.5 * rate * at[1],
                    "{u} {v} at {at:?}"
                );
                balls += 1;
            } else if normal == [0.0; 3] {
                assert_eq!([*u, *v], [0.0; 2]);
            }
        }
        assert!(squares > 20 && balls > 10, "{squares} {balls}");
    }
    // A turn of the camera by atan(0.02) a frame or so: everything goes left, the faster the farther out.
    let turning = text
        .replace("[5, [0, 0, 0]]] }\nfov", "[3, [0.4, 0, 0]]] }\nfov")
        .replace("{ keys = [[1, [-1.5, -1, 0]], [5, [2.5, 1, 0]]] }", "[50, 0, 0]");
    let layers = vectors(&turning);
    let middle = layers[1].pixels[25 * 40 + 20];
    // At frame 2 the direction has a tangent of 0.02, and goes on by 0.02 a frame.
    let expected = -scale * 0.02 / (1.0 + 0.02 * 0.02);
    assert!(
        (f64::from(middle[0]) - expected).abs() < 0.02,
        "{middle:?} for {expected}"
    );
}

const VIEW: &str = "\
[image]
width = 8
height = 8
[animation]
frames = [1, 48]
shutter = [0, 0.5]
";

/// What is said of a scene that cannot be.
fn refused(text: &str) -> beamfarm_scene::SceneError {
    beamfarm_scene::load(&bundle(text, &[])).map(|_| text).unwrap_err()
}

/// Line and message of what is wrong.
fn fault(fields: &str) -> (usize, String) {
    let view = VIEW.replace(
        "[animation]",
        "[camera]\norigin = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 40\n[animation]",
    );
    let text = format!("{view}{fields}");
    let error = refused(&text);
    (error.line.unwrap() - view.lines().count(), error.message)
}

#[test]
fn what_is_wrong_has_its_line() {
    let light = "[[lights]]\ntype = \"point\"\nposition = [0, 0, 0]\npower = ";
    for (power, words) in [
        (
            "{ keys = [[3, 1], [2, 4]] }",
            "keys must be in the order of their times: 2 comes after 3",
        ),
        ("{ keys = [[1, 1]] }", "expected { keys = [[frame, value]"),
        ("{ keys = [[1, 1], [50, [1, 2]]] }", "another form"),
        ("{ keys = [[1, 1], [50]] }", "expected [frame, value]"),
        ("{ keys = [[1, 1], [nan, 2]] }", "expected a finite number"),
        (
            "{ keys = [[2, 1], [50, 2]] }",
            "the shutter is open from 1 to 1.5, and the keys tell of 2 to 50",
        ),
        ("{ keys = [[1, 1], [1.25, 2]] }", "the shutter is open from 1 to 1.5"),
        (
            "{ keys = [[1, 1], [50, 2]], interpolation = \"cubic\" }",
            "expected \"linear\", \"smooth\" or \"step\"",
        ),
        ("{ keys = [[1, 1], [50, 2]], ease = 1 }", "unknown field `ease`"),
        ("{ keys = [[1, \"a\"], [50, \"b\"]] }", "interpolation = \"step\""),
        // What comes of them is checked as if it stood there.
        (
            "{ keys = [[1, -1], [50, 2]] }",
            "expected a number that is not negative",
        ),
    ] {
        let (line, message) = fault(&format!("{light}{power}\n"));
        assert_eq!(line, 4, "{power}: {message}");
        assert!(message.contains(words), "{power}: {message}");
    }
    let still = VIEW.replace("[animation]\nframes = [1, 48]\nshutter = [0, 0.5]\n", "");
    let text = format!("{still}[world]\nvalue = {{ keys = [[1, 1], [2, 2]] }}\n");
    let fault = refused(&text);
    assert!(fault.message.contains("the scene has no frames"), "{}", fault.message);
    for (before, after, words) in [
        ("frames = [1, 48]", "frames = [48, 1]", "not before it"),
        ("shutter = [0, 0.5]", "shutter = [0.5, 0]", "not before that"),
        ("shutter = [0, 0.5]", "shuter = [0.5, 0]", "did you mean `shutter`"),
    ] {
        let text = VIEW.replace(before, after);
        let fault = refused(&text);
        assert!(fault.message.contains(words), "{}", fault.message);
    }
}

/// Lists of which every item moves are written as tables of their own by who writes scenes anew.
#[test]
fn all_copies_may_move() {
    let text = "\
[image]
width = 4
height = 4
[animation]
frame = 2
[camera]
origin = [0, 0, 5]
target = [0, 0, 0]
fov = 40
[[shapes]]
type = \"instances\"
shape = { type = \"sphere\" }
";
    let copies = |list: &str| format!("{text}{list}");
    let inline = "transforms = [{ keys = [[1, [{ translate = [0, 0, 0] }]], [3, [{ translate = [2, 0, 0] }]]] }, \
                  { keys = [[1, [{ translate = [0, 0, 0] }]], [3, [{ translate = [0, 4, 0] }]]] }]\n";
    let tables = "[[shapes.transforms]]\nkeys = [[1, [{ translate = [0, 0, 0] }]], [3, [{ translate = [2, 0, 0] }]]]\n\
                  [[shapes.transforms]]\nkeys = [[1, [{ translate = [0, 0, 0] }]], [3, [{ translate = [0, 4, 0] }]]]\n";
    for list in [inline, tables] {
        let scene = scene(&copies(list));
        let places = scene.description().objects.iter().map(|object| match &object.shape {
            beamfarm_render::world::geometry::Shape::Sphere { placement, .. } => {
                placement.render_from_object.translation
            }
            _ => panic!("no ball"),
        });
        let places: Vec<[f32; 3]> = places.map(|place| place.into()).collect();
        assert_eq!(places, [[1.0, 0.0, -5.0], [0.0, 2.0, -5.0]]);
    }
}
