//! Lamps that coincide with other surfaces: two in one plane, or one in the plane of a ceiling.
//!
//! Of two coincident surfaces a ray meets only one, since it restarts a little off the surface that it leaves. With
//! lamps that rays pass through it would miss the other's light: half the light of two lamps, all of one behind a
//! ceiling. So such lamps are moved apart, by an invisible amount.

use super::SceneDescription;
use super::crossing::places_on;
use crate::math::{Ray, Vec3};
use crate::world::bsdf::BsdfFlags;
use crate::world::geometry::{Geometry, Mesh, Object, Placement, Shape, clearance};
use glam::Affine3A;
use std::sync::Arc;

/// One in this many places on a lamp is tested for other surfaces.
const EVERY: usize = 4;
/// Most surfaces at one place that are distinguished.
const MOST: usize = 8;
/// Distance that lamps are moved, in clearances of the scene; surfaces within half of it coincide.
const CLEARANCES: f32 = 8.0;

/// The same scene with coincident lamps moved towards the side that they emit to; `None` if there are none.
pub(super) fn moved_apart(description: &SceneDescription, geometry: &Geometry) -> Option<SceneDescription> {
    let mut moved: Option<SceneDescription> = None;
    let scale = clearance(description.bounds.center.abs().max_element() + description.bounds.radius);
    for (number, object) in (0..).zip(&description.objects) {
        let steps = match is_lamp(description, object) {
            true => steps_off(description, geometry, number, CLEARANCES * scale),
            false => 0,
        };
        if steps > 0
            && let Some(shape) = inflated(&object.shape, steps as f32 * CLEARANCES * scale)
        {
            moved.get_or_insert_with(|| description.clone()).objects[number as usize].shape = shape;
        }
    }
    moved
}

fn is_lamp(description: &SceneDescription, object: &Object) -> bool {
    object.light.is_some() && description.materials[object.material as usize].has(BsdfFlags::NULL)
}

/// Number of steps to move a lamp: one for each earlier lamp in the same place, and one for all other surfaces.
fn steps_off(description: &SceneDescription, geometry: &Geometry, lamp: u32, reach: f32) -> u32 {
    let mut met = [lamp; MOST];
    let mut count = 1;
    for on in places_on(&description.objects[lamp as usize]).step_by(EVERY) {
        let across = Ray {
            origin: on.point - on.normal * (0.5 * reach),
            dir: on.normal,
        };
        while count < MOST {
            let is_passed = |other: u32| met[..count].contains(&other);
            let Some(hit) = geometry.intersect(&description.objects, &across, reach, &is_passed) else {
                break;
            };
            // A surface that only cuts through the lamp takes none of its light.
            if hit.ng.dot(on.normal).abs() < PARALLEL {
                break;
            }
            met[count] = hit.object;
            count += 1;
        }
    }
    let others = || met[1..count].iter();
    let is_other_lamp = |other: u32| is_lamp(description, &description.objects[other as usize]);
    let before = others()
        .filter(|other| is_other_lamp(**other) && **other < lamp)
        .count();
    let is_in_more = others().any(|other| !is_other_lamp(*other));
    before as u32 + u32::from(is_in_more)
}

/// Cosine of the angle between surfaces above which they count as parallel.
const PARALLEL: f32 = 0.999;

/// A shape moved along its normals; `None` if it is neither flat nor a ball.
fn inflated(shape: &Shape, by: f32) -> Option<Shape> {
    match shape {
        Shape::Mesh { mesh, placement } if mesh.is_flat() => {
            let offset = mesh.normal(0) * by;
            let mesh = Mesh {
                positions: mesh.positions.iter().map(|position| *position + offset).collect(),
                normals: mesh.normals.clone(),
                uvs: mesh.uvs.clone(),
                colors: mesh.colors.clone(),
                given_tangents: mesh.given_tangents.clone(),
                triangles: mesh.triangles.clone(),
                ..Mesh::default()
            };
            let (mesh, placement) = (Arc::new(mesh), *placement);
            Some(Shape::Mesh { mesh, placement })
        }
        Shape::Disc { placement, flip } => {
            let normal = placement.normal(Vec3::Z).normalize();
            let offset = if *flip { -normal } else { normal } * by;
            let shift = Affine3A::from_translation(offset);
            let (placement, flip) = (placed(shift * placement.render_from_object), *flip);
            Some(Shape::Disc { placement, flip })
        }
        Shape::Sphere { placement, flip } => {
            let radius = placement.uniform_scale()?;
            let factor = if *flip { radius - by } else { radius + by } / radius;
            let map = placement.render_from_object * Affine3A::from_scale(Vec3::splat(factor));
            let (placement, flip) = (placed(map), *flip);
            Some(Shape::Sphere { placement, flip })
        }
        Shape::Mesh { .. } | Shape::Cylinder { .. } | Shape::Strands { .. } => None,
    }
}

fn placed(render_from_object: Affine3A) -> Placement {
    Placement {
        render_from_object,
        object_from_render: render_from_object.inverse(),
    }
}
