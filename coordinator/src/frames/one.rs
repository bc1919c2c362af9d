//! A frame while it renders.

use super::ahead::Ready;
use super::record::FrameRecord;
use crate::again::Again;
use crate::at_work::AtWork;
use crate::conduct::{terms, warn_of_bias};
use crate::failure::Failure;
use crate::job::JobArgs;
use crate::onlookers::{Share, log_configuration};
use crate::output::Output;
use crate::progress;
use crate::summary::{Stop, Summary};
use beamfarm_coordinator::store::Keeper;
use beamfarm_coordinator::{End, Farm, FrameState, FrameView, Series, Timing, Watch, Who};
use std::collections::BTreeSet;
use std::future::pending;
use std::net::SocketAddr;
use std::sync::Arc;
use tokio::sync::{mpsc, oneshot};

/// A frame whose turn has come.
pub struct Begun {
    pub frame: i64,
    pub args: JobArgs,
    pub output: Output,
    pub watch: Arc<Watch>,
    keeper: Option<Keeper>,
    /// `frame 12 (3/48)`.
    label: String,
    share: Share,
    /// Reports that something the frame needs has failed.
    broken: oneshot::Receiver<String>,
}

/// How a frame ended.
pub struct Outcome {
    pub watch: Arc<Watch>,
    pub record: FrameRecord,
    pub label: String,
}

impl Begun {
    /// Start the frame's clock. `convicted`: workers that delivered wrong pixels for other frames. Dropping the sender
    /// of `broken` reports nothing.
    pub fn new(
        ready: Ready,
        share: Share,
        convicted: Vec<Who>,
        said: &mut BTreeSet<String>,
    ) -> Result<(Self, oneshot::Sender<String>), Box<FrameRecord>> {
        let Ready { frame, args, .. } = ready;
        if !args.quiet {
            for (kind, texts) in [("note", ready.notes), ("left out", ready.left_out)] {
                for text in texts {
                    let line = format!("{kind}: {text}");
                    // Most messages are the same for all frames.
                    if !said.contains(&line) {
                        progress::complain(&line);
                        said.insert(line);
                    }
                }
            }
        }
        let mut start = ready.start;
        start.convicted.extend(convicted);
        let farm = Farm::new(ready.spec, Timing::default(), start);
        let keeper = ready.directory.map(|directory| {
            let kept = Keeper::start(directory.folder, farm.clone(), directory.entries);
            kept.map_err(|error| Box::new(FrameRecord::failed(frame, &args, error.to_string())))
        });
        let (sender, broken) = oneshot::channel();
        let begun = Self {
            frame,
            keeper: keeper.transpose()?,
            watch: Watch::new(farm, terms(&args, &ready.output, ready.view)),
            label: share.label(frame),
            output: ready.output,
            args,
            share,
            broken,
        };
        Ok((begun, sender))
    }

    /// The frame in the page's list.
    pub fn view(&self) -> FrameView {
        FrameView {
            state: FrameState::Rendering,
            ..FrameView::waiting(self.frame)
        }
    }

    /// Render the frame from its first pass to its image.
    pub async fn render(self, series: Arc<Series>, address: SocketAddr) -> Outcome {
        let Self {
            frame,
            args,
            output,
            watch,
            keeper,
            label,
            share,
            broken,
        } = self;
        let (args, output, watch) = (&args, &output, &watch);
        let farm = watch.farm();
        log_configuration(watch, address, &output.exr, farm.progress().limit);
        warn_of_bias(output);
        let job = AtWork::begin(args, output, watch, format!("{label}  "));
        let told = async {
            series.first_in_line(watch).await;
            args.onlookers.tell(watch, share)
        };
        let broken = async {
            match broken.await {
                Ok(message) => message,
                Err(_) => pending().await,
            }
        };
        // Signals apply to all frames; this one sees them as the end of its farm.
        let (_, mut hang_ups) = mpsc::channel(1);
        let turn = series.first_in_line(watch);
        let (stop, told) = tokio::join!(
            async {
                let stop = job.until_it_stops(turn, pending(), &mut hang_ups, broken).await;
                farm.stop();
                stop
            },
            told
        );
        let (mut folder, kept) = match keeper {
            None => (None, Ok(())),
            Some(keeper) => match tokio::task::spawn_blocking(|| keeper.finish()).await {
                Ok((folder, kept)) => (folder, kept.map_err(Failure::from)),
                Err(error) => (None, Err(Failure::io(error))),
            },
        };
        let mut again = Again::default();
        let is_over = || series.is_cancelled();
        let written = loop {
            let attempt = job.write().await;
            if attempt.is_err() {
                // Later frames do not wait for this one.
                series.close(watch);
            }
            if let Some(written) = again.settled(attempt, is_over()).await {
                break written;
            }
        };
        let (image, unwritten) = match written {
            Ok(image) => (image, Ok(())),
            Err(failure) => (None, Err(failure)),
        };
        let kept = again.keep_end(&is_over, folder.as_mut(), farm, kept).await;
        let (sketch, unwritten) = match image.is_none() && unwritten.is_ok() {
            true => match job.write_sketch(&stop).await {
                Ok(sketch) => (sketch, Ok(())),
                Err(failure) => (None, Err(failure)),
            },
            false => (None, unwritten),
        };
        told.last_words().await;
        // A frame that was stopped before its first pass has no image, which is not a failure.
        let has_nothing = image.is_none() && matches!(stop, Stop::Ended(End::Stopped));
        let summary = Summary {
            args,
            output,
            farm,
            image,
            sketch,
            stop,
        };
        let report = summary.report();
        let reported = again.report(&is_over, folder.as_ref(), &report).await;
        // From here on the job may be opened again.
        drop(folder);
        let verdict = if has_nothing { Ok(()) } else { summary.verdict() };
        let done = unwritten.and(kept).and(reported).and(verdict);
        let message = done.err().map(|failure| failure.to_string());
        Outcome {
            record: FrameRecord::of(frame, args, &report, message),
            label,
            watch: watch.clone(),
        }
    }
}
