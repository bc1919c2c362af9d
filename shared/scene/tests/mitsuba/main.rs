//! Mitsuba's scenes as they are published: what their old and odd parts become. Numbers that are said to be Mitsuba's
//! were read back from Mitsuba 3.9.1.

mod parts;

use beamfarm_render::world::geometry::Shape;
use beamfarm_render::world::geometry::strands::Basis;
use beamfarm_scene::{ImportOptions, Imported, SceneFile, import};
use std::path::Path;
use tempfile::TempDir;

const SENSOR: &str = r#"<sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film></sensor>"#;

/// A tetrahedron, closed.
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

#[allow(clippy::unwrap_used)]
fn folder(version: &str, elements: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let xml = format!("<scene version=\"{version}\">\n{elements}\n{SENSOR}</scene>");
    std::fs::write(folder.path().join("scene.xml"), xml).unwrap();
    std::fs::write(folder.path().join("mesh.obj"), OBJ).unwrap();
    folder
}

fn convert(folder: &Path, skip_unsupported: bool) -> Result<Imported, String> {
    let options = ImportOptions {
        skip_unsupported,
        ..ImportOptions::default()
    };
    import(&folder.join("scene.xml"), folder, &options).map_err(|error| error.to_string())
}

/// The native scene, which loads, and its notes.
#[track_caller]
fn read(version: &str, elements: &str) -> (String, String) {
    let folder = folder(version, elements);
    let imported = convert(folder.path(), false).unwrap_or_else(|error| panic!("{error}"));
    (imported.text, imported.notes.join("\n"))
}

#[track_caller]
fn refused(version: &str, elements: &str) -> String {
    match convert(folder(version, elements).path(), false) {
        Ok(imported) => panic!("expected an error, found\n{}", imported.text),
        Err(error) => error,
    }
}

#[track_caller]
fn assert_has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
}

#[test]
fn old_names_are_those_of_now() {
    let old = r##"
        <bsdf type="plastic" id="p"><rgb name="diffuseReflectance" value="#804020"/><float name="intIOR" value="1.5"/></bsdf>
        <bsdf type="diffuse" id="d"><srgb name="diffuseReflectance" value="#ffffff"/><float name="unknown" value="1"/></bsdf>
        <bsdf type="diffuse" id="t"><texture name="reflectance" type="checkerboard"><float name="uscale" value="4"/>
            <float name="voffset" value="0.5"/></texture></bsdf>
        <shape type="sphere"><transform name="toWorld"><lookAt origin="0 0 0" target="0 0 1" up="0 1 0"/>
            <rotate y="2" angle="90"/></transform><boolean name="flipNormals" value="true"/></shape>"##;
    let (text, notes) = read("0.6.0", old);
    assert_has(
        &text,
        &[
            "reflectance = [0.5019607843137255, 0.25098039215686274, 0.12549019607843137]",
            "ior = 1.5",
            "reflectance = 1.0",
            "{ translate = [0.0, 0.5, 0.0] }, { scale = [4.0, 1.0, 1.0] }",
            "{ rotate = { axis = [0.0, 2.0, 0.0], angle = 90.0 } }",
            "flip_normals = true",
        ],
    );
    assert_has(&notes, &["the parameter \"unknown\" is passed over"]);
    // What a file of now may not say, it still may not.
    let error = refused("3.0.0", old);
    assert_has(
        &error,
        &[
            "<srgb> is no element",
            "#804020",
            "lookAt",
            "\"toWorld\" is not supported",
        ],
    );
}

#[test]
fn old_factors_above_one_are_made_darker() {
    let element = r#"<bsdf type="diffuse" id="a"><rgb name="reflectance" value="255 51 0"/></bsdf>"#;
    let (text, notes) = read("0.5.0", element);
    assert_has(&text, &["reflectance = [1.0, 0.2, 0.0]"]);
    assert_has(&notes, &["becomes"]);
    assert_has(&refused("3.0.0", element), &["from 0 to 1"]);
}

#[test]
fn what_changes_nothing_refuses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let xml = r#"<scene version="3.0.0"><film type="hdrfilm"/>
        <integrator type="path"><boolean name="whatever" value="true"/></integrator>
        <sensor type="perspective"><float name="focus_distance" value="3"/>
            <film type="ldrfilm"><float name="gamma" value="2.2"/><string name="else" value="x"/>
                <rfilter type="mitchell"><float name="A" value="0.3"/></rfilter></film>
            <sampler type="sobol"><integer name="scramble" value="1"/></sampler></sensor>
        <bsdf type="principled"><float name="sheen_tint" value="1"/><float name="clearcoat_gloss" value="0.5"/>
            <float name="clearcoat" value="0"/></bsdf></scene>"#;
    std::fs::write(folder.path().join("scene.xml"), xml).unwrap();
    let imported = convert(folder.path(), false).unwrap();
    let notes = imported.notes.join("\n");
    assert_has(&imported.text, &["filter = \"gaussian\""]);
    assert_has(
        &notes,
        &[
            "\"mitchell\" is replaced",
            "\"else\" is passed over",
            "outside of the sensor",
            "ldrfilm",
        ],
    );
    assert!(imported.left_out.is_empty());
}

#[test]
fn conductors_take_what_tables_have() {
    let (text, notes) = read(
        "0.6.0",
        r#"<bsdf type="conductor" id="a"><rgb name="eta" value="0.2 -0.01 3"/><rgb name="k" value="3 -0.1 6"/>
            <float name="extEta" value="1.5"/></bsdf>"#,
    );
    assert_has(
        &text,
        &[
            "eta = [0.13333333333333333, 0.0, 2.0]",
            "k = [2.0, 0.6666666666666666, 4.0]",
        ],
    );
    assert_has(&notes, &["negative channels"]);
    let (text, notes) = read(
        "3.0.0",
        r#"<bsdf type="roughconductor" id="a"><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.4"/></bsdf>"#,
    );
    assert_has(&text, &["alpha_u = 0.1\n", "alpha_v = 0.4\n"]);
    assert_eq!(notes, "");
    let (text, notes) = read(
        "3.0.0",
        r#"<bsdf type="roughdielectric" id="a"><float name="alpha_u" value="0.3"/><float name="alpha_v" value="0.3"/></bsdf>
        <bsdf type="roughplastic" id="b"><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.4"/></bsdf>"#,
    );
    assert_has(&text, &["alpha = 0.3\n", "alpha = 0.2\n"]);
    assert_has(
        &notes,
        &["a roughness of coats that differs by direction becomes its geometric mean, 0.2"],
    );
}

/// The same radiance by a list, a file and two plugins; `<blackbody>` has the chromaticity of its temperature.
#[test]
fn spectra_by_file_and_plugin() {
    let emitter = |spectrum: &str| format!("<emitter type=\"point\">{spectrum}</emitter>");
    let folder = folder(
        "3.0.0",
        &[
            r#"<spectrum name="intensity" value="400:0.1, 500:0.5, 600:0.9"/>"#,
            r#"<spectrum name="intensity" filename="light.spd"/>"#,
            r#"<spectrum name="intensity" type="irregular"><string name="wavelengths" value="400, 500, 600"/>
                <string name="values" value="0.1, 0.5, 0.9"/></spectrum>"#,
            r#"<spectrum name="intensity" type="regular"><float name="wavelength_min" value="400"/>
                <float name="wavelength_max" value="600"/><string name="values" value="0.1, 0.5, 0.9"/></spectrum>"#,
        ]
        .map(emitter)
        .concat(),
    );
    std::fs::write(
        folder.path().join("light.spd"),
        "# a light\n400 0.1\n\n500 0.5 # middle\n600 0.9\n",
    )
    .unwrap();
    let text = convert(folder.path(), false).unwrap().text;
    let lines: Vec<_> = text.lines().filter(|line| line.starts_with("intensity")).collect();
    assert_eq!(lines.len(), 4);
    assert!(lines.iter().all(|line| *line == lines[0]), "{lines:?}");

    let (text, _) = read(
        "0.6.0",
        r#"<emitter type="point"><blackbody name="intensity" temperature="6504K" scale="2"/></emitter>"#,
    );
    let line = text.lines().find(|line| line.starts_with("intensity")).unwrap();
    let numbers: Vec<f64> = line
        .trim_start_matches(|c| c != '[')
        .trim_matches(['[', ']'])
        .split(", ")
        .map(|n| n.parse().unwrap())
        .collect();
    // The radiance of 6504 K under the standard observer: Y = 25 860 W/(m^2 sr nm) a unit of the observer's y, which is
    // what the midpoint rule of Planck's law over the CIE's table gives; and nearly white.
    let y = 0.212671 * numbers[0] + 0.715160 * numbers[1] + 0.072169 * numbers[2];
    assert!(
        (numbers[0] / y - 1.0).abs() < 0.06 && (numbers[2] / y - 1.0).abs() < 0.06,
        "{line}"
    );
    let planck = |nm: f64| {
        let m = nm * 1e-9;
        1.191_042_972e-16 / (libm::pow(m, 5.0) * (libm::exp(1.438_776_877e-2 / (m * 6504.0)) - 1.0)) * 1e-9
    };
    // The observer's y is symmetric about 556 nm with a width of some 45 nm, so that the value there is near.
    assert!((y / (2.0 * planck(556.0)) - 1.0).abs() < 0.02, "{y} {}", planck(556.0));
}

#[test]
fn emitters_that_shapes_refer_to() {
    let (text, _) = read(
        "3.0.0",
        r#"<emitter type="area" id="lamp"><rgb name="radiance" value="3"/></emitter>
            <shape type="sphere"><ref id="lamp"/></shape><shape type="cube"><ref id="lamp"/></shape>"#,
    );
    assert_eq!(text.matches("emission = { radiance = 3.0 }").count(), 2);
    assert!(!text.contains("[[lights]]"));
}

/// A pane around a medium is a pane and a boundary; light that is not polarised loses half in a polarizer.
#[test]
fn thin_dielectrics_around_media() {
    let (text, _) = read(
        "3.0.0",
        r#"<medium type="homogeneous" id="fog"/><shape type="obj" id="pane"><string name="filename" value="mesh.obj"/>
            <bsdf type="thindielectric"/><ref id="fog" name="interior"/></shape>
            <shape type="rectangle"><bsdf type="polarizer"><float name="theta" value="30"/></bsdf></shape>"#,
    );
    assert_has(
        &text,
        &[
            "material = \"boundary\"",
            "interior = \"fog\"",
            "[materials.boundary]\ntype = \"null\"",
        ],
    );
    assert_has(
        &text,
        &["type = \"thin_dielectric\"\nior = 1.0\nexterior_ior = 1.0\nspecular_transmittance = 0.5"],
    );
    assert_eq!(text.matches("file = \"mesh.obj\"").count(), 2);
}

/// A rectangle with a medium behind it is read and noted, as Mitsuba takes it.
#[test]
fn open_boundaries_and_meshes_without_area_are_noted() {
    let folder = folder(
        "3.0.0",
        r#"<medium type="homogeneous" id="fog"/><emitter type="point"/>
            <shape type="rectangle"><bsdf type="dielectric"/><ref id="fog" name="interior"/></shape>
            <shape type="obj"><string name="filename" value="flat.obj"/></shape>"#,
    );
    std::fs::write(folder.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").unwrap();
    let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
    let scene = file.load().unwrap();
    assert_eq!(scene.objects.len(), 1);
    let notes = scene.notes.join("\n");
    assert_has(&notes, &["an open surface is the boundary", "the shape is left out"]);
}

#[test]
fn what_is_taken_as_the_nearest_is_said() {
    let (text, notes) = read(
        "0.6.0",
        r#"<bsdf type="phong" id="phong"><float name="exponent" value="198"/><spectrum name="specularReflectance" value="0.04"/>
            </bsdf>
            <bsdf type="ward" id="ward"><float name="alphaU" value="0.1"/><float name="alphaV" value="0.4"/></bsdf>
            <bsdf type="roughdiffuse" id="rough"><float name="alpha" value="0.3"/></bsdf>
            <bsdf type="coating" id="coat"><bsdf type="diffuse"/></bsdf>
            <bsdf type="roughconductor" id="as"><string name="distribution" value="as"/></bsdf>
            <bsdf type="mask" id="leaf"><rgb name="opacity" value="1 0 0"/><bsdf type="diffuse"/></bsdf>"#,
    );
    // sqrt(2 / (198 + 2)); (1 + sqrt(0.04)) / (1 - sqrt(0.04)).
    assert_has(
        &text,
        &[
            "[materials.phong]\ntype = \"rough_plastic\"\nior = 1.4999999999999998",
            "alpha = 0.1\n",
        ],
    );
    assert_has(&text, &["[materials.ward]", "alpha = 0.2\n", "opacity = 0.212671"]);
    for name in ["phong", "ward", "roughdiffuse", "coat", "\"as\"", "luminance"] {
        assert_has(&notes, &[name]);
    }
}

#[test]
fn lamps_with_pictures() {
    let folder = folder(
        "3.0.0",
        r#"<emitter type="projector"><texture name="irradiance" type="bitmap"><string name="filename" value="a.bmp"/>
                <boolean name="raw" value="true"/></texture><float name="scale" value="2"/><float name="fov" value="30"/>
                <transform name="to_world"><lookat origin="0 0 5" target="0 0 0" up="0 1 0"/></transform></emitter>
            <emitter type="spot"><texture name="texture" type="bitmap"><string name="filename" value="a.bmp"/></texture>
                <transform name="to_world"><lookat origin="0 0 5" target="0 0 0" up="0 1 0"/></transform></emitter>"#,
    );
    // 2 x 1 pixels of 24 bits, blue and red: a header of 14 bytes, one of 40, and a row filled up to 8 bytes.
    let mut bmp = b"BM".to_vec();
    for word in [62u32, 0, 54, 40, 2, 1] {
        bmp.extend(word.to_le_bytes());
    }
    bmp.extend([1, 0, 24, 0]);
    bmp.extend([0; 24]);
    bmp.extend([255, 0, 0, 0, 0, 255, 0, 0]);
    std::fs::write(folder.path().join("a.bmp"), bmp).unwrap();
    let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
    let text = String::from_utf8(file.text().to_vec()).unwrap();
    assert_has(
        &text,
        &[
            "type = \"projector\"",
            "up = [0.0, 1.0, 0.0]",
            "fov = 30.0",
            "intensity = 6.283185307179586",
            "raw = true",
        ],
    );
    assert_has(&text, &["up = [-0.0, -1.0, -0.0]"]);
    assert_eq!(file.load().unwrap().lights.len(), 2);
}

#[test]
fn distances_and_hair_are_refused_by_name_or_left_out() {
    let elements = r#"<shape type="sdfgrid"/><bsdf type="measured"/>"#;
    assert_has(&refused("3.0.0", elements), &["sdfgrid", "measured"]);
    let imported = convert(folder("3.0.0", elements).path(), true).unwrap();
    assert_eq!(imported.left_out.len(), 2, "{:?}", imported.left_out);
}

#[test]
fn curves_keep_their_files_and_their_kind() {
    let elements = r#"
        <shape type="bsplinecurve"><string name="filename" value="c.txt"/></shape>
        <shape type="linearcurve"><string name="filename" value="c.txt"/>
            <transform name="to_world"><translate x="1"/></transform><bsdf type="diffuse"/></shape>"#;
    let folder = folder("3.0.0", elements);
    std::fs::write(
        folder.path().join("c.txt"),
        "0 0 0 0.1\n1 0 0 0.1\n2 0 0 0.2\n3 1 0 0.1\n",
    )
    .unwrap();
    let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
    let objects = file.load().unwrap().objects;
    let strands = objects.iter().map(|object| match &object.shape {
        Shape::Strands { strands, .. } => (strands.basis(), strands.pieces()),
        other => panic!("{other:?}"),
    });
    let expected = [(Basis::BSpline, 1), (Basis::Linear, 3)];
    assert!(strands.eq(expected));
}

#[test]
fn named_dielectrics_have_an_index_by_wavelength_where_that_is_asked_for() {
    let elements = r#"
        <bsdf type="dielectric" id="a"><string name="int_ior" value="diamond"/></bsdf>
        <bsdf type="roughdielectric" id="b"><string name="ext_ior" value="Water"/></bsdf>
        <bsdf type="dielectric" id="c"><float name="int_ior" value="1.7"/></bsdf>
        <shape type="sphere"><ref id="a"/></shape><shape type="sphere"><ref id="b"/></shape>
        <shape type="sphere"><ref id="c"/></shape>"#;
    let folder = folder("3.0.0", elements);
    let path = folder.path().join("scene.xml");
    let text = |spectral| {
        let options = ImportOptions {
            spectral,
            ..ImportOptions::default()
        };
        SceneFile::read(&path, &options).unwrap().load().unwrap();
        import(&path, folder.path(), &options).unwrap().text
    };
    assert_has(&text(false), &["ior = 2.419", "exterior_ior = 1.333", "ior = 1.7"]);
    assert_has(
        &text(true),
        &[
            "ior = { preset = \"diamond\" }",
            "ior = { preset = \"bk7\" }",
            "exterior_ior = { preset = \"water\" }",
            "ior = 1.7",
        ],
    );
}
