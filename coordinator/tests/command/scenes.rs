//! Messages about scenes that the program can render only in some way, or not at all.

use crate::setup::{fail, find_attribute, folder_with, run, scene, succeed};

#[test]
fn a_biased_image_is_announced_and_says_so_itself() {
    let plain = scene([16, 12], 4, 200);
    let rejecting = plain.replace("targeting = \"off\"", "targeting = \"reject\"");
    assert_ne!(plain, rejecting);
    for (text, is_biased) in [(plain, false), (rejecting, true)] {
        let folder = folder_with(&text);
        let path = folder.path();
        let args = ["--workers", "1", "--threads", "1", "--quiet", "--job"];
        let part = |name, more: &[&str]| run(path, &[&["render", "scene.toml"], &args[..], &[name], more].concat());
        let output = part("a.job", &["--passes", "2"]);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{stderr}");
        let warned = stderr
            .lines()
            .any(|line| line.contains("WARN") && line.contains("biased") && line.contains("targeting = \"reject\""));
        assert_eq!(warned, is_biased, "{stderr}");

        let biased = |name: &str| find_attribute(&path.join(name), "beamfarmBiased").is_some();
        assert_eq!(biased("scene.exr"), is_biased);
        assert!(part("b.job", &["--first-pass", "2"]).status.success());
        succeed(path, &["merge", "a.job", "b.job", "-o", "merged.exr"]);
        assert_eq!(biased("merged.exr"), is_biased);
    }
}

#[test]
fn the_path_tracer_names_the_rules_for_photons() {
    let plain = scene([8, 8], 1, 10).replace("type = \"sphere\"", "name = \"ball\"\ntype = \"sphere\"");
    let rules = "[[rules]]\nrays = [\"camera\"]\nexclude = [\"ball\"]\n\
                 [[rules]]\nrays = [\"shadow\", \"photon\"]\nexclude = [\"ball\"]\n";
    let text = format!("{plain}{rules}");
    let folder = folder_with(&text);
    let args = ["reference", "scene.toml", "--samples", "1"];
    let (code, stderr) = fail(folder.path(), &args);
    assert_eq!(code, 2, "{stderr}");
    let line = format!("scene.toml:{}: rules[1].exclude", text.lines().count());
    assert!(stderr.contains(&line), "{line}: {stderr}");
    assert_eq!(stderr.matches("scene.toml:").count(), 1, "{stderr}");
    assert!(stderr.contains("take \"photon\" out of the rays"), "{stderr}");

    let folder = folder_with(&text.replace(", \"photon\"", ""));
    succeed(folder.path(), &[&args[..], &["--quiet"]].concat());
}

/// In the image of a job, and in one made from its folder.
#[test]
fn depth_of_nothing_is_what_the_scene_says() {
    // A sphere, and nothing behind it.
    let folder = folder_with(&scene([16, 12], 2, 10));
    let path = folder.path();
    let args = ["--workers", "1", "--threads", "1", "--aov", "depth", "-o"];
    let render =
        |file: &str, more: &[&str]| succeed(path, &[&["render", "scene.toml"], &args[..], &[file], more].concat());
    render("infinite.exr", &[]);
    render("far.exr", &["-D", "render.empty_depth=1e10", "--job", "far.job"]);
    succeed(path, &["merge", "far.job", "-o", "merged.exr"]);
    let depth = |file: &str| {
        let image = exr::image::read::read_first_flat_layer_from_file(path.join(file)).unwrap();
        let mut channels = image.layer_data.channel_data.list.into_iter();
        let depth = channels.find(|channel| channel.name.to_string() == "depth.Z").unwrap();
        depth.sample_data.values_as_f32().collect::<Vec<f32>>()
    };
    let infinite = depth("infinite.exr");
    assert!(infinite.contains(&f32::INFINITY) && infinite.iter().any(|z| z.is_finite()));
    let expected: Vec<f32> = infinite.iter().map(|z| if z.is_finite() { *z } else { 1e10 }).collect();
    assert_eq!(depth("far.exr"), expected);
    assert_eq!(depth("merged.exr"), expected);
    let (code, stderr) = fail(path, &["render", "scene.toml", "-D", "render.empty_depth=inf"]);
    assert_eq!(code, 2, "{stderr}");
}
