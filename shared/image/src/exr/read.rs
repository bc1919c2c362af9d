//! Reads images that may come from other programs.

use crate::error::ImageError;
use crate::film::Film;
use crate::input;
use exr::io::Tracking;
use exr::meta::MetaData;
use exr::meta::attribute::Compression;
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, Vec2};
use std::io::{BufReader, Cursor, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What images are read from. One type for files and for bytes in memory, because the decoder is compiled anew for
/// each.
pub(super) trait Source: Read + Seek {}

impl<T: Read + Seek> Source for T {}

/// The headers of an image.
pub(super) fn meta_data(source: &mut dyn Source, pedantic: bool) -> exr::error::Result<MetaData> {
    // The pixel decoder wraps its sources in this, too.
    MetaData::read_from_buffered(Tracking::new(source), pedantic)
}

/// Most bytes of an image besides its pixels: attributes and tables of blocks.
const AROUND: u64 = 64 << 20;

/// The whole file, limited to what its header claims: no compression makes blocks larger.
fn read_bytes(path: &Path) -> Result<Vec<u8>, ImageError> {
    let read = || {
        let mut file = input::open(path)?;
        let meta = meta_data(&mut BufReader::new(&file), false);
        // An unreadable header claims no pixels.
        let headers = meta.map_or(Default::default(), |meta| meta.headers);
        let claimed = headers.iter().map(|header| {
            let samples = (header.layer_size.width() as u64).saturating_mul(header.layer_size.height() as u64);
            samples.saturating_mul(header.channels.bytes_per_pixel as u64)
        });
        let claimed = claimed.fold(0, u64::saturating_add);
        file.rewind()?;
        // Smaller copies of the image take a third of its size or, if they shrink along one side only, as much as the
        // image.
        input::read_all(file, claimed.saturating_mul(4).saturating_add(AROUND))
    };
    read().map_err(|source| ImageError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Read the channels R, G, B, half or float, from the first layer that has them.
pub fn read_rgb(path: &Path) -> Result<Film, ImageError> {
    let bytes = read_bytes(path)?;
    decode_rgb(&bytes).map_err(|message| ImageError::File {
        path: path.to_owned(),
        message,
    })
}

/// Read the standard error of an image written by [`write_image`](super::image::write_image), if it has one: the
/// channels stderr.R, .G, .B.
pub fn read_standard_error(path: &Path) -> Result<Option<Film>, ImageError> {
    let bytes = read_bytes(path)?;
    let failed = |message| ImageError::File {
        path: path.to_owned(),
        message,
    };
    check_claims(&bytes, false).map_err(failed)?;
    let names = ["stderr.R", "stderr.G", "stderr.B"];
    let meta = meta_data(&mut Cursor::new(&bytes), false).map_err(|error| failed(error.to_string()))?;
    let has_all = meta.headers.iter().any(|header| {
        let channels = &header.channels.list;
        let has = |name: &&str| channels.iter().any(|channel| channel.name.eq(name));
        names.iter().all(has)
    });
    match has_all {
        true => without_panic(|| decode_trusting(&bytes, names))
            .map(Some)
            .map_err(failed),
        false => Ok(None),
    }
}

/// Width, height, and the values of channels by their full names, from the first layer of a file. Half or float. The
/// file may be untrusted.
pub fn read_channels(path: &Path, names: &[&str]) -> Result<([u32; 2], Vec<Vec<f32>>), ImageError> {
    let bytes = read_bytes(path)?;
    let read = check_claims(&bytes, false).and_then(|()| without_panic(|| decode_channels(&bytes, names)));
    read.map_err(|message| ImageError::File {
        path: path.to_owned(),
        message,
    })
}

fn decode_channels(bytes: &[u8], names: &[&str]) -> Result<([u32; 2], Vec<Vec<f32>>), String> {
    let reader = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels();
    let reader = reader.first_valid_layer().all_attributes().non_parallel();
    let image = reader
        .from_buffered(&mut Cursor::new(bytes) as &mut dyn Source)
        .map_err(|error| error.to_string())?;
    let layer = image.layer_data;
    let find = |name: &&str| {
        let mut channels = layer.channel_data.list.iter();
        let found = channels.find(|channel| channel.name.eq(name));
        let channel = found.ok_or_else(|| format!("there is no channel {name}"))?;
        let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
        match values.len() == layer.size.area() {
            true => Ok(values),
            false => Err(format!("channel {name} has fewer pixels than the image")),
        }
    };
    let values: Result<Vec<Vec<f32>>, String> = names.iter().map(find).collect();
    Ok(([layer.size.0 as u32, layer.size.1 as u32], values?))
}

/// Most pixels of an image.
const MAX_PIXELS: usize = 1 << 27;
/// Bytes to search for the first part's compression.
const MAX_HEADER: usize = 1 << 16;
/// Most decoded bytes per byte of the file. Deflate reaches 1032; EXR's other methods stay below it.
const MAX_EXPANSION: usize = 2048;

/// The headers of a file's parts. They may be untrusted: see [`check_claims`].
pub fn headers(bytes: &[u8]) -> Result<Vec<Header>, String> {
    let meta = meta_data(&mut Cursor::new(bytes), true).map_err(|error| error.to_string())?;
    Ok(meta.headers.into_iter().collect())
}

/// For a file with an unsupported compression: an error that says what to do.
pub fn not_read(bytes: &[u8]) -> Option<String> {
    const ATTRIBUTE: &[u8] = b"compression\0compression\0\x01\0\0\0";
    let header = &bytes[..bytes.len().min(MAX_HEADER)];
    let at = header.windows(ATTRIBUTE.len()).position(|part| part == ATTRIBUTE)?;
    let name = match header.get(at + ATTRIBUTE.len())? {
        8 => "DWAA",
        9 => "DWAB",
        10 | 11 => "HTJ2K",
        _ => return None,
    };
    Some(compressed_by(name))
}

fn compressed_by(name: &str) -> String {
    format!(
        "it is compressed by {name}, which is not read; expected none, RLE, ZIP, PIZ, PXR24 or B44. Convert it, for \
         example by `oiiotool in.exr --compression zip -o out.exr`, or open it in Blender and save it with ZIP"
    )
}

/// Checks that an untrusted file can hold the pixels that it claims, in a form whose decoder is safe to run.
pub fn check_claims(bytes: &[u8], pedantic: bool) -> Result<(), String> {
    if let Some(kind) = other_kind(bytes) {
        return Err(format!("expected an OpenEXR image; this is {kind}"));
    }
    let meta = meta_data(&mut Cursor::new(bytes), pedantic).map_err(|error| error.to_string())?;
    let mut claimed = 0usize;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        let pixels = width.checked_mul(height).filter(|n| *n <= MAX_PIXELS);
        let Some(pixels) = pixels else {
            return Err(format!("{width} x {height} pixels; expected at most {MAX_PIXELS}"));
        };
        // The DWA decoder of exr 1.74.2 allocates what a chunk claims, so a broken chunk would end the process. Its
        // vector code also gives different bits on different machines.
        match header.compression {
            Compression::DWAA(_) => return Err(compressed_by("DWAA")),
            Compression::DWAB(_) => return Err(compressed_by("DWAB")),
            _ => {}
        }
        claimed = claimed.saturating_add(pixels.saturating_mul(header.channels.bytes_per_pixel));
    }
    match claimed > bytes.len().saturating_mul(MAX_EXPANSION) {
        true => Err("the file is too short for the pixels that its header claims".into()),
        false => Ok(()),
    }
}

/// The first bytes of an EXR.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The kind of a file that is not an EXR, by its first bytes and not its name; `None` if it is unknown.
fn other_kind(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 12] = [
        (b"\x89PNG\r\n\x1a\n", "a PNG"),
        (b"\xff\xd8\xff", "a JPEG"),
        (b"#?RADIANCE", "a Radiance HDR"),
        (b"#?RGBE", "a Radiance HDR"),
        (b"II*\0", "a TIFF"),
        (b"MM\0*", "a TIFF"),
        (b"II+\0", "a TIFF"),
        (b"MM\0+", "a TIFF"),
        (b"PF\n", "a PFM"),
        (b"BM", "a BMP"),
        (b"GIF8", "a GIF"),
        (b"RIFF", "a WebP"),
    ];
    let found = kinds.iter().find(|(magic, _)| bytes.starts_with(magic));
    match found {
        Some((_, kind)) => Some(kind),
        None if bytes.is_empty() => Some("an empty file"),
        None if !bytes.starts_with(&MAGIC) => Some("a file of another kind"),
        None => None,
    }
}

/// Run another crate's decoder, which may panic. The B44 decoder of exr 1.74 subtracts below zero in a broken file,
/// which panics where overflow is checked.
pub fn without_panic<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    let read = catch_unwind(AssertUnwindSafe(decode));
    read.unwrap_or_else(|_| Err("its decoder gave up".into()))
}

/// [`read_rgb`] from memory; the error says what is wrong. The bytes may be untrusted.
pub fn decode_rgb(bytes: &[u8]) -> Result<Film, String> {
    check_claims(bytes, false)?;
    without_panic(|| decode_trusting(bytes, ["R", "G", "B"]))
}

fn decode_trusting(bytes: &[u8], channels: [&str; 3]) -> Result<Film, String> {
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
        .required(channels[0])
        .required(channels[1])
        .required(channels[2])
        .collect_pixels(create, set);
    let reader = reader.first_valid_layer().all_attributes().non_parallel();
    let image = reader
        .from_buffered(&mut Cursor::new(bytes) as &mut dyn Source)
        .map_err(|error| error.to_string())?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::image::write::WritableImage;
    use exr::image::{Encoding, Image, Layer};
    use exr::meta::header::LayerAttributes;

    /// The kind is told by the first bytes, not by the name.
    #[test]
    fn a_file_of_another_kind_is_called_by_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let kinds: [(&[u8], &str); 8] = [
            (b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", "a PNG"),
            (b"\xff\xd8\xff\xe0\0\x10JFIF", "a JPEG"),
            (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "a Radiance HDR"),
            (b"II*\0\x08\0\0\0", "a TIFF"),
            (b"MM\0*\0\0\0\x08", "a TIFF"),
            (b"PF\n1 1\n", "a PFM"),
            (b"image = {}", "a file of another kind"),
            (b"", "an empty file"),
        ];
        for (bytes, kind) in kinds {
            std::fs::write(&path, bytes).unwrap();
            let expected = format!("{}: expected an OpenEXR image; this is {kind}", path.display());
            assert_eq!(read_rgb(&path).unwrap_err().to_string(), expected);
            assert_eq!(read_channels(&path, &["R"]).unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn half_floats_and_other_channels_are_read() {
        use exr::prelude::f16;
        let pixels = |at: Vec2<usize>| {
            let half = f16::from_f32(at.0 as f32 + 0.5);
            (half, half, at.1 as f32, f16::ZERO, 7u32)
        };
        let channels = exr::image::SpecificChannels::build()
            .with_channel("R")
            .with_channel("G")
            .with_channel("B")
            .with_channel("A")
            .with_channel("id")
            .with_pixel_fn(pixels);
        let image = Image::from_channels((3, 2), channels);
        let mut bytes = Vec::new();
        image
            .write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        let film = decode_rgb(&bytes).unwrap();
        assert_eq!((film.width, film.height), (3, 2));
        assert_eq!(film.pixels[5], [2.5, 2.5, 1.0]);
    }

    #[test]
    fn a_file_without_colour_is_refused() {
        let channels = exr::image::SpecificChannels::build()
            .with_channel("Z")
            .with_pixel_fn(|_| (1.0f32,));
        let mut bytes = Vec::new();
        let image = Image::from_channels((3, 2), channels);
        image
            .write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        assert!(decode_rgb(&bytes).is_err());
        assert!(decode_rgb(b"\x89PNG").is_err());
        let missing = read_rgb(Path::new("does-not-exist.exr")).unwrap_err();
        assert!(missing.to_string().starts_with("does-not-exist.exr: "));
    }

    /// The library reads no DWA yet; a later version may.
    #[test]
    fn dwa_is_refused_before_its_decoder_runs() {
        let channels = exr::image::SpecificChannels::rgb(|_| (0.5f32, 0.5f32, 0.5f32));
        let encoding = Encoding {
            compression: Compression::ZIP16,
            ..Encoding::SMALL_LOSSLESS
        };
        let layer = Layer::new((3usize, 2usize), LayerAttributes::default(), encoding, channels);
        let mut bytes = Vec::new();
        let image = Image::from_layer(layer);
        image
            .write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        // The attribute's name, type and size; then the code for ZIP.
        let attribute = b"compression\0compression\0\x01\0\0\0\x03";
        let at = bytes
            .windows(attribute.len())
            .position(|part| part == attribute)
            .unwrap();
        bytes[at + attribute.len() - 1] = 8;
        let error = decode_rgb(&bytes).unwrap_err();
        assert!(
            error.starts_with("it is compressed by DWAA, which is not read"),
            "{error}"
        );
        assert_eq!(not_read(&bytes), Some(error));
        bytes[at + attribute.len() - 1] = 10;
        assert!(not_read(&bytes).unwrap().contains("HTJ2K"));
        bytes[at + attribute.len() - 1] = 3;
        assert_eq!(not_read(&bytes), None);
    }
}
