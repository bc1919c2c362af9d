//! Workers come and go.

use super::level;
use super::standing::{Sentence, Who, Worker};
use super::{Done, Ledger, LedgerError, Note, PixelHash};
use beamfarm_image::job::Block;
use beamfarm_proto::{Device, WorkerId};
use std::collections::BTreeSet;
use std::time::Duration;

/// The most workers remembered of which nothing counts.
const WORKERS: usize = 8192;

impl Ledger {
    /// Whether there is room for another worker. Workers that did nothing and are gone are forgotten to make room.
    pub fn has_room(&mut self, now: Duration) -> bool {
        if self.workers.len() < WORKERS {
            return true;
        }
        let holds: BTreeSet<WorkerId> = self.active.iter().map(|id| self.leases[id.0 as usize].worker).collect();
        let votes = self.audits.values().flat_map(|audit| &audit.votes);
        let judges: BTreeSet<WorkerId> = votes.map(|(worker, _)| *worker).collect();
        let rules = self.rules;
        self.workers.retain(|id, worker| {
            let matters = worker.is_earlier || worker.passes > 0 || holds.contains(id) || judges.contains(id);
            matters || worker.attending > 0 || worker.is_present(&rules, now)
        });
        // Over a long job there may be any number of workers with passes.
        let idle = self
            .workers
            .values()
            .filter(|worker| worker.passes == 0 && !worker.is_earlier);
        idle.count() < WORKERS
    }

    /// Whether the worker is remembered.
    pub fn knows(&self, worker: WorkerId) -> bool {
        self.workers.contains_key(&worker)
    }

    /// Whether the worker can be relied on: nothing speaks against it, and where blocks are checked others confirmed
    /// its pixels.
    pub fn is_reliable(&self, worker: WorkerId) -> bool {
        self.workers
            .get(&worker)
            .is_some_and(|worker| worker.is_reliable(&self.rules))
    }

    /// Register a worker with the hash of its test picture and its device, if any. Where nothing is ever checked, there
    /// may be no picture.
    ///
    /// A worker is refused if its picture differs from that of proven workers. Until there are any, nobody is refused:
    /// the first worker could be the one that computes wrong bits. Where nothing is ever checked, the first picture is
    /// the right one.
    pub fn register(
        &mut self,
        who: impl Into<Who>,
        threads: u32,
        canary: Option<PixelHash>,
        device: Option<Device>,
        now: Duration,
    ) -> Result<WorkerId, Sentence> {
        let who = who.into();
        if self.convicted.contains_key(&who.known_by()) {
            return Err(Sentence::Key);
        }
        if self.rules.audit_every == 0 {
            self.canary = self.canary.or(canary);
        }
        let differs = |known| canary.is_some_and(|canary| canary != known);
        if self.canary.is_some_and(differs) {
            return Err(Sentence::Canary);
        }
        Ok(self.add(Worker {
            canary,
            device,
            ..Worker::new(who, threads, now)
        }))
    }

    /// Whether workers must render a test picture.
    pub fn asks_for_canary(&self) -> bool {
        self.rules.audit_every > 0
    }

    fn add(&mut self, worker: Worker) -> WorkerId {
        let id = WorkerId(self.next_worker);
        self.next_worker = self.next_worker.wrapping_add(1);
        self.workers.insert(id, worker);
        id
    }

    /// Enter what an earlier run of the job has done. Call it first.
    pub fn resume<'a>(&mut self, blocks: impl IntoIterator<Item = (Block, Option<(&'a Who, PixelHash)>, bool)>) {
        for (block, by, confirmed) in blocks {
            if self.first_done(block.passes()).is_some() {
                continue;
            }
            let by = by.map(|(who, hash)| (self.earlier_worker(who), hash));
            self.open.remove(block.passes());
            self.enter(Done { block, by, confirmed });
        }
    }

    /// Note that this worker delivered wrong pixels in an earlier run of the job.
    pub fn resume_convicted(&mut self, who: &Who) {
        self.convicted.insert(who.known_by(), who.clone());
    }

    fn earlier_worker(&mut self, who: &Who) -> WorkerId {
        if let Some(id) = self.earlier_workers.get(&who.known_by()) {
            return *id;
        }
        let id = self.add(Worker::earlier(who.clone()));
        self.earlier_workers.insert(who.known_by(), id);
        id
    }

    /// Note that an earlier run of the job accepted this block with these pixels. Call it after [`Self::resume`] and
    /// [`Self::resume_rest`]. Blocks that are no longer done are leased again unchanged, for comparison.
    pub fn expect(&mut self, block: Block, who: &Who, hash: PixelHash) {
        if let Some(known) = self.done.get(&block.start()).copied() {
            if let Some(vote) = known.by.filter(|_| known.block == block && !known.confirmed)
                && vote.1 != hash
            {
                let earlier = (self.earlier_worker(who), hash);
                self.dispute(block, vote, vec![earlier], Duration::ZERO);
            }
            return;
        }
        let fits = block.level <= level::highest_at(block.start());
        if !fits || self.first_done(block.passes()).is_some() {
            return;
        }
        let other = self.earlier.range(..block.passes().end).next_back();
        let other = other.map(|(_, (other, _))| *other);
        if other.is_some_and(|other| other != block && other.passes().end > block.start()) {
            return;
        }
        let earlier = (self.earlier_worker(who), hash);
        let (_, votes) = self.earlier.entry(block.start()).or_insert((block, Vec::new()));
        if !votes.contains(&earlier) {
            votes.push(earlier);
        }
    }

    /// Enter passes of a sum about which nothing else is known.
    pub fn resume_rest(&mut self, nodes: impl IntoIterator<Item = Block>) {
        for node in nodes {
            let mut rest = vec![node];
            while let Some(block) = rest.pop() {
                let known = self.done.get(&block.start());
                if known.is_some_and(|done| done.block == block) {
                    continue;
                }
                if self.first_done(block.passes()).is_none() {
                    self.resume([(block, None, false)]);
                } else if block.level > 0 {
                    let left = Block {
                        level: block.level - 1,
                        index: 2 * block.index,
                    };
                    rest.extend([left.sibling(), left]);
                }
            }
        }
    }

    /// The worker opened a stream of heartbeats.
    pub fn attend(&mut self, worker: WorkerId, now: Duration) -> Result<(), LedgerError> {
        let entry = self.admitted(worker)?;
        entry.seen(now);
        entry.attending += 1;
        Ok(())
    }

    /// A heartbeat stream of the worker broke. If it was the last, the worker's leases end; results that still arrive
    /// count.
    pub fn detach(&mut self, worker: WorkerId) -> usize {
        let Some(entry) = self.workers.get_mut(&worker) else {
            return 0;
        };
        entry.attending = entry.attending.saturating_sub(1);
        match entry.attending {
            0 => self.lost(worker),
            _ => 0,
        }
    }

    /// The connection through which the worker registered is closed. A worker without a heartbeat stream, whose end
    /// would say the same, is gone; returns how many of its leases end.
    pub fn hung_up(&mut self, worker: WorkerId) -> Option<usize> {
        let entry = self.workers.get(&worker)?;
        let is_gone = entry.attending == 0 && !entry.gone;
        is_gone.then(|| self.lost(worker))
    }

    /// The worker is told that another job has work.
    pub fn send_away(&mut self, worker: WorkerId) {
        if let Some(entry) = self.workers.get_mut(&worker) {
            entry.away = true;
        }
    }

    /// Whether the worker was sent to another job.
    pub fn is_away(&self, worker: WorkerId) -> bool {
        self.workers.get(&worker).is_some_and(|entry| entry.away)
    }

    /// Note how many passes the worker renders best together.
    pub fn renders_together(&mut self, worker: WorkerId, passes: u32) {
        if let Some(entry) = self.workers.get_mut(&worker) {
            entry.together = passes.max(1);
        }
    }

    /// A sign of life from a worker that is at another job.
    pub fn seen_away(&mut self, worker: WorkerId, now: Duration) {
        if let Some(entry) = self.workers.get_mut(&worker).filter(|entry| entry.away) {
            entry.last_seen = entry.last_seen.max(now);
        }
    }

    /// A worker that was sent away comes back.
    pub fn welcome_back(&mut self, worker: WorkerId, now: Duration) -> Result<(), LedgerError> {
        let entry = self.admitted(worker)?;
        entry.seen(now);
        entry.away = false;
        Ok(())
    }

    /// Workers that delivered wrong pixels.
    pub fn convicted(&self) -> impl Iterator<Item = &Who> {
        self.convicted.values()
    }

    /// Whether some worker has neither hung up nor signed off. It may be silent or shut out.
    pub fn has_company(&self) -> bool {
        self.workers.values().any(|worker| !worker.gone)
    }

    /// The worker is gone: its leases end.
    pub fn lost(&mut self, worker: WorkerId) -> usize {
        if let Some(entry) = self.workers.get_mut(&worker) {
            entry.gone = true;
        }
        self.end_leases(|_, lease| lease.worker == worker)
    }

    /// Give the worker nothing more.
    pub(super) fn shut_out(&mut self, worker: WorkerId, sentence: Sentence) {
        let Some(entry) = self.workers.get_mut(&worker) else {
            return;
        };
        if entry.shut_out.is_none() {
            entry.shut_out = Some(sentence);
            if sentence.is_conviction() {
                self.convicted.insert(entry.who.known_by(), entry.who.clone());
            }
            self.notes.push(Note::ShutOut(worker, sentence));
        }
        self.end_leases(|_, lease| lease.worker == worker);
    }

    pub(super) fn worker(&self, worker: WorkerId) -> Result<&Worker, LedgerError> {
        let unknown = LedgerError::UnknownWorker(worker);
        self.workers.get(&worker).ok_or(unknown)
    }

    /// The worker, unless it is shut out.
    pub(super) fn admitted(&mut self, worker: WorkerId) -> Result<&mut Worker, LedgerError> {
        let unknown = LedgerError::UnknownWorker(worker);
        let entry = self.workers.get_mut(&worker).ok_or(unknown)?;
        match entry.shut_out {
            Some(sentence) => Err(LedgerError::ShutOut(worker, sentence)),
            None => Ok(entry),
        }
    }

    /// The worker's name for itself.
    pub fn name(&self, worker: WorkerId) -> &str {
        self.workers.get(&worker).map_or("", |entry| &entry.who.name)
    }

    /// The worker's identity.
    pub fn who(&self, worker: WorkerId) -> Who {
        let entry = self.workers.get(&worker);
        entry.map_or_else(|| Who::from(""), |entry| entry.who.clone())
    }
}
