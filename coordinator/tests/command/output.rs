//! Where images go: what commands say about paths that cannot be written.

use crate::setup::{fail, folder_with, scene, succeed};

/// Each command reports it before it begins, with the folder as it was written, and leaves nothing.
#[test]
fn a_folder_that_is_not_there_is_named() {
    let folder = folder_with(&scene([16, 12], 2, 100));
    let path = folder.path();
    let image = ["render", "scene.toml", "-o", "there.exr", "--job", "job", "--denoise"];
    std::fs::create_dir(path.join("job")).unwrap();
    succeed(path, &image);
    let before = std::fs::read_dir(path).unwrap().count();
    let commands: [&[&str]; 7] = [
        &["render", "scene.toml"],
        // It does not wait for the pilot.
        &["render", "scene.toml", "--budget", "1000000"],
        &["serve", "scene.toml", "--listen", "127.0.0.1:0"],
        &["replay", "scene.toml", "--pass", "0"],
        &["reference", "scene.toml", "--samples", "1000000"],
        &["merge", "job"],
        &["denoise", "there.exr"],
    ];
    for command in commands {
        let (code, stderr) = fail(path, &[command, &["-o", "out/a/x.exr"]].concat());
        assert_eq!(code, 1, "{command:?}: {stderr}");
        let said = "error: out/a/x.exr: the folder out/a does not exist: make it, or name another with -o";
        assert_eq!(stderr.trim_end(), said, "{command:?}");
        let (code, stderr) = fail(path, &[command, &["-o", "scene.toml/x.exr"]].concat());
        assert_eq!(code, 1, "{command:?}: {stderr}");
        assert!(stderr.contains("scene.toml is a file, not a folder"), "{stderr}");
    }
    assert_eq!(std::fs::read_dir(path).unwrap().count(), before);
}
