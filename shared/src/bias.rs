//! Bias, seen through the radius: passes have many radii, and what they show is extrapolated to radius zero.
//!
//! The mean of a pass deviates from the truth by about b R_i, with R_i its radius scale. The slope of the least-squares line
//! through a tile's value in each pass over R_i estimates b, and the mean of R_i times it the bias of the average. Its
//! variance follows from squared differences of neighbouring passes, whose variance grows as a + c / R_i: c from kernels, a
//! from all else.

use crate::film::Film;
use std::fmt;

/// Pixels along the side of a tile.
const TILE: u32 = 32;

/// Passes from which on anything is said, and standard errors that a bias must be away from zero to be claimed: of the
/// image, and of the worst of thousands of tiles.
const MIN_PASSES: u64 = 16;
const SIGNIFICANT: f64 = 3.0;
const SIGNIFICANT_TILE: f64 = 5.0;
/// A standard error of the bias above this share of the mean radiance says nothing.
const TOO_NOISY: f64 = 0.1;

/// Sums over the passes of a node of the summation tree. All of them are sums over its two children, so they have the same
/// bits whoever adds them up, as the image does.
#[derive(Clone, Debug, PartialEq)]
pub struct RadiusSums {
    /// Sums of R, R^2 and 1 / R.
    pub scales: [f64; 3],
    /// The whole image, then tiles row by row. With x the mean of all pixels and channels in a pass: the sums of x and of
    /// R x, and the sums over pairs of neighbouring passes of the squared difference of x, alone and times the mean of R.
    pub tiles: Vec<[f64; 4]>,
}

/// Number of tiles of an image, and the whole image.
pub fn tile_count(width: u32, height: u32) -> usize {
    width.div_ceil(TILE) as usize * height.div_ceil(TILE) as usize + 1
}

impl RadiusSums {
    /// Of one pass.
    pub fn leaf(film: &Film, radius_scale: f64) -> Self {
        let columns = film.width.div_ceil(TILE) as usize;
        let mut sums = vec![(0.0, 0u32); tile_count(film.width, film.height)];
        let mut whole = (0.0, 0u32);
        for (y, row) in film.pixels.chunks(film.width.max(1) as usize).enumerate() {
            for (column, part) in row.chunks(TILE as usize).enumerate() {
                let values = part.iter().flatten();
                let sum: f64 = values.map(|v| f64::from(*v)).sum();
                for into in [
                    &mut whole,
                    &mut sums[1 + y / TILE as usize * columns + column],
                ] {
                    into.0 += sum;
                    into.1 += 3 * part.len() as u32;
                }
            }
        }
        sums[0] = whole;
        let tile = |(sum, count): (f64, u32)| {
            let x = sum / f64::from(count.max(1));
            [x, radius_scale * x, 0.0, 0.0]
        };
        Self {
            scales: [
                radius_scale,
                radius_scale * radius_scale,
                1.0 / radius_scale,
            ],
            tiles: sums.into_iter().map(tile).collect(),
        }
    }

    /// Of the parent of two siblings, `self` the left one. `are_leaves`: each of them is one pass.
    pub fn join(&mut self, right: &Self, are_leaves: bool) {
        let mean_scale = 0.5 * (self.scales[0] + right.scales[0]);
        for (l, r) in self.tiles.iter_mut().zip(&right.tiles) {
            let d = (l[0] - r[0]) * (l[0] - r[0]);
            for (a, b) in l.iter_mut().zip(r) {
                *a += b;
            }
            if are_leaves {
                (l[2], l[3]) = (d, d * mean_scale);
            }
        }
        for (a, b) in self.scales.iter_mut().zip(right.scales) {
            *a += b;
        }
    }

    /// Whether all values are such that passes of images of this size could have given them.
    pub fn is_sound(&self, width: u32, height: u32) -> bool {
        let sound = |t: &[f64; 4]| t.iter().all(|v| v.is_finite()) && t[2] >= 0.0 && t[3] >= 0.0;
        self.tiles.len() == tile_count(width, height)
            && self.tiles.iter().all(sound)
            && self.scales.iter().all(|s| s.is_finite() && *s > 0.0)
    }

    /// All values, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let values = self.scales.iter().chain(self.tiles.iter().flatten());
        values.flat_map(|v| v.to_le_bytes()).collect()
    }

    /// What [`Self::to_bytes`] wrote.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (chunks, rest) = bytes.as_chunks();
        let values: Vec<f64> = chunks.iter().map(|c| f64::from_le_bytes(*c)).collect();
        let (scales, tiles) = values.split_first_chunk()?;
        let (tiles, more) = tiles.as_chunks();
        (rest.is_empty() && more.is_empty()).then(|| Self {
            scales: *scales,
            tiles: tiles.to_vec(),
        })
    }

    /// Estimates from the sums over `passes` passes.
    pub fn estimate(&self, passes: u64) -> Bias {
        let n = passes as f64;
        // An odd last pass has no neighbour.
        let paired = n / (passes - passes % 2).max(1) as f64;
        let [r, rr, inverse] = self.scales;
        let mean_r = r / n;
        let spread = rr - n * mean_r * mean_r;
        let of = |tile: &[f64; 4]| {
            let [x, rx, d, rd] = *tile;
            // One pass, or radii that do not differ.
            if spread.is_nan() || spread <= 1e-12 * rr {
                return BiasEstimate {
                    mean: x / n,
                    bias: 0.0,
                    standard_error: f64::INFINITY,
                };
            }
            let slope = (rx - mean_r * x) / spread;
            // d and rd have the means a N + c sum 1/R and a sum R + c N; neither a nor c is negative.
            let (d, rd) = (d * paired, rd * paired);
            let determinant = n * n - r * inverse;
            let a = (d * n - rd * inverse) / determinant;
            let c = (n * rd - r * d) / determinant;
            let (a, c) = match (a, c) {
                (a, _) if a < 0.0 => (0.0, d / inverse),
                (_, c) if c < 0.0 => (d / n, 0.0),
                both => both,
            };
            let variance = (a * spread + c * (r - 2.0 * mean_r * n + mean_r * mean_r * inverse))
                / spread
                / spread;
            BiasEstimate {
                mean: x / n,
                bias: slope * mean_r,
                standard_error: variance.max(0.0).sqrt() * mean_r,
            }
        };
        let mut tiles: Vec<BiasEstimate> = self.tiles.iter().map(of).collect();
        let image = tiles.remove(0);
        Bias {
            passes,
            image,
            tiles,
        }
    }
}

/// By how much the mean of passes deviates from the truth, as far as the radius is the cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasEstimate {
    /// Mean radiance, of pixels and channels.
    pub mean: f64,
    /// Its bias, to be subtracted for an estimate of the truth.
    pub bias: f64,
    /// Standard error of the bias; infinite when nothing is known.
    pub standard_error: f64,
}

impl BiasEstimate {
    fn is_beyond(&self, standard_errors: f64) -> bool {
        self.bias.abs() > standard_errors * self.standard_error
    }
}

/// The bias of an average.
#[derive(Clone, Debug, PartialEq)]
pub struct Bias {
    /// Passes of the average.
    pub passes: u64,
    /// Of the whole image.
    pub image: BiasEstimate,
    /// Of tiles of 32 x 32 pixels, row by row.
    pub tiles: Vec<BiasEstimate>,
}

impl Bias {
    /// Whether there are enough passes, and little enough noise, to say anything.
    pub fn is_known(&self) -> bool {
        self.passes >= MIN_PASSES
            && self.image.standard_error <= TOO_NOISY * self.image.mean.abs()
            && self.image.mean != 0.0
    }

    /// Whether the image has a bias that cannot be chance.
    pub fn is_significant(&self) -> bool {
        self.is_known() && self.image.is_beyond(SIGNIFICANT)
    }

    /// Tiles that have a bias that cannot be chance.
    pub fn significant_tiles(&self) -> impl Iterator<Item = &BiasEstimate> {
        let known = self.passes >= MIN_PASSES;
        let tiles = self.tiles.iter();
        tiles.filter(move |tile| known && tile.is_beyond(SIGNIFICANT_TILE))
    }
}

/// One line for people.
impl fmt::Display for Bias {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.passes < MIN_PASSES {
            return write!(f, "bias unknown: fewer than {MIN_PASSES} passes");
        }
        let BiasEstimate {
            mean,
            bias,
            standard_error,
        } = self.image;
        let (bias, error) = (100.0 * bias / mean, 100.0 * standard_error / mean.abs());
        if !self.is_known() {
            f.write_str("bias unknown: too noisy to extrapolate to radius 0")?;
        } else if self.is_significant() {
            write!(f, "bias {bias:+.2} % ± {error:.2} % of the mean radiance")?;
        } else {
            write!(
                f,
                "bias not significant, {bias:+.2} % ± {error:.2} % of the mean radiance"
            )?;
        }
        let count = self.significant_tiles().count();
        let worst = |a: &&BiasEstimate, b: &&BiasEstimate| a.bias.abs().total_cmp(&b.bias.abs());
        match self.significant_tiles().max_by(worst) {
            Some(worst) if self.tiles.len() > 1 => write!(
                f,
                "; significant in {count} of {} tiles, the worst {:+.2} % ± {:.2} %",
                self.tiles.len(),
                100.0 * worst.bias / worst.mean,
                100.0 * worst.standard_error / worst.mean.abs()
            ),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::radius::radius_scale;

    fn film(value: f32) -> Film {
        let mut film = Film::new(40, 33);
        film.pixels.fill([value, 2.0 * value, 3.0 * value]);
        film
    }

    /// The sums over passes of these values, one after another, as the tree adds them: pairs first.
    fn sums(values: &[f32], alpha: f64) -> RadiusSums {
        let leaf =
            |i: usize| RadiusSums::leaf(&film(values[i]), radius_scale((i + 1) as f64, alpha));
        let mut total: Option<RadiusSums> = None;
        for i in (0..values.len()).step_by(2) {
            let mut pair = leaf(i);
            if i + 1 < values.len() {
                pair.join(&leaf(i + 1), true);
            }
            match &mut total {
                Some(total) => total.join(&pair, false),
                None => total = Some(pair),
            }
        }
        total.unwrap()
    }

    #[test]
    fn a_line_is_extrapolated_exactly() {
        let r = |i: usize| radius_scale((i + 1) as f64, 0.5);
        let values: Vec<f32> = (0..33).map(|i| (3.0 - 0.5 * r(i)) as f32).collect();
        let sums = sums(&values, 0.5);
        let bias = sums.estimate(33);
        let expected = -(0..33).map(r).sum::<f64>() / 33.0;
        assert_eq!(bias.tiles.len(), 4);
        for tile in bias.tiles.iter().chain([&bias.image]) {
            assert!((tile.bias - expected).abs() < 1e-6, "{tile:?}");
            assert!((tile.mean - tile.bias - 6.0).abs() < 1e-6, "{tile:?}");
        }
        let again = RadiusSums::from_bytes(&sums.to_bytes()).unwrap();
        assert_eq!(again, sums);
        assert!(again.is_sound(40, 33) && !again.is_sound(40, 65));
        assert_eq!(RadiusSums::from_bytes(&sums.to_bytes()[1..]), None);
    }

    #[test]
    fn it_says_when_it_knows_nothing() {
        // Noise that alternates: no trend.
        let noise = |size: f32, count: usize| -> Vec<f32> {
            let sign = |i: usize| {
                if (i / 2 + i).is_multiple_of(2) {
                    1.0
                } else {
                    -1.0
                }
            };
            (0..count).map(|i| 1.0 + size * sign(i)).collect()
        };
        let text = |values: &[f32]| {
            let bias = sums(values, 0.5).estimate(values.len() as u64);
            (bias.to_string(), bias.is_significant())
        };
        let few = text(&noise(0.01, 15));
        assert_eq!(few, ("bias unknown: fewer than 16 passes".into(), false));
        let wild = text(&noise(5.0, 16));
        assert!(
            wild.0.starts_with("bias unknown: too noisy") && !wild.1,
            "{wild:?}"
        );
        let calm = text(&noise(0.01, 64));
        assert!(
            calm.0.starts_with("bias not significant, ") && !calm.1,
            "{calm:?}"
        );
        let mut trend = noise(0.01, 64);
        for (i, value) in trend.iter_mut().enumerate() {
            *value += (1.0 - 0.5 * radius_scale((i + 1) as f64, 0.5)) as f32;
        }
        let trend = text(&trend);
        assert!(trend.0.starts_with("bias -") && trend.1, "{trend:?}");
        assert!(trend.0.contains("significant in 4 of 4 tiles"), "{trend:?}");
        let one = sums(&[1.0], 0.5).estimate(1).image;
        assert_eq!((one.bias, one.standard_error), (0.0, f64::INFINITY));
        let black = text(&[0.0; 20]);
        assert!(black.0.starts_with("bias unknown"), "{black:?}");
    }
}
