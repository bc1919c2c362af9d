//! Files that random scenes name: small meshes, heights, skies, and grids.

use super::draw::Draw;
use glam::DVec3;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// A file of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    /// Its name in the scene.
    pub name: String,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// A mesh of triangles.
struct Mesh {
    points: Vec<DVec3>,
    faces: Vec<[usize; 3]>,
}

/// A closed mesh within the unit ball, as an ASCII PLY: a ball of two to four rings, dented, with or without normals.
pub fn closed_mesh(draw: &mut Draw, with_normals: bool) -> Vec<u8> {
    let (rings, columns) = (draw.pick(&[1, 2, 4]), draw.pick(&[3, 4, 7]));
    let dents = draw.between(0.0, 0.3);
    let mut points = vec![DVec3::Y];
    for ring in 1..=rings {
        let (sin, cos) = libm::sincos(PI * ring as f64 / (rings + 1) as f64);
        for column in 0..columns {
            let (s, c) = libm::sincos(TAU * column as f64 / columns as f64);
            points.push(DVec3::new(sin * c, cos, sin * s) * (1.0 - dents * draw.unit()));
        }
    }
    points.push(-DVec3::Y);
    let last = points.len() - 1;
    let at = |ring: usize, column: usize| match ring {
        0 => 0,
        ring if ring > rings => last,
        ring => 1 + (ring - 1) * columns + column % columns,
    };
    let mut faces = Vec::new();
    for ring in 0..=rings {
        for column in 0..columns {
            let [a, b] = [at(ring, column), at(ring, column + 1)];
            let [c, d] = [at(ring + 1, column), at(ring + 1, column + 1)];
            if a != b {
                faces.push([a, b, c]);
            }
            if c != d {
                faces.push([b, d, c]);
            }
        }
    }
    let mesh = Mesh { points, faces };
    mesh.ply(with_normals.then(|| mesh.points.iter().map(|p| p.normalize()).collect()))
}

/// An open mesh within the unit square of the xy plane, facing +z: waves, with or without their normals.
pub fn waves(draw: &mut Draw, with_normals: bool) -> Vec<u8> {
    let cells = draw.pick(&[3, 6]);
    let (height, k) = (draw.between(0.02, 0.15), draw.between(2.0, 5.0));
    let mut points = Vec::new();
    let mut normals = Vec::new();
    for row in 0..=cells {
        for column in 0..=cells {
            let x = 2.0 * column as f64 / cells as f64 - 1.0;
            let y = 2.0 * row as f64 / cells as f64 - 1.0;
            let (sin_x, cos_x) = libm::sincos(k * x);
            let (sin_y, cos_y) = libm::sincos(k * y);
            points.push(DVec3::new(x, y, height * sin_x * cos_y));
            let slope = DVec3::new(cos_x * cos_y, -sin_x * sin_y, 0.0) * (k * height);
            normals.push((DVec3::Z - slope).normalize());
        }
    }
    let at = |row: usize, column: usize| row * (cells + 1) + column;
    let mut faces = Vec::new();
    for row in 0..cells {
        for column in 0..cells {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            faces.extend([[a, b, d], [a, d, c]]);
        }
    }
    Mesh { points, faces }.ply(with_normals.then_some(normals))
}

impl Mesh {
    fn ply(&self, normals: Option<Vec<DVec3>>) -> Vec<u8> {
        let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", self.points.len());
        let own = match &normals {
            Some(_) => ["x", "y", "z", "nx", "ny", "nz"].as_slice(),
            None => ["x", "y", "z"].as_slice(),
        };
        for property in own {
            let _ = writeln!(text, "property float {property}");
        }
        let _ = writeln!(text, "element face {}", self.faces.len());
        text.push_str("property list uchar int vertex_indices\nend_header\n");
        for (i, p) in self.points.iter().enumerate() {
            let _ = write!(text, "{:.5} {:.5} {:.5}", p.x, p.y, p.z);
            if let Some(n) = normals.as_ref().map(|normals| normals[i]) {
                let _ = write!(text, " {:.5} {:.5} {:.5}", n.x, n.y, n.z);
            }
            text.push('\n');
        }
        for [a, b, c] in &self.faces {
            let _ = writeln!(text, "3 {a} {b} {c}");
        }
        text.into_bytes()
    }
}

/// Heights from 0 to 1, or opacities, periodic, as a Radiance HDR picture.
pub fn relief(draw: &mut Draw) -> Vec<u8> {
    let (kx, ky) = (draw.pick(&[1.0, 2.0]), draw.pick(&[1.0, 3.0]));
    let phase = draw.between(0.0, TAU);
    hdr(16, 16, |x, y| {
        let angle = TAU * (kx * x + phase) + libm::sin(TAU * ky * y);
        [0.5 + 0.4 * libm::sin(angle); 3]
    })
}

/// A sky of smooth colours with a sun of some width that has `sun` times their radiance, as a Radiance HDR picture.
pub fn sky(draw: &mut Draw, sun: f64) -> Vec<u8> {
    let zenith = draw.channels(0.2, 1.0);
    let ground = draw.channels(0.05, 0.5);
    let mut towards = draw.direction();
    towards.y = towards.y.abs();
    let cos_width = draw.between(0.9, 0.98);
    hdr(32, 16, |x, y| {
        let (sin, cos) = libm::sincos(PI * y);
        let (s, c) = libm::sincos(TAU * x);
        // The top row is +y, the middle column +z.
        let dir = DVec3::new(-sin * s, cos, -sin * c);
        let up = 0.5 + 0.5 * cos;
        let shine = if dir.dot(towards) > cos_width { sun } else { 1.0 };
        std::array::from_fn(|i| shine * (up * zenith[i] + (1.0 - up) * ground[i]))
    })
}

/// A picture of the values at pixel centres in the unit square, the first row on top.
fn hdr(width: usize, height: usize, value: impl Fn(f64, f64) -> [f64; 3]) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for row in 0..height {
        for column in 0..width {
            let x = (column as f64 + 0.5) / width as f64;
            let rgb = value(x, (row as f64 + 0.5) / height as f64);
            let max = rgb.into_iter().fold(1e-9, f64::max);
            let (_, exponent) = libm::frexp(max);
            let scale = libm::ldexp(256.0, -exponent);
            bytes.extend(rgb.map(|v| (v * scale) as u8));
            bytes.push((exponent + 128) as u8);
        }
    }
    bytes
}

/// A Mitsuba `.vol` of 6 x 5 x 4 samples from `low` to `high`, of one channel or three.
pub fn grid(draw: &mut Draw, channels: usize, low: f64, high: f64) -> Vec<u8> {
    let size = [6usize, 5, 4];
    let mut bytes = b"VOL\x03".to_vec();
    for int in [1, size[0], size[1], size[2], channels] {
        bytes.extend((int as i32).to_le_bytes());
    }
    for bound in [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0] {
        bytes.extend(bound.to_le_bytes());
    }
    for _ in 0..size.iter().product::<usize>() * channels {
        bytes.extend((draw.between(low, high) as f32).to_le_bytes());
    }
    bytes
}
