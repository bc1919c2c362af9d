//! The live view in a browser: a light is dragged, and the picture follows.

use crate::setup::{LONG, Process, beamfarm, folder_with, scene, spawn};
use beamfarm_harness::browser::{Browser, is_there};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const TOKEN: &str = "the-token-of-this-view";

fn open() -> (TempDir, Process, Browser) {
    let text = scene([96, 64], 3, 300).replace("position = [0.5, 2, 0.5]", "position = [0.5, 1.5, 0.5] # near");
    let folder = folder_with(&text);
    let mut command = beamfarm(folder.path(), &["live", "scene.toml", "--listen", "127.0.0.1:0"]);
    command.env("BEAMFARM_TOKEN", TOKEN);
    let mut process = spawn(command);
    let page = process.log.wait_for("page: ");
    let mut page = Browser::open(&format!("{}/enter#{TOKEN}", page.trim_end_matches('/')));
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

/// Mean of the picture, and a number that changes with any pixel of it.
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
    let at = page.evaluate(
        "(() => {
            const box = document.querySelector('#overlay .grip.lamp circle').getBoundingClientRect();
            return [box.left + box.width / 2, box.top + box.height / 2];
        })()",
    );
    [0, 1].map(|i| at[i].as_f64().unwrap())
}

fn key(page: &mut Browser, key: &str, control: bool) {
    for kind in ["keyDown", "keyUp"] {
        let code = format!("Key{}", key.to_uppercase());
        let event = json!({"type": kind, "key": key, "code": code, "modifiers": if control { 2 } else { 0 }});
        page.call("Input.dispatchKeyEvent", event);
    }
}

/// Of the scene with all changes that were made on the page.
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
    // To and fro, until pictures have come on the way; at least ten steps, to where it is let go.
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
    // The handle is where the pointer let it go.
    let at = handle(&mut page);
    assert!((0..2).all(|i| (at[i] - to[i]).abs() < 2.0), "{at:?}, {to:?}");
    let measured = page.evaluate("performance.getEntriesByName('change to picture').length");
    assert!(measured.as_u64().unwrap() >= 2, "{measured}");

    // One step back is where it was, to the bit; saved, the comment is still there.
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
