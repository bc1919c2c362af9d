//! Reconstruction filters: how a pixel weighs the image around its centre.
//!
//! A pixel is the mean of the radiance around it, weighted by a product of the same function of x and of y. Its one
//! sample a pass is drawn from the filter, so that all samples have the same weight. At the borders of the image the
//! filter is cut off and what is left of it is normalised, as in Mitsuba 3.

use crate::math::Vec2;
use libm::{erf, exp};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

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

/// A Gaussian ends at so many standard deviations.
const GAUSSIAN_REACH: f64 = 4.0;

/// More steps than Newton's method needs anywhere.
const MAX_STEPS: u32 = 64;

impl PixelFilter {
    /// Where the sample of a pixel is in an image of `size` pixels: (0, 0) is the top left corner. `u` in [0, 1)^2.
    #[inline]
    pub fn sample(&self, pixel: [u32; 2], size: [u32; 2], u: Vec2) -> Vec2 {
        let [x, y] = pixel;
        match self {
            Self::Box => Vec2::new(x as f32, y as f32) + u,
            _ => Vec2::new(self.sample_axis(x, size[0], u.x), self.sample_axis(y, size[1], u.y)),
        }
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

    /// Integral of the filter from its middle.
    fn integral(&self, x: f64) -> f64 {
        match self {
            Self::Box => x,
            Self::Tent { .. } => x - 0.5 * x * x.abs(),
            Self::Gaussian { .. } => (0.5 * PI).sqrt() * erf(x * FRAC_1_SQRT_2) - x * gaussian(GAUSSIAN_REACH),
        }
    }

    /// Where the integral from the middle is `share`.
    fn inverse(&self, share: f64) -> f64 {
        let wanted = share.abs();
        let x = match self {
            Self::Box => wanted,
            // 1 - sqrt(1 - 2 share), without cancellation.
            Self::Tent { .. } => 2.0 * wanted / (1.0 + (1.0 - 2.0 * wanted).max(0.0).sqrt()),
            Self::Gaussian { .. } => {
                // The integral bends downwards: from the middle, Newton's method comes near from one side.
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

fn gaussian(x: f64) -> f64 {
    exp(-0.5 * x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filter in the unit of the pixel, as it is documented.
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

    const FILTERS: [PixelFilter; 7] = [
        PixelFilter::Box,
        PixelFilter::Tent { radius: 1.0 },
        PixelFilter::Tent { radius: 0.3 },
        PixelFilter::Tent { radius: 2.7 },
        PixelFilter::Gaussian { stddev: 0.5 },
        PixelFilter::Gaussian { stddev: 0.1 },
        PixelFilter::Gaussian { stddev: 1.3 },
    ];

    /// The share of the filter between the image's border and the sample of `u` is `u`, by the midpoint rule.
    #[test]
    fn samples_divide_the_filter_within_the_image() {
        for filter in FILTERS {
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
