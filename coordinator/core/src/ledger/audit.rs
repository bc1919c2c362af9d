//! Blocks that several workers render, and what follows when their bits differ.
//!
//! A block is checked because it is one of a worker's first, because it was drawn, because it looks unlike others, or
//! because it happened to be rendered twice. Blocks from devices are checked on devices of other makers where possible.
//! When two workers disagree, others render the block until two agree; every worker that differs is shut out. What it
//! delivered and nobody confirmed is taken back: the caller removes it from the sum ([`Ledger::stained`]) and reports
//! what went with it ([`Ledger::reopen`]), and it is rendered again.

use super::standing::{Likeness, Sentence, Worker};
use super::{Accepted, Done, Lease, Ledger, LedgerError, Note, PixelHash};
use beamfarm_image::job::Block;
use beamfarm_proto::{Fingerprint, WorkerId};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// A worker's first blocks are all checked, so that a worker that lies from its first pass on is found before even a
/// short job ends. One that starts lying later is found with probability 1 - (1 - 1 / [`super::Rules::audit_every`])^n
/// after n lies.
const TRIAL: u32 = 2;

/// A block that is to be rendered again.
#[derive(Clone, Debug)]
pub(super) struct Audit {
    /// Results so far; the first is the one whose pixels count.
    pub votes: Vec<(WorkerId, PixelHash)>,
    /// Workers that failed to render it.
    pub unable: BTreeSet<WorkerId>,
    /// Workers that had it to render and did not: they kept it too long or gave it back.
    pub unwilling: BTreeSet<WorkerId>,
    /// When the block was drawn, or the dispute began.
    since: Duration,
}

impl Audit {
    pub fn new(worker: WorkerId, pixels: PixelHash, now: Duration) -> Self {
        Self {
            votes: vec![(worker, pixels)],
            unable: BTreeSet::new(),
            unwilling: BTreeSet::new(),
            since: now,
        }
    }

    /// Whether two workers disagree.
    fn is_disputed(&self) -> bool {
        self.votes.windows(2).any(|votes| votes[0].1 != votes[1].1)
    }

    /// Whether the worker can add a vote and would. One that failed to render the block may try again only if others
    /// disagree.
    fn may_judge(&self, worker: WorkerId) -> bool {
        let would = !self.unwilling.contains(&worker) && (self.is_disputed() || !self.unable.contains(&worker));
        would && self.votes.iter().all(|(voter, _)| *voter != worker)
    }

    /// The pixels that two workers found, if any.
    fn verdict(&self) -> Option<PixelHash> {
        let found = |hash: &PixelHash| self.votes.iter().filter(|(_, h)| h == hash).count();
        let twice = self.votes.iter().find(|(_, hash)| found(hash) > 1);
        twice.map(|(_, hash)| *hash)
    }
}

impl Ledger {
    /// Whether this block, which has just arrived, is one of the worker's first.
    pub(super) fn is_tried(&mut self, worker: WorkerId) -> bool {
        if self.rules.audit_every == 0 {
            return false;
        }
        let Some(entry) = self.workers.get_mut(&worker) else {
            return false;
        };
        let is_tried = entry.tried < TRIAL;
        entry.tried += u32::from(is_tried);
        is_tried
    }

    /// Whether the block is drawn: one in [`super::Rules::audit_every`] is.
    pub(super) fn is_drawn(&self, block: Block) -> bool {
        let every = self.rules.audit_every;
        if every == 0 {
            return false;
        }
        let mut hasher = blake3::Hasher::new_keyed(&self.rules.audit_salt);
        hasher.update(&block.start().to_le_bytes());
        hasher.update(&block.level.to_le_bytes());
        let bytes = hasher.finalize();
        let number = bytes.as_bytes()[..8].iter();
        let number = number.fold(0, |number, byte| number << 8 | u64::from(*byte));
        number.is_multiple_of(every)
    }

    /// Have a block that counts checked, because it looks unlike others.
    pub fn suspect(&mut self, block: Block, now: Duration) {
        let known = self.done.get(&block.start());
        let known = known.filter(|done| done.block == block && !done.confirmed);
        if let Some((worker, pixels)) = known.and_then(|done| done.by)
            && self.rules.audit_every > 0
        {
            let audit = || Audit::new(worker, pixels, now);
            self.audits.entry(block).or_insert_with(audit);
        }
    }

    /// A block that this worker may check: disputed ones first, then those from devices least like its own.
    pub(super) fn audit_for(&self, worker: WorkerId, now: Duration) -> Option<Block> {
        let (checks, has_devices) = (self.checks(), self.has_devices());
        let disputed = |audit: &Audit| audit.is_disputed();
        let mine = self.wanted().filter(|(block, _)| !checks.contains_key(block));
        let mine = mine.filter(|(_, audit)| self.may_judge(audit, worker));
        let is_left = |audit: &Audit| has_devices && self.is_left_to_others(audit, worker, now);
        let mine = mine.filter(|(_, audit)| disputed(audit) || !is_left(audit));
        let likeness = |audit: &Audit| self.likeness(audit, worker);
        let first = mine.min_by_key(|(block, audit)| (!disputed(audit), likeness(audit), block.start()));
        first.map(|(block, _)| *block)
    }

    /// Blocks that others are checking and that this worker could check too, each with the time from which on it is
    /// late.
    pub(super) fn late_audits(&self, worker: WorkerId) -> Vec<(Duration, Block)> {
        let pass = self.seconds_per_pass();
        let checks = self.checks().into_iter();
        let late = checks.filter_map(|(block, leases)| {
            let audit = self.audits.get(&block).filter(|_| block.start() < self.limit())?;
            let is_free = leases.iter().all(|lease| lease.worker != worker) && self.may_judge(audit, worker);
            let begun = leases.iter().map(|lease| lease.begun).min()?;
            let late = is_free.then(|| self.late(block, begun, leases.len(), pass))?;
            Some((late?, block))
        });
        late.collect()
    }

    /// Leases of blocks that are being checked.
    fn checks(&self) -> BTreeMap<Block, Vec<&Lease>> {
        let mut checks: BTreeMap<Block, Vec<&Lease>> = BTreeMap::new();
        let leases = self.active.iter().map(|id| &self.leases[id.0 as usize]);
        for lease in leases.filter(|lease| lease.audit) {
            checks.entry(lease.block).or_default().push(lease);
        }
        checks
    }

    /// Whether any worker uses a device; without, all workers are alike.
    fn has_devices(&self) -> bool {
        self.workers.values().any(|worker| worker.device.is_some())
    }

    /// How alike this worker's device is to that of the worker whose pixels count.
    fn likeness(&self, audit: &Audit, worker: WorkerId) -> Likeness {
        let first = audit.votes.first().and_then(|(first, _)| self.workers.get(first));
        let likeness = first.zip(self.workers.get(&worker)).map(|(a, b)| a.likeness(b));
        likeness.unwrap_or(Likeness::Alike)
    }

    /// Whether a worker is present whose device differs more and which shall check the block. Limited in time: it may
    /// be slow.
    fn is_left_to_others(&self, audit: &Audit, worker: WorkerId, now: Duration) -> bool {
        let own = self.likeness(audit, worker);
        if own == Likeness::OtherDriver || now >= audit.since + self.rules.lease {
            return false;
        }
        let mut others = self.workers.iter();
        others.any(|(id, other)| {
            other.is_present(&self.rules, now) && self.likeness(audit, *id) < own && self.may_judge(audit, *id)
        })
    }

    /// Whether another worker shall render the block again.
    pub fn is_to_be_checked(&self, block: Block) -> bool {
        self.audits.contains_key(&block)
    }

    /// Whether nothing is left to do: all passes are done, and all blocks that somebody could check are checked.
    pub fn is_over(&self, now: Duration) -> bool {
        if !self.is_complete() {
            return false;
        }
        let tempo = self.tempo(now);
        let waits = |block: Block, audit: &Audit| {
            let has_time = self.has_time(audit.since, block, tempo);
            let judges = self.workers.iter();
            let mut judges = judges.filter(|(_, worker)| self.is_worth_waiting(worker, has_time, now));
            let judge = judges.any(|(id, _)| self.may_judge(audit, *id));
            // A judge may still come.
            let may_come = audit.is_disputed() && now < audit.since + self.rules.lease;
            judge || may_come || (has_time && self.may_call())
        };
        !self.wanted().any(|(block, audit)| waits(*block, audit))
    }

    /// The audits of blocks that the job still needs.
    fn wanted(&self) -> impl Iterator<Item = (&Block, &Audit)> {
        let limit = self.limit();
        let audits = self.audits.iter();
        audits.filter(move |(block, _)| block.start() < limit)
    }

    /// The number of pending audits, and how many of them are disputed.
    pub fn audits_pending(&self) -> (u64, u64) {
        let disputed = self.wanted().filter(|(_, audit)| audit.is_disputed());
        (self.wanted().count() as u64, disputed.count() as u64)
    }

    /// Compare a repeated delivery with the block that counts.
    pub(super) fn compare(
        &mut self,
        worker: WorkerId,
        known: Done,
        pixels: PixelHash,
        now: Duration,
    ) -> Result<Accepted, LedgerError> {
        let block = known.block;
        let Some((first, hash)) = known.by else {
            return Ok(Accepted::Duplicate);
        };
        let audit = self.audits.get(&block);
        let alone = [(first, hash)];
        let votes = audit.map_or(&alone[..], |audit| &audit.votes);
        if let Some((_, before)) = votes.iter().find(|(voter, _)| *voter == worker) {
            if *before == pixels {
                return Ok(Accepted::Duplicate);
            }
            self.convict(worker, Sentence::Contradiction);
            return Err(LedgerError::ShutOut(worker, Sentence::Contradiction));
        }
        let same = |(voter, before): &(WorkerId, PixelHash)| *before == pixels && self.was_earlier(*voter, worker);
        if votes.iter().any(same) {
            // It adds no vote.
            return Ok(Accepted::Duplicate);
        }
        if known.confirmed {
            // Two against one.
            return match hash == pixels {
                true => Ok(Accepted::Duplicate),
                false => {
                    self.convict(worker, Sentence::WrongPixels);
                    Err(LedgerError::ShutOut(worker, Sentence::WrongPixels))
                }
            };
        }
        let audit = self.audits.entry(block).or_insert_with(|| Audit::new(first, hash, now));
        let news = !audit.is_disputed();
        audit.votes.push((worker, pixels));
        let Some(winner) = audit.verdict() else {
            if news {
                audit.since = now;
                self.notes.push(Note::Disputed(block, first, worker));
            }
            return Ok(Accepted::Disputed);
        };
        let votes = self.audits.remove(&block).map(|audit| audit.votes);
        let votes = votes.unwrap_or_default();
        self.end_leases(|_, lease| lease.audit && lease.block == block);
        if winner == hash {
            if let Some(done) = self.done.get_mut(&block.start()) {
                done.confirmed = true;
            }
            if let Some(entry) = self.workers.get_mut(&first) {
                entry.audits_passed += 1;
            }
            self.notes.push(Note::Confirmed(block, worker, pixels));
        }
        for (voter, _) in votes.iter().filter(|(_, vote)| *vote == winner) {
            self.prove(*voter);
        }
        for (voter, _) in votes.iter().filter(|(_, vote)| *vote != winner) {
            self.convict(*voter, Sentence::WrongPixels);
            let others = self.workers.keys().copied();
            let later: Vec<WorkerId> = others
                .filter(|later| self.was_earlier(*voter, *later))
                .filter(|later| votes.iter().all(|(good, _)| good != later))
                .collect();
            for later in later {
                self.convict(later, Sentence::Key);
            }
        }
        match pixels == winner {
            true => Ok(Accepted::Confirmed),
            false => Err(LedgerError::ShutOut(worker, Sentence::WrongPixels)),
        }
    }

    /// Another worker found the same pixels as this one, so its test picture counts as well. The picture of most proven
    /// workers is the right one; in a tie, the first. Unproven workers with a different picture are shut out, as
    /// workers with wrong pixels are.
    fn prove(&mut self, worker: WorkerId) {
        let Some(entry) = self.workers.get_mut(&worker) else {
            return;
        };
        let news = !std::mem::replace(&mut entry.is_proven, true);
        let Some(canary) = entry.canary.filter(|_| news) else {
            return;
        };
        let votes = self.canaries.entry(canary).or_default();
        *votes += 1;
        let votes = *votes;
        let known = self.canary.and_then(|known| self.canaries.get(&known));
        if self.canary == Some(canary) || known.is_some_and(|known| votes <= *known) {
            return;
        }
        self.canary = Some(canary);
        let differs = |worker: &Worker| !worker.is_proven && worker.canary.is_some_and(|other| other != canary);
        let wrong = self.workers.iter().filter(|(_, worker)| differs(worker));
        let wrong: Vec<WorkerId> = wrong.map(|(id, _)| *id).collect();
        for id in wrong {
            self.convict(id, Sentence::Canary);
        }
    }

    /// Whether `earlier` is the record of `worker` from an earlier run of the job.
    fn was_earlier(&self, earlier: WorkerId, worker: WorkerId) -> bool {
        if self.earlier_workers.is_empty() {
            return false;
        }
        let known = self.earlier_workers.get(&self.who(worker).known_by());
        earlier != worker && known == Some(&earlier)
    }

    /// Whether the worker can add a vote: it has not voted, not even under another number.
    fn may_judge(&self, audit: &Audit, worker: WorkerId) -> bool {
        let mut voters = audit.votes.iter();
        audit.may_judge(worker) && !voters.any(|(voter, _)| self.was_earlier(*voter, worker))
    }

    /// A block was rendered again because an earlier run of the job had lost it. It counts; if its pixels differ from
    /// the earlier ones, others have to decide.
    pub(super) fn compare_with_earlier(&mut self, block: Block, vote: (WorkerId, PixelHash), now: Duration) {
        let lost = self.earlier.range(..block.passes().end).rev();
        let overlapping = lost.take_while(|(_, (lost, _))| lost.passes().end > block.start());
        let overlapping: Vec<u64> = overlapping.map(|(start, _)| *start).collect();
        for start in overlapping {
            let Some((lost, votes)) = self.earlier.remove(&start) else {
                continue;
            };
            if lost == block {
                self.dispute(block, vote, votes, now);
            }
        }
    }

    /// Others have to decide if one of these earlier votes differs from the one that counts.
    pub(super) fn dispute(
        &mut self,
        block: Block,
        vote: (WorkerId, PixelHash),
        earlier: Vec<(WorkerId, PixelHash)>,
        now: Duration,
    ) {
        let Some((other, _)) = earlier.iter().find(|(_, hash)| *hash != vote.1) else {
            return;
        };
        self.notes.push(Note::Disputed(block, *other, vote.0));
        let mut audit = Audit::new(vote.0, vote.1, now);
        audit.votes.extend(earlier);
        self.audits.insert(block, audit);
    }

    /// Shut out a worker that is not trusted, and mark its blocks that nobody confirmed.
    pub(super) fn convict(&mut self, worker: WorkerId, sentence: Sentence) {
        if let Some(entry) = self.workers.get_mut(&worker) {
            entry.audits_failed += 1;
        }
        self.shut_out(worker, sentence);
        // And under any other number that it has here.
        let key = self.workers.get(&worker).and_then(|entry| entry.who.key);
        if let Some(key) = key.filter(|_| sentence.is_conviction()) {
            self.convict_key(key);
        }
        let by = |done: &&Done| !done.confirmed && done.by.is_some_and(|(id, _)| id == worker);
        let stained = self.done.values().filter(by).map(|done| done.block);
        self.stained.extend(stained);
        for (_, votes) in self.earlier.values_mut() {
            votes.retain(|(voter, _)| *voter != worker);
        }
        self.audits.retain(|_, audit| {
            let counts = audit.votes.first().is_some_and(|(first, _)| *first == worker);
            audit.votes.retain(|(voter, _)| *voter != worker);
            !counts
        });
    }

    /// The owner of this key delivered wrong pixels, here or for another job.
    pub fn convict_key(&mut self, key: Fingerprint) {
        let own = self
            .workers
            .iter()
            .filter(|(_, entry)| entry.who.key == Some(key) && entry.shut_out.is_none());
        let own: Vec<WorkerId> = own.map(|(id, _)| *id).collect();
        for id in own {
            self.convict(id, Sentence::Key);
        }
    }

    /// Blocks that still count but must not. Take them out of the sum, then pass them to [`Self::reopen`].
    pub fn stained(&self) -> &[Block] {
        &self.stained
    }

    /// These blocks are no longer part of the sum: all passes that they cover are open again. Returns what counted
    /// until now.
    pub fn reopen(&mut self, blocks: &[Block]) -> Vec<Done> {
        let mut dropped = Vec::new();
        for block in blocks {
            let covered = self.done.range(block.passes());
            dropped.extend(covered.map(|(_, done)| *done));
        }
        for done in &dropped {
            self.done.remove(&done.block.start());
            self.audits.remove(&done.block);
            self.passes_done -= done.block.len();
            self.prefix = self.prefix.min(done.block.start());
            if let Some(entry) = done.by.and_then(|(id, _)| self.workers.get_mut(&id)) {
                entry.passes = entry.passes.saturating_sub(done.block.len());
            }
        }
        for done in &dropped {
            self.end_leases(|_, lease| lease.audit && lease.block == done.block);
            self.reopen_passes(done.block.passes());
        }
        self.stained.clear();
        dropped
    }
}
