//! The plans that a pilot tries.

use super::PATHS;
use super::pictures::SCALE;
use crate::plan::RenderPlan;
use crate::world::Scene;
use beamfarm_image::job::{Budget, Finder, Finders, JobSettings, MAX_PASSES, Targeting};

/// The plan of the pilot's passes by a way to find light.
fn plan_of(scene: &Scene, settings: JobSettings, finders: Finders) -> RenderPlan {
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
    RenderPlan::new(scene, settings)
}

/// Those plans of some ways that differ from each other and from those that are known.
pub(super) fn plans_of(
    scene: &Scene,
    settings: JobSettings,
    ways: Vec<Finders>,
    known: &[&RenderPlan],
) -> Vec<RenderPlan> {
    let mut plans: Vec<RenderPlan> = Vec::new();
    for finders in ways {
        let plan = plan_of(scene, settings, finders);
        if !plans
            .iter()
            .chain(known.iter().copied())
            .any(|other| are_like(&plan, other))
        {
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

/// Another way in one decision.
type Change = fn(Finders) -> Finders;

/// What is left to choose, a decision each: how else it may be.
fn decisions(scene: &Scene, said: Finders) -> Vec<Vec<Change>> {
    let mut decisions: Vec<Vec<Change>> = Vec::new();
    let rules = scene.description().rules.as_ref();
    // Where photons alone obey rules, the picture is what they find.
    if rules.is_none_or(|rules| rules.paths_obey || !rules.touches_photons) {
        if said.media.is_none() {
            decisions.push(vec![
                |of| Finders {
                    media: Some(Finder::Photons),
                    ..of
                },
                |of| Finders {
                    media: Some(Finder::Paths),
                    ..of
                },
            ]);
        }
        if said.surfaces.is_none() {
            decisions.push(vec![
                |of| Finders {
                    surfaces: Some(Finder::Photons),
                    ..of
                },
                |of| Finders {
                    surfaces: Some(Finder::Paths),
                    ..of
                },
            ]);
        }
        if said.caustics.is_none() {
            decisions.push(vec![
                |of| Finders {
                    caustics: Some(Finder::Photons),
                    ..of
                },
                |of| Finders {
                    caustics: Some(Finder::Paths),
                    ..of
                },
            ]);
        }
    }
    if scene.description().defaults.targeting == Targeting::Auto && said.aimed.is_none() {
        decisions.push(vec![
            |of| Finders {
                aimed: Some(true),
                ..of
            },
            |of| Finders {
                aimed: Some(false),
                ..of
            },
        ]);
    }
    decisions
}

/// What is said, and all in which one decision is another.
pub(super) fn neighbours(scene: &Scene, said: Finders, of: Finders) -> Vec<Finders> {
    let others = decisions(scene, said).into_iter().flatten().map(|change| change(of));
    std::iter::once(of).chain(others).collect()
}

/// All that what is said leaves, first of all that alone.
pub(super) fn all(scene: &Scene, said: Finders) -> Vec<Finders> {
    let mut ways = vec![said];
    for decision in decisions(scene, said) {
        for way in ways.clone() {
            ways.extend(decision.iter().map(|change| change(way)));
        }
    }
    ways
}
