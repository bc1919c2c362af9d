//! What radii for a known number of passes gain over those that shrink from pass to pass:
//! `cargo run --release -p beamfarm-scene --example budget -- SCENE.toml REFERENCE.exr PASSES [SEEDS]`
//!
//! The image is rendered in the size of the reference, by both, and by constant scales a quarter and a half of an
//! octave or more from the one that the pilot chooses. Printed are relMSE, mean over the seeds, and its ratio to that
//! of radii that shrink; and the seconds of the pilot and of the passes. All but the times is the same on every
//! machine.

use beamfarm_image::exr::read_rgb;
use beamfarm_image::job::{Budget, JobSettings};
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_image::metrics::compare;
use beamfarm_render::cpu::pass::{Cpu, render_pass};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::budget::Pilot;
use beamfarm_render::world::Scene;
use beamfarm_scene::read_bundle;
use std::time::Instant;

/// Factors of the chosen scale that are tried beside it.
const FACTORS: [f64; 4] = [0.35, 0.6, 1.0, 1.67];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = || args.next().ok_or("expected a scene, a reference and passes");
    let path = next()?;
    let reference = read_rgb(next()?.as_ref())?;
    let passes: u64 = next()?.parse()?;
    let seeds: u64 = args.next().map_or(Ok(1), |n| n.parse())?;
    let mut description = beamfarm_scene::load(&read_bundle(path.as_ref())?)?;
    description.camera.width = reference.width;
    description.camera.height = reference.height;
    let settings = description.defaults.job_settings();
    let begun = Instant::now();
    let pilot = Pilot::new(&Cpu, &description, settings);
    let seconds = begun.elapsed().as_secs_f64();
    let chosen = pilot.budget(passes);
    println!("{pilot:?}: {chosen}; pilot {seconds:.2} s");
    let scene = Scene::new(description);
    let mut shrinking = 0.0;
    let budgets = FACTORS.map(|factor| {
        let scale = chosen.scale * factor;
        Some(Budget { scale, ..chosen })
    });
    for budget in [None].into_iter().chain(budgets) {
        let (mut error, mut seconds) = (0.0, 0.0);
        for seed in 0..seeds {
            let settings = JobSettings {
                budget,
                seed: settings.seed + seed,
                ..settings
            };
            let begun = Instant::now();
            let plan = RenderPlan::new(&scene, settings);
            let mut sum = TreeSum::new(reference.width, reference.height);
            for pass_index in 0..passes {
                let film = render_pass(&scene, &plan, pass_index).expect("a pass").film;
                sum.insert(Node::leaf(pass_index, film))?;
            }
            let average = sum.average().ok_or("no passes")?;
            seconds += begun.elapsed().as_secs_f64() / seeds as f64;
            error += compare(&average.beauty, &reference)?.rel_mse / seeds as f64;
        }
        match budget {
            None => {
                shrinking = error;
                println!("shrinking: {error:.3e}, {seconds:.1} s");
            }
            Some(Budget { scale, .. }) => println!(
                "scale {scale:.3}: {error:.3e}, {:.3} of it (pilot expects {:.3e}), {seconds:.1} s",
                error / shrinking,
                pilot.error(passes, scale)
            ),
        }
    }
    Ok(())
}
