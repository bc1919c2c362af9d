//! A saloon of the late forties, its front at z = 0 facing +z, standing on y = 0. Its headlights are meshes of their
//! own.

use super::{Mesh, loft};
use glam::DVec3;
use std::f64::consts::PI;

/// A section across the car: its z, half width, lowest and highest point.
type Section = [f64; 4];

const HULL: [Section; 13] = [
    [-0.10, 0.17, 0.47, 0.72],
    [-0.13, 0.27, 0.40, 0.82],
    [-0.28, 0.35, 0.34, 0.90],
    [-0.60, 0.41, 0.32, 0.96],
    [-1.00, 0.49, 0.32, 1.00],
    [-1.40, 0.62, 0.32, 1.03],
    [-1.80, 0.70, 0.32, 1.03],
    [-2.40, 0.73, 0.32, 1.02],
    [-3.00, 0.71, 0.32, 1.00],
    [-3.45, 0.62, 0.34, 0.93],
    [-3.80, 0.50, 0.38, 0.79],
    [-3.98, 0.38, 0.42, 0.66],
    [-4.04, 0.24, 0.47, 0.59],
];

/// Of roof and windows, from the windscreen's foot to the rear window's.
const CABIN: [Section; 10] = [
    [-1.26, 0.46, 0.80, 0.99],
    [-1.36, 0.58, 0.80, 1.10],
    [-1.52, 0.63, 0.80, 1.27],
    [-1.72, 0.65, 0.80, 1.43],
    [-2.00, 0.66, 0.80, 1.50],
    [-2.40, 0.66, 0.80, 1.52],
    [-2.80, 0.64, 0.80, 1.49],
    [-3.20, 0.58, 0.80, 1.36],
    [-3.52, 0.48, 0.80, 1.14],
    [-3.74, 0.36, 0.80, 0.93],
];
/// Where the cabin's sections are widest.
const BELT: f64 = 0.96;
/// Rows of faces from one section of the cabin to the next.
const CABIN_ROWS: u32 = 6;
/// Faces around a section of the cabin.
const CABIN_AROUND: u32 = 48;

const FRONT_WING: [Section; 9] = [
    [-0.02, 0.05, 0.46, 0.56],
    [-0.05, 0.13, 0.40, 0.66],
    [-0.18, 0.19, 0.36, 0.76],
    [-0.40, 0.22, 0.40, 0.83],
    [-0.65, 0.23, 0.43, 0.84],
    [-0.95, 0.21, 0.38, 0.77],
    [-1.25, 0.17, 0.32, 0.61],
    [-1.52, 0.12, 0.30, 0.44],
    [-1.66, 0.07, 0.31, 0.36],
];
const REAR_WING: [Section; 8] = [
    [-2.34, 0.06, 0.31, 0.37],
    [-2.48, 0.13, 0.30, 0.51],
    [-2.75, 0.19, 0.38, 0.73],
    [-3.08, 0.22, 0.43, 0.80],
    [-3.42, 0.20, 0.41, 0.75],
    [-3.70, 0.15, 0.40, 0.64],
    [-3.85, 0.10, 0.42, 0.57],
    [-3.88, 0.05, 0.45, 0.53],
];
/// Distance of the wings' middles from the car's.
const WING: f64 = 0.63;

/// Faces between sections whose middle is at `x` and which are widest at the height `widest`; `keep` is asked for the
/// row and the place around, from +x over the top.
fn shell(
    mesh: &mut Mesh,
    sections: &[Section],
    (rows, around): (u32, u32),
    (x, widest): (f64, Option<f64>),
    keep: impl Fn(u32, u32) -> bool,
) {
    let total = rows * (sections.len() as u32 - 1);
    let at = |row: u32, column: u32| {
        let [z, half, low, high] = loft::spline(sections, f64::from(row) / f64::from(rows));
        let middle = widest.map_or(0.5 * (low + high), |widest| widest.min(high - 0.02));
        let (sin, cos) = libm::sincos(2.0 * PI * f64::from(column) / f64::from(around));
        // A superellipse between ellipse and box.
        let power = 2.7;
        let radius = libm::pow(libm::pow(sin.abs(), power) + libm::pow(cos.abs(), power), -1.0 / power);
        let tall = if sin > 0.0 { high - middle } else { middle - low };
        DVec3::new(x + half * radius * cos, middle + tall * radius * sin, z)
    };
    loft::tube(mesh, total, around, at, keep);
}

/// Is this face of the cabin glass? Windscreen, two windows on each side, rear window.
fn is_pane(row: u32, column: u32) -> bool {
    let across = |from: u32, to: u32| (from..to).contains(&column);
    let along = |from: u32, to: u32| (from..to).contains(&row);
    let side = across(2, 6) || across(18, 22);
    (along(5, 18) && (across(4, 12) || across(12, 20)))
        || (side && (along(22, 30) || along(31, 40)))
        || (along(42, 50) && across(7, 17))
}

/// Painted parts.
pub fn body() -> Mesh {
    let mut mesh = Mesh::default();
    shell(&mut mesh, &HULL, (3, 32), (0.0, None), |_, _| true);
    let cabin = (CABIN_ROWS, CABIN_AROUND);
    shell(&mut mesh, &CABIN, cabin, (0.0, Some(BELT)), |row, column| {
        !is_pane(row, column)
    });
    for side in [-1.0, 1.0] {
        for wing in [&FRONT_WING[..], &REAR_WING] {
            shell(&mut mesh, wing, (3, 20), (WING * side, None), |_, _| true);
        }
        let (near, far) = (0.45 * side, 0.80 * side);
        super::push_box(&mut mesh, [near, 0.27, -2.5], [far, 0.33, -1.5], 0.01);
    }
    mesh.smooth();
    mesh
}

/// Panes, dark.
pub fn panes() -> Mesh {
    let mut mesh = Mesh::default();
    shell(
        &mut mesh,
        &CABIN,
        (CABIN_ROWS, CABIN_AROUND),
        (0.0, Some(BELT)),
        is_pane,
    );
    mesh.smooth();
    mesh
}

/// Bright parts: bumpers, grille, hub caps, a strip along the bonnet.
pub fn chrome() -> Mesh {
    let mut mesh = Mesh::default();
    super::push_box(&mut mesh, [-0.84, 0.36, 0.10], [0.84, 0.45, 0.15], 0.015);
    super::push_box(&mut mesh, [-0.78, 0.38, -4.16], [0.78, 0.47, -4.11], 0.015);
    for side in [-1.0, 1.0] {
        super::push_box(&mut mesh, [0.26 * side, 0.32, 0.09], [0.31 * side, 0.54, 0.18], 0.015);
        super::push_box(&mut mesh, [0.27 * side, 0.38, -0.5], [0.30 * side, 0.42, 0.11], 0.005);
    }
    // Bars of the grille lean back with the nose.
    for i in -4i32..=4 {
        let x = 0.042 * f64::from(i);
        let high = 0.80 - 2.2 * x * x;
        let low = 0.46 + 1.6 * x * x;
        let place = |x: f64, y: f64, z: f64| DVec3::new(x, y, z - 0.13 * (y - 0.45) - 1.1 * x * x);
        let (left, right) = (x - 0.009, x + 0.009);
        for (from, to) in [
            ([left, -0.10], [left, -0.065]),
            ([left, -0.065], [right, -0.065]),
            ([right, -0.065], [right, -0.10]),
        ] {
            mesh.push_polygon(&[
                place(from[0], low, from[1]),
                place(to[0], low, to[1]),
                place(to[0], high, to[1]),
                place(from[0], high, from[1]),
            ]);
        }
    }
    super::push_box(&mut mesh, [-0.008, 0.95, -1.2], [0.008, 1.025, -0.6], 0.002);
    for (z, side) in [(-0.62, -1.0), (-0.62, 1.0), (-3.08, -1.0), (-3.08, 1.0)] {
        let at = |row: u32, column: u32| {
            let (sin, cos) = libm::sincos(0.5 * PI * (1.0 - 0.98 * f64::from(row) / 6.0));
            let (across, up) = libm::sincos(2.0 * PI * f64::from(column) / 20.0);
            let radius = 0.19 * sin;
            DVec3::new(
                side * (0.80 + 0.07 * cos),
                0.34 + radius * up,
                z - side * radius * across,
            )
        };
        loft::tube(&mut mesh, 6, 20, at, |_, _| true);
    }
    mesh.smooth();
    mesh
}
