//! Cut glass around the z axis, and what is in it.

use super::{Mesh, lathe, loft};
use glam::{DVec2, DVec3};
use lathe::{Profile, v};
use std::f64::consts::PI;

/// A glass body whose outside has been ground flat `facets` times around.
struct Cut<'a> {
    /// Outline (r, z) of the outside, from below up.
    outline: &'a [[f64; 2]],
    facets: u32,
    /// Where along the outline the cut begins, is as deep as it becomes, begins to end, ends.
    range: [f64; 4],
}

/// Columns of faces to a facet.
const COLUMNS: u32 = 6;
/// Chords from a point of an outline to the next.
const CHORDS: u32 = 3;

impl Cut<'_> {
    /// The outside. What is within the first point's radius is closed by a flat face, and so it is at the end if it is
    /// a `solid`.
    fn outside(&self, mesh: &mut Mesh, solid: bool) {
        let rows = CHORDS * (self.outline.len() as u32 - 1);
        let around = self.facets * COLUMNS;
        for facet in 0..self.facets {
            let first = mesh.positions.len() as u32;
            for row in 0..=rows {
                for column in 0..=COLUMNS {
                    let (at, normal) = self.point(f64::from(row) / f64::from(CHORDS), facet, column);
                    mesh.positions.push(at);
                    mesh.normals.push(normal);
                }
            }
            for row in 0..rows {
                for column in 0..COLUMNS {
                    let i = first + row * (COLUMNS + 1) + column;
                    mesh.faces.push(vec![i, i + 1, i + COLUMNS + 2, i + COLUMNS + 1]);
                }
            }
        }
        let end = self.outline.len() as f64 - 1.0;
        let caps = [(0.0, DVec3::NEG_Z), (end, DVec3::Z)];
        for (t, normal) in caps.into_iter().take(if solid { 2 } else { 1 }) {
            let ring = (0..around).map(|column| {
                let column = if normal.z > 0.0 { column } else { around - 1 - column };
                self.point(t, column / COLUMNS, column % COLUMNS).0
            });
            mesh.push_polygon(&ring.collect::<Vec<_>>());
            mesh.normals.resize(mesh.positions.len(), normal);
        }
    }

    /// Point and normal at `t` along the outline, at the left edge of a column of a facet, or at the last one's right
    /// edge.
    fn point(&self, t: f64, facet: u32, column: u32) -> (DVec3, DVec3) {
        let around = self.facets * COLUMNS;
        let angle = |column: u32| 2.0 * PI * f64::from(column % around) / f64::from(around);
        let turn = libm::sincos(angle(facet * COLUMNS + column));
        let flat = libm::sincos(angle(facet * COLUMNS + COLUMNS / 2));
        // The same at both edges of a facet, so that it meets its neighbours.
        let away = libm::cos(angle(column.abs_diff(COLUMNS / 2)));
        let [begin, full, ending, end] = self.range;
        let ramp = |t: f64| {
            let t = t.clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        let corner = 1.0 - libm::cos(PI / f64::from(self.facets));
        let deep = |t: f64| corner * ramp((t - begin) / (full - begin)) * ramp((end - t) / (end - ending));
        let round = |t: f64| DVec2::from(loft::spline(self.outline, t));
        let ground = |t: f64| round(t) * DVec2::new(1.0 - deep(t), 1.0);
        let is_cut = deep(t) > 0.0 && ground(t).x / away < round(t).x - 1e-9;
        let slope = |curve: &dyn Fn(f64) -> DVec2| {
            let along = (curve(t + 1e-4) - curve(t - 1e-4)).normalize();
            DVec2::new(along.y, -along.x)
        };
        let (radius, normal, out) = match is_cut {
            true => (ground(t).x / away, slope(&ground), flat),
            false => (round(t).x, slope(&round), turn),
        };
        (
            DVec3::new(radius * turn.1, radius * turn.0, round(t).y),
            DVec3::new(normal.x * out.1, normal.x * out.0, normal.y),
        )
    }
}

/// Outside of the wine glass.
const GLASS: [[f64; 2]; 15] = [
    [0.02, 0.02],
    [0.20, 0.008],
    [0.36, 0.0],
    [0.385, 0.014],
    [0.36, 0.030],
    [0.18, 0.055],
    [0.075, 0.12],
    [0.055, 0.26],
    [0.062, 0.44],
    [0.085, 0.52],
    [0.21, 0.60],
    [0.345, 0.76],
    [0.385, 1.00],
    [0.365, 1.24],
    [0.335, 1.45],
];
/// Its inside, from the rim to where the wine begins.
const DRY: [[f64; 2]; 4] = [[0.317, 1.45], [0.346, 1.24], [0.357, 1.08], [0.357, 1.02]];
/// Its inside where there is wine, from below up.
const WET: [[f64; 2]; 5] = [[0.0, 0.655], [0.14, 0.675], [0.255, 0.76], [0.335, 0.90], [0.357, 1.02]];

/// A wine glass with ten facets, from the stem to the middle of the bowl. Where wine touches it there is none of it.
pub fn cut_glass() -> Mesh {
    let mut mesh = Mesh::default();
    let cut = Cut {
        outline: &GLASS,
        facets: 10,
        range: [5.6, 6.4, 11.2, 12.6],
    };
    cut.outside(&mut mesh, false);
    let rim = Profile::default().arc(6, v(0.326, 1.45), 0.009, 0.0, PI);
    mesh.append(rim.revolve(10 * COLUMNS));
    mesh.append(Profile::default().spline(4, &DRY).revolve(10 * COLUMNS));
    mesh
}

/// Wine in that glass, where the two touch, facing the glass.
pub fn wine() -> Mesh {
    Profile::default().spline(4, &WET).revolve(60)
}

/// The wine's surface, a little up at its rim.
pub fn wine_top() -> Mesh {
    Profile::default()
        .spline(
            2,
            &[
                [0.357, 1.02],
                [0.350, 1.0145],
                [0.33, 1.012],
                [0.2, 1.012],
                [0.0, 1.012],
            ],
        )
        .revolve(60)
}

/// Outside of the decanter.
const DECANTER: [[f64; 2]; 12] = [
    [0.02, 0.012],
    [0.30, 0.008],
    [0.42, 0.0],
    [0.455, 0.03],
    [0.47, 0.20],
    [0.46, 0.60],
    [0.40, 0.86],
    [0.24, 1.04],
    [0.15, 1.16],
    [0.125, 1.32],
    [0.14, 1.46],
    [0.185, 1.54],
];
const DECANTER_INSIDE: [[f64; 2]; 9] = [
    [0.150, 1.54],
    [0.105, 1.46],
    [0.093, 1.32],
    [0.115, 1.16],
    [0.19, 1.03],
    [0.335, 0.84],
    [0.385, 0.60],
    [0.385, 0.20],
    [0.0, 0.12],
];
/// Its stopper.
const STOPPER: [[f64; 2]; 7] = [
    [0.06, 1.50],
    [0.085, 1.58],
    [0.10, 1.62],
    [0.19, 1.70],
    [0.215, 1.80],
    [0.16, 1.92],
    [0.05, 1.97],
];

/// A decanter with eight facets and its stopper.
pub fn decanter() -> Mesh {
    let mut mesh = Mesh::default();
    let cut = |outline, range| Cut {
        outline,
        facets: 8,
        range,
    };
    cut(&DECANTER, [3.0, 3.6, 6.6, 7.6]).outside(&mut mesh, false);
    let rim = Profile::default().arc(6, v(0.1675, 1.54), 0.0175, 0.0, PI);
    mesh.append(rim.revolve(8 * COLUMNS));
    mesh.append(Profile::default().spline(4, &DECANTER_INSIDE).revolve(8 * COLUMNS));
    cut(&STOPPER, [1.6, 2.2, 5.6, 6.1]).outside(&mut mesh, true);
    mesh
}

/// A bar of equal sides 0.5 and length 1.2 along x, lying on z = 0.
pub fn prism_bar() -> Mesh {
    let mut mesh = Mesh::default();
    let (half, side, tall) = (0.6, 0.25, 0.25 * libm::sqrt(3.0));
    let at = |x: f64, i: usize| {
        let (y, z) = [(-side, 0.0), (side, 0.0), (0.0, tall)][i];
        DVec3::new(x, y, z)
    };
    for i in 0..3 {
        let j = (i + 1) % 3;
        mesh.push_polygon(&[at(half, j), at(half, i), at(-half, i), at(-half, j)]);
    }
    mesh.push_polygon(&[at(half, 0), at(half, 1), at(half, 2)]);
    mesh.push_polygon(&[at(-half, 0), at(-half, 2), at(-half, 1)]);
    mesh
}
