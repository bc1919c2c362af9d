//! Final images on disk, and images to compare them with.

use super::header::{attributes, sort_attributes, text};
use crate::atomic;
use crate::error::ImageError;
use crate::film::Film;
use crate::job::{JobSettings, SceneHash};
use crate::merge::Average;
use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::attribute::{AttributeValue, Compression, LineOrder};
use exr::meta::header::LayerAttributes;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, Vec2};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What a final image says about itself, beside its number of passes and its error.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageMeta {
    /// The scene.
    pub scene: SceneHash,
    /// The job.
    pub settings: JobSettings,
    /// Time since the job started. The one attribute that differs between runs.
    pub render_seconds: f64,
    /// Version of the program.
    pub version: String,
}

/// Write the final image: R, G, B the mean radiance, stderr.R, .G, .B its standard error, float32, lossless ZIP.
///
/// Apart from the attribute `beamfarmRenderSeconds` the file is the same bytes whenever the average and the job are.
pub fn write_image(path: &Path, average: &Average, meta: &ImageMeta) -> Result<(), ImageError> {
    atomic::write_file(path, &encode_image(average, meta)?)
}

fn encode_image(average: &Average, meta: &ImageMeta) -> Result<Vec<u8>, ImageError> {
    let beauty = &average.beauty;
    let size = Vec2(beauty.width as usize, beauty.height as usize);
    let films = [("", beauty), ("stderr.", &average.standard_error)];
    if size.area() == 0
        || films
            .iter()
            .any(|(_, film)| film.pixels.len() != size.area())
    {
        return Err(ImageError::Encode {
            field: "size",
            message: format!("{} x {} pixels", size.0, size.1),
        });
    }
    let channel = |prefix: &str, film: &Film, c: usize| {
        let samples = film.pixels.iter().map(|pixel| pixel[c]).collect();
        AnyChannel::new(
            format!("{prefix}{}", ["R", "G", "B"][c]).as_str(),
            FlatSamples::F32(samples),
        )
    };
    let each = |(prefix, film)| (0..3).map(move |c| channel(prefix, film, c));
    let channels = AnyChannels::sort(films.into_iter().flat_map(each).collect());

    let settings = &meta.settings;
    let number = |n: u64| text("number", &n.to_string());
    let other = attributes(vec![
        ("beamfarmScene", text("scene", &meta.scene.to_string())?),
        ("beamfarmPasses", number(average.passes)?),
        ("beamfarmSeed", number(settings.seed)?),
        ("beamfarmAlpha", AttributeValue::F64(settings.alpha)),
        (
            "beamfarmSchedule",
            text("schedule", &settings.schedule.to_string())?,
        ),
        (
            "beamfarmPathsPerPass",
            number(settings.paths_per_pass.into())?,
        ),
        (
            "beamfarmReferencePaths",
            number(settings.reference_paths.into())?,
        ),
        (
            "beamfarmRelativeError",
            AttributeValue::F64(average.relative_standard_error()),
        ),
        (
            "beamfarmRenderSeconds",
            AttributeValue::F64(meta.render_seconds),
        ),
        ("beamfarmVersion", text("version", &meta.version)?),
    ]);
    let layer_attributes = LayerAttributes {
        software_name: exr::prelude::Text::new_or_none(format!("beamfarm {}", meta.version)),
        other,
        ..LayerAttributes::default()
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        line_order: LineOrder::Increasing,
        ..Encoding::UNCOMPRESSED
    };
    let image = Image::from_layer(Layer::new(size, layer_attributes, encoding, channels));
    let mut bytes = Vec::new();
    let written = image
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes));
    written.map_err(|error| ImageError::Encode {
        field: "EXR image",
        message: error.to_string(),
    })?;
    sort_attributes(&mut bytes)?;
    Ok(bytes)
}

/// Read the channels R, G, B, half or float, of the first layer that has them.
pub fn read_rgb(path: &Path) -> Result<Film, ImageError> {
    let bytes = std::fs::read(path).map_err(|source| ImageError::Io {
        path: path.to_owned(),
        source,
    })?;
    decode_rgb(&bytes).map_err(|message| ImageError::File {
        path: path.to_owned(),
        message,
    })
}

/// Pixels of the largest image that is read.
const MAX_PIXELS: usize = 1 << 28;

/// [`read_rgb`] from memory; the error says what is wrong with the bytes.
pub fn decode_rgb(bytes: &[u8]) -> Result<Film, String> {
    // The `exr` crate asserts what it should check in some corners of a header; a broken file is no reason to stop.
    let read = catch_unwind(AssertUnwindSafe(|| decode_rgb_trusting(bytes)));
    read.unwrap_or_else(|_| Err("not a sound OpenEXR file".into()))
}

fn decode_rgb_trusting(bytes: &[u8]) -> Result<Film, String> {
    let meta =
        exr::meta::MetaData::read_from_buffered(bytes, false).map_err(|error| error.to_string())?;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        if width
            .checked_mul(height)
            .is_none_or(|pixels| pixels > MAX_PIXELS)
        {
            return Err(format!(
                "{width} x {height} pixels; expected at most {MAX_PIXELS}"
            ));
        }
    }
    let create = |size: Vec2<usize>, _: &_| Film::new(size.0 as u32, size.1 as u32);
    let set = |film: &mut Film, at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
        let i = at.1 * film.width as usize + at.0;
        if let Some(pixel) = film.pixels.get_mut(i) {
            *pixel = [r, g, b];
        }
    };
    let reader = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels();
    let reader = reader
        .required("R")
        .required("G")
        .required("B")
        .collect_pixels(create, set);
    let reader = reader.first_valid_layer().all_attributes().non_parallel();
    let image = reader
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    Ok(image.layer_data.channel_data.pixels)
}

/// BLAKE3, in hexadecimal, of width, height and the pixels' bits, all little-endian. Equal for equal pictures, whatever
/// file they are in.
pub fn pixel_hash(film: &Film) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&film.width.to_le_bytes());
    hasher.update(&film.height.to_le_bytes());
    let mut row = Vec::new();
    for pixels in film.pixels.chunks(film.width.max(1) as usize) {
        row.clear();
        row.extend(
            pixels
                .iter()
                .flatten()
                .flat_map(|value| value.to_le_bytes()),
        );
        hasher.update(&row);
    }
    hasher.finalize().to_string()
}
