//! Whole passes on a device: photons, what they leave, camera paths, and the film.
//!
//! | question                                  | module      |
//! | ----------------------------------------- | ----------- |
//! | what keeps a scene or plan from a device? | `reasons`   |

mod reasons;

use crate::error::{Error, Result};
use crate::self_test::Tested;
use crate::world::FlatWorld;
use crate::world::reason::Reason;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::PassImage;
use beamfarm_render::world::Scene;

/// Bytes of a device's memory that passes take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// The scene.
    pub world: u64,
    /// Photons, beams and what they are found by.
    pub photons: u64,
    /// Camera paths.
    pub paths: u64,
}

impl Memory {
    /// All of it.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.world + self.photons + self.paths
    }
}

/// Renders passes of a scene by a plan on a device.
pub struct GpuPass<'a> {
    tested: &'a Tested,
    scene: &'a Scene,
    plan: &'a RenderPlan,
}

impl<'a> GpuPass<'a> {
    /// All that keeps a scene and its plan from devices whose largest buffer has so many bytes.
    #[must_use]
    pub fn reasons(scene: &Scene, plan: &RenderPlan, largest_buffer: u64) -> Vec<Reason> {
        let mut reasons = FlatWorld::new(scene, largest_buffer).err().unwrap_or_default();
        reasons.extend(reasons::of_plan(plan));
        reasons
    }

    /// What passes take.
    #[must_use]
    pub fn memory(_scene: &Scene, _plan: &RenderPlan) -> Memory {
        Memory::default()
    }

    /// Bring a scene to a device.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] with all of [`Self::reasons`], and the device's.
    pub fn new(tested: &'a Tested, scene: &'a Scene, plan: &'a RenderPlan) -> Result<Self> {
        let reasons = Self::reasons(scene, plan, tested.device.largest_buffer());
        if !reasons.is_empty() {
            let all: Vec<String> = reasons.iter().map(ToString::to_string).collect();
            return Err(Error::Unsuitable {
                device: tested.device.listed().name.clone(),
                reasons: all.join("; "),
            });
        }
        Ok(Self { tested, scene, plan })
    }

    /// Render a pass. The same bits on every device.
    ///
    /// # Errors
    /// The device's.
    pub fn render(&self, pass_index: u64) -> Result<PassImage> {
        let _ = (self.scene, self.plan, pass_index);
        Err(Error::Refused {
            device: self.tested.device.listed().name.clone(),
            what: "a pass".to_owned(),
            reason: "passes on devices are not built in yet".to_owned(),
        })
    }

    /// Render passes, each as by itself.
    ///
    /// # Errors
    /// The device's.
    pub fn render_all(&self, indices: &[u64]) -> Result<Vec<PassImage>> {
        indices.iter().map(|index| self.render(*index)).collect()
    }
}
