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
            preset
        );
        only_takes(name, takes, &[], &given)
    }

    /// The files of its textures.
    pub fn files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let reflectance = self.reflectance.as_ref();
        reflectance.and_then(|r| r.get_ref().file()).into_iter()
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
    Null,
}

impl MaterialType {
    /// As the scene file writes it, and the fields that it takes beside `type`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Diffuse => ("diffuse", &["reflectance", "two_sided"]),
            Self::Mirror => ("mirror", &["reflectance", "two_sided"]),
            Self::Dielectric => ("dielectric", &["ior", "exterior_ior"]),
            Self::RoughDielectric => ("rough_dielectric", &["ior", "exterior_ior", "alpha"]),
            Self::Conductor => (
                "conductor",
                &["eta", "k", "preset", "reflectance", "two_sided"],
            ),
            Self::RoughConductor => (
                "rough_conductor",
                &["alpha", "eta", "k", "preset", "reflectance", "two_sided"],
            ),
            Self::Null => ("null", &[]),
        }
    }
}
