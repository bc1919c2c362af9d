//! The logs, for those who search them.

use crate::setup::{folder_with, run, scene};
use serde_json::Value;

#[test]
fn lines_name_their_job_worker_and_passes() {
    let folder = folder_with(&scene([16, 12], 6, 200));
    let args = ["render", "scene.toml", "--workers", "2", "--threads", "1"];
    let log = ["--log", "debug", "--log-format", "json"];
    let output = run(folder.path(), &[&args[..], &log].concat());
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    // The workers' lines are included, in the same form. Messages to the user are not logs.
    let lines: Vec<Value> = stderr
        .lines()
        .filter(|line| !line.starts_with("note: "))
        .map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}")))
        .collect();
    let about = |message: &str| {
        let is_it = move |line: &&Value| line["message"].as_str().unwrap().starts_with(message);
        let found: Vec<&Value> = lines.iter().filter(is_it).collect();
        assert!(!found.is_empty(), "no line {message:?} in {stderr}");
        found
    };
    for message in ["leased", "delivered", "rendered"] {
        for line in about(message) {
            assert!(line["worker"].is_u64(), "{line}");
            let block = line["block"].as_str().unwrap();
            assert!(block.starts_with("pass"), "{line}");
        }
    }
    for line in about("worker ") {
        assert!(line["worker"].is_u64() && line["name"].is_string(), "{line}");
    }
    for line in about("delivered").into_iter().chain(about("configuration")) {
        // A span's fields form a separate object.
        let job = line["span"]["job"].as_str().unwrap();
        assert!(job.starts_with("scene-"), "{line}");
    }
}
