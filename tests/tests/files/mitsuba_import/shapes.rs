//! Shapes, their transforms, groups and instances.

use super::*;
use beamfarm_render::world::geometry::{Mesh, Shape};
use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;

fn shape(element: &str) -> String {
    let native = native(&with_sensor(element));
    let lines = native.lines().skip_while(|line| *line != "[[shapes]]").skip(1);
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn kinds_of_shapes() {
    for (element, expected) in [
        (
            r#"<shape type="sphere" id="ball"><point name="center" x="1" y="2" z="3"/><float name="radius" value="2"/></shape>"#,
            "name = \"ball\"\ntype = \"sphere\"\ncenter = [1.0, 2.0, 3.0]\nradius = 2.0",
        ),
        ("<shape type=\"rectangle\"/>", "type = \"rectangle\""),
        ("<shape type=\"disk\"/>", "type = \"disc\""),
        (
            r#"<shape type="cylinder"><point name="p0" value="0"/><point name="p1" x="0" y="1" z="0"/><float name="radius" value="0.5"/></shape>"#,
            "type = \"cylinder\"\np0 = [0.0, 0.0, 0.0]\np1 = [0.0, 1.0, 0.0]\nradius = 0.5",
        ),
        (
            r#"<shape type="ply"><string name="filename" value="a.ply"/><boolean name="face_normals" value="true"/><boolean name="flip_normals" value="true"/></shape>"#,
            "type = \"mesh\"\nfile = \"a.ply\"\nface_normals = true\nflip_normals = true",
        ),
        (
            r#"<shape type="obj"><string name="filename" value="a.obj"/></shape>"#,
            "type = \"mesh\"\nfile = \"a.obj\"\nsmooth = true",
        ),
    ] {
        assert_eq!(shape(element), expected);
    }
    assert_error(&with_sensor("<shape type=\"ply\"/>"), "scene.xml:2: ", &["filename"]);
    assert_error(
        &with_sensor("<shape type=\"cube\"><float name=\"radius\" value=\"1\"/></shape>"),
        "scene.xml:2: ",
        &["radius"],
    );
}

#[test]
fn transforms_keep_their_order() {
    let steps = r#"<translate x="1"/><rotate value="0 0 1" angle="90"/><scale y="2"/><scale value="3"/><matrix value="1 0 0 5  0 1 0 6  0 0 1 7  0 0 0 1"/>
        <matrix value="0 1 0 1 0 0 0 0 1"/>"#;
    let text = shape(&format!(
        "<shape type=\"cube\"><transform name=\"to_world\">{steps}</transform></shape>"
    ));
    let expected = "transform = [{ translate = [1.0, 0.0, 0.0] }, { rotate = { axis = [0.0, 0.0, 1.0], angle = 90.0 } }, \
        { scale = [1.0, 2.0, 1.0] }, { scale = 3.0 }, \
        { matrix = [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0], [0.0, 0.0, 0.0, 1.0]] }, \
        { matrix = [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]] }]";
    assert_eq!(text.lines().nth(1), Some(expected));
    for bad in [
        "<matrix value=\"1 2 3\"/>",
        "<matrix value=\"1 0 0 5 0 1 0 6 0 0 1 7 0 0 1 1\"/>",
        "<rotate angle=\"3\"/>",
        "<rotate x=\"1\"/>",
        "<scale value=\"1 2\"/>",
        "<translate w=\"1\"/>",
        "<lookat origin=\"0 0 0\" target=\"0 0 0\"/>",
        "<lookat origin=\"0 0\" target=\"0 0 1\"/>",
    ] {
        let xml = with_sensor(&format!(
            "<shape type=\"cube\"><transform name=\"to_world\">\n{bad}</transform></shape>"
        ));
        assert_error(&xml, "scene.xml:3: ", &[]);
    }
}

/// The outward direction of a shape that the sensor at (0, 0, 5) sees: the mean of normal . (point - centre).
fn outward(element: &str) -> f32 {
    let scene = scene(&with_sensor(element));
    let center = Vec3::new(0.0, 0.0, -5.0);
    let samples = (0..64).map(|i| {
        let u = Vec2::new((i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5) / 8.0;
        let on = scene.objects[0].shape.sample_area(u, (i as f32 + 0.5) / 64.0);
        on.normal.dot(on.point - center)
    });
    samples.sum::<f32>() / 64.0
}

/// Whether Mitsuba's normals point outwards, from its `ray_intersect` on each of these.
#[test]
fn mirrored_spheres_are_turned_inside_out_and_others_are_not() {
    let element = |kind: &str, steps: &str, flip: bool| {
        format!(
            "<shape type=\"{kind}\"><transform name=\"to_world\">{steps}</transform><boolean name=\"flip_normals\" value=\"{flip}\"/></shape>"
        )
    };
    for steps in ["", "<scale x=\"-1\"/>", "<scale z=\"-1\"/>", "<scale value=\"-1\"/>"] {
        for flip in [false, true] {
            let sphere = outward(&element("sphere", steps, flip)) > 0.0;
            assert_eq!(sphere, steps.is_empty() != flip, "sphere {steps} {flip}");
            let cube = outward(&element("cube", steps, flip)) > 0.0;
            assert_eq!(cube, !flip, "cube {steps} {flip}");
        }
    }
    // The normal +z goes where the transform takes it.
    for (steps, up) in [
        ("", 1.0),
        ("<scale x=\"-1\"/>", 1.0),
        ("<scale z=\"-1\"/>", -1.0),
        ("<scale value=\"-1\"/>", -1.0),
    ] {
        for kind in ["rectangle", "disk"] {
            for flip in [false, true] {
                let scene = scene(&with_sensor(&element(kind, steps, flip)));
                let normal = scene.objects[0].shape.sample_area(Vec2::splat(0.4), 0.4).normal;
                let expected = if flip { -up } else { up };
                assert!((normal.z - expected).abs() < 1e-6, "{kind} {steps} {flip}: {normal}");
            }
        }
    }
}

#[test]
fn center_and_radius_come_before_to_world() {
    let element = r#"<shape type="sphere"><point name="center" x="0" y="0" z="1"/><float name="radius" value="0.5"/><transform name="to_world"><scale value="2"/></transform></shape>"#;
    let scene = scene(&with_sensor(element));
    // Mitsuba's nearest point to the sensor is (0, 0, 3): centre (0, 0, 2), radius 1.
    let samples = (0..256).map(|i| {
        let u = Vec2::new((i % 16) as f32 + 0.5, (i / 16) as f32 + 0.5) / 16.0;
        let on = scene.objects[0].shape.sample_area(u, 0.5);
        on.point.as_dvec3().distance(DVec3::new(0.0, 0.0, 2.0 - 5.0))
    });
    for distance in samples {
        assert!((distance - 1.0).abs() < 1e-5, "{distance}");
    }
}

#[test]
fn instances() {
    let text = shape(
        r#"<shape type="instance"><ref id="g"/><transform name="to_world"><translate x="1"/></transform></shape>
        <shape type="shapegroup" id="g"><shape type="sphere"><float name="radius" value="0.5"/></shape><shape type="cube"><bsdf type="conductor"/></shape></shape>
        <shape type="instance"><ref id="g"/></shape>"#,
    );
    let transforms = "transforms = [\n  [{ translate = [1.0, 0.0, 0.0] }],\n  [],\n]";
    let expected = format!(
        "name = \"g\"\ntype = \"instances\"\nshape = {{ type = \"sphere\", radius = 0.5 }}\n{transforms}\n\n[[shapes]]\n\
         name = \"g\"\ntype = \"instances\"\nshape = {{ type = \"cube\", material = \"conductor\" }}\n{transforms}"
    );
    assert_eq!(text, expected);
    let both = r#"<shape type="shapegroup" id="g"><shape type="sphere"/><shape type="cube"/></shape><shape type="instance"><ref id="g"/></shape>"#;
    assert_eq!(scene(&with_sensor(both)).objects.len(), 2);
    // A group without an instance is not shown.
    let alone = "<shape type=\"shapegroup\" id=\"g\"><shape type=\"sphere\"/></shape><shape type=\"cube\"/>";
    assert_eq!(scene(&with_sensor(alone)).objects.len(), 1);
    assert_error(
        &with_sensor("<shape type=\"instance\"/>"),
        "scene.xml:2: ",
        &["shapegroup"],
    );
    let light = "<shape type=\"shapegroup\"><shape type=\"sphere\"><emitter type=\"area\"/></shape></shape>";
    assert_error(&with_sensor(light), "scene.xml:2: ", &["emitter"]);
}

/// Mitsuba 3.9.1's `ScalarTransform4f.rotate([1, 2, 1], 35)`, which does not normalise the axis.
#[test]
fn an_axis_that_is_no_unit_vector_shears() {
    let element =
        "<shape type=\"cube\"><transform name=\"to_world\"><rotate value=\"1 2 1\" angle=\"35\"/></transform></shape>";
    let scene = scene(&with_sensor(element));
    let (low, high) = beamfarm_render::world::geometry::bounds(&scene.objects[0].shape);
    let rows = [
        [1.0f32, -0.21188056, 1.3280008],
        [0.93527234, 1.5425439, -0.21188056],
        [-0.96630496, 0.93527234, 1.0],
    ];
    let origin = low.midpoint(high);
    let extent = (high - origin).to_array();
    for (row, extent) in rows.iter().zip(extent) {
        let expected: f32 = row.iter().map(|x| x.abs()).sum();
        assert!((extent - expected).abs() < 1e-5, "{extent}, expected {expected}");
    }
}

/// A tetrahedron without normals, in two groups.
const CORNERS: [&str; 4] = ["0 0 0", "1 0 0", "0.3 1 0", "0.2 0.3 0.9"];
const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

fn tetrahedra() -> [String; 2] {
    let mut ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                   element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        .to_string();
    let mut obj = String::new();
    for corner in CORNERS {
        ply += &format!("{corner}\n");
        obj += &format!("v {corner}\n");
    }
    for (i, [a, b, c]) in FACES.into_iter().enumerate() {
        ply += &format!("3 {a} {b} {c}\n");
        obj += if i % 2 == 0 { "g some\n" } else { "" };
        obj += &format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    }
    [ply, obj]
}

/// The first object's mesh, and its normals in world space.
fn shaded_mesh(element: &str) -> (Arc<Mesh>, Vec<Vec3>) {
    let [ply, obj] = tetrahedra();
    let folder = folder(&[("scene.xml", &with_sensor(element)), ("a.ply", &ply), ("a.obj", &obj)]);
    let scene = scene_in(folder.path());
    let Shape::Mesh { mesh, placement } = &scene.objects[0].shape else {
        panic!("no mesh");
    };
    let map = placement.object_from_render.matrix3.transpose();
    let normals = mesh.normals.iter().map(|n| (map * *n).normalize());
    (mesh.clone(), normals.collect())
}

/// `vertex_normals` of Mitsuba 3.9.1.
#[test]
fn meshes_without_normals_are_smooth() {
    let scaled = "<scale x=\"1\" y=\"2\" z=\"0.5\"/><rotate y=\"1\" angle=\"30\"/>";
    #[rustfmt::skip]
    let expected = [
        ("", [
            [-0.6963606, -0.5751586, -0.4292719], [0.8641168, -0.4172304, -0.281462],
            [-0.0843926, 0.9448017, -0.3165875], [-0.2115972, -0.0310646, 0.9768631],
        ]),
        (scaled, [
            [-0.6752652, -0.7279019, 0.1190617], [0.62036, -0.5781938, -0.5299485],
            [-0.0878069, 0.9936481, -0.0703809], [0.2002462, 0.0221578, 0.9794951],
        ]),
    ];
    for kind in ["ply", "obj"] {
        for (steps, expected) in expected {
            let mesh = |more: &str| {
                format!(
                    "<shape type=\"{kind}\"><string name=\"filename\" value=\"a.{kind}\"/>\
                     <transform name=\"to_world\">{steps}</transform>{more}</shape>"
                )
            };
            // Instances have the normals of their original.
            let group = format!(
                "<shape type=\"shapegroup\" id=\"g\">{}</shape><shape type=\"instance\"><ref id=\"g\"/></shape>",
                mesh("")
            );
            for element in [mesh(""), group] {
                let (mesh, normals) = shaded_mesh(&element);
                assert_eq!(normals.len(), 4, "groups have vertices in common");
                // An OBJ file's vertices are in the order of its faces.
                for (i, face) in FACES.iter().enumerate() {
                    for (vertex, corner) in mesh.triangles[i].iter().zip(face) {
                        let normal = normals[*vertex as usize];
                        let expected = Vec3::from(expected[*corner as usize]);
                        assert!(
                            (normal - expected).length() < 1e-5,
                            "{kind} {steps}: {normal}, expected {expected}"
                        );
                    }
                }
            }
            let faceted = mesh("<boolean name=\"face_normals\" value=\"true\"/>");
            assert!(shaded_mesh(&faceted).1.is_empty());
        }
    }
}

/// They point outwards however the shape is mirrored or turned.
#[test]
fn smooth_normals_are_on_the_outside() {
    for (steps, flip) in [
        ("<scale x=\"-1\" y=\"2\"/>", false),
        ("<scale value=\"-2\"/>", true),
        ("", true),
    ] {
        let (mesh, normals) = shaded_mesh(&format!(
            "<shape type=\"ply\"><string name=\"filename\" value=\"a.ply\"/><transform name=\"to_world\">{steps}</transform>\
             <boolean name=\"flip_normals\" value=\"{flip}\"/></shape>"
        ));
        for (i, triangle) in mesh.triangles.iter().enumerate() {
            let face = mesh.normal(i as u32);
            for vertex in triangle {
                assert!(normals[*vertex as usize].dot(face) > 0.0, "{steps} {flip}");
            }
        }
    }
}
