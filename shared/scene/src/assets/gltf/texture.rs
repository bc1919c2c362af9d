//! Textures of a glTF file: images, each decoded once, and their placement on surfaces.

use super::accessor::Buffers;
use super::record::TextureUse;
use super::write::{numbers, quoted};
use super::{Beside, bytes_of};
use crate::assets::Flaw;
use crate::assets::image::{self, Encoding};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::texture::Image;
use gltf::texture::{MagFilter, WrappingMode};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

/// The file's images, and those derived from them that the piece names.
pub struct Textures<'a, 'b> {
    file: &'a str,
    buffers: &'a Buffers<'a>,
    beside: &'a Beside<'b>,
    textures: Vec<gltf::Texture<'a>>,
    /// Images by number and encoding.
    decoded: BTreeMap<(usize, Encoding), Arc<Image>>,
    /// Derived images by source and function, and the mean of each image. Materials often share both.
    made: BTreeMap<(usize, Encoding, String), Arc<Image>>,
    means: BTreeMap<(usize, Encoding), [f64; 3]>,
    /// Images by their names in the piece.
    pub images: BTreeMap<String, Arc<Image>>,
}

impl<'a, 'b> Textures<'a, 'b> {
    pub fn new(file: &'a str, document: &'a gltf::Document, buffers: &'a Buffers<'a>, beside: &'a Beside<'b>) -> Self {
        Self {
            file,
            buffers,
            beside,
            textures: document.textures().collect(),
            decoded: BTreeMap::new(),
            made: BTreeMap::new(),
            means: BTreeMap::new(),
            images: BTreeMap::new(),
        }
    }

    fn texture(&self, used: &TextureUse) -> Result<&gltf::Texture<'a>, Flaw> {
        let texture = self.textures.get(used.index);
        texture.ok_or_else(|| {
            let (index, count) = (used.index, self.textures.len());
            format!("it names texture {index}, but there are {count}").into()
        })
    }

    /// The image of a texture.
    pub fn picture(&mut self, used: &TextureUse, encoding: Encoding) -> Result<Arc<Image>, Flaw> {
        let source = self.texture(used)?.source();
        let key = (source.index(), encoding);
        if let Some(image) = self.decoded.get(&key) {
            return Ok(image.clone());
        }
        let image = match source.source() {
            gltf::image::Source::View { view, .. } => {
                self.buffers.view(&view).and_then(|bytes| image::read(bytes, encoding))
            }
            gltf::image::Source::Uri { uri, .. } => {
                bytes_of(uri, self.beside).and_then(|bytes| image::read(&bytes, encoding))
            }
        };
        let image = image.map_err(|flaw| format!("image {}: {}", source.index(), flaw.message))?;
        let image = Arc::new(image);
        self.decoded.insert(key, image.clone());
        Ok(image)
    }

    /// The image of a texture with a function, named `what`, applied to each pixel.
    pub fn made(
        &mut self,
        used: &TextureUse,
        encoding: Encoding,
        what: String,
        f: impl Fn(Rgb) -> Rgb,
    ) -> Result<Arc<Image>, Flaw> {
        let key = (self.texture(used)?.source().index(), encoding, what);
        if let Some(image) = self.made.get(&key) {
            return Ok(image.clone());
        }
        let image = mapped(&*self.picture(used, encoding)?, f);
        self.made.insert(key, image.clone());
        Ok(image)
    }

    /// The image of a texture times a colour.
    pub fn times(&mut self, used: &TextureUse, encoding: Encoding, factor: Rgb) -> Result<Arc<Image>, Flaw> {
        match factor == Rgb::ONE {
            true => self.picture(used, encoding),
            false => self.made(used, encoding, format!("times {factor:?}"), |p| p * factor),
        }
    }

    /// The mean of a texture's image.
    pub fn mean(&mut self, used: &TextureUse, encoding: Encoding) -> Result<[f64; 3], Flaw> {
        let key = (self.texture(used)?.source().index(), encoding);
        if let Some(mean) = self.means.get(&key) {
            return Ok(*mean);
        }
        let mean = mean(&*self.picture(used, encoding)?);
        self.means.insert(key, mean);
        Ok(mean)
    }

    /// A normal map with x and y multiplied by `scale`, encoded as (x + 1) / 2.
    pub fn normals(&mut self, used: &TextureUse, scale: f64) -> Result<Arc<Image>, Flaw> {
        if scale == 1.0 {
            return self.picture(used, Encoding::Raw);
        }
        self.made(used, Encoding::Raw, format!("normals {scale:?}"), |p| {
            let n = p * 2.0 - Rgb::ONE;
            let n = glam::DVec3::new(f64::from(n.x) * scale, f64::from(n.y) * scale, f64::from(n.z));
            let n = n.try_normalize().unwrap_or(glam::DVec3::Z);
            Rgb::from_array((n * 0.5 + 0.5).to_array().map(|x| x as f32))
        })
    }

    /// An image as a scene file's texture called `name`, placed as `used` says. `more`: its other fields.
    pub fn written(&mut self, used: &TextureUse, name: &str, image: Arc<Image>, more: &str) -> Result<String, Flaw> {
        let filter = match self.texture(used)?.sampler().mag_filter() {
            Some(MagFilter::Nearest) => "nearest",
            _ => "bilinear",
        };
        self.filtered(used, name, image, &format!(", filter = \"{filter}\"{more}"))
    }

    /// The same for values that cannot be interpolated, such as angles.
    pub fn unfiltered(&mut self, used: &TextureUse, name: &str, image: Arc<Image>) -> Result<String, Flaw> {
        self.filtered(used, name, image, ", filter = \"nearest\"")
    }

    fn filtered(&mut self, used: &TextureUse, name: &str, image: Arc<Image>, more: &str) -> Result<String, Flaw> {
        let file = format!("{}:{name}", self.file);
        let sampler = self.texture(used)?.sampler();
        let wrap = match sampler.wrap_s() {
            WrappingMode::Repeat => "repeat",
            WrappingMode::MirroredRepeat => "mirror",
            WrappingMode::ClampToEdge => "clamp",
        };
        let mut text = format!("{{ image = {}, wrap = \"{wrap}\"{more}", quoted(&file));
        if let Some(matrix) = uv_matrix(used) {
            let _ = write!(text, ", uv = [{{ matrix = {matrix} }}]");
        }
        text.push_str(" }");
        self.images.insert(file, image);
        Ok(text)
    }

    /// A colour or image, as TOML, times the vertex colours. A colour becomes a one-pixel image.
    pub fn times_vertices(&mut self, color: &str, id: &str) -> String {
        const ATTRIBUTE: &str = "attribute = \"color\"";
        if let Some(picture) = color.strip_suffix(" }") {
            return format!("{picture}, {ATTRIBUTE} }}");
        }
        let numbers = color.trim_matches(['[', ']']).split(',');
        let numbers: Vec<f32> = numbers.filter_map(|x| x.trim().parse().ok()).collect();
        let pixel = match numbers[..] {
            [r, g, b] => Rgb::new(r, g, b),
            _ => Rgb::ONE,
        };
        if pixel == Rgb::ONE {
            return format!("{{ {ATTRIBUTE} }}");
        }
        let file = format!("{}:{id}.factor", self.file);
        let text = format!("{{ image = {}, {ATTRIBUTE} }}", quoted(&file));
        let image = Image {
            width: 1,
            height: 1,
            pixels: vec![pixel],
            alpha: Vec::new(),
        };
        self.images.insert(file, Arc::new(image));
        text
    }

    /// Whether two textures have the same placement on a mesh.
    pub fn lie_alike(&self, a: &TextureUse, b: &TextureUse) -> bool {
        let wraps = |used: &TextureUse| {
            let sampler = self.textures.get(used.index).map(gltf::Texture::sampler);
            sampler.map(|sampler| (sampler.wrap_s(), sampler.wrap_t()))
        };
        uv_set(a) == uv_set(b) && uv_matrix(a) == uv_matrix(b) && wraps(a) == wraps(b)
    }

    /// Whether a texture wraps differently along u and v.
    pub fn wraps_in_two_ways(&self, used: &TextureUse) -> bool {
        let sampler = self.textures.get(used.index).map(gltf::Texture::sampler);
        sampler.is_some_and(|sampler| sampler.wrap_s() != sampler.wrap_t())
    }
}

/// The UV set it uses.
pub fn uv_set(used: &TextureUse) -> u32 {
    let transform = used.extensions.transform.as_ref();
    transform.and_then(|t| t.tex_coord).unwrap_or(used.tex_coord)
}

/// KHR_texture_transform for a v axis that points up.
fn uv_matrix(used: &TextureUse) -> Option<String> {
    let transform = used.extensions.transform.as_ref()?;
    // Counter-clockwise with v pointing down.
    let (sin, cos) = libm::sincos(transform.rotation);
    let [across, down] = transform.scale;
    let [a, b, c] = [cos * across, sin * down, transform.offset[0]];
    let [d, e, f] = [-sin * across, cos * down, transform.offset[1]];
    if [a, b, c, d, e, f] == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        return None;
    }
    let rows = [numbers(&[a, -b, b + c]), numbers(&[-d, e, 1.0 - e - f])];
    Some(format!("[{}, {}, [0, 0, 1]]", rows[0], rows[1]))
}

/// An image with a function applied to each pixel.
pub fn mapped(image: &Image, f: impl Fn(Rgb) -> Rgb) -> Arc<Image> {
    Arc::new(Image {
        width: image.width,
        height: image.height,
        pixels: image.pixels.iter().map(|p| f(*p)).collect(),
        alpha: Vec::new(),
    })
}

pub fn mean(image: &Image) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in &image.pixels {
        for (sum, value) in sum.iter_mut().zip(pixel.to_array()) {
            *sum += f64::from(value);
        }
    }
    sum.map(|sum| sum / image.pixels.len().max(1) as f64)
}
