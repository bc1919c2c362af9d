//! Maps from uniform numbers in [0, 1)^2 to distributions, each sampler next to its density.

use crate::math::{PI, Vec2, Vec3, sin_cos};

const FRAC_1_PI: f32 = std::f32::consts::FRAC_1_PI;

/// Unit vector, uniform over the sphere.
#[inline]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    // sin = 2 sqrt(u (1 - u)) equals sqrt(1 - z^2) and does not cancel at the poles.
    let r = 2.0 * (u.x * (1.0 - u.x)).sqrt();
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.y);
    Vec3::new(r * cos_phi, r * sin_phi, z)
}

/// Density of [`uniform_sphere`] per solid angle: 1/(4 pi).
#[inline]
pub fn uniform_sphere_pdf() -> f32 {
    0.25 * FRAC_1_PI
}

/// Unit vector with z >= 0, density proportional to z (Malley's method).
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let (r, phi) = concentric_polar(u);
    let (sin_phi, cos_phi) = sin_cos(phi);
    // From the radius, not from the point, which rounding may put on the rim.
    let z = ((1.0 - r) * (1.0 + r)).sqrt();
    Vec3::new(r * cos_phi, r * sin_phi, z)
}

/// Density of [`cosine_hemisphere`] per solid angle; zero below the horizon.
#[inline]
pub fn cosine_hemisphere_pdf(cos: f32) -> f32 {
    cos.max(0.0) * FRAC_1_PI
}

/// Point in the unit disk, uniform by area (Shirley & Chiu 1997, concentric map).
#[inline]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let (r, phi) = concentric_polar(u);
    let (sin_phi, cos_phi) = sin_cos(phi);
    Vec2::new(r * cos_phi, r * sin_phi)
}

/// Radius in [-1, 1] and angle of a point uniform in the unit disk.
#[inline]
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

/// Density of [`concentric_disk`] per area of the unit disk: 1/pi.
#[inline]
pub fn concentric_disk_pdf() -> f32 {
    FRAC_1_PI
}

/// Unit vector, uniform over the cone around +z whose half angle has the cosine `cos_max`.
#[inline]
pub fn uniform_cone(u: Vec2, cos_max: f32) -> Vec3 {
    uniform_cap(u, 1.0 - cos_max)
}

/// [`uniform_cone`], given 1 - cos: narrow cones keep their digits.
#[inline]
pub fn uniform_cap(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let one_minus_cos = u.x * one_minus_cos_max;
    let sin_theta = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.y);
    Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, 1.0 - one_minus_cos)
}

/// Density of [`uniform_cone`] per solid angle, inside the cone. Infinite where `cos_max` is 1.
#[inline]
pub fn uniform_cone_pdf(cos_max: f32) -> f32 {
    1.0 / (2.0 * PI * (1.0 - cos_max))
}

/// Barycentric coordinates (b1, b2) of a point uniform by area in a triangle; b0 = 1 - b1 - b2, which is never
/// negative (Heitz 2019, low-distortion map).
#[inline]
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let x = 0.5 * u.x;
        Vec2::new(x, u.y - x)
    } else {
        let y = 0.5 * u.y;
        Vec2::new(u.x - y, y)
    }
}

/// Density of [`uniform_triangle`] per area of the (b1, b2) plane: 2; per surface area it is 1 / area.
#[inline]
pub fn uniform_triangle_pdf() -> f32 {
    2.0
}

/// The power heuristic (Veach 1997, section 9.2.4) with exponent 2.
pub(crate) fn power_heuristic(a: f32, b: f32) -> f32 {
    let (a2, b2) = (a * a, b * b);
    if a2.is_infinite() {
        return 1.0;
    }
    if a2 > 0.0 { a2 / (a2 + b2) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = Vec2> {
        let top = 1.0 - 1.0 / (1u32 << 24) as f32;
        let axis = move |i: u32| (i as f32 / 32.0).min(top);
        (0..=32).flat_map(move |i| (0..=32).map(move |j| Vec2::new(axis(i), axis(j))))
    }

    #[test]
    fn directions_are_unit_and_within_their_domain() {
        for u in grid() {
            let sphere = uniform_sphere(u);
            let hemisphere = cosine_hemisphere(u);
            assert!((sphere.length() - 1.0).abs() < 1e-6);
            assert!((hemisphere.length() - 1.0).abs() < 1e-6 && hemisphere.z >= 0.0);
            for cos_max in [-1.0, 0.0, 0.5, 1.0 - 1e-6, 1.0] {
                let cone = uniform_cone(u, cos_max);
                assert!((cone.length() - 1.0).abs() < 1e-6 && cone.z >= cos_max);
            }
        }
    }

    #[test]
    fn points_are_within_disk_and_triangle() {
        for u in grid() {
            assert!(concentric_disk(u).length() <= 1.0 + 1e-6);
            let b = uniform_triangle(u);
            assert!(b.x >= 0.0 && b.y >= 0.0 && 1.0 - b.x - b.y >= 0.0, "{u} -> {b}");
        }
    }
}
