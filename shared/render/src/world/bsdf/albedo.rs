//! A surface's reflectance as one colour.

use super::{Bsdf, RoughConductor, fresnel_conductor};
use crate::math::Rgb;

impl Bsdf<'_> {
    /// Approximate share of light that the surface sends on. Exact for diffuse surfaces; for mirrors, metals and coated
    /// surfaces, at normal incidence; 1 for clear dielectrics; for hair, of a large mass of it.
    pub fn albedo(&self) -> Rgb {
        match *self {
            Self::Black => Rgb::ZERO,
            Self::Diffuse { reflectance, .. } | Self::Mirror { reflectance, .. } => reflectance,
            Self::Conductor {
                eta, k, reflectance, ..
            }
            | Self::RoughConductor(RoughConductor {
                eta, k, reflectance, ..
            }) => reflectance * fresnel_conductor(1.0, eta, k),
            Self::Translucent(b) => b.reflectance + b.transmittance,
            Self::OrenNayar(b) => b.reflectance,
            Self::Velvet(b) => b.reflectance,
            Self::Sheen(b) => b.fibers.color * b.fibers.mean_albedo(),
            Self::Dielectric(b) | Self::ThinDielectric(b) => b.transmittance,
            Self::RoughDielectric(b) => b.transmittance,
            Self::Plastic(b) => b.albedo(),
            Self::RoughPlastic(b) => b.albedo(),
            Self::Principled(b) => b.albedo(),
            Self::Layered(b) => b.albedo(),
            Self::Hair(b) => b.albedo(),
            Self::Null => Rgb::ONE,
        }
    }
}
