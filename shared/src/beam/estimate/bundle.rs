//! Which beams may matter to a bundle of segments.

use super::super::store::BeamBounds;
use super::{CameraSegment, NEARLY_PARALLEL_SIN};
use crate::math::Vec3;

/// What the root of 1 - cos^2 may be short of the sine.
const SIN_ROUNDING: f32 = 1e-3;

/// Bounds of some segments: a line in their middle, and how far they may be from it.
#[derive(Clone, Copy)]
pub(super) struct Bundle {
    origin: [f32; 3],
    dir: [f32; 3],
    /// Deviation of origins, as a length.
    origin_range: f32,
    /// Deviation of directions, by axis and as a length.
    dir_range: [f32; 3],
    dir_length: f32,
    /// Its square, and rounding.
    second_order: f32,
    /// What deviation of origins and rounding of their coordinates add to distances.
    origin_slack: f32,
    /// Length of the longest segment.
    length: f32,
}

impl Bundle {
    /// Bounds of at least one segment.
    pub fn new(segments: &[CameraSegment]) -> Self {
        let range = |of: fn(&CameraSegment) -> Vec3| {
            let bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let grow = |(min, max): (Vec3, Vec3), v: Vec3| (min.min(v), max.max(v));
            let (min, max) = segments.iter().map(of).fold(bounds, grow);
            (0.5 * (min + max), 0.5 * (max - min))
        };
        let (origin, origin_range) = range(|s| s.ray.origin);
        // The middle of a box around unit vectors need not be one.
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
            origin_slack: 2.5 * origin_range.length()
                + 1e-5 * (origin.abs() + origin_range).max_element(),
            length: segments.iter().fold(0.0, |length, s| s.length.max(length)),
        }
    }

    /// Whether the segments point everywhere, so that comparing them with beams is for nothing.
    pub fn is_wide(&self) -> bool {
        self.dir_length > 0.3
    }

    /// Whether some segment may meet the beam: comes within its radius between its
    /// ends. Never false for one that does.
    ///
    /// The lines are |m . d| / |d x b| apart with m = b x w, w from o to the beam's origin, and nearest at
    /// s = (c w.d - w.b) / sin^2 along the beam and t = (w.d - c w.b) / sin^2 along the segment. All are compared times
    /// the sine or its square, and with as much slack as o and d may deviate.
    #[inline(always)]
    pub fn may_meet(&self, beam: BeamBounds) -> bool {
        let (o, d) = (self.origin, self.dir);
        let ([px, py, pz], [bx, by, bz]) = (beam.origin, beam.dir);
        let (wx, wy, wz) = (px - o[0], py - o[1], pz - o[2]);
        let (mx, my, mz) = (by * wz - bz * wy, bz * wx - bx * wz, bx * wy - by * wx);
        let (ax, ay, az) = (mx.abs(), my.abs(), mz.abs());
        let w_dot_b = wx * bx + wy * by + wz * bz;
        let w_length = wx.abs() + wy.abs() + wz.abs();

        let least = (mx * d[0] + my * d[1] + mz * d[2]).abs();
        let cos = d[0] * bx + d[1] * by + d[2] * bz;
        let w_dot_d = d[0] * wx + d[1] * wy + d[2] * wz;
        let sin2 = 1.0 - cos * cos;
        let sin = (if sin2 > 0.0 { sin2 } else { 0.0 }).sqrt() + SIN_ROUNDING + self.dir_length;
        let reach = (beam.radius + self.origin_range) * sin
            + (ax * self.dir_range[0] + ay * self.dir_range[1] + az * self.dir_range[2])
            + 2e-6 * w_length
            + self.origin_slack;
        // s sin^2 - end sin^2, and how much its gradient by d lets it vary; what is of second order goes into the slack.
        let s_sin2 = cos * w_dot_d - w_dot_b;
        let [hx, hy, hz] = self.dir_range;
        let along = (bx * w_dot_d + wx * cos).abs() * hx
            + (by * w_dot_d + wy * cos).abs() * hy
            + (bz * w_dot_d + wz * cos).abs() * hz;
        let slack = along
            + (w_length + beam.start.abs() + beam.end.abs()) * self.second_order
            + self.origin_slack;
        let turn = 2.0 * cos.abs() * (bx.abs() * hx + by.abs() * hy + bz.abs() * hz);
        let after = s_sin2 - beam.start * sin2 >= -(slack + beam.start.abs() * turn);
        let before = s_sin2 - beam.end * sin2 <= slack + beam.end.abs() * turn;
        // Chords reach beyond the nearest points.
        let parallel = sin < NEARLY_PARALLEL_SIN + 2.0 * (SIN_ROUNDING + self.dir_length);

        // The beam must not be all behind the segments, nor all beyond their ends.
        let (t0, t1) = (w_dot_d + beam.start * cos, w_dot_d + beam.end * cos);
        let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
        let margin = beam.radius
            + (w_length + beam.start.abs() + beam.end.abs()) * (self.dir_length + 1e-5)
            + self.origin_slack;
        let ahead = (far + margin >= 0.0) & (near - margin <= self.length);
        (least <= reach) & ahead & (parallel | (after & before))
    }
}
