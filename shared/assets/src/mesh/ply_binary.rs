//! Reads elements of binary PLY files in parallel, given the library's header; the library takes a microsecond per
//! property. Anything unusual or faulty is left to the library and its errors: the result is then `None`, and no bytes
//! are consumed.

use super::RawMesh;
use super::polygon::Runs;
use crate::image::linear_from_srgb;
use crate::ply_number::{Number, is_big, size};
use beamfarm_render::math::Rgb;
use beamfarm_render::parallel::collected;
use glam::{DVec2, DVec3};
use ply_rs_bw::ply::{ElementDef, Encoding, PropertyType, ScalarType};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Names of the list of a face's indices.
pub const INDEX_NAMES: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Faces per thread.
const CHUNK: usize = 1 << 14;

/// The linear value of a colour byte, which is sRGB, as Blender and MeshLab write it.
pub fn linear(byte: u8) -> f32 {
    static LINEAR: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb(byte as f64 / 255.0)));
    LINEAR[usize::from(byte)]
}

fn is_whole(kind: &ScalarType) -> bool {
    !matches!(kind, ScalarType::Float | ScalarType::Double)
}

/// A vertex property's slot in a record of numbers.
fn slot(name: &str) -> Option<usize> {
    Some(match name {
        "x" => 0,
        "y" => 1,
        "z" => 2,
        "nx" => 3,
        "ny" => 4,
        "nz" => 5,
        "u" | "s" | "texture_u" | "texture_s" => 6,
        "v" | "t" | "texture_v" | "texture_t" => 7,
        "red" | "r" => 8,
        "green" | "g" => 9,
        "blue" | "b" => 10,
        _ => return None,
    })
}

/// Read the vertices at the front of `bytes`, and report which of normals, UVs and colours they have.
pub fn vertices(
    bytes: &mut &[u8],
    element: &ElementDef,
    encoding: &Encoding,
    [has_normals, has_uvs, has_colors]: [bool; 3],
    mesh: &mut RawMesh,
) -> Option<()> {
    let is_big = is_big(encoding)?;
    let mut columns: [Option<(usize, Number)>; 11] = [const { None }; 11];
    let mut stride = 0;
    for property in element.properties.values() {
        let PropertyType::Scalar(kind) = &property.data_type else {
            return None;
        };
        if let Some(slot) = slot(&property.name) {
            // If several properties have one meaning, the last counts.
            let kind = kind.clone();
            columns[slot] = Some((stride, Number { kind, is_big }));
        }
        stride += size(kind);
    }
    let known = |(_, number): &(usize, Number)| {
        matches!(number.kind, ScalarType::UChar | ScalarType::Float | ScalarType::Double)
    };
    if has_colors && !columns[8..].iter().flatten().all(known) {
        return None;
    }
    let length = stride.checked_mul(element.count)?;
    let (records, rest) = bytes.split_at_checked(length)?;
    if stride == 0 {
        return None;
    }
    let numbers = |record: &[u8], first: usize| -> [f64; 3] {
        std::array::from_fn(|i| match columns.get(first + i) {
            Some(Some((at, number))) => number.float(&record[*at..]),
            _ => 0.0,
        })
    };
    let records = records.par_chunks_exact(stride);
    let vectors = |first: usize| collected(records.clone().map(move |r| DVec3::from(numbers(r, first))));
    mesh.positions = vectors(0);
    if has_normals {
        mesh.normals = vectors(3);
    }
    if has_uvs {
        let uv = |record: &[u8]| {
            let [u, v, _] = numbers(record, 6);
            DVec2::new(u, v)
        };
        mesh.uvs = collected(records.clone().map(uv));
    }
    if has_colors {
        let color = |record: &[u8]| {
            let part = |column: &Option<(usize, Number)>| match column {
                Some((
                    at,
                    Number {
                        kind: ScalarType::UChar,
                        ..
                    },
                )) => linear(record[*at]),
                Some((at, number)) => number.float(&record[*at..]) as f32,
                None => 0.0,
            };
            Rgb::new(part(&columns[8]), part(&columns[9]), part(&columns[10]))
        };
        mesh.colors = collected(records.map(color));
    }
    *bytes = rest;
    Some(())
}

/// A part of a face's record.
enum Part {
    /// Ignored bytes.
    Skipped(usize),
    /// A list's count and elements.
    List(Number, Number),
}

/// Reads face records one by one.
struct Faces<'p> {
    parts: &'p [Part],
    /// Which part holds the indices.
    indices: usize,
}

impl Faces<'_> {
    /// The indices of the face at the front of `bytes`, which then starts after it.
    fn next<'b>(&self, bytes: &mut &'b [u8]) -> Option<&'b [u8]> {
        let mut indices: &[u8] = &[];
        for (i, part) in self.parts.iter().enumerate() {
            let length = match part {
                Part::Skipped(length) => *length,
                Part::List(count, item) => {
                    let (count_bytes, rest) = bytes.split_at_checked(size(&count.kind))?;
                    *bytes = rest;
                    usize::try_from(count.whole(count_bytes))
                        .ok()?
                        .checked_mul(size(&item.kind))?
                }
            };
            let (part, rest) = bytes.split_at_checked(length)?;
            *bytes = rest;
            if i == self.indices {
                indices = part;
            }
        }
        Some(indices)
    }
}

/// Faces as triangle fans.
pub struct Fans {
    pub triangles: Vec<[u32; 3]>,
    /// Faces with more than three corners.
    pub runs: Runs,
}

/// Read the faces at the front of `bytes`.
pub fn faces(bytes: &mut &[u8], element: &ElementDef, encoding: &Encoding) -> Option<Fans> {
    let is_big = is_big(encoding)?;
    let mut parts = Vec::new();
    let mut found = None;
    for property in element.properties.values() {
        let is_indices = INDEX_NAMES.contains(&property.name.as_str());
        parts.push(match &property.data_type {
            PropertyType::Scalar(_) if is_indices => return None,
            PropertyType::Scalar(kind) => Part::Skipped(size(kind)),
            PropertyType::List(count, item) if is_whole(count) => {
                let number = |kind: &ScalarType| Number {
                    kind: kind.clone(),
                    is_big,
                };
                if is_indices {
                    found = Some((parts.len(), number(item)));
                }
                Part::List(number(count), number(item))
            }
            PropertyType::List(..) => return None,
        });
    }
    let (indices, number) = found.filter(|(_, number)| is_whole(&number.kind))?;
    let (faces, size) = (Faces { parts: &parts, indices }, size(&number.kind));
    let in_fan = |indices: &[u8]| (indices.len() / size).saturating_sub(2);
    // A chunk's start is known only once the faces before it are counted.
    let mut chunks = Vec::new();
    let (mut runs, mut before) = (Runs::default(), 0);
    let mut rest = *bytes;
    let mut left = element.count;
    while left > 0 {
        let (start, count) = (rest, left.min(CHUNK));
        let mut triangles = 0;
        for _ in 0..count {
            let own = in_fan(faces.next(&mut rest)?);
            runs.add(before + triangles, own);
            triangles += own;
        }
        before += triangles;
        chunks.push((start, count, triangles));
        left -= count;
    }
    let mut all = vec![[0; 3]; chunks.iter().map(|(.., triangles)| triangles).sum()];
    let mut to_fill = &mut all[..];
    let chunks: Vec<_> = chunks
        .into_iter()
        .map(|(start, count, triangles)| (start, count, to_fill.split_off_mut(..triangles).unwrap_or_default()))
        .collect();
    // A negative index becomes one that no vertex has.
    let index = |bytes: &[u8]| u32::try_from(number.whole(bytes)).unwrap_or(u32::MAX);
    chunks.into_par_iter().for_each(|(mut bytes, count, triangles)| {
        let mut to_fill = triangles.iter_mut();
        for _ in 0..count {
            let Some(indices) = faces.next(&mut bytes) else { return };
            let corner = |i: usize| index(&indices[i * size..]);
            for (i, triangle) in (2..2 + in_fan(indices)).zip(&mut to_fill) {
                *triangle = [corner(0), corner(i - 1), corner(i)];
            }
        }
    });
    *bytes = rest;
    Some(Fans { triangles: all, runs })
}
