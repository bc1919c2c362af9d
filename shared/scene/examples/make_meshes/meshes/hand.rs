//! A hand: bones as cones with round ends, joined smoothly, and the surface at which their distance is zero.

use super::Mesh;
use glam::DVec3;

/// From a point to another, with a radius at each.
type Bone = ([f64; 3], [f64; 3], f64, f64);

/// Palm and forearm. The forearm lies along +x, fingers point to -x, the thumb is up and the palm looks to -z.
const PALM: [Bone; 8] = [
    ([1.00, 0.14, 0.00], [0.02, 0.31, 0.01], 0.125, 0.100),
    ([1.00, 0.06, 0.02], [0.00, 0.11, 0.04], 0.125, 0.105),
    ([1.00, -0.04, 0.02], [0.03, -0.09, 0.03], 0.125, 0.100),
    ([1.00, -0.13, 0.00], [0.09, -0.28, 0.00], 0.120, 0.090),
    ([0.92, 0.16, -0.10], [0.52, 0.38, -0.16], 0.150, 0.130),
    ([0.95, -0.20, -0.06], [0.30, -0.29, -0.08], 0.120, 0.100),
    ([1.02, 0.07, 0.00], [2.05, 0.10, 0.02], 0.170, 0.210),
    ([1.02, -0.08, 0.00], [2.05, -0.13, 0.02], 0.165, 0.200),
];
/// Knuckle, length and radius of a finger, and how far it is spread towards +y for each unit along it.
const FINGERS: [([f64; 3], f64, f64, f64); 4] = [
    ([0.03, 0.31, 0.01], 0.76, 0.088, 0.09),
    ([0.00, 0.11, 0.04], 0.86, 0.092, 0.02),
    ([0.03, -0.09, 0.03], 0.79, 0.087, -0.04),
    ([0.09, -0.28, 0.00], 0.62, 0.076, -0.11),
];
/// Slopes towards -z of a finger's three bones, and their shares of its length.
const BENT: [(f64, f64); 3] = [(0.12, 0.46), (0.42, 0.30), (0.75, 0.24)];
const THUMB: [([f64; 3], f64); 4] = [
    ([0.62, 0.36, -0.14], 0.125),
    ([0.30, 0.60, -0.24], 0.105),
    ([0.02, 0.73, -0.33], 0.098),
    ([-0.20, 0.80, -0.36], 0.076),
];

/// Side of the grid's cells.
const CELL: f64 = 0.041;
/// Corner of the grid, and its cells along each axis.
const CORNER: [f64; 3] = [-1.05, -0.62, -0.70];
const CELLS: [usize; 3] = [75, 42, 26];

fn distance_to_bone(p: DVec3, (from, to, start, end): Bone) -> f64 {
    let (from, to) = (DVec3::from(from), DVec3::from(to));
    let along = to - from;
    let t = ((p - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(from + along * t) - (start + (end - start) * t)
}

/// The smaller of two distances, rounded off where they differ by less than `by`.
fn joined(a: f64, b: f64, by: f64) -> f64 {
    let near = (by - (a - b).abs()).max(0.0) / by;
    a.min(b) - 0.25 * by * near * near
}

/// Bones of a finger, a little thicker at its joints.
fn finger((knuckle, length, radius, spread): ([f64; 3], f64, f64, f64)) -> Vec<Bone> {
    let mut from = DVec3::from(knuckle);
    let mut thick = 1.08 * radius;
    let mut bones = Vec::new();
    for (slope, share) in BENT {
        let to = from + DVec3::new(-1.0, spread, -slope).normalize() * (length * share);
        let thin = thick * 0.89;
        bones.push((from.to_array(), to.to_array(), thick, thin));
        (from, thick) = (to, thin * 1.02);
    }
    bones
}

/// Distance to the hand's surface, about right near it, negative inside.
fn distance(p: DVec3) -> f64 {
    let chain = |bones: &[Bone], by: f64| {
        let mut sum = f64::INFINITY;
        for bone in bones {
            let d = distance_to_bone(p, *bone);
            sum = if sum.is_finite() { joined(sum, d, by) } else { d };
        }
        sum
    };
    let palm = chain(&PALM, 0.16);
    let thumb: Vec<Bone> = THUMB.windows(2).map(|w| (w[0].0, w[1].0, w[0].1, w[1].1)).collect();
    let mut hand = joined(palm, chain(&thumb, 0.03), 0.14);
    for of in FINGERS {
        // Only near the palm is there skin between fingers.
        hand = joined(
            hand,
            chain(&finger(of), 0.03),
            0.05 + 0.06 * ((p.x + 0.1) / 0.2).clamp(0.0, 1.0),
        );
    }
    // It ends flat, a little before the forearm's bones do.
    hand.max(p.x - 1.90)
}

fn normal(p: DVec3) -> DVec3 {
    let e = 1e-4;
    let along = |axis: DVec3| distance(p + axis * e) - distance(p - axis * e);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize()
}

/// A left hand of 1.8 from wrist to fingertips, closed: a vertex in each cell of a grid that the surface crosses, and a
/// face around each of its edges that does.
pub fn hand() -> Mesh {
    let corner = |i: [usize; 3]| DVec3::from(CORNER) + DVec3::from(i.map(|i| i as f64)) * CELL;
    let corners = CELLS.map(|n| n + 1);
    let index = |i: [usize; 3], n: [usize; 3]| (i[2] * n[1] + i[1]) * n[0] + i[0];
    let mut values = Vec::with_capacity(corners.iter().product());
    for z in 0..corners[2] {
        for y in 0..corners[1] {
            for x in 0..corners[0] {
                values.push(distance(corner([x, y, z])));
            }
        }
    }
    let value = |i: [usize; 3]| values[index(i, corners)];
    let moved = |mut i: [usize; 3], axis: usize| {
        i[axis] += 1;
        i
    };
    let mut mesh = Mesh::default();
    let mut places = vec![None; CELLS.iter().product()];
    for z in 0..CELLS[2] {
        for y in 0..CELLS[1] {
            for x in 0..CELLS[0] {
                // The mean of where the surface crosses the cell's twelve edges.
                let (mut sum, mut crossings) = (DVec3::ZERO, 0.0);
                for axis in 0..3 {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let from = [x, y, z];
                    for from in [from, moved(from, u), moved(from, v), moved(moved(from, u), v)] {
                        let to = moved(from, axis);
                        let (a, b) = (value(from), value(to));
                        if (a < 0.0) != (b < 0.0) {
                            sum += corner(from).lerp(corner(to), a / (a - b));
                            crossings += 1.0;
                        }
                    }
                }
                if crossings > 0.0 {
                    let mean = sum / crossings;
                    let at = mean - normal(mean) * distance(mean);
                    places[index([x, y, z], CELLS)] = Some(mesh.positions.len() as u32);
                    mesh.positions.push(at);
                    mesh.normals.push(normal(at));
                }
            }
        }
    }
    for z in 1..CELLS[2] {
        for y in 1..CELLS[1] {
            for x in 1..CELLS[0] {
                for axis in 0..3 {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let from = [x, y, z];
                    let (a, b) = (value(from), value(moved(from, axis)));
                    if (a < 0.0) == (b < 0.0) {
                        continue;
                    }
                    let around = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(du, dv)| {
                        let mut cell = from;
                        cell[u] -= du;
                        cell[v] -= dv;
                        places[index(cell, CELLS)]
                    });
                    let mut face: Vec<u32> = around.into_iter().flatten().collect();
                    if a > 0.0 {
                        face.reverse();
                    }
                    mesh.faces.push(face);
                }
            }
        }
    }
    mesh
}
