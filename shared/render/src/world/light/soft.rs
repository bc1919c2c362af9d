//! Soft falloff: lamps of which every point sees a disc that faces it, as Blender's lamps with a radius are.
//!
//! From a distance d a ball of radius r is seen in a cone of half angle asin(r / d), a disc that faces the point in one
//! of atan(r / d). With the radiance of the ball, 1 / (d^2 + r^2) of its intensity arrives there instead of 1 / d^2,
//! and light comes to points within the ball as well.
//!
//! It is light all the same. A line at a distance b from the middle sees the disc where b / t <= r / d, with t from the
//! line's foot on and d^2 = t^2 + b^2: from t = b^2 / sqrt(r^2 - b^2) on, and from there the radiance stays. So photons
//! are those of the ball, but start there on their lines.
//!
//! The disc that a point at t faces meets the line at -b^2 / t. From there on things may be in the way, for photons as
//! for shadow rays: what is at -s, behind the foot, hides the light from all that is nearer than b^2 / s.

use super::{Light, LightKind};
use crate::math::{Ray, Vec3};
use crate::world::geometry::{Object, Shape};

/// Lines that are farther out start so many radii from the middle. Less than 1e-8 of the light is there.
const FARTHEST: f32 = 1e4;

/// A lamp with soft falloff.
#[derive(Clone, Copy, Debug)]
pub struct SoftBall {
    /// Middle, render space.
    pub center: Vec3,
    /// Scene units.
    pub radius: f32,
}

/// Light along a line through the ball.
#[derive(Clone, Copy, Debug)]
pub struct SoftLine {
    /// From the point of the line that is next to the middle.
    pub from_foot: Ray,
    /// Half of what of the line is in the ball.
    pub half_chord: f32,
    /// Square of the line's distance from the middle.
    across2: f32,
    farthest: f32,
}

impl SoftLine {
    /// How far from the foot it begins to shine. `clear`: how far behind the foot nothing is in the way.
    pub fn dark(&self, clear: f32) -> f32 {
        let clear = clear.min(self.half_chord);
        match self.across2 < self.farthest * clear {
            true => self.across2 / clear,
            false => self.farthest,
        }
    }
}

impl SoftBall {
    /// That of a sphere under a similar map.
    pub(super) fn of(shape: &Shape) -> Option<Self> {
        match shape {
            Shape::Sphere { placement, .. } => Some(Self {
                center: Vec3::from(placement.render_from_object.translation),
                radius: placement.uniform_scale()?,
            }),
            Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Mesh { .. } | Shape::Strands { .. } => None,
        }
    }

    /// Light along a line through the ball.
    pub fn along(&self, line: &Ray) -> SoftLine {
        let to_foot = (self.center - line.origin).dot(line.dir);
        let from_foot = Ray {
            origin: line.at(to_foot),
            dir: line.dir,
        };
        let across2 = from_foot.origin.distance_squared(self.center);
        SoftLine {
            from_foot,
            half_chord: (self.radius * self.radius - across2).max(0.0).sqrt(),
            across2,
            farthest: FARTHEST * self.radius,
        }
    }

    /// Whether a ray that meets the ball from outside sees light: `cos` of its angle to the normal there, back along
    /// the ray, and how far it has come.
    pub fn shines_to(&self, cos: f32, distance: f32) -> bool {
        // t >= b^2 / sqrt(r^2 - b^2) with b = r sin, t = distance + r cos.
        distance * cos >= self.radius * (1.0 - 2.0 * cos * cos)
    }

    /// How far it is from there on to the disc.
    pub fn depth(&self, cos: f32, distance: f32) -> f32 {
        let half_chord = self.radius * cos;
        half_chord + self.radius * self.radius * (1.0 - cos * cos).max(0.0) / (distance + half_chord)
    }

    /// Whether light comes to a point from a direction.
    pub fn is_seen(&self, from: Vec3, wi: Vec3) -> bool {
        let offset = self.center - from;
        offset.dot(wi) > 0.0 && offset.cross(wi).length() * offset.length() <= self.radius * offset.dot(wi)
    }
}

impl Light {
    /// Its ball, if its falloff is soft.
    pub(crate) fn soft_ball(&self, objects: &[Object]) -> Option<SoftBall> {
        match &self.kind {
            LightKind::Area { object, soft: true, .. } => SoftBall::of(&objects[*object as usize].shape),
            LightKind::Spot(spot) if spot.soft => Some(SoftBall {
                center: spot.position,
                radius: spot.radius,
            }),
            LightKind::Area { .. }
            | LightKind::Spot(_)
            | LightKind::Point { .. }
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_)
            | LightKind::Environment(_)
            | LightKind::Volume(_) => None,
        }
    }

    /// Whether it is a surface in which a point lies that its light comes to, but no ray from there meets it.
    pub(crate) fn is_around(&self, objects: &[Object], from: Vec3) -> bool {
        match &self.kind {
            LightKind::Area { soft: true, .. } => {
                let ball = self.soft_ball(objects);
                ball.is_some_and(|ball| from.distance_squared(ball.center) <= ball.radius * ball.radius)
            }
            _ => false,
        }
    }
}
