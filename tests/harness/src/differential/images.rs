//! Independent images of a scene by both renderers, and the statistics kept of them.

use beamfarm_image::film::Film;
use beamfarm_image::job::{JobSettings, ReferenceSettings};
use beamfarm_image::layer::Layer;
use beamfarm_render::cpu::pass::{Cpu, render_pass};
use beamfarm_render::cpu::reference::{SampleLayers, render_sample_with_layers};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::aov::light_layers;
use beamfarm_render::plan::pilot::{Choice, Question};
use beamfarm_render::world::Scene;
use std::time::Instant;

use crate::MeanEstimate;

/// Pixels along the side of a block.
pub const BLOCK: usize = 8;

/// How many images of a scene, and from which random numbers.
#[derive(Clone, Copy, Debug)]
pub struct Draws {
    /// Seed of both renderers.
    pub seed: u64,
    /// Images by each renderer.
    pub images: u64,
    /// Index of the first pass: radii shrink with it.
    pub first_pass: u64,
    /// The path tracer's samples per image.
    pub samples: u64,
}

/// What is compared: the beauty and its parts.
pub const LAYERS_BEFORE_LIGHTS: usize = 3;

/// Images of one renderer.
#[derive(Clone, Debug)]
pub struct Images {
    /// Means by part of the beauty (itself, direct and surface, volume, each group of lights), then by cell (the whole
    /// image first, then blocks), then by image.
    pub means: Vec<Vec<Vec<[f32; 3]>>>,
    /// The beauty, by pixel.
    pub pixels: Vec<[MeanEstimate; 3]>,
    /// Wall time of all of them.
    pub seconds: f64,
    /// Their approximate cost, in samples of the path tracer. Verdicts based on time would vary from run to run.
    pub work: f64,
    /// Width of the picture in blocks.
    pub columns: usize,
}

fn layers(scene: &Scene) -> Vec<Layer> {
    let mut layers = vec![Layer::Direct, Layer::Surface, Layer::Volume];
    let lights = light_layers(scene.description());
    if lights.len() > 1 {
        layers.extend(lights);
    }
    layers
}

/// Names of the compared parts.
pub fn part_names(scene: &Scene) -> Vec<String> {
    let lights = layers(scene).into_iter().skip(LAYERS_BEFORE_LIGHTS);
    let own = ["beauty", "direct + surface", "volume"].map(str::to_owned);
    own.into_iter().chain(lights.map(|layer| layer.to_string())).collect()
}

impl Images {
    /// Images from passes, planned as by a pilot.
    ///
    /// # Panics
    /// When the layers are not those of the scene.
    pub fn of_passes(scene: &Scene, draws: &Draws) -> Self {
        let defaults = &scene.description().defaults;
        let settings = JobSettings {
            seed: draws.seed,
            ..defaults.job_settings()
        };
        let choice = Choice::new(
            &Cpu,
            scene.description(),
            Question::new(settings, defaults.paths_per_pass),
        );
        let settings = choice.map_or(settings, |choice| choice.settings());
        let layers = layers(scene);
        let started = Instant::now();
        let plan = match RenderPlan::new(scene, settings).with_layers(scene, &layers) {
            Ok(plan) => plan,
            Err(error) => panic!("{error}"),
        };
        let mut images = Self::new(scene, layers.len());
        for pass in draws.first_pass..draws.first_pass + draws.images {
            let image = render_pass(scene, &plan, pass).expect("a pass");
            images.add(&image.film, &image.layers);
        }
        images.seconds = started.elapsed().as_secs_f64();
        let samples_of_pass = if plan.has_photons() { 5.0 } else { 1.0 };
        images.work = samples_of_pass * draws.images as f64;
        images
    }

    /// Images from the path tracer.
    ///
    /// # Panics
    /// When the layers are not those of the scene.
    pub fn of_reference(scene: &Scene, draws: &Draws) -> Self {
        let settings = ReferenceSettings {
            seed: draws.seed,
            max_depth: None,
        };
        let layers = layers(scene);
        let started = Instant::now();
        let sampled = match SampleLayers::new(scene, &layers) {
            Ok(layers) => layers,
            Err(error) => panic!("{error}"),
        };
        let camera = &scene.description().camera;
        let mut images = Self::new(scene, layers.len());
        for image in 0..draws.images {
            let mut sums = vec![Film::new(camera.width, camera.height); 1 + layers.len()];
            for sample in image * draws.samples..(image + 1) * draws.samples {
                let found = render_sample_with_layers(scene, &settings, &sampled, sample, || true);
                let films = found.iter().flat_map(|f| [&f.film].into_iter().chain(&f.layers));
                for (sum, film) in sums.iter_mut().zip(films) {
                    let values = film.pixels.iter().flatten();
                    for (sum, value) in sum.pixels.iter_mut().flatten().zip(values) {
                        *sum += value / draws.samples as f32;
                    }
                }
            }
            let film = sums.remove(0);
            images.add(&film, &sums);
        }
        images.seconds = started.elapsed().as_secs_f64();
        images.work = (draws.images * draws.samples) as f64;
        images
    }

    fn new(scene: &Scene, layers: usize) -> Self {
        let camera = &scene.description().camera;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let columns = width / BLOCK;
        let cells = 1 + columns * (height / BLOCK);
        // Direct and surface form one part; the beauty is another.
        Self {
            means: vec![vec![Vec::new(); cells]; layers],
            pixels: vec![[MeanEstimate::new(); 3]; width * height],
            seconds: 0.0,
            work: 0.0,
            columns,
        }
    }

    fn add(&mut self, film: &Film, layers: &[Film]) {
        for (estimate, pixel) in self.pixels.iter_mut().zip(&film.pixels) {
            for (estimate, value) in estimate.iter_mut().zip(pixel) {
                estimate.add((*value).into());
            }
        }
        let (width, columns) = (film.width as usize, self.columns);
        for (part, cells) in self.means.iter_mut().enumerate() {
            let films = match part {
                0 => [Some(film), None],
                1 => [layers.first(), layers.get(1)],
                part => [layers.get(part), None],
            };
            let mut whole = [0.0; 3];
            let count = cells.len() - 1;
            for (index, cell) in cells[1..].iter_mut().enumerate() {
                let (x0, y0) = (index % columns * BLOCK, index / columns * BLOCK);
                let mut sum = [0.0; 3];
                for film in films.into_iter().flatten() {
                    for row in film.pixels.chunks(width).skip(y0).take(BLOCK) {
                        for pixel in &row[x0..x0 + BLOCK] {
                            for (sum, value) in sum.iter_mut().zip(pixel) {
                                *sum += f64::from(*value) / (BLOCK * BLOCK) as f64;
                            }
                        }
                    }
                }
                for (whole, sum) in whole.iter_mut().zip(sum) {
                    *whole += sum / count as f64;
                }
                cell.push(sum.map(|v| v as f32));
            }
            cells[0].push(whole.map(|v| v as f32));
        }
    }
}
