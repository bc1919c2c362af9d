//! The rendering threads.

use crate::run::WorkerError;
use beamfarm_proto::Job;
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::pass::{PassImage, render_pass};
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::scene::SceneDescription;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use tokio::sync::oneshot;

/// A scene ready to render.
#[derive(Debug)]
pub struct Prepared {
    scene: Scene,
    plan: RenderPlan,
}

/// Threads that do nothing but render.
pub struct Renderer {
    pool: rayon::ThreadPool,
}

impl Renderer {
    /// A renderer of this many threads, at least one.
    pub fn new(threads: usize) -> Result<Self, WorkerError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("render-{i}"))
            .build()
            .map_err(|error| WorkerError::Internal(format!("rendering threads: {error}")))?;
        Ok(Self { pool })
    }

    /// Read a scene and build what rendering it needs. The image must have the size that the job says.
    pub async fn prepare(&self, bundle: Bundle, job: &Job) -> Result<Arc<Prepared>, WorkerError> {
        let (settings, layers) = (job.settings, job.layers.clone());
        let (width, height) = (job.width, job.height);
        let prepare = move || {
            let description = SceneDescription::load(&bundle)?;
            let camera = &description.camera;
            if (camera.width, camera.height) != (width, height) {
                let message = format!(
                    "the scene has {} x {} pixels, the job {width} x {height}",
                    camera.width, camera.height
                );
                return Err(WorkerError::Refused(message));
            }
            let scene = Scene::new(description);
            let plan = RenderPlan::new(&scene, settings)
                .with_layers(&scene, &layers)
                .map_err(|error| WorkerError::Refused(error.to_string()))?;
            Ok(Arc::new(Prepared { scene, plan }))
        };
        match self.run(prepare).await {
            Ok(prepared) => prepared,
            Err(message) => Err(WorkerError::Internal(message)),
        }
    }

    /// Render a pass. The error says what became of it instead.
    pub async fn pass(
        &self,
        prepared: &Arc<Prepared>,
        pass_index: u64,
    ) -> Result<PassImage, String> {
        let prepared = prepared.clone();
        let image = self
            .run(move || render_pass(&prepared.scene, &prepared.plan, pass_index))
            .await?;
        let bad = image.stats.non_finite;
        if bad > 0 {
            return Err(format!("{bad} pixel values are not finite"));
        }
        Ok(image)
    }

    async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, String> {
        let (sender, receiver) = oneshot::channel();
        self.pool.spawn(move || {
            let done = catch_unwind(AssertUnwindSafe(work));
            // Fails when nobody waits for it any more.
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
