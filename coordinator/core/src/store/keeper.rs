//! Keeps a job directory up to date while the job runs.

use super::{Checkpoint, Folder, StoreError};
use crate::farm::{Entry, Farm};
use beamfarm_image::merge::TreeSum;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::mpsc::UnboundedReceiver;
use tracing::{debug, info, warn};

/// Time between checks for new passes.
const LOOK: Duration = Duration::from_millis(100);
/// Least time between checkpoints.
const EVERY: Duration = Duration::from_secs(1);
/// And at least this many times the duration of the last one, so that at most a fiftieth of the time goes into them.
const SHARE: u32 = 50;
/// Time until the next attempt after a failure.
pub const RETRY: Duration = Duration::from_secs(5);

/// A thread that writes lines and checkpoints. It holds no more than the images of the sum, and those that were merged
/// while a checkpoint was being written.
pub struct Keeper {
    stop: Sender<()>,
    thread: JoinHandle<(Folder, Result<(), StoreError>)>,
}

impl Keeper {
    /// Start writing the directory of this farm, which reports its blocks through `entries`.
    pub fn start(folder: Folder, farm: Arc<Farm>, entries: UnboundedReceiver<Entry>) -> Result<Self, StoreError> {
        // On failure, it is repeated as soon as the disk allows.
        let is_withdrawn = folder.withdraw_report().is_ok();
        let path = folder.path().to_owned();
        let (stop, stopped) = channel();
        let span = tracing::Span::current();
        let thread = std::thread::Builder::new()
            .name("job directory".into())
            .spawn(move || {
                let _job = span.entered();
                let mut work = Work::new(folder, farm, entries, is_withdrawn);
                work.run(&stopped);
                let last = work.finish();
                (work.folder, last)
            })
            .map_err(StoreError::io(&path))?;
        Ok(Self { stop, thread })
    }

    /// Write the last checkpoint and return the directory. Takes as long as the write: do not call it from a thread
    /// that serves others.
    pub fn finish(self) -> (Option<Folder>, Result<(), StoreError>) {
        // Fails if the thread has already ended, which only a panic can cause.
        let _ = self.stop.send(());
        match self.thread.join() {
            Ok((folder, last)) => (Some(folder), last),
            Err(_) => {
                let error = std::io::Error::other("its keeper panicked");
                (None, Err(StoreError::io(std::path::Path::new("job directory"))(error)))
            }
        }
    }
}

struct Work {
    folder: Folder,
    farm: Arc<Farm>,
    entries: UnboundedReceiver<Entry>,
    /// What the last checkpoint held.
    saved: State,
    /// When the next checkpoint is due.
    due: Instant,
    /// Whether the last attempt failed.
    failing: bool,
    /// Whether the report of an earlier end is removed.
    is_withdrawn: bool,
}

/// Two sums with equal states are the same.
#[derive(PartialEq, Eq)]
struct State {
    passes: u64,
    fence: Option<u64>,
    /// Passes taken out so far; they may have come back with different pixels.
    dropped: u64,
}

impl State {
    fn new(sum: &TreeSum, dropped: u64) -> Self {
        Self {
            passes: sum.passes(),
            fence: sum.fence(),
            dropped,
        }
    }
}

impl Work {
    fn new(folder: Folder, farm: Arc<Farm>, entries: UnboundedReceiver<Entry>, is_withdrawn: bool) -> Self {
        Self {
            is_withdrawn,
            folder,
            saved: State::new(&farm.snapshot().sum, 0),
            farm,
            entries,
            due: Instant::now(),
            failing: false,
        }
    }

    fn run(&mut self, stopped: &Receiver<()>) {
        while stopped.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            self.take_lines();
            let is_due = Instant::now() >= self.due;
            if self.failing && !is_due {
                continue;
            }
            // Lines do not wait for checkpoints: blocks rendered again after a crash are compared with them.
            let appended = self.folder.append();
            let saved = match is_due {
                true => self.save(),
                false => Ok(()),
            };
            match saved.and(appended).and(self.withdraw()) {
                Ok(()) if self.failing => {
                    self.failing = false;
                    info!("{}: written again", self.folder.path().display());
                }
                Ok(()) => {}
                Err(error) => {
                    warn!("{error}; the job goes on, and writes it again in {RETRY:?}");
                    self.failing = true;
                    self.due = Instant::now() + RETRY;
                }
            }
        }
    }

    fn withdraw(&mut self) -> Result<(), StoreError> {
        if !self.is_withdrawn {
            self.folder.withdraw_report()?;
            self.is_withdrawn = true;
        }
        Ok(())
    }

    fn take_lines(&mut self) {
        while let Ok(entry) = self.entries.try_recv() {
            self.folder.enter(&entry);
        }
    }

    /// Write a checkpoint, if the state has changed since the last.
    fn save(&mut self) -> Result<(), StoreError> {
        let progress = self.farm.progress();
        let extended = self.folder.extend(progress.limit);
        // A block's line is added together with the change of the sum; the sum taken next covers these lines.
        self.take_lines();
        let ledger = self.folder.ledger_end();
        let mut checkpoint = Checkpoint::of(self.farm.snapshot(), ledger);
        let state = State::new(&checkpoint.sum, progress.dropped);
        if state == self.saved {
            return extended;
        }
        // With these, the ledger covers everything in the checkpoint.
        self.take_lines();
        let begun = Instant::now();
        self.folder.save(&mut checkpoint)?;
        let took = begun.elapsed();
        debug!(
            "checkpoint {} of {} passes in {took:?}",
            checkpoint.number, state.passes
        );
        self.saved = state;
        self.due = Instant::now() + EVERY.max(SHARE * took);
        extended
    }

    fn finish(&mut self) -> Result<(), StoreError> {
        self.take_lines();
        let synced = self.folder.sync();
        self.save().and(synced)
    }
}

#[cfg(test)]
mod tests;
