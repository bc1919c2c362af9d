//! Rotations as people write them.

use glam::{DQuat, DVec4};

/// A rotation as axis and degrees.
pub fn axis_and_angle(q: DVec4) -> ([f64; 3], f64) {
    let q = if q.w < 0.0 { -q } else { q };
    let axis = q.truncate();
    let sin = axis.length();
    match axis.try_normalize() {
        Some(axis) => (axis.to_array(), 2.0 * libm::atan2(sin, q.w).to_degrees()),
        None => ([0.0, 0.0, 1.0], 0.0),
    }
}

/// A rotation from axis and degrees.
pub fn from_axis_and_angle(axis: glam::DVec3, degrees: f64) -> Option<DQuat> {
    let axis = axis.try_normalize()?;
    let (sin, cos) = libm::sincos(0.5 * degrees.to_radians());
    Some(DQuat::from_vec4((axis * sin).extend(cos)))
}
