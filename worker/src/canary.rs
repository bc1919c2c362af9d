//! Test pictures, one per engine: machines that render the same one render the same bits, as far as a test of a few
//! milliseconds can tell.

use crate::engine::{Engines, NotRendered, Planned};
use crate::error::WorkerError;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::node_hash;
use beamfarm_image::job::{EngineKind, JobSettings};
use beamfarm_image::merge::Node;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_scene::SceneError;
use std::sync::Arc;

const NAME: &str = "canary.toml";

fn text(engine: EngineKind) -> &'static str {
    match engine {
        EngineKind::Cpu => include_str!("canary.toml"),
        EngineKind::Gpu => include_str!("canary-gpu.toml"),
    }
}

fn planned(engine: EngineKind) -> Result<Planned, SceneError> {
    let description = beamfarm_scene::load(&Bundle {
        scene: NAME.into(),
        files: [(NAME.into(), text(engine).into())].into(),
    })?;
    let settings = JobSettings {
        engine,
        ..description.defaults.job_settings()
    };
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, settings);
    Ok(Planned { scene, plan })
}

/// Hash of the pixels of the processors' picture.
pub fn canary() -> Result<[u8; 32], WorkerError> {
    canary_by(&Engines::new(""), EngineKind::Cpu)
}

/// Hash of the pixels of an engine's picture.
pub fn canary_by(engines: &Engines, engine: EngineKind) -> Result<[u8; 32], WorkerError> {
    let engine = engines.engine(Arc::new(planned(engine)?))?;
    let image = engine.pass(0).map_err(|why| match why {
        NotRendered::Machine(why) => why.into(),
        NotRendered::Pass(why) => WorkerError::Internal(why.to_string()),
    })?;
    Ok(node_hash(
        &Node::leaf(0, image.film)
            .with_layers(image.layers)
            .with_mattes(image.mattes),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_render::cpu::pass::render_pass;

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
        for engine in [EngineKind::Cpu, EngineKind::Gpu] {
            let Planned { scene, plan } = planned(engine).unwrap();
            assert_eq!(plan.settings.engine, engine);
            let image = render_pass(&scene, &plan, 0).expect("a pass");
            if engine == EngineKind::Cpu {
                assert!(image.stats.beams > 0 && image.stats.beam_evaluations > 0);
            }
            // About 10 ms.
            assert!(
                image.stats.beam_evaluations < 1_000_000,
                "{}",
                image.stats.beam_evaluations
            );
            let lit = image.film.pixels.iter().filter(|pixel| pixel[0] > 0.0);
            assert!(lit.count() > if engine == EngineKind::Cpu { 200 } else { 40 });
        }
    }
}
