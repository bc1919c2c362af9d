//! JPEG: pictures that are shown only for a moment.

use crate::error::ImageError;
use crate::film::Film;
use crate::view::{View, ViewTransform, agx, filmic, finite, srgb};
use jpeg_encoder::{Encoder, ImageBuffer, JpegColorType, rgb_to_ycbcr};
use std::sync::LazyLock;

/// JPEG quality out of 100: no blocks are visible, and a picture of 960 x 540 takes about 100 kB.
const QUALITY: u8 = 88;

/// Log2 of the steps per factor of two in the curves' tables, and factors of two below 1. Neighbouring steps differ by
/// less than one step of 8 bits, and below the last all curves are black.
const STEPS_LEVEL: u32 = 9;
const OCTAVES: u32 = 13;

/// Bits of the mantissa that a step ignores.
const SHIFT: u32 = 23 - STEPS_LEVEL;
const FIRST: u32 = (127 - OCTAVES) << 23 >> SHIFT;

/// A tabulated curve, constant beyond its ends.
struct Table<T>(Vec<T>);

impl<T: Copy> Table<T> {
    /// `above`: factors of two above 1.
    fn new(above: u32, curve: impl Fn(f32) -> T) -> Self {
        let middle = |entry| f32::from_bits((FIRST + entry) << SHIFT | 1 << (SHIFT - 1));
        let entries = (OCTAVES + above) << STEPS_LEVEL;
        Self((0..entries).map(|entry| curve(middle(entry))).collect())
    }

    /// The value for `v`; NaN is black.
    fn at(&self, v: f32) -> T {
        match v {
            0.0.. => {
                let entry = (v.to_bits() >> SHIFT).saturating_sub(FIRST) as usize;
                self.0[entry.min(self.0.len() - 1)]
            }
            _ => self.0[0],
        }
    }
}

/// The encoder's source of rows. Its own eleven kinds of images would all be compiled along with the one in use.
struct Picture<'a> {
    width: u16,
    height: u16,
    /// `width * height` pixels of sRGB.
    pixels: &'a [[u8; 3]],
}

impl ImageBuffer for Picture<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Ycbcr
    }

    fn width(&self) -> u16 {
        self.width
    }

    fn height(&self) -> u16 {
        self.height
    }

    fn fill_buffers(&self, y: u16, [luma, blue, red, _]: &mut [Vec<u8>; 4]) {
        let width = usize::from(self.width);
        let row = self.pixels.chunks_exact(width).nth(y.into()).unwrap_or_default();
        for [r, g, b] in row {
            let (y, cb, cr) = rgb_to_ycbcr(*r, *g, *b);
            luma.push(y);
            blue.push(cb);
            red.push(cr);
        }
    }
}

/// Encodes linear Rec. 709 radiance as an 8-bit sRGB picture, as the view shows it. The same as
/// [`encode_png`](crate::png::encode_png) apart from compression noise, and quicker.
pub fn encode_jpeg(film: &Film, view: View) -> Result<Vec<u8>, ImageError> {
    static ENCODED: LazyLock<Table<u8>> = LazyLock::new(|| Table::new(0, |v| (srgb(v) * 255.0 + 0.5) as u8));
    // White is between 16 and 32.
    static AGX: LazyLock<Table<f32>> = LazyLock::new(|| Table::new(5, agx::curve));
    let ready = view.ready();
    let encoded = &*ENCODED;
    let shown = |pixel: &[f32; 3]| {
        let light = ready.light(*pixel);
        let shown = match ready.transform {
            ViewTransform::Standard => light,
            ViewTransform::Filmic => light.map(filmic),
            ViewTransform::Agx => agx::formed(light.map(finite), |v| AGX.at(v)),
        };
        shown.map(|v| encoded.at(v))
    };
    let pixels: Vec<[u8; 3]> = film.pixels.iter().map(shown).collect();
    let failed = |message: String| ImageError::Encode { field: "JPEG", message };
    let side = |side: u32| u16::try_from(side).map_err(|_| failed(format!("{side} pixels; expected at most 65535")));
    let picture = Picture {
        width: side(film.width)?,
        height: side(film.height)?,
        pixels: &pixels,
    };
    let mut bytes = Vec::new();
    Encoder::new(&mut bytes, QUALITY)
        .encode_image(picture)
        .map_err(|error| failed(error.to_string()))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of one colour keeps it: within two of 255, for compression and the table.
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
                for transform in [ViewTransform::Standard, ViewTransform::Filmic, ViewTransform::Agx] {
                    let view = View {
                        transform,
                        ..View::exposed(stops)
                    };
                    let mut film = Film::new(16, 16);
                    film.pixels.fill([value; 3]);
                    let bytes = encode_jpeg(&film, view).unwrap();
                    let mut decoder = zune_jpeg::JpegDecoder::new(std::io::Cursor::new(&bytes));
                    let pixels = decoder.decode().unwrap();
                    let expected = view.ready().encoded([value; 3])[0] * 255.0;
                    let off = pixels.iter().map(|pixel| (f32::from(*pixel) - expected).abs());
                    assert!(
                        off.fold(0.0, f32::max) < 2.0,
                        "{view:?} {value}: {expected}, {:?}",
                        &pixels[..3]
                    );
                }
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
        assert!(encode_jpeg(&film, View::default()).is_err());
    }
}
