//! A scene that changes while it is rendered: workers render its revisions, and viewers see the best picture of the
//! newest one. [`desk`] decides who renders what; `service` talks to the workers.

pub mod desk;
pub mod ladder;
mod service;

pub use desk::{Job, Quality, Style};
pub(crate) use service::Service;

use beamfarm_image::film::Film;
use beamfarm_image::job::PassStats;
use beamfarm_image::merge::{Average, TreeSum};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{FileHash, Fingerprint, Revision, RevisionNumber, Task, TaskNumber, WorkerId};
use desk::{Desk, Verdict};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// The current picture of a revision.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The revision.
    pub revision: RevisionNumber,
    /// How good it is.
    pub quality: Quality,
    /// The number of its sketches' steps.
    pub steps: usize,
    /// The picture itself.
    pub content: Content,
}

/// What a picture is made of.
#[derive(Clone, Debug)]
pub enum Content {
    /// A sketch.
    Sketch(Arc<Film>),
    /// The average of passes.
    Average(Arc<Average>),
}

impl Content {
    /// Its radiance.
    pub fn film(&self) -> &Film {
        match self {
            Self::Sketch(film) => film,
            Self::Average(average) => &average.beauty,
        }
    }
}

/// What a worker reports about a picture that it delivers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub task: TaskNumber,
    /// Time from order to delivery.
    pub took: Duration,
    pub stats: PassStats,
}

/// The newest revision for workers, and its files.
struct Published {
    revision: Option<Arc<Revision>>,
    files: BTreeMap<FileHash, Bytes>,
}

/// A live view's workers and pictures, shared by all calls.
pub struct Revisions {
    desk: Mutex<Desk>,
    published: Mutex<Published>,
    /// Hash of the test picture as rendered by this machine.
    canary: [u8; 32],
    /// Wakes the tasks that hand out work.
    news: watch::Sender<u64>,
    pictures: watch::Sender<Option<Arc<Picture>>>,
    /// The last problem with a task of the newest revision.
    trouble: watch::Sender<Option<String>>,
    over: watch::Sender<bool>,
    delivered: AtomicU64,
    started: Instant,
    /// Workers that failed too often at what others could render.
    sent_away: Mutex<BTreeSet<Fingerprint>>,
}

impl Revisions {
    /// A view with sketches up to this size. `canary`: hash of the test picture as rendered by this machine; workers
    /// must match it.
    pub fn new(full: [u32; 2], style: Style, canary: [u8; 32]) -> Arc<Self> {
        Arc::new(Self {
            desk: Mutex::new(Desk::new(full, style)),
            published: Mutex::new(Published {
                revision: None,
                files: BTreeMap::new(),
            }),
            canary,
            news: watch::Sender::default(),
            pictures: watch::Sender::default(),
            trouble: watch::Sender::default(),
            over: watch::Sender::default(),
            delivered: AtomicU64::new(0),
            started: Instant::now(),
            sent_away: Mutex::default(),
        })
    }

    /// The scene has changed. `files`: what the revision's manifest lists besides the scene file.
    pub fn revise(&self, revision: Revision, files: BTreeMap<FileHash, Bytes>, full: [u32; 2], style: Style) {
        let number = revision.number;
        {
            let mut published = self.published();
            let revision = Arc::new(revision);
            published.files = files;
            published.revision = Some(revision);
            self.desk().revise(number, full, style);
        }
        self.trouble.send_replace(None);
        self.wake();
    }

    /// Set what the passes of a revision render. They are rendered after its sketches.
    pub fn settle(&self, revision: RevisionNumber, job: Job) {
        self.desk().settle(revision, job);
        self.wake();
    }

    /// Set the total number of passes of the newest revision.
    pub fn extend(&self, limit: u64) {
        self.desk().extend(limit);
        self.wake();
    }

    /// The best picture of the newest revision that has one.
    pub fn pictures(&self) -> watch::Receiver<Option<Arc<Picture>>> {
        self.pictures.subscribe()
    }

    /// Problems, as they occur.
    pub fn trouble(&self) -> watch::Receiver<Option<String>> {
        self.trouble.subscribe()
    }

    /// The number of workers present.
    pub fn workers(&self) -> usize {
        self.desk().workers()
    }

    /// The number of pictures delivered by workers.
    pub fn delivered(&self) -> u64 {
        self.delivered.load(Ordering::Relaxed)
    }

    /// The job of the newest revision, once known.
    pub fn job(&self) -> Option<Job> {
        self.desk().passes().map(|(job, _)| job.clone())
    }

    /// Tell workers that there is nothing more to do.
    pub fn finish(&self) {
        self.over.send_replace(true);
    }

    pub(crate) fn canary(&self) -> [u8; 32] {
        self.canary
    }

    pub(crate) fn is_over(&self) -> watch::Receiver<bool> {
        self.over.subscribe()
    }

    pub(crate) fn news(&self) -> watch::Receiver<u64> {
        self.news.subscribe()
    }

    pub(crate) fn join(&self, worker: WorkerId) {
        self.desk().join(worker);
    }

    pub(crate) fn leave(&self, worker: WorkerId) {
        self.desk().leave(worker);
        self.wake();
    }

    /// The task that a worker must drop, and its next task with the revision.
    pub(crate) fn orders(&self, worker: WorkerId) -> (Option<TaskNumber>, Option<(Arc<Revision>, Task)>) {
        // Both under one lock, so that the task belongs to the published revision.
        let published = self.published();
        let now = self.started.elapsed();
        let mut desk = self.desk();
        let dropped = desk.drop_of(worker);
        let revision = published.revision.clone();
        let task = revision.and_then(|revision| Some((revision, desk.next(worker, now)?)));
        (dropped, task)
    }

    /// Whether the worker must go. It is not admitted again.
    pub(crate) fn sends_away(&self, worker: WorkerId, key: Fingerprint) -> bool {
        let is_to_blame = self.desk().is_to_blame(worker);
        if is_to_blame {
            self.sent_away().insert(key);
        }
        is_to_blame
    }

    pub(crate) fn has_sent_away(&self, key: Fingerprint) -> bool {
        self.sent_away().contains(&key)
    }

    pub(crate) fn size_of(&self, worker: WorkerId, task: TaskNumber) -> Option<[u32; 2]> {
        self.desk().size_of(worker, task)
    }

    pub(crate) fn give_back(&self, worker: WorkerId, task: TaskNumber, failure: Option<String>) {
        self.desk().give_back(worker, task);
        if failure.is_some() {
            self.trouble.send_replace(failure);
        }
        self.wake();
    }

    /// Take in a picture if it still counts. An error is the worker's fault.
    pub(crate) async fn deliver(self: &Arc<Self>, worker: WorkerId, outcome: Outcome, film: Film) {
        self.delivered.fetch_add(1, Ordering::Relaxed);
        let verdict = match outcome.stats.non_finite {
            0 => (self.desk()).finish(worker, outcome.task, &film, (outcome.took, self.started.elapsed())),
            count => {
                self.desk().give_back(worker, outcome.task);
                Verdict::Wrong(format!("{count} pixel values are not finite"))
            }
        };
        self.wake();
        match verdict {
            Verdict::Late => {}
            Verdict::Wrong(message) => {
                self.trouble.send_replace(Some(message));
            }
            Verdict::Sketch { revision, step, steps } => self.show(Picture {
                revision,
                quality: Quality::Sketch(step),
                steps,
                content: Content::Sketch(Arc::new(film)),
            }),
            Verdict::Pass { prefix: 0, .. } => {}
            Verdict::Pass { revision, prefix } => {
                let sum = self.desk().passes().map(|(_, sum)| sum.clone());
                let revisions = self.clone();
                // Not awaited: the worker gets its next task meanwhile.
                tokio::task::spawn_blocking(move || {
                    if let Some(average) = sum.and_then(|sum: TreeSum| sum.average_of(prefix)) {
                        revisions.show(Picture {
                            revision,
                            quality: Quality::Passes(prefix),
                            steps: 0,
                            content: Content::Average(Arc::new(average)),
                        });
                    }
                });
            }
        }
    }

    pub(crate) fn file(&self, hash: FileHash) -> Option<Bytes> {
        self.published().files.get(&hash).cloned()
    }

    /// Show a picture, unless a newer or better one is shown.
    fn show(&self, picture: Picture) {
        self.pictures.send_if_modified(|shown| {
            let order = |picture: &Picture| (picture.revision, picture.quality);
            let is_better = shown.as_deref().is_none_or(|shown| order(shown) < order(&picture));
            if is_better {
                *shown = Some(Arc::new(picture));
            }
            is_better
        });
    }

    fn wake(&self) {
        self.news.send_modify(|count| *count += 1);
    }

    fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn sent_away(&self) -> MutexGuard<'_, BTreeSet<Fingerprint>> {
        self.sent_away.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn published(&self) -> MutexGuard<'_, Published> {
        self.published.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
