//! glTF files: what the scene says of them, and what they are read as.

use super::transform::Steps;
use super::{EmissionRecord, LightRecord, MaterialRecord, MediumRecord, ShapeRecord};
use crate::values::*;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// A glTF 2.0 file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GltfRecord {
    /// .gltf or .glb, relative to the scene file.
    pub file: Spanned<String>,
    /// From the file's space to the world.
    pub transform: Option<Spanned<Steps>>,
    /// Base materials become principled materials. Default: true.
    pub materials: Option<bool>,
    /// KHR_lights_punctual become lights. Default: true.
    pub lights: Option<bool>,
    /// What the numbers of lights mean. Default: lumen in files of Blender, of others watt.
    pub light_unit: Option<LightUnitName>,
}

/// Units of lights of a glTF file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightUnitName {
    /// W/sr and W/m^2.
    Watt,
    /// Candela and lux, 683 lm to the watt.
    Lumen,
}

/// The piece of a scene file that a glTF file is read as.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PieceRecord {
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    #[serde(default)]
    pub media: BTreeMap<Spanned<String>, MediumRecord>,
    #[serde(default)]
    pub shapes: Vec<ShapeRecord>,
    #[serde(default)]
    pub lights: Vec<LightRecord>,
}

/// The piece of a scene file that .mtl files are read as.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MtlRecord {
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    /// What they emit, by their names.
    #[serde(default)]
    pub emission: BTreeMap<String, Spanned<EmissionRecord>>,
}

/// A camera of a glTF file as the fields of a scene file's.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GltfCameraRecord {
    pub origin: Vector,
    pub target: Vector,
    pub up: Vector,
    pub fov: Option<Number<Degrees>>,
    pub view_width: Option<Number<Positive>>,
}
