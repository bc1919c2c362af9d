//! `beamfarm bench`, and the record that every render leaves.

use crate::setup::{self, folder_with, scene};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

fn folder() -> TempDir {
    folder_with(&scene([24, 16], 3, 200))
}

fn succeed(folder: &Path, args: &str) -> String {
    let args: Vec<&str> = args.split_whitespace().collect();
    setup::succeed(folder, &args)
}

fn fail(folder: &Path, args: &str, code: i32, message: &str) {
    let args: Vec<&str> = args.split_whitespace().collect();
    let (failed_with, stderr) = setup::fail(folder, &args);
    assert_eq!(failed_with, code, "{args:?}: {stderr}");
    assert!(stderr.contains(message), "{args:?}: {stderr}");
}

/// The columns of a CSV file, by name.
fn read_csv(path: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

fn read_json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The page is well-formed and refers to nothing elsewhere. Returns the text of its elements.
fn read_page(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let options = roxmltree::ParsingOptions {
        allow_dtd: true,
        ..roxmltree::ParsingOptions::default()
    };
    let page = roxmltree::Document::parse_with_options(&text, options).unwrap();
    for node in page.descendants().filter(|node| node.is_element()) {
        let name = node.tag_name().name();
        assert!(
            !["script", "link", "iframe", "object", "base"].contains(&name),
            "{name}"
        );
        for attribute in node.attributes() {
            let (key, value) = (attribute.name(), attribute.value());
            let inside = !value.contains("//") || value.starts_with("data:");
            assert!(
                inside && (key != "src" || value.starts_with("data:image/png;base64,")),
                "{key}"
            );
        }
    }
    let style = page.descendants().find(|node| node.has_tag_name("style"));
    let style = style.or_else(|| page.descendants().find(|n| n.tag_name().name() == "style"));
    let style = style.unwrap().text().unwrap();
    assert!(!style.contains("url(") && !style.contains("@import"));
    assert!(style.contains("prefers-color-scheme: dark"));
    let texts = page.descendants().filter_map(|node| node.text());
    texts.map(|text| text.trim().to_owned()).collect()
}

#[test]
fn a_scene_is_measured_against_its_reference_and_against_others() {
    let folder = folder();
    let path = folder.path();
    succeed(path, "render scene.toml --aov stderr -o same.exr --quiet");
    succeed(path, "render scene.toml --seed 5 -o other.exr --quiet");
    let args = "bench scene.toml --reference same.exr --reference-noise 0 --against Other=other.exr,0.5,0.9 \
                -o out --date today";
    let stdout = succeed(path, args);
    for text in [
        "beamfarm: 3 passes",
        "relMSE 10\u{207b}\u{b3}",
        "Other",
        "Times faster",
        "bench.html",
    ] {
        assert!(stdout.contains(text), "{text}: {stdout}");
    }

    let rows = read_csv(&path.join("out/bench.csv"));
    let column = |name: &str| -> Vec<f64> { rows.iter().map(|row| row[name].parse().unwrap_or(f64::NAN)).collect() };
    assert_eq!(column("passes"), [1.0, 2.0, 3.0]);
    assert_eq!(column("photon_paths"), [200.0, 400.0, 600.0]);
    // The farm's image, to the last bit.
    assert_eq!(column("rel_mse")[2], 0.0);
    assert_eq!(column("mean_ratio")[2], 1.0);
    assert!(column("rel_mse")[0] > column("rel_mse")[1]);
    assert_eq!(column("net_rel_mse"), column("rel_mse"));
    for name in [
        "wall_seconds",
        "core_seconds",
        "beams",
        "beam_evaluations",
        "surface_photons",
    ] {
        let values = column(name);
        assert!(
            0.0 < values[0] && values[0] < values[1] && values[1] < values[2],
            "{name}: {values:?}"
        );
    }
    for name in ["block_deviation", "rmse", "bytes_per_beam"] {
        assert!(column(name)[0].abs() > 0.0, "{name}");
    }
    assert!(column("estimated_rel_mse")[0].is_nan() && column("estimated_rel_mse")[1] > 0.0);
    assert!(column("estimated_relative_error")[1] > 0.0);
    if cfg!(target_os = "linux") {
        let peak = column("peak_memory_bytes");
        assert!(peak[0] > 1e6 && peak[0] <= peak[2] && peak[2] < 1e9, "{peak:?}");
        assert_eq!(column("bytes_per_pixel")[0], peak[0] / (24.0 * 16.0));
    }

    let json = read_json(&path.join("out/bench.json"));
    assert_eq!(json["date"], "today");
    assert!(json["machine"]["cores"].as_u64().unwrap() >= 1);
    let scene = &json["scenes"][0];
    assert_eq!(scene["name"], "scene");
    assert_eq!(scene["runs"][0]["records"].as_array().unwrap().len(), 3);
    assert_eq!(scene["runs"][0]["settings"]["paths_per_pass"], 200);
    let point = &scene["peers"][0]["points"][0];
    assert_eq!(
        (&point["wall_seconds"], &point["core_seconds"]),
        (&0.5.into(), &0.9.into())
    );
    assert!(point["rel_mse"].as_f64().unwrap() > 0.0);

    let texts = read_page(&path.join("out/bench.html"));
    for text in [
        "wall seconds",
        "core-seconds",
        "Other",
        "reference",
        "relative error of beamfarm",
        "Memory",
    ] {
        assert!(texts.iter().any(|found| found == text), "{text}: {texts:?}");
    }
}

#[test]
fn the_reference_tells_its_own_noise() {
    let folder = folder();
    let path = folder.path();
    succeed(
        path,
        "render scene.toml --aov stderr --passes 8 --seed 3 -o ref.exr --quiet",
    );
    succeed(path, "bench scene.toml --reference ref.exr --passes 2 -o out --quiet");
    let json = read_json(&path.join("out/bench.json"));
    let noise = json["scenes"][0]["reference_noise"].as_f64().unwrap();
    assert!(noise > 0.0);
    let rows = read_csv(&path.join("out/bench.csv"));
    let value = |name: &str| rows[1][name].parse::<f64>().unwrap();
    assert!((value("rel_mse") - noise - value("net_rel_mse")).abs() < 1e-12);
}

#[test]
fn a_suite_has_scenes_configurations_and_figures_of_others() {
    let folder = folder();
    let path = folder.path();
    let suite = r#"
title = "All <of> & it"
[[scenes]]
name = "one"
scene = "scene.toml"
passes = 2
[[scenes.peers]]
name = "known figures"
points = [[0.1, 0.5], [10, 1e-4, 20]]
[[scenes]]
name = "two"
scene = "scene.toml"
passes = 1
[[runs]]
name = "as it is"
[[runs]]
name = "half"
scenes = ["one"]
passes = 4
overrides = { alpha = 0.5, paths = 100, radius = 0.05, schedule = "beam", seed = 1, threads = 1, width = 12, height = 8 }
"#;
    std::fs::write(path.join("suite.toml"), suite).unwrap();
    let output = succeed(path, "bench --suite suite.toml --paths 50 -o out --quiet");
    assert_eq!(output, "");
    let rows = read_csv(&path.join("out/bench.csv"));
    let found: Vec<[&str; 4]> = rows
        .iter()
        .map(|row| ["scene", "run", "passes", "width"].map(|name| row[name].as_str()))
        .collect();
    #[rustfmt::skip]
    assert_eq!(found, [
        ["one", "as it is", "1", "24"], ["one", "as it is", "2", "24"],
        ["one", "half", "1", "12"], ["one", "half", "2", "12"], ["one", "half", "4", "12"],
        ["two", "as it is", "1", "24"],
    ]);
    assert!(rows.iter().all(|row| row["rel_mse"].is_empty()));
    let settings = &read_json(&path.join("out/bench.json"))["scenes"][0]["runs"][1]["settings"];
    assert_eq!(settings["schedule"], "beam");
    // The command line overrides the file.
    assert_eq!(settings["paths_per_pass"], 50);
    assert_eq!((&settings["alpha"], &settings["seed"]), (&0.5.into(), &1.into()));
    let texts = read_page(&path.join("out/bench.html"));
    for text in ["All <of> & it", "one", "two", "half", "known figures"] {
        assert!(texts.iter().any(|found| found == text), "{text}");
    }
}

#[test]
fn what_cannot_be_measured_is_told_before_anything_is_rendered() {
    let folder = folder();
    let path = folder.path();
    let small = scene([16, 16], 3, 200);
    std::fs::write(path.join("small.toml"), small).unwrap();
    succeed(path, "render small.toml --passes 1 --quiet");
    succeed(path, "render scene.toml --passes 1 -o ref.exr --quiet");
    std::fs::write(
        path.join("bad.toml"),
        "[[scenes]]\nscene = \"scene.toml\"\npasses = \"x\"\n",
    )
    .unwrap();
    let half =
        "[[scenes]]\nscene = 'scene.toml'\nreference = 'ref.exr'\n[[runs]]\nname = 'a'\noverrides = { width = 12 }\n";
    std::fs::write(path.join("half.toml"), half).unwrap();
    let cases = [
        ("bench", "<SCENES>"),
        ("bench missing.toml", "missing.toml"),
        ("bench scene.toml --reference missing.exr", "missing.exr"),
        (
            "bench scene.toml --reference small.exr",
            "16 x 16 pixels, the scene 24 x 16",
        ),
        ("bench scene.toml --reference scene.toml", "scene.toml"),
        (
            "bench scene.toml small.toml --reference ref.exr",
            "one --reference for each scene",
        ),
        (
            "bench scene.toml --reference ref.exr --against a.exr",
            "[NAME=]OTHER.exr,SECONDS",
        ),
        ("bench scene.toml --reference ref.exr --against a.exr,1", "a.exr"),
        (
            "bench scene.toml --reference ref.exr --against x=small.exr,1",
            "small.exr",
        ),
        ("bench scene.toml --against ref.exr,1", "--reference"),
        (
            "bench scene.toml --reference ref.exr --reference-noise x",
            "--reference-noise",
        ),
        (
            "bench scene.toml --reference ref.exr --reference-noise=-1",
            "noise is -1",
        ),
        ("bench scene.toml --alpha 2", "alpha is 2"),
        ("bench scene.toml --radius 0", "radius is 0"),
        ("bench scene.toml --schedule day", "expected pass or beam"),
        ("bench scene.toml --passes 0", "--passes"),
        ("bench --suite missing.toml", "missing.toml"),
        ("bench --suite bad.toml", "bad.toml:3: "),
        ("bench --suite half.toml", "the scene 12 x 16"),
        ("bench scene.toml --suite bad.toml", "--suite"),
    ];
    for (args, message) in cases {
        fail(path, args, 2, message);
    }
    fail(path, "bench scene.toml -o ref.exr", 1, "ref.exr");
}

#[test]
fn help_teaches_suites() {
    let folder = folder();
    let help = succeed(folder.path(), "bench --help");
    for text in [
        "Examples:",
        "--against",
        "[[scenes.peers]]",
        "[[runs]]",
        "relMSE",
        "bench.csv",
    ] {
        assert!(help.contains(text), "{help}");
    }
    // The subcommand that bench starts for itself is hidden.
    assert!(!succeed(folder.path(), "--help").contains("bench-run"));
}

#[test]
fn every_render_leaves_its_error_against_time() {
    let folder = folder();
    let path = folder.path();
    let stdout = succeed(path, "render scene.toml --passes 40 -o a.exr");
    assert!(stdout.contains("wrote a.exr, a.png and a.csv"), "{stdout}");
    let rows = read_csv(&path.join("a.csv"));
    let column = |name: &str| -> Vec<f64> { rows.iter().map(|row| row[name].parse().unwrap_or(f64::NAN)).collect() };
    let passes = column("passes");
    assert_eq!(passes.last(), Some(&40.0));
    let before = &passes[..passes.len() - 1];
    assert!(before.windows(2).all(|pair| pair[1] >= 2.0 * pair[0]), "{passes:?}");
    assert!(column("relative_standard_error").last().unwrap() > &0.0);
    assert_eq!(column("photon_paths").last(), Some(&8000.0));
    for name in [
        "wall_seconds",
        "worker_seconds",
        "beams",
        "beam_evaluations",
        "surface_photons",
    ] {
        let values = column(name);
        // A job may be over before anyone has looked at its workers.
        let first = values[0] > 0.0 || name == "worker_seconds";
        assert!(first && values.is_sorted(), "{name}: {values:?}");
    }
    assert!(succeed(path, "render --help").contains("worker_seconds"));
    assert!(succeed(path, "serve --help").contains("OUT.csv"));
}
