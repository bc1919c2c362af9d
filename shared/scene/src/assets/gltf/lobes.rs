//! KHR_materials_clearcoat, KHR_materials_iridescence and KHR_materials_sheen by lobes of `principled`. The last is of
//! microfibers in place of Charlie's distribution, and dims what is below in the same way.

use super::record::{Clearcoat, Iridescence, Sheen};
use super::write::number;
use super::writer::Writer;
use crate::assets::Flaw;
use std::fmt::Write;

impl Writer<'_, '_, '_> {
    /// The fields of all.
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
        if coat.clearcoat_normal_texture.is_some() {
            self.note("normals of KHR_materials_clearcoat do not count: materials");
        }
        let _ = writeln!(
            text,
            "coat_weight = {}\ncoat_roughness = {}",
            weight.text, roughness.text
        );
        Ok(())
    }

    fn iridescence(&mut self, film: &Iridescence, text: &mut String) -> Result<(), Flaw> {
        let weight = self.amount(
            film.iridescence_factor,
            film.iridescence_texture.as_ref(),
            0,
            "thin_film_weight",
        )?;
        // Of micrometres.
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
