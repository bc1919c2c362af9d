//! A job with everything known about it, shared by all calls.
//!
//! Locks are held while something is looked up or images are added, and never across an `.await`.

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

/// Attempts at one pass before the job gives up. Passes are deterministic: a second attempt rules out one machine that
/// miscalculates, a third rules out two.
const ATTEMPTS_PER_PASS: u32 = 3;
/// Failures in a row before a worker is shut out.
const FAILURES_PER_WORKER: u32 = 5;
/// Wrong results before a worker is shut out. The worker's own program stops after its first.
const REFUSALS_PER_WORKER: u32 = 3;

/// What to render.
#[derive(Clone, Debug)]
pub struct JobSpec {
    /// The scene file and its assets.
    pub bundle: Bundle,
    /// What passes depend on besides the scene.
    pub settings: JobSettings,
    /// Image width in pixels, from the scene.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// The layers that passes have in addition to radiance.
    pub layers: Vec<Layer>,
    /// First pass. Not zero only if several farms share the passes of one job.
    pub first_pass: u64,
    /// End of the passes, exclusive: their number if `first_pass` is zero.
    pub passes: u64,
    /// One block in `audit_every`, chosen at random, is rendered again by another worker and compared; 0: none.
    pub audit_every: u64,
}

/// How quickly a lost worker is noticed when its connection does not break.
///
/// A worker whose attempt failed gets nothing for a tenth of a heartbeat. The time doubles with each further failure,
/// up to 6.4 heartbeats. After an expired lease it is the length of a lease, which doubles up to 64 lengths.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Time between heartbeats.
    pub heartbeat: Duration,
    /// A lease ends this long after its last heartbeat. It lasts several heartbeats, as loaded machines are late.
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

/// What changes with each call, except the images.
struct State {
    ledger: Ledger,
    progress: Progress,
    events: Events,
    pauses: Pauses,
    plausible: Plausible,
}

/// Time during which the job was paused.
#[derive(Clone, Copy, Debug, Default)]
struct Pauses {
    /// Total length of finished pauses.
    over: Duration,
    /// Start of the current pause.
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

/// A job in progress.
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
    /// Time that earlier coordinators spent on the job.
    before: Duration,
    /// Notified when a pass becomes open again, and when nothing more will.
    opened: Notify,
    end: watch::Sender<Option<End>>,
    entries: Option<mpsc::UnboundedSender<Entry>>,
    /// Limits log lines about refused registrations.
    unwelcome: Rarely,
    /// Limits log lines about workers without the job's engine.
    unable: Rarely,
}

impl Farm {
    /// A farm for this job. Its clock starts now.
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
        // What the sum does not contain is rendered again.
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

    /// How long the job has been paused since it started.
    pub fn paused_for(&self) -> Duration {
        let now = self.now();
        self.state().pauses.until(now)
    }

    /// Time that earlier coordinators spent on the job.
    pub fn before(&self) -> Duration {
        self.before
    }

    /// How far the job is.
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

    /// Blocks that are done, in pass order.
    pub fn blocks(&self) -> Vec<Done> {
        self.state().ledger.blocks().copied().collect()
    }

    /// Hash of a block that is done: its [`beamfarm_image::exr::node_hash`].
    pub fn block_hash(&self, block: Block) -> Option<PixelHash> {
        self.state().ledger.block_hash(block)
    }

    /// Recent events, from number `since` on.
    pub fn events(&self, since: u64) -> Vec<Event> {
        self.state().events.since(since)
    }

    /// Pause or resume handing out passes. Passes that are being rendered still count.
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

    /// Raise the total number of passes to `passes` while the job is not over.
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

    /// End the job with the passes that are done.
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

    /// Resolves when no worker is left: all have hung up or signed off.
    pub(crate) async fn deserted(&self) {
        loop {
            // Before reading the ledger, so that no news slips in between.
            let changed = self.opened.notified();
            if !self.state().ledger.has_company() {
                return;
            }
            changed.await;
        }
    }

    /// End expired leases, and the job if there is nobody left to wait for. Call it about once per heartbeat.
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

/// Why a job cannot have this number of passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExtendError {
    /// The job is over.
    #[error("the job is over")]
    Over,
    /// The job already has more; some of those may have been rendered.
    #[error("the job has {limit} passes already; expected more")]
    Fewer {
        /// The number it has.
        limit: u64,
    },
    /// Larger counts are not exact.
    #[error("expected at most {MAX_PASSES} passes")]
    TooMany,
}

/// Whether all of the block's passes are in the sum.
fn covers(sum: &TreeSum, block: Block) -> bool {
    let mut nodes = sum.nodes().map(|node| node.block.passes());
    nodes.any(|node| node.start <= block.start() && block.passes().end <= node.end)
}
