//! Rules of what rays see, as kernels have them: a bit for each class of objects and lights that rules do not tell
//! apart, and what rays of a type do not see as a word of such bits.
//!
//! Kernels have them where all photons see the same, and paths find what surfaces send by rays that see that too:
//! `Rules::paths_obey` of the renderer.

use super::reason::{Of, Reason, Why};
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::LightSelector;
use beamfarm_render::world::mask::{Ruled, Unruled, VisibilityMask};
use beamfarm_render::world::rules::{HiddenSet, ObjectSets, Rules};
use std::ptr;

/// The bit of the first class. Those before say other things of objects.
const FIRST: u32 = 8;
/// So many classes have a bit.
const MOST: u32 = 32 - FIRST;

/// What rays do not see that start at an object, by bits of classes; all zero without rules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct OfObject {
    /// Its own bit.
    pub class: u32,
    /// Rays that it reflects.
    pub reflected: u32,
    /// Rays that it refracts.
    pub refracted: u32,
    /// Rays to lights.
    pub shadow: u32,
    /// Rays to lights and those to surfaces see the same.
    pub one_ray: bool,
}

/// The same of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct OfLight {
    /// Its own bit.
    pub class: u32,
    /// That of its surface, if it has one.
    pub shape_class: u32,
    /// What shadow rays to it do not see, wherever they start.
    pub shadow: u32,
}

/// What a scene's rays do not see.
#[derive(Clone, Debug, Default)]
pub(super) struct FlatRules {
    /// Whether there are rules.
    pub are_there: bool,
    /// Rays from the camera.
    pub camera: u32,
    /// Photons, and rays of paths from their second vertex on.
    pub gather: u32,
    /// By object; empty without rules.
    pub objects: Vec<OfObject>,
    /// By light; empty without rules.
    pub lights: Vec<OfLight>,
}

fn classes(rules: &Rules) -> u32 {
    rules.class.iter().max().map_or(0, |class| class + 1)
}

/// Of those classes that have one.
fn bit(class: u32) -> u32 {
    1_u32.checked_shl(FIRST + class).unwrap_or_default()
}

fn bits(rules: &Rules, set: HiddenSet) -> u32 {
    let held = (0..classes(rules).min(MOST)).filter(|class| rules.holds_class(set, *class));
    held.map(bit).sum()
}

impl FlatRules {
    /// Of a scene, all of whose rules kernels have.
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
            one_ray: sets.one_ray,
        };
        let light = |(number, shadow): (usize, &HiddenSet)| OfLight {
            class: class(rules.objects + number),
            shape_class: (description.lights[number].kind.object()).map_or(0, |object| class(object as usize)),
            shadow: of(*shadow),
        };
        Self {
            are_there: true,
            camera: of(rules.camera),
            gather: of(rules.gather),
            objects: rules.of_object.iter().enumerate().map(object).collect(),
            lights: rules.shadow_of_light.iter().enumerate().map(light).collect(),
        }
    }

    /// Of an object.
    pub fn of_object(&self, object: u32) -> OfObject {
        self.objects.get(object as usize).copied().unwrap_or_default()
    }

    /// Of a light.
    pub fn of_light(&self, light: usize) -> OfLight {
        self.lights.get(light).copied().unwrap_or_default()
    }
}

/// Objects that photons pass, by bits of classes.
pub(crate) fn hidden_from_photons(scene: &Scene) -> u32 {
    FlatRules::new(scene).gather
}

/// Who chooses among which lights, by power: paths from later vertices on; where they end, and along segments; then
/// paths at their first vertex, where rules tell objects apart. By object: the number of its own.
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

/// What of rules kernels have not.
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
    let mut reasons = Vec::new();
    if rules.of_object.iter().any(|sets| sets.is_glossy) {
        reasons.push(of_scene(Why::Missing("gloss that shows what its surface does not see")));
    }
    if !photons_are_alike(rules) {
        reasons.push(of_scene(Why::Missing("photons that see what others do not")));
    }
    reasons
}

/// Whether all photons pass what gather rays pass, and those of the same lights leave nothing anywhere.
fn photons_are_alike(rules: &Rules) -> bool {
    let all = bits(rules, rules.gather);
    let of_lights = rules.class[rules.objects..]
        .iter()
        .fold(0, |sum, class| sum | bit(*class));
    let is_passed = |object: usize| all & bit(rules.class[object]) != 0;
    let is_hidden = |light: usize| all & bit(rules.class[rules.objects + light]) != 0;
    let mut objects = rules.of_object.iter().enumerate();
    let mut lights = rules.of_light.iter().enumerate();
    // By medium.
    let unlit = rules.unlit.chunks(rules.of_light.len().max(1));
    // Of what is passed by all no photon leaves, but it counts where it is said which lights matter.
    objects.all(|(number, sets)| {
        let own = bits(rules, sets.photon);
        own == all || is_passed(number) && all & of_lights & !own == 0
    }) && lights.all(|(light, set)| is_hidden(light) || bits(rules, *set) & !of_lights == all & !of_lights)
        && rules.of_medium.iter().all(|set| bits(rules, *set) == all)
        && (unlit.zip(&rules.of_medium))
            .all(|(unlit, _)| (0..unlit.len()).all(|light| unlit[light] == is_hidden(light)))
}
