//! The image and the camera.

use super::schema::{described, table};
use super::{Fault, given, only_takes};
use crate::values::*;
use beamfarm_render::world::filter::PixelFilter;
use beamfarm_render::world::panorama::Mapping;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// The image.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageRecord {
    /// Width, pixels, 1 to 32768.
    #[schemars(range(min = 1, max = 32768))]
    pub width: Spanned<u32>,
    /// Height, pixels, 1 to 32768.
    #[schemars(range(min = 1, max = 32768))]
    pub height: Spanned<u32>,
    /// Render only this window, which becomes the whole output image. Default: all of it.
    pub crop: Option<Spanned<CropRecord>>,
    /// Reconstruction filter. Default: box.
    #[serde(default)]
    pub filter: FilterRecord,
}

/// A window of the image, pixels.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CropRecord {
    /// Columns left of the window.
    #[serde(default)]
    pub x: u32,
    /// Rows above the window.
    #[serde(default)]
    pub y: u32,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}

/// `"box"`, `"tent"`, `"gaussian"`, or a table with the type and its parameter.
#[derive(Clone, Copy, Debug, Default)]
pub struct FilterRecord(pub PixelFilter);

impl JsonSchema for FilterRecord {
    fn schema_name() -> Cow<'static, str> {
        "FilterRecord".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let size = described(FilterSize::schema(), "Its size, pixels.");
        json_schema!({
            "description": "A filter by name, or with its parameter in pixels.",
            "anyOf": [
                { "enum": ["box", "tent", "gaussian"] },
                table(&["type"], json_schema!({ "type": { "const": "box" } })),
                table(&["type"], json_schema!({ "type": { "const": "tent" }, "radius": size })),
                table(&["type"], json_schema!({ "type": { "const": "gaussian" }, "stddev": size })),
            ]
        })
    }
}

impl<'de> Deserialize<'de> for FilterRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const EXPECTED: &str = "\"box\", \"tent\", \"gaussian\", { type = \"tent\", radius = pixels } \
            or { type = \"gaussian\", stddev = pixels }";

        #[derive(Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Kind {
            Box,
            Tent,
            Gaussian,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            #[serde(rename = "type")]
            kind: Kind,
            radius: Option<Number<FilterSize>>,
            stddev: Option<Number<FilterSize>>,
        }
        struct FilterVisitor;
        impl<'de> Visitor<'de> for FilterVisitor {
            type Value = FilterRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(EXPECTED)
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
                let filter = match name {
                    "box" => PixelFilter::Box,
                    "tent" => PixelFilter::Tent { radius: 1.0 },
                    "gaussian" => PixelFilter::Gaussian { stddev: 0.5 },
                    _ => {
                        return Err(E::custom(format_args!("expected {EXPECTED}, found \"{name}\"")));
                    }
                };
                Ok(FilterRecord(filter))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let table = Table::deserialize(MapAccessDeserializer::new(map))?;
                let filter = match (table.kind, table.radius, table.stddev) {
                    (Kind::Box, None, None) => PixelFilter::Box,
                    (Kind::Tent, radius, None) => PixelFilter::Tent {
                        radius: radius.map_or(1.0, |r| r.f32()),
                    },
                    (Kind::Gaussian, None, stddev) => PixelFilter::Gaussian {
                        stddev: stddev.map_or(0.5, |s| s.f32()),
                    },
                    _ => return Err(A::Error::custom(format_args!("expected {EXPECTED}"))),
                };
                Ok(FilterRecord(filter))
            }
        }
        deserializer.deserialize_any(FilterVisitor)
    }
}

/// The camera.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = CameraRecord::narrow)]
pub struct CameraRecord {
    /// Camera position. Required without `gltf`.
    pub origin: Option<Spanned<Vector>>,
    /// A point at the centre of the image. Required without `gltf`.
    pub target: Option<Spanned<Vector>>,
    /// Direction towards the top of the image. Default: [0, 1, 0].
    pub up: Option<Spanned<Vector>>,
    /// Perspective, orthographic or panoramic projection. Default: perspective.
    pub projection: Option<Spanned<ProjectionName>>,
    /// Field of view, degrees. Of a perspective camera below 180, and required without `gltf`; of a panorama up to 360.
    /// Default: 360, of a fisheye 180.
    pub fov: Option<Spanned<Number<FieldOfView>>>,
    /// The side of the image that `fov` spans. Default: x.
    pub fov_axis: Option<Spanned<FovAxis>>,
    /// Vertical field of view, degrees. Of an equirectangular panorama up to 180; default: 180. Of a fisheye up to 360;
    /// default: square pixels.
    pub vertical_fov: Option<Spanned<Number<FieldOfView>>>,
    /// How a fisheye maps angles from the axis to the image. Default: equidistant.
    pub mapping: Option<Spanned<FisheyeMapping>>,
    /// Full angle that a fisheye sees, degrees. The image is black outside. Default: `fov`.
    pub image_circle: Option<Spanned<Number<FieldOfView>>>,
    /// Width of the image, scene units. Required of an orthographic camera; no other takes it.
    pub view_width: Option<Spanned<Number<Positive>>>,
    /// Take the first camera of this glTF file instead of `origin`, `target`, `up`, `projection` and its fields.
    pub gltf: Option<Spanned<String>>,
    /// Name of the glTF file's camera, or of its node. Default: the first.
    pub gltf_camera: Option<Spanned<String>>,
    /// Radius of the lens, scene units. Default: 0, a pinhole.
    pub aperture: Option<Number<NonNegative>>,
    /// Distance of the focal plane, scene units. Default: the distance to `target`.
    pub focus_distance: Option<Number<Positive>>,
    /// Shifts the image in its plane, in units of its width and height. Default: [0, 0].
    pub principal_point: Option<Spanned<Pair>>,
    /// Mirror the image horizontally.
    #[serde(default)]
    pub flip_x: bool,
    /// Medium around the camera; "none" for vacuum. Default: found by tracing.
    pub medium: Option<Spanned<String>>,
}

/// The side of the image that the field of view spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FovAxis {
    /// Horizontal.
    #[default]
    X,
    /// Vertical.
    Y,
    /// The shorter side.
    Smaller,
    /// The longer side.
    Larger,
}

/// The camera's projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionName {
    /// Rays meet in one point.
    Perspective,
    /// Rays are parallel.
    Orthographic,
    /// All around: longitude to the right, latitude up.
    Equirectangular,
    /// All around, on an unrolled cylinder.
    Cylindrical,
    /// Up to all around, within a circle.
    Fisheye,
}

/// How a fisheye maps angles from the axis to the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FisheyeMapping {
    /// To proportional distances from the centre.
    #[default]
    Equidistant,
    /// To distances proportional to the sine of half the angle: equal areas for equal solid angles.
    Equisolid,
}

impl From<FisheyeMapping> for Mapping {
    fn from(word: FisheyeMapping) -> Self {
        match word {
            FisheyeMapping::Equidistant => Self::Equidistant,
            FisheyeMapping::Equisolid => Self::Equisolid,
        }
    }
}

/// The camera's position and field of view.
#[derive(Clone, Debug)]
pub struct Eye {
    pub origin: Vector,
    pub target: Spanned<Vector>,
    pub up: Option<Spanned<Vector>>,
    pub extent: Extent,
}

/// The extent of a camera's view.
#[derive(Clone, Debug)]
pub enum Extent {
    /// The field of view, degrees, and the side of the image that it spans.
    Angle(Spanned<f64>, FovAxis),
    /// The width of the image of an orthographic camera.
    Width(Spanned<Number<Positive>>),
    /// A panorama.
    Panorama(PanoramaExtent),
}

/// The extent of a panorama, degrees.
#[derive(Clone, Copy, Debug)]
pub struct PanoramaExtent {
    /// Its mapping to the image.
    pub mapping: Mapping,
    /// Field of view along `axis`.
    pub fov: f64,
    pub axis: FovAxis,
    /// Vertical field of view, if pixels need not be square.
    pub vertical_fov: Option<f64>,
    /// Diameter of a fisheye's visible circle.
    pub image_circle: f64,
}

impl CameraRecord {
    /// The field of view of a perspective camera is below 180 degrees.
    fn narrow(schema: &mut Schema) {
        let mut rules = json_schema!({ "allOf": [{
            "if": {
                "properties": { "projection": { "enum": ["equirectangular", "cylindrical", "fisheye"] } },
                "required": ["projection"]
            },
            "else": { "properties": { "fov": { "exclusiveMaximum": 180 } } }
        }] });
        if let Some(rules) = rules.remove("allOf") {
            schema.insert("allOf".into(), rules);
        }
    }

    /// Refuse fields that `gltf` replaces.
    pub fn check(&self) -> Result<(), Fault> {
        let given = given!(
            self,
            origin,
            target,
            up,
            projection,
            fov,
            fov_axis,
            vertical_fov,
            mapping,
            image_circle,
            view_width
        );
        let twice = given.into_iter().find_map(|(name, span)| Some((name, span?)));
        match (&self.gltf, &self.gltf_camera, twice) {
            (Some(_), _, Some((name, span))) => Err(Fault::new(
                span,
                format!("the camera of a glTF file has its own `{name}`"),
            )),
            (None, Some(name), _) => Err(Fault::new(
                name.span(),
                "it names one of the cameras of a glTF file; `gltf`, which says of which, is missing",
            )),
            _ => Ok(()),
        }
    }

    /// The position and view of a camera without `gltf`; `place`: where the camera is in the file.
    pub fn eye(&self, place: std::ops::Range<usize>) -> Result<Eye, Fault> {
        let missing = |name: &str| Fault::new(place.clone(), format!("missing field `{name}`"));
        let projection = self.projection.as_ref().map(|name| *name.get_ref());
        let (name, takes) = match projection.unwrap_or(ProjectionName::Perspective) {
            ProjectionName::Perspective => ("perspective", &["fov", "fov_axis"][..]),
            ProjectionName::Orthographic => ("orthographic", &["view_width"][..]),
            ProjectionName::Equirectangular => ("equirectangular", &["fov", "vertical_fov"][..]),
            ProjectionName::Cylindrical => ("cylindrical", &["fov"][..]),
            ProjectionName::Fisheye => (
                "fisheye",
                &["fov", "fov_axis", "vertical_fov", "mapping", "image_circle"][..],
            ),
        };
        let given = given!(self, fov, fov_axis, vertical_fov, mapping, image_circle, view_width);
        only_takes(name, takes, &[], &given)?;
        let extent = match projection {
            Some(ProjectionName::Orthographic) => {
                Extent::Width(self.view_width.clone().ok_or_else(|| missing("view_width"))?)
            }
            None | Some(ProjectionName::Perspective) => {
                let fov = self.fov.clone().ok_or_else(|| missing("fov"))?;
                let degrees = fov.get_ref().0;
                if !Degrees::holds(degrees as f32) {
                    let message = format!("expected {}, found {degrees:?}", Degrees::EXPECTED);
                    return Err(Fault::new(fov.span(), message));
                }
                Extent::Angle(Spanned::new(fov.span(), degrees), self.axis())
            }
            Some(name) => Extent::Panorama(self.panorama(name)?),
        };
        Ok(Eye {
            origin: *self.origin.as_ref().ok_or_else(|| missing("origin"))?.get_ref(),
            target: self.target.clone().ok_or_else(|| missing("target"))?,
            up: self.up.clone(),
            extent,
        })
    }

    fn axis(&self) -> FovAxis {
        self.fov_axis.as_ref().map_or(FovAxis::X, |axis| *axis.get_ref())
    }

    /// The extent of a panorama.
    fn panorama(&self, name: ProjectionName) -> Result<PanoramaExtent, Fault> {
        let degrees = |given: &Option<Spanned<Number<FieldOfView>>>| given.as_ref().map(|angle| angle.get_ref().0);
        let mapping = match name {
            ProjectionName::Cylindrical => Mapping::Cylindrical,
            ProjectionName::Fisheye => {
                let mapping = self.mapping.as_ref().map(|mapping| *mapping.get_ref());
                mapping.unwrap_or_default().into()
            }
            ProjectionName::Equirectangular | ProjectionName::Perspective | ProjectionName::Orthographic => {
                Mapping::Equirectangular
            }
        };
        if let Some(vertical) = &self.vertical_fov
            && mapping == Mapping::Equirectangular
            && vertical.get_ref().0 > 180.0
        {
            let message = format!(
                "expected at most 180 degrees, from pole to pole, found {:?}",
                vertical.get_ref().0
            );
            return Err(Fault::new(vertical.span(), message));
        }
        if let (Some(name), Some(aperture)) = (&self.projection, self.aperture)
            && aperture.0 > 0.0
        {
            return Err(Fault::new(
                name.span(),
                "panoramas are in focus everywhere; expected no `aperture`",
            ));
        }
        let fov = degrees(&self.fov).unwrap_or(if mapping.goes_round() { 360.0 } else { 180.0 });
        Ok(PanoramaExtent {
            mapping,
            fov,
            axis: self.axis(),
            vertical_fov: match mapping {
                Mapping::Equirectangular => Some(degrees(&self.vertical_fov).unwrap_or(180.0)),
                _ => degrees(&self.vertical_fov),
            },
            image_circle: degrees(&self.image_circle).unwrap_or(fov),
        })
    }
}
