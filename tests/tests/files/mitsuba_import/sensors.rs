//! Sensors, films, emitters.

use super::*;

fn sensor(plugin: &str, inner: &str, film: &str) -> String {
    bare(&format!(
        r#"<sensor type="{plugin}">{inner}<film type="hdrfilm"><integer name="width" value="200"/><integer name="height" value="100"/>{film}</film></sensor>"#
    ))
}

fn fov(inner: &str) -> (f64, String) {
    let text = native(&sensor("perspective", inner, ""));
    let axis = field(&text, "[camera]", "fov_axis").unwrap_or("\"x\"");
    (
        field(&text, "[camera]", "fov").unwrap().parse().unwrap(),
        axis.to_string(),
    )
}

/// Mitsuba's x_fov for an image of 200 x 100 pixels.
#[test]
fn fields_of_view() {
    let wide = |(degrees, axis): (f64, String)| match axis.as_str() {
        "\"x\"" | "\"larger\"" => degrees,
        _ => 2.0 * libm::atan(2.0 * libm::tan(0.5 * degrees.to_radians())).to_degrees(),
    };
    let axis = |axis: &str| format!(r#"<float name="fov" value="40"/><string name="fov_axis" value="{axis}"/>"#);
    let focal = |length: &str| format!(r#"<string name="focal_length" value="{length}"/>"#);
    for (inner, x_fov) in [
        (String::new(), 42.311714),
        (axis("x"), 40.0),
        (axis("y"), 72.104774),
        (axis("diagonal"), 36.064789),
        (axis("smaller"), 72.104774),
        (axis("larger"), 40.0),
        (focal("50mm"), 42.311714),
        (focal("35"), 57.871193),
        (focal("35.5 mm"), 57.185543),
    ] {
        let found = wide(fov(&inner));
        assert!((found - x_fov).abs() < 1e-5, "{inner}: {found}");
    }
    // A lens parameter that many exporters write; it has no effect here.
    let pinhole = format!(r#"{}<float name="focus_distance" value="3"/>"#, axis("x"));
    assert_eq!(fov(&pinhole), (40.0, "\"x\"".to_owned()));
    for (bad, words) in [
        (axis("z"), "fov_axis"),
        (focal("long"), "focal_length"),
        (format!("{}{}", axis("x"), focal("50mm")), "not both"),
        (r#"<float name="fov" value="180"/>"#.to_string(), "fov"),
    ] {
        assert_error(&sensor("perspective", &bad, ""), "scene.xml:2: ", &[words]);
    }
}

#[test]
fn placement() {
    let place = |steps: &str| {
        let inner = format!("<float name=\"fov\" value=\"40\"/><transform name=\"to_world\">{steps}</transform>");
        sensor("perspective", &inner, "")
    };
    let text = native(&place(r#"<lookat origin="1, 2, 3" target="4 5 6" up="0 0 1"/>"#));
    for (name, expected) in [
        ("origin", "[1.0, 2.0, 3.0]"),
        ("target", "[4.0, 5.0, 6.0]"),
        ("up", "[0.0, 0.0, 1.0]"),
    ] {
        assert_eq!(field(&text, "[camera]", name), Some(expected));
    }
    // The identity looks along +z, with +x to the left.
    let text = native(&place(r#"<rotate y="1" angle="180"/><translate z="5"/>"#));
    assert_eq!(field(&text, "[camera]", "origin"), Some("[0.0, 0.0, 5.0]"));
    assert_eq!(field(&text, "[camera]", "target"), Some("[0.0, 0.0, 4.0]"));
    let text = native(&place(r#"<scale x="-1"/>"#));
    assert_eq!(field(&text, "[camera]", "flip_x"), Some("true"));
    assert_error(
        &place(r#"<lookat origin="0 0 0" target="0 3 0" up="0 1 0"/>"#),
        "scene.xml:2: ",
        &["up"],
    );
}

/// For a lookat from the origin to (1, 2, 3) without up, Mitsuba's frame has up = (0.960357, -0.0792865, -0.267261).
#[test]
fn lookat_without_up() {
    let lookat = r#"<float name="fov" value="40"/><transform name="to_world"><lookat origin="0 0 0" target="1 2 3"/></transform>"#;
    let scene = scene(&sensor("perspective", lookat, "<rfilter type=\"box\"/>"));
    let up = scene.camera.frame.t;
    let expected = [0.960357, -0.0792865, -0.267261];
    for c in 0..3 {
        assert!((up[c] - expected[c]).abs() < 1e-5, "{up}");
    }
}

#[test]
fn thin_lenses() {
    let lens = |inner: &str| sensor("thinlens", &format!("<float name=\"fov\" value=\"40\"/>{inner}"), "");
    let text = native(&lens(
        r#"<float name="aperture_radius" value="0.1"/><float name="focus_distance" value="3"/>"#,
    ));
    assert_eq!(field(&text, "[camera]", "aperture"), Some("0.1"));
    assert_eq!(field(&text, "[camera]", "focus_distance"), Some("3.0"));
    // Mitsuba's default is the far plane.
    let text = native(&lens(r#"<float name="aperture_radius" value="0.1"/>"#));
    assert_eq!(field(&text, "[camera]", "focus_distance"), Some("10000.0"));
    assert_error(&lens(""), "scene.xml:2: ", &["aperture_radius"]);
    let text = native(&sensor(
        "perspective",
        r#"<float name="principal_point_offset_x" value="0.1"/>"#,
        "",
    ));
    assert_eq!(field(&text, "[camera]", "principal_point"), Some("[0.1, 0.0]"));
}

#[test]
fn films() {
    let film = |inner: &str| native(&sensor("perspective", "<float name=\"near_clip\" value=\"1\"/>", inner));
    for (inner, filter) in [
        ("", Some("\"gaussian\"")),
        ("<rfilter type=\"gaussian\"/>", Some("\"gaussian\"")),
        (
            "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.7\"/></rfilter>",
            Some("{ type = \"gaussian\", stddev = 0.7 }"),
        ),
        ("<rfilter type=\"tent\"/>", Some("\"tent\"")),
        (
            "<rfilter type=\"tent\"><float name=\"radius\" value=\"2\"/></rfilter>",
            Some("{ type = \"tent\", radius = 2.0 }"),
        ),
        ("<rfilter type=\"box\"/>", None),
        (
            "<string name=\"pixel_format\" value=\"rgba\"/><rfilter type=\"box\"/>",
            None,
        ),
    ] {
        assert_eq!(field(&film(inner), "[image]", "filter"), filter, "{inner}");
    }
    let crop = r#"<integer name="crop_offset_x" value="20"/><integer name="crop_offset_y" value="10"/><integer name="crop_width" value="50"/><integer name="crop_height" value="30"/>"#;
    assert_eq!(
        field(&film(crop), "[image]", "crop"),
        Some("{ x = 20, y = 10, width = 50, height = 30 }")
    );
    let crop = r#"<integer name="crop_width" value="20"/>"#;
    assert_eq!(
        field(&film(crop), "[image]", "crop"),
        Some("{ x = 0, y = 0, width = 20, height = 100 }")
    );
    // Mitsuba's default size.
    let text = native(&bare("<sensor type=\"perspective\"/>"));
    assert_eq!(field(&text, "[image]", "width"), Some("768"));
    assert_eq!(field(&text, "[image]", "height"), Some("576"));
    let beyond = r#"<integer name="crop_offset_x" value="20"/>"#;
    assert_error(&sensor("perspective", "", beyond), "scene.xml:2: ", &["crop window"]);
}

fn light(element: &str) -> String {
    let native = native(&with_sensor(element));
    let lines = native.lines().skip_while(|line| *line != "[[lights]]").skip(1);
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn emitters() {
    for (element, expected) in [
        (
            r#"<emitter type="point" id="bulb"><point name="position" x="1" y="2" z="3"/><rgb name="intensity" value="4"/></emitter>"#,
            "name = \"bulb\"\ntype = \"point\"\nposition = [1.0, 2.0, 3.0]\nintensity = 4.0",
        ),
        (
            r#"<emitter type="point"><transform name="to_world"><translate x="1" y="2" z="3"/></transform></emitter>"#,
            "type = \"point\"\nposition = [1.0, 2.0, 3.0]\nintensity = 1.0",
        ),
        (
            r#"<emitter type="spot"><transform name="to_world"><lookat origin="0 3 0" target="0 0 0" up="1 0 0"/></transform>
            <float name="cutoff_angle" value="30"/><float name="beam_width" value="10"/><float name="sampling_weight" value="2"/></emitter>"#,
            "type = \"spot\"\nposition = [0.0, 3.0, 0.0]\ntarget = [0.0, 0.0, 0.0]\nintensity = 1.0\ncutoff_angle = 30.0\nbeam_width = 10.0",
        ),
        (
            r#"<emitter type="spot"><transform name="to_world"><translate y="2"/></transform></emitter>"#,
            "type = \"spot\"\nposition = [0.0, 2.0, 0.0]\ntarget = [0.0, 2.0, 1.0]\nintensity = 1.0",
        ),
        (
            r#"<emitter type="directional"><vector name="direction" x="0" y="-2" z="0"/><rgb name="irradiance" value="1 2 3"/></emitter>"#,
            "type = \"directional\"\ndirection = [0.0, -2.0, 0.0]\nirradiance = [1.0, 2.0, 3.0]",
        ),
        (
            r#"<emitter type="directional"><transform name="to_world"><rotate x="1" angle="90"/></transform></emitter>"#,
            "type = \"directional\"\ndirection = [0.0, -1.0, 0.0]\nirradiance = 1.0",
        ),
        ("<emitter type=\"constant\"/>", "type = \"environment\"\nradiance = 1.0"),
        (
            r#"<emitter type="envmap"><string name="filename" value="sky.exr"/><float name="scale" value="2"/><transform name="to_world"><rotate y="-1" angle="30"/></transform></emitter>"#,
            "type = \"environment\"\nimage = \"sky.exr\"\nscale = 2.0\nrotate_y = -30.0",
        ),
        (
            r#"<emitter type="envmap"><string name="filename" value="sky.exr"/><transform name="to_world"><rotate x="1" angle="90"/></transform></emitter>"#,
            "type = \"environment\"\nimage = \"sky.exr\"\ntransform = [{ rotate = { axis = [1.0, 0.0, 0.0], angle = 90.0 } }]",
        ),
    ] {
        assert_eq!(light(element), expected);
    }
    for (bad, words) in [
        (
            r#"<emitter type="point"><point name="position" value="1"/><transform name="to_world"/></emitter>"#,
            "not both",
        ),
        (
            r#"<emitter type="point"><float name="scale" value="2"/></emitter>"#,
            "scale",
        ),
        ("<emitter type=\"envmap\"/>", "filename"),
        ("<emitter type=\"directionalarea\"/>", "directionalarea"),
        (
            r#"<emitter type="point"><rgb name="intensity" value="-1"/></emitter>"#,
            "negative",
        ),
    ] {
        assert_error(&with_sensor(bad), "scene.xml:2: ", &[words]);
    }
}
