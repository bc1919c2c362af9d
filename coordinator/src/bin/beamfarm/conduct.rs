//! A job from its first pass to its image.

use crate::directory::Directory;
use crate::failure::Failure;
use crate::history::History;
use crate::image::{Written, write, write_now};
use crate::job::JobArgs;
use crate::onlookers::{hang_ups, log_configuration, write_on_request};
use crate::output::Output;
use crate::progress;
use crate::summary::{Stop, Summary};
use beamfarm_coordinator::store::{Folder, Keeper, StoreError};
use beamfarm_coordinator::{Entrance, Farm, Terms, Watch, server};
use beamfarm_image::merge::Average;
use beamfarm_worker::{complain, signals};
use std::convert::Infallible;
use std::future::{Future, pending};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio::time::{MissedTickBehavior, interval};
use tracing::{Instrument, error_span, warn};

/// Time between looks for the first pass.
const FIRST_LOOK: Duration = Duration::from_millis(500);

/// Serve the farm until its job ends in whatever way, then write what is complete. `crew` runs beside it and only ends
/// early to say what went wrong.
pub async fn conduct(
    args: &JobArgs,
    output: &Output,
    exposure: f32,
    farm: Arc<Farm>,
    directory: Option<Directory>,
    entrance: impl Into<Entrance>,
    crew: impl Future<Output = Result<(), String>>,
) -> Result<(), Failure> {
    let terms = Terms {
        title: output.title(),
        time: args.time,
        target: args.target_error,
        first_pass: args.first_pass,
        exposure,
        drops_photons: output.drops_photons,
        names: output.names.clone(),
        empty_depth: output.empty_depth,
    };
    let watch = Watch::new(farm, terms);
    let span = error_span!("job", job = watch.id());
    let job = run(args, output, &watch, directory, entrance.into(), crew);
    let done = job.instrument(span).await;
    args.onlookers.tell_end(&done);
    done
}

async fn run(
    args: &JobArgs,
    output: &Output,
    watch: &Arc<Watch>,
    directory: Option<Directory>,
    entrance: Entrance,
    crew: impl Future<Output = Result<(), String>>,
) -> Result<(), Failure> {
    let farm = watch.farm();
    let job = Job {
        args,
        output,
        watch,
        history: begin_history(watch, output),
        is_dark: AtomicBool::new(false),
    };
    // Before there is anything that somebody could take for a sign that it listens.
    let drain = signals::drain().map_err(Failure::io)?;
    let mut hang_ups = hang_ups().map_err(Failure::io)?;
    let keeper = directory.map(|Directory { folder, entries }| {
        let keeper = Keeper::start(folder, farm.clone(), entries);
        keeper.map_err(Failure::io)
    });
    let keeper = keeper.transpose()?;
    let (close, closed) = oneshot::channel::<()>();
    let closed = async {
        // Comes as an error: nothing is ever sent.
        let _ = closed.await;
    };
    let address = entrance.listener.local_addr().map_err(Failure::io)?;
    log_configuration(watch, address, &output.exr, farm.progress().limit);
    if output.drops_photons {
        warn!("the image will be biased: the scene's targeting = \"reject\" drops photons that miss all targets");
    }
    let mut server = tokio::spawn(server::run(entrance, watch.clone(), closed).in_current_span());
    let told = args.onlookers.tell(watch);
    let stop = job.until_it_stops(drain, &mut hang_ups, crew, &mut server).await;
    farm.stop();
    drop(close);
    progress::clear();

    let (folder, kept) = match keeper {
        None => (None, Ok(())),
        Some(keeper) => tokio::task::spawn_blocking(|| keeper.finish())
            .await
            .map_err(Failure::io)?,
    };
    let image = job.write().await;
    // Workers and onlookers hear of the end meanwhile.
    told.last_words().await;
    if !server.is_finished() {
        let _ = server.await;
    }
    let summary = Summary {
        args,
        output,
        farm,
        image: image?,
        stop,
    };
    conclude(summary, folder, kept)
}

/// The record beside the image, from where an earlier coordinator of the job left it.
fn begin_history(watch: &Watch, output: &Output) -> Arc<History> {
    let before = watch.farm().snapshot();
    let seconds = Duration::try_from_secs_f64(before.seconds).unwrap_or_default();
    let history = History::new(&output.exr, before.sum.prefix(), seconds);
    watch.recall(history.points());
    history
}

/// A job that runs.
struct Job<'a> {
    args: &'a JobArgs,
    output: &'a Output,
    watch: &'a Arc<Watch>,
    history: Arc<History>,
    /// It was said that the image is black.
    is_dark: AtomicBool,
}

impl Job<'_> {
    /// A job that does not begin with the first pass makes no image.
    fn makes_image(&self) -> bool {
        self.args.first_pass == 0
    }

    /// Show and keep what there is, and write it when somebody asks, until no more passes are to be taken.
    async fn until_it_stops(
        &self,
        mut drain: tokio::sync::watch::Receiver<bool>,
        hang_ups: &mut mpsc::Receiver<()>,
        crew: impl Future<Output = Result<(), String>>,
        server: &mut JoinHandle<()>,
    ) -> Stop {
        let farm = self.watch.farm();
        let exposure = self.watch.terms().exposure;
        let time = async {
            match self.args.time {
                Some(time) => tokio::time::sleep(time).await,
                None => pending().await,
            }
        };
        let crew_broken = async {
            match crew.await {
                // It ends in peace only with the farm.
                Ok(()) => pending().await,
                Err(message) => message,
            }
        };
        let write_on_request = write_on_request(self.watch, hang_ups, || write_now(farm, self.output, exposure));
        let broken = |what: &str, how: String| Stop::Broken(format!("{what}: {how}"));
        tokio::select! {
            // First: a job that was finished before needs no crew.
            biased;
            end = farm.ended() => Stop::Ended(end),
            () = time => Stop::Time,
            _ = drain.wait_for(|drain| *drain) => Stop::Signal,
            message = crew_broken => Stop::Broken(message),
            served = server => match served {
                Ok(()) => broken("the server", "ended early".into()),
                Err(error) => broken("the server", error.to_string()),
            },
            never = self.look_for_light() => match never {},
            never = self.show() => match never {},
            never = self.keep() => match never {},
            never = write_on_request => match never {},
        }
    }

    async fn show(&self) -> Infallible {
        if !self.args.quiet {
            progress::show(self.watch.clone()).await;
        }
        pending().await
    }

    /// Say early that nothing will come of it.
    async fn look_for_light(&self) -> Infallible {
        let mut looks = interval(FIRST_LOOK);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        while self.makes_image() && !self.args.quiet {
            looks.tick().await;
            let farm = self.watch.farm().clone();
            if farm.progress().prefix == 0 {
                continue;
            }
            let average = tokio::task::spawn_blocking(move || farm.average()).await;
            if let Ok(Some(average)) = average {
                self.tell_of_darkness(&average);
            }
            break;
        }
        pending().await
    }

    fn tell_of_darkness(&self, average: &Average) {
        let is_black = average.beauty.pixels.as_flattened().iter().all(|value| *value == 0.0);
        if is_black && !self.is_dark.swap(true, Ordering::Relaxed) {
            let passes = average.passes;
            complain!(
                "warning: after {passes} passes the image is black. No light reaches what the camera sees: is it inside of \
                 something opaque, or the light; is what it should see behind it? `beamfarm explain` prints where things are"
            );
        }
    }

    async fn keep(&self) -> Infallible {
        if self.makes_image() {
            let history = self.history.clone();
            history.keep(self.watch.farm().clone()).await;
        }
        pending().await
    }

    /// Write the image for the last time, if the job makes one.
    async fn write(&self) -> Result<Option<Written>, Failure> {
        if !self.makes_image() {
            return Ok(None);
        }
        let exposure = self.watch.terms().exposure;
        let history = Some(self.history.clone());
        let written = write(self.watch.farm(), self.output, exposure, history).await?;
        if let Some(Written { average, .. }) = written.as_ref().filter(|_| !self.args.quiet) {
            self.tell_of_darkness(average);
        }
        Ok(written)
    }
}

/// Say how the job ended, on stdout, in its folder and by the exit code.
fn conclude(summary: Summary<'_>, folder: Option<Folder>, kept: Result<(), StoreError>) -> Result<(), Failure> {
    if !summary.args.quiet {
        summary.print();
    }
    if let Some(folder) = folder {
        let reported = folder.write_report(&summary.report());
        kept.and(reported)
            .map_err(|error| Failure::io(format!("{error}; what the job folder holds is older than the image")))?;
    } else {
        kept?;
    }
    summary.verdict()
}
