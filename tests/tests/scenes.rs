//! Scenes that can be rendered mean what the format says: places, sides, powers, orientations.

use beamfarm_shared::bsdf::MaterialKind;
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::geometry::accel::{Geometry, bounds};
use beamfarm_shared::geometry::{Boundary, Shape, SurfaceHit};
use beamfarm_shared::light::LightKind;
use beamfarm_shared::math::{PI, Ray, Rgb, Vec2, Vec3};
use beamfarm_shared::medium::Medium;
use beamfarm_shared::phase::Phase;
use beamfarm_shared::sampler::{Purpose, Sampler};
use beamfarm_shared::scene::{SceneDescription, read_bundle};
use beamfarm_shared::texture::Texture;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The camera stands at (0, 0, 5).
const VIEW: &str = "image = { width = 8, height = 4 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 90 }
";

fn load_with(text: &str, assets: &[(&str, Vec<u8>)]) -> SceneDescription {
    let mut files: BTreeMap<_, _> = assets
        .iter()
        .map(|(name, bytes)| (name.to_string(), bytes.clone()))
        .collect();
    files.insert("scene.toml".to_string(), text.as_bytes().to_vec());
    let scene = "scene.toml".to_string();
    SceneDescription::load(&Bundle { scene, files }).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn load(text: &str) -> SceneDescription {
    load_with(&format!("{VIEW}{text}"), &[])
}

/// The first hit of a ray given in world space.
fn hit(scene: &SceneDescription, origin: [f32; 3], dir: [f32; 3]) -> Option<SurfaceHit> {
    let ray = Ray {
        origin: Vec3::from(origin) - Vec3::new(0.0, 0.0, 5.0),
        dir: Vec3::from(dir).normalize(),
    };
    Geometry::new(&scene.objects).intersect(&scene.objects, &ray, f32::INFINITY, |_| false)
}

/// An octahedron with vertex normals, centred away from the origin.
const OCTAHEDRON: &str = "v 11 0 0\nv 9 0 0\nv 10 1 0\nv 10 -1 0\nv 10 0 1\nv 10 0 -1\n\
    vn 1 0 0\nvn -1 0 0\nvn 0 1 0\nvn 0 -1 0\nvn 0 0 1\nvn 0 0 -1\n\
    f 1//1 3//3 5//5\nf 3//3 2//2 5//5\nf 2//2 4//4 5//5\nf 4//4 1//1 5//5\n\
    f 3//3 1//1 6//6\nf 2//2 3//3 6//6\nf 4//4 2//2 6//6\nf 1//1 4//4 6//6\n";

fn octahedron() -> [(&'static str, Vec<u8>); 1] {
    [("octahedron.obj", OCTAHEDRON.as_bytes().to_vec())]
}

/// What `EVERY_FIELD` names.
fn every_file() -> [(&'static str, Vec<u8>); 3] {
    let [octahedron] = octahedron();
    let volume = include_bytes!("../data/volumes/several.vdb").to_vec();
    let image = include_bytes!("../data/mitsuba_renders/mask.png").to_vec();
    [octahedron, ("several.vdb", volume), ("grey.png", image)]
}

/// Every field of the format, in places that are valid together.
const EVERY_FIELD: &str = r#"
[image]
width = 512
height = 256
[render]
passes = 10
paths = 1000
alpha = 0.5
schedule = "beam"
seed = 7
exposure = -1.5
radius = 0.02
[world]
medium = "fog"
[camera]
origin = [0.0, 1.0, 2.9]
target = [0.0, 1.0, 0.0]
up = [0.0, 1.0, 0.0]
fov = 50.0
fov_axis = "x"
aperture = 0.1
focus_distance = 3.0
medium = "none"
[media.amber]
type = "homogeneous"
sigma_t = [1.0, 2.0, 4.0]
albedo = 0.75
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.1, 0.1]
sigma_s = 0.4
phase = { type = "hg", g = 0.7 }
[media.haze]
type = "heterogeneous"
sigma_a = 0.1
sigma_s = 0.4
transmittance = "ratio_tracking"
[media.haze.density]
min = [-1.0, 0.0, -1.0]
max = [1.0, 1.0, 1.0]
voxel = 0.5
height = { base = 0.25, scale = 0.5 }
blobs = [ { center = [0, 0.5, 0], radius = 1, density = 2 } ]
noise = { size = 0.5, octaves = 2, gain = 0.6, contrast = 2.0, seed = 3 }
[media.smoke]
type = "heterogeneous"
sigma_t = 1.0
albedo = 0.9
density = { file = "several.vdb", grid = "heat[1]" }
scale = 2.0
transform = [ { scale = 0.5 }, { translate = [0, 1, 0] } ]
transmittance = { free_flights = 8 }
[materials.a_diffuse]
type = "diffuse"
reflectance = [0.1, 0.2, 0.3]
two_sided = true
[materials.b_dielectric]
type = "dielectric"
ior = 1.5
exterior_ior = 1.2
[materials.c_conductor]
type = "conductor"
preset = "gold"
reflectance = 0.9
[materials.d_conductor]
type = "conductor"
eta = 0.2
k = [3.0, 4.0, 5.0]
two_sided = false
[materials.e_rough]
type = "rough_conductor"
alpha = 0.1
preset = "aluminium"
[materials.f_rough]
type = "rough_dielectric"
ior = 1.5
alpha = 0.2
[materials.g_mirror]
type = "mirror"
[materials.h_null]
type = "null"
[materials.i_pane]
type = "thin_dielectric"
ior = 1.5
specular_reflectance = 0.9
specular_transmittance = [0.9, 0.8, 0.7]
[materials.j_plastic]
type = "plastic"
reflectance = 0.4
ior = 1.6
exterior_ior = 1.1
nonlinear = true
two_sided = true
[materials.k_plastic]
type = "rough_plastic"
alpha = 0.2
distribution = "beckmann"
specular_reflectance = 0.8
[materials.l_principled]
type = "principled"
base_color = [0.8, 0.4, 0.1]
metallic = 0.2
roughness = 0.3
specular = 0.6
[materials.m_principled]
type = "principled"
ior = 1.6
exterior_ior = 1.2
opacity = 0.5
normal_map = { image = "grey.png" }
[materials.n_bumpy]
type = "mirror"
opacity = { image = "grey.png", raw = true }
bump = { image = "grey.png", raw = true, filter = "bilinear", wrap = "clamp", uv = [{ scale = 2 }], scale = 0.5 }
[[shapes]]
name = "ball"
type = "sphere"
center = [0, 1, 0]
radius = 0.35
material = "b_dielectric"
interior = "amber"
exterior = "fog"
[[shapes]]
type = "rectangle"
emission = { radiance = [10, 10, 10] }
transform = [
    { scale = 2.0 },
    { rotate = { axis = [0, 1, 0], angle = 30 } },
    { translate = [1, 0, 0] },
    { matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] },
    { look_at = { origin = [0, 0, 0], target = [0, 0, 1], up = [0, 1, 0] } },
]
[[shapes]]
type = "cube"
material = "h_null"
transform = []
[[shapes]]
type = "disc"
flip_normals = true
[[shapes]]
type = "mesh"
file = "octahedron.obj"
face_normals = true
material = "c_conductor"
[[shapes]]
name = "facets"
type = "instances"
shape = { type = "mesh", file = "octahedron.obj", material = "g_mirror" }
transforms = [[{ translate = [0, 0, 0] }], []]
[[lights]]
name = "bulb"
type = "point"
position = [0, 1, 0]
power = 100.0
[[lights]]
type = "spot"
position = [0, 1, 0]
target = [0, 0, 0]
intensity = 10.0
cutoff_angle = 30
beam_width = 10
"#;

#[test]
fn every_field_of_the_format_is_read() {
    let scene = load_with(EVERY_FIELD, &every_file());
    let d = scene.defaults;
    assert_eq!(
        (d.passes, d.paths_per_pass, d.alpha, d.seed),
        (10, 1000, 0.5, 7)
    );
    assert_eq!((d.exposure, d.radius), (-1.5, Some(0.02)));
    assert_eq!(d.schedule, beamfarm_shared::job::ScheduleKind::Beam);
    assert_eq!(scene.world_medium, Some(1));
    assert_eq!(scene.camera_medium, Some(None));
    assert_eq!(
        (scene.camera.aperture, scene.camera.focus_distance),
        (0.1, 3.0)
    );
    assert_eq!(scene.media[0].sigma_s(), Rgb::new(0.75, 1.5, 3.0));
    assert_eq!(scene.media[0].sigma_t(), Rgb::new(1.0, 2.0, 4.0));
    assert_eq!(scene.media[0].phase(), Phase::Isotropic);
    assert_eq!(scene.media[1].sigma_s(), Rgb::splat(0.4));
    assert_eq!(scene.media[1].phase(), Phase::HenyeyGreenstein { g: 0.7 });
    for (medium, scattered) in [(2, 0.4), (3, 1.8)] {
        assert!(matches!(scene.media[medium], Medium::Heterogeneous(_)));
        assert!(
            (scene.media[medium].sigma_s() - scattered)
                .abs()
                .max_element()
                < 1e-6
        );
    }
    assert!(matches!(scene.materials[1].kind, MaterialKind::Dielectric { eta, .. } if eta == 1.25));
    let two_sided: Vec<bool> = scene.materials.iter().map(|m| m.two_sided).collect();
    // The last two stand for shapes without a material: black and grey.
    assert_eq!(
        two_sided[..8],
        [true, true, true, false, true, true, true, true]
    );
    assert_eq!(two_sided[8..14], [true, true, false, false, false, true]);
    assert_eq!(two_sided[14..], [false, false]);
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    let expected = [
        "ball",
        "shapes[1]",
        "shapes[2]",
        "shapes[3]",
        "shapes[4]",
        "facets[0]",
        "facets[1]",
    ];
    assert_eq!(names, expected);
    let ball = Boundary {
        interior: Some(0),
        exterior: Some(1),
    };
    let clear = Boundary {
        interior: None,
        exterior: Some(1),
    };
    let boundaries: Vec<_> = scene.objects.iter().map(|o| o.boundary).collect();
    assert_eq!(
        boundaries,
        [Some(ball), None, Some(clear), None, None, None, None]
    );
    for (object, reflectance) in [(1, 0.0), (3, 0.5)] {
        match &scene.materials[scene.objects[object].material as usize].kind {
            MaterialKind::Diffuse {
                reflectance: Texture::Constant(c),
            } => assert_eq!(*c, Rgb::splat(reflectance)),
            other => panic!("{other:?}"),
        }
    }
    let lights: Vec<&str> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(lights, ["bulb", "lights[1]", "shapes[1]"]);
    assert_eq!(scene.objects[1].light, Some(2));
    assert!(matches!(
        scene.lights[2].kind,
        LightKind::Area { object: 1, .. }
    ));
    match (&scene.objects[5].shape, &scene.objects[6].shape) {
        (Shape::Mesh { mesh: a, .. }, Shape::Mesh { mesh: b, .. }) => assert!(Arc::ptr_eq(a, b)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn fields_have_their_defaults() {
    let scene = load("");
    let d = scene.defaults;
    assert_eq!(
        (d.passes, d.paths_per_pass, d.seed, d.exposure),
        (64, 50_000, 0, 0.0)
    );
    assert_eq!((d.alpha, d.radius), (2.0 / 3.0, None));
    assert_eq!((scene.world_medium, scene.camera_medium), (None, None));
    assert_eq!(
        (scene.camera.aperture, scene.camera.focus_distance),
        (0.0, 5.0)
    );
    assert!(scene.bounds.radius > 0.0);
}

/// Looking along -z with +y up, +x is on the right of the image and +y at its top.
#[test]
fn camera_sees_right_and_up() {
    let scene = load("");
    let corner = scene.camera.ray(Vec2::new(8.0, 0.0), Vec2::ZERO).dir;
    // 90 degrees across, half as much of the tangent upwards.
    assert!((corner - Vec3::new(1.0, 0.5, -1.0).normalize()).length() < 1e-6);
    for (axis, tan_half_x) in [("x", 1.0), ("y", 2.0), ("smaller", 2.0), ("larger", 1.0)] {
        let text = VIEW.replace("fov = 90", &format!("fov = 90, fov_axis = \"{axis}\""));
        assert!((load_with(&text, &[]).camera.tan_half_fov_x - tan_half_x).abs() < 1e-6);
    }
}

/// Geometric normals at the near side of things, seen from the camera on +z.
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
        (
            "type = \"cylinder\"\np1 = [1, 0, 0]\nflip_normals = true",
            0.1,
            -1.0,
        ),
        (
            &format!("type = \"cylinder\"\np1 = [1, 0, 0]\n{mirror}"),
            0.1,
            1.0,
        ),
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
        let instance = format!(
            "{VIEW}[[shapes]]\ntype = \"instances\"\nshape = {{ {inline} }}\ntransforms = [[]]"
        );
        for text in [alone, instance] {
            let scene = load_with(&text, &octahedron());
            let hit = hit(&scene, [x, 0.1, 4.0], down).unwrap();
            assert_eq!(hit.ng.z > 0.0, expected > 0.0, "{text}");
            assert!(hit.ns.dot(hit.ng) > 0.0);
        }
    }
}

/// An instance is where, and what, the same shape with the same transform is; mirrored and stretched ones too.
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
            let aim = target
                + Vec3::new((i % 20) as f32 - 9.7, (i / 20) as f32 - 9.6, 0.0) * (0.05 * size);
            let ray = Ray {
                origin: Vec3::ZERO,
                dir: aim.normalize(),
            };
            let one = objects.intersect(&a.objects, &ray, f32::INFINITY, |_| false);
            let two = instance.intersect(&b.objects, &ray, f32::INFINITY, |_| false);
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

/// Moved as a whole by 100 km, a scene of a metre is the same in render space.
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
                Shape::Sphere { placement, .. }
                | Shape::Disc { placement, .. }
                | Shape::Cylinder { placement, .. } => {
                    points.push(placement.render_from_object.transform_point3(Vec3::X));
                }
                Shape::Mesh { mesh, placement } => {
                    let place = |p: &Vec3| placement.render_from_object.transform_point3(*p);
                    points.extend(mesh.positions.iter().map(place));
                }
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

/// `power` is what the light then emits.
#[test]
fn powers_are_kept() {
    let turn = "{ rotate = { axis = [1, 1, 0], angle = 25 } }";
    let shapes = [
        "type = \"rectangle\"",
        "type = \"cube\"",
        "type = \"disc\"",
        "type = \"cylinder\"\np0 = [1, 0, 2]\np1 = [1, 1, 3]\nradius = 0.25",
        "type = \"sphere\"\nradius = 0.25",
        "type = \"mesh\"\nfile = \"octahedron.obj\"",
    ];
    let mut texts = Vec::new();
    for shape in shapes {
        for scale in ["3", "[0.5, 2, -1]"] {
            texts.push(format!(
                "[[shapes]]\n{shape}\nemission = {{ power = [1, 2, 3] }}\ntransform = [{{ scale = {scale} }}, {turn}]"
            ));
        }
    }
    texts.push("[[lights]]\ntype = \"point\"\nposition = [1, 2, 3]\npower = [1, 2, 3]".to_string());
    for angles in [
        "",
        "cutoff_angle = 2\nbeam_width = 0",
        "cutoff_angle = 170\nbeam_width = 169",
    ] {
        texts.push(format!(
            "[[lights]]\ntype = \"spot\"\nposition = [1, 2, 3]\ntarget = [0, 0, 0]\npower = [1, 2, 3]\n{angles}"
        ));
    }
    for text in texts {
        let scene = load_with(&format!("{VIEW}{text}"), &octahedron());
        let power = scene.lights[0].power(&scene.objects, &scene.bounds);
        let error = (power / Rgb::new(1.0, 2.0, 3.0) - 1.0).abs().max_element();
        assert!(error < 1e-4, "{text}: {power}");
    }
    // A square of 2 x 2 under a scale of 3: 36 units squared.
    let scene = load(
        "[[shapes]]\ntype = \"rectangle\"\nemission = { power = 1 }\ntransform = [{ scale = 3 }]",
    );
    match scene.lights[0].kind {
        LightKind::Area { radiance, .. } => assert!((radiance.x * 36.0 * PI - 1.0).abs() < 1e-6),
        _ => unreachable!(),
    }
}

#[test]
fn lights_that_are_off_are_no_lights() {
    let scene = load(
        "[[lights]]\ntype = \"point\"\nposition = [0, 0, 0]\npower = 0
        [[lights]]\ntype = \"environment\"\nradiance = 0
        [[shapes]]\ntype = \"sphere\"\nemission = { radiance = 0 }",
    );
    assert!(scene.lights.is_empty());
    assert_eq!(scene.objects[0].light, None);
}

/// Mitsuba 3's `envmap`: the middle of the image looks towards +z, a quarter to the right of its left edge is +x, the
/// top is +y. Turning it by +90 degrees around +y takes +z to +x.
#[test]
fn environment_stands_as_in_mitsuba() {
    let (width, height) = (64, 33);
    // Red grows to the right, green downwards.
    let pixel = |x: usize, y: usize| (x as f32, y as f32, 0.0);
    let path = tempfile::NamedTempFile::with_suffix(".exr").unwrap();
    exr::prelude::write_rgb_file(path.path(), width, height, pixel).unwrap();
    let assets = [("sky.exr", std::fs::read(path.path()).unwrap())];
    let radiance = |fields: &str, dir: Vec3| {
        let text =
            format!("{VIEW}[[lights]]\ntype = \"environment\"\nimage = \"sky.exr\"\n{fields}");
        match &load_with(&text, &assets).lights[0].kind {
            LightKind::Environment(environment) => environment.radiance(dir),
            _ => unreachable!(),
        }
    };
    // Pixel centres lie at (i + 1/2) / 64: u = 1/4 is at 15.5.
    for (dir, column) in [(Vec3::X, 15.5), (Vec3::Z, 31.5), (Vec3::NEG_X, 47.5)] {
        let found = radiance("", dir);
        assert!(
            (found - Rgb::new(column, 16.0, 0.0)).abs().max_element() < 1e-3,
            "{dir}: {found}"
        );
    }
    assert!(radiance("", Vec3::Y).y < 1e-3);
    assert!(radiance("", Vec3::NEG_Y).y > 31.9);
    let turned = radiance("rotate_y = 90\nscale = 2", Vec3::X);
    assert!(
        (turned - Rgb::new(63.0, 32.0, 0.0)).abs().max_element() < 1e-3,
        "{turned}"
    );
}

/// Towards these directions, before they have unit length, ...
const DIRECTIONS: [[f32; 3]; 6] = [
    [1.0, 2.0, -0.5],
    [-0.3, -1.0, 0.8],
    [0.9, 0.1, 0.2],
    [-0.6, 0.4, -0.7],
    [0.2, -0.3, -1.0],
    [-1.0, 0.05, 0.3],
];

/// ... Mitsuba 3.9.1's `envmap` of 8 x 5 pixels, (x / 8, y / 8, ((3 x + 5 y) mod 7) / 8), with these `to_world`.
#[rustfmt::skip]
const MITSUBA_SKIES: [(&str, [[f32; 3]; 6]); 4] = [
    ("{ rotate = { axis = [1, 2, 3], angle = 50 } }", [ // of unit length for Mitsuba
        [0.18357, 0.1971, 0.42473], [0.60952, 0.28534, 0.41352], [0.3132, 0.3136, 0.3124],
        [0.31946, 0.18737, 0.50026], [0.06097, 0.3632, 0.1486], [0.73515, 0.13161, 0.29616],
    ]),
    ("{ scale = [-1, 1, 1] }, { rotate = { axis = [0, 1, 0], angle = 30 } }", [
        [0.67796, 0.08113, 0.44892], [0.29707, 0.38747, 0.17068], [0.56936, 0.2328, 0.36748],
        [0.23136, 0.18485, 0.5053], [0.82275, 0.29553, 0.26042], [0.15055, 0.24238, 0.6206],
    ]),
    ("{ look_at = { origin = [1, 2, 3], target = [2, 1, 0], up = [0, 1, 0] } }", [
        [0.65751, 0.05712, 0.40414], [0.36885, 0.43616, 0.43081], [0.67705, 0.22866, 0.33447],
        [0.25072, 0.16263, 0.42338], [0.41851, 0.24714, 0.44363], [0.09152, 0.27038, 0.60881],
    ]),
    ("{ matrix = [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, -1, 7], [0, 0, 0, 1]] }", [
        [0.26129, 0.08113, 0.54258], [0.8372, 0.38747, 0.18735], [0.1527, 0.2328, 0.5799],
        [0.55028, 0.18485, 0.40615], [0.40608, 0.29553, 0.48886], [0.73389, 0.24238, 0.07969],
    ]),
];

#[test]
fn environments_turn_as_mitsubas() {
    let pixel = |x: usize, y: usize| {
        let blue = (3 * x + 5 * y) % 7;
        (x as f32 / 8.0, y as f32 / 8.0, blue as f32 / 8.0)
    };
    let path = tempfile::NamedTempFile::with_suffix(".exr").unwrap();
    exr::prelude::write_rgb_file(path.path(), 8, 5, pixel).unwrap();
    let assets = [("sky.exr", std::fs::read(path.path()).unwrap())];
    for (steps, values) in MITSUBA_SKIES {
        let text = format!(
            "{VIEW}[[lights]]\ntype = \"environment\"\nimage = \"sky.exr\"\ntransform = [{steps}]"
        );
        let scene = load_with(&text, &assets);
        let LightKind::Environment(sky) = &scene.lights[0].kind else {
            unreachable!();
        };
        for (dir, expected) in DIRECTIONS.into_iter().zip(values) {
            let dir = Vec3::from(dir).normalize();
            let found = sky.radiance(dir);
            assert!(
                (found - Rgb::from(expected)).abs().max_element() < 2e-5,
                "{steps} towards {dir}: {found}, not {expected:?}"
            );
            // Samples of it are of it.
            let sample = sky.sample(Vec2::new(dir.x.abs(), dir.y.abs()));
            assert!((sample.dir.length() - 1.0).abs() < 1e-6);
            assert!((sky.pdf(sample.dir) / sample.pdf - 1.0).abs() < 1e-3);
        }
    }
}

#[test]
fn bundles_hold_every_file_and_load_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.toml");
    std::fs::create_dir(folder.path().join("meshes")).unwrap();
    std::fs::write(folder.path().join("meshes/octahedron.obj"), OCTAHEDRON).unwrap();
    let text = format!(
        "{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"meshes/octahedron.obj\"
        [[shapes]]\ntype = \"instances\"\nshape = {{ type = \"mesh\", file = \"meshes/octahedron.obj\" }}\ntransforms = [[]]"
    );
    std::fs::write(&path, &text).unwrap();
    let bundle = read_bundle(&path).unwrap();
    assert_eq!(bundle.scene, "room.toml");
    let keys: Vec<&String> = bundle.files.keys().collect();
    assert_eq!(keys, ["meshes/octahedron.obj", "room.toml"]);
    assert_eq!(SceneDescription::load(&bundle).unwrap().objects.len(), 2);
    // The bundle is all there is to the scene: its hash changes with an asset.
    let before = bundle.hash();
    std::fs::write(
        folder.path().join("meshes/octahedron.obj"),
        OCTAHEDRON.replace("11", "12"),
    )
    .unwrap();
    assert_ne!(read_bundle(&path).unwrap().hash(), before);
}

/// All that can be hit, and the camera, lie inside the bounds; for one ball at the camera's place they fit closely.
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

/// Damaged scenes are refused or mean something else; none makes the reader panic.
#[test]
fn damage_does_not_panic() {
    let numbers = [
        "-1",
        "0",
        "1e-300",
        "1e300",
        "nan",
        "-inf",
        "9223372036854775807",
        "\"x\"",
        "[]",
        "{}",
    ];
    for copy in 0..3000 {
        let mut rng = Sampler::new(1, 0, Purpose::Test, copy);
        let mut below = |n: usize| rng.next_u32() as usize % n;
        let mut words: Vec<&str> = EVERY_FIELD.split_inclusive([' ', '\n', ',']).collect();
        for _ in 0..=below(3) {
            let at = below(words.len());
            match below(4) {
                0 => drop(words.remove(at)),
                1 => words.swap(at, at / 2),
                _ => words[at] = numbers[below(numbers.len())],
            }
        }
        let mut files: BTreeMap<_, _> = every_file().map(|(n, b)| (n.to_string(), b)).into();
        files.insert("scene.toml".to_string(), words.concat().into_bytes());
        let scene = "scene.toml".to_string();
        if let Err(error) = SceneDescription::load(&Bundle { scene, files }) {
            assert!(!error.message.is_empty());
        }
    }
}

/// A box of walls that are instances gets the ball through its corners, whatever its walls are made of.
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
