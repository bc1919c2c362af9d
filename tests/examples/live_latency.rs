//! How quickly the live view follows: `cargo run --release -p beamfarm-tests --example live_latency --
//! target/release/beamfarm SCENE ... [--workers N] [--seconds S] [--passes K]`.
//!
//! For each scene, `beamfarm live` opens a copy in headless Chromium with a picture 960 pixels wide. One of its lights
//! is dragged, or turned if it has no position, by 20 mouse events a second for ten seconds. The page measures the time
//! from each event until the page shows a picture of it (User Timing: "change to picture"), and when pictures arrive.
//! Then the light is released: how soon does a sketch of full size arrive, and how soon the first pass? Finally the
//! scene is saved, rendered by `beamfarm render` with as many passes as the page had, and compared bit by bit.
//!
//! `--workers N`: N processes of `beamfarm worker` with one thread each instead of the view's own.

use beamfarm_harness::browser::Browser;
use beamfarm_image::exr::{pixel_hash, read_rgb};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

type AnyError = Box<dyn std::error::Error + Send + Sync>;

const TOKEN: &str = "a-token-for-measuring";
/// Mouse events per second.
const RATE: f64 = 20.0;

struct Options {
    program: PathBuf,
    scenes: Vec<PathBuf>,
    workers: usize,
    seconds: f64,
    passes: u64,
}

fn options() -> Result<Options, AnyError> {
    let mut args = std::env::args().skip(1);
    let usage = "expected the program and scenes";
    let mut options = Options {
        program: std::path::absolute(args.next().ok_or(usage)?)?,
        scenes: Vec::new(),
        workers: 0,
        seconds: 10.0,
        passes: 2,
    };
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg}: expected a number"));
        match arg.as_str() {
            "--workers" => options.workers = value()?.parse()?,
            "--seconds" => options.seconds = value()?.parse()?,
            "--passes" => options.passes = value()?.parse()?,
            scene => options.scenes.push(scene.into()),
        }
    }
    match options.scenes.is_empty() {
        true => Err(usage.into()),
        false => Ok(options),
    }
}

fn main() -> Result<(), AnyError> {
    let options = options()?;
    println!(
        "{:16} {:>8} {:>8} {:>8} {:>9} {:>8} {:>9} {:>9}  bits",
        "scene", "median", "95 %", "worst", "pictures", "gap 95 %", "full size", "1st pass"
    );
    let mut is_wrong = false;
    for scene in &options.scenes {
        let measured = measure(&options, scene)?;
        is_wrong |= !measured.is_exact;
        let [median, late, worst] = measured.latency.map(|ms| format!("{ms:.0} ms"));
        println!(
            "{:16} {median:>8} {late:>8} {worst:>8} {:>7.1}/s {:>5.0} ms {:>7.2} s {:>7.2} s  {}",
            scene.file_stem().unwrap_or_default().to_string_lossy(),
            measured.pictures_a_second,
            measured.gap,
            measured.full_size,
            measured.first_pass,
            match measured.is_exact {
                true => format!("as render, {} passes", measured.passes),
                false => "OTHERS THAN RENDER".into(),
            }
        );
    }
    match is_wrong {
        true => Err("not all bits are those of render".into()),
        false => Ok(()),
    }
}

/// Killed when dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Measured {
    /// Median, 95th percentile and maximum, milliseconds.
    latency: [f64; 3],
    pictures_a_second: f64,
    /// 95th percentile of the time between pictures, milliseconds.
    gap: f64,
    /// From the release, seconds.
    full_size: f64,
    first_pass: f64,
    passes: u64,
    is_exact: bool,
}

/// Copies a scene and the files next to it.
fn copy(scene: &Path) -> Result<(tempfile::TempDir, PathBuf), AnyError> {
    let folder = tempfile::tempdir()?;
    let from = scene.parent().ok_or("expected a file")?;
    for entry in std::fs::read_dir(if from.as_os_str().is_empty() {
        Path::new(".")
    } else {
        from
    })? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            std::os::unix::fs::symlink(
                std::fs::canonicalize(entry.path())?,
                folder.path().join(entry.file_name()),
            )?;
        }
    }
    let path = folder.path().join(scene.file_name().ok_or("expected a file")?);
    std::fs::copy(scene, &path)?;
    Ok((folder, path))
}

/// Starts the view; returns the link to its page.
fn begin(options: &Options, scene: &Path) -> Result<(Process, String), AnyError> {
    let mut command = Command::new(&options.program);
    command
        .arg("live")
        .arg(scene)
        .args(["--listen", "127.0.0.1:0", "--quiet"]);
    if options.workers > 0 {
        command.args(["--workers", "0"]);
    }
    let child = command
        .env("BEAMFARM_TOKEN", TOKEN)
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()?;
    let mut process = Process(child);
    let lines = BufReader::new(process.0.stderr.take().ok_or("no stderr")?).lines();
    let mut lines = lines.map_while(Result::ok);
    let page = lines.find_map(|line| line.strip_prefix("page: ").map(str::to_owned));
    let page = page.ok_or("the view names no address")?;
    // Its later output must not block it.
    std::thread::spawn(move || lines.for_each(|line| eprintln!("{line}")));
    Ok((process, page))
}

fn workers(options: &Options, url: &str) -> Result<Vec<Process>, AnyError> {
    let start = |_| {
        let child = Command::new(&options.program)
            .args([
                "worker",
                "--connect",
                url,
                "--threads",
                "1",
                "--no-cache",
                "--log",
                "warn",
            ])
            .env("BEAMFARM_TOKEN", TOKEN)
            .stdout(Stdio::null())
            .spawn();
        Ok(Process(child?))
    };
    (0..options.workers).map(start).collect()
}

/// The centre of the handle to drag, in the page's pixels, and its kind.
const HANDLE: &str = "(() => {
    const grips = [...document.querySelectorAll('#overlay .grip')];
    const shown = (grip) => {
        const box = grip.querySelector('circle').getBoundingClientRect();
        return grip.style.display !== 'none' && box.width > 0 && [box.left + box.width / 2, box.top + box.height / 2];
    };
    for (const grip of grips) {
        const at = shown(grip);
        const canvas = document.getElementById('canvas').getBoundingClientRect();
        if (at && at[0] > canvas.left && at[0] < canvas.right && at[1] > canvas.top && at[1] < canvas.bottom
            && grip.classList.contains('lamp')) return { at, name: grip.dataset.name };
    }
    for (const grip of grips) {
        const at = shown(grip);
        const canvas = document.getElementById('canvas').getBoundingClientRect();
        if (at && at[0] > canvas.left && at[0] < canvas.right && at[1] > canvas.top && at[1] < canvas.bottom
            && / lamp /.test(grip.textContent)) return { at, name: grip.dataset.name };
    }
    return null;
})()";

const RING: &str = "(() => {
    const ring = document.querySelector('#overlay .grip.ring circle');
    if (!ring || ring.getBoundingClientRect().width === 0) return null;
    const box = ring.getBoundingClientRect();
    return { at: [box.right - 2, box.top + box.height / 2], around: [box.left + box.width / 2, box.top + box.height / 2] };
})()";

fn mouse(page: &mut Browser, kind: &str, [x, y]: [f64; 2], held: bool) {
    let button = if kind == "mouseMoved" && !held { "none" } else { "left" };
    let event = json!({
        "type": kind, "x": x, "y": y, "button": button, "buttons": u32::from(held), "clickCount": 1, "pointerType": "mouse"
    });
    page.call("Input.dispatchMouseEvent", event);
}

/// A handle to drag: after moving back if there is none in the picture; otherwise on something that is no light itself.
fn find(page: &mut Browser) -> Option<Value> {
    let wheel = |page: &mut Browser| {
        let event = json!({"type": "mouseWheel", "x": 500, "y": 400, "deltaX": 0, "deltaY": 120});
        page.call("Input.dispatchMouseEvent", event);
        std::thread::sleep(Duration::from_millis(300));
    };
    for look in 0..2 {
        for _ in 0..8 {
            let handle = page.evaluate(HANDLE);
            if !handle.is_null() {
                return Some(handle);
            }
            if look == 0 && page.evaluate("document.querySelector('#overlay .grip.lamp') !== null") == json!(true) {
                wheel(page);
            } else {
                break;
            }
        }
        // All handles, including those of emitting shapes.
        page.evaluate("document.getElementById('handles').click(); 0");
        std::thread::sleep(Duration::from_millis(500));
    }
    None
}

fn point(value: &Value) -> [f64; 2] {
    [0, 1].map(|i| value[i].as_f64().unwrap_or(f64::NAN))
}

fn measure(options: &Options, scene: &Path) -> Result<Measured, AnyError> {
    let (_folder, path) = copy(scene)?;
    let (view, link) = begin(options, &path)?;
    let (url, _) = link.split_once("/enter#").ok_or("the view names no token")?;
    let crew = workers(options, url)?;
    let mut page = Browser::open(&link);
    // The picture is 960 wide, and the panel is next to it.
    page.call(
        "Emulation.setDeviceMetricsOverride",
        json!({"width": 1320, "height": 900, "deviceScaleFactor": 1, "mobile": false}),
    );
    page.wait_for("document.getElementById('canvas')?.dataset.frame !== undefined");
    page.wait_for("document.querySelectorAll('#overlay .grip').length > 0");
    // What is rendered at the start does not count.
    std::thread::sleep(Duration::from_secs(1));
    let handle = find(&mut page).ok_or_else(|| format!("{}: no light is in the picture", scene.display()))?;
    let mut at = point(&handle["at"]);
    let mut around = None;
    // A light without a position is turned by its ring.
    mouse(&mut page, "mouseMoved", at, false);
    mouse(&mut page, "mousePressed", at, true);
    mouse(&mut page, "mouseReleased", at, false);
    let name = handle["name"].as_str().unwrap_or_default().to_owned();
    let moves = format!(
        "document.querySelector('#overlay .grip[data-name=\"{name}\"]:not(.ring)').classList.contains('is-still')"
    );
    // A click and a drag must not count as a double click.
    std::thread::sleep(Duration::from_secs(1));
    if page.evaluate(&moves) == json!(true) {
        page.wait_for(&format!("{RING} !== null"));
        let ring = page.evaluate(RING);
        at = point(&ring["at"]);
        around = Some(point(&ring["around"]));
    }
    page.evaluate("performance.clearMarks(); performance.clearMeasures(); 0");
    mouse(&mut page, "mouseMoved", at, false);
    mouse(&mut page, "mousePressed", at, true);
    let begun = Instant::now();
    let mut place = at;
    for event in 1.. {
        let time = f64::from(event) / RATE;
        if time > options.seconds {
            break;
        }
        // Back and forth, and a little up and down.
        let angle = time * 1.3;
        place = match around {
            None => [at[0] + 60.0 * libm::sin(angle), at[1] + 25.0 * libm::sin(1.7 * angle)],
            Some(center) => {
                let radius = at[0] - center[0];
                let turned = 0.5 * libm::sin(angle);
                [
                    center[0] + radius * libm::cos(turned),
                    center[1] + radius * libm::sin(turned),
                ]
            }
        };
        std::thread::sleep(Duration::from_secs_f64(time).saturating_sub(begun.elapsed()));
        mouse(&mut page, "mouseMoved", place, true);
    }
    let let_go = page.evaluate("performance.now()").as_f64().unwrap_or(0.0);
    mouse(&mut page, "mouseReleased", place, false);
    let passes = options.passes;
    page.wait_for_long(
        &format!("performance.getEntriesByName('picture').some((mark) => mark.detail.passes >= {passes})"),
        Duration::from_secs(600),
    );
    let said = page.evaluate(
        "({ measures: performance.getEntriesByName('change to picture').map((m) => [m.startTime, m.duration]),
            pictures: performance.getEntriesByName('picture').map((m) => [m.startTime, m.detail.step,
                m.detail.passes, m.detail.width, m.detail.steps]) })",
    );
    let rows = |name: &str| -> Vec<Vec<f64>> {
        let rows = said[name].as_array().into_iter().flatten();
        let numbers = |row: &Value| {
            row.as_array()
                .into_iter()
                .flatten()
                .map(|v| v.as_f64().unwrap_or(f64::NAN))
                .collect()
        };
        rows.map(numbers).collect()
    };
    let latencies: Vec<f64> = rows("measures").iter().map(|row| row[1]).collect();
    let pictures = rows("pictures");
    let during: Vec<f64> = pictures
        .iter()
        .map(|row| row[0])
        .filter(|time| *time < let_go)
        .collect();
    let gaps: Vec<f64> = during.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let after = |which: &dyn Fn(&[f64]) -> bool| {
        let first = pictures.iter().find(|row| row[0] > let_go && which(row));
        first.map_or(f64::NAN, |row| (row[0] - let_go) / 1000.0)
    };
    let full_size = after(&|row| row[2] > 0.0 || row[1] + 1.0 == row[4]);
    let first_pass = after(&|row| row[2] > 0.0);

    // Saved, and rendered by the command.
    page.evaluate("document.getElementById('save').click(); 0");
    page.wait_for("document.getElementById('dirty').hidden");
    let image = page.evaluate(
        "(async () => {
            const bytes = new Uint8Array(await (await fetch('/image.exr')).arrayBuffer());
            let text = '';
            for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
            return btoa(text);
        })()",
    );
    let wrongs = page.wrongs();
    if wrongs != json!([]) {
        return Err(format!("the page did wrong: {wrongs}").into());
    }
    drop((page, crew, view));
    let folder = path.parent().ok_or("no folder")?;
    let seen = folder.join("seen.exr");
    let bytes = base64::Engine::decode(
        &base64::engine::general_purpose::STANDARD,
        image.as_str().unwrap_or_default(),
    )?;
    std::fs::write(&seen, bytes)?;
    let passes = passes_of(&seen)?;
    let rendered = folder.join("rendered.exr");
    let status = Command::new(&options.program)
        .arg("render")
        .arg(&path)
        .args(["--quiet", "--passes", &passes.to_string(), "-o"])
        .arg(&rendered)
        .status()?;
    if !status.success() {
        return Err("render failed".into());
    }
    let is_exact = pixel_hash(&read_rgb(&seen)?) == pixel_hash(&read_rgb(&rendered)?);
    Ok(Measured {
        latency: [0.5, 0.95, 1.0].map(|share| quantile(&latencies, share)),
        pictures_a_second: during.len() as f64 / options.seconds,
        gap: quantile(&gaps, 0.95),
        full_size,
        first_pass,
        passes,
        is_exact,
    })
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (share * (sorted.len() as f64 - 1.0)).round().max(0.0) as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

/// The number of passes in the image's metadata.
fn passes_of(path: &Path) -> Result<u64, AnyError> {
    use exr::prelude::*;
    let image = read_all_data_from_file(path)?;
    let attributes = &image.attributes.other;
    let layers = image.layer_data.iter().flat_map(|layer| &layer.attributes.other);
    for (name, value) in attributes.iter().chain(layers) {
        if *name == *"beamfarmPasses" {
            return match value {
                attribute::AttributeValue::Text(text) => Ok(text.to_string().parse()?),
                attribute::AttributeValue::I32(number) => Ok(*number as u64),
                attribute::AttributeValue::F64(number) => Ok(*number as u64),
                other => Err(format!("passes as {other:?}").into()),
            };
        }
    }
    Err("no number of passes in the image".into())
}
