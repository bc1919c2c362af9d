//! The average of a prefix of passes, and its error.

use super::{Node, REPLICATION};
use crate::bias::Bias;
use crate::film::Film;
use crate::matte::Matte;

/// Side of the blocks whose radiance errors are relative to, in pixels.
pub(super) const BLOCK: usize = 8;

/// Percentiles of an image's error: 1 to 100.
pub const PERCENTILES: usize = 100;

/// The average of a prefix of passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Average {
    /// Passes [0, passes).
    pub passes: u64,
    /// Mean radiance.
    pub beauty: Film,
    /// Standard error of the mean, per pixel and channel. Infinite for one pass, which allows no estimate.
    pub standard_error: Film,
    /// Means of the layers, in the job's order.
    pub layers: Vec<Film>,
    /// Sums of the mattes.
    pub mattes: Vec<Matte>,
    /// Estimated bias, if the passes' radius scales are known.
    pub bias: Option<Bias>,
}

impl Average {
    /// From the sums over `passes` passes; their blocks no longer matter.
    ///
    /// From two replications on, D is the sum of the squared differences of neighbouring replications. It estimates the
    /// variance of the sum, and the standard error of the mean is sqrt(D) / N. Passes beyond the last pair of
    /// replications are compared by parts of a replication or by pairs of passes, as all are if there are fewer: that
    /// overestimates the error and never underestimates it.
    ///
    /// Passes are not identically distributed (their variance grows with the index), but neighbours nearly are: the
    /// squared difference of passes 2k and 2k + 1 has the mean Var[2k] + Var[2k + 1]. The sum D of these over an even
    /// number N of passes estimates the variance of the sum, and the standard error of the mean is sqrt(D) / N. An odd
    /// last pass has no neighbour and is taken to vary as the others do on average: D * N / (N - 1). Its variance is at
    /// most 2 - alpha times theirs, so the variance of the mean comes out too small by a fraction of at most (1 -
    /// alpha) / N.
    pub(super) fn new(passes: u64, total: Node) -> Self {
        let Node {
            mut sum,
            squared_difference: mut difference,
            mut layers,
            mattes,
            radius_sums,
            ..
        } = total;
        let n = passes as f64;
        let pairs = passes - passes % 2;
        for film in layers.iter_mut().chain([&mut sum]) {
            for pixel in &mut film.pixels {
                *pixel = pixel.map(|v| (f64::from(v) / n) as f32);
            }
        }
        for pixel in &mut difference.pixels {
            *pixel = pixel.map(|d| match pairs {
                0 => f32::INFINITY,
                _ => (f64::from(d) / (n * pairs as f64)).sqrt() as f32,
            });
        }
        let bias = radius_sums.and_then(|sums| sums.estimate(passes, &difference));
        Self {
            passes,
            beauty: sum,
            standard_error: difference,
            layers,
            mattes,
            bias,
        }
    }

    /// Whether the standard error is too large on average: there are not yet two replications to compare, only passes
    /// that are more even together than each is alone.
    pub fn has_upper_error(&self) -> bool {
        self.passes < 2 * REPLICATION
    }

    /// [`Errors::image`].
    pub fn relative_standard_error(&self) -> f64 {
        self.errors().image
    }

    /// How noisy the picture and its parts are. Depends only on the bits of the average.
    pub fn errors(&self) -> Errors {
        let values = || self.beauty.pixels.iter().flatten().map(|v| f64::from(*v));
        let count = (3 * self.beauty.pixels.len()) as f64;
        let mean = values().map(f64::abs).sum::<f64>() / count;
        if mean == 0.0 {
            return Errors::UNKNOWN;
        }
        let (width, height) = (self.beauty.width as usize, self.beauty.height as usize);
        let mut squares = 0.0;
        let mut blocks = Vec::new();
        for y0 in (0..height).step_by(BLOCK) {
            for x0 in (0..width).step_by(BLOCK) {
                let columns = x0..width.min(x0 + BLOCK);
                let mut block = [0.0; 3];
                let mut errors = [0.0; 3];
                let mut pixels = 0.0;
                for y in y0..height.min(y0 + BLOCK) {
                    for x in columns.clone() {
                        pixels += 1.0;
                        for c in 0..3 {
                            let error = f64::from(self.standard_error.pixels[y * width + x][c]);
                            block[c] += f64::from(self.beauty.pixels[y * width + x][c]);
                            errors[c] += error * error;
                        }
                    }
                }
                let mut of_block = 0.0;
                for c in 0..3 {
                    let radiance = (block[c] / pixels).abs().max(0.1 * mean);
                    squares += errors[c] / (radiance * radiance);
                    of_block += errors[c] / (radiance * radiance);
                }
                blocks.push((of_block / (3.0 * pixels)).sqrt());
            }
        }
        blocks.sort_by(f64::total_cmp);
        Errors {
            image: (squares / count).sqrt(),
            percentiles: std::array::from_fn(|i| {
                let rank = (blocks.len() * (i + 1)).div_ceil(PERCENTILES);
                blocks[rank.max(1) - 1]
            }),
        }
    }
}

/// Relative standard errors of an average.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// One number for the picture's noise: the root mean square, over all pixels and channels, of the standard error
    /// relative to the radiance around the pixel. That radiance is the channel's mean over a block of 8 x 8 pixels, or
    /// a tenth of the picture's mean magnitude if that is more: a few pixels that look into a lamp do not outweigh the
    /// rest, nor do black ones. (Relative to the pixel's own radiance, it would be too small as long as there is much
    /// noise: a large error comes with a large value.)
    ///
    /// Infinite for one pass and for a black picture.
    pub image: f64,
    /// The same root mean square within each block of 8 x 8 pixels: index P - 1 holds the smallest value that at least
    /// P % of the blocks do not exceed.
    pub percentiles: [f64; PERCENTILES],
}

impl Errors {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        image: f64::INFINITY,
        percentiles: [f64::INFINITY; PERCENTILES],
    };

    /// The error of the image, or at a percentile from 1 to 100 (infinite beyond).
    pub fn at(&self, percentile: Option<u32>) -> f64 {
        match percentile {
            None => self.image,
            Some(percentile) => {
                let place = (percentile as usize).checked_sub(1);
                let value = place.and_then(|place| self.percentiles.get(place));
                value.copied().unwrap_or(f64::INFINITY)
            }
        }
    }
}
