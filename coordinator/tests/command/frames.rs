//! Frames of an animation as jobs of one command: their bits, their files, their reports.

use crate::setup::{BY_PHOTONS, attribute, beamfarm, fail, folder_with, line, run, spawn, succeed, text, wait_until};
use serde_json::Value;
use std::path::Path;
use std::time::SystemTime;
use tempfile::TempDir;

/// A ball that moves through fog below a lamp that moves the other way, over a floor at rest.
fn moving(render: &str, shutter: &str) -> String {
    format!(
        r#"
image = {{ width = 32, height = 24 }}
render = {{ {render} }}
[animation]
frames = [1, 24]
shutter = {shutter}
[camera]
origin = [0.0, 1.0, 3.0]
target = [0.0, 1.0, 0.0]
fov = 50.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.4
[[shapes]]
type = "sphere"
center = {{ keys = [[1, [-0.4, 1, 0]], [25, [0.4, 1, 0]]] }}
radius = 0.35
[[shapes]]
type = "mesh"
file = "floor.obj"
[[lights]]
type = "point"
position = {{ keys = [[1, [0.5, 2, 0.5]], [25, [-0.5, 2, 0.5]]], interpolation = "smooth" }}
power = 100.0
"#
    )
}

const FLOOR: &str = "v -3 0 3\nv 3 0 3\nv 3 0 -3\nv -3 0 -3\nf 1 2 3\nf 1 3 4\n";

/// A folder with such a scene of this many passes.
pub fn folder(passes: u32) -> TempDir {
    let render = format!("passes = {passes}, paths = 400, {BY_PHOTONS}");
    let folder = folder_with(&moving(&render, "[0.0, 0.5]"));
    std::fs::write(folder.path().join("floor.obj"), FLOOR).unwrap();
    folder
}

/// The report of all frames.
pub fn report(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Its entry for a frame.
pub fn of_frame(report: &Value, frame: i64) -> &Value {
    let frames = report["frames"].as_array().unwrap();
    let found = frames.iter().find(|record| record["frame"] == frame);
    found.unwrap_or_else(|| panic!("no frame {frame} in {report}"))
}

/// The pixels of a separate job for this frame.
pub fn alone(folder: &Path, frame: i64, more: &[&str]) -> String {
    let frame = format!("animation.frame={frame}");
    let args = ["render", "scene.toml", "-o", "alone.exr", "-D", &frame];
    let stdout = succeed(folder, &[&args[..], more].concat());
    line(&stdout, "pixels ").trim_start_matches("pixels ").to_owned()
}

fn written(path: &Path) -> SystemTime {
    std::fs::metadata(path).unwrap().modified().unwrap()
}

#[test]
fn each_frame_is_a_job_of_its_own() {
    let folder = folder(3);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-4", "-o", "out/f.##.exr"];
    let stdout = succeed(path, &[&args[..], &["--workers", "2", "--threads", "1"]].concat());
    let report = report(&path.join("out/f.report.json"));
    assert_eq!(report["failed"], Value::Array(Vec::new()));
    let lines: Vec<&str> = stdout.lines().filter(|line| line.starts_with("frame ")).collect();
    assert_eq!(lines.len(), 4, "{stdout}");
    let mut pixels = Vec::new();
    for frame in 1..=4 {
        let record = of_frame(&report, frame);
        assert_eq!(record["pixels"], alone(path, frame, &[]), "frame {frame}");
        pixels.push(record["pixels"].as_str().unwrap());
        let image = path.join(format!("out/f.0{frame}.exr"));
        assert_eq!(record["image"], format!("out/f.0{frame}.exr"));
        assert!(image.with_extension("png").exists());
        // The same attributes as a separate job's, except for its name.
        for name in ["beamfarmScene", "beamfarmPassSet", "beamfarmPasses", "beamfarmSeed"] {
            assert_eq!(attribute(&image, name), attribute(&path.join("alone.exr"), name));
        }
        // In the order in which they finish.
        let start = format!("frame {frame} ({frame}/4): wrote out/f.0{frame}.exr, 3 passes in ");
        let said = lines.iter().find(|line| line.starts_with(&start));
        let said = said.unwrap_or_else(|| panic!("{stdout}"));
        assert!(said.ends_with(record["pixels"].as_str().unwrap()), "{said}");
        assert_eq!((&record["passes"], &record["stopped"]), (&3.into(), &"complete".into()));
        assert!(
            record["relative_standard_error"]
                .as_f64()
                .is_some_and(|error| error > 0.0)
        );
    }
    pixels.dedup();
    assert_eq!(pixels.len(), 4);
    assert!(
        stdout.contains("4 of 4 frames are there; out/f.report.json"),
        "{stdout}"
    );
}

/// Where pilots choose, each frame has its own pilot.
#[test]
fn pilots_choose_as_for_a_job_of_its_own() {
    let folder = folder_with(&moving("passes = 2", "[0.0, 0.5]"));
    let path = folder.path();
    std::fs::write(path.join("floor.obj"), FLOOR).unwrap();
    succeed(path, &["render", "scene.toml", "--frames", "3,9", "--budget", "2"]);
    let report = report(&path.join("scene.report.json"));
    for frame in [3, 9] {
        let image = path.join(format!("scene.000{frame}.exr"));
        let own = alone(path, frame, &["--budget", "2"]);
        assert_eq!(of_frame(&report, frame)["pixels"], own);
        for name in ["beamfarmPathsPerPass", "beamfarmBudget"] {
            assert_eq!(attribute(&image, name), attribute(&path.join("alone.exr"), name));
        }
    }
}

/// Frames that exist stay, whatever is requested later; more passes, another seed or another scene make another image.
#[test]
fn later_frames_come_to_those_that_are_there() {
    let folder = folder(2);
    let path = folder.path();
    let render = |frames: &str, more: &[&str]| {
        let args = ["render", "scene.toml", "-o", "f.####.exr", "--frames", frames];
        succeed(path, &[&args[..], more].concat())
    };
    render("1-5x2", &[]);
    let images = [1, 3, 5].map(|frame| path.join(format!("f.000{frame}.exr")));
    let times = images.each_ref().map(|image| written(image));
    let stdout = render("1-6", &[]);
    assert_eq!(times, images.each_ref().map(|image| written(image)));
    for frame in [1, 3, 5] {
        let kept = format!("frame {frame} ({frame}/6): f.000{frame}.exr is there already, with 2 passes");
        assert!(stdout.contains(&kept), "{stdout}");
    }
    let all = report(&path.join("f.report.json"));
    let frames = all["frames"].as_array().unwrap().iter();
    let frames: Vec<i64> = frames.filter_map(|record| record["frame"].as_i64()).collect();
    assert_eq!(frames, [1, 2, 3, 4, 5, 6]);

    // In another view only the PNGs differ.
    let pngs = images
        .each_ref()
        .map(|image| std::fs::read(image.with_extension("png")).unwrap());
    let stdout = render("1-5x2", &["--view", "agx"]);
    assert_eq!(stdout.matches("is there already").count(), 3, "{stdout}");
    assert_eq!(times, images.each_ref().map(|image| written(image)));
    for (image, before) in images.iter().zip(&pngs) {
        assert!(std::fs::read(image.with_extension("png")).unwrap() != *before);
    }
    render("1-5x2", &[]);
    assert!(
        pngs == images
            .each_ref()
            .map(|image| std::fs::read(image.with_extension("png")).unwrap())
    );

    // With nothing left to do it prints a note.
    let stdout = render("1-6", &[]);
    assert_eq!(stdout.matches("is there already").count(), 6, "{stdout}");
    // A smaller number of passes is there already.
    assert!(render("1", &["--passes", "1"]).contains("with 2 passes"));
    render("1", &["--passes", "3"]);
    assert_eq!(attribute(&images[0], "beamfarmPasses"), "3");
    render("3", &["--seed", "7"]);
    assert_eq!(attribute(&images[1], "beamfarmSeed"), "7");
    // A layer that it lacks.
    render("5", &["--aov", "depth"]);
    assert_ne!(written(&images[2]), times[2]);
    // Another version of the program may render other bits.
    let mut bytes = std::fs::read(&images[2]).unwrap();
    let bits = attribute(&images[2], "beamfarmEngine");
    let at = bytes.windows(bits.len()).position(|window| window == bits.as_bytes());
    bytes[at.unwrap() + bits.len() - 1] = b'0';
    std::fs::write(&images[2], bytes).unwrap();
    render("5", &[]);
    assert_eq!(attribute(&images[2], "beamfarmEngine"), bits);
    let scene = std::fs::read_to_string(path.join("scene.toml")).unwrap();
    let times = images.each_ref().map(|image| written(image));
    std::fs::write(path.join("scene.toml"), scene.replace("power = 100.0", "power = 50.0")).unwrap();
    render("5", &[]);
    assert_ne!(written(&images[2]), times[2]);
    assert_eq!(
        report(&path.join("f.report.json"))["frames"][4]["pixels"],
        alone(path, 5, &[])
    );
}

#[test]
fn lists_that_are_none_are_told() {
    let folder = folder(2);
    let path = folder.path();
    let refused = |more: &[&str], expected: &str| {
        let (code, stderr) = fail(path, &[&["render", "scene.toml"], more].concat());
        assert_eq!(code, 2, "{more:?}: {stderr}");
        assert!(stderr.contains(expected), "{more:?}: {stderr}");
    };
    refused(
        &["--frames", "1-"],
        "expected a frame as in 7, frames as in 1-100 or 1-100x2",
    );
    refused(&["--frames", "9-3"], "the first frame comes after the last");
    refused(
        &["--frames", "20-30"],
        "--frames: frame 25: the scene has frames 1 to 24",
    );
    refused(
        &["--frames", "1-2", "-o", "f.exr"],
        "--frames: f.exr: expected a name with a run of # for the frame's number that ends in .exr, as in frame.####.exr",
    );
    refused(&["--frames", "1-2", "--resume"], "--resume");
    refused(&["--frames", "1-2", "--first-pass", "3"], "--first-pass");
    refused(&["--seed-per-frame"], "--frames");
    refused(&["--frames", "1-2", "-D", "animation.frame=3"], "animation.frame");
    refused(&["--frames", "1-2", "-o", "f.####.png"], "f.####.png: expected a name");
    let scene = std::fs::read_to_string(path.join("scene.toml")).unwrap();
    std::fs::write(path.join("scene.toml"), scene.replace("frames = [1, 24]\n", "")).unwrap();
    refused(&["--frames", "1-2"], "the scene does not say which frames there are");
}

#[test]
fn each_frame_ends_by_itself() {
    let folder = folder(2);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1,20"];
    succeed(path, &[&args[..], &["--target-error", "20%", "-o", "e.#.exr"]].concat());
    let all = report(&path.join("e.report.json"));
    for frame in [1, 20] {
        let record = of_frame(&all, frame);
        assert_eq!(record["stopped"], "target-error");
        assert!(
            record["relative_standard_error"]
                .as_f64()
                .is_some_and(|error| error <= 0.2)
        );
        assert_eq!(record["pixels"], alone(path, frame, &["--target-error", "20%"]));
    }
    // Frames that have it are not rendered again; those rendered with less are.
    let again = succeed(path, &[&args[..], &["--target-error", "20%", "-o", "e.#.exr"]].concat());
    assert_eq!(again.matches("is there already").count(), 2, "{again}");
    let less = succeed(path, &[&args[..], &["--target-error", "10%", "-o", "e.#.exr"]].concat());
    assert!(!less.contains("is there already"), "{less}");

    let begun = std::time::Instant::now();
    succeed(path, &[&args[..], &["--time", "2s", "-o", "t.#.exr"]].concat());
    // Each frame has its own time budget.
    assert!(begun.elapsed().as_secs_f64() > 4.0);
    let all = report(&path.join("t.report.json"));
    for frame in [1, 20] {
        let record = of_frame(&all, frame);
        assert_eq!(record["stopped"], "time");
        let passes = record["passes"].as_u64().unwrap();
        assert!(passes > 2, "{record}");
        let own = alone(path, frame, &["--passes", &passes.to_string()]);
        assert_eq!(record["pixels"], own, "frame {frame}");
    }
}

#[test]
fn noise_stands_still_or_has_a_seed_a_frame() {
    let folder = folder(1);
    let path = folder.path();
    let args = ["render", "scene.toml", "--seed", "5", "--frames", "1-2"];
    succeed(path, &[&args[..], &["-o", "still.#.exr"]].concat());
    succeed(path, &[&args[..], &["--seed-per-frame", "-o", "grain.#.exr"]].concat());
    let [still, grain] = ["still", "grain"].map(|name| report(&path.join(format!("{name}.report.json"))));
    let seeds = |all: &Value| [1, 2].map(|frame| of_frame(all, frame)["seed"].as_u64().unwrap());
    assert_eq!(seeds(&still), [5, 5]);
    let own = seeds(&grain);
    assert_ne!(own[0], own[1]);
    for (frame, seed) in [1, 2].into_iter().zip(own) {
        let record = of_frame(&grain, frame);
        assert_eq!(record["pixels"], alone(path, frame, &["--seed", &seed.to_string()]));
        assert_ne!(record["pixels"], of_frame(&still, frame)["pixels"]);
    }
    // The same seeds again, so that existing frames stay.
    let again = succeed(path, &[&args[..], &["--seed-per-frame", "-o", "grain.#.exr"]].concat());
    assert_eq!(again.matches("is there already").count(), 2, "{again}");
}

/// A floor whose second frame is missing.
#[test]
fn a_frame_that_fails_names_itself_and_the_others_go_on() {
    let scene = moving(&format!("passes = 1, paths = 400, {BY_PHOTONS}"), "[0.0, 0.0]");
    let folder = folder_with(&scene.replace("floor.obj", "floor_##.obj"));
    let path = folder.path();
    let floor = |frame: i64| path.join(format!("floor_0{frame}.obj"));
    for frame in [1, 3, 4] {
        std::fs::write(floor(frame), FLOOR).unwrap();
    }
    std::fs::write(floor(4), "v 0 0 0\nf 1 2 3\n").unwrap();
    let args = ["render", "scene.toml", "--frames", "1-5", "-o", "f.#.exr"];
    let output = run(path, &args);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{stderr}");
    let (_, list) = stderr.split_once("error: 3 of 5 frames failed:\n").unwrap_or_default();
    let named: Vec<&str> = list.lines().map(str::trim).collect();
    assert_eq!(named.len(), 3, "{stderr}");
    for (line, frame) in named.iter().zip([2, 4, 5]) {
        assert!(line.starts_with(&format!("frame {frame}: ")), "{stderr}");
        assert!(line.contains(&format!("floor_0{frame}.obj")), "{stderr}");
    }
    assert!(text(&output.stdout).contains("2 of 5 frames are there"));
    let all = report(&path.join("f.report.json"));
    assert_eq!(all["failed"], serde_json::json!([2, 4, 5]));
    assert_eq!(of_frame(&all, 3)["pixels"], alone(path, 3, &[]));
    assert_eq!(of_frame(&all, 2)["stopped"], "failed");

    // Failed frames are tried again, and only those.
    for frame in [2, 4, 5] {
        std::fs::write(floor(frame), FLOOR).unwrap();
    }
    let stdout = succeed(path, &args);
    assert_eq!(stdout.matches("is there already").count(), 2, "{stdout}");
    let all = report(&path.join("f.report.json"));
    assert_eq!(all["failed"], Value::Array(Vec::new()));
    assert_eq!(of_frame(&all, 4)["pixels"], alone(path, 4, &[]));

    // When the scene itself is wrong, there is one message.
    let broken = std::fs::read_to_string(path.join("scene.toml")).unwrap();
    std::fs::write(path.join("scene.toml"), broken.replace("radius = 0.35", "radius = -1")).unwrap();
    let output = run(path, &["render", "scene.toml", "--frames", "1-5", "-o", "g.#.exr"]);
    assert_eq!(output.status.code(), Some(5));
    let stderr = text(&output.stderr);
    assert!(
        stderr.contains("error: all 5 frames failed: ") && stderr.contains("radius"),
        "{stderr}"
    );
}

/// A signal ends all frames; the current one keeps what it has.
#[test]
fn an_interrupted_command_keeps_what_is_there() {
    let folder = folder(2);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-24", "--time", "1h"];
    let mut command = beamfarm(path, &[&args[..], &["-o", "f.##.exr"]].concat());
    command.args(["--log", "debug"]);
    let mut render = spawn(command);
    render.log.wait_for("block=pass 0 pixels=");
    render.signal("-INT");
    let output = render.finish();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(path.join("f.01.exr").exists());
    assert!(!path.join("f.02.exr").exists());
    let all = report(&path.join("f.report.json"));
    assert_eq!(of_frame(&all, 1)["stopped"], "asked");
    let passes = of_frame(&all, 1)["passes"].as_u64().unwrap();
    assert_eq!(
        of_frame(&all, 1)["pixels"],
        alone(path, 1, &["--passes", &passes.to_string()])
    );
    // Each frame has a job folder, and resumes from it.
    let passes = (passes + 40).to_string();
    let args = ["--frames", "1-2", "--job", "jobs", "--passes", &passes, "-o", "g.#.exr"];
    let mut command = beamfarm(path, &[&["render", "scene.toml"], &args[..]].concat());
    command.args(["--log", "debug"]);
    let mut render = spawn(command);
    // Or all of them, where passes are quick.
    let files = ["jobs/0001/checkpoint-1", "g.1.exr"].map(|name| path.join(name));
    wait_until("a checkpoint", || match files.iter().any(|file| file.exists()) {
        true => Ok(()),
        false => Err(render.log.so_far().to_owned()),
    });
    render.kill();
    let stdout = succeed(path, &[&["render", "scene.toml"], &args[..]].concat());
    assert!(
        stdout.contains("resuming jobs/0001 with ") || stdout.contains("g.1.exr is there"),
        "{stdout}"
    );
    let all = report(&path.join("g.report.json"));
    for frame in [1, 2] {
        assert_eq!(
            of_frame(&all, frame)["pixels"],
            alone(path, frame, &["--passes", &passes])
        );
        // The image is written first: a kill in between leaves the image and nothing to resume.
        let was_killed_between = frame == 1 && stdout.contains("g.1.exr is there");
        let report = path.join(format!("jobs/000{frame}/report.json"));
        assert!(report.exists() || was_killed_between, "{stdout}");
    }
}
