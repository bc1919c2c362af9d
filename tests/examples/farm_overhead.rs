//! What the farm costs: `cargo run --release -p beamfarm-tests --example farm_overhead -- target/release/beamfarm SCENE
//! PASSES`.
//!
//! Three ways take turns: `beamfarm serve`, with its job folder, and two worker processes of one thread; two processes
//! that render every second pass each, without coordinator, network or images; and two threads of one process. The
//! first over the second is the cost of the farm, the second over the third that of not sharing memory. CPU time is
//! less disturbed by other programs; the standard error of a mean tells how far to trust it.
//!
//! All renderers are this program, started anew for each run: the compiler generates different machine code for the
//! renderer in each program, and memory that a process has used before is faster, and either effect would be attributed
//! to the farm.

use beamfarm_image::exr::pixel_hash;
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_scene::{ImportOptions, SceneFile};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

type AnyError = Box<dyn std::error::Error + Send + Sync>;

const TURNS: usize = 6;
const THREADS: usize = 2;

fn main() -> Result<(), AnyError> {
    let mut args = std::env::args().skip(1);
    let usage = "expected the program, a scene and a number of passes";
    let program = args.next().ok_or(usage)?;
    if program == "worker" {
        return serve_as_worker(args.next().ok_or(usage)?);
    }
    if program == "bare" {
        let mut number = || -> Result<u64, AnyError> { Ok(args.next().ok_or(usage)?.parse()?) };
        let (first, step, passes) = (number()?, number()?, number()?);
        let scene = args.next().ok_or(usage)?;
        return render_here(Path::new(&scene), first, step, passes);
    }
    let scene = args.next().ok_or(usage)?;
    let passes: u64 = args.next().ok_or(usage)?.parse()?;
    let folder = tempfile::tempdir()?;
    let output = folder.path().join("farm.exr");
    let mut ratios: [Vec<f64>; 4] = Default::default();
    for turn in 0..TURNS {
        let farm = by_farm(&program, &scene, passes, &output)?;
        let processes = bare(&scene, passes, THREADS)?;
        let threads = bare(&scene, passes, 1)?;
        if farm.pixels != threads.pixels {
            let (farm, bare) = (farm.pixels, threads.pixels);
            return Err(format!("the farm made pixels {farm}, one process {bare}").into());
        }
        let runs = [farm, processes, threads];
        let seconds = runs.each_ref().map(|run| run.seconds);
        let cpu = runs.each_ref().map(|run| run.cpu_seconds);
        println!("turn {turn}: farm, two processes, one process: {seconds:.2?} s, of the processors {cpu:.2?} s");
        let of_turn = [
            seconds[0] / seconds[1],
            cpu[0] / cpu[1],
            seconds[1] / seconds[2],
            cpu[1] / cpu[2],
        ];
        for (ratios, ratio) in ratios.iter_mut().zip(of_turn) {
            ratios.push(ratio);
        }
    }
    let names = [
        "farm over two processes, time",
        "farm over two processes, the processors' time",
        "two processes over two threads of one, time",
        "two processes over two threads of one, the processors' time",
    ];
    for (what, ratios) in names.into_iter().zip(ratios) {
        let count = TURNS as f64;
        let mean = ratios.iter().sum::<f64>() / count;
        let off = ratios.iter().map(|ratio| ratio - mean);
        let squares = off.map(|off| off * off).sum::<f64>();
        let standard_error = (squares / (count - 1.0) / count).sqrt();
        println!("{what}: {mean:.3} (standard error {standard_error:.3}, {TURNS} turns)");
    }
    Ok(())
}

/// Renders for this coordinator.
fn serve_as_worker(url: String) -> Result<(), AnyError> {
    let config = beamfarm_worker::Config {
        url,
        credentials: Default::default(),
        threads: 1,
        at_once: None,
        name: "overhead".into(),
        state: None,
        cache: None,
        patience: Duration::from_secs(10),
        grace: Duration::ZERO,
    };
    let (_drain, drain) = tokio::sync::watch::channel(false);
    let runtime = tokio::runtime::Runtime::new()?;
    runtime.block_on(beamfarm_worker::run(
        config,
        beamfarm_worker::offer::Offered::processors(),
        drain,
    ))?;
    Ok(())
}

/// Cost and result of a run.
struct Run {
    seconds: f64,
    cpu_seconds: f64,
    pixels: String,
}

/// CPU seconds of this process and of its finished children (Linux).
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
        // Like `render`, which trusts its own workers: audited passes are no overhead of the farm.
        .args(["--listen", "127.0.0.1:0", "--audit-share", "0", "-o"])
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

/// The same without a farm, with this many processes that have [`THREADS`] threads in all.
fn bare(scene: &str, passes: u64, processes: usize) -> Result<Run, AnyError> {
    let (begun, before) = (Instant::now(), cpu_seconds()?);
    let start = |first: usize| {
        let [first, step, passes] = [first as u64, processes as u64, passes].map(|n| n.to_string());
        Command::new(std::env::current_exe()?)
            .args(["bare", &first, &step, &passes, scene])
            .stdout(Stdio::piped())
            .spawn()
    };
    let started: Vec<Child> = (0..processes).map(start).collect::<Result<_, _>>()?;
    let mut pixels = String::new();
    for process in started {
        let made = process.wait_with_output()?;
        if !made.status.success() {
            return Err("a process without a farm failed".into());
        }
        pixels = String::from_utf8(made.stdout)?.trim().to_owned();
    }
    Ok(Run {
        seconds: begun.elapsed().as_secs_f64(),
        cpu_seconds: cpu_seconds()? - before,
        pixels,
    })
}

/// Renders every `step`th pass with this process's share of the threads. If it renders all passes, it prints the hash
/// of their average.
fn render_here(scene: &Path, first: u64, step: u64, passes: u64) -> Result<(), AnyError> {
    let description = SceneFile::read(scene, &ImportOptions::default())?.load()?;
    let settings = description.defaults.job_settings();
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, settings);
    let camera = &scene.description().camera;
    let sum = Mutex::new(TreeSum::new(camera.width, camera.height));
    let next = AtomicU64::new(first);
    let work = || -> Result<(), AnyError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        loop {
            let pass = next.fetch_add(step, Ordering::Relaxed);
            if pass >= passes {
                return Ok(());
            }
            let image = pool.install(|| render_pass(&scene, &plan, pass).expect("a pass"));
            let node = Node::leaf(pass, image.film).with_radius_scale(image.radius_scale);
            sum.lock().map_err(|_| "a thread failed")?.insert(node)?;
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS / step as usize).map(|_| scope.spawn(work)).collect();
        let mut joined = threads.into_iter().map(|thread| thread.join());
        joined.try_for_each(|ended| ended.map_err(|_| "a thread panicked")?)
    })?;
    let sum = sum.into_inner().map_err(|_| "a thread failed")?;
    if let Some(average) = sum.average() {
        println!("{}", pixel_hash(&average.beauty));
    }
    Ok(())
}
