//! Rays with arbitrary numbers: each query ends, and none panics.

use beamfarm_harness::render::scene_with;
use beamfarm_render::math::{Ray, Vec3};
use std::fmt::Write;

const VIEW: &str = "image = { width = 4, height = 4 }\ncamera = { origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }\n\
    lights = [{ type = \"point\", position = [0, 7, 0], power = 9 }]\n";
const TURNED: &str = "transform = [{ scale = [1, 0.5, 2] }, { rotate = { axis = [1, 2, 3], angle = 40 } }]\n";

/// NaN, infinities, zeros, and the smallest and largest numbers.
const STRANGE: [f32; 16] = [
    0.0,
    -0.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::from_bits(1),
    -f32::from_bits(1),
    f32::MIN_POSITIVE,
    f32::EPSILON,
    1e-30,
    1e30,
    -1e30,
    f32::MAX,
    f32::MIN,
    1.0,
    -1.0,
];

/// One of those, an ordinary one, or arbitrary bits.
fn number(seed: &mut u64) -> f32 {
    // Steele, Lea and Flood 2014, SplitMix64.
    *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (*seed ^ *seed >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    let bits = (mixed ^ mixed >> 31) as u32;
    match bits % 3 {
        0 => STRANGE[(bits >> 8) as usize % STRANGE.len()],
        1 => (bits >> 8) as f32 / (1 << 22) as f32 - 2.0,
        _ => f32::from_bits((mixed >> 32) as u32),
    }
}

/// A grid of triangles, so that trees have levels, and one triangle far away.
fn grid() -> String {
    let mut text = String::new();
    for (x, y) in (0..12).flat_map(|x| (0..12).map(move |y| (x, y))) {
        let (x, y) = (f64::from(x) / 6.0 - 1.0, f64::from(y) / 6.0 - 1.0);
        let _ = write!(
            text,
            "v {x} {y} {}\nv {} {y} 0\nv {x} {} 0\nf -3 -2 -1\n",
            x * y,
            x + 0.1,
            y + 0.1
        );
    }
    text + "v 1e6 0 0\nv 1e6 1 0\nv 1e6 0 1\nf -3 -2 -1\n"
}

#[test]
fn no_ray_is_too_strange() {
    let mut text = VIEW.to_owned();
    let sphere = "type = \"sphere\"\ncenter = [0.2, 0.1, 0]\nradius = 0.5\n";
    let cylinder = "type = \"cylinder\"\np0 = [0, -1, 0]\np1 = [0, 1, 0.5]\nradius = 0.3\n";
    let others = ["rectangle", "cube", "disc"].map(|kind| format!("type = \"{kind}\"\n"));
    let mesh = "type = \"mesh\"\nfile = \"grid.obj\"\n";
    let all = [sphere, cylinder, mesh]
        .into_iter()
        .chain(others.iter().map(String::as_str));
    for shape in all {
        let _ = write!(text, "[[shapes]]\n{shape}[[shapes]]\n{shape}{TURNED}");
    }
    let _ = write!(
        text,
        "[[shapes]]\ntype = \"instances\"\nshape = {{ type = \"mesh\", file = \"grid.obj\" }}\n\
         transforms = [[{{ translate = [3, 0, 0] }}], [{{ scale = 1e-3 }}], [{{ scale = 1e3 }}]]\n"
    );
    // The grid, and its parts alone: trees of one leaf, and empty ones.
    let grid = grid();
    let assets = [("grid.obj", grid.as_bytes())];
    let texts = [
        text,
        format!("{VIEW}[[shapes]]\n{mesh}"),
        format!("{VIEW}[[shapes]]\n{sphere}"),
        VIEW.to_owned(),
    ];
    for text in texts {
        let scene = scene_with(&text, &assets);
        let objects = &scene.description().objects;
        let mut seed = 47;
        for _ in 0..5000 {
            let [origin, dir] = [(); 2].map(|()| Vec3::from_array([(); 3].map(|()| number(&mut seed))));
            let (ray, t_max) = (Ray { origin, dir }, number(&mut seed));
            for passes in [false, true] {
                let hit = scene.geometry().intersect(objects, &ray, t_max, &|_| passes);
                assert!(hit.is_none() || !passes);
                // Hits lie on the ray, in front of its origin.
                assert!(hit.is_none_or(|hit| hit.t > 0.0 && hit.t < t_max), "{ray:?}, {t_max}");
                scene.geometry().occluded(objects, &ray, t_max, &|_| passes);
            }
            scene.first_hit(&ray, |_| false);
            scene.seen_at(origin.x, dir.x);
        }
        for x in [1e39, -1e39, 1e308, f64::NAN, f64::INFINITY] {
            assert!(scene.seen_at(x as f32, 0.5).is_none());
            assert!(scene.seen_at(0.5, x as f32).is_none());
        }
    }
}
