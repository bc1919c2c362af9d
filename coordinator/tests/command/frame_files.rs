//! Frame files and misfortune: damage, a full disk, a kill, another command.

use crate::frames::{alone, folder, of_frame, report};
use crate::setup::{beamfarm, run, spawn, succeed, text};
use exr::image::FlatSamples;
use exr::image::write::WritableImage;
use std::path::Path;

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with(".beamfarm-"))
        .collect();
    names.sort();
    names
}

/// What a loss of power may leave: zeros, half a file, nothing. And pixels from someone else.
#[test]
fn damaged_images_are_told_and_rendered_anew() {
    let folder = folder(2);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-6", "-o", "f.#.exr"];
    succeed(path, &args);
    let all = report(&path.join("f.report.json"));
    let image = |frame: u32| path.join(format!("f.{frame}.exr"));
    let whole: Vec<Vec<u8>> = (1..=6).map(|frame| std::fs::read(image(frame)).unwrap()).collect();
    let zeros = |bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        let at = bytes.len() * 3 / 4;
        bytes[at..at + 100].fill(0);
        bytes
    };
    std::fs::write(image(1), zeros(&whole[0])).unwrap();
    std::fs::write(image(2), &whole[1][..whole[1].len() / 2]).unwrap();
    std::fs::write(image(3), "").unwrap();
    let mut other = exr::image::read::read_first_flat_layer_from_file(image(4)).unwrap();
    for channel in &mut other.layer_data.channel_data.list {
        if let FlatSamples::F32(samples) = &mut channel.sample_data {
            samples[7] += 1.0;
        }
    }
    other.write().to_file(image(4)).unwrap();
    // Damage to the PNG alone costs no rendering.
    let png = image(5).with_extension("png");
    let shown = std::fs::read(&png).unwrap();
    std::fs::write(&png, zeros(&shown)).unwrap();
    let written = [5, 6].map(|frame| std::fs::metadata(image(frame)).unwrap().modified().unwrap());

    let output = run(path, &args);
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{stderr}");
    for frame in 1..=4 {
        let start = format!("warning: f.{frame}.exr is damaged (");
        let end = format!("): frame {frame} is rendered anew");
        let is_told = |line: &str| line.starts_with(&start) && line.ends_with(&end);
        assert!(stderr.lines().any(is_told), "{stderr}");
    }
    assert!(
        stderr.contains("f.4.exr is damaged (its pixels are not those of the report)"),
        "{stderr}"
    );
    assert_eq!(stderr.matches("damaged").count(), 4, "{stderr}");
    assert_eq!(stdout.matches("is there already").count(), 2, "{stdout}");
    let again = report(&path.join("f.report.json"));
    for frame in 1..=6 {
        assert_eq!(of_frame(&again, frame)["pixels"], of_frame(&all, frame)["pixels"]);
    }
    assert_eq!(
        written,
        [5, 6].map(|frame| std::fs::metadata(image(frame)).unwrap().modified().unwrap())
    );
    assert!(std::fs::read(&png).unwrap() == shown);

    // Without a report, the checksums in the file reveal it.
    std::fs::remove_file(path.join("f.report.json")).unwrap();
    std::fs::write(image(6), zeros(&whole[5])).unwrap();
    let output = run(path, &args);
    let stderr = text(&output.stderr);
    assert!(
        output.status.success() && stderr.contains("f.6.exr is damaged ("),
        "{stderr}"
    );
    assert_eq!(stderr.matches("damaged").count(), 1, "{stderr}");
}

/// This includes frames that exist already, but only frames of this command, and none that another one is writing.
#[test]
fn what_killed_commands_were_writing_is_removed() {
    let folder = folder(1);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-2", "-o", "f.#.exr"];
    succeed(path, &args);
    assert_eq!(names(path), Vec::<String>::new());
    let temporary = |name: &str| std::fs::File::create(path.join(name)).unwrap();
    let busy = temporary(".beamfarm-f.1.exr-busy");
    busy.try_lock().unwrap();
    for name in [
        ".beamfarm-f.1.exr-a1b2c3",
        ".beamfarm-f.2.png-a1b2c3",
        ".beamfarm-f.1.csv-a1b2c3",
        ".beamfarm-f.report.json-a1b2c3",
        ".beamfarm-f.3.exr-a1b2c3",
        ".beamfarm-g.1.exr-a1b2c3",
    ] {
        temporary(name);
    }
    let stdout = succeed(path, &args);
    assert_eq!(stdout.matches("is there already").count(), 2, "{stdout}");
    let stay = [
        ".beamfarm-f.1.exr-busy",
        ".beamfarm-f.3.exr-a1b2c3",
        ".beamfarm-g.1.exr-a1b2c3",
    ];
    assert_eq!(names(path), stay);
}

#[cfg(unix)]
#[test]
fn one_command_at_a_time_renders_frames_of_a_name() {
    let folder = folder(2);
    let path = folder.path();
    let args = ["render", "scene.toml", "--frames", "1-24", "--time", "1h", "-o"];
    let mut command = beamfarm(path, &[&args[..], &["out/f.##.exr"]].concat());
    command.args(["--log", "debug"]);
    let mut first = spawn(command);
    first.log.wait_for("block=pass 0 pixels=");
    let second = run(path, &[&args[..], &["out/../out/f.##.exr"]].concat());
    let stderr = text(&second.stderr);
    assert_eq!((second.status.code(), text(&second.stdout)), (Some(1), ""), "{stderr}");
    let told = "f.report.json: another command renders frames of this name into this folder: wait for it, or name \
                others with -o\n";
    assert!(stderr.starts_with("error: out/") && stderr.ends_with(told), "{stderr}");
    // Other files in this folder are left alone.
    succeed(path, &["render", "scene.toml", "--frames", "1", "-o", "out/g.##.exr"]);
    first.kill();
    // A kill leaves no lock.
    succeed(path, &["render", "scene.toml", "--frames", "1", "-o", "out/f.##.exr"]);
    assert_eq!(names(&path.join("out")), Vec::<String>::new());
}

/// A file system that can be filled.
#[cfg(target_os = "linux")]
#[test]
#[cfg_attr(not(can_mount), ignore = "needs the right to mount a file system")]
fn frames_wait_for_a_full_disk_and_go_on() {
    use std::process::Command;
    let folder = folder(2);
    let path = folder.path();
    let disk = path.join("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=1m", "none"])
        .arg(&disk)
        .output();
    let mount = mount.unwrap();
    assert!(mount.status.success(), "{}", text(&mount.stderr));
    let ballast = disk.join("ballast");
    let fill = || {
        let mut file = std::fs::File::create(&ballast).unwrap();
        for size in [4096, 1] {
            while std::io::Write::write_all(&mut file, &vec![0; size]).is_ok() {}
        }
    };
    fill();
    let args = ["render", "scene.toml", "-o", "disk/f.#.exr", "--frames"];
    let mut render = spawn(beamfarm(path, &[&args[..], &["1-3"]].concat()));
    // The second is rendered while the first waits.
    for frame in [1, 2] {
        let warning = render.log.wait_for(&format!("disk/f.{frame}.exr: "));
        assert!(
            warning.ends_with("; another attempt follows in 5s, and more for 300s"),
            "{warning}"
        );
    }
    assert!(!disk.join("f.1.exr").exists());
    std::fs::remove_file(&ballast).unwrap();
    let output = render.finish();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{stderr}");
    assert!(stdout.contains("3 of 3 frames are there"), "{stdout}");
    let all = report(&disk.join("f.report.json"));
    for frame in 1..=3 {
        assert!(disk.join(format!("f.{frame}.png")).exists());
        assert_eq!(of_frame(&all, frame)["pixels"], alone(path, frame, &[]));
    }
    assert_eq!(names(&disk), Vec::<String>::new());

    // Without waiting, the command reports what is missing.
    fill();
    let mut render = spawn(beamfarm(path, &[&args[..], &["1-5"]].concat()));
    render.log.wait_for("disk/f.4.exr: ");
    render.signal("-INT");
    let output = render.finish();
    let stderr = text(&output.stderr);
    std::fs::remove_file(&ballast).unwrap();
    assert_eq!(output.status.code(), Some(5), "{stderr}");
    assert!(stderr.contains("\n  frame 4: disk/f.4.exr: "), "{stderr}");
    // The next command renders it.
    let stdout = succeed(path, &[&args[..], &["1-5"]].concat());
    assert_eq!(stdout.matches("is there already").count(), 3, "{stdout}");
    assert!(stdout.contains("5 of 5 frames are there"), "{stdout}");

    // Job folders are made, and record how the job ended, as soon as there is room.
    fill();
    let jobs = ["6-7", "--job", "disk/jobs"];
    let mut render = spawn(beamfarm(path, &[&args[..], &jobs].concat()));
    render.log.wait_for("disk/jobs/0006");
    std::fs::remove_file(&ballast).unwrap();
    let output = render.finish();
    assert!(output.status.success(), "{}", text(&output.stderr));
    for frame in [6, 7] {
        let job = report(&disk.join(format!("jobs/000{frame}/report.json")));
        assert_eq!(job["stopped"], "complete");
        let all = report(&disk.join("f.report.json"));
        assert_eq!(job["pixels"], of_frame(&all, frame)["pixels"]);
    }
    assert!(Command::new("umount").arg(&disk).status().unwrap().success());
}
