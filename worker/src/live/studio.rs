//! What a worker keeps of a changing scene, and how it renders it.

use crate::engine::{Engines, Revisions};
use beamfarm_image::film::Film;
use beamfarm_image::job::{JobSettings, PassStats};
use beamfarm_proto::{RevisionNumber, Task, Work};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_render::world::{Scene, SceneDescription};
use beamfarm_scene::{Files, Store};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A revision's files, and the interrupt for all work on it.
#[derive(Clone)]
pub struct Subject {
    pub number: RevisionNumber,
    pub files: Arc<Files>,
    pub interrupt: Interrupt,
}

/// A picture with its statistics.
pub struct Rendered {
    pub film: Film,
    pub stats: PassStats,
    pub preparing: Duration,
    pub rendering: Duration,
}

/// Why there is no picture.
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

/// Scenes of the latest revisions, and their data on the devices that render them.
pub struct Studio {
    store: Store,
    sketchable: Option<Sketchable>,
    exact: Option<Exact>,
    sketches: Revisions,
    passes: Revisions,
}

impl Studio {
    pub fn new(engines: &Arc<Engines>) -> Self {
        Self {
            store: Store::default(),
            sketchable: None,
            exact: None,
            sketches: engines.revisions(),
            passes: engines.revisions(),
        }
    }

    /// Renders a task of a revision, on the current rayon pool.
    pub fn render(&mut self, subject: &Subject, task: &Task) -> Result<Rendered, NotRendered> {
        let begun = Instant::now();
        let preparing;
        let image = match task.work {
            Work::Sketch {
                settings,
                index,
                origin,
            } => {
                let mut sketchable = self.sketchable(subject, origin)?;
                sketchable.scene.resize(task.width, task.height);
                let plan = RenderPlan::provisional(&sketchable.scene, settings);
                preparing = begun.elapsed();
                let image = self.sketches.pass(&sketchable.scene, &plan, index);
                self.sketchable = Some(sketchable);
                image
            }
            Work::Pass { settings, pass_index } => {
                let exact = self.exact(subject, settings)?;
                let camera = &exact.scene.description().camera;
                if (camera.width, camera.height) != (task.width, task.height) {
                    let message = format!(
                        "the scene has {} x {} pixels, the task {} x {}",
                        camera.width, camera.height, task.width, task.height
                    );
                    self.exact = Some(exact);
                    return Err(NotRendered::Failed(message));
                }
                preparing = begun.elapsed();
                let image = self.passes.pass(&exact.scene, &exact.plan, pass_index);
                self.exact = Some(exact);
                image
            }
        };
        // An interrupted result is meaningless, whatever it is.
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

    /// Takes the scene out; the caller puts it back after use.
    fn sketchable(&mut self, subject: &Subject, origin: [f64; 3]) -> Result<Sketchable, NotRendered> {
        let is_known = |known: &mut Sketchable| {
            let is_stopped = known.scene.description().interrupt.is_raised();
            known.of == subject.number && known.origin == origin && !is_stopped
        };
        if let Some(known) = self.sketchable.take_if(is_known) {
            return Ok(known);
        }
        let description = self.store.sketch(&subject.files, origin);
        let description = with_interrupt(description, subject)?;
        let scene = match self.sketchable.take() {
            Some(before) => Scene::new_like(&before.scene, description),
            None => Scene::new(description),
        };
        Ok(Sketchable {
            of: subject.number,
            origin,
            scene,
        })
    }

    /// Likewise.
    fn exact(&mut self, subject: &Subject, settings: JobSettings) -> Result<Exact, NotRendered> {
        let is_known = |known: &mut Exact| {
            let is_stopped = known.scene.description().interrupt.is_raised();
            known.of == subject.number && known.settings == settings && !is_stopped
        };
        if let Some(known) = self.exact.take_if(is_known) {
            return Ok(known);
        }
        let description = with_interrupt(self.store.load(&subject.files), subject)?;
        let scene = match self.exact.take() {
            Some(before) => Scene::new_like(&before.scene, description),
            None => Scene::new(description),
        };
        let plan = RenderPlan::new(&scene, settings);
        if subject.interrupt.is_raised() {
            return Err(NotRendered::Dropped);
        }
        Ok(Exact {
            of: subject.number,
            settings,
            scene,
            plan,
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_proto::TaskNumber;
    use beamfarm_scene::File;
    use std::collections::BTreeMap;

    const SCENE: &str = r#"
image = { width = 6, height = 4 }
camera = { origin = [0, 0, 4], target = [0, 0, 0], fov = 40 }
lights = [{ type = "point", position = [0, 2, 2], power = 10 }]
shapes = [{ type = "sphere", radius = 1 }]
"#;

    /// A dropped revision does not affect later ones.
    #[test]
    fn tasks_follow_one_that_was_dropped() {
        let name = "scene.toml".to_owned();
        let hash = *blake3::hash(SCENE.as_bytes()).as_bytes();
        let file = File::known(hash, SCENE.as_bytes().into());
        let files = Arc::new(Files {
            scene: name.clone(),
            files: BTreeMap::from([(name, file)]),
        });
        let subject = || Subject {
            number: RevisionNumber(1),
            files: files.clone(),
            interrupt: Interrupt::default(),
        };
        let settings = Store::default().load(&files).unwrap().defaults.job_settings();
        let pass = Work::Pass {
            settings,
            pass_index: 0,
        };
        let sketch = Work::Sketch {
            settings,
            origin: [0.0; 3],
            index: 0,
        };
        for work in [pass, sketch] {
            let task = Task {
                number: TaskNumber(1),
                revision: RevisionNumber(1),
                width: 6,
                height: 4,
                work,
            };
            let mut studio = Studio::new(&Arc::new(Engines::new("")));
            let first = subject();
            let expected = studio.render(&first, &task).unwrap().film;
            first.interrupt.raise();
            let dropped = studio.render(&first, &task);
            assert!(matches!(dropped, Err(NotRendered::Dropped)));
            let again = studio.render(&subject(), &task).unwrap().film;
            assert!(again == expected);
        }
    }
}
