//! A picture is made by trial: what changes in a scene, and what happens to existing files.

use crate::setup::{attribute, beamfarm, fail, folder_with, line, run, scene, spawn, succeed, text};
use beamfarm_image::exr::read_rgb;
use beamfarm_image::png::encode_png;
use beamfarm_image::view::{View, ViewTransform};
use std::path::Path;

const SIZE: [u32; 2] = [16, 12];

fn pixels(stdout: &str) -> String {
    line(stdout, "pixels").to_owned()
}

fn write(folder: &Path, text: &str) {
    std::fs::write(folder.join("scene.toml"), text).unwrap();
}

#[test]
fn what_changes_no_pixel_changes_nothing() {
    let original = scene(SIZE, 4, 200);
    let folder = folder_with(&original);
    let folder = folder.path();
    let first = pixels(&succeed(folder, &["render", "scene.toml", "--job", "a.job"]));
    let hash = attribute(&folder.join("scene.exr"), "beamfarmScene");
    let same = [
        format!("# A comment.\n{original}\n"),
        original.replace("fov = 50.0", "fov   =  50"),
        original.replace(
            "target = [0.0, 1.0, 0.0]\nfov = 50.0",
            "fov = 50.0\ntarget = [0.0, 1.0, 0.0]",
        ),
        original.replace("render = {", "render = { exposure = 2,"),
        original.replace("render = {", "render = { view = \"agx\", white_balance = 3000,"),
    ];
    for same in same {
        assert_ne!(same, original);
        write(folder, &same);
        // The job folder belongs to the same job: nothing is rendered again.
        let said = succeed(folder, &["render", "scene.toml", "--job", "a.job"]);
        assert!(said.contains("resuming a.job with 4 passes"), "{said}");
        assert_eq!(pixels(&said), first);
        assert_eq!(attribute(&folder.join("scene.exr"), "beamfarmScene"), hash);
    }
    // The file's name does not matter either, and a changed number of passes belongs to the job.
    std::fs::write(folder.join("other.toml"), scene(SIZE, 6, 200)).unwrap();
    let said = succeed(folder, &["render", "other.toml", "--job", "a.job"]);
    assert!(said.contains("resuming a.job with 4 passes"), "{said}");
    assert_eq!(attribute(&folder.join("other.exr"), "beamfarmPasses"), "6");
}

/// The PNG shows the EXR in the requested view; nothing else depends on the view.
#[test]
fn pictures_are_shown_in_the_view_that_is_asked_for() {
    let plain = scene(SIZE, 2, 200);
    let folder = folder_with(&plain);
    let folder = folder.path();
    let shows = |name: &str, view: View| {
        let film = read_rgb(&folder.join(format!("{name}.exr"))).unwrap();
        let png = std::fs::read(folder.join(format!("{name}.png"))).unwrap();
        assert!(
            png == encode_png(&film, view).unwrap(),
            "{name} is not shown as {view:?}"
        );
    };
    let first = pixels(&succeed(folder, &["render", "scene.toml", "--job", "a.job"]));
    shows("scene", View::default());
    let view = View {
        transform: ViewTransform::Agx,
        exposure: -0.5,
        white_balance: 3200.0,
    };
    let said = "render = { view = \"agx\", exposure = -0.5, white_balance = 3200,";
    write(folder, &plain.replace("render = {", said));
    assert_eq!(
        pixels(&succeed(folder, &["render", "scene.toml", "--job", "b.job"])),
        first
    );
    shows("scene", view);
    // The job remembers it, and the command line overrides it.
    let merged = succeed(folder, &["merge", "b.job", "-o", "merged.exr"]);
    assert_eq!(pixels(&merged), first);
    shows("merged", view);
    let flags = ["--view", "filmic", "--exposure", "1", "--white-balance", "6500"];
    let bright = View {
        transform: ViewTransform::Filmic,
        ..View::exposed(1.0)
    };
    succeed(folder, &[&["merge", "b.job", "-o", "merged.exr"][..], &flags].concat());
    shows("merged", bright);
    let reference = ["reference", "scene.toml", "--samples", "2", "-o", "truth.exr"];
    succeed(folder, &[&reference[..], &flags].concat());
    shows("truth", bright);
    write(folder, &plain.replace("render = {", "render = { white_balance = 900,"));
    let (code, stderr) = fail(folder, &["render", "scene.toml"]);
    assert_eq!(code, 2);
    assert!(
        stderr.contains("render.white_balance: expected a temperature from 1000 to 25000 kelvin"),
        "{stderr}"
    );
}

/// Ten edits in a row, each rendered, and no folder removed by hand.
#[test]
fn edits_are_named_and_begin_anew_when_somebody_says_so() {
    let folder = folder_with(&scene(SIZE, 2, 200));
    let folder = folder.path();
    let render = ["render", "scene.toml", "--job", "a.job"];
    let mut pictures = vec![pixels(&succeed(folder, &render))];
    for edit in 1..10 {
        let fov = 50 + edit;
        write(
            folder,
            &scene(SIZE, 2, 200).replace("fov = 50.0", &format!("fov = {fov}")),
        );
        let (code, said) = fail(folder, &render);
        let expected = format!("camera.fov {} there, {fov} here", fov - 1);
        assert!(code == 2 && said.contains(&expected), "{said}");
        assert!(said.contains("--restart"), "{said}");
        let anew = succeed(folder, &[&render[..], &["--restart"]].concat());
        pictures.push(pixels(&anew));
    }
    pictures.sort();
    pictures.dedup();
    assert_eq!(pictures.len(), 10);
}

#[test]
fn fields_and_sizes_change_on_the_command_line() {
    let folder = folder_with(&scene(SIZE, 2, 200));
    let folder = folder.path();
    let render = |args: &[&str]| {
        let said = succeed(folder, &[&["scene.toml", "-o", "a.exr"], args].concat());
        let meta = exr::meta::MetaData::read_from_file(folder.join("a.exr"), false).unwrap();
        let size = meta.headers[0].layer_size;
        (pixels(&said), [size.x(), size.y()])
    };
    let (plain, size) = render(&[]);
    assert_eq!(size, [16, 12]);
    let (narrow, _) = render(&["-D", "camera.fov=40"]);
    assert_ne!(narrow, plain);
    write(folder, &scene(SIZE, 2, 200).replace("fov = 50.0", "fov = 40"));
    assert_eq!(render(&[]).0, narrow);
    for (args, expected) in [
        (&["--scale", "50%"][..], [8, 6]),
        (&["--width", "32"], [32, 24]),
        (&["--height", "6"], [8, 6]),
        (&["--width", "10", "--height", "10"], [10, 10]),
        (&["--crop", "4,2,5,7"], [5, 7]),
        (&["--scale", "2", "--crop", "4,2,5,7"], [5, 7]),
    ] {
        assert_eq!(render(args).1, expected, "{args:?}");
    }
    let (code, said) = fail(folder, &["scene.toml", "--crop", "10,2,20,7"]);
    assert!(code == 2 && said.contains("crop"), "{said}");
}

#[test]
fn commands_do_not_write_over_each_others_images() {
    let folder = folder_with(&scene(SIZE, 2, 200));
    let folder = folder.path();
    succeed(folder, &["render", "scene.toml"]);
    let rendered = std::fs::read(folder.join("scene.exr")).unwrap();
    succeed(folder, &["reference", "scene.toml", "--samples", "2"]);
    assert_eq!(std::fs::read(folder.join("scene.exr")).unwrap(), rendered);
    assert!(folder.join("scene-reference.exr").exists());
    succeed(
        folder,
        &["reference", "scene.toml", "--samples", "2", "-o", "scene.exr"],
    );
    let (code, said) = fail(folder, &["render", "scene.toml"]);
    assert!(code == 2 && said.contains("made by `beamfarm reference`"), "{said}");
    succeed(folder, &["render", "scene.toml", "-o", "scene.exr"]);
    succeed(folder, &["render", "scene.toml"]);
}

/// Mitsuba scenes are all called scene.xml.
#[test]
fn scenes_of_one_name_in_two_folders_have_two_images() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for name in ["fog", "smoke"] {
        std::fs::create_dir(folder.join(name)).unwrap();
    }
    std::fs::write(folder.join("fog/scene.toml"), scene(SIZE, 2, 200)).unwrap();
    std::fs::write(folder.join("smoke/scene.toml"), scene(SIZE, 2, 300)).unwrap();
    let fog = pixels(&succeed(folder, &["render", "fog/scene.toml"]));
    let image = |name: &str| std::fs::read(folder.join(name)).unwrap();
    let of_fog = image("scene.exr");
    let smoke = pixels(&succeed(folder, &["render", "smoke/scene.toml"]));
    assert_ne!(fog, smoke);
    assert_eq!(image("scene.exr"), of_fog);
    assert!(folder.join("smoke-scene.png").exists());
    // With either command, and although the plain name is free again.
    std::fs::remove_file(folder.join("scene.exr")).unwrap();
    let above = folder.join("fog/../smoke/scene.toml");
    succeed(folder, &["render", above.to_str().unwrap()]);
    assert!(!folder.join("scene.exr").exists());
    succeed(folder, &["render", "fog/scene.toml"]);
    assert_eq!(
        attribute(&folder.join("scene.exr"), "beamfarmSceneFile"),
        "fog/scene.toml"
    );
    // The job folder goes with the image.
    succeed(
        folder,
        &[
            "render",
            "smoke/scene.toml",
            "--passes",
            "1",
            "--job",
            "smoke-scene.job",
        ],
    );
    let said = succeed(folder, &["render", "smoke/scene.toml", "--passes", "3"]);
    assert_eq!(
        attribute(&folder.join("smoke-scene.exr"), "beamfarmPasses"),
        "3",
        "{said}"
    );
}

#[test]
fn shells_and_man_know_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for shell in ["bash", "zsh", "fish"] {
        let script = succeed(folder, &["completions", shell]);
        assert!(script.contains("target-error"), "{shell}");
    }
    succeed(folder, &["man", "pages"]);
    let page = std::fs::read_to_string(folder.join("pages/beamfarm-render.1")).unwrap();
    assert!(
        page.contains("beamfarm\\-render") && page.contains("target\\-error"),
        "{page}"
    );
    let hidden = spawn(beamfarm(folder, &["man", "/dev/null/pages"])).finish();
    assert_eq!(hidden.status.code(), Some(1), "{}", text(&hidden.stderr));
}

/// What will be black or empty is reported, with where things are.
#[test]
fn darkness_is_told() {
    let folder = folder_with(&scene(SIZE, 2, 200));
    let folder = folder.path();
    let warned = |args: &[&str]| {
        let output = run(folder, &[&["render", "scene.toml", "-o", "a.exr"], args].concat());
        assert!(output.status.success());
        text(&output.stderr).to_owned()
    };
    assert!(!warned(&[]).contains("black"));
    // The lamp inside the ball, and the ball opaque.
    let dark = warned(&["-D", "lights.0.position=[0, 1, 0]", "-D", "world.medium=none"]);
    assert_eq!(dark.matches("the image is black").count(), 1, "{dark}");
    let unlit = scene(SIZE, 2, 200);
    write(folder, &unlit[..unlit.find("[[lights]]").unwrap()]);
    assert!(warned(&[]).contains("there are no lights"));

    let smoke = "
[materials.hull]
type = \"null\"
[media.smoke]
type = \"heterogeneous\"
sigma_a = 0.1
sigma_s = 1.0
density = { min = [5, 5, 5], max = [6, 6, 6], noise = { size = 0.5 } }
[[shapes]]
type = \"cube\"
material = \"hull\"
interior = \"smoke\"
";
    write(folder, &format!("{}{smoke}", scene(SIZE, 2, 200)));
    let explained = run(folder, &["explain", "scene.toml"]);
    let (said, noted) = (text(&explained.stdout), text(&explained.stderr));
    assert!(
        noted.contains("lies outside of the shapes that hold it"),
        "{noted} {said}"
    );
    line(
        said,
        "at  shapes[0]: [-0.3500, 0.6500, -0.3500] to [0.3500, 1.3500, 0.3500]",
    );
    line(
        said,
        "at  volume of medium \"smoke\": [5.0000, 5.0000, 5.0000] to [6.0000, 6.0000, 6.0000]",
    );
    line(said, "at  all of them: ");
}

#[test]
fn all_that_is_wrong_is_told_in_order() {
    let wrong = scene(SIZE, 2, 200)
        .replace("fov = 50.0", "fovv = 50.0")
        .replace("radius = 0.35", "radius = -0.35")
        .replace("power = 100.0", "powr = 100.0");
    let folder = folder_with(&wrong);
    let (code, said) = fail(folder.path(), &["render", "scene.toml"]);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!((code, lines.len()), (2, 3), "{said}");
    for (line, word) in lines
        .iter()
        .zip(["did you mean `fov`", "radius", "did you mean `power`"])
    {
        assert!(line.starts_with("scene.toml:") && line.contains(word), "{said}");
    }
}
