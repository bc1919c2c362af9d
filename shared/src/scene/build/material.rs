//! Materials and their names.

use super::texture::texture;
use super::{Assets, Problem, required, unknown_name};
use crate::bsdf::{Material, MaterialKind, conductor_names, conductor_preset};
use crate::math::Rgb;
use crate::scene::parse::{Fault, MaterialRecord, MaterialType};
use crate::texture::Texture;
use std::collections::BTreeMap;
use toml::Spanned;

/// The scene's materials in the order of their names, then those for shapes that name none.
pub struct Materials {
    pub list: Vec<Material>,
    names: Vec<String>,
    grey: Option<u32>,
    black: Option<u32>,
}

impl Materials {
    pub fn new(
        records: &BTreeMap<Spanned<String>, MaterialRecord>,
        assets: &mut Assets<'_>,
    ) -> Result<Self, Problem> {
        let mut materials = Self {
            list: Vec::new(),
            names: Vec::new(),
            grey: None,
            black: None,
        };
        for (name, record) in records {
            materials.list.push(material(record, assets)?);
            materials.names.push(name.get_ref().clone());
        }
        Ok(materials)
    }

    /// The material of a name.
    pub fn resolve(&self, name: &Spanned<String>) -> Result<u32, Fault> {
        match self.names.binary_search(name.get_ref()) {
            Ok(index) => Ok(index as u32),
            Err(_) => Err(unknown_name(
                "material",
                name,
                self.names.iter().map(String::as_str),
            )),
        }
    }

    /// The material of shapes that name none: black for those that emit, else grey.
    pub fn default(&mut self, emits: bool) -> u32 {
        let (slot, reflectance) = match emits {
            true => (&mut self.black, 0.0),
            false => (&mut self.grey, 0.5),
        };
        *slot.get_or_insert_with(|| {
            self.list.push(Material {
                kind: MaterialKind::Diffuse {
                    reflectance: Texture::Constant(Rgb::splat(reflectance)),
                },
                two_sided: false,
            });
            (self.list.len() - 1) as u32
        })
    }
}

fn material(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Material, Problem> {
    let mut reflectance = |default: f32| match &record.reflectance {
        None => Ok(Texture::Constant(Rgb::splat(default))),
        Some(given) => texture(given.get_ref(), assets),
    };
    let two_sided = |default| record.two_sided.as_ref().map_or(default, |b| *b.get_ref());
    let (kind, two_sided) = match record.kind.get_ref() {
        MaterialType::Diffuse => (
            MaterialKind::Diffuse {
                reflectance: reflectance(0.5)?,
            },
            two_sided(false),
        ),
        MaterialType::Mirror => (
            MaterialKind::Mirror {
                reflectance: reflectance(1.0)?,
            },
            two_sided(true),
        ),
        MaterialType::Dielectric => (
            MaterialKind::Dielectric {
                eta: relative_ior(record)?,
            },
            true,
        ),
        MaterialType::RoughDielectric => (
            MaterialKind::RoughDielectric {
                alpha: alpha(record)?,
                eta: relative_ior(record)?,
            },
            true,
        ),
        MaterialType::Conductor => {
            let (eta, k) = metal(record)?;
            let reflectance = reflectance(1.0)?;
            (
                MaterialKind::Conductor {
                    eta,
                    k,
                    reflectance,
                },
                two_sided(true),
            )
        }
        MaterialType::RoughConductor => {
            let (eta, k) = metal(record)?;
            let kind = MaterialKind::RoughConductor {
                alpha: alpha(record)?,
                eta,
                k,
                reflectance: reflectance(1.0)?,
            };
            (kind, two_sided(true))
        }
        MaterialType::Null => (MaterialKind::Null, true),
    };
    Ok(Material { kind, two_sided })
}

fn alpha(record: &MaterialRecord) -> Result<f32, Fault> {
    Ok(required(&record.alpha, &record.kind, "alpha")?
        .get_ref()
        .f32())
}

fn relative_ior(record: &MaterialRecord) -> Result<f32, Fault> {
    let ior = required(&record.ior, &record.kind, "ior")?;
    let exterior = record
        .exterior_ior
        .as_ref()
        .map_or(1.0, |ior| ior.get_ref().0);
    let eta = (ior.get_ref().0 / exterior) as f32;
    if !(1e-2..=1e2).contains(&eta) {
        return Err(Fault::new(
            ior.span(),
            format!("expected `ior` / `exterior_ior` from 0.01 to 100, found {eta}"),
        ));
    }
    Ok(eta)
}

fn metal(record: &MaterialRecord) -> Result<(Rgb, Rgb), Fault> {
    match (&record.preset, &record.eta, &record.k) {
        (Some(preset), None, None) => conductor_preset(preset.get_ref()).ok_or_else(|| {
            let known = conductor_names().collect::<Vec<_>>().join(", ");
            Fault::new(
                preset.span(),
                format!(
                    "there is no metal \"{}\"; expected one of {known}",
                    preset.get_ref()
                ),
            )
        }),
        (None, Some(eta), Some(k)) => {
            let (eta, k) = (eta.get_ref().rgb(), k.get_ref().rgb());
            if (eta + k).min_element() <= 0.0 {
                return Err(Fault::new(
                    record.kind.span(),
                    "eta and k are both 0 in one channel",
                ));
            }
            Ok((eta, k))
        }
        _ => Err(Fault::new(
            record.kind.span(),
            "a conductor is given by `preset`, or by `eta` and `k`: one of the two ways",
        )),
    }
}
