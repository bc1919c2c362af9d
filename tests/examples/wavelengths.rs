//! How many wavelengths a pass should have, and what dispersion costs.
//!
//! ```text
//! cargo run --release -p beamfarm-tests --example wavelengths -- SCENE.toml REFERENCE.exr PASSES SCALE [TWIN.exr]
//! ```
//!
//! The program averages passes with 1, 2, 4, 8, 16 and 32 wavelengths, compares them with a reference, and prints the
//! relMSE of the luminance and of the channels, and the time. With a twin, a reference of the same scene with indices
//! that do not depend on wavelength, it renders that scene as well.

use beamfarm_image::exr::read_rgb;
use beamfarm_image::film::Film;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::{Material, MaterialDescription};
use beamfarm_scene::{Edits, ImportOptions, SceneFile};
use std::path::Path;
use std::time::Instant;

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let mut args = std::env::args().skip(1);
    let usage = "expected SCENE.toml REFERENCE.exr PASSES SCALE [TWIN.exr]";
    let mut next = || args.next().ok_or(usage);
    let (path, reference, passes, scale) = (next()?, next()?, next()?.parse()?, next()?.parse()?);
    let twin = args.next();
    let options = ImportOptions {
        edits: Edits {
            scale: Some(scale),
            ..Edits::default()
        },
        ..ImportOptions::default()
    };
    let description = SceneFile::read(Path::new(&path), &options)?.load()?;
    let mut grey = description.clone();
    grey.materials.iter_mut().for_each(even);
    let scene = Scene::new(description);
    let truth = read_rgb(Path::new(&reference))?;
    for waves in [1, 2, 4, 8, 16, 32] {
        report(&format!("{waves} wavelengths"), &scene, waves, passes, &truth);
    }
    if let Some(twin) = twin {
        report("twin", &Scene::new(grey), 0, passes, &read_rgb(Path::new(&twin))?);
    }
    Ok(())
}

/// The same index for all wavelengths.
fn even(material: &mut Material) {
    *material = Material::from(MaterialDescription {
        dispersion: None,
        ..material.clone().into()
    });
}

fn report(name: &str, scene: &Scene, waves: u8, passes: u64, truth: &Film) {
    let mut settings = scene.description().defaults.job_settings();
    settings.seed = 77;
    let mut plan = RenderPlan::new(scene, settings);
    plan.waves = waves;
    let start = Instant::now();
    let mut sum = vec![[0.0f64; 3]; truth.pixels.len()];
    for pass_index in 0..passes {
        let film = render_pass(scene, &plan, pass_index).expect("a pass").film;
        for (sum, pixel) in sum.iter_mut().zip(&film.pixels) {
            for c in 0..3 {
                sum[c] += f64::from(pixel[c]) / passes as f64;
            }
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    let luminance = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (mut of_luminance, mut of_channels) = (Vec::new(), Vec::new());
    for (found, truth) in sum.iter().zip(&truth.pixels) {
        let truth = truth.map(f64::from);
        let y = luminance(truth);
        let off = luminance(*found) - y;
        of_luminance.push(off * off / (y * y + 1e-4));
        let off: f64 = (0..3).map(|c| (found[c] - truth[c]) * (found[c] - truth[c])).sum();
        of_channels.push(off / 3.0 / (y * y + 1e-4));
    }
    let [of_luminance, of_channels] = [of_luminance, of_channels].map(trimmed_mean);
    println!("{name:>14}: relMSE of luminance {of_luminance:.5}, of channels {of_channels:.5}, {seconds:.1} s");
}

/// Without the largest thousandth, which is noise of a few pixels of the reference.
fn trimmed_mean(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let kept = values.len() - values.len() / 1000;
    values[..kept].iter().sum::<f64>() / kept as f64
}
