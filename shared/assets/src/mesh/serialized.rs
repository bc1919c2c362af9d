//! Mitsuba's `.serialized` meshes, versions 3 and 4: several per file, each compressed by zlib. The format is that of
//! Mitsuba's documentation of the plugin `serialized`; all numbers are little-endian.

use super::RawMesh;
use crate::Flaw;
use flate2::read::ZlibDecoder;
use glam::{DVec2, DVec3};
use std::io::Read;

/// The most bytes of a decompressed mesh: zlib can expand a thousandfold.
const MOST: u64 = 1 << 32;
const MAGIC: u16 = 0x041c;
const NORMALS: u32 = 0x1;
const UVS: u32 = 0x2;
const COLORS: u32 = 0x8;
const FACE_NORMALS: u32 = 0x10;
const DOUBLE: u32 = 0x2000;

/// Read the mesh with an index from zero.
pub fn read(bytes: &[u8], index: u32, colored: bool) -> Result<RawMesh, Flaw> {
    let start = |at: usize| -> Option<[u16; 2]> {
        let head = bytes.get(at..at.checked_add(4)?)?;
        Some([
            u16::from_le_bytes([head[0], head[1]]),
            u16::from_le_bytes([head[2], head[3]]),
        ])
    };
    let version = match start(0) {
        Some([MAGIC, version @ (3 | 4)]) => version,
        Some([MAGIC, version]) => {
            return Err(format!("version {version} of .serialized is not supported; expected 3 or 4").into());
        }
        _ => return Err("not a .serialized mesh of Mitsuba: it does not begin with 1c 04".into()),
    };
    let at = offset(bytes, version, index)?;
    let beyond = || format!("the place of mesh {index} lies outside of the file");
    match start(at).ok_or_else(beyond)? {
        [MAGIC, found] if found == version => {}
        _ => return Err(format!("at byte {at}, where mesh {index} should be, there is none").into()),
    }
    let compressed = bytes.get(at + 4..).ok_or_else(beyond)?;
    let data = ZlibDecoder::new(compressed).take(MOST);
    Data { data }.mesh(version, colored)
}

/// Offset of a mesh: the file ends with a table of offsets and their count.
fn offset(bytes: &[u8], version: u16, index: u32) -> Result<usize, Flaw> {
    let short = "the file is too short for its table of meshes";
    let end = bytes.len().checked_sub(4).ok_or(short)?;
    let word = |at: usize, size: usize| -> Option<u64> {
        let bytes = bytes.get(at..at.checked_add(size)?)?;
        Some(bytes.iter().rev().fold(0, |number, b| number << 8 | u64::from(*b)))
    };
    let count = word(end, 4).ok_or(short)?;
    if u64::from(index) >= count {
        return Err(format!("there is no mesh {index}; the file has {count}, counted from zero").into());
    }
    let size: usize = if version == 3 { 4 } else { 8 };
    let table = usize::try_from(count)
        .ok()
        .and_then(|count| end.checked_sub(count.checked_mul(size)?));
    let at = table
        .and_then(|table| word(table + index as usize * size, size))
        .ok_or(short)?;
    usize::try_from(at).map_err(|_| short.into())
}

struct Data<R> {
    data: R,
}

impl<R: Read> Data<R> {
    fn mesh(&mut self, version: u16, colored: bool) -> Result<RawMesh, Flaw> {
        let flags = u32::from_le_bytes(self.array()?);
        if version == 4 {
            // A zero-terminated name.
            while self.array::<1>()? != [0] {}
        }
        let [vertices, triangles] = [u64::from_le_bytes(self.array()?), u64::from_le_bytes(self.array()?)];
        if vertices > u64::from(u32::MAX) || triangles > u64::from(u32::MAX) {
            return Err(
                format!("{vertices} vertices and {triangles} triangles: expected fewer than 2^32 of each").into(),
            );
        }
        let double = flags & DOUBLE != 0;
        let mut mesh = RawMesh {
            positions: self.triples(vertices, double)?,
            ..RawMesh::default()
        };
        if flags & NORMALS != 0 {
            mesh.normals = self.triples(vertices, double)?;
        }
        if flags & UVS != 0 {
            let numbers = self.numbers(2 * vertices, double)?;
            mesh.uvs = numbers.as_chunks().0.iter().map(|uv| DVec2::from_array(*uv)).collect();
        }
        if flags & COLORS != 0 {
            let colors = self.triples(vertices, double)?;
            if colored {
                mesh.colors = colors.iter().map(|color| color.as_vec3()).collect();
            }
        }
        let bytes = self.bytes(12 * triangles)?;
        let (words, _) = bytes.as_chunks::<4>();
        let (corners, _) = words.as_chunks::<3>();
        mesh.triangles = corners.iter().map(|t| t.map(u32::from_le_bytes)).collect();
        if flags & FACE_NORMALS != 0 {
            split(&mut mesh)?;
        }
        Ok(mesh)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Flaw> {
        let mut array = [0; N];
        self.data.read_exact(&mut array).map_err(|e| broken(&e))?;
        Ok(array)
    }

    /// Memory grows with the actual data, not with the claimed size.
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, Flaw> {
        let mut bytes = Vec::new();
        let read = self
            .data
            .by_ref()
            .take(count)
            .read_to_end(&mut bytes)
            .map_err(|e| broken(&e))?;
        match read as u64 == count {
            true => Ok(bytes),
            false => Err(format!("the mesh is cut off: expected {count} bytes more, found {read}").into()),
        }
    }

    fn numbers(&mut self, count: u64, double: bool) -> Result<Vec<f64>, Flaw> {
        let bytes = self.bytes(count * if double { 8 } else { 4 })?;
        Ok(match double {
            true => bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
            false => bytes
                .as_chunks()
                .0
                .iter()
                .map(|b| f64::from(f32::from_le_bytes(*b)))
                .collect(),
        })
    }

    fn triples(&mut self, count: u64, double: bool) -> Result<Vec<DVec3>, Flaw> {
        let numbers = self.numbers(3 * count, double)?;
        Ok(numbers.as_chunks().0.iter().map(|v| DVec3::from_array(*v)).collect())
    }
}

fn broken(error: &std::io::Error) -> Flaw {
    format!("the mesh cannot be decompressed, or is cut off: {error}").into()
}

/// Separate vertices per triangle, without normals: the file's meaning of face normals.
fn split(mesh: &mut RawMesh) -> Result<(), Flaw> {
    let corners: Vec<usize> = mesh.triangles.iter().flatten().map(|v| *v as usize).collect();
    if corners.len() > u32::MAX as usize || corners.iter().any(|v| *v >= mesh.positions.len()) {
        return Err("a triangle names a vertex that there is not".into());
    }
    mesh.positions = corners.iter().map(|v| mesh.positions[*v]).collect();
    if !mesh.uvs.is_empty() {
        mesh.uvs = corners.iter().map(|v| mesh.uvs[*v]).collect();
    }
    if !mesh.colors.is_empty() {
        mesh.colors = corners.iter().map(|v| mesh.colors[*v]).collect();
    }
    mesh.normals.clear();
    mesh.triangles = (0..mesh.triangles.len() as u32)
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damage::damage;
    use beamfarm_render::math::Rgb;
    use flate2::{Compression, write::ZlibEncoder};
    use std::io::Write;

    /// A triangle at height `z`, as Mitsuba writes it.
    fn triangle(version: u16, flags: u32, z: f64) -> Vec<u8> {
        let mut data = flags.to_le_bytes().to_vec();
        if version == 4 {
            data.extend(b"name\0");
        }
        data.extend(3u64.to_le_bytes());
        data.extend(1u64.to_le_bytes());
        let mut put = |numbers: &[f64]| {
            for x in numbers {
                match flags & DOUBLE {
                    0 => data.extend((*x as f32).to_le_bytes()),
                    _ => data.extend(x.to_le_bytes()),
                }
            }
        };
        put(&[0.0, 0.0, z, 1.0, 0.0, z, 0.0, 1.0, z]);
        if flags & NORMALS != 0 {
            put(&[0.0, 0.0, 1.0].repeat(3));
        }
        if flags & UVS != 0 {
            put(&[0.0, 0.25, 1.0, 0.25, 0.0, 0.75]);
        }
        if flags & COLORS != 0 {
            put(&[0.5; 9]);
        }
        [0u32, 1, 2].iter().for_each(|v| data.extend(v.to_le_bytes()));
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&data).unwrap();
        let mut bytes = MAGIC.to_le_bytes().to_vec();
        bytes.extend(version.to_le_bytes());
        bytes.extend(encoder.finish().unwrap());
        bytes
    }

    fn file(version: u16, flags: &[u32]) -> Vec<u8> {
        let (mut bytes, mut places) = (Vec::new(), Vec::new());
        for (i, flags) in flags.iter().enumerate() {
            places.push(bytes.len() as u64);
            bytes.extend(triangle(version, *flags, i as f64));
        }
        for place in places {
            match version {
                3 => bytes.extend((place as u32).to_le_bytes()),
                _ => bytes.extend(place.to_le_bytes()),
            }
        }
        bytes.extend((flags.len() as u32).to_le_bytes());
        bytes
    }

    #[test]
    fn meshes_are_found_by_their_index() {
        for version in [3, 4] {
            let flags = [0x1000, DOUBLE | NORMALS | UVS | COLORS, 0x1000 | NORMALS | FACE_NORMALS];
            let bytes = file(version, &flags);
            for (i, flags) in flags.into_iter().enumerate() {
                let mesh = read(&bytes, i as u32, i == 1).unwrap();
                assert_eq!(mesh.triangles, [[0, 1, 2]]);
                assert_eq!(mesh.positions[2], DVec3::new(0.0, 1.0, i as f64));
                let normals = flags & NORMALS != 0 && flags & FACE_NORMALS == 0;
                assert_eq!(mesh.normals, vec![DVec3::Z; if normals { 3 } else { 0 }]);
                let uvs = [[0.0, 0.25], [1.0, 0.25], [0.0, 0.75]].map(DVec2::from_array);
                assert_eq!(mesh.colors, vec![Rgb::splat(0.5); if i == 1 { 3 } else { 0 }]);
                assert_eq!(mesh.uvs, if flags & UVS != 0 { uvs.to_vec() } else { vec![] });
            }
            assert!(
                read(&bytes, 3, true)
                    .unwrap_err()
                    .message
                    .contains("there is no mesh 3")
            );
        }
    }

    #[test]
    fn damaged_files_are_errors_or_meshes() {
        damage(&[file(3, &[0x1000, UVS]), file(4, &[NORMALS, FACE_NORMALS])], |bytes| {
            let _ = read(bytes, 1, true).and_then(RawMesh::checked);
        });
        // A claim of four billion vertices allocates nothing.
        let mut data = 0u32.to_le_bytes().to_vec();
        data.extend(u64::from(u32::MAX).to_le_bytes().repeat(2));
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&data).unwrap();
        let mut bytes = [0x1c, 4, 3, 0].to_vec();
        bytes.extend(encoder.finish().unwrap());
        bytes.extend([0, 0, 0, 0, 1, 0, 0, 0]);
        assert!(read(&bytes, 0, true).unwrap_err().message.contains("cut off"));
    }
}
