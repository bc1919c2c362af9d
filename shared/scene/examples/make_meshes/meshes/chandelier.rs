//! The metal of a chandelier around the z axis.

use super::{Mesh, lathe, loft};
use glam::{DVec2, DVec3};
use lathe::{Profile, v};
use std::f64::consts::PI;

/// Arms, each from the stem to the candle that it carries: (r, z).
const ARM: [[f64; 2]; 6] = [
    [0.05, 0.02],
    [0.22, -0.16],
    [0.48, -0.20],
    [0.72, -0.10],
    [0.84, 0.06],
    [0.85, 0.14],
];
const ARMS: u32 = 8;
/// Its stem, from below up.
const STEM: [[f64; 2]; 14] = [
    [0.0, -0.70],
    [0.03, -0.69],
    [0.055, -0.64],
    [0.03, -0.58],
    [0.022, -0.40],
    [0.05, -0.30],
    [0.085, -0.12],
    [0.10, 0.02],
    [0.06, 0.12],
    [0.03, 0.22],
    [0.03, 0.50],
    [0.06, 0.62],
    [0.05, 0.74],
    [0.0, 0.78],
];
/// Hoops that crystals hang from: radius, height.
const HOOPS: [(f64, f64); 3] = [(0.50, -0.30), (0.28, -0.56), (0.24, 0.70)];

/// A tube along an arm, in the plane of the z axis and the azimuth `turn`.
fn arm(mesh: &mut Mesh, turn: f64, radius: f64) {
    const ROWS: u32 = 24;
    const AROUND: u32 = 8;
    let (sin, cos) = libm::sincos(turn);
    let placed = |p: DVec2, side: f64| DVec3::new(p.x * cos - side * sin, p.x * sin + side * cos, p.y);
    let at = |row: u32, i: u32| {
        let t = f64::from(row) / f64::from(ROWS) * (ARM.len() - 1) as f64;
        let point = |t: f64| DVec2::from(loft::spline(&ARM, t));
        let along = (point(t + 1e-4) - point(t - 1e-4)).normalize();
        let (s, c) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(AROUND));
        placed(point(t) + DVec2::new(along.y, -along.x) * (radius * s), radius * c)
    };
    loft::tube(mesh, ROWS, AROUND, at, |_, _| true);
}

/// Stem, arms, the dishes at their ends, and hoops, 1.5 high and 1.9 wide; crystals and candles are left out.
pub fn frame() -> Mesh {
    let mut arms = Mesh::default();
    for i in 0..ARMS {
        arm(&mut arms, 2.0 * PI * f64::from(i) / f64::from(ARMS), 0.014);
    }
    arms.smooth();
    let mut mesh = Profile::default().spline(3, &STEM).revolve(24);
    mesh.append(arms);
    for i in 0..ARMS {
        let dish = [
            [0.0, 0.13],
            [0.03, 0.132],
            [0.075, 0.155],
            [0.078, 0.162],
            [0.03, 0.146],
            [0.0, 0.142],
        ];
        let mut dish = Profile::default().spline(2, &dish).revolve(16);
        let (sin, cos) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(ARMS));
        dish.positions
            .iter_mut()
            .for_each(|p| *p += DVec3::new(0.85 * cos, 0.85 * sin, 0.0));
        mesh.append(dish);
    }
    for (radius, height) in HOOPS {
        let hoop = Profile::default().arc(6, v(radius, height), 0.009, 0.0, 2.0 * PI);
        mesh.append(hoop.revolve(48));
    }
    mesh
}
