//! One pass: a pure function of the scene, the plan and the pass index.

use crate::film::Film;
use crate::job::PassStats;
use crate::plan::{RenderPlan, Scene};

/// What a pass returns.
#[derive(Clone, Debug)]
pub struct PassImage {
    /// Radiance.
    pub film: Film,
    /// Counters.
    pub stats: PassStats,
}

/// Render a pass on the current rayon pool. The bits do not depend on the pool.
pub fn render_pass(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> PassImage {
    let _ = (plan, pass_index);
    let camera = &scene.description.camera;
    PassImage {
        film: Film::new(camera.width, camera.height),
        stats: PassStats::default(),
    }
}
