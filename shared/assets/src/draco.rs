//! Meshes compressed by Draco, as in glTF files (`KHR_draco_mesh_compression`).

use crate::Flaw;
use crate::elements::Component;
use beamfarm_image::exr::without_panic;
use draco_core::decode_limits::DecodeLimits;
use draco_core::decoder_buffer::DecoderBuffer;
use draco_core::draco_types::DataType;
use draco_core::geometry_attribute::PointAttribute;
use draco_core::geometry_indices::PointIndex;
use draco_core::mesh_decoder::MeshDecoder;
use std::collections::BTreeMap;

/// The most points, and the most triangles.
const MOST: u64 = 1 << 28;
/// The most decoded bytes: the larger of this and `PER_BYTE` times the file's size.
const ALLOWED: u64 = 64 << 20;
const PER_BYTE: u64 = 1024;

/// A decompressed mesh; only quantisation is lost.
#[derive(Debug, Default)]
pub struct Mesh {
    /// Three points each.
    pub triangles: Vec<[u32; 3]>,
    /// Number of points.
    pub points: usize,
    /// Attributes by their ids in the file.
    pub attributes: BTreeMap<u32, Attribute>,
}

/// An attribute of all points.
#[derive(Debug)]
pub struct Attribute {
    /// Type of its components.
    pub component: Component,
    /// Components per point.
    pub components: usize,
    /// The values of all points, without gaps.
    pub bytes: Vec<u8>,
}

/// Decompress a mesh. Attributes with component types that glTF lacks are left out.
pub fn decode(bytes: &[u8]) -> Result<Mesh, Flaw> {
    let limits = DecodeLimits::default()
        .with_max_points(MOST)
        .with_max_faces(MOST)
        .with_max_decoded_bytes(ALLOWED.max(PER_BYTE * bytes.len() as u64));
    let decoded = without_panic(|| {
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        let mut mesh = draco_core::mesh::Mesh::new();
        let decoded = MeshDecoder::new().decode(&mut buffer, &mut mesh);
        decoded.map(|()| mesh).map_err(|e| e.to_string())
    });
    let decoded = decoded.map_err(|reason| format!("not a sound mesh of Draco: {reason}"))?;
    let points = decoded.num_points();
    let triangles = decoded.faces().iter().map(|face| face.map(|point| point.0)).collect();
    let mut attributes = BTreeMap::new();
    for i in 0..decoded.num_attributes() {
        let attribute = decoded.attribute(i);
        if let Some(of_points) = of_points(attribute, points)? {
            attributes.insert(attribute.unique_id(), of_points);
        }
    }
    Ok(Mesh {
        triangles,
        points,
        attributes,
    })
}

fn of_points(attribute: &PointAttribute, points: usize) -> Result<Option<Attribute>, Flaw> {
    let component = match attribute.data_type() {
        DataType::Int8 => Component::I8,
        DataType::Uint8 => Component::U8,
        DataType::Int16 => Component::I16,
        DataType::Uint16 => Component::U16,
        DataType::Uint32 => Component::U32,
        DataType::Float32 => Component::F32,
        _ => return Ok(None),
    };
    let components = usize::from(attribute.num_components());
    let size = components * attribute.data_type().byte_length();
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or(0).max(size);
    let values = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..points as u32 {
        let value = attribute.mapped_index(PointIndex(point)).0 as usize;
        let start = value.checked_mul(stride);
        let value = start.and_then(|start| values.get(start..start.checked_add(size)?));
        bytes.extend_from_slice(value.ok_or("a mesh of Draco lacks values of its points")?);
    }
    Ok(Some(Attribute {
        component,
        components,
        bytes,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damage::damage;
    use draco_core::encoder_buffer::EncoderBuffer;
    use draco_core::encoder_options::EncoderOptions;
    use draco_core::geometry_attribute::GeometryAttributeType;
    use draco_core::mesh_encoder::MeshEncoder;

    const SIDE: u32 = 6;

    fn position(i: u32) -> [f32; 3] {
        let (x, y) = ((i % SIDE) as f32, (i / SIDE) as f32);
        [x, y, libm::sinf(x * 0.7) + y * y * 0.1]
    }

    /// A wavy grid.
    fn packed(speed: i32) -> Vec<u8> {
        let mut mesh = draco_core::mesh::Mesh::new();
        let mut attribute = PointAttribute::new();
        let count = (SIDE * SIDE) as usize;
        attribute.init(GeometryAttributeType::Position, 3, DataType::Float32, false, count);
        for i in 0..SIDE * SIDE {
            attribute.buffer_mut().update_f32s_le(12 * i as usize, &position(i));
        }
        mesh.set_num_points(count);
        mesh.add_attribute(attribute);
        let mut triangles = Vec::new();
        for y in 0..SIDE - 1 {
            for x in 0..SIDE - 1 {
                let i = y * SIDE + x;
                triangles.extend([i, i + 1, i + SIDE, i + 1, i + SIDE + 1, i + SIDE]);
            }
        }
        mesh.set_num_faces(triangles.len() / 3);
        mesh.set_faces_from_flat_indices(&triangles);
        let mut options = EncoderOptions::new();
        options.set_global_int("encoding_speed", speed);
        options.set_global_int("decoding_speed", speed);
        options.set_attribute_int(0, "quantization_bits", 14);
        let mut encoder = MeshEncoder::new();
        encoder.set_mesh(mesh);
        let mut buffer = EncoderBuffer::new();
        encoder.encode(&options, &mut buffer).expect("it encodes");
        buffer.data().to_vec()
    }

    #[test]
    fn grids_come_back() {
        for speed in [0, 5, 10] {
            let mesh = decode(&packed(speed)).expect("it is sound");
            assert_eq!(mesh.triangles.len(), 2 * (SIDE as usize - 1).pow(2));
            let attribute = mesh.attributes.values().next().expect("it has positions");
            let mut numbers = vec![0.0; 3 * mesh.points];
            crate::elements::read(&attribute.bytes, 12, attribute.component, false, (&mut numbers, 3));
            // The order of points changes and triangles may rotate, so the corners of each are compared.
            let corner = |p: [f64; 3]| p.map(|x| (x * 100.0).round() as i64);
            let of_triangle = |mut corners: [[i64; 3]; 3]| {
                corners.sort_unstable();
                corners
            };
            let mut found: Vec<_> = mesh
                .triangles
                .iter()
                .map(|t| of_triangle(t.map(|i| corner(std::array::from_fn(|c| numbers[3 * i as usize + c])))))
                .collect();
            found.sort_unstable();
            let mut expected = Vec::new();
            for y in 0..SIDE - 1 {
                for x in 0..SIDE - 1 {
                    let i = y * SIDE + x;
                    for t in [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]] {
                        expected.push(of_triangle(t.map(|i| corner(position(i).map(f64::from)))));
                    }
                }
            }
            expected.sort_unstable();
            let near = |a: &[[i64; 3]; 3], b: &[[i64; 3]; 3]| {
                a.as_flattened()
                    .iter()
                    .zip(b.as_flattened())
                    .all(|(a, b)| (a - b).abs() <= 1)
            };
            assert!(
                found.iter().zip(&expected).all(|(a, b)| near(a, b)),
                "{found:?} {expected:?}"
            );
        }
    }

    #[test]
    fn damaged_meshes_are_refused_or_read() {
        damage(&[packed(0), packed(5), packed(10)], |bytes| drop(decode(bytes)));
    }
}
