//! The rendering threads.

use crate::canary::canary_by;
use crate::engine::{Engine, Engines, NotRendered, Planned};
use crate::error::WorkerError;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::{Block, EngineKind, PassStats};
use beamfarm_image::merge::Node;
use beamfarm_proto::Job;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::PassImage;
use beamfarm_render::world::Scene;
use beamfarm_scene::{Files, Store};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{Mutex, oneshot};
use tracing::{debug, info};

/// Time between log lines while a scene is loading; the first comes after a second.
const LOADING: Duration = Duration::from_secs(10);

/// The source of a scene.
pub enum Source {
    /// Its files alone.
    Whole(Bundle),
    /// Its files, and what it shares with earlier scenes.
    Shared(Files, Arc<Mutex<Store>>, Option<Arc<Prepared>>),
}

/// A scene ready to render with its job's engine.
#[derive(Debug)]
pub struct Prepared {
    engine: Engine,
}

impl Prepared {
    /// Number of passes that are best rendered together.
    pub fn together(&self) -> usize {
        self.engine.together()
    }

    /// Renders passes and adds them to the sums of earlier passes.
    fn add(&self, indices: &[u64], nodes: &mut Vec<Node>) -> Result<PassStats, Flaw> {
        let first = indices.first().copied().unwrap_or_default();
        let images = self.engine.passes(indices).map_err(|why| match why {
            NotRendered::Pass(why) => Flaw::Pass(first, why.to_string()),
            NotRendered::Machine(why) => Flaw::Machine(why.to_string()),
        })?;
        let mut stats = PassStats::default();
        for (index, image) in indices.iter().zip(images) {
            stats += image.stats;
            self.add_image(*index, image, nodes)
                .map_err(|why| Flaw::Pass(*index, why))?;
        }
        Ok(stats)
    }

    /// Adds a pass to the sums of earlier passes; the error says what is wrong with it.
    fn add_image(&self, pass_index: u64, image: PassImage, nodes: &mut Vec<Node>) -> Result<(), String> {
        let bad = image.stats.non_finite;
        if bad > 0 {
            return Err(format!("{bad} pixel values are not finite"));
        }
        let leaf = Node::leaf(pass_index, image.film)
            .with_layers(image.layers)
            .with_mattes(image.mattes);
        let mut node = leaf.with_radius_scale(image.radius_scale);
        let (width, height) = (node.sum.width, node.sum.height);
        // Checked here, so that the error names the pass and not only the block.
        node.check(width, height, node.layer_counts())
            .map_err(|error| error.to_string())?;
        while nodes.last().is_some_and(|left| left.block == node.block.sibling())
            && node.block.index % 2 == 1
            && let Some(left) = nodes.pop()
        {
            node = Node::join(left, node).map_err(|error| error.to_string())?;
        }
        nodes.push(node);
        Ok(())
    }
}

/// Why a pass is missing.
#[derive(Debug)]
pub enum Flaw {
    /// It cannot be rendered.
    Pass(u64, String),
    /// This machine does not render it; another may.
    Machine(String),
}

/// A pass that cannot be rendered.
#[derive(Debug)]
pub struct Failed {
    pub pass_index: u64,
    /// The reason.
    pub message: String,
}

/// Why a block is missing.
#[derive(Debug)]
pub enum NoBlock {
    /// One of its passes cannot be rendered.
    Failed(Failed),
    /// This machine stops rendering, for this reason.
    Machine(String),
}

/// Threads that only render.
pub struct Renderer {
    pool: rayon::ThreadPool,
    engines: Arc<Engines>,
}

impl Renderer {
    /// The engines that render passes.
    pub fn engines(&self) -> &Arc<Engines> {
        &self.engines
    }

    /// A renderer with this many threads, at least one, and these engines.
    pub fn new(threads: usize, engines: Arc<Engines>) -> Result<Self, WorkerError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("render-{i}"))
            .build()
            .map_err(|error| WorkerError::Internal(format!("rendering threads: {error}")))?;
        Ok(Self { pool, engines })
    }

    /// Reads a scene and builds what rendering needs. The image must have the job's size.
    pub async fn prepare(&self, source: Source, job: &Job) -> Result<Arc<Prepared>, WorkerError> {
        let (settings, layers) = (job.settings, job.layers.clone());
        let (width, height) = (job.width, job.height);
        let engines = self.engines.clone();
        // Lock outside the rendering threads: one that waits for others there may be handed work that waits for the
        // lock.
        let store = match &source {
            Source::Whole(_) => None,
            Source::Shared(_, store, _) => Some(store.clone().lock_owned().await),
        };
        let prepare = move || {
            let begun = Instant::now();
            let (description, before) = match (source, store) {
                (Source::Whole(bundle), _) => (beamfarm_scene::load(&bundle)?, None),
                (Source::Shared(files, _, before), Some(mut store)) => (store.load(&files)?, before),
                (Source::Shared(files, _, before), None) => (Store::default().load(&files)?, before),
            };
            let camera = &description.camera;
            if (camera.width, camera.height) != (width, height) {
                let message = format!(
                    "the scene has {} x {} pixels, the job {width} x {height}",
                    camera.width, camera.height
                );
                return Err(WorkerError::Refused(message));
            }
            let decoded = begun.elapsed();
            let scene = match before {
                Some(before) => Scene::new_like(&before.engine.planned().scene, description),
                None => Scene::new(description),
            };
            let built = begun.elapsed();
            let plan = RenderPlan::new(&scene, settings)
                .with_layers(&scene, &layers)
                .map_err(|error| WorkerError::Refused(error.to_string()))?;
            let planned = begun.elapsed();
            let engine = engines.engine(Arc::new(Planned { scene, plan }))?;
            debug!(
                files = decoded.as_secs_f64(),
                hierarchies = (built - decoded).as_secs_f64(),
                pilots = (planned - built).as_secs_f64(),
                engine = (begun.elapsed() - planned).as_secs_f64(),
                "the scene is ready, seconds"
            );
            Ok(Arc::new(Prepared { engine }))
        };
        let begun = Instant::now();
        let mut done = pin!(self.run(prepare));
        let mut patience = Duration::from_secs(1);
        let done = loop {
            match tokio::time::timeout(patience, &mut done).await {
                Ok(done) => break done,
                Err(_) => info!(seconds = begun.elapsed().as_secs(), "loading the scene"),
            }
            patience = LOADING;
        };
        match done {
            Ok(prepared) => prepared,
            Err(message) => Err(WorkerError::Internal(message)),
        }
    }

    /// Hash of this machine's test picture for an engine.
    pub async fn canary(&self, engine: EngineKind) -> Result<[u8; 32], WorkerError> {
        let engines = self.engines.clone();
        let made = self.run(move || canary_by(&engines, engine)).await;
        made.unwrap_or_else(|message| Err(WorkerError::Internal(message)))
    }

    /// Renders a block, as many passes together as suit its engine, and sums them as a tree. `rendered` receives the
    /// number of finished passes.
    pub async fn block(
        &self,
        prepared: &Arc<Prepared>,
        block: Block,
        rendered: impl Fn(u64),
    ) -> Result<(Node, PassStats), NoBlock> {
        // Nodes of falling level: the binary digits of the number of finished passes.
        let mut nodes: Vec<Node> = Vec::new();
        let mut stats = PassStats::default();
        let indices: Vec<u64> = block.passes().collect();
        for indices in indices.chunks(prepared.engine.together().max(1)) {
            let (prepared, together) = (prepared.clone(), indices.to_vec());
            let done = self.run(move || prepared.add(&together, &mut nodes).map(|s| (nodes, s)));
            let failed = |flaw| match flaw {
                Flaw::Pass(pass_index, message) => NoBlock::Failed(Failed { pass_index, message }),
                Flaw::Machine(message) => NoBlock::Machine(message),
            };
            let done = done.await.map_err(|panic| Flaw::Pass(indices[0], panic));
            let (grown, of_passes) = done.and_then(|done| done).map_err(failed)?;
            nodes = grown;
            stats += of_passes;
            rendered(indices[indices.len() - 1] + 1 - block.start());
        }
        let missing = || {
            NoBlock::Failed(Failed {
                pass_index: block.start(),
                message: "its passes do not add up".into(),
            })
        };
        let node = nodes.pop().filter(|node| node.block == block);
        node.map(|node| (node, stats)).ok_or_else(missing)
    }

    /// Runs something on these threads. The error is a panic of it.
    pub async fn run<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, String> {
        let (sender, receiver) = oneshot::channel();
        self.pool.spawn(move || {
            let done = catch_unwind(AssertUnwindSafe(work));
            // Fails if nobody waits for it any more.
            let _ = sender.send(done.map_err(|panic| panic_message(&*panic)));
        });
        receiver
            .await
            .unwrap_or_else(|_| Err("the rendering threads are gone".into()))
    }
}

fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the renderer panicked: {}", text.unwrap_or("no message"))
}
