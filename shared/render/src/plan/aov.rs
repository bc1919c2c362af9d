//! The requested layers: which lights belong to which, and what a camera path adds to them.

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
    /// Groups of lights that have a layer, as indices of their layers.
    groups: Vec<usize>,
    /// By light, if there are groups: its group.
    group_of_light: Vec<Option<GroupNumber>>,
    /// By matte layer, then by object: what the pixels hold.
    ids: Vec<Vec<u32>>,
}

/// Number of a group of lights among those that have a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupNumber(
    /// One more than the number, so that an `Option` takes no more space.
    NonZeroU16,
);

impl GroupNumber {
    /// None beyond the first 65,535 groups; nothing belongs to those.
    pub fn new(number: usize) -> Option<Self> {
        let number = u16::try_from(number).ok()?;
        number.checked_add(1).and_then(NonZeroU16::new).map(Self)
    }

    /// Index in lists of groups.
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0.get() - 1)
    }
}

/// A layer was requested for a group that no light belongs to.
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

    /// As [`Self::new`], but groups may have no lights, for example while those are switched off.
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

    /// The layers that are images of numbers, not mattes.
    pub fn films(&self) -> &[Layer] {
        &self.layers[..self.layers.len() - self.ids.len()]
    }

    /// Number of mattes.
    pub fn mattes(&self) -> usize {
        self.ids.len()
    }

    /// What a matte's pixel holds where this object is met.
    pub fn id(&self, matte: usize, object: Option<u32>) -> u32 {
        object.map_or(NOTHING, |object| self.ids[matte][object as usize])
    }

    /// The group that a light belongs to, if the group has a layer.
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

    /// Whether motion vectors are recorded.
    pub fn has_motion(&self) -> bool {
        self.layers.contains(&Layer::Motion)
    }

    /// Number of groups of lights.
    pub fn groups(&self) -> usize {
        self.groups.len()
    }

    /// The groups' numbers.
    pub(crate) fn group_numbers(&self) -> impl Iterator<Item = GroupNumber> {
        (0..self.groups()).filter_map(GroupNumber::new)
    }

    /// The group whose layer this one is.
    pub fn group_of_layer(&self, layer: usize) -> Option<usize> {
        self.groups.iter().position(|i| *i == layer)
    }
}

/// The layers of all groups of lights in a scene, in the order of their first lights.
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
    /// Depth of the first surface along the camera's axis, its shading normal, and its albedo.
    pub first: Option<(f32, Vec3, Rgb)>,
    /// The object of the first surface.
    pub object: Option<u32>,
    /// The share of environment light that gets through straight.
    pub let_through: f32,
    /// See [`Layer::Direct`].
    pub direct: Rgb,
    /// See [`Layer::Surface`].
    pub surface: Rgb,
    /// See [`Layer::Volume`].
    pub volume: Rgb,
    /// By group of lights.
    pub groups: Vec<Rgb>,
    /// Number of photon beams that contributed.
    pub beams: u32,
    /// Number of photon targets before the first surface, or on it.
    pub targets: u32,
    /// How the first surface moves in the image, in pixels per frame, to the right and up.
    pub motion: Vec2,
}

impl Parts {
    /// Empty values, for this many groups.
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

    /// The value of a layer. `group`: the group's number, for a group's layer.
    pub fn value(&self, layer: &Layer, group: Option<usize>) -> [f32; 3] {
        let first = |value: fn(&(f32, Vec3, Rgb)) -> Vec3| self.first.as_ref().map_or(Vec3::ZERO, value);
        let value = match layer {
            Layer::Alpha => Vec3::new(1.0 - self.let_through, 0.0, 0.0),
            // These come from the mattes and from the pass as a whole, not from paths.
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

/// How light came to the surface or medium that sends it to the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Straight from a light.
    Direct,
    /// From another surface or a medium.
    Surface,
    /// Straight from a light to a medium that scattered it.
    Volume,
}

/// Records what a path adds to the layers; without layers, nothing.
pub struct Recorder<'a> {
    plan: &'a LayerPlan,
    parts: Option<&'a mut Parts>,
    /// The part that everything counts for, however the light came. Set where a medium has scattered the camera path.
    within: Option<Part>,
    /// Factor on all radiance, see [`crate::world::spectrum`].
    tint: Rgb,
}

impl<'a> Recorder<'a> {
    /// A recorder into these parts, if there are any.
    pub fn new(plan: &'a LayerPlan, parts: Option<&'a mut Parts>) -> Self {
        Self {
            plan,
            parts,
            within: None,
            tint: Rgb::ONE,
        }
    }

    /// From here on, everything is light that a medium scatters. Returns what to pass to [`Self::leave_volume`].
    pub fn enter_volume(&mut self) -> Option<Part> {
        self.within.replace(Part::Volume)
    }

    /// The part that light which came this way counts for.
    pub fn part_or(&self, part: Part) -> Part {
        self.within.unwrap_or(part)
    }

    /// Ends what [`Self::enter_volume`] began.
    pub fn leave_volume(&mut self, before: Option<Part>) {
        self.within = before;
    }

    /// Whether anything is recorded.
    #[inline]
    pub fn is_on(&self) -> bool {
        self.parts.is_some()
    }

    /// From here on, light has this weight.
    #[inline]
    pub(crate) fn set_tint(&mut self, tint: Rgb) {
        self.tint = tint;
    }

    /// Adds radiance at the film that comes from a light.
    #[inline]
    pub fn add(&mut self, part: Part, light: usize, radiance: Rgb) {
        if self.is_on() {
            self.add_of_group(part, self.plan.group(light), radiance);
        }
    }

    /// Adds radiance at the film from a group of lights, as numbered by [`LayerPlan::group`].
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

    /// The path has met nothing: records its throughput if it has met no surface before.
    #[inline]
    pub fn meets_nothing(&mut self, throughput: Rgb) {
        if let Some(parts) = &mut self.parts
            && parts.first.is_none()
        {
            parts.let_through = throughput.element_sum() / 3.0;
        }
    }

    /// Records the first surface that the path meets; later ones are ignored.
    #[inline]
    pub fn first_surface(&mut self, object: u32, surface: impl FnOnce() -> (f32, Vec3, Rgb)) {
        if let Some(parts) = &mut self.parts {
            parts.first.get_or_insert_with(surface);
            parts.object.get_or_insert(object);
        }
    }
}
