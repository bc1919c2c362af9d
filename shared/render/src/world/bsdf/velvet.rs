//! Velvet: upright fibres, seen at grazing angles (M. Ashikhmin, S. Premoze, Distribution-based BRDFs, 2007, in Cycles'
//! form). A distribution of normals that lie nearly in the surface, without Fresnel.

use super::{BsdfSample, half_vector, lit_side, reflects};
use crate::math::{PI, Rgb, Vec2, Vec3, exp, sin_cos};

/// Parameters at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velvet {
    /// Factor on the reflection, in [0, 1].
    pub reflectance: Rgb,
    /// Lean of the fibres, from 0.01 to 1: with more lean, the sheen shows at less grazing angles.
    pub roughness: f32,
    /// Reflects on both sides.
    pub two_sided: bool,
}

impl Velvet {
    /// Fibres that lean less are invisible.
    pub(super) const LEAST: f32 = 0.01;

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if !reflects(wo, wi, self.two_sided) {
            return Rgb::ZERO;
        }
        let m = half_vector(wo, wi);
        let (cos_m, cos_d) = (m.z.abs(), wo.dot(m).abs());
        let sin2 = m.x * m.x + m.y * m.y;
        let (o, i) = (wo.z.abs(), wi.z.abs());
        if cos_d <= 0.0 || sin2 <= 0.0 {
            return Rgb::ZERO;
        }
        let inverse = 1.0 / (self.roughness * self.roughness);
        let density = exp(-(cos_m * cos_m / sin2) * inverse) * inverse / (PI * sin2 * sin2);
        // Masking of V-shaped grooves (Torrance, Sparrow 1967).
        let masked = (2.0 * cos_m / cos_d * o.min(i)).min(1.0);
        self.reflectance * (0.25 * density * masked / (o * i).max(f32::MIN_POSITIVE))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match reflects(wo, wi, self.two_sided) {
            true => 0.5 / PI,
            false => 0.0,
        }
    }

    /// Draws uniformly over the hemisphere.
    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let sin = (1.0 - u.x * u.x).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.y);
        let wi = Vec3::new(sin * cos_phi, sin * sin_phi, u.x) * sign;
        BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi))
    }
}
