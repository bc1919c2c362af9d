//! A server that is asked how it stands, and told what to do.

use crate::setup::{
    beamfarm, fail, finish, folder_with, line, scene, signal, spawn, succeed, wait_for,
};
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout};

/// Lines of stdout as they come.
fn stdout(child: &mut Child) -> std::io::Lines<BufReader<ChildStdout>> {
    BufReader::new(child.stdout.take().unwrap()).lines()
}

fn wait_for_line(lines: &mut impl Iterator<Item = std::io::Result<String>>, text: &str) -> String {
    let mut lines = lines.map(Result::unwrap);
    lines
        .find(|line| line.contains(text))
        .unwrap_or_else(|| panic!("no {text:?}"))
}

#[test]
fn a_server_is_watched_paused_extended_written_and_cancelled() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    let serve = [
        "serve",
        "scene.toml",
        "--listen",
        "127.0.0.1:0",
        "--openjd",
        "--log-format",
        "json",
    ];
    let (mut server, mut log) = spawn(beamfarm(folder, &serve));
    let mut lines = stdout(&mut server);
    let listening = wait_for_line(&mut lines, "listening on ");
    let url = listening.split_once("listening on ").unwrap().1.to_owned();
    let configuration = wait_for(&mut log, "\"message\":\"configuration\"");
    for part in [
        "\"passes\":100000",
        "\"paths_per_pass\":200",
        "\"job\":\"scene-",
    ] {
        assert!(
            configuration.contains(part),
            "{part} is not in {configuration}"
        );
    }
    let (code, message) = fail(folder, &["write", &url]);
    assert!(
        code == 1 && message.contains("no pass is complete"),
        "{code} {message}"
    );

    let (mut worker, worker_log) = spawn(beamfarm(
        folder,
        &["worker", "--connect", &url, "--threads", "1"],
    ));
    let progress = wait_for_line(&mut lines, "openjd_status: ");
    assert!(progress.contains(" of 100000 passes"), "{progress}");
    let status = || -> serde_json::Value {
        serde_json::from_str(&succeed(folder, &["status", &url, "--json"])).unwrap()
    };
    while status()["prefix"].as_u64().unwrap() < 4 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert_eq!(succeed(folder, &["pause", &url]), "paused\n");
    assert_eq!(status()["state"], "paused");
    assert_eq!(succeed(folder, &["resume", &url]), "resumed\n");
    assert_eq!(status()["state"], "running");
    succeed(folder, &["extend", &url, "--passes", "100001"]);
    assert_eq!(status()["limit"], 100_001);
    let (code, message) = fail(folder, &["extend", &url, "--passes", "7"]);
    assert!(code == 2 && message.contains("100001"), "{code} {message}");
    // It is estimated now and then.
    let error = loop {
        match status()["relative_standard_error"].as_f64() {
            Some(error) => break error,
            None => std::thread::sleep(std::time::Duration::from_millis(20)),
        }
    };
    assert!(error > 0.0);
    let text = succeed(folder, &["status", &url]);
    assert!(line(&text, "passes").contains("of 100001 (0"), "{text}");

    let exr = folder.join("scene.exr");
    assert!(succeed(folder, &["write", &url]).starts_with("wrote scene.exr with "));
    std::fs::remove_file(&exr).unwrap();
    signal("-HUP", &server.id().to_string());
    // The log has the line of the write before as well, so that the file itself tells.
    while !exr.exists() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }

    let cancelled = succeed(folder, &["cancel", &url]);
    assert!(cancelled.starts_with("cancelled with "), "{cancelled}");
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert!(
        rest.iter()
            .any(|line| line.starts_with("openjd_progress: 0.")),
        "{rest:?}"
    );
    assert!(
        rest.iter().any(|line| line.starts_with("wrote scene.exr")),
        "{rest:?}"
    );
    let (output, log) = finish(server, log);
    assert_eq!(output.status.code(), Some(0), "{log}");
    // Every line is an object, and names the job.
    for line in log.lines() {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        let job = line["span"]["job"].as_str();
        assert!(job.is_some_and(|job| job.starts_with("scene-")), "{line}");
    }
    assert_eq!(worker.wait().unwrap().code(), Some(0));
    drop(worker_log);
    let (code, message) = fail(folder, &["status", &url]);
    assert!(
        code == 3 && message.contains("cannot reach"),
        "{code} {message}"
    );
}

#[test]
fn a_job_that_fails_tells_openjd() {
    let folder = folder_with(&scene([16, 12], 2, 200));
    let args = ["render", "scene.toml", "--openjd", "--time", "1ms"];
    let output = beamfarm(folder.path(), &args).output().unwrap();
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(4), "{stdout}");
    let failure = line(&stdout, "openjd_fail: ");
    assert!(failure.contains("before the first pass"), "{failure}");
}
