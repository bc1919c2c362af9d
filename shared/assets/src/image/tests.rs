use super::exr::tests::exr_with;
use super::*;

fn read(bytes: &[u8]) -> Result<Image, Flaw> {
    super::read(bytes, Encoding::Srgb)
}

fn png(width: u32, height: u32, color: ::png::ColorType, depth: ::png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == ::png::ColorType::Indexed {
        encoder.set_palette(vec![0, 0, 0, 255, 128, 0]);
    }
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

/// IEC 61966-2-1: 0.5 in sRGB is 0.2140411 linear.
#[test]
fn png_is_srgb_in_every_layout() {
    use ::png::{BitDepth, ColorType};
    let half = linear_from_srgb(128.0 / 255.0);
    assert!((linear_from_srgb(0.5) - 0.214_041_1).abs() < 1e-6);
    assert!((linear_from_srgb(0.04) - 0.04 / 12.92).abs() < 1e-8);
    assert_eq!(linear_from_srgb(1.0), 1.0);
    let orange = Rgb::new(1.0, half, 0.0);
    for (color, depth, data, expected) in [
        (ColorType::Rgb, BitDepth::Eight, vec![255, 128, 0, 0, 0, 0], orange),
        (
            ColorType::Rgba,
            BitDepth::Eight,
            vec![255, 128, 0, 7, 0, 0, 0, 0],
            orange,
        ),
        (ColorType::Grayscale, BitDepth::Eight, vec![128, 0], Rgb::splat(half)),
        (
            ColorType::GrayscaleAlpha,
            BitDepth::Eight,
            vec![128, 9, 0, 0],
            Rgb::splat(half),
        ),
        (ColorType::Grayscale, BitDepth::One, vec![0b1000_0000], Rgb::ONE),
        (ColorType::Indexed, BitDepth::One, vec![0b1000_0000], orange),
        (
            ColorType::Grayscale,
            BitDepth::Sixteen,
            vec![0x80, 0x80, 0, 0],
            Rgb::splat(half),
        ),
        (
            ColorType::Rgb,
            BitDepth::Sixteen,
            vec![255, 255, 0x80, 0x80, 0, 0, 0, 0, 0, 0, 0, 0],
            orange,
        ),
    ] {
        let image = read(&png(2, 1, color, depth, &data)).unwrap();
        assert_eq!((image.width, image.height), (2, 1));
        assert!(
            (image.pixels[0] - expected).abs().max_element() < 1e-6,
            "{color:?} {depth:?}"
        );
        assert_eq!(image.pixels[1], Rgb::ZERO, "{color:?} {depth:?}");
        let raw = super::read(&png(2, 1, color, depth, &data), Encoding::Raw).unwrap();
        let is_half = |c: f32, raw: f32| {
            if c == half {
                (raw - 0.502).abs() < 1e-3
            } else {
                raw == c
            }
        };
        let pairs = expected.to_array().into_iter().zip(raw.pixels[0].to_array());
        assert!(pairs.into_iter().all(|(c, raw)| is_half(c, raw)), "{color:?} {depth:?}");
    }
}

#[test]
fn bad_images_say_why() {
    let message = |bytes: &[u8]| read(bytes).unwrap_err().message;
    assert!(message(&exr_with(2, 2, &[("Y", f32::NAN)])).contains("column 0, row 0"));
    assert!(message(&exr_with(2, 2, &[("Y", f32::INFINITY)])).contains("expected finite"));
    assert!(message(&exr_with(2, 2, &[("Y", -1.0)])).contains("not negative"));
    assert!(message(&exr_with(2, 2, &[("Z", 1.0)])).contains("no layer has the channels"));
    assert!(message(b"").contains("expected PNG, JPEG"));
    let good = png(1, 1, ::png::ColorType::Grayscale, ::png::BitDepth::Eight, &[1]);
    // What follows the pixel data (12 bytes of IEND, 4 of a checksum) is not needed.
    for length in 0..good.len() - 16 {
        assert!(read(&good[..length]).is_err(), "{length}");
    }
    let good = exr_with(64, 64, &[("Y", 1.0)]);
    assert!(message(&good[..good.len() / 2]).contains("not a sound OpenEXR"));
}

/// A header that claims gigabytes is refused before any allocation.
#[test]
fn claims_of_headers_are_not_believed() {
    let huge = |width: u32, height: u32| {
        let mut bytes = png(1, 1, ::png::ColorType::Rgb, ::png::BitDepth::Eight, &[1, 2, 3]);
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let crc = crc32(&bytes[12..29]).to_be_bytes();
        bytes[29..33].copy_from_slice(&crc);
        read(&bytes).unwrap_err().message
    };
    assert!(huge(0, 1).contains("PNG"), "{}", huge(0, 1));
    assert!(huge(1 << 30, 1 << 30).contains("pixels; expected 1 to"));
    assert!(huge(16384, 8192).contains("too short"));
    assert!(huge(32768, 32768).contains("pixels; expected 1 to"));

    let mut bytes = exr_with(1, 1, &[("Y", 1.0)]);
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    bytes[at + 8..at + 12].copy_from_slice(&16383u32.to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&8191u32.to_le_bytes());
    assert!(read(&bytes).is_err());
}

/// 16 x 8 pixels: the left half sRGB (200, 100, 50), the right half (20, 40, 220); quality 95 without subsampling.
const JPEG: &[u8] = include_bytes!("../../../../tests/fuzz/seeds/jpeg/halves.jpg");

#[test]
fn jpeg_is_srgb() {
    let image = read(JPEG).unwrap();
    assert_eq!((image.width, image.height), (16, 8));
    for (i, pixel) in image.pixels.iter().enumerate() {
        let srgb = match i % 16 {
            0..8 => [200.0, 100.0, 50.0],
            _ => [20.0, 40.0, 220.0],
        };
        for (found, expected) in pixel.to_array().into_iter().zip(srgb) {
            // Two steps of 255, for JPEG's rounding.
            let near = |d: f64| linear_from_srgb((expected + d) / 255.0);
            assert!((near(-2.0)..=near(2.0)).contains(&found), "{i}: {pixel}");
        }
    }
    let raw = super::read(JPEG, Encoding::Raw).unwrap();
    assert!((raw.pixels[0].x - 200.0 / 255.0).abs() < 0.01);
    let mut huge = JPEG.to_vec();
    let at = huge.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    huge[at + 5..at + 9].copy_from_slice(&[0x7f, 0xff, 0x0f, 0xff]);
    let message = read(&huge).unwrap_err().message;
    assert!(message.contains("too short"), "{message}");
}

/// One row of pixels in Radiance's format, uncompressed.
fn hdr(pixels: &[Rgb]) -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n".to_vec();
    bytes.extend(format!("-Y 1 +X {}\n", pixels.len()).bytes());
    for pixel in pixels {
        // Shared exponent: the largest value is 1/2 to 1 times 2^(e - 128).
        let exponent = libm::frexpf(pixel.max_element()).1;
        let scale = libm::ldexpf(1.0, 8 - exponent);
        bytes.extend(pixel.to_array().map(|v| (v * scale) as u8));
        bytes.push((exponent + 128) as u8);
    }
    bytes
}

#[test]
fn hdr_is_linear() {
    let pixels = [
        Rgb::new(0.5, 2.0, 3.5),
        Rgb::new(1e-12, 0.0, 5e-13),
        Rgb::new(6e20, 1e20, 0.0),
    ];
    let image = read(&hdr(&pixels)).unwrap();
    assert_eq!((image.width, image.height), (3, 1));
    for (found, expected) in image.pixels.iter().zip(pixels) {
        let step = expected.max_element() / 128.0;
        assert!((*found - expected).abs().max_element() <= step, "{found}");
    }
    let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4096 +X 32768\n";
    let message = read(huge).unwrap_err().message;
    assert!(message.contains("too short"), "{message}");
}

#[test]
fn damage_does_not_panic() {
    let grey = png(8, 8, ::png::ColorType::Grayscale, ::png::BitDepth::Eight, &[99; 64]);
    let color = exr_with(8, 8, &[("R", 1.0), ("G", 2.0), ("B", 3.0)]);
    let jpeg = JPEG.to_vec();
    let all = [grey, color, jpeg, hdr(&[Rgb::new(0.5, 2.0, 3e4); 12])];
    crate::damage::damage(&all, |bytes| {
        let _ = read(bytes);
    });
}

/// The good channels of a pixel are kept.
#[test]
fn bad_numbers_are_zero_and_counted() {
    let row = [
        Rgb::new(0.5, -3.6e-7, 0.25),
        Rgb::ONE,
        Rgb::new(f32::NAN, 2.0, f32::INFINITY),
        Rgb::new(-0.0, 0.0, f32::NEG_INFINITY),
    ];
    let picture = read_picture(&exr::tests::rgb(row), Encoding::Srgb, None).unwrap();
    let expected = [Rgb::new(0.5, 0.0, 0.25), Rgb::ONE, Rgb::new(0.0, 2.0, 0.0), Rgb::ZERO];
    assert_eq!(picture.image.pixels, expected);
    let bad = picture.bad.as_ref().unwrap();
    assert_eq!(bad.count, 3);
    let said = bad.to_string();
    assert!(said.starts_with("3 pixels have numbers that are negative"), "{said}");
    assert!(
        said.contains("column 0, row 0 (from zero) is [0.5, -0.00000036, 0.25]"),
        "{said}"
    );
    assert!(
        picture
            .sound()
            .unwrap_err()
            .message
            .contains("expected finite, not negative")
    );
    let sound = read_picture(&exr::tests::rgb([Rgb::ONE; 4]), Encoding::Srgb, None).unwrap();
    assert_eq!((sound.bad.as_ref(), sound.notes.len()), (None, 0));
    assert!(sound.sound().is_ok());
}

#[test]
fn only_openexr_has_layers() {
    let grey = png(1, 1, ::png::ColorType::Grayscale, ::png::BitDepth::Eight, &[1]);
    let said = read_picture(&grey, Encoding::Srgb, Some("a")).unwrap_err().message;
    assert!(said.starts_with("only OpenEXR images have layers"), "{said}");
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}
