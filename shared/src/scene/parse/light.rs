//! Lights that are not surfaces.

use super::transform::Steps;
use super::{Fault, given, only_takes};
use crate::scene::values::*;
use serde::Deserialize;
use toml::Spanned;

/// Fields of all kinds of lights.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightRecord {
    pub name: Option<String>,
    pub group: Option<String>,
    #[serde(rename = "type")]
    pub kind: Spanned<LightType>,
    pub position: Option<Spanned<Vector>>,
    pub target: Option<Spanned<Vector>>,
    pub direction: Option<Spanned<Vector>>,
    pub intensity: Option<Spanned<Color<NonNegative>>>,
    pub power: Option<Spanned<Color<NonNegative>>>,
    pub irradiance: Option<Spanned<Color<NonNegative>>>,
    pub radiance: Option<Spanned<Color<NonNegative>>>,
    pub cutoff_angle: Option<Spanned<Number<Degrees>>>,
    pub beam_width: Option<Spanned<Number<NonNegative>>>,
    pub image: Option<Spanned<String>>,
    pub scale: Option<Spanned<Color<NonNegative>>>,
    pub rotate_y: Option<Spanned<Number<Finite>>>,
    pub transform: Option<Spanned<Steps>>,
}

impl LightRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        #[rustfmt::skip]
        let given = given!(self, position, target, direction, intensity, power, irradiance, radiance, cutoff_angle,
            beam_width, image, scale, rotate_y, transform);
        only_takes(name, takes, &[], &given)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightType {
    Point,
    Spot,
    Directional,
    Environment,
}

impl LightType {
    /// As the scene file writes it, and the fields that it takes beside `type` and `name`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Point => ("point", &["position", "intensity", "power"]),
            Self::Spot => (
                "spot",
                &[
                    "position",
                    "target",
                    "intensity",
                    "power",
                    "cutoff_angle",
                    "beam_width",
                ],
            ),
            Self::Directional => ("directional", &["direction", "irradiance"]),
            Self::Environment => (
                "environment",
                &["radiance", "image", "scale", "rotate_y", "transform"],
            ),
        }
    }
}
