//! Lights that are not surfaces.

use super::schema::by_type;
use super::transform::Steps;
use super::words::{BeamProfile, Falloff, RayType, TextureFilter};
use super::{Fault, ImageFile, TextureRecord, given, only_takes};
use crate::values::*;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;

/// A light that is not a surface.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = LightType::narrow)]
pub struct LightRecord {
    /// Name for messages, and for the layer of its group.
    pub name: Option<String>,
    /// Lights of one group share a layer. Default: the name.
    pub group: Option<String>,
    /// Kind of light.
    #[serde(rename = "type")]
    pub kind: Spanned<LightType>,
    /// Position, scene units.
    pub position: Option<Spanned<Vector>>,
    /// A point on the light's axis, scene units; for a lamp with `ies`, on the axis at vertical angle 0.
    pub target: Option<Spanned<Vector>>,
    /// Direction of travel. Lasers, and points with `ies`, may take it instead of `target`.
    pub direction: Option<Spanned<Vector>>,
    /// W/sr, on the axis of a spot.
    pub intensity: Option<Spanned<Color<NonNegative>>>,
    /// W, in all directions that it shines to.
    pub power: Option<Spanned<Color<NonNegative>>>,
    /// W/m^2 across the direction; at the centre of a laser's beam.
    pub irradiance: Option<Spanned<Color<NonNegative>>>,
    /// W/(m^2 sr).
    pub radiance: Option<Spanned<Color<NonNegative>>>,
    /// Width of the projected image, degrees. Default: 45.
    pub fov: Option<Spanned<Number<Degrees>>>,
    /// Up direction of a spot's or projector's image; default: [0, 1, 0]. For a lamp with `ies`, the direction of
    /// horizontal angle 0; default: [0, 0, 1], or [0, 1, 0] if the lamp points along z.
    pub up: Option<Spanned<Vector>>,
    /// Interpolation of a spot's or projector's image. Default: bilinear.
    pub filter: Option<Spanned<TextureFilter>>,
    /// Take the numbers of a PNG or JPEG as linear, not as sRGB. Default: false.
    pub raw: Option<Spanned<bool>>,
    /// Half angle of the cone, degrees. Default: 20.
    pub cutoff_angle: Option<Spanned<Number<Degrees>>>,
    /// Half angle of full intensity, degrees, less than `cutoff_angle`. Default: 3/4 of it.
    pub beam_width: Option<Spanned<Number<NonNegative>>>,
    /// How a spot's intensity falls from `beam_width` to `cutoff_angle`. Default: linear.
    pub falloff: Option<Spanned<Falloff>>,
    /// Radius, scene units. Of a spherical spot: 0, the default, is a point. Of a laser's beam: above 0.
    pub radius: Option<Spanned<Number<NonNegative>>>,
    /// Soft falloff of a spherical spot, as in Blender: at a distance d from its centre, 1 / (d² + radius²) of its
    /// intensity arrives. Default: false.
    pub soft_falloff: Option<Spanned<bool>>,
    /// How a laser's irradiance varies across its beam. Default: flat.
    pub profile: Option<Spanned<BeamProfile>>,
    /// Angle that a light at infinity subtends, degrees. Default: 0, parallel.
    pub angle: Option<Spanned<Number<AngleFromZero>>>,
    /// Latitude-longitude image of an environment, or the image that a spot or projector throws; .exr, .hdr, .png or
    /// .jpg.
    pub image: Option<ImageFile>,
    /// Photometric file (IES LM-63, type C), relative to the scene file: intensity by direction.
    pub ies: Option<Spanned<String>>,
    /// Factor on the image, or on the candela of `ies` at 683 per W/sr. Default: 1.
    pub scale: Option<Spanned<Color<NonNegative>>>,
    /// Rotation around +y, degrees. Default: 0.
    pub rotate_y: Option<Spanned<Number<Finite>>>,
    /// A graph over directions instead of an image; "generated" coordinates are the unit direction.
    pub texture: Option<Spanned<TextureRecord<NonNegative>>>,
    /// A rotation, possibly mirrored, instead of `rotate_y`.
    pub transform: Option<Spanned<Steps>>,
    /// Ray types that see the light, or its effect. Default: all.
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
    /// Equal in all directions.
    Point,
    /// A cone from a point or from an invisible ball.
    Spot,
    /// A lamp that projects an image.
    Projector,
    /// Parallel light from an invisible disc.
    Laser,
    /// Light from infinity, parallel or within an angle; its source is invisible.
    Directional,
    /// Light from all around; several add up, or `visible` gives each its rays.
    Environment,
}

impl LightType {
    /// The schema for each kind of light.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| {
            [&["name", "group", "visible"][..], kind.takes().1].concat()
        });
    }

    /// The name in scene files, and the fields it takes in addition to `type` and `name`.
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
