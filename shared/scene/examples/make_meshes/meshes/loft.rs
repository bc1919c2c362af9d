//! Sheets and tubes of quadrilaterals between points of a function, and splines.

use super::Mesh;
use glam::DVec3;

/// The Catmull-Rom spline through `points` at `t`, which is 0 at the first of them and grows by 1 from each to the
/// next. Beyond its ends it goes on as it would through a point as far away again.
pub fn spline<const N: usize>(points: &[[f64; N]], t: f64) -> [f64; N] {
    let last = points.len() - 1;
    let first = (t.max(0.0) as usize).min(last - 1);
    let t = t - first as f64;
    let mut value = [0.0; N];
    for (i, value) in value.iter_mut().enumerate() {
        let (b, c) = (points[first][i], points[first + 1][i]);
        let a = if first > 0 { points[first - 1][i] } else { 2.0 * b - c };
        let d = if first + 1 < last {
            points[first + 2][i]
        } else {
            2.0 * c - b
        };
        let (p, q) = (0.5 * (c - a), 0.5 * (d - b));
        *value = b + (p + (3.0 * (c - b) - 2.0 * p - q + (2.0 * (b - c) + p + q) * t) * t) * t;
    }
    value
}

/// Faces between the points `at(row, column)` of rows 0 to `rows` and columns 0 to `columns`. Those that `keep` has
/// none of are left out, with the points that no other face needs. The outside is where the vector product of the way
/// from row to row and the way from column to column points.
pub fn sheet(
    mesh: &mut Mesh,
    rows: u32,
    columns: u32,
    at: impl Fn(u32, u32) -> DVec3,
    keep: impl Fn(u32, u32) -> bool,
) {
    faces(mesh, rows, columns, columns + 1, at, keep);
}

/// The same, but that the last column is followed by the first.
pub fn tube(mesh: &mut Mesh, rows: u32, around: u32, at: impl Fn(u32, u32) -> DVec3, keep: impl Fn(u32, u32) -> bool) {
    faces(mesh, rows, around, around, at, keep);
}

fn faces(
    mesh: &mut Mesh,
    rows: u32,
    columns: u32,
    width: u32,
    at: impl Fn(u32, u32) -> DVec3,
    keep: impl Fn(u32, u32) -> bool,
) {
    let mut places = vec![None; ((rows + 1) * width) as usize];
    let mut place = |mesh: &mut Mesh, row: u32, column: u32| {
        let column = column % width;
        *places[(row * width + column) as usize].get_or_insert_with(|| {
            mesh.positions.push(at(row, column));
            mesh.positions.len() as u32 - 1
        })
    };
    for row in 0..rows {
        for column in (0..columns).filter(|column| keep(row, *column)) {
            let corners = [
                (row, column),
                (row + 1, column),
                (row + 1, column + 1),
                (row, column + 1),
            ];
            let face = corners.map(|(row, column)| place(mesh, row, column));
            mesh.faces.push(face.to_vec());
        }
    }
}
