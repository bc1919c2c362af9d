//! Media with a density on a grid, rendered by passes and by the reference integrator, against a path tracer,
//! quadrature and homogeneous media.
//!
//! The tests compare means over blocks of pixels, whose standard errors come from the passes' own block means. Kernels
//! blur and lose a little light at edges, in proportion to their radius: scenes set a small one, and each comparison
//! allows a stated share of the expected value besides its errors.

use beamfarm_harness::Suite;
use beamfarm_harness::furnace::{closed_box, is_one, under_the_sky};
use beamfarm_harness::path_tracer::{Camera, Grid, Lamp, Room};
use beamfarm_harness::render::{Blocks, average, blocks, images, is_long, reference_images, scene_with};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::world::Scene;
use glam::{DAffine3, DQuat, DVec2, DVec3};
use std::f64::consts::PI;

const SIZE: usize = 24;
const BLOCK: usize = 4;
const VOL: &str = "lumps.vol";
const RESOLUTION: [usize; 3] = [6, 5, 7];
const SIGMA_A: [f64; 3] = [0.1, 0.4, 0.02];
const SIGMA_S: [f64; 3] = [0.5, 0.3, 0.9];
const G: f64 = 0.4;
const ESTIMATORS: [&str; 3] = [
    "\"ratio_tracking\"",
    "\"residual_ratio_tracking\"",
    "{ free_flights = 8 }",
];
const CAMERA: Camera = Camera {
    origin: DVec3::new(0.3, -0.2, 0.8),
    target: DVec3::new(-0.1, 0.1, -0.4),
    fov: 75.0,
    size: SIZE,
};

/// Samples from 0 to 4 that vary strongly between neighbours, a third of them zero, on a grid of [`RESOLUTION`].
fn lumps(to_world: DAffine3) -> Grid {
    let sample = |i: u32| {
        let mut x = (i + 1).wrapping_mul(0x9E37_79B9);
        x = (x ^ (x >> 15)).wrapping_mul(0x85EB_CA6B);
        x ^= x >> 13;
        if x.is_multiple_of(3) {
            0.0
        } else {
            (x >> 8) as f32 / (1 << 24) as f32 * 4.0
        }
    };
    let count: usize = RESOLUTION.iter().product();
    Grid::new(RESOLUTION, (0..count as u32).map(sample).collect(), to_world)
}

/// Placement of a unit cube: its size, its rotation angle, its centre.
fn placed(size: DVec3, degrees: f64, center: DVec3) -> DAffine3 {
    let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
    DAffine3::from_translation(center)
        * DAffine3::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()))
        * DAffine3::from_scale(size)
        * DAffine3::from_translation(DVec3::splat(-0.5))
}

/// The cube [-1, 1]^3.
fn cube() -> DAffine3 {
    placed(DVec3::splat(2.0), 0.0, DVec3::ZERO)
}

fn steps(map: DAffine3) -> String {
    let row = |i: usize| {
        let m = map.matrix3.row(i);
        [m.x, m.y, m.z, map.translation[i]]
    };
    let (x, y, z) = (row(0), row(1), row(2));
    format!("[ {{ matrix = [{x:?}, {y:?}, {z:?}, [0, 0, 0, 1]] }} ]")
}

fn head(camera: &Camera, passes: usize, paths: usize) -> String {
    format!(
        r#"
[image]
width = {SIZE}
height = {SIZE}
[render]
passes = {passes}
paths = {paths}
radius = 0.02
seed = 17
[camera]
origin = {:?}
target = {:?}
fov = {}
"#,
        camera.origin.to_array(),
        camera.target.to_array(),
        camera.fov,
    )
}

const EVERYWHERE: &str = r#"
[world]
medium = "smoke"
"#;

/// The medium "smoke" with these coefficients at density 1.
fn smoke(sigma_a: [f64; 3], sigma_s: [f64; 3], rest: &str) -> String {
    format!(
        r#"
[media.smoke]
sigma_a = {sigma_a:?}
sigma_s = {sigma_s:?}
phase = {{ type = "hg", g = {G} }}
{rest}
"#
    )
}

/// Fields of a medium whose density is [`VOL`].
fn of_file(to_world: DAffine3, rest: &str) -> String {
    let transform = steps(to_world);
    format!("type = \"heterogeneous\"\ndensity = {{ file = \"{VOL}\" }}\ntransform = {transform}\n{rest}")
}

/// The walls of the cube [-1, 1]^3, in the path tracer's order.
fn walls(reflectances: [[f64; 3]; 6], rest: &str) -> String {
    // Axis and angle that turn +z inwards.
    let turns = [
        ([0, 1, 0], 90),
        ([0, 1, 0], -90),
        ([1, 0, 0], -90),
        ([1, 0, 0], 90),
        ([0, 1, 0], 0),
        ([0, 1, 0], 180),
    ];
    let wall = |(wall, (axis, angle)): (usize, ([i32; 3], i32))| {
        let reflectance = reflectances[wall];
        let mut center = [0, 0, 0];
        center[wall / 2] = [-1, 1][wall % 2];
        format!(
            r#"
[materials.wall{wall}]
type = "diffuse"
reflectance = {reflectance:?}
[[shapes]]
type = "rectangle"
material = "wall{wall}"
transform = [ {{ rotate = {{ axis = {axis:?}, angle = {angle} }} }}, {{ translate = {center:?} }} ]
{rest}
"#
        )
    };
    turns.into_iter().enumerate().map(wall).collect()
}

/// Walls and lamp.
fn furniture(room: &Room) -> String {
    format!(
        r#"
{}
[[shapes]]
type = "sphere"
center = {:?}
radius = {}
emission = {{ radiance = {:?} }}
"#,
        walls(room.walls, ""),
        room.lamp.center.to_array(),
        room.lamp.radius,
        room.lamp.radiance,
    )
}

fn lit_room(grid: Grid) -> Room {
    Room {
        walls: [
            [0.7, 0.2, 0.2],
            [0.2, 0.6, 0.3],
            [0.5, 0.5, 0.5],
            [0.6, 0.6, 0.4],
            [0.3, 0.4, 0.7],
            [0.5, 0.3, 0.4],
        ],
        sigma_a: SIGMA_A,
        sigma_s: SIGMA_S,
        phase: vec![(1.0, G)],
        grid,
        albedo: None,
        lamp: Lamp {
            center: DVec3::new(-0.45, 0.5, -0.3),
            radius: 0.15,
            radiance: [20.0, 15.0, 10.0],
        },
        camera: CAMERA,
    }
}

/// What the reference integrator renders.
fn reference(scene: &Scene) -> Blocks {
    let settings = ReferenceSettings::default();
    Blocks::new(reference_images(scene, settings, 64, 8), BLOCK)
}

#[test]
fn a_room_of_lumpy_smoke_is_what_a_path_tracer_sees() {
    // The grid does not quite fill the room, so its border is inside.
    let (size, center) = (DVec3::new(2.4, 2.0, 2.2), DVec3::new(0.1, -0.05, 0.05));
    let to_world = placed(size, 25.0, center);
    let room = lit_room(lumps(to_world));
    let expected = Blocks::new(room.images(images(2000), 1).into_iter(), BLOCK);
    // Significance 1e-3 for all images; 0.5 % for kernels.
    let mut suite = Suite::new(1e-3);
    let estimators = ["", "transmittance = \"ratio_tracking\""];
    // The first is also that of the cloud below.
    for estimator in &estimators[usize::from(!is_long())..] {
        let text = [
            &head(&CAMERA, 180, 8000),
            EVERYWHERE,
            &smoke(SIGMA_A, SIGMA_S, &of_file(to_world, estimator)),
            &furniture(&room),
        ];
        let scene = scene_with(&text.map(String::from).concat(), &[(VOL, &room.grid.vol())]);
        let got = blocks(&scene, BLOCK);
        suite.same_blocks(estimator, &got, &expected, 0.005);
        let name = format!("reference {estimator}");
        suite.same_blocks(&name, &reference(&scene), &expected, 0.0);
    }
    suite.finish();
}

#[test]
fn a_cloud_in_a_cube_is_what_a_path_tracer_sees() {
    // An index-matched glass boundary with vacuum around it; the cube is rotated, and the light is outside.
    let center = DVec3::new(0.15, -0.1, -0.1);
    let to_world = placed(DVec3::new(1.1, 0.9, 1.0), 40.0, center);
    let room = Room {
        phase: vec![(0.7, -0.5), (0.3, 0.6)],
        ..lit_room(lumps(to_world))
    };
    let expected = Blocks::new(room.images(images(800), 2).into_iter(), BLOCK);
    // The shape spans [-1, 1]^3, the density the unit cube.
    let boundary = to_world * DAffine3::from_translation(DVec3::splat(0.5)) * DAffine3::from_scale(DVec3::splat(0.5));
    let cube = format!(
        r#"
[materials.boundary]
type = "null"
[[shapes]]
type = "cube"
material = "boundary"
interior = "smoke"
transform = {}
"#,
        steps(boundary)
    );
    let text = head(&CAMERA, 100, 8000)
        + &smoke(SIGMA_A, SIGMA_S, &of_file(to_world, "")).replace(
            &format!("phase = {{ type = \"hg\", g = {G} }}"),
            "phase = { type = \"blend\", weight = 0.3, phases = [{ type = \"hg\", g = -0.5 }, { type = \"hg\", g = 0.6 }] }",
        )
        + &furniture(&room)
        + &cube;
    let scene = scene_with(&text, &[(VOL, &room.grid.vol())]);
    // Significance 1e-3; 0.5 % for kernels.
    let mut suite = Suite::new(1e-3);
    suite.same_blocks("cloud", &blocks(&scene, BLOCK), &expected, 0.005);
    suite.same_blocks("cloud, reference", &reference(&scene), &expected, 0.0);
    suite.finish();
}

#[test]
fn smoke_of_many_colours_is_what_a_path_tracer_sees() {
    let to_world = placed(DVec3::new(2.4, 2.0, 2.2), 25.0, DVec3::new(0.1, -0.05, 0.05));
    // Coarser than the density; red scatters on one side, blue on the other.
    let albedo = [0, 1, 2].map(|c| {
        let sample = |i: usize| [1.0f32, 0.6, 0.1, 0.9, 0.0][(i + i / 3 + 2 * c) % 5];
        Grid::new([3, 2, 4], (0..24).map(sample).collect(), to_world)
    });
    let file = Grid::vol_of(&albedo.each_ref());
    let room = Room {
        sigma_a: [0.0; 3],
        sigma_s: [0.9; 3],
        albedo: Some(albedo),
        ..lit_room(lumps(to_world))
    };
    let expected = Blocks::new(room.images(images(2000), 3).into_iter(), BLOCK);
    let text = [
        &head(&CAMERA, 180, 8000),
        EVERYWHERE,
        &format!(
            "[media.smoke]\nsigma_t = 0.9\nalbedo = {{ file = \"colours.vol\" }}\nphase = {{ type = \"hg\", g = {G} }}\n"
        ),
        &of_file(to_world, ""),
        &furniture(&room),
    ];
    let assets: [(&str, &[u8]); 2] = [(VOL, &room.grid.vol()), ("colours.vol", &file)];
    let scene = scene_with(&text.map(String::from).concat(), &assets);
    // Significance 1e-3 for all images; 0.5 % for kernels.
    let mut suite = Suite::new(1e-3);
    suite.same_blocks("colours", &blocks(&scene, BLOCK), &expected, 0.005);
    suite.same_blocks("colours, reference", &reference(&scene), &expected, 0.0);
    suite.finish();
}

/// An albedo of one half everywhere, in one channel, in three or as a graph, gives the bits of the colour one half.
#[test]
fn an_albedo_of_one_value_is_a_colour() {
    let room = lit_room(lumps(cube()));
    let halves = Grid::new([3, 2, 4], vec![0.5; 24], cube());
    let hash = |albedo: &str, file: &[u8]| {
        let text = head(&CAMERA, 4, 2000)
            + EVERYWHERE
            + "[textures.half]\nnode = \"math\"\noperation = \"add\"\na = 0.3\nb = 0.2\n"
            + &format!("[media.smoke]\nsigma_t = [0.6, 0.7, 0.9]\nalbedo = {albedo}\n")
            + &of_file(cube(), "")
            + &furniture(&room);
        let scene = scene_with(&text, &[(VOL, &room.grid.vol()), ("a.vol", file)]);
        pixel_hash(&average(&scene).beauty)
    };
    let color = hash("0.5", b"");
    assert_eq!(hash("{ file = \"a.vol\" }", &halves.vol()), color);
    let three = Grid::vol_of(&[&halves; 3]);
    assert_eq!(hash("{ file = \"a.vol\" }", &three), color);
    assert_eq!(hash("{ texture = \"half\" }", b""), color);
}

#[test]
fn constant_density_is_a_homogeneous_medium() {
    let room = lit_room(lumps(cube()));
    let image = |seed: usize, medium: &str, assets: &[(&str, &[u8])]| {
        let text = head(&CAMERA, 40, 5000).replace("seed = 17", &format!("seed = {seed}"))
            + EVERYWHERE
            + &smoke(SIGMA_A, SIGMA_S, medium)
            + &furniture(&room);
        blocks(&scene_with(&text, assets), BLOCK)
    };
    // Significance 1e-3 for all of them; the blur of kernels is the same in both.
    let mut suite = Suite::new(1e-3);
    let expected = image(1, "type = \"homogeneous\"", &[]);
    let recipe = "type = \"heterogeneous\"\ndensity = { min = [-1, -1, -1], max = [1, 1, 1] }\ntransmittance = ";
    for (i, estimator) in ESTIMATORS.into_iter().enumerate() {
        let got = image(2 + i, &format!("{recipe}{estimator}"), &[]);
        suite.same_blocks(estimator, &got, &expected, 0.0);
    }
    // The file says 2, the scene half of that.
    let twos = Grid::new([3, 2, 4], vec![2.0; 24], cube());
    let got = image(9, &of_file(cube(), "scale = 0.5"), &[(VOL, &twos.vol())]);
    suite.same_blocks("file", &got, &expected, 0.0);
    suite.finish();
}

/// Only the wall at z = -1.
const FACING: Camera = Camera {
    origin: DVec3::new(0.1, -0.15, 0.85),
    target: DVec3::new(-0.05, 0.05, -1.0),
    fov: 45.0,
    size: SIZE,
};

/// Block means of the radiance of points of the wall at z = -1, by quadrature with 6 x 6 points per pixel.
fn seen(radiance: impl Fn(DVec3, usize) -> f64) -> Vec<[f64; 3]> {
    const POINTS: usize = 6;
    let side = BLOCK * POINTS;
    let columns = SIZE / BLOCK;
    let mut means = vec![[0.0; 3]; columns * columns];
    for (block, mean) in means.iter_mut().enumerate() {
        for i in 0..side * side {
            let x = (block % columns * side + i % side) as f64 + 0.5;
            let y = (block / columns * side + i / side) as f64 + 0.5;
            let dir = FACING.direction(DVec2::new(x, y) / POINTS as f64);
            let point = FACING.origin + dir * ((-1.0 - FACING.origin.z) / dir.z);
            assert!(point.x.abs() < 1.0 && point.y.abs() < 1.0);
            for (c, mean) in mean.iter_mut().enumerate() {
                *mean += radiance(point, c) / (side * side) as f64;
            }
        }
    }
    means
}

/// The smoke only absorbs: every estimator's image is the quadrature's.
fn absorbed(name: &str, passes: usize, rest: &str, radiance: impl Fn(DVec3, usize) -> f64) {
    let to_world = absorbing_place();
    let file = lumps(to_world).vol();
    let expected = seen(radiance);
    // Significance 1e-3 for all of them; 1e-4 for rounding and quadrature.
    let mut suite = Suite::new(1e-3);
    for estimator in ESTIMATORS {
        let medium = of_file(to_world, &format!("transmittance = {estimator}"));
        let text = head(&FACING, passes, 1) + EVERYWHERE + &smoke(ABSORBING, [0.0; 3], &medium) + rest;
        let got = blocks(&scene_with(&text, &[(VOL, &file)]), BLOCK);
        for (i, (got, expected)) in got.blocks.iter().zip(&expected).enumerate() {
            for c in 0..3 {
                let name = format!("{name}, {estimator}, block {i}, channel {c}");
                suite.mean_within(name, &got[c], expected[c], 1e-4);
            }
        }
    }
    suite.finish();
}

const ABSORBING: [f64; 3] = [0.3, 0.8, 0.1];

fn absorbing_place() -> DAffine3 {
    placed(DVec3::new(1.8, 1.6, 1.9), 30.0, DVec3::new(0.0, 0.1, -0.05))
}

#[test]
fn a_glowing_wall_behind_smoke_that_absorbs() {
    const RADIANCE: [f64; 3] = [1.0, 2.0, 0.5];
    let grid = lumps(absorbing_place());
    let glowing = walls([[0.0; 3]; 6], &format!("emission = {{ radiance = {RADIANCE:?} }}"));
    absorbed("glowing wall", 800, &glowing, |point, c| {
        RADIANCE[c] * libm::exp(-ABSORBING[c] * grid.depth(FACING.origin, point))
    });
}

#[test]
fn a_wall_lit_through_smoke_that_absorbs() {
    const LIGHT: DVec3 = DVec3::new(0.5, 0.6, 0.3);
    const INTENSITY: [f64; 3] = [3.0, 2.0, 5.0];
    const REFLECTANCE: [f64; 3] = [0.8, 0.5, 0.3];
    let grid = lumps(absorbing_place());
    let mut reflectances = [[0.0; 3]; 6];
    reflectances[4] = REFLECTANCE;
    let lit = format!(
        r#"
{}
[[lights]]
type = "point"
position = {:?}
intensity = {INTENSITY:?}
"#,
        walls(reflectances, ""),
        LIGHT.to_array()
    );
    absorbed("lit wall", 600, &lit, |point, c| {
        let to_light = LIGHT - point;
        let distance = to_light.length();
        let cos = to_light.z / distance;
        let depth = grid.depth(point, LIGHT) + grid.depth(FACING.origin, point);
        REFLECTANCE[c] / PI * INTENSITY[c] * cos / (distance * distance) * libm::exp(-ABSORBING[c] * depth)
    });
}

#[test]
fn furnaces_with_lumpy_smoke() {
    let sigma_s = [0.5, 0.9, 0.2];
    let file = lumps(cube()).vol();
    let medium = smoke([0.0; 3], sigma_s, &of_file(cube(), ""));
    let inside = format!("{EVERYWHERE}{medium}");
    let mut suite = Suite::new(1e-3);
    is_one(&mut suite, "room", &closed_box(0.5, &inside), &[(VOL, &file)], 24);
    for shape in ["sphere", "cube"] {
        let cloud = format!(
            r#"
{medium}
[materials.boundary]
type = "null"
[[shapes]]
type = "{shape}"
material = "boundary"
interior = "smoke"
"#
        );
        is_one(&mut suite, shape, &under_the_sky(&cloud), &[(VOL, &file)], 24);
    }
    suite.finish();
}
