//! The beams of a pass, laid out for evaluation, under an obvhs hierarchy of boxes around pieces of them.

use super::PhotonBeam;
use crate::light::SceneBounds;
use crate::math::{Ray, Vec3};
use crate::medium::transmittance::StepFunctions;
use glam::{BVec3A, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams};
use std::time::Duration;

/// Pieces per beam within the scene, on average: more make tighter boxes and a larger hierarchy. A beam's estimate is always evaluated
/// once and over its whole length, so this changes nothing but time.
const PIECES_PER_BEAM: f32 = 3.0;

/// The beams of one pass.
pub struct BeamMap {
    beams: Vec<PhotonBeam>,
    steps: StepFunctions,
    /// By position in the hierarchy's leaves: the piece's beam.
    piece_beam: Vec<u32>,
    bvh: Bvh2,
}

struct Piece(Aabb);

impl Boundable for Piece {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl BeamMap {
    /// Build the map. Deterministic. `steps`: transmittance along the beams in heterogeneous media. `around`: where the camera and all things are; in fog without end, beams go on far
    /// beyond, and what is out there needs no small boxes.
    pub fn new(beams: Vec<PhotonBeam>, steps: StepFunctions, around: &SceneBounds) -> Self {
        let inside: Vec<[f32; 2]> = beams.iter().map(|b| range_within(b, around)).collect();
        let total: f64 = inside.iter().map(|[s0, s1]| (s1 - s0) as f64).sum();
        let piece_length = (total / (beams.len() as f64 * PIECES_PER_BEAM as f64)) as f32;
        let mut pieces =
            Vec::with_capacity((beams.len() as f32 * (PIECES_PER_BEAM + 1.0)) as usize);
        let mut owners = Vec::with_capacity(pieces.capacity());
        for (i, (beam, &[s0, s1])) in beams.iter().zip(&inside).enumerate() {
            let mut add = |from: f32, to: f32| {
                pieces.push(Piece(piece_bounds(beam, from, to)));
                owners.push(i as u32);
            };
            let [start, end] = beam.extent;
            if start < s0 {
                add(start, s0);
            }
            if s0 < s1 {
                let count = ((s1 - s0) / piece_length).ceil().clamp(1.0, 4096.0);
                let at = |k: u32| s0 + (s1 - s0) * (k as f32 / count);
                for k in 0..count as u32 {
                    add(at(k), at(k + 1));
                }
            }
            if s1 < end {
                add(s1, end);
            }
        }
        let bvh = build_bvh2(
            &pieces,
            BvhBuildParams {
                max_prims_per_leaf: 16,
                ..BvhBuildParams::very_fast_build()
            },
            &mut Duration::default(),
        );
        let order = &bvh.primitive_indices;
        Self {
            beams,
            steps,
            piece_beam: order.iter().map(|&i| owners[i as usize]).collect(),
            bvh,
        }
    }

    /// The beams, in the order that they were traced in.
    pub fn beams(&self) -> &[PhotonBeam] {
        &self.beams
    }

    /// Transmittance along the beams in heterogeneous media.
    pub fn steps(&self) -> &StepFunctions {
        &self.steps
    }

    /// Indices of all beams that may come within their radius of any ray of the packet (and some that do not), each
    /// once, in increasing order: the order of summation does not depend on the hierarchy.
    pub fn candidates(&self, packet: &Packet, scratch: &mut Candidates) {
        scratch.found.clear();
        let nodes = &self.bvh.nodes;
        if nodes.is_empty() {
            return;
        }
        scratch.stack.clear();
        scratch.stack.push(0);
        while let Some(index) = scratch.stack.pop() {
            let node = &nodes[index as usize];
            if !packet.meets(&node.aabb) {
                continue;
            }
            if node.is_leaf() {
                let first = node.first_index as usize;
                let leaf = first..first + node.prim_count as usize;
                for &beam in &self.piece_beam[leaf] {
                    scratch.found.push(beam);
                }
            } else {
                scratch.stack.push(node.first_index + 1);
                scratch.stack.push(node.first_index);
            }
        }
        scratch.sort_and_deduplicate(self.beams.len());
    }
}

/// The part of a beam's extent within a sphere; of no length when they do not meet.
fn range_within(beam: &PhotonBeam, sphere: &SceneBounds) -> [f32; 2] {
    let [start, end] = beam.extent;
    let offset = beam.origin - sphere.center;
    let nearest = -offset.dot(beam.dir);
    let half2 = sphere.radius * sphere.radius - (offset + beam.dir * nearest).length_squared();
    let half = half2.max(0.0).sqrt();
    [
        (nearest - half).clamp(start, end),
        (nearest + half).clamp(start, end),
    ]
}

/// A box around a beam from `s0` to `s1`, kernel included.
fn piece_bounds(beam: &PhotonBeam, s0: f32, s1: f32) -> Aabb {
    let end = |s: f32| (beam.origin + beam.dir * s, beam.radius_at(s));
    let ((p0, r0), (p1, r1)) = (end(s0), end(s1));
    let min = (p0 - r0).min(p1 - r1);
    let max = (p0 + r0).max(p1 + r1);
    let pad = min.abs().max(max.abs()).max_element() * 1e-6;
    Aabb::new(Vec3A::from(min - pad), Vec3A::from(max + pad))
}

/// Found beams, and room to look for them.
#[derive(Default)]
pub struct Candidates {
    /// Indices of beams, increasing.
    pub found: Vec<u32>,
    stack: Vec<u32>,
    marks: Vec<u64>,
}

impl Candidates {
    fn sort_and_deduplicate(&mut self, beams: usize) {
        let words = beams.div_ceil(64);
        // Marking is linear in the number of beams, sorting in what was found.
        if self.found.len() * 4 < words {
            self.found.sort_unstable();
            self.found.dedup();
            return;
        }
        self.marks.clear();
        self.marks.resize(words, 0);
        for &i in &self.found {
            self.marks[i as usize / 64] |= 1 << (i % 64);
        }
        self.found.clear();
        for (word, &bits) in self.marks.iter().enumerate() {
            let mut bits = bits;
            while bits != 0 {
                self.found.push(word as u32 * 64 + bits.trailing_zeros());
                bits &= bits - 1;
            }
        }
    }
}

/// Bounds of a set of ray segments: intervals of origins and directions, and the longest distance.
#[derive(Clone, Copy, Debug)]
pub struct Packet {
    origin_min: Vec3A,
    origin_max: Vec3A,
    inv_dir_min: Vec3A,
    inv_dir_max: Vec3A,
    /// Axes along which the lowest direction is positive: there the box's far side bounds the distance from above.
    min_forward: BVec3A,
    /// Axes along which the highest direction is positive: there the box's near side bounds the distance from below.
    max_forward: BVec3A,
    t_max: f32,
}

impl Packet {
    /// Bounds of rays, each with its length. At least one.
    pub fn new(rays: impl Iterator<Item = (Ray, f32)>) -> Self {
        let (mut origin_min, mut origin_max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (mut dir_min, mut dir_max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut t_max: f32 = 0.0;
        for (ray, t) in rays {
            origin_min = origin_min.min(ray.origin);
            origin_max = origin_max.max(ray.origin);
            dir_min = dir_min.min(ray.dir);
            dir_max = dir_max.max(ray.dir);
            t_max = t_max.max(t);
        }
        // A direction of zero bounds nothing, or everything: what a tiny one does.
        let inverse = |d: f32| {
            if d.abs() < 1e-20 {
                1e20f32.copysign(d)
            } else {
                1.0 / d
            }
        };
        let inverse = |d: Vec3| Vec3A::new(inverse(d.x), inverse(d.y), inverse(d.z));
        let (inv_dir_min, inv_dir_max) = (inverse(dir_min), inverse(dir_max));
        Self {
            origin_min: origin_min.into(),
            origin_max: origin_max.into(),
            inv_dir_min,
            inv_dir_max,
            min_forward: inv_dir_min.cmpgt(Vec3A::ZERO),
            max_forward: inv_dir_max.cmpgt(Vec3A::ZERO),
            t_max,
        }
    }

    /// Whether any ray may meet the box: on every axis, the interval of positions at some common distance t must
    /// overlap the box. Never false for a box that is met.
    #[inline]
    fn meets(&self, aabb: &Aabb) -> bool {
        // The lowest position, origin_min + t dir_min, must not be above the box; the highest not below it.
        let low = (aabb.max - self.origin_min) * self.inv_dir_min;
        let high = (aabb.min - self.origin_max) * self.inv_dir_max;
        let (none, all) = (Vec3A::NEG_INFINITY, Vec3A::INFINITY);
        let near = Vec3A::select(self.min_forward, none, low).max(Vec3A::select(
            self.max_forward,
            high,
            none,
        ));
        let far = Vec3A::select(self.min_forward, low, all).min(Vec3A::select(
            self.max_forward,
            all,
            high,
        ));
        let near = near.max_element().max(0.0);
        let far = far.min_element().min(self.t_max);
        // A few roundings of slack.
        near <= far * (1.0 + 1e-5) + 1e-30
    }
}
