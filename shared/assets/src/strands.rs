//! Curves and points, from text or from a PLY file.

use crate::Flaw;
use crate::mesh::BYTE_ORDER_MARK;
use crate::ply_number::{Number, is_big, size};
use beamfarm_render::parallel::collected;
use beamfarm_render::world::geometry::strands::{Basis, MOST_POINTS, Strands};
use glam::{Vec3, Vec4};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, Encoding, PropertyType};
use rayon::prelude::*;

/// Control points or centres with radii, as in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawStrands {
    /// Positions and radii.
    pub points: Vec<Vec4>,
    /// Number of control points of each curve, in order.
    pub lengths: Vec<u32>,
}

impl RawStrands {
    /// Read a PLY file, or otherwise text. Text: a line per point with x, y, z and radius; an empty line ends a curve.
    /// PLY: element `vertex` with x, y, z and radius; for curves also element `curve` with `vertices`, the number of
    /// control points of each. `radius`: for points without one.
    pub fn read(name: &str, bytes: &[u8], radius: Option<f32>) -> Result<Self, Flaw> {
        let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        match ending.as_deref() {
            Some("ply") => of_ply(bytes, radius),
            _ => of_text(bytes, radius),
        }
    }

    /// The curves or balls; an error if a number is out of range.
    pub fn to_strands(&self, basis: Basis) -> Result<Strands, Flaw> {
        let is_good = |p: &Vec4| p.is_finite() && p.w >= 0.0 && p.abs().max_element() <= 1e15;
        if let Some(wrong) = self.points.par_iter().position_first(|p| !is_good(p)) {
            let point = self.points[wrong].to_array();
            return Err(format!(
                "point {wrong} (from zero) is {point:?}; expected finite coordinates and a radius that is not negative"
            )
            .into());
        }
        if self.points.is_empty() {
            return Err("it has no points".into());
        }
        if self.points.len() > MOST_POINTS {
            return Err(format!("{} points; expected at most {MOST_POINTS}", self.points.len()).into());
        }
        let least = basis.least_points();
        let short = |length: &u32| basis != Basis::Balls && (*length as usize) < least;
        if let Some(wrong) = self.lengths.iter().position(short) {
            let has = self.lengths[wrong];
            return Err(
                format!("curve {wrong} (from zero) has {has} control point(s); expected {least} at least").into(),
            );
        }
        Ok(Strands::new(basis, self.points.clone(), &self.lengths))
    }
}

fn of_text(bytes: &[u8], radius: Option<f32>) -> Result<RawStrands, Flaw> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no text in UTF-8; expected lines `x y z radius`")?;
    let mut read = RawStrands::default();
    let mut length = 0;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.starts_with('#') {
            continue;
        }
        if line.is_empty() {
            if length > 0 {
                read.lengths.push(length);
            }
            length = 0;
            continue;
        }
        let point = point_of(line, radius).ok_or_else(|| {
            let expected = match radius {
                None => "four numbers: x, y, z and radius",
                Some(_) => "x, y, z and perhaps a radius",
            };
            let shown: String = line.chars().take(60).collect();
            Flaw {
                line: Some(number + 1),
                message: format!("\"{shown}\"; expected {expected}"),
            }
        })?;
        read.points.push(point);
        length += 1;
    }
    if length > 0 {
        read.lengths.push(length);
    }
    Ok(read)
}

fn point_of(line: &str, radius: Option<f32>) -> Option<Vec4> {
    let mut words = line.split_ascii_whitespace();
    let mut number = || {
        words
            .next()
            .map(|word| word.parse::<f32>().ok().filter(|x| x.is_finite()))
    };
    let place = Vec3::new(number()??, number()??, number()??);
    let radius = match number() {
        Some(given) => given?,
        None => radius?,
    };
    words.next().is_none().then_some(place.extend(radius))
}

fn of_ply(bytes: &[u8], radius: Option<f32>) -> Result<RawStrands, Flaw> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<DefaultElement>::new()
        .read_header(&mut reader)
        .map_err(|e| e.to_string().lines().next().unwrap_or_default().to_owned())?;
    let mut rest: &[u8] = reader.get_ref();
    let mut read = RawStrands::default();
    let mut counts = None;
    for element in header.elements.values() {
        let rows = Rows::take(element, &header.encoding, &mut rest)?;
        match element.name.as_str() {
            "vertex" => {
                let place = ["x", "y", "z"].map(|name| rows.column(name));
                let [Some(x), Some(y), Some(z)] = place else {
                    return Err("the element `vertex` lacks x, y or z".into());
                };
                let width = ["radius", "r"].iter().find_map(|name| rows.column(name));
                if width.is_none() && radius.is_none() {
                    return Err("the element `vertex` has no `radius`, nor does the scene say one".into());
                }
                let point = |row: usize| {
                    let at = |column: usize| rows.number(row, column) as f32;
                    Vec4::new(at(x), at(y), at(z), width.map_or(radius.unwrap_or(0.0), at))
                };
                read.points = collected((0..element.count).into_par_iter().map(point));
            }
            "curve" => {
                let column = rows
                    .column("vertices")
                    .ok_or("the element `curve` lacks the number `vertices`")?;
                let count = |row: usize| rows.number(row, column);
                let all: Vec<f64> = (0..element.count).map(count).collect();
                let is_whole = |count: &f64| *count >= 0.0 && *count <= MOST_POINTS as f64 && count.fract() == 0.0;
                if let Some(wrong) = all.iter().position(|count| !is_whole(count)) {
                    let message = format!(
                        "curve {wrong} (from zero) has {} vertices; expected a count",
                        all[wrong]
                    );
                    return Err(message.into());
                }
                counts = Some(all.into_iter().map(|count| count as u32).collect::<Vec<_>>());
            }
            _ => {}
        }
    }
    read.lengths = counts.unwrap_or_else(|| vec![read.points.len() as u32]);
    let sum: u64 = read.lengths.iter().map(|length| u64::from(*length)).sum();
    if sum != read.points.len() as u64 {
        let points = read.points.len();
        return Err(format!("its curves have {sum} vertices together; expected {points}, as there are").into());
    }
    Ok(read)
}

/// The rows of an element that has only numbers.
struct Rows<'b> {
    /// By column: name, type, and byte offset in a row.
    columns: Vec<(String, Number, usize)>,
    stride: usize,
    bytes: &'b [u8],
    /// For text: all numbers, row by row.
    numbers: Vec<f64>,
}

impl<'b> Rows<'b> {
    /// Read the rows from the front of `rest`.
    fn take(element: &ElementDef, encoding: &Encoding, rest: &mut &'b [u8]) -> Result<Self, Flaw> {
        let mut rows = Self {
            columns: Vec::new(),
            stride: 0,
            bytes: &[],
            numbers: Vec::new(),
        };
        let order = is_big(encoding);
        for property in element.properties.values() {
            let PropertyType::Scalar(kind) = &property.data_type else {
                return Err(format!(
                    "the property `{}` of the element `{}` is a list; expected numbers alone",
                    property.name, element.name
                )
                .into());
            };
            let number = Number {
                kind: kind.clone(),
                is_big: order.unwrap_or(false),
            };
            rows.columns.push((property.name.clone(), number, rows.stride));
            rows.stride += size(kind);
        }
        let too_short = || {
            let (count, name) = (element.count, &element.name);
            format!("the file is too short for the {count} `{name}` elements it claims")
        };
        if order.is_none() {
            // A number and its separator take at least two bytes.
            let count = (element.count.checked_mul(rows.columns.len())).filter(|count| *count <= rest.len());
            for _ in 0..count.ok_or_else(too_short)? {
                let start = rest
                    .iter()
                    .position(|b| !b.is_ascii_whitespace())
                    .ok_or_else(too_short)?;
                let word = &rest[start..];
                let end = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
                let (word, after) = word.split_at(end);
                let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
                let shown = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
                rows.numbers.push(
                    number.ok_or_else(|| format!("\"{shown}\" in an element `{}`; expected a number", element.name))?,
                );
                *rest = after;
            }
            return Ok(rows);
        }
        let length = rows
            .stride
            .checked_mul(element.count)
            .filter(|length| *length <= rest.len());
        let (bytes, after) = rest.split_at(length.ok_or_else(too_short)?);
        if rows.stride == 0 && element.count > 0 {
            return Err(format!("the element `{}` has no properties", element.name).into());
        }
        rows.bytes = bytes;
        *rest = after;
        Ok(rows)
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|(column, ..)| column == name)
    }

    fn number(&self, row: usize, column: usize) -> f64 {
        if !self.numbers.is_empty() {
            return self.numbers[row * self.columns.len() + column];
        }
        let (_, number, at) = &self.columns[column];
        number.float(&self.bytes[row * self.stride + at..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ply(encoding: &str, elements: &str, body: &[u8]) -> Vec<u8> {
        let mut file = format!("ply\nformat {encoding} 1.0\n{elements}end_header\n").into_bytes();
        file.extend_from_slice(body);
        file
    }

    const VERTICES: &str = "element vertex 3\nproperty float x\nproperty uchar tag\nproperty float y\nproperty double z\n\
                            property float radius\n";
    const CURVES: &str = "element curve 2\nproperty ushort vertices\n";

    #[test]
    fn text_and_ply_say_the_same() {
        let text = b"# two curves\n1 2 3 0.5\n\n\n4 5 6 0.25\n7 8 9 0\n";
        let expected = RawStrands {
            points: vec![
                Vec4::new(1.0, 2.0, 3.0, 0.5),
                Vec4::new(4.0, 5.0, 6.0, 0.25),
                Vec4::new(7.0, 8.0, 9.0, 0.0),
            ],
            lengths: vec![1, 2],
        };
        assert_eq!(RawStrands::read("a.txt", text, None).unwrap(), expected);
        let elements = format!("{VERTICES}{CURVES}");
        let rows = b"1 7 2 3 0.5\n4 0 5 6 0.25\n7 0 8 9 0\n1\n2\n";
        assert_eq!(
            RawStrands::read("a.ply", &ply("ascii", &elements, rows), None).unwrap(),
            expected
        );
        for is_big in [false, true] {
            let mut body = Vec::new();
            for p in &expected.points {
                let (x, y, z, r) = (p.x, p.y, f64::from(p.z), p.w);
                match is_big {
                    true => {
                        body.extend(
                            [
                                x.to_be_bytes().as_slice(),
                                &[9],
                                &y.to_be_bytes(),
                                &z.to_be_bytes(),
                                &r.to_be_bytes(),
                            ]
                            .concat(),
                        );
                    }
                    false => {
                        body.extend(
                            [
                                x.to_le_bytes().as_slice(),
                                &[9],
                                &y.to_le_bytes(),
                                &z.to_le_bytes(),
                                &r.to_le_bytes(),
                            ]
                            .concat(),
                        );
                    }
                }
            }
            for count in [1u16, 2] {
                body.extend(if is_big {
                    count.to_be_bytes()
                } else {
                    count.to_le_bytes()
                });
            }
            let encoding = if is_big {
                "binary_big_endian"
            } else {
                "binary_little_endian"
            };
            let file = ply(encoding, &elements, &body);
            assert_eq!(RawStrands::read("a.PLY", &file, None).unwrap(), expected);
            // Truncated anywhere, it is refused.
            for end in 0..file.len() {
                assert!(RawStrands::read("a.ply", &file[..end], None).is_err(), "{end}");
            }
        }
    }

    #[test]
    fn flaws_are_named() {
        let said = |bytes: &[u8]| {
            let flaw = RawStrands::read("a.txt", bytes, None).unwrap_err();
            (flaw.line, flaw.message)
        };
        for (text, line) in [
            ("1 2 3 1\n1 2 3", 2),
            ("1 2 3 nan", 1),
            ("\n1 2 3 4 5", 2),
            ("1 2 x 4", 1),
        ] {
            let (at, message) = said(text.as_bytes());
            assert!(
                at == Some(line) && message.contains("x, y, z and radius"),
                "{text}: {message}"
            );
        }
        assert!(RawStrands::read("a.txt", b"1 2 3", Some(0.1)).is_ok());
        let strands = |text: &str, basis| {
            let read = RawStrands::read("a.txt", text.as_bytes(), None).unwrap();
            read.to_strands(basis)
                .map(|strands| strands.pieces())
                .map_err(|flaw| flaw.message)
        };
        assert!(strands("1 2 3 -1", Basis::Balls).unwrap_err().contains("radius"));
        assert!(strands("", Basis::Balls).unwrap_err().contains("no points"));
        let three = "1 2 3 1\n2 2 3 1\n3 2 3 1";
        assert!(strands(three, Basis::BSpline).unwrap_err().contains("4 at least"));
        assert_eq!(strands(three, Basis::Linear), Ok(2));
        assert_eq!(strands(three, Basis::CatmullRom), Ok(2));
        assert_eq!(strands(three, Basis::Balls), Ok(3));
        let elements = format!("{VERTICES}{CURVES}");
        let file = ply("ascii", &elements, b"1 7 2 3 0.5\n4 0 5 6 0.25\n7 0 8 9 0\n1\n1\n");
        assert!(
            RawStrands::read("a.ply", &file, None)
                .unwrap_err()
                .message
                .contains("2 vertices")
        );
        let list = "element vertex 1\nproperty list uchar float x\n";
        assert!(RawStrands::read("a.ply", &ply("ascii", list, b"1 2"), None).is_err());
    }
}
