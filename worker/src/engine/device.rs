//! Vulkan devices.

use super::{EngineError, Found, KernelTime, Needed, NotRendered, Planned, Test, Where};
use beamfarm_gpu::device::{Choice, Device, Kind, Listed, list};
use beamfarm_gpu::error::Error;
pub use beamfarm_gpu::pass::Kept;
use beamfarm_gpu::pass::{GpuPass, Memory};
use beamfarm_gpu::self_test::Tested;
use beamfarm_proto::Device as Described;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::{NoPass, PassImage};
use beamfarm_render::world::Scene;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Instant;

impl From<Error> for EngineError {
    fn from(error: Error) -> Self {
        match error {
            Error::NoVulkan
            | Error::Forked
            | Error::NoSuchDevice { .. }
            | Error::Missing { .. }
            | Error::Arithmetic { .. } => Self::NoDevice(error.to_string()),
            Error::Unsuitable { reasons, .. } => Self::Scene(vec![reasons]),
            error => Self::Broke(error.to_string()),
        }
    }
}

impl From<Error> for NotRendered {
    fn from(error: Error) -> Self {
        match error {
            Error::NoMoment { why, .. } => Self::Pass(NoPass::NoMoment(why)),
            error => Self::Machine(error.into()),
        }
    }
}

/// This machine's render device, opened on first use.
#[derive(Debug)]
pub struct Chosen {
    choice: Choice,
    tested: Mutex<Option<Arc<Tested>>>,
}

impl Chosen {
    pub fn new(gpu: &str) -> Self {
        Self {
            choice: Choice::parse(gpu),
            tested: Mutex::default(),
        }
    }

    /// Uploads a scene to it.
    pub fn passes(&self, planned: Arc<Planned>) -> Result<Passes, EngineError> {
        Passes::new(self.tested()?, planned)
    }

    /// Renders a pass of a scene similar to the previous one, some of whose data is still on the device.
    pub fn revised(
        &self,
        (scene, plan): (&Scene, &RenderPlan),
        pass_index: u64,
        kept: Option<Kept>,
    ) -> Result<(PassImage, Option<Kept>), NotRendered> {
        let tested = self.tested()?;
        let pass = GpuPass::of_revision(&tested, scene, plan, kept)?;
        let image = pass.render(pass_index)?;
        Ok((image, pass.keep()))
    }

    /// Its description.
    pub fn described(&self) -> Result<Described, EngineError> {
        let tested = self.tested()?;
        let listed = tested.device.listed();
        Ok(Described {
            name: listed.name.clone(),
            kind: listed.kind.to_string(),
            driver: listed.driver.clone(),
            memory: listed.memory,
        })
    }

    fn tested(&self) -> Result<Arc<Tested>, EngineError> {
        let mut known = self.tested.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(tested) = &*known {
            return Ok(tested.clone());
        }
        let tested = Arc::new(Tested::open(&self.choice)?);
        *known = Some(tested.clone());
        Ok(tested)
    }
}

type Rendered = thread::Result<Result<Vec<PassImage>, Error>>;

/// Passes that are wanted together, and where to send them.
type Order = (Vec<u64>, Sender<Rendered>);

/// A scene on a device. Its data lives in a separate thread that ends with this value, so that it can borrow the scene.
#[derive(Debug)]
pub struct Passes {
    orders: Sender<Order>,
    together: usize,
}

impl Passes {
    fn new(tested: Arc<Tested>, planned: Arc<Planned>) -> Result<Self, EngineError> {
        let (orders, wanted) = channel::<Order>();
        let (ready, is_ready) = channel();
        let work = move || {
            let largest = tested.device.largest_buffer();
            if let Err(error) = suits(&planned.scene, &planned.plan, largest) {
                let _ = ready.send(Err(error));
                return;
            }
            // Sending fails only if nobody waits.
            match GpuPass::new(&tested, &planned.scene, &planned.plan) {
                Ok(pass) => {
                    let _ = ready.send(Ok(pass.passes_together()));
                    let begin = |(indices, answer): Order| {
                        let begun = catch_unwind(AssertUnwindSafe(|| pass.begin(&indices)));
                        (begun, answer)
                    };
                    let mut next = None;
                    while let Some((begun, answer)) = next.take().or_else(|| wanted.recv().ok().map(begin)) {
                        // Submits the next waiting order before waiting for the current passes.
                        next = wanted.try_recv().ok().map(begin);
                        let rendered = begun.and_then(|begun| catch_unwind(AssertUnwindSafe(|| pass.end(begun?))));
                        let _ = answer.send(rendered);
                    }
                }
                Err(error) => drop(ready.send(Err(error.into()))),
            }
        };
        let broke = |message: String| EngineError::Broke(message);
        thread::Builder::new()
            .name("device".into())
            .spawn(work)
            .map_err(|error| broke(format!("no thread for the device: {error}")))?;
        match is_ready.recv() {
            Ok(ready) => ready.map(|together| Self { orders, together }),
            Err(_) => Err(broke("bringing the scene to the device panicked".into())),
        }
    }

    /// Number of passes that are best rendered together.
    pub fn together(&self) -> usize {
        self.together
    }

    /// Renders passes. A panic in the device's thread is resumed here.
    pub fn render(&self, indices: &[u64]) -> Result<Vec<PassImage>, NotRendered> {
        let ended = || NotRendered::Machine(EngineError::Broke("the device's thread has ended".into()));
        let (answer, rendered) = channel();
        self.orders.send((indices.to_vec(), answer)).map_err(|_| ended())?;
        match rendered.recv().map_err(|_| ended())? {
            Ok(rendered) => Ok(rendered?),
            Err(panic) => resume_unwind(panic),
        }
    }
}

/// All reasons why devices whose largest buffer has this many bytes cannot render a scene, as an error.
fn suits(scene: &Scene, plan: &RenderPlan, largest: u64) -> Result<(), EngineError> {
    let reasons = GpuPass::reasons(scene, plan, largest);
    match reasons.is_empty() {
        true => Ok(()),
        false => Err(EngineError::Scene(reasons.iter().map(ToString::to_string).collect())),
    }
}

pub fn check(scene: &Scene, plan: &RenderPlan, place: &Where) -> Result<Needed, EngineError> {
    let largest = match place {
        Where::Elsewhere => u64::MAX,
        Where::Here(gpu) => Device::open(&Choice::parse(gpu))?.largest_buffer(),
    };
    suits(scene, plan, largest)?;
    let Memory { world, photons, paths } = GpuPass::memory(scene, plan);
    Ok(Needed { world, photons, paths })
}

pub fn kernel_times(planned: &Planned, gpu: &str, pass_index: u64) -> Result<Vec<KernelTime>, EngineError> {
    let mut tested = Tested::open(&Choice::parse(gpu))?;
    if !tested.time_kernels() {
        return Ok(Vec::new());
    }
    let pass = GpuPass::new(&tested, &planned.scene, &planned.plan)?;
    // The first pass determines the room that passes need.
    pass.render(pass_index)?;
    drop(tested.device.kernel_times());
    pass.render(pass_index)?;
    let times = tested.device.kernel_times().into_iter();
    Ok(times
        .map(|time| KernelTime {
            kernel: time.kernel,
            dispatches: time.dispatches,
            seconds: time.time.as_secs_f64(),
        })
        .collect())
}

pub fn cards() -> Result<Vec<usize>, EngineError> {
    real(list()?).map_err(EngineError::NoDevice)
}

/// Devices other than software drivers, the best first; the error lists what there is.
fn real(mut all: Vec<Listed>) -> Result<Vec<usize>, String> {
    all.sort_by_key(|listed| (listed.kind, listed.number));
    let is_real = |listed: &&Listed| matches!(listed.kind, Kind::Discrete | Kind::Integrated | Kind::Virtual);
    let complete = all.iter().filter(is_real).filter(|listed| listed.missing.is_empty());
    let numbers: Vec<usize> = complete.map(|listed| listed.number).collect();
    if !numbers.is_empty() {
        return Ok(numbers);
    }
    let there: Vec<String> = all
        .iter()
        .map(|listed| match listed.missing.is_empty() {
            true => format!("{} is {}", listed.name, listed.kind),
            false => format!("{} lacks {}", listed.name, listed.missing.join(", ")),
        })
        .collect();
    Err(format!(
        "there is no card here that can be used, and what is none has to be named by --gpu: {}",
        there.join("; ")
    ))
}

pub fn all() -> Result<Vec<Found>, EngineError> {
    let found = list()?.into_iter().map(|listed| {
        let test = test(&listed);
        Found {
            number: listed.number,
            name: listed.name,
            kind: listed.kind.to_string(),
            driver: listed.driver,
            memory: listed.memory,
            test,
        }
    });
    Ok(found.collect())
}

fn test(listed: &Listed) -> Result<Test, String> {
    if !listed.missing.is_empty() {
        return Err(format!("lacks {}", listed.missing.join(", ")));
    }
    let begun = Instant::now();
    let tested = Tested::open(&Choice::Number(listed.number)).map_err(|error| error.to_string())?;
    Ok(Test {
        native_division: tested.arithmetic.native_quotient,
        native_roots: tested.arithmetic.native_root,
        time: begun.elapsed(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::bundle::Bundle;

    fn device() -> String {
        "llvmpipe".into()
    }

    #[test]
    fn cards_are_what_is_no_program() {
        let listed = |number, name: &str, kind, missing: &[&'static str]| Listed {
            number,
            name: name.into(),
            kind,
            driver: String::new(),
            memory: None,
            missing: missing.to_vec(),
        };
        let software = listed(0, "llvmpipe", Kind::Software, &[]);
        let old = listed(1, "Old Card", Kind::Discrete, &["Vulkan 1.2"]);
        let all = [
            software.clone(),
            old.clone(),
            listed(2, "Chip", Kind::Integrated, &[]),
            listed(3, "Card", Kind::Discrete, &[]),
            listed(4, "Card", Kind::Discrete, &[]),
        ];
        assert_eq!(real(all.into()), Ok(vec![3, 4, 2]));
        let why = real(vec![software, old]).unwrap_err();
        assert!(
            why.ends_with("Old Card lacks Vulkan 1.2; llvmpipe is software"),
            "{why}"
        );
    }

    /// A machine without a device need not try again; a device that fails may succeed the next time, or another one
    /// may.
    #[test]
    fn what_is_not_there_is_told_from_what_fails() {
        let why = "the ball has burst".to_owned();
        let nowhere = NotRendered::from(Error::NoMoment {
            pass: 4,
            why: why.clone(),
        });
        assert_eq!(nowhere, NotRendered::Pass(NoPass::NoMoment(why)));
        let missing = Error::Missing {
            device: device(),
            features: "Vulkan 1.2".into(),
        };
        for error in [Error::NoVulkan, missing] {
            let text = error.to_string();
            assert_eq!(EngineError::from(error), EngineError::NoDevice(text));
        }
        let (what, reason) = ("film".to_owned(), "12 bytes".to_owned());
        let errors = [
            Error::OutOfMemory {
                device: device(),
                what,
                reason: reason.clone(),
            },
            Error::Lost {
                device: device(),
                reason: reason.clone(),
            },
            Error::TimedOut {
                device: device(),
                seconds: 60,
            },
            Error::Kernel {
                kernel: "paths".into(),
                reason,
            },
        ];
        for error in errors {
            let text = error.to_string();
            assert_eq!(text.lines().count(), 1);
            assert_eq!(EngineError::from(error), EngineError::Broke(text));
        }
    }

    /// Passes requested together arrive in the requested order.
    #[test]
    fn passes_come_in_the_order_in_which_they_are_asked_for() {
        let text = "
            image = { width = 8, height = 8 }
            render = { engine = \"gpu\" }
            camera = { origin = [0, 0, 0], target = [0, 0, -1], fov = 50 }
            shapes = [{ type = \"sphere\", center = [0, 0, -3], radius = 1, material = \"grey\" }]
            lights = [{ type = \"point\", position = [1, 2, 0], intensity = 3 }]
            [materials.grey]
            type = \"diffuse\"";
        let bundle = Bundle {
            scene: "ball.toml".into(),
            files: [("ball.toml".into(), text.into())].into(),
        };
        let scene = Scene::new(beamfarm_scene::load(&bundle).unwrap());
        let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
        let passes = match Chosen::new("").passes(Arc::new(Planned { scene, plan })) {
            Ok(passes) => passes,
            Err(EngineError::NoDevice(why)) => return println!("not tried: {why}"),
            Err(error) => panic!("{error}"),
        };
        let indices = [4, 1, 2];
        let together = passes.render(&indices).unwrap();
        assert_eq!(together.len(), 3);
        for (index, image) in indices.into_iter().zip(together) {
            let alone = passes.render(&[index]).unwrap();
            assert!(image.film.pixels == alone[0].film.pixels, "{index}");
        }
        assert!(passes.render(&[]).unwrap().is_empty());
    }

    #[test]
    fn nobody_waits_for_a_thread_that_has_ended() {
        let (orders, wanted) = channel();
        let passes = Passes { orders, together: 1 };
        let end = thread::spawn(move || drop(wanted.recv()));
        // The first ends with the thread; the second finds none.
        for _ in 0..2 {
            let ended = EngineError::Broke("the device's thread has ended".into());
            assert_eq!(passes.render(&[0]).err(), Some(NotRendered::Machine(ended)));
        }
        end.join().expect("it does not panic");
    }
}
