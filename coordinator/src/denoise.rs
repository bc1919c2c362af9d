//! `beamfarm denoise`: a less noisy picture from an image that has the layers for it.

use crate::failure::Failure;
use crate::output::{check, denoised_name, write_both};
use crate::view_args::ViewArgs;
use beamfarm_image::denoise::denoise;
use beamfarm_image::exr::{DenoiseLayers, DenoisedMeta, Provenance};
use beamfarm_image::view::View;
use beamfarm_worker::say;
use clap::Args;
use std::path::PathBuf;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm render scene.toml --aov odd,albedo,normal,depth
  beamfarm denoise scene.exr                      scene.denoised.exr and scene.denoised.png
  beamfarm denoise scene.exr -o smooth.exr --exposure 1

The picture is biased: the image that it is made of is the one that converges. `beamfarm render --denoise`
makes both in one go.";

#[derive(Args)]
pub struct DenoiseArgs {
    /// Image of `render --denoise`, or of `render --aov odd,albedo,normal,depth`
    image: PathBuf,

    /// Where to write the picture, with a PNG beside it [default: IMAGE.denoised.exr]
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: Option<PathBuf>,

    #[command(flatten)]
    view: ViewArgs,
}

pub fn main(args: DenoiseArgs) -> Result<(), Failure> {
    let path = args.image.display();
    let output = args.output.clone().unwrap_or_else(|| denoised_name(&args.image));
    check(&output)?;
    if output == args.image {
        return Err(Failure::usage(format!(
            "{path}: expected another name than the image's own"
        )));
    }
    let layers = DenoiseLayers::read(&args.image).map_err(Failure::usage)?;
    let scene_file = Provenance::read(&args.image).and_then(|provenance| provenance.scene_file);
    let film = denoise(&layers.input()).map_err(|error| Failure::usage(format!("{path}: {error}")))?;
    let made = &layers.made;
    let meta = DenoisedMeta::of_image(made, scene_file);
    write_both(&output, &film, &meta, args.view.over(View::default()))?;
    say!(
        "wrote {} and {}: biased, of {} passes",
        output.display(),
        output.with_extension("png").display(),
        made.passes
    );
    Ok(())
}
