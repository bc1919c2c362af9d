//! The things of a scene that can be selected, and where they are.

use super::moves::keyed;
use crate::parse::{LightRecord, LightType, SceneRecord, ShapeRecord, ShapeType};
use crate::values::{Spanned, Vector};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::{Mesh, Object, Shape, bounds};
use glam::{DVec3, Vec3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The most things listed; beyond that the largest are.
const MOST: usize = 500;

/// A light, a shape or an instance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Thing {
    /// The id for [`super::translate`] and [`super::turn`].
    pub id: String,
    /// Its name in the scene.
    pub name: String,
    /// `point`, `spot`, `projector`, `laser`, `directional`, `environment`, a type of shape, or `instance`.
    pub kind: &'static str,
    /// Its centre, world space; `None` for what has no place.
    pub at: Option<[f64; 3]>,
    /// The point that a spot shines at.
    pub target: Option<[f64; 3]>,
    /// Whether it can be moved.
    pub moves: bool,
    /// Whether it can be turned.
    pub turns: bool,
    /// Whether it is a light or an emitting shape.
    pub emits: bool,
    /// Half the diagonal of its box; 0 for lights that are not shapes.
    pub radius: f64,
}

/// The ids of the scene's objects, in order. Objects of glTF files come after these and have none.
pub fn object_ids(text: &str) -> Vec<String> {
    match SceneRecord::parse(text) {
        Ok(record) => objects(&record).map(|(_, id)| id).collect(),
        Err(_) => Vec::new(),
    }
}

/// Each object's shape and id.
fn objects(record: &SceneRecord) -> impl Iterator<Item = (&ShapeRecord, String)> {
    record.shapes.iter().enumerate().flat_map(|(i, shape)| {
        let copies = match shape.kind.get_ref() {
            ShapeType::Instances => shape
                .transforms
                .as_ref()
                .map(|all| all.get_ref().len())
                .unwrap_or_default(),
            _ => 1,
        };
        let is_one = *shape.kind.get_ref() != ShapeType::Instances;
        (0..copies).map(move |copy| match is_one {
            true => (shape, format!("shapes.{i}")),
            false => (shape, format!("shapes.{i}.{copy}")),
        })
    })
}

/// The name of an object's material; `None` for the default material and for objects of glTF files.
pub fn material_of(text: &str, object: usize) -> Option<String> {
    let record = SceneRecord::parse(text).ok()?;
    let (shape, _) = objects(&record).nth(object)?;
    inner_of(shape).material.as_ref().map(|name| name.get_ref().clone())
}

/// The shape that instances repeat, or the shape itself.
fn inner_of(shape: &ShapeRecord) -> &ShapeRecord {
    shape.shape.as_ref().map_or(shape, |inner| inner.get_ref())
}

/// What can be selected: lights, then shapes and instances. `text` is the source of `description`; `camera` is the
/// camera's position, world space.
pub fn things(text: &str, description: &SceneDescription, camera: [f64; 3]) -> Vec<Thing> {
    let Ok(record) = SceneRecord::parse(text) else {
        return Vec::new();
    };
    let lights = record.lights.iter().enumerate().map(|(i, light)| of_light(i, light));
    let mut found: Vec<Thing> = lights.collect();
    let mut boxes = Boxes::default();
    let shapes = objects(&record).zip(&description.objects).map(|((shape, id), object)| {
        let [low, high] = boxes.of(object);
        Thing {
            id,
            name: object.name.clone(),
            kind: match shape.kind.get_ref() {
                ShapeType::Instances => "instance",
                kind => kind.takes().0,
            },
            at: Some((0.5 * (low + high) + DVec3::from(camera)).to_array()),
            target: None,
            moves: true,
            turns: true,
            emits: shape.emission.is_some() || inner_of(shape).emission.is_some(),
            radius: 0.5 * (high - low).length(),
        }
    });
    let mut shapes: Vec<Thing> = shapes.collect();
    let room = MOST.saturating_sub(found.len());
    if shapes.len() > room {
        shapes.sort_by(|a, b| b.radius.total_cmp(&a.radius));
        shapes.truncate(room);
    }
    found.extend(shapes);
    found.truncate(MOST);
    if record.animation.is_some() {
        let keyed = keyed(text, found.iter().map(|thing| &*thing.id));
        for thing in found.iter_mut().filter(|thing| keyed.contains(&thing.id)) {
            (thing.moves, thing.turns) = (false, false);
        }
    }
    found
}

fn of_light(i: usize, light: &LightRecord) -> Thing {
    let kind = *light.kind.get_ref();
    let point = |given: &Option<Spanned<Vector>>| given.as_ref().map(|point| point.get_ref().0.to_array());
    let stands = matches!(
        kind,
        LightType::Point | LightType::Spot | LightType::Projector | LightType::Laser
    );
    Thing {
        id: format!("lights.{i}"),
        name: light.name.clone().unwrap_or_else(|| format!("lights[{i}]")),
        kind: kind.takes().0,
        at: point(&light.position),
        target: point(&light.target),
        moves: stands,
        turns: kind != LightType::Point || light.target.is_some() || light.direction.is_some(),
        emits: true,
        radius: 0.0,
    }
}

/// Boxes of objects, render space. An instance's box bounds the transformed box of its shape.
#[derive(Default)]
struct Boxes {
    of_meshes: BTreeMap<*const Mesh, [Vec3; 2]>,
}

impl Boxes {
    fn of(&mut self, object: &Object) -> [DVec3; 2] {
        let (low, high) = match &object.shape {
            Shape::Mesh { mesh, placement } if Arc::strong_count(mesh) > 1 => {
                let own = self.of_meshes.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                    let none = [Vec3::INFINITY, Vec3::NEG_INFINITY];
                    mesh.positions
                        .iter()
                        .fold(none, |[low, high], p| [low.min(*p), high.max(*p)])
                });
                let corner = |i: usize| Vec3::from_array(std::array::from_fn(|axis| own[i >> axis & 1][axis]));
                let corners = (0..8).map(|i| placement.render_from_object.transform_point3(corner(i)));
                corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                    (low.min(p), high.max(p))
                })
            }
            shape => bounds(shape),
        };
        [low.as_dvec3(), high.as_dvec3()]
    }
}
