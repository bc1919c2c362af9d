//! Hills and trees.

use super::{Mesh, loft};
use glam::DVec3;
use std::f64::consts::PI;

/// Random numbers in [0, 1): a linear congruential generator, Knuth's MMIX.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 33) as f64 / (1u64 << 31) as f64
    }
}

/// A tree in winter, about 7 high, standing on y = 0: boughs of tapering prisms.
pub fn bare() -> Mesh {
    let mut mesh = Mesh::default();
    let mut random = Random(5);
    bough(
        &mut mesh,
        &mut random,
        (DVec3::new(0.0, -0.1, 0.0), DVec3::Y),
        (1.9, 0.17),
        0,
    );
    mesh
}

/// How often boughs fork.
const FORKS: u32 = 5;

fn bough(mesh: &mut Mesh, random: &mut Random, (from, along): (DVec3, DVec3), (length, thick): (f64, f64), depth: u32) {
    let right = along.any_orthonormal_vector();
    let up = along.cross(right);
    let around = if depth < 2 { 7 } else { 3 };
    // It bends on the way.
    let bend = (right * (random.next() - 0.5) + up * (random.next() - 0.5)) * (0.35 * length);
    let middle = from + along * (0.5 * length) + bend * 0.5;
    let to = from + along * length + DVec3::Y * (0.06 * length * f64::from(depth));
    let thin = if depth == FORKS { 0.3 * thick } else { 0.68 * thick };
    let ring = |center: DVec3, radius: f64, i: u32| {
        let (sin, cos) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(around));
        center + right * (radius * cos) + up * (radius * sin)
    };
    let first = mesh.positions.len() as u32;
    for (center, radius) in [(from, thick), (middle, 0.5 * (thick + thin)), (to, thin)] {
        mesh.positions.extend((0..around).map(|i| ring(center, radius, i)));
    }
    for row in 0..2 {
        for i in 0..around {
            let (a, b) = (first + row * around + i, first + row * around + (i + 1) % around);
            mesh.faces.push(vec![a, b, b + around, a + around]);
        }
    }
    if depth == FORKS {
        return;
    }
    let along = (to - middle).normalize();
    let right = along.any_orthonormal_vector();
    let up = along.cross(right);
    let first = random.next();
    for i in 0..3 {
        let (sin, cos) = libm::sincos(2.0 * PI * (first + f64::from(i) / 3.0 + 0.15 * random.next()));
        let spread = 0.35 + 0.45 * random.next();
        let direction = (along + (right * cos + up * sin) * spread + DVec3::Y * 0.08).normalize();
        let length = length * (0.62 + 0.22 * random.next());
        bough(mesh, random, (to, direction), (length, thin * 0.8), depth + 1);
    }
}

/// A fir of height 1: skirts of boughs, each of which is a ragged cone.
pub fn fir() -> Mesh {
    const AROUND: u32 = 11;
    let mut mesh = Mesh::default();
    let mut random = Random(11);
    for skirt in 0..6 {
        let t = f64::from(skirt) / 6.0;
        let (low, high, radius) = (0.08 + 0.78 * t, 0.36 + 0.72 * t, 0.24 * (1.0 - 0.85 * t));
        let tips: Vec<DVec3> = (0..2 * AROUND)
            .map(|i| {
                let turn = (f64::from(i) + 0.5 * random.next()) / f64::from(2 * AROUND);
                let (sin, cos) = libm::sincos(2.0 * PI * turn);
                let reach = radius * if i % 2 == 0 { 0.85 + 0.3 * random.next() } else { 0.55 };
                DVec3::new(reach * sin, low - 0.03 * random.next(), reach * cos)
            })
            .collect();
        for i in 0..tips.len() {
            let top = DVec3::Y * high.min(1.0);
            mesh.push_polygon(&[tips[i], tips[(i + 1) % tips.len()], top]);
        }
    }
    mesh
}

/// Heights of the hills: (direction in degrees from the x axis, length, amplitude, phase) of waves.
const HILLS: [(f64, f64, f64, f64); 5] = [
    (20.0, 19.0, 0.42, 1.3),
    (-48.0, 11.0, 0.26, 0.4),
    (75.0, 7.3, 0.13, 2.9),
    (-15.0, 4.1, 0.05, 4.0),
    (50.0, 2.3, 0.018, 0.7),
];

/// Rolling land around the origin, 48 wide and 48 deep, finer in the middle, facing +y; it falls away at its rim.
pub fn hills() -> Mesh {
    const CELLS: u32 = 60;
    let mut mesh = Mesh::default();
    let at = |row: u32, column: u32| {
        let place = |i: u32| {
            let t = 2.0 * f64::from(i) / f64::from(CELLS) - 1.0;
            24.0 * t * (0.4 + 0.6 * t.abs())
        };
        let (x, z) = (place(column), place(row));
        DVec3::new(x, hill(x, z), z)
    };
    loft::sheet(&mut mesh, CELLS, CELLS, at, |_, _| true);
    mesh.smooth();
    mesh
}

fn hill(x: f64, z: f64) -> f64 {
    let wave = |(degrees, length, a, phase): (f64, f64, f64, f64)| {
        let (sin, cos) = libm::sincos(f64::to_radians(degrees));
        a * libm::sin(2.0 * PI / length * (x * cos + z * sin) + phase)
    };
    let beyond = ((x * x + z * z).sqrt() - 17.0).max(0.0);
    HILLS.into_iter().map(wave).sum::<f64>() - 0.03 * beyond * beyond
}
