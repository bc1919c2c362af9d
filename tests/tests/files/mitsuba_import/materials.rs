//! BSDFs and textures.

use super::*;

fn material(element: &str) -> String {
    let native = native(&with_sensor(element));
    let lines = native.lines().skip_while(|line| !line.starts_with("[materials."));
    let lines = lines.skip(1).take_while(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join("\n")
}

#[track_caller]
fn assert_material(element: &str, expected: &[&str]) {
    assert_eq!(material(element), expected.join("\n"), "{element}");
}

/// Mitsuba's eta in air: 1.50418 for `bk7`, 1.48959 for polypropylene, 1.33263 for water.
#[test]
fn indices_of_refraction_by_name() {
    let default = ["ior = 1.5046", "exterior_ior = 1.000277"];
    for (plugin, kind) in [("dielectric", "dielectric"), ("thindielectric", "thin_dielectric")] {
        let kind = format!("type = \"{kind}\"");
        assert_material(&format!("<bsdf type=\"{plugin}\"/>"), &[&kind, default[0], default[1]]);
    }
    assert!((1.5046_f64 / 1.000277 - 1.504183292).abs() < 1e-7);
    assert_material(
        "<bsdf type=\"plastic\"/>",
        &["type = \"plastic\"", "ior = 1.49", "exterior_ior = 1.000277"],
    );
    let water =
        r#"<bsdf type="dielectric"><string name="int_ior" value="Water"/><float name="ext_ior" value="1.5"/></bsdf>"#;
    assert_material(water, &["type = \"dielectric\"", "ior = 1.333", "exterior_ior = 1.5"]);
    let unknown = r#"<bsdf type="dielectric"><string name="int_ior" value="mud"/></bsdf>"#;
    assert_error(&with_sensor(unknown), "scene.xml:2: ", &["int_ior", "mud", "bk7"]);
    let eta = r#"<bsdf type="dielectric"><float name="eta" value="1.3"/></bsdf>"#;
    assert_error(&with_sensor(eta), "scene.xml:2: ", &["\"eta\" is not supported"]);
}

#[test]
fn hair() {
    let index = ["ior = 1.55", "exterior_ior = 1.000277"];
    let brown = [
        "type = \"hair\"",
        "eumelanin = 1.3",
        "pheomelanin = 0.2",
        index[0],
        index[1],
    ];
    assert_material("<bsdf type=\"hair\"/>", &brown);
    let own = r#"<bsdf type="hair"><rgb name="sigma_a" value="0.2, 0.25, 0.5"/><float name="scale" value="2"/>
        <float name="longitudinal_roughness" value="0.2"/><float name="azimuthal_roughness" value="0.4"/>
        <float name="scale_tilt" value="3"/></bsdf>"#;
    let expected = [
        "type = \"hair\"",
        "absorption = [0.4, 0.5, 1.0]",
        "beta_m = 0.2",
        "beta_n = 0.4",
        "tilt = 3.0",
    ];
    assert_material(own, &[&expected[..], &index].concat());
    let both = r#"<bsdf type="hair"><float name="eumelanin" value="1"/><rgb name="sigma_a" value="1"/></bsdf>"#;
    assert_error(&with_sensor(both), "scene.xml:2: ", &["sigma_a", "melanin"]);
}

#[test]
fn rough_dielectrics_are_beckmann_by_default() {
    let ior = ["ior = 1.5046", "exterior_ior = 1.000277"];
    assert_material(
        "<bsdf type=\"roughdielectric\"/>",
        &[
            "type = \"rough_dielectric\"",
            ior[0],
            ior[1],
            "alpha = 0.1",
            "distribution = \"beckmann\"",
            "multiple_scattering = false",
        ],
    );
    assert_material(
        r#"<bsdf type="roughdielectric"><float name="alpha" value="0.3"/><string name="distribution" value="ggx"/></bsdf>"#,
        &[
            "type = \"rough_dielectric\"",
            ior[0],
            ior[1],
            "alpha = 0.3",
            "multiple_scattering = false",
        ],
    );
}

/// Mitsuba's values for gold: eta (0.143036, 0.375307, 1.44205), k (3.983, 2.38556, 1.60336).
#[test]
fn conductors_by_name_and_by_numbers() {
    assert_material(
        r#"<bsdf type="conductor"><string name="material" value="Au"/></bsdf>"#,
        &[
            "type = \"conductor\"",
            "eta = [0.143036, 0.375307, 1.44205]",
            "k = [3.983, 2.38556, 1.60336]",
            "two_sided = false",
        ],
    );
    // Without a material everything is reflected.
    let mirror = ["type = \"mirror\"", "two_sided = false"];
    assert_material("<bsdf type=\"conductor\"/>", &mirror);
    assert_material(
        r#"<bsdf type="conductor"><string name="material" value="none"/></bsdf>"#,
        &mirror,
    );
    assert_material(
        "<bsdf type=\"roughconductor\"/>",
        &[
            "type = \"rough_conductor\"",
            "eta = 0.0",
            "k = 1.0",
            "alpha = 0.1",
            "distribution = \"beckmann\"",
            "multiple_scattering = false",
            "two_sided = false",
        ],
    );
    assert_material(
        r#"<bsdf type="conductor"><float name="eta" value="1.5"/><rgb name="k" value="3 2 1"/><rgb name="specular_reflectance" value="0.5"/></bsdf>"#,
        &[
            "type = \"conductor\"",
            "eta = 1.5",
            "k = [3.0, 2.0, 1.0]",
            "reflectance = 0.5",
            "two_sided = false",
        ],
    );
    let unknown = r#"<bsdf type="conductor"><string name="material" value="au"/></bsdf>"#;
    assert_error(&with_sensor(unknown), "scene.xml:2: ", &["\"au\"", "Au"]);
    let both = r#"<bsdf type="conductor"><string name="material" value="Au"/><float name="eta" value="1"/></bsdf>"#;
    assert_error(&with_sensor(both), "scene.xml:2: ", &["eta", "not both"]);
    assert_material(
        r#"<bsdf type="roughconductor"><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.4"/></bsdf>"#,
        &[
            "type = \"rough_conductor\"",
            "eta = 0.0",
            "k = 1.0",
            "alpha_u = 0.1",
            "alpha_v = 0.4",
            "distribution = \"beckmann\"",
            "multiple_scattering = false",
            "two_sided = false",
        ],
    );
}

#[test]
fn plastics_and_principled() {
    assert_material(
        r#"<bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.1 0.2 0.3"/><boolean name="nonlinear" value="true"/></bsdf>"#,
        &[
            "type = \"rough_plastic\"",
            "reflectance = [0.1, 0.2, 0.3]",
            "ior = 1.49",
            "exterior_ior = 1.000277",
            "alpha = 0.1",
            "distribution = \"beckmann\"",
            "nonlinear = true",
        ],
    );
    assert_material(
        r#"<bsdf type="principled"><rgb name="base_color" value="1 0.5 0"/><float name="roughness" value="0.4"/><float name="metallic" value="1"/>
        <float name="specular" value="0.3"/><float name="clearcoat" value="0"/></bsdf>"#,
        &[
            "type = \"principled\"",
            "multiple_scattering = false",
            "base_color = [1.0, 0.5, 0.0]",
            "metallic = 1.0",
            "roughness = 0.4",
            "specular = 0.3",
        ],
    );
    assert_material(
        r#"<bsdf type="principled"><float name="clearcoat" value="0.5"/><float name="clearcoat_gloss" value="0.2"/>
        <float name="sheen" value="0"/><float name="sheen_tint" value="0.5"/><float name="spec_trans" value="0.7"/>
        <texture type="bitmap" name="roughness"><string name="filename" value="r.png"/><boolean name="raw" value="true"/></texture></bsdf>"#,
        &[
            "type = \"principled\"",
            "multiple_scattering = false",
            "roughness = { image = \"r.png\", raw = true, uv = [{ scale = [1.0, -1.0, 1.0] }, { translate = [0.0, 1.0, 0.0] }] }",
            "spec_trans = 0.7",
            "clearcoat = 0.5",
            "clearcoat_gloss = 0.2",
        ],
    );
    assert_material(
        r#"<bsdf type="principled"><float name="anisotropic" value="0.5"/></bsdf>"#,
        &[
            "type = \"principled\"",
            "multiple_scattering = false",
            "anisotropic = 0.5",
        ],
    );
}

#[test]
fn blends_are_of_two_materials() {
    let blend = |weight: &str| {
        format!(
            r#"<bsdf type="twosided" id="mixed"><bsdf type="blendbsdf">{weight}
            <bsdf type="diffuse" id="paint"/><bsdf type="roughconductor"/></bsdf></bsdf>"#
        )
    };
    let native = native(&with_sensor(&blend("<float name=\"weight\" value=\"0.3\"/>")));
    let in_section = |heading: &str, name: &str| field(&native, heading, name).unwrap_or_else(|| panic!("{native}"));
    assert_eq!(in_section("[materials.mixed]", "type"), "\"blend\"");
    assert_eq!(
        in_section("[materials.mixed]", "materials"),
        "[\"paint-part\", \"roughconductor-part\"]"
    );
    assert_eq!(in_section("[materials.mixed]", "weight"), "0.3");
    for part in ["paint-part", "roughconductor-part"] {
        assert_eq!(in_section(&format!("[materials.{part}]"), "two_sided"), "true");
    }
    let textured = "<texture type=\"bitmap\" name=\"weight\"><string name=\"filename\" value=\"w.png\"/></texture>";
    assert!(self::native(&with_sensor(&blend(textured))).contains("weight = { image = \"w.png\", uv = "));
    let one = "<bsdf type=\"blendbsdf\"><bsdf type=\"diffuse\"/></bsdf>";
    assert_error(&with_sensor(one), "scene.xml:2: ", &["two nested"]);
}

#[test]
fn wrappers_become_fields() {
    let diffuse = "<bsdf type=\"diffuse\"/>";
    assert_material(
        &format!("<bsdf type=\"twosided\">{diffuse}</bsdf>"),
        &["type = \"diffuse\"", "two_sided = true"],
    );
    let metal = r#"<bsdf type="twosided"><bsdf type="conductor"/></bsdf>"#;
    assert_material(metal, &["type = \"mirror\"", "two_sided = true"]);
    // Mitsuba's default opacity is 0.5.
    assert_material(
        &format!("<bsdf type=\"mask\">{diffuse}</bsdf>"),
        &["type = \"diffuse\"", "opacity = 0.5"],
    );
    assert_material(
        r#"<bsdf type="mask"><texture type="checkerboard" name="opacity"/><bsdf type="twosided"><bsdf type="bumpmap">
        <texture type="bitmap"><string name="filename" value="h.png"/></texture><float name="scale" value="3"/><bsdf type="diffuse"/></bsdf></bsdf></bsdf>"#,
        &[
            "type = \"diffuse\"",
            "two_sided = true",
            // Mitsuba swaps the colours here: its `eval_1` of (0.1, 0.1) is color1.
            "opacity = { checkerboard = [0.2, 0.4] }",
            "bump = { image = \"h.png\", uv = [{ scale = [1.0, -1.0, 1.0] }, { translate = [0.0, 1.0, 0.0] }], scale = 3.0 }",
        ],
    );
    let map = r#"<bsdf type="normalmap"><texture type="bitmap" name="normalmap"><string name="filename" value="n.png"/><boolean name="raw" value="true"/></texture><bsdf type="diffuse"/></bsdf>"#;
    assert!(material(map).contains("normal_map = { image = \"n.png\", raw = true, uv = "));
    for (bad, words) in [
        (
            "<bsdf type=\"twosided\"><bsdf type=\"dielectric\"/></bsdf>",
            "transmission",
        ),
        ("<bsdf type=\"twosided\"/>", "missing"),
        ("<bsdf type=\"mask\"/>", "missing"),
        ("<bsdf type=\"bumpmap\"><bsdf type=\"diffuse\"/></bsdf>", "texture"),
        (
            "<bsdf type=\"mask\"><bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf></bsdf>",
            "second",
        ),
    ] {
        assert_error(&with_sensor(bad), "scene.xml:2: ", &[words]);
    }
}

fn diffuse(texture: &str) -> String {
    let found = material(&format!("<bsdf type=\"diffuse\">{texture}</bsdf>"));
    found
        .strip_prefix("type = \"diffuse\"\nreflectance = ")
        .unwrap()
        .to_string()
}

/// In Mitsuba an image's first row is v = 0, here it is v = 1.
#[test]
fn images_are_turned_around() {
    let bitmap = |inner: &str| {
        diffuse(&format!(
            r#"<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/>{inner}</texture>"#
        ))
    };
    let turn = "{ scale = [1.0, -1.0, 1.0] }, { translate = [0.0, 1.0, 0.0] }";
    assert_eq!(bitmap(""), format!("{{ image = \"a.png\", uv = [{turn}] }}"));
    let options = r#"<string name="filter_type" value="nearest"/><string name="wrap_mode" value="mirror"/><boolean name="raw" value="true"/>"#;
    assert_eq!(
        bitmap(options),
        format!("{{ image = \"a.png\", raw = true, filter = \"nearest\", wrap = \"mirror\", uv = [{turn}] }}")
    );
    assert_eq!(
        bitmap(
            r#"<transform name="to_uv"><scale value="4"/><translate x="0.5"/><rotate z="1" angle="90"/></transform>"#
        ),
        format!(
            "{{ image = \"a.png\", uv = [{{ scale = 4.0 }}, {{ translate = [0.5, 0.0, 0.0] }}, \
             {{ rotate = {{ axis = [0.0, 0.0, 1.0], angle = 90.0 }} }}, {turn}] }}"
        )
    );
}

/// Mitsuba turns a 3x3 matrix 1 to 9 into [[1, 2, 0], [4, 5, 0], [0, 0, 1]].
#[test]
fn to_uv_is_flattened() {
    let checkerboard = |inner: &str| {
        diffuse(&format!(
            r#"<texture type="checkerboard" name="reflectance">{inner}</texture>"#
        ))
    };
    assert_eq!(checkerboard(""), "{ checkerboard = [0.4, 0.2] }");
    assert_eq!(
        checkerboard(
            r#"<rgb name="color0" value="1 0 0"/><float name="color1" value="0.1"/><transform name="to_uv"><matrix value="1 2 3 4 5 6 0 0 1"/></transform>"#
        ),
        "{ checkerboard = [[1.0, 0.0, 0.0], 0.1], uv = [{ matrix = [[1.0, 2.0, 0.0], [4.0, 5.0, 0.0], [0.0, 0.0, 1.0]] }] }"
    );
}

/// Mitsuba flips the v of OBJ files; flipped twice it is unchanged.
#[test]
fn materials_of_obj_files_are_turned_once_more() {
    let xml = with_sensor(
        r#"<bsdf type="diffuse" id="m"><texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/></texture></bsdf>
        <bsdf type="diffuse" id="plain"/>
        <shape type="cube"><ref id="m"/></shape>
        <shape type="obj"><string name="filename" value="a.obj"/><ref id="m"/></shape>
        <shape type="obj"><string name="filename" value="a.obj"/><boolean name="flip_tex_coords" value="false"/><ref id="m"/></shape>
        <shape type="ply"><string name="filename" value="a.ply"/><ref id="m"/></shape>
        <shape type="obj"><string name="filename" value="a.obj"/><ref id="plain"/></shape>"#,
    );
    let text = native(&xml);
    assert_eq!(
        field(&text, "[materials.m-turned]", "reflectance"),
        Some("{ image = \"a.png\" }")
    );
    let used: Vec<_> = text
        .lines()
        .filter_map(|line| line.strip_prefix("material = "))
        .collect();
    assert_eq!(used, ["\"m\"", "\"m-turned\"", "\"m\"", "\"m\"", "\"plain\""]);
}

/// Mitsuba: black with an emitter, else diffuse 0.5; both are the native defaults.
#[test]
fn shapes_without_a_bsdf() {
    let text = native(&with_sensor(
        r#"<shape type="cube"/><shape type="sphere"><emitter type="area"><rgb name="radiance" value="3 2 1"/></emitter></shape>"#,
    ));
    assert!(!text.contains("material"), "{text}");
    assert!(text.contains("emission = { radiance = [3.0, 2.0, 1.0] }"), "{text}");
}
