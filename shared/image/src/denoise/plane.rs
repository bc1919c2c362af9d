//! Planes of numbers: means over windows, and an image pyramid.

use rayon::prelude::*;

/// One number per pixel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl Plane {
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            values: vec![0.0; width * height],
        }
    }

    pub fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..(y + 1) * self.width]
    }

    /// A plane of this size. `fill` makes each row from its number alone.
    pub fn from_rows(width: usize, height: usize, fill: impl Fn(usize, &mut [f32]) + Sync) -> Self {
        let mut plane = Self::new(width, height);
        plane.fill(&fill);
        plane
    }

    /// Not generic: the code that shares rows among threads is as long as thirty of the functions that fill them.
    fn fill(&mut self, row: &(dyn Fn(usize, &mut [f32]) + Sync)) {
        let rows = self.values.par_chunks_mut(self.width.max(1)).enumerate();
        rows.for_each(|(y, values)| row(y, values));
    }

    /// A function of the values of several planes of equal size, pixel by pixel.
    pub fn of<const N: usize>(planes: [&Self; N], value: impl Fn([f32; N]) -> f32 + Sync) -> Self {
        Self::from_rows(planes[0].width, planes[0].height, |y, row| {
            let rows = planes.map(|plane| plane.row(y));
            for (x, out) in row.iter_mut().enumerate() {
                *out = value(rows.map(|row| row[x]));
            }
        })
    }

    /// Means over squares that reach `radius` pixels to all sides, cut off at the borders. Each square is added up
    /// anew: running sums would keep a firefly's rounding errors.
    pub fn blurred(&self, radius: usize) -> Self {
        let (width, height) = (self.width, self.height);
        let across = Self::from_rows(width, height, |y, row| {
            let values = self.row(y);
            for (x, out) in row.iter_mut().enumerate() {
                let window = &values[x.saturating_sub(radius)..width.min(x + radius + 1)];
                *out = window.iter().sum::<f32>() / window.len() as f32;
            }
        });
        Self::from_rows(width, height, |y, row| {
            let window = y.saturating_sub(radius)..height.min(y + radius + 1);
            let count = window.len() as f32;
            for y in window {
                for (sum, value) in row.iter_mut().zip(across.row(y)) {
                    *sum += value;
                }
            }
            row.iter_mut().for_each(|sum| *sum /= count);
        })
    }

    /// The largest value of each pixel and the eight around it.
    pub fn maxima(&self) -> Self {
        Self::from_rows(self.width, self.height, |y, row| {
            let rows = y.saturating_sub(1)..self.height.min(y + 2);
            for (x, out) in row.iter_mut().enumerate() {
                let columns = x.saturating_sub(1)..self.width.min(x + 2);
                let values = rows.clone().flat_map(|y| &self.row(y)[columns.clone()]);
                *out = values.copied().fold(f32::MIN, f32::max);
            }
        })
    }

    /// Half the size, rounded up: means of 2 x 2 pixels, with the last ones repeated.
    pub fn halved(&self) -> Self {
        let last = (self.width - 1, self.height - 1);
        Self::from_rows(self.width.div_ceil(2), self.height.div_ceil(2), |y, row| {
            let (upper, lower) = (self.row(2 * y), self.row(last.1.min(2 * y + 1)));
            for (x, out) in row.iter_mut().enumerate() {
                let (left, right) = (2 * x, last.0.min(2 * x + 1));
                *out = 0.25 * (upper[left] + upper[right] + lower[left] + lower[right]);
            }
        })
    }

    /// A plane of about twice the size, by linear interpolation between pixel centres.
    pub fn doubled(&self, width: usize, height: usize) -> Self {
        let last = (self.width - 1, self.height - 1);
        Self::from_rows(width, height, |y, row| {
            let ((y0, y1), v) = between(y, last.1);
            let (upper, lower) = (self.row(y0), self.row(y1));
            for (x, out) in row.iter_mut().enumerate() {
                let ((x0, x1), u) = between(x, last.0);
                let a = upper[x0] * (1.0 - u) + upper[x1] * u;
                let b = lower[x0] * (1.0 - u) + lower[x1] * u;
                *out = a * (1.0 - v) + b * v;
            }
        })
    }
}

/// The two places of a halved line around the i-th pixel of the whole line, and the weight of the second.
fn between(i: usize, last: usize) -> ((usize, usize), f32) {
    match i % 2 {
        0 => (((i / 2).saturating_sub(1).min(last), (i / 2).min(last)), 0.75),
        _ => (((i / 2).min(last), (i / 2 + 1).min(last)), 0.25),
    }
}

/// Red, green and blue.
pub type Colours = [Plane; 3];

/// Colours from a function of the channel.
pub fn each(channel: impl FnMut(usize) -> Plane) -> Colours {
    std::array::from_fn(channel)
}
