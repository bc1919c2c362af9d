//! The reference: samples of the path tracer.

use super::wait::{State, pool, wait_for};
use super::{Asked, Failure, Image, Notes};
use crate::loaded::Choosing;
use crate::measure::reference::{SAMPLES, refuse_photon_rules, samples};
use beamfarm_image::exr::{ImageMeta, Maker, Names};
use beamfarm_image::job::{MAX_PASSES, ReferenceSettings};
use beamfarm_proto::VERSION;
use beamfarm_render::cpu::reference::SampleLayers;
use beamfarm_render::world::Scene;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// When to stop.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples {
    /// Number of samples.
    pub count: Option<u64>,
    /// Time limit; the image is made of the samples that are complete by then.
    pub time: Option<Duration>,
    /// The most scattering events per path.
    pub max_depth: Option<u32>,
}

/// The result.
pub struct Sampled {
    /// The image of the complete samples.
    pub image: Option<Image>,
    /// Messages about the scene.
    pub notes: Notes,
}

/// Render a scene with the path tracer, which is unbiased. `tell` returns `false` to stop with the samples that are
/// complete.
pub fn sample(asked: &Asked, wanted: Samples, tell: &mut dyn FnMut(State) -> bool) -> Result<Sampled, Failure> {
    let mut settings = asked.settings()?;
    // The path tracer emits no photons and needs no pilot.
    settings.of.paths = Some(1);
    settings.device = None;
    settings.engine = None;
    let loaded = asked.load(settings, Choosing::Nothing, tell)?;
    refuse_photon_rules(&loaded.description)?;
    let notes = Notes::of(&loaded);
    let (view, scene, layers) = (loaded.defaults.view, loaded.bundle.hash(), loaded.layers);
    let settings = ReferenceSettings {
        seed: loaded.settings.seed,
        max_depth: wanted.max_depth,
    };
    let count = match (wanted.count, wanted.time) {
        (Some(count), _) => count,
        (None, Some(_)) => MAX_PASSES,
        (None, None) => SAMPLES,
    };
    let (pool, description, of_samples) = (pool(asked.threads)?, loaded.description, layers.clone());
    let (stopped, done) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let started = Instant::now();
    let work = {
        let (stopped, done) = (stopped.clone(), done.clone());
        move || {
            pool.install(|| {
                let scene = Scene::new(description);
                let layers = SampleLayers::new(&scene, &of_samples).map_err(Failure::usage)?;
                let is_late = || wanted.time.is_some_and(|time| started.elapsed() >= time);
                let goes_on = || !stopped.load(Ordering::Relaxed) && !is_late();
                let sum = samples((&scene, &layers), settings, count, goes_on, |_, samples| {
                    done.store(samples, Ordering::Relaxed);
                });
                sum.map_err(|(_, error)| Failure::job(error))
            })
        }
    };
    let sum = wait_for(work, &mut || {
        let passes = done.load(Ordering::Relaxed);
        let by_time = wanted
            .time
            .map_or(0.0, |time| started.elapsed().as_secs_f64() / time.as_secs_f64());
        let fraction = (passes as f64 / count as f64).max(by_time).min(1.0);
        let goes_on = tell(State::Rendering {
            passes,
            limit: (count < MAX_PASSES).then_some(count),
            fraction,
            remaining: Duration::try_from_secs_f64(started.elapsed().as_secs_f64() * (1.0 / fraction - 1.0)).ok(),
            error: None,
        });
        if !goes_on {
            stopped.store(true, Ordering::Relaxed);
        }
        // The current sample is abandoned within moments.
        true
    })?;
    let image = sum.average().map(|average| Image {
        average,
        meta: ImageMeta {
            scene,
            scene_file: None,
            maker: Maker::Reference(settings),
            render_seconds: started.elapsed().as_secs_f64(),
            version: VERSION.into(),
            layers,
            standard_error: true,
            drops_photons: false,
            names: Names::default(),
            empty_depth: None,
        },
        view,
    });
    Ok(Sampled { image, notes })
}
