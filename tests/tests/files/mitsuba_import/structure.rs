//! Parameters, includes, ids, references, versions.

use super::*;

fn with(parameters: &[(&str, &str)]) -> ImportOptions {
    let parameters = parameters.iter().map(|(a, b)| (a.to_string(), b.to_string()));
    ImportOptions {
        parameters: parameters.collect(),
        ..ImportOptions::default()
    }
}

#[test]
fn parameters_have_defaults_and_are_replaced_from_outside() {
    let xml = bare(&format!(
        r#"<default name="r" value="0.25"/><default name="radius" value="2"/><default name="both" value="$r, 0.5, $r"/>
        <bsdf type="diffuse" id="m"><rgb name="reflectance" value="$both"/></bsdf>
        <shape type="sphere"><float name="radius" value="$radius"/></shape>{SENSOR}"#
    ));
    let folder = folder(&[("scene.xml", &xml)]);
    let text = import_in(folder.path(), &ImportOptions::default()).unwrap().text;
    assert_eq!(field(&text, "[materials.m]", "reflectance"), Some("[0.25, 0.5, 0.25]"));
    // The longest name that fits wins: $radius is not $r followed by "adius".
    assert_eq!(field(&text, "[[shapes]]", "radius"), Some("2.0"));
    let text = import_in(folder.path(), &with(&[("r", "0.125"), ("radius", "3")]))
        .unwrap()
        .text;
    assert_eq!(
        field(&text, "[materials.m]", "reflectance"),
        Some("[0.125, 0.5, 0.125]")
    );
    assert_eq!(field(&text, "[[shapes]]", "radius"), Some("3.0"));
    let errors = import_in(folder.path(), &with(&[("nobody", "1")])).unwrap_err();
    assert!(
        errors[0].contains("nobody") && errors[0].contains("not used"),
        "{errors:?}"
    );
}

#[test]
fn a_parameter_without_a_value_is_an_error_and_a_dollar_can_be_escaped() {
    let xml = with_sensor(r#"<bsdf type="diffuse"><rgb name="reflectance" value="$what"/></bsdf>"#);
    assert_error(&xml, "scene.xml:2: ", &["$what", "-D what=value"]);
    let xml = with_sensor(r#"<shape type="sphere" id="a\$b"/>"#);
    assert_eq!(field(&native(&xml), "[[shapes]]", "name"), Some("\"a$b\""));
}

#[test]
fn references_may_come_before_what_they_name() {
    let xml = with_sensor(
        r#"<shape type="sphere"><ref id="red"/></shape>
        <bsdf type="diffuse" id="red"><rgb name="reflectance" value="1 0 0"/></bsdf><alias id="red" as="rot"/>
        <shape type="cube"><ref id="rot"/></shape>"#,
    );
    let text = native(&xml);
    assert_eq!(text.matches("material = \"red\"").count(), 2, "{text}");
    assert_error(
        &with_sensor(r#"<shape type="cube"><ref id="nobody"/></shape>"#),
        "scene.xml:2: ",
        &["nobody"],
    );
    let twice = with_sensor("<shape type=\"cube\" id=\"a\"/>\n<shape type=\"cube\" id=\"a\"/>");
    assert_error(&twice, "scene.xml:3: ", &["\"a\"", "scene.xml:2"]);
    let given =
        r#"<bsdf type="diffuse"><float name="reflectance" value="0.3"/><float name="reflectance" value="0.4"/></bsdf>"#;
    assert_error(&with_sensor(given), "scene.xml:2: ", &["twice"]);
}

/// Files are searched for next to the file that names them, and the native scene names them from its own folder.
#[test]
fn includes() {
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let part = format!(
        r#"<scene version="3.0.0"><shape type="obj" id="leaf"><string name="filename" value="leaf.obj"/><ref id="green"/></shape>
        <default name="g" value="0.5"/>{SENSOR}</scene>"#
    );
    let scene = r#"<scene version="3.0.0"><include filename="parts/leaf.xml"/>
        <include filename="parts/green.xml"/></scene>"#;
    let green = r#"<bsdf version="3.0.0" type="diffuse" id="green"><rgb name="reflectance" value="0 $g 0"/></bsdf>"#;
    let folder = folder(&[
        ("scene.xml", scene),
        ("parts/leaf.xml", &part),
        ("parts/green.xml", green),
        ("parts/leaf.obj", mesh),
    ]);
    let text = import_in(folder.path(), &ImportOptions::default()).unwrap().text;
    assert_eq!(field(&text, "[[shapes]]", "file"), Some("\"parts/leaf.obj\""));
    assert_eq!(field(&text, "[[shapes]]", "material"), Some("\"green\""));
    assert_eq!(
        field(&text, "[materials.green]", "reflectance"),
        Some("[0.0, 0.5, 0.0]")
    );
    scene_in(folder.path());
    // For a native file elsewhere.
    std::fs::create_dir(folder.path().join("out")).unwrap();
    let out = folder.path().join("out");
    let text = import(&folder.path().join("scene.xml"), &out, &ImportOptions::default())
        .unwrap()
        .text;
    assert_eq!(field(&text, "[[shapes]]", "file"), Some("\"../parts/leaf.obj\""));
}

#[test]
fn errors_of_included_files_name_them() {
    let folder = folder(&[
        (
            "scene.xml",
            "<scene version=\"3.0.0\">\n<include filename=\"a.xml\"/></scene>",
        ),
        ("a.xml", "<scene version=\"3.0.0\">\n\n<shape type=\"teapot\"/></scene>"),
    ]);
    let errors = import_in(folder.path(), &ImportOptions::default()).unwrap_err();
    assert!(
        errors
            .iter()
            .any(|e| e.starts_with("a.xml:3: ") && e.contains("teapot")),
        "{errors:?}"
    );
    let missing = try_import(&bare("<include filename=\"b.xml\"/>")).unwrap_err();
    assert!(
        missing[0].starts_with("scene.xml:2: ") && missing[0].contains("b.xml"),
        "{missing:?}"
    );
}

#[test]
fn versions() {
    let xml = |version: &str| format!("<scene {version}>{SENSOR}</scene>");
    for version in ["3.0.0", "3.9.1", "2.1.0", "0.6.0"] {
        native(&xml(&format!("version=\"{version}\"")));
    }
    for version in ["version=\"x\"", "version=\"4.0.0\"", ""] {
        assert_error(&xml(version), "scene.xml:1: ", &["version"]);
    }
    assert_error(
        "<bsdf version=\"3.0.0\" type=\"diffuse\"/>",
        "scene.xml:1: ",
        &["<scene>"],
    );
}

#[test]
fn what_is_no_element_is_refused() {
    for element in [
        "<sphere/>",
        "<translate x=\"1\"/>",
        "<shape/>",
        "<ref/>",
        "<shape type=\"cube\" colour=\"red\"/>",
    ] {
        assert_error(&with_sensor(element), "scene.xml:2: ", &[]);
    }
    let inside = r#"<shape type="cube"><transform name="to_world"><shear x="1"/></transform></shape>"#;
    assert_error(&with_sensor(inside), "scene.xml:2: ", &["shear"]);
    assert_error(
        "<scene version=\"3.0.0\">\n\n<shape type=cube/></scene>",
        "scene.xml:3: ",
        &["XML"],
    );
}
