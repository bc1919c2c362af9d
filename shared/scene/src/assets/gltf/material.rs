//! Materials of glTF: principled ones, and glass.

use super::gloss::{base_color, metallic};
use super::notes::Notes;
use super::record::{AlphaMode, Material, Record, SpecularGlossiness, TextureUse, Volume};
use super::texture::{Textures, mapped, mean, scaled_normals, times, uv_set};
use super::write::{number, numbers};
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use beamfarm_render::math::Rgb;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What shapes of a material say.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The material's name within the piece.
    pub id: String,
    /// For people.
    pub name: String,
    /// Which of a mesh's texture coordinates it takes.
    pub uv_set: u32,
    /// Radiance, as TOML.
    pub emission: Option<String>,
    /// Whether light goes through to the inside.
    pub is_glass: bool,
    /// What is inside.
    pub interior: Option<String>,
}

/// The materials that shapes use.
pub struct Materials<'a, 'b> {
    record: &'a Record,
    pub textures: Textures<'a, 'b>,
    made: BTreeMap<Option<usize>, Surface>,
    /// Materials and media, as TOML.
    pub text: String,
    /// Lengths in the world of a length of the file.
    scale: f64,
}

/// A number, or a texture's.
struct Mean(f64);

impl<'a, 'b> Materials<'a, 'b> {
    /// `scale`: lengths in the world of a length of the file.
    pub fn new(record: &'a Record, textures: Textures<'a, 'b>, scale: f64) -> Self {
        Self {
            record,
            textures,
            made: BTreeMap::new(),
            text: String::new(),
            scale,
        }
    }

    /// What shapes of a material are told, by its number; without one, the default material.
    pub fn surface(&mut self, index: Option<usize>, notes: &mut Notes) -> Result<Surface, Flaw> {
        if let Some(made) = self.made.get(&index) {
            return Ok(made.clone());
        }
        let default = Material::default();
        let record = self.record;
        let material = index.map_or(Some(&default), |i| record.materials.get(i));
        let material = material.ok_or("it names a material that is not there")?;
        let (id, name) = match (index, &material.name) {
            (Some(i), Some(name)) => (format!("material{i}"), format!("{name:?}")),
            (Some(i), None) => (format!("material{i}"), i.to_string()),
            (None, _) => ("default".to_string(), "that is the default".to_string()),
        };
        let in_material = |flaw: Flaw| Flaw::from(format!("the material {name}: {}", flaw.message));
        let mut writer = Writer {
            material,
            id: &id,
            name: &name,
            textures: &mut self.textures,
            notes,
            uv_set: main_uv_set(material),
        };
        let emission = writer.emission().map_err(in_material)?;
        let written = writer.write(self.scale).map_err(in_material)?;
        self.text.push_str(&written.text);
        let surface = Surface {
            uv_set: main_uv_set(material),
            emission,
            is_glass: written.is_glass,
            interior: written.has_medium.then(|| id.clone()),
            id: id.clone(),
            name: name.clone(),
        };
        self.made.insert(index, surface.clone());
        Ok(surface)
    }
}

/// The texture coordinates of the texture that matters most.
fn main_uv_set(material: &Material) -> u32 {
    let pbr = &material.pbr_metallic_roughness;
    let x = &material.extensions;
    let transmission = x.transmission.as_ref().and_then(|t| t.transmission_texture.as_ref());
    let diffuse = x.specular_glossiness.as_ref().and_then(|s| s.diffuse_texture.as_ref());
    let in_order = [
        pbr.base_color_texture.as_ref(),
        diffuse,
        material.normal_texture.as_ref(),
        pbr.metallic_roughness_texture.as_ref(),
        material.emissive_texture.as_ref(),
        transmission,
    ];
    in_order.into_iter().flatten().next().map_or(0, uv_set)
}

/// What a material is without its extensions. The colour is TOML.
struct Base {
    color: String,
    metallic: f64,
    roughness: f64,
}

struct Written {
    text: String,
    is_glass: bool,
    has_medium: bool,
}

/// One material on its way.
struct Writer<'w, 'a, 'b> {
    material: &'w Material,
    id: &'w str,
    name: &'w str,
    textures: &'w mut Textures<'a, 'b>,
    notes: &'w mut Notes,
    uv_set: u32,
}

impl Writer<'_, '_, '_> {
    fn note(&mut self, note: impl Into<String>) {
        self.notes.add_of(note, self.name);
    }

    /// Whether a texture lies on the mesh as the others do; says so where it does not.
    fn lies_with_others(&mut self, used: &TextureUse) -> bool {
        if self.textures.wraps_in_two_ways(used) {
            self.note("beyond their edges textures go on along v as they do along u: materials");
        }
        let is_so = uv_set(used) == self.uv_set;
        if !is_so {
            self.note(
                "textures of one material have several sets of texture coordinates; those that are not in its main one \
                 count by their mean, and normals not at all: materials",
            );
        }
        is_so
    }

    /// A number times the mean of a texture's channel.
    fn mean(&mut self, factor: f64, used: Option<&TextureUse>, channel: usize) -> Result<Mean, Flaw> {
        let Some(used) = used else {
            return Ok(Mean(factor));
        };
        let image = self.textures.picture(used, Encoding::Raw)?;
        Ok(Mean(factor * mean(&image)[channel]))
    }

    /// A colour, or a picture of one, as TOML. `what` is what it is called.
    fn color(&mut self, factor: [f64; 3], used: Option<&TextureUse>, what: &str) -> Result<String, Flaw> {
        let Some(used) = used else {
            return Ok(numbers(&factor));
        };
        let image = self.textures.picture(used, Encoding::Srgb)?;
        if !self.lies_with_others(used) {
            let mean = mean(&image);
            return Ok(numbers(&std::array::from_fn::<_, 3, _>(|c| factor[c] * mean[c])));
        }
        let image = times(image, Rgb::from_array(factor.map(|x| x as f32)));
        let name = format!("{}{what}", self.id);
        self.textures.written(used, &name, image, "")
    }

    /// Radiance, if there is any. A texture counts by its mean.
    fn emission(&mut self) -> Result<Option<String>, Flaw> {
        let strength = self.material.extensions.emissive_strength.as_ref();
        let strength = strength.map_or(1.0, |s| s.emissive_strength);
        let factor = self.material.emissive_factor.map(|c| c * strength);
        if factor == [0.0; 3] {
            return Ok(None);
        }
        let mean = match &self.material.emissive_texture {
            None => [1.0; 3],
            Some(used) => {
                self.note("textures of emission count by their mean: materials");
                mean(&*self.textures.picture(used, Encoding::Srgb)?)
            }
        };
        let radiance: [f64; 3] = std::array::from_fn(|c| factor[c] * mean[c]);
        if radiance == [0.0; 3] {
            return Ok(None);
        }
        if self.material.double_sided {
            self.note("surfaces with two sides give light from the front alone: materials");
        }
        Ok(Some(numbers(&radiance)))
    }

    /// What of light does not go straight through, as TOML.
    fn opacity(&mut self) -> Result<Option<String>, Flaw> {
        let pbr = &self.material.pbr_metallic_roughness;
        let (factor, texture) = match &self.material.extensions.specular_glossiness {
            Some(gloss) => (gloss.diffuse_factor[3], &gloss.diffuse_texture),
            None => (pbr.base_color_factor[3], &pbr.base_color_texture),
        };
        let mode = self.material.alpha_mode;
        let cutoff = self.material.alpha_cutoff.unwrap_or(0.5);
        let alpha = |a: f64| match mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Blend => a.clamp(0.0, 1.0),
            AlphaMode::Mask => f64::from(u8::from(a >= cutoff)),
        };
        if mode == AlphaMode::Opaque {
            return Ok(None);
        }
        let Some(used) = texture else {
            return Ok(Some(number(alpha(factor))).filter(|_| alpha(factor) < 1.0));
        };
        let image = self.textures.picture(used, Encoding::Alpha)?;
        let image = mapped(&image, |p| Rgb::splat(alpha(f64::from(p.x) * factor) as f32));
        if image.pixels.iter().all(|p| *p == Rgb::ONE) {
            return Ok(None);
        }
        if !self.lies_with_others(used) {
            return Ok(Some(number(mean(&image)[0])));
        }
        let name = format!("{}.opacity", self.id);
        self.textures.written(used, &name, image, "").map(Some)
    }

    /// The index of refraction whose reflectance at normal incidence is that of `ior` and KHR_materials_specular.
    fn reflecting_ior(&mut self, ior: f64) -> Result<f64, Flaw> {
        let Some(specular) = &self.material.extensions.specular else {
            return Ok(ior);
        };
        let Mean(factor) = match &specular.specular_texture {
            None => Mean(specular.specular_factor),
            Some(used) => {
                self.note("textures of KHR_materials_specular count by their mean: materials");
                let alpha = self.textures.picture(used, Encoding::Alpha)?;
                Mean(specular.specular_factor * mean(&alpha)[0])
            }
        };
        let mut tint = specular.specular_color_factor;
        if let Some(used) = &specular.specular_color_texture {
            self.note("textures of KHR_materials_specular count by their mean: materials");
            let mean = mean(&*self.textures.picture(used, Encoding::Srgb)?);
            tint = std::array::from_fn(|c| tint[c] * mean[c]);
        }
        if tint[0] != tint[1] || tint[1] != tint[2] {
            self.note("colours of KHR_materials_specular count by their luminance: materials");
        }
        let tint = 0.2126 * tint[0] + 0.7152 * tint[1] + 0.0722 * tint[2];
        if factor == 1.0 && tint == 1.0 {
            return Ok(ior);
        }
        let plain = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let root = (plain * factor * tint).clamp(0.0, MOST_REFLECTANCE).sqrt();
        Ok((1.0 + root) / (1.0 - root))
    }

    fn base(&mut self) -> Result<Base, Flaw> {
        let material = self.material;
        if let Some(gloss) = &material.extensions.specular_glossiness {
            return self.base_of_gloss(gloss);
        }
        let pbr = &material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor;
        let texture = pbr.metallic_roughness_texture.as_ref();
        if texture.is_some() {
            self.note("textures of metallic and roughness count by their mean: materials");
        }
        Ok(Base {
            color: self.color([r, g, b], pbr.base_color_texture.as_ref(), "")?,
            metallic: self.mean(pbr.metallic_factor, texture, 2)?.0,
            roughness: self.mean(pbr.roughness_factor, texture, 1)?.0,
        })
    }

    /// Of KHR_materials_pbrSpecularGlossiness.
    fn base_of_gloss(&mut self, gloss: &SpecularGlossiness) -> Result<Base, Flaw> {
        self.note("KHR_materials_pbrSpecularGlossiness is converted, textures of it but the diffuse count by their mean: materials");
        let (mut specular, mut glossiness) = (gloss.specular_factor, gloss.glossiness_factor);
        if let Some(used) = &gloss.specular_glossiness_texture {
            let by = mean(&*self.textures.picture(used, Encoding::Srgb)?);
            specular = std::array::from_fn(|c| specular[c] * by[c]);
            glossiness *= mean(&*self.textures.picture(used, Encoding::Alpha)?)[0];
        }
        let [r, g, b, _] = gloss.diffuse_factor;
        let factor = [r, g, b];
        let roughness = (1.0 - glossiness).clamp(0.0, 1.0);
        let Some(used) = &gloss.diffuse_texture else {
            let metallic = metallic(factor, specular);
            let color = numbers(&base_color(factor, specular, metallic));
            return Ok(Base {
                color,
                metallic,
                roughness,
            });
        };
        let image = times(
            self.textures.picture(used, Encoding::Srgb)?,
            Rgb::from_array(factor.map(|x| x as f32)),
        );
        let metallic = metallic(mean(&image), specular);
        let of = |diffuse: [f64; 3]| base_color(diffuse, specular, metallic);
        let color = match self.lies_with_others(used) {
            false => numbers(&of(mean(&image))),
            true => {
                let image = mapped(&image, |p| {
                    Rgb::from_array(of(p.to_array().map(f64::from)).map(|x| x as f32))
                });
                self.textures.written(used, self.id, image, "")?
            }
        };
        Ok(Base {
            color,
            metallic,
            roughness,
        })
    }

    fn write(&mut self, scale: f64) -> Result<Written, Flaw> {
        self.note_what_does_not_count();
        let material = self.material;
        let x = &material.extensions;
        let Base {
            color: base_color,
            metallic,
            roughness,
        } = self.base()?;
        let opacity = self.opacity()?;
        let mut common = String::new();
        if let Some(opacity) = &opacity {
            let _ = writeln!(common, "opacity = {opacity}");
        }
        if let Some(used) = &material.normal_texture
            && self.lies_with_others(used)
        {
            let image = self.textures.picture(used, Encoding::Raw)?;
            let image = scaled_normals(image, used.scale.unwrap_or(1.0));
            let name = format!("{}.normal", self.id);
            let map = self.textures.written(used, &name, image, "")?;
            let _ = writeln!(common, "normal_map = {map}");
        }
        let ior = match x.ior.as_ref().map(|x| x.ior) {
            // As if it reflected everything, which is for conversions of other models.
            Some(0.0) => LARGEST_IOR,
            ior => ior.unwrap_or(1.5),
        };
        let transmission = match &x.transmission {
            None => 0.0,
            Some(t) => {
                let Mean(share) = self.mean(t.transmission_factor, t.transmission_texture.as_ref(), 0)?;
                share * (1.0 - metallic)
            }
        };
        if transmission > 0.0 && transmission < 1.0 {
            self.note("what transmits half of the light or more is glass, what transmits less is not: materials");
        }
        let id = self.id;
        let mut text = String::new();
        if transmission >= 0.5 {
            let volume = x.volume.clone().unwrap_or_default();
            let _ = writeln!(text, "[materials.{id}]");
            let is_solid = volume.thickness_factor > 0.0;
            let alpha = roughness * roughness;
            match (is_solid, alpha >= LEAST_ALPHA) {
                (false, is_rough) => {
                    if is_rough {
                        self.note("panes (transmission without thickness) are smooth: materials");
                    }
                    let _ = writeln!(text, "type = \"thin_dielectric\"");
                }
                (true, false) => {
                    let _ = writeln!(text, "type = \"dielectric\"");
                }
                (true, true) => {
                    let _ = writeln!(text, "type = \"rough_dielectric\"\nalpha = {}", number(alpha));
                }
            }
            let _ = write!(
                text,
                "ior = {}\nspecular_transmittance = {base_color}\n{common}",
                number(ior)
            );
            let medium = attenuation(&volume, scale).filter(|_| is_solid && opacity.is_none());
            let has_medium = medium.is_some();
            if let Some(sigma_a) = medium {
                let _ = writeln!(
                    text,
                    "[media.{id}]\ntype = \"homogeneous\"\nsigma_a = {}\nsigma_s = 0.0",
                    numbers(&sigma_a)
                );
            }
            return Ok(Written {
                text,
                is_glass: is_solid && opacity.is_none(),
                has_medium,
            });
        }
        let ior = self.reflecting_ior(ior)?;
        let _ = write!(
            text,
            "[materials.{id}]\ntype = \"principled\"\nbase_color = {base_color}\nmetallic = {}\nroughness = {}\n\
             two_sided = {}\n{common}",
            number(metallic),
            number(roughness),
            material.double_sided
        );
        if ior != 1.5 {
            let _ = writeln!(text, "ior = {}", number(ior));
        }
        Ok(Written {
            text,
            is_glass: false,
            has_medium: false,
        })
    }

    /// Say what is left out or counts otherwise.
    fn note_what_does_not_count(&mut self) {
        let material = self.material;
        let x = &material.extensions;
        if material.occlusion_texture.is_some() {
            self.note("textures of occlusion do not count, since shadows are found by light: materials");
        }
        if x.unlit.is_some() {
            self.note("KHR_materials_unlit does not count, they are lit as others are: materials");
        }
        if x.clearcoat.as_ref().is_some_and(|coat| coat.clearcoat_factor > 0.0) {
            self.note("KHR_materials_clearcoat does not count: materials");
        }
        if x.sheen
            .as_ref()
            .is_some_and(|sheen| sheen.sheen_color_factor != [0.0; 3])
        {
            self.note("KHR_materials_sheen does not count: materials");
        }
        for name in x.others.keys() {
            self.note(format!("{name} is not supported and does not count: materials"));
        }
    }
}

/// sigma_a of what is inside, per unit of the world. `scale`: such units of one of the file.
fn attenuation(volume: &Volume, scale: f64) -> Option<[f64; 3]> {
    let distance = volume.attenuation_distance.filter(|d| *d > 0.0)? * scale;
    let sigma = |c: f64| -libm::log(c.clamp(LEAST_ATTENUATION, 1.0)) / distance;
    let sigma = volume.attenuation_color.map(sigma);
    sigma.iter().any(|s| *s > 0.0).then(|| sigma.map(f64::abs))
}

/// Roughness of microfacets from which on a surface is rough.
const LEAST_ALPHA: f64 = 0.001;
/// A channel of which less is left counts as this.
const LEAST_ATTENUATION: f64 = 1e-6;
/// Reflectance at normal incidence, at most: that of the largest index of refraction.
const MOST_REFLECTANCE: f64 = 0.96;
/// An index of refraction that is not too large.
const LARGEST_IOR: f64 = 99.0;
