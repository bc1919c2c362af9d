//! PNG: the picture for people.

use crate::atomic;
use crate::error::ImageError;
use crate::film::Film;
use std::path::Path;

/// Write an 8-bit sRGB picture of linear Rec. 709 radiance, scaled by 2^`exposure_stops` and clamped to [0, 1].
///
/// Smooth gradients are kept from banding by an ordered dither below one step; exact steps, black and white stay.
pub fn write_png(path: &Path, film: &Film, exposure_stops: f32) -> Result<(), ImageError> {
    atomic::write_file(path, &encode_png(film, exposure_stops)?)
}

/// The bytes of that file.
pub fn encode_png(film: &Film, exposure_stops: f32) -> Result<Vec<u8>, ImageError> {
    let failed = |error: png::EncodingError| ImageError::Encode {
        field: "PNG",
        message: error.to_string(),
    };
    let scale = libm::exp2f(exposure_stops);
    let mut data = Vec::with_capacity(3 * film.pixels.len());
    for (y, row) in film.pixels.chunks(film.width.max(1) as usize).enumerate() {
        for (x, pixel) in row.iter().enumerate() {
            let threshold = bayer(x, y);
            data.extend(pixel.map(|v| (srgb(v * scale) * 255.0 + threshold) as u8));
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, film.width, film.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// The sRGB transfer function (IEC 61966-2-1) of a value clamped to [0, 1]; NaN is black.
fn srgb(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * libm::powf(v, 1.0 / 2.4) - 0.055
    }
}

/// The 8 x 8 Bayer matrix, in (0, 1): the bits of x ^ y and y, interleaved and reversed.
fn bayer(x: usize, y: usize) -> f32 {
    let bits = (0..3).fold(0, |bits, i| {
        bits << 2 | ((x ^ y) >> i & 1) << 1 | (y >> i & 1)
    });
    (bits as f32 + 0.5) / 64.0
}
