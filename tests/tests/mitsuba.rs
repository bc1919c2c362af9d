//! Mitsuba scenes against pictures that Mitsuba 3 made of them (`tests/mitsuba/compare.py` says how).
//!
//! Compared are means over blocks of 8 x 8 pixels and over the whole picture, by channel. Standard errors are those of the
//! references, which are part of their files, and of beamfarm's passes. Late passes are rendered, whose radii have shrunk
//! so far that their bias is below the noise.

#![allow(clippy::unwrap_used)]

use beamfarm_shared::film::Film;
use beamfarm_shared::job::JobSettings;
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::scene::{SceneDescription, read_bundle};
use beamfarm_tests::Suite;
use beamfarm_tests::render::Blocks;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::path::{Path, PathBuf};

const BLOCK: usize = 8;
/// The radius scale of beams is a fifth from here on.
const FIRST_PASS: u64 = 128;
/// Rounding, in Mitsuba's single precision and in ours: share of a value that may differ besides the noise.
const ROUNDING: f64 = 2e-3;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("mitsuba")
}

/// A picture, and the standard error of the mean of the block that a pixel is in.
struct Reference {
    mean: Film,
    error: Film,
}

impl Reference {
    fn read(path: &Path) -> Self {
        let image = exr::image::read::read_first_flat_layer_from_file(path).unwrap();
        let size = image.layer_data.size;
        let film = |prefix: &str| {
            let mut film = Film::new(size.0 as u32, size.1 as u32);
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let is_named = |channel: &&exr::image::AnyChannel<exr::image::FlatSamples>| {
                    channel.name.to_string() == format!("{prefix}{name}")
                };
                let channels = &image.layer_data.channel_data.list;
                let channel = channels.iter().find(is_named).unwrap();
                let values = channel.sample_data.values_as_f32();
                for (pixel, value) in film.pixels.iter_mut().zip(values) {
                    pixel[c] = value;
                }
            }
            film
        };
        Self {
            mean: film(""),
            error: film("stderr."),
        }
    }

    /// Mean and standard error of each block, row by row, and of the whole.
    fn blocks(&self, c: usize) -> (Vec<[f64; 2]>, [f64; 2]) {
        let (width, height) = (self.mean.width as usize, self.mean.height as usize);
        let columns = width / BLOCK;
        let blocks: Vec<[f64; 2]> = (0..columns * (height / BLOCK))
            .map(|i| {
                let corner = i / columns * BLOCK * width + i % columns * BLOCK;
                let pixels = (0..BLOCK * BLOCK).map(|p| corner + p / BLOCK * width + p % BLOCK);
                let sum: f64 = pixels.map(|p| f64::from(self.mean.pixels[p][c])).sum();
                let error = f64::from(self.error.pixels[corner][c]);
                [sum / (BLOCK * BLOCK) as f64, error]
            })
            .collect();
        let count = blocks.len() as f64;
        let mean = blocks.iter().map(|b| b[0]).sum::<f64>() / count;
        let error = blocks.iter().map(|b| b[1] * b[1]).sum::<f64>().sqrt() / count;
        (blocks, [mean, error])
    }
}

/// Compare `passes` passes of `paths` photon paths. Significance 1e-3 a scene, over all its blocks and channels.
fn compare(name: &str, passes: u64, paths: u32) {
    let folder = folder();
    let bundle = read_bundle(&folder.join("scenes").join(name).with_extension("xml")).unwrap();
    let scene = Scene::new(SceneDescription::load(&bundle).unwrap());
    let settings = JobSettings {
        paths_per_pass: paths,
        reference_paths: paths,
        ..scene.description().defaults.job_settings()
    };
    let plan = RenderPlan::new(&scene, settings);
    let images = (FIRST_PASS..FIRST_PASS + passes).map(|i| render_pass(&scene, &plan, i).film);
    let ours = Blocks::new(images, BLOCK);
    let reference = Reference::read(&folder.join("references").join(name).with_extension("exr"));
    let mut suite = Suite::new(1e-3);
    for c in 0..3 {
        let (blocks, whole) = reference.blocks(c);
        assert_eq!(blocks.len(), ours.blocks.len());
        let named = ours.blocks.iter().zip(blocks).enumerate();
        let blocks = named.map(|(i, (block, expected))| (format!("block {i}"), block[c], expected));
        for (part, block, [expected, error]) in blocks.chain([("all".into(), ours.whole[c], whole)])
        {
            let error = error.hypot(ROUNDING * expected);
            // Welch's test: ours is a mean of few values, the reference one of many.
            let own = block.std_error();
            let both = own.hypot(error);
            let ratio = both / own.max(1e-9 * both);
            let freedom = (passes - 1) as f64 * ratio * ratio * ratio * ratio;
            let t = (block.mean() - expected) / both;
            let p = 2.0 * StudentsT::new(0.0, 1.0, freedom).unwrap().sf(t.abs());
            let text = format!(
                "{part}, channel {c}: {:e} +- {own:e}, expected {expected:e} +- {error:e}",
                block.mean()
            );
            suite.p_value(text, p);
        }
    }
    suite.finish();
}

macro_rules! scenes {
    ($($test:ident: $name:literal, $passes:literal, $paths:literal;)*) => {$(
        #[test]
        fn $test() {
            compare($name, $passes, $paths);
        }
    )*};
}

scenes! {
    surfaces: "surfaces", 64, 10_000;
    specular: "specular", 64, 20_000;
    glossy: "glossy", 64, 20_000;
    plastic: "plastic", 64, 20_000;
    lens: "lens", 64, 10_000;
    textures: "textures", 64, 10_000;
    shapes: "shapes", 64, 10_000;
    environment: "environment", 64, 10_000;
    fog: "fog", 64, 20_000;
    fog_hg: "fog-hg", 64, 20_000;
    fog_blend: "fog-blend", 64, 20_000;
    chromatic: "chromatic", 64, 20_000;
    spot_fog: "spot-fog", 64, 20_000;
    cloud: "cloud", 64, 20_000;
    amber: "amber", 64, 20_000;
    furnace: "furnace", 64, 20_000;
}
