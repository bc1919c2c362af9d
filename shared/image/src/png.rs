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
    let scale = libm::exp2f(exposure_stops);
    let mut data = Vec::with_capacity(3 * film.pixels.len());
    for (y, row) in film.pixels.chunks(film.width.max(1) as usize).enumerate() {
        for (x, pixel) in row.iter().enumerate() {
            let threshold = bayer(x, y);
            data.extend(pixel.map(|v| (srgb(v * scale) * 255.0 + threshold) as u8));
        }
    }
    encode_rgb(film.width, film.height, &data)
}

/// A PNG of sRGB bytes, three a pixel, row after row from the top.
pub fn encode_rgb(width: u32, height: u32, data: &[u8]) -> Result<Vec<u8>, ImageError> {
    let failed = |error: png::EncodingError| ImageError::Encode {
        field: "PNG",
        message: error.to_string(),
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// The sRGB transfer function (IEC 61966-2-1) of a value clamped to [0, 1]; NaN is black.
pub(crate) fn srgb(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * libm::powf(v, 1.0 / 2.4) - 0.055
    }
}

/// The 8 x 8 Bayer matrix, in (0, 1): the bits of x ^ y and y, interleaved and reversed.
fn bayer(x: usize, y: usize) -> f32 {
    let bits = (0..3).fold(0, |bits, i| bits << 2 | ((x ^ y) >> i & 1) << 1 | (y >> i & 1));
    (bits as f32 + 0.5) / 64.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!(
            (info.color_type, info.bit_depth),
            (png::ColorType::Rgb, png::BitDepth::Eight)
        );
        assert!(reader.info().srgb.is_some());
        (info.width, info.height, pixels)
    }

    fn flat(value: f32) -> Film {
        let mut film = Film::new(8, 8);
        film.pixels.fill([value; 3]);
        film
    }

    /// The mean over a tile of the dither is the curve itself. Values of IEC 61966-2-1 as published.
    #[test]
    fn curve_is_srgb() {
        let published = [
            (0.0, 0.0),
            (0.002, 0.02584),
            (0.18, 0.461_356),
            (0.5, 0.735_357),
            (1.0, 1.0),
        ];
        for (linear, encoded) in published {
            assert!((srgb(linear) - encoded).abs() < 2e-6, "{linear}: {}", srgb(linear));
            let (_, _, pixels) = decode(&encode_png(&flat(linear), 0.0).unwrap());
            let mean = pixels.iter().map(|v| f32::from(*v)).sum::<f32>() / pixels.len() as f32;
            assert!((mean - 255.0 * encoded).abs() <= 1.0 / 64.0, "{linear}: {mean}");
        }
    }

    #[test]
    fn exact_steps_are_not_dithered() {
        for step in 0..=255u8 {
            let v = f64::from(step) / 255.0;
            let linear = if v <= 0.04045 {
                v / 12.92
            } else {
                libm::pow((v + 0.055) / 1.055, 2.4)
            };
            let (_, _, pixels) = decode(&encode_png(&flat(linear as f32), 0.0).unwrap());
            assert!(pixels.iter().all(|value| *value == step), "{step}");
        }
    }

    #[test]
    fn exposure_doubles_and_the_ends_are_clamped() {
        let half = encode_png(&flat(0.25), 1.0).unwrap();
        assert_eq!(half, encode_png(&flat(0.5), 0.0).unwrap());
        assert_eq!(half, encode_png(&flat(1.0), -1.0).unwrap());
        for (value, expected) in [(1e30, 255), (-1.0, 0), (f32::INFINITY, 255), (f32::NAN, 0)] {
            let (_, _, pixels) = decode(&encode_png(&flat(value), 10.0).unwrap());
            assert!(pixels.iter().all(|v| *v == expected), "{value}");
        }
    }

    #[test]
    fn dither_takes_each_threshold_once() {
        let mut thresholds: Vec<f32> = (0..64).map(|i| bayer(i % 8, i / 8) * 64.0 - 0.5).collect();
        assert_eq!(thresholds[..8], [0.0, 32.0, 8.0, 40.0, 2.0, 34.0, 10.0, 42.0]);
        thresholds.sort_by(f32::total_cmp);
        assert!(thresholds.iter().enumerate().all(|(i, t)| *t == i as f32));
    }

    #[test]
    fn rows_and_channels_are_in_place() {
        let mut film = Film::new(3, 2);
        film.pixels[4] = [1.0, 0.0, 1.0];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        write_png(&path, &film, 0.0).unwrap();
        let (width, height, pixels) = decode(&std::fs::read(&path).unwrap());
        let mut expected = vec![0; 18];
        expected[12] = 255;
        expected[14] = 255;
        assert_eq!((width, height, pixels), (3, 2, expected));
    }

    #[test]
    fn an_empty_film_is_an_error() {
        assert!(encode_png(&Film::new(0, 4), 0.0).is_err());
    }
}
