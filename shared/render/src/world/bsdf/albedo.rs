//! What a surface reflects, as one colour.

use super::{Bsdf, RoughConductor, fresnel_conductor};
use crate::math::Rgb;

impl Bsdf<'_> {
    /// The share of light that the surface sends on, about: exact for diffuse surfaces, for mirrors, metals and coated
    /// surfaces that of light from straight above, 1 for clear dielectrics,
    /// of hair that of much of it.
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
