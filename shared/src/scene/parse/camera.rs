//! The image and the camera.

use crate::scene::values::*;
use serde::Deserialize;
use toml::Spanned;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageRecord {
    pub width: Spanned<u32>,
    pub height: Spanned<u32>,
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
