//! `beamfarm denoise`: a picture with less noise, of an image that has the layers for it.

use crate::failure::Failure;
use crate::output::{denoised_name, write_both};
use crate::view_args::ViewArgs;
use beamfarm_image::denoise::{Input, denoise};
use beamfarm_image::exr::{DenoisedMeta, MadeOf, Provenance, read_channels};
use beamfarm_image::film::Film;
use beamfarm_image::view::View;
use beamfarm_worker::say;
use clap::Args;
use std::ffi::OsStr;
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

    /// Where to write the picture, and a PNG beside it [default: IMAGE.denoised.exr]
    #[arg(short, long, value_name = "OUT.exr")]
    output: Option<PathBuf>,

    #[command(flatten)]
    view: ViewArgs,
}

/// Channels that are read, three of each layer; the depth is alone.
const CHANNELS: [&str; 13] = [
    "R", "G", "B", "odd.R", "odd.G", "odd.B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z",
    "depth.Z",
];

pub fn main(args: DenoiseArgs) -> Result<(), Failure> {
    let path = args.image.display();
    let output = args.output.clone().unwrap_or_else(|| denoised_name(&args.image));
    if output.extension() != Some(OsStr::new("exr")) {
        let message = format!("{}: expected a name that ends in .exr", output.display());
        return Err(Failure::usage(message));
    }
    if output == args.image {
        return Err(Failure::usage(format!(
            "{path}: expected another name than the image's own"
        )));
    }
    let hint = "expected an image of `beamfarm render --denoise`, or --aov odd,albedo,normal,depth";
    let (size, channels) =
        read_channels(&args.image, &CHANNELS).map_err(|error| Failure::usage(format!("{error}; {hint}")))?;
    let made = MadeOf::read(&args.image)
        .ok_or_else(|| Failure::usage(format!("{path}: does not say of which passes it is made; {hint}")))?;
    let scene_file = Provenance::read(&args.image).and_then(|provenance| provenance.scene_file);
    let films: Vec<Film> = channels
        .chunks_exact(3)
        .map(|channels| {
            let mut film = Film::new(size[0], size[1]);
            for (i, pixel) in film.pixels.iter_mut().enumerate() {
                *pixel = std::array::from_fn(|c| channels[c][i]);
            }
            film
        })
        .collect();
    let ([beauty, odd, albedo, normal], Some(depth)) = (&films[..], channels.last()) else {
        return Err(Failure::usage(format!("{path}: {hint}")));
    };
    let input = Input {
        passes: made.passes,
        beauty,
        odd,
        albedo,
        normal,
        depth,
    };
    let film = denoise(&input).map_err(|error| Failure::usage(format!("{path}: {error}")))?;
    let meta = DenoisedMeta::of_image(&made, scene_file);
    write_both(&output, &film, &meta, args.view.over(View::default()))?;
    say!(
        "wrote {} and {}: biased, of {} passes",
        output.display(),
        output.with_extension("png").display(),
        made.passes
    );
    Ok(())
}
