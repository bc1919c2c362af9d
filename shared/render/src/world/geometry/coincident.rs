//! Triangles in the same place, either of which a ray may meet.

use super::mesh::Mesh;
use crate::math::Vec3;
use crate::parallel::collected;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashSet};

/// Triangles of an object.
#[derive(Clone, Copy, Debug)]
pub struct Faces<'m> {
    /// The object's number.
    pub object: u32,
    /// The object's triangles.
    pub mesh: &'m Mesh,
    /// Meshes in different spaces are in different places, whatever their coordinates.
    pub space: u64,
}

/// Pairs of objects (or an object with itself), with the number of the second's triangles whose corners equal those of
/// one of the first's, bit for bit, in any winding.
pub fn coincident(all: &[Faces<'_>]) -> BTreeMap<(u32, u32), usize> {
    let hashes: Vec<Vec<u64>> = all.iter().map(hashes).collect();
    let mut sorted = hashes.concat();
    sorted.par_sort_unstable();
    let twice = sorted.windows(2).filter(|two| two[0] == two[1]);
    let twice: HashSet<u64> = twice.map(|two| two[0]).collect();
    let mut pairs = BTreeMap::new();
    if twice.is_empty() {
        return pairs;
    }
    let mut first_with = BTreeMap::new();
    for (faces, hashes) in all.iter().zip(&hashes) {
        let mesh = faces.mesh;
        for (triangle, _) in (mesh.triangles.iter().zip(hashes)).filter(|(_, hash)| twice.contains(hash)) {
            let mut corners = triangle.map(|v| bits(mesh.positions[v as usize]));
            corners.sort_unstable();
            match first_with.get(&(faces.space, corners)) {
                Some(first) => *pairs.entry((*first, faces.object)).or_default() += 1,
                None => {
                    first_with.insert((faces.space, corners), faces.object);
                }
            }
        }
    }
    pairs
}

/// Zero has one sign.
fn bits(p: Vec3) -> [u32; 3] {
    (p + 0.0).to_array().map(f32::to_bits)
}

/// A hash of each triangle that does not depend on the order of its corners.
fn hashes(faces: &Faces<'_>) -> Vec<u64> {
    let of_vertex = |p: &Vec3| {
        let [x, y, z] = bits(*p).map(u64::from);
        mixed(mixed(x << 32 | y) ^ z)
    };
    let vertices: Vec<u64> = collected(faces.mesh.positions.par_iter().map(of_vertex));
    let of_triangle = |t: &[u32; 3]| {
        let sum = t
            .iter()
            .fold(faces.space, |sum, v| sum.wrapping_add(vertices[*v as usize]));
        mixed(sum)
    };
    collected(faces.mesh.triangles.par_iter().map(of_triangle))
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}
