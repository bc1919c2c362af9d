//! One run: a scene rendered with one configuration, in a separate process so that its memory can be measured.
//!
//! The parent writes a line of JSON, the [`Task`], and then an empty line whenever the next passes may start: nothing
//! else runs while they are timed. The child answers each with a line of JSON, the [`Sample`], and the pixels of the
//! image.

use super::overrides::{Overrides, load};
use crate::failure::Failure;
use crate::local::Shape;
use beamfarm_image::film::Film;
use beamfarm_image::job::{EngineKind, JobSettings, PassStats, ReferenceSettings, Techniques};
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_render::cpu::reference::render_sample;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_worker::engine::{Engine, Engines, KernelTime, Planned, kernel_times};
use beamfarm_worker::exit;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, mpsc};
use std::time::Instant;

/// The task of a child process.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Task {
    pub scene: PathBuf,
    pub overrides: Overrides,
    pub integrator: Integrator,
    /// As chosen by a pilot or given in the scene.
    pub paths_per_pass: u32,
    pub techniques: Techniques,
    pub passes: u64,
    /// No pass starts after this much rendering time.
    pub seconds: Option<f64>,
}

/// The integrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Passes of photon beams, as in `render`.
    #[default]
    Beams,
    /// Samples of the path tracer, as in `reference`.
    Paths,
}

/// Measurements after some passes. Counts are sums over these passes; times exclude measuring.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sample {
    pub passes: u64,
    /// Whether this is the last sample.
    pub is_last: bool,
    pub prepare_seconds: f64,
    pub wall_seconds: f64,
    pub core_seconds: Option<f64>,
    pub photon_paths: u64,
    pub beams: u64,
    pub beam_bytes: u64,
    pub beam_evaluations: u64,
    pub surface_photons: u64,
    /// Peak memory of the process so far.
    pub peak_memory_bytes: Option<u64>,
    /// The image's error as shown by `render`.
    pub estimated_relative_error: Option<f64>,
    /// The same as relMSE: mean of stderr^2 / (x^2 + 0.01).
    pub estimated_rel_mse: Option<f64>,
    /// In the last sample: time of a device's kernels in one more pass.
    pub kernels: Vec<KernelTime>,
}

/// The image after some passes.
pub struct Step {
    pub sample: Sample,
    pub image: Film,
}

/// Passes after which the image is measured: 1, 2, 4, … and the last.
pub fn checkpoints(passes: u64) -> impl Iterator<Item = u64> {
    let powers = (0..u64::BITS).map(|bit| 1 << bit);
    powers.take_while(move |power| *power < passes).chain([passes])
}

/// A running child.
pub struct Run {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    left: std::vec::IntoIter<u64>,
    size: [u32; 2],
}

impl Run {
    /// Start a child. `size`: width and height of its image in pixels.
    pub fn start(task: &Task, size: [u32; 2]) -> Result<Self, Failure> {
        let broken = |error: io::Error| Failure::io(format!("cannot start a run: {error}"));
        let program = std::env::current_exe().map_err(broken)?;
        let mut child = Command::new(program)
            .arg(CHILD)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(broken)?;
        let (Some(mut stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(broken(io::ErrorKind::BrokenPipe.into()));
        };
        let task_line = serde_json::to_string(task).map_err(Failure::io)?;
        writeln!(stdin, "{task_line}").map_err(broken)?;
        Ok(Self {
            child,
            stdin,
            stdout: BufReader::new(stdout),
            left: checkpoints(task.passes).collect::<Vec<_>>().into_iter(),
            size,
        })
    }

    fn step(&mut self) -> io::Result<Step> {
        writeln!(self.stdin)?;
        let mut line = String::new();
        self.stdout.read_line(&mut line)?;
        let sample = serde_json::from_str(&line)?;
        let [width, height] = self.size;
        let mut image = Film::new(width, height);
        for value in image.pixels.iter_mut().flatten() {
            let mut bytes = [0; 4];
            self.stdout.read_exact(&mut bytes)?;
            *value = f32::from_le_bytes(bytes);
        }
        Ok(Step { sample, image })
    }
}

impl Iterator for Run {
    type Item = Result<Step, Failure>;

    /// Render up to the next checkpoint.
    fn next(&mut self) -> Option<Self::Item> {
        self.left.next()?;
        let step = self.step();
        if step.as_ref().is_ok_and(|step| step.sample.is_last) {
            self.left = Vec::new().into_iter();
        }
        Some(step.map_err(|error| {
            self.left = Vec::new().into_iter();
            let _ = self.child.kill();
            match self.child.wait() {
                // The child has printed what was wrong.
                Ok(status) if status.code() == Some(exit::FAILED.into()) => Failure::job("the run failed"),
                Ok(status) => Failure::job(format!("the run broke off: {status}")),
                Err(_) => Failure::io(error),
            }
        }))
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // The child has nothing left to report.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Name of the hidden subcommand.
pub const CHILD: &str = "bench-run";

/// The child's main function.
pub fn child() -> Result<(), Failure> {
    let (lines, orders) = mpsc::channel();
    std::thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            if lines.send(line).is_err() {
                return;
            }
        }
        // The parent is gone.
        std::process::exit(exit::FAILED.into());
    });
    let gone = |_| Failure::io("the parent is gone");
    let task: Task = serde_json::from_str(&orders.recv().map_err(gone)?).map_err(Failure::usage)?;
    let begun = Instant::now();
    // Zero threads mean one per core.
    let threads = task.overrides.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(Failure::io)?;
    let (description, settings) = pool.install(|| load(&task.scene, &task.overrides))?;
    let settings = JobSettings {
        paths_per_pass: task.paths_per_pass,
        techniques: task.techniques,
        ..settings
    };
    let planned = pool.install(|| {
        let scene = Scene::new(description);
        let plan = RenderPlan::new(&scene, settings);
        Arc::new(Planned { scene, plan })
    });
    let gpu = task.overrides.gpu.as_deref().unwrap_or_default();
    let is_by_device = task.integrator == Integrator::Beams && settings.engine == EngineKind::Gpu;
    let engine = match task.integrator {
        Integrator::Beams => Some(Engines::new(gpu).engine(planned.clone())?),
        Integrator::Paths => None,
    };
    let threads = pool.current_num_threads();
    let shape = match is_by_device {
        true => Shape::on_device(None, None, threads),
        false => Shape::new(None, None, threads),
    };
    let together = engine.as_ref().map_or(1, Engine::together) as u64;
    let at_once = shape.passes_at_once() as u64 * together;
    let reference = ReferenceSettings {
        seed: settings.seed,
        max_depth: None,
    };
    let render = |indices: &[u64]| match &engine {
        Some(engine) => {
            let images = engine.passes(indices)?.into_iter();
            Ok(images.map(|image| (image.stats, image.film)).collect())
        }
        None => (indices.iter())
            .map(|index| render_sample(&planned.scene, &reference, *index, || true))
            .map(|film| film.map(|film| (PassStats::default(), film)))
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| Failure::job("a sample was not rendered")),
    };
    let camera = &planned.scene.description().camera;
    let mut sum = TreeSum::new(camera.width, camera.height);
    let mut stats = PassStats::default();
    let (mut wall, mut cores) = (0.0, cpu_seconds().map(|_| 0.0));
    let prepare_seconds = begun.elapsed().as_secs_f64();
    let mut pass_index = 0;
    for passes in checkpoints(task.passes) {
        orders.recv().map_err(gone)?;
        let (started, cpu_started) = (Instant::now(), cpu_seconds());
        let is_over = || (task.seconds).is_some_and(|seconds| wall + started.elapsed().as_secs_f64() >= seconds);
        while pass_index < passes && !(pass_index > 0 && is_over()) {
            let end = passes.min(pass_index + at_once);
            let indices: Vec<u64> = (pass_index..end).collect();
            let images: Vec<Result<Vec<_>, Failure>> =
                pool.install(|| indices.par_chunks(together as usize).map(render).collect());
            for (of_pass, film) in images.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
                stats += of_pass;
                sum.insert(Node::leaf(pass_index, film)).map_err(Failure::job)?;
                pass_index += 1;
            }
        }
        let is_last = is_over() || pass_index == task.passes;
        wall += started.elapsed().as_secs_f64();
        cores = cores
            .zip(cpu_seconds().zip(cpu_started))
            .map(|(cores, (now, then))| cores + (now - then));
        let Some(average) = sum.average() else {
            return Err(Failure::job("no pass is complete"));
        };
        let relative_error = average.relative_standard_error();
        let sample = Sample {
            passes: pass_index,
            is_last,
            prepare_seconds,
            wall_seconds: wall,
            core_seconds: cores,
            photon_paths: stats.paths,
            beams: stats.beams,
            beam_bytes: stats.beam_bytes,
            beam_evaluations: stats.beam_evaluations,
            surface_photons: stats.surface_photons,
            peak_memory_bytes: peak_memory(),
            estimated_relative_error: Some(relative_error).filter(|error| error.is_finite()),
            estimated_rel_mse: Some(estimated_rel_mse(&average)).filter(|error| error.is_finite()),
            kernels: match is_last && is_by_device {
                true => kernel_times(&planned, gpu, pass_index)?,
                false => Vec::new(),
            },
        };
        answer(&sample, &average.beauty).map_err(Failure::io)?;
        if is_last {
            break;
        }
    }
    // The parent ends this process after reading the last image.
    let _ = orders.recv();
    Ok(())
}

fn answer(sample: &Sample, image: &Film) -> io::Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    serde_json::to_writer(&mut out, sample)?;
    writeln!(out)?;
    for value in image.pixels.iter().flatten() {
        out.write_all(&value.to_le_bytes())?;
    }
    out.flush()
}

fn estimated_rel_mse(average: &Average) -> f64 {
    super::comparison::relative_noise(&average.beauty, &average.standard_error)
}

/// CPU time of this process over all its threads.
#[cfg(unix)]
pub fn cpu_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
}

#[cfg(not(unix))]
pub fn cpu_seconds() -> Option<f64> {
    None
}

/// Peak memory of this process. Not from getrusage, which on Linux starts at the parent's peak.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kibibytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_measured_whenever_their_passes_doubled() {
        let all = |passes| checkpoints(passes).collect::<Vec<_>>();
        assert_eq!(all(1), [1]);
        assert_eq!(all(2), [1, 2]);
        assert_eq!(all(8), [1, 2, 4, 8]);
        assert_eq!(all(11), [1, 2, 4, 8, 11]);
        assert_eq!(all(u64::MAX).len(), 65);
    }
}
