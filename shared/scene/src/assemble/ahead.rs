//! Decodes a scene's files in parallel before the scene asks for them one by one. Errors are dropped here: they are
//! reported, in the scene's order, when the file is asked for.

use super::shape::emits_colors;
use super::{Assets, Kept, Parts, key_of_image, key_of_mesh, read_image, read_mesh};
use crate::assets::image::Encoding;
use crate::parse::{MaterialRecord, SceneRecord, ShapeRecord, ShapeType};
use beamfarm_image::bundle;
use beamfarm_render::world::bsdf::BsdfFlags;
use rayon::prelude::*;
use std::collections::BTreeMap;

impl Assets<'_> {
    /// Decode the scene's images.
    pub fn images_ahead(&mut self, record: &SceneRecord) {
        let of_materials = record.materials.values().flat_map(MaterialRecord::images);
        let emissions = record.shapes.iter().filter_map(|s| s.emission.as_ref());
        let glowing = emissions.filter_map(|emission| Some(emission.get_ref().radiance.as_ref()?.images()));
        let named = record.textures.values().map(|texture| texture.get_ref().images());
        let around = (record.lights.iter().flat_map(|light| &light.texture)).map(|texture| texture.get_ref().images());
        let glowing = glowing.chain(named).chain(around).flatten();
        let of_lights = record.lights.iter().filter_map(|light| {
            let is_raw = light.raw.as_ref().is_some_and(|raw| *raw.get_ref());
            Some((light.image.as_ref()?, is_raw))
        });
        let all = of_materials
            .chain(glowing.map(|image| (&image.file, image.raw)))
            .chain(of_lights);
        let source = self.source;
        let Kept { images, clock, .. } = &mut *self.kept;
        let wanted = all.map(|(path, is_raw)| {
            let encoding = match is_raw {
                true => Encoding::Raw,
                false => Encoding::Srgb,
            };
            (key_of_image(source, path, encoding), path)
        });
        let wanted: BTreeMap<_, _> = wanted.filter(|(key, _)| !images.has(key)).collect();
        let read: Vec<_> = wanted
            .into_par_iter()
            .filter_map(|(key, path)| Some((read_image(source, path, key.1).ok()?, key)))
            .collect();
        read.into_iter().for_each(|(image, key)| images.put(clock, key, image));
    }
}

impl Parts<'_> {
    /// Decode the meshes of shapes.
    pub fn meshes_ahead(&mut self, shapes: &[ShapeRecord]) {
        let source = self.assets.source;
        let mut wanted = BTreeMap::new();
        for shape in shapes {
            let shape = shape.shape.as_ref().map_or(shape, |inner| inner.get_ref());
            if *shape.kind.get_ref() != ShapeType::Mesh {
                continue;
            }
            let material = shape
                .material
                .as_ref()
                .and_then(|name| self.materials.resolve(name).ok());
            let is_read =
                material.is_some_and(|material| self.materials.list[material as usize].has(BsdfFlags::READS_COLORS));
            let index = shape.shape_index.as_ref().map_or(0, |index| *index.get_ref());
            let toward = shape.toward.as_ref().map(|toward| (&toward.get_ref().file, false));
            let takes_colors = is_read || emits_colors(shape, &mut self.assets);
            let own = shape.file.as_ref().map(|file| (file, takes_colors));
            for (path, colored) in own.into_iter().chain(toward) {
                let is_of_other = self.assets.meshes.contains_key(&bundle::key(path.get_ref()));
                let key = key_of_mesh(source, path, index, colored);
                if !is_of_other && !self.assets.kept.meshes.has(&key) {
                    wanted.insert(key, (path, index, colored));
                }
            }
        }
        let read: Vec<_> = wanted
            .into_par_iter()
            .filter_map(|(key, (path, index, colored))| Some((key, read_mesh(source, path, index, colored).ok()?)))
            .collect();
        let Kept { meshes, clock, .. } = &mut *self.assets.kept;
        read.into_iter().for_each(|(key, mesh)| meshes.put(clock, key, mesh));
    }
}
