//! What follows from a change of the job's state.

use super::{End, Entry, EntryState, EventKind, Farm, State};
use crate::ledger::{Failure, Note, PixelHash};
use beamfarm_image::job::Block;
use beamfarm_proto::WorkerId;
use std::time::{Duration, SystemTime};
use tracing::{debug, error, info, warn};

impl Farm {
    #[expect(clippy::too_many_arguments, reason = "one for each column of the entry")]
    pub(super) fn enter(
        &self,
        state: &State,
        became: EntryState,
        block: Block,
        worker: WorkerId,
        hash: Option<PixelHash>,
        took: Duration,
        message: Option<String>,
    ) {
        let Some(entries) = &self.entries else {
            return;
        };
        // Fails when nobody keeps the entries any more.
        let _ = entries.send(Entry {
            time: SystemTime::now(),
            block,
            state: became,
            worker: state.ledger.who(worker),
            radius_scale: self.schedule.scale(block.start()),
            hash,
            took,
            message,
        });
    }

    /// Act on the last change: take back what must not count, tell those who watch, end the job.
    pub(super) fn settle(&self) {
        let mut state = self.state();
        for note in state.ledger.take_notes() {
            self.announce(&mut state, note);
        }
        let stained = !state.ledger.stained().is_empty();
        let over = state.ledger.is_over(self.now());
        let end = over.then(|| match state.ledger.failed() {
            Some(failure) => End::Failed(failure.clone()),
            None => End::Complete,
        });
        drop(state);
        if stained {
            self.take_back();
        } else if let Some(end) = end {
            // A block is in the ledger a moment before it is in the sum: wait for the sum's lock.
            drop(self.sum());
            self.finish(end);
        }
    }

    fn take_back(&self) {
        let mut sum = self.sum();
        let mut state = self.state();
        let stained = state.ledger.stained().to_vec();
        let mut nodes = Vec::new();
        for block in &stained {
            nodes.extend(sum.remove(*block));
        }
        let dropped = state.ledger.reopen(&nodes);
        drop(sum);
        let passes: u64 = dropped.iter().map(|done| done.block.len()).sum();
        for done in &dropped {
            if let Some((worker, hash)) = done.by {
                let (dropped, took) = (EntryState::Dropped, Duration::ZERO);
                self.enter(&state, dropped, done.block, worker, Some(hash), took, None);
                let name = state.ledger.name(worker);
                warn!(worker = worker.0, name, block = %done.block, "dropped");
            }
        }
        if passes > 0 {
            state.progress.dropped += passes;
            let text = format!("{passes} passes are dropped and will be rendered again");
            warn!("{text}");
            state.events.push(EventKind::Dropped, text);
        }
        drop(state);
        // The prefix that met the target may have lost passes.
        self.look();
        self.opened.notify_waiters();
    }

    fn announce(&self, state: &mut State, note: Note) {
        let who = |worker: WorkerId| format!("worker {} ({:?})", worker.0, state.ledger.name(worker));
        let (kind, text) = match note {
            Note::ShutOut(worker, sentence) => {
                let text = format!("{} is shut out: {sentence}", who(worker));
                let name = state.ledger.name(worker);
                error!(worker = worker.0, name, "{text}");
                if sentence.is_conviction() {
                    let (became, any, why) = (EntryState::ShutOut, Block::leaf(0), Some(sentence.to_string()));
                    self.enter(state, became, any, worker, None, Duration::ZERO, why);
                }
                (EventKind::ShutOut, text)
            }
            Note::Disputed(block, first, second) => {
                let (one, other) = (who(first), who(second));
                let text = format!("{one} and {other} delivered different pixels for {block}");
                error!(worker = first.0, other = second.0, %block, "{text}");
                (EventKind::Divergent, text)
            }
            Note::Expired(block, worker) => {
                let text = format!(
                    "the lease of {block} ran out: {} is silent, or does not get on with it; it is handed out again",
                    who(worker)
                );
                let name = state.ledger.name(worker);
                warn!(worker = worker.0, name, %block, "{text}");
                state.progress.lost_leases += 1;
                (EventKind::Lost, text)
            }
            Note::Confirmed(block, worker, hash) => {
                let audited = EntryState::Audited;
                self.enter(state, audited, block, worker, Some(hash), Duration::ZERO, None);
                state.progress.audits += 1;
                state.plausible.confirm(block);
                debug!(worker = worker.0, %block, "confirmed");
                return;
            }
        };
        state.events.push(kind, text);
        // Waiting workers may be needed as judges.
        self.opened.notify_waiters();
    }

    pub(super) fn finish(&self, end: End) {
        let mut pass = None;
        let text = match &end {
            End::Complete => "the job is complete".to_owned(),
            End::Stopped => "the job was stopped".to_owned(),
            End::Failed(failure) => {
                let Failure {
                    pass_index,
                    attempts,
                    workers,
                    message,
                } = failure;
                pass = Some(*pass_index);
                format!("pass {pass_index} failed {attempts} times on {workers} workers: {message}")
            }
        };
        let first = |known: &mut Option<End>| {
            let first = known.is_none();
            known.get_or_insert(end);
            first
        };
        if self.end.send_if_modified(first) {
            info!(pass, "{text}");
            let now = self.now();
            let mut state = self.state();
            state.pauses.end(now);
            state.events.push(EventKind::Ended, text);
        }
        self.opened.notify_waiters();
    }
}
