//! Numbers of a glTF file: buffers, accessors, and the meshes that they make. No index or length is believed.

use super::{Beside, bytes_of};
use crate::assets::Flaw;
use crate::assets::mesh::RawMesh;
use glam::{DAffine2, DVec2, DVec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Semantic};

/// The file's buffers.
pub struct Buffers(Vec<Vec<u8>>);

impl Buffers {
    pub fn new(document: &gltf::Document, blob: Option<&[u8]>, beside: &Beside<'_>) -> Result<Self, Flaw> {
        let mut buffers = Vec::new();
        for buffer in document.buffers() {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => blob.unwrap_or_default().to_vec(),
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

    /// The elements of an accessor, as bytes.
    fn elements(&self, accessor: &Accessor<'_>, what: &str) -> Result<impl Iterator<Item = &[u8]>, Flaw> {
        let at = format!("the {what} (accessor {})", accessor.index());
        if accessor.sparse().is_some() {
            return Err(format!("{at}: sparse accessors are not supported").into());
        }
        let Some(view) = accessor.view() else {
            return Err(format!("{at}: an accessor without a buffer view is not supported").into());
        };
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(format!("{at}: its stride is {stride}; expected at least {size}").into());
        }
        let bytes = self.view(&view)?;
        let claimed = accessor
            .count()
            .checked_sub(1)
            .and_then(|last| last.checked_mul(stride)?.checked_add(size));
        let bytes = bytes.get(accessor.offset()..).unwrap_or_default();
        match claimed {
            Some(claimed) if claimed <= bytes.len() => Ok(bytes[..claimed].chunks(stride).map(move |c| &c[..size])),
            _ => Err(format!(
                "{at}: {} elements, {stride} bytes apart, are claimed, but its view has {} bytes for them",
                accessor.count(),
                bytes.len()
            )
            .into()),
        }
    }

    fn vectors<const N: usize>(&self, accessor: &Accessor<'_>, what: &str) -> Result<Vec<[f64; N]>, Flaw> {
        let dimensions = match N {
            2 => Dimensions::Vec2,
            _ => Dimensions::Vec3,
        };
        let kind = accessor.data_type();
        let usable = match kind {
            DataType::F32 => true,
            DataType::U8 | DataType::U16 => accessor.normalized() && N == 2,
            _ => false,
        };
        if accessor.dimensions() != dimensions || !usable {
            return Err(format!(
                "the {what} (accessor {}) are {:?} of {kind:?}, which is not supported",
                accessor.index(),
                accessor.dimensions(),
            )
            .into());
        }
        let read = |element: &[u8]| {
            std::array::from_fn(|i| match (kind, element) {
                (DataType::U8, e) => f64::from(e[i]) / 255.0,
                (DataType::U16, e) => f64::from(u16::from_le_bytes([e[2 * i], e[2 * i + 1]])) / 65535.0,
                (_, e) => {
                    let bytes = [e[4 * i], e[4 * i + 1], e[4 * i + 2], e[4 * i + 3]];
                    f64::from(f32::from_le_bytes(bytes))
                }
            })
        };
        Ok(self.elements(accessor, what)?.map(read).collect())
    }

    fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, Flaw> {
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
        let read = |e: &[u8]| match *e {
            [a] => u32::from(a),
            [a, b] => u32::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
            _ => u32::MAX,
        };
        Ok(self.elements(accessor, "indices")?.map(read).collect())
    }
}

/// Which texture coordinates a material uses, and how.
pub struct Uv {
    pub set: u32,
    pub transform: DAffine2,
}

/// The triangles of a primitive; `None` if it has points or lines.
pub fn mesh(primitive: &gltf::Primitive<'_>, buffers: &Buffers, uv: &Uv) -> Result<Option<RawMesh>, Flaw> {
    if !matches!(
        primitive.mode(),
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    ) {
        return Ok(None);
    }
    let positions = primitive.get(&Semantic::Positions).ok_or("it has no positions")?;
    let vectors = |accessor: &Accessor<'_>, what| -> Result<Vec<DVec3>, Flaw> {
        let vectors = buffers.vectors::<3>(accessor, what)?;
        Ok(vectors.into_iter().map(DVec3::from).collect())
    };
    let mut raw = RawMesh {
        positions: vectors(&positions, "positions")?,
        ..RawMesh::default()
    };
    let same_count = |n: usize, what: &str| match n == raw.positions.len() {
        true => Ok(()),
        false => Err(format!("it has {} positions and {n} {what}", raw.positions.len())),
    };
    if let Some(accessor) = primitive.get(&Semantic::Normals) {
        let normals = vectors(&accessor, "normals")?;
        same_count(normals.len(), "normals")?;
        raw.normals = normals;
    }
    if let Some(accessor) = primitive.get(&Semantic::TexCoords(uv.set)) {
        let uvs = buffers.vectors::<2>(&accessor, "texture coordinates")?;
        same_count(uvs.len(), "texture coordinates")?;
        // Ours begin at the bottom.
        let ours = |at: [f64; 2]| {
            let at = uv.transform.transform_point2(DVec2::from(at));
            DVec2::new(at.x, 1.0 - at.y)
        };
        raw.uvs = uvs.into_iter().map(ours).collect();
    }
    let count = u32::try_from(raw.positions.len()).map_err(|_| "it has more than 2^32 vertices")?;
    let indices = match primitive.indices() {
        Some(accessor) => buffers.indices(&accessor)?,
        None => (0..count).collect(),
    };
    raw.triangles = match primitive.mode() {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, v)| match i % 2 {
                0 => [v[0], v[1], v[2]],
                _ => [v[0], v[2], v[1]],
            })
            .collect(),
        Mode::TriangleFan => match indices.split_first() {
            Some((center, rim)) => rim.windows(2).map(|v| [v[0], v[1], *center]).collect(),
            None => Vec::new(),
        },
        _ => indices.as_chunks::<3>().0.to_vec(),
    };
    Ok(Some(raw))
}
