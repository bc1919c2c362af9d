//! Jobs that are killed, resumed, extended, split and stopped.

use crate::setup::*;
use std::path::Path;
use std::time::{Duration, Instant};

fn folder() -> tempfile::TempDir {
    folder_with(&scene([48, 32], 24, 6000))
}

fn pixels(stdout: &str) -> String {
    line(stdout, "pixels").to_owned()
}

fn report(job: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(job.join("report.json")).unwrap()).unwrap()
}

#[test]
fn a_coordinator_killed_again_and_again_ends_with_the_same_bits() {
    let folder = folder();
    let path = folder.path();
    // Enough passes that it does not end before it is killed.
    let passes = ["--passes", "120"];
    let undisturbed = ["render", "scene.toml", "-o", "whole.exr"];
    let undisturbed = succeed(path, &[&undisturbed[..], &passes].concat());
    let args = [
        "render",
        "scene.toml",
        "-o",
        "a.exr",
        "--job",
        "a.job",
        "--workers",
        "2",
        "--threads",
        "1",
    ];
    let job = path.join("a.job");
    let mut kills = 0;
    let end = loop {
        let mut render = spawn(beamfarm(path, &[&args[..], &passes].concat()));
        // From before the first look at the directory to after several checkpoints.
        let patience = Duration::from_millis(random(kills) % 300);
        if kills >= 12 || render.ends(Instant::now() + patience).is_some() {
            break render.finish();
        }
        render.kill();
        kills += 1;
    };
    assert!(kills > 2, "it was never killed");
    let stdout = String::from_utf8(end.stdout).unwrap();
    let stderr = String::from_utf8(end.stderr).unwrap();
    assert!(end.status.success(), "{stderr}");
    assert_eq!(pixels(&stdout), pixels(&undisturbed));
    let report = report(&job);
    assert_eq!(
        (&report["prefix"], &report["stopped"]),
        (&120.into(), &"complete".into())
    );
    assert!(line(&stdout, "pixels").ends_with(report["pixels"].as_str().unwrap()));
    // The error report is also available to programs.
    assert!(report["median_error"].as_f64().is_some_and(|e| e > 0.0));
    assert!(line(&stdout, "relative").contains(", median of lit 8 x 8 blocks "));
    assert_eq!(line(&stdout, "bias of"), report["bias"].as_str().unwrap());
    assert!(report["bias_estimate"]["biased"].is_array());
    let ledger = std::fs::read_to_string(job.join("ledger.jsonl")).unwrap();
    for entry in ledger.lines() {
        let entry: serde_json::Value = serde_json::from_str(entry).unwrap();
        // A block that took one worker long may have been rendered by two.
        let state = entry["state"].as_str();
        assert!(matches!(state, Some("done" | "audited")), "{entry}");
    }
    // Each image says what it holds.
    let output = path.join("a.exr");
    assert_eq!(attribute(&output, "beamfarmPasses"), "120");
    assert_eq!(attribute(&output, "beamfarmLastPass"), "119");
    let set = attribute(&output, "beamfarmPassSet");
    assert_eq!(set, attribute(&path.join("whole.exr"), "beamfarmPassSet"));
    assert_eq!(report["pass_set"], set);
    assert!(stdout.contains(&format!("passes 0 to 119, set {set}")), "{stdout}");
}

/// What was found when a job began holds until it ends; it does not depend on the duration of its runs.
#[test]
fn a_job_goes_on_with_what_it_began_with() {
    let folder = folder();
    let path = folder.path();
    let args = |passes| ["render", "scene.toml", "--job", "a.job", "--passes", passes];
    succeed(path, &args("2"));
    let file = path.join("a.job/job.json");
    let json = std::fs::read_to_string(&file).unwrap();
    let mut job: serde_json::Value = serde_json::from_str(&json).unwrap();
    job["media_finder"] = "paths".into();
    std::fs::write(&file, job.to_string()).unwrap();
    // Passes of another job.
    for name in ["checkpoint-0", "checkpoint-1", "ledger.jsonl"] {
        let _ = std::fs::remove_file(path.join("a.job").join(name));
    }
    succeed(path, &args("4"));
    let finders = attribute(&path.join("scene.exr"), "beamfarmFinders");
    assert!(finders.starts_with("media by paths"), "{finders}");
    // The request is another job, and so is what a new pilot finds.
    let (code, stderr) = fail(path, &[&args("4")[..], &["--paths", "77"]].concat());
    assert_eq!(code, 2, "{stderr}");
    succeed(path, &[&args("4")[..], &["--restart"]].concat());
    assert!(attribute(&path.join("scene.exr"), "beamfarmFinders").starts_with("media by photons"));
}

#[test]
fn a_finished_job_can_have_more_passes() {
    let folder = folder();
    let path = folder.path();
    let whole = succeed(path, &["render", "scene.toml", "--passes", "13", "-o", "whole.exr"]);
    let args = |passes| ["render", "scene.toml", "--job", "a.job", "--passes", passes];
    succeed(path, &args("5"));
    let rows = || std::fs::read_to_string(path.join("scene.csv")).unwrap();
    let before = rows();
    assert_eq!(attribute(&path.join("scene.exr"), "beamfarmPasses"), "5");
    let stdout = succeed(path, &args("13"));
    assert!(stdout.contains("resuming a.job with 5 passes"), "{stdout}");
    assert_eq!(pixels(&stdout), pixels(&whole));
    assert!(rows().starts_with(&before), "{} {before}", rows());
    assert!(rows().lines().last().unwrap().starts_with("13,"));

    // Finished: the image is written again if anything happened to it.
    std::fs::remove_file(path.join("scene.exr")).unwrap();
    let stdout = succeed(path, &["render", "scene.toml", "--job", "a.job", "--resume"]);
    assert_eq!(pixels(&stdout), pixels(&whole));
    assert!(path.join("scene.exr").exists());

    let (code, stderr) = fail(path, &args("12"));
    assert_eq!(code, 2);
    assert!(stderr.contains("can be raised, not lowered"), "{stderr}");
    let (code, stderr) = fail(
        path,
        &[
            "render",
            "scene.toml",
            "--job",
            "a.job",
            "--seed",
            "5",
            "--aov",
            "depth",
        ],
    );
    assert_eq!(code, 2);
    assert!(
        stderr.contains("seed 0 there, 5 here\n  layers none there, depth here\n--restart"),
        "{stderr}"
    );
    let (code, stderr) = fail(path, &["render", "scene.toml", "--resume"]);
    assert_eq!(code, 2);
    assert!(stderr.contains("scene.job: no job to resume"), "{stderr}");

    // The report belongs to a job that has ended, not to one killed later.
    assert!(path.join("a.job/report.json").exists());
    let job = ["render", "scene.toml", "--job", "a.job"];
    let more = ["--time", "1h", "--log", "debug"];
    let mut render = spawn(beamfarm(path, &[&job[..], &more].concat()));
    render.log.wait_for("block=pass 13 pixels=");
    render.kill();
    assert!(!path.join("a.job/report.json").exists());
}

/// Jobs a, b and c that make a whole of 12 passes, and d, which is part of another.
fn render_parts(path: &Path) {
    let part = |job: &str, first: &str, passes: &str, more: &[&str]| {
        let mut args = vec![
            "render",
            "scene.toml",
            "--job",
            job,
            "--aov",
            "depth,stderr,crypto_object",
        ];
        args.extend(["--first-pass", first, "--passes", passes]);
        args.extend(more);
        succeed(path, &args)
    };
    part("a.job", "0", "3", &[]);
    let image = std::fs::metadata(path.join("scene.exr")).unwrap().modified().unwrap();
    let stdout = part("b.job", "3", "7", &[]);
    assert!(stdout.contains("passes 3 to 6 are complete"), "{stdout}");
    part("c.job", "7", "12", &[]);
    part("d.job", "7", "9", &["--seed", "9"]);
    assert_eq!(
        std::fs::metadata(path.join("scene.exr")).unwrap().modified().unwrap(),
        image
    );
}

#[test]
fn jobs_of_disjoint_passes_make_one_image() {
    let folder = folder();
    let path = folder.path();
    let whole = succeed(
        path,
        &[
            "render",
            "scene.toml",
            "--passes",
            "12",
            "-o",
            "whole.exr",
            "--aov",
            "depth,stderr,crypto_object",
        ],
    );
    render_parts(path);
    let merged = succeed(path, &["merge", "c.job", "a.job", "b.job", "-o", "merged.exr"]);
    assert_eq!(pixels(&merged), pixels(&whole));
    assert_eq!(line(&merged, "passes 0 to"), line(&whole, "passes 0 to"));
    let compared = succeed(path, &["compare", "merged.exr", "whole.exr"]);
    assert!(compared.contains("identical"), "{compared}");
    // Except for the time, they are the same files, with layers and errors.
    let channels = |name: &str| {
        let image = exr::image::read::read_first_flat_layer_from_file(path.join(name)).unwrap();
        image.layer_data.channel_data
    };
    assert_eq!(channels("merged.exr"), channels("whole.exr"));
    merge_into_a_job_that_goes_on(path, &whole);
    merge_what_does_not_fit(path);
}

/// As one job, which can go on.
fn merge_into_a_job_that_goes_on(path: &Path, whole: &str) {
    let merge = ["merge", "a.job", "b.job", "c.job", "-o", "merged.exr"];
    let merge = [&merge[..], &["--job", "all.job"]].concat();
    let kept = succeed(path, &merge);
    assert_eq!(line(&kept, "made"), "made all.job");
    assert_eq!(pixels(&kept), pixels(whole));
    let (code, stderr) = fail(path, &merge);
    assert_eq!(code, 2);
    assert!(stderr.contains("all.job: there is a job already"), "{stderr}");
    let aov = ["render", "scene.toml", "--aov", "depth,stderr,crypto_object"];
    let again = ["--resume", "--job", "all.job", "-o", "again.exr"];
    let again = succeed(path, &[&aov[..], &again].concat());
    assert!(again.contains("resuming all.job with 12 passes"), "{again}");
    assert_eq!(pixels(&again), pixels(whole));
    let more = ["--passes", "19", "-o", "more.exr"];
    let more = [&aov[..], &more].concat();
    let undisturbed = succeed(path, &more);
    let continued = succeed(path, &[&more[..], &["--job", "all.job"]].concat());
    assert_eq!(pixels(&continued), pixels(&undisturbed));
    let ledger = std::fs::read_to_string(path.join("all.job/ledger.jsonl")).unwrap();
    let mut passes: Vec<u64> = ledger
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
        // Idle workers at the end render what another one has leased.
        .filter(|line| line["state"] == "done")
        .flat_map(|line| {
            let [level, index] = [0, 1].map(|i| line["block"][i].as_u64().unwrap());
            index << level..(index + 1) << level
        })
        .collect();
    passes.sort();
    assert!(passes.into_iter().eq(0..19));
}

fn merge_what_does_not_fit(path: &Path) {
    for (jobs, expected) in [
        (&["a.job", "c.job"][..], "passes 3 to 6 missing"),
        (&["b.job"], "passes 0 to 2 missing"),
        (&["a.job", "b.job", "a.job"], "a.job and a.job both have pass 0"),
        (&["a.job", "d.job"], "a.job and d.job are different jobs: seed 0 and 9"),
        (&["a.job", "e.job"], "e.job: no job to resume"),
    ] {
        let mut args = vec!["merge"];
        args.extend(jobs);
        args.extend(["-o", "bad.exr"]);
        let (code, stderr) = fail(path, &args);
        assert_eq!(code, 2, "{stderr}");
        assert!(stderr.contains(expected), "{stderr}");
        assert!(!path.join("bad.exr").exists());
    }
}

#[test]
fn the_same_error_is_reached_at_the_same_pass() {
    let folder = folder();
    let path = folder.path();
    let mut found = Vec::new();
    for (workers, name) in [("1", "a.exr"), ("2", "b.exr"), ("4", "c.exr")] {
        let args = [
            "render",
            "scene.toml",
            "--target-error",
            "8%",
            "--workers",
            workers,
            "--threads",
            "1",
            "-o",
            name,
        ];
        let stdout = succeed(path, &args);
        assert!(stdout.contains("stopped at the first test that met"), "{stdout}");
        found.push((attribute(&path.join(name), "beamfarmPasses"), pixels(&stdout)));
    }
    assert_eq!(found[0], found[1]);
    assert_eq!(found[0], found[2]);
    let passes: u64 = found[0].0.parse().unwrap();
    assert!(
        passes >= 3 && (passes.is_power_of_two() || (passes / 3 * 2).is_power_of_two()),
        "{passes}"
    );
    // It is the image of this number of passes.
    let plain = succeed(path, &["render", "scene.toml", "--passes", &found[0].0]);
    assert_eq!(pixels(&plain), found[0].1);

    // A job resumed with fewer passes stops there too; one that missed the target reports it.
    let job = ["render", "scene.toml", "--job", "a.job", "-o", "d.exr"];
    let run = |more: &[&str]| succeed(path, &[&job[..], more].concat());
    run(&["--passes", "2"]);
    let stopped = run(&["--target-error", "8%"]);
    assert_eq!(pixels(&stopped), found[0].1);
    assert_eq!(report(&path.join("a.job"))["stopped"], "target-error");
    // The same again, then more.
    assert_eq!(pixels(&run(&["--target-error", "8%"])), found[0].1);
    let more = (2 * passes + 1).to_string();
    run(&["--passes", &more]);
    let (code, stderr) = fail(path, &[&job[..], &["--target-error", "8%"]].concat());
    assert_eq!(code, 2);
    assert!(
        stderr.contains(&format!("the first {passes} passes of this job met it")),
        "{stderr}"
    );
    let (code, _) = fail(path, &["render", "scene.toml", "--target-error", "1"]);
    assert_eq!(code, 2);
}

#[test]
fn a_percentile_asks_for_more_than_the_mean_of_squares() {
    let folder = folder();
    let path = folder.path();
    let run = |percentile: &str| {
        let args = [
            "render",
            "scene.toml",
            "--target-error",
            "10%",
            "--target-percentile",
            percentile,
        ];
        succeed(path, &args);
        attribute(&path.join("scene.exr"), "beamfarmPasses")
            .parse::<u64>()
            .unwrap()
    };
    let (half, nearly_all) = (run("50"), run("99"));
    assert!(half <= nearly_all && nearly_all > 2, "{half} {nearly_all}");
}

#[cfg(unix)]
#[test]
fn two_coordinators_cannot_have_one_directory() {
    let folder = folder();
    let path = folder.path();
    let args = [
        "render",
        "scene.toml",
        "--job",
        "a.job",
        "--time",
        "1h",
        "--log",
        "debug",
    ];
    let mut render = spawn(beamfarm(path, &args));
    render.log.wait_for("checkpoint 0 of");
    let output = run(path, &args);
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        stderr.contains("another coordinator uses this job directory"),
        "{stderr}"
    );
    // A hangup writes what is complete and ends nothing. A checkpoint does not imply that the first pass is done:
    // another worker's may have arrived before it.
    render.log.wait_until_seen("block=pass 0 pixels=");
    render.signal("-HUP");
    render.log.wait_for("wrote scene.exr with ");
    assert!(
        attribute(&path.join("scene.exr"), "beamfarmPasses")
            .parse::<u64>()
            .unwrap()
            > 0
    );
    render.log.wait_for("delivered: ");
    render.signal("-TERM");
    let output = render.finish();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(report(&path.join("a.job"))["stopped"], "asked");
}

/// A file system that holds two images, but not two checkpoints.
#[cfg(target_os = "linux")]
#[test]
#[cfg_attr(not(can_mount), ignore = "needs the right to mount a file system")]
fn a_full_disk_costs_nothing() {
    use std::process::Command;
    let folder = folder();
    let path = folder.path();
    let undisturbed = succeed(path, &["render", "scene.toml", "--passes", "40"]);
    let disk = path.join("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=2m", "none"])
        .arg(&disk)
        .output();
    let mount = mount.unwrap();
    assert!(mount.status.success(), "{}", text(&mount.stderr));
    let args = [
        "render",
        "scene.toml",
        "-o",
        "full.exr",
        "--passes",
        "40",
        "--job",
        "disk/a.job",
        "--log",
        "beamfarm_coordinator=debug,warn",
    ];
    let mut render = spawn(beamfarm(path, &args));
    render.log.wait_for("checkpoint 0 of");
    std::fs::write(disk.join("ballast"), vec![0; 1 << 20]).unwrap_or_default();
    let mut ballast = std::fs::File::create(disk.join("more")).unwrap();
    // Fills the remaining space, finally byte by byte.
    for size in [4096, 1] {
        while std::io::Write::write_all(&mut ballast, &vec![0; size]).is_ok() {}
    }
    let warning = render.log.wait_for("the job goes on, and writes it again");
    assert!(warning.contains("5s"), "{warning}");
    render.kill();
    // The earlier checkpoint is good.
    std::fs::remove_file(disk.join("ballast")).unwrap();
    drop(ballast);
    std::fs::remove_file(disk.join("more")).unwrap();
    let output = run(path, &args);
    assert!(Command::new("umount").arg(&disk).status().unwrap().success());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let stdout = text(&output.stdout);
    assert!(stdout.contains("resuming disk/a.job"), "{stdout}");
    assert_eq!(pixels(stdout), pixels(&undisturbed));
}

/// A file size limit stands for a disk that stays full.
#[cfg(unix)]
#[test]
fn a_job_whose_checkpoints_cannot_be_written_still_makes_its_image() {
    use std::process::{Command, Stdio};
    let folder = folder();
    let path = folder.path();
    let undisturbed = succeed(path, &["render", "scene.toml", "--passes", "7"]);
    let binary = env!("CARGO_BIN_EXE_beamfarm");
    // 32 blocks of 512 or 1024 bytes: more than the image takes, less than its sum.
    let script = format!(
        "ulimit -f 40; trap '' XFSZ; exec {binary} render scene.toml -o full.exr --passes 7 --job a.job --workers 2 --threads 1"
    );
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).current_dir(path);
    shell.stdin(Stdio::null());
    shell.stdout(Stdio::piped()).stderr(Stdio::piped());
    let output = output(shell);
    let stderr = String::from_utf8(output.stderr).unwrap();
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("checkpoint-"), "{stderr}");
    assert!(stderr.contains("older than the image"), "{stderr}");
    assert_eq!(pixels(&stdout), pixels(&undisturbed));
    // Nothing half-written is left, and the job goes on from its last state.
    assert!(!path.join("a.job/checkpoint-0.part").exists());
    let args = [
        "render",
        "scene.toml",
        "-o",
        "full.exr",
        "--passes",
        "7",
        "--job",
        "a.job",
    ];
    assert_eq!(pixels(&succeed(path, &args)), pixels(&undisturbed));
}
