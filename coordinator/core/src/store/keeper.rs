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

/// Time between looks at what has come in.
const LOOK: Duration = Duration::from_millis(100);
/// Time between checkpoints at least,
const EVERY: Duration = Duration::from_secs(1);
/// and times the time that the last one took: a fiftieth of the time at most goes into them.
const SHARE: u32 = 50;
/// Time before the next attempt when one failed.
pub const RETRY: Duration = Duration::from_secs(5);

/// A thread that writes lines and checkpoints. It holds no more than the images that the sum has anyway, and those that
/// were joined while they were being written.
pub struct Keeper {
    stop: Sender<()>,
    thread: JoinHandle<(Folder, Result<(), StoreError>)>,
}

impl Keeper {
    /// Keep the directory of this farm, which tells about its blocks through `entries`.
    pub fn start(folder: Folder, farm: Arc<Farm>, entries: UnboundedReceiver<Entry>) -> Result<Self, StoreError> {
        // Where that fails, it is done as soon as the disk lets it.
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

    /// Write the last checkpoint and give the directory back. Takes as long as writing it: not for a thread that serves
    /// others.
    pub fn finish(self) -> (Option<Folder>, Result<(), StoreError>) {
        // Fails when the thread has ended by itself, which only a panic can cause.
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
    /// Time of the next checkpoint.
    due: Instant,
    /// The last attempt failed.
    failing: bool,
    /// The folder has no report of an earlier end.
    is_withdrawn: bool,
}

/// Sums that agree in this are the same.
#[derive(PartialEq, Eq)]
struct State {
    passes: u64,
    fence: Option<u64>,
    /// Passes that were taken out of it until now, and may have come back with other pixels.
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
            // Lines do not wait for checkpoints: what is rendered again after a crash is compared with them.
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

    /// Write a checkpoint, if it would be another one than the last.
    fn save(&mut self) -> Result<(), StoreError> {
        let progress = self.farm.progress();
        let extended = self.folder.extend(progress.limit);
        // A block's line is entered together with the change of the sum: the sum follows these.
        self.take_lines();
        let ledger = self.folder.ledger_end();
        let mut checkpoint = Checkpoint::of(self.farm.snapshot(), ledger);
        let state = State::new(&checkpoint.sum, progress.dropped);
        if state == self.saved {
            return extended;
        }
        // With these, the ledger knows all of the checkpoint.
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
