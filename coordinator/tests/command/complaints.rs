//! What a message blames, and what it calls things.

use crate::setup::{beamfarm, fail, folder_with, scene, spawn, succeed};
use std::net::TcpListener;

/// A value from the command line is on no line of the file.
#[test]
fn fields_on_the_command_line_are_blamed_themselves() {
    let folder = folder_with(&scene([16, 12], 1, 200));
    let path = folder.path();
    let refused = |args: &[&str]| {
        let (code, stderr) = fail(path, &[&["render", "scene.toml", "-o", "a.exr"], args].concat());
        assert_eq!(code, 2, "{args:?}: {stderr}");
        stderr
    };
    for (option, expected) in [
        ("camera.fov=400", "camera.fov: "),
        ("camera.fov=wide", "camera.fov"),
        ("lights.0.power=-1", ""),
        ("world.medium=smoke", ""),
        // A value in the file that the new one makes wrong.
        ("shapes.0.radios=1", ""),
        ("lights.7.power=1", ""),
    ] {
        let stderr = refused(&["-D", option]);
        let start = format!("scene.toml: -D {option}: {expected}");
        assert!(
            stderr.starts_with(&start) && stderr.lines().count() == 1,
            "{option}: {stderr}"
        );
    }
    // With several, the faulty one is named.
    let stderr = refused(&["-D", "camera.fov=40", "-D", "lights.0.power=-1", "--seed", "3"]);
    assert!(stderr.starts_with("scene.toml: -D lights.0.power=-1: "), "{stderr}");
    let stderr = fail(
        path,
        &["render", "scene.toml", "--frames", "1", "-D", "animation.frames=wide"],
    )
    .1;
    assert!(stderr.starts_with("scene.toml: -D animation.frames=wide: "), "{stderr}");
    // An error in the file itself is reported at its line.
    std::fs::write(
        path.join("scene.toml"),
        scene([16, 12], 1, 200).replace("radius = 0.35", "radius = -1"),
    )
    .unwrap();
    let stderr = refused(&["-D", "camera.fov=400"]);
    let lines: Vec<&str> = stderr.lines().collect();
    assert_eq!(lines.len(), 2, "{stderr}");
    assert!(
        lines
            .iter()
            .any(|line| line.starts_with("scene.toml: -D camera.fov=400: ")),
        "{stderr}"
    );
    let of_file = lines.iter().find(|line| !line.contains("-D")).unwrap();
    let line = of_file
        .strip_prefix("scene.toml:")
        .and_then(|rest| rest.split(':').next());
    assert!(line.is_some_and(|line| line.parse::<usize>().is_ok()), "{stderr}");
}

#[test]
fn compare_says_what_a_file_is_in_place_of_an_exr() {
    let folder = folder_with(&scene([16, 12], 1, 200));
    let path = folder.path();
    succeed(path, &["render", "scene.toml", "-o", "a.exr"]);
    let (code, stderr) = fail(path, &["compare", "a.png", "a.exr"]);
    assert_eq!(
        (code, &*stderr),
        (2, "error: a.png: expected an OpenEXR image; this is a PNG\n")
    );
    // Whatever the file is called.
    std::fs::copy(path.join("a.png"), path.join("b.exr")).unwrap();
    let (_, stderr) = fail(path, &["compare", "a.exr", "b.exr"]);
    assert_eq!(stderr, "error: b.exr: expected an OpenEXR image; this is a PNG\n");
}

#[test]
fn names_of_hosts_are_resolved_or_told() {
    let folder = folder_with(&scene([16, 12], 1, 200));
    let path = folder.path();
    let has_ipv6 = TcpListener::bind("[::1]:0").is_ok();
    let own = [("localhost:0", "http://"), ("[::1]:0", "http://[::1]:")];
    for (listen, expected) in own.into_iter().take(if has_ipv6 { 2 } else { 1 }) {
        let mut serve = spawn(beamfarm(
            path,
            &["serve", "scene.toml", "--listen", listen, "-o", "a.exr"],
        ));
        let address = serve.out.wait_for("listening on ");
        assert!(address.starts_with(expected), "{address}");
        let port = address.rsplit(':').next().and_then(|port| port.parse::<u16>().ok());
        assert!(port.is_some_and(|port| port > 0), "{address}");
        succeed(path, &["status", &address]);
        if listen.starts_with("localhost") {
            let port = address.rsplit(':').next().unwrap();
            succeed(path, &["status", &format!("localhost:{port}")]);
        }
    }
    for command in ["serve", "live"] {
        for (listen, expected) in [
            (
                "no-such-host.invalid:80",
                "the name \"no-such-host.invalid\" cannot be resolved",
            ),
            ("localhost", "expected ADDR:PORT or NAME:PORT"),
            ("::1:7325", "an IPv6 address stands in brackets"),
        ] {
            let (code, stderr) = fail(path, &[command, "scene.toml", "--listen", listen]);
            assert_eq!(code, 2, "{command}: {stderr}");
            assert!(
                stderr.contains(&format!("invalid value '{listen}' for '--listen")) && stderr.contains(expected),
                "{command}: {stderr}"
            );
        }
    }
    for args in [
        &["status", "no-such-host.invalid:7325"][..],
        &["worker", "--connect", "no-such-host.invalid:7325", "--patience", "0s"],
    ] {
        let (code, stderr) = fail(path, args);
        let told = "cannot reach the coordinator at http://no-such-host.invalid:7325: ";
        assert!(code == 3 && stderr.contains(told), "{args:?}: {stderr}");
    }
}

/// A random token is of no use without its link.
#[test]
fn the_link_of_a_live_view_is_whole_wherever_it_is_written() {
    let folder = folder_with(&scene([16, 12], 1, 200));
    let mut command = beamfarm(folder.path(), &["live", "scene.toml", "--workers", "0"]);
    command.env_remove("BEAMFARM_TOKEN");
    let mut view = spawn(command);
    let page = view.log.wait_for("page: ");
    let (address, token) = page.split_once("/enter#").unwrap_or_else(|| panic!("{page}"));
    assert!(address.starts_with("http://127.0.0.1:"), "{page}");
    assert!(
        token.len() >= 32 && token.chars().all(|c| c.is_ascii_alphanumeric()),
        "{page}"
    );
    // A token that the user chose is not printed.
    let mut command = beamfarm(folder.path(), &["live", "scene.toml", "--workers", "0"]);
    command.env("BEAMFARM_TOKEN", "a-token-of-somebody");
    let page = spawn(command).log.wait_for("page: ");
    assert!(!page.contains("a-token"), "{page}");
}
