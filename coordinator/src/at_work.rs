//! A running job: how it is shown and recorded, and what ends it.

use crate::failure::Failure;
use crate::history::History;
use crate::image::{Written, write, write_now};
use crate::job::JobArgs;
use crate::onlookers::write_on_request;
use crate::output::Output;
use crate::progress;
use crate::sketch::Sketch;
use crate::summary::Stop;
use beamfarm_coordinator::{End, Watch};
use beamfarm_image::merge::Average;
use beamfarm_worker::complain;
use std::convert::Infallible;
use std::future::{Future, pending};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval};

/// Time between checks for the first pass.
const FIRST_LOOK: Duration = Duration::from_millis(500);

/// The record next to the image, continued from an earlier coordinator of the job.
fn begin_history(watch: &Watch, output: &Output) -> Arc<History> {
    let before = watch.farm().snapshot();
    let seconds = Duration::try_from_secs_f64(before.seconds).unwrap_or_default();
    let history = History::new(&output.exr, before.sum.prefix(), seconds);
    watch.recall(history.points());
    history
}

/// A running job.
pub struct AtWork<'a> {
    args: &'a JobArgs,
    output: &'a Output,
    watch: &'a Arc<Watch>,
    history: Arc<History>,
    /// Prefix of progress lines.
    label: String,
    /// Whether a warning about a black image was printed.
    is_dark: AtomicBool,
}

impl<'a> AtWork<'a> {
    /// Start the job's clock.
    pub fn begin(args: &'a JobArgs, output: &'a Output, watch: &'a Arc<Watch>, label: String) -> Self {
        Self {
            args,
            output,
            watch,
            history: begin_history(watch, output),
            label,
            is_dark: AtomicBool::new(false),
        }
    }

    /// A job that does not start with pass 0 makes no image.
    fn makes_image(&self) -> bool {
        self.args.first_pass == 0
    }

    /// Show and record progress, and write the image on request, until the job should stop. Its time starts when its
    /// turn comes; `broken` reports the failure of something that it depends on.
    pub async fn until_it_stops(
        &self,
        turn: impl Future<Output = ()>,
        drain: impl Future<Output = ()>,
        hang_ups: &mut mpsc::Receiver<()>,
        broken: impl Future<Output = String>,
    ) -> Stop {
        let farm = self.watch.farm();
        let view = self.watch.terms().view;
        let run = async {
            turn.await;
            let time = async {
                match self.args.time {
                    Some(time) => tokio::time::sleep(time).await,
                    None => pending().await,
                }
            };
            tokio::select! {
                () = time => Stop::Time,
                never = self.look_for_light() => match never {},
                never = self.show() => match never {},
            }
        };
        let write_on_request = write_on_request(self.watch, hang_ups, || write_now(farm, self.output, view));
        tokio::select! {
            // First: a job that is already complete needs no workers.
            biased;
            end = farm.ended() => Stop::Ended(end),
            () = drain => Stop::Signal,
            message = broken => Stop::Broken(message),
            stop = run => stop,
            never = self.keep() => match never {},
            never = write_on_request => match never {},
        }
    }

    async fn show(&self) -> Infallible {
        if !self.args.quiet {
            progress::show(self.watch.clone(), &self.label).await;
        }
        pending().await
    }

    /// Warn early if the image stays black.
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
                "warning: after {passes} passes the image is black: no light reaches what the camera sees. Is the \
                 camera or the light inside something opaque, or the scene behind the camera? `beamfarm explain` \
                 prints where things are"
            );
        }
    }

    async fn keep(&self) -> Infallible {
        if self.makes_image() {
            let history = self.history.clone();
            history.keep(self.watch.clone()).await;
        }
        pending().await
    }

    /// Write the final image, if the job makes one.
    pub async fn write(&self) -> Result<Option<Written>, Failure> {
        if !self.makes_image() {
            return Ok(None);
        }
        let view = self.watch.terms().view;
        let history = Some(self.history.clone());
        let written = write(self.watch.farm(), self.output, view, history).await?;
        if let Some(Written { average, .. }) = written.as_ref().filter(|_| !self.args.quiet) {
            self.tell_of_darkness(average);
        }
        Ok(written)
    }

    /// Write a coarse picture if a job that makes an image was stopped before its first pass. Returns what was written,
    /// for display.
    pub async fn write_sketch(&self, stop: &Stop) -> Result<Option<String>, Failure> {
        let is_stopped = matches!(stop, Stop::Time | Stop::Signal | Stop::Ended(End::Stopped));
        let Some(coarse) = self.output.sketch.clone().filter(|_| is_stopped && self.makes_image()) else {
            return Ok(None);
        };
        let farm = self.watch.farm();
        let sketch = Sketch::of_job(farm.clone()).await.unwrap_or(coarse);
        let (output, scene, view) = (self.output.clone(), farm.job().scene, self.watch.terms().view);
        let written = tokio::task::spawn_blocking(move || output.write_sketch(&sketch, scene, view)).await;
        Ok(Some(written.map_err(Failure::io)??))
    }
}
