//! Soft falloff: lamps that every point sees as a disc facing it, like Blender's lamps with a radius.
//!
//! At distance d a ball of radius r fills a cone of half angle asin(r / d); a disc that faces the point fills one of
//! atan(r / d). With the ball's radiance, 1 / (d^2 + r^2) of its intensity arrives instead of 1 / d^2, and points
//! inside the ball receive light as well.
//!
//! This is still light along lines. A line at distance b from the centre sees the disc where b / t <= r / d, with t
//! measured from the line's foot and d^2 = t^2 + b^2: from t = b^2 / sqrt(r^2 - b^2) on, with constant radiance. So
//! photons are those of the ball, but start at that point of their lines.
//!
//! The disc that a point at t faces meets the line at -b^2 / t. Beyond it objects may block the light, for photons as
//! for shadow rays: an object at -s, behind the foot, hides the light from everything nearer than b^2 / s.

use super::{Light, LightKind};
use crate::math::{Ray, Vec3};
use crate::world::geometry::{Object, Shape};

/// Lines that would start farther out start this many radii from the centre. Less than 1e-8 of the light is there.
const FARTHEST: f32 = 1e4;

/// A lamp with soft falloff.
#[derive(Clone, Copy, Debug)]
pub struct SoftBall {
    /// Centre, render space.
    pub center: Vec3,
    /// Scene units.
    pub radius: f32,
}

/// Light along a line through the ball.
#[derive(Clone, Copy, Debug)]
pub struct SoftLine {
    /// From the point of the line nearest to the centre.
    pub from_foot: Ray,
    /// Half the length of the line inside the ball.
    pub half_chord: f32,
    /// Squared distance of the line from the centre.
    across2: f32,
    farthest: f32,
}

impl SoftLine {
    /// Distance from the foot at which it begins to shine. `clear`: unobstructed distance behind the foot.
    pub fn dark(&self, clear: f32) -> f32 {
        let clear = clear.min(self.half_chord);
        match self.across2 < self.farthest * clear {
            true => self.across2 / clear,
            false => self.farthest,
        }
    }
}

impl SoftBall {
    /// The soft ball of a sphere under a similarity.
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

    /// Whether a ray that meets the ball from outside sees light. `cos`: of the angle between the reversed ray and the
    /// normal there; `distance`: that the ray has come.
    pub fn shines_to(&self, cos: f32, distance: f32) -> bool {
        // t >= b^2 / sqrt(r^2 - b^2) with b = r sin, t = distance + r cos.
        distance * cos >= self.radius * (1.0 - 2.0 * cos * cos)
    }

    /// Distance from there to the disc.
    pub fn depth(&self, cos: f32, distance: f32) -> f32 {
        let half_chord = self.radius * cos;
        half_chord + self.radius * self.radius * (1.0 - cos * cos).max(0.0) / (distance + half_chord)
    }

    /// Whether light reaches a point from a direction.
    pub fn is_seen(&self, from: Vec3, wi: Vec3) -> bool {
        let offset = self.center - from;
        offset.dot(wi) > 0.0 && offset.cross(wi).length() * offset.length() <= self.radius * offset.dot(wi)
    }
}

impl Light {
    /// The light's ball, if its falloff is soft.
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

    /// Whether its surface surrounds a point that its light reaches, but that no ray from there meets.
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
