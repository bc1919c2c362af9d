//! The plans that a pilot tries.

use super::PATHS;
use super::pictures::SCALE;
use crate::plan::targeting::Places;
use crate::plan::thin::has_thin_light;
use crate::plan::{RenderPlan, photons_decide};
use crate::world::Scene;
use beamfarm_image::job::{Budget, JobSettings, MAX_PASSES, Targeting, Technique, Techniques};

/// The plan of the pilot's passes for a set of techniques.
fn plan_of(scene: &Scene, settings: JobSettings, techniques: Techniques, places: &mut Places) -> RenderPlan {
    let budget = Some(Budget {
        passes: MAX_PASSES,
        scale: SCALE,
    });
    let settings = JobSettings {
        seed: 0,
        budget,
        paths_per_pass: PATHS,
        techniques,
        ..settings
    };
    RenderPlan::by_places(scene, settings, places)
}

/// The plans for some sets of techniques, without duplicates or plans already known.
pub(super) fn plans_of(
    scene: &Scene,
    settings: JobSettings,
    ways: Vec<Techniques>,
    known: &[&RenderPlan],
    places: &mut Places,
) -> Vec<RenderPlan> {
    let mut plans: Vec<RenderPlan> = Vec::new();
    for techniques in ways {
        let plan = plan_of(scene, settings, techniques, places);
        let said = settings.techniques;
        let tries = |is: Option<Technique>, said: Option<Technique>| is == Some(Technique::Photons) && said.is_none();
        let is_tried = [
            (techniques.media, said.media),
            (techniques.surfaces, said.surfaces),
            (techniques.caustics, said.caustics),
        ];
        if is_tried.into_iter().any(|(is, said)| tries(is, said)) && plan.waits_for_rare_light() {
            continue;
        }
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

/// Whether both plans find light in the same way.
fn are_like(plan: &RenderPlan, other: &RenderPlan) -> bool {
    let same_targets = match (&plan.targets, &other.targets) {
        (None, None) => true,
        (Some(these), Some(those)) => these.are_like(those),
        (Some(_), None) | (None, Some(_)) => false,
    };
    same_targets && plan.estimators == other.estimators
}

/// Changes one decision.
type Change = fn(Techniques) -> Techniques;

/// The open decisions, each with its alternatives.
fn decisions(scene: &Scene, said: Techniques) -> Vec<Vec<Change>> {
    let mut decisions: Vec<Vec<Change>> = Vec::new();
    if !photons_decide(scene) {
        if said.media.is_none() && !has_thin_light(scene) {
            decisions.push(vec![
                |of| Techniques {
                    media: Some(Technique::Photons),
                    ..of
                },
                |of| Techniques {
                    media: Some(Technique::Paths),
                    ..of
                },
            ]);
        }
        if said.surfaces.is_none() {
            decisions.push(vec![
                |of| Techniques {
                    surfaces: Some(Technique::Photons),
                    ..of
                },
                |of| Techniques {
                    surfaces: Some(Technique::Paths),
                    ..of
                },
            ]);
        }
        if said.caustics.is_none() {
            decisions.push(vec![
                |of| Techniques {
                    caustics: Some(Technique::Photons),
                    ..of
                },
                |of| Techniques {
                    caustics: Some(Technique::Paths),
                    ..of
                },
            ]);
        }
    }
    if scene.description().defaults.targeting == Targeting::Auto && said.aimed.is_none() {
        decisions.push(vec![
            |of| Techniques {
                aimed: Some(true),
                ..of
            },
            |of| Techniques {
                aimed: Some(false),
                ..of
            },
        ]);
    }
    decisions
}

/// The set techniques, and every variant that differs in one decision.
pub(super) fn neighbours(scene: &Scene, said: Techniques, of: Techniques) -> Vec<Techniques> {
    let others = decisions(scene, said).into_iter().flatten().map(|change| change(of));
    std::iter::once(of).chain(others).collect()
}

/// All combinations that the set techniques leave open, starting with these alone.
pub(super) fn all(scene: &Scene, said: Techniques) -> Vec<Techniques> {
    let mut ways = vec![said];
    for decision in decisions(scene, said) {
        for way in ways.clone() {
            ways.extend(decision.iter().map(|change| change(way)));
        }
    }
    ways
}
