//! Materials.

use super::{Fault, TextureRecord, given, only_takes};
use crate::scene::values::*;
use serde::Deserialize;
use toml::Spanned;

/// Fields of all kinds of materials; [`MaterialRecord::given`] and the kind say which may stand together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialRecord {
    #[serde(rename = "type")]
    pub kind: Spanned<MaterialType>,
    pub reflectance: Option<Spanned<TextureRecord<Unit>>>,
    pub two_sided: Option<Spanned<bool>>,
    pub ior: Option<Spanned<Number<Positive>>>,
    pub exterior_ior: Option<Spanned<Number<Positive>>>,
    pub alpha: Option<Spanned<Number<Roughness>>>,
    pub eta: Option<Spanned<Color<NonNegative>>>,
    pub k: Option<Spanned<Color<NonNegative>>>,
    pub preset: Option<Spanned<String>>,
    pub distribution: Option<Spanned<DistributionName>>,
    pub specular_reflectance: Option<Spanned<TextureRecord<Unit>>>,
    pub specular_transmittance: Option<Spanned<TextureRecord<Unit>>>,
    pub nonlinear: Option<Spanned<bool>>,
    pub base_color: Option<Spanned<TextureRecord<Unit>>>,
    pub metallic: Option<Spanned<Number<Unit>>>,
    pub roughness: Option<Spanned<Number<Unit>>>,
    pub specular: Option<Spanned<Number<Unit>>>,
}

impl MaterialRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let given = given!(
            self,
            reflectance,
            two_sided,
            ior,
            exterior_ior,
            alpha,
            eta,
            k,
            preset,
            distribution,
            specular_reflectance,
            specular_transmittance,
            nonlinear,
            base_color,
            metallic,
            roughness,
            specular
        );
        only_takes(name, takes, &[], &given)
    }

    /// The files of its textures.
    pub fn files(&self) -> impl Iterator<Item = &Spanned<String>> {
        [
            &self.reflectance,
            &self.specular_reflectance,
            &self.specular_transmittance,
            &self.base_color,
        ]
        .into_iter()
        .filter_map(|field| field.as_ref()?.get_ref().file())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaterialType {
    Diffuse,
    Dielectric,
    Conductor,
    Mirror,
    RoughConductor,
    RoughDielectric,
    ThinDielectric,
    Plastic,
    RoughPlastic,
    Principled,
    Null,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DistributionName {
    Ggx,
    Beckmann,
}

impl MaterialType {
    /// As the scene file writes it, and the fields that it takes beside `type`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Diffuse => ("diffuse", &["reflectance", "two_sided"]),
            Self::Mirror => ("mirror", &["reflectance", "two_sided"]),
            Self::Dielectric => ("dielectric", SMOOTH_DIELECTRIC),
            Self::ThinDielectric => ("thin_dielectric", SMOOTH_DIELECTRIC),
            Self::RoughDielectric => (
                "rough_dielectric",
                &[
                    "ior",
                    "exterior_ior",
                    "alpha",
                    "distribution",
                    "specular_reflectance",
                    "specular_transmittance",
                ],
            ),
            Self::Conductor => (
                "conductor",
                &["eta", "k", "preset", "reflectance", "two_sided"],
            ),
            Self::RoughConductor => (
                "rough_conductor",
                &[
                    "alpha",
                    "distribution",
                    "eta",
                    "k",
                    "preset",
                    "reflectance",
                    "two_sided",
                ],
            ),
            Self::Plastic => (
                "plastic",
                &[
                    "reflectance",
                    "specular_reflectance",
                    "ior",
                    "exterior_ior",
                    "nonlinear",
                    "two_sided",
                ],
            ),
            Self::RoughPlastic => (
                "rough_plastic",
                &[
                    "reflectance",
                    "specular_reflectance",
                    "ior",
                    "exterior_ior",
                    "alpha",
                    "distribution",
                    "nonlinear",
                    "two_sided",
                ],
            ),
            Self::Principled => (
                "principled",
                &[
                    "base_color",
                    "metallic",
                    "roughness",
                    "specular",
                    "ior",
                    "exterior_ior",
                    "two_sided",
                ],
            ),
            Self::Null => ("null", &[]),
        }
    }
}

const SMOOTH_DIELECTRIC: &[&str] = &[
    "ior",
    "exterior_ior",
    "specular_reflectance",
    "specular_transmittance",
];
