//! What renders the passes of a job here: the processors of this machine, or a device of it.
//!
//! Devices are there in programs that are built with the feature `gpu`. Others know their name, and say that they are
//! not built with it.

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

/// Have Mesa's layer that looks for a desktop's favourite device look for none where there is no desktop: it complains
/// on stderr each time that devices are listed.
///
/// # Safety
/// There must be no other thread yet: this changes the process's environment.
pub unsafe fn spare_desktop() {
    #[cfg(all(feature = "gpu", target_os = "linux"))]
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: nobody else reads or writes the environment, as the caller says.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

/// Whether the program was built with the engine gpu.
pub const HAS_GPU: bool = cfg!(feature = "gpu");

/// A scene that is ready to be rendered, and how.
#[derive(Debug)]
pub struct Planned {
    /// The scene.
    pub scene: Scene,
    /// Its settings say by which engine.
    pub plan: RenderPlan,
}

/// Why there is no engine for a job, or none any more.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EngineError {
    /// The program has none.
    #[error(
        "this program was built without the engine gpu: `cargo build --release --features gpu` makes one that has it"
    )]
    NotBuilt,
    /// There is no such device here, or none that can be used.
    #[error("{0}")]
    NoDevice(String),
    /// All that keeps the scene from devices.
    #[error("the engine gpu cannot render this scene:\n  {}", .0.join("\n  "))]
    Scene(Vec<String>),
    /// A device did not do what it was asked: no memory, a driver that gave it up.
    #[error("{0}")]
    Broke(String),
}

/// Why a pass was not rendered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotRendered {
    /// There is no such pass, on any machine.
    #[error(transparent)]
    Pass(#[from] NoPass),
    /// The machine is at fault; another may render it.
    #[error(transparent)]
    Machine(#[from] EngineError),
}

/// The engines of this machine. A device is opened and tested by the first job that needs it.
#[derive(Debug)]
pub struct Engines {
    #[cfg(feature = "gpu")]
    device: device::Chosen,
}

impl Engines {
    /// With this device: its number, or a part of its name; empty: the best.
    #[must_use]
    pub fn new(gpu: &str) -> Self {
        #[cfg(not(feature = "gpu"))]
        let _ = gpu;
        Self {
            #[cfg(feature = "gpu")]
            device: device::Chosen::new(gpu),
        }
    }

    /// What the device is, opened and tested.
    ///
    /// # Errors
    /// There is none here, or it cannot be used.
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
    /// There is none here, or the scene cannot be brought to the device.
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

    /// For scenes that change.
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

/// Renders passes of scenes, each of which has much in common with the one before: what stays is left on the device.
pub struct Revisions {
    #[cfg(feature = "gpu")]
    engines: Arc<Engines>,
    #[cfg(feature = "gpu")]
    kept: Option<device::Kept>,
}

impl Revisions {
    /// Render a pass by the engine that the plan's settings say: on processors in the current rayon pool. The bits are
    /// those of [`Engine::pass`].
    ///
    /// # Errors
    /// There is no such pass, or no such engine here, or the scene is not for the device, or that failed.
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
    /// The scene, and how it is rendered.
    #[must_use]
    pub fn planned(&self) -> &Planned {
        &self.planned
    }

    /// Render a pass: on processors in the current rayon pool. The bits depend on the engine's kind alone.
    ///
    /// # Errors
    /// There is no such pass, or the device failed.
    pub fn pass(&self, pass_index: u64) -> Result<PassImage, NotRendered> {
        let image = self.passes(&[pass_index])?.pop();
        image.ok_or_else(|| EngineError::Broke(format!("pass {pass_index} is missing")).into())
    }

    /// Render passes, together or one after the other. The bits of each are those that it has by itself.
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

    /// So many passes are best rendered together: several where a device has more to do by that.
    #[must_use]
    pub fn together(&self) -> usize {
        match &self.by {
            By::Processors => 1,
            #[cfg(feature = "gpu")]
            By::Device(passes) => passes.together(),
        }
    }
}

/// What a device must be like for [`check`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Where {
    /// It is somewhere else.
    #[default]
    Elsewhere,
    /// One of this machine: its number, or a part of its name; empty: the best.
    Here(String),
}

/// What passes take of a device's memory, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needed {
    /// The scene.
    pub world: u64,
    /// Photons, beams and what they are found by.
    pub photons: u64,
    /// Camera paths.
    pub paths: u64,
}

/// Whether devices can render passes of a scene, whatever engine its settings name, and what these take there.
///
/// # Errors
/// [`EngineError::Scene`] with all that keeps it from there; a device of this machine that was asked for and is not
/// there.
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

/// What one kernel of a device takes for a pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelTime {
    /// Its program and entry point.
    pub kernel: String,
    /// How often it is handed over, to no workgroup at times.
    pub dispatches: u64,
    /// All of them together, by the device's clock.
    pub seconds: f64,
}

/// What kernels of a device of this machine take for a pass, the longest first. Nothing of one without a clock.
///
/// # Errors
/// Those of [`Engines::engine`] and [`Engine::pass`].
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
    /// Its place in the list, from zero.
    pub number: usize,
    /// As its driver calls it.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: String,
    /// The driver's name and version.
    pub driver: String,
    /// Bytes of its memory, or of what it shares with the processor.
    pub memory: Option<u64>,
    /// How it did in its test, or why it cannot be used.
    pub test: Result<Test, String>,
}

/// A test that a device has passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// Its own division is exact; else kernels have theirs.
    pub native_division: bool,
    /// Its own roots are.
    pub native_roots: bool,
    /// What opening and testing it took.
    pub time: Duration,
}

/// The number of the card that is taken where none is named: the first of the best kind that lacks nothing.
///
/// # Errors
/// There is none: drivers in software have to be named.
pub fn best_card() -> Result<usize, EngineError> {
    let mut cards = cards()?.into_iter();
    cards
        .next()
        .ok_or_else(|| EngineError::NoDevice("no card was found".into()))
}

/// Numbers of all cards of this machine that lack nothing, the best first: not of drivers in software.
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
/// There is no Vulkan, or the program was built without.
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
