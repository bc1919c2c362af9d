//! The farm that renders frames: workers that stay, a next frame that begins before the last one has ended, kills and
//! restarts.

use crate::frames::{alone, folder, of_frame, report};
use crate::setup::{Process, beamfarm, output, random, signal, spawn, succeed, text, wait_until};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

/// Each worker fetches and decodes once what frames have in common, and registers anew for each of them.
#[test]
fn workers_stay_and_load_nothing_twice() {
    let folder = folder(4);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-3", "-o", "f.#.exr"];
    let mut command = beamfarm(path, &args);
    command.args(["--workers", "1", "--threads", "1", "--log", "debug"]);
    let output = output(command);
    let log = text(&output.stderr);
    assert!(output.status.success(), "{log}");
    assert_eq!(log.matches("started worker process ").count(), 1, "{log}");
    assert_eq!(log.matches("fetching floor.obj ").count(), 1, "{log}");
    assert_eq!(log.matches("fetching scene.toml ").count(), 3, "{log}");
    assert_eq!(log.matches("rendering scene ").count(), 3, "{log}");
    // Lines name their frame.
    for frame in 1..=3 {
        let leased = |line: &&str| line.contains("leased ") && line.contains(&format!("job{{job=\"f.{frame}-"));
        assert!(log.lines().any(|line| leased(&line)), "frame {frame}: {log}");
    }
}

/// Three passes are one too many for two workers: the free one goes on with the next frame.
#[test]
fn a_frame_begins_while_the_last_passes_of_the_one_before_are_out() {
    let folder = folder(3);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-4", "-o", "f.#.exr"];
    let mut command = beamfarm(path, &args);
    // Long passes, so that the workers' calls to the coordinator take no noticeable time.
    command.args(["--workers", "2", "--threads", "1", "--paths", "40000", "--log", "debug"]);
    let output = output(command);
    let log = text(&output.stderr);
    assert!(output.status.success(), "{log}");
    let of = |frame: u32, what: &str| {
        let is_of = move |line: &&str| line.contains(&format!("job{{job=\"f.{frame}-"));
        let lines = log.lines().enumerate().filter(move |(_, line)| is_of(line));
        let places = lines.filter(|(_, line)| line.contains(what)).map(|(place, _)| place);
        places.collect::<Vec<usize>>()
    };
    let ahead = (1..4).filter(|frame| of(frame + 1, "leased ")[0] < *of(*frame, "delivered: ").last().unwrap());
    assert!(ahead.count() >= 2, "{log}");
    let all = report(&path.join("f.report.json"));
    for frame in 1..=4 {
        let own = alone(path, frame, &["--paths", "40000"]);
        assert_eq!(of_frame(&all, frame)["pixels"], own, "frame {frame}");
    }
}

/// Killed twice, once in the middle of a frame and once anywhere, and started again.
#[test]
fn frames_that_are_killed_go_on() {
    let folder = folder(2);
    let path = folder.path();
    let args = [
        "render",
        "scene.toml",
        "--frames",
        "all",
        "-o",
        "out/f.##.exr",
        "--job",
        "jobs",
    ];
    let more = ["--workers", "2", "--threads", "1", "--log", "debug"];
    let render = || spawn(beamfarm(path, &[&args[..], &more].concat()));
    let exists = |frame: u64| path.join(format!("out/f.{frame:02}.png")).exists();
    for kill in 0..2 {
        let mut killed = render();
        let last = 5 + 8 * kill + random(kill) % 4;
        wait_until("frame", || match exists(last) {
            true => Ok(()),
            false => Err(killed.log.so_far().to_owned()),
        });
        std::thread::sleep(Duration::from_millis(random(kill + 7) % 60));
        killed.kill();
        // Its workers die with it.
        killed.log.wait_for_end();
    }
    assert!(!exists(24));
    let first = path.join("out/f.01.exr");
    let written = first.metadata().unwrap().modified().unwrap();
    let output = render().finish();
    let stdout = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(first.metadata().unwrap().modified().unwrap(), written);
    assert!(
        stdout.contains("frame 1 (1/24): out/f.01.exr is there already"),
        "{stdout}"
    );
    assert!(stdout.contains("24 of 24 frames are there"), "{stdout}");
    let all = report(&path.join("out/f.report.json"));
    assert_eq!(all["frames"].as_array().map(Vec::len), Some(24), "{all}");
    for frame in 1..=24 {
        assert_eq!(
            of_frame(&all, frame)["pixels"],
            alone(path, frame, &[]),
            "frame {frame}"
        );
    }
}

#[test]
fn a_killed_worker_changes_no_frame() {
    let folder = folder(6);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-4", "-o", "f.#.exr"];
    let mut command = beamfarm(path, &args);
    command.args(["--workers", "2", "--threads", "1", "--paths", "20000", "--log", "debug"]);
    let mut render = spawn(command);
    let rest = render.log.wait_for("started worker process ");
    let first = rest.split(' ').next().unwrap().to_owned();
    render.log.wait_for("job{job=\"f.2-");
    signal("-KILL", &first);
    let output = render.finish();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let all = report(&path.join("f.report.json"));
    for frame in 1..=4 {
        let own = alone(path, frame, &["--paths", "20000"]);
        assert_eq!(of_frame(&all, frame)["pixels"], own, "frame {frame}");
    }
}

/// When every worker that is started dies, the current frame fails, and so does each later one.
#[test]
fn workers_that_keep_dying_fail_the_frame() {
    let folder = folder(1);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-2", "-o", "f.#.exr"];
    let mut command = beamfarm(path, &args);
    command.args(["--workers", "1", "--paths", "50000000", "--log", "info"]);
    let mut render = spawn(command);
    for _ in 0..10 {
        let rest = render.log.wait_for("started worker process ");
        signal("-KILL", rest.split(' ').next().unwrap());
    }
    let output = render.finish();
    let log = text(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{log}");
    assert!(log.contains("all 2 frames failed: 5 workers died in a row"), "{log}");
}

/// A page or a picture, as a browser gets it.
fn get(address: &str, path: &str) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let request = format!("GET {path} HTTP/1.0\r\nHost: {address}\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut reply = Vec::new();
    stream.read_to_end(&mut reply).unwrap();
    reply
}

fn start_worker(folder: &Path, url: &str, more: &[&str]) -> Process {
    let work = ["worker", "--connect", url, "--threads", "1"];
    let mut command = beamfarm(folder, &[&work[..], more].concat());
    command.args(["--log", "info"]);
    spawn(command)
}

/// One coordinator and two workers started separately, all of which end successfully with the last frame.
#[test]
fn served_frames_are_shown_in_a_list() {
    let folder = folder(4);
    let path = folder.path();
    let args = [
        "serve",
        "scene.toml",
        "--frames",
        "1-3",
        "-o",
        "f.#.exr",
        "--passes",
        "40",
    ];
    let mut command = beamfarm(path, &args);
    command.args(["--listen", "127.0.0.1:0", "--log", "info"]);
    let mut server = spawn(command);
    let url = server.out.wait_for("listening on ");
    let address = url.trim_start_matches("http://").to_owned();
    let page = wait_until("page", || match String::from_utf8_lossy(&get(&address, "/")) {
        page if page.contains("Frames") => Ok(page.into_owned()),
        page => Err(page.into_owned()),
    });
    assert!(page.contains("0 of 3 frames are there"), "{page}");
    assert!(!page.contains("/thumbnail.png?frame="), "{page}");
    assert!(succeed(path, &["pause", &url]).contains("paused"));
    let mut workers = [(); 2].map(|()| start_worker(path, &url, &[]));
    succeed(path, &["resume", &url]);
    wait_until("thumbnail of the first frame", || {
        let page = String::from_utf8_lossy(&get(&address, "/")).into_owned();
        let picture = get(&address, "/thumbnail.png?frame=1");
        let is_there = page.contains("/thumbnail.png?frame=1") && picture.windows(4).any(|bytes| bytes == b"\x89PNG");
        is_there.then_some(()).ok_or(page)
    });
    // It shows the current frame under its name.
    let status = succeed(path, &["status", &url]);
    assert!(status.contains("f."), "{status}");
    let output = server.finish();
    assert!(output.status.success(), "{}", text(&output.stderr));
    // One of them may come too late for a frame; an idle one moves to where a pass may be left, and back.
    let mut rendered = 0;
    for worker in &mut workers {
        let status = worker.wait();
        let log = worker.log.so_far();
        assert!(status.success(), "{log}");
        rendered += log.matches("rendering scene ").count();
    }
    assert!(rendered >= 3, "{rendered}");
    let all = report(&path.join("f.report.json"));
    for frame in 1..=3 {
        let own = alone(path, frame, &["--passes", "40"]);
        assert_eq!(of_frame(&all, frame)["pixels"], own, "frame {frame}");
        // A server keeps jobs whether or not this was requested.
        assert!(path.join(format!("f.{frame}.job/report.json")).exists());
    }
}

/// The server is killed between frames and restarted at its address; the workers wait for it and go on.
#[test]
fn workers_outlive_a_server_of_frames() {
    let folder = folder(12);
    let path = folder.path();
    std::fs::write(path.join("token"), "a-token-of-this-test").unwrap();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o600);
    std::fs::set_permissions(path.join("token"), mode).unwrap();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = port.local_addr().unwrap().to_string();
    drop(port);
    let serve = || {
        let args = [
            "serve",
            "scene.toml",
            "--frames",
            "1-8",
            "-o",
            "f.#.exr",
            "--listen",
            &address,
        ];
        let mut command = beamfarm(path, &[&args[..], &["--token-file", "token"]].concat());
        command.args(["--log", "debug"]);
        spawn(command)
    };
    let mut server = serve();
    let url = server.out.wait_for("listening on ");
    let stranger = start_worker(path, &url, &[]).finish();
    assert_eq!(stranger.status.code(), Some(6), "{}", text(&stranger.stderr));
    let mut workers = [(); 2].map(|()| start_worker(path, &url, &["--token-file", "token"]));
    for frame in [3, 6] {
        let image = path.join(format!("f.{frame}.png"));
        wait_until("frame", || match image.exists() {
            true => Ok(()),
            false => Err(server.log.so_far().to_owned()),
        });
        server.kill();
        server = serve();
    }
    let begun = Instant::now();
    let output = server.finish();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(begun.elapsed() < Duration::from_secs(60));
    for worker in &mut workers {
        assert!(worker.wait().success(), "{}", worker.log.so_far());
    }
    let all = report(&path.join("f.report.json"));
    for frame in 1..=8 {
        assert_eq!(
            of_frame(&all, frame)["pixels"],
            alone(path, frame, &[]),
            "frame {frame}"
        );
    }
}
