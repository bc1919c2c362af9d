//! What all kinds of glTF materials share: colour, opacity, metalness and roughness.

use super::notes::Notes;
use super::record::{AlphaMode, Material, TextureUse};
use super::texture::{Textures, mean, uv_set};
use super::write::{number, numbers};
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use beamfarm_render::math::Rgb;

/// A number, or a texture of numbers.
pub struct Amount {
    /// As TOML.
    pub text: String,
    /// Its mean.
    pub mean: f64,
    pub is_texture: bool,
}

impl Amount {
    pub fn number(x: f64) -> Self {
        Self {
            text: number(x),
            mean: x,
            is_texture: false,
        }
    }
}

/// A material without its extensions. The colour is TOML.
pub struct Base {
    pub color: String,
    pub metallic: Amount,
    pub roughness: Amount,
}

/// A material being written.
pub struct Writer<'w, 'a, 'b> {
    pub material: &'w Material,
    pub id: &'w str,
    pub name: &'w str,
    pub textures: &'w mut Textures<'a, 'b>,
    pub notes: &'w mut Notes,
    pub uv_set: u32,
    /// Whether vertex colours multiply the base colour.
    pub colored: bool,
}

impl Writer<'_, '_, '_> {
    pub fn note(&mut self, note: impl Into<String>) {
        self.notes.add_of(note, self.name);
    }

    /// Whether a texture has the same placement on the mesh as the others; adds a note if not.
    pub fn lies_with_others(&mut self, used: &TextureUse) -> bool {
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

    /// A number times a texture's channel. `what`: its name.
    pub fn amount(
        &mut self,
        factor: f64,
        used: Option<&TextureUse>,
        channel: usize,
        what: &str,
    ) -> Result<Amount, Flaw> {
        let Some(used) = used else {
            return Ok(Amount::number(factor));
        };
        self.amount_of(factor, used, (Encoding::Raw, channel), what)
    }

    /// A number times a texture's alpha.
    pub fn alpha(&mut self, factor: f64, used: Option<&TextureUse>, what: &str) -> Result<Amount, Flaw> {
        match used {
            None => Ok(Amount::number(factor)),
            Some(used) => self.amount_of(factor, used, (Encoding::Alpha, 0), what),
        }
    }

    fn amount_of(
        &mut self,
        factor: f64,
        used: &TextureUse,
        (encoding, channel): (Encoding, usize),
        what: &str,
    ) -> Result<Amount, Flaw> {
        let mean = factor * self.textures.mean(used, encoding)?[channel];
        if !self.lies_with_others(used) || factor == 0.0 {
            return Ok(Amount::number(mean));
        }
        let name = format!("channel {channel} times {factor:?}");
        let image = self.textures.made(used, encoding, name, |p| {
            Rgb::splat((f64::from(p.to_array()[channel]) * factor).clamp(0.0, 1.0) as f32)
        })?;
        let name = format!("{}.{what}", self.id);
        Ok(Amount {
            text: self.textures.written(used, &name, image, "")?,
            mean,
            is_texture: true,
        })
    }

    /// Interpolates between two numbers by a texture's channel, as TOML.
    pub fn between(
        &mut self,
        [low, high]: [f64; 2],
        used: &TextureUse,
        channel: usize,
        what: &str,
    ) -> Result<String, Flaw> {
        let at = |share: f64| low + (high - low) * share;
        if !self.lies_with_others(used) {
            return Ok(number(at(self.textures.mean(used, Encoding::Raw)?[channel])));
        }
        let name = format!("channel {channel} from {low:?} to {high:?}");
        let image = self.textures.made(used, Encoding::Raw, name, |p| {
            Rgb::splat(at(f64::from(p.to_array()[channel])).clamp(0.0, 1.0) as f32)
        })?;
        let name = format!("{}.{what}", self.id);
        self.textures.written(used, &name, image, "")
    }

    /// A colour, or an image of one, as TOML. `what`: its name.
    pub fn color(&mut self, factor: [f64; 3], used: Option<&TextureUse>, what: &str) -> Result<String, Flaw> {
        let Some(used) = used else {
            return Ok(numbers(&factor));
        };
        if !self.lies_with_others(used) {
            let mean = self.textures.mean(used, Encoding::Srgb)?;
            return Ok(numbers(&std::array::from_fn::<_, 3, _>(|c| factor[c] * mean[c])));
        }
        let image = (self.textures).times(used, Encoding::Srgb, Rgb::from_array(factor.map(|x| x as f32)))?;
        let name = format!("{}{what}", self.id);
        self.textures.written(used, &name, image, "")
    }

    /// The share of light that does not pass straight through, as TOML.
    pub fn opacity(&mut self) -> Result<Option<String>, Flaw> {
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
        let name = format!("opacity {mode:?} {cutoff:?} {factor:?}");
        let opaque = |p: Rgb| Rgb::splat(alpha(f64::from(p.x) * factor) as f32);
        let image = self.textures.made(used, Encoding::Alpha, name, opaque)?;
        if image.pixels.iter().all(|p| *p == Rgb::ONE) {
            return Ok(None);
        }
        if !self.lies_with_others(used) {
            return Ok(Some(number(mean(&image)[0])));
        }
        let name = format!("{}.opacity", self.id);
        self.textures.written(used, &name, image, "").map(Some)
    }

    /// The base of a metallic-roughness or specular-glossiness material.
    pub fn base(&mut self) -> Result<Base, Flaw> {
        let base = self.plain_base()?;
        Ok(match self.colored {
            true => Base {
                color: self.textures.times_vertices(&base.color, self.id),
                ..base
            },
            false => base,
        })
    }

    fn plain_base(&mut self) -> Result<Base, Flaw> {
        let material = self.material;
        if let Some(gloss) = &material.extensions.specular_glossiness {
            return self.base_of_gloss(gloss);
        }
        let pbr = &material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor;
        let texture = pbr.metallic_roughness_texture.as_ref();
        Ok(Base {
            color: self.color([r, g, b], pbr.base_color_texture.as_ref(), "")?,
            metallic: self.amount(pbr.metallic_factor, texture, 2, "metallic")?,
            roughness: self.amount(pbr.roughness_factor, texture, 1, "roughness")?,
        })
    }
}
