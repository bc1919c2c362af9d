//! Edges that meet several shorter ones: a face next to more finely divided ones.

use super::boxes::{Bounds, BoxTree};
use super::edges::{Edges, Side, has_corners};
use crate::mesh::RawMesh;
use glam::DVec3;

/// The most unmatched edges that are examined, and the most nearby ends per edge, on average.
const MOST_EDGES: usize = 1 << 16;
const MOST_NEAR: usize = 64;
/// Tolerance for a vertex on an edge, relative to the edge's length, and to its distance from the origin, since files
/// round positions.
const OF_LENGTH: f64 = 1e-6;
const OF_POSITION: f64 = 2.5e-7;

/// A vertex on a triangle's side.
#[derive(Clone, Copy)]
struct OnSide {
    face: usize,
    /// The side from this corner to the next.
    side: usize,
    /// Fraction along the side.
    at: f64,
    vertex: u32,
}

/// The mesh with unmatched edges cut wherever the end of another edge lies on them, and the number of cut edges; `None`
/// if there are none. `faces`: the triangles, by the first vertex at each position; degenerate ones are left out.
pub(super) fn sewn(mesh: &RawMesh, faces: &[[u32; 3]], edges: &Edges) -> Option<(RawMesh, usize)> {
    let on_sides = on_sides(mesh, faces, edges)?;
    let is_same = |a: &OnSide, b: &OnSide| (a.face, a.side) == (b.face, b.side);
    let count = on_sides.chunk_by(is_same).count();
    let mut sewn = mesh.clone();
    let mut rest = &on_sides[..];
    let triangles = mesh.triangles.iter().enumerate();
    let parts: Vec<Vec<[u32; 3]>> = triangles
        .map(|(face, triangle)| {
            let (own, others) = rest.split_at(rest.partition_point(|on| on.face == face));
            rest = others;
            let mut vertices: [Vec<u32>; 3] = Default::default();
            for on in own {
                let ends = [on.side, (on.side + 1) % 3].map(|corner| triangle[corner] as usize);
                vertices[on.side].push(sewn.add_between(ends, on.at, mesh.positions[on.vertex as usize]));
            }
            let mut parts = Vec::new();
            if has_corners(faces[face]) {
                cut(*triangle, vertices, &mut parts);
            }
            parts
        })
        .collect();
    sewn.replace_triangles(parts);
    Some((sewn, count))
}

/// Vertices on sides, ordered by face, side and position along it.
fn on_sides(mesh: &RawMesh, faces: &[[u32; 3]], edges: &Edges) -> Option<Vec<OnSide>> {
    let odd = edges.iter().filter(|(_, sides)| sides.len() % 2 == 1);
    let odd: Vec<(u32, Side)> = odd
        .flat_map(|(low, sides)| sides.iter().map(move |side| (low, *side)))
        .take(MOST_EDGES + 1)
        .collect();
    if odd.len() > MOST_EDGES {
        return None;
    }
    let at = |v: u32| mesh.positions[v as usize];
    let reach = |low: u32, side: Side| {
        let [from, to] = [low, side.high()].map(at);
        OF_LENGTH * from.distance(to) + OF_POSITION * from.abs().max(to.abs()).max_element()
    };
    let boxes: Vec<_> = odd
        .iter()
        .map(|(low, side)| {
            let reach = DVec3::splat(reach(*low, *side));
            let ends = [*low, side.high()].map(at);
            Bounds::around(ends.into_iter().flat_map(|p| [p - reach, p + reach]))
        })
        .collect();
    let tree = BoxTree::new(&boxes);
    let mut vertices: Vec<u32> = odd.iter().flat_map(|(low, side)| [*low, side.high()]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut found = Vec::new();
    let mut near = 0;
    for vertex in vertices {
        let point = at(vertex);
        tree.meeting(&Bounds::around([point]), |number| {
            near += 1;
            let (low, side) = odd[number as usize];
            let face = side.face();
            let corner = faces[face]
                .iter()
                .position(|v| *v == if side.is_up() { low } else { side.high() });
            let [from, to] = if side.is_up() {
                [low, side.high()]
            } else {
                [side.high(), low]
            };
            let along = at(to) - at(from);
            let share = (point - at(from)).dot(along) / along.length_squared();
            let is_on = share > 0.0 && share < 1.0 && vertex != low && vertex != side.high();
            if is_on
                && (at(from) + along * share).distance(point) <= reach(low, side)
                && let Some(corner) = corner
            {
                found.push(OnSide {
                    face,
                    side: corner,
                    at: share,
                    vertex,
                });
            }
        });
        if near > MOST_NEAR * odd.len() {
            return None;
        }
    }
    found.sort_unstable_by(|a, b| {
        let order = (a.face, a.side, a.vertex).cmp(&(b.face, b.side, b.vertex));
        (a.face, a.side)
            .cmp(&(b.face, b.side))
            .then(a.at.total_cmp(&b.at))
            .then(order)
    });
    (!found.is_empty()).then_some(found)
}

/// Cut a triangle at vertices on its sides: from the first to the second corner, and so on.
fn cut(corners: [u32; 3], mut on: [Vec<u32>; 3], parts: &mut Vec<[u32; 3]>) {
    let Some(side) = on.iter().position(|vertices| !vertices.is_empty()) else {
        parts.push(corners);
        return;
    };
    let [a, b, c] = [0, 1, 2].map(|i| corners[(side + i) % 3]);
    let [mut before, next, last] = [0, 1, 2].map(|i| std::mem::take(&mut on[(side + i) % 3]));
    let middle = before.len() / 2;
    let after = before.split_off(middle + 1);
    let Some(vertex) = before.pop() else { return };
    cut([a, vertex, c], [before, Vec::new(), last], parts);
    cut([vertex, b, c], [after, next, Vec::new()], parts);
}

impl RawMesh {
    /// Add a vertex at `position` with attributes interpolated between two others.
    fn add_between(&mut self, [from, to]: [usize; 2], share: f64, position: DVec3) -> u32 {
        let number = self.positions.len() as u32;
        self.positions.push(position);
        if let (Some(a), Some(b)) = (self.normals.get(from), self.normals.get(to)) {
            self.normals.push(a.lerp(*b, share).normalize_or(*a));
        }
        if let (Some(a), Some(b)) = (self.uvs.get(from), self.uvs.get(to)) {
            self.uvs.push(a.lerp(*b, share));
        }
        if let (Some(a), Some(b)) = (self.colors.get(from), self.colors.get(to)) {
            self.colors.push(a.lerp(*b, share as f32));
        }
        if let (Some(a), Some(b)) = (self.tangents.get(from), self.tangents.get(to)) {
            let along = a.truncate().lerp(b.truncate(), share);
            self.tangents.push(along.extend(a.w));
        }
        number
    }

    /// Replace each triangle by several.
    pub(super) fn replace_triangles(&mut self, by: impl IntoIterator<Item = impl IntoIterator<Item = [u32; 3]>>) {
        let mut triangles = Vec::with_capacity(self.triangles.len());
        let mut materials = self.materials.iter_mut().peekable();
        for (number, parts) in by.into_iter().enumerate() {
            while let Some((first, _)) = materials.next_if(|(first, _)| *first <= number) {
                *first = triangles.len();
            }
            triangles.extend(parts);
        }
        materials.for_each(|(first, _)| *first = triangles.len());
        self.triangles = triangles;
        // They refer to triangle numbers.
        self.cuts.clear();
    }
}
