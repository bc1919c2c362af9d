//! glTF files: what the scene says of them, and what they are read as.

use super::transform::Steps;
use super::{LightRecord, MaterialRecord, ShapeRecord};
use crate::scene::values::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GltfRecord {
    pub file: Spanned<String>,
    pub transform: Option<Spanned<Steps>>,
    pub materials: Option<bool>,
    pub lights: Option<bool>,
}

/// The piece of a scene file that a glTF file is read as.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PieceRecord {
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    #[serde(default)]
    pub shapes: Vec<ShapeRecord>,
    #[serde(default)]
    pub lights: Vec<LightRecord>,
}

/// A camera of a glTF file as the fields of a scene file's.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GltfCameraRecord {
    pub origin: Vector,
    pub target: Vector,
    pub up: Vector,
    pub fov: Number<Degrees>,
}
