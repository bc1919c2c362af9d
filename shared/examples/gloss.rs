//! What surface photons seen on gloss gain over gather rays alone, as a Markdown table:
//! `cargo run --release -p beamfarm-shared --features render --example gloss -- SCENE.toml [PASSES [FIRST]]`, of a scene with neither
//! specular surfaces nor scattering media (with those, photons are seen on all surfaces).
//!
//! Both ways take turns of a pass, with the same random numbers, so that whatever else the machine does meets both. Counted are
//! pixels where the camera sees gloss alone. `variance` is that of a pass, mean over the pixels, relative to the square of
//! their mean plus 0.01, as relMSE is; at equal time it is times the seconds of a pass. Above 1: photons are better.
//! Everything but the times is the same on every machine.

use beamfarm_shared::bsdf::{Material, MaterialKind};
use beamfarm_shared::math::Rgb;
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::scene::{SceneDescription, read_bundle};
use beamfarm_shared::texture::Texture;
use std::time::Instant;

/// By value: sum and sum of squares over the passes.
#[derive(Default)]
struct Moments {
    sums: Vec<[f64; 2]>,
    seconds: f64,
}

impl Moments {
    /// Mean relative variance and mean of a value.
    fn variance(&self, passes: f64, seen: &[bool]) -> [f64; 2] {
        let mut variance = 0.0;
        let mut total = 0.0;
        let mut count = 0.0;
        for ([sum, squares], _) in self.sums.iter().zip(seen).filter(|v| *v.1) {
            count += 1.0;
            let mean = sum / passes;
            let of_one = (squares - sum * mean) / (passes - 1.0);
            variance += of_one / (mean * mean + 0.01);
            total += mean;
        }
        [variance, total].map(|x| x / count)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let path = args.next().ok_or("expected a scene")?;
    let passes: u64 = args.next().map_or(Ok(32), |n| n.parse())?;
    let first: u64 = args.next().map_or(Ok(0), |n| n.parse())?;
    let scene = Scene::new(SceneDescription::load(&read_bundle(path.as_ref())?)?);
    let seen = gloss(&scene, passes.min(16));
    let settings = scene.description().defaults.job_settings();
    let mut modes = [Moments::default(), Moments::default()];
    for pass_index in first..first + passes {
        for (mode, photons) in modes.iter_mut().zip([false, true]) {
            let mut plan = RenderPlan::new(&scene, settings);
            plan.photons_on_gloss &= photons;
            let start = Instant::now();
            let image = render_pass(&scene, &plan, pass_index);
            mode.seconds += start.elapsed().as_secs_f64();
            let values: Vec<f64> = image
                .film
                .pixels
                .iter()
                .flatten()
                .map(|v| f64::from(*v))
                .collect();
            mode.sums.resize(values.len(), [0.0; 2]);
            for ([sum, squares], value) in mode.sums.iter_mut().zip(values) {
                *sum += value;
                *squares += value * value;
            }
        }
    }
    let n = passes as f64;
    println!("| indirect light of gloss | mean | variance | s a pass |\n| --- | --- | --- | --- |");
    let ways = ["gather rays", "gather rays and photons"];
    let moments = modes.map(|mode| (mode.variance(n, &seen), mode.seconds));
    for (name, ([variance, mean], seconds)) in ways.iter().zip(&moments) {
        let seconds = seconds / n;
        println!("| {name} | {mean:.5} | {variance:.5} | {seconds:.4} |");
    }
    let [alone, together] = moments.map(|([variance, _], seconds)| (variance, seconds));
    println!(
        "\nvariance ratio at equal rays {:.2}, at equal time {:.2}",
        alone.0 / together.0,
        alone.0 * alone.1 / (together.0 * together.1)
    );
    Ok(())
}

/// By value: whether it is of a pixel where the camera sees gloss alone. What such materials show goes when they are black.
fn gloss(scene: &Scene, passes: u64) -> Vec<bool> {
    let mut description = scene.description().clone();
    for material in &mut description.materials {
        if material.is_glossy() {
            let reflectance = Texture::Constant(Rgb::ZERO);
            *material = Material::new(MaterialKind::Diffuse { reflectance }, true);
        }
    }
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
    let mut seen = Vec::new();
    for pass_index in 0..passes {
        let film = render_pass(&scene, &plan, pass_index).film;
        seen.resize(film.pixels.len() * 3, true);
        for (seen, value) in seen.iter_mut().zip(film.pixels.iter().flatten()) {
            *seen &= *value == 0.0;
        }
    }
    seen
}
