//! Which block a worker gets.

use super::level::{self, Load};
use super::standing::Worker;
use super::{Lease, Ledger, LedgerError};
use beamfarm_image::job::Block;
use beamfarm_proto::{Grant, LeaseId, WorkerId};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Duration;

/// A lease is a straggler when it has run for so many times the average of others, and its first copy when it has run
/// for as many times that, and so on.
const STRAGGLER: f64 = 2.0;
/// Leases of one block at the same time.
const COPIES: usize = 8;
/// Leases of one worker at the same time. It renders one block, has the next at hand and the one before on its way.
const HELD: usize = 16;

impl Ledger {
    /// The next block for this worker, if there is one: something to be checked, the lowest open passes, or what others
    /// take long for.
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
        let audit = self.audit_for(worker, now);
        let block = audit
            .or_else(|| self.next_block(worker, now))
            .or_else(|| self.straggler(worker, now));
        Ok(match block {
            Some(block) => Grant::Lease(self.grant(worker, block, audit.is_some(), now), block),
            None => Grant::NotNow,
        })
    }

    /// Blocks that this worker, or one that is yet to come, would be given now, as far as they can be counted: at most
    /// so many. `is_idle`: it has nothing else to do, so that what others take long for counts.
    pub fn openings(&self, worker: Option<WorkerId>, is_idle: bool, now: Duration) -> u64 {
        let known = worker.and_then(|worker| self.workers.get(&worker));
        let waits = known.is_some_and(|known| known.shut_out.is_some() || known.not_before > now);
        // One that no worker has.
        let worker = worker.unwrap_or(WorkerId(u64::MAX));
        if self.is_over(now) || waits || self.has_enough(worker) {
            return 0;
        }
        let open = match self.next_block(worker, now) {
            Some(_) => self.open.count(),
            None => 0,
        };
        let straggler = is_idle.then(|| self.straggler(worker, now)).flatten();
        let again = [self.audit_for(worker, now), straggler];
        open + again.iter().flatten().count() as u64
    }

    /// The worker holds as many leases as one may.
    fn has_enough(&self, worker: WorkerId) -> bool {
        let leases = self.active.iter().map(|id| &self.leases[id.0 as usize]);
        leases.filter(|lease| lease.worker == worker).count() >= HELD
    }

    /// Lease this very block: the worker has it, or is rendering it, from before the coordinator was restarted.
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
        let load = self.load(worker, now);
        let open = self.open.count();
        for Range { mut start, end } in self.open.iter() {
            while start < end {
                let Some(attempts) = self.attempts.get(&start) else {
                    // Passes that failed are tried on their own.
                    let next = self.attempts.range(start..end).next();
                    let end = next.map_or(end, |(pass, _)| *pass);
                    return Some(self.first_block(start..end, open, &load));
                };
                let somebody_else = self
                    .workers
                    .iter()
                    .any(|(id, w)| w.is_at_hand(&self.rules, now) && !attempts.workers.contains(id));
                if !attempts.workers.contains(&worker) || !somebody_else {
                    return Some(Block::leaf(start));
                }
                start += 1;
            }
        }
        None
    }

    /// The first block of these open passes: one that an earlier life of the job lost, as it was, so that it can be
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

    /// For this worker. One of which nothing is known yet is as quick as the others are in the mean.
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
        // What all do in the time in which this one does a pass.
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

    /// Average of the workers that have rendered something and are not gone.
    pub(super) fn seconds_per_pass(&self) -> Option<f64> {
        let there = self.workers.values().filter(|worker| !worker.gone);
        let times: Vec<f64> = there.filter_map(|worker| worker.seconds_per_pass).collect();
        (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
    }

    /// Leases that this worker could take over, with the time from which on each is a straggler.
    fn stragglers(&self, worker: WorkerId) -> Vec<(Duration, Block)> {
        let pass = self.seconds_per_pass();
        // When it was first leased, how often it is, and whether this worker may have it.
        let mut blocks: BTreeMap<Block, (Duration, usize, bool)> = BTreeMap::new();
        for LeaseId(place) in &self.active {
            let lease = &self.leases[*place as usize];
            if lease.audit {
                continue;
            }
            let unable = self.attempts.get(&lease.block.start());
            let unable = unable.is_some_and(|attempts| attempts.workers.contains(&worker));
            let first = (lease.begun, 0, !unable);
            let (begun, copies, free) = blocks.entry(lease.block).or_insert(first);
            *begun = lease.begun.min(*begun);
            *copies += 1;
            *free &= lease.worker != worker;
        }
        let free = blocks.into_iter();
        let free = free.filter(|(_, (_, copies, free))| *copies < COPIES && *free);
        let due = |(block, (begun, copies, _)): (Block, (Duration, usize, bool))| {
            let long = match pass {
                Some(pass) => {
                    let late = (0..copies).fold(1.0, |late, _| STRAGGLER * late);
                    let long = late * pass * block.len() as f64;
                    Duration::try_from_secs_f64(long).ok()?
                }
                // Nobody has rendered anything yet.
                None => self.rules.lease * copies as u32,
            };
            Some((begun + long, block))
        };
        free.filter_map(due).collect()
    }

    pub(super) fn copies(&self, block: Block) -> impl Iterator<Item = &Lease> {
        let leases = self.active.iter().map(|id| &self.leases[id.0 as usize]);
        leases.filter(move |lease| lease.block == block)
    }

    fn straggler(&self, worker: WorkerId, now: Duration) -> Option<Block> {
        let due = self.stragglers(worker).into_iter();
        let due = due.filter(|(due, _)| *due <= now);
        due.min().map(|(_, block)| block)
    }

    /// When a worker for which there is nothing now should ask again, although nothing happens until then.
    pub fn ask_again(&self, worker: WorkerId, now: Duration) -> Option<Duration> {
        let known = self.workers.get(&worker)?;
        let first = self.stragglers(worker).into_iter();
        let first = first.map(|(due, _)| due).min();
        match known.not_before > now {
            true => Some(known.not_before),
            false => first.filter(|_| !self.has_enough(worker)),
        }
    }
}
