//! Who renders what: a state machine of leases. It has no clock, no lock and no network; whoever calls it says what time
//! it is, as the time since the job began.
//!
//! A pass is `open`, `leased` or `done`. Open passes are handed out lowest first, so that the prefix of passes that are
//! done, which is all that an image may be made of, grows without gaps.

use beamfarm_proto::{Grant, LeaseId, WorkerId};
use beamfarm_shared::job::Block;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Hash of a delivered block's pixels.
pub type PixelHash = [u8; 32];

/// How patient a ledger is.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Passes to render: [0, passes).
    pub passes: u64,
    /// A lease ends this long after it was given or last mentioned in a heartbeat.
    pub lease: Duration,
    /// The job fails when one pass failed this often.
    pub failures_per_pass: u32,
    /// A worker is shut out when it sent this many wrong results.
    pub refusals_per_worker: u32,
}

/// What a worker may not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LedgerError {
    /// Not registered here.
    #[error("worker {0:?} is not registered here")]
    UnknownWorker(WorkerId),
    /// Sent too many wrong results.
    #[error("worker {0:?} is shut out after too many wrong results")]
    ShutOut(WorkerId),
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
    /// A block arrived twice, with different bits: one of the two machines is not to be trusted.
    #[error("pass {} was delivered twice with different pixels, first by worker {first:?}, then by {second:?}", block.start())]
    Divergent {
        /// The block.
        block: Block,
        /// Whose pixels count.
        first: WorkerId,
        /// Whose pixels differ.
        second: WorkerId,
    },
}

/// What became of a block that passed every check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// It counts.
    New,
    /// It was there already, with the same bits.
    Duplicate,
    /// It lies beyond a pass that failed for good.
    NotNeeded,
}

/// A pass that no worker could render.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The pass.
    pub pass_index: u64,
    /// How often it was tried.
    pub attempts: u32,
    /// What the last attempt said.
    pub message: String,
}

#[derive(Clone, Copy, Debug)]
struct Lease {
    worker: WorkerId,
    block: Block,
    expires: Duration,
}

#[derive(Clone, Copy, Debug, Default)]
struct Worker {
    refusals: u32,
    accepted: u64,
}

/// The ledger of one job.
#[derive(Debug)]
pub struct Ledger {
    rules: Rules,
    /// Every lease ever given; the lease's number is its place. Kept, because a result may come long after its lease
    /// has ended, and is as good as any.
    leases: Vec<Lease>,
    /// Those that have not ended.
    active: BTreeSet<LeaseId>,
    /// Lowest pass never handed out.
    next: u64,
    /// Handed out once, lost, and to be handed out again. All below `next`.
    returned: BTreeSet<Block>,
    done: BTreeMap<Block, (PixelHash, WorkerId)>,
    /// Lowest pass that is not done.
    prefix: u64,
    workers: BTreeMap<WorkerId, Worker>,
    next_worker: u64,
    failures: BTreeMap<Block, u32>,
    failed: Option<Failure>,
}

impl Ledger {
    /// An empty ledger. Workers are numbered from `first_worker`: differently after every restart, so that a worker of
    /// the coordinator before is not taken for one of this.
    pub fn new(rules: Rules, first_worker: u64) -> Self {
        Self {
            rules,
            leases: Vec::new(),
            active: BTreeSet::new(),
            next: 0,
            returned: BTreeSet::new(),
            done: BTreeMap::new(),
            prefix: 0,
            workers: BTreeMap::new(),
            next_worker: first_worker,
            failures: BTreeMap::new(),
            failed: None,
        }
    }

    /// Begin with this pass, and with these blocks done.
    pub fn resume(&mut self, first_pass: u64, blocks: impl IntoIterator<Item = Block>) {
        (self.prefix, self.next) = (first_pass, first_pass);
        for block in blocks {
            let end = block.passes().end;
            for pass in self.next..end {
                self.returned.insert(Block::leaf(pass));
            }
            for pass in block.passes() {
                self.returned.remove(&Block::leaf(pass));
                self.done.insert(Block::leaf(pass), ([0; 32], WorkerId(0)));
            }
            self.next = self.next.max(end);
        }
        while self.done.contains_key(&Block::leaf(self.prefix)) {
            self.prefix += 1;
        }
    }

    /// A new worker.
    pub fn register(&mut self) -> WorkerId {
        let worker = WorkerId(self.next_worker);
        self.next_worker = self.next_worker.wrapping_add(1);
        self.workers.insert(worker, Worker::default());
        worker
    }

    /// The lowest open pass, if there is one.
    pub fn lease(&mut self, worker: WorkerId, now: Duration) -> Result<Grant, LedgerError> {
        let entry = self.worker(worker)?;
        if entry.refusals >= self.rules.refusals_per_worker {
            return Err(LedgerError::ShutOut(worker));
        }
        if self.is_complete() {
            return Ok(Grant::Done);
        }
        self.expire(now);
        let block = match self.returned.pop_first() {
            Some(block) => block,
            None if self.next < self.limit() => {
                self.next += 1;
                Block::leaf(self.next - 1)
            }
            None => return Ok(Grant::NotNow),
        };
        let lease = LeaseId(self.leases.len() as u64);
        self.leases.push(Lease {
            worker,
            block,
            expires: now + self.rules.lease,
        });
        self.active.insert(lease);
        Ok(Grant::Lease(lease, block))
    }

    /// A sign of life: these leases are still worked on.
    pub fn beat(
        &mut self,
        worker: WorkerId,
        leases: impl IntoIterator<Item = LeaseId>,
        now: Duration,
    ) -> Result<(), LedgerError> {
        self.worker(worker)?;
        for id in leases {
            if !self.active.contains(&id) {
                continue;
            }
            let lease = &mut self.leases[id.0 as usize];
            if lease.worker == worker {
                lease.expires = now + self.rules.lease;
            }
        }
        Ok(())
    }

    /// The worker's connection broke: its leases end. What it still delivers is welcome.
    pub fn lost(&mut self, worker: WorkerId) -> usize {
        self.end_leases(|lease| lease.worker == worker)
    }

    /// End the leases that have run out.
    pub fn expire(&mut self, now: Duration) -> usize {
        self.end_leases(|lease| lease.expires <= now)
    }

    /// Is this the lease that the worker was given for this block? It need not be active.
    pub fn check(&self, worker: WorkerId, lease: LeaseId, block: Block) -> Result<(), LedgerError> {
        self.worker(worker)?;
        let given = usize::try_from(lease.0)
            .ok()
            .and_then(|i| self.leases.get(i));
        match given {
            Some(given) if given.worker == worker && given.block == block => Ok(()),
            _ => Err(LedgerError::NotLeased {
                worker,
                lease,
                block,
            }),
        }
    }

    /// Take in a block that passed every check of its content.
    pub fn accept(
        &mut self,
        worker: WorkerId,
        lease: LeaseId,
        block: Block,
        pixels: PixelHash,
    ) -> Result<Accepted, LedgerError> {
        self.check(worker, lease, block)?;
        self.active.remove(&lease);
        if let Some(&(known, first)) = self.done.get(&block) {
            return if known == pixels {
                Ok(Accepted::Duplicate)
            } else {
                let second = worker;
                Err(LedgerError::Divergent {
                    block,
                    first,
                    second,
                })
            };
        }
        if block.start() >= self.limit() {
            return Ok(Accepted::NotNeeded);
        }
        // Another worker may be rendering it again: its lease must not put the block back.
        let leases = &self.leases;
        self.active
            .retain(|id| leases[id.0 as usize].block != block);
        self.returned.remove(&block);
        self.done.insert(block, (pixels, worker));
        if let Some(entry) = self.workers.get_mut(&worker) {
            entry.accepted += 1;
        }
        while self.done.contains_key(&Block::leaf(self.prefix)) {
            self.prefix += 1;
        }
        Ok(Accepted::New)
    }

    /// The leased block cannot be rendered. After some attempts the job ends before it. A lease fails at most once: what
    /// is said about one that has ended changes nothing.
    pub fn fail(
        &mut self,
        worker: WorkerId,
        lease: LeaseId,
        block: Block,
        message: &str,
    ) -> Result<(), LedgerError> {
        self.check(worker, lease, block)?;
        if !self.active.contains(&lease) {
            return Ok(());
        }
        self.release(lease);
        let attempts = self.failures.entry(block).or_default();
        *attempts += 1;
        let attempts = *attempts;
        let pass_index = block.start();
        if attempts >= self.rules.failures_per_pass
            && pass_index < self.limit()
            && !self.done.contains_key(&block)
        {
            self.failed = Some(Failure {
                pass_index,
                attempts,
                message: message.into(),
            });
            self.returned.retain(|b| b.start() < pass_index);
        }
        Ok(())
    }

    /// What the worker sent was wrong, which says nothing about the block.
    pub fn refuse(&mut self, worker: WorkerId, lease: LeaseId, block: Block) {
        if let Some(entry) = self.workers.get_mut(&worker) {
            entry.refusals += 1;
        }
        if self.check(worker, lease, block).is_ok() {
            self.release(lease);
        }
    }

    /// The block that was leased under this number.
    pub fn leased_block(&self, lease: LeaseId) -> Option<Block> {
        let place = usize::try_from(lease.0).ok()?;
        self.leases.get(place).map(|lease| lease.block)
    }

    /// Passes that the job will have: those asked for, or those before the one that failed.
    pub fn limit(&self) -> u64 {
        match &self.failed {
            Some(failure) => failure.pass_index,
            None => self.rules.passes,
        }
    }

    /// Have so many passes, at least as many as before.
    pub fn extend(&mut self, passes: u64) {
        self.rules.passes = self.rules.passes.max(passes);
    }

    /// Have so many passes, whatever was asked for. Those beyond are not needed any more.
    pub fn set_limit(&mut self, passes: u64) {
        self.rules.passes = passes;
    }

    /// All passes below the limit are done.
    pub fn is_complete(&self) -> bool {
        self.prefix >= self.limit()
    }

    /// Passes [0, prefix) are done.
    pub fn prefix(&self) -> u64 {
        self.prefix
    }

    /// Passes that are done, with those beyond the prefix.
    pub fn done(&self) -> u64 {
        self.done.len() as u64
    }

    /// The pass that ended the job, if one did.
    pub fn failed(&self) -> Option<&Failure> {
        self.failed.as_ref()
    }

    /// The pixels of a pass that is done.
    pub fn pixel_hash(&self, pass_index: u64) -> Option<PixelHash> {
        self.done.get(&Block::leaf(pass_index)).map(|done| done.0)
    }

    /// Passes that counted, per worker.
    pub fn accepted_per_worker(&self) -> impl Iterator<Item = (WorkerId, u64)> + '_ {
        self.workers.iter().map(|(id, entry)| (*id, entry.accepted))
    }

    fn worker(&self, worker: WorkerId) -> Result<&Worker, LedgerError> {
        let unknown = LedgerError::UnknownWorker(worker);
        self.workers.get(&worker).ok_or(unknown)
    }

    fn release(&mut self, lease: LeaseId) {
        if self.active.remove(&lease) {
            let block = self.leases[lease.0 as usize].block;
            if block.start() < self.limit() {
                self.returned.insert(block);
            }
        }
    }

    fn end_leases(&mut self, ended: impl Fn(&Lease) -> bool) -> usize {
        let leases = &self.leases;
        let ended: Vec<LeaseId> = self
            .active
            .iter()
            .copied()
            .filter(|id| ended(&leases[id.0 as usize]))
            .collect();
        ended.iter().for_each(|id| self.release(*id));
        ended.len()
    }
}

#[cfg(test)]
mod tests;
