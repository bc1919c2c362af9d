//! Media, phase functions and boundaries.

use super::*;
use beamfarm_harness::render::plan_of;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::world::Scene;

fn medium(inner: &str) -> String {
    let element = format!("<medium type=\"homogeneous\" id=\"m\">{inner}</medium>");
    let native = native(&with_sensor(&element));
    let lines = native.lines().skip_while(|line| *line != "[media.m]").skip(1);
    lines.take_while(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
}

/// Mitsuba's defaults: sigma_t 1, albedo 0.75, scale 1, isotropic.
#[test]
fn coefficients() {
    let homogeneous = "type = \"homogeneous\"\n";
    for (inner, expected) in [
        ("", "sigma_t = 1.0\nalbedo = 0.75"),
        (r#"<float name="scale" value="3"/>"#, "sigma_t = 3.0\nalbedo = 0.75"),
        (
            r#"<rgb name="sigma_t" value="0.5 1 0.25"/><float name="scale" value="2"/><rgb name="albedo" value="0.5"/>"#,
            "sigma_t = [1.0, 2.0, 0.5]\nalbedo = 0.5",
        ),
        (r#"<float name="sigma_t" value="2"/>"#, "sigma_t = 2.0\nalbedo = 0.75"),
        (
            r#"<spectrum name="sigma_t" value="2"/>"#,
            "sigma_t = 2.0\nalbedo = 0.75",
        ),
        (
            r#"<volume type="constvolume" name="sigma_t"><rgb name="value" value="2 0.6 0.7"/></volume>"#,
            "sigma_t = [2.0, 0.6, 0.7]\nalbedo = 0.75",
        ),
        (
            r#"<rgb name="sigma_s" value="2 3 4"/><rgb name="sigma_a" value="1"/><float name="scale" value="0.5"/>"#,
            "sigma_s = [1.0, 1.5, 2.0]\nsigma_a = 0.5",
        ),
        (
            r#"<phase type="hg"/>"#,
            "sigma_t = 1.0\nalbedo = 0.75\nphase = { type = \"hg\", g = 0.8 }",
        ),
        (r#"<phase type="isotropic"/>"#, "sigma_t = 1.0\nalbedo = 0.75"),
        (
            r#"<phase type="blendphase"><float name="weight" value="0.3"/><phase type="isotropic"/><phase type="hg"><float name="g" value="-0.5"/></phase></phase>"#,
            "sigma_t = 1.0\nalbedo = 0.75\nphase = { type = \"blend\", weight = 0.3, phases = [\"isotropic\", { type = \"hg\", g = -0.5 }] }",
        ),
    ] {
        assert_eq!(medium(inner), format!("{homogeneous}{expected}"), "{inner}");
    }
}

#[test]
fn coefficients_that_mitsuba_refuses() {
    for (inner, words) in [
        // As strict as Mitsuba.
        (r#"<rgb name="sigma_t" value="2"/>"#, "scale"),
        (r#"<rgb name="albedo" value="2"/>"#, "albedo"),
        (r#"<rgb name="sigma_s" value="2"/>"#, "both of sigma_s and sigma_a"),
        (
            r#"<rgb name="sigma_s" value="1"/><rgb name="sigma_a" value="1"/><rgb name="albedo" value="1"/>"#,
            "mixed",
        ),
        (r#"<float name="sigma_t" value="-1"/>"#, "negative"),
        (r#"<string name="material" value="skin1"/>"#, "not supported"),
        (r#"<phase type="rayleigh"/>"#, "rayleigh"),
    ] {
        let xml = with_sensor(&format!("<medium type=\"homogeneous\">{inner}</medium>"));
        assert_error(&xml, "scene.xml:2: ", &[words]);
    }
}

/// A .vol file of one sample in the box from (1, 2, 3) to (2, 4, 7).
fn vol() -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for n in [1i32, 1, 1, 1, 1] {
        bytes.extend(n.to_le_bytes());
    }
    for x in [1f32, 2.0, 3.0, 2.0, 4.0, 7.0, 0.5] {
        bytes.extend(x.to_le_bytes());
    }
    bytes
}

#[test]
fn grids() {
    let xml = |inner: &str| {
        with_sensor(&format!(
            r#"<medium type="heterogeneous" id="m"><volume type="gridvolume" name="sigma_t"><string name="filename" value="a.vol"/>
            <transform name="to_world"><scale value="2"/></transform>{inner}</volume><float name="scale" value="3"/>
            <rgb name="albedo" value="0.5"/></medium>"#
        ))
    };
    let folder = folder(&[("scene.xml", &xml(""))]);
    std::fs::write(folder.path().join("a.vol"), vol()).unwrap();
    let text = import_in(folder.path(), &ImportOptions::default()).unwrap().text;
    for (name, expected) in [
        ("type", "\"heterogeneous\""),
        ("sigma_t", "1.0"),
        ("albedo", "0.5"),
        ("scale", "3.0"),
        ("density", "{ file = \"a.vol\" }"),
        ("transform", "[{ scale = 2.0 }]"),
    ] {
        assert_eq!(field(&text, "[media.m]", name), Some(expected));
    }
    scene_in(folder.path());
    // An albedo in the same place, and one elsewhere.
    let with = |place: &str| {
        let albedo = format!(
            "<volume type=\"gridvolume\" name=\"albedo\"><string name=\"filename\" value=\"b.vol\"/>\
             <transform name=\"to_world\"><scale value=\"{place}\"/></transform></volume>"
        );
        xml("").replace("<rgb name=\"albedo\" value=\"0.5\"/>", &albedo)
    };
    let text = native(&with("2"));
    assert_eq!(field(&text, "[media.m]", "albedo"), Some("{ file = \"b.vol\" }"));
    assert_error(&with("3"), "scene.xml:", &["albedo", "not supported"]);
    // The file's own box is used on request.
    std::fs::write(
        folder.path().join("scene.xml"),
        xml(r#"<boolean name="use_grid_bbox" value="true"/>"#),
    )
    .unwrap();
    let text = import_in(folder.path(), &ImportOptions::default()).unwrap().text;
    let expected = "[{ scale = [1.0, 2.0, 4.0] }, { translate = [1.0, 2.0, 3.0] }, { scale = 2.0 }]";
    assert_eq!(field(&text, "[media.m]", "transform"), Some(expected));
}

/// Without a grid too, a heterogeneous medium fills the bounds of the unit cube under its extinction's own transform,
/// as pixels of Mitsuba 3.9.1 show; a homogeneous one fills the shape.
#[test]
fn constant_volumes_have_a_box() {
    let volume = |plugin: &str, sigma_t: &str| {
        format!("<medium type=\"{plugin}\" id=\"m\">{sigma_t}<float name=\"albedo\" value=\"0\"/></medium>")
    };
    let constant = |steps: &str| {
        format!(
            "<volume type=\"constvolume\" name=\"sigma_t\"><rgb name=\"value\" value=\"2 0.5 1\"/>\
             <transform name=\"to_world\">{steps}</transform></volume><float name=\"scale\" value=\"0.5\"/>"
        )
    };
    let text = native(&with_sensor(&volume("heterogeneous", &constant("<scale x=\"2\"/>"))));
    for (name, expected) in [
        ("type", "\"heterogeneous\""),
        ("sigma_t", "[1.0, 0.25, 0.5]"),
        (
            "density",
            "{ min = [0.0, 0.0, 0.0], max = [2.0, 1.0, 1.0], voxel = 2.0 }",
        ),
    ] {
        assert_eq!(field(&text, "[media.m]", name), Some(expected));
    }
    let diagonal = std::f64::consts::SQRT_2;
    let turned = "<rotate z=\"1\" angle=\"45\"/><translate x=\"-0.5\"/>";
    for (medium, sigma_t, corners) in [
        (
            volume("heterogeneous", "<float name=\"sigma_t\" value=\"2\"/>"),
            [2.0; 3],
            [[0.0; 3], [1.0; 3]],
        ),
        (
            volume("heterogeneous", &constant(turned)),
            [1.0, 0.25, 0.5],
            [[-0.5 - 0.5 * diagonal, 0.0, 0.0], [0.5 * diagonal - 0.5, diagonal, 1.0]],
        ),
        (
            volume("homogeneous", &constant(turned)),
            [1.0, 0.25, 0.5],
            [[-2.0; 3], [2.0; 3]],
        ),
    ] {
        let cube = "<shape type=\"cube\"><transform name=\"to_world\"><scale value=\"2\"/></transform>\
                    <bsdf type=\"null\"/><ref name=\"interior\" id=\"m\"/></shape>";
        let sky = "<emitter type=\"constant\"/>";
        let scene = Scene::new(scene(&with_sensor(&format!("{medium}{cube}{sky}"))));
        let plan = plan_of(&scene);
        let pixels = render_pass(&scene, &plan, 0).expect("a pass").film.pixels;
        let (mut inside, mut outside) = (0, 0);
        for (i, pixel) in pixels.iter().enumerate() {
            // Bounds of what a pixel sees of the box, from its corners, if they are all of one kind.
            let depths =
                [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| depth(i as u32 % 16 + x, i as u32 / 16 + y, corners));
            let [least, most] = [f64::min, f64::max].map(|f| depths.into_iter().reduce(f).unwrap());
            if least == 0.0 && most > 0.0 {
                continue;
            }
            inside += usize::from(least > 0.0);
            outside += usize::from(most == 0.0);
            for (value, sigma) in pixel.iter().zip(sigma_t) {
                let bounds = [most, least].map(|depth| libm::exp(-sigma * depth));
                let value = f64::from(*value);
                assert!(
                    value > bounds[0] - 0.03 && value < bounds[1] + 0.03,
                    "pixel {i}: {value}, expected {bounds:?}"
                );
            }
        }
        let filled = corners == [[-2.0; 3], [2.0; 3]];
        assert!(inside >= 8 && (filled || outside >= 8), "{inside} {outside}");
    }
}

/// The length of the ray through a corner of a pixel of [`SENSOR`] inside a box.
fn depth(x: u32, y: u32, [low, high]: [[f64; 3]; 2]) -> f64 {
    let extent = libm::tan(20f64.to_radians());
    let origin = [0.0, 0.0, 5.0];
    let direction = [
        (f64::from(x) / 8.0 - 1.0) * extent,
        (0.5 - f64::from(y) / 8.0) * extent,
        -1.0,
    ];
    let (mut enter, mut leave) = (0.0, f64::INFINITY);
    for axis in 0..3 {
        let at = [low, high].map(|c| (c[axis] - origin[axis]) / direction[axis]);
        enter = f64::max(enter, at[0].min(at[1]));
        leave = f64::min(leave, at[0].max(at[1]));
    }
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    (leave - enter).max(0.0) * length
}

const FOG: &str = r#"<medium type="homogeneous" id="fog"/>"#;

#[test]
fn boundaries_are_said() {
    let glass = |media: &str| format!("{FOG}<shape type=\"sphere\"><bsdf type=\"dielectric\"/>{media}</shape>");
    let interior = r#"<ref name="interior" id="fog"/>"#;
    let text = native(&with_sensor(&glass(interior)));
    assert_eq!(field(&text, "[[shapes]]", "interior"), Some("\"fog\""));
    assert_eq!(field(&text, "[[shapes]]", "exterior"), None);
    assert_eq!(field(&text, "[camera]", "medium"), Some("\"none\""));
    assert!(!text.contains("[world]"));
    // Inline, without an id.
    let inline = r#"<shape type="cube"><bsdf type="null"/><medium type="homogeneous" name="interior"/></shape>"#;
    assert_eq!(
        field(&native(&with_sensor(inline)), "[[shapes]]", "interior"),
        Some("\"interior\"")
    );
    // Sheets have the same medium on both sides.
    let sheet = format!("{FOG}<shape type=\"sphere\"><bsdf type=\"thindielectric\"/>{interior}</shape>");
    assert_eq!(
        field(&native(&with_sensor(&sheet)), "[[shapes]]", "material"),
        Some("\"thindielectric\"")
    );
    // No medium is inside opaque shapes.
    let opaque = format!("{FOG}<shape type=\"sphere\">{interior}</shape>");
    let imported = try_import(&with_sensor(&opaque)).unwrap();
    assert_eq!(field(&imported.text, "[[shapes]]", "interior"), None);
    assert!(
        imported.notes.iter().any(|note| note.contains("interior medium")),
        "{:?}",
        imported.notes
    );
}

/// A sensor's medium, whether named "medium" or not, is that of the world unless shapes say otherwise.
#[test]
fn the_world_is_what_lies_outside() {
    for reference in [r#"<ref id="fog"/>"#, r#"<ref name="medium" id="fog"/>"#] {
        let sensor = SENSOR.replace("<film", &format!("{reference}<film"));
        // A bubble in the fog; and glass, which in Mitsuba does not stop the fog.
        let text = native(&bare(&format!(
            r#"{FOG}<shape type="sphere"><bsdf type="null"/><ref name="exterior" id="fog"/></shape>
            <shape type="sphere" id="ball"><bsdf type="dielectric"/></shape>{sensor}"#
        )));
        assert_eq!(field(&text, "[world]", "medium"), Some("\"fog\""));
        assert_eq!(field(&text, "[camera]", "medium"), Some("\"fog\""));
        assert_eq!(field(&text, "[[shapes]]", "interior"), None);
        assert_eq!(text.matches("boundary = false").count(), 1, "{text}");
        // The sensor in a box of fog.
        let text = native(&bare(&format!(
            r#"{FOG}<shape type="cube"><bsdf type="null"/><ref name="interior" id="fog"/></shape>{sensor}"#
        )));
        assert_eq!(field(&text, "[world]", "medium"), None);
        assert_eq!(field(&text, "[camera]", "medium"), Some("\"fog\""));
    }
}
