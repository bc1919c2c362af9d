//! Materials made of other materials.

use super::material::{material, opacity};
use super::relief::turned_by;
use super::texture;
use super::{Assets, Problem, required, unknown_name};
use crate::parse::{Fault, MaterialRecord, MaterialType};
use crate::values::Spanned;
use beamfarm_render::world::bsdf::{Material, MaterialDescription, MaterialKind, NormalPerturbation};
use std::collections::BTreeMap;

/// How deeply blends may nest.
const MAX_DEPTH: usize = 8;

/// Builds materials from their records, the parts of a blend before the blend.
pub struct Making<'r> {
    records: &'r BTreeMap<Spanned<String>, MaterialRecord>,
    made: BTreeMap<&'r str, Material>,
}

impl<'r> Making<'r> {
    pub fn new(records: &'r BTreeMap<Spanned<String>, MaterialRecord>) -> Self {
        Self {
            records,
            made: BTreeMap::new(),
        }
    }

    /// The material of that name. `within`: the blends that it is part of.
    pub fn material(
        &mut self,
        name: &Spanned<String>,
        within: &mut Vec<&'r str>,
        assets: &mut Assets<'_>,
    ) -> Result<Material, Problem> {
        if let Some(made) = self.made.get(name.get_ref().as_str()) {
            return Ok(made.clone());
        }
        let Some((key, record)) = self.records.get_key_value(name) else {
            let known = self.records.keys().map(|name| name.get_ref().as_str());
            return Err(unknown_name("material", name, known).into());
        };
        let key = key.get_ref().as_str();
        let material = match record.kind.get_ref() {
            MaterialType::Blend => {
                if within.contains(&key) {
                    let message = format!("the blend \"{key}\" is made of itself");
                    return Err(Fault::new(name.span(), message).into());
                }
                if within.len() == MAX_DEPTH {
                    let message = format!("expected no more than {MAX_DEPTH} blends within each other");
                    return Err(Fault::new(name.span(), message).into());
                }
                within.push(key);
                let material = self.blend(record, within, assets)?;
                within.pop();
                material
            }
            _ => material(record, assets)?,
        };
        self.made.insert(key, material.clone());
        Ok(material)
    }

    fn blend(
        &mut self,
        record: &'r MaterialRecord,
        within: &mut Vec<&'r str>,
        assets: &mut Assets<'_>,
    ) -> Result<Material, Problem> {
        let [first, second] = required(&record.materials, &record.kind, "materials")?.get_ref();
        let weight = required(&record.weight, &record.kind, "weight")?.get_ref();
        let mut parts = Box::new([
            self.material(first, within, assets)?,
            self.material(second, within, assets)?,
        ]);
        let of = |part: &Material| {
            part.subsurface()
                .map(|beneath| (beneath.reflectance, beneath.radius, beneath.g))
        };
        if let [Some(one), Some(other)] = [&parts[0], &parts[1]].map(of)
            && one != other
        {
            let message = "the parts of a blend have one medium beneath them: expected the same `base_color` on average, \
                           `subsurface_radius` and `subsurface_anisotropy` of both";
            return Err(Fault::new(second.span(), message).into());
        }
        if let Some(map) = turned_by(&record.normal_map, &record.bump, assets)? {
            for (part, name) in parts.iter_mut().zip([first, second]) {
                if !perturb(part, &map) {
                    let message = format!(
                        "\"{}\" has a bump or normal map of its own; expected one on the blend or on its parts",
                        name.get_ref()
                    );
                    return Err(Fault::new(name.span(), message).into());
                }
            }
        }
        let weight = texture::texture(weight, assets)?;
        Ok(Material::from(MaterialDescription {
            opacity: opacity(record, assets)?,
            ..MaterialDescription::new(MaterialKind::Blend { parts, weight }, true)
        }))
    }
}

/// Give a material, or all parts of a blend, a bump or normal map. False: it already has one.
fn perturb(material: &mut Material, map: &NormalPerturbation) -> bool {
    let mut description = MaterialDescription::from(material.clone());
    let is_first = match &mut description.kind {
        MaterialKind::Blend { parts, .. } => parts.iter_mut().all(|part| perturb(part, map)),
        MaterialKind::Null => true,
        _ => description.normal_perturbation.replace(map.clone()).is_none(),
    };
    *material = description.into();
    is_first
}
