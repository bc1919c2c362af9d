//! Denoised pictures on disk, which cannot be mistaken for averages.

use super::header::text;
use super::image::{ImageMeta, MadeOf, Maker, encode};
use super::read::read_channels;
use crate::atomic;
use crate::denoise::Input;
use crate::error::ImageError;
use crate::film::Film;
use crate::merge::Average;
use exr::image::{AnyChannel, AnyChannels, FlatSamples};
use exr::meta::attribute::AttributeValue;
use exr::prelude::Vec2;
use std::path::Path;

/// The part of an image file that [`Input`] needs for denoising.
#[derive(Clone, Debug)]
pub struct DenoiseLayers {
    /// The passes that made the image.
    pub made: MadeOf,
    /// Their mean radiance.
    pub beauty: Film,
    odd: Film,
    albedo: Film,
    normal: Film,
    depth: Vec<f32>,
}

/// Channels to read: three for each layer, one for the depth.
const CHANNELS: [&str; 13] = [
    "R", "G", "B", "odd.R", "odd.G", "odd.B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z",
    "depth.Z",
];

impl DenoiseLayers {
    /// Read an image that was rendered with the layers odd, albedo, normal and depth.
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        let hint = "expected an image of `beamfarm render --denoise`, or --aov odd,albedo,normal,depth";
        let failed = |message: &str| ImageError::File {
            path: path.to_owned(),
            message: format!("{message}; {hint}"),
        };
        let ([width, height], mut channels) = read_channels(path, &CHANNELS).map_err(|error| match error {
            ImageError::File { message, .. } => failed(&message),
            other => other,
        })?;
        let made = MadeOf::read(path).ok_or_else(|| failed("does not say of which passes it is made"))?;
        let depth = channels.pop().unwrap_or_default();
        let film = |first: usize| {
            let mut film = Film::new(width, height);
            for (i, pixel) in film.pixels.iter_mut().enumerate() {
                *pixel = std::array::from_fn(|c| channels[first + c][i]);
            }
            film
        };
        Ok(Self {
            made,
            beauty: film(0),
            odd: film(3),
            albedo: film(6),
            normal: film(9),
            depth,
        })
    }

    /// The input for [`denoise`](crate::denoise::denoise).
    pub fn input(&self) -> Input<'_> {
        Input {
            passes: self.made.passes,
            beauty: &self.beauty,
            odd: &self.odd,
            albedo: &self.albedo,
            normal: &self.normal,
            depth: &self.depth,
        }
    }
}

/// A denoised picture's metadata about its origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DenoisedMeta {
    /// Hash of the scene, as text.
    pub scene: String,
    /// [`ImageMeta::scene_file`].
    pub scene_file: Option<String>,
    /// Number of passes in the average.
    pub passes: u64,
    /// The job's seed.
    pub seed: u64,
    /// Version of the program that rendered the passes.
    pub version: String,
}

impl DenoisedMeta {
    /// For the average of an image.
    pub fn of(average: &Average, meta: &ImageMeta) -> Self {
        Self {
            scene: meta.scene.to_string(),
            scene_file: meta.scene_file.clone(),
            passes: average.passes,
            seed: match meta.maker {
                Maker::Passes(settings) => settings.seed,
                Maker::Reference(settings) => settings.seed,
            },
            version: meta.version.clone(),
        }
    }

    /// For an image that was written.
    pub fn of_image(made: &MadeOf, scene_file: Option<String>) -> Self {
        Self {
            scene: made.scene.clone(),
            scene_file,
            passes: made.passes,
            seed: made.seed,
            version: made.version.clone(),
        }
    }
}

/// Write a denoised picture: R, G, B, float32, lossless ZIP. Its attribute `beamfarmDenoised` says that it is biased.
/// It names no set of passes, because it is not their average.
pub fn write_denoised(path: &Path, film: &Film, meta: &DenoisedMeta) -> Result<(), ImageError> {
    let number = |n: u64| text("number", &n.to_string());
    let mut own: Vec<(&str, AttributeValue)> = vec![
        (
            "beamfarmDenoised",
            text(
                "method",
                "biased: non-local means of each half of the passes, judged by the other",
            )?,
        ),
        ("beamfarmScene", text("scene", &meta.scene)?),
        ("beamfarmPasses", number(meta.passes)?),
        ("beamfarmSeed", number(meta.seed)?),
        ("beamfarmVersion", text("version", &meta.version)?),
    ];
    if let Some(file) = &meta.scene_file {
        own.push(("beamfarmSceneFile", text("scene file", file)?));
    }
    write_film(path, film, &meta.version, own)
}

/// Write a film that is not an average. `version`: of the program.
pub(super) fn write_film(
    path: &Path,
    film: &Film,
    version: &str,
    own: Vec<(&str, AttributeValue)>,
) -> Result<(), ImageError> {
    let size = Vec2(film.width as usize, film.height as usize);
    if size.area() == 0 || film.pixels.len() != size.area() {
        return Err(ImageError::Encode {
            field: "size",
            message: format!("{} x {} pixels", size.0, size.1),
        });
    }
    let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| {
        let samples = film.pixels.iter().map(|pixel| pixel[c]).collect();
        AnyChannel::new(name, FlatSamples::F32(samples))
    });
    let channels = AnyChannels::sort(channels.collect());
    atomic::write_file(path, &encode(size, version, own, channels)?)
}
