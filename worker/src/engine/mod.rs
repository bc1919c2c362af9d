//! What renders the passes of a job: this machine's processors, or one of its devices.
//!
//! Programs built with the feature `gpu` have devices. Others know the engine's name and report that they lack it.

#[cfg(feature = "gpu")]
mod device;

use beamfarm_image::job::EngineKind;
use beamfarm_proto::Device;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::{NoPass, PassImage};
use beamfarm_render::world::Scene;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

/// Stops Mesa's layer that picks a desktop's preferred device from doing so where there is no desktop: it would
/// complain on stderr each time that devices are listed.
///
/// # Safety
/// There must be no other thread yet: this changes the process's environment.
pub unsafe fn spare_desktop() {
    #[cfg(all(feature = "gpu", target_os = "linux"))]
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: the caller guarantees that nobody else reads or writes the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

/// Whether the program was built with the engine gpu.
pub const HAS_GPU: bool = cfg!(feature = "gpu");

/// A scene that is ready to render, with its plan.
#[derive(Debug)]
pub struct Planned {
    /// The scene.
    pub scene: Scene,
    /// The plan, whose settings name the engine.
    pub plan: RenderPlan,
}

/// Why a job has no engine, or has lost it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EngineError {
    /// The program was built without it.
    #[error(
        "this program was built without the engine gpu: `cargo build --release --features gpu` makes one that has it"
    )]
    NotBuilt,
    /// This machine has no such device, or none that can be used.
    #[error("{0}")]
    NoDevice(String),
    /// All reasons why devices cannot render the scene.
    #[error("the engine gpu cannot render this scene:\n  {}", .0.join("\n  "))]
    Scene(Vec<String>),
    /// A device failed a request: out of memory, or given up by its driver.
    #[error("{0}")]
    Broke(String),
}

/// Why a pass was not rendered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotRendered {
    /// No machine can render this pass.
    #[error(transparent)]
    Pass(#[from] NoPass),
    /// This machine failed; another may render the pass.
    #[error(transparent)]
    Machine(#[from] EngineError),
}

/// The engines of this machine. The first job that needs a device opens and tests it.
#[derive(Debug)]
pub struct Engines {
    #[cfg(feature = "gpu")]
    device: device::Chosen,
}

impl Engines {
    /// With this device: its number, or part of its name; empty: the best.
    #[must_use]
    pub fn new(gpu: &str) -> Self {
        #[cfg(not(feature = "gpu"))]
        let _ = gpu;
        Self {
            #[cfg(feature = "gpu")]
            device: device::Chosen::new(gpu),
        }
    }

    /// The device's description, after opening and testing it.
    ///
    /// # Errors
    /// There is no device, or it cannot be used.
    pub fn device(&self) -> Result<Device, EngineError> {
        #[cfg(feature = "gpu")]
        {
            self.device.described()
        }
        #[cfg(not(feature = "gpu"))]
        {
            Err(EngineError::NotBuilt)
        }
    }

    /// The engine of a plan's job, ready for its first pass.
    ///
    /// # Errors
    /// There is no such engine here, or the scene cannot be uploaded to the device.
    pub fn engine(&self, planned: Arc<Planned>) -> Result<Engine, EngineError> {
        let by = match planned.plan.settings.engine {
            EngineKind::Cpu => By::Processors,
            #[cfg(feature = "gpu")]
            EngineKind::Gpu => By::Device(self.device.passes(planned.clone())?),
            #[cfg(not(feature = "gpu"))]
            EngineKind::Gpu => return Err(EngineError::NotBuilt),
        };
        Ok(Engine { planned, by })
    }

    /// An engine for changing scenes.
    #[must_use]
    pub fn revisions(self: &Arc<Self>) -> Revisions {
        Revisions {
            #[cfg(feature = "gpu")]
            engines: self.clone(),
            #[cfg(feature = "gpu")]
            kept: None,
        }
    }
}

/// Renders passes of successive, similar scenes: unchanged data stays on the device.
pub struct Revisions {
    #[cfg(feature = "gpu")]
    engines: Arc<Engines>,
    #[cfg(feature = "gpu")]
    kept: Option<device::Kept>,
}

impl Revisions {
    /// Renders a pass with the engine that the plan's settings name; on processors in the current rayon pool. The bits
    /// are those of [`Engine::pass`].
    ///
    /// # Errors
    /// There is no such pass, no such engine here, or the device cannot render the scene or failed.
    pub fn pass(&mut self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<PassImage, NotRendered> {
        match plan.settings.engine {
            EngineKind::Cpu => Ok(render_pass(scene, plan, pass_index)?),
            #[cfg(feature = "gpu")]
            EngineKind::Gpu => {
                let kept = self.kept.take();
                let (image, kept) = self.engines.device.revised((scene, plan), pass_index, kept)?;
                self.kept = kept;
                Ok(image)
            }
            #[cfg(not(feature = "gpu"))]
            EngineKind::Gpu => Err(EngineError::NotBuilt.into()),
        }
    }
}

/// Renders the passes of one plan.
#[derive(Debug)]
pub struct Engine {
    planned: Arc<Planned>,
    by: By,
}

#[derive(Debug)]
enum By {
    Processors,
    #[cfg(feature = "gpu")]
    Device(device::Passes),
}

impl Engine {
    /// The scene and its plan.
    #[must_use]
    pub fn planned(&self) -> &Planned {
        &self.planned
    }

    /// Renders a pass; on processors in the current rayon pool. The bits depend on the engine's kind only.
    ///
    /// # Errors
    /// There is no such pass, or the device failed.
    pub fn pass(&self, pass_index: u64) -> Result<PassImage, NotRendered> {
        let image = self.passes(&[pass_index])?.pop();
        image.ok_or_else(|| EngineError::Broke(format!("pass {pass_index} is missing")).into())
    }

    /// Renders passes, together or one after the other. Each has the same bits as alone.
    ///
    /// # Errors
    /// There is no such pass, or the device failed.
    pub fn passes(&self, indices: &[u64]) -> Result<Vec<PassImage>, NotRendered> {
        let Planned { scene, plan } = &*self.planned;
        match &self.by {
            By::Processors => {
                let images = indices.iter().map(|index| render_pass(scene, plan, *index));
                Ok(images.collect::<Result<_, _>>()?)
            }
            #[cfg(feature = "gpu")]
            By::Device(passes) => Ok(passes.render(indices)?),
        }
    }

    /// Number of passes that are best rendered together: several, if that keeps a device busier.
    #[must_use]
    pub fn together(&self) -> usize {
        match &self.by {
            By::Processors => 1,
            #[cfg(feature = "gpu")]
            By::Device(passes) => passes.together(),
        }
    }
}

/// The device that [`check`] assumes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Where {
    /// A device elsewhere.
    #[default]
    Elsewhere,
    /// A device of this machine: its number, or part of its name; empty: the best.
    Here(String),
}

/// Device memory of passes, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needed {
    /// The scene.
    pub world: u64,
    /// Photons, beams and their search structures.
    pub photons: u64,
    /// Camera paths.
    pub paths: u64,
}

/// Whether devices can render passes of a scene, whatever engine its settings name, and the memory that passes need.
///
/// # Errors
/// [`EngineError::Scene`] with all reasons why they cannot; or the requested device of this machine does not exist.
pub fn check(scene: &Scene, plan: &RenderPlan, place: &Where) -> Result<Needed, EngineError> {
    #[cfg(feature = "gpu")]
    {
        device::check(scene, plan, place)
    }
    #[cfg(not(feature = "gpu"))]
    {
        let _ = (scene, plan, place);
        Err(EngineError::NotBuilt)
    }
}

/// Time of one kernel on a device for a pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelTime {
    /// Its program and entry point.
    pub kernel: String,
    /// Number of dispatches, including empty ones.
    pub dispatches: u64,
    /// Total time, by the device's clock.
    pub seconds: f64,
}

/// Kernel times of a pass on a device of this machine, the longest first. Empty for a device without a clock.
///
/// # Errors
/// As for [`Engines::engine`] and [`Engine::pass`].
pub fn kernel_times(planned: &Planned, gpu: &str, pass_index: u64) -> Result<Vec<KernelTime>, EngineError> {
    #[cfg(feature = "gpu")]
    {
        device::kernel_times(planned, gpu, pass_index)
    }
    #[cfg(not(feature = "gpu"))]
    {
        let _ = (planned, gpu, pass_index);
        Err(EngineError::NotBuilt)
    }
}

/// A device of this machine, and whether it can be used.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Its index in the list, from zero.
    pub number: usize,
    /// Its driver's name for it.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: String,
    /// The driver's name and version.
    pub driver: String,
    /// Bytes of its own memory, or of the memory shared with the processor.
    pub memory: Option<u64>,
    /// Its test result, or why it cannot be used.
    pub test: Result<Test, String>,
}

/// Result of a passed test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// Its own division is exact; otherwise kernels use theirs.
    pub native_division: bool,
    /// Its own square root is exact.
    pub native_roots: bool,
    /// Time to open and test it.
    pub time: Duration,
}

/// The number of the default card: the first of the best kind that lacks nothing.
///
/// # Errors
/// There is none; software drivers have to be named explicitly.
pub fn best_card() -> Result<usize, EngineError> {
    let mut cards = cards()?.into_iter();
    cards
        .next()
        .ok_or_else(|| EngineError::NoDevice("no card was found".into()))
}

/// Numbers of all cards of this machine that lack nothing, the best first; excludes software drivers.
///
/// # Errors
/// There is none.
pub fn cards() -> Result<Vec<usize>, EngineError> {
    #[cfg(feature = "gpu")]
    {
        device::cards()
    }
    #[cfg(not(feature = "gpu"))]
    {
        Err(EngineError::NotBuilt)
    }
}

/// All devices of this machine, tested one after the other.
///
/// # Errors
/// There is no Vulkan, or the program was built without it.
pub fn devices() -> Result<Vec<Found>, EngineError> {
    #[cfg(feature = "gpu")]
    {
        device::all()
    }
    #[cfg(not(feature = "gpu"))]
    {
        Err(EngineError::NotBuilt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_has_a_line() {
        let error = EngineError::Scene(vec!["a: one".into(), "b: two".into()]);
        assert_eq!(
            error.to_string(),
            "the engine gpu cannot render this scene:\n  a: one\n  b: two"
        );
        assert_eq!(EngineError::NotBuilt.to_string().lines().count(), 1);
    }
}
