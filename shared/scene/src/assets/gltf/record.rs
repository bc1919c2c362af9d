//! The JSON records of a glTF file and its materials, extensions included.

use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

/// The file.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Record {
    pub asset: Asset,
    pub extensions_used: Vec<String>,
    pub extensions_required: Vec<String>,
    pub materials: Vec<Material>,
    pub animations: Vec<Animation>,
}

/// An animation's channels.
#[derive(Default, Deserialize)]
#[serde(default)]
pub struct Animation {
    pub channels: Vec<Channel>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub struct Channel {
    pub target: Target,
}

/// What a channel moves.
#[derive(Default, Deserialize)]
#[serde(default)]
pub struct Target {
    pub path: String,
}

/// The program that wrote the file.
#[derive(Default, Deserialize)]
#[serde(default)]
pub struct Asset {
    pub generator: String,
}

#[derive(Clone, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Material {
    pub name: Option<String>,
    pub pbr_metallic_roughness: Pbr,
    pub normal_texture: Option<TextureUse>,
    pub occlusion_texture: Option<TextureUse>,
    pub emissive_texture: Option<TextureUse>,
    pub emissive_factor: [f64; 3],
    pub alpha_mode: AlphaMode,
    pub alpha_cutoff: Option<f64>,
    pub double_sided: bool,
    pub extensions: Extensions,
}

/// What the base colour's alpha means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum AlphaMode {
    #[default]
    Opaque,
    Mask,
    Blend,
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Pbr {
    pub base_color_factor: [f64; 4],
    pub base_color_texture: Option<TextureUse>,
    pub metallic_factor: f64,
    pub roughness_factor: f64,
    pub metallic_roughness_texture: Option<TextureUse>,
}

impl Default for Pbr {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

/// A use of a texture.
#[derive(Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TextureUse {
    pub index: usize,
    #[serde(default)]
    pub tex_coord: u32,
    /// Scale of a normal map.
    pub scale: Option<f64>,
    #[serde(default)]
    pub extensions: TextureExtensions,
}

#[derive(Clone, Default, Deserialize)]
#[serde(default)]
pub struct TextureExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct TextureTransform {
    pub offset: [f64; 2],
    /// Radians.
    pub rotation: f64,
    pub scale: [f64; 2],
    pub tex_coord: Option<u32>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self {
            offset: [0.0; 2],
            rotation: 0.0,
            scale: [1.0; 2],
            tex_coord: None,
        }
    }
}

/// Extensions of a material.
#[derive(Clone, Default, Deserialize)]
#[serde(default)]
pub struct Extensions {
    #[serde(rename = "KHR_materials_anisotropy")]
    pub anisotropy: Option<Anisotropy>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub diffuse_transmission: Option<DiffuseTransmission>,
    #[serde(rename = "KHR_materials_dispersion")]
    pub dispersion: Option<Dispersion>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_ior")]
    pub ior: Option<Ior>,
    #[serde(rename = "KHR_materials_iridescence")]
    pub iridescence: Option<Iridescence>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
    #[serde(rename = "KHR_materials_sheen")]
    pub sheen: Option<Sheen>,
    #[serde(rename = "KHR_materials_specular")]
    pub specular: Option<Specular>,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_unlit")]
    pub unlit: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_volume")]
    pub volume: Option<Volume>,
    /// Unknown extensions.
    #[serde(flatten)]
    pub others: BTreeMap<String, IgnoredAny>,
}

#[derive(Clone, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Anisotropy {
    pub anisotropy_strength: f64,
    /// Radians, counter-clockwise from the tangent.
    pub anisotropy_rotation: f64,
    /// Red and green are the direction as (x + 1) / 2; blue multiplies the strength.
    pub anisotropy_texture: Option<TextureUse>,
}

#[derive(Clone, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Clearcoat {
    pub clearcoat_factor: f64,
    pub clearcoat_texture: Option<TextureUse>,
    pub clearcoat_roughness_factor: f64,
    pub clearcoat_roughness_texture: Option<TextureUse>,
    pub clearcoat_normal_texture: Option<TextureUse>,
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct DiffuseTransmission {
    pub diffuse_transmission_factor: f64,
    pub diffuse_transmission_texture: Option<TextureUse>,
    pub diffuse_transmission_color_factor: [f64; 3],
    pub diffuse_transmission_color_texture: Option<TextureUse>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color_factor: [1.0; 3],
            diffuse_transmission_color_texture: None,
        }
    }
}

#[derive(Clone, Default, Deserialize)]
#[serde(default)]
pub struct Dispersion {
    /// 20 over the Abbe number.
    pub dispersion: f64,
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct EmissiveStrength {
    pub emissive_strength: f64,
}

impl Default for EmissiveStrength {
    fn default() -> Self {
        Self { emissive_strength: 1.0 }
    }
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Iridescence {
    pub iridescence_factor: f64,
    pub iridescence_texture: Option<TextureUse>,
    pub iridescence_ior: f64,
    /// Nanometres, like the maximum.
    pub iridescence_thickness_minimum: f64,
    pub iridescence_thickness_maximum: f64,
    pub iridescence_thickness_texture: Option<TextureUse>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Self {
            iridescence_factor: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_minimum: 100.0,
            iridescence_thickness_maximum: 400.0,
            iridescence_thickness_texture: None,
        }
    }
}

#[derive(Clone, Deserialize)]
#[serde(default)]
pub struct Ior {
    pub ior: f64,
}

impl Default for Ior {
    fn default() -> Self {
        Self { ior: 1.5 }
    }
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct SpecularGlossiness {
    pub diffuse_factor: [f64; 4],
    pub diffuse_texture: Option<TextureUse>,
    pub specular_factor: [f64; 3],
    pub glossiness_factor: f64,
    pub specular_glossiness_texture: Option<TextureUse>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

#[derive(Clone, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Sheen {
    pub sheen_color_factor: [f64; 3],
    pub sheen_color_texture: Option<TextureUse>,
    pub sheen_roughness_factor: f64,
    pub sheen_roughness_texture: Option<TextureUse>,
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Specular {
    pub specular_factor: f64,
    pub specular_texture: Option<TextureUse>,
    pub specular_color_factor: [f64; 3],
    pub specular_color_texture: Option<TextureUse>,
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

#[derive(Clone, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Transmission {
    pub transmission_factor: f64,
    pub transmission_texture: Option<TextureUse>,
}

#[derive(Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Volume {
    pub thickness_factor: f64,
    /// World units; `None`: no attenuation.
    pub attenuation_distance: Option<f64>,
    pub attenuation_color: [f64; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self {
            thickness_factor: 0.0,
            attenuation_distance: None,
            attenuation_color: [1.0; 3],
        }
    }
}
