//! What `kernels/warp.wgsl` computes: the renderer's distributions, with the kernels' sine and cosine. Triangles use
//! neither, and so have the renderer's own bits.

use super::sin_cos;
use beamfarm_render::math::{PI, Vec2, Vec3};

/// Unit vector, uniform over the sphere.
#[must_use]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let r = 2.0 * (u.x * (1.0 - u.x)).sqrt();
    let (sine, cosine) = sin_cos(2.0 * PI * u.y);
    Vec3::new(r * cosine, r * sine, 1.0 - 2.0 * u.x)
}

/// Unit vector with z >= 0, with density proportional to z.
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let (r, phi) = concentric_polar(u);
    let (sine, cosine) = sin_cos(phi);
    Vec3::new(r * cosine, r * sine, ((1.0 - r) * (1.0 + r)).sqrt())
}

/// Point in the unit disk, uniform by area.
#[must_use]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let (r, phi) = concentric_polar(u);
    let (sine, cosine) = sin_cos(phi);
    Vec2::new(r * cosine, r * sine)
}

/// Unit vector, uniform over the cone around +z; the argument is 1 - cos of its half angle.
#[must_use]
pub fn uniform_cap(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let one_minus_cos = u.x * one_minus_cos_max;
    let square = one_minus_cos * (2.0 - one_minus_cos);
    let sin_theta = if square > 0.0 { square.sqrt() } else { 0.0 };
    let (sine, cosine) = sin_cos(2.0 * PI * u.y);
    Vec3::new(sin_theta * cosine, sin_theta * sine, 1.0 - one_minus_cos)
}

/// Radius in [-1, 1] and angle of a point uniform in the unit disk.
fn concentric_polar(u: Vec2) -> (f32, f32) {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() > b.abs() {
        (a, (PI / 4.0) * (b / a))
    } else {
        (b, PI / 2.0 - (PI / 4.0) * (a / b))
    }
}
