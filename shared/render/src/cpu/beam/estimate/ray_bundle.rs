//! Which beams may matter to a bundle of camera rays.

use super::super::store::{Bounds, Cluster};
use super::search::Probe;
use super::{CameraSegment, NEARLY_PARALLEL_SIN};
use crate::math::Vec3;

/// How far sqrt(1 - cos^2) may fall short of the sine.
const SIN_ROUNDING: f32 = 1e-3;

/// Bounds of some segments: a line in their middle, and how far they may deviate from it.
#[derive(Clone, Copy)]
pub(super) struct RayBundle {
    origin: [f32; 3],
    dir: [f32; 3],
    /// Deviation of origins, as a length.
    origin_range: f32,
    /// Deviation of directions, by axis and as a length.
    dir_range: [f32; 3],
    dir_length: f32,
    /// `dir_length` squared, and rounding.
    second_order: f32,
    /// What the deviation of origins and rounding of their coordinates add to distances.
    origin_slack: f32,
    /// Length of the longest segment.
    length: f32,
}

impl RayBundle {
    /// Bounds of at least one segment.
    pub fn new(segments: &[CameraSegment]) -> Self {
        let range = |of: fn(&CameraSegment) -> Vec3| {
            let bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let grow = |(min, max): (Vec3, Vec3), v: Vec3| (min.min(v), max.max(v));
            let (min, max) = segments.iter().map(of).fold(bounds, grow);
            (0.5 * (min + max), 0.5 * (max - min))
        };
        let (origin, origin_range) = range(|s| s.ray.origin);
        // The middle of a box around unit vectors need not be a unit vector.
        let (middle, _) = range(|s| s.ray.dir);
        let dir = middle.normalize_or_zero();
        let grow = |most: Vec3, s: &CameraSegment| most.max((s.ray.dir - dir).abs());
        let dir_range = segments.iter().fold(Vec3::ZERO, grow);
        Self {
            origin: origin.to_array(),
            dir: dir.to_array(),
            origin_range: origin_range.length(),
            dir_range: dir_range.to_array(),
            dir_length: dir_range.length(),
            second_order: dir_range.length_squared() + 1e-5,
            origin_slack: 2.5 * origin_range.length() + 1e-5 * (origin.abs() + origin_range).max_element(),
            length: segments.iter().fold(0.0, |length, s| s.length.max(length)),
        }
    }

    /// Whether the directions spread so widely that comparing the bundle with beams is useless.
    pub fn is_wide(&self) -> bool {
        self.dir_length > 0.3
    }

    /// How far apart the segments are, halfway along the longest.
    pub fn spread(&self) -> f32 {
        self.origin_range + 0.5 * self.length * self.dir_length
    }

    /// Whether some segment may come within the radius of a piece, between its ends. The piece's middle and direction
    /// are within `ranges` of those given. Never false for a piece that is met.
    ///
    /// The lines are |m . d| / |d x b| apart, with m = b x w and w from o to the piece's middle. They are nearest at s
    /// = (c w.d - w.b) / sin^2 along the piece and t = (w.d - c w.b) / sin^2 along the segment. All comparisons are
    /// multiplied by the sine or its square, with as much slack as o and d may deviate.
    #[inline(always)]
    fn may_meet_any<const CLUSTER: bool>(&self, piece: Bounds, ranges: [f32; 2]) -> bool {
        let (o, d) = (self.origin, self.dir);
        let ([px, py, pz], [bx, by, bz]) = (piece.middle, piece.dir);
        let (wx, wy, wz) = (px - o[0], py - o[1], pz - o[2]);
        let (mx, my, mz) = (by * wz - bz * wy, bz * wx - bx * wz, bx * wy - by * wx);
        let (ax, ay, az) = (mx.abs(), my.abs(), mz.abs());
        let w_dot_b = wx * bx + wy * by + wz * bz;
        let w_length = wx.abs() + wy.abs() + wz.abs();
        let ends = piece.half + piece.half;

        let least = (mx * d[0] + my * d[1] + mz * d[2]).abs();
        let cos = d[0] * bx + d[1] * by + d[2] * bz;
        let w_dot_d = d[0] * wx + d[1] * wy + d[2] * wz;
        let sin2 = 1.0 - cos * cos;
        let mut sin = (if sin2 > 0.0 { sin2 } else { 0.0 }).sqrt() + SIN_ROUNDING + self.dir_length;
        let mut moment_slack = ax * self.dir_range[0]
            + ay * self.dir_range[1]
            + az * self.dir_range[2]
            + 2e-6 * w_length
            + self.origin_slack;
        // s sin^2, and how far its gradient by d lets it vary; second-order terms go into the slack.
        let s_sin2 = cos * w_dot_d - w_dot_b;
        let [hx, hy, hz] = self.dir_range;
        let along = (bx * w_dot_d + wx * cos).abs() * hx
            + (by * w_dot_d + wy * cos).abs() * hy
            + (bz * w_dot_d + wz * cos).abs() * hz;
        let mut slack = along + (w_length + ends) * self.second_order + self.origin_slack;
        let turn = 2.0 * cos.abs() * (bx.abs() * hx + by.abs() * hy + bz.abs() * hz);
        let mut margin = piece.radius + (w_length + ends) * (self.dir_length + 1e-5) + self.origin_slack;
        let mut near = true;
        if CLUSTER {
            // What the pieces' deviations change. Deviating directions turn pieces about their middles, so they matter
            // in proportion to the distance from the segment.
            let [middle, dir] = ranges;
            let (ux, uy, uz) = (wx - w_dot_d * d[0], wy - w_dot_d * d[1], wz - w_dot_d * d[2]);
            let away = (ux * ux + uy * uy + uz * uz).sqrt();
            let range = middle + self.origin_range + (w_length + middle) * (self.dir_length + 1e-5);
            let most = dir * (away + range) + middle;
            near = away <= piece.half + piece.radius + range;
            moment_slack += most;
            slack += most + piece.half * (2.0 * dir + dir * dir);
            margin += middle + ends * dir;
            sin += dir;
        }
        let reach = (piece.radius + self.origin_range) * sin + moment_slack;
        let within = s_sin2.abs() - piece.half * sin2 <= slack + piece.half * turn;
        // Chords reach beyond the nearest points.
        let mut parallel_below = NEARLY_PARALLEL_SIN + 2.0 * (SIN_ROUNDING + self.dir_length);
        if CLUSTER {
            parallel_below += 2.0 * ranges[1];
        }
        let parallel = sin < parallel_below;

        // The piece must not be wholly behind the segments, nor wholly beyond their ends.
        let extent = piece.half * cos.abs();
        let ahead = (w_dot_d + extent + margin >= 0.0) & (w_dot_d - extent - margin <= self.length);
        (least <= reach) & near & ahead & (parallel | within)
    }
}

impl Probe for RayBundle {
    #[inline(always)]
    fn may_meet_cluster(&self, cluster: &Cluster, lane: usize) -> bool {
        let ranges = [cluster.ranges[0][lane], cluster.ranges[1][lane]];
        self.may_meet_any::<true>(Bounds::of_lane(&cluster.rows, lane), ranges)
    }

    #[inline(always)]
    fn may_meet(&self, piece: Bounds) -> bool {
        self.may_meet_any::<false>(piece, [0.0; 2])
    }
}
