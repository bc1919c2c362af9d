//! Which block a worker gets.

use super::level::{self, Load};
use super::standing::Worker;
use super::{Lease, Ledger, LedgerError, Tempo};
use beamfarm_image::job::Block;
use beamfarm_proto::{Grant, LeaseId, WorkerId};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Duration;

/// A lease is a straggler when it has run for this many times the usual time. Each further copy multiplies the time
/// again.
const STRAGGLER: f64 = 2.0;
/// The most leases of one block at a time.
const COPIES: usize = 8;
/// The most leases of one worker. It renders one block, has the next ready and the previous on its way.
const HELD: usize = 16;

/// Of late blocks, the one that is due first.
fn due(late: impl IntoIterator<Item = (Duration, Block)>, now: Duration) -> Option<Block> {
    let late = late.into_iter().filter(|(due, _)| *due <= now);
    late.min().map(|(_, block)| block)
}

impl Ledger {
    /// The next block for this worker, if any: one to check, the lowest open passes, or one that another worker is late
    /// with.
    pub fn lease(&mut self, worker: WorkerId, now: Duration) -> Result<Grant, LedgerError> {
        let entry = self.admitted(worker)?;
        entry.seen(now);
        entry.away = false;
        self.expire(now);
        if self.is_over(now) {
            return Ok(Grant::Done);
        }
        if self.workers[&worker].not_before > now || self.has_enough(worker) {
            return Ok(Grant::NotNow);
        }
        let pass = || {
            self.next_block(worker, now)
                .or_else(|| due(self.stragglers(worker, now), now))
        };
        let (block, is_audit) = match self.audit_for(worker, now) {
            Some(block) => (Some(block), true),
            None => match pass() {
                Some(block) => (Some(block), false),
                None => (due(self.late_audits(worker), now), true),
            },
        };
        Ok(match block {
            Some(block) => Grant::Lease(self.grant(worker, block, is_audit, now), block),
            None => Grant::NotNow,
        })
    }

    /// Blocks that this worker, or a new one for `None`, would be given now, as far as they can be counted, as an upper
    /// bound. `is_idle`: it has nothing else to do, so that late blocks count too.
    pub fn openings(&self, worker: Option<WorkerId>, is_idle: bool, now: Duration) -> u64 {
        let known = worker.and_then(|worker| self.workers.get(&worker));
        let waits = known.is_some_and(|known| known.shut_out.is_some() || known.not_before > now);
        // A number that no worker has.
        let worker = worker.unwrap_or(WorkerId(u64::MAX));
        if self.is_over(now) || waits || self.has_enough(worker) {
            return 0;
        }
        let open = match self.next_block(worker, now) {
            Some(_) => self.open.count(),
            None => 0,
        };
        let late = || {
            due(
                self.stragglers(worker, now).into_iter().chain(self.late_audits(worker)),
                now,
            )
        };
        let again = [self.audit_for(worker, now), is_idle.then(late).flatten()];
        open + again.iter().flatten().count() as u64
    }

    /// Whether the worker holds as many leases as it may.
    fn has_enough(&self, worker: WorkerId) -> bool {
        let leases = self.active.iter().map(|id| &self.leases[id.0 as usize]);
        leases.filter(|lease| lease.worker == worker).count() >= HELD
    }

    /// Lease this block: the worker has it or is rendering it, from before the coordinator was restarted.
    pub fn claim(&mut self, worker: WorkerId, block: Block, now: Duration) -> Option<LeaseId> {
        let fits = block.level <= level::highest_at(block.start());
        let open = fits && self.open.contains(&block.passes());
        let admitted = self.admitted(worker).is_ok();
        (open && admitted).then(|| self.grant(worker, block, false, now))
    }

    fn grant(&mut self, worker: WorkerId, block: Block, audit: bool, now: Duration) -> LeaseId {
        let lease = LeaseId(self.leases.len() as u64);
        self.leases.push(Lease {
            worker,
            block,
            begun: now,
            expires: now + self.rules.lease,
            rendered: 0,
            moved: now,
            audit,
        });
        self.active.insert(lease);
        if !audit {
            self.open.remove(block.passes());
        }
        lease
    }

    /// The lowest open passes that the worker may try.
    fn next_block(&self, worker: WorkerId, now: Duration) -> Option<Block> {
        let (load, tempo) = (self.load(worker, now), self.tempo(now));
        let open = self.open.count();
        for Range { mut start, end } in self.open.iter() {
            while start < end {
                if !self.attempts.contains_key(&start) {
                    // Failed passes are tried individually.
                    let next = self.attempts.range(start..end).next();
                    let end = next.map_or(end, |(pass, _)| *pass);
                    return Some(self.first_block(start..end, open, &load));
                }
                if self.may_try(worker, start, tempo) {
                    return Some(Block::leaf(start));
                }
                start += 1;
            }
        }
        None
    }

    /// Whether the worker may try this pass: it has not had it, or every other worker worth waiting for has.
    fn may_try(&self, worker: WorkerId, pass_index: u64, tempo: Tempo) -> bool {
        let Some(attempts) = self
            .attempts
            .get(&pass_index)
            .filter(|attempts| attempts.workers.contains(&worker))
        else {
            return true;
        };
        let has_time = self.has_time(attempts.since, Block::leaf(pass_index), tempo);
        let mut others = self.workers.iter().filter(|(id, _)| !attempts.workers.contains(id));
        !others.any(|(_, other)| self.is_worth_waiting(other, has_time, tempo.now))
    }

    /// The first block of this range. A block that an earlier run of the job lost keeps its extent, so that it can be
    /// compared.
    fn first_block(&self, range: Range<u64>, open: u64, load: &Load) -> Block {
        let lost = self.earlier.range(range.clone()).next();
        let end = match lost {
            Some((start, (block, _))) if *start == range.start => {
                if block.passes().end <= range.end {
                    return *block;
                }
                range.end
            }
            Some((start, _)) => *start,
            None => range.end,
        };
        level::first_block(&(range.start..end), open, load)
    }

    /// The load for this worker. If its time per pass is unknown, the mean is used.
    fn load(&self, worker: WorkerId, now: Duration) -> Load {
        let mean = self.seconds_per_pass().unwrap_or(0.0);
        let pass = |worker: &Worker| worker.seconds_per_pass.unwrap_or(mean);
        let present = self.workers.values();
        let present: Vec<f64> = present
            .filter(|worker| worker.is_present(&self.rules, now))
            .map(pass)
            .collect();
        let known = self.workers.get(&worker);
        let own = known.map_or(mean, pass);
        // Passes that all workers render in the time in which this one renders one.
        let all: f64 = present.iter().map(|pass| own / pass).sum();
        Load {
            workers: present.len() as u64,
            share: if all.is_finite() && all > 0.0 {
                1.0 / all
            } else {
                1.0 / present.len().max(1) as f64
            },
            pass: own,
            together: known.map_or(1, |known| known.together.into()),
            intake: self.intake,
        }
    }

    /// Mean over the workers that have rendered something and are not gone.
    pub(super) fn seconds_per_pass(&self) -> Option<f64> {
        let there = self.workers.values().filter(|worker| !worker.gone);
        let times: Vec<f64> = there.filter_map(|worker| worker.seconds_per_pass).collect();
        (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
    }

    /// Blocks that this worker could take over, each with the time from which on it is late.
    fn stragglers(&self, worker: WorkerId, now: Duration) -> Vec<(Duration, Block)> {
        // When the block was first leased, how many leases it has, and whether this worker may have it.
        let mut blocks: BTreeMap<Block, (Duration, usize, bool)> = BTreeMap::new();
        let tempo = self.tempo(now);
        for LeaseId(place) in &self.active {
            let lease = &self.leases[*place as usize];
            if lease.audit {
                continue;
            }
            let first = (lease.begun, 0, self.may_try(worker, lease.block.start(), tempo));
            let (begun, copies, free) = blocks.entry(lease.block).or_insert(first);
            *begun = lease.begun.min(*begun);
            *copies += 1;
            *free &= lease.worker != worker;
        }
        let free = blocks.into_iter().filter(|(_, (_, _, free))| *free);
        let due = free.filter_map(|(block, (begun, copies, _))| {
            let due = self.late(block, begun, copies, tempo.pass)?;
            Some((due, block))
        });
        due.collect()
    }

    /// When a block with this first lease and this number of leases is leased once more. `pass`: usual seconds per
    /// pass, which the caller computes once, as it needs a loop over all workers.
    pub(super) fn late(&self, block: Block, begun: Duration, copies: usize, pass: Option<f64>) -> Option<Duration> {
        let long = match pass {
            Some(pass) => {
                let late = (0..copies).fold(1.0, |late, _| STRAGGLER * late);
                Duration::try_from_secs_f64(late * pass * block.len() as f64).ok()?
            }
            // Nobody has rendered anything yet.
            None => self.rules.lease * copies as u32,
        };
        (copies < COPIES).then_some(begun + long)
    }

    /// When a worker that gets nothing now should ask again, even if nothing happens until then.
    pub fn ask_again(&self, worker: WorkerId, now: Duration) -> Option<Duration> {
        let known = self.workers.get(&worker)?;
        let late = self.stragglers(worker, now).into_iter().chain(self.late_audits(worker));
        let first = late.map(|(due, _)| due).min();
        match known.not_before > now {
            true => Some(known.not_before),
            false => first.filter(|_| !self.has_enough(worker)),
        }
    }
}
