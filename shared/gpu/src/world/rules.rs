//! Visibility rules in the kernels' layout: one bit per class of objects and lights that rules treat alike, and a word
//! of such bits for what rays of a type do not see.

use super::reason::{Of, Reason, Why};
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::LightSelector;
use beamfarm_render::world::mask::{Ruled, Unruled, VisibilityMask};
use beamfarm_render::world::rules::{HiddenSet, ObjectSets, Rules};
use std::ptr;

/// The bit of the first class. Lower bits have other meanings.
const FIRST: u32 = 8;
/// Number of classes with a bit.
const MOST: u32 = 32 - FIRST;

/// What rays that start at an object do not see, as class bits; all zero without rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OfObject {
    /// Its own bit.
    pub class: u32,
    /// For rays that it reflects.
    pub reflected: u32,
    /// For rays that it refracts.
    pub refracted: u32,
    /// For shadow rays.
    pub shadow: u32,
    /// For photons that it scatters; also the lights whose photons do not light it.
    pub photon: u32,
    /// Whether shadow rays and surface rays see the same.
    pub one_ray: bool,
    /// Whether path rays that start at it find light of other surfaces.
    pub gathers: bool,
    /// Whether path rays that reach it find its light.
    pub is_gathered: bool,
    /// Whether rules for reflected and refracted rays govern its gloss.
    pub is_glossy: bool,
}

impl OfObject {
    /// Without rules.
    const FREE: Self = Self {
        class: 0,
        reflected: 0,
        refracted: 0,
        shadow: 0,
        photon: 0,
        one_ray: true,
        gathers: true,
        is_gathered: true,
        is_glossy: false,
    };

    /// As [`Surface::bits`](super::Surface::bits).
    pub fn bits(&self) -> u32 {
        let all = [self.one_ray, self.gathers, self.is_gathered, self.is_glossy];
        all.iter().enumerate().map(|(bit, is)| u32::from(*is) << bit).sum()
    }
}

/// The same for a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct OfLight {
    /// Its own bit.
    pub class: u32,
    /// The class bit of its surface, if it has one.
    pub shape_class: u32,
    /// What shadow rays to it do not see, wherever they start.
    pub shadow: u32,
    /// What its photons do not see.
    pub photon: u32,
}

/// What a scene's rays do not see.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlatRules {
    /// Whether there are rules.
    pub are_there: bool,
    /// For camera rays.
    pub camera: u32,
    /// For rays of paths from their second vertex on.
    pub gather: u32,
    /// By object; empty without rules.
    pub objects: Vec<OfObject>,
    /// By light; empty without rules.
    pub lights: Vec<OfLight>,
    /// By medium, for photons that it scatters, and the lights whose photons are not stored in it; empty without rules.
    pub media: Vec<u32>,
    /// By medium and light: no light comes there straight from the light. Empty if `gather` already says so.
    pub unlit: Vec<bool>,
}

fn classes(rules: &Rules) -> u32 {
    rules.class.iter().max().map_or(0, |class| class + 1)
}

/// The bit of a class, if it has one.
fn bit(class: u32) -> u32 {
    1_u32.checked_shl(FIRST + class).unwrap_or_default()
}

fn bits(rules: &Rules, set: HiddenSet) -> u32 {
    let held = (0..classes(rules).min(MOST)).filter(|class| rules.holds_class(set, *class));
    held.map(bit).sum()
}

impl FlatRules {
    /// For a scene whose rules kernels support.
    pub fn new(scene: &Scene) -> Self {
        let description = scene.description();
        let Some(rules) = &description.rules else {
            return Self::default();
        };
        let class = |thing: usize| rules.class.get(thing).copied().map_or(0, bit);
        let of = |set: HiddenSet| bits(rules, set);
        let object = |(number, sets): (usize, &ObjectSets)| OfObject {
            class: class(number),
            reflected: of(sets.reflected),
            refracted: of(sets.refracted),
            shadow: of(sets.shadow),
            photon: of(sets.photon),
            one_ray: sets.one_ray,
            gathers: sets.gathers,
            is_gathered: sets.is_gathered,
            is_glossy: sets.is_glossy,
        };
        let light = |(number, shadow): (usize, &HiddenSet)| OfLight {
            class: class(rules.objects + number),
            shape_class: (description.lights[number].kind.object()).map_or(0, |object| class(object as usize)),
            shadow: of(*shadow),
            photon: rules.of_light.get(number).map_or(0, |set| of(*set)),
        };
        // By medium.
        let all_unlit = rules.unlit.chunks(rules.of_light.len().max(1));
        let is_hidden = |light: usize| rules.hides_light(rules.gather, light);
        let is_told = all_unlit.flat_map(|of_medium| of_medium.iter().enumerate());
        let is_told = is_told.into_iter().any(|(light, unlit)| *unlit != is_hidden(light));
        Self {
            are_there: true,
            camera: of(rules.camera),
            gather: of(rules.gather),
            objects: rules.of_object.iter().enumerate().map(object).collect(),
            lights: rules.shadow_of_light.iter().enumerate().map(light).collect(),
            media: rules.of_medium.iter().map(|set| of(*set)).collect(),
            unlit: if is_told { rules.unlit.clone() } else { Vec::new() },
        }
    }

    /// For an object.
    pub fn of_object(&self, object: u32) -> OfObject {
        self.objects.get(object as usize).copied().unwrap_or(OfObject::FREE)
    }

    /// For a light.
    pub fn of_light(&self, light: usize) -> OfLight {
        self.lights.get(light).copied().unwrap_or_default()
    }

    /// What photons that a medium scatters do not see, and the lights whose photons are not stored in it.
    pub fn of_medium(&self, medium: u16) -> u32 {
        self.media.get(usize::from(medium)).copied().unwrap_or_default()
    }
}

/// Selectors of lights by power: for paths from later vertices on; for path ends and segments; then for first vertices,
/// if rules distinguish objects. By object: the number of its own.
pub(super) fn selectors(scene: &Scene) -> (Vec<&LightSelector>, Vec<u32>) {
    let objects = 0..scene.description().objects.len() as u32;
    match &scene.description().rules {
        None => selected_by(scene, Unruled, objects),
        Some(rules) => selected_by(scene, Ruled(rules), objects),
    }
}

fn selected_by(
    scene: &Scene,
    mask: impl VisibilityMask,
    objects: impl Iterator<Item = u32>,
) -> (Vec<&LightSelector>, Vec<u32>) {
    let mut all = vec![mask.emitters(scene.aimed_at()), mask.emitters(scene.selectors())];
    let of_objects = objects.map(|object| {
        let own = mask.selector(scene.aimed_at(), object);
        let known = all.iter().position(|other| ptr::eq(*other, own));
        let number = known.unwrap_or(all.len());
        if known.is_none() {
            all.push(own);
        }
        number as u32
    });
    let of_objects = of_objects.collect();
    (all, of_objects)
}

/// Rules that kernels do not support.
pub(super) fn reasons(scene: &Scene) -> Vec<Reason> {
    let Some(rules) = &scene.description().rules else {
        return Vec::new();
    };
    let of_scene = |why: Why| Reason {
        of: Of::Scene,
        field: "rules",
        why,
    };
    let count = classes(rules);
    if count > MOST {
        let (count, most) = (count.into(), MOST.into());
        return vec![of_scene(Why::Many { count, most })];
    }
    Vec::new()
}
