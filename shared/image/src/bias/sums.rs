//! The sums over passes from which a bias is estimated. They can be added in any order that the tree allows.

use super::{BIAS_EXPONENTS, TILE};
use crate::film::Film;

/// Exponents e of the sums of R^e over passes.
pub(super) const EXPONENTS: [f64; 8] = [-1.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0];
/// Sums per value of a tile, and values per tile: the mean of the channels, then R, G and B.
const SUMS: usize = 7;
pub(super) const CHANNELS: usize = 4;

/// Neighbouring passes are alike if their radii differ by at most this share: they differ by noise and hardly by bias.
/// All pairs but the first few are alike.
const ALIKE: f64 = 0.1;

/// Sums over the passes of one value x of a tile: of x, R x and R^2 x. With d the difference of two neighbouring
/// passes, also sums of d^2, of d^2 times their mean R, and of d^4 over alike pairs, and of d over the other pairs.
pub(super) type Sums = [f64; SUMS];

/// Sums over the passes of a node of the summation tree. Each is a sum over the node's two children, so like the image
/// it has the same bits whoever adds it up.
#[derive(Clone, Debug, PartialEq)]
pub struct RadiusSums {
    /// Sums of powers of the radius scale R.
    pub(super) scales: [f64; EXPONENTS.len()],
    /// Number of alike pairs of neighbours; sums over them of the mean of R, and of 1 / R.
    pub(super) alike: [f64; 3],
    /// Number of the other pairs; sums over them of the differences of R^p, with p as in [`BIAS_EXPONENTS`].
    pub(super) unlike: [f64; 4],
    /// The whole image, then tiles row by row.
    pub(super) tiles: Vec<[Sums; CHANNELS]>,
}

/// Number of an image's tiles, plus one for the whole image.
fn tile_count(width: u32, height: u32) -> usize {
    width.div_ceil(TILE) as usize * height.div_ceil(TILE) as usize + 1
}

impl RadiusSums {
    /// The sums for one pass.
    pub fn leaf(film: &Film, radius_scale: f64) -> Self {
        let columns = film.width.div_ceil(TILE) as usize;
        let mut sums = vec![([0.0; 3], 0u32); tile_count(film.width, film.height)];
        let mut whole = ([0.0; 3], 0u32);
        for (y, row) in film.pixels.chunks(film.width.max(1) as usize).enumerate() {
            for (column, part) in row.chunks(TILE as usize).enumerate() {
                let mut sum = [0.0; 3];
                for pixel in part {
                    for (sum, v) in sum.iter_mut().zip(pixel) {
                        *sum += f64::from(*v);
                    }
                }
                for (into, pixels) in [&mut whole, &mut sums[1 + y / TILE as usize * columns + column]] {
                    for (into, v) in into.iter_mut().zip(sum) {
                        *into += v;
                    }
                    *pixels += part.len() as u32;
                }
            }
        }
        sums[0] = whole;
        let r = radius_scale;
        let tile = |(sum, pixels): ([f64; 3], u32)| {
            let [red, green, blue] = sum.map(|v| v / f64::from(pixels.max(1)));
            let values = [(red + green + blue) / 3.0, red, green, blue];
            values.map(|x| [x, r * x, r * r * x, 0.0, 0.0, 0.0, 0.0])
        };
        Self {
            scales: EXPONENTS.map(|e| libm::pow(r, e)),
            alike: [0.0; 3],
            unlike: [0.0; 4],
            tiles: sums.into_iter().map(tile).collect(),
        }
    }

    /// Turns the sums of a left sibling into those of the parent. `are_leaves`: each sibling is one pass.
    pub fn join(&mut self, right: &Self, are_leaves: bool) {
        let [left_inverse, _, left_r, ..] = self.scales;
        let [right_inverse, _, right_r, ..] = right.scales;
        let mean_r = 0.5 * (left_r + right_r);
        let is_alike = (left_r - right_r).abs() <= ALIKE * mean_r;
        let tiles = self.tiles.iter_mut().zip(&right.tiles);
        for (l, r) in tiles.flat_map(|(l, r)| l.iter_mut().zip(r)) {
            let d = l[0] - r[0];
            for (a, b) in l.iter_mut().zip(r) {
                *a += b;
            }
            match (are_leaves, is_alike) {
                (false, _) => {}
                (true, true) => (l[3], l[4], l[5]) = (d * d, d * d * mean_r, d * d * d * d),
                (true, false) => l[6] = d,
            }
        }
        let alike = self.alike.iter_mut().zip(right.alike);
        let unlike = self.unlike.iter_mut().zip(right.unlike);
        let scales = self.scales.iter_mut().zip(right.scales);
        for (a, b) in scales.chain(alike).chain(unlike) {
            *a += b;
        }
        match (are_leaves, is_alike) {
            (false, _) => {}
            (true, true) => self.alike = [1.0, mean_r, 0.5 * (left_inverse + right_inverse)],
            (true, false) => {
                let [a, b, c] = BIAS_EXPONENTS.map(|p| libm::pow(left_r, p) - libm::pow(right_r, p));
                self.unlike = [1.0, a, b, c];
            }
        }
    }

    /// Whether passes of images of this size could have given all these values.
    pub fn is_sound(&self, width: u32, height: u32) -> bool {
        // No sum is ever minus zero.
        let is_value = |v: &f64| v.is_finite() && (*v != 0.0 || v.is_sign_positive());
        let is_square = |v: &f64| v.is_finite() && v.is_sign_positive();
        let sound = |sums: &Sums| sums.iter().all(is_value) && sums[3..6].iter().all(is_square);
        self.tiles.len() == tile_count(width, height)
            && self.tiles.iter().flatten().all(sound)
            && self.scales.iter().all(|s| s.is_finite() && *s > 0.0)
            && self.alike.iter().all(is_square)
            && self.unlike.iter().all(is_value)
    }

    /// Length of [`Self::to_bytes`] for images of this size.
    pub fn byte_count(width: u32, height: u32) -> usize {
        8 * (EXPONENTS.len() + 7 + SUMS * CHANNELS * tile_count(width, height))
    }

    /// All values, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let tiles = self.tiles.as_flattened().as_flattened();
        let values = self.scales.iter().chain(&self.alike).chain(&self.unlike);
        let values = values.chain(tiles);
        values.flat_map(|v| v.to_le_bytes()).collect()
    }

    /// Read what [`Self::to_bytes`] wrote.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (chunks, rest) = bytes.as_chunks();
        let values: Vec<f64> = chunks.iter().map(|c| f64::from_le_bytes(*c)).collect();
        let (scales, values) = values.split_first_chunk()?;
        let (alike, values) = values.split_first_chunk()?;
        let (unlike, sums) = values.split_first_chunk()?;
        let (sums, more) = sums.as_chunks();
        let (tiles, some) = sums.as_chunks();
        (rest.is_empty() && more.is_empty() && some.is_empty()).then(|| Self {
            scales: *scales,
            alike: *alike,
            unlike: *unlike,
            tiles: tiles.to_vec(),
        })
    }
}
