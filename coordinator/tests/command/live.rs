//! The live view without a browser: its socket, used like the page does.

use crate::devices::has_device;
use crate::setup::{LONG, Process, beamfarm, fail, folder_with, scene, spawn, succeed, wait_until};
use beamfarm_image::exr::{pixel_hash, read_rgb};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

const TOKEN: &str = "the-token-of-this-view";

/// The address of a view and the token of its page, from the link that it prints.
fn link(process: &mut Process) -> (String, String) {
    let page = process.log.wait_for("page: http://");
    let (address, token) = page.split_once("/enter#").unwrap();
    (address.to_owned(), token.to_owned())
}

/// A view of a scene, and one of its pages.
pub struct View {
    pub process: Process,
    address: String,
    token: String,
    pub socket: WebSocket<MaybeTlsStream<TcpStream>>,
    /// The last of each kind of message, and the header of the last picture.
    pub last: std::collections::BTreeMap<String, Value>,
    pictures: Vec<Value>,
    /// Radiance of the last picture, where requested.
    linear: Option<Vec<f32>>,
    pub seq: u64,
    /// How long it waits for an expected message.
    patience: Duration,
}

impl View {
    pub fn of(folder: &TempDir, args: &[&str]) -> Self {
        Self::as_asked(folder, args, "/look")
    }

    /// `path`: the socket's, including the requested form of pictures.
    fn as_asked(folder: &TempDir, args: &[&str], path: &str) -> Self {
        let all = [&["live", "scene.toml", "--listen", "127.0.0.1:0"], args].concat();
        let mut command = beamfarm(folder.path(), &all);
        command.env("BEAMFARM_TOKEN", TOKEN);
        let mut process = spawn(command);
        let (address, token) = link(&mut process);
        let mut view = Self {
            socket: connect(&address, path, Some(&token)).unwrap(),
            process,
            address,
            token,
            last: Default::default(),
            pictures: Vec::new(),
            linear: path.ends_with("linear").then(Vec::new),
            seq: 0,
            patience: LONG,
        };
        view.say(json!({"type": "size", "width": 64}));
        view
    }

    pub fn say(&mut self, message: Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// Sends a change.
    fn change(&mut self, mut message: Value) -> u64 {
        self.seq += 1;
        message["seq"] = json!(self.seq);
        self.say(message);
        self.seq
    }

    pub fn set(&mut self, path: &str, value: Value) -> u64 {
        let gesture = format!("g{}", self.seq);
        self.change(json!({"type": "set", "gesture": gesture, "path": path, "value": value}))
    }

    pub fn hear(&mut self) {
        match self.socket.read().unwrap() {
            Message::Text(text) => {
                let message: Value = serde_json::from_str(&text).unwrap();
                let kind = message["type"].as_str().unwrap().to_owned();
                self.last.insert(kind, message);
            }
            Message::Binary(bytes) => {
                let size = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                let header: Value = serde_json::from_slice(&bytes[4..4 + size]).unwrap();
                let pixels = &bytes[4 + size..];
                match &mut self.linear {
                    Some(linear) => {
                        let values = pixels.as_chunks::<4>().0.iter();
                        *linear = values.map(|value| f32::from_le_bytes(*value)).collect();
                        let area = header["width"].as_u64().unwrap() * header["height"].as_u64().unwrap();
                        assert_eq!(pixels.len() as u64, 12 * area, "three floats a pixel");
                    }
                    None => assert_eq!(pixels[..2], [0xff, 0xd8], "a JPEG"),
                }
                self.say(json!({"type": "drawn", "frame": header["frame"]}));
                self.pictures.push(header);
            }
            _ => {}
        }
    }

    /// Receives messages until this holds.
    pub fn hear_until<T>(&mut self, what: &str, mut look: impl FnMut(&Self) -> Option<T>) -> T {
        let until = Instant::now() + self.patience;
        loop {
            if let Some(found) = look(self) {
                return found;
            }
            assert!(
                Instant::now() < until,
                "waited for {what}: {:?}, {:?}",
                self.last,
                self.pictures.last()
            );
            self.hear();
        }
    }

    fn hear_picture(&mut self, what: &str, is_it: impl Fn(&Value) -> bool) -> Value {
        self.hear_until(what, |view| {
            view.pictures.iter().rev().find(|picture| is_it(picture)).cloned()
        })
    }

    fn field(&self, path: &str) -> Option<Value> {
        let fields = self.last.get("scene")?["fields"].as_array()?;
        fields.iter().find(|field| field["path"] == path).cloned()
    }
}

fn connect(address: &str, path: &str, token: Option<&str>) -> Result<WebSocket<MaybeTlsStream<TcpStream>>, String> {
    let mut request = format!("ws://{address}{path}").into_client_request().unwrap();
    if let Some(token) = token {
        let value = format!("Bearer {token}").parse().unwrap();
        request.headers_mut().insert("authorization", value);
    }
    let (socket, _) = tungstenite::connect(request).map_err(|error| error.to_string())?;
    if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
        stream.set_read_timeout(Some(6 * LONG)).unwrap();
    }
    Ok(socket)
}

/// The body of an answer from the view's port.
fn get(address: &str, path: &str) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(
        stream,
        "GET {path} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {TOKEN}\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    assert!(
        bytes.starts_with(b"HTTP/1.1 200"),
        "{}",
        String::from_utf8_lossy(&bytes[..end])
    );
    bytes.split_off(end + 4)
}

/// As editors do: readers find the old text or the new one.
fn replace(path: &Path, text: &str) {
    let beside = path.with_extension("new");
    std::fs::write(&beside, text).unwrap();
    std::fs::rename(beside, path).unwrap();
}

const SCENE: [u32; 2] = [48, 32];

#[test]
fn at_rest_it_has_the_bits_of_render() {
    let text = scene(SCENE, 4, 300);
    let folder = folder_with(&format!("# A lamp in fog.\n{text}"));
    let mut view = View::of(&folder, &[]);
    view.hear_picture("a sketch", |_| true);
    view.hear_until("the scene", |view| view.last.get("scene").map(|_| ()));
    assert_eq!(view.field("lights.0.power").unwrap()["value"], json!(100.0));

    // A drag in twenty steps, of which only the final position is in the file.
    for step in 1..=20 {
        let by = json!([0.02 * f64::from(step), 0.0, 0.0]);
        view.change(json!({"type": "move", "gesture": "drag", "thing": "lights.0", "by": by}));
    }
    let seq = view.set("camera.fov", json!(45));
    view.say(json!({"type": "rest"}));
    view.hear_picture("a sketch with the change", |picture| picture["seq"] == seq);
    view.hear_picture("all passes", |picture| picture["passes"] == 4);
    // Picture messages arrive in order.
    let order = |picture: &Value| ["revision", "passes", "step"].map(|name| picture[name].as_u64().unwrap());
    let is_ordered = |pair: &[Value]| {
        let [a, b] = [order(&pair[0]), order(&pair[1])];
        a[0] < b[0] || a[0] == b[0] && (a[1] < b[1] || a[1] == b[1] && (a[2] <= b[2] || b[1] > 0))
    };
    assert!(view.pictures.windows(2).all(is_ordered), "{:?}", view.pictures);

    view.hear_until("it is not saved", |view| {
        (view.last.get("scene")?["dirty"] == true).then_some(())
    });
    view.say(json!({"type": "save"}));
    view.hear_until("saved", |view| view.last.get("told").map(|_| ()));
    let saved = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let expected = format!("# A lamp in fog.\n{text}")
        .replace("[0.5, 2, 0.5]", "[0.9, 2, 0.5]")
        .replace("fov = 50.0", "fov = 45.0");
    assert_eq!(
        saved
            .replace("fov = 45\n", "fov = 45.0\n")
            .replace("2.0, 0.5", "2, 0.5"),
        expected
    );

    let seen = folder.path().join("seen.exr");
    std::fs::write(&seen, get(&view.address, "/image.exr")).unwrap();
    drop(view);
    succeed(folder.path(), &["render", "scene.toml", "-o", "rendered.exr"]);
    let hash = |path: &Path| pixel_hash(&read_rgb(path).unwrap());
    assert_eq!(hash(&seen), hash(&folder.path().join("rendered.exr")));
}

/// Programs with their own tone curve receive the radiance that `render` writes, and report themselves when they have
/// written files.
#[test]
fn programs_get_radiance_and_say_when_files_are_written() {
    let text = scene(SCENE, 3, 300);
    let folder = folder_with(&text);
    let mut view = View::as_asked(&folder, &[], "/look?pixels=linear");
    view.hear_picture("a sketch", |_| true);
    replace(
        &folder.path().join("scene.toml"),
        &text.replace("fov = 50.0", "fov = 40.0"),
    );
    let seq = view.change(json!({"type": "written"}));
    view.hear_picture("all passes", |picture| picture["seq"] == seq && picture["passes"] == 3);
    succeed(folder.path(), &["render", "scene.toml", "-o", "out.exr", "--quiet"]);
    let film = read_rgb(&folder.path().join("out.exr")).unwrap();
    assert_eq!(view.linear.as_deref(), Some(film.pixels.as_flattened()));

    // An error carries the number of the writer's change.
    replace(
        &folder.path().join("scene.toml"),
        &text.replace("fov = 50.0", "fov = true"),
    );
    let seq = view.change(json!({"type": "written"}));
    view.hear_until("an error", |view| (view.last.get("error")?["seq"] == seq).then_some(()));
    let nonsense = connect(&view.address, "/look?pixels=none", Some(&view.token));
    assert!(nonsense.unwrap_err().contains("400"));
}

/// A device renders the current scene: what remains from earlier states shows here. A lamp of half the power halves the
/// picture. The long test compares it with that of `render`, whose kernels take as long to compile.
#[test]
fn on_a_device_it_shows_what_it_shows_elsewhere() {
    let by = ["--engine", "gpu"];
    // Camera paths only and no fog, so that there are few kernels.
    let text = scene([16, 12], 2, 200).replace("= \"photons\"", "= \"paths\"");
    let folder = folder_with(&text.replace("[world]\nmedium = \"fog\"", ""));
    if !has_device(folder.path()) {
        return;
    }
    let mut view = View::as_asked(&folder, &by, "/look?pixels=linear");
    view.patience = 6 * LONG;
    let all_passes = |view: &mut View, seq: u64| {
        view.hear_picture("all passes", |picture| picture["seq"] == seq && picture["passes"] == 2);
        view.linear.clone().unwrap()
    };
    let before = all_passes(&mut view, 0);
    let seq = view.set("lights.0.power", json!(50.0));
    let after = all_passes(&mut view, seq);
    let is_half = |(before, after): (&f32, &f32)| (after - 0.5 * before).abs() <= 1e-6 * before.abs();
    assert!(before.iter().any(|value| *value > 0.0) && before.iter().zip(&after).all(is_half));
    if std::env::var_os("BEAMFARM_LONG").is_none() {
        return;
    }
    view.say(json!({"type": "save"}));
    view.hear_until("saved", |view| view.last.get("told").map(|_| ()));
    drop(view);
    let render = ["render", "scene.toml", "-o", "out.exr", "--quiet"];
    succeed(folder.path(), &[&render[..], &by].concat());
    let film = read_rgb(&folder.path().join("out.exr")).unwrap();
    assert_eq!(after, film.pixels.as_flattened());
}

/// Before a page exists that could be told.
#[test]
fn a_scene_that_is_not_for_devices_is_refused_at_once() {
    let cylinder = "[[shapes]]\ntype = \"cylinder\"\np0 = [0, 3, 0]\np1 = [1, 3, 0]\nradius = 0.1\nemission = { radiance = 1.0 }\n";
    let folder = folder_with(&format!("{}{cylinder}", scene(SCENE, 2, 300)));
    if !has_device(folder.path()) {
        return;
    }
    let (code, stderr) = fail(folder.path(), &["live", "scene.toml", "--engine", "gpu"]);
    assert_eq!(code, 2, "{stderr}");
    assert!(stderr.contains("the engine gpu cannot render this scene"), "{stderr}");
}

#[test]
fn what_cannot_be_is_told_and_taken_back() {
    let folder = folder_with(&scene(SCENE, 2, 300));
    let path = folder.path().join("scene.toml");
    let before = std::fs::read_to_string(&path).unwrap();
    let mut view = View::of(&folder, &[]);
    view.hear_picture("a sketch", |_| true);

    let seq = view.set("camera.fov", json!(-3));
    let error = view.hear_until("an error", |view| view.last.get("error").cloned());
    assert_eq!(error["path"], "camera.fov", "{error}");
    assert_eq!(error["seq"], json!(seq), "{error}");
    view.set("camera.fov", json!(60));
    view.hear_until("all is well", |view| view.last.get("fine").map(|_| ()));
    view.last.clear();

    // A change on disk counts as well.
    replace(&path, &before.replace("radius = 0.35", "radius = \"large\""));
    let error = view.hear_until("an error", |view| view.last.get("error").cloned());
    let line = before.lines().position(|line| line.contains("radius")).unwrap() + 1;
    assert_eq!(error["line"], json!(line), "{error}");
    assert_eq!(error["path"], "shapes.0.radius", "{error}");
    replace(&path, &before.replace("radius = 0.35", "radius = 0.45"));
    view.hear_until("all is well", |view| view.last.get("fine").map(|_| ()));
    view.hear_until("the disk's field of view", |view| {
        (view.field("camera.fov")?["value"].as_f64() == Some(50.0)).then_some(())
    });

    // One step back and forth.
    let seq = view.change(json!({"type": "undo"}));
    view.hear_picture("undone", |picture| picture["seq"] == seq);
    view.hear_until("the page's field of view", |view| {
        (view.field("camera.fov")?["value"].as_f64() == Some(60.0)).then_some(())
    });
    let seq = view.change(json!({"type": "redo"}));
    view.hear_picture("redone", |picture| picture["seq"] == seq);

    // Display settings make no other picture.
    let revision = view.pictures.last().unwrap()["revision"].clone();
    for (field, value) in [
        ("exposure", json!(1.5)),
        ("view", json!("agx")),
        ("white_balance", json!(3200)),
    ] {
        let seq = view.set(&format!("render.{field}"), value);
        let picture = view.hear_picture("shown otherwise", |picture| picture["seq"] == seq);
        assert_eq!(picture["revision"], revision, "{field}");
    }

    // Invalid messages are ignored.
    for wrong in ["", "[]", "{\"type\":\"set\"}", "{\"type\":\"size\",\"width\":-1}"] {
        view.socket.send(Message::text(wrong)).unwrap();
    }
    view.socket.send(Message::binary(vec![0u8; 100])).unwrap();
    let seq = view.set("camera.fov", json!(33));
    view.hear_picture("another change", |picture| picture["seq"] == seq);
}

#[test]
fn a_job_is_begun_of_what_is_seen() {
    let folder = folder_with(&scene(SCENE, 2, 300));
    let mut view = View::of(&folder, &["--scale", "200%"]);
    view.hear_picture("a sketch", |_| true);
    view.set("camera.fov", json!(45));
    view.say(json!({"type": "render"}));
    let open = view.hear_until("the job's page", |view| view.last.get("open").cloned());
    let url = open["url"].as_str().unwrap();
    assert!(url.starts_with("http://127.0.0.1:") && url.contains("/enter#"), "{url}");
    view.hear_until("the job's end", |view| {
        view.last.get("told")?["text"]
            .as_str()?
            .contains("is done")
            .then_some(())
    });
    // What was saved before, without what the view's own options change.
    let saved = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    assert!(saved.contains("fov = 45") && saved.contains("width = 48"), "{saved}");
    let film = read_rgb(&folder.path().join("scene.exr")).unwrap();
    assert_eq!((film.width, film.height), (96, 64));
}

/// However often one is requested, there is one job. It ends with the view, however that ends, and keeps its results
/// where it was told to.
#[test]
fn jobs_are_one_at_a_time_and_end_with_the_view() {
    for signal in ["-TERM", "-KILL"] {
        let folder = folder_with(&scene(SCENE, 1_000_000, 300));
        let mut view = View::of(&folder, &[]);
        view.hear_picture("a sketch", |_| true);
        for _ in 0..40 {
            view.say(json!({"type": "render"}));
        }
        let open = view.hear_until("the job's page", |view| view.last.get("open").cloned());
        view.hear_until("a refusal", |view| {
            let message = view.last.get("error")?.to_string();
            message.contains("is under way").then_some(())
        });
        let url = open["url"].as_str().unwrap();
        let address = url.trim_start_matches("http://").split('/').next().unwrap();
        let is_served = || TcpStream::connect(address).is_ok();
        assert!(is_served());
        view.process.signal(signal);
        let ended = view.process.wait();
        wait_until("the job's end", || match is_served() {
            true => Err("it goes on".to_owned()),
            false => Ok(()),
        });
        if signal == "-TERM" {
            assert!(ended.success());
            let film = read_rgb(&folder.path().join("scene.exr")).unwrap();
            assert_eq!((film.width, film.height), (48, 32));
        }
    }
}

#[test]
fn strangers_see_nothing_and_workers_may_come_and_go() {
    let folder = folder_with(&scene(SCENE, 3, 300));
    let mut view = View::of(&folder, &["--workers", "0"]);
    assert!(connect(&view.address, "/look", None).unwrap_err().contains("401"));
    assert!(
        connect(&view.address, "/look", Some("another-token-than-it"))
            .unwrap_err()
            .contains("401")
    );
    // The workers' token does not open the page's socket.
    assert!(
        connect(&view.address, "/look", Some(TOKEN))
            .unwrap_err()
            .contains("403")
    );
    view.hear_until("no workers", |view| {
        (view.last.get("state")?["doing"] == "no workers").then_some(())
    });
    let url = format!("http://{}", view.address);
    let worker = || {
        let args = ["worker", "--connect", &url, "--threads", "1", "--no-cache"];
        let mut command = beamfarm(folder.path(), &args);
        command.env("BEAMFARM_TOKEN", TOKEN);
        spawn(command)
    };
    let mut first = worker();
    view.hear_picture("a sketch", |_| true);
    let _second = worker();
    view.hear_until("two workers", |view| {
        (view.last.get("state")?["workers"] == 2).then_some(())
    });
    first.kill();
    view.set("camera.fov", json!(40));
    view.say(json!({"type": "rest"}));
    view.hear_picture("all passes", |picture| picture["passes"] == 3);
    view.hear_until("one worker", |view| {
        (view.last.get("state")?["workers"] == 1).then_some(())
    });
}

/// However workers connect, the page has its own token.
#[test]
fn a_page_has_another_token_than_workers() {
    let folder = folder_with(&scene(SCENE, 3, 300));
    let own = folder.path().join("page");
    std::fs::write(&own, "the-token-of-the-page").unwrap();
    let listen = ["--workers", "0", "--listen", "127.0.0.1:0"];
    for (args, token) in [
        (&listen[..2], None),
        (&listen[..], None),
        (&listen[..], Some(TOKEN)),
        (
            &["--workers", "0", "--listen", "127.0.0.1:0", "--insecure-listen"],
            None,
        ),
    ] {
        let mut command = beamfarm(folder.path(), &[&["live", "scene.toml"], args].concat());
        command.envs(token.map(|token| ("BEAMFARM_TOKEN", token)));
        let mut process = spawn(command);
        let (address, page) = link(&mut process);
        connect(&address, "/look", Some(&page)).unwrap();
        for wrong in [None, token] {
            let refused = connect(&address, "/look", wrong).unwrap_err();
            assert!(
                refused.contains("401") || refused.contains("403"),
                "{args:?}: {refused}"
            );
        }
    }
    let mut command = beamfarm(folder.path(), &[&["live", "scene.toml"], &listen[..]].concat());
    command
        .env("BEAMFARM_TOKEN", TOKEN)
        .args(["--operator-token-file", "page"]);
    let mut process = spawn(command);
    let address = process.log.wait_for("page: http://");
    connect(address.trim_end_matches('/'), "/look", Some("the-token-of-the-page")).unwrap();
    std::fs::write(&own, TOKEN).unwrap();
    let mut command = beamfarm(folder.path(), &[&["live", "scene.toml"], &listen[..]].concat());
    command
        .env("BEAMFARM_TOKEN", TOKEN)
        .args(["--operator-token-file", "page"]);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && said.contains("another token than its workers"),
        "{said}"
    );
}

/// A page may read files in the scene's folder and in no other, and cannot tell which others exist.
#[test]
fn pages_do_not_leave_the_folder() {
    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let text = scene(SCENE, 3, 300) + "\n[[shapes]]\nname = \"mesh\"\ntype = \"mesh\"\nfile = \"in.ply\"\n";
    let folder = folder_with(&text);
    let elsewhere = tempfile::tempdir().unwrap();
    let private = elsewhere.path().join("private.ply");
    for path in [
        &folder.path().join("in.ply"),
        &folder.path().join("other.ply"),
        &private,
    ] {
        std::fs::write(path, PLY).unwrap();
    }
    let allowed = elsewhere.path().to_str().unwrap();
    for args in [&["--workers", "0"][..], &["--workers", "0", "--allow-outside", allowed]] {
        let mut view = View::of(&folder, args);
        view.hear_until("the scene", |view| view.last.get("scene").map(|_| ()));
        let mut said = |file: &str| {
            let seq = view.set("shapes.1.file", json!(file));
            view.hear_until("an answer", |view| {
                let error = view.last.get("error").filter(|error| error["seq"] == seq);
                let taken = view.last.get("scene").is_some_and(|scene| scene["seq"] == seq);
                match error {
                    Some(error) => Some(error["message"].as_str().unwrap().replace(file, "FILE")),
                    None => taken.then(String::new),
                }
            })
        };
        assert_eq!(said("other.ply"), "");
        let nowhere = said("none.ply");
        assert!(nowhere.contains("no such file in the scene's folder"), "{nowhere}");
        let private = private.to_str().unwrap();
        for file in ["/etc/passwd", "/etc/nothing", "../../etc/passwd", "/dev/zero", private] {
            assert_eq!(said(file), nowhere, "{file}");
        }
    }
}
