//! Materials.

use super::{Fault, TextureRecord, UvSteps, given, only_takes};
use crate::scene::values::*;
use crate::texture::{TextureFilter, Wrap};
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
    pub opacity: Option<Spanned<TextureRecord<Unit>>>,
    pub bump: Option<Spanned<BumpRecord>>,
    pub normal_map: Option<Spanned<TextureRecord<Unit>>>,
}

/// An image of heights.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "{ image = \"file\", scale = 1.0 }")]
pub struct BumpRecord {
    pub image: Spanned<String>,
    #[serde(default)]
    pub raw: bool,
    #[serde(default)]
    pub filter: TextureFilter,
    #[serde(default)]
    pub wrap: Wrap,
    pub uv: Option<UvSteps>,
    pub scale: Option<Number<Finite>>,
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
            specular,
            opacity,
            bump,
            normal_map
        );
        let common: &[&str] = match self.kind.get_ref() {
            MaterialType::Null => &[],
            _ => &["opacity", "bump", "normal_map"],
        };
        only_takes(name, takes, common, &given)
    }

    /// The files of its textures.
    pub fn files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let textures = [
            &self.reflectance,
            &self.specular_reflectance,
            &self.specular_transmittance,
            &self.base_color,
            &self.opacity,
            &self.normal_map,
        ];
        let files = textures
            .into_iter()
            .filter_map(|field| field.as_ref()?.get_ref().file());
        files.chain(self.bump.iter().map(|bump| &bump.get_ref().image))
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
