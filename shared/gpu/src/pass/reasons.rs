//! Parts of a plan that kernels do not support.

use super::layers;
use crate::world::aims;
use crate::world::reason::{Of, Reason, Why};
use crate::world::waves::MOST_WAVES;
use beamfarm_render::plan::RenderPlan;

/// All reasons why devices cannot render a plan; each field is checked here or with its scene.
pub(super) fn of_plan(plan: &RenderPlan) -> Vec<Reason> {
    let mut reasons = Vec::new();
    reasons.extend(layers::reason(&plan.layers));
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
