//! What passes see: the scene, or, where things move while the shutter is open, a moment of it for each.

use super::buffers::Buffers;
use super::{GpuPass, unsuitable};
use crate::error::Result;
use crate::world::{FlatWorld, WorldBuffers};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// A scene, what of it is done in a pass, and its buffers.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub scene: &'a Scene,
    pub plan: &'a RenderPlan,
    pub world: &'a WorldBuffers,
}

/// A scene as one pass sees it.
pub(super) struct Moment {
    scene: Scene,
    plan: RenderPlan,
    world: WorldBuffers,
}

impl Moment {
    pub fn seen(&self) -> Seen<'_> {
        Seen {
            scene: &self.scene,
            plan: &self.plan,
            world: &self.world,
        }
    }
}

impl GpuPass<'_> {
    /// What all passes see, where nothing moves.
    pub(super) fn still(&self) -> Seen<'_> {
        Seen {
            scene: self.scene,
            plan: self.plan,
            world: &self.world,
        }
    }

    /// What a pass sees that is not what all see. The buffers are made to suit it: most often they do, and only what has
    /// moved is brought to the device.
    pub(super) fn moment(&self, buffers: &mut Buffers, pass_index: u64) -> Result<Option<Moment>> {
        let Some(flat) = &self.moving else { return Ok(None) };
        let moment = self.scene.moment(self.plan.settings.seed, pass_index);
        let Some(scene) = moment.map_err(|why| self.refused(pass_index, why))? else {
            return Ok(None);
        };
        let plan = self.plan.at(self.scene, &scene);
        let device = &self.tested.device;
        let now = FlatWorld::new(&scene, device.largest_buffer()).map_err(|all| unsuitable(self.tested, &all))?;
        let now = now.aimed_by(&scene, &plan);
        let mut world = now.revise(device, Some((flat, &self.world)))?;
        world.with_stacks_of(buffers.made_for());
        let moment = Moment { scene, plan, world };
        buffers.suit(self.tested, moment.seen())?;
        Ok(Some(moment))
    }
}
