//! A test picture: machines that make the same one render the same bits, as far as a few milliseconds can tell.

use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::node_hash;
use beamfarm_image::merge::Node;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_scene::SceneError;

const SCENE: &str = include_str!("canary.toml");
const NAME: &str = "canary.toml";

/// Hash of the picture's pixels.
pub fn canary() -> Result<[u8; 32], SceneError> {
    let description = beamfarm_scene::load(&Bundle {
        scene: NAME.into(),
        files: [(NAME.into(), SCENE.into())].into(),
    })?;
    let settings = description.defaults.job_settings();
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, settings);
    let image = render_pass(&scene, &plan, 0).expect("nothing moves, and nobody interrupts");
    Ok(node_hash(
        &Node::leaf(0, image.film)
            .with_layers(image.layers)
            .with_mattes(image.mattes),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_same_on_any_number_of_threads() {
        let first = canary().unwrap();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            assert_eq!(pool.unwrap().install(canary).unwrap(), first);
        }
        assert_ne!(first, [0; 32]);
    }

    #[test]
    fn there_is_something_in_it_and_not_much() {
        let bundle = Bundle {
            scene: NAME.into(),
            files: [(NAME.into(), SCENE.into())].into(),
        };
        let scene = Scene::new(beamfarm_scene::load(&bundle).unwrap());
        let settings = scene.description().defaults.job_settings();
        let image = render_pass(&scene, &RenderPlan::new(&scene, settings), 0).expect("a pass");
        assert!(image.stats.beams > 0 && image.stats.beam_evaluations > 0);
        // Some 10 ms.
        assert!(
            image.stats.beam_evaluations < 1_000_000,
            "{}",
            image.stats.beam_evaluations
        );
        let lit = image.film.pixels.iter().filter(|pixel| pixel[0] > 0.0);
        assert!(lit.count() > 200);
    }
}
