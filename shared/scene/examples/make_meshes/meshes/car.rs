//! A boxy car, its front at z = 0 facing +z, standing on y = 0.

use super::Mesh;
use glam::DVec3;

/// Painted parts.
pub fn body() -> Mesh {
    let mut mesh = Mesh::default();
    // Bonnet, wings, doors, roof.
    push_box(&mut mesh, [-0.56, 0.5, -1.35], [0.56, 1.08, 0.0], 0.05);
    for side in [-1.0, 1.0] {
        let (near, far) = (0.5 * side, 0.84 * side);
        push_box(&mut mesh, [near, 0.72, -1.35], [far, 0.98, -0.06], 0.05);
        push_box(&mut mesh, [near, 0.45, -1.35], [far, 0.9, -1.0], 0.03);
    }
    push_box(&mut mesh, [-0.84, 0.42, -3.7], [0.84, 1.12, -1.25], 0.05);
    push_frustum(&mut mesh, 1.10, [0.80, -1.30, -3.68], 1.78, [0.70, -1.62, -3.60]);
    push_box(&mut mesh, [-0.73, 1.77, -3.64], [0.73, 1.84, -1.56], 0.03);
    mesh
}

/// Dark parts: grille, bumper, panes.
pub fn trim() -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..5 {
        let y = 0.62 + 0.075 * f64::from(i);
        push_box(&mut mesh, [-0.26, y, -0.01], [0.26, y + 0.035, 0.02], 0.005);
    }
    push_box(&mut mesh, [-0.88, 0.36, -0.05], [0.88, 0.52, 0.16], 0.03);
    push_box(&mut mesh, [-0.8, 0.3, -3.6], [0.8, 0.5, -0.3], 0.02);
    // The windscreen, its pillars left free, a little before the sloping front.
    let corner = |x: f64, y: f64| {
        let up = (y - 1.10) / (1.78 - 1.10);
        DVec3::new(x * (1.0 - 0.125 * up), y, -1.30 - 0.32 * up + 0.012)
    };
    for (from, to) in [(-0.74, -0.03), (0.03, 0.74)] {
        mesh.push_polygon(&[
            corner(from, 1.17),
            corner(to, 1.17),
            corner(to, 1.71),
            corner(from, 1.71),
        ]);
    }
    mesh
}

/// A box between two corners, its edges cut off at `cut`.
fn push_box(mesh: &mut Mesh, from: [f64; 3], to: [f64; 3], cut: f64) {
    let (a, b) = (DVec3::from(from), DVec3::from(to));
    let (center, half) = (0.5 * (a + b), 0.5 * (a - b).abs());
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    // The corner of the face across `axis`, on the sides that `signs` gives.
    let corner = |signs: [f64; 3], axis: usize| {
        let mut offset = DVec3::ZERO;
        for i in 0..3 {
            let inset = if i == axis { 0.0 } else { cut };
            offset += axes[i] * (signs[i] * (half[i] - inset));
        }
        center + offset
    };
    let mut push = |corners: &[DVec3]| {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let mut corners = corners.to_vec();
        if normal.dot(corners[0] - center) < 0.0 {
            corners.reverse();
        }
        mesh.push_polygon(&corners);
    };
    let signs = |axis: usize, own: f64, next: f64, last: f64| {
        let mut signs = [0.0; 3];
        signs[axis] = own;
        signs[(axis + 1) % 3] = next;
        signs[(axis + 2) % 3] = last;
        signs
    };
    for axis in 0..3 {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        for own in [-1.0, 1.0] {
            push(
                &[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(n, l)| corner(signs(axis, own, n, l), axis)),
            );
            // The edges along `axis`, between the faces across the two others.
            for other in [-1.0, 1.0] {
                let along = |end: f64| signs(axis, end, own, other);
                push(&[
                    corner(along(-1.0), next),
                    corner(along(1.0), next),
                    corner(along(1.0), last),
                    corner(along(-1.0), last),
                ]);
            }
        }
    }
    for i in 0..8 {
        let signs = [1, 2, 4].map(|bit| if i & bit == 0 { -1.0 } else { 1.0 });
        push(&[0, 1, 2].map(|axis| corner(signs, axis)));
    }
}

/// A roof: from a rectangle [half width, front, back] at the height `y0` to one at `y1`.
fn push_frustum(mesh: &mut Mesh, y0: f64, base: [f64; 3], y1: f64, top: [f64; 3]) {
    let level = |y: f64, [half, front, back]: [f64; 3]| {
        [(-half, front), (half, front), (half, back), (-half, back)].map(|(x, z)| DVec3::new(x, y, z))
    };
    let (low, high) = (level(y0, base), level(y1, top));
    for i in 0..4 {
        let j = (i + 1) % 4;
        mesh.push_polygon(&[low[i], low[j], high[j], high[i]]);
    }
    mesh.push_polygon(&high);
    mesh.push_polygon(&[low[3], low[2], low[1], low[0]]);
}
