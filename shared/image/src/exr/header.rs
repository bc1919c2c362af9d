//! EXR headers: writing attributes, and reading them without trusting a byte.

use crate::error::ImageError;
use exr::meta::attribute::{AttributeValue, ChannelDescription, ChannelList, SampleType, Text};
use exr::meta::header::Header;
use std::collections::HashMap;

/// Longest block header that is read, in bytes. Headers written here take about one kilobyte, and up to three hundred
/// bytes per layer.
const MAX_HEADER: usize = 128 * 1024;
/// Magic number and version field.
const PREAMBLE: usize = 8;

/// The attribute that names the engine, unless that is the processor's.
pub(super) const ENGINE: &str = "beamfarmEngine";

/// A text attribute, which EXR stores as bytes.
pub(super) fn text(field: &'static str, value: &str) -> Result<AttributeValue, ImageError> {
    if !value.is_ascii() || value.is_empty() || value.len() > 255 {
        return Err(ImageError::Encode {
            field,
            message: format!("`{}` is not 1 to 255 characters of ASCII", value.escape_debug()),
        });
    }
    let text = Text::new_or_none(value).map(AttributeValue::Text);
    text.ok_or_else(|| ImageError::Encode {
        field,
        message: "not ASCII".into(),
    })
}

/// Attributes by name, in the form that the `exr` crate takes.
pub(super) fn attributes<N: AsRef<str>>(list: Vec<(N, AttributeValue)>) -> HashMap<Text, AttributeValue> {
    let entry = |(name, value): (N, AttributeValue)| (Text::from(name.as_ref()), value);
    list.into_iter().map(entry).collect()
}

/// Channels of f32 under these names, which must be sorted.
pub(super) fn float_channels<'a>(names: impl Iterator<Item = &'a str>) -> ChannelList {
    let channel = |name| ChannelDescription::named(name, SampleType::F32);
    ChannelList::new(names.map(channel).collect())
}

/// Bytes of a file with this header and no pixels, attributes sorted by name.
pub(super) fn encode(header: &Header) -> Result<Vec<u8>, ImageError> {
    let failed = |error: exr::error::Error| ImageError::Encode {
        field: "EXR header",
        message: error.to_string(),
    };
    let requirements = exr::meta::MetaData::validate(std::slice::from_ref(header), true).map_err(failed)?;
    let mut bytes = Vec::new();
    exr::meta::magic_number::write(&mut bytes).map_err(failed)?;
    requirements.write(&mut bytes).map_err(failed)?;
    header.write(&mut bytes).map_err(failed)?;
    sort_attributes(&mut bytes)?;
    Ok(bytes)
}

/// Sort the attributes of a single-part file by name. The `exr` crate writes them in the order of a hash map, so equal
/// images would give different files. Nothing else moves.
pub(super) fn sort_attributes(file: &mut [u8]) -> Result<(), ImageError> {
    let mut sorted = walk(file).map_err(|message| ImageError::Encode {
        field: "EXR header",
        message,
    })?;
    sorted.sort_by_key(|attribute| attribute.name);
    let bytes: Vec<u8> = sorted.iter().flat_map(|attribute| attribute.bytes).copied().collect();
    file[PREAMBLE..PREAMBLE + bytes.len()].copy_from_slice(&bytes);
    Ok(())
}

/// One attribute of a header.
pub(super) struct Attribute<'a> {
    pub name: &'a [u8],
    pub kind: &'a [u8],
    pub value: &'a [u8],
    /// The whole attribute.
    bytes: &'a [u8],
}

/// The attributes of a block's file. Checks lengths and the end mark, not the attributes' contents.
pub(super) fn walk_block(file: &[u8]) -> Result<Vec<Attribute<'_>>, String> {
    walk(&file[..file.len().min(MAX_HEADER)])
}

fn walk(file: &[u8]) -> Result<Vec<Attribute<'_>>, String> {
    if !file.starts_with(&exr::meta::magic_number::BYTES) {
        return Err("not an OpenEXR file".into());
    }
    let mut rest = file.get(PREAMBLE..).ok_or("ends within the header")?;
    let mut attributes = Vec::new();
    loop {
        let start = rest;
        let name = until_zero(&mut rest)?;
        if name.is_empty() {
            return Ok(attributes);
        }
        let kind = until_zero(&mut rest)?;
        let (size, tail) = rest.split_first_chunk().ok_or("ends within the header")?;
        let size = usize::try_from(i32::from_le_bytes(*size)).map_err(|_| "attribute of negative size")?;
        let value = tail.get(..size).ok_or("attribute reaches beyond the header")?;
        rest = &tail[size..];
        attributes.push(Attribute {
            name,
            kind,
            value,
            bytes: &start[..start.len() - rest.len()],
        });
    }
}

fn until_zero<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], String> {
    let end = rest
        .iter()
        .position(|byte| *byte == 0)
        .ok_or("ends within the header")?;
    let text = &rest[..end];
    *rest = &rest[end + 1..];
    Ok(text)
}
