//! Subdivides meshes and displaces their vertices.
//!
//! Whether an edge is halved, and where its midpoint lies, depends only on the positions of its ends. So the triangles
//! on both sides agree, even if they have separate vertices there, as at UV seams. Vertices at one position move the
//! same way. A closed mesh therefore stays closed.

use super::RawMesh;
use beamfarm_render::parallel::collected;
use glam::{DAffine3, DVec2, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// A vertex before displacement.
#[derive(Clone, Copy, Debug)]
pub struct Unmoved {
    /// In the mesh's own space.
    pub position: DVec3,
    /// Unit normal in the mesh's own space: the direction of displacement.
    pub normal: DVec3,
    /// Zero if it has none.
    pub uv: DVec2,
}

/// The result of a subdivision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cutting {
    /// Whether the limit on triangles was reached before all edges were short enough.
    pub is_cut_short: bool,
}

/// A position as a key, so that coincident vertices are one.
type Key = [u64; 3];

fn key(p: DVec3) -> Key {
    // Adding zero turns -0 into +0.
    (p + 0.0).to_array().map(f64::to_bits)
}

impl RawMesh {
    /// The mesh with edges halved until `longest` finds none too long by its two ends, or until there would be more
    /// than `most` triangles. Colours and material names are kept.
    pub fn subdivided(&self, longest: impl Fn(DVec3, DVec3) -> bool + Sync, most: usize) -> (Self, Cutting) {
        let mut mesh = self.clone();
        mesh.cuts = Vec::new();
        loop {
            let is_long = |a: u32, b: u32| {
                let [a, b] = [a, b].map(|v| mesh.positions[v as usize]);
                a != b && longest(a, b)
            };
            let marks: Vec<[bool; 3]> = collected(
                mesh.triangles
                    .par_iter()
                    .map(|[a, b, c]| [is_long(*a, *b), is_long(*b, *c), is_long(*c, *a)]),
            );
            let more: usize = marks
                .iter()
                .map(|marks| marks.iter().filter(|mark| **mark).count())
                .sum();
            if more == 0 {
                return (mesh, Cutting { is_cut_short: false });
            }
            if mesh.triangles.len() + more > most {
                return (mesh, Cutting { is_cut_short: true });
            }
            mesh = mesh.halved(&marks, more);
        }
    }

    /// Halve the marked edges of triangles: from corner 0 to 1, 1 to 2 and 2 to 0.
    fn halved(mut self, marks: &[[bool; 3]], more: usize) -> Self {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut triangles = Vec::with_capacity(self.triangles.len() + more);
        let mut materials = Vec::with_capacity(self.materials.len());
        let mut named = std::mem::take(&mut self.materials).into_iter().peekable();
        for (number, ([a, b, c], marks)) in std::mem::take(&mut self.triangles).into_iter().zip(marks).enumerate() {
            while let Some((_, name)) = named.next_if(|(first, _)| *first <= number) {
                materials.push((triangles.len(), name));
            }
            let mut middle = |from: u32, to: u32| {
                *middles
                    .entry((from.min(to), from.max(to)))
                    .or_insert_with(|| self.add_middle(from, to))
            };
            // First comes the corner opposite the only edge that is kept, or halved.
            match marks {
                [false, false, false] => triangles.push([a, b, c]),
                [true, true, true] => {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                }
                [true, false, false] => triangles.extend(in_two([c, a, b], middle(a, b))),
                [false, true, false] => triangles.extend(in_two([a, b, c], middle(b, c))),
                [false, false, true] => triangles.extend(in_two([b, c, a], middle(c, a))),
                [false, true, true] => triangles.extend(in_three([c, a, b], middle(c, a), middle(b, c))),
                [true, false, true] => triangles.extend(in_three([a, b, c], middle(a, b), middle(c, a))),
                [true, true, false] => triangles.extend(in_three([b, c, a], middle(b, c), middle(a, b))),
            }
        }
        self.triangles = triangles;
        self.materials = materials;
        self
    }

    fn add_middle(&mut self, a: u32, b: u32) -> u32 {
        let [a, b] = [a, b].map(|v| v as usize);
        let number = self.positions.len() as u32;
        self.positions.push(0.5 * (self.positions[a] + self.positions[b]));
        if !self.normals.is_empty() {
            let mean = self.normals[a] + self.normals[b];
            self.normals.push(mean.try_normalize().unwrap_or(self.normals[a]));
        }
        if !self.uvs.is_empty() {
            self.uvs.push(0.5 * (self.uvs[a] + self.uvs[b]));
        }
        if !self.colors.is_empty() {
            self.colors.push(0.5 * (self.colors[a] + self.colors[b]));
        }
        if !self.tangents.is_empty() {
            let along = 0.5 * (self.tangents[a] + self.tangents[b]).truncate();
            self.tangents.push(along.extend(self.tangents[a].w));
        }
        number
    }

    /// The mesh with each vertex displaced along its normal by a height in its own space, and with new normals.
    /// Coincident vertices share one normal and the mean of their heights. `map`: to the space in which angles are
    /// measured.
    pub fn displaced(&self, height: impl Fn(&Unmoved) -> f64 + Sync, map: &DAffine3) -> Self {
        let mut mesh = self.clone();
        let (places, count) = self.places();
        let of_place = |vectors: &[DVec3]| {
            let mut sums = vec![DVec3::ZERO; count];
            for (place, vector) in places.iter().zip(vectors) {
                sums[*place as usize] += *vector;
            }
            let unit: Vec<DVec3> = sums.into_iter().map(DVec3::normalize_or_zero).collect();
            unit
        };
        let own = match self.normals.is_empty() {
            true => self.smooth_normals(map),
            false => self.normals.clone(),
        };
        let normals = of_place(&own);
        let heights: Vec<f64> = collected((0..self.positions.len()).into_par_iter().map(|v| {
            height(&Unmoved {
                position: self.positions[v],
                normal: normals[places[v] as usize],
                uv: self.uvs.get(v).copied().unwrap_or_default(),
            })
        }));
        let mut sums = vec![(0.0, 0u32); count];
        for (place, height) in places.iter().zip(&heights) {
            let sum = &mut sums[*place as usize];
            *sum = (sum.0 + height, sum.1 + 1);
        }
        for (position, place) in mesh.positions.iter_mut().zip(&places) {
            let (sum, vertices) = sums[*place as usize];
            *position += normals[*place as usize] * (sum / f64::from(vertices));
        }
        let normals = of_place(&mesh.smooth_normals(map));
        mesh.normals = places.iter().map(|place| normals[*place as usize]).collect();
        mesh.repair_normals();
        mesh
    }

    /// Position numbers by vertex, and the number of positions.
    fn places(&self) -> (Vec<u32>, usize) {
        let mut known = BTreeMap::new();
        let places = self.positions.iter().map(|p| {
            let next = known.len() as u32;
            *known.entry(key(*p)).or_insert(next)
        });
        let places = places.collect();
        (places, known.len())
    }
}

/// A triangle whose edge opposite its first corner is halved.
fn in_two([a, b, c]: [u32; 3], middle: u32) -> [[u32; 3]; 2] {
    [[a, b, middle], [a, middle, c]]
}

/// A triangle whose two edges at its first corner are halved.
fn in_three([a, b, c]: [u32; 3], ab: u32, ca: u32) -> [[u32; 3]; 3] {
    [[a, ab, ca], [ab, b, c], [ab, c, ca]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether each edge is passed equally often in both directions, by position.
    fn is_closed(mesh: &RawMesh) -> bool {
        mesh.to_mesh(&DAffine3::IDENTITY, false, &[]).is_closed()
    }

    fn volume(mesh: &RawMesh) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        mesh.triangles.iter().map(of).sum()
    }

    /// The cube, whose faces have separate vertices and UVs, is displaced to a ball.
    fn ball(edge: f64) -> RawMesh {
        let cube = RawMesh::cube();
        let (mut mesh, cutting) = cube.subdivided(|a, b| a.distance(b) > edge, 1 << 20);
        assert!(!cutting.is_cut_short);
        for position in &mut mesh.positions {
            *position = position.normalize();
        }
        mesh
    }

    #[test]
    fn closed_stays_closed_over_seams() {
        let cube = RawMesh::cube();
        // Edges of all lengths, so that every way of splitting a triangle occurs.
        for longest in [1.1, 0.5, 0.2] {
            let is_long = |a: DVec3, b: DVec3| a.distance(b) > longest * (1.3 + 0.5 * (a + b).x);
            let (mesh, _) = cube.subdivided(is_long, 1 << 20);
            assert!(is_closed(&mesh) && mesh.triangles.len() > 12);
            assert!((volume(&mesh) - 8.0).abs() < 1e-9);
            assert!((mesh.area(&DAffine3::IDENTITY) - 24.0).abs() < 1e-9);
            // UVs differ on the two sides of a seam.
            let moved = mesh.displaced(
                |at| 0.1 * libm::sin(9.0 * at.uv.x) + 0.05 * at.uv.y,
                &DAffine3::IDENTITY,
            );
            assert!(is_closed(&moved));
            assert_ne!(moved.positions, mesh.positions);
        }
    }

    /// A ball displaced uniformly is a larger ball; displaced by waves, it has a known volume.
    #[test]
    fn balls_have_the_volume_that_they_should() {
        let ball = ball(0.03);
        let pi = std::f64::consts::PI;
        let grown = ball.displaced(|_| 0.5, &DAffine3::IDENTITY);
        assert!(is_closed(&grown));
        assert!((volume(&grown) / (4.0 / 3.0 * pi * 3.375) - 1.0).abs() < 2e-3);
        assert!((grown.area(&DAffine3::IDENTITY) / (4.0 * pi * 2.25) - 1.0).abs() < 2e-3);
        for (p, n) in grown.positions.iter().zip(&grown.normals) {
            assert!(p.normalize().dot(*n) > 0.999);
        }
        // r = 1 + a z^2: the integral of r^3 / 3 over the sphere is 4 pi / 3 (1 + a + 3 a^2 / 5 + a^3 / 7).
        let a = 0.4;
        let waved = ball.displaced(|at| a * at.position.z * at.position.z, &DAffine3::IDENTITY);
        let expected = 4.0 / 3.0 * pi * (1.0 + a + 0.6 * a * a + a * a * a / 7.0);
        assert!(
            (volume(&waved) / expected - 1.0).abs() < 2e-3,
            "{} {expected}",
            volume(&waved)
        );
    }

    #[test]
    fn there_are_no_more_triangles_than_asked_for() {
        let (mesh, cutting) = RawMesh::cube().subdivided(|a, b| a.distance(b) > 1e-3, 1000);
        assert!(cutting.is_cut_short && mesh.triangles.len() <= 1000 && is_closed(&mesh));
    }
}
