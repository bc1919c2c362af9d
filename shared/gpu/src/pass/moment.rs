//! What passes see: the scene, or with motion blur one moment of it each.

use super::buffers::Buffers;
use super::seen::Seen;
use super::{GpuPass, flatten, room};
use crate::error::{Error, Result};
use crate::self_test::Tested;
use crate::world::{FlatWorld, WorldBuffers};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use std::sync::PoisonError;

/// What remains of a scene on a device, for a similar one.
pub struct Kept {
    flat: FlatWorld,
    world: WorldBuffers,
    buffers: Buffers,
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

impl<'a> GpuPass<'a> {
    /// A scene similar to one that was on the device before: only the changes are uploaded. The bits are those of any
    /// other pass of the scene.
    ///
    /// # Errors
    /// As for [`GpuPass::new`].
    pub fn of_revision(tested: &'a Tested, scene: &'a Scene, plan: &'a RenderPlan, kept: Option<Kept>) -> Result<Self> {
        let Some(Kept {
            flat,
            world,
            mut buffers,
        }) = kept
        else {
            let mut pass = Self::new(tested, scene, plan)?;
            if pass.flat.is_none() {
                pass.flat = Some(flatten(tested, scene, plan)?);
            }
            return Ok(pass);
        };
        let now = flatten(tested, scene, plan)?;
        let mut revised = now.revise(&tested.device, Some((&flat, &world)))?;
        revised.with_stacks_of(buffers.made_for());
        let seen = Seen {
            scene,
            plan,
            world: &revised,
        };
        buffers.suit(tested, seen, room(tested, scene))?;
        tested.compile()?;
        Ok(Self::with_buffers(tested, (scene, plan), (Some(now), revised), buffers))
    }

    /// Hands the device data over to a similar scene. None for a scene that was uploaded to stay unchanged.
    pub fn keep(self) -> Option<Kept> {
        let buffers = self.buffers.into_inner().unwrap_or_else(PoisonError::into_inner);
        Some(Kept {
            flat: self.flat?,
            world: self.world,
            buffers,
        })
    }

    /// What all passes see if nothing moves.
    pub(super) fn still(&self) -> Seen<'_> {
        Seen {
            scene: self.scene,
            plan: self.plan,
            world: &self.world,
        }
    }

    /// What a pass sees, if it differs from the others. Adapts the buffers: usually they fit, and only moved objects
    /// are uploaded.
    pub(super) fn moment(&self, buffers: &mut Buffers, pass_index: u64) -> Result<Option<Moment>> {
        let Some(flat) = &self.flat else { return Ok(None) };
        let no_moment = |why: String| Error::NoMoment { pass: pass_index, why };
        let moment = self.scene.moment(self.plan.settings.seed, pass_index);
        let Some(scene) = moment.map_err(no_moment)? else {
            return Ok(None);
        };
        let plan = self.plan.at(self.scene, &scene);
        let now = flatten(self.tested, &scene, &plan).map_err(|error| no_moment(error.to_string()))?;
        let mut world = now.revise(&self.tested.device, Some((flat, &self.world)))?;
        world.with_stacks_of(buffers.made_for());
        let moment = Moment { scene, plan, world };
        let room = (buffers.paths.most(), buffers.passes);
        buffers.suit(self.tested, moment.seen(), room)?;
        Ok(Some(moment))
    }
}
