//! Which worker renders what: a state machine of leases, without clock, lock or network. Callers pass the time since
//! the job began.
//!
//! A pass is open, leased or done. Open passes are handed out lowest first, in aligned blocks, so that the prefix of
//! done passes, which the image is made of, grows without gaps. When nothing is left but to wait for slow blocks, they
//! are handed out a second time. Passes replay bit for bit, so the first result counts and the second confirms it.

mod audit;
mod crew;
mod hand_out;
mod level;
mod ranges;
mod register;
mod standing;
mod view;

pub use crew::Crew;
pub use standing::{Sentence, Who};
pub use view::{WorkerState, WorkerView};

use audit::Audit;
use beamfarm_image::job::Block;
use beamfarm_proto::{Fingerprint, LeaseId, WorkerId};
use ranges::Ranges;
use standing::{KnownBy, Worker};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Hash of a delivered block: its [`beamfarm_image::exr::node_hash`].
pub type PixelHash = [u8; 32];

/// How patient and how strict a ledger is.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// First pass of the job.
    pub first_pass: u64,
    /// End of the passes, exclusive.
    pub passes: u64,
    /// A lease ends this long after it was given or last named in a heartbeat.
    pub lease: Duration,
    /// The job fails when one pass failed this often on workers that have rendered others, or on all workers there are.
    pub failures_per_pass: u32,
    /// A worker is shut out after this many failed attempts in a row.
    pub failures_per_worker: u32,
    /// A worker is shut out after this many wrong results.
    pub refusals_per_worker: u32,
    /// A worker whose attempt failed gets nothing for this long; the time doubles with each further failure. After an
    /// expired lease it is the length of a lease, doubling likewise, until the worker delivers something.
    pub back_off: Duration,
    /// One block in this many is rendered again by another worker, as are the first blocks of every worker; 0: none.
    pub audit_every: u64,
    /// Secret that decides which blocks are drawn, so that nobody can predict them.
    pub audit_salt: [u8; 32],
}

/// A lease ends after this many times the usual time, or its worker's own if that is longer, even if heartbeats name
/// it.
const LONGEST: f64 = 32.0;

/// Why a worker's call is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LedgerError {
    /// It is not registered here.
    #[error("worker {0:?} is not registered here")]
    UnknownWorker(WorkerId),
    /// It is not trusted.
    #[error("worker {0:?} is shut out: {1}")]
    ShutOut(WorkerId, Sentence),
    /// The worker was never given this lease for this block.
    #[error("lease {lease:?} of {block:?} was never given to worker {worker:?}")]
    NotLeased {
        /// The worker.
        worker: WorkerId,
        /// The claimed lease.
        lease: LeaseId,
        /// The claimed block.
        block: Block,
    },
}

/// What became of a block that passed all checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// It counts.
    New,
    /// It was done already, with the same bits.
    Duplicate,
    /// It was done already, with the same bits from another worker: it is now confirmed.
    Confirmed,
    /// It was done already, with different bits. Others will decide.
    Disputed,
    /// It lies beyond a pass that failed for good, or some of its passes are done in other blocks.
    NotNeeded,
}

/// A pass that no worker could render.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The pass.
    pub pass_index: u64,
    /// The number of attempts.
    pub attempts: u32,
    /// The number of workers that tried it.
    pub workers: u32,
    /// The message of the last attempt.
    pub message: String,
}

/// Consequences for other workers, to be logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// A worker is shut out.
    ShutOut(WorkerId, Sentence),
    /// Two workers disagree about a block.
    Disputed(Block, WorkerId, WorkerId),
    /// The lease of a block ran out.
    Expired(Block, WorkerId),
    /// Another worker found the same bits.
    Confirmed(Block, WorkerId, PixelHash),
}

/// A block that counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Done {
    /// Which passes.
    pub block: Block,
    /// The worker and its hash of the pixels; unknown for passes in a sum from an earlier run of the job.
    pub by: Option<(WorkerId, PixelHash)>,
    /// Whether two workers found these pixels.
    pub confirmed: bool,
}

#[derive(Clone, Copy, Debug)]
struct Lease {
    worker: WorkerId,
    block: Block,
    begun: Duration,
    expires: Duration,
    /// Passes of it that the worker has rendered, and when this number last rose.
    rendered: u64,
    moved: Duration,
    /// Whether it checks a block that another worker has rendered.
    audit: bool,
}

/// The current time and the usual seconds per pass, which need a loop over all workers.
#[derive(Clone, Copy)]
struct Tempo {
    now: Duration,
    pass: Option<f64>,
}

/// Failed attempts at a pass.
#[derive(Clone, Debug)]
struct Attempts {
    /// When the first one failed.
    since: Duration,
    count: u32,
    /// Attempts by workers that had rendered other passes.
    by_able: u32,
    /// Workers that have had the pass.
    workers: BTreeSet<WorkerId>,
}

/// The ledger of one job.
#[derive(Debug)]
pub struct Ledger {
    rules: Rules,
    open: Ranges,
    /// Every lease ever given; its number is its index. Kept because a result may arrive long after its lease has ended
    /// and still counts.
    leases: Vec<Lease>,
    /// Leases that have not ended.
    active: BTreeSet<LeaseId>,
    /// Done blocks by first pass; disjoint.
    done: BTreeMap<u64, Done>,
    passes_done: u64,
    /// Lowest pass that is not done.
    prefix: u64,
    workers: BTreeMap<WorkerId, Worker>,
    next_worker: u64,
    /// The test picture that counts, and how many proven workers made each one.
    canary: Option<PixelHash>,
    canaries: BTreeMap<PixelHash, u64>,
    /// Workers that delivered wrong pixels.
    convicted: BTreeMap<KnownBy, Who>,
    /// Workers known from earlier runs of the job.
    earlier_workers: BTreeMap<KnownBy, WorkerId>,
    /// By first pass, disjoint: blocks that an earlier run of the job accepted and lost, with their votes.
    earlier: BTreeMap<u64, (Block, Vec<(WorkerId, PixelHash)>)>,
    attempts: BTreeMap<u64, Attempts>,
    audits: BTreeMap<Block, Audit>,
    /// Blocks of untrusted workers that still count.
    stained: Vec<Block>,
    notes: Vec<Note>,
    failed: Option<Failure>,
    /// The workers of the coordinator's other jobs, if any.
    crew: Option<Arc<Crew>>,
    /// Seconds to take in a block.
    intake: f64,
}

impl Ledger {
    /// An empty ledger. Workers are numbered from `first_worker`.
    pub fn new(rules: Rules, first_worker: u64) -> Self {
        Self {
            open: Ranges::from(rules.first_pass..rules.passes),
            leases: Vec::new(),
            active: BTreeSet::new(),
            done: BTreeMap::new(),
            passes_done: 0,
            prefix: rules.first_pass,
            workers: BTreeMap::new(),
            next_worker: first_worker,
            canary: None,
            canaries: BTreeMap::new(),
            convicted: BTreeMap::new(),
            earlier_workers: BTreeMap::new(),
            earlier: BTreeMap::new(),
            attempts: BTreeMap::new(),
            audits: BTreeMap::new(),
            stained: Vec::new(),
            notes: Vec::new(),
            failed: None,
            crew: None,
            intake: 0.0,
            rules,
        }
    }

    /// A heartbeat: these leases are being worked on, each with its number of rendered passes.
    pub fn beat(
        &mut self,
        worker: WorkerId,
        leases: impl IntoIterator<Item = (LeaseId, u64)>,
        now: Duration,
    ) -> Result<(), LedgerError> {
        self.admitted(worker)?.seen(now);
        for (id, rendered) in leases {
            if !self.active.contains(&id) {
                continue;
            }
            let lease = &mut self.leases[id.0 as usize];
            if lease.worker == worker {
                lease.expires = now + self.rules.lease;
                let rendered = rendered.min(lease.block.len());
                if rendered > lease.rendered {
                    lease.moved = now;
                }
                lease.rendered = rendered;
            }
        }
        Ok(())
    }

    /// End expired leases: no heartbeat named them, or the block or one of its passes takes far too long.
    pub fn expire(&mut self, now: Duration) -> usize {
        let pass = self.seconds_per_pass();
        let workers = &self.workers;
        let is_over = |lease: &Lease| {
            let own = workers.get(&lease.worker).and_then(|worker| worker.seconds_per_pass);
            let pass = pass.map(|pass| pass.max(own.unwrap_or(pass)));
            let too_long = |since: Duration, passes: u64| {
                let longest = pass.and_then(|pass| self.longest(pass, passes));
                longest.is_some_and(|longest| since + longest <= now)
            };
            // A block that has not been started waits for the one before.
            let is_rendered = 0 < lease.rendered && lease.rendered < lease.block.len();
            lease.expires <= now || too_long(lease.begun, lease.block.len()) || is_rendered && too_long(lease.moved, 1)
        };
        let expired: BTreeSet<LeaseId> = self
            .active
            .iter()
            .copied()
            .filter(|id| is_over(&self.leases[id.0 as usize]))
            .collect();
        let leases: Vec<Lease> = expired.iter().map(|id| self.leases[id.0 as usize]).collect();
        let notes = leases.iter().map(|lease| Note::Expired(lease.block, lease.worker));
        self.notes.extend(notes);
        let late: BTreeSet<WorkerId> = leases.iter().map(|lease| lease.worker).collect();
        for worker in late {
            if let Some(entry) = self.workers.get_mut(&worker) {
                entry.is_late(&self.rules, now);
            }
        }
        self.forgo(leases);
        self.end_leases(|id, _| expired.contains(&id))
    }

    /// The longest that a lease of this many passes may last, given the usual seconds per pass.
    fn longest(&self, pass: f64, passes: u64) -> Option<Duration> {
        let longest = Duration::try_from_secs_f64(LONGEST * pass * passes as f64).ok()?;
        Some(longest.max(self.rules.lease))
    }

    /// Let workers of other jobs be called to this one.
    pub fn join(&mut self, crew: Arc<Crew>) {
        self.crew = Some(crew);
    }

    /// Whether some worker was never here and may be called from another job.
    fn may_call(&self) -> bool {
        let Some(crew) = &self.crew else {
            return false;
        };
        let here: BTreeSet<Fingerprint> = self.workers.values().filter_map(|worker| worker.who.key).collect();
        let is_out = |key: &Fingerprint| self.convicted.contains_key(&KnownBy::Key(*key));
        crew.has(self.rules.lease, |key| !here.contains(key) && !is_out(key))
    }

    fn tempo(&self, now: Duration) -> Tempo {
        let pass = self.seconds_per_pass();
        Tempo { now, pass }
    }

    /// Whether a lease of the block that began at `since` could still run. Unproven workers are waited for that long.
    fn has_time(&self, since: Duration, block: Block, Tempo { now, pass }: Tempo) -> bool {
        let longest = pass.and_then(|pass| self.longest(pass, block.len()));
        longest.is_none_or(|longest| now < since + longest)
    }

    /// Whether to wait for a present worker to take over a block. One that has never delivered anything is waited for
    /// while there is time.
    fn is_worth_waiting(&self, worker: &Worker, has_time: bool, now: Duration) -> bool {
        let may_deliver = worker.seconds_per_pass.is_some() || has_time;
        worker.is_at_hand(&self.rules, now) && worker.late == 0 && may_deliver
    }

    /// The worker gives these leases back, for which it is not blamed.
    pub fn give_back(&mut self, worker: WorkerId, leases: &BTreeSet<LeaseId>) -> Result<usize, LedgerError> {
        self.worker(worker)?;
        let own = |id: LeaseId, lease: &Lease| lease.worker == worker && leases.contains(&id);
        let active = self.active.iter().map(|id| (*id, self.leases[id.0 as usize]));
        let given: Vec<Lease> = active
            .filter(|(id, lease)| own(*id, lease))
            .map(|(_, lease)| lease)
            .collect();
        self.forgo(given);
        Ok(self.end_leases(own))
    }

    /// These leases end without a result. Checks and failed passes among them are no longer left to these workers.
    fn forgo(&mut self, ended: Vec<Lease>) {
        for Lease {
            worker, block, audit, ..
        } in ended
        {
            if audit {
                if let Some(audit) = self.audits.get_mut(&block) {
                    audit.unwilling.insert(worker);
                }
            } else if let Some(attempts) = self.attempts.get_mut(&block.start()) {
                attempts.workers.insert(worker);
            }
        }
    }

    /// Check that the worker was given this lease for this block. The lease need not be active.
    pub fn check(&self, worker: WorkerId, lease: LeaseId, block: Block) -> Result<(), LedgerError> {
        if let Some(sentence) = self.worker(worker)?.shut_out {
            return Err(LedgerError::ShutOut(worker, sentence));
        }
        let given = usize::try_from(lease.0).ok().and_then(|i| self.leases.get(i));
        match given {
            Some(given) if given.worker == worker && given.block == block => Ok(()),
            _ => Err(LedgerError::NotLeased { worker, lease, block }),
        }
    }

    /// Take in a block whose content passed all checks.
    pub fn accept(
        &mut self,
        worker: WorkerId,
        lease: LeaseId,
        block: Block,
        pixels: PixelHash,
        now: Duration,
    ) -> Result<Accepted, LedgerError> {
        self.check(worker, lease, block)?;
        let took = now.saturating_sub(self.leases[lease.0 as usize].begun);
        let entry = self.admitted(worker)?;
        entry.seen(now);
        entry.delivered(block.len(), took);
        let known = self.done.get(&block.start()).copied();
        if let Some(known) = known.filter(|known| known.block == block) {
            self.active.remove(&lease);
            return self.compare(worker, known, pixels, now);
        }
        let wider = |id: &LeaseId| {
            let other = self.leases[id.0 as usize].block;
            other.level > block.level && other.passes().contains(&block.start())
        };
        if block.passes().end > self.limit()
            || self.first_done(block.passes()).is_some()
            || self.active.iter().any(wider)
        {
            self.end_lease(lease);
            return Ok(Accepted::NotNeeded);
        }
        // Others may be rendering parts of it: when their leases end, these passes must not become open again.
        let leases = &self.leases;
        self.active
            .retain(|id| !block.passes().contains(&leases[id.0 as usize].block.start()));
        self.open.remove(block.passes());
        self.enter(Done {
            block,
            by: Some((worker, pixels)),
            confirmed: false,
        });
        if self.is_tried(worker) || self.is_drawn(block) {
            self.audits.insert(block, Audit::new(worker, pixels, now));
        }
        self.compare_with_earlier(block, (worker, pixels), now);
        Ok(Accepted::New)
    }

    fn enter(&mut self, done: Done) {
        if let Some(entry) = done.by.and_then(|(id, _)| self.workers.get_mut(&id)) {
            entry.passes += done.block.len();
        }
        self.passes_done += done.block.len();
        self.done.insert(done.block.start(), done);
        while let Some(next) = self.done.get(&self.prefix) {
            self.prefix = next.block.passes().end;
        }
    }

    /// The leased block cannot be rendered because of this pass of it. After several attempts the job ends before that
    /// pass. A lease fails at most once; reports about an ended lease change nothing.
    pub fn fail(
        &mut self,
        worker: WorkerId,
        lease: LeaseId,
        pass_index: u64,
        message: &str,
        now: Duration,
    ) -> Result<(), LedgerError> {
        let block = self.leased_block(lease).unwrap_or(Block::leaf(0));
        self.check(worker, lease, block)?;
        if !self.active.contains(&lease) {
            return Ok(());
        }
        self.end_lease(lease);
        let rules = self.rules;
        let is_able = self.worker(worker)?.is_able(&rules);
        if self.admitted(worker)?.failed(&rules, now) {
            self.shut_out(worker, Sentence::Failures);
        }
        if let Some(audit) = self.audits.get_mut(&block) {
            audit.unable.insert(worker);
        }
        let pass_index = match block.passes().contains(&pass_index) {
            true => pass_index,
            false => block.start(),
        };
        if self.first_done(pass_index..pass_index + 1).is_some() {
            return Ok(());
        }
        let attempts = self.attempts.entry(pass_index).or_insert_with(|| Attempts {
            since: now,
            count: 0,
            by_able: 0,
            workers: BTreeSet::new(),
        });
        attempts.count += 1;
        attempts.by_able += u32::from(is_able);
        attempts.workers.insert(worker);
        let attempts = attempts.clone();
        // Failures of a worker that has rendered nothing, or that fails at pass after pass, say nothing about this pass
        // until all others have tried it.
        let mut present = self.workers.iter().filter(|(_, other)| other.is_at_hand(&rules, now));
        let by_all = present.all(|(id, _)| attempts.workers.contains(id));
        let counted = if by_all { attempts.count } else { attempts.by_able };
        if counted >= rules.failures_per_pass && pass_index < self.limit() {
            self.failed = Some(Failure {
                pass_index,
                attempts: attempts.count,
                workers: attempts.workers.len() as u32,
                message: message.into(),
            });
            self.open.remove(pass_index..u64::MAX);
        }
        Ok(())
    }

    /// The worker sent a wrong result, which says nothing about the block.
    pub fn refuse(&mut self, worker: WorkerId, lease: LeaseId, block: Block) {
        let limit = self.rules.refusals_per_worker;
        let Some(entry) = self.workers.get_mut(&worker) else {
            return;
        };
        entry.refusals += 1;
        if entry.refusals >= limit {
            self.shut_out(worker, Sentence::Refusals);
        }
        if self.check(worker, lease, block).is_ok() {
            self.end_lease(lease);
        }
    }

    /// The block that was leased under this number.
    pub fn leased_block(&self, lease: LeaseId) -> Option<Block> {
        let place = usize::try_from(lease.0).ok()?;
        self.leases.get(place).map(|lease| lease.block)
    }

    /// When the lease was given.
    pub fn leased_at(&self, lease: LeaseId) -> Option<Duration> {
        let place = usize::try_from(lease.0).ok()?;
        self.leases.get(place).map(|lease| lease.begun)
    }

    /// Set the seconds to take in a block.
    pub fn set_intake(&mut self, seconds: f64) {
        self.intake = seconds;
    }

    /// End of the job's passes, exclusive.
    pub fn limit(&self) -> u64 {
        let failed = self.failed.as_ref().map(|failure| failure.pass_index);
        failed.map_or(self.rules.passes, |failed| failed.min(self.rules.passes))
    }

    /// Raise the number of passes. It never falls.
    pub fn extend(&mut self, passes: u64) {
        if passes > self.rules.passes {
            self.set_limit(passes);
        }
    }

    /// Set the number of passes. Those beyond it are no longer needed.
    pub fn set_limit(&mut self, passes: u64) {
        let before = self.rules.passes;
        self.rules.passes = passes;
        self.open.remove(self.limit()..u64::MAX);
        if before < passes {
            self.reopen_passes(before..passes);
        }
    }

    /// Whether all passes below the limit are done, by trusted workers.
    pub fn is_complete(&self) -> bool {
        self.prefix >= self.limit() && self.stained.is_empty()
    }

    /// All passes from the first one to this one, exclusive, are done. At most [`Self::limit`].
    pub fn prefix(&self) -> u64 {
        self.prefix
    }

    /// Passes that are done, including those beyond the prefix.
    pub fn done(&self) -> u64 {
        self.passes_done
    }

    /// The pass that ended the job, if one did.
    pub fn failed(&self) -> Option<&Failure> {
        self.failed.as_ref()
    }

    /// The hash of a done block's pixels.
    pub fn block_hash(&self, block: Block) -> Option<PixelHash> {
        let done = self.done.get(&block.start())?;
        let (_, hash) = done.by.filter(|_| done.block == block)?;
        Some(hash)
    }

    /// Done blocks, in pass order.
    pub fn blocks(&self) -> impl Iterator<Item = &Done> + '_ {
        self.done.values()
    }

    /// The consequences since the last call.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// The first of these passes that is done.
    fn first_done(&self, passes: Range<u64>) -> Option<u64> {
        let before = self.done.range(..passes.start).next_back();
        if before.is_some_and(|(_, done)| done.block.passes().end > passes.start) {
            return Some(passes.start);
        }
        self.done.range(passes).next().map(|(start, _)| *start)
    }

    fn end_leases(&mut self, ended: impl Fn(LeaseId, &Lease) -> bool) -> usize {
        let leases = &self.leases;
        let ended: Vec<LeaseId> = self
            .active
            .iter()
            .copied()
            .filter(|id| ended(*id, &leases[id.0 as usize]))
            .collect();
        ended.iter().for_each(|id| self.end_lease(*id));
        ended.len()
    }

    /// Its passes become open again, except those that are done or that another lease holds.
    fn end_lease(&mut self, lease: LeaseId) {
        if self.active.remove(&lease) && !self.leases[lease.0 as usize].audit {
            self.reopen_passes(self.leases[lease.0 as usize].block.passes());
        }
    }

    fn reopen_passes(&mut self, passes: Range<u64>) {
        let mut again = Ranges::from(passes.start..passes.end.min(self.limit()));
        let held = self.active.iter().map(|id| &self.leases[id.0 as usize]);
        for lease in held.filter(|lease| !lease.audit) {
            again.remove(lease.block.passes());
        }
        let first = self.done.range(..passes.start).next_back();
        for done in first.into_iter().chain(self.done.range(passes)) {
            again.remove(done.1.block.passes());
        }
        again.iter().for_each(|range| self.open.insert(range));
    }
}

#[cfg(test)]
mod tests;
