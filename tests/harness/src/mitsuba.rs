//! Mitsuba scenes and the pictures that Mitsuba 3 made of them (see `tests/mitsuba/compare.py`).
//!
//! The tests compare means over blocks of 8 x 8 pixels and over the whole picture, by channel. Standard errors are
//! those of the references, which are part of their files, and of our images.

use crate::Suite;
use crate::render::Blocks;
use beamfarm_image::film::Film;
use beamfarm_render::world::Scene;
use beamfarm_scene::read_bundle;
use exr::image::read::read_first_flat_layer_from_file;
use exr::image::{AnyChannel, FlatSamples};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::path::{Path, PathBuf};

const BLOCK: usize = 8;
/// Rounding in Mitsuba's single precision and in ours: the share of a value that may differ on top of the noise.
const ROUNDING: f64 = 2e-3;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../mitsuba")
}

/// One of the scenes.
///
/// # Panics
/// If there is none of this name.
pub fn scene(name: &str) -> Scene {
    let path = folder().join("scenes").join(name).with_extension("xml");
    let description = read_bundle(&path).and_then(|bundle| beamfarm_scene::load(&bundle));
    match description {
        Ok(description) => Scene::new(description),
        Err(error) => panic!("{error}"),
    }
}

/// A picture, and for each pixel the standard error of its block's mean.
struct Reference {
    mean: Film,
    error: Film,
}

impl Reference {
    fn read(path: &Path) -> Self {
        let image = match read_first_flat_layer_from_file(path) {
            Ok(image) => image,
            Err(error) => panic!("{}: {error}", path.display()),
        };
        let size = image.layer_data.size;
        let film = |prefix: &str| {
            let mut film = Film::new(size.0 as u32, size.1 as u32);
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let name = format!("{prefix}{name}");
                let is_named = |channel: &&AnyChannel<FlatSamples>| channel.name.to_string() == name;
                let channels = &image.layer_data.channel_data.list;
                let Some(channel) = channels.iter().find(is_named) else {
                    panic!("{}: no channel {name}", path.display());
                };
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

/// Compares independent images of a scene with its reference. Significance 1e-3 per scene, over all its blocks and
/// channels.
///
/// # Panics
/// If they differ.
pub fn compare(name: &str, images: impl Iterator<Item = Film>) {
    let ours = Blocks::new(images, BLOCK);
    let reference = Reference::read(&folder().join("references").join(name).with_extension("exr"));
    let mut suite = Suite::new(1e-3);
    for c in 0..3 {
        let (blocks, whole) = reference.blocks(c);
        assert_eq!(blocks.len(), ours.blocks.len());
        let named = ours.blocks.iter().zip(blocks).enumerate();
        let blocks = named.map(|(i, (block, expected))| (format!("block {i}"), block[c], expected));
        for (part, block, [expected, error]) in blocks.chain([("all".into(), ours.whole[c], whole)]) {
            let error = error.hypot(ROUNDING * expected);
            // Welch's test: our mean is of few values, the reference's of many.
            let own = block.std_error();
            let both = own.hypot(error);
            let ratio = both / own.max(1e-9 * both);
            let freedom = (ours.whole[c].count() - 1) as f64 * ratio * ratio * ratio * ratio;
            let t = (block.mean() - expected) / both;
            let p = StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |d| 2.0 * d.sf(t.abs()));
            let text = format!(
                "{part}, channel {c}: {:e} +- {own:e}, expected {expected:e} +- {error:e}",
                block.mean()
            );
            suite.p_value(text, p);
        }
    }
    suite.finish();
}
