//! How much of an image's error denoising removes.
//!
//! ```text
//! beamfarm render SCENE --time 90s --seed 7777 -o one.exr
//! beamfarm render SCENE --time 90s --seed 7778 -o another.exr
//! beamfarm render SCENE --passes 4 --seed 1 --aov odd,albedo,normal,depth -o image.exr
//! cargo run --release -p beamfarm-tests --example denoised -- one.exr another.exr image.exr
//! ```
//!
//! The arguments are two references r and s with other seeds, then any number of images x of the same size. For each
//! image the program prints the relMSE, as `beamfarm compare` defines it, of the image before and after denoising, and
//! the second over the first. Noise of the references does not count: relMSE is the mean over pixels and channels of
//!
//! ```text
//! (x - r) (x - s) / (m² + 0.01) = [(x - m)² - (r - s)² / 4] / (m² + 0.01),     m = (r + s) / 2
//! ```
//!
//! The noises of r, s and x are independent, so only that of x remains on average. Giving the same file twice makes it
//! one reference whose noise counts. Since one firefly can outweigh all other pixels, the program repeats the figures
//! without the thousandth of the pixels with the largest absolute values.
//!
//! For several images with the same number of passes and different seeds it also prints what they have in common: their
//! bias, which no filter is meant to remove. This is the same mean of (x - r) (y - s) over all pairs of images x and y.

use beamfarm_image::denoise::denoise;
use beamfarm_image::exr::{DenoiseLayers, read_rgb};
use beamfarm_image::film::Film;
use std::fmt;
use std::path::Path;

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let [one, another, images @ ..] = &files[..] else {
        return Err("expected REFERENCE.exr ANOTHER.exr IMAGE.exr…".into());
    };
    let references = [read_rgb(Path::new(one))?, read_rgb(Path::new(another))?];
    let (mut plain, mut smooth) = (Errors::default(), Errors::default());
    for image in images {
        let layers = DenoiseLayers::read(Path::new(image))?;
        let before = plain.add(&layers.beauty, &references)?;
        let after = smooth.add(&denoise(&layers.input())?, &references)?;
        println!("{image}: {}", Comparison { before, after });
    }
    if images.len() > 1 {
        let [before, after] = [&plain, &smooth].map(Errors::mean);
        println!("all: {}", Comparison { before, after });
        let [before, after] = [&plain, &smooth].map(Errors::in_common);
        println!("in common: {}", Comparison { before, after });
    }
    Ok(())
}

/// relMSE of all pixels, and without the largest thousandth.
#[derive(Clone, Copy, Default)]
struct Error([f64; 2]);

impl Error {
    /// The means of the pixels' values.
    fn of(mut pixels: Vec<f64>) -> Self {
        pixels.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let mean = |pixels: &[f64]| pixels.iter().sum::<f64>() / pixels.len().max(1) as f64;
        Self([mean(&pixels), mean(&pixels[..pixels.len() - pixels.len() / 1000])])
    }
}

struct Comparison {
    before: Error,
    after: Error,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Error([before, before_kept]), Error([after, after_kept])) = (self.before, self.after);
        write!(
            f,
            "relMSE {before:.6}, denoised {after:.6}, ratio {:.3}; ",
            after / before
        )?;
        let ratio = after_kept / before_kept;
        write!(f, "kept pixels {before_kept:.6}, {after_kept:.6}, {ratio:.3}")
    }
}

/// Errors of images with different seeds.
#[derive(Default)]
struct Errors {
    images: Vec<Error>,
    /// Sums over all images, by pixel.
    sums: Vec<Sums>,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    /// Deviations from either reference, by channel.
    off: [[f64; 3]; 2],
    /// The product of both, weighted.
    errors: f64,
    /// The weight of a product, by channel.
    weight: [f64; 3],
}

impl Errors {
    /// Adds an image; returns its relMSE.
    fn add(&mut self, film: &Film, [one, another]: &[Film; 2]) -> Result<Error, AnyError> {
        for reference in [one, another] {
            if (film.width, film.height) != (reference.width, reference.height) {
                return Err("the images have other sizes".into());
            }
        }
        self.sums.resize(film.pixels.len(), Sums::default());
        let pixels = film.pixels.iter().zip(one.pixels.iter().zip(&another.pixels));
        let mut errors = Vec::with_capacity(film.pixels.len());
        for (sums, (x, (r, s))) in self.sums.iter_mut().zip(pixels) {
            let mut error = 0.0;
            for c in 0..3 {
                let [x, r, s] = [x[c], r[c], s[c]].map(f64::from);
                let mean = (r + s) / 2.0;
                sums.weight[c] = 1.0 / (3.0 * (mean * mean + 0.01));
                sums.off[0][c] += x - r;
                sums.off[1][c] += x - s;
                error += (x - r) * (x - s) * sums.weight[c];
            }
            sums.errors += error;
            errors.push(error);
        }
        let error = Error::of(errors);
        self.images.push(error);
        Ok(error)
    }

    /// Mean relMSE of an image.
    fn mean(&self) -> Error {
        let mean = |i: usize| self.images.iter().map(|error| error.0[i]).sum::<f64>() / self.images.len() as f64;
        Error([mean(0), mean(1)])
    }

    /// relMSE of what the images have in common: all products of sums except those of an image with itself.
    fn in_common(&self) -> Error {
        let images = self.images.len() as f64;
        let pixel = |sums: &Sums| {
            let products = (0..3).map(|c| sums.off[0][c] * sums.off[1][c] * sums.weight[c]);
            (products.sum::<f64>() - sums.errors) / (images * (images - 1.0))
        };
        Error::of(self.sums.iter().map(pixel).collect())
    }
}
