//! Buffers and accessors of a glTF file. No index or length in the file is trusted.

use super::packed::{self, Packed, Place};
use super::{Beside, bytes_of};
use crate::assets::Flaw;
use beamfarm_assets::elements::{self, Component};
use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Semantic};
use std::borrow::Cow;

/// The most elements of an accessor without bytes of its own.
const MAX_ZEROS: usize = 1 << 22;

/// The file's buffers, and the packed data in them.
pub struct Buffers<'b> {
    /// The bytes, or why they are missing.
    buffers: Vec<Result<Cow<'b, [u8]>, String>>,
    packed: Packed,
}

impl<'b> Buffers<'b> {
    /// Buffers that nothing uses may lack their files.
    pub fn new(document: &gltf::Document, blob: Option<&'b [u8]>, beside: &Beside<'b>) -> Result<Self, Flaw> {
        let mut buffers = Vec::new();
        for buffer in document.buffers() {
            if packed::is_placeholder(&buffer) {
                buffers.push(Err("it reads a buffer that is there for packed views alone".into()));
                continue;
            }
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => Ok(blob.unwrap_or_default().into()),
                gltf::buffer::Source::Uri(uri) => bytes_of(uri, beside).map_err(|flaw| flaw.message),
            };
            if let Ok(bytes) = &bytes
                && bytes.len() < buffer.length()
            {
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
        let packed = Packed::of(document);
        Ok(Self { buffers, packed })
    }

    /// The bytes of a view, unpacked.
    pub fn view(&self, view: &gltf::buffer::View<'_>) -> Result<&[u8], Flaw> {
        match self.packed.view(view, |place| self.stored(place)) {
            Some(unpacked) => Ok(unpacked?),
            None => Ok(self.stored(&Place::of(view))?),
        }
    }

    /// Bytes as stored in a buffer.
    fn stored(&self, place: &Place) -> Result<&[u8], String> {
        let buffer = match self.buffers.get(place.buffer) {
            Some(Err(reason)) => return Err(reason.clone()),
            Some(Ok(bytes)) => Some(bytes),
            None => None,
        };
        buffer
            .and_then(|buffer| buffer.get(place.offset..place.offset.checked_add(place.length)?))
            .ok_or_else(|| format!("buffer view {} reaches beyond its buffer", place.view))
    }

    /// The triangles of a Draco primitive; `None` for other primitives.
    pub fn triangles(&self, primitive: &gltf::Primitive<'_>) -> Result<Option<Vec<[u32; 3]>>, Flaw> {
        let mesh = self.packed.of_primitive(primitive, |place| self.stored(place))?;
        Ok(mesh.map(|mesh| mesh.triangles.clone()))
    }

    /// The number of a primitive's vertices.
    pub fn vertices(&self, primitive: &gltf::Primitive<'_>) -> Result<usize, Flaw> {
        let positions = Semantic::Positions;
        let packed = self
            .packed
            .of_attribute(primitive, &positions, |place| self.stored(place))?;
        let plain = || primitive.get(&positions).map_or(0, |accessor| accessor.count());
        Ok(packed.map_or_else(plain, |packed| packed.points))
    }

    /// An attribute of a primitive's vertices, `N` numbers each; `None` if it has none.
    pub fn attribute<const N: usize>(
        &self,
        primitive: &gltf::Primitive<'_>,
        semantic: &Semantic,
        what: &str,
    ) -> Result<Option<Vec<[f64; N]>>, Flaw> {
        let Some(accessor) = primitive.get(semantic) else {
            return Ok(None);
        };
        let packed = self
            .packed
            .of_attribute(primitive, semantic, |place| self.stored(place))?;
        let Some(packed) = packed else {
            return self.numbers(&accessor, what).map(Some);
        };
        let at = is_of::<N>(&accessor, what)?;
        let attribute = packed.attribute;
        if attribute.components != N {
            let found = attribute.components;
            return Err(format!("{at} have {found} numbers each as Draco packed them; expected {N}").into());
        }
        let mut numbers = vec![[0.0; N]; packed.points];
        let stride = attribute.bytes.len() / packed.points.max(1);
        let into = (numbers.as_flattened_mut(), N);
        elements::read(
            &attribute.bytes,
            stride,
            attribute.component,
            accessor.normalized(),
            into,
        );
        Ok(Some(numbers))
    }

    /// The bytes of elements of `size` bytes in a view, from `offset` on, and their stride. `at` is for messages.
    fn elements(
        &self,
        view: &gltf::buffer::View<'_>,
        offset: usize,
        [count, size]: [usize; 2],
        at: &str,
    ) -> Result<(&[u8], usize), Flaw> {
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
            Some(claimed) if claimed <= bytes.len() => Ok((&bytes[..claimed], stride)),
            _ => Err(format!(
                "{at}: {count} elements, {stride} bytes apart, are claimed, but its view has {} bytes for them",
                bytes.len()
            )
            .into()),
        }
    }

    /// The elements of an accessor, `N` numbers each, with its sparse values applied.
    pub fn numbers<const N: usize>(&self, accessor: &Accessor<'_>, what: &str) -> Result<Vec<[f64; N]>, Flaw> {
        let at = is_of::<N>(accessor, what)?;
        let (count, size) = (accessor.count(), accessor.size());
        let component = component(accessor.data_type());
        let read = |(bytes, stride): (&[u8], usize), count: usize| {
            let mut numbers = vec![[0.0; N]; count];
            let into = (numbers.as_flattened_mut(), N);
            elements::read(bytes, stride, component, accessor.normalized(), into);
            numbers
        };
        let mut numbers: Vec<[f64; N]> = match accessor.view() {
            Some(view) => read(self.elements(&view, accessor.offset(), [count, size], &at)?, count),
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
        let (index, index_size) = match indices.index_type() {
            gltf::accessor::sparse::IndexType::U8 => (Component::U8, 1),
            gltf::accessor::sparse::IndexType::U16 => (Component::U16, 2),
            gltf::accessor::sparse::IndexType::U32 => (Component::U32, 4),
        };
        let changed = sparse.count();
        let at_indices = format!("{at}: sparse indices");
        let (bytes, stride) = self.elements(&indices.view(), indices.offset(), [changed, index_size], &at_indices)?;
        let places = elements::whole(bytes, stride, index);
        let values = sparse.values();
        let at_values = format!("{at}: sparse values");
        let values = self.elements(&values.view(), values.offset(), [changed, size], &at_values)?;
        for (index, value) in places.into_iter().zip(read(values, changed)) {
            let slot = numbers.get_mut(index as usize);
            *slot.ok_or_else(|| format!("{at}: a sparse index is {index}, but there are {count} elements"))? = value;
        }
        Ok(numbers)
    }

    /// An accessor's integers.
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
        let at = format!("the indices (accessor {})", accessor.index());
        match accessor.view() {
            Some(view) if accessor.sparse().is_none() => {
                let shape = [accessor.count(), accessor.size()];
                let (bytes, stride) = self.elements(&view, accessor.offset(), shape, &at)?;
                Ok(elements::whole(bytes, stride, component(kind)))
            }
            _ => {
                let indices = self.numbers(accessor, "indices")?;
                Ok(indices.into_iter().map(|[index]| index as u32).collect())
            }
        }
    }
}

/// An accessor's name in messages; an error unless it has `N` numbers per element.
fn is_of<const N: usize>(accessor: &Accessor<'_>, what: &str) -> Result<String, Flaw> {
    let at = format!("the {what} (accessor {})", accessor.index());
    let dimensions = accessor.dimensions();
    if dimensions.multiplicity() != N || dimensions == Dimensions::Mat2 {
        let kind = accessor.data_type();
        return Err(format!("{at} are {dimensions:?} of {kind:?}, which is not supported").into());
    }
    Ok(at)
}

fn component(kind: DataType) -> Component {
    match kind {
        DataType::I8 => Component::I8,
        DataType::U8 => Component::U8,
        DataType::I16 => Component::I16,
        DataType::U16 => Component::U16,
        DataType::U32 => Component::U32,
        DataType::F32 => Component::F32,
    }
}
