//! A job as seen by those who watch and control it: the page, the metrics, `beamfarm status`, tev.
//!
//! All of them use the same [`Watch`]. It measures rates, records the error over time, and makes pictures only while
//! somebody looks.

pub(crate) mod heat;
mod meter;
pub(crate) mod picture;
pub(crate) mod shown;

pub use meter::{Meter, Rates};

use crate::farm::{Farm, Progress};
use beamfarm_image::exr::Names;
use beamfarm_image::job::MAX_PASSES;
use beamfarm_image::view::View;
use beamfarm_proto::Job;
use beamfarm_proto::wire;
use picture::{Picture, Pictures};
use prost::Message;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, oneshot};
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

/// Time between checks of the number of passes.
const LOOK: Duration = Duration::from_secs(1);
/// Points kept of the error curve, more than a plot can show. Beyond that every other point is dropped.
const POINTS: usize = 400;
/// The most pages that may be open.
const PAGES: usize = 64;
/// Requests to write the image that may wait. Each waits for the one before.
const WAITING_WRITES: usize = 4;

/// Stopping conditions that the farm does not know, and how the job is shown.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    /// The name for people, such as the scene's name.
    pub title: String,
    /// Time after which it stops.
    pub time: Option<Duration>,
    /// Error at which it stops, for display.
    pub target: Option<f64>,
    /// Its first pass. Passes make an image only if they start at zero.
    pub first_pass: u64,
    /// How the picture is shown initially.
    pub view: View,
    /// Whether the scene drops photons that miss all targets: the image is then biased and marked so.
    pub drops_photons: bool,
    /// Names of what its mattes separate.
    pub names: Names,
    /// Depth of the empty background; `None`: infinite.
    pub empty_depth: Option<f32>,
}

/// The estimated error at a number of complete passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Complete passes.
    pub passes: u64,
    /// Time spent on the job, over all its coordinators.
    pub seconds: f64,
    /// Relative standard error.
    pub error: f64,
}

/// A request to write the image of the complete passes now. The answer is what was written, or why nothing was.
pub type WriteRequest = oneshot::Sender<Result<String, String>>;

/// A job for those who watch it.
pub struct Watch {
    farm: Arc<Farm>,
    terms: Terms,
    id: String,
    started: Instant,
    state: Mutex<State>,
    pictures: Pictures,
    /// Permits for open pages.
    places: Arc<Semaphore>,
    writer: Mutex<Option<mpsc::Sender<WriteRequest>>>,
}

#[derive(Default)]
struct State {
    meter: Meter,
    rates: Rates,
    curve: Vec<Point>,
    /// When the job ended.
    ended: Option<Duration>,
}

impl Watch {
    /// Watch this farm. Its clock starts now.
    pub fn new(farm: Arc<Farm>, terms: Terms) -> Arc<Self> {
        let id = job_id(&terms.title, farm.job());
        Arc::new(Self {
            pictures: Pictures::new(farm.clone()),
            places: Arc::new(Semaphore::new(PAGES)),
            farm,
            terms,
            id,
            started: Instant::now(),
            state: Mutex::default(),
            writer: Mutex::default(),
        })
    }

    /// The watched farm.
    pub fn farm(&self) -> &Arc<Farm> {
        &self.farm
    }

    /// Name of the job in logs: its title and the first digits of a hash over everything its passes depend on.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Stopping conditions and display.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Keep rates and the error curve up to date, forever.
    pub async fn run(&self) {
        let mut ticks = interval(LOOK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut known = 0;
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                _ = self.farm.ended(), if self.state().ended.is_none() => {
                    let now = self.started.elapsed();
                    self.state().ended = Some(now);
                }
            }
            let progress = self.farm.progress();
            let now = self.worked();
            {
                let mut state = self.state();
                state.rates = state.meter.rates(now, progress.passes, progress.stats.beams);
            }
            // So that later viewers get a curve: a few tests during the job, where nobody else has tested.
            let told = self.state().curve.last().map_or(0, |point| point.passes);
            known = told.max(known);
            if progress.prefix >= 2 && progress.prefix >= 2 * known {
                known = progress.prefix;
                self.picture().await;
            }
            self.pictures.forget().await;
        }
    }

    /// Time since this coordinator started; the total once the job has ended.
    pub fn elapsed(&self) -> Duration {
        let ended = self.state().ended;
        ended.unwrap_or_else(|| self.started.elapsed())
    }

    /// Elapsed time without pauses, which do not count as time of the job.
    pub fn worked(&self) -> Duration {
        self.elapsed().saturating_sub(self.farm.paused_for())
    }

    /// The same, plus the time of earlier coordinators.
    pub fn elapsed_in_all(&self) -> Duration {
        self.farm.before().saturating_add(self.worked())
    }

    /// Passes and beams per second, over the last seconds.
    pub fn rates(&self) -> Rates {
        self.state().rates
    }

    /// Start the curve with points from earlier coordinators, in pass order.
    pub fn recall(&self, points: impl IntoIterator<Item = Point>) {
        let mut state = self.state();
        let last = state.curve.first().map_or(u64::MAX, |point| point.passes);
        // Points from a file may be invalid.
        let mut known = 0;
        let mut points: Vec<Point> = points.into_iter().take(POINTS).collect();
        points.retain(|point| {
            let fits = known < point.passes && point.passes < last;
            let fits = fits && point.seconds.is_finite() && point.error.is_finite();
            if fits {
                known = point.passes;
            }
            fits
        });
        state.curve.splice(0..0, points);
    }

    /// The error over time, as far as it was estimated.
    pub fn curve(&self) -> Vec<Point> {
        self.state().curve.clone()
    }

    /// Add an error estimate to the curve.
    pub fn note_error(&self, passes: u64, error: f64) {
        if !error.is_finite() {
            return;
        }
        let seconds = self.elapsed_in_all().as_secs_f64();
        let mut state = self.state();
        if state.curve.last().is_some_and(|last| last.passes >= passes) {
            return;
        }
        if state.curve.len() >= POINTS {
            let mut number = 0;
            state.curve.retain(|_| {
                number += 1;
                number % 2 == 0
            });
        }
        state.curve.push(Point { passes, seconds, error });
    }

    /// The picture of the complete passes, at most about a second old; `None` before the first pass.
    pub(crate) async fn picture(&self) -> Option<Arc<Picture>> {
        let picture = self.pictures.latest().await?;
        self.note_error(picture.average.passes, picture.error);
        Some(picture)
    }

    /// A permit for an open page, held until dropped; `None` if too many are open.
    pub(crate) fn sit_down(&self) -> Option<OwnedSemaphorePermit> {
        self.places.clone().try_acquire_owned().ok()
    }

    /// Resolves when no page is open, or after `patience`.
    pub(crate) async fn left_alone(&self, patience: Duration) {
        let _ = timeout(patience, self.places.acquire_many(PAGES as u32)).await;
    }

    pub(crate) fn pictures(&self) -> &Pictures {
        &self.pictures
    }

    /// The completed fraction of the job, by passes or by time, whichever is larger.
    pub fn fraction(&self, progress: &Progress) -> f64 {
        fraction(progress, self.elapsed(), &self.terms)
    }

    /// Remaining time, by passes or by time, whichever ends first. `None` while unknown.
    pub fn remaining(&self, progress: &Progress) -> Option<Duration> {
        let rate = self.rates().passes;
        remaining(progress, self.elapsed(), &self.terms, rate)
    }

    /// The queue of requests to write the image. Until somebody takes it, nobody can write.
    pub fn write_requests(&self) -> mpsc::Receiver<WriteRequest> {
        let (sender, receiver) = mpsc::channel(WAITING_WRITES);
        *self.writer.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender);
        receiver
    }

    /// Have the image of the complete passes written. Returns a description of what was written.
    pub async fn write_now(&self) -> Result<String, String> {
        let writer = self.writer.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let writer = writer.ok_or("this coordinator writes no images")?;
        let (reply, written) = oneshot::channel();
        let busy = |_| "the image is being written already".to_owned();
        writer.try_send(reply).map_err(busy)?;
        let over = |_| "the job is over; its image is written at its end".to_owned();
        written.await.map_err(over)?
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn fraction(progress: &Progress, elapsed: Duration, terms: &Terms) -> f64 {
    let first = terms.first_pass;
    let all = progress.limit.saturating_sub(first).max(1);
    let passes = progress.prefix.saturating_sub(first) as f64 / all as f64;
    let time = terms
        .time
        .map_or(0.0, |time| elapsed.as_secs_f64() / time.as_secs_f64());
    passes.max(time).min(1.0)
}

fn remaining(progress: &Progress, elapsed: Duration, terms: &Terms, rate: f64) -> Option<Duration> {
    let done = terms.first_pass.saturating_add(progress.passes);
    let left = progress.limit.saturating_sub(done) as f64;
    // Not finite while nothing is known.
    let by_passes = Duration::try_from_secs_f64(left / rate).ok();
    let by_passes = by_passes.filter(|_| !progress.paused && progress.limit < MAX_PASSES);
    let by_time = terms.time.map(|time| time.saturating_sub(elapsed));
    by_passes.into_iter().chain(by_time).min()
}

fn job_id(title: &str, job: &Job) -> String {
    let hash = blake3::hash(&wire::Job::from(job).encode_to_vec()).to_hex();
    match title {
        "" => hash[..8].to_owned(),
        title => format!("{title}-{}", &hash[..8]),
    }
}

/// Seconds since 1970, for messages and pages.
pub(crate) fn unix_time(time: SystemTime) -> Duration {
    time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_on_after_a_restart() {
        let before = Duration::from_secs(100);
        let farm = picture::tests::farm(8, None, before);
        let watch = Watch::new(farm, Terms::default());
        let point = |passes, seconds, error| Point { passes, seconds, error };
        let earlier = [point(2, 20.0, 0.4), point(4, 50.0, 0.3)];
        let nonsense = [point(3, 60.0, 0.3), point(6, f64::NAN, 0.3)];
        watch.recall(earlier.into_iter().chain(nonsense));
        watch.note_error(4, 0.3);
        watch.note_error(8, 0.2);
        let curve = watch.curve();
        assert_eq!(curve[..2], earlier);
        assert_eq!((curve.len(), curve[2].passes), (3, 8));
        assert!(curve[2].seconds >= 100.0);
        assert!(watch.elapsed() < before && watch.elapsed_in_all() >= before);
    }

    #[test]
    fn the_nearer_end_counts() {
        let ten = Duration::from_secs(10);
        let open = Terms::default();
        let minute = Terms {
            time: Some(Duration::from_secs(60)),
            ..Terms::default()
        };
        let mut progress = Progress {
            prefix: 50,
            passes: 50,
            limit: 100,
            ..Progress::default()
        };
        assert_eq!(fraction(&progress, ten, &minute), 0.5);
        let five = Some(Duration::from_secs(5));
        assert_eq!(remaining(&progress, ten, &minute, 10.0), five);
        let fifty = Some(Duration::from_secs(50));
        assert_eq!(remaining(&progress, ten, &minute, 0.5), fifty);
        assert_eq!(remaining(&progress, ten, &open, 0.0), None);
        // Half of the second half.
        let part = Terms {
            first_pass: 50,
            ..Terms::default()
        };
        (progress.prefix, progress.passes) = (75, 25);
        assert_eq!(fraction(&progress, ten, &part), 0.5);
        assert_eq!(remaining(&progress, ten, &part, 5.0), five);
        progress.paused = true;
        assert_eq!(remaining(&progress, ten, &open, 10.0), None);
        progress = Progress {
            limit: MAX_PASSES,
            ..Progress::default()
        };
        assert_eq!(remaining(&progress, ten, &open, 10.0), None);
    }
}
