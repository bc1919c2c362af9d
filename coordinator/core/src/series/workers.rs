//! Which worker is at which job.

use super::{Series, Workplace};
use crate::keys::{Seat, Seats};
use crate::ledger::LedgerError;
use beamfarm_image::job::SceneHash;
use beamfarm_proto::Grant;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// Time between checks whether another job has work again, as nothing notifies of it.
const LOOK: Duration = Duration::from_millis(200);
/// How long a worker that registers waits for the next job when there is nothing to lease.
const FOR_WORK: Duration = Duration::from_secs(1);
/// The same when there is no job at all.
const FOR_A_JOB: Duration = Duration::from_secs(5);

/// Where a worker that registers belongs.
enum Belongs {
    At(Arc<Workplace>),
    /// Nothing to lease anywhere; the worker goes to this job if nothing changes.
    Nowhere(Option<Arc<Workplace>>),
}

impl Series {
    /// The job for a worker that registers. `seats`: where it was before, if anywhere. `held`: the scene of the blocks
    /// that it has. `None` if no job turned up in time.
    pub(crate) async fn place_for(&self, seats: Option<&Seats>, held: Option<SceneHash>) -> Option<Arc<Workplace>> {
        let begun = Instant::now();
        // Wherever it was called to, it is no longer on its way.
        if let Some(seats) = seats {
            self.open_places()
                .iter()
                .for_each(|place| place.expect_no_more(seats.now));
        }
        let mut is_news = true;
        loop {
            let news = self.news.notified();
            match self.belongs(seats, held, is_news) {
                Belongs::At(place) => return Some(place),
                Belongs::Nowhere(fallback) => {
                    self.hunger.notify_one();
                    let patience = if fallback.is_some() { FOR_WORK } else { FOR_A_JOB };
                    let until = begun + patience;
                    // It is present, and may be called to work that nothing notifies of.
                    seats.inspect(|seats| self.seen(seats));
                    is_news = timeout_at(until.min(Instant::now() + LOOK), news).await.is_ok();
                    if Instant::now() >= until {
                        return fallback;
                    }
                }
            }
        }
    }

    /// `for_copies`: tasks that others are slow at count as work too.
    fn belongs(&self, seats: Option<&Seats>, held: Option<SceneHash>, for_copies: bool) -> Belongs {
        let is_over = self.is_over();
        let state = self.state();
        let last = state.last.clone();
        let running: Vec<Arc<Workplace>> = state.places.iter().filter(|p| !p.has_ended()).cloned().collect();
        let may_grow = !state.is_sealed && !state.is_cancelled;
        drop(state);
        if is_over || !self.is_of_several() {
            return Belongs::At(last);
        }
        let has_it = |place: &&Arc<Workplace>| held.is_some_and(|scene| place.farm().job().scene == scene);
        let has_work = |is_idle| {
            move |place: &&Arc<Workplace>| {
                place
                    .farm()
                    .openings(seats.and_then(|seats| seats.at(place.number)), is_idle)
                    > 0
            }
        };
        let place = running.iter().find(has_it);
        let place = place.or_else(|| running.iter().find(has_work(false)));
        let place = place.or_else(|| running.iter().find(has_work(true)).filter(|_| for_copies));
        match (place, running.first()) {
            (Some(place), _) => Belongs::At(place.clone()),
            (None, Some(first)) if !may_grow => Belongs::At(first.clone()),
            (None, first) => Belongs::Nowhere(first.cloned()),
        }
    }

    /// The worker's next block at its job, or the message that another job wants it.
    pub(crate) async fn lease(&self, place: &Arc<Workplace>, seats: &Seats) -> Result<Grant, LedgerError> {
        let worker = seats.now.worker;
        if !self.is_of_several() {
            return place.farm().lease(worker).await;
        }
        if self.is_called(seats, false, |other| other.number < place.number) {
            return Ok(self.send(place, seats));
        }
        tokio::select! {
            // A leased block must reach the worker.
            biased;
            grant = place.farm().lease(worker) => match grant? {
                Grant::Done if self.goes_on() => Ok(self.send(place, seats)),
                grant => Ok(grant),
            },
            () = self.work_elsewhere(seats) => Ok(self.send(place, seats)),
        }
    }

    fn send(&self, place: &Workplace, seats: &Seats) -> Grant {
        place.farm().send_away(seats.now.worker);
        Grant::Elsewhere
    }

    /// Whether some job is not over, or more will come.
    pub(crate) fn goes_on(&self) -> bool {
        self.is_of_several() && !self.is_over()
    }

    /// Resolves when another job has work for the worker.
    async fn work_elsewhere(&self, seats: &Seats) {
        loop {
            let news = self.news.notified();
            if self.is_called(seats, true, |_| true) {
                return;
            }
            self.hunger.notify_one();
            let _ = timeout_at(Instant::now() + LOOK, news).await;
        }
    }

    /// Whether one of these jobs, other than the worker's own, calls it.
    fn is_called(&self, seats: &Seats, is_idle: bool, which: impl Fn(&Workplace) -> bool) -> bool {
        let mut others = self.open_places();
        others.retain(|place| place.number != seats.now.job && !place.has_ended() && which(place));
        let mut others = others.iter();
        // An unproven worker may come, but is not counted on.
        let own = self.place(seats.now.job);
        let is_reliable = own.is_some_and(|own| own.farm().is_reliable(seats.now.worker));
        others.any(|place| {
            let openings = place.farm().openings(seats.at(place.number), is_idle);
            place.call(seats.now, openings, is_reliable)
        })
    }

    /// The worker signs off.
    pub(crate) fn left(&self, seats: &Seats) {
        self.crew.left(seats.own);
    }

    /// A sign of life for the jobs that may call the worker back.
    pub(crate) fn seen(&self, seats: &Seats) {
        if self.is_of_several() {
            self.crew.seen(seats.own);
        }
        for Seat { job, worker } in &seats.before {
            if let Some(place) = self.place(*job) {
                place.farm().seen_away(*worker);
            }
        }
    }
}
