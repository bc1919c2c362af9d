//! What a worker keeps of a scene that changes, and how it renders it.

use beamfarm_image::film::Film;
use beamfarm_image::job::{JobSettings, PassStats};
use beamfarm_proto::{RevisionNumber, Task, Work};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_render::world::{Scene, SceneDescription};
use beamfarm_scene::{Files, Store};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A revision's files, and what ends all work on it.
#[derive(Clone)]
pub struct Subject {
    pub number: RevisionNumber,
    pub files: Arc<Files>,
    pub interrupt: Interrupt,
}

/// A picture, and what it took.
pub struct Rendered {
    pub film: Film,
    pub stats: PassStats,
    pub preparing: Duration,
    pub rendering: Duration,
}

/// Why there is none.
#[derive(Debug)]
pub enum NotRendered {
    /// Nobody wants it any more.
    Dropped,
    /// It cannot be rendered.
    Failed(String),
}

/// A scene for sketches.
struct Sketchable {
    of: RevisionNumber,
    origin: [f64; 3],
    scene: Scene,
}

/// A scene for passes.
struct Exact {
    of: RevisionNumber,
    settings: JobSettings,
    scene: Scene,
    plan: RenderPlan,
}

/// Scenes of the last revisions.
#[derive(Default)]
pub struct Studio {
    store: Store,
    sketchable: Option<Sketchable>,
    exact: Option<Exact>,
}

impl Studio {
    /// Render a task of a revision, on the current rayon pool.
    pub fn render(&mut self, subject: &Subject, task: &Task) -> Result<Rendered, NotRendered> {
        let begun = Instant::now();
        let (scene, plan, pass_index) = match task.work {
            Work::Sketch {
                settings,
                index,
                origin,
            } => {
                let scene = self.sketchable(subject, origin)?;
                scene.resize(task.width, task.height);
                let plan = RenderPlan::provisional(scene, settings);
                (&*scene, plan, index)
            }
            Work::Pass { settings, pass_index } => {
                let exact = self.exact(subject, settings)?;
                let camera = &exact.scene.description().camera;
                if (camera.width, camera.height) != (task.width, task.height) {
                    return Err(NotRendered::Failed(format!(
                        "the scene has {} x {} pixels, the task {} x {}",
                        camera.width, camera.height, task.width, task.height
                    )));
                }
                (&exact.scene, exact.plan.clone(), pass_index)
            }
        };
        let preparing = begun.elapsed();
        let image = render_pass(scene, &plan, pass_index);
        // Whatever it is: what was interrupted has no meaning.
        if subject.interrupt.is_raised() {
            return Err(NotRendered::Dropped);
        }
        let image = image.map_err(|why| NotRendered::Failed(why.to_string()))?;
        Ok(Rendered {
            film: image.film,
            stats: image.stats,
            preparing,
            rendering: begun.elapsed().saturating_sub(preparing),
        })
    }

    fn sketchable(&mut self, subject: &Subject, origin: [f64; 3]) -> Result<&mut Scene, NotRendered> {
        let is_known = |known: &Sketchable| known.of == subject.number && known.origin == origin;
        if !self.sketchable.as_ref().is_some_and(is_known) {
            let description = self.store.sketch(&subject.files, origin);
            let description = with_interrupt(description, subject)?;
            let scene = match self.sketchable.take() {
                Some(before) => Scene::new_like(&before.scene, description),
                None => Scene::new(description),
            };
            self.sketchable = Some(Sketchable {
                of: subject.number,
                origin,
                scene,
            });
        }
        let known = self.sketchable.as_mut().map(|known| &mut known.scene);
        known.ok_or(NotRendered::Dropped)
    }

    fn exact(&mut self, subject: &Subject, settings: JobSettings) -> Result<&Exact, NotRendered> {
        let is_known = |known: &Exact| known.of == subject.number && known.settings == settings;
        if !self.exact.as_ref().is_some_and(is_known) {
            let description = with_interrupt(self.store.load(&subject.files), subject)?;
            let scene = match self.exact.take() {
                Some(before) => Scene::new_like(&before.scene, description),
                None => Scene::new(description),
            };
            let plan = RenderPlan::new(&scene, settings);
            if subject.interrupt.is_raised() {
                return Err(NotRendered::Dropped);
            }
            self.exact = Some(Exact {
                of: subject.number,
                settings,
                scene,
                plan,
            });
        }
        self.exact.as_ref().ok_or(NotRendered::Dropped)
    }
}

fn with_interrupt(
    description: Result<SceneDescription, beamfarm_scene::SceneError>,
    subject: &Subject,
) -> Result<SceneDescription, NotRendered> {
    let description = description.map_err(|error| NotRendered::Failed(error.to_string()))?;
    Ok(SceneDescription {
        interrupt: subject.interrupt.clone(),
        ..description
    })
}
