//! Which materials are on objects, and the parts of their blends.

use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{Material, MaterialKind};
use beamfarm_render::world::geometry::Object;

/// By material: the first object that uses it.
pub(super) fn users(description: &SceneDescription) -> Vec<Option<&Object>> {
    let mut users = vec![None; description.materials.len()];
    for object in &description.objects {
        users[object.material as usize].get_or_insert(object);
    }
    users
}

/// Materials that objects use.
pub(super) fn used(description: &SceneDescription) -> impl Iterator<Item = &Material> {
    let used = description.materials.iter().zip(users(description));
    used.filter_map(|(material, user)| user.map(|_| material))
}

/// A material and all parts of its blends, each with its nesting depth.
pub(super) fn with_parts<'a>(material: &'a Material, depth: u32, each: &mut dyn FnMut(&'a Material, u32)) {
    each(material, depth);
    if let MaterialKind::Blend { parts, .. } = &material.kind {
        for part in &**parts {
            with_parts(part, depth + 1, each);
        }
    }
}
