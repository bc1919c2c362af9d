//! Meshes as read from files, and their conversion to the renderer's meshes.

mod displace;
mod obj;
#[cfg(test)]
mod obj_reference;
mod obj_text;
mod parts;
mod ply;
mod ply_binary;
mod polygon;
mod serialized;
mod solid;

use crate::Flaw;
use crate::parallel;
use beamfarm_render::math::Rgb;
use beamfarm_render::parallel::collected;
use beamfarm_render::world::geometry::Mesh;
pub use displace::Unmoved;
use glam::{DAffine3, DVec2, DVec3, DVec4};
pub use obj::libraries;
pub use polygon::Cut;
use polygon::Runs;
use rayon::prelude::*;
pub use solid::{Opening, Solid, meets};
use std::borrow::Cow;

/// Byte order mark, which may precede UTF-8 text.
pub const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// The fewest vertices per thread when smooth normals are computed.
const MIN_SHARE: usize = 1 << 12;

/// A mesh in double precision, as its file gives it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// One normal per vertex, or none at all.
    pub normals: Vec<DVec3>,
    /// One UV per vertex, or none at all.
    pub uvs: Vec<DVec2>,
    /// One linear colour per vertex if requested, or none at all.
    pub colors: Vec<Rgb>,
    /// The x direction of normal maps, and the handedness of their y, 1 or -1. One per vertex if the file has normals
    /// and tangents and something needs them, or none at all.
    pub tangents: Vec<DVec4>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Non-convex polygons of the file, which are not fans about their first corner.
    pub cuts: Vec<Cut>,
    /// Material names in the file, each with its first triangle, in order. Triangles before the first have none.
    pub materials: Vec<(usize, String)>,
}

impl RawMesh {
    /// The mesh interpolated linearly towards another one by `weight` from 0 to 1, or why that is impossible. Normals
    /// are interpolated too.
    pub fn toward(&self, other: &Self, weight: f64) -> Result<Self, String> {
        let count = |mesh: &Self| {
            let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
            format!("{vertices} vertices and {triangles} triangles")
        };
        if self.positions.len() != other.positions.len() || self.triangles.len() != other.triangles.len() {
            let (theirs, ours) = (count(other), count(self));
            return Err(format!("it has {theirs}, the mesh before it {ours}; expected the same"));
        }
        if self.fans() != other.fans() || self.normals.len() != other.normals.len() {
            return Err(
                "its triangles are others than those of the mesh before it; expected the same vertices in the \
                same order, and normals in both or in none"
                    .to_owned(),
            );
        }
        let between = |(from, to): (&DVec3, &DVec3)| *from + (*to - *from) * weight;
        let turned = |pair: (&DVec3, &DVec3)| between(pair).normalize_or(*pair.0);
        Ok(Self {
            positions: self.positions.iter().zip(&other.positions).map(between).collect(),
            normals: self.normals.iter().zip(&other.normals).map(turned).collect(),
            uvs: self.uvs.clone(),
            colors: self.colors.clone(),
            tangents: self.tangents.clone(),
            triangles: self.triangles.clone(),
            cuts: self.cuts.clone(),
            materials: self.materials.clone(),
        })
    }

    /// The triangles with all polygons as fans, which do not depend on vertex positions.
    fn fans(&self) -> Cow<'_, [[u32; 3]]> {
        let mut triangles = Cow::Borrowed(&self.triangles[..]);
        for cut in &self.cuts {
            cut.undo(triangles.to_mut());
        }
        triangles
    }

    /// Re-cut non-convex polygons, which are still fans.
    fn cut(&mut self, runs: &Runs) -> Result<(), Flaw> {
        polygon::check(&self.positions, &self.triangles, runs)?;
        self.cuts = polygon::cut(&self.positions, &mut self.triangles, runs);
        Ok(())
    }

    /// [`Self::read_nth`] for the first mesh of a file, with colours.
    #[cfg(test)]
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, Flaw> {
        Self::read_nth(name, bytes, 0, true)
    }

    /// Read a PLY, OBJ or .serialized file, as its extension says. `index`: which mesh of a .serialized file, from
    /// zero. `colored`: with vertex colours, if there are any.
    pub fn read_nth(name: &str, bytes: &[u8], index: u32, colored: bool) -> Result<Self, Flaw> {
        let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
        // Some editors write it before text.
        let text = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        let mesh = match ending.as_deref() {
            Some("ply") => ply::read(text, colored)?,
            Some("obj") => obj::read(text, colored)?,
            Some("serialized") => serialized::read(bytes, index, colored)?,
            _ => return Err("unsupported kind of mesh file; expected .ply, .obj or .serialized".into()),
        };
        mesh.checked()
    }

    /// The mesh with unit normals, or an error if it is unusable.
    pub fn checked(mut self) -> Result<Self, Flaw> {
        self.check()?;
        self.repair_normals();
        Ok(self)
    }

    fn check(&self) -> Result<(), Flaw> {
        if self.triangles.is_empty() {
            return Err("the mesh is empty; expected at least one triangle".into());
        }
        let count = self.positions.len();
        let unusable = |i: usize| !self.positions[i].as_vec3().is_finite();
        if let Some(i) = parallel::first(count, unusable) {
            return Err(format!("vertex {i} (from zero) has a position that is NaN or infinite").into());
        }
        if let Some(i) = parallel::first(self.normals.len(), |i| !self.normals[i].is_finite()) {
            return Err(format!("vertex {i} (from zero) has a normal that is NaN or infinite").into());
        }
        if let Some(i) = parallel::first(self.uvs.len(), |i| !self.uvs[i].as_vec2().is_finite()) {
            return Err(format!("vertex {i} (from zero) has a UV that is NaN or infinite").into());
        }
        let outside = |t: &[u32; 3]| t.iter().copied().find(|v| *v as usize >= count);
        let of_triangles = parallel::first(self.triangles.len(), |i| outside(&self.triangles[i]).is_some());
        if let Some((i, v)) = of_triangles.and_then(|i| Some((i, outside(&self.triangles[i])?))) {
            return Err(format!("triangle {i} (from zero) names vertex {v}, but there are {count}").into());
        }
        Ok(())
    }

    /// Normalise normals; zero ones become the mean of their triangles' normals.
    fn repair_normals(&mut self) {
        parallel::change(&mut self.normals, |n| *n = n.normalize_or_zero());
        if parallel::first(self.normals.len(), |i| self.normals[i] == DVec3::ZERO).is_none() {
            return;
        }
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            for v in t {
                sums[*v as usize] += (b - a).cross(c - a);
            }
        }
        for (normal, sum) in self.normals.iter_mut().zip(sums) {
            if *normal == DVec3::ZERO {
                *normal = sum.try_normalize().unwrap_or(DVec3::Z);
            }
        }
    }

    /// The square [-1, 1]^2 in the xy plane, normal +z, UV from (0, 0) to (1, 1).
    pub fn rectangle() -> Self {
        let mut mesh = Self::default();
        mesh.push_square(DVec3::ZERO, DVec3::X, DVec3::Y);
        mesh
    }

    /// The cube [-1, 1]^3; each face covers the whole UV unit square, oriented as in Mitsuba 3.
    pub fn cube() -> Self {
        let mut mesh = Self::default();
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        // Each face's two axes, and the directions of its u and v.
        for (side, other, u, v) in [
            (x, y, y, x),
            (y, x, -y, x),
            (y, z, y, -z),
            (z, y, y, z),
            (z, x, -x, -z),
            (x, z, z, x),
        ] {
            let first = mesh.positions.len();
            mesh.push_square(side.cross(other), side, other);
            for (uv, p) in mesh.uvs.iter_mut().zip(&mesh.positions).skip(first) {
                *uv = 0.5 * DVec2::new(p.dot(u), p.dot(v)) + 0.5;
            }
        }
        mesh
    }

    fn push_square(&mut self, center: DVec3, x: DVec3, y: DVec3) {
        let first = self.positions.len() as u32;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            self.positions.push(center + x * (2.0 * u - 1.0) + y * (2.0 * v - 1.0));
            self.uvs.push(DVec2::new(u, v));
        }
        self.triangles.push([first, first + 1, first + 2]);
        self.triangles.push([first, first + 2, first + 3]);
    }

    /// Area under a map.
    pub fn area(&self, map: &DAffine3) -> f64 {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| map.transform_point3(self.positions[v as usize]));
            (b - a).cross(c - a).length()
        };
        0.5 * self.triangles.iter().map(doubled).sum::<f64>()
    }

    /// A normal per vertex: the mean of its triangles' normals, weighted by their angles at the vertex (Thürmer and
    /// Wüthrich 1998). Angles are measured under `map`, but the normals returned are in the mesh's own space.
    /// Coincident vertices are separate.
    pub fn smooth_normals(&self, map: &DAffine3) -> Vec<DVec3> {
        let m = map.matrix3;
        // Mirroring reverses the winding but not the outside.
        let side = m.determinant().signum();
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        // Each thread goes through all triangles and adds to its own vertices, so that the order of summation is fixed.
        let share = sums.len().div_ceil(rayon::current_num_threads()).max(MIN_SHARE);
        parallel::change_shares(&mut sums, share, &|first, sums| {
            for t in &self.triangles {
                let mine = t
                    .map(|v| (v as usize).wrapping_sub(first))
                    .map(|v| (v < sums.len()).then_some(v));
                if mine == [None; 3] {
                    continue;
                }
                let corners = t.map(|v| self.positions[v as usize]);
                let edge = |i: usize| m * (corners[(i + 1) % 3] - corners[i % 3]);
                let Some(normal) = edge(0).cross(-edge(2)).try_normalize() else {
                    continue;
                };
                for (i, v) in mine.into_iter().enumerate() {
                    let Some(v) = v else { continue };
                    let (next, last) = (edge(i), -edge(i + 2));
                    let angle = libm::atan2(next.cross(last).length(), next.dot(last));
                    sums[v] += normal * (side * angle);
                }
            }
        });
        // If normals cancel there is none; Mitsuba uses this one.
        let unit = |sum: DVec3| sum.try_normalize().unwrap_or(DVec3::X);
        let back = m.transpose();
        parallel::change(&mut sums, |sum| *sum = (back * unit(*sum)).normalize_or_zero());
        sums
    }

    /// The mesh under a map, in single precision, with these normals, one per vertex or none at all. `flip` swaps
    /// outside and inside; a mirroring map does not. Triangles without area are dropped.
    pub fn to_mesh(&self, map: &DAffine3, flip: bool, normals: &[DVec3]) -> Mesh {
        let reverse = flip != (map.matrix3.determinant() < 0.0);
        let normal_map = map.matrix3.inverse().transpose() * if flip { -1.0 } else { 1.0 };
        // A normal map's y follows the map.
        let side = if reverse { -1.0 } else { 1.0 };
        let tangent = |t: &DVec4| {
            let along = (map.matrix3 * t.truncate()).normalize_or_zero();
            along.as_vec3().extend((t.w * side) as f32)
        };
        let mut mesh = Mesh {
            positions: collected(self.positions.par_iter().map(|p| map.transform_point3(*p).as_vec3())),
            normals: collected(normals.par_iter().map(|n| (normal_map * *n).normalize().as_vec3())),
            uvs: collected(self.uvs.par_iter().map(|uv| uv.as_vec2())),
            colors: self.colors.clone(),
            given_tangents: match normals.is_empty() {
                true => Vec::new(),
                false => self.tangents.iter().map(tangent).collect(),
            },
            triangles: self.triangles.clone(),
            ..Mesh::default()
        };
        if reverse {
            parallel::change(&mut mesh.triangles, |t| t.swap(1, 2));
        }
        let positions = &mesh.positions;
        let has_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize].as_dvec3());
            (b - a).cross(c - a) != DVec3::ZERO
        };
        // Most meshes have no triangle without area.
        if parallel::first(mesh.triangles.len(), |i| !has_area(&mesh.triangles[i])).is_some() {
            mesh.triangles.retain(has_area);
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn normal(mesh: &Mesh, t: usize) -> Vec3 {
        let [a, b, c] = mesh.triangles[t].map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a).normalize()
    }

    /// A tetrahedron around the origin with outward vertex normals.
    fn tetrahedron() -> RawMesh {
        let positions = vec![
            DVec3::new(1.0, 1.0, 1.0),
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, -1.0, -1.0),
        ];
        RawMesh {
            normals: positions.iter().map(|p| p.normalize()).collect(),
            positions,
            triangles: vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]],
            ..RawMesh::default()
        }
    }

    /// A bumpy square with triangles of all sizes, some without area.
    fn terrain(side: u32) -> RawMesh {
        let height = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 20) / 1024.0;
        let position = |i: u32| DVec3::new(f64::from(i % side), f64::from(i / side), height(i));
        let cell = |i: u32| {
            let a = i / (side - 1) * side + i % (side - 1);
            [
                [a, a + 1, a + side],
                [a + 1, a + side + 1, if i.is_multiple_of(97) { a + 1 } else { a + side }],
            ]
        };
        RawMesh {
            positions: (0..side * side).map(position).collect(),
            triangles: (0..(side - 1) * (side - 1)).flat_map(cell).collect(),
            ..RawMesh::default()
        }
    }

    /// On any number of threads each vertex has the same bits as the sum on one thread.
    #[test]
    fn meshes_do_not_depend_on_threads() {
        let raw = terrain(150);
        assert!(raw.positions.len() > 4 * MIN_SHARE);
        let map = DAffine3::from_scale(DVec3::new(1.0, -0.5, 2.0)) * DAffine3::from_rotation_x(0.3);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let normals = raw.smooth_normals(&map);
                let mesh = raw.to_mesh(&map, true, &normals);
                (normals, mesh.positions, mesh.normals, mesh.triangles, raw.solid())
            })
        };
        let one = on(1);
        assert!(one.3.len() < raw.triangles.len() && one.4.is_err());
        assert!([2, 3, 5].into_iter().all(|threads| on(threads) == one));
        // One triangle after another.
        let mut sums = vec![DVec3::ZERO; raw.positions.len()];
        for t in &raw.triangles {
            let [a, b, c] = t.map(|v| map.matrix3 * raw.positions[v as usize]);
            let corners = [a, b, c];
            let Some(normal) = (b - a).cross(c - a).try_normalize() else {
                continue;
            };
            for i in 0..3 {
                let [here, next, last] = [0, 1, 2].map(|j| corners[(i + j) % 3]);
                let (next, last) = (next - here, last - here);
                sums[t[i] as usize] -= normal * libm::atan2(next.cross(last).length(), next.dot(last));
            }
        }
        for (sum, normal) in sums.into_iter().zip(&one.0) {
            let expected = (map.matrix3.transpose() * sum.normalize_or(DVec3::X)).normalize();
            assert!(expected.distance(*normal) < 1e-9, "{expected} {normal}");
        }
    }

    #[test]
    fn cube_and_rectangle_face_outwards() {
        let cube = RawMesh::cube();
        assert!(cube.solid().is_ok_and(|solid| solid.mended.is_none()));
        assert_eq!(cube.area(&DAffine3::IDENTITY), 24.0);
        let mesh = cube.to_mesh(&DAffine3::IDENTITY, false, &[]);
        for t in 0..12 {
            let center: Vec3 = mesh.triangles[t].iter().map(|v| mesh.positions[*v as usize]).sum();
            assert!(normal(&mesh, t).dot(center) > 0.0);
            let uv = |k: usize| mesh.uvs[mesh.triangles[t][k] as usize];
            // As in Mitsuba, where image v points down.
            assert!((uv(1) - uv(0)).perp_dot(uv(2) - uv(0)) < 0.0);
        }
        let rectangle = RawMesh::rectangle().to_mesh(&DAffine3::IDENTITY, false, &[]);
        assert_eq!(normal(&rectangle, 0), Vec3::Z);
        assert_eq!(normal(&rectangle, 1), Vec3::Z);
        for (p, uv) in rectangle.positions.iter().zip(&rectangle.uvs) {
            assert_eq!(p.truncate(), *uv * 2.0 - 1.0);
        }
    }

    /// Under any map the outside stays outside unless flipped, and vertex normals follow.
    #[test]
    fn maps_that_mirror_keep_the_outside() {
        let mirror = DAffine3::from_scale(DVec3::new(-2.0, 1.0, 0.5));
        let turn = DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0);
        for map in [DAffine3::IDENTITY, turn, mirror, turn * mirror, mirror * turn * mirror] {
            for flip in [false, true] {
                let raw = tetrahedron();
                let mesh = raw.to_mesh(&map, flip, &raw.normals);
                for t in 0..4 {
                    let center: Vec3 = mesh.triangles[t].iter().map(|v| mesh.positions[*v as usize]).sum();
                    assert_eq!(normal(&mesh, t).dot(center) < 0.0, flip);
                    for v in mesh.triangles[t] {
                        let outwards = mesh.normals[v as usize].dot(mesh.positions[v as usize]);
                        assert_eq!(outwards < 0.0, flip);
                        assert!((mesh.normals[v as usize].length() - 1.0).abs() < 1e-6);
                    }
                }
                assert!(raw.to_mesh(&map, flip, &[]).normals.is_empty());
            }
        }
    }

    /// `vertex_positions` and `vertex_texcoords` of Mitsuba 3.9.1's cube, one face per line.
    #[test]
    fn cubes_have_the_uvs_of_mitsuba() {
        #[rustfmt::skip]
        let faces = [
            [[1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1]],
            [[1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]],
            [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
            [[1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]],
            [[-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1]],
            [[1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]],
        ];
        let cube = RawMesh::cube();
        for face in faces {
            let corners = face.map(|p| DVec3::from(p.map(f64::from)));
            let normal = corners.iter().sum::<DVec3>() / 4.0;
            for (corner, uv) in corners.iter().zip([DVec2::Y, DVec2::ONE, DVec2::X, DVec2::ZERO]) {
                let found = (0..cube.positions.len()).find(|v| {
                    let center = cube.positions[v - v % 4..][..4].iter().sum::<DVec3>() / 4.0;
                    center == normal && cube.positions[*v] == *corner
                });
                assert_eq!(cube.uvs[found.unwrap()], uv, "{normal} {corner}");
            }
        }
    }

    /// Weights are angles, not the number or size of triangles: three faces of a cube, one of them split in two, also
    /// under a map that changes the angles.
    #[test]
    fn smooth_normals_are_weighted_by_angles() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let corner = RawMesh {
            positions: vec![DVec3::ZERO, 3.0 * x, x + y, y, 5.0 * z],
            triangles: vec![[0, 2, 1], [0, 3, 2], [0, 1, 4], [0, 4, 3]],
            ..RawMesh::default()
        };
        let normals = corner.smooth_normals(&DAffine3::IDENTITY);
        assert!((normals[0] + DVec3::ONE.normalize()).length() < 1e-12);
        // y becomes x + y, still in the xy plane: the angles at the origin are then 45, 90 and 90 degrees.
        let shear = DAffine3::from_mat3(glam::DMat3::from_cols(x, x + y, z));
        let normals = corner.smooth_normals(&shear);
        let mapped = (shear.matrix3.inverse().transpose() * normals[0]).normalize();
        let expected = -z * 0.5 - y + (y - x).normalize();
        assert!((mapped - expected.normalize()).length() < 1e-12, "{mapped}");
    }

    #[test]
    fn openings_are_found() {
        let is_closed = |mesh: &RawMesh| mesh.solid().is_ok_and(|solid| solid.mended.is_none());
        let mut mesh = tetrahedron();
        assert!(is_closed(&mesh));
        // Separate vertices per triangle, and zeros of either sign, do not open it.
        let split = RawMesh {
            positions: mesh
                .triangles
                .iter()
                .flatten()
                .map(|v| mesh.positions[*v as usize] - 1.0)
                .collect(),
            triangles: (0..4).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            ..RawMesh::default()
        };
        assert!(is_closed(&split));
        let mut signed = split.clone();
        signed.positions.iter_mut().step_by(2).for_each(|p| *p = -(-*p));
        signed.positions[0] = signed.positions[0] * 1.0 + DVec3::splat(-0.0);
        assert!(is_closed(&signed));

        mesh.triangles.pop();
        assert!(mesh.solid().unwrap_err().to_string().contains("one triangle only"));
        assert!(RawMesh::rectangle().solid().is_err());
    }

    #[test]
    fn triangles_without_area_are_left_out() {
        let mut mesh = tetrahedron();
        mesh.positions.push(DVec3::ZERO);
        mesh.positions.push(DVec3::splat(0.5));
        mesh.triangles.extend([[0, 0, 1], [0, 4, 5]]);
        assert_eq!(
            mesh.to_mesh(&DAffine3::IDENTITY, false, &[]).triangles,
            tetrahedron().triangles
        );
    }
}
