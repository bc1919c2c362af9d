//! A point lamp whose intensity is a table over directions, as goniophotometers measure it.
//!
//! The intensity is bilinear in the table's angles. Directions are drawn in proportion to the light of the cells
//! between neighbouring angles, and uniformly by solid angle within a cell. For a lamp that a spot's cone cuts, the
//! table describes both together.

use super::cdf;
use crate::math::{PI, Rgb, Vec2, Vec3, atan2, sin_cos};
use std::f64::consts;
use std::sync::Arc;

/// A lamp with an intensity table.
#[derive(Clone, Debug)]
pub struct Goniometric {
    /// Position, render space.
    pub position: Vec3,
    /// Orthogonal unit vectors: towards horizontal angles 0 and 90 degrees, and towards vertical angle 0.
    pub axes: [Vec3; 3],
    /// W/sr where the table is 1.
    pub scale: Rgb,
    /// The intensities.
    pub table: Arc<AngularTable>,
}

/// Intensities over directions.
#[derive(Clone, Debug)]
pub struct AngularTable {
    /// Angles from the axis, radians within [0, pi], ascending.
    vertical: Vec<f32>,
    /// Angles around it, radians, from 0 to 2 pi.
    horizontal: Vec<f32>,
    /// By rows of vertical angles.
    values: Vec<f32>,
    /// One minus the cosines of the vertical angles.
    heights: Vec<f32>,
    /// Running sums over the rows of cells, and over the cells of each row.
    rows: Vec<f32>,
    cells: Vec<f32>,
    /// Integral over all directions, sr.
    integral: f64,
}

impl AngularTable {
    /// A table over ascending angles in radians: `vertical` from the axis, within [0, pi]; `horizontal` around it, from
    /// 0 to 2 pi; `values` by rows of vertical angles, not negative. `None` if there is no light, if a list has fewer
    /// than two angles, or if the table is malformed.
    pub fn new(vertical: &[f64], horizontal: &[f64], values: &[f64]) -> Option<Self> {
        let ascends = |angles: &[f64]| angles.len() >= 2 && angles.is_sorted_by(|a, b| (*a as f32) < (*b as f32));
        let (rows, columns) = (vertical.len(), horizontal.len());
        let is_table = ascends(vertical)
            && ascends(horizontal)
            && values.len() == rows * columns
            && values.iter().all(|value| *value >= 0.0 && (*value as f32).is_finite())
            && vertical[0] >= 0.0
            && vertical[rows - 1] <= consts::PI + 1e-9
            && horizontal[0] == 0.0
            && (horizontal[columns - 1] - 2.0 * consts::PI).abs() < 1e-9;
        if !is_table {
            return None;
        }
        // Integral over [a, b] of the linear function from p to q times the sine; by its series for narrow intervals.
        let slice = |[a, b]: [f64; 2], [p, q]: [f64; 2]| {
            let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
            let (sin, cos) = libm::sincos(middle);
            let [even, odd] = match half < 1e-2 {
                true => {
                    let h2 = half * half;
                    [
                        2.0 * half * (1.0 - h2 / 6.0 + h2 * h2 / 120.0),
                        2.0 / 3.0 * half * h2 * (1.0 - h2 / 10.0),
                    ]
                }
                // Integrals of cos x and of x sin x over [-half, half].
                false => {
                    let (sin, cos) = libm::sincos(half);
                    [2.0 * sin, 2.0 * (sin - half * cos)]
                }
            };
            0.5 * (p + q) * sin * even + 0.5 * (q - p) / half * cos * odd
        };
        let weight = |row: usize, column: usize| {
            let at = |row: usize| {
                let [left, right] = [column, column + 1].map(|column| values[row * columns + column]);
                0.5 * (left + right)
            };
            let width = horizontal[column + 1] - horizontal[column];
            width * slice([vertical[row], vertical[row + 1]], [at(row), at(row + 1)]).max(0.0)
        };
        let (mut of_rows, mut cells) = (Vec::new(), Vec::new());
        for row in 0..rows - 1 {
            let weights: Vec<f64> = (0..columns - 1).map(|column| weight(row, column)).collect();
            let sum: f64 = weights.iter().sum();
            of_rows.push(sum);
            cells.extend(match sum > 0.0 {
                true => cdf::running_sums(&weights),
                false => vec![0.0; columns - 1],
            });
        }
        let integral: f64 = of_rows.iter().sum();
        let single = |all: &[f64]| all.iter().map(|x| *x as f32).collect::<Vec<f32>>();
        (integral > 0.0 && (integral as f32).is_finite()).then(|| Self {
            vertical: vertical.iter().map(|angle| (*angle as f32).min(PI)).collect(),
            horizontal: single(horizontal),
            values: single(values),
            heights: (vertical
                .iter()
                .map(|angle| (2.0 * libm::pow(libm::sin(0.5 * angle), 2.0)) as f32))
            .collect(),
            rows: cdf::running_sums(&of_rows),
            cells,
            integral,
        })
    }

    /// Integral over all directions, sr.
    pub fn integral(&self) -> f64 {
        self.integral
    }

    /// The cell that a direction is in, and its position in it. The direction: coordinates along the axes, any length.
    fn find(&self, local: Vec3) -> Option<([usize; 2], Vec2)> {
        let theta = atan2(local.truncate().length(), local.z);
        let phi = atan2(local.y, local.x);
        let phi = if phi < 0.0 { phi + 2.0 * PI } else { phi };
        let place = |angles: &[f32], angle: f32| {
            let after = angles.partition_point(|edge| *edge <= angle).clamp(1, angles.len() - 1);
            let [a, b] = [angles[after - 1], angles[after]];
            (after - 1, ((angle - a) / (b - a)).clamp(0.0, 1.0))
        };
        let last = self.vertical.len() - 1;
        let is_in = theta >= self.vertical[0] && theta <= self.vertical[last];
        is_in.then(|| {
            let (row, y) = place(&self.vertical, theta);
            let (column, x) = place(&self.horizontal, phi);
            ([row, column], Vec2::new(x, y))
        })
    }

    fn value(&self, local: Vec3) -> f32 {
        self.find(local).map_or(0.0, |([row, column], Vec2 { x, y })| {
            let columns = self.horizontal.len();
            let at = |row: usize| {
                let [left, right] = [column, column + 1].map(|column| self.values[row * columns + column]);
                left + (right - left) * x
            };
            let [upper, lower] = [row, row + 1].map(at);
            upper + (lower - upper) * y
        })
    }

    /// Density per solid angle of directions in a cell.
    fn density(&self, [row, column]: [usize; 2]) -> f32 {
        let count = self.horizontal.len() - 1;
        let pmf = cdf::pmf(&self.rows, row) * cdf::pmf(&self.cells[row * count..][..count], column);
        let width = self.horizontal[column + 1] - self.horizontal[column];
        pmf / (width * (self.heights[row + 1] - self.heights[row]))
    }

    /// A unit direction in the axes' coordinates.
    fn sample(&self, u: Vec2) -> Vec3 {
        let row = cdf::choose(&self.rows, u.x);
        let count = self.horizontal.len() - 1;
        let column = cdf::choose(&self.cells[row.index * count..][..count], u.y);
        let [from, to] = [self.heights[row.index], self.heights[row.index + 1]];
        let height = from + (to - from) * row.u;
        let [from, to] = [self.horizontal[column.index], self.horizontal[column.index + 1]];
        let (sin, cos) = sin_cos(from + (to - from) * column.u);
        let across = (height * (2.0 - height)).max(0.0).sqrt();
        Vec3::new(across * cos, across * sin, 1.0 - height)
    }

    /// The widest angle to the axis with any light, radians.
    pub(super) fn widest(&self) -> f32 {
        let last = self
            .rows
            .iter()
            .position(|sum| *sum >= 1.0)
            .unwrap_or(self.rows.len() - 1);
        self.vertical[last + 1]
    }
}

impl Goniometric {
    fn local(&self, dir: Vec3) -> Vec3 {
        Vec3::from(self.axes.map(|axis| axis.dot(dir)))
    }

    /// W/sr in a direction of any length.
    pub fn intensity(&self, dir: Vec3) -> Rgb {
        self.scale * self.table.value(self.local(dir))
    }

    /// W.
    pub(super) fn power(&self) -> Rgb {
        self.scale * self.table.integral as f32
    }

    /// A unit direction, and its density per solid angle.
    pub(super) fn sample(&self, u: Vec2) -> (Vec3, f32) {
        let local = self.table.sample(u);
        let [s, t, n] = self.axes;
        let dir = s * local.x + t * local.y + n * local.z;
        (dir, self.pdf(dir))
    }

    /// Density of [`Self::sample`].
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        let found = self.table.find(self.local(dir));
        found.map_or(0.0, |(cell, _)| self.table.density(cell))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::world::light::{EmissionUniforms, Light, LightHit, LightKind, SceneBounds};
    use beamfarm_image::layer::LightGroup;

    const BOUNDS: SceneBounds = SceneBounds {
        center: Vec3::ZERO,
        radius: 10.0,
    };

    /// Vertical angles and horizontal ones in degrees, and values by rows.
    fn table(vertical: &[f64], horizontal: &[f64], value: impl Fn(f64, f64) -> f64) -> AngularTable {
        let values = vertical.iter().flat_map(|v| horizontal.iter().map(|h| value(*v, *h)));
        let values: Vec<f64> = values.collect();
        let radians = |angles: &[f64]| angles.iter().map(|angle| angle.to_radians()).collect::<Vec<f64>>();
        AngularTable::new(&radians(vertical), &radians(horizontal), &values).unwrap()
    }

    fn tables() -> [AngularTable; 4] {
        let fine: Vec<f64> = (0..=36).map(|i| f64::from(i) * 2.5).collect();
        [
            // Uniform.
            table(&[0.0, 180.0], &[0.0, 360.0], |_, _| 2.0),
            // Narrow, to one side, and dark in a quarter.
            table(
                &[0.0, 0.5, 1.0, 5.0, 40.0, 90.0],
                &[0.0, 90.0, 200.0, 210.0, 360.0],
                |v, h| {
                    if h == 90.0 || h == 200.0 { 0.0 } else { 90.0 - v }
                },
            ),
            table(&fine, &[0.0, 360.0], |v, _| {
                libm::pow(libm::cos(v.to_radians()).max(0.0), 3.0)
            }),
            // Upwards only.
            table(&[90.0, 120.0, 180.0], &[0.0, 120.0, 240.0, 360.0], |v, h| v + h % 360.0),
        ]
    }

    fn lamp(table: AngularTable) -> Light {
        let n = Vec3::new(0.3, -1.0, 0.2).normalize();
        let s = n.any_orthonormal_vector();
        Light {
            name: "lamp".into(),
            kind: LightKind::Goniometric(Goniometric {
                position: Vec3::new(1.0, 2.0, 3.0),
                axes: [s, n.cross(s), n],
                scale: Rgb::new(3.0, 2.0, 0.5),
                table: Arc::new(table),
            }),
            group: LightGroup::named("lamp"),
        }
    }

    /// Directions are found in their cells, and interpolation between angles is bilinear.
    #[test]
    fn tables_are_looked_up_by_angles() {
        let table = table(&[0.0, 30.0, 90.0], &[0.0, 90.0, 360.0], |v, h| v + 10.0 * (h % 360.0));
        for (v, h, expected) in [
            (15.0f64, 45.0f64, 465.0),
            (30.0, 90.0, 930.0),
            (60.0, 225.0, 510.0),
            (60.0, 360.0, 60.0),
        ] {
            let (sv, cv) = libm::sincos(v.to_radians());
            let (sh, ch) = libm::sincos(h.to_radians());
            let dir = 3.0 * Vec3::new((sv * ch) as f32, (sv * sh) as f32, cv as f32);
            assert!(
                (table.value(dir) / expected - 1.0).abs() < 1e-3,
                "{v} {h} {}",
                table.value(dir)
            );
        }
        assert_eq!(table.value(Vec3::new(0.1, 0.0, -1.0)), 0.0);
        let radians = |angles: &[f64]| angles.iter().map(|angle| angle.to_radians()).collect::<Vec<f64>>();
        let whole = radians(&[0.0, 360.0]);
        for (vertical, values) in [
            (&[0.0, 0.0][..], &[1.0; 4][..]),
            (&[0.0, 90.0], &[0.0; 4]),
            (&[0.0, 90.0], &[1.0; 3]),
            (&[0.0], &[1.0; 2]),
        ] {
            assert!(AngularTable::new(&radians(vertical), &whole, values).is_none());
        }
    }

    /// The integral equals that over a lattice of directions; in closed form for a uniform lamp.
    #[test]
    fn the_power_is_the_integral() {
        for (number, table) in tables().into_iter().enumerate() {
            const N: u32 = 1500;
            let mut sum = 0.0;
            for i in 0..N {
                let theta = consts::PI * (f64::from(i) + 0.5) / f64::from(N);
                let (sin, cos) = libm::sincos(theta);
                for j in 0..N {
                    let (s, c) = libm::sincos(2.0 * consts::PI * (f64::from(j) + 0.5) / f64::from(N));
                    let dir = Vec3::new((sin * c) as f32, (sin * s) as f32, cos as f32);
                    sum += f64::from(table.value(dir)) * sin * 2.0 * consts::PI * consts::PI / f64::from(N * N);
                }
            }
            assert!(
                (table.integral() / sum - 1.0).abs() < 1e-3,
                "{number}: {} {sum}",
                table.integral()
            );
        }
        let [even, ..] = tables();
        assert!((even.integral() / (8.0 * consts::PI) - 1.0).abs() < 1e-12);
    }

    /// The mean power of photons is the lamp's, their densities integrate to one, each carries intensity over density,
    /// and shadow rays bring a point what leaves towards it.
    #[test]
    fn photons_carry_what_the_lamp_emits() {
        for (number, table) in tables().into_iter().enumerate() {
            let light = lamp(table);
            let LightKind::Goniometric(lamp) = &light.kind else {
                unreachable!()
            };
            let power = light.power(&[], &BOUNDS);
            const N: usize = 40_000;
            let (mut sum, mut squares, mut ones, mut one_squares) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
            for i in 0..N {
                let mut sampler = Sampler::new(1, 0, Purpose::Test, i as u64);
                let start = light.sample_emission(&[], &BOUNDS, EmissionUniforms::draw(&mut sampler));
                let expected = lamp.intensity(start.dir) / start.pdf_dir;
                assert!((start.power - expected).abs().max_element() <= 1e-3 * power.max_element());
                let x = f64::from(start.power.x / power.x);
                (sum, squares) = (sum + x, squares + x * x);
                let dir = crate::warp::uniform_sphere(sampler.next_2d());
                let one = f64::from(lamp.pdf(dir) * 4.0 * PI);
                (ones, one_squares) = (ones + one, one_squares + one * one);
                if let Some(direct) = light.sample_direct(&[], lamp.position + dir * 2.0, Vec2::ZERO, 0.0) {
                    assert!(
                        (direct.weight * 4.0 - lamp.intensity(dir)).abs().max_element()
                            < 1e-2 * lamp.intensity(dir).max_element()
                    );
                    let at = LightHit {
                        normal: dir,
                        primitive: 0,
                        distance: 2.0,
                    };
                    let density = light.photon_density(&[], &BOUNDS, lamp.position + dir * 2.0, -dir, at);
                    assert!((density * 4.0 - lamp.pdf(dir)).abs() <= 1e-3 * lamp.pdf(dir));
                }
            }
            let n = N as f64;
            let error = |sum: f64, squares: f64| ((squares / n - (sum / n) * (sum / n)).max(0.0) / n).sqrt();
            assert!(
                (sum / n - 1.0).abs() < 4.0 * error(sum, squares) + 1e-3,
                "{number}: {}",
                sum / n
            );
            assert!(
                (ones / n - 1.0).abs() < 4.0 * error(ones, one_squares) + 1e-5,
                "{number}: {}",
                ones / n
            );
        }
    }
}
