//! How far an image is from a reference.

use crate::film::Film;
use std::fmt;

/// Images that cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricsError {
    /// They have different sizes, or none.
    #[error(
        "expected images of one size, found {} x {} and {} x {} pixels",
        image[0], image[1], reference[0], reference[1]
    )]
    Size {
        /// Width and height of the image.
        image: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
    /// One holds values that no mean may see.
    #[error("the {which} has a NaN or an infinity at x = {x}, y = {y}")]
    NonFinite {
        /// "image" or "reference".
        which: &'static str,
        /// Column of the first such pixel.
        x: u32,
        /// Row of the first such pixel.
        y: u32,
    },
}

/// Differences of an image x from a reference. Sums are taken in f64, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Metrics {
    /// Root of the mean over pixels and channels of (x - ref)^2.
    pub rmse: f64,
    /// Mean over pixels and channels of (x - ref)^2 / (ref^2 + 0.01).
    pub rel_mse: f64,
    /// Mean of the image over the mean of the reference, per channel. One where both are zero.
    pub channel_ratio: [f64; 3],
    /// The same over all channels.
    pub ratio: f64,
    /// The 8 x 8 block whose mean differs most.
    pub largest_absolute: BlockDeviation,
    /// The 8 x 8 block whose mean differs most in proportion to the reference's.
    pub largest_relative: BlockDeviation,
}

/// A block of pixels whose mean over pixels and channels differs. Noise hardly shows in block means, so this finds bias.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockDeviation {
    /// Left column of the block.
    pub x: u32,
    /// Top row of the block.
    pub y: u32,
    /// Mean of the image minus mean of the reference.
    pub absolute: f64,
    /// `absolute` over the reference's block mean, or over a hundredth of the reference's mean where that is more.
    pub relative: f64,
}

/// Side of the blocks, in pixels.
const BLOCK: u32 = 8;

/// Compare an image with a reference of the same size.
pub fn compare(image: &Film, reference: &Film) -> Result<Metrics, MetricsError> {
    let (width, height) = (reference.width, reference.height);
    let pixels = width as usize * height as usize;
    let sizes = [[image.width, image.height], [width, height]];
    if pixels == 0
        || sizes[0] != sizes[1]
        || image.pixels.len() != pixels
        || reference.pixels.len() != pixels
    {
        return Err(MetricsError::Size {
            image: sizes[0],
            reference: sizes[1],
        });
    }
    for (which, film) in [("image", image), ("reference", reference)] {
        let bad = |pixel: &[f32; 3]| !pixel.iter().all(|v| v.is_finite());
        if let Some(i) = film.pixels.iter().position(bad) {
            let (x, y) = (i as u32 % width, i as u32 / width);
            return Err(MetricsError::NonFinite { which, x, y });
        }
    }

    let (mut squares, mut relative_squares) = (0.0, 0.0);
    let mut image_sum = [0.0f64; 3];
    let mut reference_sum = [0.0f64; 3];
    for (x, r) in image.pixels.iter().zip(&reference.pixels) {
        for c in 0..3 {
            let (x, r) = (f64::from(x[c]), f64::from(r[c]));
            let square = (x - r) * (x - r);
            squares += square;
            relative_squares += square / (r * r + 0.01);
            image_sum[c] += x;
            reference_sum[c] += r;
        }
    }
    let count = 3.0 * pixels as f64;
    let total = |sums: [f64; 3]| sums[0] + sums[1] + sums[2];
    let floor = 0.01 * (total(reference_sum) / count).abs();
    let (largest_absolute, largest_relative) = largest_deviations(image, reference, floor);
    Ok(Metrics {
        rmse: (squares / count).sqrt(),
        rel_mse: relative_squares / count,
        channel_ratio: std::array::from_fn(|c| ratio(image_sum[c], reference_sum[c])),
        ratio: ratio(total(image_sum), total(reference_sum)),
        largest_absolute,
        largest_relative,
    })
}

fn ratio(image: f64, reference: f64) -> f64 {
    if image == reference {
        1.0
    } else {
        image / reference
    }
}

/// Blocks cover the image: the last of a row or column takes in what is left over, so that none is smaller than 8 x 8 (if
/// the image is not) and noisier than the others.
fn largest_deviations(
    image: &Film,
    reference: &Film,
    floor: f64,
) -> (BlockDeviation, BlockDeviation) {
    let (width, height) = (image.width, image.height);
    let columns = (width / BLOCK).max(1);
    let rows = (height / BLOCK).max(1);
    let mut sums = vec![[0.0f64; 3]; columns as usize * rows as usize];
    let both = image.pixels.iter().zip(&reference.pixels);
    for (i, (x, r)) in both.enumerate() {
        let column = (i as u32 % width / BLOCK).min(columns - 1);
        let row = (i as u32 / width / BLOCK).min(rows - 1);
        let [image_sum, reference_sum, count] = &mut sums[(row * columns + column) as usize];
        for c in 0..3 {
            *image_sum += f64::from(x[c]);
            *reference_sum += f64::from(r[c]);
            *count += 1.0;
        }
    }
    let mut absolute = BlockDeviation::default();
    let mut relative = BlockDeviation::default();
    for (i, [image_sum, reference_sum, count]) in sums.into_iter().enumerate() {
        let difference = (image_sum - reference_sum) / count;
        let scale = (reference_sum / count).abs().max(floor);
        let block = BlockDeviation {
            x: i as u32 % columns * BLOCK,
            y: i as u32 / columns * BLOCK,
            absolute: difference,
            relative: if difference == 0.0 {
                0.0
            } else {
                difference / scale
            },
        };
        if block.absolute.abs() > absolute.absolute.abs() {
            absolute = block;
        }
        if block.relative.abs() > relative.relative.abs() {
            relative = block;
        }
    }
    (absolute, relative)
}

impl fmt::Display for Metrics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.channel_ratio;
        writeln!(f, "RMSE                  {:.6e}", self.rmse)?;
        writeln!(f, "relMSE                {:.6e}", self.rel_mse)?;
        writeln!(
            f,
            "mean ratio            {:.6}  (R {r:.6}, G {g:.6}, B {b:.6})",
            self.ratio
        )?;
        let named = [
            ("absolute", self.largest_absolute),
            ("relative", self.largest_relative),
        ];
        for (name, block) in named {
            let BlockDeviation {
                x,
                y,
                absolute,
                relative,
            } = block;
            writeln!(
                f,
                "8x8 block, {name}   {absolute:+.6e}  ({:+.3} %) at ({x}, {y})",
                100.0 * relative
            )?;
        }
        Ok(())
    }
}
