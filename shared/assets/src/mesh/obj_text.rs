//! The text of OBJ files. It is cut at line ends into pieces that are read in parallel. The cuts depend only on the
//! text, and results are in line order.

use super::polygon::Runs;
use crate::Flaw;
use beamfarm_render::math::Rgb;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// The index of a corner that has none.
pub const NONE: u32 = u32::MAX;

/// An index too large for any file.
const FAR: u32 = u32::MAX - 1;

/// What a file defines, and what its faces name.
pub struct Text {
    /// From `v` lines.
    pub positions: Vec<DVec3>,
    /// From `vt` lines.
    pub uvs: Vec<DVec2>,
    /// From `vn` lines.
    pub normals: Vec<DVec3>,
    /// The pieces in order.
    pub pieces: Vec<Piece>,
    /// Linear colours by position; empty if not requested.
    pub colors: Vec<Rgb>,
}

/// Numbers of positions, UVs and normals before a line, and of colour components.
pub type Defined = [usize; 4];

/// The faces of a piece of text as triangle fans. Indices are zero-based and count from the start of the file.
#[derive(Default)]
pub struct Piece {
    /// Position of each corner of each triangle.
    pub corners: Vec<u32>,
    /// UV and normal of each corner; empty if no corner of the piece has either.
    pub others: Vec<[u32; 2]>,
    /// Faces with more than three corners.
    pub runs: Runs,
    /// Number of triangles before each `usemtl` line of the piece, and the line's offset.
    pub materials: Vec<(usize, usize)>,
    /// Where faces may be split into parts.
    pub marks: Vec<Mark>,
    /// Colour components of its vertices, as written.
    pub colors: Vec<f32>,
}

/// A place between faces where a group or another kind of face begins.
#[derive(Clone, Copy)]
pub struct Mark {
    /// Corners before it in its piece.
    pub corner: usize,
    /// The numbers defined before it; for colours, those of the piece.
    pub defined: Defined,
    /// Offset of the line of the last object or group that begins here.
    pub group: Option<usize>,
    /// Which of position, UV and normal the next face has, if that differs from the face before or is unknown.
    pub kind: Option<u32>,
}

/// What must be known of the preceding lines to read a piece.
#[derive(Clone, Copy, Default)]
struct Census {
    lines: usize,
    defined: [usize; 3],
    faces: usize,
}

/// Read the text in pieces of `size` bytes or a little more. The error is that of the first bad line.
pub fn read(bytes: &[u8], size: usize) -> Result<Text, Flaw> {
    let pieces = cut(bytes, size);
    let censuses: Vec<Census> = pieces.par_iter().map(|piece| census(piece)).collect();
    let [positions, uvs, normals] = [0, 1, 2].map(|i| censuses.iter().map(|census| census.defined[i]).sum());
    if [positions, uvs, normals].into_iter().any(|count| count >= FAR as usize) {
        return Err("the mesh has more than 2^32 vertices".into());
    }
    let mut text = Text {
        positions: vec![DVec3::ZERO; positions],
        uvs: vec![DVec2::ZERO; uvs],
        normals: vec![DVec3::ZERO; normals],
        pieces: Vec::new(),
        colors: Vec::new(),
    };
    let (mut positions, mut uvs, mut normals) = (&mut text.positions[..], &mut text.uvs[..], &mut text.normals[..]);
    let mut before = Census::default();
    let mut start = 0;
    let mut readers = Vec::with_capacity(pieces.len());
    for (piece, census) in pieces.into_iter().zip(censuses) {
        let [v, vt, vn] = census.defined;
        let reader = Reader {
            defined: before.defined,
            positions: positions.split_off_mut(..v).unwrap_or_default().iter_mut(),
            uvs: uvs.split_off_mut(..vt).unwrap_or_default().iter_mut(),
            normals: normals.split_off_mut(..vn).unwrap_or_default().iter_mut(),
            face: Vec::new(),
            kind: None,
            piece: Piece::default(),
        };
        readers.push((reader, piece, start, before.lines, census.faces));
        start += piece.len();
        before.lines += census.lines;
        for (sum, count) in before.defined.iter_mut().zip(census.defined) {
            *sum += count;
        }
    }
    let read = readers.into_par_iter().map(|(mut reader, piece, start, lines, faces)| {
        reader.piece.corners.reserve(3 * faces);
        reader.read(piece, start, lines)
    });
    // The first error in the file, not the one found first.
    let read: Vec<Result<Piece, Flaw>> = read.collect();
    text.pieces = read.into_iter().collect::<Result<_, _>>()?;
    Ok(text)
}

fn cut(bytes: &[u8], size: usize) -> Vec<&[u8]> {
    let mut pieces = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let least = size.clamp(1, rest.len());
        let end = memchr::memchr(b'\n', &rest[least - 1..]).map_or(rest.len(), |i| least + i);
        let (piece, others) = rest.split_at(end);
        pieces.push(piece);
        rest = others;
    }
    pieces
}

/// The text with lines joined that continue after a trailing `\`, if there are any. The removed line ends are appended
/// after the joined line, so that later lines keep their numbers.
pub fn continued(bytes: &[u8]) -> Cow<'_, [u8]> {
    let goes_on = |line: &[u8]| {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let is_comment = line.iter().find(|byte| !is_space(**byte)) == Some(&b'#');
        (line.last() == Some(&b'\\') && !is_comment).then(|| line.len() - 1)
    };
    let may_go_on = |at: usize| matches!(bytes[at + 1..], [b'\n', ..] | [b'\r', b'\n', ..]);
    if !memchr::memchr_iter(b'\\', bytes).any(may_go_on) {
        return bytes.into();
    }
    let mut text = Vec::with_capacity(bytes.len());
    let mut owed = 0;
    for line in lines(bytes) {
        match goes_on(line) {
            Some(end) => {
                text.extend_from_slice(&line[..end]);
                text.push(b' ');
                owed += 1;
            }
            None => {
                text.extend_from_slice(line);
                text.extend(std::iter::repeat_n(b'\n', 1 + std::mem::take(&mut owed)));
            }
        }
    }
    text.into()
}

/// Lines without line ends.
pub fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = text;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let end = memchr::memchr(b'\n', rest);
        let (line, others) = end.map_or((rest, &rest[..0]), |end| (&rest[..end], &rest[end + 1..]));
        rest = others;
        Some(line)
    })
}

fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// The first word of `rest`, which then starts after it.
fn word<'t>(rest: &mut &'t [u8]) -> Option<&'t [u8]> {
    let start = rest.iter().position(|byte| !is_space(*byte))?;
    let from = &rest[start..];
    let end = from.iter().position(|byte| is_space(*byte)).unwrap_or(from.len());
    let (word, others) = from.split_at(end);
    *rest = others;
    Some(word)
}

/// A line whose Unicode white space becomes ASCII spaces.
fn plain(line: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(line);
    text.split_whitespace().collect::<Vec<_>>().join(" ").into_bytes()
}

/// The first word of a line, and the rest.
fn keyword(line: &[u8]) -> (Cow<'_, [u8]>, Cow<'_, [u8]>) {
    let mut rest = line;
    let first = word(&mut rest).unwrap_or_default();
    if line.is_ascii() || first.starts_with(b"#") {
        return (first.into(), rest.into());
    }
    let line = plain(line);
    let mut rest = &line[..];
    let first = word(&mut rest).unwrap_or_default();
    (first.to_vec().into(), rest.to_vec().into())
}

/// The words after `f` or `l`.
pub fn face(line: &[u8]) -> Option<Vec<String>> {
    let line = plain(line);
    let mut rest = &line[..];
    let is_face = matches!(word(&mut rest), Some(b"f" | b"l"));
    let words = std::iter::from_fn(|| word(&mut rest));
    is_face.then(|| words.map(|word| String::from_utf8_lossy(word).into_owned()).collect())
}

fn census(piece: &[u8]) -> Census {
    let mut census = Census::default();
    for line in lines(piece) {
        census.lines += 1;
        // Lines too short for their numbers are errors found on reading, so no room is reserved for them.
        match &*keyword(line).0 {
            b"v" if line.len() >= b"v 0 0 0".len() => census.defined[0] += 1,
            b"vt" if line.len() >= b"vt 0 0".len() => census.defined[1] += 1,
            b"vn" if line.len() >= b"vn 0 0 0".len() => census.defined[2] += 1,
            b"f" if line.len() >= b"f 1 2 3".len() => census.faces += 1,
            _ => {}
        }
    }
    census
}

/// Reads a piece line by line.
struct Reader<'t> {
    /// The numbers defined before the line.
    defined: [usize; 3],
    positions: std::slice::IterMut<'t, DVec3>,
    uvs: std::slice::IterMut<'t, DVec2>,
    normals: std::slice::IterMut<'t, DVec3>,
    /// Corners of the current face.
    face: Vec<[u32; 3]>,
    /// Kind of the last face.
    kind: Option<u32>,
    piece: Piece,
}

impl Reader<'_> {
    /// `start`: the piece's offset in the file; `lines`: the number of lines before it.
    fn read(mut self, piece: &[u8], start: usize, lines: usize) -> Result<Piece, Flaw> {
        let mut at = start;
        for (i, line) in self::lines(piece).enumerate() {
            let (keyword, rest) = keyword(line);
            self.line(&keyword, &rest, at).map_err(|message| Flaw {
                line: Some(lines + i + 1),
                message,
            })?;
            at += line.len() + 1;
        }
        Ok(self.piece)
    }

    fn line(&mut self, keyword: &[u8], mut rest: &[u8], at: usize) -> Result<(), String> {
        match keyword {
            b"v" => {
                let position = self.position(rest)?;
                put(&mut self.positions, position);
                self.defined[0] += 1;
            }
            b"vt" => {
                let all = rest;
                let [u, v] = numbers(&mut rest).ok_or_else(|| expected("two numbers of a UV", all))?;
                put(&mut self.uvs, DVec2::new(u, v));
                self.defined[1] += 1;
            }
            b"vn" => {
                let all = rest;
                let normal = numbers(&mut rest).ok_or_else(|| expected("three numbers of a normal", all))?;
                put(&mut self.normals, DVec3::from(normal));
                self.defined[2] += 1;
            }
            b"f" => self.face(rest, true)?,
            b"l" => self.face(rest, false)?,
            // Points are skipped, but their errors are reported.
            b"p" => {
                while let Some(word) = word(&mut rest) {
                    for (part, defined) in word.split(|byte| *byte == b'/').zip(self.defined) {
                        if let Some(index @ ..0) = whole(part) {
                            from_zero(index, defined)?;
                        }
                    }
                }
            }
            b"usemtl" => self.piece.materials.push((self.piece.corners.len() / 3, at)),
            b"o" | b"g" => {
                let corner = self.piece.corners.len();
                // A group without faces is forgotten.
                match self.piece.marks.last_mut() {
                    Some(mark) if mark.corner == corner && mark.group.is_some() => mark.group = Some(at),
                    _ => self.mark(Some(at), None),
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn mark(&mut self, group: Option<usize>, kind: Option<u32>) {
        let [v, vt, vn] = self.defined;
        let Piece {
            corners, marks, colors, ..
        } = &mut self.piece;
        marks.push(Mark {
            corner: corners.len(),
            defined: [v, vt, vn, colors.len()],
            group,
            kind,
        });
    }

    /// Three coordinates, with a fourth that divides them, or with three colour components.
    fn position(&mut self, mut rest: &[u8]) -> Result<DVec3, String> {
        let all = rest;
        let what = "three numbers of a position";
        let position = DVec3::from(numbers(&mut rest).ok_or_else(|| expected(what, all))?);
        let Some(first) = word(&mut rest) else {
            return Ok(position);
        };
        match [(); 3].map(|()| word(&mut rest)) {
            [None, ..] => match number(first) {
                Some(0.0) => Err("the position is divided by zero".to_owned()),
                Some(w) => Ok(position / w),
                None => Err(expected("a number that the position is divided by", first)),
            },
            [Some(second), Some(third), None] => {
                let colors = [first, second, third].into_iter().map_while(number);
                self.piece.colors.extend(colors.map(|shade| shade as f32));
                Ok(position)
            }
            _ => Err(expected("a position, or a position and three numbers of a colour", all)),
        }
    }

    /// A polygon as a triangle fan. `is_face`: it is not a line.
    fn face(&mut self, mut rest: &[u8], is_face: bool) -> Result<(), String> {
        let all = rest;
        self.face.clear();
        let mut kind = None;
        while let Some(word) = word(&mut rest) {
            let (corner, kind_of_word) = self.corner(word)?;
            self.face.push(corner);
            kind = kind.or(Some(kind_of_word));
        }
        let Some(first) = self.face.first().copied() else {
            return Err(expected("indices of vertices", all));
        };
        if is_face && self.kind != kind {
            self.kind = kind;
            self.mark(None, kind);
        }
        let first_triangle = self.piece.corners.len() / 3;
        self.piece.runs.add(first_triangle, self.face.len().saturating_sub(2));
        for pair in self.face[1..].windows(2) {
            for [v, vt, vn] in [first, pair[0], pair[1]] {
                let Piece { corners, others, .. } = &mut self.piece;
                if !others.is_empty() || [vt, vn] != [NONE; 2] {
                    others.resize(corners.len(), [NONE; 2]);
                    others.push([vt, vn]);
                }
                corners.push(v);
            }
        }
        Ok(())
    }

    /// Indices of position, UV and normal, each optional, and the kind that says which are there.
    fn corner(&self, word: &[u8]) -> Result<([u32; 3], u32), String> {
        let mut corner = [NONE; 3];
        let mut kind = 0;
        let mut parts = 0;
        for part in word.split(|byte| *byte == b'/') {
            if !part.is_empty() {
                let index = whole(part).filter(|_| parts < 3);
                let index = index.ok_or_else(|| expected("an index, or indices like 1/2/3, 1//3 or 1/2", word))?;
                corner[parts] = from_zero(index, self.defined[parts])?;
                kind |= 1 << parts;
            }
            parts += 1;
        }
        let parts = u32::try_from(parts).unwrap_or(u32::MAX).min(u32::MAX >> 3);
        Ok((corner, parts << 3 | kind))
    }
}

fn put<T>(slots: &mut std::slice::IterMut<'_, T>, value: T) {
    if let Some(slot) = slots.next() {
        *slot = value;
    }
}

/// A zero-based index from one that counts from 1, or backwards from -1; zero is invalid.
fn from_zero(index: i64, defined: usize) -> Result<u32, String> {
    let from_start = match index {
        0 => return Ok(NONE),
        1.. => index.unsigned_abs() - 1,
        _ => (defined as u64)
            .checked_sub(index.unsigned_abs())
            .ok_or_else(|| format!("a face counts back to {index}, but there are {defined} before it"))?,
    };
    Ok(u32::try_from(from_start).unwrap_or(FAR).min(FAR))
}

/// Parses the next `N` words as numbers.
fn numbers<const N: usize>(rest: &mut &[u8]) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for slot in &mut numbers {
        *slot = number(word(rest)?)?;
    }
    Some(numbers)
}

fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn whole(word: &[u8]) -> Option<i64> {
    // This many digits always fit.
    if !(1..=18).contains(&word.len()) || !word[0].is_ascii_digit() {
        return std::str::from_utf8(word).ok()?.parse().ok();
    }
    word.iter().try_fold(0, |sum, byte| {
        byte.is_ascii_digit().then(|| 10 * sum + i64::from(byte - b'0'))
    })
}

fn expected(what: &str, found: &[u8]) -> String {
    let found = quote(&String::from_utf8_lossy(found));
    format!("expected {what}, found {found}")
}

/// The start of the faulty text.
pub fn quote(found: &str) -> String {
    let found = found.trim();
    let end = found.char_indices().nth(40).map_or(found.len(), |(end, _)| end);
    match found.len() {
        0 => "nothing".to_owned(),
        length if length > end => format!("`{}`…", &found[..end]),
        _ => format!("`{found}`"),
    }
}
