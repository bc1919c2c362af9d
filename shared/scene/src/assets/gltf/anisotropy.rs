//! KHR_materials_anisotropy.

use super::record::Anisotropy;
use super::write::number;
use super::writer::{Amount, Writer};
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use beamfarm_render::math::Rgb;
use std::f64::consts::TAU;

/// A material's anisotropy.
pub struct Stretch {
    /// Its strength.
    pub strength: Amount,
    /// The field for the tangent's rotation, or empty.
    pub rotation: String,
}

impl Stretch {
    /// The fields of a `principled` material.
    pub fn fields(&self) -> String {
        format!("anisotropy_strength = {}\n{}", self.strength.text, self.rotation)
    }

    /// The fields of `principled` glass, with the mean strength.
    pub fn of_filmed_glass(&self) -> String {
        format!(
            "anisotropy_strength = {}\n{}",
            number(self.strength.mean),
            self.rotation
        )
    }

    /// The roughness of glass, with the mean strength.
    pub fn of_glass(&self, alpha: f64) -> String {
        let strength = self.strength.mean;
        let along = alpha + (1.0 - alpha) * strength * strength;
        format!(
            "alpha_u = {}\nalpha_v = {}\n{}",
            number(along),
            number(alpha),
            self.rotation
        )
    }
}

impl Writer<'_, '_, '_> {
    /// `None`: isotropic.
    pub fn stretch(&mut self) -> Result<Option<Stretch>, Flaw> {
        let given = self.material.extensions.anisotropy.as_ref();
        let Some(given) = given.filter(|given| given.anisotropy_strength > 0.0) else {
            return Ok(None);
        };
        let used = given.anisotropy_texture.as_ref();
        let strength = self.amount(given.anisotropy_strength, used, 2, "anisotropy")?;
        let rotation = match self.turns(given)? {
            turns if turns == "0.0" => String::new(),
            turns => format!("anisotropic_rotation = {turns}\n"),
        };
        Ok(Some(Stretch { strength, rotation }))
    }

    /// The tangent's rotation in turns, as TOML.
    fn turns(&mut self, given: &Anisotropy) -> Result<String, Flaw> {
        let rotation = given.anisotropy_rotation;
        // Opposite directions are equivalent: half a turn at most, so that rounding never reaches a full one.
        let turns = |x: f64, y: f64| ((libm::atan2(y, x) + rotation) / TAU).rem_euclid(0.5);
        let Some(used) = &given.anisotropy_texture else {
            return Ok(number(turns(1.0, 0.0)));
        };
        if !self.lies_with_others(used) {
            let [x, y, _] = self.textures.mean(used, Encoding::Raw)?;
            return Ok(number(turns(2.0 * x - 1.0, 2.0 * y - 1.0)));
        }
        let what = format!("turns {rotation:?}");
        let image = self.textures.made(used, Encoding::Raw, what, |p| {
            let [x, y, _] = p.to_array().map(|c| 2.0 * f64::from(c) - 1.0);
            Rgb::splat(turns(x, y) as f32)
        })?;
        let name = format!("{}.direction", self.id);
        self.textures.unfiltered(used, &name, image)
    }
}
