//! Where an average's error lies: most of it may be in a few pixels.

use super::Average;
use super::average::BLOCK;
use std::fmt;

/// The share that counts as most of the error, and the pixels that count as few: one in this many of those with any
/// error.
const MOST: f64 = 0.8;
const FEW: usize = 100;
/// Below this many pixels, no few can be singled out.
const MIN_PIXELS: usize = 64;

/// How an average's error is spread over its pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Median of the relative standard errors of all blocks of 8 x 8 pixels that are not black: the root mean square of
    /// a block's standard errors over its mean radiance. A few wild pixels and black surroundings do not change it.
    /// `None` for one pass and for a black picture.
    pub median: Option<f64>,
    /// The few pixels that hold most of the error, if any.
    pub fireflies: Option<Fireflies>,
}

/// A few pixels that hold most of the error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fireflies {
    /// Number of pixels.
    pub pixels: usize,
    /// Their share of the error: of the sum over pixels of squared standard errors, each relative to the radiance
    /// around it.
    pub share: f64,
    /// Column of the worst pixel.
    pub x: u32,
    /// Row of the worst pixel.
    pub y: u32,
}

/// A line for users.
impl fmt::Display for Fireflies {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pixels, share, x, y } = self;
        let (noun, verb) = match pixels {
            1 => ("pixel", "holds"),
            _ => ("pixels", "hold"),
        };
        write!(
            f,
            "{pixels} {noun} {verb} {:.0} % of the error: fireflies, see `--aov stderr`; the worst at ({x}, {y})",
            (100.0 * share).floor()
        )
    }
}

impl Average {
    /// How the error is spread over the pixels.
    pub fn noise(&self) -> Noise {
        let squares = self.squared_errors();
        let is_known = squares.iter().all(|square| square.is_finite());
        Noise {
            median: if is_known { self.median_error() } else { None },
            fireflies: match is_known {
                true => fireflies(&squares, self.beauty.width),
                false => None,
            },
        }
    }

    fn median_error(&self) -> Option<f64> {
        let mut errors: Vec<f64> = self.blocks().filter_map(|block| self.error(&block)).collect();
        let middle = errors.len() / 2;
        (!errors.is_empty()).then(|| *errors.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Relative standard error of a block; none if it is black.
    fn error(&self, block: &[usize]) -> Option<f64> {
        let sum = |value: &dyn Fn(usize, usize) -> f64| -> f64 {
            let channels = block.iter().flat_map(|i| (0..3).map(move |c| (*i, c)));
            channels.map(|(i, c)| value(i, c)).sum()
        };
        let count = 3.0 * block.len() as f64;
        let radiance = sum(&|i, c| f64::from(self.beauty.pixels[i][c])).abs() / count;
        let squares = sum(&|i, c| {
            let error = f64::from(self.standard_error.pixels[i][c]);
            error * error
        });
        (radiance > 0.0).then(|| (squares / count).sqrt() / radiance)
    }

    /// Squared relative standard error of each pixel, averaged over its channels. Their mean over the picture is the
    /// square of [`Self::relative_standard_error`].
    pub fn squared_errors(&self) -> Vec<f64> {
        let beauty = &self.beauty.pixels;
        let values = || beauty.iter().flatten().map(|v| f64::from(*v));
        let mean = values().map(f64::abs).sum::<f64>() / (3 * beauty.len()).max(1) as f64;
        let mut squares = vec![0.0; beauty.len()];
        for block in self.blocks() {
            let radiance: [f64; 3] = std::array::from_fn(|c| {
                let sum: f64 = block.iter().map(|i| f64::from(beauty[*i][c])).sum();
                (sum / block.len() as f64).abs().max(0.1 * mean)
            });
            for i in block {
                let square = |c: usize| {
                    let error = f64::from(self.standard_error.pixels[i][c]);
                    match error == 0.0 {
                        true => 0.0,
                        false => error * error / (radiance[c] * radiance[c]),
                    }
                };
                squares[i] = (square(0) + square(1) + square(2)) / 3.0;
            }
        }
        squares
    }

    /// The pixels of each block, as indices.
    fn blocks(&self) -> impl Iterator<Item = Vec<usize>> {
        let (width, height) = (self.beauty.width as usize, self.beauty.height as usize);
        let corners = (0..height)
            .step_by(BLOCK)
            .flat_map(move |y0| (0..width).step_by(BLOCK).map(move |x0| (x0, y0)));
        corners.map(move |(x0, y0)| {
            let columns = x0..width.min(x0 + BLOCK);
            let rows = y0..height.min(y0 + BLOCK);
            rows.flat_map(|y| columns.clone().map(move |x| y * width + x)).collect()
        })
    }
}

/// The fewest pixels that hold most of the sum, if they are few.
fn fireflies(squares: &[f64], width: u32) -> Option<Fireflies> {
    let total: f64 = squares.iter().sum();
    let noisy = squares.iter().filter(|square| **square > 0.0).count();
    if noisy < MIN_PIXELS {
        return None;
    }
    let few = (noisy / FEW).max(1);
    let mut places: Vec<usize> = (0..squares.len()).collect();
    let descending = |a: &usize, b: &usize| squares[*b].total_cmp(&squares[*a]).then(a.cmp(b));
    places.select_nth_unstable_by(few - 1, descending);
    places.truncate(few);
    places.sort_unstable_by(descending);
    let mut sum = 0.0;
    for (i, place) in places.iter().enumerate() {
        sum += squares[*place];
        if sum >= MOST * total {
            let worst = places[0] as u32;
            return Some(Fireflies {
                pixels: i + 1,
                share: sum / total,
                x: worst % width,
                y: worst / width,
            });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Film;

    /// An average without noise; `value` gives the radiance and its standard error.
    fn average(value: impl Fn(u32, u32) -> (f32, f32)) -> Average {
        let (width, height) = (64, 40);
        let mut beauty = Film::new(width, height);
        let mut standard_error = Film::new(width, height);
        for i in 0..width * height {
            let (v, error) = value(i % width, i / width);
            beauty.pixels[i as usize] = [v; 3];
            standard_error.pixels[i as usize] = [error; 3];
        }
        Average {
            passes: 2,
            beauty,
            standard_error,
            layers: Vec::new(),
            mattes: Vec::new(),
            bias: None,
        }
    }

    #[test]
    fn one_lamp_does_not_hide_the_rest() {
        // 2 % noise where there is light, and one pixel of a lamp.
        let average = average(|x, y| match (x, y) {
            (37, 11) => (100.0, 30.0),
            (32.., _) => (1.0, 0.02),
            _ => (0.0, 0.0),
        });
        let noise = average.noise();
        let median = noise.median.unwrap();
        assert!((median - 0.02).abs() < 1e-6, "{median}");
        assert!(average.relative_standard_error() > 0.1);
        // Black blocks dilute the median over all.
        assert_eq!(average.errors().at(Some(50)), 0.0);
        let fireflies = noise.fireflies.unwrap();
        assert_eq!((fireflies.pixels, fireflies.x, fireflies.y), (1, 37, 11));
        let text = fireflies.to_string();
        assert!(
            text.starts_with("1 pixel holds 99 % of the error: fireflies, see `--aov stderr`"),
            "{text}"
        );
    }

    #[test]
    fn noise_that_is_everywhere_warns_of_nothing() {
        let noise = average(|x, y| (1.0, 0.01 + 0.001 * ((x + y) % 7) as f32)).noise();
        assert_eq!(noise.fireflies, None);
        // A small object on black is the whole picture, however noisy it is.
        let noise = average(|x, y| match (x, y) {
            (8..16, 8..24) => (1.0, 0.3),
            _ => (0.0, 0.0),
        });
        assert_eq!(noise.noise().fireflies, None);
        assert!((noise.noise().median.unwrap() - 0.3).abs() < 1e-6);
    }

    #[test]
    fn the_fewest_pixels_are_counted() {
        // 12 of 2560 pixels, with 40 times the others' error.
        let average = average(|x, y| match (x, y % 10) {
            (3 | 20 | 41, 4) => (1.0, 0.8),
            _ => (1.0, 0.02),
        });
        let fireflies = average.noise().fireflies.unwrap();
        let total = 12.0 * 1600.0 + 2548.0;
        let pixels = (0.8 * total / 1600.0f64).ceil() as usize;
        assert_eq!(fireflies.pixels, pixels);
        assert!((fireflies.share - 1600.0 * pixels as f64 / total).abs() < 1e-6);
    }

    #[test]
    fn nothing_is_said_of_one_pass_or_of_black() {
        let nothing = Noise {
            median: None,
            fireflies: None,
        };
        assert_eq!(average(|_, _| (1.0, f32::INFINITY)).noise(), nothing);
        assert_eq!(average(|_, _| (0.0, 0.0)).noise(), nothing);
    }
}
