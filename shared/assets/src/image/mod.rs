//! Images decoded to linear RGB: PNG, JPEG, WebP, BMP and Basis Universal's KTX2 (sRGB or linear), OpenEXR and
//! Radiance's HDR (linear).

mod exr;
mod exr_layers;
mod kinds;
mod packed;

use crate::Flaw;
use ::image::codecs::bmp::BmpDecoder;
use ::image::codecs::hdr::HdrDecoder;
use ::image::{DynamicImage, ImageDecoder, ImageError};
use beamfarm_image::exr::without_panic;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::texture::Image;
use std::io::Cursor;
use std::sync::Arc;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The most pixels along a side.
const MAX_SIDE: usize = 32768;
/// The most pixels: 16384 x 8192.
const MAX_PIXELS: usize = 1 << 27;
/// The most decoded bytes per byte of the file. Deflate reaches 1032; the other methods of EXR stay below that.
const MAX_EXPANSION: usize = 2048;

/// The meaning of an image's integers. OpenEXR and Radiance's HDR are always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// sRGB (IEC 61966-2-1), regardless of the file's gamma.
    Srgb,
    /// Linear, from 0 to 1.
    Raw,
    /// The image's alpha instead of its colours, from 0 to 1; 1 if it has none.
    Alpha,
}

/// A decoded image.
#[derive(Debug)]
pub struct Picture {
    /// Its pixels, with negative, infinite and NaN values replaced by 0.
    pub image: Arc<Image>,
    /// The pixels that were replaced.
    pub bad: Option<BadPixels>,
    /// Notes on the file.
    pub notes: Vec<String>,
}

/// Pixels with negative, infinite or NaN values.
#[derive(Clone, Debug, PartialEq)]
pub struct BadPixels {
    /// Their number.
    pub count: usize,
    /// Position and value of the first one.
    pub first: String,
}

impl Picture {
    /// The image, or an error if it has bad pixels.
    pub fn sound(&self) -> Result<Arc<Image>, Flaw> {
        match &self.bad {
            None => Ok(self.image.clone()),
            Some(bad) => Err(format!("{}; expected finite, not negative", bad.first).into()),
        }
    }
}

impl std::fmt::Display for BadPixels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (count, first) = (self.count, &self.first);
        let pixels = if count == 1 { "pixel has" } else { "pixels have" };
        write!(
            f,
            "{count} {pixels} numbers that are negative, infinite or NaN, which count as 0: {first}"
        )
    }
}

/// Read an image without bad pixels. Its first bytes tell the format.
pub fn read(bytes: &[u8], encoding: Encoding) -> Result<Image, Flaw> {
    let picture = read_picture(bytes, encoding, None)?;
    let image = picture.sound()?;
    drop(picture);
    Ok(Arc::unwrap_or_clone(image))
}

/// Read an image. Its first bytes tell the format. `layer`: the name of an OpenEXR layer.
pub fn read_picture(bytes: &[u8], encoding: Encoding, layer: Option<&str>) -> Result<Picture, Flaw> {
    let is_png = bytes.starts_with(b"\x89PNG");
    let is_exr = bytes.starts_with(b"\x76\x2f\x31\x01");
    if layer.is_some() && !is_exr {
        return Err("only OpenEXR images have layers; leave `layer` out".into());
    }
    let mut notes = Vec::new();
    let mut image = if is_png {
        read_png(bytes, encoding)?
    } else if is_exr {
        let (image, note) = exr::read(bytes, layer)?;
        notes.extend(note);
        image
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        read_jpeg(bytes, encoding)?
    } else if bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE") {
        read_hdr(bytes)?
    } else if packed::is_webp(bytes) {
        packed::read_webp(bytes, encoding)?
    } else if packed::is_ktx2(bytes) {
        packed::read_ktx2(bytes, encoding)?
    } else if bytes.starts_with(b"BM") {
        read_bmp(bytes, encoding)?
    } else {
        return Err(kinds::refusal(bytes).into());
    };
    let has_alpha = is_png || packed::is_webp(bytes) || packed::is_ktx2(bytes);
    if encoding == Encoding::Alpha && !has_alpha {
        image.pixels.fill(Rgb::ONE);
    }
    let bad = clean(&mut image);
    Ok(Picture {
        image: Arc::new(image),
        bad,
        notes,
    })
}

/// Replace negative, infinite and NaN values by 0.
fn clean(image: &mut Image) -> Option<BadPixels> {
    let is_bad = |p: &Rgb| !p.is_finite() || p.min_element() < 0.0;
    let first = image.pixels.iter().position(is_bad)?;
    let width = image.width as usize;
    let (x, y, value) = (first % width, first / width, image.pixels[first]);
    let mut count = 0;
    for pixel in image.pixels.iter_mut().filter(|p| is_bad(p)) {
        let numbers = pixel.to_array();
        *pixel = Rgb::from_array(numbers.map(|x| if x.is_finite() && x >= 0.0 { x } else { 0.0 }));
        count += 1;
    }
    Some(BadPixels {
        count,
        first: format!("the pixel in column {x}, row {y} (from zero) is {value}"),
    })
}

/// The number of pixels; an error if there are too many or none.
fn pixel_count(width: usize, height: usize) -> Result<usize, Flaw> {
    let sides = 1..=MAX_SIDE;
    if sides.contains(&width) && sides.contains(&height) && width * height <= MAX_PIXELS {
        return Ok(width * height);
    }
    let message =
        format!("the image has {width} x {height} pixels; expected 1 to {MAX_SIDE} on a side and {MAX_PIXELS} in all");
    Err(message.into())
}

/// Refuse a header that claims more than the file can hold.
fn check_claim(decoded_bytes: usize, file: &[u8]) -> Result<(), Flaw> {
    match decoded_bytes > file.len().saturating_mul(MAX_EXPANSION) {
        true => Err("the file is too short for the pixels that its header claims".into()),
        false => Ok(()),
    }
}

/// Grey, RGB or palette, 1 to 16 bits per channel, with or without alpha.
fn read_png(bytes: &[u8], encoding: Encoding) -> Result<Image, Flaw> {
    let message = |e: ::png::DecodingError| Flaw::from(format!("not a sound PNG: {e}"));
    let mut decoder = ::png::Decoder::new(Cursor::new(bytes));
    let header = decoder.read_header_info().map_err(message)?;
    let (width, height) = header.size();
    let count = pixel_count(width as usize, height as usize)?;
    check_claim(count * header.bits_per_pixel() / 8, bytes)?;
    decoder.set_transformations(::png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(message)?;
    let size = reader.output_buffer_size().ok_or("the image is too large")?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(message)?;
    data.truncate(info.buffer_size());

    let (bytes_per_sample, levels) = match info.bit_depth {
        ::png::BitDepth::Sixteen => (2, 65535),
        _ => (1, 255),
    };
    let linear = encoding.table(levels);
    let sample = |p: &[u8], i: usize| match bytes_per_sample {
        2 => linear[usize::from(u16::from_be_bytes([p[2 * i], p[2 * i + 1]]))],
        _ => linear[usize::from(p[i])],
    };
    let channels = info.color_type.samples();
    let pixel = |p: &[u8]| match channels {
        2 | 4 if encoding == Encoding::Alpha => Rgb::splat(sample(p, channels - 1)),
        _ if encoding == Encoding::Alpha => Rgb::ONE,
        1 | 2 => Rgb::splat(sample(p, 0)),
        _ => Rgb::new(sample(p, 0), sample(p, 1), sample(p, 2)),
    };
    let pixels = data.chunks_exact(channels * bytes_per_sample).map(pixel);
    // Alpha is always linear.
    let whole = Encoding::Raw.table(levels);
    let opacity = |p: &[u8]| match bytes_per_sample {
        2 => whole[usize::from(u16::from_be_bytes([p[p.len() - 2], p[p.len() - 1]]))],
        _ => whole[usize::from(p[p.len() - 1])],
    };
    let alpha = match channels {
        2 | 4 => data.chunks_exact(channels * bytes_per_sample).map(opacity).collect(),
        _ => Vec::new(),
    };
    Ok(Image {
        alpha,
        width,
        height,
        pixels: pixels.collect(),
    })
}

/// Grey or colour, 8 bits per channel, baseline or progressive.
fn read_jpeg(bytes: &[u8], encoding: Encoding) -> Result<Image, Flaw> {
    let message = |e: String| Flaw::from(format!("not a sound JPEG: {e}"));
    let options = DecoderOptions::default()
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let headers = without_panic(|| decoder.decode_headers().map_err(|e| e.to_string()));
    headers.map_err(message)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| message("it has no size".into()))?;
    let count = pixel_count(width, height)?;
    check_claim(count * 3, bytes)?;
    let data = without_panic(|| decoder.decode().map_err(|e| e.to_string())).map_err(message)?;
    if data.len() != count * 3 {
        return Err(message("it is neither grey nor red, green and blue".into()));
    }
    let linear = encoding.table(255);
    let pixel = |p: &[u8; 3]| Rgb::from_array(p.map(|v| linear[usize::from(v)]));
    Ok(Image {
        alpha: Vec::new(),
        width: width as u32,
        height: height as u32,
        pixels: data.as_chunks().0.iter().map(pixel).collect(),
    })
}

/// Radiance's shared-exponent format, plain or run-length encoded.
fn read_hdr(bytes: &[u8]) -> Result<Image, Flaw> {
    let message = |e: String| Flaw::from(format!("not a sound Radiance HDR image: {e}"));
    let sound = |e: ImageError| e.to_string();
    let decoder = without_panic(|| HdrDecoder::new(Cursor::new(bytes)).map_err(sound));
    let decoder = decoder.map_err(message)?;
    let (width, height) = decoder.dimensions();
    let count = pixel_count(width as usize, height as usize)?;
    check_claim(count * 4, bytes)?;
    let decoded = without_panic(|| DynamicImage::from_decoder(decoder).map_err(sound));
    let decoded = decoded.map_err(message)?.into_rgb32f();
    let pixels = decoded.pixels().map(|p| Rgb::from_array(p.0));
    Ok(Image {
        alpha: Vec::new(),
        width,
        height,
        pixels: pixels.collect(),
    })
}

/// Windows bitmaps, without alpha.
fn read_bmp(bytes: &[u8], encoding: Encoding) -> Result<Image, Flaw> {
    let message = |e: String| Flaw::from(format!("not a sound BMP: {e}"));
    let sound = |e: ImageError| e.to_string();
    let decoder = without_panic(|| BmpDecoder::new(Cursor::new(bytes)).map_err(sound)).map_err(message)?;
    let (width, height) = decoder.dimensions();
    let count = pixel_count(width as usize, height as usize)?;
    check_claim(count, bytes)?;
    let decoded = without_panic(|| DynamicImage::from_decoder(decoder).map_err(sound));
    let decoded = decoded.map_err(message)?.into_rgb8();
    let linear = encoding.table(255);
    let pixels = decoded
        .pixels()
        .map(|p| Rgb::from_array(p.0.map(|v| linear[usize::from(v)])));
    Ok(Image {
        alpha: Vec::new(),
        width,
        height,
        pixels: pixels.collect(),
    })
}

impl Encoding {
    /// Linear values of the integers from 0 to `levels`.
    fn table(self, levels: u32) -> Vec<f32> {
        let value = |v: u32| {
            let v = f64::from(v) / f64::from(levels);
            match self {
                Self::Srgb => linear_from_srgb(v),
                Self::Raw | Self::Alpha => v as f32,
            }
        };
        (0..=levels).map(value).collect()
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from [0, 1] to [0, 1].
pub(super) fn linear_from_srgb(v: f64) -> f32 {
    let linear = if v <= 0.04045 {
        v / 12.92
    } else {
        libm::pow((v + 0.055) / 1.055, 2.4)
    };
    linear as f32
}

#[cfg(test)]
mod tests;
