//! How far an image is from a reference.

use crate::film::Film;
use std::fmt;

/// Why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
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
    /// One image holds values that no mean may include.
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

/// Differences between an image x and a reference. Sums are taken in f64, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Metrics {
    /// Root of the mean over pixels and channels of (x - ref)^2.
    pub rmse: f64,
    /// Mean over pixels and channels of (x - ref)^2 / (ref^2 + 0.01).
    pub rel_mse: f64,
    /// Mean of the image over the mean of the reference, per channel; one if both are zero.
    pub channel_ratio: [f64; 3],
    /// The same ratio over all channels.
    pub ratio: f64,
    /// The 8 x 8 block whose mean differs most.
    pub largest_absolute: BlockDeviation,
    /// The 8 x 8 block whose mean differs most relative to the reference's.
    pub largest_relative: BlockDeviation,
}

/// A block of pixels whose mean over pixels and channels differs. Noise hardly shows in block means, so this finds
/// bias.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockDeviation {
    /// Left column of the block.
    pub x: u32,
    /// Top row of the block.
    pub y: u32,
    /// Mean of the image minus mean of the reference.
    pub absolute: f64,
    /// `absolute` over the reference's block mean, or over a hundredth of the reference's mean if that is larger.
    pub relative: f64,
}

/// Side of the blocks, in pixels.
const BLOCK: u32 = 8;

/// Compare an image with a reference of the same size.
pub fn compare(image: &Film, reference: &Film) -> Result<Metrics, MetricsError> {
    let (width, height) = (reference.width, reference.height);
    let pixels = width as usize * height as usize;
    let sizes = [[image.width, image.height], [width, height]];
    if pixels == 0 || sizes[0] != sizes[1] || image.pixels.len() != pixels || reference.pixels.len() != pixels {
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
    if image == reference { 1.0 } else { image / reference }
}

/// Blocks cover the image. The last block of a row or column takes in what is left over, so that none is smaller than 8
/// x 8 (unless the image is) and noisier than the others.
fn largest_deviations(image: &Film, reference: &Film, floor: f64) -> (BlockDeviation, BlockDeviation) {
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
            relative: if difference == 0.0 { 0.0 } else { difference / scale },
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
        let named = [("absolute", self.largest_absolute), ("relative", self.largest_relative)];
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

#[cfg(test)]
mod tests {
    use super::*;

    fn film(width: u32, height: u32, value: impl Fn(u32, u32) -> [f32; 3]) -> Film {
        let mut film = Film::new(width, height);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            *pixel = value(i as u32 % width, i as u32 / width);
        }
        film
    }

    fn assert_near(value: f64, expected: f64) {
        assert!(
            (value - expected).abs() <= 1e-12 * expected.abs(),
            "{value}, expected {expected}"
        );
    }

    #[test]
    fn an_image_is_itself() {
        let image = film(11, 9, |x, y| [x as f32, y as f32, 0.0]);
        let metrics = compare(&image, &image).unwrap();
        assert_eq!((metrics.rmse, metrics.rel_mse), (0.0, 0.0));
        assert_eq!((metrics.ratio, metrics.channel_ratio), (1.0, [1.0; 3]));
        assert_eq!(metrics.largest_absolute, BlockDeviation::default());
        assert_eq!(metrics.largest_relative, BlockDeviation::default());
    }

    /// Worked out by hand on two pixels.
    #[test]
    fn definitions_hold() {
        let reference = film(2, 1, |x, _| [[1.0, 2.0, 4.0], [3.0, 0.0, 4.0]][x as usize]);
        let image = film(2, 1, |x, _| [[1.5, 2.0, 4.0], [3.0, 1.0, 2.0]][x as usize]);
        let metrics = compare(&image, &reference).unwrap();
        assert_near(metrics.rmse, (5.25f64 / 6.0).sqrt());
        assert_near(metrics.rel_mse, (0.25 / 1.01 + 1.0 / 0.01 + 4.0 / 16.01) / 6.0);
        assert_eq!(metrics.channel_ratio, [4.5 / 4.0, 3.0 / 2.0, 6.0 / 8.0]);
        assert_near(metrics.ratio, 13.5 / 14.0);
        assert_near(metrics.largest_absolute.absolute, -0.5 / 6.0);
        assert_near(metrics.largest_absolute.relative, -0.5 / 14.0);
    }

    #[test]
    fn a_biased_block_is_found() {
        let reference = film(35, 20, |x, _| if x < 16 { [0.1; 3] } else { [10.0; 3] });
        let image = film(35, 20, |x, y| match (x, y) {
            (8..16, 0..8) => [0.2; 3],
            // Within the last column of blocks, which takes in the remainder: 11 x 12 pixels from (24, 8).
            (34, 19) => [142.0; 3],
            // Noise with mean zero.
            _ if x < 8 => [if (x + y) % 2 == 0 { 0.0 } else { 0.2 }; 3],
            _ if x < 16 => [0.1; 3],
            _ => [10.0; 3],
        });
        let metrics = compare(&image, &reference).unwrap();
        let BlockDeviation {
            x,
            y,
            absolute,
            relative,
        } = metrics.largest_absolute;
        assert_eq!((x, y), (24, 8));
        assert_near(absolute, 1.0);
        assert_near(relative, 0.1);
        let BlockDeviation {
            x,
            y,
            absolute,
            relative,
        } = metrics.largest_relative;
        assert_eq!((x, y), (8, 0));
        assert!((absolute - 0.1).abs() < 1e-8 && (relative - 1.0).abs() < 1e-7);
        let table = metrics.to_string();
        assert!(table.contains("at (24, 8)") && table.contains("at (8, 0)"), "{table}");
    }

    #[test]
    fn black_blocks_do_not_divide_by_zero() {
        let black = Film::new(8, 8);
        let grey = film(8, 8, |_, _| [0.5; 3]);
        assert_eq!(compare(&black, &black).unwrap().ratio, 1.0);
        assert_eq!(compare(&grey, &black).unwrap().ratio, f64::INFINITY);
        assert_eq!(compare(&black, &grey).unwrap().largest_relative.relative, -1.0);
    }

    #[test]
    fn bad_images_are_refused() {
        let good = Film::new(4, 2);
        let mut bad = good.clone();
        bad.pixels[5][1] = f32::NAN;
        let error = compare(&bad, &good).unwrap_err();
        assert_eq!(error.to_string(), "the image has a NaN or an infinity at x = 1, y = 1");
        bad.pixels[5][1] = f32::INFINITY;
        let error = compare(&good, &bad).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the reference has a NaN or an infinity at x = 1, y = 1"
        );
        assert!(matches!(
            compare(&good, &Film::new(2, 4)),
            Err(MetricsError::Size { .. })
        ));
        assert!(matches!(
            compare(&Film::new(0, 4), &Film::new(0, 4)),
            Err(MetricsError::Size { .. })
        ));
    }
}
