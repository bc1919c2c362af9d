//! What other users of the machine, and clients without the token, may see and do.
#![cfg(unix)]

use crate::setup::{Process, beamfarm, fail, folder_with, run, scene, spawn, succeed, text, wait_until};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

const TOKEN: &str = "a-token-of-this-test";

/// Starts an endless render; also returns the address of its page, without a final slash.
fn start_render(folder: &Path, token: Option<&str>) -> (Process, String) {
    let mut command = beamfarm(folder, &["render", "scene.toml", "--job", "a.job", "--time", "1h"]);
    command.env_remove("BEAMFARM_TOKEN");
    if let Some(token) = token {
        command.env("BEAMFARM_TOKEN", token);
    }
    let mut render = spawn(command);
    let page = render.log.wait_for("page: ");
    (render, page.trim_end_matches('/').to_owned())
}

#[test]
fn a_local_render_is_for_its_user_alone() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    let (mut render, url) = start_render(folder, None);
    // Its token is random, and is not printed where the output may end up in a file.
    assert!(url.starts_with("http://127.0.0.1:") && !url.contains('#'), "{url}");
    for call in ["status", "cancel", "pause"] {
        let (code, message) = fail(folder, &[call, &url]);
        assert!(code == 6 && message.contains("token"), "{code} {message}");
    }
    let stranger = run(folder, &["worker", "--connect", &url, "--threads", "1"]);
    assert_eq!(stranger.status.code(), Some(6), "{}", text(&stranger.stderr));
    let mode = |path: &str| folder.join(path).metadata().unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("a.job"), 0o700);
    render.kill();

    // Whoever wants to steer it sets the token beforehand.
    let (mut render, url) = start_render(folder, Some(TOKEN));
    let mut cancel = beamfarm(folder, &["cancel", &url]);
    cancel.env("BEAMFARM_TOKEN", TOKEN);
    let cancelled = spawn(cancel).finish();
    assert!(cancelled.status.success(), "{}", text(&cancelled.stderr));
    assert!(render.wait().code().is_some_and(|code| [0, 4].contains(&code)));
}

#[test]
fn secrets_that_others_read_and_tokens_that_are_none_are_told() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    std::fs::write(folder.join("token"), TOKEN).unwrap();
    let serve = [
        "serve",
        "scene.toml",
        "--listen",
        "127.0.0.1:0",
        "--token-file",
        "token",
    ];
    let start = |mode| {
        let permissions = std::fs::Permissions::from_mode(mode);
        std::fs::set_permissions(folder.join("token"), permissions).unwrap();
        let mut server = spawn(beamfarm(folder, &serve));
        let url = server.out.wait_for("listening on ");
        (server, url)
    };
    let (mut server, _) = start(0o644);
    server.log.wait_until_seen("token can be read by other users");
    server.kill();
    let (mut server, url) = start(0o600);
    for _ in 0..3 {
        let mut status = beamfarm(folder, &["status", &url]);
        status.env("BEAMFARM_TOKEN", "another-token-than-that");
        let refused = spawn(status).finish();
        assert_eq!(refused.status.code(), Some(6), "{}", text(&refused.stderr));
    }
    let log = server.log.so_far().to_owned();
    assert!(!log.contains("other users"), "{log}");
    assert_eq!(log.matches("requests with a wrong token").count(), 1, "{log}");
    assert!(log.contains("the last from 127.0.0.1") && !log.contains(TOKEN), "{log}");
    let status = succeed(folder, &["status", &url, "--token-file", "token"]);
    assert!(status.contains("running"), "{status}");
}

/// Strangers take connections, but not the open files that the coordinator needs.
#[test]
fn strangers_take_no_files_away() {
    let folder = folder_with(&scene([16, 12], 100_000, 200));
    let folder = folder.path();
    let program = env!("CARGO_BIN_EXE_beamfarm");
    let mut command = Command::new("sh");
    let serve = format!("ulimit -n 140; exec {program} serve scene.toml --listen 127.0.0.1:0");
    command.current_dir(folder).args(["-c", &serve]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut server = spawn(command);
    let url = server.out.wait_for("listening on ");
    let address = url.trim_start_matches("http://").trim_end_matches('/');
    let _idle: Vec<TcpStream> = (0..200).map(|_| TcpStream::connect(address).unwrap()).collect();
    let _worker = spawn(beamfarm(folder, &["worker", "--connect", &url, "--threads", "1"]));
    wait_until("a checkpoint", || {
        match folder.join("scene.job/checkpoint-1").exists() {
            true => Ok(()),
            false => Err(server.log.so_far().to_owned()),
        }
    });
    assert!(succeed(folder, &["write", &url]).starts_with("wrote scene.exr"));
    let log = server.log.so_far();
    assert!(!log.contains("too many open files"), "{log}");
}
