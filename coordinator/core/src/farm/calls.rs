//! What workers ask of a farm.

use super::{EntryState, EventKind, Farm, State, Unable};
use crate::examine::{Claim, Examined, Flaw, examine};
use crate::ledger::{Accepted, Crew, LedgerError, PixelHash, Sentence, Who};
use beamfarm_image::job::{Block, EngineKind};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{Device, FileHash, Grant, LeaseId, WorkerId};
use std::collections::BTreeSet;
use std::sync::{Arc, MutexGuard};
use tokio::time::{Instant, timeout_at};
use tracing::{debug, error, info, warn};

/// The most workers without the job's engine that are remembered.
const UNABLE: usize = 100;

impl Farm {
    pub(crate) fn file(&self, hash: FileHash) -> Option<Bytes> {
        self.files.get(&hash).cloned()
    }

    /// Whether workers have to render a test picture with the job's engine. An engine other than the processors' is
    /// spared the test where no block is ever checked.
    pub(crate) fn asks_for_canary(&self) -> bool {
        self.job.settings.engine == EngineKind::Cpu || self.state().ledger.asks_for_canary()
    }

    /// Note that a worker without the job's engine came.
    pub(crate) fn cannot_serve(&self, name: &str, reason: &str) {
        let engine = self.job.settings.engine;
        let mut state = self.state();
        let unable = &mut state.progress.unable;
        let known = unable.iter().position(|known| known.name == name);
        let times = known.map_or(0, |known| unable.remove(known).times);
        if unable.len() >= UNABLE {
            unable.remove(0);
        }
        unable.push(Unable {
            name: name.into(),
            reason: reason.into(),
            times: times.saturating_add(1),
        });
        if let Some(count) = self.unable.tell() {
            let text = format!("{name:?} does not offer the engine {engine}: {reason} ({count} such registrations)");
            warn!(name, "{text}");
            state.events.push(EventKind::Unable, text);
        }
    }

    pub(crate) fn register(
        &self,
        who: Who,
        threads: u32,
        canary: Option<PixelHash>,
        device: Option<Device>,
    ) -> Result<WorkerId, Unwelcome> {
        let name = who.name.clone();
        let key = who.key.map_or_else(String::new, |key| format!(", key {}", key.short()));
        let on = match &device {
            Some(device) => format!(" and the device {:?}", device.name),
            None => String::new(),
        };
        let now = self.now();
        let mut state = self.state();
        let registered = match state.ledger.has_room(now) {
            true => state
                .ledger
                .register(who, threads, canary, device, now)
                .map_err(Unwelcome::from),
            false => Err(Unwelcome::Crowd),
        };
        match registered {
            Ok(worker) => {
                state.progress.registered += 1;
                // It has the engine now.
                state.progress.unable.retain(|unable| unable.name != name);
                let text = format!("worker {} is {name:?}{key}, with {threads} threads{on}", worker.0);
                info!(worker = worker.0, name, threads, "{text}");
                state.events.push(EventKind::Joined, text);
            }
            Err(unwelcome) => {
                if let Some(count) = self.unwelcome.tell() {
                    let text = format!("{name:?}{key} is refused: {unwelcome} ({count} refused registrations)");
                    error!(name, "{text}");
                    state.events.push(EventKind::ShutOut, text);
                }
            }
        }
        drop(state);
        self.settle();
        registered
    }

    /// Note how many passes the worker renders best together.
    pub(crate) fn renders_together(&self, worker: WorkerId, passes: u32) {
        self.state().ledger.renders_together(worker, passes);
    }

    /// Whether the worker is remembered.
    pub(crate) fn knows(&self, worker: WorkerId) -> bool {
        self.state().ledger.knows(worker)
    }

    /// Welcome back a known worker that was at another job.
    pub(crate) fn welcome_back(&self, worker: WorkerId) -> Result<(), LedgerError> {
        let now = self.now();
        self.state().ledger.welcome_back(worker, now)
    }

    /// The number of blocks that this worker, or a new one for `None`, would be given now, as an upper bound.
    /// `is_idle`: the worker has nothing else to do.
    pub(crate) fn openings(&self, worker: Option<WorkerId>, is_idle: bool) -> u64 {
        let state = self.state();
        match self.end.borrow().is_some() || state.progress.paused {
            true => 0,
            false => state.ledger.openings(worker, is_idle, self.now()),
        }
    }

    /// Note that the worker is told to go to another job. It may be called back.
    pub(crate) fn send_away(&self, worker: WorkerId) {
        self.state().ledger.send_away(worker);
    }

    /// A sign of life from a worker that is at another job.
    pub(crate) fn seen_away(&self, worker: WorkerId) {
        let now = self.now();
        self.state().ledger.seen_away(worker, now);
    }

    /// Workers that delivered wrong pixels.
    pub(crate) fn convicted(&self) -> Vec<Who> {
        self.state().ledger.convicted().cloned().collect()
    }

    /// Shut out workers that delivered wrong pixels for another job.
    pub(crate) fn convict(&self, convicted: &[Who]) {
        let mut state = self.state();
        convicted
            .iter()
            .filter_map(|who| who.key)
            .for_each(|key| state.ledger.convict_key(key));
        drop(state);
        self.opened.notify_waiters();
        self.settle();
    }

    /// Lease blocks that the worker already holds or is rendering, as far as they are still wanted.
    pub(crate) fn claim(&self, worker: WorkerId, blocks: impl IntoIterator<Item = Block>) -> Vec<(LeaseId, Block)> {
        let now = self.now();
        let mut state = self.state();
        let claims = blocks.into_iter();
        claims
            .filter_map(|block| Some((state.ledger.claim(worker, block, now)?, block)))
            .collect()
    }

    /// The next block as soon as there is one, or `NotNow` after one heartbeat interval.
    pub(crate) async fn lease(&self, worker: WorkerId) -> Result<Grant, LedgerError> {
        let patience = Instant::now() + self.timing.heartbeat;
        loop {
            // Before reading the ledger, so that no news slips in between.
            let opened = self.opened.notified();
            if self.end.borrow().is_some() {
                return Ok(Grant::Done);
            }
            let (grant, again) = {
                let now = self.now();
                let mut state = self.state();
                if state.progress.paused {
                    state.ledger.beat(worker, [], now)?;
                    (Grant::NotNow, None)
                } else {
                    let grant = state.ledger.lease(worker, now)?;
                    (grant, state.ledger.ask_again(worker, now))
                }
            };
            match grant {
                Grant::Lease(lease, block) => {
                    debug!(worker = worker.0, %block, lease = lease.0, "leased");
                    return Ok(grant);
                }
                Grant::Done => {
                    // The last workers that could have checked something may be gone.
                    self.settle();
                    // Somebody may have come meanwhile, or passes may have to be rendered again: then there is more to
                    // do.
                    if self.end.borrow().is_some() {
                        return Ok(grant);
                    }
                }
                Grant::NotNow | Grant::Elsewhere => {}
            }
            let again = again.map(|again| self.started + again);
            let until = again.map_or(patience, |again| again.min(patience));
            if timeout_at(until, opened).await.is_err() && Instant::now() >= patience {
                return Ok(Grant::NotNow);
            }
        }
    }

    /// A heartbeat with leases and, for each, the number of passes rendered.
    pub(crate) fn beat(
        &self,
        worker: WorkerId,
        leases: impl IntoIterator<Item = (LeaseId, u64)>,
    ) -> Result<(), LedgerError> {
        let now = self.now();
        self.state().ledger.beat(worker, leases, now)
    }

    /// Count the worker as present until the value is dropped. Dropping it ends the worker's leases.
    pub(crate) fn attend(self: &Arc<Self>, worker: WorkerId) -> Result<Attendance, LedgerError> {
        let now = self.now();
        let mut state = self.state();
        state.ledger.attend(worker, now)?;
        state.progress.workers += 1;
        drop(state);
        let farm = self.clone();
        Ok(Attendance { farm, worker })
    }

    /// The connection that the worker registered through is closed.
    pub(crate) fn hung_up(&self, worker: WorkerId) {
        let mut state = self.state();
        if let Some(lost) = state.ledger.hung_up(worker) {
            self.left(state, worker, lost);
        }
    }

    /// The worker is gone; `lost` leases ended with it.
    fn left(&self, mut state: MutexGuard<'_, State>, worker: WorkerId, lost: usize) {
        if self.end.borrow().is_none() {
            state.progress.lost_leases += lost as u64;
            let name = state.ledger.name(worker).to_owned();
            let how = match state.ledger.is_away(worker) {
                true => "goes on to another job",
                false => "is gone",
            };
            let mut text = format!("worker {} ({name:?}) {how}", worker.0);
            if lost > 0 {
                text += &format!("; its {lost} leases are handed out again");
                warn!(worker = worker.0, name, "{text}");
            } else {
                info!(worker = worker.0, name, "{text}");
            }
            state.events.push(EventKind::Left, text);
        }
        drop(state);
        self.opened.notify_waiters();
        self.settle();
    }

    /// The worker gives these leases back; all of them when it leaves.
    pub(crate) fn give_back(
        &self,
        worker: WorkerId,
        leases: &BTreeSet<LeaseId>,
        leaving: bool,
    ) -> Result<(), LedgerError> {
        let mut state = self.state();
        let mut count = state.ledger.give_back(worker, leases)?;
        if leaving {
            count += state.ledger.lost(worker);
            let name = state.ledger.name(worker).to_owned();
            let text = format!("worker {} ({name:?}) signs off and gives {count} leases back", worker.0);
            info!(worker = worker.0, name, "{text}");
            state.events.push(EventKind::Left, text);
        }
        drop(state);
        self.opened.notify_waiters();
        self.settle();
        Ok(())
    }

    /// Whether the worker can be relied on.
    pub(crate) fn is_reliable(&self, worker: WorkerId) -> bool {
        self.state().ledger.is_reliable(worker)
    }

    /// Let workers of other jobs be called to this one.
    pub(crate) fn join(&self, crew: Arc<Crew>) {
        self.state().ledger.join(crew);
    }

    /// Set the seconds that taking in a block costs. The size of blocks depends on it.
    pub(crate) fn set_intake(&self, seconds: f64) {
        self.state().ledger.set_intake(seconds);
    }

    /// Whether a block that is about to arrive was asked for.
    pub(crate) fn check(&self, claim: &Claim) -> Result<(), LedgerError> {
        let state = self.state();
        state.ledger.check(claim.worker, claim.lease, claim.block)
    }

    /// Check a delivered block and add it to the sum. Takes milliseconds: do not call it from a thread that serves
    /// others.
    pub(crate) fn submit(&self, claim: &Claim, bytes: &[u8]) -> Result<Accepted, Refusal> {
        let Examined {
            node,
            pixels,
            hash,
            look,
        } = match examine(&self.job, &self.schedule, claim, bytes) {
            Ok(examined) => examined,
            Err(flaw) => {
                self.reject(claim, &flaw);
                return Err(flaw.into());
            }
        };
        let Claim { worker, block, .. } = *claim;
        let accepted = {
            // Lock the sum first, so that ledger and sum change together: a block of a worker that is being shut out
            // must be in both or in neither.
            let mut sum = self.sum();
            let now = self.now();
            let mut state = self.state();
            let accepted = state.ledger.accept(worker, claim.lease, block, hash, now);
            match accepted {
                Ok(Accepted::New) => {
                    let State { ledger, plausible, .. } = &mut *state;
                    if plausible.is_odd(block, look) {
                        ledger.suspect(block, now);
                    }
                    state.progress.stats += claim.stats;
                    let begun = state.ledger.leased_at(claim.lease).unwrap_or(now);
                    let took = now.saturating_sub(begun);
                    self.enter(&state, EntryState::Done, block, worker, Some(hash), took, None);
                }
                Ok(Accepted::Duplicate) => state.progress.duplicates += 1,
                Ok(_) => {}
                Err(_) => state.progress.refused += 1,
            }
            drop(state);
            if accepted == Ok(Accepted::New)
                && let Err(error) = sum.insert(node)
            {
                // The ledger accepts no pass twice, and `examine` checked everything else.
                error!(worker = worker.0, %block, "{error}");
                return Err(Refusal::Flaw(Flaw::Foreign(error.to_string())));
            }
            accepted
        };
        debug!(worker = worker.0, %block, pixels, "delivered: {accepted:?}");
        if accepted == Ok(Accepted::New) {
            self.look();
            if self.state().ledger.is_to_be_checked(block) {
                // Workers with nothing to do can check it now.
                self.opened.notify_waiters();
            }
        }
        self.settle();
        Ok(accepted?)
    }

    /// A worker could not render what it leased, because of this pass.
    pub(crate) fn fail(
        &self,
        worker: WorkerId,
        lease: LeaseId,
        pass_index: u64,
        message: &str,
    ) -> Result<(), LedgerError> {
        let now = self.now();
        let mut state = self.state();
        let block = state.ledger.leased_block(lease).unwrap_or(Block::leaf(0));
        state.ledger.fail(worker, lease, pass_index, message, now)?;
        state.progress.failures += 1;
        let begun = state.ledger.leased_at(lease).unwrap_or(now);
        let took = now.saturating_sub(begun);
        let said = Some(message.to_owned());
        self.enter(&state, EntryState::Failed, block, worker, None, took, said);
        let name = state.ledger.name(worker).to_owned();
        let text = format!("{block} failed on worker {} ({name:?}): {message}", worker.0);
        warn!(worker = worker.0, name, %block, pass = pass_index, "{text}");
        state.events.push(EventKind::Failed, text);
        drop(state);
        self.opened.notify_waiters();
        self.settle();
        Ok(())
    }

    /// Note that a delivery was refused.
    pub(crate) fn reject(&self, claim: &Claim, flaw: &Flaw) {
        let Claim {
            worker, lease, block, ..
        } = *claim;
        let mut state = self.state();
        state.progress.refused += 1;
        let name = state.ledger.name(worker).to_owned();
        let text = format!("{block} from worker {} ({name:?}) is refused: {flaw}", worker.0);
        warn!(worker = worker.0, name, %block, "{text}");
        state.events.push(EventKind::Refused, text);
        match flaw {
            Flaw::Damaged => return,
            // A worker checks every pass before it adds it up, so it is to blame for what is wrong in a sum of several.
            Flaw::Pixels(message) if block.level == 0 => {
                drop(state);
                // The caller checked the lease; if the worker has left since, nothing changes.
                let _ = self.fail(worker, lease, block.start(), message);
                return;
            }
            Flaw::Foreign(_) | Flaw::Pixels(_) => state.ledger.refuse(worker, lease, block),
        }
        drop(state);
        self.opened.notify_waiters();
        self.settle();
    }
}

/// Why a worker may not register.
#[derive(Clone, Copy, Debug, thiserror::Error)]
pub(crate) enum Unwelcome {
    /// For good.
    #[error(transparent)]
    Sentenced(#[from] Sentence),
    /// For now.
    #[error("there are too many workers")]
    Crowd,
}

/// Why a delivery was refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Refusal {
    /// Because of its content.
    #[error(transparent)]
    Flaw(#[from] Flaw),
    /// Because of its sender, or of what is already there.
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
        let Self { farm, worker } = self;
        let mut state = farm.state();
        let lost = state.ledger.detach(*worker);
        state.progress.workers = state.progress.workers.saturating_sub(1);
        farm.left(state, *worker, lost);
    }
}
