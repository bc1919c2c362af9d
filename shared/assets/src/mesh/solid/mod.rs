//! Meshes as surfaces of solids: what is inside and what is outside.
//!
//! Light enters glass through one face and leaves through another. A face that is missing, duplicated or reversed makes
//! the glass brighter than any light, or darker. If only one solid can be meant, the mesh is mended to its surface;
//! otherwise the error says what is open.

mod boxes;
mod edges;
mod parts;
mod seams;
#[cfg(test)]
mod tests;

use super::RawMesh;
use edges::{Edge, Edges, Side, has_corners, is_balanced};
use glam::DVec3;
use parts::Parts;
use rayon::prelude::*;
use std::hash::{BuildHasher, RandomState};

/// The surface of a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// The mended mesh, facing outwards, if it differs from the original.
    pub mended: Option<RawMesh>,
    /// Duplicate faces that were removed.
    pub doubled: usize,
    /// Faces that were reversed.
    pub turned: usize,
    /// Edges that were cut because several shorter edges meet them.
    pub cut: usize,
    /// Where two parts cross without one being inside the other, in the mesh's own space. Their overlap is bounded
    /// twice. Self-crossing of one part is not detected.
    pub crossing: Option<DVec3>,
}

/// Why a mesh does not bound a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    /// Number of edges at which inside and outside meet.
    pub edges: usize,
    /// The ends of one such edge, in the mesh's own space.
    pub edge: [DVec3; 2],
    /// What is wrong with it.
    pub why: &'static str,
}

impl std::fmt::Display for Opening {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [from, to] = self.edge.map(|p| p.to_array());
        write!(f, "its edge from {from:?} to {to:?} {}", self.why)?;
        match self.edges {
            0 | 1 => Ok(()),
            n => write!(f, ", and {} more", n - 1),
        }
    }
}

impl RawMesh {
    /// The solid that the mesh bounds, or why it does not separate an inside from an outside. Coincident vertices count
    /// as one.
    pub fn solid(&self) -> Result<Solid, Opening> {
        self.solid_of(true)
    }

    /// `sews`: cut edges that meet several shorter ones if that closes the mesh.
    fn solid_of(&self, sews: bool) -> Result<Solid, Opening> {
        let welded = self.weld();
        let at = |v: u32| welded[v as usize];
        let mut faces: Vec<[u32; 3]> = self
            .triangles
            .par_iter()
            .map(|&[a, b, c]| [at(a), at(b), at(c)])
            .collect();
        let vertices = self.positions.len();
        let mut edges = Edges::new(&faces, vertices);
        let (mut doubled, mut is_left_out) = (0, Vec::new());
        if !edges.are_simple {
            is_left_out = repeated(&faces);
            doubled = is_left_out.iter().filter(|out| **out).count();
        }
        if doubled > 0 {
            let left = faces.iter().zip(&is_left_out);
            let left: Vec<_> = left.map(|(face, out)| if *out { LEFT_OUT } else { *face }).collect();
            let of_left = Edges::new(&left, vertices);
            // Where parts are stacked, both touching faces are kept, unless they form a two-sided sheet.
            let is_even = |edge: &Edge| edge.1.len().is_multiple_of(2);
            let is_of_sheet = |(_, sides): Edge| {
                let corners = |side: &Side| sorted(faces[side.face()]);
                sides.len() == 2 && corners(&sides[0]) == corners(&sides[1])
            };
            let is_stacked = || edges.iter().all(|edge| is_even(&edge) && !is_of_sheet(edge));
            if of_left.iter().all(|edge| is_even(&edge)) || !is_stacked() {
                (faces, edges) = (left, of_left);
            } else {
                (doubled, is_left_out) = (0, Vec::new());
            }
        }
        let mut is_turned = match self.is_turned(&faces, &edges) {
            Ok(is_turned) => is_turned,
            Err(opening) => {
                let sewn = if sews { seams::sewn(self, &faces, &edges) } else { None };
                let (sewn, cut) = sewn.ok_or(opening.clone())?;
                let solid = sewn.solid_of(false).map_err(|_| opening)?;
                return Ok(Solid {
                    mended: Some(solid.mended.unwrap_or(sewn)),
                    doubled: doubled + solid.doubled,
                    cut,
                    ..solid
                });
            }
        };
        let parts = Parts::new(self, &faces, &edges, &is_turned);
        let found = parts.find();
        let is_wrong = |face: usize| parts.of(face).is_some_and(|part| found.is_wrong[part]);
        let is_wrong: Vec<bool> = (0..faces.len()).map(is_wrong).collect();
        is_turned
            .iter_mut()
            .zip(is_wrong)
            .for_each(|(turned, wrong)| *turned ^= wrong);
        let turned = is_turned.iter().filter(|turned| **turned).count();
        let mended = (doubled + turned > 0).then(|| {
            let mut mesh = self.clone();
            for (triangle, turned) in mesh.triangles.iter_mut().zip(&is_turned) {
                if *turned {
                    triangle.swap(1, 2);
                }
            }
            if doubled > 0 {
                let kept = std::mem::take(&mut mesh.triangles).into_iter().zip(is_left_out);
                mesh.replace_triangles(kept.map(|(triangle, out)| (!out).then_some(triangle)));
            }
            mesh
        });
        Ok(Solid {
            mended,
            doubled,
            turned,
            cut: 0,
            crossing: found.crossing,
        })
    }

    /// For each vertex, the first vertex at its position.
    fn weld(&self) -> Vec<u32> {
        const FREE: u32 = u32::MAX;
        // Adding zero turns -0 into +0.
        let key = |v: u32| (self.positions[v as usize] + 0.0).to_array().map(f64::to_bits);
        // A hash table of indices only, since the keys are already in `positions`.
        let mut table = vec![FREE; (2 * self.positions.len()).next_power_of_two()];
        let last = table.len() - 1;
        let hasher = RandomState::new();
        let first = |v: u32| {
            let position = key(v);
            let mut place = hasher.hash_one(position) as usize & last;
            loop {
                match table[place] {
                    FREE => {
                        table[place] = v;
                        return v;
                    }
                    first if key(first) == position => return first,
                    _ => place = (place + 1) & last,
                }
            }
        };
        (0..self.positions.len() as u32).map(first).collect()
    }

    /// Which faces to reverse so that neighbours have consistent winding.
    fn is_turned(&self, faces: &[[u32; 3]], edges: &Edges) -> Result<Vec<bool>, Opening> {
        let opening = |bad: Vec<Edge>, why| {
            let (low, sides) = bad[0];
            Err(Opening {
                edges: bad.len(),
                edge: [low, sides[0].high()].map(|v| self.positions[v as usize]),
                why,
            })
        };
        let mut is_turned = vec![false; faces.len()];
        if edges.are_simple {
            return Ok(is_turned);
        }
        let odd: Vec<_> = edges.iter().filter(|(_, sides)| sides.len() % 2 == 1).collect();
        if let Some((_, first)) = odd.first() {
            let why = match first.len() {
                1 => "belongs to one triangle only",
                _ => "belongs to an odd number of triangles",
            };
            return opening(odd, why);
        }
        if edges.iter().all(|edge| is_balanced(&edge)) {
            return Ok(is_turned);
        }
        let mixed: Vec<_> = edges.iter().filter(|edge| !is_balanced(edge)).collect();
        let why = "belongs to triangles that wind in different directions";
        if edges.iter().any(|(_, sides)| sides.len() > 2) {
            return opening(mixed, why);
        }
        // Spread from face to face over edges with two faces.
        let mut neighbours: Vec<(usize, usize, bool)> = (edges.iter())
            .flat_map(|(_, sides)| {
                let [one, other] = [sides[0], sides[1]];
                let differs = one.is_up() == other.is_up();
                [(one.face(), other.face(), differs), (other.face(), one.face(), differs)]
            })
            .collect();
        neighbours.par_sort_unstable();
        let mut is_seen = vec![false; faces.len()];
        let mut waiting = Vec::new();
        for first in 0..faces.len() {
            if std::mem::replace(&mut is_seen[first], true) {
                continue;
            }
            waiting.push(first);
            while let Some(face) = waiting.pop() {
                let from = neighbours.partition_point(|n| n.0 < face);
                for &(_, other, differs) in neighbours[from..].iter().take_while(|n| n.0 == face) {
                    let turned = is_turned[face] != differs;
                    if !std::mem::replace(&mut is_seen[other], true) {
                        is_turned[other] = turned;
                        waiting.push(other);
                    } else if is_turned[other] != turned {
                        return opening(mixed, why);
                    }
                }
            }
        }
        Ok(is_turned)
    }
}

fn sorted(mut corners: [u32; 3]) -> [u32; 3] {
    corners.sort_unstable();
    corners
}

/// Which faces repeat the corners of an earlier face.
fn repeated(faces: &[[u32; 3]]) -> Vec<bool> {
    let numbered = |(number, face): (usize, &[u32; 3])| (sorted(*face), number as u32);
    let mut all: Vec<([u32; 3], u32)> = faces.par_iter().enumerate().map(numbered).collect();
    all.par_sort_unstable();
    let mut repeated = vec![false; faces.len()];
    for pair in all.windows(2) {
        repeated[pair[1].1 as usize] = pair[0].0 == pair[1].0 && has_corners(pair[1].0);
    }
    repeated
}

/// Replaces a duplicate face; it is degenerate and so has no edges.
const LEFT_OUT: [u32; 3] = [0; 3];

/// Whether a ray from the origin hits a triangle.
pub fn meets([a, b, c]: [DVec3; 3], along: DVec3) -> bool {
    let normal = (b - a).cross(c - a);
    // On which side of each edge the ray passes.
    let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|plane| plane.dot(along) > 0.0);
    let is_ahead = (normal.dot(a) > 0.0) == (normal.dot(along) > 0.0);
    sides[0] == sides[1] && sides[1] == sides[2] && is_ahead
}
