//! Workers come and go.

use super::level;
use super::standing::{Sentence, Who, Worker};
use super::{Done, Ledger, LedgerError, Note, PixelHash};
use beamfarm_image::job::Block;
use beamfarm_proto::{Device, WorkerId};
use std::collections::BTreeSet;
use std::time::Duration;

/// Workers that are remembered although nothing of theirs counts.
const WORKERS: usize = 8192;

impl Ledger {
    /// Whether there is room for one more worker: those that did nothing and are gone are forgotten for it.
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
        // A long job may have had any number of others.
        let idle = self
            .workers
            .values()
            .filter(|worker| worker.passes == 0 && !worker.is_earlier);
        idle.count() < WORKERS
    }

    /// Whether a worker of this number is remembered.
    pub fn knows(&self, worker: WorkerId) -> bool {
        self.workers.contains_key(&worker)
    }

    /// Whether it can be relied on: nothing speaks against it, and where blocks are checked others found its pixels.
    pub fn is_reliable(&self, worker: WorkerId) -> bool {
        self.workers
            .get(&worker)
            .is_some_and(|worker| worker.is_reliable(&self.rules))
    }

    /// A new worker, that rendered the test picture with these pixels, on this device if it has one. It may have
    /// rendered none where nothing is ever checked.
    ///
    /// Who made another one than workers whose pixels others have found as well is refused. Until there are such,
    /// nobody is: whoever comes first could be the one that computes other bits. Where nothing is ever checked, the
    /// first picture is the one.
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

    /// Whether workers have to show a test picture.
    pub fn asks_for_canary(&self) -> bool {
        self.rules.audit_every > 0
    }

    fn add(&mut self, worker: Worker) -> WorkerId {
        let id = WorkerId(self.next_worker);
        self.next_worker = self.next_worker.wrapping_add(1);
        self.workers.insert(id, worker);
        id
    }

    /// Enter what an earlier life of the job has done: before anything else.
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

    /// Enter that in an earlier life of the job this worker delivered wrong pixels.
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

    /// Enter that an earlier life of the job accepted this block with these pixels: after [`Self::resume`] and
    /// [`Self::resume_rest`]. Those that are not done any more are leased again as they were, to be compared.
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

    /// Enter passes of a sum of whose making nothing is known.
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

    /// The worker's stream of heartbeats broke. When it was its last, its leases end; what it still delivers is
    /// welcome.
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

    /// The connection by which the worker registered is over. One that has opened no stream of heartbeats, whose end
    /// would tell the same, is gone; says how many leases end with it.
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

    /// Whether it was.
    pub fn is_away(&self, worker: WorkerId) -> bool {
        self.workers.get(&worker).is_some_and(|entry| entry.away)
    }

    /// So many passes the worker renders best together.
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

    /// Some worker has neither hung up nor signed off. It may be silent, or shut out.
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

    /// A worker that is not shut out.
    pub(super) fn admitted(&mut self, worker: WorkerId) -> Result<&mut Worker, LedgerError> {
        let unknown = LedgerError::UnknownWorker(worker);
        let entry = self.workers.get_mut(&worker).ok_or(unknown)?;
        match entry.shut_out {
            Some(sentence) => Err(LedgerError::ShutOut(worker, sentence)),
            None => Ok(entry),
        }
    }

    /// What the worker calls itself.
    pub fn name(&self, worker: WorkerId) -> &str {
        self.workers.get(&worker).map_or("", |entry| &entry.who.name)
    }

    /// Who the worker is.
    pub fn who(&self, worker: WorkerId) -> Who {
        let entry = self.workers.get(&worker);
        entry.map_or_else(|| Who::from(""), |entry| entry.who.clone())
    }
}
