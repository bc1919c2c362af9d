//! KHR_materials_pbrSpecularGlossiness by the usual conversion: a metallic material with the same colours at normal
//! incidence.
//!
//! Source: the conversion in the Khronos Group's examples for that extension.

use super::record::{SpecularGlossiness, TextureUse};
use super::texture::mean;
use super::write::numbers;
use super::writer::{Amount, Base, Writer};
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::texture::Image;
use std::sync::Arc;

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC: f64 = 0.04;
/// The smallest divisor.
const LEAST: f64 = 1e-6;

/// How metallic a surface with these diffuse and specular colours is.
pub fn metallic(diffuse: [f64; 3], specular: [f64; 3]) -> f64 {
    let [d, s] = [diffuse, specular].map(brightness);
    if s < DIELECTRIC {
        return 0.0;
    }
    let strength = specular.into_iter().fold(0.0, f64::max);
    let b = d * (1.0 - strength) / (1.0 - DIELECTRIC) + s - 2.0 * DIELECTRIC;
    let root = (b * b - 4.0 * DIELECTRIC * (DIELECTRIC - s)).max(0.0).sqrt();
    ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

/// Its base colour.
pub fn base_color(diffuse: [f64; 3], specular: [f64; 3], metallic: f64) -> [f64; 3] {
    let strength = specular.into_iter().fold(0.0, f64::max);
    let share = metallic * metallic;
    std::array::from_fn(|c| {
        let of_base = diffuse[c] * (1.0 - strength) / (1.0 - DIELECTRIC) / (1.0 - metallic).max(LEAST);
        let of_metal = (specular[c] - DIELECTRIC * (1.0 - metallic)) / metallic.max(LEAST);
        (of_base * (1.0 - share) + of_metal * share).clamp(0.0, 1.0)
    })
}

/// Perceived brightness, from the squares of the channels.
fn brightness([r, g, b]: [f64; 3]) -> f64 {
    (0.299 * r * r + 0.587 * g * g + 0.114 * b * b).sqrt()
}

/// A texture times a factor, or a single pixel if there is no texture.
struct Layer<'m> {
    used: Option<&'m TextureUse>,
    image: Arc<Image>,
}

impl Layer<'_> {
    fn is_uniform(&self) -> bool {
        self.image.pixels.len() == 1
    }

    /// Replace the image by its mean.
    fn flatten(&mut self) {
        let mean = Rgb::from_array(mean(&self.image).map(|x| x as f32));
        self.image = pixel(mean);
    }

    /// The value for pixel `i` of an image of the other size.
    fn at(&self, i: usize, of: &Image) -> [f64; 3] {
        let image = &self.image;
        let [width, height, of_width, of_height] = [image.width, image.height, of.width, of.height].map(|n| n as usize);
        let [x, y] = [i % of_width * width / of_width, i / of_width * height / of_height];
        image.pixels[y * width + x].to_array().map(f64::from)
    }
}

fn pixel(value: Rgb) -> Arc<Image> {
    Arc::new(Image {
        width: 1,
        height: 1,
        pixels: vec![value],
        alpha: Vec::new(),
    })
}

impl Writer<'_, '_, '_> {
    fn layer<'m>(
        &mut self,
        factor: [f64; 3],
        used: Option<&'m TextureUse>,
        encoding: Encoding,
    ) -> Result<Layer<'m>, Flaw> {
        let factor = Rgb::from_array(factor.map(|x| x as f32));
        let image = match used {
            None => pixel(factor),
            Some(used) => self.textures.times(used, encoding, factor)?,
        };
        Ok(Layer { used, image })
    }

    /// Converts a KHR_materials_pbrSpecularGlossiness material, texel by texel at the resolution of its finest texture.
    pub fn base_of_gloss(&mut self, gloss: &SpecularGlossiness) -> Result<Base, Flaw> {
        self.note("KHR_materials_pbrSpecularGlossiness is converted: materials");
        let [r, g, b, _] = gloss.diffuse_factor;
        let [diffuse, specular] = [&gloss.diffuse_texture, &gloss.specular_glossiness_texture].map(Option::as_ref);
        let Some(on) = diffuse.or(specular) else {
            // Without textures, the numbers stay as written.
            let metallic = metallic([r, g, b], gloss.specular_factor);
            return Ok(Base {
                color: numbers(&base_color([r, g, b], gloss.specular_factor, metallic)),
                metallic: Amount::number(metallic),
                roughness: Amount::number((1.0 - gloss.glossiness_factor).clamp(0.0, 1.0)),
            });
        };
        let mut layers = [
            self.layer([r, g, b], diffuse, Encoding::Srgb)?,
            self.layer(gloss.specular_factor, specular, Encoding::Srgb)?,
            self.layer([gloss.glossiness_factor; 3], specular, Encoding::Alpha)?,
        ];
        let lies = self.lies_with_others(on);
        for layer in &mut layers {
            let alike = layer.used.is_none_or(|used| self.textures.lie_alike(used, on));
            if !alike {
                self.note(
                    "specular and glossiness textures that do not lie as the diffuse ones do count by their mean: \
                     materials",
                );
            }
            if !lies || !alike {
                layer.flatten();
            }
        }
        let [diffuse, specular, glossiness] = &layers;
        let finest = layers.iter().max_by_key(|layer| layer.image.pixels.len());
        let size = finest.unwrap_or(diffuse).image.clone();
        let (mut colors, mut metals, mut roughnesses) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..size.pixels.len() {
            let [d, s] = [diffuse, specular].map(|layer| layer.at(i, &size));
            let metal = metallic(d, s);
            colors.push(Rgb::from_array(base_color(d, s, metal).map(|x| x as f32)));
            metals.push(Rgb::splat(metal as f32));
            let roughness = 1.0 - glossiness.at(i, &size)[0];
            roughnesses.push(Rgb::splat(roughness.clamp(0.0, 1.0) as f32));
        }
        let picture = |pixels| {
            let (width, height, alpha) = (size.width, size.height, Vec::new());
            Arc::new(Image {
                width,
                height,
                pixels,
                alpha,
            })
        };
        let [colors, metals, roughnesses] = [colors, metals, roughnesses].map(picture);
        let color = match layers.iter().all(Layer::is_uniform) {
            true => numbers(&mean(&colors)),
            false => self.textures.written(on, self.id, colors, "")?,
        };
        Ok(Base {
            color,
            metallic: self.amount_in(on, metals, "metallic")?,
            roughness: self.amount_in(on, roughnesses, "roughness")?,
        })
    }

    /// A texture of a number, or the number itself if it is the same everywhere.
    fn amount_in(&mut self, on: &TextureUse, image: Arc<Image>, what: &str) -> Result<Amount, Flaw> {
        let first = image.pixels.first().copied();
        if let Some(first) = first.filter(|first| image.pixels.iter().all(|p| p == first)) {
            return Ok(Amount::number(f64::from(first.x)));
        }
        let mean = mean(&image)[0];
        let name = format!("{}.{what}", self.id);
        Ok(Amount {
            text: self.textures.written(on, &name, image, "")?,
            mean,
            is_texture: true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectrics_and_metals_come_back() {
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        // A dielectric has a diffuse colour and reflects 4 %.
        let red = [0.6, 0.1, 0.2];
        assert_eq!(metallic(red, [0.04; 3]), 0.0);
        assert!(near(base_color(red, [0.04; 3], 0.0), red));
        // Gold has no diffuse colour.
        let gold = [1.0, 0.77, 0.34];
        assert!(metallic([0.0; 3], gold) > 0.999);
        assert!(near(base_color([0.0; 3], gold, 1.0), gold));
    }
}
