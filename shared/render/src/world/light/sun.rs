//! Light from infinitely far away: parallel, or from a cone, like the sun's.

use crate::math::{Frame, PI, Rgb, Vec2, Vec3, sin};
use crate::warp;

/// Light from infinitely far away, with constant radiance in its cone.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    /// Unit direction of travel of the central light.
    pub direction: Vec3,
    /// W/m^2 on a plane across that direction.
    pub irradiance: Rgb,
    /// Half angle of the cone of directions in radians, below pi / 2; 0 for parallel light.
    pub half_angle: f32,
}

impl Sun {
    /// Whether its light is parallel.
    pub fn is_parallel(&self) -> bool {
        self.half_angle == 0.0
    }

    /// W/m^2 on planes across each direction, summed over the directions. A plane across the central one receives less
    /// from oblique directions.
    pub fn fluence(&self) -> Rgb {
        self.irradiance * (2.0 / (2.0 - self.one_minus_cos()))
    }

    /// A direction of travel, uniform in the cone.
    pub(crate) fn sample(&self, u: Vec2) -> Vec3 {
        match self.is_parallel() {
            true => self.direction,
            false => Frame::from_normal(self.direction).to_world(warp::uniform_cap(u, self.one_minus_cos())),
        }
    }

    /// Density of its directions per solid angle, constant in the cone; 1 for parallel light, which has one direction.
    pub fn pdf(&self) -> f32 {
        match self.is_parallel() {
            true => 1.0,
            false => 1.0 / (2.0 * PI * self.one_minus_cos()),
        }
    }

    /// One minus the cosine of the half angle.
    pub fn one_minus_cos(&self) -> f32 {
        let half = sin(0.5 * self.half_angle);
        2.0 * half * half
    }
}
