//! A job and all that is known about it, shared by every call that comes in.
//!
//! Locks are held for the length of a look-up or of an addition of images, and never across an `.await`.

mod calls;
mod events;
mod progress;
mod settle;
mod snapshot;
mod start;
mod stopping;

pub(crate) use calls::{Refusal, Unwelcome};
pub use events::{Event, EventKind};
pub use progress::{End, Progress, Unable};
pub use snapshot::Snapshot;
pub use start::{DoneBlock, Entry, EntryState, Start};
pub use stopping::Target;

use events::Events;
use stopping::Tested;

use crate::ledger::{Done, Ledger, PixelHash, Rules};
use crate::plausible::Plausible;
use crate::rarely::Rarely;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::{Block, JobSettings, MAX_PASSES};
use beamfarm_image::layer::{Layer, LayerCounts};
use beamfarm_image::merge::TreeSum;
use beamfarm_image::radius::Schedule;
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{FileEntry, FileHash, Job, Manifest};
use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, mpsc, watch};
use tokio::time::Instant;
use tracing::info;

/// Attempts at one pass before the job gives up. Passes are deterministic, so a second attempt only rules out a machine
/// that miscalculates, and a third one two of them.
const ATTEMPTS_PER_PASS: u32 = 3;
/// Failures in a row before a worker is shut out.
const FAILURES_PER_WORKER: u32 = 5;
/// Wrong results before a worker is shut out. The worker's own program stops at its first.
const REFUSALS_PER_WORKER: u32 = 3;

/// What to render.
#[derive(Clone, Debug)]
pub struct JobSpec {
    /// The scene file and its assets.
    pub bundle: Bundle,
    /// What passes depend on beside the scene.
    pub settings: JobSettings,
    /// Pixels a row, as the scene says.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Layers that passes have beside their radiance.
    pub layers: Vec<Layer>,
    /// First pass; zero unless the passes are part of a job that several farms share.
    pub first_pass: u64,
    /// First pass that is not to be rendered: as many as there are, when the first is zero.
    pub passes: u64,
    /// One block in so many, chosen at random, is rendered again by another worker and compared; 0: none.
    pub audit_every: u64,
}

/// How quickly the loss of a worker is noticed when its connection does not break.
///
/// A worker whose attempt failed gets nothing for a tenth of a heartbeat, twice as long after the next failure, and so
/// on up to 6.4 heartbeats; one whose lease ran out for the length of a lease, and so on up to 64 of them.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Time between heartbeats.
    pub heartbeat: Duration,
    /// A lease ends this long after its last heartbeat: several of them, as machines under load are late.
    pub lease: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            heartbeat: Duration::from_secs(5),
            lease: Duration::from_secs(30),
        }
    }
}

/// What changes with each call, but for the images.
struct State {
    ledger: Ledger,
    progress: Progress,
    events: Events,
    pauses: Pauses,
    plausible: Plausible,
}

/// Time in which no passes were handed out because somebody wanted so.
#[derive(Clone, Copy, Debug, Default)]
struct Pauses {
    /// Of pauses that are over.
    over: Duration,
    /// When the one that is not began.
    since: Option<Duration>,
}

impl Pauses {
    fn until(self, now: Duration) -> Duration {
        self.over + self.since.map_or(Duration::ZERO, |since| now.saturating_sub(since))
    }

    fn end(&mut self, now: Duration) {
        *self = Self {
            over: self.until(now),
            since: None,
        };
    }
}

/// A job in the making.
pub struct Farm {
    job: Job,
    schedule: Schedule,
    files: BTreeMap<FileHash, Bytes>,
    timing: Timing,
    started: Instant,
    state: Mutex<State>,
    sum: Mutex<TreeSum>,
    target: Option<Target>,
    tested: Mutex<Tested>,
    /// Time that earlier coordinators of the job took.
    before: Duration,
    /// Told whenever a pass becomes open again, or nothing more will.
    opened: Notify,
    end: watch::Sender<Option<End>>,
    entries: Option<mpsc::UnboundedSender<Entry>>,
    /// Registrations that are refused.
    unwelcome: Rarely,
    /// Those of workers that do not offer its engine.
    unable: Rarely,
}

impl Farm {
    /// A farm for this job. Time starts now.
    pub fn new(spec: JobSpec, timing: Timing, start: Start) -> Arc<Self> {
        let job = Job {
            scene: spec.bundle.hash(),
            manifest: Manifest::from(&spec.bundle),
            settings: spec.settings,
            width: spec.width,
            height: spec.height,
            layers: spec.layers,
        };
        let files = spec.bundle.files.into_values().map(Bytes::from);
        let salt = [0; 4].map(|_: u64| RandomState::new().build_hasher().finish());
        let mut audit_salt = [0; 32];
        for (bytes, salt) in audit_salt.chunks_mut(8).zip(salt) {
            bytes.copy_from_slice(&salt.to_le_bytes());
        }
        let rules = Rules {
            first_pass: spec.first_pass,
            passes: spec.passes,
            lease: timing.lease,
            failures_per_pass: ATTEMPTS_PER_PASS,
            failures_per_worker: FAILURES_PER_WORKER,
            refusals_per_worker: REFUSALS_PER_WORKER,
            back_off: timing.heartbeat / 10,
            audit_every: spec.audit_every,
            audit_salt,
        };
        let mut ledger = Ledger::new(rules, 1);
        let empty = || {
            TreeSum::new(job.width, job.height)
                .with_layers(LayerCounts::of(&job.layers))
                .with_first_pass(spec.first_pass)
                .with_fence(0)
        };
        let sum = start.sum.unwrap_or_else(empty);
        // What the sum does not hold is rendered again.
        let held = start.done.iter().filter(|done| covers(&sum, done.block));
        ledger.resume(held.map(|done| {
            let by = (&done.worker, done.hash);
            (done.block, Some(by), done.audited)
        }));
        let nodes: Vec<Block> = sum.nodes().map(|node| node.block).collect();
        ledger.resume_rest(nodes);
        for done in &start.done {
            ledger.expect(done.block, &done.worker, done.hash);
        }
        for who in &start.convicted {
            ledger.resume_convicted(who);
        }
        let farm = Arc::new(Self {
            schedule: Schedule::new(&job.settings),
            sum: Mutex::new(sum),
            target: start.target,
            tested: Mutex::new(Tested::new(start.tested)),
            before: start.before,
            entries: start.entries,
            job,
            files: files.map(|bytes| (FileHash::of(&bytes), bytes)).collect(),
            timing,
            started: Instant::now(),
            state: Mutex::new(State {
                ledger,
                progress: Progress {
                    stats: start.stats,
                    ..Progress::default()
                },
                events: Events::default(),
                pauses: Pauses::default(),
                plausible: Plausible::default(),
            }),
            opened: Notify::new(),
            end: watch::Sender::new(None),
            unwelcome: Rarely::default(),
            unable: Rarely::default(),
        });
        farm.look();
        farm.settle();
        farm
    }

    /// The job.
    pub fn job(&self) -> &Job {
        &self.job
    }

    /// The scene file and its assets.
    pub fn bundle(&self) -> Bundle {
        let Manifest { scene, files } = &self.job.manifest;
        let file = |entry: &FileEntry| Some((entry.path.clone(), self.files.get(&entry.hash)?.to_vec()));
        Bundle {
            scene: scene.clone(),
            files: files.iter().filter_map(file).collect(),
        }
    }

    /// How quickly losses are noticed.
    pub fn timing(&self) -> Timing {
        self.timing
    }

    /// Time since it began in which it was paused.
    pub fn paused_for(&self) -> Duration {
        let now = self.now();
        self.state().pauses.until(now)
    }

    /// Time that earlier coordinators of the job took.
    pub fn before(&self) -> Duration {
        self.before
    }

    /// Where the job stands.
    pub fn progress(&self) -> Progress {
        let now = self.now();
        let state = self.state();
        let (audits_pending, divergent) = state.ledger.audits_pending();
        Progress {
            prefix: state.ledger.prefix(),
            passes: state.ledger.done(),
            limit: state.ledger.limit(),
            workers_seen: state.ledger.views(now),
            audits_pending,
            divergent,
            paused_for: state.pauses.until(now),
            ..state.progress.clone()
        }
    }

    /// Blocks that are there, in the order of their passes.
    pub fn blocks(&self) -> Vec<Done> {
        self.state().ledger.blocks().copied().collect()
    }

    /// Hash of a block that is there: its [`beamfarm_image::exr::node_hash`].
    pub fn block_hash(&self, block: Block) -> Option<PixelHash> {
        self.state().ledger.block_hash(block)
    }

    /// What happened lately, from the event of this number on.
    pub fn events(&self, since: u64) -> Vec<Event> {
        self.state().events.since(since)
    }

    /// Give no more passes away, or do so again. What is being rendered comes in.
    pub fn pause(&self, paused: bool) {
        let now = self.now();
        let mut state = self.state();
        if state.progress.paused == paused {
            return;
        }
        state.progress.paused = paused;
        state.pauses.end(now);
        state.pauses.since = paused.then_some(now);
        let text = if paused { "paused" } else { "resumed" };
        state.events.push(EventKind::Control, text.into());
        drop(state);
        info!("{text}");
        self.opened.notify_waiters();
    }

    /// Ask for more passes, so many in all, while the job is not over.
    pub fn extend(&self, passes: u64) -> Result<(), ExtendError> {
        let mut state = self.state();
        if self.end.borrow().is_some() || state.ledger.failed().is_some() {
            return Err(ExtendError::Over);
        }
        let limit = state.ledger.limit();
        if passes < limit {
            return Err(ExtendError::Fewer { limit });
        }
        if passes > MAX_PASSES {
            return Err(ExtendError::TooMany);
        }
        state.ledger.extend(passes);
        let text = format!("extended from {limit} to {passes} passes");
        info!("{text}");
        state.events.push(EventKind::Control, text);
        drop(state);
        self.opened.notify_waiters();
        Ok(())
    }

    /// End the job with what is there.
    pub fn stop(&self) {
        self.finish(End::Stopped);
    }

    /// How the job ended, if it has.
    pub fn end(&self) -> Option<End> {
        self.end.borrow().clone()
    }

    /// Resolves when the job is over.
    pub async fn ended(&self) -> End {
        let mut end = self.end.subscribe();
        // The sender lives in self.
        let ended = end.wait_for(Option::is_some).await;
        ended.ok().and_then(|end| end.clone()).unwrap_or(End::Stopped)
    }

    /// Resolves when no worker is left: each has hung up or signed off.
    pub(crate) async fn deserted(&self) {
        loop {
            // Before the look at the ledger, so that no news slips in between.
            let changed = self.opened.notified();
            if !self.state().ledger.has_company() {
                return;
            }
            changed.await;
        }
    }

    /// End the leases that have run out, and the job if nobody is left to wait for. To be called about once a
    /// heartbeat.
    pub fn expire(&self) {
        let now = self.now();
        let mut state = self.state();
        let expired = state.ledger.expire(now);
        drop(state);
        if expired > 0 {
            self.opened.notify_waiters();
        }
        self.settle();
    }

    fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn sum(&self) -> MutexGuard<'_, TreeSum> {
        self.sum.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Why a job cannot have so many passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExtendError {
    /// It is.
    #[error("the job is over")]
    Over,
    /// Some may have been rendered.
    #[error("the job has {limit} passes already; expected more")]
    Fewer {
        /// What it has.
        limit: u64,
    },
    /// Counts beyond are not exact.
    #[error("expected at most {MAX_PASSES} passes")]
    TooMany,
}

/// All of the block's passes are part of the sum.
fn covers(sum: &TreeSum, block: Block) -> bool {
    let mut nodes = sum.nodes().map(|node| node.block.passes());
    nodes.any(|node| node.start <= block.start() && block.passes().end <= node.end)
}
