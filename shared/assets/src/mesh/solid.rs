//! Meshes as the surfaces of solids: what is inside of them, and what is outside.
//!
//! Glass is what light enters through one face and leaves through another. A face that is missing, there twice, or
//! turned the wrong way makes it brighter than any light, or darker. Where only one solid can be meant, its surface is
//! made; else it is told what is open.

use super::RawMesh;
use glam::DVec3;
use rayon::prelude::*;

/// The surface of a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// The mesh that bounds it, facing outwards, if that is not the one that was looked at.
    pub mended: Option<RawMesh>,
    /// Faces that stood there more than once, and are left out of it.
    pub doubled: usize,
    /// Faces that are turned around in it.
    pub turned: usize,
}

/// Why a mesh is no surface of a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    /// Edges at which inside and outside meet.
    pub edges: usize,
    /// Ends of one of them, in the mesh's own space.
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

/// Rays that have to agree on what is inside; along no axis or diagonal, where edges often lie.
const RAYS: [DVec3; 3] = [
    DVec3::new(0.31, 0.87, 0.38),
    DVec3::new(-0.79, 0.21, 0.57),
    DVec3::new(0.13, -0.67, -0.73),
];
/// Which part is inside of which is looked for among so many at most.
const MOST_PARTS: usize = 200;

/// An edge of a triangle: its lower and its higher vertex, whether the triangle goes upwards, and which that is.
type Edge = (u32, u32, bool, u32);

impl RawMesh {
    /// The solid that the mesh bounds, or why it does not separate an inside from an outside. Vertices at one position
    /// are one.
    pub fn solid(&self) -> Result<Solid, Opening> {
        let welded = self.weld();
        let mut faces: Vec<[u32; 3]> = self
            .triangles
            .par_iter()
            .map(|t| t.map(|v| welded[v as usize]))
            .collect();
        let mut edges = edges_of(&faces);
        let is_simple = |edges: &[Edge]| edges.chunk_by(is_same).all(|edge| edge.len() == 2 && is_balanced(edge));
        let (mut doubled, mut is_left_out) = (0, Vec::new());
        if !is_simple(&edges) {
            is_left_out = repeated(&faces);
            doubled = is_left_out.iter().filter(|out| **out).count();
            if doubled > 0 {
                // Of one corner: no edge is left.
                (faces.iter_mut().zip(&is_left_out)).for_each(|(face, out)| *face = if *out { [0; 3] } else { *face });
                edges = edges_of(&faces);
            }
        }
        let mut is_turned = self.is_turned(&faces, &edges)?;
        let mut parts = Parts::new(faces.len(), &edges);
        self.face_outwards(&faces, &mut parts, &mut is_turned);
        let turned = is_turned.iter().filter(|turned| **turned).count();
        let mended = (doubled + turned > 0).then(|| {
            let mut mesh = self.clone();
            for (triangle, turned) in mesh.triangles.iter_mut().zip(&is_turned) {
                if *turned {
                    triangle.swap(1, 2);
                }
            }
            let mut left_out = is_left_out.iter().copied().chain(std::iter::repeat(false));
            mesh.triangles.retain(|_| !left_out.next().unwrap_or(false));
            mesh
        });
        Ok(Solid {
            mended,
            doubled,
            turned,
        })
    }

    /// Which faces are to be turned so that all that share an edge wind alike.
    fn is_turned(&self, faces: &[[u32; 3]], edges: &[Edge]) -> Result<Vec<bool>, Opening> {
        let opening = |bad: Vec<&[Edge]>, why| {
            let (from, to, ..) = bad[0][0];
            Err(Opening {
                edges: bad.len(),
                edge: [from, to].map(|v| self.positions[v as usize]),
                why,
            })
        };
        let all = || edges.chunk_by(is_same);
        let odd: Vec<_> = all().filter(|edge| edge.len() % 2 == 1).collect();
        if let Some(first) = odd.first() {
            let why = match first.len() {
                1 => "belongs to one triangle only",
                _ => "belongs to an odd number of triangles",
            };
            return opening(odd, why);
        }
        let mut is_turned = vec![false; faces.len()];
        if all().all(is_balanced) {
            return Ok(is_turned);
        }
        let mixed: Vec<_> = all().filter(|edge| !is_balanced(edge)).collect();
        let why = "belongs to triangles that wind in different directions";
        if all().any(|edge| edge.len() > 2) {
            return opening(mixed, why);
        }
        // From face to face, over edges that have two each.
        let mut neighbours: Vec<(u32, u32, bool)> = all()
            .flat_map(|edge| {
                let ((.., up, face), (.., other_up, other)) = (edge[0], edge[1]);
                [(face, other, up == other_up), (other, face, up == other_up)]
            })
            .collect();
        neighbours.sort_unstable();
        let mut is_seen = vec![false; faces.len()];
        let mut waiting = Vec::new();
        for first in 0..faces.len() as u32 {
            if std::mem::replace(&mut is_seen[first as usize], true) {
                continue;
            }
            waiting.push(first);
            while let Some(face) = waiting.pop() {
                let from = neighbours.partition_point(|n| n.0 < face);
                for &(_, other, differs) in neighbours[from..].iter().take_while(|n| n.0 == face) {
                    let turned = is_turned[face as usize] != differs;
                    if !std::mem::replace(&mut is_seen[other as usize], true) {
                        is_turned[other as usize] = turned;
                        waiting.push(other);
                    } else if is_turned[other as usize] != turned {
                        return opening(mixed, why);
                    }
                }
            }
        }
        Ok(is_turned)
    }

    /// Turns parts so that what is inside of them is inside, or outside where they are hollows of others.
    fn face_outwards(&self, faces: &[[u32; 3]], parts: &mut Parts, is_turned: &mut [bool]) {
        let number = parts.numbers();
        let count = number.iter().max().map_or(0, |most| *most as usize + 1);
        let mut all = vec![Part::EMPTY; count];
        for (face, &part) in faces.iter().zip(&number) {
            let corners = face.map(|v| self.positions[v as usize]);
            all[part as usize].add(corners);
        }
        for ((face, &part), turned) in faces.iter().zip(&number).zip(is_turned.iter()) {
            let part = &mut all[part as usize];
            let [a, b, c] = face.map(|v| self.positions[v as usize] - part.middle());
            let volume = a.dot(b.cross(c));
            part.volume += if *turned { -volume } else { volume };
        }
        let is_in = |inner: &Part, outer: usize| {
            all[outer].holds(inner)
                && RAYS.iter().all(|ray| {
                    let mine = faces.iter().zip(&number).filter(|(_, part)| **part as usize == outer);
                    let met =
                        mine.filter(|(face, _)| meets(face.map(|v| self.positions[v as usize] - inner.corner), *ray));
                    met.count() % 2 == 1
                })
        };
        let is_hollow: Vec<bool> = (0..count)
            .map(|part| {
                let others = (0..if count <= MOST_PARTS { count } else { 0 }).filter(|other| *other != part);
                others.filter(|other| is_in(&all[part], *other)).count() % 2 == 1
            })
            .collect();
        // What is inside of what takes too long to find among many: only the whole is turned then.
        let is_inside_out = all.iter().map(|part| part.volume).sum::<f64>() < 0.0;
        let is_wrong = |part: usize| match count <= MOST_PARTS {
            true => all[part].volume != 0.0 && (all[part].volume < 0.0) != is_hollow[part],
            false => is_inside_out,
        };
        let is_wrong: Vec<bool> = (0..count).map(is_wrong).collect();
        for (turned, &part) in is_turned.iter_mut().zip(&number) {
            *turned ^= is_wrong[part as usize];
        }
    }
}

/// What hangs together in a mesh.
#[derive(Clone, Copy)]
struct Part {
    low: DVec3,
    high: DVec3,
    /// One of its corners.
    corner: DVec3,
    /// Six times the volume, negative where it faces inwards.
    volume: f64,
}

impl Part {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        corner: DVec3::ZERO,
        volume: 0.0,
    };

    fn add(&mut self, corners: [DVec3; 3]) {
        for p in corners {
            (self.low, self.high, self.corner) = (self.low.min(p), self.high.max(p), p);
        }
    }

    fn middle(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    fn holds(&self, other: &Self) -> bool {
        self.low.cmplt(other.low).all() && self.high.cmpgt(other.high).all()
    }
}

/// Faces that share edges, by union and find.
struct Parts(Vec<u32>);

impl Parts {
    fn new(faces: usize, edges: &[Edge]) -> Self {
        let mut parts = Self((0..faces as u32).collect());
        for edge in edges.chunk_by(is_same) {
            for pair in edge.windows(2) {
                let [a, b] = [pair[0].3, pair[1].3].map(|face| parts.root(face));
                parts.0[a.max(b) as usize] = a.min(b);
            }
        }
        parts
    }

    fn root(&mut self, mut face: u32) -> u32 {
        while self.0[face as usize] != face {
            let above = self.0[self.0[face as usize] as usize];
            self.0[face as usize] = above;
            face = above;
        }
        face
    }

    /// By face the number of its part, from zero, in the order of the parts' first faces.
    fn numbers(&mut self) -> Vec<u32> {
        let mut numbers = vec![u32::MAX; self.0.len()];
        let mut next = 0;
        for face in 0..self.0.len() as u32 {
            let root = self.root(face) as usize;
            if numbers[root] == u32::MAX {
                numbers[root] = next;
                next += 1;
            }
            numbers[face as usize] = numbers[root];
        }
        numbers
    }
}

/// The edges of triangles, those between the same vertices one after the other.
fn edges_of(faces: &[[u32; 3]]) -> Vec<Edge> {
    let of_face = |(number, face): (usize, &[u32; 3])| {
        let [a, b, c] = *face;
        [(a, b), (b, c), (c, a)].map(|(from, to)| (from.min(to), from.max(to), from < to, number as u32))
    };
    let mut edges: Vec<Edge> = faces.par_iter().enumerate().flat_map_iter(of_face).collect();
    edges.retain(|(from, to, ..)| from != to);
    edges.par_sort_unstable();
    edges
}

fn is_same(one: &Edge, other: &Edge) -> bool {
    (one.0, one.1) == (other.0, other.1)
}

/// As many triangles go one way along it as the other.
fn is_balanced(edge: &[Edge]) -> bool {
    2 * edge.iter().filter(|e| e.2).count() == edge.len()
}

/// Which faces have the corners of one before them.
fn repeated(faces: &[[u32; 3]]) -> Vec<bool> {
    let sorted = |(number, face): (usize, &[u32; 3])| {
        let mut corners = *face;
        corners.sort_unstable();
        (corners, number as u32)
    };
    let mut all: Vec<([u32; 3], u32)> = faces.par_iter().enumerate().map(sorted).collect();
    all.par_sort_unstable();
    let mut repeated = vec![false; faces.len()];
    for pair in all.windows(2) {
        // Of two corners they are no faces at all.
        let [a, b, c] = pair[1].0;
        repeated[pair[1].1 as usize] = pair[0].0 == pair[1].0 && a != b && b != c;
    }
    repeated
}

/// Whether a ray from the origin meets a triangle.
pub fn meets([a, b, c]: [DVec3; 3], along: DVec3) -> bool {
    let normal = (b - a).cross(c - a);
    // On which side of each edge the ray passes.
    let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|plane| plane.dot(along) > 0.0);
    let is_ahead = (normal.dot(a) > 0.0) == (normal.dot(along) > 0.0);
    sides[0] == sides[1] && sides[1] == sides[2] && is_ahead
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube_at(center: DVec3, half: f64) -> RawMesh {
        let mut cube = RawMesh::cube();
        cube.positions.iter_mut().for_each(|p| *p = center + half * *p);
        cube
    }

    fn turned_inside_out(mut mesh: RawMesh) -> RawMesh {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh
    }

    fn joined(meshes: &[RawMesh]) -> RawMesh {
        let mut all = RawMesh::default();
        for mesh in meshes {
            let first = all.positions.len() as u32;
            all.positions.extend(&mesh.positions);
            all.triangles
                .extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        all
    }

    /// Six times the volume.
    fn volume(mesh: &RawMesh) -> f64 {
        let of_face = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            a.dot(b.cross(c))
        };
        mesh.triangles.iter().map(of_face).sum()
    }

    fn mended(mesh: &RawMesh, doubled: usize, turned: usize) -> RawMesh {
        let solid = mesh.solid().unwrap();
        assert_eq!((solid.doubled, solid.turned), (doubled, turned));
        solid.mended.unwrap_or_else(|| mesh.clone())
    }

    #[test]
    fn what_can_be_one_solid_only_becomes_it() {
        let cube = cube_at(DVec3::new(7.0, -3.0, 2.0), 1.0);
        let is_the_cube = |mesh: &RawMesh| assert!((volume(mesh) - 48.0).abs() < 1e-9, "{}", volume(mesh));
        assert_eq!(mended(&cube, 0, 0), cube);
        is_the_cube(&mended(&turned_inside_out(cube.clone()), 0, 12));
        for faces in [vec![3], vec![0, 1, 2, 8], (0..11).collect()] {
            let mut mixed = cube.clone();
            faces.iter().for_each(|f: &usize| mixed.triangles[*f].swap(1, 2));
            is_the_cube(&mended(&mixed, 0, faces.len()));
            // And a face that stands there twice, once each way.
            let [a, b, c] = mixed.triangles[5];
            mixed.triangles.push([b, a, c]);
            mixed.triangles.push([c, a, b]);
            is_the_cube(&mended(&mixed, 2, faces.len()));
        }
        // All of it doubled, either way.
        for other in [cube.clone(), turned_inside_out(cube.clone())] {
            is_the_cube(&mended(&joined(&[cube.clone(), other]), 12, 0));
        }
        // Two that touch along an edge.
        let beside = joined(&[cube.clone(), cube_at(DVec3::new(9.0, -1.0, 2.0), 1.0)]);
        assert_eq!(mended(&beside, 0, 0), beside);
    }

    #[test]
    fn hollows_face_inwards_and_islands_outwards() {
        let (outer, inner) = (cube_at(DVec3::ZERO, 3.0), cube_at(DVec3::splat(0.2), 1.0));
        let core = cube_at(DVec3::splat(0.2), 0.5);
        let apart = cube_at(DVec3::X * 9.0, 1.0);
        let hollow = joined(&[outer.clone(), turned_inside_out(inner.clone())]);
        assert_eq!(mended(&hollow, 0, 0), hollow);
        assert!((volume(&mended(&joined(&[outer.clone(), inner.clone()]), 0, 12)) - 48.0 * 26.0).abs() < 1e-9);
        let all = joined(&[core, turned_inside_out(outer), inner, turned_inside_out(apart)]);
        let volume = volume(&mended(&all, 0, 36));
        assert!((volume - 48.0 * (27.0 - 1.0 + 0.125 + 1.0)).abs() < 1e-9, "{volume}");
    }

    #[test]
    fn many_hollows_stay_hollows() {
        let bubbles = (0..300).map(|i| turned_inside_out(cube_at(DVec3::new(f64::from(i) - 150.0, 0.0, 0.0), 0.1)));
        let all = joined(
            &std::iter::once(cube_at(DVec3::ZERO, 200.0))
                .chain(bubbles)
                .collect::<Vec<_>>(),
        );
        assert_eq!(mended(&all, 0, 0), all);
        assert_eq!(
            mended(&turned_inside_out(all.clone()), 0, 12 * 301).triangles,
            all.triangles
        );
    }

    #[test]
    fn what_is_open_is_told_of() {
        let mut hole = RawMesh::cube();
        hole.triangles.truncate(10);
        let opening = hole.solid().unwrap_err();
        assert_eq!((opening.edges, opening.why), (4, "belongs to one triangle only"));
        assert!(
            opening
                .to_string()
                .ends_with("belongs to one triangle only, and 3 more"),
            "{opening}"
        );
        assert_eq!(RawMesh::rectangle().solid().unwrap_err().edges, 4);
        // A sheet whose two sides are faces of their own has nothing inside.
        let sheet = joined(&[RawMesh::rectangle(), turned_inside_out(RawMesh::rectangle())]);
        assert_eq!(sheet.solid().unwrap_err().edges, 4);
        assert!(RawMesh::default().solid().is_ok());
        let mut nothing = RawMesh::cube();
        nothing.positions.iter_mut().for_each(|p| *p = DVec3::splat(f64::NAN));
        let _ = nothing.solid();
    }
}
