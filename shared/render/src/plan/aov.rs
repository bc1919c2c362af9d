//! The layers that were asked for: which lights belong to which, and what a camera path adds to them.

use crate::math::{Rgb, Vec2, Vec3};
use crate::world::Scene;
use crate::world::SceneDescription;
use crate::world::geometry::Object;
use crate::world::light::Light;
use beamfarm_image::layer::{Layer, MatteKind};
use beamfarm_image::matte::{NOTHING, id_of_name};
use std::num::NonZeroU16;

/// Layers, and which lights belong to which.
#[derive(Clone, Debug, Default)]
pub struct LayerPlan {
    /// In the job's order.
    pub layers: Vec<Layer>,
    /// The groups among them: numbers of their layers.
    groups: Vec<usize>,
    /// By light, when there are groups: the number of its group.
    group_of_light: Vec<Option<GroupNumber>>,
    /// Of each matte among the layers, by object: what its pixels hold.
    ids: Vec<Vec<u32>>,
}

/// Number of a group of lights among those that have a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupNumber(
    /// One more than the number: none is as small as any.
    NonZeroU16,
);

impl GroupNumber {
    /// None for the groups beyond the first 65,535, which nothing belongs to.
    pub fn new(number: usize) -> Option<Self> {
        let number = u16::try_from(number).ok()?;
        number.checked_add(1).and_then(NonZeroU16::new).map(Self)
    }

    /// Where it is in lists of groups.
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0.get() - 1)
    }
}

/// A layer was asked for of a group that no light belongs to.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no light or group of lights `{0}`")]
pub struct NoSuchGroup(String);

impl LayerPlan {
    pub(crate) fn new(scene: &Scene, layers: &[Layer]) -> Result<Self, NoSuchGroup> {
        for layer in layers {
            if let Layer::Light(group) = layer
                && !scene.lights().iter().any(|light| light.group == *group)
            {
                return Err(NoSuchGroup(group.as_str().to_owned()));
            }
        }
        Ok(Self::of(scene, layers))
    }

    /// The same where groups may have no lights, as while they are switched off.
    pub(crate) fn of(scene: &Scene, layers: &[Layer]) -> Self {
        let mut plan = Self {
            layers: layers.to_vec(),
            ..Self::default()
        };
        let is_group = |i: &usize| matches!(layers[*i], Layer::Light(_));
        plan.groups = (0..layers.len()).filter(is_group).collect();
        let (objects, description) = (scene.objects().iter(), scene.description());
        plan.ids = layers
            .iter()
            .filter_map(Layer::matte)
            .map(|kind| {
                let id = |object: &Object| match kind {
                    MatteKind::Objects => id_of_name(&object.name),
                    MatteKind::Materials => id_of_name(description.material_name(object.material)),
                };
                objects.clone().map(id).collect()
            })
            .collect();
        if plan.groups.is_empty() {
            return plan;
        }
        let number = |light: &Light| {
            let is_its = |i: &usize| matches!(&layers[*i], Layer::Light(group) if *group == light.group);
            let number = plan.groups.iter().position(is_its);
            number.and_then(GroupNumber::new)
        };
        plan.group_of_light = scene.lights().iter().map(number).collect();
        plan
    }

    /// The layers that are images of numbers.
    pub fn films(&self) -> &[Layer] {
        &self.layers[..self.layers.len() - self.ids.len()]
    }

    /// Number of mattes.
    pub fn mattes(&self) -> usize {
        self.ids.len()
    }

    /// What a matte holds where this object is met.
    pub fn id(&self, matte: usize, object: Option<u32>) -> u32 {
        object.map_or(NOTHING, |object| self.ids[matte][object as usize])
    }

    /// Number of the group that a light belongs to, if that has a layer.
    #[inline]
    pub fn group(&self, light: usize) -> Option<GroupNumber> {
        self.group_of_light.get(light).copied().flatten()
    }

    /// Whether the beams that contribute to each pixel are counted.
    pub fn counts_beams(&self) -> bool {
        self.layers.contains(&Layer::BeamDensity)
    }

    /// Whether the photon targets before each pixel's first surface are counted.
    pub fn counts_targets(&self) -> bool {
        self.layers.contains(&Layer::Targets)
    }

    /// Whether it is told how things move.
    pub fn has_motion(&self) -> bool {
        self.layers.contains(&Layer::Motion)
    }

    /// Number of groups of lights.
    pub fn groups(&self) -> usize {
        self.groups.len()
    }

    /// Their numbers.
    pub(crate) fn group_numbers(&self) -> impl Iterator<Item = GroupNumber> {
        (0..self.groups()).filter_map(GroupNumber::new)
    }

    /// The number of the group whose layer this one is.
    pub fn group_of_layer(&self, layer: usize) -> Option<usize> {
        self.groups.iter().position(|i| *i == layer)
    }
}

/// The layers of all groups of lights of a scene, in the order of their first lights.
pub fn light_layers(description: &SceneDescription) -> Vec<Layer> {
    let mut layers: Vec<Layer> = Vec::new();
    for light in &description.lights {
        let layer = Layer::Light(light.group.clone());
        if !layers.contains(&layer) {
            layers.push(layer);
        }
    }
    layers
}

/// One pixel's values of all layers in one pass.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Distance of the first surface along the camera's axis, its shading normal, and its albedo.
    pub first: Option<(f32, Vec3, Rgb)>,
    /// The object that it belongs to.
    pub object: Option<u32>,
    /// What of the light from all around gets through straight.
    pub let_through: f32,
    /// See [`Layer::Direct`].
    pub direct: Rgb,
    /// See [`Layer::Surface`].
    pub surface: Rgb,
    /// See [`Layer::Volume`].
    pub volume: Rgb,
    /// By group of lights.
    pub groups: Vec<Rgb>,
    /// Photon beams that contributed.
    pub beams: u32,
    /// Photon targets before the first surface, or on it.
    pub targets: u32,
    /// How the first surface moves in the image, pixels a frame, to the right and up.
    pub motion: Vec2,
}

impl Parts {
    /// Nothing yet, for so many groups.
    pub fn new(groups: usize) -> Self {
        Self {
            groups: vec![Rgb::ZERO; groups],
            ..Self::default()
        }
    }

    /// Add radiance to a part.
    #[inline]
    pub(crate) fn add(&mut self, part: Part, radiance: Rgb) {
        match part {
            Part::Direct => self.direct += radiance,
            Part::Surface => self.surface += radiance,
            Part::Volume => self.volume += radiance,
        }
    }

    /// The value of a layer; of a group's, with the group's number.
    pub fn value(&self, layer: &Layer, group: Option<usize>) -> [f32; 3] {
        let first = |value: fn(&(f32, Vec3, Rgb)) -> Vec3| self.first.as_ref().map_or(Vec3::ZERO, value);
        let value = match layer {
            Layer::Alpha => Vec3::new(1.0 - self.let_through, 0.0, 0.0),
            // Not of a path: of the mattes, and of the pass as a whole.
            Layer::Objects | Layer::Materials | Layer::Odd => Vec3::ZERO,
            Layer::Depth => first(|f| Vec3::new(f.0, 1.0, 0.0)),
            Layer::Normal => first(|f| f.1),
            Layer::Albedo => first(|f| f.2),
            Layer::Direct => self.direct,
            Layer::Surface => self.surface,
            Layer::Volume => self.volume,
            Layer::Light(_) => group.and_then(|g| self.groups.get(g)).copied().unwrap_or_default(),
            Layer::BeamDensity => Vec3::new(self.beams as f32, 0.0, 0.0),
            Layer::Motion => self.motion.extend(0.0),
            Layer::Targets => Vec3::new(self.targets as f32, 0.0, 0.0),
        };
        value.to_array()
    }
}

/// Which way light came to the surface or medium that sends it to the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Straight from a light.
    Direct,
    /// From another surface or a medium.
    Surface,
    /// Straight from a light to a medium, which turned it.
    Volume,
}

/// Notes what a path adds where; without layers, nothing.
pub struct Recorder<'a> {
    plan: &'a LayerPlan,
    parts: Option<&'a mut Parts>,
    /// The part that everything counts for, whatever way light came: where the camera path was scattered by a medium.
    within: Option<Part>,
    /// What all radiance is multiplied by, see [`crate::world::spectrum`].
    tint: Rgb,
}

impl<'a> Recorder<'a> {
    /// Into these parts, if there are any.
    pub fn new(plan: &'a LayerPlan, parts: Option<&'a mut Parts>) -> Self {
        Self {
            plan,
            parts,
            within: None,
            tint: Rgb::ONE,
        }
    }

    /// From here on everything is light that a medium scatters. Returns what [`Self::leave_volume`] wants.
    pub fn enter_volume(&mut self) -> Option<Part> {
        self.within.replace(Part::Volume)
    }

    /// The part that light counts for which came this way.
    pub fn part_or(&self, part: Part) -> Part {
        self.within.unwrap_or(part)
    }

    /// No more.
    pub fn leave_volume(&mut self, before: Option<Part>) {
        self.within = before;
    }

    /// Whether anything is noted.
    #[inline]
    pub fn is_on(&self) -> bool {
        self.parts.is_some()
    }

    /// From here on light has this weight.
    #[inline]
    pub(crate) fn set_tint(&mut self, tint: Rgb) {
        self.tint = tint;
    }

    /// Radiance at the film that comes from a light.
    #[inline]
    pub fn add(&mut self, part: Part, light: usize, radiance: Rgb) {
        if self.is_on() {
            self.add_of_group(part, self.plan.group(light), radiance);
        }
    }

    /// Radiance at the film that comes from a group of lights, as [`LayerPlan::group`] numbers them.
    #[inline]
    pub fn add_of_group(&mut self, part: Part, group: Option<GroupNumber>, radiance: Rgb) {
        let (part, radiance) = (self.part_or(part), radiance * self.tint);
        if let Some(parts) = &mut self.parts {
            parts.add(part, radiance);
            if let Some(sum) = group.and_then(|group| parts.groups.get_mut(group.index())) {
                *sum += radiance;
            }
        }
    }

    /// The path has met nothing: with what throughput, if there was no surface before.
    #[inline]
    pub fn meets_nothing(&mut self, throughput: Rgb) {
        if let Some(parts) = &mut self.parts
            && parts.first.is_none()
        {
            parts.let_through = throughput.element_sum() / 3.0;
        }
    }

    /// The first surface that the path meets: later ones do not count.
    #[inline]
    pub fn first_surface(&mut self, object: u32, surface: impl FnOnce() -> (f32, Vec3, Rgb)) {
        if let Some(parts) = &mut self.parts {
            parts.first.get_or_insert_with(surface);
            parts.object.get_or_insert(object);
        }
    }
}
