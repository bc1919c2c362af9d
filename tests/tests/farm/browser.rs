//! The page in a browser that people have: Chromium without a window, over its DevTools protocol.

use crate::harness::{Coordinator, RawWorker, film, free_port, leaf, spec};
use base64::Engine;
use beamfarm_coordinator::Timing;
use beamfarm_coordinator::limits::Limits;
use beamfarm_coordinator::security::Security;
use beamfarm_image::exr::encode_block;
use beamfarm_proto::Token;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// Nothing here takes this long, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// The browser: the one that is named, or one with a usual name. The build script looks for the same.
fn chromium() -> Option<OsString> {
    let named = std::env::var_os("BEAMFARM_CHROMIUM");
    let mut programs = named.into_iter().chain(USUAL.map(OsString::from));
    programs.find(|program| {
        let version = Command::new(program)
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        version.is_ok_and(|status| status.success())
    })
}

const USUAL: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page.
struct Browser {
    process: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    session: Option<String>,
    calls: u64,
    _profile: TempDir,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Browser {
    /// Start it and open a page.
    fn open(url: &str) -> Self {
        let program = chromium().expect("no Chromium (Debian: apt-get install chromium)");
        let profile = tempfile::tempdir().unwrap();
        let mut folder = OsString::from("--user-data-dir=");
        folder.push(profile.path());
        let mut process = Command::new(program)
            .args(["--headless=new", "--no-sandbox", "--disable-gpu"])
            .args(["--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars"])
            .args(["--disable-background-networking", "--remote-debugging-port=0"])
            .arg(folder)
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let (sender, said) = std::sync::mpsc::channel();
        // Read to the end, whoever listens: the pipe must not fill up.
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(|l| drop(sender.send(l))));
        let (begun, mut heard) = (Instant::now(), Vec::new());
        let address = loop {
            let Ok(line) = said.recv_timeout(PATIENCE.saturating_sub(begun.elapsed())) else {
                let _ = process.kill();
                panic!("the browser names no address; it said {heard:#?}");
            };
            if let Some(address) = line.strip_prefix("DevTools listening on ") {
                break address.to_owned();
            }
            heard.push(line);
        };
        let (socket, _) = tungstenite::connect(address).unwrap();
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
        }
        let mut browser = Self {
            process,
            socket,
            session: None,
            calls: 0,
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attach = json!({"targetId": target["targetId"], "flatten": true});
        let attached = browser.call("Target.attachToTarget", attach);
        browser.session = Some(attached["sessionId"].as_str().unwrap().to_owned());
        browser.call("Page.enable", json!({}));
        // What the page's policy forbids, and what its script does wrong.
        let listen = "window.wrongs = [];
            addEventListener('securitypolicyviolation', (e) => wrongs.push(`policy: ${e.violatedDirective}`));
            addEventListener('error', (e) => wrongs.push(`error: ${e.message}`));
            addEventListener('unhandledrejection', (e) => wrongs.push(`rejection: ${e.reason}`));";
        let script = json!({"source": listen});
        browser.call("Page.addScriptToEvaluateOnNewDocument", script);
        browser.call("Page.navigate", json!({"url": url}));
        browser
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
        let mut answer = self.ask(method, params);
        assert!(answer["error"].is_null(), "{method}: {answer}");
        answer["result"].take()
    }

    /// What the browser answers, be it an error.
    fn ask(&mut self, method: &str, params: Value) -> Value {
        self.calls += 1;
        let mut call = json!({"id": self.calls, "method": method, "params": params});
        if let Some(session) = &self.session {
            call["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(call.to_string())).unwrap();
        let begun = Instant::now();
        loop {
            assert!(begun.elapsed() < PATIENCE, "no answer to {method}");
            let message = self.socket.read();
            let message = message.unwrap_or_else(|error| panic!("{method}: {error}"));
            let Message::Text(text) = message else {
                continue;
            };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == json!(self.calls) {
                return answer;
            }
        }
    }

    fn evaluate(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let mut answer = self.call("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {answer}");
        answer["result"]["value"].take()
    }

    /// Wait until this is true.
    fn wait_for(&mut self, condition: &str) {
        let begun = Instant::now();
        let params = json!({"expression": condition, "returnByValue": true, "awaitPromise": true});
        // A page that gives way to another one has no answer.
        while self.ask("Runtime.evaluate", params.clone())["result"]["result"]["value"] != json!(true) {
            if begun.elapsed() > PATIENCE {
                let page = self.evaluate("document.body.innerText");
                panic!("waited for {condition}; the page says {page}");
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Mean of the picture's values, from 0 to 255, and a number that changes with any of them.
    fn picture(&mut self) -> (f64, f64) {
        let sums = self.evaluate(
            "(() => {
                const image = document.getElementById('shown');
                const canvas = document.createElement('canvas');
                canvas.width = image.naturalWidth;
                canvas.height = image.naturalHeight;
                const context = canvas.getContext('2d');
                context.drawImage(image, 0, 0);
                const data = context.getImageData(0, 0, canvas.width, canvas.height).data;
                let sum = 0, hash = 0, count = 0;
                for (let i = 0; i < data.length; i++) {
                    if (i % 4 === 3) continue;
                    sum += data[i];
                    count += 1;
                    hash = (hash * 31 + data[i]) % 1000000007;
                }
                return [sum / count, hash];
            })()",
        );
        (sums[0].as_f64().unwrap(), sums[1].as_f64().unwrap())
    }

    /// The mouse over a place of the picture, and how far its wheel turns.
    fn mouse(&mut self, kind: &str, wheel: f64) {
        let place = self.evaluate(
            "(() => {
                const shown = document.getElementById('shown');
                shown.scrollIntoView({ block: 'center', behavior: 'instant' });
                const box = shown.getBoundingClientRect();
                return [box.left + 0.5 * box.width, box.top + 0.5 * box.height];
            })()",
        );
        let event = json!({"type": kind, "x": place[0], "y": place[1], "deltaX": 0, "deltaY": wheel});
        self.call("Input.dispatchMouseEvent", event);
    }

    /// As in a window of this width; a narrow one is a phone's.
    fn look(&mut self, width: u32, scheme: &str) -> Value {
        let is_phone = width < 600;
        let scheme = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        self.call("Emulation.setEmulatedMedia", scheme);
        let touch = json!({"enabled": is_phone, "maxTouchPoints": 1 + u32::from(is_phone)});
        self.call("Emulation.setTouchEmulationEnabled", touch);
        let (height, scale) = if is_phone { (844, 2) } else { (800, 1) };
        let size = json!({"width": width, "height": height, "deviceScaleFactor": scale, "mobile": is_phone});
        self.call("Emulation.setDeviceMetricsOverride", size.clone());
        size
    }

    /// The whole page in a window of this width, as PNG.
    fn screenshot(&mut self, path: &Path, width: u32, scheme: &str) {
        let mut size = self.look(width, scheme);
        size["height"] = self.evaluate("document.documentElement.scrollHeight");
        self.call("Emulation.setDeviceMetricsOverride", size);
        let picture = self.call("Page.captureScreenshot", json!({"format": "png"}));
        let bytes = base64::engine::general_purpose::STANDARD
            .decode(picture["data"].as_str().unwrap())
            .unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}

async fn deliver(worker: &RawWorker, passes: u64) {
    let mut delivered = 0;
    while delivered < passes {
        let leased = worker.lease().await;
        let block = leased.1;
        let nodes = block.passes().map(|pass| leaf(pass, film(pass)));
        let node = nodes.reduce(|a, b| beamfarm_image::merge::Node::join(a, b).unwrap());
        let bytes = encode_block(&node.unwrap(), &worker.meta(block), &[]).unwrap();
        worker.submit(leased, bytes).await.unwrap();
        delivered += block.len();
    }
}

const SET: &str = "(id, value) => {
    const input = document.getElementById(id);
    input.value = value;
    input.dispatchEvent(new Event('input'));
}";

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(has_chromium), ignore = "no Chromium when this was built")]
async fn the_image_changes_and_the_numbers_move() {
    let coordinator = Coordinator::start(spec(6)).await;
    let worker = RawWorker::register(&coordinator).await;
    let _attendance = worker.attend().await;
    let mut page = Browser::open(&coordinator.url());
    let state = |text: &str| format!("document.getElementById('state')?.innerText.includes('{text}') ?? false");
    let shows = |passes: u64| {
        format!(
            "document.getElementById('shown')?.dataset.passes === '{passes}' && document.getElementById('shown').complete"
        )
    };
    page.wait_for(&state("0 of 6 passes"));
    deliver(&worker, 2).await;
    page.wait_for(&state("2 of 6 passes"));
    page.wait_for(&shows(2));
    let (mean, first) = page.picture();
    deliver(&worker, 2).await;
    page.wait_for(&state("4 of 6 passes"));
    page.wait_for(&shows(4));
    let (_, second) = page.picture();
    assert_ne!(first, second);
    let percent = page.evaluate("document.querySelector('progress').value");
    assert_eq!(percent, json!(66.6));
    let title = page.evaluate("document.title");
    assert!(
        title.as_str().unwrap().starts_with("67 % Rendering") || title.as_str().unwrap().starts_with("66 % Rendering"),
        "{title}"
    );

    // The slider, the map of the error, and the zoom.
    page.evaluate(&format!("({SET})('exposure', '-6')"));
    page.wait_for("document.getElementById('caption').innerText.includes('-6 EV')");
    let (darker, _) = page.picture();
    assert!(darker < 0.5 * mean, "{darker} {mean}");
    page.evaluate(&format!("({SET})('view', 'error')"));
    page.wait_for("document.getElementById('caption').innerText.startsWith('Error of passes 0 to 3')");
    assert_eq!(page.evaluate("document.getElementById('scale').hidden"), json!(false));
    page.evaluate(&format!("({SET})('zoom', '4')"));
    assert_eq!(
        page.evaluate("document.getElementById('shown').clientWidth"),
        json!(160)
    );

    page.evaluate(&format!("({SET})('view', 'false')"));
    page.wait_for("document.getElementById('caption').innerText.includes('false colours at -6 EV')");
    page.evaluate("document.getElementById('brighter').click()");
    page.wait_for("document.getElementById('caption').innerText.includes('at -5.75 EV')");

    page.wait_for("document.querySelectorAll('#workers .rates polyline').length === 1");

    // The wheel zooms to what is under it, and the pixel there says what it holds.
    page.mouse("mouseMoved", 0.0);
    page.wait_for("/Pixel [0-9]+, [0-9]+: .* ± /.test(document.getElementById('value').innerText)");
    let place = |page: &mut Browser| page.evaluate("document.getElementById('value').innerText.split(':')[0]");
    let before = place(&mut page);
    page.mouse("mouseWheel", -400.0);
    page.wait_for("document.getElementById('shown').clientWidth === 320");
    page.mouse("mouseMoved", 0.0);
    assert_eq!(place(&mut page), before);

    // A picture that is held stays beside those that come.
    page.evaluate("document.getElementById('hold').click()");
    page.wait_for("document.getElementById('held').naturalWidth === 40");
    // And the job obeys.
    page.evaluate("document.getElementById('pause').click()");
    page.wait_for(&state("Paused"));
    page.evaluate("document.getElementById('resume').click()");
    page.wait_for(&state("Rendering"));
    page.evaluate("document.getElementById('passes').value = 7");
    page.evaluate("document.getElementById('extend').click()");
    page.wait_for(&state("4 of 7 passes"));
    deliver(&worker, 1).await;

    deliver(&worker, 2).await;
    page.wait_for(&state("Complete"));
    page.wait_for("document.getElementById('connection').innerText.includes('is over')");
    page.wait_for(&shows(7));
    assert_eq!(
        page.evaluate("document.querySelectorAll('#curve circle').length > 1"),
        json!(true)
    );
    assert_eq!(page.evaluate("window.wrongs"), json!([]));
}

/// The link that `render` prints: its token stands where no server and no log sees it.
#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(has_chromium), ignore = "no Chromium when this was built")]
async fn a_link_opens_the_page() {
    const TOKEN: &str = "a-token-of-the-job";
    let security = Security {
        token: Some(Token::parse(TOKEN).unwrap()),
        ..Security::default()
    };
    let doors = (security, Limits::default());
    let timing = Timing::default();
    let coordinator = Coordinator::start_behind(free_port(), spec(6), timing, doors).await;
    let url = coordinator.url();
    let mut page = Browser::open(&format!("{url}/enter#wrong-token-of-a-job"));
    page.wait_for("document.body?.innerText.includes('opens nothing any more') ?? false");
    let mut page = Browser::open(&format!("{url}/enter#{TOKEN}"));
    page.wait_for("document.getElementById('state')?.innerText.includes('0 of 6 passes') ?? false");
    // What belongs to it comes as well, the news among it.
    coordinator.farm.pause(true);
    page.wait_for("document.getElementById('state').innerText.includes('Paused')");
    assert_eq!(page.evaluate("location.href"), json!(format!("{url}/")));
    assert_eq!(page.evaluate("window.wrongs"), json!([]));
}

/// Text and what it stands on, and how far their brightness differs, where that is less than people need (WCAG 2.2,
/// 1.4.3).
const PALE: &str = "(() => {
    const parse = (text) => (text.match(/[0-9.]+/g) ?? []).map(Number);
    const luminance = ([r, g, b]) => [r, g, b]
        .map((v) => v / 255)
        .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
    const ground = (element) => {
        for (let at = element; at; at = at.parentElement) {
            const colour = parse(getComputedStyle(at).backgroundColor);
            if (colour.length === 3 || colour[3] === 1) return colour;
        }
        return [255, 255, 255];
    };
    const found = [];
    for (const element of document.body.querySelectorAll('*')) {
        const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
        if (!own || element.disabled || element.tagName === 'NOSCRIPT' || !element.getClientRects().length) continue;
        const style = getComputedStyle(element);
        const ink = element.ownerSVGElement ? style.fill : style.color;
        const [a, b] = [luminance(parse(ink)), luminance(ground(element))];
        const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        if (!(contrast >= 4.5)) found.push(`${element.textContent.trim().slice(0, 40)}: ${contrast}`);
    }
    return found;
})()";

/// Controls that a finger misses, on a phone.
const SMALL: &str = "[...document.querySelectorAll('button, select, input')]
    .map((element) => [element.id || element.textContent, element.getBoundingClientRect().height])
    .filter(([, height]) => height > 0 && height < 44)";

/// Parts of text that are too small to read.
const TINY: &str = "[...document.querySelectorAll('svg text')]
    .map((text) => text.getScreenCTM().a * parseFloat(getComputedStyle(text).fontSize))
    .filter((size) => size > 0 && size < 10.5)";

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(has_chromium), ignore = "no Chromium when this was built")]
async fn everybody_can_read_it() {
    let coordinator = Coordinator::start(spec(9)).await;
    let name = "a-machine-with-a-name-as-long-as-names-of-machines-get.farm.example.org";
    let worker = RawWorker::named(&coordinator, name).await;
    let _attendance = worker.attend().await;
    let leased = worker.lease().await;
    worker.submit(leased, b"no picture".to_vec()).await.unwrap_err();
    let mut page = Browser::open(&coordinator.url());
    for passes in [2, 4] {
        deliver(&worker, 2).await;
        page.wait_for(&format!("document.getElementById('shown')?.dataset.passes >= {passes}"));
    }
    page.wait_for("document.querySelector('#curve svg') !== null");
    for width in [320, 390, 768, 1024, 1920] {
        for scheme in ["light", "dark"] {
            page.look(width, scheme);
            let wide = page.evaluate("document.documentElement.scrollWidth");
            assert_eq!(wide, json!(width), "{scheme}");
            assert_eq!(page.evaluate(PALE), json!([]), "{width} {scheme}");
            assert_eq!(page.evaluate(TINY), json!([]), "{width} {scheme}");
            if width < 600 {
                assert_eq!(page.evaluate(SMALL), json!([]), "{width} {scheme}");
            }
        }
    }
    assert_eq!(page.evaluate("window.wrongs"), json!([]));
}

/// Pictures of the page of a job that runs at BEAMFARM_URL, for docs/manual.md and to be looked at: light, dark, as on
/// a phone, and without scripts, into the folder that BEAMFARM_SCREENSHOTS names. Run it with `--ignored`.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "for the picture in docs/manual.md"]
async fn the_page_in_pictures() {
    let folder = std::env::var_os("BEAMFARM_SCREENSHOTS").expect("BEAMFARM_SCREENSHOTS=FOLDER");
    let url = std::env::var("BEAMFARM_URL").expect("BEAMFARM_URL=http://HOST:PORT");
    let mut page = Browser::open(&url);
    page.wait_for("document.getElementById('shown')?.dataset.passes > 0");
    for (name, width, scheme) in [
        ("light", 1200, "light"),
        ("dark", 1200, "dark"),
        ("tablet", 768, "light"),
        ("phone", 390, "light"),
        ("phone-dark", 390, "dark"),
    ] {
        let path = Path::new(&folder).join(format!("{name}.png"));
        page.screenshot(&path, width, scheme);
    }
    page.evaluate(&format!("({SET})('view', 'error')"));
    page.wait_for("document.getElementById('caption').innerText.startsWith('Error of')");
    page.screenshot(&Path::new(&folder).join("error.png"), 1200, "light");
    page.call("Emulation.setScriptExecutionDisabled", json!({"value": true}));
    page.call("Page.navigate", json!({"url": url}));
    std::thread::sleep(Duration::from_secs(2));
    page.screenshot(&Path::new(&folder).join("no-script.png"), 1200, "light");
}
