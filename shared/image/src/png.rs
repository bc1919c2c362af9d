//! PNG: the picture for viewing.

use crate::atomic;
use crate::error::ImageError;
use crate::film::Film;
use crate::input;
use crate::view::{View, ViewTransform};
use std::io::BufReader;
use std::path::Path;

/// Write linear Rec. 709 radiance as an 8-bit sRGB picture, as the view shows it.
///
/// An ordered dither of less than one step keeps smooth gradients from banding; exact steps, black and white stay.
pub fn write_png(path: &Path, film: &Film, view: View) -> Result<(), ImageError> {
    atomic::write_file(path, &encode_png(film, view)?)
}

/// The bytes of the file that [`write_png`] writes.
pub fn encode_png(film: &Film, view: View) -> Result<Vec<u8>, ImageError> {
    let ready = view.ready();
    let mut data = Vec::with_capacity(3 * film.pixels.len());
    for (y, row) in film.pixels.chunks(film.width.max(1) as usize).enumerate() {
        for (x, pixel) in row.iter().enumerate() {
            let threshold = bayer(x, y);
            data.extend(ready.encoded(*pixel).map(|v| (v * 255.0 + threshold) as u8));
        }
    }
    encode(film.width, film.height, &data, written(view))
}

/// Keyword of the PNG text that holds the view, unless that is the default; see [`view_of`].
const VIEW: &str = "beamfarm view";

fn written(view: View) -> Option<String> {
    let View {
        transform,
        exposure,
        white_balance,
    } = view;
    let words = || format!("{} exposure {exposure} white_balance {white_balance}", transform.name());
    (view != View::default()).then(words)
}

/// The view of a picture written by [`write_png`]; `None` if it cannot be told.
pub fn view_of(path: &Path) -> Option<View> {
    let reader = png::Decoder::new(BufReader::new(input::open(path).ok()?))
        .read_info()
        .ok()?;
    let mut texts = reader.info().uncompressed_latin1_text.iter();
    let Some(text) = texts.find(|text| text.keyword == VIEW) else {
        return Some(View::default());
    };
    let words: Vec<&str> = text.text.split(' ').collect();
    let [transform, "exposure", exposure, "white_balance", white_balance] = words[..] else {
        return None;
    };
    Some(View {
        transform: ViewTransform::named(transform)?,
        exposure: exposure.parse().ok()?,
        white_balance: white_balance.parse().ok()?,
    })
}

/// Whether the whole PNG can be decoded, with correct checksums.
pub fn is_sound(path: &Path) -> bool {
    let decode = || {
        let mut reader = png::Decoder::new(BufReader::new(input::open(path).ok()?))
            .read_info()
            .ok()?;
        let size = reader.output_buffer_size().filter(|size| *size <= MOST_BYTES)?;
        reader.next_frame(&mut vec![0; size]).ok()?;
        reader.finish().ok()
    };
    decode().is_some()
}

/// Most bytes of a PNG's pixels: a damaged header may claim any size.
const MOST_BYTES: usize = 1 << 30;

/// Encodes sRGB bytes, three per pixel, row by row from the top.
pub fn encode_rgb(width: u32, height: u32, data: &[u8]) -> Result<Vec<u8>, ImageError> {
    encode(width, height, data, None)
}

fn encode(width: u32, height: u32, data: &[u8], view: Option<String>) -> Result<Vec<u8>, ImageError> {
    let failed = |error: png::EncodingError| ImageError::Encode {
        field: "PNG",
        message: error.to_string(),
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    if let Some(view) = view {
        encoder.add_text_chunk(VIEW.into(), view).map_err(failed)?;
    }
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
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

    /// The mean over a tile of the dither is the curve itself, for every view.
    #[test]
    fn tiles_have_the_mean_of_the_curve() {
        for transform in [ViewTransform::Standard, ViewTransform::Filmic, ViewTransform::Agx] {
            let view = View {
                transform,
                exposure: 0.5,
                white_balance: 4000.0,
            };
            for value in [0.0, 0.002, 0.18, 0.5, 1.0, 4.0] {
                let (_, _, pixels) = decode(&encode_png(&flat(value), view).unwrap());
                let expected = view.ready().encoded([value; 3]);
                for (channel, expected) in expected.into_iter().enumerate() {
                    let tile = pixels.iter().skip(channel).step_by(3);
                    let mean = tile.map(|v| f32::from(*v)).sum::<f32>() / 64.0;
                    assert!(
                        (mean - 255.0 * expected).abs() <= 1.0 / 64.0,
                        "{transform:?} {value}: {mean}"
                    );
                }
            }
        }
    }

    /// The pixels of a standard picture, as the first version wrote them.
    #[test]
    fn the_standard_view_has_golden_bytes() {
        let mut film = Film::new(40, 32);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            let value = libm::exp2f(i as f32 / 64.0 - 16.0);
            *pixel = [value, 0.3 * value, 1.2 - value];
        }
        let hash = |view| {
            blake3::hash(&decode(&encode_png(&film, view).unwrap()).2)
                .to_hex()
                .to_string()
        };
        assert_eq!(hash(View::default())[..16], *"389cea7c2d636dac");
        assert_eq!(hash(View::exposed(1.5))[..16], *"80cf51d9c617e541");
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
            let (_, _, pixels) = decode(&encode_png(&flat(linear as f32), View::default()).unwrap());
            assert!(pixels.iter().all(|value| *value == step), "{step}");
        }
    }

    #[test]
    fn exposure_doubles_and_the_ends_are_clamped() {
        let shown = |value: f32, stops: f32| decode(&encode_png(&flat(value), View::exposed(stops)).unwrap());
        assert_eq!(shown(0.25, 1.0), shown(0.5, 0.0));
        assert_eq!(shown(0.25, 1.0), shown(1.0, -1.0));
        for (value, expected) in [(1e30, 255), (-1.0, 0), (f32::INFINITY, 255), (f32::NAN, 0)] {
            let (_, _, pixels) = decode(&encode_png(&flat(value), View::exposed(10.0)).unwrap());
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
        write_png(&path, &film, View::default()).unwrap();
        let (width, height, pixels) = decode(&std::fs::read(&path).unwrap());
        let mut expected = vec![0; 18];
        expected[12] = 255;
        expected[14] = 255;
        assert_eq!((width, height, pixels), (3, 2, expected));
    }

    #[test]
    fn a_picture_says_its_view() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        assert_eq!(view_of(&path), None);
        let views = [
            View::default(),
            View::exposed(-0.1),
            View {
                transform: ViewTransform::Agx,
                exposure: 1.0 / 3.0,
                white_balance: 2856.5,
            },
        ];
        for view in views {
            write_png(&path, &flat(0.5), view).unwrap();
            assert_eq!(view_of(&path), Some(view));
        }
        std::fs::write(&path, b"no picture").unwrap();
        assert_eq!(view_of(&path), None);
    }

    /// Checksums find every changed byte, and what is missing.
    #[test]
    fn a_damaged_picture_is_not_sound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        let whole = encode_png(&flat(0.5), View::exposed(1.0)).unwrap();
        std::fs::write(&path, &whole).unwrap();
        assert!(is_sound(&path));
        // The pixels and their checksum. Of what stands before, only the header is part of the picture.
        let find = |name: &[u8]| whole.windows(4).position(|window| window == name).unwrap();
        for at in find(b"IDAT") + 4..find(b"IEND") - 4 {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x40;
            std::fs::write(&path, &bytes).unwrap();
            assert!(!is_sound(&path), "byte {at}");
            std::fs::write(&path, &whole[..at]).unwrap();
            assert!(!is_sound(&path), "{at} bytes");
        }
        std::fs::remove_file(&path).unwrap();
        assert!(!is_sound(&path));
    }

    #[test]
    fn an_empty_film_is_an_error() {
        assert!(encode_png(&Film::new(0, 4), View::default()).is_err());
    }
}
