//! KHR_materials_clearcoat and KHR_materials_sheen by the lobes of `principled`, which are not quite the same.

use super::record::{Clearcoat, Sheen};
use super::texture::mean;
use super::write::number;
use super::writer::Writer;
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use std::fmt::Write;

/// Widths of the lobe of `clearcoat` where its gloss is 0 and 1 (Burley 2012, as Mitsuba has it).
const ROUGHEST: f64 = 0.1;
const SMOOTHEST: f64 = 0.001;

impl Writer<'_, '_, '_> {
    /// The fields of both.
    pub fn lobes(&mut self) -> Result<String, Flaw> {
        let mut text = String::new();
        let x = &self.material.extensions;
        if let Some(coat) = x.clearcoat.as_ref().filter(|coat| coat.clearcoat_factor > 0.0) {
            self.clearcoat(coat, &mut text)?;
        }
        if let Some(sheen) = x.sheen.as_ref().filter(|sheen| sheen.sheen_color_factor != [0.0; 3]) {
            self.sheen(sheen, &mut text)?;
        }
        Ok(text)
    }

    fn clearcoat(&mut self, coat: &Clearcoat, text: &mut String) -> Result<(), Flaw> {
        self.note(
            "KHR_materials_clearcoat is the lobe clearcoat of principled, which has longer tails and takes no light from \
             what is below: materials",
        );
        let strength = self.amount(coat.clearcoat_factor, coat.clearcoat_texture.as_ref(), 0, "clearcoat")?;
        let mut roughness = coat.clearcoat_roughness_factor;
        if let Some(used) = &coat.clearcoat_roughness_texture {
            self.note("textures of the roughness of KHR_materials_clearcoat count by their mean: materials");
            roughness *= mean(&*self.textures.picture(used, Encoding::Raw)?)[1];
        }
        if coat.clearcoat_normal_texture.is_some() {
            self.note("normals of KHR_materials_clearcoat do not count: materials");
        }
        let alpha = roughness * roughness;
        if alpha > ROUGHEST {
            let most = ROUGHEST.sqrt();
            self.note(format!(
                "a roughness of KHR_materials_clearcoat above {most:.2} counts as that: materials"
            ));
        }
        let gloss = ((ROUGHEST - alpha) / (ROUGHEST - SMOOTHEST)).clamp(0.0, 1.0);
        let _ = writeln!(
            text,
            "clearcoat = {}\nclearcoat_gloss = {}",
            strength.text,
            number(gloss)
        );
        Ok(())
    }

    fn sheen(&mut self, sheen: &Sheen, text: &mut String) -> Result<(), Flaw> {
        self.note(
            "KHR_materials_sheen is the lobe sheen of principled, which is white, of one roughness, and takes no light \
             from what is below: materials",
        );
        let mut color = sheen.sheen_color_factor;
        if let Some(used) = &sheen.sheen_color_texture {
            self.note("textures of the colour of KHR_materials_sheen count by their mean: materials");
            let by = mean(&*self.textures.picture(used, Encoding::Srgb)?);
            color = std::array::from_fn(|c| color[c] * by[c]);
        }
        let luminance = 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2];
        let _ = writeln!(text, "sheen = {}", number(luminance.clamp(0.0, 1.0)));
        Ok(())
    }
}
