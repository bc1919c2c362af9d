//! What of a plan kernels cannot do.

use super::layers;
use crate::world::aims;
use crate::world::reason::{Of, Reason, Why};
use crate::world::waves::MOST_WAVES;
use beamfarm_render::plan::RenderPlan;

/// All that keeps a plan from devices; every field is answered here or by its scene.
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
