//! A job of a series.

use crate::arriving::Arriving;
use crate::farm::Farm;
use crate::intake::Intake;
use crate::keys::Seat;
use crate::watch::Watch;
use beamfarm_image::exr::encoded_size;
use std::convert::Infallible;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, MissedTickBehavior, interval};
use tracing::{Span, error_span};

/// A worker that was called and has not come after this time is not expected any more.
const ON_THE_WAY: Duration = Duration::from_secs(5);

/// A job that workers may be at.
pub(crate) struct Workplace {
    /// The job's number in its series.
    pub number: u64,
    pub watch: Arc<Watch>,
    pub intake: Arc<Intake>,
    /// Leases whose block is arriving.
    pub arriving: Arriving,
    /// Workers on their way here: where they were called from, and when.
    called: Mutex<Vec<(Seat, Instant)>>,
    /// The number of convicted workers that the job knows of.
    convicted: AtomicUsize,
}

impl Workplace {
    pub fn new(number: u64, watch: Arc<Watch>) -> Arc<Self> {
        let job = watch.farm().job();
        let largest = encoded_size(job.width, job.height, &job.layers) as u64;
        Arc::new(Self {
            number,
            intake: Arc::new(Intake::new(largest)),
            arriving: Arriving::default(),
            called: Mutex::default(),
            convicted: AtomicUsize::new(0),
            watch,
        })
    }

    pub fn farm(&self) -> &Arc<Farm> {
        self.watch.farm()
    }

    pub fn has_ended(&self) -> bool {
        self.farm().end().is_some()
    }

    /// The span for log lines, in a series of several jobs.
    pub fn span(&self) -> Span {
        error_span!("job", job = self.watch.id())
    }

    /// Call this worker if there is more work than workers on their way. `is_reliable`: whether to count it as on its
    /// way.
    pub fn call(&self, worker: Seat, openings: u64, is_reliable: bool) -> bool {
        let mut called = self.called();
        let longest = ON_THE_WAY.min(self.farm().timing().lease);
        called.retain(|(other, call)| *other != worker && call.elapsed() <= longest);
        let is_wanted = openings > called.len() as u64;
        if is_wanted && is_reliable {
            called.push((worker, Instant::now()));
        }
        is_wanted
    }

    /// Whether this number of convicted workers is new to the job. It is recorded.
    pub fn is_news(&self, convicted: usize) -> bool {
        self.convicted.swap(convicted, Ordering::Relaxed) != convicted
    }

    /// The worker has arrived, here or elsewhere.
    pub fn expect_no_more(&self, worker: Seat) {
        self.called().retain(|(other, _)| *other != worker);
    }

    /// Run the periodic work, forever.
    pub async fn run(&self) -> Infallible {
        tokio::join!(self.expire(), self.watch.run());
        std::future::pending().await
    }

    async fn expire(&self) {
        let mut ticks = interval(self.farm().timing().heartbeat);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            ticks.tick().await;
            self.farm().expire();
        }
    }

    fn called(&self) -> MutexGuard<'_, Vec<(Seat, Instant)>> {
        self.called.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
