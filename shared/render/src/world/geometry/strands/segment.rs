//! A piece of a curve.

use super::cone::{self, RayAxes, View};
use crate::math::Vec3;
use glam::{DVec3, DVec4, Vec4, Vec4Swizzles};

/// A cubic piece is cut until its parts deviate from it by at most this share of its largest radius.
const FLATNESS: f64 = 0.05;
/// Most parts of a piece.
const MOST_PARTS: f64 = 32.0;

/// A piece of a curve as a Bézier curve: positions and radii.
pub(super) struct Segment {
    points: [Vec4; 4],
    is_straight: bool,
}

impl Segment {
    pub fn straight(from: Vec4, to: Vec4) -> Self {
        Self {
            points: [from, from, to, to],
            is_straight: true,
        }
    }

    pub fn b_spline([a, b, c, d]: [Vec4; 4]) -> Self {
        let third = 1.0 / 3.0;
        let [first, second] = [(2.0 * b + c) * third, (b + 2.0 * c) * third];
        let before = (a + 2.0 * b) * third;
        let after = (2.0 * c + d) * third;
        Self {
            points: [0.5 * (before + first), first, second, 0.5 * (second + after)],
            is_straight: false,
        }
    }

    pub fn catmull_rom([a, b, c, d]: [Vec4; 4]) -> Self {
        Self {
            points: [b, b + (c - a) * (1.0 / 6.0), c - (d - b) * (1.0 / 6.0), c],
            is_straight: false,
        }
    }

    pub fn is_straight(&self) -> bool {
        self.is_straight
    }

    /// Its first ball.
    pub fn from(&self) -> DVec4 {
        self.points[0].as_dvec4()
    }

    /// Corners of a bounding box.
    pub fn corners(&self) -> [Vec3; 2] {
        let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        self.points.iter().fold(nothing, |[low, high], p| {
            let r = p.w.max(0.0);
            [low.min(p.xyz() - r), high.max(p.xyz() + r)]
        })
    }

    /// Number of straight parts. The distance of a Bézier curve from them is at most this share of its second
    /// differences over the square of their number (Wang, Shu, Yang 1984).
    fn parts(&self) -> usize {
        if self.is_straight {
            return 1;
        }
        let [a, b, c, d] = self.points;
        let bend = (a - 2.0 * b + c).xyz().length().max((b - 2.0 * c + d).xyz().length());
        let radius = a.w.max(b.w).max(c.w).max(d.w);
        let parts = (0.75 * f64::from(bend) / (FLATNESS * f64::from(radius))).sqrt().ceil();
        // NaN where both are zero.
        if parts >= 1.0 {
            parts.min(MOST_PARTS) as usize
        } else {
            1
        }
    }

    /// Position and radius at an end of a part.
    fn at(&self, part: usize, parts: usize) -> DVec4 {
        let [a, b, c, d] = self.points.map(Vec4::as_dvec4);
        let point = match part {
            0 => a,
            _ if part == parts => d,
            _ => {
                let u = part as f64 / parts as f64;
                let v = 1.0 - u;
                a * (v * v * v) + b * (3.0 * u * v * v) + c * (3.0 * u * u * v) + d * (u * u * u)
            }
        };
        // Interpolating curves may swing below zero between their points.
        point.with_w(point.w.max(0.0))
    }

    /// Where a ray enters the piece before `t_max`, and where along it. If that is inside one of its `others` or inside
    /// another part, the ray started inside the curve, and leaves it without a hit.
    pub fn hit(&self, axes: &RayAxes, t_max: f32, others: impl Fn() -> [Option<Self>; 2]) -> Option<(f64, f64)> {
        let middle = 0.5 * (self.points[0] + self.points[3]).xyz().as_dvec3();
        let view = axes.about(middle);
        if self.is_beside(&view) {
            return None;
        }
        let mut best = None;
        let mut nearest = f64::from(t_max);
        let parts = self.parts();
        let mut from = view.of(self.at(0, parts));
        for part in 0..parts {
            let to = view.of(self.at(part + 1, parts));
            if let Some((t, u)) = cone::entry(&view, from, to)
                && t < nearest
                && !self.covers(&view, t, Some(part))
                && !others().iter().flatten().any(|other| other.covers(&view, t, None))
            {
                nearest = t;
                best = Some((t, (part as f64 + u) / parts as f64));
            }
            from = to;
        }
        best.filter(|(t, _)| (*t as f32) < t_max)
    }

    /// Whether its control points, with their radii, all lie on one side of a ray, so that the piece misses it.
    fn is_beside(&self, view: &View<'_>) -> bool {
        let seen = self.points.map(|p| view.of(p.as_dvec4()));
        let widest = seen.iter().fold(0.0, |widest: f64, p| widest.max(p.w));
        let all = |side: &dyn Fn(&DVec4) -> f64| seen.iter().all(|p| side(p) > widest);
        all(&|p| p.x) || all(&|p| -p.x) || all(&|p| p.y) || all(&|p| -p.y)
    }

    /// Whether a point of a ray is inside any of its parts, except one.
    fn covers(&self, view: &View<'_>, t: f64, but: Option<usize>) -> bool {
        let parts = self.parts();
        let mut from = view.of(self.at(0, parts));
        (0..parts).any(|part| {
            let to = view.of(self.at(part + 1, parts));
            let is_in = but != Some(part) && cone::holds(view, from, to, t);
            from = to;
            is_in
        })
    }

    /// Where a ray enters the part at `u`.
    pub fn hit_near(&self, axes: &RayAxes, u: f32) -> Option<f64> {
        let middle = 0.5 * (self.points[0] + self.points[3]).xyz().as_dvec3();
        let view = axes.about(middle);
        let (part, parts, _) = self.part_at(u);
        let [from, to] = [part, part + 1].map(|end| view.of(self.at(end, parts)));
        cone::entry(&view, from, to).map(|(t, _)| t)
    }

    /// The index of the part at `u`, the number of parts, and the position along the part.
    fn part_at(&self, u: f32) -> (usize, usize, f64) {
        let parts = self.parts();
        let along = f64::from(u) * parts as f64;
        let part = (along as usize).min(parts - 1);
        (part, parts, (along - part as f64).clamp(0.0, 1.0))
    }

    /// The ball there: centre and radius.
    pub fn center(&self, u: f32) -> (DVec3, f64) {
        let (part, parts, along) = self.part_at(u);
        let [from, to] = [part, part + 1].map(|end| self.at(end, parts));
        let ball = from + (to - from) * along;
        (ball.truncate(), ball.w)
    }

    /// Unit tangent.
    pub fn tangent(&self, u: f32) -> DVec3 {
        let [a, b, c, d] = self.points.map(|p| p.xyz().as_dvec3());
        let straight = (d - a).normalize_or(DVec3::Z);
        if self.is_straight {
            return straight;
        }
        let u = f64::from(u);
        let v = 1.0 - u;
        let along = (b - a) * (v * v) + (c - b) * (2.0 * u * v) + (d - c) * (u * u);
        along.normalize_or(straight)
    }
}
