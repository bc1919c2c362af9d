//! Many round items in one tree: curves swept by a ball of varying radius, such as hair, and single balls.
//!
//! When a ray comes near a cubic piece of a curve, the piece is cut into enough straight parts to stay within a small
//! share of its radius. Each part is a round cone (`cone`) that shares its end ball with the next, so there are no
//! gaps. Only the four control points of a piece are stored.

mod cone;
mod segment;

use super::item::{Item, Items};
use super::tree::{ItemTree, TreeHit};
use crate::math::{Vec2, Vec3};
use cone::RayAxes;
use glam::{DVec3, Vec4};
use segment::Segment;
use std::sync::OnceLock;

/// Interpolation between control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Basis {
    /// Nothing: each point is a ball.
    Balls,
    /// Straight pieces.
    Linear,
    /// Uniform cubic B-splines: a curve of n points has n - 3 pieces, and begins and ends near its outer points.
    BSpline,
    /// Cubic pieces through all points, with the end points doubled.
    CatmullRom,
}

impl Basis {
    /// Least number of control points of a curve.
    pub fn least_points(self) -> usize {
        match self {
            Self::Balls => 1,
            Self::Linear | Self::CatmullRom => 2,
            Self::BSpline => 4,
        }
    }

    /// Number of pieces of a curve with this many control points.
    fn pieces(self, points: usize) -> usize {
        match self {
            Self::Balls => points,
            _ => (points + 1).saturating_sub(self.least_points()),
        }
    }
}

/// In [`Strands::first`]: a curve begins or ends with the piece.
const BEGINS: u32 = 1 << 31;
const ENDS: u32 = 1 << 30;
/// Most control points that are supported.
pub const MOST_POINTS: usize = 1 << 30;

/// Curves or balls in object space.
#[derive(Debug)]
pub struct Strands {
    basis: Basis,
    /// Position and radius of each control point.
    points: Vec<Vec4>,
    /// By piece: its first control point (for Catmull-Rom the one that it begins at), with [`BEGINS`] and [`ENDS`].
    first: Vec<u32>,
    /// By curve: the number of pieces up to its end.
    ends: Vec<u32>,
    corners: [Vec3; 2],
    tree: OnceLock<StrandTree>,
}

struct StrandTree(ItemTree);

impl std::fmt::Debug for StrandTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("StrandTree")
    }
}

/// A hit as the search finds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StrandHit {
    /// In lengths of the direction.
    pub t: f32,
    /// The piece, or ball.
    pub piece: u32,
    /// Position along the piece, 0 to 1.
    pub u: f32,
}

/// A hit in object space.
pub(super) struct Finished {
    pub point: Vec3,
    /// Unit normal, outwards.
    pub normal: Vec3,
    /// Along the whole curve and across it.
    pub uv: Vec2,
    pub radius: f32,
}

impl Strands {
    /// `lengths`: control points of each curve, in order, each at least [`Basis::least_points`]; ignored for balls. The
    /// caller must reject more than [`MOST_POINTS`] points, and values that are not finite.
    pub fn new(basis: Basis, points: Vec<Vec4>, lengths: &[u32]) -> Self {
        let all = [points.len() as u32];
        let lengths = if basis == Basis::Balls { &all } else { lengths };
        let count = |length: &u32| basis.pieces(*length as usize);
        let mut first = Vec::with_capacity(lengths.iter().map(count).sum());
        let mut ends = Vec::with_capacity(lengths.len());
        let mut start = 0;
        for length in lengths {
            let pieces = count(length) as u32;
            for piece in 0..pieces {
                let begins = if piece == 0 { BEGINS } else { 0 };
                let ends = if piece + 1 == pieces { ENDS } else { 0 };
                first.push((start + piece) | begins | ends);
            }
            ends.push(first.len() as u32);
            start += length;
        }
        let mut strands = Self {
            basis,
            points,
            first,
            ends,
            corners: [Vec3::ZERO; 2],
            tree: OnceLock::new(),
        };
        let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let pieces = 0..strands.pieces();
        strands.corners = pieces.fold(nothing, |[low, high], piece| {
            let [from, to] = strands.segment(piece).corners();
            [low.min(from), high.max(to)]
        });
        strands
    }

    /// The interpolation between points.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Number of pieces, or balls.
    pub fn pieces(&self) -> u32 {
        self.first.len() as u32
    }

    /// Lowest and highest corner of the bounding box.
    pub fn corners(&self) -> [Vec3; 2] {
        self.corners
    }

    /// The largest absolute coordinate.
    pub(super) fn extent(&self) -> f32 {
        let [low, high] = self.corners;
        low.abs().max(high.abs()).max_element()
    }

    /// Bytes of points and pieces, without the tree.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.points[..]) + size_of_val(&self.first[..]) + size_of_val(&self.ends[..])
    }

    fn segment(&self, piece: u32) -> Segment {
        let first = self.first[piece as usize];
        let at = (first & !(BEGINS | ENDS)) as usize;
        let p = |i: usize| self.points[i];
        match self.basis {
            Basis::Balls => Segment::straight(p(at), p(at)),
            Basis::Linear => Segment::straight(p(at), p(at + 1)),
            Basis::BSpline => Segment::b_spline([p(at), p(at + 1), p(at + 2), p(at + 3)]),
            Basis::CatmullRom => {
                let before = if first & BEGINS == 0 { at - 1 } else { at };
                let after = if first & ENDS == 0 { at + 2 } else { at + 1 };
                Segment::catmull_rom([p(before), p(at), p(at + 1), p(after)])
            }
        }
    }

    /// The pieces before and after this one on the same curve.
    fn beside(&self, piece: u32) -> [Option<Segment>; 2] {
        let first = self.first[piece as usize];
        [
            (first & BEGINS == 0).then(|| self.segment(piece - 1)),
            (first & ENDS == 0).then(|| self.segment(piece + 1)),
        ]
    }

    /// The hierarchy, built on first use.
    pub(super) fn tree(&self) -> &ItemTree {
        if let Some(tree) = self.tree.get() {
            return &tree.0;
        }
        // Outside the lock: see `Mesh::tree`.
        let tree = StrandTree(ItemTree::new(self));
        &self.tree.get_or_init(|| tree).0
    }

    /// The nearest hit in (0, t_max), in object space. Rays meet curves from outside only.
    #[inline(never)]
    pub(super) fn nearest(&self, (origin, dir): (Vec3, Vec3), t_max: f32) -> Option<StrandHit> {
        let axes = RayAxes::new(origin, dir);
        let other = |piece: u32, t_max: f32| self.hit(&axes, piece, t_max).map(|hit| (hit.t, hit));
        match self.tree().nearest(origin, dir, t_max, &|_| false, other)? {
            TreeHit::Other(hit) => Some(hit),
            TreeHit::Triangle(_) => None,
        }
    }

    /// Whether anything is hit in (0, t_max).
    #[inline(never)]
    pub(super) fn any(&self, (origin, dir): (Vec3, Vec3), t_max: f32) -> bool {
        let axes = RayAxes::new(origin, dir);
        let other = |piece: u32, t_max: f32| self.hit(&axes, piece, t_max).is_some();
        self.tree().any(origin, dir, t_max, &|_| false, other)
    }

    fn hit(&self, axes: &RayAxes, piece: u32, t_max: f32) -> Option<StrandHit> {
        let (t, u) = match self.basis {
            Basis::Balls => (cone::ball(axes, self.segment(piece).from(), t_max)?, 0.0),
            _ => self.segment(piece).hit(axes, t_max, || self.beside(piece))?,
        };
        Some(StrandHit {
            t: t as f32,
            piece,
            u: u as f32,
        })
    }

    /// Completes a hit of a ray in object space.
    pub(super) fn finish(&self, (origin, dir): (Vec3, Vec3), hit: &StrandHit) -> Finished {
        let axes = RayAxes::new(origin, dir);
        let segment = self.segment(hit.piece);
        let (center, radius) = segment.center(hit.u);
        // The search yields the distance in single precision, too coarse for something so thin.
        let t = match self.basis {
            Basis::Balls => cone::ball(&axes, segment.from(), f32::INFINITY),
            _ => segment.hit_near(&axes, hit.u),
        };
        let point = axes.at(t.unwrap_or(f64::from(hit.t)));
        let out = (point - center).normalize_or(-axes.dir());
        let point = center + out * radius;
        let first = self.first[hit.piece as usize];
        let is_cap = hit.u == 0.0 && first & BEGINS != 0 || hit.u == 1.0 && first & ENDS != 0;
        let normal = match segment.is_straight() || is_cap {
            true => out,
            false => {
                let along = segment.tangent(hit.u);
                (out - along * along.dot(out)).normalize_or(out)
            }
        };
        // Smooth along the curve, and turned towards the ray's origin.
        let away = normal.dot(axes.dir());
        let normal = match self.basis != Basis::Balls && away >= 0.0 {
            true => (normal - axes.dir() * (away + 1e-3)).normalize_or(out),
            false => normal,
        };
        Finished {
            point: point.as_vec3(),
            normal: normal.as_vec3(),
            uv: Vec2::new(
                self.along(hit.piece, hit.u),
                self.across(&segment, hit, normal, axes.dir()),
            ),
            radius: radius as f32,
        }
    }

    /// A piece's curve, and the numbers of pieces before the curve's first and last one.
    fn curve(&self, piece: u32) -> (usize, [u32; 2]) {
        let curve = self.ends.partition_point(|end| *end <= piece);
        let first = curve.checked_sub(1).map_or(0, |before| self.ends[before]);
        (curve, [first, self.ends[curve]])
    }

    /// 0 where a curve begins, 1 where it ends.
    fn along(&self, piece: u32, u: f32) -> f32 {
        if self.basis == Basis::Balls {
            return 0.0;
        }
        let (_, [first, end]) = self.curve(piece);
        ((piece - first) as f32 + u) / (end - first) as f32
    }

    /// 0 at one edge of a curve and 1 at the other, seen along `dir`.
    fn across(&self, segment: &Segment, hit: &StrandHit, normal: DVec3, dir: DVec3) -> f32 {
        let along = segment.tangent(hit.u);
        let side = along.cross(-dir).normalize_or_zero();
        (0.5 + 0.5 * side.dot(normal)).clamp(0.0, 1.0) as f32
    }

    /// Unit tangent of the curve at a hit, given its UV along it. Any direction for balls.
    pub(super) fn tangent(&self, piece: u32, along: f32) -> Vec3 {
        if self.basis == Basis::Balls {
            return Vec3::Z;
        }
        let (_, [first, end]) = self.curve(piece);
        let u = along * (end - first) as f32 - (piece - first) as f32;
        self.segment(piece).tangent(u.clamp(0.0, 1.0)).as_vec3()
    }

    /// Builds everything that rays need.
    pub(super) fn prepare(&self) {
        self.tree();
    }
}

impl Items for Strands {
    fn count(&self) -> usize {
        self.first.len()
    }
    fn item(&self, index: usize) -> Item {
        Item::Other(index as u32, self.segment(index as u32).corners())
    }
}

#[cfg(test)]
mod tests;
