//! What a pass sees.

use crate::world::WorldBuffers;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// A scene, its plan, and its buffers.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub scene: &'a Scene,
    pub plan: &'a RenderPlan,
    pub world: &'a WorldBuffers,
}
