//! Cloth: a curtain, bedding, a tablecloth.

use super::{Mesh, loft};
use glam::DVec3;
use std::f64::consts::PI;

fn unit(i: u32, cells: u32) -> f64 {
    f64::from(i) / f64::from(cells)
}

/// A curtain gathered to a width of 1, hanging from y = 0 to -1, its folds 0.12 deep in z.
pub fn curtain() -> Mesh {
    let mut mesh = Mesh::default();
    let at = |row: u32, column: u32| {
        let (y, x) = (-unit(row, 10), unit(column, 84));
        let phase = 2.0 * PI * (7.0 * x + 0.35 * libm::sin(9.0 * x + 0.8 * y)) + 0.5 * y;
        let (sin, cos) = libm::sincos(phase);
        let deep = 0.035 - 0.025 * y;
        DVec3::new(
            x - 0.5 + 0.012 * y * libm::sin(2.0 * phase),
            y,
            deep * sin + 0.01 * cos * libm::sin(31.0 * x),
        )
    };
    loft::sheet(&mut mesh, 10, 84, at, |_, _| true);
    mesh.smooth();
    mesh
}

/// A pillow 1 wide and 1 deep, lying on y = 0.
pub fn pillow() -> Mesh {
    const CELLS: u32 = 14;
    let mut mesh = Mesh::default();
    for up in [1.0, -1.0] {
        let at = |row: u32, column: u32| {
            let [x, z] = [row, column].map(|i| 2.0 * unit(i, CELLS) - 1.0);
            let full = |a: f64| (1.0 - libm::pow(a.abs(), 3.2)).max(0.0);
            let tall = libm::sqrt(full(x) * full(z)) * (0.15 + 0.01 * libm::sin(5.0 * x - 3.0 * z));
            // Its sides are drawn in between its corners.
            let drawn = |along: f64, across: f64| 0.5 * along * (1.0 - 0.10 * (1.0 - across * across));
            DVec3::new(up * drawn(x, z), 0.14 + up * tall, drawn(z, x))
        };
        loft::sheet(&mut mesh, CELLS, CELLS, |r, c| at(c, r), |_, _| true);
    }
    mesh.smooth();
    mesh
}

/// A quilt 1 wide along x and 1 deep along z on a bed whose top is y = 0; its sides along x hang down by 0.22.
pub fn quilt() -> Mesh {
    let (rows, columns) = (36, 48);
    let mut mesh = Mesh::default();
    let at = |row: u32, column: u32| {
        let (z, along) = (unit(row, rows), 1.5 * (2.0 * unit(column, columns) - 1.0));
        let lumps = libm::sin(6.0 * PI * z) * libm::sin(4.0 * PI * along);
        let puff = 0.012 + 0.022 * lumps * lumps + 0.012 * libm::sin(3.1 * along + 5.0 * z);
        // Around the edge of the bed it turns down.
        let over = (along.abs() - 1.0).max(0.0);
        let turn = (over / 0.12).min(1.0) * 0.5 * PI;
        let (sin, cos) = libm::sincos(turn);
        let hang = (over - 0.12).max(0.0);
        let (out, down) = (
            0.5 + 0.04 * sin + puff * sin,
            0.04 * (1.0 - cos) + 0.45 * hang - puff * cos,
        );
        let x = if over > 0.0 {
            along.signum() * (out + 0.02 * hang * libm::sin(23.0 * z))
        } else {
            0.5 * along
        };
        DVec3::new(x, -down, z - 0.5)
    };
    loft::sheet(&mut mesh, rows, columns, at, |_, _| true);
    mesh.smooth();
    mesh
}

/// Folds of the tablecloth: a point of their crest, its direction in degrees from the x axis, height, width.
const FOLDS: [(f64, f64, f64, f64, f64); 7] = [
    (-1.6, -0.9, 25.0, 0.10, 0.10),
    (-1.3, 0.5, -28.0, 0.055, 0.07),
    (1.5, -0.8, -35.0, 0.08, 0.09),
    (1.7, 1.0, 62.0, 0.06, 0.08),
    (0.2, -1.9, 8.0, 0.12, 0.12),
    (-0.4, 1.7, -12.0, 0.05, 0.07),
    (-2.3, 1.6, 70.0, 0.09, 0.10),
];

/// A tablecloth around the origin, 7 by 7, in folds, flat where glasses stand: within 1 of the origin.
pub fn table_cloth() -> Mesh {
    const CELLS: u32 = 64;
    let mut mesh = Mesh::default();
    let at = |row: u32, column: u32| {
        let [z, x] = [row, column].map(|i| {
            let t = 2.0 * unit(i, CELLS) - 1.0;
            3.5 * t * (0.6 + 0.4 * t.abs())
        });
        let fold = |(x0, z0, degrees, tall, wide): (f64, f64, f64, f64, f64)| {
            let (sin, cos) = libm::sincos(f64::to_radians(degrees));
            let (across, along) = ((z - z0) * cos - (x - x0) * sin, (x - x0) * cos + (z - z0) * sin);
            let across = across + 0.06 * libm::sin(2.1 * along);
            tall * libm::exp(-across * across / (wide * wide) - along * along / 1.6)
        };
        let far = libm::exp(-libm::pow((x * x + z * z) / 1.3, 2.0));
        let ripple = 0.012 * libm::sin(1.9 * x + 0.8 * z) * libm::sin(1.3 * z - 0.7 * x);
        DVec3::new(x, (1.0 - far) * (FOLDS.into_iter().map(fold).sum::<f64>() + ripple), z)
    };
    loft::sheet(&mut mesh, CELLS, CELLS, at, |_, _| true);
    mesh.smooth();
    mesh
}
