//! Records of glTF files, and of the pieces that they are converted to.

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
    /// From the file's space to world space.
    pub transform: Option<Spanned<Steps>>,
    /// Read materials, as principled ones. Default: true.
    pub materials: Option<bool>,
    /// Read the lights of KHR_lights_punctual. Default: true.
    pub lights: Option<bool>,
    /// Unit of lights. Default: lumen in files from Blender, else watt.
    pub light_unit: Option<LightUnitName>,
}

/// Units of a glTF file's lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightUnitName {
    /// W/sr and W/m^2.
    Watt,
    /// Candela and lux, 683 lm to the watt.
    Lumen,
}

/// The piece of a scene file that a glTF file becomes.
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

/// The piece of a scene file that .mtl files become.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MtlRecord {
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    /// Emission by material name.
    #[serde(default)]
    pub emission: BTreeMap<String, Spanned<EmissionRecord>>,
}

/// A glTF file's camera, as fields of a scene file's camera.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GltfCameraRecord {
    pub origin: Vector,
    pub target: Vector,
    pub up: Vector,
    pub fov: Option<Number<Degrees>>,
    pub view_width: Option<Number<Positive>>,
}
