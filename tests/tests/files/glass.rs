//! Glass as people model it: where only one solid can be meant, it becomes that solid; open surfaces are reported.

use beamfarm_harness::render::reference_images;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::{Scene, SceneDescription};

/// A cube of side 1 in front of a lamp of radiance 1, seen by parallel rays.
const VIEW: &str = r#"
image = { width = 8, height = 8 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], projection = "orthographic", view_width = 0.8 }
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.frosted]
type = "rough_dielectric"
alpha = 0.2
ior = 1.5
[media.amber]
type = "homogeneous"
sigma_a = [1.3862943611198906, 0.6931471805599453, 0.2876820724517809]
sigma_s = 0.0
[[shapes]]
type = "rectangle"
emission = { radiance = 1.0 }
transform = [{ scale = 20 }, { translate = [0, 0, -3] }]
"#;

const CORNERS: &str = "v -0.5 -0.5 -0.5\nv -0.5 -0.5 0.5\nv -0.5 0.5 -0.5\nv -0.5 0.5 0.5\n\
                       v 0.5 -0.5 -0.5\nv 0.5 -0.5 0.5\nv 0.5 0.5 -0.5\nv 0.5 0.5 0.5\n\
                       v 0.1 -0.5 0.5\n";
/// The cube's triangles, outwards.
const FACES: [[u32; 3]; 12] = [
    [1, 2, 4],
    [1, 4, 3],
    [5, 7, 8],
    [5, 8, 6],
    [1, 5, 6],
    [1, 6, 2],
    [3, 4, 8],
    [3, 8, 7],
    [1, 3, 7],
    [1, 7, 5],
    [2, 6, 8],
    [2, 8, 4],
];

fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
    [a, c, b]
}

fn load(shape: &str, faces: &[[u32; 3]]) -> Result<SceneDescription, String> {
    load_mesh(CORNERS, shape, faces)
}

fn load_mesh(corners: &str, shape: &str, faces: &[[u32; 3]]) -> Result<SceneDescription, String> {
    let faces: String = faces.iter().map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect();
    let text = format!("{VIEW}\n[[shapes]]\nname = \"thing\"\n{shape}\n");
    let files = [("scene.toml", text), ("cube.obj", format!("{corners}{faces}"))];
    beamfarm_scene::load(&Bundle {
        scene: "scene.toml".into(),
        files: files.map(|(name, text)| (name.into(), text.into_bytes())).into(),
    })
    .map_err(|error| error.to_string())
}

/// What reaches the middle of the picture from the lamp.
fn seen(description: SceneDescription) -> Rgb {
    let scene = Scene::new(description);
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    let mut sum = Rgb::ZERO;
    for film in reference_images(&scene, settings, 8, 16) {
        let pixels = film.pixels.iter().map(|p| Rgb::new(p[0], p[1], p[2]));
        sum += pixels.sum::<Rgb>() / (8.0 * film.pixels.len() as f32);
    }
    sum
}

const CUBE: &str = "type = \"mesh\"\nfile = \"cube.obj\"\nmaterial = \"glass\"";

#[test]
fn broken_cubes_are_the_cube() {
    let inside_out = FACES.map(turned).to_vec();
    let mut mixed = FACES.to_vec();
    mixed.iter_mut().step_by(3).for_each(|face| *face = turned(*face));
    let doubled: Vec<_> = FACES.into_iter().chain(FACES).collect();
    let both_ways: Vec<_> = FACES.into_iter().chain(FACES.map(turned)).collect();
    // The ninth corner lies on the edge from the second to the sixth.
    let mut cut = FACES.to_vec();
    cut.splice(10..11, [[2, 9, 8], [9, 6, 8]]);
    // A ray at normal incidence keeps 1 - r at either face. What is reflected in between comes out as well, less
    // absorption over two more crossings.
    let r = 0.5 * 0.5 / (2.5 * 2.5);
    let through = |t: f64| (1.0 - r) * (1.0 - r) * t / (1.0 - r * t * r * t);
    for (interior, transmittance) in [("", [1.0; 3]), ("interior = \"amber\"", [0.25, 0.5, 0.75])] {
        let shape = format!("{CUBE}\n{interior}");
        let whole = load(&shape, &FACES).unwrap();
        assert!(whole.notes.is_empty(), "{:?}", whole.notes);
        for (what, faces, said) in [
            ("inside out", &inside_out, "12 faces that look inwards are turned"),
            ("mixed", &mixed, "4 faces that look inwards are turned"),
            ("doubled", &doubled, "12 faces are there twice and left out"),
            ("both ways", &both_ways, "12 faces are there twice and left out"),
            ("cut finer", &cut, "1 edge that meets shorter ones is cut"),
        ] {
            let mended = load(&shape, faces).unwrap();
            let [note] = &mended.notes[..] else {
                panic!("{what}: {:?}", mended.notes)
            };
            assert!(note.contains("scene.toml:") && note.contains(said), "{what}: {note}");
            let seen = seen(mended);
            for (channel, t) in transmittance.into_iter().enumerate() {
                let expected = through(t);
                // All rays are alike except for their choices at each face: what does not come from the lamp is black.
                assert!(
                    (f64::from(seen[channel]) - expected).abs() < 0.02,
                    "{what}: {seen} for {expected}"
                );
            }
        }
    }
    // What was turned by hand is not turned again, and what is inside out on purpose stays so.
    for faces in [&FACES.to_vec(), &inside_out] {
        let turned = load(&format!("{CUBE}\nflip_normals = true"), faces).unwrap();
        assert!(turned.notes.is_empty(), "{:?}", turned.notes);
    }
}

/// Two cubes in one mesh, crossing and not crossing.
#[test]
fn parts_that_cross_are_told_of() {
    let at = |x: f64| {
        let corner = |line: &str| {
            let [a, b, c] = [1, 2, 3].map(|i| line.split(' ').nth(i).unwrap().parse::<f64>().unwrap());
            format!("v {} {b} {c}\n", a + x)
        };
        CORNERS.lines().map(corner).collect::<String>()
    };
    let both: Vec<_> = FACES.into_iter().chain(FACES.map(|face| face.map(|v| v + 9))).collect();
    for (x, crosses) in [(0.7, true), (1.3, false)] {
        for interior in ["", "interior = \"amber\""] {
            let corners = format!("{CORNERS}{}", at(x));
            let notes = load_mesh(&corners, &format!("{CUBE}\n{interior}"), &both)
                .unwrap()
                .notes;
            match &notes[..] {
                [note] if crosses => {
                    let said = [
                        "scene.toml:",
                        "the mesh of \"thing\" has parts that cross each other",
                        "unite them",
                    ];
                    assert!(said.iter().all(|said| note.contains(said)), "{note}");
                }
                notes => assert!(!crosses && notes.is_empty(), "{notes:?}"),
            }
        }
    }
}

#[test]
fn open_glass_is_told_of() {
    let hole = FACES[..11].to_vec();
    for (shape, faces, why) in [
        (CUBE, &hole[..], "and 2 more"),
        (
            "type = \"mesh\"\nfile = \"cube.obj\"\nmaterial = \"frosted\"",
            &hole[..10],
            "and 3 more",
        ),
        ("type = \"rectangle\"\nmaterial = \"glass\"", &FACES[..], "and 3 more"),
        (
            "type = \"disc\"\nmaterial = \"glass\"",
            &FACES[..],
            "a disc has no inside",
        ),
        (
            "type = \"cylinder\"\nmaterial = \"glass\"",
            &FACES[..],
            "a cylinder has no ends",
        ),
    ] {
        let notes = load(shape, faces).unwrap().notes;
        let [note] = &notes[..] else {
            panic!("{shape}: {notes:?}")
        };
        for part in ["scene.toml:", "thin_dielectric", "open = true", why] {
            assert!(note.contains(part), "{part:?} is not in {note}");
        }
        let meant = load(&format!("{shape}\nopen = true"), faces).unwrap().notes;
        assert!(meant.is_empty(), "{meant:?}");
    }
    let error = load(&format!("{CUBE}\ninterior = \"amber\""), &hole).unwrap_err();
    assert!(
        error.contains("cannot be the boundary") && error.contains("and 2 more"),
        "{error}"
    );
    for closed in ["sphere", "cube"] {
        let notes = load(&format!("type = \"{closed}\"\nmaterial = \"glass\""), &FACES)
            .unwrap()
            .notes;
        assert!(notes.is_empty(), "{notes:?}");
    }
}

#[test]
fn solids_that_meet_are_named() {
    use beamfarm_render::world::nested::Meeting::{Crossing, Touching};
    let ball = |name: &str, at: f32, radius: f32| {
        format!(
            "[[shapes]]\nname = \"{name}\"\ntype = \"sphere\"\ncenter = [{at}, 0, 0]\nradius = {radius}\nmaterial = \"glass\"\n"
        )
    };
    let cube = |name: &str, at: f32, scale: f32, material: &str| {
        format!(
            "[[shapes]]\nname = \"{name}\"\ntype = \"cube\"\nmaterial = \"{material}\"\n\
             transform = [{{ scale = {scale} }}, {{ translate = [{at}, 0.01, 0] }}]\n"
        )
    };
    for (shapes, expected) in [
        (ball("a", 0.0, 1.0) + &ball("b", 3.0, 1.0), None),
        (ball("a", 0.0, 1.0) + &ball("b", 1.5, 1.0), Some(Crossing)),
        // One within the other.
        (ball("a", 0.0, 1.0) + &ball("b", 0.3, 0.5), None),
        (
            cube("a", 0.0, 1.0, "glass") + &cube("b", 2.0, 1.0, "glass"),
            Some(Touching),
        ),
        (cube("a", 0.0, 1.0, "glass") + &cube("b", 2.01, 1.0, "glass"), None),
        (
            cube("a", 0.0, 1.0, "glass") + &cube("b", 1.99, 1.0, "frosted"),
            Some(Crossing),
        ),
        (cube("a", 0.0, 1.0, "frosted") + &ball("b", 1.9, 1.0), Some(Crossing)),
        // A surface between two liquids has no inside.
        (
            cube("a", 0.0, 1.0, "glass")
                + "[[shapes]]\nname = \"b\"\ntype = \"rectangle\"\nmaterial = \"glass\"\nopen = true\n",
            None,
        ),
        // An interface that bends no light.
        (cube("a", 0.0, 1.0, "glass") + &cube("b", 2.0, 1.0, "grey"), None),
        (cube("a", 0.0, 1.0, "glass") + &cube("b", 1.5, 1.0, "empty"), None),
    ] {
        let materials = "[materials.grey]\ntype = \"diffuse\"\n[materials.empty]\ntype = \"null\"\n";
        let text = format!("{VIEW}{materials}{shapes}");
        let mut bundle = Bundle {
            scene: "scene.toml".into(),
            ..Bundle::default()
        };
        bundle.files.insert("scene.toml".into(), text.into());
        let scene = Scene::new(beamfarm_scene::load(&bundle).unwrap());
        let met = scene.meeting_solids();
        assert_eq!(met.first().map(|met| met.meeting), expected, "{shapes}");
        for met in met {
            let name = |object: u32| scene.description().objects[object as usize].name.clone();
            assert_eq!(met.pair.map(name), ["a", "b"]);
        }
    }
}
