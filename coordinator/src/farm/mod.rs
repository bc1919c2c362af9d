//! A job and all that is known about it, shared by every call that comes in.
//!
//! Locks are held for the length of a look-up or of an addition of images, and never across an `.await`.

mod events;
mod progress;
mod start;
mod stopping;

pub use events::{Event, EventKind};
pub use progress::{End, Progress, WorkerState, WorkerView};
pub use start::{DoneBlock, Entry, EntryState, Start};
pub use stopping::Target;

use events::Events;
use stopping::Tested;

use crate::examine::{Claim, Examined, Flaw, examine};
use crate::ledger::{Accepted, Ledger, LedgerError, PixelHash, Rules};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{FileHash, Grant, Job, LeaseId, Manifest, WorkerId};
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::job::{Block, JobSettings, MAX_PASSES};
use beamfarm_shared::layer::Layer;
use beamfarm_shared::merge::TreeSum;
use beamfarm_shared::radius::Schedule;
use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, mpsc, watch};
use tokio::time::{Instant, timeout_at};
use tracing::{debug, error, info, warn};

/// Attempts at one pass before the job gives up. Passes are deterministic, so a second attempt only rules out a machine
/// that miscalculates, and a third one two of them.
const ATTEMPTS_PER_PASS: u32 = 3;
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

struct Books {
    ledger: Ledger,
    progress: Progress,
    events: Events,
}

/// A job in the making.
pub struct Farm {
    job: Job,
    schedule: Schedule,
    files: BTreeMap<FileHash, Bytes>,
    timing: Timing,
    started: Instant,
    books: Mutex<Books>,
    sum: Mutex<TreeSum>,
    target: Option<Target>,
    tested: Mutex<Tested>,
    /// Time that earlier coordinators of the job took.
    before: Duration,
    /// Told whenever a pass becomes open again, or nothing more will.
    opened: Notify,
    end: watch::Sender<Option<End>>,
    #[expect(dead_code, reason = "until blocks are entered")]
    entries: Option<mpsc::UnboundedSender<Entry>>,
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
        let rules = Rules {
            passes: spec.passes,
            lease: timing.lease,
            failures_per_pass: ATTEMPTS_PER_PASS,
            refusals_per_worker: REFUSALS_PER_WORKER,
        };
        // Worker numbers only have to differ from those of a coordinator that stood here before.
        let first_worker = RandomState::new().build_hasher().finish() >> 32;
        let mut ledger = Ledger::new(rules, first_worker);
        if let Some(sum) = &start.sum {
            ledger.resume(spec.first_pass, sum.nodes().map(|node| node.block));
        }
        let farm = Arc::new(Self {
            schedule: Schedule::new(&job.settings),
            sum: Mutex::new(start.sum.unwrap_or_else(|| {
                TreeSum::new(job.width, job.height)
                    .with_layers(job.layers.len())
                    .with_fence(0)
            })),
            target: start.target,
            tested: Mutex::new(Tested::new(start.tested)),
            before: start.before,
            entries: start.entries,
            job,
            files: files.map(|bytes| (FileHash::of(&bytes), bytes)).collect(),
            timing,
            started: Instant::now(),
            books: Mutex::new(Books {
                ledger,
                progress: Progress {
                    stats: start.stats,
                    ..Progress::default()
                },
                events: Events::default(),
            }),
            opened: Notify::new(),
            end: watch::Sender::new(None),
        });
        farm.look();
        let prefix = farm.sum().prefix();
        farm.finish_at(prefix);
        farm
    }

    /// The job.
    pub fn job(&self) -> &Job {
        &self.job
    }

    /// How quickly losses are noticed.
    pub fn timing(&self) -> Timing {
        self.timing
    }

    /// Where the job stands.
    pub fn progress(&self) -> Progress {
        let books = self.books();
        Progress {
            prefix: books.ledger.prefix(),
            passes: books.ledger.done(),
            limit: books.ledger.limit(),
            ..books.progress.clone()
        }
    }

    /// Hash of the pixels of a pass that is there, its layers among them: [`beamfarm_shared::exr::node_hash`].
    pub fn pixel_hash(&self, pass_index: u64) -> Option<PixelHash> {
        self.books().ledger.pixel_hash(pass_index)
    }

    /// The sum of all that is there, to be kept on a disk. Shares its images, so it takes no time.
    pub fn snapshot(&self) -> TreeSum {
        self.sum().clone()
    }

    /// What happened lately, from the event of this number on.
    pub fn events(&self, since: u64) -> Vec<Event> {
        self.books().events.since(since)
    }

    /// Give no more passes away, or do so again. What is being rendered comes in.
    pub fn pause(&self, paused: bool) {
        let mut books = self.books();
        if books.progress.paused == paused {
            return;
        }
        books.progress.paused = paused;
        let text = if paused { "paused" } else { "resumed" };
        books.events.push(EventKind::Control, text.into());
        drop(books);
        info!("{text}");
        self.opened.notify_waiters();
    }

    /// Ask for more passes, so many in all, while the job is not over.
    pub fn extend(&self, passes: u64) -> Result<(), ExtendError> {
        let mut books = self.books();
        if self.end.borrow().is_some() || books.ledger.failed().is_some() {
            return Err(ExtendError::Over);
        }
        let limit = books.ledger.limit();
        if passes < limit {
            return Err(ExtendError::Fewer { limit });
        }
        if passes > MAX_PASSES {
            return Err(ExtendError::TooMany);
        }
        books.ledger.extend(passes);
        let text = format!("extended from {limit} to {passes} passes");
        info!("{text}");
        books.events.push(EventKind::Control, text);
        drop(books);
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
        ended
            .ok()
            .and_then(|end| end.clone())
            .unwrap_or(End::Stopped)
    }

    /// End the leases that have run out. To be called about once a heartbeat.
    pub fn expire(&self) {
        let now = self.now();
        let mut books = self.books();
        let expired = books.ledger.expire(now);
        books.progress.lost_leases += expired as u64;
        drop(books);
        if expired > 0 {
            warn!("{expired} leases ran out; their passes are handed out again");
            self.opened.notify_waiters();
        }
    }

    pub(crate) fn file(&self, hash: FileHash) -> Option<Bytes> {
        self.files.get(&hash).cloned()
    }

    pub(crate) fn register(&self, name: &str, threads: u32) -> WorkerId {
        let mut books = self.books();
        let worker = books.ledger.register();
        books.progress.registered += 1;
        drop(books);
        info!("worker {} is {name:?} with {threads} threads", worker.0);
        worker
    }

    /// The next pass, as soon as there is one, or `NotNow` after the time between heartbeats.
    pub(crate) async fn lease(&self, worker: WorkerId) -> Result<Grant, LedgerError> {
        let patience = Instant::now() + self.timing.heartbeat;
        loop {
            // Before the look at the ledger, so that no news slips in between.
            let opened = self.opened.notified();
            if self.end.borrow().is_some() {
                return Ok(Grant::Done);
            }
            if self.books().progress.paused {
                if timeout_at(patience, opened).await.is_err() {
                    return Ok(Grant::NotNow);
                }
                continue;
            }
            let now = self.now();
            let grant = self.books().ledger.lease(worker, now)?;
            if let Grant::Lease(lease, block) = grant {
                debug!("{block} leased to worker {} (lease {})", worker.0, lease.0);
            }
            if grant != Grant::NotNow {
                return Ok(grant);
            }
            if timeout_at(patience, opened).await.is_err() {
                return Ok(Grant::NotNow);
            }
        }
    }

    pub(crate) fn beat(
        &self,
        worker: WorkerId,
        leases: impl IntoIterator<Item = LeaseId>,
    ) -> Result<(), LedgerError> {
        let now = self.now();
        self.books().ledger.beat(worker, leases, now)
    }

    /// Count the worker as present until the value is dropped, which ends its leases.
    pub(crate) fn attend(self: &Arc<Self>, worker: WorkerId) -> Attendance {
        self.books().progress.workers += 1;
        let farm = self.clone();
        Attendance { farm, worker }
    }

    /// Whether a block that is about to arrive can be one that was asked for.
    pub(crate) fn check(&self, claim: &Claim) -> Result<(), LedgerError> {
        let books = self.books();
        books.ledger.check(claim.worker, claim.lease, claim.block)
    }

    /// Look a delivered block over and add it to the sum. Takes milliseconds: not for a thread that serves others.
    /// Returns whether it was there before.
    pub(crate) fn submit(&self, claim: &Claim, bytes: &[u8]) -> Result<Accepted, Refusal> {
        let Examined { node, pixels, hash } = match examine(&self.job, &self.schedule, claim, bytes)
        {
            Ok(examined) => examined,
            Err(flaw) => {
                self.reject(claim, &flaw);
                return Err(flaw.into());
            }
        };
        let accepted = {
            let mut books = self.books();
            let accepted = books
                .ledger
                .accept(claim.worker, claim.lease, claim.block, hash);
            match accepted {
                Ok(Accepted::New) => books.progress.stats += claim.stats,
                Ok(Accepted::Duplicate) => books.progress.duplicates += 1,
                Ok(Accepted::NotNeeded) => {}
                Err(LedgerError::Divergent { .. }) => books.progress.divergent += 1,
                Err(_) => books.progress.refused += 1,
            }
            accepted
        };
        let accepted = accepted.inspect_err(|error| error!("{error}"))?;
        debug!(
            "{} from worker {}: {accepted:?}, pixels {}",
            claim.block, claim.worker.0, pixels
        );
        if accepted == Accepted::New {
            let mut sum = self.sum();
            if let Err(error) = sum.insert(node) {
                // The ledger lets no block in twice and `examine` checked all else.
                error!("{error}");
                return Err(Refusal::Flaw(Flaw::Foreign(error.to_string())));
            }
            let prefix = sum.prefix();
            drop(sum);
            self.look();
            self.finish_at(prefix);
        }
        Ok(accepted)
    }

    /// A worker could not render what it leased.
    pub(crate) fn fail(
        &self,
        worker: WorkerId,
        lease: LeaseId,
        message: &str,
    ) -> Result<(), LedgerError> {
        let mut books = self.books();
        let block = books.ledger.leased_block(lease).unwrap_or(Block::leaf(0));
        books.ledger.fail(worker, lease, block, message)?;
        books.progress.failures += 1;
        drop(books);
        warn!("{block} failed on worker {}: {message}", worker.0);
        self.opened.notify_waiters();
        let prefix = self.sum().prefix();
        self.finish_at(prefix);
        Ok(())
    }

    /// Enter into the books that a delivery does not count.
    pub(crate) fn reject(&self, claim: &Claim, flaw: &Flaw) {
        let Claim {
            worker,
            lease,
            block,
            ..
        } = *claim;
        warn!("{block} from worker {} is refused: {flaw}", worker.0);
        self.books().progress.refused += 1;
        match flaw {
            Flaw::Damaged => {}
            Flaw::Foreign(_) => {
                self.books().ledger.refuse(worker, lease, block);
                self.opened.notify_waiters();
            }
            Flaw::Pixels(message) => {
                // The caller checked the lease; a worker that went away since changes nothing.
                let _ = self.fail(worker, lease, message);
            }
        }
    }

    fn finish_at(&self, prefix: u64) {
        let end = {
            let books = self.books();
            if prefix < books.ledger.limit() {
                return;
            }
            match books.ledger.failed() {
                Some(failure) => End::Failed(failure.clone()),
                None => End::Complete,
            }
        };
        self.finish(end);
    }

    fn finish(&self, end: End) {
        let first = |known: &mut Option<End>| {
            let first = known.is_none();
            known.get_or_insert(end);
            first
        };
        self.end.send_if_modified(first);
        self.opened.notify_waiters();
    }

    fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn books(&self) -> MutexGuard<'_, Books> {
        self.books.lock().unwrap_or_else(PoisonError::into_inner)
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

/// Why a delivery was refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Refusal {
    /// Because of what is in it.
    #[error(transparent)]
    Flaw(#[from] Flaw),
    /// Because of who sent it, or because of what is there already.
    #[error(transparent)]
    Ledger(#[from] LedgerError),
}

/// A worker's presence. Ends its leases when dropped.
pub(crate) struct Attendance {
    farm: Arc<Farm>,
    worker: WorkerId,
}

impl Drop for Attendance {
    fn drop(&mut self) {
        let mut books = self.farm.books();
        let lost = books.ledger.lost(self.worker);
        books.progress.workers = books.progress.workers.saturating_sub(1);
        books.progress.lost_leases += lost as u64;
        drop(books);
        let ended = self.farm.end.borrow().is_some();
        if !ended && lost > 0 {
            warn!(
                "worker {} is gone; its {lost} passes are handed out again",
                self.worker.0
            );
        } else if !ended {
            info!("worker {} is gone", self.worker.0);
        }
        self.farm.opened.notify_waiters();
    }
}
