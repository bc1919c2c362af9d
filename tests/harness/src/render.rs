//! Scenes from text, rendered in this process.

use crate::MeanEstimate;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::film::Film;
use beamfarm_image::job::{JobSettings, ReferenceSettings, Technique, Techniques};
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::cpu::reference::render_sample;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// A scene without assets.
///
/// # Panics
/// If the text is not a valid scene.
pub fn scene(toml: &str) -> Scene {
    scene_with(toml, &[])
}

/// A scene with assets, by name.
///
/// # Panics
/// If the text is not a valid scene.
pub fn scene_with(toml: &str, assets: &[(&str, &[u8])]) -> Scene {
    let mut bundle = Bundle {
        scene: "test.toml".into(),
        ..Bundle::default()
    };
    for (name, bytes) in assets {
        bundle.files.insert((*name).into(), bytes.to_vec());
    }
    bundle.files.insert("test.toml".into(), toml.into());
    match beamfarm_scene::load(&bundle) {
        Ok(description) => Scene::new(description),
        Err(error) => panic!("{error}"),
    }
}

/// Whether tests may take long: `BEAMFARM_LONG=1`.
pub fn is_long() -> bool {
    std::env::var("BEAMFARM_LONG").is_ok_and(|value| !value.is_empty() && value != "0")
}

/// How many of a test's images are rendered: all where tests may take long; otherwise a half, a quarter or an eighth of
/// them, but at least 32, since the standard error of fewer would hardly be known.
pub fn images(all: u64) -> u64 {
    match all {
        _ if is_long() => all,
        0..64 => all,
        64..200 => all / 2,
        200..800 => all / 4,
        800.. => all / 8,
    }
}

/// Factor on the standard error of a mean of [`images`], at most.
pub fn blur() -> f64 {
    if is_long() { 1.0 } else { 3.0 }
}

/// The plan of the scene's own job.
pub fn plan_of(scene: &Scene) -> RenderPlan {
    RenderPlan::new(scene, scene.description().defaults.job_settings())
}

/// What `work` gives on this many threads.
///
/// # Panics
/// If there can be no threads.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("a pool of threads").install(work)
}

/// Renders the scene's own number of passes.
///
/// # Panics
/// If a pass has a pixel that is not finite.
pub fn average(scene: &Scene) -> Average {
    let defaults = scene.description().defaults;
    run(scene, defaults.job_settings(), defaults.passes)
}

/// Renders this many passes of a job.
///
/// # Panics
/// If a pass has a pixel that is not finite.
pub fn run(scene: &Scene, settings: JobSettings, passes: u64) -> Average {
    run_plan(scene, &RenderPlan::new(scene, settings), passes)
}

/// Renders this many passes of a plan.
///
/// # Panics
/// If a pass has a pixel that is not finite.
pub fn run_plan(scene: &Scene, plan: &RenderPlan, passes: u64) -> Average {
    let camera = &scene.description().camera;
    let mut sum = TreeSum::new(camera.width, camera.height);
    for pass_index in 0..passes {
        let image = render_pass(scene, plan, pass_index).expect("a pass");
        let leaf = Node::leaf(pass_index, image.film);
        let inserted = sum.insert(leaf.with_radius_scale(image.radius_scale));
        assert!(inserted.is_ok(), "{inserted:?}");
    }
    let Some(average) = sum.average() else {
        panic!("no passes");
    };
    average
}

/// Means over blocks of pixels, RGB, of independent images of one scene. Pixels of an image share random events, which
/// the block's mean includes: the standard errors are those of blocks, not of pixels.
#[derive(Clone, Debug)]
pub struct Blocks {
    side: usize,
    /// Row by row; one value per image.
    pub blocks: Vec<[MeanEstimate; 3]>,
    /// Means over all blocks.
    pub whole: [MeanEstimate; 3],
}

impl Blocks {
    /// Blocks of `side` x `side` pixels; the images' sides must be multiples of it.
    pub fn new(images: impl Iterator<Item = Film>, side: usize) -> Self {
        let mut means = Self {
            side,
            blocks: Vec::new(),
            whole: [MeanEstimate::new(); 3],
        };
        images.for_each(|film| means.add(&film));
        means
    }

    /// Standard error of the difference from another picture, as a share of its mean: the largest over the channels.
    pub fn noise(&self, other: &Self) -> f64 {
        let channels = self.whole.iter().zip(&other.whole);
        let errors = channels.map(|(a, b)| a.std_error().hypot(b.std_error()) / b.mean().abs());
        errors.fold(0.0, f64::max)
    }

    fn add(&mut self, film: &Film) {
        let (side, width) = (self.side, film.width as usize);
        let columns = width / side;
        let count = columns * (film.height as usize / side);
        self.blocks.resize(count, [MeanEstimate::new(); 3]);
        for c in 0..3 {
            let mut total = 0.0;
            for (index, block) in self.blocks.iter_mut().enumerate() {
                let (x0, y0) = (index % columns * side, index / columns * side);
                let row = |y: usize| &film.pixels[y * width + x0..][..side];
                let sum: f64 = (y0..y0 + side).flat_map(row).map(|p| f64::from(p[c])).sum();
                let mean = sum / (side * side) as f64;
                block[c].add(mean);
                total += mean / count as f64;
            }
            self.whole[c].add(total);
        }
    }
}

/// Means over blocks of `side` x `side` pixels of the scene's passes, as many as [`images`].
pub fn blocks(scene: &Scene, side: usize) -> Blocks {
    blocks_of(scene, &plan_of(scene), side)
}

/// The same with these techniques and other random numbers.
pub fn blocks_by(scene: &Scene, techniques: Techniques, seed: u64, side: usize) -> Blocks {
    let settings = JobSettings {
        seed,
        techniques,
        ..scene.description().defaults.job_settings()
    };
    blocks_of(scene, &RenderPlan::new(scene, settings), side)
}

/// The same by photons on surfaces, and by camera paths; photons bring the caustics of both.
pub fn blocks_each_way(scene: &Scene, side: usize) -> [(Technique, Blocks); 2] {
    [(1, Technique::Photons), (2, Technique::Paths)].map(|(seed, way)| {
        let techniques = Techniques {
            media: None,
            surfaces: Some(way),
            caustics: Some(Technique::Photons),
            aimed: None,
        };
        (way, blocks_by(scene, techniques, seed, side))
    })
}

/// The same for a plan.
pub fn blocks_of(scene: &Scene, plan: &RenderPlan, side: usize) -> Blocks {
    let passes = 0..images(scene.description().defaults.passes);
    let films = passes.map(|pass_index| render_pass(scene, plan, pass_index).expect("a pass").film);
    Blocks::new(films, side)
}

/// Means over blocks of what the path tracer shows: of [`reference_images`] with paths of any length.
pub fn truth(scene: &Scene, all: u64, samples: u64, side: usize) -> Blocks {
    let settings = ReferenceSettings {
        seed: 5,
        max_depth: None,
    };
    Blocks::new(reference_images(scene, settings, all, samples), side)
}

/// Independent images of the reference integrator, each the mean of this many samples: [`images`] of `all`.
pub fn reference_images(
    scene: &Scene,
    settings: ReferenceSettings,
    all: u64,
    samples: u64,
) -> impl Iterator<Item = Film> {
    (0..images(all)).map(move |image| {
        let camera = &scene.description().camera;
        let mut mean = Film::new(camera.width, camera.height);
        for sample in image * samples..(image + 1) * samples {
            let film = render_sample(scene, &settings, sample, || true);
            let pixels = film.iter().flat_map(|film| &film.pixels).flatten();
            for (sum, value) in mean.pixels.iter_mut().flatten().zip(pixels) {
                *sum += value / samples as f32;
            }
        }
        mean
    })
}
