//! Connected parts of a mesh: which are inside others, and which cross.

use super::boxes::{Bounds, BoxTree};
use super::edges::{Edges, has_corners};
use super::meets;
use crate::mesh::RawMesh;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Rays that must agree on what is inside. They avoid axes and diagonals, where edges often lie.
const RAYS: [DVec3; 3] = [
    DVec3::new(0.31, 0.87, 0.38),
    DVec3::new(-0.79, 0.21, 0.57),
    DVec3::new(0.13, -0.67, -0.73),
];
/// Parts that only touch must not count as crossing, so one of two is shrunk by this share of its size.
const TOUCH: f64 = 1e-5;
/// The most pairs of parts with overlapping boxes that are examined.
const MOST_PAIRS: usize = 1 << 20;
/// The most steps in the search for crossings.
const MOST_STEPS: usize = 1 << 24;
/// Pairs of parts with more faces than this are searched by several threads, in this many shares.
const LARGE: usize = 1 << 13;
const SHARES: usize = 64;

/// The part number of a face in no part.
const NONE: u32 = u32::MAX;

/// The parts of a mesh, each a set of faces connected by edges.
pub(super) struct Parts<'a> {
    mesh: &'a RawMesh,
    faces: &'a [[u32; 3]],
    is_turned: &'a [bool],
    /// Part numbers by face, in the order of the parts' first faces.
    numbers: Vec<u32>,
    list: Vec<Part>,
}

/// A connected part.
struct Part {
    low: DVec3,
    high: DVec3,
    /// One of its corners.
    corner: DVec3,
    /// Six times the volume; negative if it faces inwards.
    volume: f64,
    faces: usize,
}

impl Part {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        corner: DVec3::ZERO,
        volume: 0.0,
        faces: 0,
    };

    fn holds(&self, other: &Self) -> bool {
        self.low.cmplt(other.low).all() && self.high.cmpgt(other.high).all()
    }

    /// Whether its box contains the other's.
    fn reaches(&self, other: &Self) -> bool {
        self.low.cmple(other.low).all() && self.high.cmpge(other.high).all()
    }
}

/// The findings about parts.
pub(super) struct Found {
    /// Whether each part faces the wrong way: outer ones must face outwards, hollows inwards.
    pub is_wrong: Vec<bool>,
    /// Where two parts cross, if a crossing was found.
    pub crossing: Option<DVec3>,
}

impl<'a> Parts<'a> {
    /// `is_turned`: which faces to reverse for consistent winding within each part.
    pub fn new(mesh: &'a RawMesh, faces: &'a [[u32; 3]], edges: &Edges, is_turned: &'a [bool]) -> Self {
        let numbers = numbers(faces, edges);
        let count = numbers
            .iter()
            .filter(|n| **n != NONE)
            .max()
            .map_or(0, |most| *most as usize + 1);
        let mut list: Vec<Part> = std::iter::repeat_with(|| Part::EMPTY).take(count).collect();
        let parts = Self {
            mesh,
            faces,
            is_turned,
            numbers,
            list: Vec::new(),
        };
        for (face, number) in parts.all() {
            let part = &mut list[number];
            let corners = parts.corners(face);
            if part.faces == 0 {
                part.corner = corners[0];
            }
            for p in corners {
                (part.low, part.high) = (part.low.min(p), part.high.max(p));
            }
            let [a, b, c] = corners;
            let volume = (a - part.corner).dot((b - part.corner).cross(c - part.corner));
            part.volume += if is_turned[face] { -volume } else { volume };
            part.faces += 1;
        }
        Self { list, ..parts }
    }

    /// Faces with their part numbers.
    fn all(&self) -> impl Iterator<Item = (usize, usize)> {
        let all = self.numbers.iter().enumerate().filter(|(_, number)| **number != NONE);
        all.map(|(face, number)| (face, *number as usize))
    }

    fn corners(&self, face: usize) -> [DVec3; 3] {
        let [a, b, c] = self.faces[face];
        let at = |v: u32| self.mesh.positions[v as usize];
        [at(a), at(b), at(c)]
    }

    /// A face's part number, if it is in one.
    pub fn of(&self, face: usize) -> Option<usize> {
        (self.numbers[face] != NONE).then_some(self.numbers[face] as usize)
    }

    pub fn find(&self) -> Found {
        let pairs = self.pairs();
        let mut is_hollow = vec![false; self.list.len()];
        let mut crossing = None;
        if let Some(pairs) = &pairs
            && !pairs.is_empty()
        {
            let trees = Trees::new(self, pairs);
            let is_in = |[a, b]: &[u32; 2]| {
                let [inner, outer] = match self.list[*a as usize].holds(&self.list[*b as usize]) {
                    true => [*b, *a],
                    false => [*a, *b],
                };
                let is_in = self.list[outer as usize].holds(&self.list[inner as usize])
                    && RAYS.iter().all(|ray| trees.is_inside(inner, outer, *ray));
                is_in.then_some(inner)
            };
            let within: Vec<u32> = pairs.par_iter().filter_map(is_in).collect();
            within.into_iter().for_each(|part| is_hollow[part as usize] ^= true);
            crossing = trees.crossing(pairs);
        }
        // If nesting takes too long to find, only the whole mesh is reversed.
        let is_inside_out = self.list.iter().map(|part| part.volume).sum::<f64>() < 0.0;
        let is_wrong = |(part, is_hollow): (&Part, bool)| match pairs {
            Some(_) => part.volume != 0.0 && (part.volume < 0.0) != is_hollow,
            None => is_inside_out,
        };
        Found {
            is_wrong: self.list.iter().zip(is_hollow).map(is_wrong).collect(),
            crossing,
        }
    }

    /// Pairs of parts with overlapping boxes; `None` if there are too many.
    fn pairs(&self) -> Option<Vec<[u32; 2]>> {
        if self.list.len() < 2 {
            return Some(Vec::new());
        }
        let boxes: Vec<Bounds> = (self.list.iter())
            .map(|part| Bounds::around([part.low, part.high]))
            .collect();
        let tree = BoxTree::new(&boxes);
        let mut pairs = Vec::new();
        for (a, bounds) in (0..).zip(&boxes) {
            tree.meeting(bounds, |b| {
                if a < b {
                    pairs.push([a, b]);
                }
            });
            if pairs.len() > MOST_PAIRS {
                return None;
            }
        }
        pairs.sort_unstable();
        Some(pairs)
    }
}

/// Box trees over the faces of parts whose boxes overlap those of others.
struct Trees<'a> {
    parts: &'a Parts<'a>,
    /// By part: where its faces begin.
    starts: Vec<usize>,
    /// The faces of each part, one part after another.
    faces: Vec<u32>,
    list: Vec<Option<BoxTree>>,
}

impl<'a> Trees<'a> {
    fn new(parts: &'a Parts<'a>, pairs: &[[u32; 2]]) -> Self {
        let mut is_asked = vec![false; parts.list.len()];
        pairs.iter().flatten().for_each(|part| is_asked[*part as usize] = true);
        let mut starts = vec![0];
        starts.extend(parts.list.iter().scan(0, |sum, part| {
            *sum += part.faces;
            Some(*sum)
        }));
        let mut faces = vec![0; starts[parts.list.len()]];
        let mut places = starts.clone();
        for (face, number) in parts.all() {
            faces[places[number]] = face as u32;
            places[number] += 1;
        }
        let mut trees = Self {
            parts,
            starts,
            faces,
            list: Vec::new(),
        };
        let tree = |(part, is_asked): (usize, bool)| {
            let boxes = || {
                trees
                    .of(part)
                    .iter()
                    .map(|face| Bounds::around(parts.corners(*face as usize)))
            };
            is_asked.then(|| BoxTree::new(&boxes().collect::<Vec<_>>()))
        };
        trees.list = is_asked.into_par_iter().enumerate().map(tree).collect();
        trees
    }

    fn of(&self, part: usize) -> &[u32] {
        &self.faces[self.starts[part]..self.starts[part + 1]]
    }

    /// Whether a ray from a corner of one part hits the other an odd number of times.
    fn is_inside(&self, inner: u32, outer: u32, ray: DVec3) -> bool {
        let from = self.parts.list[inner as usize].corner;
        let faces = self.of(outer as usize);
        let mut is_inside = false;
        let Some(tree) = &self.list[outer as usize] else {
            return false;
        };
        tree.along(from, ray, |i| {
            let corners = self.parts.corners(faces[i as usize] as usize);
            is_inside ^= meets(corners.map(|p| p - from), ray);
        });
        is_inside
    }

    /// A crossing of the first pair of parts, of those given, that cross.
    fn crossing(&self, pairs: &[[u32; 2]]) -> Option<DVec3> {
        let parts = &self.parts.list;
        let normals = self.vertex_normals();
        // The part to shrink comes first.
        let ordered = |&[a, b]: &[u32; 2]| {
            let (one, other) = (&parts[a as usize], &parts[b as usize]);
            let is_other = one.reaches(other) || (!other.reaches(one) && other.faces < one.faces);
            if is_other { [b, a] } else { [a, b] }
        };
        let shares = |pair: &[u32; 2]| {
            let [inner, outer] = ordered(pair);
            let is_large = parts[inner as usize].faces + parts[outer as usize].faces > LARGE;
            let nodes = match (&self.list[inner as usize], &self.list[outer as usize]) {
                (Some(one), Some(other)) => one.pairs(other, if is_large { SHARES } else { 1 }),
                _ => Vec::new(),
            };
            nodes.into_iter().map(move |nodes| (inner, outer, nodes))
        };
        let shares: Vec<_> = pairs.iter().flat_map(shares).collect();
        let steps = MOST_STEPS / shares.len().max(1);
        shares.par_iter().find_map_first(|(inner, outer, nodes)| {
            let part = &parts[*inner as usize];
            let shrink = TOUCH * (part.high - part.low).length() * part.volume.signum();
            let [ours, theirs] = [inner, outer].map(|part| self.of(*part as usize));
            let [one, other] = [inner, outer].map(|part| self.list[*part as usize].as_ref());
            one?.first_of(other?, *nodes, steps, |a, b| {
                let [a, b] = [ours[a as usize], theirs[b as usize]].map(|face| face as usize);
                let smaller = |v: u32| self.parts.mesh.positions[v as usize] - normals.of(*inner, v) * shrink;
                cross(self.parts.faces[a].map(smaller), self.parts.corners(b))
            })
        })
    }

    /// Vertex normals of the consistently wound faces.
    fn vertex_normals(&self) -> VertexNormals {
        let mut normals = VertexNormals {
            by_vertex: vec![(NONE, DVec3::ZERO); self.parts.mesh.positions.len()],
            of_others: HashMap::new(),
        };
        for (face, part) in self.parts.all() {
            let [a, b, c] = self.parts.corners(face);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let normal = if self.parts.is_turned[face] { -normal } else { normal };
            for vertex in self.parts.faces[face] {
                normals.add(part as u32, vertex, normal);
            }
        }
        normals
    }
}

/// Sums of normals by vertex, for each part at it.
struct VertexNormals {
    /// The first part at the vertex, and its sum.
    by_vertex: Vec<(u32, DVec3)>,
    /// By part and vertex: other parts that touch the first there.
    of_others: HashMap<(u32, u32), DVec3>,
}

impl VertexNormals {
    fn add(&mut self, part: u32, vertex: u32, normal: DVec3) {
        let (first, sum) = &mut self.by_vertex[vertex as usize];
        if *first == NONE {
            *first = part;
        }
        match *first == part {
            true => *sum += normal,
            false => *self.of_others.entry((part, vertex)).or_default() += normal,
        }
    }

    /// The unit normal, or zero.
    fn of(&self, part: u32, vertex: u32) -> DVec3 {
        let (first, sum) = self.by_vertex[vertex as usize];
        let sum = match first == part {
            true => sum,
            false => self.of_others.get(&(part, vertex)).copied().unwrap_or_default(),
        };
        sum.normalize_or_zero()
    }
}

/// Where an edge of one of two triangles passes through the other.
fn cross(one: [DVec3; 3], other: [DVec3; 3]) -> Option<DVec3> {
    // Most nearby triangles lie wholly on one side of each other.
    let is_beside = |[a, b, c]: [DVec3; 3], other: [DVec3; 3]| {
        let normal = (b - a).cross(c - a);
        let heights = other.map(|p| normal.dot(p - a));
        heights.iter().all(|height| *height > 0.0) || heights.iter().all(|height| *height < 0.0)
    };
    if is_beside(one, other) || is_beside(other, one) {
        return None;
    }
    let edges = |t: [DVec3; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    let ours = edges(one).into_iter().find_map(|edge| goes_through(edge, other));
    ours.or_else(|| edges(other).into_iter().find_map(|edge| goes_through(edge, one)))
}

/// An edge through the triangle's border counts; one that ends in its plane does not.
fn goes_through([from, to]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    let normal = (b - a).cross(c - a);
    let [before, after] = [from, to].map(|p| normal.dot(p - a));
    let is_through = (before < 0.0 && after > 0.0) || (before > 0.0 && after < 0.0);
    let along = to - from;
    let [a, b, c] = [a, b, c].map(|p| p - from);
    let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|plane| plane.dot(along));
    let is_within = sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0);
    (is_through && is_within).then(|| from + along * (before / (before - after)))
}

/// Part numbers by face, from zero, in the order of the parts' first faces; by union-find.
fn numbers(faces: &[[u32; 3]], edges: &Edges) -> Vec<u32> {
    fn root(above: &mut [u32], mut face: u32) -> u32 {
        while above[face as usize] != face {
            let next = above[above[face as usize] as usize];
            above[face as usize] = next;
            face = next;
        }
        face
    }
    let mut above: Vec<u32> = (0..faces.len() as u32).collect();
    edges.neighbours(|one, other| {
        let (a, b) = (root(&mut above, one as u32), root(&mut above, other as u32));
        above[a.max(b) as usize] = a.min(b);
    });
    let mut next = 0;
    let mut numbers = vec![NONE; faces.len()];
    for (face, corners) in faces.iter().enumerate() {
        if !has_corners(*corners) {
            continue;
        }
        let root = root(&mut above, face as u32) as usize;
        // The root is the first face of its part.
        if root == face {
            numbers[face] = next;
            next += 1;
        } else {
            numbers[face] = numbers[root];
        }
    }
    numbers
}
