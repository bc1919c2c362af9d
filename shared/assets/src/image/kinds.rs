//! Recognises unsupported image formats by their first bytes.

/// The format of an unsupported file, and what to do.
pub fn refusal(bytes: &[u8]) -> String {
    let convert = "convert it, for example by `magick`, or save it anew in an image editor";
    let is_boxed = |brand: &[u8]| bytes.get(4..8) == Some(b"ftyp") && bytes.get(8..12) == Some(brand);
    let kind = if bytes.starts_with(b"\xabKTX 11\xbb") {
        "a KTX 1 texture"
    } else if bytes.starts_with(b"GIF8") {
        "a GIF image"
    } else if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") {
        "a TIFF image"
    } else if is_boxed(b"avif") {
        "an AVIF image"
    } else if is_boxed(b"heic") {
        "a HEIC image"
    } else if bytes.starts_with(b"DDS ") {
        "a DDS texture"
    } else if bytes.starts_with(b"8BPS") {
        "a Photoshop image"
    } else {
        return "unsupported kind of image; expected PNG, JPEG, WebP, BMP, KTX2, OpenEXR or Radiance HDR".into();
    };
    format!("{kind}, which is not read; expected PNG, JPEG, WebP, BMP, KTX2, OpenEXR or Radiance HDR: {convert}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_that_are_not_read_are_named() {
        for (bytes, kind) in [
            (&b"\xabKTX 11\xbb\r\n\x1a\n"[..], "a KTX 1 texture"),
            (b"GIF89a", "a GIF image"),
            (b"II*\0\x08", "a TIFF image"),
            (b"MM\0*\0", "a TIFF image"),
            (b"\0\0\0\x20ftypavif", "an AVIF image"),
            (b"\0\0\0\x20ftypheic", "a HEIC image"),
            (b"DDS |", "a DDS texture"),
            (b"8BPS\0", "a Photoshop image"),
            (b"", "unsupported kind of image"),
            (b"words", "unsupported kind of image"),
        ] {
            let said = refusal(bytes);
            assert!(said.starts_with(kind) && said.contains("expected PNG, JPEG"), "{said}");
        }
    }
}
