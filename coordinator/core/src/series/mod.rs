//! Jobs that share workers one after another, such as the frames of an animation. A single job is a series of one.
//!
//! At most two jobs are open. A worker belongs to the first that has work for it. If its job has none, it is sent to
//! the other, and called back when there is work again: a lost block, or a copy that nobody else may check. The next
//! job opens as soon as the open ones have nothing to lease, so that nobody waits for the last passes of others.

mod frames;
mod workers;
mod workplace;

pub use frames::{FrameState, FrameView};
pub(crate) use workplace::Workplace;

use crate::ledger::{Crew, Who};
use crate::watch::Watch;
use beamfarm_proto::FileHash;
use beamfarm_proto::bytes::Bytes;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::task::{AbortHandle, JoinSet};
use tracing::Instrument;

/// Jobs that may be open at the same time.
const OPEN: usize = 2;
/// Time between checks for what is not notified.
const LOOK: Duration = Duration::from_millis(200);

/// Jobs that run one after another.
pub struct Series {
    /// Whether there is more than one job.
    is_of_several: bool,
    /// The workers of all jobs.
    crew: Arc<Crew>,
    state: Mutex<State>,
    /// Notified when a job opens, ends or is closed, and when no more will come.
    news: Notify,
    /// Notified when a worker finds nothing to do.
    hunger: Notify,
}

struct State {
    /// The open jobs, in order.
    places: Vec<Arc<Workplace>>,
    /// The job that was opened last.
    last: Arc<Workplace>,
    /// Whether no more jobs will be opened.
    is_sealed: bool,
    is_cancelled: bool,
    is_paused: bool,
    /// Passes of closed jobs.
    passes: u64,
    convicted: Vec<Who>,
    frames: BTreeMap<i64, FrameView>,
}

impl Series {
    /// A single job.
    pub fn of(watch: Arc<Watch>) -> Arc<Self> {
        let series = Self::made(false, watch);
        series.seal();
        series
    }

    /// The first of several jobs.
    pub fn beginning_with(watch: Arc<Watch>) -> Arc<Self> {
        Self::made(true, watch)
    }

    fn made(is_of_several: bool, first: Arc<Watch>) -> Arc<Self> {
        let first = Workplace::new(1, first);
        let crew = Arc::new(Crew::default());
        if is_of_several {
            first.farm().join(crew.clone());
        }
        let state = State {
            places: vec![first.clone()],
            last: first,
            is_sealed: false,
            is_cancelled: false,
            is_paused: false,
            passes: 0,
            convicted: Vec::new(),
            frames: BTreeMap::new(),
        };
        Arc::new(Self {
            is_of_several,
            crew,
            state: Mutex::new(state),
            news: Notify::new(),
            hunger: Notify::new(),
        })
    }

    /// Whether there is more than one job.
    pub(crate) fn is_of_several(&self) -> bool {
        self.is_of_several
    }

    /// Open another job, the last in line.
    pub fn open(&self, watch: Arc<Watch>) {
        let mut state = self.state();
        if state.is_paused {
            watch.farm().pause(true);
        }
        if state.is_cancelled {
            watch.farm().stop();
        }
        watch.farm().join(self.crew.clone());
        let place = Workplace::new(state.last.number + 1, watch);
        state.last = place.clone();
        state.places.push(place);
        drop(state);
        self.tell();
    }

    /// The job is over and its output is written.
    pub fn close(&self, watch: &Arc<Watch>) {
        let mut state = self.state();
        let Some(i) = state.places.iter().position(|place| Arc::ptr_eq(&place.watch, watch)) else {
            return;
        };
        let place = state.places.remove(i);
        state.passes += place.farm().progress().passes;
        state.convicted.extend(place.farm().convicted());
        drop(state);
        self.tell();
    }

    /// No more jobs will be opened.
    pub fn seal(&self) {
        self.state().is_sealed = true;
        self.tell();
    }

    /// End all jobs with the passes that are done, and open no more.
    pub fn cancel(&self) {
        let mut state = self.state();
        state.is_cancelled = true;
        let open = state.places.clone();
        drop(state);
        open.iter().for_each(|place| place.farm().stop());
        self.tell();
    }

    /// Whether the series was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.state().is_cancelled
    }

    /// Pause or resume handing out passes.
    pub fn pause(&self, paused: bool) {
        let mut state = self.state();
        state.is_paused = paused;
        let open = state.places.clone();
        drop(state);
        open.iter().for_each(|place| place.farm().pause(paused));
        self.tell();
    }

    /// The first job in line; the last one when all are over.
    pub fn current(&self) -> Arc<Watch> {
        let state = self.state();
        let first = state.places.iter().find(|place| !place.has_ended());
        first.unwrap_or(&state.last).watch.clone()
    }

    /// Whether all jobs are over and no more will come.
    pub fn is_over(&self) -> bool {
        let state = self.state();
        (state.is_sealed || state.is_cancelled) && state.places.iter().all(|place| place.has_ended())
    }

    /// Resolves when the series is over.
    pub async fn over(&self) {
        self.until(|| self.is_over()).await;
    }

    /// Resolves when this job is first in line, or over.
    pub async fn first_in_line(&self, watch: &Arc<Watch>) {
        let is_first = || Arc::ptr_eq(&self.current(), watch) || watch.farm().end().is_some();
        self.until(is_first).await;
    }

    /// Resolves to true when the next job is wanted, to false when the series is cancelled.
    pub async fn wants_another(&self) -> bool {
        loop {
            let news = self.news.notified();
            if self.state().is_cancelled {
                return false;
            }
            if self.has_room() {
                return true;
            }
            tokio::select! {
                () = news => {}
                () = self.hunger.notified() => {}
            }
        }
    }

    /// Whether another job may open: few enough are open, and none of them has anything to lease.
    fn has_room(&self) -> bool {
        let state = self.state();
        let (open, is_paused) = (state.places.clone(), state.is_paused);
        drop(state);
        open.len() < OPEN && !is_paused && open.iter().all(|place| place.farm().openings(None, false) == 0)
    }

    /// Passes that count, over all jobs so far.
    pub fn passes(&self) -> u64 {
        let state = self.state();
        let (open, before) = (state.places.clone(), state.passes);
        drop(state);
        before + open.iter().map(|place| place.farm().progress().passes).sum::<u64>()
    }

    /// Workers that delivered wrong pixels for any job.
    pub fn convicted(&self) -> Vec<Who> {
        let state = self.state();
        let open = state.places.iter().flat_map(|place| place.farm().convicted());
        let mut all = state.convicted.clone();
        all.extend(open);
        all.sort_by_key(Who::known_by);
        all.dedup_by_key(|who| who.known_by());
        all
    }

    /// Tell a job about all convicted workers.
    pub(crate) fn tell_of_convicted(&self, place: &Workplace) {
        // Every call comes through here; a single job knows its own.
        if !self.is_of_several {
            return;
        }
        let convicted = self.convicted();
        if place.is_news(convicted.len()) {
            place.farm().convict(&convicted);
        }
    }

    /// Add a frame to the list, or update it.
    pub fn note_frame(&self, view: FrameView) {
        self.state().frames.insert(view.frame, view);
    }

    /// The list of frames.
    pub fn frames(&self) -> Vec<FrameView> {
        self.state().frames.values().cloned().collect()
    }

    /// Run the periodic work of the open jobs, forever.
    pub(crate) async fn run(self: &Arc<Self>) -> Infallible {
        let mut tasks = JoinSet::new();
        let mut running: BTreeMap<u64, AbortHandle> = BTreeMap::new();
        loop {
            let news = self.news.notified();
            while tasks.try_join_next().is_some() {}
            let open = self.open_places();
            running.retain(|number, task| {
                let stays = open.iter().any(|place| place.number == *number);
                if !stays {
                    task.abort();
                }
                stays
            });
            for place in open {
                let series = self.clone();
                running.entry(place.number).or_insert_with(|| {
                    let span = place.span();
                    let run = async move {
                        let ended = async {
                            place.farm().ended().await;
                            series.tell();
                        };
                        tokio::join!(ended, place.run());
                    };
                    tasks.spawn(run.instrument(span))
                });
            }
            news.await;
        }
    }

    /// Resolves when no worker is left at the last job.
    pub(crate) async fn deserted(&self) {
        let last = self.state().last.clone();
        last.farm().deserted().await;
    }

    /// A file of an open job.
    pub(crate) fn file(&self, hash: FileHash) -> Option<Bytes> {
        let state = self.state();
        let mut places = state.places.iter().chain([&state.last]);
        places.find_map(|place| place.farm().file(hash))
    }

    /// The job with this number, if it is open or the last.
    pub(crate) fn place(&self, job: u64) -> Option<Arc<Workplace>> {
        let state = self.state();
        let mut places = state.places.iter().chain([&state.last]);
        places.find(|place| place.number == job).cloned()
    }

    fn open_places(&self) -> Vec<Arc<Workplace>> {
        self.state().places.clone()
    }

    async fn until(&self, is_so: impl Fn() -> bool) {
        loop {
            let news = self.news.notified();
            if is_so() {
                return;
            }
            // A job's end is announced a moment after it happened.
            let _ = tokio::time::timeout(LOOK, news).await;
        }
    }

    fn tell(&self) {
        self.news.notify_waiters();
        self.hunger.notify_one();
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
