//! How the lines of a beam and a segment lie to each other.

use super::{NEARLY_PARALLEL_SIN, NEARLY_PARALLEL_SIN2};
use crate::math::Vec3;

/// How the lines of a beam and a segment lie to each other. With w from the segment's origin to the beam's, d and b
/// their directions, they are nearest at t = (w.d - c w.b) / sin^2 along the segment and s = (c w.d - w.b) / sin^2
/// along the beam,
/// |w.(d x b)| / sin apart.
#[derive(Clone, Copy)]
pub(super) struct Meeting {
    /// d.b
    pub cos: f32,
    /// Distance of the lines, times the sine.
    pub offset: f32,
    pub w_dot_d: f32,
    pub w_dot_b: f32,
}

/// Where two lines are nearest.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    /// Along the segment.
    pub t: f32,
    /// Along the beam.
    pub s: f32,
    /// Distance over radius, squared.
    pub x: f32,
    /// Kernel over sine, m^-1, where x < 1.
    pub value: f32,
}

impl Meeting {
    /// Of a segment and a beam.
    #[inline(always)]
    pub fn new(origin: Vec3, dir: Vec3, beam_origin: Vec3, beam_dir: Vec3) -> Self {
        let (w, b) = (beam_origin - origin, beam_dir);
        let moment = Vec3::new(b.y * w.z - b.z * w.y, b.z * w.x - b.x * w.z, b.x * w.y - b.y * w.x);
        let w_dot_b = w.x * b.x + w.y * b.y + w.z * b.z;
        Self::from_origin(dir, b, w, w_dot_b, moment)
    }

    /// The same, with what does not depend on the segment's direction known: w, its product with the beam's direction
    /// b, and b x w.
    #[inline(always)]
    pub fn from_origin(dir: Vec3, beam_dir: Vec3, w: Vec3, w_dot_b: f32, moment: Vec3) -> Self {
        Self {
            cos: dir.x * beam_dir.x + dir.y * beam_dir.y + dir.z * beam_dir.z,
            offset: dir.x * moment.x + dir.y * moment.y + dir.z * moment.z,
            w_dot_d: dir.x * w.x + dir.y * w.y + dir.z * w.z,
            w_dot_b,
        }
    }

    /// The sine squared.
    #[inline(always)]
    pub fn sin2(self) -> f32 {
        1.0 - self.cos * self.cos
    }

    /// Distance along the segment, times the sine squared.
    #[inline(always)]
    pub fn t_sin2(self) -> f32 {
        self.w_dot_d - self.cos * self.w_dot_b
    }

    /// Distance along the beam, times the sine squared.
    #[inline(always)]
    pub fn s_sin2(self) -> f32 {
        self.cos * self.w_dot_d - self.w_dot_b
    }

    /// Whether the chord is to be integrated: the lines are nearly parallel, and within the radius of each other
    /// somewhere between `start` and `end` along the beam.
    #[inline(always)]
    pub fn is_chord(self, radius: f32, start: f32, end: f32) -> bool {
        let sin2 = self.sin2();
        // Beyond the nearest points by up to radius / sine.
        let beyond = NEARLY_PARALLEL_SIN * radius;
        // With room for what the sine of the smallest angles is off by.
        (sin2 < NEARLY_PARALLEL_SIN2)
            & (self.offset * self.offset <= 1.01 * radius * radius * (sin2 + 1e-5))
            & (self.s_sin2() + beyond >= start * sin2)
            & (self.s_sin2() - beyond <= end * sin2)
    }

    /// Distance of the lines against the largest radius, without a division, where the 1D estimate is due.
    #[inline(always)]
    pub fn is_reached(self, radius: f32) -> bool {
        (self.offset * self.offset < radius * radius * self.sin2()) & (self.sin2() >= NEARLY_PARALLEL_SIN2)
    }

    /// For a beam's radius and its slope.
    #[inline(always)]
    pub fn nearest(self, radius: f32, radius_slope: f32) -> Nearest {
        // One division serves both 1 / sin^2 and 1 / radius.
        let sin2 = self.sin2();
        let s_sin2 = self.s_sin2();
        let r_sin2 = radius * sin2 + radius_slope * s_sin2;
        let inv = 1.0 / (sin2 * r_sin2);
        let inv_sin2 = inv * r_sin2;
        let inv_r_sin2 = inv * sin2;
        // (u / r)^2 with u = offset / sin.
        let x = self.offset * inv_r_sin2;
        let x = x * x * sin2;
        Nearest {
            t: self.t_sin2() * inv_sin2,
            s: s_sin2 * inv_sin2,
            x,
            value: 0.75 * (1.0 - x) * sin2.sqrt() * inv_r_sin2,
        }
    }
}
