//! Materials of glTF, as principled ones and glass.

use super::anisotropy::Stretch;
use super::bounds::bounded;
use super::notes::Notes;
use super::record::{Material, Record, Volume};
use super::texture::{Textures, uv_set};
use super::write::{number, numbers};
use super::writer::{Amount, Base, Writer};
use crate::assets::Flaw;
use crate::assets::image::Encoding;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What a material tells the shapes that use it.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The material's name within the piece.
    pub id: String,
    /// The name for messages.
    pub name: String,
    /// Which of the mesh's UV sets it uses.
    pub uv_set: u32,
    /// Whether it needs tangents, for a normal map or anisotropy.
    pub has_directions: bool,
    /// Radiance, as TOML: three numbers or a texture.
    pub emission: Option<String>,
    /// Whether both sides of an open mesh emit.
    pub emits_on_both: bool,
    /// Whether light passes through to the inside.
    pub is_glass: bool,
    /// The medium inside.
    pub interior: Option<String>,
    /// Whether it shows its colour without lighting other things or casting a shadow.
    pub is_unlit: bool,
}

/// The materials that shapes use.
pub struct Materials<'a, 'b> {
    record: &'a Record,
    pub textures: Textures<'a, 'b>,
    made: BTreeMap<(Option<usize>, bool), Surface>,
    /// Materials and media, as TOML.
    pub text: String,
    /// World units per unit of the file.
    scale: f64,
}

impl<'a, 'b> Materials<'a, 'b> {
    /// `scale`: world units per unit of the file.
    pub fn new(record: &'a Record, textures: Textures<'a, 'b>, scale: f64) -> Self {
        Self {
            record,
            textures,
            made: BTreeMap::new(),
            text: String::new(),
            scale,
        }
    }

    /// What a material, by number, tells its shapes; without a number, the default material. `colored`: vertex colours
    /// multiply its base colour.
    pub fn surface(&mut self, index: Option<usize>, colored: bool, notes: &mut Notes) -> Result<Surface, Flaw> {
        if let Some(made) = self.made.get(&(index, colored)) {
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
        let id = if colored { format!("{id}_colored") } else { id };
        let (material, is_beyond) = bounded(material);
        if is_beyond {
            notes.add_of(
                "factors beyond those that glTF allows count as the nearest allowed: materials",
                &name,
            );
        }
        let material = &material;
        let in_material = |flaw: Flaw| Flaw::from(format!("the material {name}: {}", flaw.message));
        let mut writer = Writer {
            material,
            id: &id,
            name: &name,
            textures: &mut self.textures,
            notes,
            uv_set: main_uv_set(material),
            colored,
        };
        let is_unlit = material.extensions.unlit.is_some();
        let (emission, written) = match is_unlit {
            true => writer.unlit().map_err(in_material)?,
            false => {
                let emission = writer.emission().map_err(in_material)?;
                (emission, writer.write(self.scale).map_err(in_material)?)
            }
        };
        self.text.push_str(&written.text);
        let surface = Surface {
            uv_set: main_uv_set(material),
            has_directions: has_directions(material),
            emission,
            emits_on_both: material.double_sided,
            is_glass: written.is_glass,
            interior: written.has_medium.then(|| id.clone()),
            is_unlit,
            id: id.clone(),
            name: name.clone(),
        };
        self.made.insert((index, colored), surface.clone());
        Ok(surface)
    }
}

fn has_directions(material: &Material) -> bool {
    let x = &material.extensions;
    let coat = x
        .clearcoat
        .as_ref()
        .and_then(|coat| coat.clearcoat_normal_texture.as_ref());
    material.normal_texture.is_some() || coat.is_some() || x.anisotropy.is_some()
}

/// The UV set of the most important texture.
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
        x.anisotropy.as_ref().and_then(|a| a.anisotropy_texture.as_ref()),
    ];
    in_order.into_iter().flatten().next().map_or(0, uv_set)
}

struct Written {
    text: String,
    is_glass: bool,
    has_medium: bool,
}

impl Writer<'_, '_, '_> {
    /// Emitted radiance, if any.
    fn emission(&mut self) -> Result<Option<String>, Flaw> {
        let strength = self.material.extensions.emissive_strength.as_ref();
        let strength = strength.map_or(1.0, |s| s.emissive_strength);
        let factor = self.material.emissive_factor.map(|c| c * strength);
        if factor == [0.0; 3] {
            return Ok(None);
        }
        let radiance = self.color(factor, self.material.emissive_texture.as_ref(), ".emission")?;
        Ok(Some(radiance))
    }

    /// An unlit material: it emits its base colour and reflects nothing.
    fn unlit(&mut self) -> Result<(Option<String>, Written), Flaw> {
        self.note_what_does_not_count();
        let color = self.base()?.color;
        let opacity = self.opacity()?;
        let opacity = opacity.map_or(String::new(), |opacity| format!("opacity = {opacity}\n"));
        let text = format!(
            "[materials.{}]\ntype = \"diffuse\"\nreflectance = 0.0\n{opacity}",
            self.id
        );
        let written = Written {
            text,
            is_glass: false,
            has_medium: false,
        };
        Ok((Some(color), written))
    }

    /// The fields for the reflectance at normal incidence, from `ior` and KHR_materials_specular. The factor can be a
    /// texture if the result is within the range of `specular`.
    fn reflectance(&mut self, ior: f64) -> Result<String, Flaw> {
        let plain = |ior: f64| match ior == 1.5 {
            true => String::new(),
            false => format!("ior = {}\n", number(ior)),
        };
        let Some(specular) = &self.material.extensions.specular else {
            return Ok(plain(ior));
        };
        let color = specular.specular_color_factor.map(|c| c.max(0.0));
        // Split the colour into its hue and its brightness.
        let brightest = color.iter().copied().fold(0.0, f64::max);
        let hue = match brightest > 0.0 {
            true => color.map(|c| c / brightest),
            false => [1.0; 3],
        };
        let used = specular.specular_color_texture.as_ref();
        let color = match used.is_none() && hue == [1.0; 3] {
            true => String::new(),
            false => format!("specular_color = {}\n", self.color(hue, used, ".specular_color")?),
        };
        let amplitude = (ior - 1.0) / (ior + 1.0);
        let most = amplitude * amplitude * brightest;
        let factor = specular.specular_factor;
        let used = specular.specular_texture.as_ref();
        // The reflectance is `specular` times `SPECULAR`.
        let factor = match used.is_some() && most * factor <= SPECULAR {
            true => {
                let amount = self.alpha(factor * most / SPECULAR, used, "specular")?;
                if amount.is_texture {
                    return Ok(format!("specular = {}\n{color}", amount.text));
                }
                amount.mean * SPECULAR / most.max(f64::MIN_POSITIVE)
            }
            false => {
                if used.is_some() {
                    self.note("textures of KHR_materials_specular count by their mean: materials");
                }
                match used {
                    None => factor,
                    Some(used) => factor * self.textures.mean(used, Encoding::Alpha)?[0],
                }
            }
        };
        let field = match factor == 1.0 && brightest == 1.0 {
            true => plain(ior),
            false => {
                let root = (most * factor).clamp(0.0, MOST_REFLECTANCE).sqrt();
                plain((1.0 + root) / (1.0 - root))
            }
        };
        Ok(format!("{field}{color}"))
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
            && let Some(map) = self.normal_map(used, "normal")?
        {
            let _ = writeln!(common, "normal_map = {map}");
        }
        let ior = match x.ior.as_ref().map(|x| x.ior) {
            // An index of 0 means total reflection; conversions from other models use it.
            Some(0.0) => LARGEST_IOR,
            ior => ior.unwrap_or(1.5),
        };
        let transmission = match &x.transmission {
            None => Amount::number(0.0),
            Some(t) => self.amount(
                t.transmission_factor,
                t.transmission_texture.as_ref(),
                0,
                "transmission",
            )?,
        };
        let stretch = self.stretch()?;
        let id = self.id;
        let share = transmission.mean * (1.0 - metallic.mean);
        let mut text = String::new();
        let mut glass = None;
        if share > 0.0 {
            if stretch.as_ref().is_some_and(|stretch| stretch.strength.is_texture) {
                self.note("textures of the anisotropy of glass count by their mean: materials");
            }
            if roughness.is_texture {
                self.note("textures of the roughness of glass count by their mean: materials");
            }
            let base = Base {
                color: base_color.clone(),
                metallic: Amount::number(metallic.mean),
                roughness: Amount::number(roughness.mean),
            };
            // The material is nothing but glass.
            let is_all = share == 1.0;
            let (name, common) = match is_all {
                true => (id.to_owned(), &common[..]),
                false => (format!("{id}.glass"), ""),
            };
            let made = self.glass(&name, (&base, stretch.as_ref()), ior, common, scale, opacity.is_some())?;
            text.push_str(&made.text);
            if is_all {
                return Ok(Written { text, ..made });
            }
            let weight = match transmission.is_texture && metallic.mean == 0.0 {
                true => transmission.text,
                false => {
                    if transmission.is_texture {
                        self.note("textures of transmission count by their mean where there is metal: materials");
                    }
                    number(share)
                }
            };
            let _ = write!(
                text,
                "[materials.{id}]\ntype = \"blend\"\nmaterials = [\"{id}.base\", \"{id}.glass\"]\n\
                 weight = {weight}\n{common}"
            );
            glass = Some(made);
        }
        let reflectance = self.reflectance(ior)?;
        let lobes = self.lobes()? + &stretch.as_ref().map_or(String::new(), Stretch::fields);
        let (name, own) = match &glass {
            Some(_) => (format!("{id}.base"), ""),
            None => (id.to_owned(), &common[..]),
        };
        let through = self.through(&name, own, &metallic)?;
        let (name, own) = match &through {
            Some(through) => (&through.front, ""),
            None => (&name, own),
        };
        text.push_str(through.as_ref().map_or("", |through| &through.text));
        let _ = write!(
            text,
            "[materials.\"{name}\"]\ntype = \"principled\"\nbase_color = {base_color}\nmetallic = {}\nroughness = {}\n\
             two_sided = {}\n{own}",
            metallic.text, roughness.text, material.double_sided
        );
        text.push_str(&reflectance);
        text.push_str(&lobes);
        Ok(Written {
            text,
            is_glass: glass.as_ref().is_some_and(|glass| glass.is_glass),
            has_medium: glass.is_some_and(|glass| glass.has_medium),
        })
    }

    /// Glass and the medium inside.
    fn glass(
        &mut self,
        name: &str,
        (base, stretch): (&Base, Option<&Stretch>),
        ior: f64,
        common: &str,
        scale: f64,
        is_cut: bool,
    ) -> Result<Written, Flaw> {
        let x = &self.material.extensions;
        if x.specular.is_some() {
            self.note("KHR_materials_specular of glass does not count: materials");
        }
        if x.clearcoat.as_ref().is_some_and(|coat| coat.clearcoat_factor > 0.0) {
            self.note("KHR_materials_clearcoat of glass does not count: materials");
        }
        let volume = x.volume.clone().unwrap_or_default();
        let is_solid = volume.thickness_factor > 0.0;
        let alpha = base.roughness.mean * base.roughness.mean;
        let is_rough = alpha >= LEAST_ALPHA;
        if is_rough && !is_solid {
            self.note("panes (transmission without thickness) are smooth: materials");
        }
        let filmed = self.filmed_glass(base, stretch)?;
        let kind = match (is_solid, is_rough) {
            (false, _) => "\"thin_dielectric\"".to_owned(),
            (true, false) => "\"dielectric\"".to_owned(),
            (true, true) => {
                let roughness = match stretch {
                    None => format!("alpha = {}", number(alpha)),
                    Some(stretch) => stretch.of_glass(alpha).trim_end().to_owned(),
                };
                format!("\"rough_dielectric\"\n{roughness}")
            }
        };
        let dispersion = x.dispersion.as_ref().map_or(0.0, |x| x.dispersion);
        let ior = match is_solid && dispersion > 0.0 && ior > 1.0 {
            true => format!(
                "{{ nd = {}, abbe = {} }}",
                number(ior),
                number((20.0 / dispersion).max(LEAST_ABBE))
            ),
            false => number(ior),
        };
        let kind = filmed.unwrap_or_else(|| format!("{kind}\nspecular_transmittance = {}\n", base.color));
        let mut text = format!("[materials.\"{name}\"]\nior = {ior}\ntype = {kind}{common}");
        let medium = attenuation(&volume, scale).filter(|_| is_solid && !is_cut);
        let has_medium = medium.is_some();
        if let Some(sigma_a) = medium {
            let _ = writeln!(
                text,
                "[media.{}]\ntype = \"homogeneous\"\nsigma_a = {}\nsigma_s = 0.0",
                self.id,
                numbers(&sigma_a)
            );
        }
        Ok(Written {
            text,
            is_glass: is_solid && !is_cut,
            has_medium,
        })
    }

    /// Note what is ignored or interpreted differently.
    fn note_what_does_not_count(&mut self) {
        let material = self.material;
        let x = &material.extensions;
        if material.occlusion_texture.is_some() {
            self.note("textures of occlusion do not count, since shadows are found by light: materials");
        }
        if x.unlit.is_some() {
            self.note(
                "KHR_materials_unlit: they show their colour to the camera and in mirrors, light nothing and cast no \
                 shadow: materials",
            );
        }
        for name in x.others.keys() {
            self.note(format!("{name} is not supported and does not count: materials"));
        }
    }
}

/// Sigma_a of the inside, per world unit. `scale`: world units per unit of the file.
fn attenuation(volume: &Volume, scale: f64) -> Option<[f64; 3]> {
    let distance = volume.attenuation_distance.filter(|d| *d > 0.0)? * scale;
    let sigma = |c: f64| -libm::log(c.clamp(LEAST_ATTENUATION, 1.0)) / distance;
    let sigma = volume.attenuation_color.map(sigma);
    sigma.iter().any(|s| *s > 0.0).then(|| sigma.map(f64::abs))
}

/// Microfacet roughness below which a surface is smooth.
const LEAST_ALPHA: f64 = 0.001;
/// The smallest attenuation colour of a channel.
const LEAST_ATTENUATION: f64 = 1e-6;
/// The largest reflectance at normal incidence, that of the largest index of refraction.
const MOST_REFLECTANCE: f64 = 0.96;
/// The reflectance at `specular` = 1.
const SPECULAR: f64 = 0.08;
/// The Abbe number of the strongest dispersion.
const LEAST_ABBE: f64 = 1.0;
/// The largest index of refraction.
const LARGEST_IOR: f64 = 99.0;
