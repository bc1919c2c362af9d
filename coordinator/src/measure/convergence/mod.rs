//! `beamfarm convergence`: one pixel rendered many times, compared with the theory of convergence.

mod plot;

use crate::failure::Failure;
use crate::import::ImportArgs;
use crate::loaded::suits_device;
use crate::output::{make_folder, print_text};
use crate::settings::DeviceArgs;
use beamfarm_image::atomic::write_file;
use beamfarm_image::job::{EngineKind, JobSettings};
use beamfarm_render::cpu::convergence::{Moments, Prediction, Runs, Theory};
use beamfarm_render::world::{Scene, SceneDescription};
use beamfarm_scene::SceneFile;
use beamfarm_worker::engine::{Engines, Planned};
use beamfarm_worker::say;
use clap::Args;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm convergence scene.toml --pixel 256,190 -o study
  beamfarm convergence scene.toml --alpha 0.5 --passes 256 --runs 200 --paths 100
  beamfarm convergence scene.toml --engine gpu        the passes of a device with Vulkan

Writes convergence.csv, with mean and variance of every pass and of every running average over the
runs, and convergence.svg: measurements as dots, the theory as lines. The lines have two constants for
all alphas together, and without --truth a third, the limit. The pixel's value is the mean of its
channels. Few paths a pass are enough: they make passes quicker, and the laws stay the same.";

#[derive(Args)]
pub struct ConvergenceArgs {
    /// Scene file: TOML, Mitsuba 3 (.xml) or glTF (.glb, .gltf)
    scene: PathBuf,

    #[command(flatten)]
    import: ImportArgs,

    /// Which pixel, from the top left, counted from zero [default: the one in the middle]
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pixel: Option<[u32; 2]>,

    /// Values of alpha, each with runs of its own
    #[arg(long, value_name = "A,A", value_delimiter = ',', default_values_t = [0.1, 0.5, 0.9])]
    #[arg(help_heading = "Sampling")]
    alpha: Vec<f64>,

    /// Passes of a run
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(2..=1 << 20))]
    #[arg(help_heading = "Sampling")]
    passes: u64,

    /// Runs for each alpha
    #[arg(long, value_name = "K", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(2..=1 << 20))]
    #[arg(help_heading = "Sampling")]
    runs: u64,

    /// Photon paths that each pass emits [default: the scene's]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Sampling")]
    paths: Option<u32>,

    /// Seed of all runs [default: the scene's]
    #[arg(long, value_name = "S", help_heading = "Sampling")]
    seed: Option<u64>,

    /// What renders: cpu, or gpu for a device with Vulkan
    ///
    /// Passes of a device are other ones with the same expectation.
    #[arg(long, value_name = "ENGINE", default_value_t = EngineKind::Cpu, help_heading = "Device")]
    engine: EngineKind,

    #[command(flatten)]
    device: DeviceArgs,

    /// The pixel's true value, if it is known [default: extrapolated from the passes]
    #[arg(long, value_name = "L")]
    truth: Option<f64>,

    /// Folder for the results; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = ".", help_heading = "Output")]
    output: PathBuf,
}

fn pixel(text: &str) -> Result<[u32; 2], String> {
    let parse = || {
        let (x, y) = text.split_once(',')?;
        Some([x.trim().parse().ok()?, y.trim().parse().ok()?])
    };
    parse().ok_or_else(|| "expected X,Y".to_owned())
}

/// The most values of a study in memory.
const MAX_VALUES: u64 = 1 << 28;

/// Measured and expected values for one alpha, by pass.
struct Curves {
    alpha: f64,
    scales: Vec<f64>,
    passes: Vec<Moments>,
    averages: Vec<Moments>,
    theory: Vec<Prediction>,
}

pub fn main(args: ConvergenceArgs) -> Result<(), Failure> {
    let file = SceneFile::read(&args.scene, &args.import.options(&args.scene)?)?;
    let mut description = file.load()?;
    let camera = &mut description.camera;
    let [x, y] = args.pixel.unwrap_or([camera.width / 2, camera.height / 2]);
    if x >= camera.width || y >= camera.height {
        return Err(Failure::usage(format!(
            "--pixel: expected a pixel of the image, which has {} x {}",
            camera.width, camera.height
        )));
    }
    *camera = camera.pixel(x, y);
    if args.alpha.len() as u64 * args.passes * args.runs > MAX_VALUES {
        return Err(Failure::usage(format!(
            "--alpha, --passes, --runs: expected at most {MAX_VALUES} passes in all"
        )));
    }
    let defaults = description.defaults;
    let settings = |alpha| JobSettings {
        alpha,
        seed: args.seed.unwrap_or(defaults.seed),
        engine: args.engine,
        ..match args.paths {
            Some(paths_per_pass) => JobSettings {
                paths_per_pass,
                ..defaults.job_settings()
            },
            None => defaults.job_settings(),
        }
    };
    for &alpha in &args.alpha {
        settings(alpha).check().map_err(Failure::usage)?;
    }
    make_folder(&args.output)?;

    let all: Result<Vec<Runs>, Failure> = match args.engine {
        EngineKind::Cpu => {
            let scene = Scene::new(description);
            let render = |&alpha: &f64| Runs::render(&scene, settings(alpha), args.passes, args.runs);
            let all = args.alpha.iter().map(|alpha| render(alpha).map_err(Failure::job));
            all.collect()
        }
        EngineKind::Gpu => {
            let place = args.device.here();
            for &alpha in &args.alpha {
                suits_device(&description, settings(alpha), &[], &place)?;
            }
            let engines = Engines::new(args.device.gpu.as_deref().unwrap_or_default());
            let render = |&alpha: &f64| on_device(&engines, &description, settings(alpha), [args.passes, args.runs]);
            args.alpha.iter().map(render).collect()
        }
    };
    let all = all?;
    if all
        .iter()
        .flat_map(|runs| &runs.values)
        .flatten()
        .any(|v| !v.is_finite())
    {
        return Err(Failure::job("some values are not finite"));
    }
    let theory = Theory::fit(&all, args.truth);
    let results: Vec<Curves> = all
        .into_iter()
        .map(|runs| Curves {
            alpha: runs.alpha,
            passes: runs.of_passes(),
            averages: runs.averaged().of_passes(),
            theory: theory.predict(&runs.scales),
            scales: runs.scales,
        })
        .collect();
    say!(
        "limit {:.6e}{}, bias of the first pass {:+.2} % of it, standard deviation {:.2} %",
        theory.truth,
        if args.truth.is_some() { "" } else { " (extrapolated)" },
        100.0 * theory.bias / theory.truth,
        100.0 * theory.variance.sqrt() / theory.truth.abs(),
    );
    print_text(&table(&results, &theory, args.runs).to_string())?;
    write(&args.output.join("convergence.csv"), &csv(&results, &theory))?;
    let svg = plot::figure(&results, &theory).map_err(Failure::job)?;
    write(&args.output.join("convergence.svg"), &svg)
}

/// `passes` passes of each of `runs` runs on a device. Passes of a run are batched as the device prefers.
fn on_device(
    engines: &Engines,
    description: &SceneDescription,
    settings: JobSettings,
    [passes, runs]: [u64; 2],
) -> Result<Runs, Failure> {
    let run = |number: u64| {
        let scene = Scene::new(description.clone());
        let plan = Runs::plan(&scene, settings, number);
        let engine = engines.engine(Arc::new(Planned { scene, plan }))?;
        let indices: Vec<u64> = (0..passes).collect();
        let mut values = Vec::with_capacity(indices.len());
        for some in indices.chunks(engine.together().max(1)) {
            values.extend(engine.passes(some)?.iter().map(|image| Runs::value(&image.film)));
        }
        Ok::<_, Failure>(values)
    };
    let values: Result<_, Failure> = (0..runs).map(run).collect();
    Ok(Runs::of_values(&settings, values?))
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    write_file(path, text.as_bytes())?;
    say!("wrote {}", path.display());
    Ok(())
}

fn csv(results: &[Curves], theory: &Theory) -> String {
    let mut csv = String::from(
        "alpha,pass,radius_scale,variance,variance_theory,bias,bias_theory,\
         average_variance,average_variance_theory,average_bias,average_bias_theory\n",
    );
    for result in results {
        for (i, expected) in result.theory.iter().enumerate() {
            let (pass, average) = (result.passes[i], result.averages[i]);
            // Writing into a string cannot fail.
            let _ = writeln!(
                csv,
                "{},{},{:.9e},{:.6e},{:.6e},{:.6e},{:.6e},{:.6e},{:.6e},{:.6e},{:.6e}",
                result.alpha,
                i + 1,
                result.scales[i],
                pass.variance,
                expected.variance,
                pass.mean - theory.truth,
                expected.bias,
                average.variance,
                expected.average_variance,
                average.mean - theory.truth,
                expected.average_bias,
            );
        }
    }
    csv
}

/// Averages after 1, 4, 16, … passes and after all, measured relative to theory.
fn table(results: &[Curves], theory: &Theory, runs: u64) -> String {
    let mut table = String::from(
        "| alpha | passes | variance of the average over theory | bias of the average, % | theory, % |\n\
         |--:|--:|--:|--:|--:|\n",
    );
    for result in results {
        let n = result.theory.len();
        let steps = (0..32).map(|k| 1 << (2 * k)).take_while(|i| *i < n);
        for passes in steps.chain([n]) {
            let (found, expected) = (result.averages[passes - 1], result.theory[passes - 1]);
            let percent = 100.0 / theory.truth;
            let _ = writeln!(
                table,
                "| {} | {passes} | {:.3} ± {:.3} | {:+.3} ± {:.3} | {:+.3} |",
                result.alpha,
                found.variance / expected.average_variance,
                // For normally distributed values.
                (2.0 / (runs - 1) as f64).sqrt(),
                percent * (found.mean - theory.truth),
                percent.abs() * (found.variance / runs as f64).sqrt(),
                percent * expected.average_bias,
            );
        }
    }
    table
}
