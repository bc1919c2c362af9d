//! Varying properties of surfaces, as in `kernels/texture.wgsl`.

use super::lights::texture_of;
use super::list;
use super::reason::{Of, Reason, Why};
use crate::device::{Buffer, Device};
use crate::error::Result;
use beamfarm_render::math::{Rgb, Vec2};
use beamfarm_render::world::bsdf::{Distribution, glass_numbers, layer_numbers, loss_numbers};
use beamfarm_render::world::light::Light;
use beamfarm_render::world::texture::{Texture, TextureFilter, Wrap};
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::sync::Arc;

const IMAGE: u32 = 1;
const CHECKERBOARD: u32 = 1 << 1;
const NEAREST: u32 = 1 << 2;
const MIRRORS: u32 = 1 << 3;
const CLAMPS: u32 = 1 << 4;
const BY_COLORS: u32 = 1 << 5;

/// The property that a texture controls, as in `kernels/interaction.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
#[allow(missing_docs, reason = "fields of materials, by their names")]
pub enum Field {
    Reflectance = 0,
    Transmittance = 1,
    Roughness = 2,
    Metallic = 3,
    Specular = 4,
    SpecTint = 5,
    SpecTrans = 6,
    Flatness = 7,
    Sheen = 8,
    SheenTint = 9,
    Clearcoat = 10,
    CoatGloss = 11,
    Opacity = 12,
    Weight = 13,
    /// Heights or normals.
    Map = 14,
}

/// An image or a checkerboard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfaceTexture {
    /// Column of the map that is first applied to a surface's coordinates.
    pub x_axis: [f32; 2],
    /// Column of the map.
    pub y_axis: [f32; 2],
    /// Column of the map.
    pub translation: [f32; 2],
    /// 1 image, 2 checkerboard; bits of images: not interpolated 4, mirrored at edges 8, clamped 16.
    pub kind: u32,
    /// Its first texel: a pixel or a colour.
    pub first: u32,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// A [`Field`].
    pub field: u32,
    pub(super) padding: u32,
}

/// All textures of a scene that kernels look up.
#[derive(Debug, Default)]
pub struct FlatTextures {
    /// By light: its emission texture, all zero without one. Then those of materials, one after another.
    pub textures: Vec<SurfaceTexture>,
    /// Pixels of images, each image once, colours of checkerboards, and tables of rough coats.
    pub texels: Vec<[f32; 3]>,
    /// The first pixel of each stored image, by address.
    known: HashMap<usize, u32>,
    /// Offsets of the losses of GGX and of Beckmann facets, if stored.
    losses: [Option<u32>; 2],
}

/// Reasons why texels do not fit a device whose largest buffer has this many bytes. `colors`: number of coloured
/// vertices, if any texture uses them; `tangents`: number of given tangents.
pub(super) fn reasons<'a>(
    textures: impl Iterator<Item = &'a Texture>,
    lights: &[Light],
    [colors, tangents]: [u64; 2],
    largest: u64,
) -> Vec<Reason> {
    let mut known = HashMap::new();
    let mut reads_colors = false;
    let mut size = |texture: &Texture| match texture {
        Texture::Image { image, .. } if known.insert(Arc::as_ptr(image), ()).is_none() => image.pixels.len() as u64,
        Texture::Checkerboard { .. } | Texture::Constant(_) => 2,
        Texture::Image { .. } | Texture::VertexColors(_) | Texture::Graph(_) => 0,
    };
    // The factor on vertex colours is laid out as well.
    let laid_out = |texture: &'a Texture| match texture {
        Texture::VertexColors(Some(times)) => times,
        texture => texture,
    };
    let of_materials: u64 = textures
        .inspect(|texture| reads_colors |= texture.reads_colors())
        .map(|texture| size(laid_out(texture)))
        .sum();
    let of_lights: u64 = lights.iter().filter_map(texture_of).map(|texture| size(&texture)).sum();
    let count = of_materials + of_lights + tangents + if reads_colors { colors } else { 0 };
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
    /// The emission textures of lights.
    pub(super) fn of_lights(lights: &[Light]) -> Self {
        let mut flat = Self::default();
        for light in lights {
            let texture = texture_of(light).map(|texture| flat.laid_out(&texture));
            flat.textures.push(texture.unwrap_or_default());
        }
        flat
    }

    /// Adds a texture. A constant becomes a checkerboard of one colour.
    pub(super) fn add(&mut self, field: Field, texture: &Texture) {
        let texture = self.laid_out(texture);
        self.textures.push(SurfaceTexture {
            field: field as u32,
            ..texture
        });
    }

    fn laid_out(&mut self, texture: &Texture) -> SurfaceTexture {
        let next = self.texels.len() as u32;
        // From a map's columns and translation.
        let squares = |[x_axis, y_axis, translation]: [Vec2; 3]| SurfaceTexture {
            x_axis: x_axis.to_array(),
            y_axis: y_axis.to_array(),
            translation: translation.to_array(),
            kind: CHECKERBOARD,
            first: next,
            ..SurfaceTexture::default()
        };
        match texture {
            Texture::Image {
                image,
                filter,
                wrap,
                image_from_uv: map,
            } => {
                let first = *self.known.entry(Arc::as_ptr(image).addr()).or_insert(next);
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
                    kind: IMAGE | filter | wrap,
                    first,
                    width: image.width,
                    height: image.height,
                    ..squares([map.matrix2.x_axis, map.matrix2.y_axis, map.translation])
                }
            }
            Texture::Checkerboard {
                colors,
                squares_from_uv: map,
            } => {
                self.texels.extend(colors.map(|color| color.to_array()));
                squares([map.matrix2.x_axis, map.matrix2.y_axis, map.translation])
            }
            Texture::Constant(color) => {
                self.texels.extend([color.to_array(); 2]);
                squares([Vec2::X, Vec2::Y, Vec2::ZERO])
            }
            // Such scenes are refused.
            Texture::Graph(_) => SurfaceTexture::default(),
            Texture::VertexColors(times) => {
                let white = Texture::Constant(Rgb::ONE);
                let times = self.laid_out(times.as_deref().unwrap_or(&white));
                SurfaceTexture {
                    kind: times.kind | BY_COLORS,
                    ..times
                }
            }
        }
    }

    /// Whether some use vertex colours.
    pub(super) fn reads_colors(&self) -> bool {
        self.textures.iter().any(|texture| texture.kind & BY_COLORS != 0)
    }

    /// Adds numbers. Returns their first texel.
    pub(super) fn add_numbers(&mut self, numbers: &[f32]) -> u32 {
        let first = self.texels.len() as u32;
        let number = |three: &[f32], i: usize| three.get(i).copied().unwrap_or_default();
        let texel = |three: &[f32]| std::array::from_fn(|i| number(three, i));
        self.texels.extend(numbers.chunks(3).map(texel));
        first
    }

    /// Adds, once, the losses of a distribution's facets, then for GGX the reflection of layers, and the share that
    /// rough glass keeps. Returns the first texel.
    pub(super) fn losses(&mut self, distribution: Distribution) -> u32 {
        let (number, of_losses) = (distribution as usize, loss_numbers(distribution));
        if let Some(there) = self.losses[number] {
            return there;
        }
        let mut numbers: Vec<f32> = match distribution {
            Distribution::Ggx => of_losses.chain(layer_numbers()).collect(),
            Distribution::Beckmann => of_losses.collect(),
        };
        numbers.extend(glass_numbers(distribution));
        let first = self.add_numbers(&numbers);
        self.losses[number] = Some(first);
        first
    }

    /// Uploads them to a device.
    ///
    /// # Errors
    /// Device errors.
    pub fn upload(&self, device: &Device, there: Option<(&Self, &TextureBuffers)>) -> Result<TextureBuffers> {
        let textures = there.map(|(flat, on)| (&flat.textures[..], &on.textures));
        let texels = there.map(|(flat, on)| (&flat.texels[..], &on.texels));
        Ok(TextureBuffers {
            textures: list(device, "textures", &self.textures, textures)?,
            texels: list(device, "pixels of textures", &self.texels, texels)?,
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
    /// In binding order, from 38.
    #[must_use]
    pub fn in_order(&self) -> [&Buffer; 2] {
        [&self.textures, &self.texels]
    }
}
