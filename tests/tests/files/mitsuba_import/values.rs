//! Numbers, colours, spectra, vectors, booleans.

use super::*;

fn reflectance(element: &str) -> String {
    let xml = with_sensor(&format!(r#"<bsdf type="diffuse" id="m">{element}</bsdf>"#));
    let native = native(&xml);
    let found = field(&native, "[materials.m]", "reflectance").unwrap();
    found.to_string()
}

fn numbers(text: &str) -> Vec<f64> {
    let inner = text.trim_matches(['[', ']']);
    inner.split(", ").map(|x| x.parse().unwrap()).collect()
}

#[track_caller]
fn assert_near(found: &str, expected: &[f64]) {
    let numbers = numbers(found);
    assert_eq!(numbers.len(), expected.len(), "{found}");
    for (a, b) in numbers.iter().zip(expected) {
        assert!((a - b).abs() < 2e-6 * b.abs().max(1.0), "{found}, {expected:?}");
    }
}

#[test]
fn rgb_is_one_number_or_three_by_commas_or_spaces() {
    for (written, expected) in [
        ("0.5", "0.5"),
        ("0.2 0.4 0.6", "[0.2, 0.4, 0.6]"),
        ("0.2,0.4,0.6", "[0.2, 0.4, 0.6]"),
        ("0.2, 0.4, 0.6", "[0.2, 0.4, 0.6]"),
        (" +0.5 ", "0.5"),
        ("1e-1", "0.1"),
    ] {
        let found = reflectance(&format!(r#"<rgb name="reflectance" value="{written}"/>"#));
        assert_eq!(found, expected, "{written}");
    }
    assert_eq!(reflectance(r#"<float name="reflectance" value="0.3"/>"#), "0.3");
}

/// Mitsuba refuses all of these as well, except nan.
#[test]
fn other_rgb_is_refused() {
    for written in [
        "#ff8000",
        "red",
        "0.2;0.4;0.6",
        "0.1 0.2",
        "0.5f",
        "0x1",
        "",
        "nan",
        "1.5",
        "-0.1",
    ] {
        let element = format!(r#"<bsdf type="diffuse"><rgb name="reflectance" value="{written}"/></bsdf>"#);
        assert_error(&with_sensor(&element), "scene.xml:2: ", &["reflectance"]);
    }
}

#[test]
fn a_spectrum_is_grey_in_materials_and_not_in_emitters() {
    assert_eq!(reflectance(r#"<spectrum name="reflectance" value="0.5"/>"#), "0.5");
    let xml = with_sensor(r#"<emitter type="point" id="p"><spectrum name="intensity" value="2"/></emitter>"#);
    let native = native(&xml);
    // Mitsuba's: 2.40959, 1.89658, 1.81783.
    assert_near(
        field(&native, "[[lights]]", "intensity").unwrap(),
        &[2.409588, 1.896582, 1.817832],
    );
}

/// Expected: Mitsuba's values, to its six digits.
#[test]
fn wavelengths_become_colours() {
    let list = "400:0.1, 500:0.5, 600:0.8, 700:0.9";
    let found = reflectance(&format!(r#"<spectrum name="reflectance" value="{list}"/>"#));
    assert_near(&found, &[0.878015, 0.635779, 0.270342]);
    // Values outside the range are clamped in a reflectance, but not in an index of refraction.
    let steep = "400:0.1,500:2,700:0.2";
    let found = reflectance(&format!(r#"<spectrum name="reflectance" value="{steep}"/>"#));
    assert_near(&found, &[0.635677, 1.0, 1.0]);
    let xml = with_sensor(&format!(
        r#"<bsdf type="conductor" id="m"><spectrum name="eta" value="{steep}"/><float name="k" value="1"/></bsdf>
        <emitter type="point"><spectrum name="intensity" value="{list}"/></emitter>"#
    ));
    let native = native(&xml);
    let eta = field(&native, "[materials.m]", "eta").unwrap();
    for (a, b) in numbers(eta).iter().zip([0.635677, 1.72078, 1.07502]) {
        assert!((a - b).abs() < 1e-5, "{eta}");
    }
    let intensity = field(&native, "[[lights]]", "intensity").unwrap();
    for (a, b) in numbers(intensity).iter().zip([1.03331, 0.606869, 0.234725]) {
        assert!((a - b).abs() < 1e-5, "{intensity}");
    }
}

#[test]
fn other_spectra_are_refused() {
    for written in [
        "500:1",
        "#aabbcc",
        "0.1 0.2 0.3",
        "600:0.8,400:0.1",
        "400:0.1,400:0.2",
        "400: 0.1, 500: 0.5",
        "400:x,500:1",
    ] {
        let element = format!(r#"<bsdf type="diffuse"><spectrum name="reflectance" value="{written}"/></bsdf>"#);
        assert_error(&with_sensor(&element), "scene.xml:2: ", &["reflectance"]);
    }
}

/// Mitsuba's figures: 1, 3 and (3, 6, 9).
#[test]
fn spectra_as_objects() {
    for (inner, expected) in [
        (r#"<spectrum type="d65" name="intensity"/>"#, "1.0"),
        (
            r#"<spectrum type="d65" name="intensity"><float name="scale" value="3"/></spectrum>"#,
            "3.0",
        ),
        (
            r#"<spectrum type="d65" name="intensity"><rgb name="color" value="1 2 3"/><float name="scale" value="3"/></spectrum>"#,
            "[3.0, 6.0, 9.0]",
        ),
        (
            r#"<spectrum type="uniform" name="intensity"><float name="value" value="5"/></spectrum>"#,
            "5.0",
        ),
    ] {
        let native = native(&with_sensor(&format!(r#"<emitter type="point">{inner}</emitter>"#)));
        assert_eq!(field(&native, "[[lights]]", "intensity"), Some(expected), "{inner}");
    }
    let blackbody = r#"<emitter type="point"><spectrum type="blackbody" name="intensity"><float name="temperature" value="5000"/></spectrum></emitter>"#;
    let native = native(&with_sensor(blackbody));
    assert!(
        field(&native, "[[lights]]", "intensity").is_some_and(|found| found.starts_with("[15262.7")),
        "{native}"
    );
}

#[test]
fn points_and_vectors_in_both_notations() {
    for (written, expected) in [
        (r#"x="1" y="2" z="3""#, "[1.0, 2.0, 3.0]"),
        (r#"value="1, 2 3""#, "[1.0, 2.0, 3.0]"),
        (r#"value="4""#, "[4.0, 4.0, 4.0]"),
    ] {
        for tag in ["point", "vector"] {
            let xml = with_sensor(&format!(
                r#"<emitter type="point"><{tag} name="position" {written}/></emitter>"#
            ));
            assert_eq!(field(&native(&xml), "[[lights]]", "position"), Some(expected));
        }
    }
    for written in [r#"x="1" y="2""#, r#"value="1 2""#, r#"value="1 2 3" x="1""#, ""] {
        let xml = with_sensor(&format!(
            r#"<emitter type="point"><point name="position" {written}/></emitter>"#
        ));
        assert_error(&xml, "scene.xml:2: ", &["position"]);
    }
}

#[test]
fn booleans_and_whole_numbers() {
    let shape = |value: &str| {
        with_sensor(&format!(
            r#"<shape type="cube"><boolean name="flip_normals" value="{value}"/></shape>"#
        ))
    };
    assert_eq!(
        field(&native(&shape("TRUE")), "[[shapes]]", "flip_normals"),
        Some("true")
    );
    assert_eq!(field(&native(&shape("false")), "[[shapes]]", "flip_normals"), None);
    assert_error(&shape("1"), "scene.xml:2: ", &["flip_normals", "true"]);
    let xml = SENSOR.replace("value=\"16\"", "value=\"16.5\"");
    assert_error(&bare(&xml), "scene.xml:4: ", &["width", "whole number"]);
    // Mitsuba accepts an integer for a float, but not a float for an integer.
    let xml = SENSOR.replace("float name=\"fov\"", "integer name=\"fov\"");
    assert_eq!(field(&native(&bare(&xml)), "[camera]", "fov"), Some("40.0"));
    let xml = SENSOR.replace(
        "<integer name=\"width\" value=\"16\"",
        "<float name=\"width\" value=\"16\"",
    );
    assert_error(&bare(&xml), "scene.xml:4: ", &["width", "<integer>", "<float>"]);
}
