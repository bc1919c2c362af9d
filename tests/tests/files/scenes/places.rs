//! Where things are: the camera, sides, instances, bounds.

use crate::files::scenes::setup::{VIEW, hit, load, load_with, octahedron};
use beamfarm_render::math::{Ray, Vec2, Vec3};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::Shape;
use beamfarm_render::world::geometry::{Geometry, bounds};
use beamfarm_render::world::light::LightKind;

/// Looking along -z with +y up, +x is on the right of the image and +y at its top.
#[test]
fn camera_sees_right_and_up() {
    let scene = load("");
    let corner = scene.camera.ray(Vec2::new(8.0, 0.0), Vec2::ZERO).dir;
    // 90 degrees horizontally; vertically half of the tangent.
    assert!((corner - Vec3::new(1.0, 0.5, -1.0).normalize()).length() < 1e-6);
    for (axis, tan_half_x) in [("x", 1.0), ("y", 2.0), ("smaller", 2.0), ("larger", 1.0)] {
        let text = VIEW.replace("fov = 90", &format!("fov = 90, fov_axis = \"{axis}\""));
        assert!((load_with(&text, &[]).camera.half_width - tan_half_x).abs() < 1e-6);
    }
}

/// Geometric normals on the near side of objects, seen from the camera on +z.
#[test]
fn sides_are_where_the_format_says() {
    let down = [0.0, 0.0, -1.0];
    let mirror = "transform = [{ scale = [1, 1, -1] }]";
    for (shape, x, expected) in [
        ("type = \"sphere\"", 0.1, 1.0),
        ("type = \"sphere\"\nflip_normals = true", 0.1, -1.0),
        (&format!("type = \"sphere\"\n{mirror}"), 0.1, 1.0),
        ("type = \"disc\"", 0.1, 1.0),
        ("type = \"disc\"\nflip_normals = true", 0.1, -1.0),
        (&format!("type = \"disc\"\n{mirror}"), 0.1, -1.0),
        ("type = \"cylinder\"\np1 = [1, 0, 0]", 0.1, 1.0),
        ("type = \"cylinder\"\np1 = [1, 0, 0]\nflip_normals = true", 0.1, -1.0),
        (&format!("type = \"cylinder\"\np1 = [1, 0, 0]\n{mirror}"), 0.1, 1.0),
        ("type = \"rectangle\"", 0.1, 1.0),
        ("type = \"rectangle\"\nflip_normals = true", 0.1, -1.0),
        (&format!("type = \"rectangle\"\n{mirror}"), 0.1, -1.0),
        ("type = \"cube\"", 0.1, 1.0),
        (&format!("type = \"cube\"\n{mirror}"), 0.1, 1.0),
        ("type = \"cube\"\nflip_normals = true", 0.1, -1.0),
        ("type = \"mesh\"\nfile = \"octahedron.obj\"", 10.1, 1.0),
        (
            "type = \"mesh\"\nfile = \"octahedron.obj\"\nflip_normals = true",
            10.1,
            -1.0,
        ),
        (
            &format!("type = \"mesh\"\nfile = \"octahedron.obj\"\n{mirror}"),
            10.1,
            1.0,
        ),
    ] {
        let inline = shape.replace('\n', ", ");
        let alone = format!("{VIEW}[[shapes]]\n{shape}");
        let instance = format!("{VIEW}[[shapes]]\ntype = \"instances\"\nshape = {{ {inline} }}\ntransforms = [[]]");
        for text in [alone, instance] {
            let scene = load_with(&text, &octahedron());
            let hit = hit(&scene, [x, 0.1, 4.0], down).unwrap();
            assert_eq!(hit.ng.z > 0.0, expected > 0.0, "{text}");
            assert!(hit.ns.dot(hit.ng) > 0.0);
        }
    }
}

/// An instance is the same as the shape itself with the same transform, also where it is mirrored or stretched.
#[test]
fn instances_equal_shapes_of_their_own() {
    let own = "{ rotate = { axis = [1, 2, 3], angle = 40 } }";
    for placed in [
        "{ translate = [-10, 0, 0] }",
        "{ scale = [-0.01, 0.01, 0.01] }, { translate = [0.1, 0, 0] }",
        "{ scale = [1, 2, -3] }, { translate = [-8, 0, 0] }",
    ] {
        let file = "type = \"mesh\"\nfile = \"octahedron.obj\"";
        let alone = format!("{VIEW}[[shapes]]\n{file}\ntransform = [{own}, {placed}]");
        let inline = file.replace('\n', ", ");
        let instances = format!(
            "{VIEW}[[shapes]]\ntype = \"instances\"\nshape = {{ {inline}, transform = [{own}] }}\ntransforms = [[{placed}]]"
        );
        let [a, b] = [alone, instances].map(|text| load_with(&text, &octahedron()));
        let (low, high) = bounds(&a.objects[0].shape);
        let (target, size) = (0.5 * (low + high), (high - low).max_element());
        let mut met = 0;
        let objects = Geometry::new(&a.objects);
        let instance = Geometry::new(&b.objects);
        for i in 0..400 {
            let aim = target + Vec3::new((i % 20) as f32 - 9.7, (i / 20) as f32 - 9.6, 0.0) * (0.05 * size);
            let ray = Ray {
                origin: Vec3::ZERO,
                dir: aim.normalize(),
            };
            let one = objects.intersect(&a.objects, &ray, f32::INFINITY, &|_| false);
            let two = instance.intersect(&b.objects, &ray, f32::INFINITY, &|_| false);
            let (Some(one), Some(two)) = (one, two) else {
                continue;
            };
            met += 1;
            assert!((one.point - two.point).length() < 1e-4);
            assert!((one.ng - two.ng).length() < 1e-3);
            assert!((one.ns - two.ns).length() < 1e-2);
            assert!((one.curvature / two.curvature - 1.0).abs() < 1e-2);
        }
        assert!(met > 40, "{met}");
    }
}

/// A scene of one metre moved by 100 km is the same in render space.
#[test]
fn far_from_the_origin_nothing_changes() {
    let text = |x: &str| {
        format!(
            "image = {{ width = 8, height = 4 }}
            camera = {{ origin = [{x}.25, 0, 5], target = [{x}, 0, 0], fov = 90 }}
            [[shapes]]
            type = \"sphere\"
            center = [{x}.5, 0, 0]
            radius = 0.001
            [[shapes]]
            type = \"cube\"
            transform = [{{ scale = 0.001 }}, {{ translate = [{x}.125, 0, 0] }}]
            [[shapes]]
            type = \"instances\"
            shape = {{ type = \"cube\", transform = [{{ scale = 0.001 }}] }}
            transforms = [[{{ translate = [{x}.125, 0, 0] }}]]
            [[lights]]
            type = \"point\"
            position = [{x}.125, 0, 0]
            intensity = 1"
        )
    };
    let [near, far] = ["0", "100000"].map(|x| load_with(&text(x), &[]));
    let points = |scene: &SceneDescription| -> Vec<Vec3> {
        let mut points = Vec::new();
        for object in &scene.objects {
            match &object.shape {
                Shape::Sphere { placement, .. } | Shape::Disc { placement, .. } | Shape::Cylinder { placement, .. } => {
                    points.push(placement.render_from_object.transform_point3(Vec3::X));
                }
                Shape::Mesh { mesh, placement } => {
                    let place = |p: &Vec3| placement.render_from_object.transform_point3(*p);
                    points.extend(mesh.positions.iter().map(place));
                }
                Shape::Strands { .. } => unreachable!(),
            }
        }
        match scene.lights[0].kind {
            LightKind::Point { position, .. } => points.push(position),
            _ => unreachable!(),
        }
        points
    };
    for (a, b) in points(&near).into_iter().zip(points(&far)) {
        assert!((a - b).length() < 1e-6, "{a} {b}");
    }
}

/// Everything that can be hit, and the camera, lie inside the bounds; for a single ball at the camera's place they are
/// tight.
#[test]
fn bounds_hold_everything() {
    let scene = load_with(
        &format!(
            "{VIEW}[[shapes]]\ntype = \"sphere\"\ntransform = [{{ scale = [1, 2, 3] }}, {{ rotate = {{ axis = [1, 1, 1], angle = 50 }} }}]
            [[shapes]]\ntype = \"mesh\"\nfile = \"octahedron.obj\"
            [[shapes]]\ntype = \"instances\"\nshape = {{ type = \"mesh\", file = \"octahedron.obj\" }}\ntransforms = [[{{ translate = [-30, 5, 5] }}]]
            [[lights]]\ntype = \"point\"\nposition = [0, -20, 0]\npower = 1"
        ),
        &octahedron(),
    );
    let inside = |p: Vec3| (p - scene.bounds.center).length() <= scene.bounds.radius;
    assert!(inside(Vec3::ZERO));
    assert!(inside(Vec3::new(0.0, -20.0, -5.0)));
    for object in &scene.objects {
        let (low, high) = bounds(&object.shape);
        assert!(inside(0.5 * (low + high)));
        assert!(inside(low.lerp(high, 0.3)));
    }
    let ball = load("[[shapes]]\ntype = \"sphere\"\ncenter = [0, 0, 5]\nradius = 4");
    assert!((4.0..4.01).contains(&ball.bounds.radius));
}

/// A box whose walls are instances gets the ball through its corners, whatever shapes the walls are.
#[test]
fn bounds_are_tight() {
    let walls = |shape: &str| {
        load_with(
            &format!(
                "{VIEW}[[shapes]]\ntype = \"instances\"\nshape = {{ {shape} }}
                transforms = [
                    [{{ scale = [9, 3.5, 1] }}, {{ translate = [0, 0, -4] }}],
                    [{{ scale = [9, 3.5, 1] }}, {{ translate = [0, 0, 14] }}],
                ]"
            ),
            &octahedron(),
        )
    };
    let diagonal = Vec3::new(9.0, 3.5, 9.0).length();
    let scene = walls("type = \"rectangle\"");
    assert!((scene.bounds.center - Vec3::ZERO).length() < 1e-5);
    assert!(
        (scene.bounds.radius / diagonal - 1.0).abs() < 2e-3,
        "{}",
        scene.bounds.radius
    );
    // A disc's box is that of the rectangle.
    let scene = walls("type = \"disc\"");
    assert!(scene.bounds.radius < 1.002 * diagonal);
}
