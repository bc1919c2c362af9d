//! Under water: the water itself, the sand, a fish.

use super::Mesh;
use glam::DVec3;
use std::f64::consts::PI;

/// A wave of a height field: direction in degrees from the x axis, length, amplitude, phase.
type Wave = (f64, f64, f64, f64);

/// A surface of amplitude a and wave number k = 2 pi / length focuses light from above at the depth 4 / (a k^2), for
/// the index 1.33; the waves together do so around the depth of the sand.
const RIPPLES: [Wave; 8] = [
    (20.0, 6.0, 0.100, 0.3),
    (-35.0, 3.7, 0.060, 2.1),
    (70.0, 2.3, 0.034, 4.4),
    (-78.0, 1.6, 0.019, 1.0),
    (112.0, 1.15, 0.011, 5.3),
    (8.0, 0.90, 0.007, 3.6),
    (150.0, 0.75, 0.0045, 0.8),
    (-50.0, 0.66, 0.0035, 2.7),
];
const DUNES: [Wave; 4] = [
    (80.0, 7.0, 0.16, 0.5),
    (20.0, 4.1, 0.09, 2.2),
    (86.0, 0.9, 0.022, 1.0),
    (72.0, 0.8, 0.018, 3.0),
];

/// Half of the water's side.
const HALF: f64 = 9.0;
/// Cells of the water's surface along a side.
const CELLS: u32 = 144;
/// Depth of the water's flat bottom.
const DEPTH: f64 = 7.0;

/// Height and gradient of the sum of a sin(k . (x, z) + phase).
fn height(waves: &[Wave], x: f64, z: f64) -> (f64, f64, f64) {
    let mut sum = (0.0, 0.0, 0.0);
    for (degrees, length, a, phase) in waves {
        let k = 2.0 * PI / length;
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let (wave, slope) = libm::sincos(k * (x * cos + z * sin) + phase);
        sum.0 += a * wave;
        sum.1 += a * slope * k * cos;
        sum.2 += a * slope * k * sin;
    }
    sum
}

/// A square height field around the origin, facing +y, with its exact normals.
fn field(waves: &[Wave], half: f64, cells: u32, level: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=cells {
        for column in 0..=cells {
            let at = |i: u32| half * (2.0 * f64::from(i) / f64::from(cells) - 1.0);
            let (x, z) = (at(column), at(row));
            let (h, dx, dz) = height(waves, x, z);
            mesh.positions.push(DVec3::new(x, level + h, z));
            mesh.normals.push(DVec3::new(-dx, 1.0, -dz).normalize());
        }
    }
    for row in 0..cells {
        for column in 0..cells {
            let i = row * (cells + 1) + column;
            let below = i + cells + 1;
            mesh.faces.push(vec![i, below, below + 1, i + 1]);
        }
    }
    mesh
}

/// A closed volume: rippled top at y = 0, sides, flat bottom.
pub fn water() -> Mesh {
    let mut mesh = field(&RIPPLES, HALF, CELLS, 0.0);
    let side = CELLS + 1;
    let corner = |along: u32, i: u32| match along {
        0 => CELLS * side + i,
        1 => (CELLS - i) * side + CELLS,
        2 => CELLS - i,
        _ => i * side,
    };
    let normals = [DVec3::Z, DVec3::X, DVec3::NEG_Z, DVec3::NEG_X];
    for (along, normal) in (0..4).zip(normals) {
        let first = mesh.positions.len() as u32;
        for i in 0..side {
            let top = mesh.positions[corner(along, i) as usize];
            mesh.positions.extend([top, top.with_y(-DEPTH)]);
            mesh.normals.extend([normal, normal]);
        }
        for i in 0..CELLS {
            let [upper, lower] = [first + 2 * i, first + 2 * i + 1];
            mesh.faces.push(vec![upper, lower, lower + 2, upper + 2]);
        }
        // The bottom: from its centre to every step along this side.
        let first = mesh.positions.len() as u32;
        mesh.positions.push(DVec3::new(0.0, -DEPTH, 0.0));
        for i in 0..side {
            let top = mesh.positions[corner(along, i) as usize];
            mesh.positions.push(top.with_y(-DEPTH));
        }
        mesh.normals.resize(mesh.positions.len(), DVec3::NEG_Y);
        for i in 1..side {
            mesh.faces.push(vec![first, first + i + 1, first + i]);
        }
    }
    mesh
}

/// Ribbed sand a little above the water's bottom, ending within the water.
pub fn sand() -> Mesh {
    field(&DUNES, HALF - 0.02, 96, 0.4 - DEPTH)
}

/// Four walls just inside the water's sides, up through its surface, facing inwards.
pub fn basin() -> Mesh {
    let mut mesh = Mesh::default();
    let (half, bottom, top) = (HALF - 0.02, 0.02 - DEPTH, 0.3);
    let corners = [(-half, half), (half, half), (half, -half), (-half, -half)];
    for i in 0..4 {
        let at = |corner: (f64, f64), y: f64| DVec3::new(corner.0, y, corner.1);
        let (from, to) = (corners[(i + 1) % 4], corners[i]);
        mesh.push_polygon(&[at(from, bottom), at(to, bottom), at(to, top), at(from, top)]);
    }
    mesh
}

/// Sections (x, half height, half width) of the fish, from its mouth to the end of its tail.
const FISH: [[f64; 3]; 14] = [
    [0.50, 0.012, 0.008],
    [0.47, 0.045, 0.028],
    [0.41, 0.085, 0.052],
    [0.32, 0.125, 0.072],
    [0.20, 0.155, 0.082],
    [0.06, 0.160, 0.080],
    [-0.08, 0.135, 0.066],
    [-0.20, 0.095, 0.046],
    [-0.29, 0.055, 0.027],
    [-0.35, 0.034, 0.016],
    [-0.39, 0.050, 0.010],
    [-0.44, 0.105, 0.007],
    [-0.49, 0.165, 0.005],
    [-0.50, 0.170, 0.003],
];

/// Where the fish's tail fin begins.
const TAIL: f64 = -0.39;

/// A fish of length 1 that swims along +x: ellipses around its sections, closed at both ends.
pub fn fish() -> Mesh {
    const AROUND: u32 = 14;
    let mut mesh = Mesh::default();
    for [x, tall, wide] in FISH {
        for i in 0..AROUND {
            let (sin, cos) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(AROUND));
            // The tail is forked.
            let fork = 0.6 * (TAIL - x).max(0.0) * (1.0 - sin.abs());
            mesh.positions.push(DVec3::new(x + fork, tall * sin, wide * cos));
        }
    }
    for section in 0..FISH.len() as u32 - 1 {
        for i in 0..AROUND {
            let (a, b) = (section * AROUND + i, section * AROUND + (i + 1) % AROUND);
            mesh.faces.push(vec![a, b, b + AROUND, a + AROUND]);
        }
    }
    // Ends of their own, so that their edges are sharp.
    let ring = |first: usize| mesh.positions[first..first + AROUND as usize].to_vec();
    let (mut mouth, tail) = (ring(0), ring((FISH.len() - 1) * AROUND as usize));
    mouth.reverse();
    mesh.push_polygon(&mouth);
    mesh.push_polygon(&tail);
    mesh.smooth();
    mesh
}
