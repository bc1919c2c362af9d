//! The lights to choose from, by visibility.

use super::SceneDescription;
use crate::world::light::{Light, LightKind, LightSelector};
use crate::world::rules::Rules;
use std::collections::BTreeMap;

/// Choices by power among the lights that rules allow.
#[derive(Debug)]
pub struct Selectors {
    /// Among all of these lights.
    pub all: LightSelector,
    /// By the set hidden from shadow rays, where it includes lights: the visible lights.
    pub(crate) seen: BTreeMap<u32, LightSelector>,
    /// The lights whose photons rules allow to be stored, if not all.
    pub(crate) emitters: Option<LightSelector>,
}

impl Selectors {
    /// Among all lights.
    pub(super) fn of_all(description: &SceneDescription) -> Self {
        Self::of(description, |_| true)
    }

    /// Among the lights that need sampling where scattered rays go on, if those find the others well enough.
    pub(super) fn aimed_at(description: &SceneDescription) -> Option<Self> {
        let lights = description.lights.iter().enumerate();
        let by_chance = |(i, light): (usize, &Light)| {
            matches!(&light.kind, LightKind::Environment(environment) if environment.is_even())
                && (description.rules.as_ref()).is_none_or(|rules| rules.all_see_light(i))
        };
        let by_chance: Vec<bool> = lights.map(by_chance).collect();
        by_chance
            .contains(&true)
            .then(|| Self::of(description, |light| !by_chance[light]))
    }

    fn of(description: &SceneDescription, is_one: impl Fn(usize) -> bool) -> Self {
        let some = |is_seen: &dyn Fn(usize) -> bool| {
            let SceneDescription {
                lights,
                objects,
                bounds,
                ..
            } = description;
            LightSelector::of_some(lights, objects, bounds, |light| is_one(light) && is_seen(light))
        };
        Self {
            all: some(&|_| true),
            seen: (description.rules.as_ref())
                .map(|rules| seen(description, rules, some))
                .unwrap_or_default(),
            emitters: emitters(description, some),
        }
    }
}

/// For each set hidden from shadow rays: the visible lights.
fn seen(
    description: &SceneDescription,
    rules: &Rules,
    some: impl Fn(&dyn Fn(usize) -> bool) -> LightSelector,
) -> BTreeMap<u32, LightSelector> {
    let mut selectors = BTreeMap::new();
    for sets in &rules.of_object {
        let sees = |light: usize| !rules.hides_light(sets.shadow, light);
        if (0..description.lights.len()).all(sees) {
            continue;
        }
        selectors.entry(sets.shadow.row).or_insert_with(|| some(&sees));
    }
    selectors
}

/// The lights whose photons may be stored somewhere, unless all may.
fn emitters(
    description: &SceneDescription,
    some: impl Fn(&dyn Fn(usize) -> bool) -> LightSelector,
) -> Option<LightSelector> {
    let matters = lights_that_leave(description);
    matters.contains(&false).then(|| some(&|light| matters[light]))
}

/// By light: whether rules allow its photons to be stored somewhere.
pub(crate) fn lights_that_leave(description: &SceneDescription) -> Vec<bool> {
    let Some(rules) = &description.rules else {
        return vec![true; description.lights.len()];
    };
    let objects = description.objects.iter().zip(&rules.of_object);
    let surfaces = objects.filter(|(object, _)| {
        let material = &description.materials[object.material as usize];
        !material.is_specular()
    });
    let media = description.media.iter().zip(&rules.of_medium);
    let media = media.filter(|(medium, _)| medium.scatters());
    let mut sets: Vec<_> = surfaces.map(|(_, sets)| sets.photon).collect();
    sets.extend(media.map(|(_, set)| *set));
    sets.sort_unstable_by_key(|set| set.row);
    sets.dedup();
    let matters = |light: usize| !sets.iter().all(|set| rules.hides_light(*set, light));
    (0..description.lights.len()).map(matters).collect()
}
