//! The GGX distribution of microfacet normals (Walter et al. 2007; Trowbridge & Reitz 1975), isotropic.
//!
//! All functions take directions in the local frame. Masking and shadowing are Smith's, uncorrelated: G = G1(wo) G1(wi).

use crate::math::{PI, Vec2, Vec3};
use crate::warp::concentric_disk;

/// A GGX distribution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    /// Roughness, at least 1e-3.
    pub alpha: f32,
}

impl Ggx {
    /// D(m) in 1/sr for a unit normal with `m.z >= 0`: Walter et al. 2007, eq. 33. Written without 1 - cos^2, which would
    /// cancel in the peak of a smooth surface.
    #[inline]
    pub fn density(&self, m: Vec3) -> f32 {
        let inv_alpha2 = 1.0 / (self.alpha * self.alpha);
        let x = (m.x * m.x + m.y * m.y) * inv_alpha2 + m.z * m.z;
        inv_alpha2 / (PI * x * x)
    }

    /// `|z| + sqrt(z^2 + alpha^2 (x^2 + y^2))`, by which `G1(v) = 2 |z| / extent(v)` (Walter et al. 2007, eq. 34). At least
    /// `alpha`, so that the cosines in the microfacet formulas cancel and nothing is infinite at grazing angles.
    #[inline]
    pub fn extent(&self, v: Vec3) -> f32 {
        v.z.abs() + (v.z * v.z + self.alpha * self.alpha * (v.x * v.x + v.y * v.y)).sqrt()
    }

    /// Smith's masking of the side that `v` is on.
    #[inline]
    pub fn g1(&self, v: Vec3) -> f32 {
        2.0 * v.z.abs() / self.extent(v)
    }

    /// A normal visible from `wo`, `wo.z > 0`, with density `G1(wo) max(0, wo . m) D(m) / wo.z` per solid angle: Heitz 2018.
    #[inline]
    pub fn sample_visible(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let v = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let length2 = v.x * v.x + v.y * v.y;
        let t1 = if length2 > 0.0 {
            Vec3::new(-v.y, v.x, 0.0) / length2.sqrt()
        } else {
            Vec3::X
        };
        let t2 = v.cross(t1);
        let disk = concentric_disk(u);
        // The half of the disk that lies behind the visible hemisphere's rim is squeezed onto its projection.
        let s = 0.5 * (1.0 + v.z);
        let chord = (1.0 - disk.x * disk.x).max(0.0).sqrt();
        let y = (1.0 - s) * chord + s * disk.y;
        let z = (1.0 - disk.x * disk.x - y * y).max(0.0).sqrt();
        let n = t1 * disk.x + t2 * y + v * z;
        Vec3::new(self.alpha * n.x, self.alpha * n.y, n.z.max(0.0)).normalize()
    }
}
