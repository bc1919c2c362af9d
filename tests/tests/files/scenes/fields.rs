//! What is read: every field, its default, every file, and nothing where the text is damaged.

use crate::files::scenes::setup::{OCTAHEDRON, VIEW, load, load_with, octahedron};
use beamfarm_harness::render::is_long;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::{EngineChoice, EngineKind};
use beamfarm_image::view::{View, ViewTransform};
use beamfarm_render::math::Rgb;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::geometry::{Boundary, Shape};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::texture::Texture;
use beamfarm_scene::read_bundle;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The files that `EVERY_FIELD` names.
fn every_file() -> [(&'static str, Vec<u8>); 3] {
    let [octahedron] = octahedron();
    let volume = include_bytes!("../../../data/volumes/several.vdb").to_vec();
    let image = include_bytes!("../../../data/mitsuba_renders/mask.png").to_vec();
    [octahedron, ("several.vdb", volume), ("grey.png", image)]
}

/// Every field of the format, combined validly.
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
white_balance = 3200
view = "agx"
radius = 0.02
targeting = "on"
media = "photons"
surfaces = "paths"
caustics = "paths"
engine = "gpu"
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
shape = { type = "mesh", file = "octahedron.obj", smooth = true, material = "g_mirror" }
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
falloff = "smooth"
radius = 0.1
"#;

#[test]
fn every_field_of_the_format_is_read() {
    let scene = load_with(EVERY_FIELD, &every_file());
    let d = scene.defaults;
    assert_eq!((d.passes, d.paths_per_pass, d.alpha, d.seed), (10, Some(1000), 0.5, 7));
    assert_eq!(d.radius, Some(0.02));
    let view = View {
        transform: ViewTransform::Agx,
        exposure: -1.5,
        white_balance: 3200.0,
    };
    assert_eq!(d.view, view);
    assert_eq!(d.schedule, beamfarm_image::job::ScheduleKind::Beam);
    assert_eq!(d.engine, EngineChoice::Is(EngineKind::Gpu));
    assert_eq!(scene.world_medium, Some(1));
    assert_eq!(scene.camera_medium, Some(None));
    assert_eq!((scene.camera.aperture, scene.camera.focus_distance), (0.1, 3.0));
    assert_eq!(scene.media[0].sigma_s(), Rgb::new(0.75, 1.5, 3.0));
    assert_eq!(scene.media[0].sigma_t(), Rgb::new(1.0, 2.0, 4.0));
    assert_eq!(scene.media[0].phase(), Phase::Isotropic);
    assert_eq!(scene.media[1].sigma_s(), Rgb::splat(0.4));
    assert_eq!(scene.media[1].phase(), Phase::HenyeyGreenstein { g: 0.7 });
    for (medium, scattered) in [(2, 0.4), (3, 1.8)] {
        assert!(matches!(scene.media[medium], Medium::Heterogeneous(_)));
        assert!((scene.media[medium].sigma_s() - scattered).abs().max_element() < 1e-6);
    }
    assert!(matches!(scene.materials[1].kind, MaterialKind::Dielectric { eta, .. } if eta == 1.25));
    let two_sided: Vec<bool> = scene.materials.iter().map(|m| m.two_sided).collect();
    // The last two stand for shapes without a material: black and grey.
    assert_eq!(two_sided[..8], [true, true, true, false, true, true, true, true]);
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
    assert_eq!(boundaries, [Some(ball), None, Some(clear), None, None, None, None]);
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
    assert!(matches!(scene.lights[2].kind, LightKind::Area { object: 1, .. }));
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
        (d.passes, d.paths_per_pass, d.seed, d.view),
        (64, None, 0, View::default())
    );
    assert_eq!((d.alpha, d.radius), (2.0 / 3.0, None));
    assert_eq!((scene.world_medium, scene.camera_medium), (None, None));
    assert_eq!((scene.camera.aperture, scene.camera.focus_distance), (0.0, 5.0));
    assert!(scene.bounds.radius > 0.0);
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
    assert_eq!(beamfarm_scene::load(&bundle).unwrap().objects.len(), 2);
    // The bundle is the whole scene: its hash changes with an asset.
    let before = bundle.hash();
    std::fs::write(
        folder.path().join("meshes/octahedron.obj"),
        OCTAHEDRON.replace("11", "12"),
    )
    .unwrap();
    assert_ne!(read_bundle(&path).unwrap().hash(), before);
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
    for copy in 0..if is_long() { 3000 } else { 1000 } {
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
        if let Err(error) = beamfarm_scene::load(&Bundle { scene, files }) {
            assert!(!error.message.is_empty());
        }
    }
}
