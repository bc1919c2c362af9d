//! Tightly packed images with 8 bits per channel: WebP, and Basis Universal in KTX2.

use super::{Encoding, check_claim, pixel_count};
use crate::Flaw;
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use beamfarm_image::exr::without_panic;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::texture::Image;
use image_webp::WebPDecoder;
use std::io::Cursor;

/// Pixels allowed for any file: a constant image takes hardly a byte.
const ALWAYS: usize = 1 << 24;

/// Whether a file is WebP.
pub fn is_webp(bytes: &[u8]) -> bool {
    bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP")
}

pub fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

fn checked_count(width: u32, height: u32, bytes: &[u8]) -> Result<usize, Flaw> {
    let count = pixel_count(width as usize, height as usize)?;
    if count > ALWAYS {
        check_claim(count * 4, bytes)?;
    }
    Ok(count)
}

/// Lossy or lossless, with or without alpha; the first frame of an animation.
pub fn read_webp(bytes: &[u8], encoding: Encoding) -> Result<Image, Flaw> {
    let message = |e: String| Flaw::from(format!("not a sound WebP image: {e}"));
    let decoder = without_panic(|| WebPDecoder::new(Cursor::new(bytes)).map_err(|e| e.to_string()));
    let mut decoder = decoder.map_err(message)?;
    let (width, height) = decoder.dimensions();
    let count = checked_count(width, height, bytes)?;
    let channels = if decoder.has_alpha() { 4 } else { 3 };
    decoder.set_memory_limit(8 * count + (1 << 20));
    let decoded = without_panic(|| {
        let mut data = vec![0; channels * count];
        match decoder.is_animated() {
            true => decoder.read_frame(&mut data).map(drop),
            false => decoder.read_image(&mut data),
        }
        .map_err(|e| e.to_string())?;
        Ok(data)
    });
    Ok(of_bytes(
        [width, height],
        channels,
        &decoded.map_err(message)?,
        encoding,
    ))
}

/// ETC1S or UASTC; the largest mip level.
pub fn read_ktx2(bytes: &[u8], encoding: Encoding) -> Result<Image, Flaw> {
    let message = |e: String| Flaw::from(format!("not a sound KTX2 texture of Basis Universal: {e}"));
    // Checks the claimed number of pixels before anything is decoded.
    let side = |at: usize| bytes.get(at..)?.first_chunk().map(|b| u32::from_le_bytes(*b));
    let (Some(width), Some(height)) = (side(20), side(24)) else {
        return Err(message("its header is cut off".into()));
    };
    let count = checked_count(width, height, bytes)?;
    if ![Some(0), None].contains(&side(12)) {
        let kind = side(12).unwrap_or_default();
        return Err(format!(
            "a KTX2 texture of the Vulkan format {kind}; expected Basis Universal (ETC1S or UASTC). Unpack it with \
             `ktx extract` of KTX-Software"
        )
        .into());
    }
    // A level unpacks to sixteen bytes per block of 4 x 4 pixels.
    let unpacked = bytes
        .get(96..)
        .and_then(|rest| rest.first_chunk())
        .map(|b| u64::from_le_bytes(*b));
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    if side(44) == Some(2) && unpacked.is_none_or(|length| length > 16 * blocks) {
        return Err(message("its largest level claims more than its pixels take".into()));
    }
    let decoded = without_panic(|| {
        let transcoder = Transcoder::new(bytes).map_err(|e| format!("{e:?}"))?;
        if !matches!(transcoder.source_format(), SourceFormat::Etc1s | SourceFormat::UastcLdr) {
            return Err(format!(
                "it is {:?}; expected ETC1S or UASTC",
                transcoder.source_format()
            ));
        }
        if transcoder.face_count() > 1 || transcoder.layer_count() > 1 {
            return Err("it has several faces or layers; expected one picture".into());
        }
        let data = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE);
        let data = data.map_err(|e| format!("{e:?}"))?;
        Ok((data, transcoder.has_alpha()))
    });
    let (mut data, has_alpha) = decoded.map_err(message)?;
    if data.len() != 4 * count {
        return Err(message("it has not the pixels that its header claims".into()));
    }
    if !has_alpha {
        data.chunks_exact_mut(4).for_each(|p| p[3] = 255);
    }
    let image = of_bytes([width, height], 4, &data, encoding);
    Ok(Image {
        alpha: if has_alpha { image.alpha } else { Vec::new() },
        ..image
    })
}

/// An image with `channels` bytes per pixel: red, green, blue, and alpha if there are four.
fn of_bytes([width, height]: [u32; 2], channels: usize, data: &[u8], encoding: Encoding) -> Image {
    let linear = encoding.table(255);
    let whole = Encoding::Raw.table(255);
    let value = |table: &[f32], v: u8| table[usize::from(v)];
    let pixels = data.chunks_exact(channels).map(|p| match (encoding, p) {
        (Encoding::Alpha, [_, _, _, a]) => Rgb::splat(value(&whole, *a)),
        (Encoding::Alpha, _) => Rgb::ONE,
        _ => Rgb::new(value(&linear, p[0]), value(&linear, p[1]), value(&linear, p[2])),
    });
    let alpha = match channels {
        4 => data.chunks_exact(4).map(|p| value(&whole, p[3])).collect(),
        _ => Vec::new(),
    };
    Image {
        width,
        height,
        pixels: pixels.collect(),
        alpha,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Encoding, linear_from_srgb, read};
    use beamfarm_render::math::Rgb;

    macro_rules! seed {
        ($name:literal) => {
            include_bytes!(concat!("../../../../tests/fuzz/seeds/", $name))
        };
    }

    /// A ramp of sRGB (12 x, 20 y, 128) and alpha 255 - 8 x is packed. `near`: tolerance of the mean linear error.
    #[test]
    fn a_ramp_comes_back() {
        for (name, bytes, near, has_alpha) in [
            ("lossless", &seed!("webp/lossless.webp")[..], 0.0, true),
            ("lossy", seed!("webp/lossy.webp"), 0.02, true),
            ("opaque", seed!("webp/opaque.webp"), 0.02, false),
            ("UASTC", seed!("ktx2/uastc.ktx2"), 0.01, true),
            ("ETC1S", seed!("ktx2/etc1s.ktx2"), 0.06, true),
        ] {
            let image = read(bytes, Encoding::Srgb).unwrap();
            let alpha = read(bytes, Encoding::Alpha).unwrap();
            assert_eq!((image.width, image.height), (20, 12), "{name}");
            assert_eq!(image.alpha.is_empty(), !has_alpha, "{name}");
            let (mut off, mut off_alpha) = (0.0, 0.0);
            for (i, pixel) in image.pixels.iter().enumerate() {
                let (x, y) = (i % 20, i / 20);
                let expected = [12 * x, 20 * y, 128].map(|v| linear_from_srgb(v as f64 / 255.0));
                off += (*pixel - Rgb::from_array(expected)).abs().element_sum() / 720.0;
                let expected = if has_alpha { (255 - 8 * x) as f32 / 255.0 } else { 1.0 };
                off_alpha += (alpha.pixels[i].x - expected).abs() / 240.0;
            }
            assert!(off <= near && off_alpha <= near, "{name}: {off}, alpha {off_alpha}");
        }
    }

    #[test]
    fn damage_is_refused_or_read() {
        let files = [
            &seed!("webp/lossless.webp")[..],
            seed!("webp/lossy.webp"),
            seed!("ktx2/uastc.ktx2"),
            seed!("ktx2/etc1s.ktx2"),
        ];
        crate::damage::damage(&files.map(<[u8]>::to_vec), |bytes| drop(read(bytes, Encoding::Srgb)));
    }

    #[test]
    fn other_textures_of_ktx2_are_refused_by_their_format() {
        let mut bytes = seed!("ktx2/uastc.ktx2").to_vec();
        bytes[12] = 43;
        let flaw = read(&bytes, Encoding::Srgb).unwrap_err();
        assert!(
            flaw.message.contains("Vulkan format 43; expected Basis Universal"),
            "{}",
            flaw.message
        );
        let flaw = read(&bytes[..20], Encoding::Srgb).unwrap_err();
        assert!(flaw.message.contains("its header is cut off"), "{}", flaw.message);
    }
}
