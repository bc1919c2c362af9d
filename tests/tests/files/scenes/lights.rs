//! Lights: powers, and the orientation of environments.

use crate::files::scenes::setup::{VIEW, load, load_with, octahedron};
use beamfarm_render::math::{PI, Rgb, Vec2, Vec3};
use beamfarm_render::world::light::{LightKind, Ramp};

/// The light emits its `power`.
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
        "cutoff_angle = 170\nbeam_width = 30\nfalloff = \"smooth\"\nradius = 0.25",
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
    let scene = load("[[shapes]]\ntype = \"rectangle\"\nemission = { power = 1 }\ntransform = [{ scale = 3 }]");
    match scene.lights[0].kind {
        LightKind::Area { radiance, .. } => assert!((radiance.x * 36.0 * PI - 1.0).abs() < 1e-6),
        _ => unreachable!(),
    }
}

/// A radius is in scene units, an angle is the full one, and both default to zero. The bounds contain the lights'
/// shapes.
#[test]
fn sizes_of_lights_are_read() {
    let spot = "[[lights]]\ntype = \"spot\"\nposition = [7, 2, 3]\ntarget = [0, 0, 0]\npower = 1\n";
    let sun = "[[lights]]\ntype = \"directional\"\ndirection = [0, 0, 1]\nirradiance = 1\n";
    for (more, radius, ramp) in [
        ("", 0.0, Ramp::Linear),
        ("radius = 0", 0.0, Ramp::Linear),
        ("radius = 1e-30\nfalloff = \"linear\"", 0.0, Ramp::Linear),
        ("radius = 1.5\nfalloff = \"smooth\"", 1.5, Ramp::Smooth),
    ] {
        let scene = load(&format!("{spot}{more}"));
        let LightKind::Spot(found) = &scene.lights[0].kind else {
            panic!("{:?}", scene.lights);
        };
        assert_eq!((found.radius, found.ramp), (radius, ramp), "{more}");
        let farthest = found.position + Vec3::X * radius;
        assert!(farthest.distance(scene.bounds.center) <= scene.bounds.radius, "{more}");
    }
    for (more, half) in [
        ("", 0.0f32),
        ("angle = 0", 0.0),
        ("angle = 0.5", 0.25),
        ("angle = 179", 89.5),
    ] {
        let scene = load(&format!("{sun}{more}"));
        let LightKind::Directional(found) = &scene.lights[0].kind else {
            panic!("{:?}", scene.lights);
        };
        assert!((found.half_angle - half.to_radians()).abs() < 1e-6, "{more}");
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

/// As in Mitsuba 3's `envmap`, the middle of the image looks towards +z, +x is a quarter of the width to the right of
/// its left edge, and the top is +y. Turning it by +90 degrees around +y takes +z to +x.
#[test]
fn environment_stands_as_in_mitsuba() {
    let (width, height) = (64, 33);
    // Red grows to the right, green downwards.
    let pixel = |x: usize, y: usize| (x as f32, y as f32, 0.0);
    let path = tempfile::NamedTempFile::with_suffix(".exr").unwrap();
    exr::prelude::write_rgb_file(path.path(), width, height, pixel).unwrap();
    let assets = [("sky.exr", std::fs::read(path.path()).unwrap())];
    let radiance = |fields: &str, dir: Vec3| {
        let text = format!("{VIEW}[[lights]]\ntype = \"environment\"\nimage = \"sky.exr\"\n{fields}");
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

/// Towards these directions, before they are normalised, ...
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
        let text = format!("{VIEW}[[lights]]\ntype = \"environment\"\nimage = \"sky.exr\"\ntransform = [{steps}]");
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
            // Its samples lie on it.
            let sample = sky.sample(Vec2::new(dir.x.abs(), dir.y.abs()));
            assert!((sample.dir.length() - 1.0).abs() < 1e-6);
            assert!((sky.pdf(sample.dir) / sample.pdf - 1.0).abs() < 1e-3);
        }
    }
}
