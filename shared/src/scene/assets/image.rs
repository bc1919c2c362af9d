//! Images: PNG (sRGB) and OpenEXR (linear), decoded to linear RGB.

use super::Flaw;
use crate::math::Rgb;
use crate::texture::Image;
use ::exr::prelude as exr;
use std::io::Cursor;

/// Pixels a row, and rows, at most.
const MAX_SIDE: usize = 32768;
/// Pixels at most: 16384 x 8192.
const MAX_PIXELS: usize = 1 << 27;
/// Decoded bytes per byte of the file at most. Deflate reaches 1032; the other methods of EXR stay below it.
const MAX_EXPANSION: usize = 2048;

/// Read a PNG or EXR image; its first bytes tell which.
pub fn read(bytes: &[u8]) -> Result<Image, Flaw> {
    let image = if bytes.starts_with(b"\x89PNG") {
        read_png(bytes)?
    } else if bytes.starts_with(b"\x76\x2f\x31\x01") {
        read_exr(bytes)?
    } else {
        return Err("unsupported kind of image; expected PNG or OpenEXR".into());
    };
    let width = image.width as usize;
    let bad = |p: &Rgb| !p.is_finite() || p.min_element() < 0.0;
    if let Some(i) = image.pixels.iter().position(bad) {
        let (x, y, value) = (i % width, i / width, image.pixels[i]);
        return Err(format!(
            "the pixel in column {x}, row {y} (from zero) is {value}; expected finite, not negative"
        )
        .into());
    }
    Ok(image)
}

fn check_size(
    width: usize,
    height: usize,
    bytes_per_pixel: usize,
    file: &[u8],
) -> Result<(), Flaw> {
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) || width * height > MAX_PIXELS {
        return Err(format!(
            "the image has {width} x {height} pixels; expected 1 to {MAX_SIDE} on a side and {MAX_PIXELS} in all"
        )
        .into());
    }
    if width * height * bytes_per_pixel > file.len().saturating_mul(MAX_EXPANSION) {
        return Err(
            format!("the file is too short for the {width} x {height} pixels it claims").into(),
        );
    }
    Ok(())
}

/// Grey, RGB or palette, 1 to 16 bits a channel, alpha ignored. All values are taken as sRGB (IEC 61966-2-1),
/// whatever the file says of its gamma.
fn read_png(bytes: &[u8]) -> Result<Image, Flaw> {
    let message = |e: ::png::DecodingError| Flaw::from(format!("not a sound PNG: {e}"));
    let mut decoder = ::png::Decoder::new(Cursor::new(bytes));
    let (width, height) = decoder.read_header_info().map_err(message)?.size();
    check_size(width as usize, height as usize, 1, bytes).or_else(|flaw| {
        // Eight one-bit pixels share a byte.
        check_size(width as usize, (height as usize).div_ceil(8), 1, bytes).map_err(|_| flaw)
    })?;
    decoder.set_transformations(::png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(message)?;
    let size = reader
        .output_buffer_size()
        .ok_or("the image is too large")?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(message)?;
    let channels = info.color_type.samples();
    let samples: Vec<f32> = match info.bit_depth {
        ::png::BitDepth::Sixteen => {
            let table: Vec<f32> = (0..=u16::MAX)
                .map(|v| linear_from_srgb(f64::from(v) / 65535.0))
                .collect();
            let words = data
                .chunks_exact(2)
                .map(|b| u16::from_be_bytes([b[0], b[1]]));
            words.map(|v| table[usize::from(v)]).collect()
        }
        _ => {
            let table: Vec<f32> = (0..=u8::MAX)
                .map(|v| linear_from_srgb(f64::from(v) / 255.0))
                .collect();
            data.iter().map(|v| table[usize::from(*v)]).collect()
        }
    };
    let pixel = |p: &[f32]| match channels {
        1 | 2 => Rgb::splat(p[0]),
        _ => Rgb::new(p[0], p[1], p[2]),
    };
    Ok(Image {
        width,
        height,
        pixels: samples.chunks_exact(channels).map(pixel).collect(),
    })
}

/// The sRGB transfer function (IEC 61966-2-1), from [0, 1] to [0, 1].
fn linear_from_srgb(v: f64) -> f32 {
    let linear = if v <= 0.04045 {
        v / 12.92
    } else {
        libm::pow((v + 0.055) / 1.055, 2.4)
    };
    linear as f32
}

/// The channels R, G and B, or Y alone, of the first layer that has them; the data window is the image.
fn read_exr(bytes: &[u8]) -> Result<Image, Flaw> {
    let message = |e: exr::Error| Flaw::from(format!("not a sound OpenEXR image: {e}"));
    let meta = exr::MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(message)?;
    for header in &meta.headers {
        let size = header.layer_size;
        check_size(
            size.width(),
            size.height(),
            header.channels.bytes_per_pixel,
            bytes,
        )?;
    }
    use exr::{ReadChannels, ReadLayers};
    let image = exr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .pedantic()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(message)?;
    for layer in &image.layer_data {
        let find = |name: &str| {
            layer
                .channel_data
                .list
                .iter()
                .find(|c| c.name.eq_case_insensitive(name))
        };
        let channels = match (find("R"), find("G"), find("B"), find("Y")) {
            (Some(r), Some(g), Some(b), _) => [r, g, b],
            (None, None, None, Some(y)) => [y, y, y],
            _ => continue,
        };
        let (width, height) = (layer.size.width(), layer.size.height());
        if channels.iter().any(|c| c.sampling != exr::Vec2(1, 1)) {
            return Err("channels of reduced resolution are not supported".into());
        }
        let value = |c: &exr::AnyChannel<exr::FlatSamples>, i| {
            c.sample_data.value_by_flat_index(i).to_f32()
        };
        let pixel = |i| Rgb::from_array(channels.map(|c| value(c, i)));
        return Ok(Image {
            width: width as u32,
            height: height as u32,
            pixels: (0..width * height).map(pixel).collect(),
        });
    }
    Err("no layer has the channels R, G and B, or Y".into())
}
