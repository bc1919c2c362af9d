//! `beamfarm compare`: the difference between an image and a reference.

use crate::failure::Failure;
use crate::output::print_text;
use beamfarm_image::exr::{pixel_hash, read_rgb};
use beamfarm_image::metrics::compare;
use beamfarm_worker::say;
use clap::Args;
use std::path::PathBuf;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm reference scene.toml --time 10m -o reference.exr
  beamfarm compare scene.exr reference.exr
  beamfarm compare a.exr b.exr | grep identical       whether two images have the same bits";

pub const MEANING: &str = "\
RMSE        root of the mean of (x - ref)^2
relMSE      mean of (x - ref)^2 / (ref^2 + 0.01)
mean ratio  mean of the image over mean of the reference: finds a lost factor
8x8 block   the block whose mean differs most: finds bias that hides in noise
identical   printed only where every bit is the same
All values are over linear RGB, without exposure.";

#[derive(Args)]
pub struct CompareArgs {
    /// EXR image
    image: PathBuf,
    /// EXR image of the same size to compare it with
    reference: PathBuf,
}

pub fn main(args: CompareArgs) -> Result<(), Failure> {
    let image = read_rgb(&args.image).map_err(Failure::usage)?;
    let reference = read_rgb(&args.reference).map_err(Failure::usage)?;
    let metrics = compare(&image, &reference).map_err(Failure::usage)?;
    print_text(&metrics.to_string())?;
    if pixel_hash(&image) == pixel_hash(&reference) {
        say!("identical      every bit");
    }
    Ok(())
}
