//! Materials and their names.

use super::blend::Making;
use super::{Assets, Problem, unknown_name};
use crate::parse::{Fault, MaterialRecord};
use crate::values::Spanned;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::{Material, MaterialKind};
use beamfarm_render::world::texture::Texture;
use std::collections::BTreeMap;

/// The scene's materials in name order, then those for shapes that name none.
pub struct Materials {
    pub list: Vec<Material>,
    names: BTreeMap<String, u32>,
    /// The names of materials that have one.
    pub labels: BTreeMap<u32, String>,
    grey: Option<u32>,
    black: Option<u32>,
    /// Materials without their subsurface, by the originals.
    diffuse: BTreeMap<u32, u32>,
    /// By material: its version for thin things.
    thin: BTreeMap<u32, u32>,
}

impl Materials {
    pub fn new(records: &BTreeMap<Spanned<String>, MaterialRecord>, assets: &mut Assets<'_>) -> Result<Self, Problem> {
        let mut materials = Self {
            list: Vec::new(),
            names: BTreeMap::new(),
            labels: BTreeMap::new(),
            grey: None,
            black: None,
            diffuse: BTreeMap::new(),
            thin: BTreeMap::new(),
        };
        materials.enter(records, assets)?;
        Ok(materials)
    }

    /// Add materials whose names replace all others until [`Self::leave`].
    pub fn enter(
        &mut self,
        records: &BTreeMap<Spanned<String>, MaterialRecord>,
        assets: &mut Assets<'_>,
    ) -> Result<BTreeMap<String, u32>, Problem> {
        let mut names = BTreeMap::new();
        let mut making = Making::new(records);
        for name in records.keys() {
            let material = making.material(name, &mut Vec::new(), assets)?;
            names.insert(name.get_ref().clone(), self.list.len() as u32);
            self.labels.insert(self.list.len() as u32, name.get_ref().clone());
            self.list.push(material);
        }
        Ok(std::mem::replace(&mut self.names, names))
    }

    /// Restore the names that [`Self::enter`] returned.
    pub fn leave(&mut self, names: BTreeMap<String, u32>) -> BTreeMap<String, u32> {
        std::mem::replace(&mut self.names, names)
    }

    /// The material of that name.
    pub fn resolve(&self, name: &Spanned<String>) -> Result<u32, Fault> {
        match self.names.get(name.get_ref()) {
            Some(index) => Ok(*index),
            None => Err(unknown_name("material", name, self.names.keys().map(String::as_str))),
        }
    }

    /// The same material without its subsurface.
    pub fn without_subsurface(&mut self, material: u32) -> u32 {
        if let Some(known) = self.diffuse.get(&material) {
            return *known;
        }
        let index = self.list.len() as u32;
        self.list.push(self.list[material as usize].without_subsurface());
        if let Some(label) = self.labels.get(&material) {
            self.labels.insert(index, label.clone());
        }
        self.diffuse.insert(material, index);
        index
    }

    /// A material as it is on curves and points, which are thinner than any kernel.
    pub fn thin(&mut self, material: u32) -> u32 {
        *self.thin.entry(material).or_insert_with(|| {
            let thin = self.list.len() as u32;
            self.list.push(self.list[material as usize].thinned());
            if let Some(label) = self.labels.get(&material).cloned() {
                self.labels.insert(thin, label);
            }
            thin
        })
    }

    /// The material of shapes that name none: black for those that emit, else grey.
    pub fn default(&mut self, emits: bool) -> u32 {
        let (slot, reflectance) = match emits {
            true => (&mut self.black, 0.0),
            false => (&mut self.grey, 0.5),
        };
        *slot.get_or_insert_with(|| {
            let reflectance = Texture::Constant(Rgb::splat(reflectance));
            let kind = MaterialKind::Diffuse { reflectance };
            self.list.push(Material::new(kind, false));
            (self.list.len() - 1) as u32
        })
    }
}
