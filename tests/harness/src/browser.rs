//! A page in a real browser: headless Chromium over its DevTools protocol. It panics where tests fail.

#![allow(clippy::unwrap_used, clippy::missing_panics_doc)]

use base64::Engine;
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

/// Whether there is a browser on this machine.
pub fn is_there() -> bool {
    chromium().is_some()
}

/// The browser: the one that the environment names, or one with a usual name. The build script looks for the same.
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
pub struct Browser {
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
    /// Starts it and opens a page.
    pub fn open(url: &str) -> Self {
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
        // Read to the end even if nobody listens: the pipe must not fill up.
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
        // What the page's policy forbids, and errors of its script.
        let listen = "window.wrongs = [];
            addEventListener('securitypolicyviolation', (e) => wrongs.push(`policy: ${e.violatedDirective}`));
            addEventListener('error', (e) => wrongs.push(`error: ${e.message}`));
            addEventListener('unhandledrejection', (e) => wrongs.push(`rejection: ${e.reason}`));";
        let script = json!({"source": listen});
        browser.call("Page.addScriptToEvaluateOnNewDocument", script);
        browser.call("Page.navigate", json!({"url": url}));
        browser
    }

    /// What the page's policy forbade, and errors of its script, so far.
    pub fn wrongs(&mut self) -> Value {
        self.evaluate("window.wrongs")
    }

    /// The result of a method of the DevTools protocol.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        let mut answer = self.ask(method, params);
        assert!(answer["error"].is_null(), "{method}: {answer}");
        answer["result"].take()
    }

    /// The browser's answer, which may be an error.
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

    /// The value of an expression on the page.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let mut answer = self.call("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {answer}");
        answer["result"]["value"].take()
    }

    /// Waits until this is true.
    pub fn wait_for(&mut self, condition: &str) {
        self.wait_for_long(condition, PATIENCE);
    }

    /// Waits until this is true, at most this long.
    pub fn wait_for_long(&mut self, condition: &str, patience: Duration) {
        let begun = Instant::now();
        let params = json!({"expression": condition, "returnByValue": true, "awaitPromise": true});
        // A page that is being replaced gives no answer.
        while self.ask("Runtime.evaluate", params.clone())["result"]["result"]["value"] != json!(true) {
            if begun.elapsed() > patience {
                let page = self.evaluate("document.body.innerText");
                panic!("waited for {condition}; the page says {page}");
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Mean of the picture's values, from 0 to 255, and a number that changes with any of them.
    pub fn picture(&mut self) -> (f64, f64) {
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

    /// A mouse event over a point of the picture, and how far the wheel turns.
    pub fn mouse(&mut self, kind: &str, wheel: f64) {
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

    /// Sets the window's width; a narrow one is a phone's.
    pub fn look(&mut self, width: u32, scheme: &str) -> Value {
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
    pub fn screenshot(&mut self, path: &Path, width: u32, scheme: &str) {
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
