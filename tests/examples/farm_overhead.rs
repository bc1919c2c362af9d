//! What the farm costs: `cargo run --release -p beamfarm-tests --example farm_overhead -- target/release/beamfarm SCENE PASSES`.
//!
//! Runs `beamfarm render` with two worker processes of one thread, and the same passes in this process on two threads
//! without coordinator, network or images, in turns; the ratios of the pairs tell the overhead.

use beamfarm_shared::exr::pixel_hash;
use beamfarm_shared::merge::{Node, TreeSum};
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::radius::Schedule;
use beamfarm_shared::scene::{ImportOptions, SceneFile};
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

const PAIRS: usize = 7;
const THREADS: usize = 2;

fn main() -> Result<(), AnyError> {
    let mut args = std::env::args().skip(1);
    let usage = "expected the program, a scene and a number of passes";
    let program = args.next().ok_or(usage)?;
    let scene = args.next().ok_or(usage)?;
    let passes: u64 = args.next().ok_or(usage)?.parse()?;
    let folder = tempfile::tempdir()?;
    let output = folder.path().join("farm.exr");
    let mut ratios = Vec::new();
    for pair in 0..PAIRS {
        // Whoever begins may find a warmer or a cooler machine.
        let (farm, bare) = if pair.is_multiple_of(2) {
            let farm = by_farm(&program, &scene, passes, &output)?;
            (farm, in_process(Path::new(&scene), passes)?)
        } else {
            let bare = in_process(Path::new(&scene), passes)?;
            (by_farm(&program, &scene, passes, &output)?, bare)
        };
        if farm.1 != bare.1 {
            return Err(format!("the farm made pixels {}, this process {}", farm.1, bare.1).into());
        }
        println!(
            "{:.2} s with the farm, {:.2} s without: {:.3}",
            farm.0,
            bare.0,
            farm.0 / bare.0
        );
        ratios.push(farm.0 / bare.0);
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "median of {PAIRS} ratios {:.3}, from {:.3} to {:.3}",
        ratios[PAIRS / 2],
        ratios[0],
        ratios[PAIRS - 1]
    );
    Ok(())
}

/// Seconds, and the hash of the pixels.
fn by_farm(
    program: &str,
    scene: &str,
    passes: u64,
    output: &Path,
) -> Result<(f64, String), AnyError> {
    let begun = Instant::now();
    let run = Command::new(program)
        .args(["render", scene, "--passes", &passes.to_string()])
        .args(["--workers", &THREADS.to_string(), "--threads", "1", "-o"])
        .arg(output)
        .output()?;
    let seconds = begun.elapsed().as_secs_f64();
    let text = String::from_utf8_lossy(&run.stdout);
    let hash = text.lines().find_map(|line| line.strip_prefix("pixels "));
    let hash = hash.ok_or_else(|| String::from_utf8_lossy(&run.stderr).into_owned())?;
    Ok((seconds, hash.to_owned()))
}

/// The same by two threads of this process that take pass after pass.
fn in_process(scene: &Path, passes: u64) -> Result<(f64, String), AnyError> {
    let begun = Instant::now();
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
    Ok((begun.elapsed().as_secs_f64(), pixel_hash(&average.beauty)))
}
