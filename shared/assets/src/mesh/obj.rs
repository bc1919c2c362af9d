//! Wavefront OBJ: all objects and groups as one mesh, with its material names.

use super::RawMesh;
use super::obj_text::{self, Defined, Mark, NONE, Text, quote};
use super::polygon::Runs;
use crate::Flaw;
use crate::image::linear_from_srgb;
use beamfarm_render::math::Rgb;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Bytes of text per thread.
const PIECE: usize = 1 << 20;

/// The most vertices of one position that are searched linearly.
const MAX_LINKS: usize = 16;

/// Read a mesh. Polygons are triangulated; points and lines are skipped. `colored`: with vertex colours.
pub fn read(bytes: &[u8], colored: bool) -> Result<RawMesh, Flaw> {
    read_in_pieces(bytes, PIECE, colored)
}

fn read_in_pieces(bytes: &[u8], size: usize, colored: bool) -> Result<RawMesh, Flaw> {
    let bytes = &*obj_text::continued(bytes);
    let mut text = obj_text::read(bytes, size)?;
    if colored {
        text.colors = colors(&text);
    }
    let mut mesh = fans(bytes, &text)?;
    let mut runs = Runs::default();
    let mut before = 0;
    for piece in &text.pieces {
        runs.extend(&piece.runs.0, before);
        for (first, line) in &piece.materials {
            let name = rest_of(bytes, *line).unwrap_or_default();
            // A material that is replaced before any face has none.
            mesh.materials.pop_if(|(last, _)| *last == before + first);
            mesh.materials.push((before + first, name));
        }
        before += piece.corners.len() / 3;
    }
    mesh.cut(&runs)?;
    Ok(mesh)
}

/// The colour of each position, if all have one. The numbers are sRGB, as Blender and MeshLab write them.
fn colors(text: &Text) -> Vec<Rgb> {
    let all: Vec<f32> = text
        .pieces
        .iter()
        .flat_map(|piece| piece.colors.iter().copied())
        .collect();
    if all.len() != 3 * text.positions.len() {
        return Vec::new();
    }
    let linear = |shade: f32| linear_from_srgb(f64::from(shade).clamp(0.0, 1.0));
    let (colors, _) = all.as_chunks();
    colors
        .par_iter()
        .map(|color| Rgb::from_array(color.map(linear)))
        .collect()
}

/// The mesh with all polygons as fans of triangles.
fn fans(bytes: &[u8], text: &Text) -> Result<RawMesh, Flaw> {
    // Without normals, groups share vertices, so that smooth normals continue across groups. If only some groups have
    // UVs, each group gets its own vertices.
    if text.normals.is_empty()
        && let Ok(mesh) = join(bytes, text, Parted::Not)
    {
        return Ok(mesh);
    }
    // If only some faces of a group have UVs or normals, each kind gets its own vertices.
    let by_groups = join(bytes, text, Parted::ByGroups);
    by_groups.or_else(|flaw| join(bytes, text, Parted::ByKinds).map_err(|_| flaw))
}

/// Which parts of a mesh get their own vertices.
#[derive(Clone, Copy, PartialEq)]
enum Parted {
    Not,
    ByGroups,
    /// By group, and by whether faces have UVs and normals.
    ByKinds,
}

/// Faces that share vertices.
struct Part {
    triangles: usize,
    /// The numbers of elements defined at its end.
    defined: Defined,
    /// Offset of its group's line.
    group: Option<usize>,
}

fn parts(text: &Text, parted: Parted) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut group = None;
    let mut kind = None;
    // Corners before the piece, and before the part.
    let (mut before, mut begun) = (0, 0);
    let mut colors = 0;
    for piece in &text.pieces {
        for mark in &piece.marks {
            let Mark {
                corner,
                defined: [v, vt, vn, own],
                ..
            } = *mark;
            let is_other = mark.kind.is_some() && kind.is_some() && kind != mark.kind;
            let ends = match parted {
                Parted::Not => false,
                Parted::ByGroups => mark.group.is_some(),
                Parted::ByKinds => mark.group.is_some() || is_other,
            };
            let end = before + corner;
            if ends && end > begun {
                parts.push(Part {
                    triangles: (end - begun) / 3,
                    defined: [v, vt, vn, colors + own],
                    group,
                });
                begun = end;
            }
            group = mark.group.or(group);
            kind = mark.kind.or(kind);
        }
        before += piece.corners.len();
        colors += piece.colors.len();
    }
    parts.push(Part {
        triangles: (before - begun) / 3,
        defined: [text.positions.len(), text.uvs.len(), text.normals.len(), colors],
        group,
    });
    parts
}

/// The vertices of a mesh, in the order in which faces first name them.
struct Vertices {
    /// Position, UV and normal.
    keys: Vec<[u32; 3]>,
    /// The previous vertex at its position.
    older: Vec<u32>,
    /// The last vertex at each position.
    newest: Vec<u32>,
    /// Vertices at positions with very many vertices.
    others: HashMap<[u32; 3], u32>,
    /// The first vertex of the part.
    first: u32,
    /// How many vertices of the part have UVs, and how many normals.
    with: [usize; 2],
}

/// A fault in an index.
enum Fault {
    /// The index of a position, UV or normal is out of range.
    Outside(usize),
    /// Only other vertices have a colour.
    Colorless,
    TooMany,
}

impl Vertices {
    /// The vertex with this position, UV and normal.
    fn of(&mut self, key: [u32; 3], defined: &Defined) -> Result<u32, Fault> {
        let position = key[0] as usize;
        let mut at = *self.newest.get(position).ok_or(Fault::Outside(0))?;
        let mut links = 0;
        // Vertices before the first belong to another part.
        while at != NONE && at >= self.first && links < MAX_LINKS {
            if self.keys[at as usize] == key {
                return Ok(at);
            }
            at = self.older[at as usize];
            links += 1;
        }
        if links == MAX_LINKS
            && let Some(found) = self.others.get(&key).filter(|found| **found >= self.first)
        {
            return Ok(*found);
        }
        if position >= defined[0] {
            return Err(Fault::Outside(0));
        }
        for i in [1, 2] {
            // In files that define no UVs or normals, their indices are ignored.
            if key[i] != NONE && defined[i] > 0 {
                if key[i] as usize >= defined[i] {
                    return Err(Fault::Outside(i));
                }
                self.with[i - 1] += 1;
            }
        }
        if defined[3] > 0 && 3 * position + 2 >= defined[3] {
            return Err(Fault::Colorless);
        }
        let new = self.keys.len() as u32;
        if new == NONE - 1 {
            return Err(Fault::TooMany);
        }
        self.keys.push(key);
        match links {
            MAX_LINKS => {
                self.others.insert(key, new);
                self.older.push(NONE);
            }
            _ => {
                self.older.push(self.newest[position]);
                self.newest[position] = new;
            }
        }
        Ok(new)
    }

    /// Begin another part. Fails if only some vertices of this one have UVs, or normals.
    fn end(&mut self, defined: &Defined) -> Result<(), &'static str> {
        let own = &mut self.keys[self.first as usize..];
        let is_mixed = |with: usize| with > 0 && with < own.len();
        if is_mixed(self.with[1]) {
            return Err("normals");
        }
        if is_mixed(self.with[0]) {
            return Err("UVs");
        }
        for i in [1, 2] {
            // They may be defined later.
            if defined[i] == 0 {
                own.iter_mut().for_each(|key| key[i] = NONE);
            }
        }
        self.first = self.keys.len() as u32;
        self.with = [0; 2];
        Ok(())
    }
}

/// Join the parts one by one.
fn join(bytes: &[u8], text: &Text, parted: Parted) -> Result<RawMesh, Flaw> {
    let mut vertices = Vertices {
        keys: Vec::new(),
        older: Vec::new(),
        newest: vec![NONE; text.positions.len()],
        others: HashMap::new(),
        first: 0,
        with: [0; 2],
    };
    let count: usize = text.pieces.iter().map(|piece| piece.corners.len() / 3).sum();
    let mut triangles = Vec::with_capacity(count);
    let mut all = text.pieces.iter().flat_map(|piece| {
        let keys = |i: usize| {
            let [vt, vn] = piece.others.get(i).copied().unwrap_or([NONE; 2]);
            [piece.corners[i], vt, vn]
        };
        (0..piece.corners.len() / 3).map(move |t| [keys(3 * t), keys(3 * t + 1), keys(3 * t + 2)])
    });
    for part in parts(text, parted) {
        for keys in all.by_ref().take(part.triangles) {
            let mut triangle = [0; 3];
            for (i, key) in keys.into_iter().enumerate() {
                triangle[i] = vertices
                    .of(key, &part.defined)
                    .map_err(|fault| flaw(bytes, &fault, 3 * triangles.len() + i, &part.defined))?;
            }
            triangles.push(triangle);
        }
        vertices.end(&part.defined).map_err(|what| {
            let name = name(bytes, part.group);
            format!("some faces of {name} have {what} and some have none")
        })?;
    }
    let keys = vertices.keys;
    let some = |i: usize| keys.par_iter().any(|key| key[i] != NONE);
    let mut mesh = RawMesh {
        triangles,
        positions: keys.par_iter().map(|key| text.positions[key[0] as usize]).collect(),
        ..RawMesh::default()
    };
    if !text.colors.is_empty() {
        mesh.colors = keys.par_iter().map(|key| text.colors[key[0] as usize]).collect();
    }
    // Zero normals are replaced by face normals after reading.
    if some(2) {
        let normal = |key: &[u32; 3]| text.normals.get(key[2] as usize).copied().unwrap_or(DVec3::ZERO);
        mesh.normals = keys.par_iter().map(normal).collect();
    }
    if some(1) {
        let uv = |key: &[u32; 3]| text.uvs.get(key[1] as usize).copied().unwrap_or(DVec2::ZERO);
        mesh.uvs = keys.par_iter().map(uv).collect();
    }
    Ok(mesh)
}

/// A part's name in messages.
fn name(bytes: &[u8], group: Option<usize>) -> String {
    let name = group.and_then(|start| rest_of(bytes, start));
    name.map_or_else(|| "an object without a name".to_owned(), |name| quote(&name))
}

/// The text after the first word of the line at this offset.
fn rest_of(bytes: &[u8], start: usize) -> Option<String> {
    let line = obj_text::lines(bytes.get(start..)?).next()?;
    let line = String::from_utf8_lossy(line);
    let (_, rest) = line.trim().split_once(char::is_whitespace)?;
    Some(rest.trim().to_owned())
}

/// The .mtl files that an OBJ file names, as written, with their lines.
pub fn libraries(bytes: &[u8]) -> Vec<(usize, String)> {
    let mut named = Vec::new();
    for (i, line) in obj_text::lines(&obj_text::continued(bytes)).enumerate() {
        let line = line.trim_ascii_start();
        let Some(rest) = line
            .strip_prefix(b"mtllib")
            .filter(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
        else {
            continue;
        };
        let rest = String::from_utf8_lossy(rest);
        let mut name = String::new();
        // Names may contain spaces, and a line may name several files.
        for word in rest.trim().split_inclusive(char::is_whitespace) {
            name.push_str(word);
            if name.trim().to_ascii_lowercase().ends_with(".mtl") {
                named.push((i + 1, name.trim().to_owned()));
                name.clear();
            }
        }
        if !name.trim().is_empty() {
            named.push((i + 1, name.trim().to_owned()));
        }
    }
    named
}

/// The error for a triangle corner, numbered over the whole file.
fn flaw(bytes: &[u8], fault: &Fault, corner: usize, defined: &Defined) -> Flaw {
    let (part, what) = match fault {
        Fault::TooMany => return "the mesh has more than 2^32 vertices".into(),
        Fault::Colorless => (0, "vertex"),
        Fault::Outside(part) => (*part, ["vertex", "UV", "normal"][*part]),
    };
    let mut left = corner;
    for (i, line) in obj_text::lines(bytes).enumerate() {
        let Some(words) = obj_text::face(line) else { continue };
        let corners = 3 * words.len().saturating_sub(2);
        if left >= corners {
            left -= corners;
            continue;
        }
        // Each triangle has the first word and two consecutive ones.
        let word = match left % 3 {
            0 => &words[0],
            k => &words[left / 3 + k],
        };
        let index = word.split('/').nth(part).unwrap_or_default();
        let message = match fault {
            Fault::Colorless => format!("the face names vertex {index}, which has no colour, but others have one"),
            _ if index.is_empty() => format!("expected the index of a vertex, found {}", quote(word)),
            _ => format!("the face names {what} {index}, but there are {}", defined[part]),
        };
        let line = Some(i + 1);
        return Flaw { line, message };
    }
    format!("a face names a {what} that does not exist").into()
}

#[cfg(test)]
mod tests;
