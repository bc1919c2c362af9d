//! What of a plan kernels cannot do.

use super::layers;
use crate::world::aims;
use crate::world::reason::{Of, Reason, Why};
use crate::world::waves::MOST_WAVES;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::estimators::PathEnds;

/// All that keeps a plan from devices; every field is answered here or by its scene.
pub(super) fn of_plan(plan: &RenderPlan) -> Vec<Reason> {
    let mut reasons = Vec::new();
    let mut no = |field: &'static str, what: &'static str| {
        reasons.push(Reason {
            of: Of::Plan,
            field,
            why: Why::Missing(what),
        });
    };
    match plan.estimators.ends() {
        PathEnds::Never | PathEnds::FarEnough | PathEnds::First => {}
        PathEnds::Second => no("surfaces", "paths that all end at the second surface"),
    }
    reasons.extend(layers::reasons(&plan.layers.layers));
    reasons.extend(aims::reasons(plan));
    let (count, most) = (u64::from(plan.waves), MOST_WAVES as u64);
    if count > most {
        reasons.push(Reason {
            of: Of::Plan,
            field: "waves",
            why: Why::Many { count, most },
        });
    }
    reasons
}
