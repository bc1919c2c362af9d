//! `beamfarm bench`: error over time.

mod analysis;
mod comparison;
mod crops;
mod machine;
mod overrides;
mod plot;
mod record;
mod regret;
mod report;
mod run;
mod suite;
mod table;

pub use run::{CHILD, child};

use crate::failure::Failure;
use crate::output::make_folder;
use analysis::Clock;
use beamfarm_image::exr::read_rgb;
use beamfarm_image::job::MAX_PASSES;
use beamfarm_image::view::View;
use beamfarm_scene::read_bundle;
use beamfarm_worker::say;
use clap::Args;
use comparison::Reference;
use machine::Machine;
use overrides::{Overrides, chosen, load};
use record::{Findings, PeerFindings, Record, RunFindings, SceneFindings, Settings};
use run::{Integrator, Run, Task, checkpoints};
use std::path::PathBuf;
use suite::{Against, Peer, Point, RunCase, SceneCase, Suite};

pub const EXAMPLES: &str = "\
Examples:
  beamfarm bench scene.toml --reference ref.exr --passes 64
  beamfarm bench scene.toml --reference ref.exr --alpha 0.5 --paths 20000 --threads 1 -o half
  beamfarm bench scene.toml --reference ref.exr --against Other=other.exr,90,180
  beamfarm bench scene.toml --reference ref.exr --engine gpu --against cpu --seconds 60
  beamfarm bench a.toml b.toml --passes 16             no reference: times, counts and estimates
  beamfarm bench --suite scenes/peers/bench.toml       scenes, references, configurations, others
  beamfarm bench scene.toml --regret --seconds 10      the chosen plan against all others, in regret.csv";

pub const SUITES: &str = "\
A suite is a TOML file; what it names lies relative to it:

  title = \"Fog\"
  seconds = 10                    # runs end then, and all errors are reported at that time
  [[scenes]]
  scene = \"box.toml\"
  reference = \"box.exr\"           # EXR; its layer stderr tells its noise
  reference_noise = 2.5e-4        # or this: relMSE of the reference's own noise
  passes = 64
  crops = [[100, 80], [300, 200]] # left and top pixels of what the report shows large
  [[scenes.peers]]                # other renderers: [seconds, relMSE] or [seconds, relMSE, core-seconds],
  name = \"other, known figures\"
  points = [[1.0, 2.1e-2], [3.3, 7.8e-3]]
  [[scenes.peers]]                # or an image, which is compared with the reference
  name = \"another\"
  image = \"another.exr\"
  seconds = 90
  core_seconds = 180
  [[runs]]                        # configurations; without any, the scenes as they are
  name = \"alpha 0.5\"
  integrator = \"beams\"           # or \"paths\": the path tracer of `reference`
  scenes = [\"box\"]                # default: all
  passes = 32
  overrides = { alpha = 0.5, paths = 20000, radius = 0.01, schedule = \"beam\", seed = 1, threads = 1,
                width = 256, height = 256 }

Runs follow one another. Each is a process with all threads, which renders as many passes side by side as `render` does.
The image is measured after 1, 2, 4, ... passes and the last. Neither that nor the pilot counts in the times. Wall
seconds are those of rendering alone, core-seconds the CPU time of all threads. relMSE is the mean of
(x - ref)^2 / (ref^2 + 0.01); net relMSE is less the reference's own noise.

Writes bench.html (plots of error against time, times to an error, crops), bench.csv (a row for each run and number of
passes) and bench.json.";

#[derive(Args)]
pub struct BenchArgs {
    /// Scenes to render
    #[arg(required_unless_present = "suite")]
    scenes: Vec<PathBuf>,

    /// TOML file that says what to measure, in place of scenes
    #[arg(long, value_name = "BENCH.toml", conflicts_with_all = ["scenes", "reference", "reference_noise", "against"])]
    suite: Option<PathBuf>,

    /// Images to compare with, one for each scene in the same order
    #[arg(long, value_name = "REF.exr")]
    reference: Vec<PathBuf>,

    /// relMSE of the reference's own noise [default: from its layer stderr, if it has one]
    #[arg(long, value_name = "X", requires = "reference")]
    reference_noise: Option<f64>,

    /// Compare with the other engine, or with another renderer's image and its time; may be repeated
    #[arg(long, value_name = "cpu|gpu|[NAME=]OTHER.exr,SECONDS[,CORE-SECONDS]", value_parser = suite::against)]
    against: Vec<Against>,

    /// Passes of each run [default: the suite's or the scene's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_PASSES))]
    #[arg(help_heading = "Stopping")]
    passes: Option<u64>,

    /// Seconds of rendering after which each run ends [default: the suite's]
    ///
    /// All errors are reported at that time.
    #[arg(long, value_name = "S", help_heading = "Stopping")]
    seconds: Option<f64>,

    #[command(flatten)]
    overrides: Overrides,

    /// Folder to write into; made if it is not there
    #[arg(short, long, value_name = "FOLDER", default_value = "bench", help_heading = "Output")]
    output: PathBuf,

    /// Date to write into the files
    #[arg(long, value_name = "DATE", help_heading = "Output")]
    date: Option<String>,

    /// Measure how much worse the pilot's choice is than the best plan
    ///
    /// Every plan that the pilot considers renders for --seconds.
    #[arg(long, conflicts_with = "passes")]
    regret: bool,

    /// Print nothing but errors
    #[arg(short, long, help_heading = "Output")]
    quiet: bool,
}

pub fn main(args: BenchArgs) -> Result<(), Failure> {
    let (mut peers, mut engines) = (Vec::new(), Vec::new());
    for against in args.against {
        match against {
            Against::Peer(peer) => peers.push(peer),
            Against::Engine(engine) => engines.push(engine),
        }
    }
    if !peers.is_empty() && args.reference.is_empty() {
        return Err(Failure::usage("--against OTHER.exr: expected --reference as well"));
    }
    let mut suite = match &args.suite {
        Some(path) => Suite::read(path)?,
        None => Suite::plain(&args.scenes, &args.reference, args.reference_noise, &peers).map_err(Failure::usage)?,
    };
    let mut overrides = args.overrides;
    if !engines.is_empty() {
        engines.insert(0, overrides.engine.take().unwrap_or_default());
        suite.by_engines(&engines);
    }
    suite.set(args.passes, args.seconds, &overrides);
    suite.check().map_err(Failure::usage)?;
    make_folder(&args.output)?;

    if args.regret {
        return regret::main(&suite, &args.output, args.quiet);
    }
    // Check everything first, so that a misspelt name does not fail after an hour.
    let prepared = suite
        .scenes
        .iter()
        .map(|case| prepare(case, &suite.runs, suite.seconds));
    let prepared = prepared.collect::<Result<Vec<_>, _>>()?;
    let mut findings = Findings {
        title: suite.title,
        date: args.date,
        machine: Machine::this(),
        scenes: Vec::new(),
    };
    for (scene, tasks) in prepared {
        findings.scenes.push(scene);
        for (name, task, settings) in tasks {
            let Some(scene) = findings.scenes.last_mut() else {
                continue;
            };
            scene.runs.push(RunFindings {
                name,
                settings,
                records: Vec::new(),
                kernels: Vec::new(),
                images: Vec::new(),
            });
            render(scene, &task, args.quiet)?;
            // Write what is known so far, should a later run fail.
            findings.write_csv(&args.output.join("bench.csv"))?;
            findings.write_json(&args.output.join("bench.json"))?;
        }
    }
    findings.write_csv(&args.output.join("bench.csv"))?;
    findings.write_json(&args.output.join("bench.json"))?;
    let page = args.output.join("bench.html");
    report::write(&findings, &page)?;
    if !args.quiet {
        for scene in &findings.scenes {
            print_tables(scene);
        }
        if let Some(seconds) = suite.seconds {
            say!("\n{}", table::errors_at(&findings.scenes, seconds).plain());
        }
        say!("wrote {}, with bench.csv and bench.json beside it", page.display());
    }
    Ok(())
}

fn print_tables(scene: &SceneFindings) {
    say!("\n{}", scene.name);
    let tables = [table::times(scene, Clock::Wall), table::ratios(scene, Clock::Wall)];
    let kernels = scene.runs.iter().map(table::kernels);
    let tables = tables.into_iter().chain(kernels);
    for table in tables.filter(|table| !table.rows.is_empty()) {
        say!("{}", table.plain());
    }
}

type NamedTask = (String, Task, Settings);

/// Read what a scene needs, and list its runs.
fn prepare(
    case: &SceneCase,
    runs: &[RunCase],
    seconds: Option<f64>,
) -> Result<(SceneFindings, Vec<NamedTask>), Failure> {
    let mut tasks = Vec::new();
    let mut size = None;
    let mut view = View::default();
    for run in runs.iter().filter(|run| run.renders(&case.name)) {
        let (description, said) = load(&case.path, &run.overrides)?;
        let job_settings = match run.integrator {
            Integrator::Beams => chosen(&description, said, &run.overrides),
            Integrator::Paths => said,
        };
        let camera = &description.camera;
        let this = [camera.width, camera.height];
        let first = *size.get_or_insert(this);
        if case.reference.is_some() && first != this {
            return Err(Failure::usage(format!(
                "scene `{}`: run `{}` has {} x {} pixels, another one {} x {}; a reference has one size",
                case.name, run.name, this[0], this[1], first[0], first[1]
            )));
        }
        view = description.defaults.view;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let settings = Settings {
            width: this[0],
            height: this[1],
            paths_per_pass: job_settings.paths_per_pass,
            alpha: job_settings.alpha,
            schedule: job_settings.schedule.to_string(),
            seed: job_settings.seed,
            threads: run.overrides.threads.unwrap_or(cores as u16),
            overrides: run.overrides.clone(),
        };
        let task = Task {
            scene: case.path.clone(),
            overrides: run.overrides.clone(),
            integrator: run.integrator,
            paths_per_pass: job_settings.paths_per_pass,
            techniques: job_settings.techniques,
            // With a time limit only, the number of passes is unlimited.
            passes: run.passes.or(case.passes).unwrap_or(match seconds {
                Some(_) => MAX_PASSES,
                None => description.defaults.passes,
            }),
            seconds,
        };
        tasks.push((run.name.clone(), task, settings));
    }
    let size = match size {
        Some(size) => size,
        // Nothing is rendered, but peers may be compared.
        None => {
            let (description, _) = load(&case.path, &Overrides::default())?;
            view = description.defaults.view;
            [description.camera.width, description.camera.height]
        }
    };
    let reference = case.reference.as_ref();
    let reference = reference.map(|path| Reference::read(path, case.reference_noise, size));
    let reference = reference.transpose()?;
    let peers = case.peers.iter().map(|peer| measure_peer(peer, &reference));
    let findings = SceneFindings {
        name: case.name.clone(),
        hash: read_bundle(&case.path)?.hash().to_string(),
        view,
        crops: case.crops.clone(),
        peers: peers.collect::<Result<_, _>>()?,
        reference,
        runs: Vec::new(),
    };
    Ok((findings, tasks))
}

fn measure_peer(peer: &Peer, reference: &Option<Reference>) -> Result<PeerFindings, Failure> {
    let mut points = peer.points.clone();
    let image = match (&peer.image, reference) {
        (Some(image), Some(reference)) => {
            let film = read_rgb(&image.path).map_err(Failure::usage)?;
            let found = reference
                .compare(&film)
                .map_err(|error| Failure::usage(format!("{}: {error}", image.path.display())))?;
            points.push(Point {
                wall_seconds: image.wall_seconds,
                core_seconds: image.core_seconds,
                rel_mse: found.error(),
            });
            points.sort_by(|a, b| a.wall_seconds.total_cmp(&b.wall_seconds));
            Some((film, found))
        }
        _ => None,
    };
    points.retain(|point| point.rel_mse > 0.0);
    Ok(PeerFindings {
        name: peer.name.clone(),
        points,
        image,
    })
}

/// Perform the last run of a scene.
fn render(scene: &mut SceneFindings, task: &Task, quiet: bool) -> Result<(), Failure> {
    let Some(run) = scene.runs.last_mut() else {
        return Ok(());
    };
    if !quiet {
        match task.seconds {
            Some(seconds) => say!("{}, {}: {seconds} s", scene.name, run.name),
            None => say!("{}, {}: {} passes", scene.name, run.name, task.passes),
        }
    }
    let all: Vec<u64> = checkpoints(task.passes).collect();
    let shown = [all[0], all[all.len() / 2]];
    let size = [run.settings.width, run.settings.height];
    for step in Run::start(task, size)? {
        let step = step?;
        let found = match &scene.reference {
            Some(reference) => Some(reference.compare(&step.image).map_err(Failure::job)?),
            None => None,
        };
        let record = Record::new(&scene.name, &run.name, &run.settings, &step.sample, found);
        run.kernels = step.sample.kernels;
        if !quiet {
            let error = record.error().map_or("-".into(), |e| format!("{e:.3e}"));
            say!(
                "  {:>6} passes  {:>9.3} s  {:>9.3} core-s  relMSE {error}",
                record.passes,
                record.wall_seconds,
                record.core_seconds.unwrap_or(f64::NAN),
            );
        }
        if step.sample.is_last || shown.contains(&record.passes) {
            run.images.push((record.passes, step.image));
        }
        run.records.push(record);
    }
    Ok(())
}
