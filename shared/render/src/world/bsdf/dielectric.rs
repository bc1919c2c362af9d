//! Smooth dielectrics: a boundary, and a thin sheet.

use super::{BsdfSample, TransportMode, mirrored};
use crate::math::{Rgb, Vec3};
use crate::world::fresnel::fresnel_dielectric;

/// A smooth dielectric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Index of refraction inside over the one outside.
    pub eta: f32,
    /// Factor on the reflection.
    pub reflectance: Rgb,
    /// Factor on the transmission.
    pub transmittance: Rgb,
}

impl Dielectric {
    /// As a boundary between two sides: reflection and refraction.
    #[inline]
    pub(super) fn boundary(&self, wo: Vec3, mode: TransportMode) -> [BsdfSample; 2] {
        let eta = if wo.z > 0.0 { self.eta } else { 1.0 / self.eta };
        let (reflectance, cos_t) = fresnel_dielectric(wo.z.abs().min(1.0), eta);
        let z = if wo.z > 0.0 { -cos_t } else { cos_t };
        let refracted = BsdfSample {
            wi: Vec3::new(-wo.x / eta, -wo.y / eta, z).normalize(),
            weight: self.transmittance * radiance_scale(eta, mode),
            pdf: 1.0 - reflectance,
            delta: true,
            transmitted: true,
        };
        [mirrored(wo, self.reflectance, reflectance), refracted]
    }

    /// As a sheet with two boundaries. Light that bounces between them leaves at the point where it entered; 2R / (1 +
    /// R) is reflected.
    #[inline]
    pub(super) fn sheet(&self, wo: Vec3) -> [BsdfSample; 2] {
        let (once, _) = fresnel_dielectric(wo.z.abs().min(1.0), self.eta);
        let reflectance = 2.0 * once / (1.0 + once);
        let straight = BsdfSample {
            wi: -wo,
            weight: self.transmittance,
            pdf: 1.0 - reflectance,
            delta: true,
            transmitted: true,
        };
        [mirrored(wo, self.reflectance, reflectance), straight]
    }
}

/// Picks the first way with its probability, otherwise the second.
#[inline]
pub(super) fn one_of([first, second]: [BsdfSample; 2], u_lobe: f32) -> BsdfSample {
    if u_lobe < first.pdf { first } else { second }
}

/// How refraction into a side of relative index `eta` scales the carried quantity: radiance spreads over fewer or more
/// steradians, flux stays.
#[inline]
pub(super) fn radiance_scale(eta: f32, mode: TransportMode) -> f32 {
    match mode {
        TransportMode::Radiance => 1.0 / (eta * eta),
        TransportMode::Flux => 1.0,
    }
}
