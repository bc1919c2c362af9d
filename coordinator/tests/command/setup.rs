//! Scenes to run the command on, and ways to run it.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Nothing that a test waits for takes this long: a line, a file, a requested end.
pub const LONG: Duration = Duration::from_secs(60);
/// Nor does a whole command, on a machine that is busy with other things.
const WHOLE_RUN: Duration = Duration::from_secs(300);
/// Polling interval.
const LOOK: Duration = Duration::from_millis(5);

/// A lamp in fog over a ball.
const SCENE: &str = r#"
[camera]
origin = [0.0, 1.0, 3.0]
target = [0.0, 1.0, 0.0]
fov = 50.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.4
[[shapes]]
type = "sphere"
center = [0, 1, 0]
radius = 0.35
[[lights]]
type = "point"
position = [0.5, 2, 0.5]
power = 100.0
"#;

/// Render settings for photons alone, which leave nothing to a pilot: it would take longer than most tests.
pub const BY_PHOTONS: &str = r#"media = "photons", surfaces = "photons", caustics = "photons", targeting = "off""#;

/// A scene of this size, with this many passes and photon paths per pass. A pass costs nothing but photons.
pub fn scene([width, height]: [u32; 2], passes: u32, paths: u32) -> String {
    format!(
        "image = {{ width = {width}, height = {height} }}\n\
         render = {{ passes = {passes}, paths = {paths}, {BY_PHOTONS} }}\n{SCENE}"
    )
}

/// A folder with it as scene.toml.
pub fn folder_with(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

pub fn beamfarm(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamfarm"));
    command.current_dir(folder).args(args);
    // The environment must not change what is tested.
    for name in ["RUST_LOG", "BEAMFARM_CONNECT", "BEAMFARM_CACHE"] {
        command.env_remove(name);
    }
    command.env("XDG_CACHE_HOME", folder.join("cache"));
    // Except Mesa's cache: what a software driver has compiled for one test serves the others.
    if let Some(cache) = cache_folder() {
        command.env("MESA_SHADER_CACHE_DIR", cache);
    }
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The user's cache folder.
fn cache_folder() -> Option<PathBuf> {
    let said = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    said.or_else(|| Some(Path::new(&std::env::var_os("HOME")?).join(".cache")))
}

pub fn run(folder: &Path, args: &[&str]) -> Output {
    output(beamfarm(folder, args))
}

/// Runs a command to its end.
pub fn output(command: Command) -> Output {
    spawn(command).finish()
}

pub fn succeed(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{args:?}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

/// Exit code and stderr of a command that must not succeed and must print nothing on stdout.
pub fn fail(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = run(folder, args);
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "", "{args:?}");
    let stderr = String::from_utf8(output.stderr).unwrap();
    (output.status.code().unwrap(), stderr)
}

/// The line of stdout that begins with this word.
pub fn line<'a>(stdout: &'a str, word: &str) -> &'a str {
    let found = stdout.lines().find(|line| line.starts_with(word));
    found.unwrap_or_else(|| panic!("no {word:?} in {stdout}"))
}

/// A process's output, read as it arrives, so that the process never waits for its reader.
pub struct Lines {
    coming: Receiver<String>,
    seen: String,
}

impl Lines {
    fn of(stream: Option<impl Read + Send + 'static>) -> Self {
        let (sender, coming) = channel();
        if let Some(stream) = stream {
            std::thread::spawn(move || {
                let mut stream = BufReader::new(stream);
                let mut line = Vec::new();
                while stream.read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
                    // Fails when the test is over; the rest is still read.
                    let _ = sender.send(String::from_utf8_lossy(&line).into_owned());
                    line.clear();
                }
            });
        }
        Self {
            coming,
            seen: String::new(),
        }
    }

    /// The next line, with its end. An error if none arrives in time, or none will come.
    pub fn next(&mut self, until: Instant) -> Result<String, RecvTimeoutError> {
        let patience = until.saturating_duration_since(Instant::now());
        let line = self.coming.recv_timeout(patience)?;
        self.seen.push_str(&line);
        Ok(line)
    }

    /// Waits for a line that contains this text; returns what follows the text there.
    pub fn wait_for(&mut self, text: &str) -> String {
        let until = Instant::now() + LONG;
        loop {
            match self.next(until) {
                Ok(line) => {
                    if let Some((_, rest)) = line.split_once(text) {
                        return rest.trim_end().to_owned();
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    panic!("no {text:?} within {LONG:?}, but:\n{}", self.seen)
                }
                Err(RecvTimeoutError::Disconnected) => {
                    panic!("it has ended without {text:?}:\n{}", self.seen)
                }
            }
        }
    }

    /// The same, but such a line may have come already.
    pub fn wait_until_seen(&mut self, text: &str) {
        if !self.so_far().contains(text) {
            self.wait_for(text);
        }
    }

    /// Everything that has arrived.
    pub fn so_far(&mut self) -> &str {
        self.seen.extend(self.coming.try_iter());
        &self.seen
    }

    /// Waits until nothing more will come.
    pub fn wait_for_end(&mut self) {
        if !self.has_ended(Instant::now() + LONG) {
            panic!("it goes on after {LONG:?}:\n{}", self.seen);
        }
    }

    /// The same until a deadline; returns whether it has ended.
    fn has_ended(&mut self, until: Instant) -> bool {
        loop {
            match self.next(until) {
                Ok(_) => {}
                Err(error) => return error == RecvTimeoutError::Disconnected,
            }
        }
    }
}

/// A process that does not outlive its test.
pub struct Process {
    child: Child,
    /// Its stdout, unless that goes elsewhere.
    pub out: Lines,
    /// Its stderr, unless that goes elsewhere. Ends when its children have ended as well.
    pub log: Lines,
}

pub fn spawn(mut command: Command) -> Process {
    let mut child = command.spawn().unwrap();
    Process {
        out: Lines::of(child.stdout.take()),
        log: Lines::of(child.stderr.take()),
        child,
    }
}

impl Process {
    pub fn signal(&self, name: &str) {
        signal(name, &self.child.id().to_string());
    }

    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    pub fn kill(&mut self) {
        // Fails when it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Its status, if it ends by then.
    pub fn ends(&mut self, until: Instant) -> Option<ExitStatus> {
        loop {
            let status = self.child.try_wait().unwrap();
            if status.is_some() || Instant::now() >= until {
                return status;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        let status = self.ends(Instant::now() + LONG);
        status.unwrap_or_else(|| panic!("it goes on after {LONG:?}:\n{}", self.said()))
    }

    /// Its status, and everything that it wrote.
    pub fn finish(mut self) -> Output {
        let until = Instant::now() + WHOLE_RUN;
        let whole = self.out.has_ended(until) && self.log.has_ended(until);
        match self.ends(until).filter(|_| whole) {
            Some(status) => Output {
                status,
                stdout: std::mem::take(&mut self.out.seen).into_bytes(),
                stderr: std::mem::take(&mut self.log.seen).into_bytes(),
            },
            None => panic!("it goes on after {WHOLE_RUN:?}:\n{}", self.said()),
        }
    }

    /// Everything that it has written so far.
    fn said(&mut self) -> String {
        format!("{}\n{}", self.out.so_far(), self.log.so_far())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Polls until `look` succeeds; panics with its last error.
pub fn wait_until<T>(what: &str, mut look: impl FnMut() -> Result<T, String>) -> T {
    let until = Instant::now() + LONG;
    loop {
        match look() {
            Ok(found) => return found,
            Err(instead) if Instant::now() >= until => {
                panic!("no {what} within {LONG:?}, but:\n{instead}")
            }
            Err(_) => std::thread::sleep(LOOK),
        }
    }
}

/// Output as text.
pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

pub fn signal(name: &str, pid: &str) {
    let status = Command::new("kill").args([name, pid]).status().unwrap();
    assert!(status.success(), "kill {name} {pid}");
}

/// A text attribute of an image.
pub fn attribute(path: &Path, name: &str) -> String {
    find_attribute(path, name).unwrap_or_else(|| panic!("no {name}"))
}

pub fn find_attribute(path: &Path, name: &str) -> Option<String> {
    let image = exr::image::read::read_first_flat_layer_from_file(path).unwrap();
    let attributes = &image.layer_data.attributes.other;
    match attributes.get(&exr::prelude::Text::from(name))? {
        exr::meta::attribute::AttributeValue::Text(text) => Some(text.to_string()),
        other => panic!("{other:?}"),
    }
}

/// SplitMix64: the points at which to kill.
pub fn random(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
