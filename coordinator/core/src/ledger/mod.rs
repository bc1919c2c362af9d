//! Who renders what: a state machine of leases. It has no clock, no lock and no network; whoever calls it says what
//! time it is, as the time since the job began.
//!
//! A pass is open, leased or done. Open passes are handed out lowest first, in aligned blocks, so that the prefix of
//! passes that are done, which is all that an image may be made of, grows without gaps. What nobody is left to do but
//! wait for is handed out a second time; as passes replay bit for bit, the first result counts and the second confirms
//! it.

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

/// How patient and how suspicious a ledger is.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// First pass to render.
    pub first_pass: u64,
    /// First pass not to render.
    pub passes: u64,
    /// A lease ends this long after it was given or last mentioned in a heartbeat.
    pub lease: Duration,
    /// The job fails when one pass failed this often, on workers that are known to render others, or on all there are.
    pub failures_per_pass: u32,
    /// A worker is shut out when this many of its attempts in a row failed.
    pub failures_per_worker: u32,
    /// A worker is shut out when it sent this many wrong results.
    pub refusals_per_worker: u32,
    /// A worker whose attempt failed gets nothing for this long; twice as long after the next failure, and so on. One
    /// whose lease ran out gets nothing for the length of a lease, and so on, until it delivers something.
    pub back_off: Duration,
    /// One block in so many is rendered again by another worker, and the first ones of every worker; 0: none.
    pub audit_every: u64,
    /// Which blocks that are: nobody can know beforehand who does not know this.
    pub audit_salt: [u8; 32],
}

/// A lease ends when it has run for so many times the average of others, and of its worker, whatever that says.
const LONGEST: f64 = 32.0;

/// What a worker may not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LedgerError {
    /// Not registered here.
    #[error("worker {0:?} is not registered here")]
    UnknownWorker(WorkerId),
    /// Not to be trusted.
    #[error("worker {0:?} is shut out: {1}")]
    ShutOut(WorkerId, Sentence),
    /// The lease was never given to this worker for this block.
    #[error("lease {lease:?} of {block:?} was never given to worker {worker:?}")]
    NotLeased {
        /// Who claims it.
        worker: WorkerId,
        /// The number claimed.
        lease: LeaseId,
        /// The block claimed.
        block: Block,
    },
}

/// What became of a block that passed every check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// It counts.
    New,
    /// It was there already, with the same bits.
    Duplicate,
    /// It was there already, with the same bits, from another worker: now it is certain.
    Confirmed,
    /// It was there already, with other bits. Others will decide.
    Disputed,
    /// It lies beyond a pass that failed for good, or others have rendered some of its passes.
    NotNeeded,
}

/// A pass that no worker could render.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The pass.
    pub pass_index: u64,
    /// How often it was tried.
    pub attempts: u32,
    /// By how many workers.
    pub workers: u32,
    /// What the last attempt said.
    pub message: String,
}

/// What follows from what others did, for whoever writes a log.
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
    /// Whose pixels, and their hash; unknown for passes of a sum that an earlier life of the job left.
    pub by: Option<(WorkerId, PixelHash)>,
    /// Two workers found these pixels.
    pub confirmed: bool,
}

#[derive(Clone, Copy, Debug)]
struct Lease {
    worker: WorkerId,
    block: Block,
    begun: Duration,
    expires: Duration,
    /// Passes of it that the worker has rendered, and when it said so first.
    rendered: u64,
    moved: Duration,
    /// Somebody else has rendered it already.
    audit: bool,
}

/// The time, and how many seconds a pass usually takes, which is a look at all workers.
#[derive(Clone, Copy)]
struct Tempo {
    now: Duration,
    pass: Option<f64>,
}

/// Attempts at a pass that failed.
#[derive(Clone, Debug)]
struct Attempts {
    /// When the first of them did.
    since: Duration,
    count: u32,
    /// Those of workers that were known to render others.
    by_able: u32,
    /// Who has had it.
    workers: BTreeSet<WorkerId>,
}

/// The ledger of one job.
#[derive(Debug)]
pub struct Ledger {
    rules: Rules,
    open: Ranges,
    /// Every lease ever given; the lease's number is its place. Kept, because a result may come long after its lease
    /// has ended, and is as good as any.
    leases: Vec<Lease>,
    /// Those that have not ended.
    active: BTreeSet<LeaseId>,
    /// By first pass; disjoint.
    done: BTreeMap<u64, Done>,
    passes_done: u64,
    /// Lowest pass that is not done.
    prefix: u64,
    workers: BTreeMap<WorkerId, Worker>,
    next_worker: u64,
    /// The test picture that counts, and how many proven workers made each.
    canary: Option<PixelHash>,
    canaries: BTreeMap<PixelHash, u64>,
    /// Names of workers that delivered wrong pixels.
    convicted: BTreeMap<KnownBy, Who>,
    /// Workers that an earlier life of the job knew, by name.
    earlier_workers: BTreeMap<KnownBy, WorkerId>,
    /// By first pass, disjoint: blocks that an earlier life of the job accepted and lost, and whose pixels they had.
    earlier: BTreeMap<u64, (Block, Vec<(WorkerId, PixelHash)>)>,
    attempts: BTreeMap<u64, Attempts>,
    audits: BTreeMap<Block, Audit>,
    /// Blocks of workers that are not to be trusted, still counted.
    stained: Vec<Block>,
    notes: Vec<Note>,
    failed: Option<Failure>,
    /// Workers of this job and of others beside it, where there are such.
    crew: Option<Arc<Crew>>,
    /// Seconds that taking a block in takes.
    intake: f64,
}

impl Ledger {
    /// An empty ledger. Workers are numbered from `first_worker` on.
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

    /// A sign of life: these leases are still worked on, and so many passes of each are rendered.
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

    /// End the leases that have run out: no heartbeat named them, or they take far longer than such blocks do, or one
    /// pass of them does.
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
            // One that is not begun waits for the one before.
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

    /// The longest that a lease of so many passes may last, of which each usually takes so long.
    fn longest(&self, pass: f64, passes: u64) -> Option<Duration> {
        let longest = Duration::try_from_secs_f64(LONGEST * pass * passes as f64).ok()?;
        Some(longest.max(self.rules.lease))
    }

    /// Workers of other jobs may be called to this one.
    pub fn join(&mut self, crew: Arc<Crew>) {
        self.crew = Some(crew);
    }

    /// Whether there is one that was never here and may be called from another job.
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

    /// Whether a lease of the block that began then may last until now: so long those are waited for of whom nothing is
    /// known.
    fn has_time(&self, since: Duration, block: Block, Tempo { now, pass }: Tempo) -> bool {
        let longest = pass.and_then(|pass| self.longest(pass, block.len()));
        longest.is_none_or(|longest| now < since + longest)
    }

    /// Whether a worker that is there would do what others cannot do or shall not: to wait for it is worth while. One
    /// that has never delivered anything is waited for as long as there is time.
    fn is_worth_waiting(&self, worker: &Worker, has_time: bool, now: Duration) -> bool {
        let may_deliver = worker.seconds_per_pass.is_some() || has_time;
        worker.is_at_hand(&self.rules, now) && worker.late == 0 && may_deliver
    }

    /// The worker does not want these leases any more, which is nobody's fault.
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

    /// These leases end without a word about their blocks. What others shall check or try, because it failed, is not
    /// left to these workers any more.
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

    /// Is this the lease that the worker was given for this block? It need not be active.
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

    /// Take in a block that passed every check of its content.
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
        // Others may be rendering some of it again: their leases must not put it back.
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

    /// The leased block cannot be rendered, because of this pass of it. After some attempts the job ends before that. A
    /// lease fails at most once: what is said about one that has ended changes nothing.
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
        // Whoever has rendered nothing, or fails at one pass after another, says nothing about this one as long as
        // others have not tried it.
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

    /// What the worker sent was wrong, which says nothing about the block.
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

    /// When that was.
    pub fn leased_at(&self, lease: LeaseId) -> Option<Duration> {
        let place = usize::try_from(lease.0).ok()?;
        self.leases.get(place).map(|lease| lease.begun)
    }

    /// So long does it take to take a block in, in seconds.
    pub fn set_intake(&mut self, seconds: f64) {
        self.intake = seconds;
    }

    /// First pass that the job will not have.
    pub fn limit(&self) -> u64 {
        let failed = self.failed.as_ref().map(|failure| failure.pass_index);
        failed.map_or(self.rules.passes, |failed| failed.min(self.rules.passes))
    }

    /// Have so many passes, at least as many as before.
    pub fn extend(&mut self, passes: u64) {
        if passes > self.rules.passes {
            self.set_limit(passes);
        }
    }

    /// Have so many passes, whatever was asked for. Those beyond are not needed any more.
    pub fn set_limit(&mut self, passes: u64) {
        let before = self.rules.passes;
        self.rules.passes = passes;
        self.open.remove(self.limit()..u64::MAX);
        if before < passes {
            self.reopen_passes(before..passes);
        }
    }

    /// All passes below the limit are done, by workers that are trusted.
    pub fn is_complete(&self) -> bool {
        self.prefix >= self.limit() && self.stained.is_empty()
    }

    /// All passes below [`Self::limit`] and from the first on, up to this one, are done.
    pub fn prefix(&self) -> u64 {
        self.prefix
    }

    /// Passes that are done, with those beyond the prefix.
    pub fn done(&self) -> u64 {
        self.passes_done
    }

    /// The pass that ended the job, if one did.
    pub fn failed(&self) -> Option<&Failure> {
        self.failed.as_ref()
    }

    /// The pixels of a block that is done.
    pub fn block_hash(&self, block: Block) -> Option<PixelHash> {
        let done = self.done.get(&block.start())?;
        let (_, hash) = done.by.filter(|_| done.block == block)?;
        Some(hash)
    }

    /// Blocks that are done, in the order of their passes.
    pub fn blocks(&self) -> impl Iterator<Item = &Done> + '_ {
        self.done.values()
    }

    /// What followed from what others did, since this was last asked.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// First of these passes that is done.
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

    /// Its passes are open again, but for those that are done or that somebody else holds.
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
