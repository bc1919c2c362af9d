//! The picture when no pass was completed, and notes on scenes of which nothing will come.

use crate::setup::{attribute, beamfarm, find_attribute, folder_with, line, run, scene, spawn, succeed, text};
use beamfarm_image::exr::read_rgb;
use std::path::Path;

const SIZE: [u32; 2] = [96, 64];

/// The notes of `explain` on stderr for a scene.
fn noted(scene: &str, more: &[&str]) -> String {
    let folder = folder_with(scene);
    let output = run(folder.path(), &[&["explain", "scene.toml"], more].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stderr).to_owned()
}

fn is_sketch(path: &Path) -> bool {
    let film = read_rgb(path).unwrap();
    assert_eq!(([film.width, film.height], film.non_finite()), (SIZE, 0));
    assert!(path.with_extension("png").exists());
    let is_sketch = find_attribute(path, "beamfarmSketch").is_some();
    assert_eq!(is_sketch, find_attribute(path, "beamfarmPasses").is_none());
    is_sketch
}

/// The picture is part of no pass: a resumed job has the bits of an uninterrupted one, and an existing image stays.
#[test]
fn without_a_complete_pass_there_is_a_coarse_picture() {
    let folder = folder_with(&scene(SIZE, 2, 400));
    let path = folder.path();
    let whole = succeed(path, &["render", "scene.toml", "-o", "whole.exr"]);
    let args = ["render", "scene.toml", "-o", "a.exr", "--job", "job"];
    for written in ["a.exr", "a.exr"] {
        let output = run(path, &[&args[..], &["--time", "0s"]].concat());
        assert_eq!(output.status.code(), Some(4));
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        assert!(line(stdout, "wrote a.exr").contains("part of no"), "{stdout}");
        assert!(stderr.contains("a coarse picture was written"), "{stderr}");
        assert!(is_sketch(&path.join(written)));
    }
    let finished = succeed(path, &args);
    assert_eq!(line(&finished, "pixels"), line(&whole, "pixels"));
    assert!(!is_sketch(&path.join("a.exr")));
    let output = run(path, &["render", "scene.toml", "-o", "a.exr", "--time", "0s"]);
    line(text(&output.stdout), "wrote a.sketch.exr");
    assert_eq!(attribute(&path.join("a.exr"), "beamfarmPasses"), "2");
    assert!(is_sketch(&path.join("a.sketch.exr")));
    // A part of a job makes no image.
    let part = [
        "render",
        "scene.toml",
        "-o",
        "b.exr",
        "--first-pass",
        "1",
        "--time",
        "0s",
    ];
    assert_eq!(run(path, &part).status.code(), Some(4));
    assert!(!path.join("b.exr").exists());
}

/// Fog that scatters light without end: a pilot and a pass take minutes.
fn dense() -> String {
    let scene = scene(SIZE, 2, 400).replace("paths = 400, ", "");
    scene.replace("sigma_s = 0.4", "sigma_s = 1000.0")
}

#[test]
fn a_signal_while_a_pilot_runs_ends_with_a_coarse_picture() {
    let folder = folder_with(&dense());
    let path = folder.path();
    let mut render = spawn(beamfarm(path, &["render", "scene.toml"]));
    render.log.wait_for("note: `media.");
    render.signal("-TERM");
    let output = render.finish();
    assert_eq!(output.status.code(), Some(4), "{}", text(&output.stderr));
    assert!(is_sketch(&path.join("scene.exr")));
}

#[test]
fn media_that_no_light_gets_through_are_named() {
    let said = noted(&dense(), &["--paths", "1"]);
    assert!(said.contains("`media.fog.sigma_s`: a photon path scatters "), "{said}");
    let thin = noted(&dense(), &["--paths", "1", "-D", "media.fog.sigma_s=10.0"]);
    assert!(!thin.contains("media.fog"), "{thin}");

    let block = scene(SIZE, 2, 400)
        + "[media.stone]\ntype = \"homogeneous\"\nsigma_a = 3000.0\nsigma_s = 0.0\n[materials.hull]\ntype = \"null\"\n\
           [[shapes]]\ntype = \"cube\"\nmaterial = \"hull\"\ninterior = \"stone\"\nexterior = \"fog\"\n\
           transform = [{ scale = [0.2, 0.25, 0.3] }, { translate = [1, 0, 0] }]\n";
    let said = noted(&block, &[]);
    assert!(
        said.contains("`media.stone.sigma_a`: the medium's optical depth is 1200 "),
        "{said}"
    );
    let thin = noted(&block, &["-D", "media.stone.sigma_a=2000.0"]);
    assert!(!thin.contains("media.stone"), "{thin}");
}

/// A closed room with its lamp, seen from the middle.
const ROOM: &str = r#"
image = { width = 96, height = 64 }
camera = { origin = [0, 0, 0.5], target = [0, 0, 0], fov = 40 }
[materials.wall]
type = "diffuse"
reflectance = 0.5
two_sided = true
[[shapes]]
name = "room"
type = "cube"
material = "wall"
[[lights]]
type = "point"
position = [0, 0.5, 0]
power = 10
"#;

#[test]
fn cameras_that_see_nothing_are_told_of() {
    let said = |origin: &str| noted(ROOM, &["-D", &format!("camera.origin={origin}")]);
    let inside = said("[0, 0, 0.5]");
    assert!(!inside.contains("camera"), "{inside}");
    let outside = said("[0, 0, 9]");
    assert!(
        outside.contains("stay black") && outside.contains("\"room\""),
        "{outside}"
    );
    assert!(outside.contains("`camera.origin`"), "{outside}");
    let target = ["-D", "camera.target=[0, 0, 20]", "-D", "camera.origin=[0, 0, 9]"];
    let away = noted(ROOM, &target);
    assert!(away.contains("the camera sees nothing: none of 4096 rays"), "{away}");
    // The surroundings are visible.
    let sky = format!("{ROOM}[[lights]]\ntype = \"environment\"\nradiance = 1.0\n");
    let lit = noted(&sky, &target);
    assert!(!lit.contains("camera"), "{lit}");
}

#[test]
fn photons_that_find_nothing_are_told_of() {
    let spot = r#"
image = { width = 32, height = 24 }
camera = { origin = [0, 3, 6], target = [0, 0, 0], fov = 40 }
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
material = "glass"
[[shapes]]
type = "rectangle"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 3 }, { translate = [0, -1, 0] }]
[[lights]]
type = "spot"
position = [0, 2, 0]
target = [0, 0, 0]
cutoff_angle = 20
intensity = 10
"#;
    let lost = noted(spot, &["-D", "lights.0.target=[0, 9, 0]"]);
    assert!(lost.contains("none of 4096 photon paths meets anything"), "{lost}");
    let found = noted(spot, &[]);
    assert!(!found.contains("photon paths meet"), "{found}");
    // Lit directly by the lamp, whose photons leave nothing.
    let flat = noted(
        &spot.replace("material = \"glass\"", ""),
        &["-D", "lights.0.position=[2, 0, 2]"],
    );
    assert!(!flat.contains("photon paths meet"), "{flat}");
}

/// Which solid gives way to which, unless the scene says it; and contradictions.
#[test]
fn solids_that_meet_are_told_of() {
    let shape = |name: &str, x: f64, more: &str| {
        format!(
            "[[shapes]]\nname = \"{name}\"\ntype = \"cube\"\n{more}\n\
             transform = [{{ scale = 0.4 }}, {{ translate = [{x}, 0.01, 0.02] }}]\n"
        )
    };
    let materials = "[materials]\nglass = { type = \"dielectric\", ior = 1.5 }\nwater = { type = \"dielectric\", ior = 1.33 }\n\
                     edge = { type = \"null\" }\n\
                     [media]\njuice = { type = \"homogeneous\", sigma_a = 0.5, sigma_s = 0 }\n\
                     red = { type = \"homogeneous\", sigma_a = 0, sigma_s = [1, 0, 0], phase = { type = \"hg\", g = 0.5 } }\n\
                     grey = { type = \"homogeneous\", sigma_a = 0, sigma_s = 1 }\n";
    let room = ROOM.replace("[materials.wall]", &format!("{materials}[materials.wall]"));
    let cup = shape("cup", 0.0, "material = \"glass\"");
    let said = |shapes: &str| noted(&format!("{room}{shapes}"), &["--paths", "1"]);
    let juice = |more: &str| shape("juice", 0.3, &format!("material = \"water\"\n{more}"));
    let by_medium = said(&(cup.clone() + &juice("interior = \"juice\"")));
    assert!(
        by_medium.contains(
            "shapes \"cup\" and \"juice\" reach into each other: \"juice\", which has a medium inside, gives way to \"cup\""
        ),
        "{by_medium}"
    );
    let by_index = said(&(juice("") + &cup));
    assert!(
        by_index.contains("\"juice\", whose index of refraction is lower, gives way to \"cup\""),
        "{by_index}"
    );
    for quiet in ["priority = 1", "priority = -1\ninterior = \"juice\""] {
        let quiet = said(&(cup.clone() + &juice(quiet)));
        assert!(
            !quiet.contains("gives way") && !quiet.contains("another medium"),
            "{quiet}"
        );
    }
    let fog = |name: &str, x: f64| shape(name, x, &format!("material = \"edge\"\ninterior = \"{name}\""));
    let sum = said(&(fog("juice", 0.0) + &fog("grey", 0.3)));
    assert!(!sum.contains("shapes \"") && !sum.contains("another medium"), "{sum}");
    let colours = said(&(fog("red", 0.0) + &fog("grey", 0.3)));
    assert!(
        colours.contains(
            "shapes \"red\" and \"grey\" reach into each other: their media add up, but for the phase function"
        ),
        "{colours}"
    );
}

/// A lamp so far away that hardly any of its photons reaches the scene. Where camera paths may not find its light, the
/// picture reports that it is missing. With aimed photons it is not.
#[test]
fn light_of_rare_photons_is_said_to_be_missing() {
    let text_of_scene = r#"
[image]
width = 32
height = 32
[camera]
origin = [0, 3, 8]
target = [0, 0.5, 0]
fov = 40
[materials.floor]
type = "diffuse"
[materials.mirror]
type = "conductor"
preset = "silver"
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{ scale = 5 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "rectangle"
material = "mirror"
transform = [{ translate = [0, 1, -3] }]
[[shapes]]
type = "sphere"
center = [0, 40000, 50000]
radius = 5000
emission = { radiance = 10 }
"#;
    let folder = folder_with(text_of_scene);
    let render = |more: &str| {
        let args = [
            "render",
            "scene.toml",
            "-o",
            "a.exr",
            "--passes",
            "4",
            "--paths",
            "2000",
        ];
        let techniques = [
            "-D",
            "render.caustics=photons",
            "-D",
            "render.surfaces=paths",
            "-D",
            more,
        ];
        succeed(folder.path(), &[&args[..], &techniques].concat())
    };
    let plain = render("render.targeting=off");
    let note = line(&plain, "note: 8000 photon paths left ");
    assert!(
        note.contains("hardly include the light") && note.contains("render.targeting=on"),
        "{note}"
    );
    std::fs::remove_file(folder.path().join("a.exr")).unwrap();
    assert!(!render("render.targeting=on").contains("photon paths"));
}
