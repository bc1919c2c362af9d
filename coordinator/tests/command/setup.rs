//! Scenes to run the command on, and running it.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output, Stdio};
use tempfile::TempDir;

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

/// A scene of this size, with so many passes and photon paths a pass.
pub fn scene([width, height]: [u32; 2], passes: u32, paths: u32) -> String {
    format!(
        "image = {{ width = {width}, height = {height} }}\n\
         render = {{ passes = {passes}, paths = {paths} }}\n{SCENE}"
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
    // What the environment says must not change what is tested.
    for name in ["RUST_LOG", "BEAMFARM_CONNECT", "BEAMFARM_CACHE"] {
        command.env_remove(name);
    }
    command.env("XDG_CACHE_HOME", folder.join("cache"));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

pub fn run(folder: &Path, args: &[&str]) -> Output {
    beamfarm(folder, args).output().unwrap()
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

/// Read the log until a line holds this text, and return what follows it there.
pub fn wait_for(log: &mut BufReader<ChildStderr>, text: &str) -> String {
    let mut read = String::new();
    for line in log.lines() {
        let line = line.unwrap();
        if let Some((_, rest)) = line.split_once(text) {
            return rest.to_owned();
        }
        read.push_str(&line);
        read.push('\n');
    }
    panic!("no {text:?} in the log:\n{read}");
}

pub fn spawn(mut command: Command) -> (Child, BufReader<ChildStderr>) {
    let mut child = command.spawn().unwrap();
    let log = BufReader::new(child.stderr.take().unwrap());
    (child, log)
}

/// The rest of the log has to be read, or the process blocks.
pub fn finish(child: Child, log: BufReader<ChildStderr>) -> (Output, String) {
    let log = std::thread::spawn(move || std::io::read_to_string(log).unwrap());
    let output = child.wait_with_output().unwrap();
    (output, log.join().unwrap())
}

pub fn signal(name: &str, pid: &str) {
    let status = Command::new("kill").args([name, pid]).status().unwrap();
    assert!(status.success(), "kill {name} {pid}");
}

/// A text that an image says about itself.
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

/// SplitMix64: places to be killed at.
pub fn random(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
