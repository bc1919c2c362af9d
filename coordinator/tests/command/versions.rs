//! Job folders and messages of other versions of the program, kept in `tests/data/versions`. Those with the same bits
//! go on; everything else is refused with what it needs.

use crate::setup::{beamfarm, line, run, spawn, succeed, text};
use beamfarm_proto::wire::RegisterRequest;
use beamfarm_proto::wire::farm_client::FarmClient;
use prost::Message;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tonic::Code;

const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/versions");

/// A folder with the scene of all jobs, and this job.
fn folder(name: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let kept = Path::new(KEPT).join("jobs");
    std::fs::copy(kept.join("scene.toml"), folder.path().join("scene.toml")).unwrap();
    copy(&kept.join(name), &folder.path().join("a.job"));
    folder
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for (name, bytes) in files(from) {
        let to = to.join(name);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::write(to, bytes).unwrap();
    }
}

/// All files of a folder and its subfolders.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = PathBuf::from(path.file_name().unwrap());
        match path.is_dir() {
            true => files.extend(
                self::files(&path)
                    .into_iter()
                    .map(|(inner, bytes)| (name.join(inner), bytes)),
            ),
            false => drop(files.insert(name, std::fs::read(&path).unwrap())),
        }
    }
    files
}

fn description(job: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(job.join("job.json")).unwrap()).unwrap()
}

/// Changes a field of job.json.
fn say(job: &Path, field: &str, value: Value) {
    let mut all = description(job);
    all[field] = value;
    std::fs::write(job.join("job.json"), all.to_string()).unwrap();
}

const EIGHT: [&str; 6] = ["render", "scene.toml", "-o", "a.exr", "--passes", "8"];

/// The pixels of eight passes by this version, and its identifier for their bits.
fn fresh() -> (String, Value) {
    let folder = folder("cpu-1");
    let stdout = succeed(folder.path(), &[&EIGHT[..], &["--job", "new.job"]].concat());
    let bits = description(&folder.path().join("new.job"))["engine"].take();
    (line(&stdout, "pixels ").to_owned(), bits)
}

#[test]
fn folders_of_other_versions_go_on_with_the_same_bits_or_say_which_can() {
    let (pixels, bits) = fresh();
    let mut count = 0;
    for entry in std::fs::read_dir(Path::new(KEPT).join("jobs")).unwrap() {
        let kept = entry.unwrap().path();
        if !kept.is_dir() {
            continue;
        }
        count += 1;
        let name = kept.file_name().unwrap().to_str().unwrap();
        let folder = folder(name);
        let path = folder.path();
        let job = path.join("a.job");
        let known = description(&job);
        let before = files(&job);
        let output = run(path, &EIGHT);
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        if known["engine"] == bits {
            assert!(output.status.success(), "{name}: {stderr}");
            assert!(stdout.contains("resuming a.job with 4 passes"), "{name}: {stdout}");
            assert_eq!(line(stdout, "pixels "), pixels, "{name}");
            continue;
        }
        assert_eq!(output.status.code(), Some(2), "{name}: {stderr}");
        let version = known["version"].as_str().unwrap();
        assert!(
            stderr.contains(&format!("only the version that began it, {version}, renders")),
            "{name}: {stderr}"
        );
        // Nothing is lost: that version can go on with the job.
        let mut after = files(&job);
        after.retain(|name, _| before.contains_key(name));
        assert!(after == before, "{name}");
        let stdout = succeed(path, &[&EIGHT[..], &["--restart"]].concat());
        assert_eq!(line(&stdout, "pixels "), pixels, "{name}");
    }
    assert!(count >= 9, "{count}");
}

#[test]
fn a_format_of_the_future_is_told() {
    let folder = folder("cpu-1");
    let job = folder.path().join("a.job");
    say(&job, "format", 3.into());
    let output = run(folder.path(), &EIGHT);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("format 3; this version of beamfarm"), "{stderr}");
}

/// A farm moves to another version: its coordinator goes on with its predecessor's results, and old workers are told
/// why they are sent away. New ones do the rest.
#[test]
fn a_farm_is_taken_to_another_version() {
    let folder = folder("cpu-1");
    let path = folder.path();
    std::fs::remove_dir_all(path.join("a.job")).unwrap();
    succeed(path, &[&EIGHT[..4], &["--passes", "4", "--job", "a.job"]].concat());
    let (pixels, _) = fresh();
    say(&path.join("a.job"), "version", "0.0.9".into());
    let mut args = EIGHT.to_vec();
    args[0] = "serve";
    args.extend(["--listen", "127.0.0.1:0"]);
    let mut serve = spawn(beamfarm(path, &args));
    let url = serve.out.wait_for("listening on ");
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let texts = std::fs::read_to_string(Path::new(KEPT).join("register.txt")).unwrap();
    let mut told = Vec::new();
    runtime.block_on(async {
        let mut farm = FarmClient::connect(url.clone()).await.unwrap();
        for message in texts.lines().filter(|line| !line.starts_with('#')) {
            let bytes: Vec<u8> = message
                .as_bytes()
                .chunks(2)
                .map(|digits| u8::from_str_radix(text(digits), 16).unwrap())
                .collect();
            let request = RegisterRequest::decode(&bytes[..]).unwrap();
            let refused = farm.register(request).await.unwrap_err();
            assert_eq!(refused.code(), Code::FailedPrecondition, "{refused}");
            told.push(refused.message().to_owned());
        }
    });
    assert!(told.len() >= 7);
    for (told, version) in told
        .iter()
        .zip(["0.1.0", "0.1.0", "0.1.0", "0.1.0", "0.1.0", "0.0.9", "9.0.0"])
    {
        let start = format!("version {version} with protocol ");
        assert!(
            told.starts_with(&start) && told.contains("; this coordinator is version "),
            "{told}"
        );
    }
    let worker = spawn(beamfarm(path, &["worker", "--connect", &url]));
    let output = serve.finish();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{stderr}");
    assert!(stdout.contains("resuming a.job with 4 passes"), "{stdout}");
    assert_eq!(line(stdout, "pixels "), pixels);
    assert!(worker.finish().status.success());
}
