//! The live view in a browser: a light is dragged, and the picture follows.

use crate::setup::{LONG, Process, beamfarm, folder_with, scene, spawn};
use beamfarm_harness::browser::{Browser, is_there};
use beamfarm_harness::render::is_long;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tempfile::TempDir;

fn open() -> (TempDir, Process, Browser) {
    let near = "position = [0.5, 1.5, 0.5] # near";
    open_scene(&scene([96, 64], 3, 300).replace("position = [0.5, 2, 0.5]", near))
}

fn open_scene(text: &str) -> (TempDir, Process, Browser) {
    let folder = folder_with(text);
    let command = beamfarm(folder.path(), &["live", "scene.toml", "--listen", "127.0.0.1:0"]);
    let mut process = spawn(command);
    let page = process.log.wait_for("page: ");
    let mut page = Browser::open(&page);
    page.look(1100, "light");
    page.wait_for("document.getElementById('canvas')?.dataset.frame !== undefined");
    page.wait_for("document.querySelector('#overlay .grip.lamp') !== null");
    (folder, process, page)
}

fn mouse(page: &mut Browser, kind: &str, [x, y]: [f64; 2], held: bool) {
    let button = if kind == "mouseMoved" && !held { "none" } else { "left" };
    let event = json!({"type": kind, "x": x, "y": y, "button": button, "buttons": u32::from(held), "clickCount": 1});
    page.call("Input.dispatchMouseEvent", event);
}

/// Mean of the picture, and a number that changes with every pixel.
fn picture(page: &mut Browser) -> (f64, f64) {
    let sums = page.evaluate(
        "(() => {
            const canvas = document.getElementById('canvas');
            const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
            let sum = 0, hash = 0;
            for (let i = 0; i < data.length; i++) {
                if (i % 4 === 3) continue;
                sum += data[i];
                hash = (hash * 31 + data[i]) % 1000000007;
            }
            return [sum / (0.75 * data.length), hash];
        })()",
    );
    (sums[0].as_f64().unwrap(), sums[1].as_f64().unwrap())
}

fn handle(page: &mut Browser) -> [f64; 2] {
    handle_of(page, "lights.0")
}

fn handle_of(page: &mut Browser, name: &str) -> [f64; 2] {
    let at = page.evaluate(&format!(
        "(() => {{
            const box = document.querySelector('#overlay .grip.lamp[data-name=\"{name}\"] circle').getBoundingClientRect();
            return [box.left + box.width / 2, box.top + box.height / 2];
        }})()"
    ));
    [0, 1].map(|i| at[i].as_f64().unwrap())
}

/// Drags by this much from one place, in steps.
fn drag(page: &mut Browser, from: [f64; 2], by: [f64; 2]) {
    mouse(page, "mouseMoved", from, false);
    mouse(page, "mousePressed", from, true);
    for step in 1..=5 {
        let place = [0, 1].map(|i| from[i] + by[i] * f64::from(step) / 5.0);
        mouse(page, "mouseMoved", place, true);
    }
    mouse(page, "mouseReleased", [from[0] + by[0], from[1] + by[1]], false);
}

/// Saves the scene once it has all changes.
fn save(page: &mut Browser) {
    page.wait_for("!document.getElementById('dirty').hidden");
    waits_for_passes(page, 1);
    key(page, "s", true);
    page.wait_for("document.getElementById('dirty').hidden");
}

/// Saves the scene; returns a vector of the light of this number as the file then has it.
fn saved(page: &mut Browser, folder: &TempDir, light: usize, name: &str) -> [f64; 3] {
    save(page);
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let vector = text.split("[[lights]]").nth(light + 1).unwrap();
    let vector = vector
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{name} = [")));
    let numbers = vector.and_then(|rest| rest.split(']').next()).unwrap().split(',');
    let numbers: Vec<f64> = numbers.map(|number| number.trim().parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

/// The same, repeated until it has changed: a page saves what it knows, and the last step of a drag may arrive later.
fn saved_anew(page: &mut Browser, folder: &TempDir, light: usize, name: &str, before: [f64; 3]) -> [f64; 3] {
    loop {
        let now = saved(page, folder, light, name);
        std::thread::sleep(Duration::from_millis(300));
        if now != before && page.evaluate("document.getElementById('dirty').hidden") == json!(true) {
            return now;
        }
    }
}

fn key(page: &mut Browser, key: &str, control: bool) {
    for kind in ["keyDown", "keyUp"] {
        let code = format!("Key{}", key.to_uppercase());
        let event = json!({"type": kind, "key": key, "code": code, "modifiers": if control { 2 } else { 0 }});
        page.call("Input.dispatchKeyEvent", event);
    }
}

/// For passes of the scene with all changes made on the page.
fn waits_for_passes(page: &mut Browser, passes: u64) {
    let condition = format!(
        "(() => {{
            const marks = performance.getEntriesByType('mark').map((mark) => mark.name);
            const changes = marks.filter((name) => name.startsWith('change ')).map((name) => Number(name.slice(7)));
            const shown = performance.getEntriesByName('picture').at(-1)?.detail;
            return shown?.passes === {passes} && shown.seq >= Math.max(0, ...changes);
        }})()"
    );
    page.wait_for_long(&condition, LONG);
}

#[test]
fn a_light_is_dragged_and_the_picture_follows() {
    if !is_there() {
        eprintln!("no Chromium: not tested");
        return;
    }
    let (folder, _process, mut page) = open();
    waits_for_passes(&mut page, 3);
    let (_, before) = picture(&mut page);
    let from = handle(&mut page);
    let to = [from[0] - 150.0, from[1] + 40.0];
    mouse(&mut page, "mouseMoved", from, false);
    mouse(&mut page, "mousePressed", from, true);
    // Back and forth until pictures have arrived on the way; at least ten steps, to the point of release.
    let mut seen = Vec::new();
    let until = Instant::now() + LONG;
    for step in 1.. {
        let share = 1.0 - f64::from(10i32 - step % 20).abs() / 10.0;
        let place = [0, 1].map(|i| from[i] + share * (to[i] - from[i]));
        mouse(&mut page, "mouseMoved", place, true);
        std::thread::sleep(Duration::from_millis(50));
        seen.push(picture(&mut page).1);
        seen.dedup();
        if step % 20 == 10 && seen.len() >= 3 {
            break;
        }
        assert!(Instant::now() < until, "pictures while it was dragged: {seen:?}");
    }
    mouse(&mut page, "mouseReleased", to, false);
    waits_for_passes(&mut page, 3);
    let (mean, after) = picture(&mut page);
    assert!(mean > 1.0, "the picture is black");
    assert_ne!(before, after);
    // The handle is where the pointer released it.
    let at = handle(&mut page);
    assert!((0..2).all(|i| (at[i] - to[i]).abs() < 2.0), "{at:?}, {to:?}");
    let measured = page.evaluate("performance.getEntriesByName('change to picture').length");
    assert!(measured.as_u64().unwrap() >= 2, "{measured}");

    // One undo restores the position to the bit; the saved file still has its comment.
    key(&mut page, "z", true);
    page.wait_for("document.getElementById('dirty').hidden");
    waits_for_passes(&mut page, 3);
    assert_eq!(picture(&mut page).1, before);
    let at = handle(&mut page);
    assert!((0..2).all(|i| (at[i] - from[i]).abs() < 2.0), "{at:?}, {from:?}");
    page.evaluate("document.getElementById('redo').click(); 0");
    page.wait_for("!document.getElementById('dirty').hidden");
    key(&mut page, "s", true);
    page.wait_for("document.getElementById('dirty').hidden");
    let saved = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    assert!(
        saved.contains("] # near") && !saved.contains("[0.5, 1.5, 0.5]"),
        "{saved}"
    );
    assert_eq!(page.wrongs(), json!([]));
}

#[test]
fn fields_are_changed_and_everybody_can_read_them() {
    if !is_there() {
        eprintln!("no Chromium: not tested");
        return;
    }
    let (_folder, _process, mut page) = open();
    let set = "(path, value) => {
        const input = document.querySelector(`[data-path='${path}'] input:not([type=range]):not([type=color])`);
        input.value = value;
        for (const kind of ['input', 'change']) input.dispatchEvent(new Event(kind, { bubbles: true }));
    }";
    page.wait_for("document.querySelector(\"[data-path='camera.fov'] input\") !== null");
    page.evaluate(&format!("({set})('camera.fov', '400'); 0"));
    page.wait_for("document.querySelector(\"[data-path='camera.fov'] [aria-invalid=true]\") !== null");
    page.evaluate(&format!("({set})('camera.fov', '61'); 0"));
    page.wait_for("document.querySelector(\"[data-path='camera.fov'] [aria-invalid=true]\") === null");
    page.wait_for("!document.getElementById('dirty').hidden");
    // A message of the page about its own refusal also goes away with the next number.
    page.evaluate(&format!("({set})('camera.fov', 'wide'); 0"));
    let said = "document.querySelector(\"[data-path='camera.fov'] [role=alert]\")";
    page.wait_for(&format!(
        "{said}.textContent.startsWith('This is not a number.') && !{said}.hidden"
    ));
    page.evaluate(&format!("({set})('camera.fov', '61'); 0"));
    page.wait_for(&format!("{said}.hidden && {said}.textContent === ''"));
    page.evaluate(&format!("({set})('camera.fov', '62'); 0"));
    page.wait_for("document.querySelector(\"[data-path='camera.fov'] input:not([type=range])\").value === '62'");
    for (width, scheme) in [(1200, "dark"), (390, "light"), (390, "dark")] {
        page.look(width, scheme);
        page.wait_for("document.getElementById('canvas').getBoundingClientRect().width > 200");
        let wide: Value = page.evaluate("document.documentElement.scrollWidth");
        assert!(
            wide.as_u64().unwrap() <= u64::from(width),
            "at {width} it is {wide} wide"
        );
    }
    assert_eq!(page.wrongs(), json!([]));
}

/// Next to the picture, behind the camera, and infinitely far away: all can be grabbed.
#[test]
fn lights_that_are_not_seen_are_turned_and_moved() {
    if !is_there() {
        eprintln!("no Chromium: not tested");
        return;
    }
    // Without the fog, which would hide the sun.
    let text = scene([96, 64], 1, 100).replace("[world]\nmedium = \"fog\"\n", "");
    let text = text.replace("position = [0.5, 2, 0.5]", "position = [0.5, 1.5, 0.5]");
    let more = "\
[[lights]]
type = \"point\"
position = [9, 1, 0]
power = 10.0
[[lights]]
type = \"point\"
position = [-1, 1, 8]
power = 10.0
[[lights]]
type = \"directional\"
direction = [0, -1, -1]
irradiance = 1.0
[[lights]]
type = \"environment\"
radiance = 0.1
";
    let (folder, _process, mut page) = open_scene(&(text + more));
    page.wait_for("document.querySelectorAll('#overlay .grip.lamp').length === 5");
    let edges = page.evaluate(
        "(() => {
            const box = document.getElementById('canvas').getBoundingClientRect();
            return [box.left, box.right, box.top, box.bottom];
        })()",
    );
    let [left, right, top, bottom] = [0, 1, 2, 3].map(|i| edges[i].as_f64().unwrap());
    let away = page
        .evaluate("[...document.querySelectorAll('#overlay .grip.is-away')].map((node) => node.dataset.name).sort()");
    assert_eq!(away, json!(["lights.1", "lights.2"]));
    let beside = handle_of(&mut page, "lights.1");
    assert!((right - 18.0 - beside[0]).abs() < 2.0, "{beside:?}, {edges}");
    assert!(
        beside[1] > top + 10.0 && beside[1] < bottom - 10.0,
        "{beside:?}, {edges}"
    );
    let behind = handle_of(&mut page, "lights.2");
    assert!((left + 18.0 - behind[0]).abs() < 2.0, "{behind:?}, {edges}");

    // A click selects and names the object.
    drag(&mut page, beside, [0.0, 0.0]);
    let name = "document.getElementById('selection-name').textContent";
    page.wait_for(&format!(
        "{name} === 'lights[1] · point light · outside of the picture'"
    ));
    drag(&mut page, beside, [-60.0, 0.0]);
    let [x, y, z] = saved_anew(&mut page, &folder, 1, "position", [9.0, 1.0, 0.0]);
    assert!(
        x < 8.9 && x > 7.0 && (y - 1.0).abs() < 1e-3 && z.abs() < 1e-3,
        "{x} {y} {z}"
    );
    drag(&mut page, behind, [60.0, 0.0]);
    let [x, y, z] = saved_anew(&mut page, &folder, 2, "position", [-1.0, 1.0, 8.0]);
    assert!(
        x > -0.9 && x < 5.0 && (y - 1.0).abs() < 1e-3 && (z - 8.0).abs() < 1e-3,
        "{x} {y} {z}"
    );

    // The sun is behind the camera and above: left around the vertical, and down.
    let sun = handle_of(&mut page, "lights.3");
    assert!(
        sun[0] > left && sun[0] < right && sun[1] > top && sun[1] < bottom,
        "{sun:?}, {edges}"
    );
    let quarter = bottom - top;
    drag(&mut page, sun, [-quarter, 0.0]);
    let [x, y, z] = saved_anew(&mut page, &folder, 3, "direction", [0.0, -1.0, -1.0]);
    assert!(
        x < -0.6 && (y + std::f64::consts::FRAC_1_SQRT_2).abs() < 0.3 && z.abs() < 0.1,
        "{x} {y} {z}"
    );
    page.wait_for("!document.getElementById('undo').disabled");
    page.evaluate("document.getElementById('undo').click(); 0");
    let before = saved_anew(&mut page, &folder, 3, "direction", [x, y, z]);
    assert_eq!(before, [0.0, -1.0, -1.0]);
    let sun = handle_of(&mut page, "lights.3");
    drag(&mut page, sun, [0.0, quarter / 2.0]);
    let [x, y, z] = saved_anew(&mut page, &folder, 3, "direction", before);
    assert!(x.abs() < 1e-3 && (y * y + z * z).sqrt() > 0.5, "{x} {y} {z}");
    assert!((y.atan2(z) - (-1.0f64).atan2(-1.0)).abs() > 0.7, "{x} {y} {z}");
    // The environment turns around the vertical.
    let sky = handle_of(&mut page, "lights.4");
    assert!(sky[0] - left < 100.0 && sky[1] - top < 100.0, "{sky:?}, {edges}");
    drag(&mut page, sky, [-quarter / 2.0, 0.0]);
    save(&mut page);
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let turned = text.lines().find_map(|line| line.strip_prefix("rotate_y = "));
    let turned: f64 = turned.unwrap().parse().unwrap();
    assert!((turned - 45.0).abs() < 3.0, "{turned}");
    assert_eq!(page.wrongs(), json!([]));
}

/// In each example scene (two of them without BEAMFARM_LONG=1), a light that can be turned or moved is within reach as
/// soon as the page is open.
#[test]
fn every_example_has_a_light_to_take_hold_of() {
    if !is_there() {
        eprintln!("no Chromium: not tested");
        return;
    }
    let scenes = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut without = Vec::new();
    let mut tested = 0;
    for entry in std::fs::read_dir(&scenes).unwrap() {
        let scene = entry.unwrap().path();
        // One whose lights are all shapes, and one with a sun.
        let is_meant = is_long()
            || ["headlights.toml", "street.toml"]
                .iter()
                .any(|name| scene.ends_with(name));
        if scene.extension().is_none_or(|ending| ending != "toml") || !is_meant {
            continue;
        }
        let mut command = beamfarm(&scenes, &["live", "--workers", "0"]);
        command.arg(&scene).env_remove("BEAMFARM_TOKEN");
        let mut process = spawn(command);
        let link = process.log.wait_for("page: ");
        let mut page = Browser::open(&link);
        page.look(1280, "light");
        page.wait_for("document.getElementById('title').textContent !== 'beamfarm'");
        // A place where a click reaches it and nothing else.
        let grips = "[...document.querySelectorAll('#overlay .grip.lamp:not(.is-still)')].filter((node) => {
            const box = node.querySelector('circle').getBoundingClientRect();
            const at = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
            return at?.closest('.grip.lamp') !== null && at?.closest('.grip.lamp') !== undefined;
        }).length";
        page.wait_for("document.querySelector('#overlay .grips, #overlay g') !== null");
        std::thread::sleep(Duration::from_millis(300));
        tested += 1;
        if page.evaluate(grips).as_u64() == Some(0) {
            without.push(scene.file_name().unwrap().to_string_lossy().into_owned());
        }
        assert_eq!(page.wrongs(), json!([]), "{}", scene.display());
    }
    assert!(tested >= if is_long() { 10 } else { 2 }, "{tested} scenes");
    assert_eq!(without, Vec::<String>::new());
}
