//! Single passes, rendered in this process.

use super::wait::{State, pool, wait_for};
use super::{Asked, Failure, Notes};
use crate::loaded::Choosing;
use beamfarm_image::exr::{ImageMeta, Maker};
use beamfarm_image::job::Targeting;
use beamfarm_image::merge::Node;
use beamfarm_image::radius::Schedule;
use beamfarm_image::view::View;
use beamfarm_proto::VERSION;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::PassImage;
use beamfarm_render::world::Scene;
use beamfarm_worker::engine::{Engine, Engines, Planned};
use std::sync::Arc;
use std::time::Instant;

/// The passes of a scene, each rendered individually.
#[derive(Clone)]
pub struct Passes {
    engine: Arc<Engine>,
    pool: Arc<rayon::ThreadPool>,
    meta: ImageMeta,
    view: View,
    notes: Notes,
}

impl Passes {
    /// Read a scene and choose missing settings.
    pub fn new(asked: &Asked, tell: &mut dyn FnMut(State) -> bool) -> Result<Self, Failure> {
        let loaded = asked.load(asked.settings()?, Choosing::By(None), tell)?;
        let notes = Notes::of(&loaded);
        let meta = ImageMeta {
            scene: loaded.bundle.hash(),
            scene_file: None,
            maker: Maker::Passes(loaded.settings),
            render_seconds: 0.0,
            version: VERSION.into(),
            layers: loaded.layers,
            standard_error: loaded.standard_error,
            drops_photons: loaded.defaults.targeting == Targeting::Reject,
            names: loaded.description.names(),
            empty_depth: loaded.defaults.empty_depth,
        };
        let pool = Arc::new(pool(asked.threads)?);
        let (settings, layers, view) = (loaded.settings, meta.layers.clone(), loaded.defaults.view);
        let (description, gpu) = (loaded.description, asked.gpu.clone().unwrap_or_default());
        let threads = pool.clone();
        let build = move || {
            threads.install(|| {
                let scene = Scene::new(description);
                let plan = RenderPlan::new(&scene, settings).with_layers(&scene, &layers);
                let plan = plan.map_err(Failure::usage)?;
                Ok(Engines::new(&gpu).engine(Arc::new(Planned { scene, plan }))?)
            })
        };
        let engine = Arc::new(wait_for(build, &mut || tell(State::Preparing))?);
        Ok(Self {
            engine,
            pool,
            meta,
            view,
            notes,
        })
    }

    /// Messages about the scene.
    pub fn notes(&self) -> &Notes {
        &self.notes
    }

    /// How a PNG displays its images.
    pub fn view(&self) -> View {
        self.view
    }

    /// The radius scale of a pass.
    pub fn radius_scale(&self, pass_index: u64) -> f64 {
        Schedule::new(&self.engine.planned().plan.settings).scale(pass_index)
    }

    /// Metadata of an image of passes.
    pub fn meta(&self) -> &ImageMeta {
        &self.meta
    }

    /// Render a pass. Returns it with the seconds that it took.
    pub fn pass(&self, pass_index: u64, tell: &mut dyn FnMut(State) -> bool) -> Result<(Node, f64), Failure> {
        let (engine, pool) = (self.engine.clone(), self.pool.clone());
        let work = move || {
            let begun = Instant::now();
            let image = pool.install(|| engine.pass(pass_index))?;
            Ok((image, begun.elapsed().as_secs_f64()))
        };
        let (image, seconds): (PassImage, f64) = wait_for(work, &mut || tell(State::Preparing))?;
        let bad = image.stats.non_finite;
        if bad > 0 {
            return Err(Failure::job(format!("{bad} pixel values are not finite")));
        }
        let leaf = Node::leaf(pass_index, image.film)
            .with_layers(image.layers)
            .with_mattes(image.mattes);
        Ok((leaf.with_radius_scale(image.radius_scale), seconds))
    }
}
