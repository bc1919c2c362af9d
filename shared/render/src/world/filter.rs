//! Reconstruction filters: how a pixel weighs the image around its centre.
//!
//! A pixel is the weighted mean of the radiance around it; the weight is a product of the same function in x and y. At
//! the image border the filter is clipped and renormalised, as in Mitsuba 3.
//!
//! Each pass has one sample in each pixel's square, which counts for every pixel whose filter covers it. A pixel's
//! noise thus comes from several samples and is correlated with that of its neighbours. All samples of a pass are at
//! the same place within their pixels, so that the sum of their weights hardly varies. The weights are normalised by
//! the filter, not by the samples that happen to be near, which keeps every pass unbiased. Most samples would miss a
//! filter narrower than a pixel; there a pixel's sample is drawn from its filter and counts for that pixel only.

use crate::math::Vec2;
use beamfarm_image::film::Film;
use libm::{erf, exp};
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::ops::Range;

/// A reconstruction filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PixelFilter {
    /// The pixel's square.
    #[default]
    Box,
    /// 1 - |x| / `radius`.
    Tent {
        /// Where it is 0, pixels.
        radius: f32,
    },
    /// exp(-x^2 / (2 `stddev`^2)), less its value at 4 `stddev`, where it ends.
    Gaussian {
        /// Pixels.
        stddev: f32,
    },
}

/// A Gaussian ends at this many standard deviations.
const GAUSSIAN_REACH: f64 = 4.0;

/// Values of a pixel.
const CHANNELS: usize = 3;

/// More steps than Newton's method ever needs.
const MAX_STEPS: u32 = 64;

impl PixelFilter {
    /// Whether a sample counts for several pixels: if the integral of the squared filter is less than one.
    #[inline]
    pub fn spreads(&self) -> bool {
        match *self {
            Self::Box => false,
            Self::Tent { radius } => radius > 2.0 / 3.0,
            Self::Gaussian { stddev } => stddev > 0.282_094_8,
        }
    }

    /// Turns films of samples into films of pixels, in place. All samples are at the same `offset` in [0, 1)^2 within
    /// their pixels. For filters that spread.
    pub fn reconstruct<'a>(&self, films: impl IntoIterator<Item = &'a mut Film>, offset: Vec2) {
        for film in films {
            let (width, height) = (film.width as usize, film.height as usize);
            let [along_x, along_y] =
                [(film.width, offset.x), (film.height, offset.y)].map(|(s, o)| Taps::new(self, s, o));
            // All channels side by side, tap by tap, so that the loop vectorises.
            let values = CHANNELS * width;
            let mut rows = vec![0.0; film.pixels.len() * CHANNELS];
            let weights = along_x.by_tap(width);
            for (row, samples) in rows.chunks_mut(values).zip(film.pixels.chunks(width)) {
                let samples = samples.as_flattened();
                for (tap, weights) in weights.iter().enumerate() {
                    let (to, from) = along_x.overlap(tap, width);
                    let to = CHANNELS * to.start..CHANNELS * to.end;
                    let sums = row[to.clone()].iter_mut().zip(&weights[to]);
                    for ((sum, weight), value) in sums.zip(&samples[CHANNELS * from.start..]) {
                        *sum += weight * value;
                    }
                }
            }
            for (y, row) in film.pixels.chunks_mut(width).enumerate() {
                let row = row.as_flattened_mut();
                row.fill(0.0);
                for (place, weight) in along_y.around(y, height) {
                    for (sum, value) in row.iter_mut().zip(&rows[place * values..]) {
                        *sum += weight * value;
                    }
                }
            }
        }
    }

    /// Where the sample of a pixel is in an image of `size` pixels: (0, 0) is the top left corner. `u` in [0, 1)^2.
    #[inline]
    pub fn sample(&self, pixel: [u32; 2], size: [u32; 2], u: Vec2) -> Vec2 {
        let [x, y] = pixel;
        match self.spreads() || matches!(self, Self::Box) {
            true => Vec2::new(x as f32, y as f32) + u,
            false => Vec2::new(self.sample_axis(x, size[0], u.x), self.sample_axis(y, size[1], u.y)),
        }
    }

    /// The filter, not normalised, in its own unit of length.
    fn value(&self, x: f64) -> f64 {
        match self {
            Self::Box => f64::from(x.abs() <= 1.0),
            Self::Tent { .. } => (1.0 - x.abs()).max(0.0),
            Self::Gaussian { .. } => (gaussian(x) - gaussian(GAUSSIAN_REACH)).max(0.0),
        }
    }

    /// Integral of each pixel's filter along an axis, within the image; pixels.
    fn integrals(&self, size: u32) -> Vec<f64> {
        let (unit, reach) = self.unit();
        let within = |pixel| {
            let center = f64::from(pixel) + 0.5;
            let low = -reach.min(center / unit);
            let high = reach.min((f64::from(size) - center) / unit);
            unit * (self.integral(high) - self.integral(low))
        };
        (0..size).map(within).collect()
    }

    /// Inverts the distribution of the distance from the pixel's centre, between the borders of the image.
    fn sample_axis(&self, pixel: u32, size: u32, u: f32) -> f32 {
        let (unit, reach) = self.unit();
        let center = f64::from(pixel) + 0.5;
        let low = -reach.min(center / unit);
        let high = reach.min((f64::from(size) - center) / unit);
        let (below, above) = (self.integral(low), self.integral(high));
        let share = below + (above - below) * f64::from(u);
        let at = self.inverse(share).clamp(low, high);
        (center + at * unit) as f32
    }

    /// The filter's unit of length in pixels, and where the filter ends in that unit.
    fn unit(&self) -> (f64, f64) {
        match *self {
            Self::Box => (0.5, 1.0),
            Self::Tent { radius } => (radius.into(), 1.0),
            Self::Gaussian { stddev } => (stddev.into(), GAUSSIAN_REACH),
        }
    }

    /// Integral of the filter from its centre.
    fn integral(&self, x: f64) -> f64 {
        match self {
            Self::Box => x,
            Self::Tent { .. } => x - 0.5 * x * x.abs(),
            Self::Gaussian { .. } => (0.5 * PI).sqrt() * erf(x * FRAC_1_SQRT_2) - x * gaussian(GAUSSIAN_REACH),
        }
    }

    /// The point at which the integral from the centre is `share`.
    fn inverse(&self, share: f64) -> f64 {
        let wanted = share.abs();
        let x = match self {
            Self::Box => wanted,
            // 1 - sqrt(1 - 2 share), without cancellation.
            Self::Tent { .. } => 2.0 * wanted / (1.0 + (1.0 - 2.0 * wanted).max(0.0).sqrt()),
            Self::Gaussian { .. } => {
                // The integral is concave: from the centre, Newton's method converges from one side.
                let mut x = 0.0;
                for _ in 0..MAX_STEPS {
                    let slope = gaussian(x) - gaussian(GAUSSIAN_REACH);
                    let step = (wanted - self.integral(x)) / slope;
                    if step.is_nan() || step < 1e-9 {
                        break;
                    }
                    x = (x + step).min(GAUSSIAN_REACH);
                }
                x
            }
        };
        x.copysign(share)
    }
}

/// Weights of the samples around pixels along an axis.
struct Taps {
    /// Pixels to each side.
    reach: usize,
    /// By pixel: weights of the samples around it, in order; they sum to one over the image.
    weights: Vec<f32>,
}

impl Taps {
    /// `offset`: of the samples within their pixels.
    fn new(filter: &PixelFilter, size: u32, offset: f32) -> Self {
        let (unit, reach) = filter.unit();
        // Samples are less than half a pixel from their pixel's centre.
        let pixels = (unit * reach + 0.5).ceil() - 1.0;
        let weight = |tap| filter.value((f64::from(tap) - pixels + f64::from(offset) - 0.5) / unit);
        let weights: Vec<f64> = (0..=2 * pixels as u32).map(weight).collect();
        let integrals = filter.integrals(size);
        let of_pixel = |integral| weights.iter().map(move |weight| (weight / integral) as f32);
        Self {
            reach: pixels as usize,
            weights: integrals.into_iter().flat_map(of_pixel).collect(),
        }
    }

    fn count(&self) -> usize {
        2 * self.reach + 1
    }

    /// Pixels, among `size`, for which this tap lies within the image, and the places of its samples.
    fn overlap(&self, tap: usize, size: usize) -> (Range<usize>, Range<usize>) {
        let (before, after) = (self.reach.saturating_sub(tap), tap.saturating_sub(self.reach));
        match size.saturating_sub(before + after) {
            0 => (0..0, 0..0),
            count => (before..before + count, after..after + count),
        }
    }

    /// By tap: the weight of each value of all pixels.
    fn by_tap(&self, size: usize) -> Vec<Vec<f32>> {
        let count = self.count();
        let of_tap = |tap| {
            let weights = (0..size).map(|pixel| self.weights[pixel * count + tap]);
            weights.flat_map(|weight| [weight; CHANNELS]).collect()
        };
        (0..count).map(of_tap).collect()
    }

    /// Places of the samples around a pixel, among `size`, and their weights.
    fn around(&self, pixel: usize, size: usize) -> impl Iterator<Item = (usize, f32)> {
        let first = pixel.saturating_sub(self.reach);
        let last = (pixel + self.reach).min(size - 1);
        let weights = &self.weights[pixel * self.count()..][first + self.reach - pixel..];
        (first..=last).zip(weights.iter().copied())
    }
}

fn gaussian(x: f64) -> f64 {
    exp(-0.5 * x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filter in pixels, as documented.
    fn value(filter: PixelFilter, x: f64) -> f64 {
        match filter {
            PixelFilter::Box => f64::from(x.abs() <= 0.5),
            PixelFilter::Tent { radius } => (1.0 - x.abs() / f64::from(radius)).max(0.0),
            PixelFilter::Gaussian { stddev } => {
                let x = x / f64::from(stddev);
                (exp(-0.5 * x * x) - exp(-8.0)).max(0.0)
            }
        }
    }

    /// Filters whose samples count for one pixel.
    const NARROW: [PixelFilter; 5] = [
        PixelFilter::Box,
        PixelFilter::Tent { radius: 0.3 },
        PixelFilter::Tent { radius: 0.6 },
        PixelFilter::Gaussian { stddev: 0.1 },
        PixelFilter::Gaussian { stddev: 0.28 },
    ];

    const WIDE: [PixelFilter; 5] = [
        PixelFilter::Tent { radius: 0.7 },
        PixelFilter::Tent { radius: 1.0 },
        PixelFilter::Tent { radius: 2.7 },
        PixelFilter::Gaussian { stddev: 0.5 },
        PixelFilter::Gaussian { stddev: 1.3 },
    ];

    /// An image that is 1 in one pixel, or in half of it, gives each pixel the share of its filter there: the midpoint
    /// rule over sample positions and over the filter.
    #[test]
    fn samples_count_for_the_pixels_around() {
        const STEPS: u32 = 100;
        for filter in WIDE {
            assert!(filter.spreads());
            for (column, row, edge) in [(3, 2, 1.0), (0, 0, 1.0), (6, 1, 0.5)] {
                let mut sums = [0.0; 28];
                for i in 0..STEPS * STEPS {
                    let u = Vec2::new((i % STEPS) as f32 + 0.5, (i / STEPS) as f32 + 0.5) / STEPS as f32;
                    let mut film = Film::new(7, 4);
                    if u.x < edge {
                        film.pixels[row * 7 + column] = [1.0; 3];
                    }
                    filter.reconstruct([&mut film], u);
                    for (sum, pixel) in sums.iter_mut().zip(&film.pixels) {
                        *sum += f64::from(pixel[0]) / f64::from(STEPS * STEPS);
                    }
                }
                // The filter along an axis, over its integral within the image.
                let share = |at: usize, from: f64, to: f64, size: u32| {
                    let of = |from: f64, to: f64| {
                        let step = (to - from) / 10_000.0;
                        let at = |i| value(filter, from + (f64::from(i) + 0.5) * step - at as f64 - 0.5);
                        (0..10_000).map(at).sum::<f64>() * step
                    };
                    of(from, to) / of(0.0, size.into())
                };
                for (i, sum) in sums.into_iter().enumerate() {
                    let (x, y) = (column as f64, row as f64);
                    let expected = share(i % 7, x, x + f64::from(edge), 7) * share(i / 7, y, y + 1.0, 4);
                    assert!(
                        (sum - expected).abs() < 1e-4,
                        "{filter:?} at {i}: {sum}, not {expected}"
                    );
                }
            }
        }
    }

    /// The share of the filter between the image's border and the sample for `u` is `u`, by the midpoint rule.
    #[test]
    fn samples_divide_the_filter_within_the_image() {
        for filter in NARROW {
            for (pixel, size) in [(0, 1), (0, 9), (1, 9), (4, 9), (8, 9)] {
                let center = f64::from(pixel) + 0.5;
                let steps = 40_000;
                let width = f64::from(size) / f64::from(steps);
                let mut sums = vec![0.0];
                for i in 0..steps {
                    let x = (f64::from(i) + 0.5) * width;
                    sums.push(sums[i as usize] + value(filter, x - center) * width);
                }
                let total = sums[steps as usize];
                let mut last = 0.0;
                for i in 0..=200 {
                    let u = (i as f32 / 200.0).min(1.0 - f32::EPSILON / 2.0);
                    let at = filter.sample([pixel, pixel], [size, size], Vec2::splat(u));
                    assert_eq!(at.x, at.y);
                    let x = f64::from(at.x);
                    assert!((0.0..=f64::from(size)).contains(&x) && x >= last);
                    last = x;
                    let bin = (x / width) as usize;
                    let below =
                        sums[bin] + (sums[(bin + 1).min(steps as usize)] - sums[bin]) * (x / width - bin as f64);
                    let share = below / total;
                    assert!(
                        (share - f64::from(u)).abs() < 1e-3,
                        "{filter:?} at {pixel} of {size}: {share}, not {u}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_box_is_the_pixel() {
        let u = Vec2::new(0.3, 0.9);
        let at = PixelFilter::Box.sample([3, 5], [9, 9], u);
        assert_eq!(at, Vec2::new(3.0, 5.0) + u);
    }
}
