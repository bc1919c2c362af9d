//! Scenes from text, rendered in this process.

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
    let mut bundle = Bundle {
        scene: "test.toml".into(),
        ..Bundle::default()
    };
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
