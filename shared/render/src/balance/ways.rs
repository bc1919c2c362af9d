//! The plans that a pilot tries.

use super::PATHS;
use super::pictures::SCALE;
use crate::plan::RenderPlan;
use crate::world::Scene;
use beamfarm_image::job::{Budget, Finder, Finders, JobSettings, MAX_PASSES, Targeting};

/// All plans that differ, of the pilot's passes; the first of them by what is best for most scenes.
pub(super) fn plans_of(scene: &Scene, settings: JobSettings) -> Vec<RenderPlan> {
    let mut plans: Vec<RenderPlan> = Vec::new();
    for finders in ways(scene, settings.finders) {
        let budget = Some(Budget {
            passes: MAX_PASSES,
            scale: SCALE,
        });
        let settings = JobSettings {
            seed: 0,
            budget,
            paths_per_pass: PATHS,
            finders,
            ..settings
        };
        let plan = RenderPlan::new(scene, settings);
        if !plans.iter().any(|other| are_like(&plan, other)) {
            plans.push(plan);
        }
    }
    plans
}

/// Whether passes find light in the same way.
fn are_like(plan: &RenderPlan, other: &RenderPlan) -> bool {
    let same_targets = match (&plan.targets, &other.targets) {
        (None, None) => true,
        (Some(these), Some(those)) => these.are_like(those),
        (Some(_), None) | (None, Some(_)) => false,
    };
    same_targets && plan.estimators == other.estimators
}

/// All that what is said leaves, first of all that alone.
fn ways(scene: &Scene, said: Finders) -> Vec<Finders> {
    let is_free = scene.description().defaults.targeting == Targeting::Auto && said.aimed.is_none();
    let aims = match is_free {
        true => vec![Some(false), Some(true)],
        false => vec![said.aimed],
    };
    let aim = |finders: Finders| aims.iter().map(move |&aimed| Finders { aimed, ..finders });
    let mut ways = vec![said];
    let rules = scene.description().rules.as_ref();
    // Where photons alone obey rules, the picture is what they find.
    if rules.is_some_and(|rules| rules.touches_photons && !rules.paths_obey) {
        ways.extend(aim(said));
        return ways;
    }
    let either = |said: Option<Finder>| match said {
        Some(_) => vec![said],
        None => vec![Some(Finder::Photons), Some(Finder::Paths)],
    };
    for media in either(said.media) {
        for surfaces in either(said.surfaces) {
            let mut all = either(said.caustics);
            if said.caustics.is_none() {
                all.push(None);
            }
            for caustics in all {
                ways.extend(aim(Finders {
                    media,
                    surfaces,
                    caustics,
                    aimed: None,
                }));
            }
        }
    }
    ways
}
