//! Hostile files: each gives an error with its reason, quickly and without much memory.

use super::*;

#[test]
fn entities_are_refused() {
    let bomb = r#"<!DOCTYPE scene [<!ENTITY a "xxxxxxxxxx"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]><scene version="3.0.0"><shape type="&c;"/></scene>"#;
    assert_error(bomb, "scene.xml:1: ", &["DOCTYPE", "not supported"]);
    let unknown = "<scene version=\"3.0.0\">\n<shape type=\"&a;\"/></scene>";
    assert_error(unknown, "scene.xml:2: ", &["entity", "a"]);
}

#[test]
fn deep_nesting_is_refused() {
    for depth in [200, 100_000] {
        let (open, close) = ("<bsdf type=\"twosided\">".repeat(depth), "</bsdf>".repeat(depth));
        assert_error(
            &with_sensor(&format!("{open}{close}")),
            "scene.xml:2: ",
            &["within each other"],
        );
    }
}

#[test]
fn chains_and_cycles_of_references_are_refused() {
    let link = |i: usize| format!("<bsdf type=\"twosided\" id=\"b{i}\"><ref id=\"b{}\"/></bsdf>", i + 1);
    let chain: String = (0..50_000).map(link).collect();
    let end = "<bsdf type=\"diffuse\" id=\"b50000\"/>";
    assert_error(
        &with_sensor(&format!("{chain}{end}")),
        "scene.xml:2: ",
        &["refer to each other"],
    );
    let cycle = "<bsdf type=\"twosided\" id=\"a\"><ref id=\"b\"/></bsdf>\n<bsdf type=\"twosided\" id=\"b\"><ref id=\"a\"/></bsdf>";
    assert_error(&with_sensor(cycle), "scene.xml:", &["refers to itself"]);
}

/// Each level refers to the next one twice: 2^60 paths.
#[test]
fn what_is_shared_is_read_once() {
    let link = |i: usize| {
        let next = i + 1;
        format!("<bsdf type=\"twosided\" id=\"b{i}\"><ref id=\"b{next}\"/><ref id=\"b{next}\"/></bsdf>")
    };
    let levels: String = (0..60).map(link).collect();
    let xml = with_sensor(&format!("{levels}<bsdf type=\"diffuse\" id=\"b60\"/>"));
    assert!(native(&xml).contains("[materials.b0]"));
}

#[test]
fn cycles_of_includes_are_refused() {
    let include = |name: &str| format!("<scene version=\"3.0.0\"><include filename=\"{name}\"/></scene>");
    let folder = folder(&[("scene.xml", &include("a.xml")), ("a.xml", &include("./scene.xml"))]);
    let errors = import_in(folder.path(), &ImportOptions::default()).unwrap_err();
    assert!(
        errors[0].starts_with("a.xml:1: ") && errors[0].contains("includes itself"),
        "{errors:?}"
    );
}

#[test]
fn includes_within_includes_have_an_end() {
    let name = |i: usize| {
        if i == 0 {
            "scene.xml".to_string()
        } else {
            format!("{i}.xml")
        }
    };
    let file = |i: usize| {
        (
            name(i),
            format!("<scene version=\"3.0.0\"><include filename=\"{}.xml\"/></scene>", i + 1),
        )
    };
    let files: Vec<_> = (0..30).map(file).collect();
    let files: Vec<_> = files.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    let errors = import_in(folder(&files).path(), &ImportOptions::default()).unwrap_err();
    assert!(errors[0].contains("included within each other"), "{errors:?}");
}

/// Fifteen levels that each include the next one ten times: 10^15 elements.
#[test]
fn includes_of_many_includes_have_an_end() {
    let name = |i: usize| {
        if i == 0 {
            "scene.xml".to_string()
        } else {
            format!("{i}.xml")
        }
    };
    let include = |i: usize| format!("<include filename=\"{}.xml\"/>", i + 1).repeat(10);
    let file = |i: usize| (name(i), format!("<scene version=\"3.0.0\">{}</scene>", include(i)));
    let mut files: Vec<_> = (0..14).map(file).collect();
    files.push((name(14), "<scene version=\"3.0.0\"/>".to_string()));
    let files: Vec<_> = files.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    let errors = import_in(folder(&files).path(), &ImportOptions::default()).unwrap_err();
    assert!(errors[0].contains("more than"), "{errors:?}");
}

#[test]
fn parameters_of_parameters_have_an_end() {
    let double = |i: usize| format!("<default name=\"a{i}_\" value=\"$a{}_$a{}_\"/>", i - 1, i - 1);
    let doubles: String = (1..64).map(double).collect();
    let xml = with_sensor(&format!("<default name=\"a0_\" value=\"0123456789\"/>{doubles}"));
    assert_error(&xml, "scene.xml:2: ", &["bytes"]);
}

/// Truncated, duplicated or changed: an error or a scene, never a panic.
#[test]
fn damage_does_not_panic() {
    let whole = crate::files::mitsuba_import::equality::XML.as_bytes();
    let folder = folder(&[]);
    let path = folder.path().join("scene.xml");
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for round in 0..600 {
        let mut bytes = whole.to_vec();
        for _ in 0..1 + round % 3 {
            let at = random(bytes.len());
            let length = random(40).min(bytes.len() - at);
            match random(4) {
                0 => bytes.truncate(at.max(1)),
                1 => drop(bytes.drain(at..at + length)),
                2 => {
                    let part = bytes[at..at + length].to_vec();
                    let to = random(bytes.len());
                    bytes.splice(to..to, part);
                }
                _ => bytes[at] = b"\"$<>/0-e9 \xff"[random(11)],
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        let file = SceneFile::read(&path, &ImportOptions::default());
        let _ = file.and_then(|file| file.load());
    }
}
