//! The live view: the scene on its bench, its workers, and messages to pages.

use super::bench::{Bench, Changed, Refusal};
use super::jobs::Jobs;
use super::messages::{FromPage, ToPage};
use crate::loaded::Choosing;
use crate::settings::SceneArgs;
use beamfarm_coordinator::revisions::{Job, Revisions};
use beamfarm_image::job::{EngineKind, Targeting};
use beamfarm_proto::RevisionNumber;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_scene::Store;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, broadcast, watch};
use tokio::time::sleep;
use tracing::warn;

/// After this time without a change the view is at rest, even if a mouse button is held.
const STILL: Duration = Duration::from_millis(350);
/// Picture width in device pixels until a page requests one.
const WIDTH: u32 = 960;
/// The most messages that a slow page may lag behind.
const BEHIND: usize = 64;

/// The result of pilots at rest.
#[derive(Clone, Debug, Default)]
pub struct Rest {
    /// The scene's revision.
    pub revision: RevisionNumber,
    /// Whether a pilot is running.
    pub is_trying: bool,
    /// When the passes started.
    pub since: Option<Instant>,
    /// Whether photons that miss all targets are dropped, which biases the average.
    pub drops_photons: bool,
}

/// A live view.
pub struct LiveView {
    pub args: SceneArgs,
    engine: EngineKind,
    pub revisions: Arc<Revisions>,
    bench: Mutex<Bench>,
    /// Counts changes of what pages show of the scene.
    scene: watch::Sender<u64>,
    rest: watch::Sender<Rest>,
    /// Messages for all pages.
    told: broadcast::Sender<ToPage>,
    /// Notified of a change, and when no more changes follow for now.
    changed: Notify,
    at_rest: Notify,
    /// Interrupts the running pilot.
    pilot: Mutex<Interrupt>,
    /// Largest useful picture width in device pixels.
    width: watch::Sender<u32>,
    /// The number of passes, if it overrides the scene's.
    passes: Mutex<Option<u64>>,
    /// Whether there is an unresolved error in a file on disk.
    wrong: Mutex<bool>,
    pub jobs: Jobs,
}

impl LiveView {
    pub fn new(args: SceneArgs, bench: Bench, engine: EngineKind, canary: [u8; 32]) -> Arc<Self> {
        let camera = bench.description().camera;
        let full = fitting([camera.width, camera.height], WIDTH);
        let revisions = Revisions::new(full, bench.style(engine), canary);
        let view = Arc::new(Self {
            args,
            engine,
            revisions,
            bench: Mutex::new(bench),
            scene: watch::Sender::new(1),
            rest: watch::Sender::default(),
            told: broadcast::Sender::new(BEHIND),
            changed: Notify::new(),
            at_rest: Notify::new(),
            pilot: Mutex::default(),
            width: watch::Sender::new(WIDTH),
            passes: Mutex::new(None),
            wrong: Mutex::new(false),
            jobs: Jobs::new(),
        });
        view.publish(&view.bench());
        view.changed.notify_one();
        view
    }

    pub fn bench(&self) -> MutexGuard<'_, Bench> {
        self.bench.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notifies those who show the scene.
    pub fn scene_changes(&self) -> watch::Receiver<u64> {
        self.scene.subscribe()
    }

    pub fn rest(&self) -> watch::Receiver<Rest> {
        self.rest.subscribe()
    }

    /// Messages for all pages.
    pub fn told(&self) -> broadcast::Receiver<ToPage> {
        self.told.subscribe()
    }

    /// Send a message to all pages.
    pub fn tell(&self, message: ToPage) {
        // Fails if there are none.
        let _ = self.told.send(message);
    }

    /// Apply a change requested by a page. Returns the revision that includes it.
    pub fn change(&self, change: &FromPage) -> Result<RevisionNumber, Refusal> {
        let mut bench = self.bench();
        let changed = bench.change(change)?;
        self.follow(&bench, changed);
        Ok(bench.number())
    }

    /// No more changes follow for now.
    pub fn settle_down(&self) {
        self.at_rest.notify_one();
    }

    /// A file has changed on disk.
    pub fn read_again(&self) {
        let mut bench = self.bench();
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        match bench.read_again() {
            Ok(changed) => {
                self.follow(&bench, changed);
                // The saved state, for example, has changed.
                self.scene.send_modify(|count| *count += 1);
                if std::mem::take(&mut *wrong) {
                    self.tell(ToPage::Fine);
                }
            }
            Err(refusal) => {
                *wrong = true;
                self.tell(error(0, refusal));
            }
        }
    }

    /// Write the scene file.
    pub fn save(&self) -> Result<String, String> {
        let saved = self.bench().save();
        self.scene.send_modify(|count| *count += 1);
        saved
    }

    /// A page can show pictures of this width.
    pub fn widen(&self, width: u32) {
        let is_new = self.width.send_if_modified(|known| {
            let is_new = *known != width;
            *known = width;
            is_new
        });
        if is_new {
            // The same scene at another size.
            let mut bench = self.bench();
            let is_sketch = self.revisions.job().is_none();
            if is_sketch {
                bench.begin_anew();
                self.publish(&bench);
                self.changed.notify_one();
            }
        }
    }

    /// Set the total number of passes.
    pub fn set_passes(&self, passes: u64) {
        *self.passes.lock().unwrap_or_else(PoisonError::into_inner) = Some(passes);
        self.revisions.extend(passes);
    }

    /// Stop the view's own passes while a job runs.
    pub fn give_way(&self) {
        self.revisions.extend(0);
    }

    fn limit(&self, of_scene: u64) -> u64 {
        let said = *self.passes.lock().unwrap_or_else(PoisonError::into_inner);
        said.unwrap_or(of_scene)
    }

    fn follow(&self, bench: &Bench, changed: Changed) {
        if changed == Changed::Picture {
            self.publish(bench);
            self.changed.notify_one();
        }
        if changed != Changed::Nothing {
            self.scene.send_modify(|count| *count += 1);
        }
    }

    fn publish(&self, bench: &Bench) {
        self.pilot.lock().unwrap_or_else(PoisonError::into_inner).raise();
        let camera = bench.description().camera;
        let full = fitting([camera.width, camera.height], *self.width.borrow());
        let (revision, files) = bench.revision();
        self.rest.send_replace(Rest {
            revision: revision.number,
            ..Rest::default()
        });
        self.revisions.revise(revision, files, full, bench.style(self.engine));
    }

    /// Whenever the scene is at rest, find the settings of its passes.
    pub async fn rest_again_and_again(self: Arc<Self>) {
        let mut store = Store::default();
        loop {
            self.changed.notified().await;
            // Discard a notification of an earlier rest.
            let _ = tokio::time::timeout(Duration::ZERO, self.at_rest.notified()).await;
            // Until nothing changes any more.
            loop {
                tokio::select! {
                    biased;
                    () = self.changed.notified() => {}
                    () = self.at_rest.notified() => break,
                    () = sleep(STILL) => break,
                }
            }
            let view = self.clone();
            let tried = tokio::task::spawn_blocking(move || {
                view.try_out(&mut store);
                store
            });
            store = match tried.await {
                Ok(store) => store,
                Err(error) => {
                    warn!("the pilot: {error}");
                    Store::default()
                }
            };
        }
    }

    /// Run the pilot, as `render` does before its first pass.
    fn try_out(&self, store: &mut Store) {
        let interrupt = Interrupt::default();
        *self.pilot.lock().unwrap_or_else(PoisonError::into_inner) = interrupt.clone();
        let (number, files, passes) = {
            let bench = self.bench();
            (bench.number(), bench.meant().clone(), bench.passes())
        };
        if self.rest.borrow().since.is_some() {
            return;
        }
        let of_this = |change: &dyn Fn(&mut Rest)| {
            self.rest.send_if_modified(|rest| {
                let is_this = rest.revision == number;
                if is_this {
                    change(rest);
                }
                is_this
            });
        };
        of_this(&|rest| rest.is_trying = true);
        let description = store.load(&files).map(|description| SceneDescription {
            interrupt: interrupt.clone(),
            ..description
        });
        let chosen = description.map_err(|error| error.to_string()).and_then(|description| {
            match self.args.choose(&description, self.engine, Choosing::By(None)) {
                Ok(chosen) => Ok((chosen.settings, description)),
                Err(failure) => Err(failure.to_string()),
            }
        });
        of_this(&|rest| rest.is_trying = false);
        if interrupt.is_raised() {
            return;
        }
        match chosen {
            Ok((settings, description)) => {
                self.bench().chose(settings.techniques);
                let camera = &description.camera;
                let job = Job {
                    settings,
                    width: camera.width,
                    height: camera.height,
                    limit: self.limit(passes),
                };
                of_this(&|rest| {
                    rest.since = Some(Instant::now());
                    rest.drops_photons = description.defaults.targeting == Targeting::Reject;
                });
                self.revisions.settle(number, job);
            }
            Err(message) => self.tell(error(0, message.into())),
        }
    }
}

/// The message for a refused change.
pub fn error(seq: u64, refusal: Refusal) -> ToPage {
    let Refusal { path, line, message } = refusal;
    ToPage::Error {
        seq,
        path,
        line,
        message,
    }
}

/// The picture's size, reduced to at most this width.
fn fitting([width, height]: [u32; 2], most: u32) -> [u32; 2] {
    let share = (f64::from(most.max(16)) / f64::from(width.max(1))).min(1.0);
    [width, height].map(|side| ((f64::from(side) * share).round() as u32).max(1))
}
