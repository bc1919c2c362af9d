//! Rays and round cones: the union of all balls between two balls, with linearly interpolated centres and radii.
//!
//! A round cone is convex: a ray enters it where it first enters either ball, or the cone that touches both, between
//! its contact circles. Computed in double precision and relative to a point nearby, so that distant hairs are as
//! precise as near ones.

use crate::math::Vec3;
use glam::{DVec3, DVec4};

/// A ray with a frame whose third axis is its direction.
pub(super) struct RayAxes {
    origin: DVec3,
    x: DVec3,
    y: DVec3,
    z: DVec3,
    /// Length of the direction.
    length: f64,
}

impl RayAxes {
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        let dir = dir.as_dvec3();
        let length = dir.length();
        let z = dir / length;
        let (x, y) = z.any_orthonormal_pair();
        Self {
            origin: origin.as_dvec3(),
            x,
            y,
            z,
            length,
        }
    }

    /// Unit direction.
    pub fn dir(&self) -> DVec3 {
        self.z
    }

    /// The point at this many lengths of the direction.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.z * (t * self.length)
    }

    /// The view along the ray, with the origin next to a point.
    pub fn about(&self, point: DVec3) -> View<'_> {
        let way = (point - self.origin).dot(self.z);
        View {
            axes: self,
            way,
            origin: self.origin + self.z * way,
        }
    }
}

/// The frame of a ray, relative to a point on it.
pub(super) struct View<'a> {
    axes: &'a RayAxes,
    /// Distance from the ray's own origin.
    way: f64,
    origin: DVec3,
}

impl View<'_> {
    /// A ball in this frame.
    pub fn of(&self, ball: DVec4) -> DVec4 {
        let offset = ball.truncate() - self.origin;
        let axes = self.axes;
        DVec4::new(offset.dot(axes.x), offset.dot(axes.y), offset.dot(axes.z), ball.w)
    }

    /// In lengths of the direction, if ahead of the origin.
    fn ahead(&self, z: f64) -> Option<f64> {
        let t = (self.way + z) / self.axes.length;
        // Must hold in single precision as well.
        (t as f32 > 0.0).then_some(t)
    }
}

/// Where the ray enters the round cone between two balls, in lengths of its direction, and which ball between them it
/// touches there. None if it starts inside. Balls are in the ray's frame.
pub(super) fn entry(view: &View<'_>, a: DVec4, b: DVec4) -> Option<(f64, f64)> {
    let (axis, taper) = (b.truncate() - a.truncate(), a.w - b.w);
    // Closest approach of the ray to the line between both, seen from the side.
    let across2 = axis.x * axis.x + axis.y * axis.y;
    let along = -(a.x * axis.x + a.y * axis.y);
    let s = if across2 > 0.0 {
        (along / across2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let (x, y) = (a.x + s * axis.x, a.y + s * axis.y);
    let widest = a.w.max(b.w);
    if x * x + y * y > widest * widest {
        return None;
    }
    let mut best: Option<(f64, f64)> = None;
    let mut add = |z: f64, u: f64| {
        if best.is_none_or(|(nearest, _)| z < nearest) {
            best = Some((z, u));
        }
    };
    for (ball, u) in [(a, 0.0), (b, 1.0)] {
        let h = ball.w * ball.w - ball.x * ball.x - ball.y * ball.y;
        if h >= 0.0 && ball.w > 0.0 {
            add(ball.z - h.sqrt(), u);
        }
    }
    // The cone: points whose distance from the axis, along the normals, is the radius there. None if one ball contains
    // the other.
    let m0 = axis.length_squared();
    let d2 = m0 - taper * taper;
    if d2 > 1e-12 * m0 {
        let oa = -a.truncate();
        let (m1, m2, m3, m5) = (axis.dot(oa), axis.z, oa.z, oa.length_squared());
        let k2 = d2 - m2 * m2;
        let k1 = d2 * m3 - m1 * m2 + m2 * taper * a.w;
        let k0 = d2 * m5 - m1 * m1 + m1 * taper * a.w * 2.0 - m0 * a.w * a.w;
        let h = k1 * k1 - k0 * k2;
        if h >= 0.0 {
            let q = -(k1 + h.sqrt().copysign(k1));
            for z in [q / k2, k0 / q] {
                let y = m1 - a.w * taper + z * m2;
                // Entering, not leaving. NaN if there is no such root.
                let into = d2 * (oa.z + z) - axis.z * y;
                if y > 0.0 && y < d2 && into < 0.0 {
                    add(z, y / d2);
                }
            }
        }
    }
    let (z, u) = best?;
    Some((view.ahead(z)?, u))
}

/// Whether a point of the ray is inside the round cone between two balls by more than rounding.
pub(super) fn holds(view: &View<'_>, a: DVec4, b: DVec4, t: f64) -> bool {
    const MARGIN: f64 = 1e-7;
    let z = t * view.axes.length - view.way;
    let (axis, taper) = (b.truncate() - a.truncate(), a.w - b.w);
    let oa = DVec3::new(-a.x, -a.y, z - a.z);
    // The maximum along the axis of the squared radius minus the squared distance.
    let (m0, m1) = (axis.length_squared(), axis.dot(oa));
    let d2 = m0 - taper * taper;
    let depth = |s: f64| {
        let radius = a.w - s * taper;
        (radius * radius - (oa - axis * s).length_squared(), radius)
    };
    let within = |(depth, radius): (f64, f64)| depth > MARGIN * radius * radius;
    match d2 > 0.0 {
        true => within(depth(((m1 - a.w * taper) / d2).clamp(0.0, 1.0))),
        false => within(depth(0.0)) || within(depth(1.0)),
    }
}

/// The first point of a ball ahead of a ray's origin and before `t_max`.
pub(super) fn ball(axes: &RayAxes, ball: DVec4, t_max: f32) -> Option<f64> {
    let view = axes.about(ball.truncate());
    let seen = view.of(ball);
    let h = ball.w * ball.w - seen.x * seen.x - seen.y * seen.y;
    if h.is_nan() || h < 0.0 {
        return None;
    }
    let root = h.sqrt();
    let t = view.ahead(seen.z - root).or_else(|| view.ahead(seen.z + root))?;
    ((t as f32) < t_max).then_some(t)
}
