//! Soft falloff: lamps of which every point sees a disc that faces it, as Blender's lamps with a radius are.
//!
//! From a distance d a ball of radius r is seen in a cone of half angle asin(r / d), a disc that faces the point in one
//! of atan(r / d). With the radiance of the ball, 1 / (d^2 + r^2) of its intensity arrives there instead of 1 / d^2,
//! and light comes to points within the ball as well.
//!
//! It is light all the same. A line at a distance b from the middle sees the disc where b / t <= r / d, with t from the
//! line's foot on and d^2 = t^2 + b^2: from t = b^2 / sqrt(r^2 - b^2) on, and from there the radiance stays. So photons
//! are those of the ball, but start there on their lines. What lies between the foot and the start is in their way, as
//! it is in that of shadow rays, which go to the disc.

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

/// Where the light of a line through the ball comes from.
#[derive(Clone, Copy, Debug)]
pub struct SoftStart {
    /// The point of the line that is next to the middle.
    pub foot: Vec3,
    /// How far from there on it shines.
    pub dark: f32,
}

impl SoftBall {
    /// Where light shines along a line through the ball.
    pub fn start(&self, line: &Ray) -> SoftStart {
        let to_foot = (self.center - line.origin).dot(line.dir);
        let foot = line.at(to_foot);
        let (radius2, across2) = (self.radius * self.radius, foot.distance_squared(self.center));
        let half_chord = (radius2 - across2).max(0.0).sqrt();
        let dark = match across2 < FARTHEST * self.radius * half_chord {
            true => across2 / half_chord,
            false => FARTHEST * self.radius,
        };
        SoftStart { foot, dark }
    }

    /// Whether a ray that meets the ball from outside sees light: `cos` of its angle to the normal there, back along
    /// the ray, and how far it has come.
    pub fn shines_to(&self, cos: f32, distance: f32) -> bool {
        // t >= b^2 / sqrt(r^2 - b^2) with b = r sin, t = distance + r cos.
        distance * cos >= self.radius * (1.0 - 2.0 * cos * cos)
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
            LightKind::Area { object, soft: true, .. } => match &objects[*object as usize].shape {
                Shape::Sphere { placement, .. } => Some(SoftBall {
                    center: Vec3::from(placement.render_from_object.translation),
                    radius: placement.uniform_scale()?,
                }),
                Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Mesh { .. } | Shape::Strands { .. } => None,
            },
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
