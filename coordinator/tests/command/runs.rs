//! Rendering on one machine and over several: exit codes, stdout and stderr, and what survives a signal.

use crate::setup::{
    attribute, beamfarm, fail, find_attribute, folder_with, line, run, scene, signal, spawn, succeed, text,
};
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

fn small_scene() -> String {
    scene([48, 32], 6, 400)
}

fn folder() -> TempDir {
    folder_with(&small_scene())
}

#[test]
fn one_command_renders_and_the_crew_does_not_change_a_bit() {
    let folder = folder();
    let path = folder.path();
    let first = succeed(path, &["render", "scene.toml"]);
    assert!(path.join("scene.exr").exists() && path.join("scene.png").exists());
    let pixels = line(&first, "pixels");
    for (workers, threads) in [("1", "1"), ("2", "1"), ("4", "1"), ("1", "3")] {
        let again = succeed(
            path,
            &[
                "render",
                "scene.toml",
                "-o",
                "b.exr",
                "--workers",
                workers,
                "--threads",
                threads,
            ],
        );
        assert_eq!(line(&again, "pixels"), pixels, "{workers} x {threads}");
    }
    let compared = succeed(path, &["compare", "scene.exr", "b.exr"]);
    assert!(compared.contains("identical"), "{compared}");
}

/// The pilot is the same everywhere, and the job folder keeps its result: a job begun with a budget goes on with it.
#[test]
fn a_budget_changes_radii_and_not_what_is_promised() {
    let folder = folder();
    let path = folder.path();
    let render = |output: &str, more: &[&str]| {
        let args = ["render", "scene.toml", "-o", output, "--passes", "4"];
        succeed(path, &[&args[..], more].concat())
    };
    let shrinking = render("shrinking.exr", &[]);
    assert_eq!(
        line(&render("inf.exr", &["--budget", "inf"]), "pixels"),
        line(&shrinking, "pixels")
    );
    let one = render("one.exr", &["--budget", "4", "--workers", "1"]);
    let two = render("two.exr", &["--budget", "4", "--workers", "2"]);
    assert_ne!(line(&one, "pixels"), line(&shrinking, "pixels"));
    assert_eq!(line(&one, "pixels"), line(&two, "pixels"));
    let bytes = std::fs::read(path.join("one.exr")).unwrap();
    assert!(bytes.windows(14).any(|name| name == b"beamfarmBudget"));

    // The first two of four passes, then the others.
    let job = ["--job", "job", "--budget", "4", "-o", "parts.exr"];
    for passes in ["2", "4"] {
        let args = ["render", "scene.toml", "--passes", passes];
        let made = succeed(path, &[&args[..], &job].concat());
        if passes == "4" {
            assert_eq!(line(&made, "pixels"), line(&one, "pixels"));
        }
    }
    let other = ["render", "scene.toml", "--passes", "6", "--job", "job"];
    let (_, stderr) = fail(path, &[&other[..], &["-o", "parts.exr"]].concat());
    assert!(stderr.contains("budget 4 passes at "), "{stderr}");

    let (code, stderr) = fail(path, &["render", "scene.toml", "--budget", "0"]);
    assert_eq!(code, 2);
    assert!(stderr.contains("expected a number of passes, or inf"), "{stderr}");
}

#[test]
fn quiet_says_nothing() {
    let folder = folder();
    let stdout = succeed(folder.path(), &["render", "scene.toml", "--quiet", "--passes", "2"]);
    assert_eq!(stdout, "");
    assert!(folder.path().join("scene.exr").exists());
}

#[test]
fn a_killed_worker_does_not_change_a_bit() {
    let folder = folder();
    let path = folder.path();
    let passes = "200";
    let args = [
        "render",
        "scene.toml",
        "--passes",
        passes,
        "--workers",
        "2",
        "--threads",
        "1",
    ];
    let undisturbed = succeed(path, &args);
    let mut command = beamfarm(path, &args);
    command.args(["--log", "debug", "-o", "killed.exr"]);
    let mut render = spawn(command);
    let rest = render.log.wait_for("started worker process ");
    let pid = rest.split(' ').next().unwrap();
    render.log.wait_for("block=pass 3 lease=");
    signal("-KILL", pid);
    let output = render.finish();
    let log = text(&output.stderr);
    assert!(output.status.success(), "{log}");
    assert!(log.contains("was killed by signal 9; starting another one"), "{log}");
    let stdout = text(&output.stdout);
    assert_eq!(line(stdout, "pixels"), line(&undisturbed, "pixels"));
}

#[test]
fn workers_that_keep_dying_end_the_job() {
    let folder = folder();
    let mut command = beamfarm(folder.path(), &["render", "scene.toml", "--workers", "1"]);
    // A pass that takes longer than its workers live.
    command.args(["--paths", "50000000", "--log", "info"]);
    let mut render = spawn(command);
    for _ in 0..5 {
        let rest = render.log.wait_for("started worker process ");
        signal("-KILL", rest.split(' ').next().unwrap());
    }
    let output = render.finish();
    let log = text(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{log}");
    assert!(log.contains("5 workers died in a row"), "{log}");
    assert!(!folder.path().join("scene.exr").exists());
}

#[test]
fn an_interrupted_job_writes_what_is_complete() {
    let folder = folder();
    let mut command = beamfarm(folder.path(), &["render", "scene.toml", "--time", "1h"]);
    command.args(["--log", "debug"]);
    let mut render = spawn(command);
    render.log.wait_for("block=pass 0 pixels=");
    render.signal("-INT");
    let output = render.finish();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(line(text(&output.stdout), "wrote").contains("scene.exr"));
    assert!(folder.path().join("scene.exr").exists());
}

/// Sent to a process, and a moment later to its whole group, as `timeout` does.
#[test]
fn two_signals_at_once_are_one() {
    let folder = folder();
    let mut command = beamfarm(folder.path(), &["render", "scene.toml", "--time", "1h"]);
    command.args(["--log", "debug"]);
    let mut render = spawn(command);
    render.log.wait_for("block=pass 0 pixels=");
    render.signal("-TERM");
    render.signal("-TERM");
    let output = render.finish();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(folder.path().join("scene.exr").exists());
}

/// A deliberate second signal ends what should not be waited for.
#[cfg(unix)]
#[test]
fn a_second_signal_kills() {
    let folder = folder_with(&scene([64, 48], 3, 50_000_000));
    let folder = folder.path();
    let serve = ["serve", "scene.toml", "--listen", "127.0.0.1:0", "--log", "debug"];
    let mut server = spawn(beamfarm(folder, &serve));
    let url = server.out.wait_for("listening on ");
    let work = ["worker", "--connect", &url, "--threads", "1", "--grace", "1h"];
    let mut worker = spawn(beamfarm(folder, &work));
    // A worker that has no pass yet has nothing to finish. The lease is on its way when the signal comes.
    server.log.wait_for("leased ");
    std::thread::sleep(Duration::from_millis(300));
    worker.signal("-TERM");
    std::thread::sleep(Duration::from_millis(1300));
    assert!(worker.is_running());
    worker.signal("-TERM");
    assert_eq!(worker.wait().code(), Some(128 + 15));
}

/// The reader of the output may be gone, or the disk that it goes to full: the work is still done. It is a failure
/// where the text is all that was requested.
#[cfg(target_os = "linux")]
#[test]
fn what_cannot_be_said_stops_no_work() {
    let folder = folder();
    let path = folder.path();
    succeed(path, &["render", "scene.toml", "-o", "a.exr"]);
    for (args, code) in [
        (&["render", "scene.toml", "-o", "b.exr", "--log", "debug"][..], 0),
        (&["replay", "scene.toml", "--pass", "1"], 0),
        (&["convert", "scene.toml", "-o", "c.toml"], 2),
        (&["compare", "a.exr", "a.exr"], 1),
        (&["explain", "scene.toml"], 1),
        (&["schema"], 1),
    ] {
        let full = || std::fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = beamfarm(path, args);
        command.stdout(full()).stderr(full());
        assert_eq!(spawn(command).finish().status.code(), Some(code), "{args:?}, full");
        let (reader, writer) = std::io::pipe().unwrap();
        let mut command = beamfarm(path, args);
        command.stdout(writer.try_clone().unwrap()).stderr(writer);
        drop(reader);
        let expected = if code == 1 { 0 } else { code };
        let ended = spawn(command).finish().status;
        assert_eq!(ended.code(), Some(expected), "{args:?}, closed");
    }
    assert!(path.join("b.exr").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn workers_die_with_their_parent() {
    let folder = folder();
    let mut command = beamfarm(folder.path(), &["render", "scene.toml", "--time", "1h"]);
    command.args(["--log", "info", "--workers", "1", "--threads", "1"]);
    let mut render = spawn(command);
    let rest = render.log.wait_for("started worker process ");
    let worker = rest.split(' ').next().unwrap();
    assert!(Path::new("/proc").join(worker).exists());
    render.kill();
    // The log's pipe closes only when the worker, which shares it, is gone.
    render.log.wait_for_end();
}

#[test]
fn a_server_and_a_worker_make_the_same_picture() {
    let folder = folder();
    let path = folder.path();
    let alone = succeed(path, &["render", "scene.toml"]);
    let mut command = beamfarm(path, &["serve", "scene.toml", "--listen", "127.0.0.1:0"]);
    command.args(["-o", "served.exr", "--log", "info"]);
    let mut server = spawn(command);
    let url = server.out.wait_for("listening on ");
    let worker = run(path, &["worker", "--connect", &url, "--threads", "1"]);
    let stderr = String::from_utf8(worker.stderr).unwrap();
    assert_eq!(worker.status.code(), Some(0), "{stderr}");
    assert_eq!(worker.stdout, b"");
    let server = server.finish();
    assert!(server.status.success(), "{}", text(&server.stderr));
    assert_eq!(line(text(&server.stdout), "pixels"), line(&alone, "pixels"));
    // The worker kept the scene for the next time.
    assert!(path.join("cache").join("beamfarm").read_dir().unwrap().count() > 0);
}

#[test]
fn a_worker_without_a_coordinator_says_so() {
    let folder = folder();
    let args = [
        "worker",
        "--connect",
        "127.0.0.1:1",
        "--patience",
        "0s",
        "--threads",
        "1",
    ];
    let (code, stderr) = fail(folder.path(), &args);
    assert_eq!(code, 3);
    assert!(stderr.contains("cannot reach the coordinator"), "{stderr}");
}

#[test]
fn a_replayed_pass_has_the_pixels_of_the_farms() {
    let folder = folder();
    let path = folder.path();
    let output = run(path, &["render", "scene.toml", "--seed", "5", "--log", "debug"]);
    let log = String::from_utf8(output.stderr).unwrap();
    for pass in ["0", "3"] {
        let of_pass = |l: &&str| l.contains(&format!("block=pass {pass} pixels="));
        let logged = log.lines().find(of_pass).unwrap();
        let logged = logged.split("pixels=").nth(1).unwrap().trim_matches('"');
        let args = ["replay", "scene.toml", "--pass", pass, "--seed", "5", "-o", "pass.exr"];
        let replayed = succeed(path, &args);
        assert!(line(&replayed, "pass").ends_with(logged), "{replayed} {logged}");
        assert!(path.join("pass.exr").exists());
    }
}

#[test]
fn scenes_are_explained() {
    let folder = folder();
    let stdout = succeed(folder.path(), &["explain", "scene.toml"]);
    assert!(line(&stdout, "scene ").len() > 64);
}

#[test]
fn bad_scenes_are_named_by_file_and_line() {
    let folder = folder();
    let path = folder.path();
    std::fs::create_dir(path.join("sub")).unwrap();
    let bad = small_scene().replace("sigma_a = 0.1", "sigma_a = -0.1");
    let number = 1 + bad.lines().position(|l| l.starts_with("sigma_a")).unwrap();
    std::fs::write(path.join("sub/bad.toml"), bad).unwrap();
    let expected = format!("sub/bad.toml:{number}: ");
    for command in ["render", "serve", "explain"] {
        let (code, stderr) = fail(path, &[command, "sub/bad.toml"]);
        assert_eq!(code, 2);
        assert!(stderr.starts_with(&expected), "{stderr}");
        assert!(stderr.contains("sigma_a"), "{stderr}");
    }
    let (code, stderr) = fail(path, &["render", "missing.toml"]);
    assert_eq!(code, 2);
    assert!(stderr.starts_with("missing.toml"), "{stderr}");
}

#[test]
fn wrong_usage_is_told_before_anything_is_rendered() {
    let folder = folder();
    let cases: [(&[&str], &str); 15] = [
        (&[], "Usage"),
        (&["rendr"], "render"),
        (&["render"], "SCENE"),
        (&["render", "scene.toml", "--passes", "0"], "--passes"),
        (&["render", "scene.toml", "--passes", "-3"], "-3"),
        (&["render", "scene.toml", "--paths", "0"], "--paths"),
        (&["render", "scene.toml", "--workers", "0"], "--workers"),
        (&["render", "scene.toml", "--alpha", "1"], "alpha is 1"),
        (&["render", "scene.toml", "--alpha", "NaN"], "alpha is NaN"),
        (&["render", "scene.toml", "--time", "soon"], "--time"),
        (&["render", "scene.toml", "--view", "aces"], "standard, filmic, agx"),
        (&["render", "scene.toml", "--exposure", "nan"], "a number of stops"),
        (
            &["reference", "scene.toml", "--white-balance", "500"],
            "1000 to 25000 kelvin",
        ),
        (
            &["merge", "a.job", "-o", "a.exr", "--view", "raw"],
            "standard, filmic, agx",
        ),
        (&["render", "scene.toml", "-o", "a.tiff"], "ends in .exr"),
    ];
    for (args, message) in cases {
        let (code, stderr) = fail(folder.path(), args);
        assert_eq!(code, 2, "{args:?}");
        assert!(stderr.contains(message), "{args:?}: {stderr}");
    }
    let (code, stderr) = fail(folder.path(), &["render", "scene.toml", "-o", "no/where/a.exr"]);
    assert_eq!(code, 1, "{stderr}");
    assert!(stderr.contains("no/where"), "{stderr}");
    let (code, stderr) = fail(folder.path(), &["compare", "scene.toml", "scene.toml"]);
    assert_eq!(code, 2);
    assert!(stderr.contains("scene.toml"), "{stderr}");
}

#[test]
fn help_teaches() {
    let folder = folder();
    let help = succeed(folder.path(), &["--help"]);
    for text in [
        "Examples:",
        "Exit codes:",
        "render",
        "serve",
        "worker",
        "replay",
        "compare",
        "explain",
    ] {
        assert!(help.contains(text), "{help}");
    }
    for command in ["render", "serve", "worker", "replay", "compare", "explain", "convert"] {
        succeed(folder.path(), &[command, "--help"]);
    }
}

#[test]
fn layers_stand_beside_the_same_beauty() {
    let folder = folder();
    let folder = folder.path();
    let plain = succeed(folder, &["render", "scene.toml", "-o", "plain.exr"]);
    let layered = succeed(
        folder,
        &[
            "render",
            "scene.toml",
            "-o",
            "all.exr",
            "--aov",
            "all",
            "--workers",
            "2",
        ],
    );
    assert_eq!(line(&plain, "pixels"), line(&layered, "pixels"));
    let channels = |file: &str| {
        let image = exr::image::read::read_first_flat_layer_from_file(folder.join(file)).unwrap();
        let list = &image.layer_data.channel_data.list;
        list.iter().map(|c| c.name.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(channels("plain.exr"), ["B", "G", "R"]);
    #[rustfmt::skip]
    let expected = [
        "A", "B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "beam_density.Y", "depth.Z", "direct.B", "direct.G", "direct.R",
        "light_lights[0].B", "light_lights[0].G", "light_lights[0].R", "motion.u", "motion.v", "normal.X", "normal.Y", "normal.Z",
        "odd.B", "odd.G", "odd.R", "stderr.B", "stderr.G", "stderr.R", "surface.B", "surface.G", "surface.R", "targets.Y", "volume.B", "volume.G", "volume.R",
    ];
    let (mattes, others): (Vec<String>, Vec<String>) = channels("all.exr")
        .into_iter()
        .partition(|name| name.starts_with("Crypto"));
    assert_eq!(others, expected);
    assert_eq!(mattes.len(), 2 * 3 * 4, "{mattes:?}");
    let (code, message) = fail(folder, &["render", "scene.toml", "--aov", "deep"]);
    assert!(code == 2 && message.contains("beam_density"), "{message}");
}

/// A denoised picture is written next to the image, which keeps its bits, and is labelled as biased; `denoise` makes
/// the same picture from the image.
#[test]
fn a_denoised_picture_stands_beside_the_image() {
    let folder = folder();
    let folder = folder.path();
    let plain = succeed(folder, &["render", "scene.toml", "-o", "plain.exr"]);
    let both = succeed(folder, &["render", "scene.toml", "-o", "both.exr", "--denoise"]);
    assert_eq!(line(&plain, "pixels"), line(&both, "pixels"));
    assert!(both.contains("wrote both.denoised.exr"), "{both}");
    assert!(folder.join("both.denoised.png").exists() && !folder.join("plain.denoised.exr").exists());
    let denoised = folder.join("both.denoised.exr");
    assert!(attribute(&denoised, "beamfarmDenoised").starts_with("biased"));
    assert_eq!(attribute(&denoised, "beamfarmPasses"), "6");
    assert_eq!(find_attribute(&denoised, "beamfarmPassSet"), None);
    assert_eq!(find_attribute(&folder.join("both.exr"), "beamfarmDenoised"), None);

    let said = succeed(folder, &["denoise", "both.exr", "-o", "again.exr"]);
    assert!(said.contains("biased, of 6 passes"), "{said}");
    let compared = succeed(folder, &["compare", "both.denoised.exr", "again.exr"]);
    assert!(compared.contains("identical"), "{compared}");
    let (code, message) = fail(folder, &["denoise", "plain.exr"]);
    assert!(
        code == 2 && message.contains("plain.exr: there is no channel odd.R"),
        "{message}"
    );
    let (code, message) = fail(folder, &["denoise", "both.exr", "-o", "both.exr"]);
    assert!(code == 2 && message.contains("another name"), "{message}");

    // One pass has no halves: the image is written all the same.
    let (one, stderr) = {
        let output = run(
            folder,
            &["render", "scene.toml", "-o", "one.exr", "--denoise", "--passes", "1"],
        );
        (output.status.success(), text(&output.stderr).to_owned())
    };
    assert!(one && stderr.contains("expected 2 at least"), "{stderr}");
    assert!(folder.join("one.exr").exists() && !folder.join("one.denoised.exr").exists());
}

const MITSUBA: &str = r#"<scene version="3.0.0">
<default name="spp" value="3"/><integrator type="volpath"/>
<sensor type="perspective"><float name="fov" value="50"/>
<transform name="to_world"><lookat origin="0, 1, 3" target="0, 1, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/><rfilter type="box"/></film>
<sampler type="independent"><integer name="sample_count" value="$spp"/></sampler><ref id="fog"/></sensor>
<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.5"/></medium>
<shape type="ply"><string name="filename" value="triangle.ply"/></shape>
<emitter type="point"><point name="position" x="0.5" y="2" z="0.5"/><rgb name="intensity" value="8"/></emitter>
</scene>"#;

const TRIANGLE: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n-1 0 0\n1 0 0\n0 2 0\n3 0 1 2\n";

#[test]
fn a_mitsuba_scene_renders_as_its_conversion_does() {
    let folder = folder();
    let folder = folder.path();
    std::fs::write(folder.join("room.xml"), MITSUBA).unwrap();
    std::fs::write(folder.join("triangle.ply"), TRIANGLE).unwrap();
    std::fs::create_dir(folder.join("out")).unwrap();
    let direct = succeed(folder, &["render", "room.xml", "--paths", "300", "--workers", "1"]);
    assert!(line(&direct, "3 passes").starts_with("3 passes"));
    let converted = run(folder, &["convert", "room.xml", "out/room.toml"]);
    let notes = String::from_utf8(converted.stderr).unwrap();
    assert!(converted.status.success(), "{notes}");
    assert!(notes.contains("room.xml:2: ") && notes.contains("volpath"), "{notes}");
    let text = std::fs::read_to_string(folder.join("out/room.toml")).unwrap();
    assert!(text.contains("file = \"../triangle.ply\""), "{text}");
    let native = succeed(folder, &["render", "out/room.toml", "--paths", "300", "--workers", "1"]);
    assert_eq!(line(&direct, "pixels"), line(&native, "pixels"));
    let more = succeed(
        folder,
        &["render", "room.xml", "-D", "spp=4", "--paths", "50", "-o", "more.exr"],
    );
    line(&more, "4 passes");
    succeed(folder, &["explain", "room.xml", "-D", "spp=4"]);
    let replayed = succeed(folder, &["replay", "room.xml", "--pass", "0", "--paths", "50"]);
    line(&replayed, "pass 0 pixels");
}

#[test]
fn mitsuba_scenes_that_cannot_be_used() {
    let folder = folder();
    let folder = folder.path();
    let odd = MITSUBA.replace(
        "</scene>",
        "<shape type=\"teapot\"/>\n<emitter type=\"collimated\"/></scene>",
    );
    std::fs::write(folder.join("room.xml"), odd).unwrap();
    std::fs::write(folder.join("triangle.ply"), TRIANGLE).unwrap();
    for args in [
        &["render", "room.xml"][..],
        &["serve", "room.xml"],
        &["replay", "room.xml", "--pass", "0"],
        &["explain", "room.xml"],
        &["convert", "room.xml", "room.toml"],
    ] {
        let (code, message) = fail(folder, args);
        let lines: Vec<_> = message.lines().collect();
        assert!(code == 2 && lines.len() == 2, "{args:?}: {message}");
        assert!(lines[0].starts_with("room.xml:10: ") && lines[0].contains("teapot"));
        assert!(lines[1].starts_with("room.xml:11: ") && lines[1].contains("collimated"));
    }
    assert!(!folder.join("room.toml").exists());
    let skipped = succeed(folder, &["render", "room.xml", "--skip-unsupported", "--paths", "50"]);
    assert_eq!(skipped.matches("left out: room.xml:1").count(), 2, "{skipped}");
    // A missing folder is created.
    succeed(folder, &["convert", "room.xml", "new/other.toml", "--skip-unsupported"]);
    assert!(folder.join("new/other.toml").exists());
    for (args, words) in [
        (
            &["render", "room.xml", "-D", "x=1", "--skip-unsupported"][..],
            "not used",
        ),
        (&["render", "room.xml", "-D", "x"], "NAME=VALUE"),
        (&["render", "scene.toml", "-D", "x=1"], "unknown field `x`"),
        (
            &["render", "scene.toml", "-D", "lights.1.power=1"],
            "there are 1, numbered from 0",
        ),
        (&["explain", "scene.toml", "--skip-unsupported"], ".xml"),
        (&["convert", "scene.toml", "other.toml"], ".xml"),
        (&["convert", "room.xml", "other.exr"], ".toml"),
    ] {
        let (code, message) = fail(folder, args);
        assert!(code == 2 && message.contains(words), "{args:?}: {message}");
    }
}

#[test]
fn reference_writes_its_error_and_threads_do_not_change_a_bit() {
    let folder = folder();
    let path = folder.path();
    let args = ["reference", "scene.toml", "--samples", "4"];
    let first = succeed(path, &args);
    assert!(path.join("scene-reference.png").exists());
    assert!(line(&first, "4 samples").contains("samples/s"));
    let image = exr::image::read::read_first_flat_layer_from_file(path.join("scene-reference.exr")).unwrap();
    let channels = &image.layer_data.channel_data.list;
    let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R", "stderr.B", "stderr.G", "stderr.R"]);

    let pixels = line(&first, "pixels");
    let again = |more: &[&str]| succeed(path, &[&args[..], more].concat());
    assert_eq!(line(&again(&["--threads", "3"]), "pixels"), pixels);
    assert_ne!(line(&again(&["--seed", "1"]), "pixels"), pixels);
    assert_ne!(line(&again(&["--max-depth", "1"]), "pixels"), pixels);
    assert_eq!(again(&["--quiet"]), "");
}

#[test]
fn reference_ends_on_time_and_needs_a_sample() {
    let folder = folder();
    let path = folder.path();
    let timed = succeed(path, &["reference", "scene.toml", "--time", "500ms"]);
    line(&timed, "wrote");
    let early = run(path, &["reference", "scene.toml", "--time", "0s", "-o", "early.exr"]);
    assert_eq!(early.status.code(), Some(4), "{}", text(&early.stderr));
    let said = line(text(&early.stdout), "wrote early.exr");
    assert!(said.contains("a coarse picture"), "{said}");
    assert!(find_attribute(&path.join("early.exr"), "beamfarmSamples").is_none());
    // The existing picture stays.
    let again = run(path, &["reference", "scene.toml", "--time", "0s"]);
    line(text(&again.stdout), "wrote scene-reference.sketch.exr");
    let (code, stderr) = fail(path, &["reference", "scene.toml", "--samples", "0"]);
    assert_eq!(code, 2, "{stderr}");
}
