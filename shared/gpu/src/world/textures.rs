//! What varies over surfaces, as `kernels/texture.wgsl` has it.

use super::lights::texture_of;
use super::list;
use super::reason::{Of, Reason, Why};
use crate::device::{Buffer, Device};
use crate::error::Result;
use beamfarm_render::world::bsdf::{Material, MaterialKind};
use beamfarm_render::world::light::Light;
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, Wrap};
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::sync::Arc;

const IMAGE: u32 = 1;
const CHECKERBOARD: u32 = 1 << 1;
const NEAREST: u32 = 1 << 2;
const MIRRORS: u32 = 1 << 3;
const CLAMPS: u32 = 1 << 4;

/// An image or a checkerboard; all zero where there is one colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfaceTexture {
    /// Of the map that is applied to a surface's coordinates first, by columns.
    pub x_axis: [f32; 2],
    /// Of the map.
    pub y_axis: [f32; 2],
    /// Of the map.
    pub translation: [f32; 2],
    /// Image or checkerboard, 1 and 2; bits of images: not interpolated 4, mirrored at edges 8, clamped 16.
    pub kind: u32,
    /// Its first pixel, or its first colour.
    pub first: u32,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// All textures of a scene that kernels look up.
#[derive(Debug)]
pub struct FlatTextures {
    /// By a material's number: of its reflectance. Then by a light's: of what it emits.
    pub textures: Vec<SurfaceTexture>,
    /// Pixels of images, each of which is there once, and colours of checkerboards.
    pub texels: Vec<[f32; 3]>,
}

/// The texture of what a material reflects, if it is of a kind that kernels have.
pub(super) fn of_reflectance(material: &Material) -> Option<&Texture> {
    match &material.kind {
        MaterialKind::Diffuse { reflectance }
        | MaterialKind::Mirror { reflectance }
        | MaterialKind::Conductor { reflectance, .. } => Some(reflectance),
        MaterialKind::Dielectric { tint, .. } | MaterialKind::ThinDielectric { tint, .. } => Some(&tint.reflectance),
        MaterialKind::Null
        | MaterialKind::RoughConductor { .. }
        | MaterialKind::RoughDielectric { .. }
        | MaterialKind::Plastic { .. }
        | MaterialKind::RoughPlastic { .. }
        | MaterialKind::Principled { .. }
        | MaterialKind::Blend { .. } => None,
    }
}

/// What keeps pixels from a device whose largest buffer has so many bytes.
pub(super) fn reasons(materials: &[Material], lights: &[Light], largest: u64) -> Vec<Reason> {
    let mut known = HashMap::new();
    let mut size = |texture: &Texture| match texture {
        Texture::Image { image, .. } if known.insert(Arc::as_ptr(image), ()).is_none() => image.pixels.len() as u64,
        Texture::Checkerboard { .. } => 2,
        Texture::Image { .. } | Texture::Constant(_) | Texture::VertexColors(_) => 0,
    };
    let of_materials: u64 = materials.iter().filter_map(of_reflectance).map(&mut size).sum();
    let of_lights: u64 = lights.iter().filter_map(texture_of).map(|texture| size(&texture)).sum();
    let count = of_materials + of_lights;
    let (bytes, most) = (count * size_of::<[f32; 3]>() as u64, u64::from(u32::MAX));
    let why = match () {
        () if bytes > largest => Why::Large { bytes, most: largest },
        () if count > most => Why::Many { count, most },
        () => return Vec::new(),
    };
    vec![Reason {
        of: Of::Scene,
        field: "pixels of textures",
        why,
    }]
}

impl FlatTextures {
    /// Lay out all that [`reasons`] do not keep from devices.
    pub(super) fn new(materials: &[Material], lights: &[Light]) -> Self {
        let mut flat = Self {
            textures: Vec::with_capacity(materials.len() + lights.len()),
            texels: Vec::new(),
        };
        let mut known = HashMap::new();
        for material in materials {
            let texture = of_reflectance(material).map(|texture| flat.add(texture, &mut known));
            flat.textures.push(texture.unwrap_or_default());
        }
        for light in lights {
            let texture = texture_of(light).map(|texture| flat.add(&texture, &mut known));
            flat.textures.push(texture.unwrap_or_default());
        }
        flat
    }

    /// `known`: the first pixel of each image that is there.
    fn add(&mut self, texture: &Texture, known: &mut HashMap<*const Image, u32>) -> SurfaceTexture {
        let next = self.texels.len() as u32;
        match texture {
            Texture::Constant(_) | Texture::VertexColors(_) => SurfaceTexture::default(),
            Texture::Image {
                image,
                filter,
                wrap,
                image_from_uv: map,
            } => {
                let first = *known.entry(Arc::as_ptr(image)).or_insert(next);
                if first == next {
                    self.texels.extend(image.pixels.iter().map(|pixel| pixel.to_array()));
                }
                let filter = match filter {
                    TextureFilter::Bilinear => 0,
                    TextureFilter::Nearest => NEAREST,
                };
                let wrap = match wrap {
                    Wrap::Repeat => 0,
                    Wrap::Mirror => MIRRORS,
                    Wrap::Clamp => CLAMPS,
                };
                SurfaceTexture {
                    x_axis: map.matrix2.x_axis.to_array(),
                    y_axis: map.matrix2.y_axis.to_array(),
                    translation: map.translation.to_array(),
                    kind: IMAGE | filter | wrap,
                    first,
                    width: image.width,
                    height: image.height,
                }
            }
            Texture::Checkerboard {
                colors,
                squares_from_uv: map,
            } => {
                self.texels.extend(colors.map(|color| color.to_array()));
                SurfaceTexture {
                    x_axis: map.matrix2.x_axis.to_array(),
                    y_axis: map.matrix2.y_axis.to_array(),
                    translation: map.translation.to_array(),
                    kind: CHECKERBOARD,
                    first: next,
                    ..SurfaceTexture::default()
                }
            }
        }
    }

    /// Bring it to a device.
    ///
    /// # Errors
    /// The device's.
    pub fn upload(&self, device: &Device) -> Result<TextureBuffers> {
        Ok(TextureBuffers {
            textures: list(device, "textures", &self.textures)?,
            texels: list(device, "pixels of textures", &self.texels)?,
        })
    }
}

/// Textures on a device.
pub struct TextureBuffers {
    /// Binding 38.
    pub textures: Buffer,
    /// Binding 39.
    pub texels: Buffer,
}

impl TextureBuffers {
    /// In the order of their bindings, from 38.
    #[must_use]
    pub fn in_order(&self) -> [&Buffer; 2] {
        [&self.textures, &self.texels]
    }
}
