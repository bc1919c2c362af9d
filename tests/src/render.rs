//! Scenes from text, rendered in this process.

use crate::MeanEstimate;
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::merge::{Average, Node, TreeSum};
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::scene::SceneDescription;

/// A scene without assets.
///
/// # Panics
/// When the text is not a valid scene.
pub fn scene(toml: &str) -> Scene {
    scene_with(toml, &[])
}

/// A scene with assets, by name.
///
/// # Panics
/// When the text is not a valid scene.
pub fn scene_with(toml: &str, assets: &[(&str, &[u8])]) -> Scene {
    let mut bundle = Bundle {
        scene: "test.toml".into(),
        ..Bundle::default()
    };
    for (name, bytes) in assets {
        bundle.files.insert((*name).into(), bytes.to_vec());
    }
    bundle.files.insert("test.toml".into(), toml.into());
    match SceneDescription::load(&bundle) {
        Ok(description) => Scene::new(description),
        Err(error) => panic!("{error}"),
    }
}

/// Renders the scene's own number of passes.
///
/// # Panics
/// When a pass has a pixel that is not finite.
pub fn average(scene: &Scene) -> Average {
    let plan = RenderPlan::new(scene, scene.description().defaults.job_settings());
    let camera = &scene.description().camera;
    let mut sum = TreeSum::new(camera.width, camera.height);
    for pass_index in 0..scene.description().defaults.passes {
        let image = render_pass(scene, &plan, pass_index);
        let inserted = sum.insert(Node::leaf(pass_index, image.film));
        assert!(inserted.is_ok(), "{inserted:?}");
    }
    let Some(average) = sum.average() else {
        panic!("no passes");
    };
    average
}

/// Means over blocks of `side` x `side` pixels, RGB, row by row, one value a pass. A pass is one draw, and what the block's
/// pixels share of it is in the block's mean: the standard errors are those of blocks, not of pixels.
pub fn block_means(scene: &Scene, side: usize) -> Vec<[MeanEstimate; 3]> {
    let plan = RenderPlan::new(scene, scene.description().defaults.job_settings());
    let camera = &scene.description().camera;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let columns = width / side;
    let mut blocks = vec![[MeanEstimate::new(); 3]; columns * (height / side)];
    for pass_index in 0..scene.description().defaults.passes {
        let film = render_pass(scene, &plan, pass_index).film;
        for (index, block) in blocks.iter_mut().enumerate() {
            let (x0, y0) = (index % columns * side, index / columns * side);
            for (c, mean) in block.iter_mut().enumerate() {
                let row = |y: usize| &film.pixels[y * width + x0..][..side];
                let pixels = (y0..y0 + side).flat_map(row);
                let sum: f64 = pixels.map(|p| f64::from(p[c])).sum();
                mean.add(sum / (side * side) as f64);
            }
        }
    }
    blocks
}
