//! The difference between an image and a reference that may be noisy itself.

use crate::failure::Failure;
use beamfarm_image::exr::{read_rgb, read_standard_error};
use beamfarm_image::film::Film;
use beamfarm_image::metrics::{self, MetricsError};
use serde::Serialize;
use std::path::Path;

/// The image to compare with.
pub struct Reference {
    pub image: Film,
    /// relMSE due to its own noise.
    pub noise: Option<f64>,
}

/// The differences of an image from the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    pub rmse: f64,
    pub rel_mse: f64,
    /// relMSE minus that of the reference's own noise, if known. May be slightly negative by chance.
    pub net_rel_mse: Option<f64>,
    pub mean_ratio: f64,
    /// Largest relative deviation of the mean of an 8 x 8 block.
    pub block_deviation: f64,
    /// Left column and top row of that block.
    pub block: [u32; 2],
}

impl Comparison {
    /// The best available estimate of the image's error.
    pub fn error(&self) -> f64 {
        self.net_rel_mse.unwrap_or(self.rel_mse)
    }
}

impl Reference {
    /// Read a reference. `noise` overrides the file's own.
    pub fn read(path: &Path, noise: Option<f64>, size: [u32; 2]) -> Result<Self, Failure> {
        let image = read_rgb(path).map_err(Failure::usage)?;
        if [image.width, image.height] != size {
            return Err(Failure::usage(format!(
                "{}: the reference has {} x {} pixels, the scene {} x {}",
                path.display(),
                image.width,
                image.height,
                size[0],
                size[1]
            )));
        }
        let stderr = read_standard_error(path).map_err(Failure::usage)?;
        let reference = Self {
            noise: noise.or_else(|| stderr.map(|stderr| relative_noise(&image, &stderr))),
            image,
        };
        // Rejects NaN now rather than after the rendering.
        reference
            .compare(&reference.image)
            .map_err(|error| Failure::usage(format!("{}: {error}", path.display())))?;
        Ok(reference)
    }

    /// Compare an image with the reference.
    pub fn compare(&self, image: &Film) -> Result<Comparison, MetricsError> {
        let metrics = metrics::compare(image, &self.image)?;
        let block = metrics.largest_relative;
        Ok(Comparison {
            rmse: metrics.rmse,
            rel_mse: metrics.rel_mse,
            net_rel_mse: self.noise.map(|noise| metrics.rel_mse - noise),
            mean_ratio: metrics.ratio,
            block_deviation: block.relative,
            block: [block.x, block.y],
        })
    }
}

/// relMSE of an image due to noise with this standard error: the mean of stderr^2 / (x^2 + 0.01). The noise is
/// independent of the comparison image, so it adds to the relMSE.
pub fn relative_noise(image: &Film, standard_error: &Film) -> f64 {
    let values = image.pixels.iter().flatten();
    let errors = standard_error.pixels.iter().flatten();
    let squares = values.zip(errors).map(|(x, error)| {
        let (x, error) = (f64::from(*x), f64::from(*error));
        error * error / (x * x + 0.01)
    });
    squares.sum::<f64>() / (3 * image.pixels.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(values: impl Iterator<Item = f32>) -> Film {
        let mut film = Film::new(32, 32);
        for (pixel, value) in film.pixels.iter_mut().zip(values) {
            *pixel = [value; 3];
        }
        film
    }

    /// Approximately standard normal: twelve uniform numbers of a linear congruential generator.
    fn noise(mut state: u32) -> impl Iterator<Item = f32> {
        let mut uniform = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        std::iter::repeat_with(move || (0..12).map(|_| uniform()).sum::<f32>() - 6.0)
    }

    #[test]
    fn the_references_noise_is_taken_off() {
        let truth = 0.5;
        let reference = film(noise(1).map(|n| truth + 0.05 * n));
        let image = film(noise(2).map(|n| truth + 0.02 * n));
        let stderr = film(std::iter::repeat(0.05));
        let own = relative_noise(&reference, &stderr);
        let expected = 0.05f64 * 0.05 / 0.26;
        assert!((own / expected - 1.0).abs() < 0.05, "{own}");
        let reference = Reference {
            image: reference,
            noise: Some(own),
        };
        let comparison = reference.compare(&image).unwrap();
        assert_eq!(comparison.net_rel_mse, Some(comparison.rel_mse - own));
        // 1024 pixels: the standard error is that of the mean of 1024 squares of noise of 0.0029, 4.4 % of 0.0112.
        let error = (comparison.error() - 0.02 * 0.02 / 0.26).abs();
        assert!(error < 4.0 * 0.044 * 0.0112, "{comparison:?}");
        assert!(comparison.rel_mse > 5.0 * comparison.error(), "{comparison:?}");
    }

    #[test]
    fn without_known_noise_nothing_is_taken_off() {
        let reference = Reference {
            image: film(std::iter::repeat(1.0)),
            noise: None,
        };
        let comparison = reference.compare(&film(std::iter::repeat(1.1))).unwrap();
        assert_eq!(comparison.net_rel_mse, None);
        assert!((comparison.error() - 0.01 / 1.01).abs() < 1e-7);
        assert!((comparison.block_deviation - 0.1).abs() < 1e-6);
    }
}
