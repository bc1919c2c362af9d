//! A server that is asked for its status and told what to do.

use crate::setup::{Process, beamfarm, fail, folder_with, line, run, scene, spawn, succeed, text, wait_until};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

fn status(folder: &Path, url: &str) -> Value {
    serde_json::from_str(&succeed(folder, &["status", url, "--json"])).unwrap()
}

/// A server that logs what it does, and its address.
fn start_server(folder: &Path) -> (Process, String) {
    let serve = ["serve", "scene.toml", "--listen", "127.0.0.1:0"];
    let told = ["--openjd", "--log-format", "json"];
    let mut server = spawn(beamfarm(folder, &[&serve[..], &told].concat()));
    let url = server.out.wait_for("listening on ");
    let configuration = server.log.wait_for("\"message\":\"configuration\"");
    for part in ["\"passes\":100000", "\"paths_per_pass\":200", "\"job\":\"scene-"] {
        assert!(configuration.contains(part), "{part} is not in {configuration}");
    }
    (server, url)
}

fn pause_and_extend(folder: &Path, url: &str) {
    assert_eq!(succeed(folder, &["pause", url]), "paused\n");
    assert_eq!(status(folder, url)["state"], "paused");
    assert_eq!(succeed(folder, &["resume", url]), "resumed\n");
    assert_eq!(status(folder, url)["state"], "running");
    succeed(folder, &["extend", url, "--passes", "100001"]);
    assert_eq!(status(folder, url)["limit"], 100_001);
    let (code, message) = fail(folder, &["extend", url, "--passes", "7"]);
    assert!(code == 2 && message.contains("100001"), "{code} {message}");
}

fn write_twice(folder: &Path, url: &str, server: &mut Process) {
    let exr = folder.join("scene.exr");
    assert!(succeed(folder, &["write", url]).starts_with("wrote scene.exr with "));
    std::fs::remove_file(&exr).unwrap();
    server.signal("-HUP");
    // The log also has the line of the previous write, so look at the file.
    wait_until("image after a hangup", || match exr.exists() {
        true => Ok(()),
        false => Err(server.log.so_far().to_owned()),
    });
}

/// Sends as many hangups as BEAMFARM_HANGUPS says. Each must give an image; none is sent while the previous image is
/// being written.
#[cfg(unix)]
#[test]
fn every_hangup_brings_an_image() {
    let hangups = std::env::var("BEAMFARM_HANGUPS").ok();
    let hangups: u32 = hangups.map_or(10, |text| text.parse().expect("BEAMFARM_HANGUPS"));
    let folder = folder_with(&scene([16, 12], 10_000_000, 200));
    let folder = folder.path();
    let (mut server, url) = start_server(folder);
    let work = ["worker", "--connect", &url, "--threads", "1"];
    let _workers = [(); 2].map(|()| spawn(beamfarm(folder, &work)));
    let exr = folder.join("scene.exr");
    for hangup in 0..hangups {
        server.signal("-HUP");
        wait_until("image after a hangup", || match std::fs::remove_file(&exr) {
            Ok(()) => Ok(()),
            Err(_) => Err(format!("hangup {hangup}: {}", server.log.so_far())),
        });
    }
}

/// A pause counts neither in the job's seconds nor in its rate.
#[test]
fn pauses_are_left_out() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    let (_server, url) = start_server(folder);
    let _worker = spawn(beamfarm(folder, &["worker", "--connect", &url, "--threads", "1"]));
    wait_until("fourth pass", || {
        let status = status(folder, &url);
        let there = status["prefix"].as_u64().is_some_and(|prefix| prefix >= 4);
        there.then_some(()).ok_or(status.to_string())
    });
    succeed(folder, &["pause", &url]);
    let elapsed = |status: &Value| status["elapsed"].as_f64().unwrap();
    let before = elapsed(&status(folder, &url));
    std::thread::sleep(Duration::from_secs(3));
    let after = status(folder, &url);
    assert!(elapsed(&after) < before + 1.0, "{before} {after}");
    succeed(folder, &["resume", &url]);
    std::thread::sleep(Duration::from_secs(1));
    let going_on = elapsed(&status(folder, &url));
    assert!(going_on > elapsed(&after), "{going_on} {after}");
}

/// Before there is anything to write: it is written as soon as there is.
#[cfg(unix)]
#[test]
fn a_hangup_is_not_lost() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    let (mut server, url) = start_server(folder);
    for _ in 0..20 {
        server.signal("-HUP");
    }
    let _worker = spawn(beamfarm(folder, &["worker", "--connect", &url, "--threads", "1"]));
    let exr = folder.join("scene.exr");
    wait_until("image after a hangup", || match exr.exists() {
        true => Ok(()),
        false => Err(server.log.so_far().to_owned()),
    });
}

#[test]
fn a_server_is_watched_paused_extended_written_and_cancelled() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    let (mut server, url) = start_server(folder);
    let begun = server.log.so_far().len();
    let (code, message) = fail(folder, &["write", &url]);
    assert!(code == 1 && message.contains("no pass is complete"), "{code} {message}");

    let worker = ["worker", "--connect", &url, "--threads", "1"];
    let mut worker = spawn(beamfarm(folder, &worker));
    let progress = server.out.wait_for("openjd_status: ");
    assert!(progress.contains(" of 100000 passes"), "{progress}");
    let said = server.out.so_far().len();
    wait_until("fourth pass", || {
        let status = status(folder, &url);
        let there = status["prefix"].as_u64().is_some_and(|prefix| prefix >= 4);
        there.then_some(()).ok_or(status.to_string())
    });
    pause_and_extend(folder, &url);
    // It is estimated only now and then.
    let error = wait_until("estimate of the error", || {
        let status = status(folder, &url);
        let error = status["relative_standard_error"].as_f64();
        error.ok_or(status.to_string())
    });
    assert!(error > 0.0);
    let stood = succeed(folder, &["status", &url]);
    assert!(line(&stood, "passes").contains("of 100001 ("), "{stood}");
    write_twice(folder, &url, &mut server);

    let cancelled = succeed(folder, &["cancel", &url]);
    assert!(cancelled.starts_with("cancelled with "), "{cancelled}");
    let output = server.finish();
    let (stdout, log) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{log}");
    line(&stdout[said..], "openjd_progress: 0.");
    line(&stdout[said..], "wrote scene.exr");
    // Every line is an object, and names the job.
    for line in log[begun..].lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let job = line["span"]["job"].as_str();
        assert!(job.is_some_and(|job| job.starts_with("scene-")), "{line}");
    }
    assert_eq!(worker.wait().code(), Some(0));
    let (code, message) = fail(folder, &["status", &url]);
    assert!(code == 3 && message.contains("cannot reach"), "{code} {message}");
}

#[test]
fn a_job_that_fails_tells_openjd() {
    let folder = folder_with(&scene([16, 12], 2, 200));
    let args = ["render", "scene.toml", "--openjd", "--time", "1ms"];
    let output = run(folder.path(), &args);
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(4), "{stdout}");
    let failure = line(&stdout, "openjd_fail: ");
    assert!(failure.contains("before the first pass"), "{failure}");
}
