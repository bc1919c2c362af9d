//! Images of media whose density is given on a grid, against a path tracer, quadrature and homogeneous media.
//!
//! Compared are means over blocks of pixels, whose standard errors come from the passes' own block means. Kernels blur and
//! lose a little light at edges, in proportion to their radius: scenes name a small one, and each comparison allows for a
//! stated share of the expected value besides its errors.

use beamfarm_tests::furnace::{closed_box, is_one, under_the_sky};
use beamfarm_tests::path_tracer::{Camera, Grid, Lamp, Room};
use beamfarm_tests::render::{block_means, scene, scene_with};
use beamfarm_tests::z_test::two_sided;
use beamfarm_tests::{MeanEstimate, Suite};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use std::f64::consts::PI;

const SIZE: usize = 24;
const BLOCK: usize = 4;

/// Samples that vary a lot between neighbours; a third of them are zero.
fn lumps(resolution: [usize; 3]) -> Vec<f32> {
    (0..resolution.iter().product::<usize>() as u32)
        .map(|i| {
            let mut x = (i + 1).wrapping_mul(0x9E37_79B9);
            x = (x ^ (x >> 15)).wrapping_mul(0x85EB_CA6B);
            x ^= x >> 13;
            if x % 3 == 0 {
                0.0
            } else {
                (x >> 8) as f32 / (1 << 24) as f32 * 4.0
            }
        })
        .collect()
}

/// From the unit cube, about its centre.
fn placed(size: DVec3, degrees: f64, center: DVec3) -> DAffine3 {
    let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
    DAffine3::from_translation(center)
        * DAffine3::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()))
        * DAffine3::from_scale(size)
        * DAffine3::from_translation(DVec3::splat(-0.5))
}

fn steps(to_world: DAffine3) -> String {
    let row = |i: usize| {
        let m = to_world.matrix3.row(i);
        [m.x, m.y, m.z, to_world.translation[i]]
    };
    format!(
        "[ {{ matrix = [{:?}, {:?}, {:?}, [0, 0, 0, 1]] }} ]",
        row(0),
        row(1),
        row(2)
    )
}

/// The room but for what encloses the medium "smoke", with what `smoke` adds to it.
fn text(room: &Room, passes: usize, to_world: DAffine3, smoke: &str) -> String {
    let mut text = format!(
        r#"
[image]
width = {SIZE}
height = {SIZE}
[render]
passes = {passes}
paths = 5000
radius = 0.01
seed = 17
[camera]
origin = {:?}
target = {:?}
fov = {}
[media.smoke]
type = "heterogeneous"
sigma_a = {:?}
sigma_s = {:?}
phase = {{ type = "hg", g = {} }}
density = {{ file = "lumps.vol" }}
transform = {}
{smoke}
[[shapes]]
type = "sphere"
center = {:?}
radius = {}
emission = {{ radiance = {:?} }}
"#,
        room.camera.origin.to_array(),
        room.camera.target.to_array(),
        room.camera.fov,
        room.sigma_a,
        room.sigma_s,
        room.g,
        steps(to_world),
        room.lamp.center.to_array(),
        room.lamp.radius,
        room.lamp.radiance,
    );
    // By wall: axis and angle that turn +z inwards.
    let turns = [
        ([0, 1, 0], 90),
        ([0, 1, 0], -90),
        ([1, 0, 0], -90),
        ([1, 0, 0], 90),
        ([0, 1, 0], 0),
        ([0, 1, 0], 180),
    ];
    for (wall, (axis, angle)) in turns.into_iter().enumerate() {
        let mut center = [0, 0, 0];
        center[wall / 2] = [-1, 1][wall % 2];
        text += &format!(
            r#"
[materials.wall{wall}]
type = "diffuse"
reflectance = {:?}
[[shapes]]
type = "rectangle"
material = "wall{wall}"
transform = [ {{ rotate = {{ axis = {axis:?}, angle = {angle} }} }}, {{ translate = {center:?} }} ]
"#,
            room.walls[wall],
        );
    }
    text
}

/// Every block's two means are the same within a share of the second and their errors.
fn compare(
    suite: &mut Suite,
    name: &str,
    got: &[[MeanEstimate; 3]],
    expected: &[[MeanEstimate; 3]],
    allowance: f64,
) {
    assert_eq!(got.len(), expected.len());
    let (mut squares, mut off, mut error) = (0.0, [0.0; 3], [0.0; 3]);
    for (block, (got, expected)) in got.iter().zip(expected).enumerate() {
        for c in 0..3 {
            let (a, b) = (got[c], expected[c]);
            let difference = a.mean() - b.mean();
            let se = a.std_error().hypot(b.std_error());
            let beyond = (difference.abs() - allowance * b.mean()).max(0.0);
            let z = if beyond > 0.0 { beyond / se } else { 0.0 };
            squares += difference * difference / (se * se);
            off[c] += difference / b.mean();
            error[c] += se / b.mean();
            suite.p_value(
                format!(
                    "{name}: block {block} channel {c}: {} +- {}, expected {} +- {}",
                    a.mean(),
                    a.std_error(),
                    b.mean(),
                    b.std_error()
                ),
                two_sided(z),
            );
        }
    }
    let n = got.len() as f64;
    eprintln!(
        "{name}: mean z^2 {:.3}, mean relative difference {:.5?}, mean relative error of a block {:.5?}",
        squares / (3.0 * n),
        off.map(|x| x / n),
        error.map(|x| x / n)
    );
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
        sigma_a: [0.1, 0.4, 0.02],
        sigma_s: [0.5, 0.3, 0.9],
        g: 0.4,
        grid,
        lamp: Lamp {
            center: DVec3::new(-0.45, 0.5, -0.3),
            radius: 0.15,
            radiance: [20.0, 15.0, 10.0],
        },
        camera: Camera {
            origin: DVec3::new(0.3, -0.2, 0.8),
            target: DVec3::new(-0.1, 0.1, -0.4),
            fov: 75.0,
            size: SIZE,
        },
    }
}

#[test]
fn a_room_of_lumpy_smoke_is_what_a_path_tracer_sees() {
    // The grid does not quite fill the room: its border is in it.
    let resolution = [6, 5, 7];
    let to_world = placed(
        DVec3::new(2.4, 2.0, 2.2),
        25.0,
        DVec3::new(0.1, -0.05, 0.05),
    );
    let room = lit_room(Grid::new(resolution, lumps(resolution), to_world));
    let expected = room.block_means(BLOCK, 400, 1);
    // Significance 1e-3 for both images; 1 % for kernels.
    let mut suite = Suite::new(1e-3);
    for estimator in ["", "transmittance = \"ratio_tracking\""] {
        let text = text(&room, 100, to_world, estimator) + "[world]\nmedium = \"smoke\"\n";
        let scene = scene_with(&text, &[("lumps.vol", &room.grid.vol())]);
        let got = block_means(&scene, BLOCK);
        compare(&mut suite, estimator, &got, &expected, 0.01);
    }
    suite.finish();
}
