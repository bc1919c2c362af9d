//! JPEG: pictures that are gone in a moment.

use crate::error::ImageError;
use crate::film::Film;
use crate::png::srgb;
use jpeg_encoder::{ColorType, Encoder};
use std::sync::OnceLock;

/// Of 100: no blocks are seen, and a picture of 960 x 540 takes about 100 kB.
const QUALITY: u8 = 88;

/// Steps of a factor of two in the table of the sRGB transfer function, and factors of two: less than a step of 8 bits
/// lies between neighbours, and below the last the curve is black.
const STEPS_LEVEL: u32 = 9;
const OCTAVES: u32 = 13;
const ENTRIES: usize = (OCTAVES << STEPS_LEVEL) as usize;

/// Bits of the mantissa that a step leaves out.
const SHIFT: u32 = 23 - STEPS_LEVEL;
const FIRST: u32 = (127 - OCTAVES) << 23 >> SHIFT;

/// An 8-bit sRGB picture of linear Rec. 709 radiance, scaled by 2^`exposure_stops` and clamped to [0, 1]; as
/// [`encode_png`](crate::png::encode_png) but for the noise of compression, and quicker.
pub fn encode_jpeg(film: &Film, exposure_stops: f32) -> Result<Vec<u8>, ImageError> {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let middle = |entry| f32::from_bits((FIRST + entry as u32) << SHIFT | 1 << (SHIFT - 1));
        (0..ENTRIES)
            .map(|entry| (srgb(middle(entry)) * 255.0 + 0.5) as u8)
            .collect()
    });
    let scale = libm::exp2f(exposure_stops);
    let byte = |value: &f32| {
        let scaled = value * scale;
        // NaN is black.
        match scaled {
            1.0.. => 255,
            0.0.. => {
                let entry = (scaled.to_bits() >> SHIFT).checked_sub(FIRST);
                entry.map_or(0, |entry| table[(entry as usize).min(ENTRIES - 1)])
            }
            _ => 0,
        }
    };
    let data: Vec<u8> = film.pixels.as_flattened().iter().map(byte).collect();
    let failed = |message: String| ImageError::Encode { field: "JPEG", message };
    let side = |side: u32| u16::try_from(side).map_err(|_| failed(format!("{side} pixels; expected at most 65535")));
    let mut bytes = Vec::new();
    Encoder::new(&mut bytes, QUALITY)
        .encode(&data, side(film.width)?, side(film.height)?, ColorType::Rgb)
        .map_err(|error| failed(error.to_string()))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of one colour keeps it: within two of 255, of compression and of the table.
    #[test]
    fn colours_are_kept() {
        let values = [
            0.0,
            1e-5,
            2e-4,
            0.003,
            0.02,
            0.1,
            0.18,
            0.5,
            0.9,
            1.0,
            7.0,
            f32::NAN,
            f32::INFINITY,
            -1.0,
        ];
        for value in values {
            for stops in [-2.0, 0.0, 1.5] {
                let mut film = Film::new(16, 16);
                film.pixels.fill([value; 3]);
                let bytes = encode_jpeg(&film, stops).unwrap();
                let mut decoder = zune_jpeg::JpegDecoder::new(std::io::Cursor::new(&bytes));
                let pixels = decoder.decode().unwrap();
                let expected = srgb(value * libm::exp2f(stops)) * 255.0;
                let off = pixels.iter().map(|pixel| (f32::from(*pixel) - expected).abs());
                assert!(
                    off.fold(0.0, f32::max) < 2.0,
                    "{value} by {stops}: {expected}, {:?}",
                    &pixels[..3]
                );
            }
        }
    }

    #[test]
    fn sizes_beyond_the_format_are_refused() {
        let film = Film {
            width: 70_000,
            height: 1,
            pixels: vec![[0.0; 3]; 70_000],
        };
        assert!(encode_jpeg(&film, 0.0).is_err());
    }
}
