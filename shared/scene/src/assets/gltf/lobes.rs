//! KHR_materials_clearcoat, KHR_materials_iridescence and KHR_materials_sheen as lobes of `principled`. Sheen uses
//! microfibres instead of Charlie's distribution, and dims what is below in the same way.

use super::anisotropy::Stretch;
use super::record::{Clearcoat, Iridescence, Sheen, TextureUse};
use super::texture::{mapped, mean};
use super::write::{number, numbers};
use super::writer::{Base, Writer};
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use beamfarm_render::math::Rgb;
use std::fmt::Write;

impl Writer<'_, '_, '_> {
    /// The fields of all lobes.
    pub fn lobes(&mut self) -> Result<String, Flaw> {
        let mut text = String::new();
        let x = &self.material.extensions;
        if let Some(coat) = x.clearcoat.as_ref().filter(|coat| coat.clearcoat_factor > 0.0) {
            self.clearcoat(coat, &mut text)?;
        }
        if let Some(film) = x.iridescence.as_ref().filter(|film| film.iridescence_factor > 0.0) {
            self.iridescence(film, &mut text)?;
        }
        if let Some(sheen) = x.sheen.as_ref().filter(|sheen| sheen.sheen_color_factor != [0.0; 3]) {
            self.sheen(sheen, &mut text)?;
        }
        Ok(text)
    }

    fn clearcoat(&mut self, coat: &Clearcoat, text: &mut String) -> Result<(), Flaw> {
        let weight = self.amount(coat.clearcoat_factor, coat.clearcoat_texture.as_ref(), 0, "coat_weight")?;
        let roughness = self.amount(
            coat.clearcoat_roughness_factor,
            coat.clearcoat_roughness_texture.as_ref(),
            1,
            "coat_roughness",
        )?;
        let _ = writeln!(
            text,
            "coat_weight = {}\ncoat_roughness = {}",
            weight.text, roughness.text
        );
        // A coat without its own map has the shape's normal, whatever map the base has.
        match &coat.clearcoat_normal_texture {
            None if self.material.normal_texture.is_some() => text.push_str("coat_levels = true\n"),
            None => {}
            Some(used) => match self.normal_map(used, "coat_normal")? {
                Some(map) => {
                    let _ = writeln!(text, "coat_normal_map = {map}");
                }
                None => text.push_str("coat_levels = true\n"),
            },
        }
        Ok(())
    }

    /// A normal map as TOML. `None`, with a note, if it is placed differently from the other textures.
    pub fn normal_map(&mut self, used: &TextureUse, what: &str) -> Result<Option<String>, Flaw> {
        if !self.lies_with_others(used) {
            return Ok(None);
        }
        let image = self.textures.normals(used, used.scale.unwrap_or(1.0))?;
        let name = format!("{}.{what}", self.id);
        self.textures.written(used, &name, image, "").map(Some)
    }

    /// Solid glass beneath a film, as `principled`: its type and fields, except the index. `None`: there is no film, or
    /// the colour, which has to be squared, cannot be built from what is given.
    pub fn filmed_glass(&mut self, base: &Base, stretch: Option<&Stretch>) -> Result<Option<String>, Flaw> {
        let x = &self.material.extensions;
        let Some(film) = x.iridescence.as_ref().filter(|film| film.iridescence_factor > 0.0) else {
            return Ok(None);
        };
        let is_solid = (x.volume.as_ref()).is_some_and(|volume| volume.thickness_factor > 0.0);
        if !is_solid || self.colored || x.specular_glossiness.is_some() {
            self.note(
                "KHR_materials_iridescence of glass without thickness, or of the colours of vertices, does not count: \
                 materials",
            );
            return Ok(None);
        }
        let mut text = format!(
            "\"principled\"\nspec_trans = 1\nbase_color = {}\nroughness = {}\n",
            self.color_of_both_sides()?,
            number(base.roughness.mean)
        );
        self.iridescence(film, &mut text)?;
        text.push_str(&stretch.map_or(String::new(), Stretch::of_filmed_glass));
        Ok(Some(text))
    }

    /// The square of the base colour, since `principled` tints each glass surface by its root.
    fn color_of_both_sides(&mut self) -> Result<String, Flaw> {
        let pbr = &self.material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor;
        let squared = |color: [f64; 3]| numbers(&color.map(|c| (c * c).clamp(0.0, 1.0)));
        let Some(used) = &pbr.base_color_texture else {
            return Ok(squared([r, g, b]));
        };
        let factor = Rgb::from_array([r, g, b].map(|c| c as f32));
        let image = self.textures.times(used, Encoding::Srgb, factor)?;
        if !self.lies_with_others(used) {
            return Ok(squared(mean(&image)));
        }
        let name = format!("{}.glass", self.id);
        let image = mapped(&image, |p| (p * p).clamp(Rgb::ZERO, Rgb::ONE));
        self.textures.written(used, &name, image, "")
    }

    fn iridescence(&mut self, film: &Iridescence, text: &mut String) -> Result<(), Flaw> {
        let weight = self.amount(
            film.iridescence_factor,
            film.iridescence_texture.as_ref(),
            0,
            "thin_film_weight",
        )?;
        // Range in micrometres.
        let [least, most] = [film.iridescence_thickness_minimum, film.iridescence_thickness_maximum]
            .map(|nanometres| 1e-3 * nanometres.max(0.0));
        let thickness = match &film.iridescence_thickness_texture {
            None => number(most),
            Some(used) => self.between([least, most], used, 1, "thin_film_thickness")?,
        };
        let _ = writeln!(
            text,
            "thin_film_weight = {}\nthin_film_thickness = {thickness}\nthin_film_ior = {}",
            weight.text,
            number(film.iridescence_ior.clamp(1.0, 5.0))
        );
        Ok(())
    }

    fn sheen(&mut self, sheen: &Sheen, text: &mut String) -> Result<(), Flaw> {
        let factor = sheen.sheen_color_factor.map(|c| c.clamp(0.0, 1.0));
        let color = self.color(factor, sheen.sheen_color_texture.as_ref(), ".sheen_color")?;
        let used = sheen.sheen_roughness_texture.as_ref();
        let roughness = self.alpha(sheen.sheen_roughness_factor.clamp(0.0, 1.0), used, "sheen_roughness")?;
        let _ = writeln!(
            text,
            "sheen_weight = 1\nsheen_color = {color}\nsheen_roughness = {}",
            roughness.text
        );
        Ok(())
    }
}
