//! What gather rays beside one another, and surface photons seen on gloss, gain over one gather ray drawn by the BSDF,
//! as a Markdown table: `cargo run --release -p beamfarm-scene --example gloss -- SCENE.toml [PASSES [FIRST]]`, of a
//! scene with neither specular surfaces nor scattering media (with those, photons are seen on all surfaces).
//!
//! All ways take turns of a pass, so that whatever else the machine does meets all. Counted are pixels where the camera
//! sees gloss alone. `variance` is that of a pass, mean over the pixels, relative to the square of their mean plus
//! 0.01, as relMSE is; at equal time it is times the seconds of a pass. Gains above 1: better than one gather ray.
//! Everything but the times is the same on every machine.

use beamfarm_image::layer::Layer;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::Rgb;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::{BsdfFlags, Material, MaterialKind};
use beamfarm_render::world::texture::Texture;
use beamfarm_scene::read_bundle;
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
    let scene = Scene::new(beamfarm_scene::load(&read_bundle(path.as_ref())?)?);
    let seen = gloss(&scene, passes.min(4))?;
    let settings = scene.description().defaults.job_settings();
    let ways = [("one gather ray", 1), ("four", 2)];
    let mut modes = ways.map(|_| Moments::default());
    for pass_index in first..first + passes {
        for (mode, (_, side)) in modes.iter_mut().zip(ways) {
            let mut plan = RenderPlan::new(&scene, settings);
            plan.gloss_rays_side = side;
            let start = Instant::now();
            let image = render_pass(&scene, &plan, pass_index).expect("a pass");
            mode.seconds += start.elapsed().as_secs_f64();
            let values: Vec<f64> = image.film.pixels.iter().flatten().map(|v| f64::from(*v)).collect();
            mode.sums.resize(values.len(), [0.0; 2]);
            for ([sum, squares], value) in mode.sums.iter_mut().zip(values) {
                *sum += value;
                *squares += value * value;
            }
        }
    }
    let n = passes as f64;
    println!(
        "| gloss | mean | variance | s a pass | gain at equal passes | at equal time |\n| --- | --- | --- | --- | --- | --- |"
    );
    let [of_one, _] = modes[0].variance(n, &seen);
    for ((name, _), mode) in ways.iter().zip(&modes) {
        let [variance, mean] = mode.variance(n, &seen);
        let gain = of_one / variance;
        let seconds = mode.seconds / n;
        let at_equal_time = gain * modes[0].seconds / mode.seconds;
        println!("| {name} | {mean:.5} | {variance:.5} | {seconds:.4} | {gain:.2} | {at_equal_time:.2} |");
    }
    Ok(())
}

/// By value: whether it is of a pixel where the camera sees gloss alone: that of a scene where all such materials are
/// black.
fn gloss(scene: &Scene, passes: u64) -> Result<Vec<bool>, Box<dyn std::error::Error>> {
    let mut description = scene.description().clone();
    for material in &mut description.materials {
        let albedo = if material.has(BsdfFlags::GLOSSY) { 0.0 } else { 1.0 };
        let reflectance = Texture::Constant(Rgb::splat(albedo));
        *material = Material::new(MaterialKind::Diffuse { reflectance }, true);
    }
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
    let plan = plan.with_layers(&scene, &[Layer::Albedo])?;
    let mut seen = Vec::new();
    for pass_index in 0..passes {
        let image = render_pass(&scene, &plan, pass_index).expect("a pass");
        let albedo = &image.layers[0].pixels;
        seen.resize(albedo.len() * 3, true);
        for (seen, value) in seen.iter_mut().zip(albedo.iter().flatten()) {
            *seen &= *value == 0.0;
        }
    }
    Ok(seen)
}
