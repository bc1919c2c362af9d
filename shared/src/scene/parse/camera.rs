//! The image and the camera.

use crate::filter::PixelFilter;
use crate::scene::values::*;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use toml::Spanned;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageRecord {
    pub width: Spanned<u32>,
    pub height: Spanned<u32>,
    pub crop: Option<Spanned<CropRecord>>,
    #[serde(default)]
    pub filter: FilterRecord,
}

/// A window of the image, pixels.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CropRecord {
    #[serde(default)]
    pub x: u32,
    #[serde(default)]
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// `"box"`, `"tent"`, `"gaussian"`, or a table with the type and its parameter.
#[derive(Clone, Copy, Debug, Default)]
pub struct FilterRecord(pub PixelFilter);

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
                        return Err(E::custom(format_args!(
                            "expected {EXPECTED}, found \"{name}\""
                        )));
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

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraRecord {
    pub origin: Vector,
    pub target: Spanned<Vector>,
    pub up: Option<Spanned<Vector>>,
    pub fov: Spanned<Number<Degrees>>,
    #[serde(default)]
    pub fov_axis: FovAxis,
    pub aperture: Option<Number<NonNegative>>,
    pub focus_distance: Option<Number<Positive>>,
    pub principal_point: Option<Spanned<Pair>>,
    #[serde(default)]
    pub flip_x: bool,
    pub medium: Option<Spanned<String>>,
}

/// The side of the image that the field of view spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FovAxis {
    #[default]
    X,
    Y,
    Smaller,
    Larger,
}
