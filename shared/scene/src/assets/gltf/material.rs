//! Base materials of glTF as principled materials.

use super::accessor::{Buffers, Uv};
use super::{Beside, Piece, bytes_of, quoted};
use crate::assets::Flaw;
use crate::assets::image::{self, Encoding};
use beamfarm_render::math::Rgb;
use beamfarm_render::texture::Image;
use glam::{DAffine2, DMat2, DVec2};
use gltf::texture::{MagFilter, WrappingMode};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

/// Texture coordinates of the base colour's texture.
pub fn uv(material: &gltf::Material<'_>) -> Uv {
    let Some(texture) = material.pbr_metallic_roughness().base_color_texture() else {
        return Uv {
            set: 0,
            transform: DAffine2::IDENTITY,
        };
    };
    match texture.texture_transform() {
        None => Uv {
            set: texture.tex_coord(),
            transform: DAffine2::IDENTITY,
        },
        Some(transform) => {
            // Counter-clockwise, where v runs downwards.
            let (sin, cos) = libm::sincos(f64::from(transform.rotation()));
            let vector = |v: [f32; 2]| DVec2::from(v.map(f64::from));
            let rotation = DMat2::from_cols(DVec2::new(cos, -sin), DVec2::new(sin, cos));
            Uv {
                set: transform.tex_coord().unwrap_or(texture.tex_coord()),
                transform: DAffine2::from_mat2_translation(
                    rotation * DMat2::from_diagonal(vector(transform.scale())),
                    vector(transform.offset()),
                ),
            }
        }
    }
}

/// The materials that shapes use.
pub struct Materials<'a, 'b> {
    file: &'a str,
    buffers: &'a Buffers,
    beside: &'a Beside<'b>,
    used: BTreeMap<Option<usize>, gltf::Material<'a>>,
    /// Decoded, by number and encoding.
    images: BTreeMap<(usize, Encoding), Arc<Image>>,
}

impl<'a, 'b> Materials<'a, 'b> {
    pub fn new(file: &'a str, buffers: &'a Buffers, beside: &'a Beside<'b>) -> Self {
        Self {
            file,
            buffers,
            beside,
            used: BTreeMap::new(),
            images: BTreeMap::new(),
        }
    }

    /// The name by which a shape calls it.
    pub fn id(&mut self, material: &gltf::Material<'a>) -> String {
        self.used.entry(material.index()).or_insert_with(|| material.clone());
        id(material)
    }

    /// Radiance, if there is any. A texture counts by its mean.
    pub fn emission(&mut self, material: &gltf::Material<'a>) -> Result<Option<[f64; 3]>, Flaw> {
        let strength = material.emissive_strength().unwrap_or(1.0);
        let factor = material.emissive_factor().map(|c| f64::from(c) * f64::from(strength));
        if factor == [0.0; 3] {
            return Ok(None);
        }
        let mean = match material.emissive_texture() {
            None => [1.0; 3],
            Some(texture) => {
                let image = self.image(material, &texture.texture(), Encoding::Srgb)?;
                mean(&image)
            }
        };
        let radiance: [f64; 3] = std::array::from_fn(|c| factor[c] * mean[c]);
        Ok((radiance != [0.0; 3]).then_some(radiance))
    }

    /// Add the materials to the piece.
    pub fn write(mut self, piece: &mut Piece) -> Result<(), Flaw> {
        for material in std::mem::take(&mut self.used).into_values() {
            self.write_one(&material, piece)?;
        }
        Ok(())
    }

    fn write_one(&mut self, material: &gltf::Material<'a>, piece: &mut Piece) -> Result<(), Flaw> {
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        let base_color = match pbr.base_color_texture() {
            None => format!("[{r:?}, {g:?}, {b:?}]"),
            Some(info) => {
                let texture = info.texture();
                let file = format!("{}:{}", self.file, id(material));
                let image = self.image(material, &texture, Encoding::Srgb)?;
                piece.images.insert(file.clone(), times(image, Rgb::new(r, g, b)));
                let sampler = texture.sampler();
                let wrap = match sampler.wrap_s() {
                    WrappingMode::Repeat => "repeat",
                    WrappingMode::MirroredRepeat => "mirror",
                    WrappingMode::ClampToEdge => "clamp",
                };
                let filter = match sampler.mag_filter() {
                    Some(MagFilter::Nearest) => "nearest",
                    _ => "bilinear",
                };
                format!(
                    "{{ image = {}, wrap = \"{wrap}\", filter = \"{filter}\" }}",
                    quoted(&file)
                )
            }
        };
        let (mut metallic, mut roughness) = (f64::from(pbr.metallic_factor()), f64::from(pbr.roughness_factor()));
        if let Some(info) = pbr.metallic_roughness_texture() {
            let image = self.image(material, &info.texture(), Encoding::Raw)?;
            let [_, g, b] = mean(&image);
            roughness *= g;
            metallic *= b;
        }
        if material.transmission().is_some_and(|t| t.transmission_factor() > 0.0) {
            return Err(format!(
                "the material {}: KHR_materials_transmission is not supported; read the file with `materials = false`, \
                 or export it without",
                name(material)
            )
            .into());
        }
        let text = &mut piece.text;
        let _ = writeln!(
            text,
            "[materials.{}]\ntype = \"principled\"\nbase_color = {base_color}\nmetallic = {metallic:?}\n\
             roughness = {roughness:?}\ntwo_sided = {}",
            id(material),
            material.double_sided()
        );
        if let Some(ior) = material.ior() {
            let _ = writeln!(text, "ior = {ior:?}");
        }
        Ok(())
    }

    fn image(
        &mut self,
        material: &gltf::Material<'a>,
        texture: &gltf::Texture<'a>,
        encoding: Encoding,
    ) -> Result<Arc<Image>, Flaw> {
        let source = texture.source();
        let key = (source.index(), encoding);
        if let Some(image) = self.images.get(&key) {
            return Ok(image.clone());
        }
        let in_image = |flaw: Flaw| {
            format!(
                "the material {}: image {}: {}",
                name(material),
                source.index(),
                flaw.message
            )
        };
        let image = match source.source() {
            gltf::image::Source::View { view, .. } => {
                self.buffers.view(&view).and_then(|bytes| image::read(bytes, encoding))
            }
            gltf::image::Source::Uri { uri, .. } => {
                bytes_of(uri, self.beside).and_then(|bytes| image::read(&bytes, encoding))
            }
        };
        let image = Arc::new(image.map_err(in_image)?);
        self.images.insert(key, image.clone());
        Ok(image)
    }
}

/// Its name within the piece.
fn id(material: &gltf::Material<'_>) -> String {
    match material.index() {
        Some(i) => format!("material{i}"),
        None => "default".to_string(),
    }
}

/// Its name for people.
fn name(material: &gltf::Material<'_>) -> String {
    match (material.name(), material.index()) {
        (Some(name), _) => format!("{name:?}"),
        (None, Some(i)) => i.to_string(),
        (None, None) => "that is the default".to_string(),
    }
}

fn times(image: Arc<Image>, factor: Rgb) -> Arc<Image> {
    match factor == Rgb::ONE {
        true => image,
        false => Arc::new(Image {
            alpha: Vec::new(),
            width: image.width,
            height: image.height,
            pixels: image.pixels.iter().map(|p| *p * factor).collect(),
        }),
    }
}

fn mean(image: &Image) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in &image.pixels {
        for (sum, value) in sum.iter_mut().zip(pixel.to_array()) {
            *sum += f64::from(value);
        }
    }
    sum.map(|sum| sum / image.pixels.len().max(1) as f64)
}
