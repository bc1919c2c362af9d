//! The cells of a grid around an emitting medium: points are drawn from them, and line integrals computed over them.

use crate::math::{Ray, Vec3};
use crate::world::light::cdf;
use glam::{Affine3A, DAffine3, DVec3, UVec3};

/// A density of points in space that is constant within each cell of a grid.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    count: UVec3,
    /// Render space to cell space, in which a cell is a unit cube and the first cell begins at the origin.
    to_cells: Affine3A,
    from_cells: Affine3A,
    /// By cell, x fastest: density of points per volume of render space.
    density: Vec<f32>,
    /// Running sums over layers, over the rows of each layer, and over the cells of each row.
    layers: Vec<f32>,
    rows: Vec<f32>,
    cells: Vec<f32>,
}

/// A line's integrals over cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Line {
    /// Integral of the density along it, per area.
    pub across: f32,
    /// The same times the squared distance from the line's start: density of directions towards drawn points, per solid
    /// angle.
    pub towards: f32,
    /// Cells along it with a density above zero.
    pub cells: u32,
}

impl Cells {
    /// `to_render`: from cell space. `weights`: total of each cell, x fastest; at least one is positive.
    pub fn new(count: UVec3, to_render: DAffine3, weights: &[f64]) -> Self {
        let [nx, ny, nz] = count.to_array().map(|n| n as usize);
        let sums = |weights: &[f64]| match weights.iter().any(|w| *w > 0.0) {
            true => cdf::running_sums(weights),
            // Never read.
            false => vec![1.0; weights.len()],
        };
        let of_row = |row: usize| &weights[row * nx..(row + 1) * nx];
        let row_weights: Vec<f64> = (0..ny * nz).map(|row| of_row(row).iter().sum()).collect();
        let of_layer = |layer: usize| &row_weights[layer * ny..(layer + 1) * ny];
        let layer_weights: Vec<f64> = (0..nz).map(|layer| of_layer(layer).iter().sum()).collect();
        let layers = sums(&layer_weights);
        let rows: Vec<f32> = (0..nz).flat_map(|layer| sums(of_layer(layer))).collect();
        let cells: Vec<f32> = (0..ny * nz).flat_map(|row| sums(of_row(row))).collect();
        let volume = to_render.matrix3.determinant().abs();
        let density = (0..nx * ny * nz).map(|i| {
            let (row, layer) = (i / nx, i / (nx * ny));
            // The drawn probabilities, including their rounding.
            let share = f64::from(cdf::pmf(&layers, layer))
                * f64::from(cdf::pmf(&rows[layer * ny..(layer + 1) * ny], row % ny))
                * f64::from(cdf::pmf(&cells[row * nx..(row + 1) * nx], i % nx));
            (if weights[i] > 0.0 { share / volume } else { 0.0 }) as f32
        });
        Self {
            count,
            density: density.collect(),
            to_cells: to_render.inverse().as_affine3a(),
            from_cells: to_render.as_affine3a(),
            layers,
            rows,
            cells,
        }
    }

    /// A point by three uniform numbers, and its density.
    pub fn sample(&self, u: [f32; 3]) -> (Vec3, f32) {
        let [nx, ny, _] = self.count.to_array().map(|n| n as usize);
        let layer = cdf::choose(&self.layers, u[2]);
        let first_row = layer.index * ny;
        let row = cdf::choose(&self.rows[first_row..first_row + ny], u[1]);
        let first = (first_row + row.index) * nx;
        let cell = cdf::choose(&self.cells[first..first + nx], u[0]);
        let at = Vec3::new(
            cell.index as f32 + cell.u,
            row.index as f32 + row.u,
            layer.index as f32 + layer.u,
        );
        (self.from_cells.transform_point3(at), self.density[first + cell.index])
    }

    /// Centre of the grid, and half its diagonal, render space.
    pub fn ball(&self) -> (Vec3, f32) {
        let half = 0.5 * self.count.as_vec3();
        let center = self.from_cells.transform_point3(half);
        let corner = |i: u32| {
            let side = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
            self.from_cells
                .transform_point3(side * self.count.as_vec3())
                .distance(center)
        };
        (center, (0..8).map(corner).fold(0.0, f32::max))
    }

    /// The part of a ray, up to `length`, inside the grid.
    pub fn clip(&self, ray: &Ray, length: f32) -> Option<[f32; 2]> {
        let (origin, dir) = self.of(ray);
        self.clip_of(origin, dir, length)
    }

    fn of(&self, ray: &Ray) -> (Vec3, Vec3) {
        (
            self.to_cells.transform_point3(ray.origin),
            self.to_cells.transform_vector3(ray.dir),
        )
    }

    fn clip_of(&self, origin: Vec3, dir: Vec3, length: f32) -> Option<[f32; 2]> {
        let (mut start, mut end) = (0.0f32, length);
        for axis in 0..3 {
            let (o, d, high) = (origin[axis], dir[axis], self.count[axis] as f32);
            if d == 0.0 {
                if !(0.0..=high).contains(&o) {
                    return None;
                }
                continue;
            }
            let (a, b) = (-o / d, (high - o) / d);
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
        (start < end && end.is_finite()).then_some([start, end])
    }

    /// Visits each cell along a ray up to `length`, with its density and where the ray enters and leaves it
    /// (Amanatides, Woo 1987).
    pub fn along(&self, ray: &Ray, length: f32, mut visit: impl FnMut(f32, [f32; 2])) {
        let (origin, dir) = self.of(ray);
        let Some([mut at, end]) = self.clip_of(origin, dir, length) else {
            return;
        };
        let start = origin + dir * at;
        // Conversion to unsigned numbers saturates.
        let mut cell = start.to_array().map(|x| x as u32);
        for (cell, count) in cell.iter_mut().zip(self.count.to_array()) {
            *cell = (*cell).min(count - 1);
        }
        let plane = |axis: usize, cell: u32| match dir[axis] {
            0.0 => f32::INFINITY,
            d => (cell as f32 + f32::from(u8::from(d > 0.0)) - origin[axis]) / d,
        };
        let mut next: [f32; 3] = std::array::from_fn(|axis| plane(axis, cell[axis]));
        loop {
            let axis = match next {
                [x, y, z] if x <= y && x <= z => 0,
                [_, y, z] if y <= z => 1,
                _ => 2,
            };
            let leaves = next[axis].min(end);
            if leaves > at {
                let [x, y, z] = cell;
                let density = self.density[(x + self.count.x * (y + self.count.y * z)) as usize];
                visit(density, [at, leaves]);
                at = leaves;
            }
            let is_last = match dir[axis] > 0.0 {
                true => cell[axis] + 1 >= self.count[axis],
                false => cell[axis] == 0,
            };
            if next[axis] >= end || is_last {
                return;
            }
            cell[axis] = match dir[axis] > 0.0 {
                true => cell[axis] + 1,
                false => cell[axis] - 1,
            };
            next[axis] = plane(axis, cell[axis]);
        }
    }

    /// The density integrals along a ray up to `length`.
    pub fn line(&self, ray: &Ray, length: f32) -> Line {
        let mut line = Line::default();
        self.along(ray, length, |density, [a, b]| {
            line.across += density * (b - a);
            line.towards += density * ((b - a) * (a * a + a * b + b * b) * (1.0 / 3.0));
            line.cells += u32::from(density > 0.0);
        });
        line
    }
}

/// Roughly cubic cells of a box, at most this many along the longest side, and the map from them.
pub(super) fn grid(low: DVec3, high: DVec3, most: u32) -> (UVec3, DAffine3) {
    let size = high - low;
    let side = size.max_element() / f64::from(most);
    let count = size.to_array().map(|length| (length / side).round().max(1.0) as u32);
    let count = UVec3::from(count);
    let step = size / count.as_dvec3();
    (count, DAffine3::from_translation(low) * DAffine3::from_scale(step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp::uniform_sphere;

    fn some() -> Cells {
        let weights: Vec<f64> = (0..24).map(|i| f64::from(i % 5)).collect();
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::new(0.5, 0.8, 0.4),
            glam::DQuat::from_rotation_y(0.7),
            DVec3::new(1.0, -2.0, 0.5),
        );
        Cells::new(UVec3::new(2, 3, 4), map, &weights)
    }

    /// Points have the stated density where they are drawn, and no direction towards them is missing: the densities
    /// integrate to one over space and over directions.
    #[test]
    fn densities_integrate_to_one() {
        let cells = some();
        let mut sampler = Sampler::new(3, 0, Purpose::Test, 0);
        let volume = f64::from(cells.from_cells.matrix3.determinant().abs());
        let total: f64 = cells.density.iter().map(|p| f64::from(*p) * volume).sum();
        assert!((total - 1.0).abs() < 1e-5, "{total}");
        for from in [Vec3::new(1.5, -1.0, 1.0), Vec3::new(4.0, 0.0, -3.0)] {
            let (mut sum, mut squares, n) = (0.0, 0.0, 200_000);
            for _ in 0..n {
                let dir = uniform_sphere(sampler.next_2d());
                let ray = Ray { origin: from, dir };
                let value = f64::from(cells.line(&ray, f32::INFINITY).towards * 4.0 * crate::math::PI);
                sum += value / f64::from(n);
                squares += value * value / f64::from(n);
            }
            let error = ((squares - sum * sum) / f64::from(n)).sqrt();
            assert!((sum - 1.0).abs() < 4.0 * error + 1e-4, "{sum} +- {error}");
        }
    }

    /// A direction towards a drawn point has a positive density.
    #[test]
    fn points_lie_on_lines_that_know_them() {
        let cells = some();
        let mut sampler = Sampler::new(4, 0, Purpose::Test, 0);
        let from = Vec3::new(1.2, -1.5, 0.9);
        // The mean of a function over its density is its integral: here of a clamped cosine over the sphere.
        let (mut sum, mut squares, n) = (0.0, 0.0, 100_000);
        let axis = Vec3::new(0.2, 0.3, 0.9).normalize();
        for _ in 0..n {
            let [u, v] = sampler.next_2d().to_array();
            let (point, density) = cells.sample([u, v, sampler.next_1d()]);
            assert!(density > 0.0);
            let dir = (point - from).normalize();
            let line = cells.line(&Ray { origin: from, dir }, f32::INFINITY);
            assert!(line.towards > 0.0 && line.cells > 0);
            // The constant keeps the divisor above zero.
            let value = f64::from(dir.dot(axis).max(0.0) / (line.towards + 0.2));
            sum += value / f64::from(n);
            squares += value * value / f64::from(n);
        }
        let error = ((squares - sum * sum) / f64::from(n)).sqrt();
        let (mut expected, m) = (0.0, 300_000);
        for _ in 0..m {
            let dir = uniform_sphere(sampler.next_2d());
            let towards = cells.line(&Ray { origin: from, dir }, f32::INFINITY).towards;
            let value = f64::from(dir.dot(axis).max(0.0) * towards / (towards + 0.2));
            expected += value * 4.0 * std::f64::consts::PI / f64::from(m);
        }
        assert!(
            (sum - expected).abs() < 5.0 * error + 3e-3 * expected,
            "{sum} {expected} {error}"
        );
    }
}
