//! Numbers of a glTF file: buffers and accessors. No index or length is believed.

use super::{Beside, bytes_of};
use crate::assets::Flaw;
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions};
use rayon::prelude::*;
use std::borrow::Cow;

/// Elements at most of an accessor that has no bytes of its own.
const MAX_ZEROS: usize = 1 << 22;

/// The file's buffers.
pub struct Buffers<'b>(Vec<Cow<'b, [u8]>>);

impl<'b> Buffers<'b> {
    pub fn new(document: &gltf::Document, blob: Option<&'b [u8]>, beside: &Beside<'b>) -> Result<Self, Flaw> {
        let mut buffers = Vec::new();
        for buffer in document.buffers() {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => blob.unwrap_or_default().into(),
                gltf::buffer::Source::Uri(uri) => bytes_of(uri, beside)?,
            };
            if bytes.len() < buffer.length() {
                return Err(format!(
                    "buffer {} has {} bytes; {} are claimed",
                    buffer.index(),
                    bytes.len(),
                    buffer.length()
                )
                .into());
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    /// The bytes of a view.
    pub fn view(&self, view: &gltf::buffer::View<'_>) -> Result<&[u8], Flaw> {
        let buffer = self.0.get(view.buffer().index());
        let end = view.offset().checked_add(view.length());
        buffer
            .zip(end)
            .and_then(|(buffer, end)| buffer.get(view.offset()..end))
            .ok_or_else(|| format!("buffer view {} reaches beyond its buffer", view.index()).into())
    }

    /// Elements of `size` bytes in a view, from `offset` on. `at` is for messages.
    fn elements<'s>(
        &'s self,
        view: &gltf::buffer::View<'_>,
        offset: usize,
        [count, size]: [usize; 2],
        at: &str,
    ) -> Result<impl IndexedParallelIterator<Item = &'s [u8]> + use<'s>, Flaw> {
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(format!("{at}: its stride is {stride}; expected at least {size}").into());
        }
        let bytes = self.view(view)?;
        let claimed = count
            .checked_sub(1)
            .and_then(|last| last.checked_mul(stride)?.checked_add(size));
        let bytes = bytes.get(offset..).unwrap_or_default();
        match claimed {
            Some(claimed) if claimed <= bytes.len() => Ok(bytes[..claimed].par_chunks(stride).map(move |c| &c[..size])),
            _ => Err(format!(
                "{at}: {count} elements, {stride} bytes apart, are claimed, but its view has {} bytes for them",
                bytes.len()
            )
            .into()),
        }
    }

    /// The elements of an accessor, `N` numbers each, those that are named one by one in their places.
    pub fn numbers<const N: usize>(&self, accessor: &Accessor<'_>, what: &str) -> Result<Vec<[f64; N]>, Flaw> {
        let at = format!("the {what} (accessor {})", accessor.index());
        let kind = accessor.data_type();
        if accessor.dimensions().multiplicity() != N || accessor.dimensions() == Dimensions::Mat2 {
            return Err(format!(
                "the {what} (accessor {}) are {:?} of {kind:?}, which is not supported",
                accessor.index(),
                accessor.dimensions(),
            )
            .into());
        }
        let (count, size) = (accessor.count(), accessor.size());
        let read = |element: &[u8]| number(kind, accessor.normalized(), element);
        let mut numbers: Vec<[f64; N]> = match accessor.view() {
            Some(view) => {
                let elements = self.elements(&view, accessor.offset(), [count, size], &at)?;
                elements.map(read).collect()
            }
            None if count <= MAX_ZEROS => vec![[0.0; N]; count],
            None => {
                return Err(format!(
                    "{at}: {count} elements are claimed without a buffer view; expected at most {MAX_ZEROS}"
                )
                .into());
            }
        };
        let Some(sparse) = accessor.sparse().filter(|sparse| sparse.count() > 0) else {
            return Ok(numbers);
        };
        let indices = sparse.indices();
        let index_kind = match indices.index_type() {
            gltf::accessor::sparse::IndexType::U8 => DataType::U8,
            gltf::accessor::sparse::IndexType::U16 => DataType::U16,
            gltf::accessor::sparse::IndexType::U32 => DataType::U32,
        };
        let changed = [sparse.count(), index_kind.size()];
        let places = self.elements(
            &indices.view(),
            indices.offset(),
            changed,
            &format!("{at}: sparse indices"),
        )?;
        let values = sparse.values();
        let values = self.elements(
            &values.view(),
            values.offset(),
            [sparse.count(), size],
            &format!("{at}: sparse values"),
        )?;
        let changes: Vec<_> = places.zip(values).collect();
        for (place, value) in changes {
            let [index] = number(index_kind, false, place);
            let slot = numbers.get_mut(index as usize);
            *slot.ok_or_else(|| format!("{at}: a sparse index is {index}, but there are {count} elements"))? =
                read(value);
        }
        Ok(numbers)
    }

    /// Whole numbers.
    pub fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, Flaw> {
        let kind = accessor.data_type();
        if accessor.dimensions() != Dimensions::Scalar || !matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
        {
            return Err(format!(
                "the indices (accessor {}) are {:?} of {kind:?}; expected whole numbers",
                accessor.index(),
                accessor.dimensions(),
            )
            .into());
        }
        let indices = self.numbers(accessor, "indices")?;
        Ok(indices.into_iter().map(|[index]| index as u32).collect())
    }
}

/// The components of an element. Normalised ones are shares of the largest that their kind has.
fn number<const N: usize>(kind: DataType, normalized: bool, element: &[u8]) -> [f64; N] {
    let size = kind.size();
    std::array::from_fn(|i| {
        let bytes = element.get(i * size..).unwrap_or_default();
        let (value, largest) = match (kind, bytes) {
            (DataType::I8, [a, ..]) => (f64::from(*a as i8), 127.0),
            (DataType::U8, [a, ..]) => (f64::from(*a), 255.0),
            (DataType::I16, [a, b, ..]) => (f64::from(i16::from_le_bytes([*a, *b])), 32767.0),
            (DataType::U16, [a, b, ..]) => (f64::from(u16::from_le_bytes([*a, *b])), 65535.0),
            (DataType::U32, [a, b, c, d, ..]) => (f64::from(u32::from_le_bytes([*a, *b, *c, *d])), 4294967295.0),
            (DataType::F32, [a, b, c, d, ..]) => {
                return f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
            }
            _ => (0.0, 1.0),
        };
        match normalized {
            true => (value / largest).max(-1.0),
            false => value,
        }
    })
}
