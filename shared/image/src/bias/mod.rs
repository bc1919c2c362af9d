//! Bias, seen through the radius: passes have many radii, and their values are extrapolated to radius zero.
//!
//! The mean of a pass deviates from the truth by about b R_i^p, with R_i its radius scale. Any weighted difference
//! between passes with large and with small radii shows that b is not zero, whatever p is. The size of the average's
//! bias depends on p by factors of two, and p is known only where the bias is many times its noise. So tiles are
//! *named* by such a difference. The size of a bias is a mean over exponents, whose standard error includes their
//! disagreement.
//!
//! The variance of a pass follows from squared differences of neighbouring passes, and grows as a + c / R_i, with c
//! from kernels and a from everything else.

mod fit;
mod naming;
mod sums;
mod words;

pub use fit::{BiasEstimate, Fit};
pub use sums::RadiusSums;

use crate::film::Film;
use fit::Scales;

/// Exponents p of R^p with which a bias may grow. Beams have the radius R and surface photons sqrt(R). At edges, a bias
/// is proportional to the radius; where light is smooth, to its square.
pub const BIAS_EXPONENTS: [f64; 3] = [0.5, 1.0, 2.0];

/// Pixels along the side of a tile.
pub const TILE: u32 = 32;

/// Fewest passes for any finding.
const MIN_PASSES: u64 = 16;
/// The image as a whole has a bias if noise alone looks like one this rarely: three standard errors.
const SIGNIFICANCE: f64 = 0.0027;
/// Radiances are compared with the tile's mean, or with this part of the image's mean if that is larger.
const FLOOR: f64 = 0.1;

/// What is known about a bias.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// There is a bias.
    Biased,
    /// No bias is seen, and one as large as a pixel's standard error would be.
    NotSeen,
    /// No bias is seen, but there could be one as large as a pixel's standard error.
    NotKnown,
}

/// A channel, or the mean of all channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The mean of the channels.
    Mean,
    /// R.
    Red,
    /// G.
    Green,
    /// B.
    Blue,
}

const CHANNELS: [Channel; sums::CHANNELS] = [Channel::Mean, Channel::Red, Channel::Green, Channel::Blue];

/// The bias of a part of the image.
#[derive(Clone, Debug, PartialEq)]
pub struct PartBias {
    /// Column of the part's first pixel.
    pub x: u32,
    /// Row of the part's first pixel.
    pub y: u32,
    /// For the mean of the channels, then for R, G and B.
    pub estimates: [BiasEstimate; sums::CHANNELS],
    /// Standard error of the part's pixels: root mean square over pixels and channels.
    pub pixel_error: f64,
    /// The radiance that a bias is compared with.
    pub radiance: f64,
    /// The conclusion.
    pub finding: Finding,
}

impl PartBias {
    /// The estimate for the mean of the channels.
    pub fn mean(&self) -> &BiasEstimate {
        &self.estimates[0]
    }

    /// The channel whose bias is least likely to be chance, or the mean of all channels if that is about as unlikely.
    pub fn clearest(&self) -> (Channel, &BiasEstimate) {
        let single = CHANNELS.into_iter().zip(&self.estimates).skip(1);
        let clearest = single.min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value));
        match clearest {
            Some((channel, estimate)) if 4.0 * estimate.p_value < self.mean().p_value.min(SIGNIFICANCE) => {
                (channel, estimate)
            }
            _ => (Channel::Mean, self.mean()),
        }
    }

    /// Bias of [`Self::clearest`] and its standard error, relative to the radiance.
    pub fn relative(&self) -> (f64, f64) {
        let (_, estimate) = self.clearest();
        let relative = |v: f64| if v == 0.0 { 0.0 } else { v / self.radiance };
        (relative(estimate.bias), relative(estimate.standard_error))
    }

    fn p_value(&self) -> f64 {
        naming::joint_p_value(self.estimates.each_ref().map(|e| e.p_value))
    }

    fn decide(&mut self, is_biased: bool) {
        self.finding = match is_biased {
            true => Finding::Biased,
            false if self.mean().least_seen() <= self.pixel_error => Finding::NotSeen,
            false => Finding::NotKnown,
        };
    }
}

/// The bias of an average.
#[derive(Clone, Debug, PartialEq)]
pub struct Bias {
    /// Number of passes in the average.
    pub passes: u64,
    /// Whether the passes have different radii; if not, nothing is known.
    pub radii_differ: bool,
    /// The bias of the whole image.
    pub image: PartBias,
    /// Tiles of [`TILE`] x [`TILE`] pixels, row by row.
    pub tiles: Vec<PartBias>,
}

impl RadiusSums {
    /// Estimates from the sums over `passes` passes, whose average has this standard error. `None` without passes.
    pub fn estimate(&self, passes: u64, standard_error: &Film) -> Option<Bias> {
        let scales = Scales::new(self, passes);
        let all_tiles = || self.tiles.iter().skip(1);
        let noisy_scale: [f64; sums::CHANNELS] =
            std::array::from_fn(|c| scales.mean_noisy_scale(all_tiles().map(|tile| &tile[c])));
        let columns = standard_error.width.div_ceil(TILE).max(1);
        let pixel_errors = pixel_errors(standard_error);
        let parts = self.tiles.iter().zip(pixel_errors).zip(0u32..);
        let mut parts = parts.map(|((sums, pixel_error), i)| {
            let tile = i.saturating_sub(1);
            PartBias {
                x: tile % columns * TILE,
                y: tile / columns * TILE,
                estimates: std::array::from_fn(|c| scales.estimate(&sums[c], noisy_scale[c])),
                pixel_error,
                radiance: 0.0,
                finding: Finding::NotKnown,
            }
        });
        let mut image = parts.next().filter(|_| passes > 0)?;
        let mut tiles: Vec<PartBias> = parts.collect();
        let floor = FLOOR * image.mean().mean.abs();
        for part in tiles.iter_mut().chain([&mut image]) {
            part.radiance = part.mean().mean.abs().max(floor);
        }
        if passes >= MIN_PASSES {
            image.decide(image.p_value() <= SIGNIFICANCE);
            let p_values: Vec<f64> = tiles.iter().map(PartBias::p_value).collect();
            for (tile, is_biased) in tiles.iter_mut().zip(naming::are_named(&p_values)) {
                tile.decide(is_biased);
            }
        }
        Some(Bias {
            passes,
            radii_differ: !scales.are_equal(),
            image,
            tiles,
        })
    }
}

impl Bias {
    /// Whether anything is known: there are enough passes with different radii, and some light.
    pub fn is_known(&self) -> bool {
        self.passes >= MIN_PASSES && self.radii_differ && self.image.mean().mean != 0.0
    }

    /// The least bias of the image's mean that is found almost always, relative to that mean.
    pub fn least_seen(&self) -> f64 {
        self.image.mean().least_seen() / self.image.radiance
    }

    /// Tiles that have a bias, worst first.
    pub fn named(&self) -> Vec<&PartBias> {
        let tiles = self.tiles.iter();
        let mut named: Vec<_> = tiles.filter(|tile| tile.finding == Finding::Biased).collect();
        named.sort_by(|a, b| b.relative().0.abs().total_cmp(&a.relative().0.abs()));
        named
    }

    /// Number of tiles about which nothing is known.
    pub fn unknown(&self) -> usize {
        let tiles = self.tiles.iter();
        tiles.filter(|tile| tile.finding == Finding::NotKnown).count()
    }
}

/// Root mean square errors over the image, then over each tile.
fn pixel_errors(standard_error: &Film) -> Vec<f64> {
    let columns = standard_error.width.div_ceil(TILE) as usize;
    let rows = standard_error.height.div_ceil(TILE) as usize;
    let mut sums = vec![(0.0, 0.0); 1 + columns * rows];
    let width = standard_error.width.max(1) as usize;
    for (y, row) in standard_error.pixels.chunks(width).enumerate() {
        for (column, part) in row.chunks(TILE as usize).enumerate() {
            let squares = part.iter().flatten().map(|v| f64::from(*v) * f64::from(*v));
            let (squares, count) = (squares.sum::<f64>(), 3.0 * part.len() as f64);
            for i in [0, 1 + y / TILE as usize * columns + column] {
                sums[i].0 += squares;
                sums[i].1 += count;
            }
        }
    }
    let mean = |(squares, count): (f64, f64)| (squares / f64::max(count, 1.0)).sqrt();
    sums.into_iter().map(mean).collect()
}
