//! Lights that are not surfaces.

use super::schema::by_type;
use super::transform::Steps;
use super::words::{BeamProfile, Falloff, RayType, TextureFilter};
use super::{Fault, ImageFile, TextureRecord, given, only_takes};
use crate::values::*;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;

/// A light that is no surface.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = LightType::narrow)]
pub struct LightRecord {
    /// For messages, and for the layer of its group.
    pub name: Option<String>,
    /// Lights of one group share a layer. Default: the name.
    pub group: Option<String>,
    /// Kind of light.
    #[serde(rename = "type")]
    pub kind: Spanned<LightType>,
    /// Where it stands, scene units.
    pub position: Option<Spanned<Vector>>,
    /// A point on its axis, scene units; of a lamp by `ies` on the axis of its vertical angle 0.
    pub target: Option<Spanned<Vector>>,
    /// Direction of travel; of lasers, and of points by `ies`, in place of `target`.
    pub direction: Option<Spanned<Vector>>,
    /// W/sr, of a spot on its axis.
    pub intensity: Option<Spanned<Color<NonNegative>>>,
    /// W, in all directions that it shines to.
    pub power: Option<Spanned<Color<NonNegative>>>,
    /// W/m^2 across the direction; of a laser in the middle of its beam.
    pub irradiance: Option<Spanned<Color<NonNegative>>>,
    /// W/(m^2 sr).
    pub radiance: Option<Spanned<Color<NonNegative>>>,
    /// The picture's width, degrees. Default: 45.
    pub fov: Option<Spanned<Number<Degrees>>>,
    /// Up in the picture of a spot or a projector; default: [0, 1, 0]. Of a lamp by `ies` where its horizontal angle 0
    /// is; default: [0, 0, 1], of lamps along z [0, 1, 0].
    pub up: Option<Spanned<Vector>>,
    /// How the picture of a spot or a projector is interpolated. Default: bilinear.
    pub filter: Option<Spanned<TextureFilter>>,
    /// Whether the numbers of a PNG or a JPEG are taken as they are, not as sRGB. Default: false.
    pub raw: Option<Spanned<bool>>,
    /// Half angle of the cone, degrees. Default: 20.
    pub cutoff_angle: Option<Spanned<Number<Degrees>>>,
    /// Half angle of full intensity, degrees, below `cutoff_angle`. Default: 3/4 of it.
    pub beam_width: Option<Spanned<Number<NonNegative>>>,
    /// How a spot's intensity falls from `beam_width` to `cutoff_angle`. Default: linear.
    pub falloff: Option<Spanned<Falloff>>,
    /// Of a ball that shines as a spot, scene units; default: 0, a point. Of a laser's beam, above 0.
    pub radius: Option<Spanned<Number<NonNegative>>>,
    /// Whether a spot that is a ball shines as Blender's with soft falloff, so that at a distance d from its middle
    /// 1 / (d² + radius²) of its intensity arrives. Default: false.
    pub soft_falloff: Option<Spanned<bool>>,
    /// How a laser's irradiance varies across its beam. Default: flat.
    pub profile: Option<Spanned<BeamProfile>>,
    /// Full angle that light from infinitely far away comes out of, degrees. Default: 0, parallel.
    pub angle: Option<Spanned<Number<AngleFromZero>>>,
    /// Picture of the sky in latitude and longitude, or what a spot or a projector throws; .exr, .hdr, .png or .jpg.
    pub image: Option<ImageFile>,
    /// Photometric file (IES LM-63, type C), relative to the scene file: how intensity goes by direction.
    pub ies: Option<Spanned<String>>,
    /// Factor on the picture, or on the candela of `ies` at 683 to W/sr. Default: 1.
    pub scale: Option<Spanned<Color<NonNegative>>>,
    /// Turned around +y, degrees. Default: 0.
    pub rotate_y: Option<Spanned<Number<Finite>>>,
    /// A graph of directions in place of an image; "generated" coordinates are the direction, of unit length.
    pub texture: Option<Spanned<TextureRecord<NonNegative>>>,
    /// A rotation, which may mirror, in place of `rotate_y`.
    pub transform: Option<Spanned<Steps>>,
    /// Types of rays that see it, or its light. Default: all.
    pub visible: Option<Spanned<Vec<RayType>>>,
}

impl LightRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        #[rustfmt::skip]
        let given = given!(self, position, target, direction, intensity, power, irradiance, radiance, fov, up, filter, raw,
            cutoff_angle, beam_width, falloff, radius, soft_falloff, profile, angle, image, ies, texture, scale, rotate_y, transform);
        only_takes(name, takes, &[], &given)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightType {
    /// The same to all sides.
    Point,
    /// A cone, from a point or a ball that is not seen.
    Spot,
    /// A lamp that throws a picture on a screen.
    Projector,
    /// Parallel light out of a disc that is not seen.
    Laser,
    /// Light from infinitely far away, parallel or out of an angle; where it comes from is not seen.
    Directional,
    /// Light from all around; at most one.
    Environment,
}

impl LightType {
    /// The schema of each kind of light.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| {
            [&["name", "group", "visible"][..], kind.takes().1].concat()
        });
    }

    /// As the scene file writes it, and the fields that it takes beside `type` and `name`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Point => (
                "point",
                &[
                    "position",
                    "intensity",
                    "power",
                    "ies",
                    "scale",
                    "target",
                    "direction",
                    "up",
                ],
            ),
            Self::Spot => (
                "spot",
                &[
                    "position",
                    "target",
                    "intensity",
                    "power",
                    "cutoff_angle",
                    "beam_width",
                    "falloff",
                    "radius",
                    "soft_falloff",
                    "image",
                    "ies",
                    "scale",
                    "up",
                    "filter",
                    "raw",
                ],
            ),
            Self::Projector => (
                "projector",
                &["position", "target", "intensity", "fov", "image", "up", "filter", "raw"],
            ),
            Self::Laser => (
                "laser",
                &[
                    "position",
                    "target",
                    "direction",
                    "power",
                    "irradiance",
                    "radius",
                    "profile",
                ],
            ),
            Self::Directional => ("directional", &["direction", "irradiance", "angle"]),
            Self::Environment => (
                "environment",
                &["radiance", "image", "texture", "scale", "rotate_y", "transform"],
            ),
        }
    }
}
