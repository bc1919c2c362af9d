//! The GGX distribution of microfacet normals (Walter et al. 2007; Trowbridge & Reitz 1975). See [`super::microfacet`].

use crate::math::{PI, Vec2, Vec3};
use crate::warp::concentric_disk;

/// Walter et al. 2007, eq. 33. Avoids 1 - cos^2, which would cancel in the peak of a smooth surface.
#[inline]
pub fn density(alpha: f32, m: Vec3) -> f32 {
    let inv_alpha2 = 1.0 / (alpha * alpha);
    let x = (m.x * m.x + m.y * m.y) * inv_alpha2 + m.z * m.z;
    inv_alpha2 / (PI * x * x)
}

/// `|z| + sqrt(z^2 + alpha^2 (x^2 + y^2))` (Walter et al. 2007, eq. 34).
#[inline]
pub fn extent(alpha: f32, v: Vec3) -> f32 {
    v.z.abs() + (v.z * v.z + alpha * alpha * (v.x * v.x + v.y * v.y)).sqrt()
}

/// Heitz 2018.
#[inline]
pub fn sample_visible(alpha: f32, wo: Vec3, u: Vec2) -> Vec3 {
    let v = Vec3::new(alpha * wo.x, alpha * wo.y, wo.z).normalize();
    let length2 = v.x * v.x + v.y * v.y;
    let t1 = if length2 > 0.0 {
        Vec3::new(-v.y, v.x, 0.0) / length2.sqrt()
    } else {
        Vec3::X
    };
    let t2 = v.cross(t1);
    let disk = concentric_disk(u);
    // The half of the disk behind the visible hemisphere's rim is squeezed onto its projection.
    let s = 0.5 * (1.0 + v.z);
    let chord = (1.0 - disk.x * disk.x).max(0.0).sqrt();
    let y = (1.0 - s) * chord + s * disk.y;
    let z = (1.0 - disk.x * disk.x - y * y).max(0.0).sqrt();
    let n = t1 * disk.x + t2 * y + v * z;
    Vec3::new(alpha * n.x, alpha * n.y, n.z.max(0.0)).normalize()
}
