//! What the farm costs: `cargo run --release -p beamfarm-tests --example farm_overhead -- target/release/beamfarm SCENE PASSES`.
//!
//! Runs `beamfarm serve`, with its job folder, and two worker processes of one thread, and the same passes in this
//! process on two threads without coordinator, network or images, in turns; the ratios of the pairs tell the overhead, of time and of the processors' time, which other programs on the
//! machine disturb less.
//!
//! The workers are this program too: the compiler makes other machine code of the renderer for each program, and that
//! would be measured with it.

use beamfarm_shared::exr::pixel_hash;
use beamfarm_shared::merge::{Node, TreeSum};
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::radius::Schedule;
use beamfarm_shared::scene::{ImportOptions, SceneFile};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

type AnyError = Box<dyn std::error::Error + Send + Sync>;

const PAIRS: usize = 7;
const THREADS: usize = 2;

fn main() -> Result<(), AnyError> {
    let mut args = std::env::args().skip(1);
    let usage = "expected the program, a scene and a number of passes";
    let program = args.next().ok_or(usage)?;
    if program == "worker" {
        return serve_as_worker(args.next().ok_or(usage)?);
    }
    let scene = args.next().ok_or(usage)?;
    let passes: u64 = args.next().ok_or(usage)?.parse()?;
    let folder = tempfile::tempdir()?;
    let output = folder.path().join("farm.exr");
    let mut ratios = Vec::new();
    let mut cpu_ratios = Vec::new();
    for pair in 0..PAIRS {
        // Whoever begins may find a warmer or a cooler machine.
        let (farm, bare) = if pair.is_multiple_of(2) {
            let farm = by_farm(&program, &scene, passes, &output)?;
            (farm, in_process(Path::new(&scene), passes)?)
        } else {
            let bare = in_process(Path::new(&scene), passes)?;
            (by_farm(&program, &scene, passes, &output)?, bare)
        };
        if farm.pixels != bare.pixels {
            let (farm, bare) = (farm.pixels, bare.pixels);
            return Err(format!("the farm made pixels {farm}, this process {bare}").into());
        }
        let ratio = farm.seconds / bare.seconds;
        let cpu_ratio = farm.cpu_seconds / bare.cpu_seconds;
        println!(
            "{:.2} s with the farm, {:.2} s without: {ratio:.3}; of the processors {:.2} s and {:.2} s: {cpu_ratio:.3}",
            farm.seconds, bare.seconds, farm.cpu_seconds, bare.cpu_seconds
        );
        ratios.push(ratio);
        cpu_ratios.push(cpu_ratio);
    }
    for (what, mut ratios) in [("time", ratios), ("the processors' time", cpu_ratios)] {
        ratios.sort_by(f64::total_cmp);
        println!(
            "{what}: median of {PAIRS} ratios {:.3}, from {:.3} to {:.3}",
            ratios[PAIRS / 2],
            ratios[0],
            ratios[PAIRS - 1]
        );
    }
    Ok(())
}

/// Render for this coordinator.
fn serve_as_worker(url: String) -> Result<(), AnyError> {
    let config = beamfarm_worker::Config {
        url,
        credentials: Default::default(),
        threads: 1,
        name: "overhead".into(),
        cache: None,
        patience: Duration::from_secs(10),
        grace: Duration::ZERO,
    };
    let (_drain, drain) = tokio::sync::watch::channel(false);
    let runtime = tokio::runtime::Runtime::new()?;
    runtime.block_on(beamfarm_worker::run(config, drain))?;
    Ok(())
}

/// What rendering took, and what it made.
struct Run {
    seconds: f64,
    cpu_seconds: f64,
    pixels: String,
}

/// CPU seconds of this process, and of those that it has waited for (Linux).
fn cpu_seconds() -> Result<f64, AnyError> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    let fields = text.rsplit(')').next().unwrap_or("").split_whitespace();
    let ticks = fields.skip(11).take(4).map(str::parse::<f64>);
    Ok(ticks.sum::<Result<f64, _>>()? / 100.0)
}

fn by_farm(program: &str, scene: &str, passes: u64, output: &Path) -> Result<Run, AnyError> {
    let (begun, before) = (Instant::now(), cpu_seconds()?);
    let mut coordinator = Command::new(program)
        .args(["serve", scene, "--passes", &passes.to_string()])
        .args(["--listen", "127.0.0.1:0", "-o"])
        .arg(output)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let mut said = BufReader::new(coordinator.stdout.take().ok_or("no stdout")?);
    let mut line = String::new();
    said.read_line(&mut line)?;
    let url = line.trim().rsplit(' ').next().unwrap_or_default();
    let start = |_| {
        let mut worker = Command::new(std::env::current_exe()?);
        worker.args(["worker", url]).spawn()
    };
    let mut workers: Vec<Child> = (0..THREADS).map(start).collect::<Result<_, _>>()?;
    let mut text = String::new();
    said.read_to_string(&mut text)?;
    coordinator.wait()?;
    for worker in &mut workers {
        worker.wait()?;
    }
    let seconds = begun.elapsed().as_secs_f64();
    std::fs::remove_dir_all(output.with_extension("job"))?;
    let hash = text.lines().find_map(|line| line.strip_prefix("pixels "));
    Ok(Run {
        seconds,
        cpu_seconds: cpu_seconds()? - before,
        pixels: hash.ok_or("no image")?.to_owned(),
    })
}

/// The same by two threads of this process that take pass after pass.
fn in_process(scene: &Path, passes: u64) -> Result<Run, AnyError> {
    let (begun, before) = (Instant::now(), cpu_seconds()?);
    let description = SceneFile::read(scene, &ImportOptions::default())?.load()?;
    let settings = description.defaults.job_settings();
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, settings);
    let schedule = Schedule::new(&settings);
    let camera = &scene.description().camera;
    let sum = Mutex::new(TreeSum::new(camera.width, camera.height));
    let next = AtomicU64::new(0);
    let work = || -> Result<(), AnyError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        loop {
            let pass = next.fetch_add(1, Ordering::Relaxed);
            if pass >= passes {
                return Ok(());
            }
            let image = pool.install(|| render_pass(&scene, &plan, pass));
            let node = Node::leaf(pass, image.film).with_radius_scale(schedule.scale(pass));
            sum.lock().map_err(|_| "a thread failed")?.insert(node)?;
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|_| scope.spawn(work)).collect();
        let mut joined = threads.into_iter().map(|thread| thread.join());
        joined.try_for_each(|ended| ended.map_err(|_| "a thread panicked")?)
    })?;
    let sum = sum.into_inner().map_err(|_| "a thread failed")?;
    let average = sum.average().ok_or("no passes")?;
    Ok(Run {
        seconds: begun.elapsed().as_secs_f64(),
        cpu_seconds: cpu_seconds()? - before,
        pixels: pixel_hash(&average.beauty),
    })
}
