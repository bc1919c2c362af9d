//! KHR_materials_diffuse_transmission: sheets that scatter light through, as a blend with `translucent`.

use super::write::number;
use super::writer::{Amount, Writer};
use crate::assets::Flaw;
use std::fmt::Write;

/// The blend, whose front is yet to be written.
pub struct Through {
    /// The blend and its transmitting part, as TOML.
    pub text: String,
    /// The name of the reflecting material.
    pub front: String,
}

impl Writer<'_, '_, '_> {
    /// A blend called `name` with the extra fields `own`. `None`: it transmits nothing.
    pub fn through(&mut self, name: &str, own: &str, metallic: &Amount) -> Result<Option<Through>, Flaw> {
        let x = &self.material.extensions;
        let said = x.diffuse_transmission.as_ref();
        let Some(said) = said.filter(|said| said.diffuse_transmission_factor > 0.0) else {
            return Ok(None);
        };
        // Metal transmits nothing.
        let factor = said.diffuse_transmission_factor * (1.0 - metallic.mean);
        let weight = self.alpha(factor, said.diffuse_transmission_texture.as_ref(), "through_weight")?;
        if weight.mean <= 0.0 {
            return Ok(None);
        }
        let color = self.color(
            said.diffuse_transmission_color_factor.map(|c| c.clamp(0.0, 1.0)),
            said.diffuse_transmission_color_texture.as_ref(),
            ".through",
        )?;
        self.note(
            "KHR_materials_diffuse_transmission is a blend with translucent, so that the share of light that comes \
             through takes its part of the gloss along: materials",
        );
        if metallic.is_texture && metallic.mean > 0.0 {
            self.note("of metal by a texture as much light comes through everywhere: materials");
        }
        if x.volume.as_ref().is_some_and(|volume| volume.thickness_factor > 0.0) {
            self.note("what light comes through, scattered, is a sheet without thickness: materials");
        }
        let [front, back] = ["front", "through"].map(|part| format!("{name}.{part}"));
        let weight = if weight.is_texture {
            weight.text
        } else {
            number(weight.mean.min(1.0))
        };
        let mut text = String::new();
        let _ = write!(
            text,
            "[materials.\"{name}\"]\ntype = \"blend\"\nmaterials = [\"{front}\", \"{back}\"]\nweight = {weight}\n{own}\
             [materials.\"{back}\"]\ntype = \"translucent\"\nreflectance = 0.0\ntransmittance = {color}\n"
        );
        Ok(Some(Through { text, front }))
    }
}
