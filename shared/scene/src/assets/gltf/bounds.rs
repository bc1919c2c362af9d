//! Clamps material factors to the range that glTF 2.0 allows.

use super::record::Material;

/// Deviations up to this are rounding.
const ROUNDING: f64 = 1e-3;

/// Clamps factors, and records whether one was out of range by more than rounding.
#[derive(Default)]
struct Bounds {
    is_beyond: bool,
}

impl Bounds {
    fn keep(&mut self, factors: &mut [f64], most: f64) {
        for factor in factors {
            let kept = factor.clamp(0.0, most);
            self.is_beyond |= (kept - *factor).abs() > ROUNDING;
            *factor = kept;
        }
    }

    fn share(&mut self, factor: &mut f64) {
        self.keep(std::slice::from_mut(factor), 1.0);
    }
}

/// The material with its factors clamped, and whether one was out of range by more than rounding. Emission has no upper
/// bound: files from before KHR_materials_emissive_strength put values above 1 into the factor.
pub fn bounded(material: &Material) -> (Material, bool) {
    let mut material = material.clone();
    let mut bounds = Bounds::default();
    let pbr = &mut material.pbr_metallic_roughness;
    bounds.keep(&mut pbr.base_color_factor, 1.0);
    bounds.share(&mut pbr.metallic_factor);
    bounds.share(&mut pbr.roughness_factor);
    bounds.keep(&mut material.emissive_factor, f64::INFINITY);
    let x = &mut material.extensions;
    if let Some(anisotropy) = &mut x.anisotropy {
        bounds.share(&mut anisotropy.anisotropy_strength);
    }
    if let Some(coat) = &mut x.clearcoat {
        bounds.share(&mut coat.clearcoat_factor);
        bounds.share(&mut coat.clearcoat_roughness_factor);
    }
    if let Some(through) = &mut x.diffuse_transmission {
        bounds.share(&mut through.diffuse_transmission_factor);
        bounds.keep(&mut through.diffuse_transmission_color_factor, 1.0);
    }
    if let Some(film) = &mut x.iridescence {
        bounds.share(&mut film.iridescence_factor);
    }
    if let Some(gloss) = &mut x.specular_glossiness {
        bounds.keep(&mut gloss.diffuse_factor, 1.0);
        bounds.keep(&mut gloss.specular_factor, 1.0);
        bounds.share(&mut gloss.glossiness_factor);
    }
    if let Some(sheen) = &mut x.sheen {
        bounds.keep(&mut sheen.sheen_color_factor, 1.0);
        bounds.share(&mut sheen.sheen_roughness_factor);
    }
    if let Some(specular) = &mut x.specular {
        bounds.share(&mut specular.specular_factor);
        bounds.keep(&mut specular.specular_color_factor, f64::INFINITY);
    }
    if let Some(transmission) = &mut x.transmission {
        bounds.share(&mut transmission.transmission_factor);
    }
    if let Some(volume) = &mut x.volume {
        bounds.keep(&mut volume.attenuation_color, 1.0);
    }
    (material, bounds.is_beyond)
}
