//! What a surface reflects, as one colour.

use super::{Bsdf, fresnel_conductor};
use crate::math::Rgb;

impl Bsdf {
    /// The share of light that the surface sends on, about: exact for diffuse surfaces, for mirrors and metals that of light
    /// from straight above, 1 for clear dielectrics.
    pub fn albedo(&self) -> Rgb {
        match *self {
            Self::Black => Rgb::ZERO,
            Self::Diffuse { reflectance, .. } | Self::Mirror { reflectance, .. } => reflectance,
            Self::Conductor {
                eta,
                k,
                reflectance,
                ..
            }
            | Self::RoughConductor {
                eta,
                k,
                reflectance,
                ..
            } => reflectance * fresnel_conductor(1.0, eta, k),
            Self::Dielectric { .. } | Self::RoughDielectric { .. } | Self::Null => Rgb::ONE,
        }
    }
}
