//! The spot light's cone: a plateau, then a ramp that is linear in the angle.
//!
//! Cosines enter as 1 - cos = 2 sin^2(angle / 2), which keeps its digits in narrow cones.

use crate::math::{Frame, PI, Vec2, Vec3, atan2, sin, sin_cos};

/// Fraction of the axis' intensity at an angle from the axis.
#[inline]
pub(crate) fn falloff(angle: f32, beam_width: f32, cutoff: f32) -> f32 {
    if angle <= beam_width {
        1.0
    } else if angle < cutoff {
        (cutoff - angle) / (cutoff - beam_width)
    } else {
        0.0
    }
}

/// Angle from the frame's `n`.
#[inline]
pub(crate) fn angle_from_axis(frame: &Frame, dir: Vec3) -> f32 {
    let local = frame.to_local(dir);
    atan2(local.truncate().length(), local.z)
}

/// Integral of the falloff over all directions, sr: 2 pi (1 - (sin c - sin b) / (c - b)).
pub(super) fn effective_solid_angle(beam_width: f32, cutoff: f32) -> f32 {
    let (b, c) = (f64::from(beam_width), f64::from(cutoff));
    // (sin c - sin b) / (c - b) = cos(middle) sin(half) / half, and 1 - x y = (1 - x) + x (1 - y).
    let (middle, half) = (0.5 * (c + b), 0.5 * (c - b));
    let one_minus_cos = 2.0 * libm::pow(libm::sin(0.5 * middle), 2.0);
    let one_minus_sinc = if half < 1e-3 {
        half * half / 6.0
    } else {
        1.0 - libm::sin(half) / half
    };
    let integral = one_minus_cos + (1.0 - one_minus_cos) * one_minus_sinc;
    (2.0 * std::f64::consts::PI * integral) as f32
}

/// Draw a direction around +z: the plateau uniformly with its own share of the flux, else the ramp with a density that
/// falls linearly in the cosine. Returns it with its angle and its density per solid angle.
pub(super) fn sample(u: Vec2, beam_width: f32, cutoff: f32) -> (Vec3, f32, f32) {
    let (b, c) = (one_minus_cos(beam_width), one_minus_cos(cutoff));
    let total = effective_solid_angle(beam_width, cutoff);
    let share = (2.0 * PI * b / total).min(1.0);
    let (h, pdf) = if u.x < share || c <= b {
        ((u.x / share).min(1.0) * b, 1.0 / total)
    } else {
        let left = (1.0 - u.x) / (1.0 - share);
        let root = left.min(1.0).sqrt();
        let pdf = (1.0 - share) * root / (PI * (c - b));
        (c - (c - b) * root, pdf)
    };
    let sin_theta = (h * (2.0 - h)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.y);
    let dir = Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, 1.0 - h);
    (dir, atan2(sin_theta, 1.0 - h), pdf)
}

/// Density of [`sample`] per solid angle at an angle from the axis.
pub(crate) fn pdf(angle: f32, beam_width: f32, cutoff: f32) -> f32 {
    let (b, c) = (one_minus_cos(beam_width), one_minus_cos(cutoff));
    let total = effective_solid_angle(beam_width, cutoff);
    let share = (2.0 * PI * b / total).min(1.0);
    if angle <= beam_width || c <= b {
        f32::from(angle <= cutoff) / total
    } else {
        let root = ((c - one_minus_cos(angle)) / (c - b)).max(0.0);
        (1.0 - share) * root / (PI * (c - b))
    }
}

#[inline]
fn one_minus_cos(angle: f32) -> f32 {
    let half = sin(0.5 * angle);
    2.0 * half * half
}
