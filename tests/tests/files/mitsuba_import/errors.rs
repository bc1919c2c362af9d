//! Errors: all at once, at their lines; and what is left out on request.

use super::*;

const MANY: &str = r#"<shape type="teapot"/>
<shape type="sphere"><float name="colour" value="1"/><bsdf type="measured"/></shape>
<bsdf type="dielectric">
<float name="abbe" value="30"/></bsdf>
<emitter type="projector"/>
<medium type="homogeneous"><phase type="sggx"/></medium>
<bsdf type="diffuse"><texture type="wireframe" name="reflectance"/></bsdf>"#;

#[test]
fn everything_that_is_not_supported_is_named_at_once() {
    let found = errors(&with_sensor(MANY));
    let expected = [
        "scene.xml:2: shape \"teapot\" is not supported",
        "scene.xml:3: bsdf \"measured\" is not supported",
        "scene.xml:3: shape \"sphere\": the parameter \"colour\" is not supported",
        "scene.xml:5: bsdf \"dielectric\": the parameter \"abbe\" is not supported",
        "scene.xml:7: phase \"sggx\" is not supported",
        "scene.xml:8: texture \"wireframe\" is not supported",
    ];
    let mut found: Vec<_> = found.iter().map(String::as_str).collect();
    found.sort_unstable();
    assert_eq!(found, expected);
}

#[test]
fn what_is_not_supported_can_be_left_out() {
    let folder = folder(&[("scene.xml", &with_sensor(MANY))]);
    let options = ImportOptions {
        skip_unsupported: true,
        ..ImportOptions::default()
    };
    let imported = import_in(folder.path(), &options).unwrap();
    assert_eq!(imported.left_out.len(), 6, "{:#?}", imported.left_out);
    assert!(imported.text.contains("type = \"sphere\""));
    let file = SceneFile::read(&folder.path().join("scene.xml"), &options).unwrap();
    assert_eq!(file.load().unwrap().objects.len(), 1);
    // Mistakes remain errors.
    std::fs::write(
        folder.path().join("scene.xml"),
        with_sensor(r#"<shape type="cube"><ref id="x"/></shape>"#),
    )
    .unwrap();
    import_in(folder.path(), &options).unwrap_err();
}

/// The parser's time grows with the square of an element's attributes.
#[test]
fn an_element_has_few_attributes() {
    let many = |count: usize| (0..count).map(|i| format!(" a{i}=\"1\"")).collect::<String>();
    for count in [101, 50_000] {
        let found = errors(&with_sensor(&format!(
            "<shape type=\"cube\">\n<float{}/></shape>",
            many(count)
        )));
        assert_eq!(found, ["scene.xml:3: an element has more than 100 attributes"]);
    }
    // Many elements with few attributes each are fine.
    let boxes = "<shape type=\"cube\"/>".repeat(1000);
    try_import(&with_sensor(&boxes)).unwrap();
}

#[test]
fn what_is_replaced_is_noted() {
    let xml = bare(&format!(
        "<integrator type=\"volpath\"><integer name=\"max_depth\" value=\"8\"/></integrator>\n{}",
        SENSOR.replace(
            "</sensor>",
            "<sampler type=\"independent\"><integer name=\"sample_count\" value=\"7\"/></sampler></sensor>"
        )
    ));
    let imported = try_import(&xml).unwrap();
    assert_eq!(imported.notes.len(), 2, "{:?}", imported.notes);
    assert!(
        imported
            .notes
            .iter()
            .any(|n| n.contains("scene.xml:2: ") && n.contains("volpath"))
    );
    assert_eq!(field(&imported.text, "[render]", "passes"), Some("7"));
}

/// Errors found by the native scene's reader, at the XML's lines.
#[test]
fn later_errors_are_those_of_the_xml() {
    let missing = "\n<shape type=\"ply\">\n<string name=\"filename\" value=\"none.ply\"/></shape>";
    let flat = "<shape type=\"cube\">\n\n<transform name=\"to_world\"><scale x=\"0\"/></transform></shape>";
    for (elements, line, words) in [(missing, 4, "none.ply"), (flat, 4, "inverted")] {
        let folder = folder(&[("scene.xml", &with_sensor(elements))]);
        let path = folder.path().join("scene.xml");
        let file = SceneFile::read(&path, &ImportOptions::default());
        let error = file.and_then(|file| file.load()).unwrap_err();
        assert_eq!(
            (error.file.as_path(), error.line),
            (path.as_path(), Some(line)),
            "{error}"
        );
        assert!(error.message.contains(words), "{error}");
    }
    // Mistakes in an asset are reported at the asset's lines.
    let folder = folder(&[("scene.xml", &with_sensor(missing)), ("none.ply", "ply\nnonsense\n")]);
    let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
    let error = file.load().unwrap_err();
    assert_eq!(error.file, folder.path().join("none.ply"), "{error}");
}

#[test]
fn a_scene_needs_a_sensor() {
    assert_error(&bare(""), "scene.xml:1: ", &["<sensor>"]);
}
