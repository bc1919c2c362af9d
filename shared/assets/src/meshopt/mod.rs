//! glTF buffer views compressed by meshopt: `EXT_meshopt_compression` and `KHR_meshopt_compression`.
//!
//! Source: appendices A and B of the Khronos Group's KHR_meshopt_compression, which calls the EXT format version 0.

mod attributes;
mod filters;
mod indices;

use crate::Flaw;

/// The kind of packed data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Any elements, coded by byte differences.
    Attributes,
    /// Triangle indices, three each.
    Triangles,
    /// Any indices.
    Indices,
}

/// A filter applied to unpacked elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Nothing.
    None,
    /// Unit vectors from octahedral coding.
    Octahedral,
    /// Quaternions from three components.
    Quaternion,
    /// Floats from exponents and mantissas.
    Exponential,
    /// Colours from luma and chroma.
    Color,
}

/// How a buffer view is packed.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// The kind of data.
    pub mode: Mode,
    /// The filter applied afterwards.
    pub filter: Filter,
    /// Number of elements or indices.
    pub count: usize,
    /// Bytes per element.
    pub stride: usize,
}

impl Layout {
    fn check(&self) -> Result<(), Flaw> {
        let Self {
            mode,
            filter,
            count,
            stride,
        } = *self;
        let is_sound = match mode {
            Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride),
            Mode::Triangles => matches!(stride, 2 | 4) && count.is_multiple_of(3) && filter == Filter::None,
            Mode::Indices => matches!(stride, 2 | 4) && filter == Filter::None,
        };
        let suits = match filter {
            Filter::None | Filter::Exponential => true,
            Filter::Octahedral | Filter::Color => matches!(stride, 4 | 8),
            Filter::Quaternion => stride == 8,
        };
        match is_sound && suits && count.checked_mul(stride).is_some() {
            true => Ok(()),
            false => Err(format!("{count} {mode:?} of {stride} bytes with the filter {filter:?} cannot be").into()),
        }
    }
}

/// Unpack `count` elements of `stride` bytes. Memory is limited to a thousand times the input.
pub fn decode(bytes: &[u8], layout: &Layout) -> Result<Vec<u8>, Flaw> {
    layout.check()?;
    let mut elements = match layout.mode {
        Mode::Attributes => attributes::decode(bytes, layout.count, layout.stride)?,
        Mode::Triangles => indices::triangles(bytes, layout.count, layout.stride)?,
        Mode::Indices => indices::sequence(bytes, layout.count, layout.stride)?,
    };
    filters::apply(&mut elements, layout.filter, layout.stride);
    Ok(elements)
}

/// A sequential reader of bytes.
struct Input<'b>(&'b [u8]);

impl<'b> Input<'b> {
    fn take(&mut self, count: usize) -> Result<&'b [u8], Flaw> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("its packed bytes end early")?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, Flaw> {
        Ok(self.take(1)?[0])
    }

    /// An integer of up to five bytes (LEB128).
    fn varint(&mut self) -> Result<u32, Flaw> {
        let mut value = 0;
        for i in 0..5 {
            let byte = self.byte()?;
            value |= u32::from(byte & 127) << (7 * i);
            if byte < 128 {
                return Ok(value);
            }
        }
        Err("a packed number has more than five bytes".into())
    }

    fn end(&self) -> Result<(), Flaw> {
        match self.0.len() {
            0 => Ok(()),
            more => Err(format!("it has {more} packed bytes more than it needs").into()),
        }
    }
}

#[cfg(test)]
mod tests;
