//! A job from its first pass to its image.

use crate::directory::Directory;
use crate::failure::Failure;
use crate::history::History;
use crate::job::JobArgs;
use crate::onlookers::{log_configuration, write_on_request};
use crate::output::Output;
use crate::progress;
use crate::summary::Summary;
use beamfarm_coordinator::store::Keeper;
use beamfarm_coordinator::{End, Entrance, Farm, Terms, Watch, server};
use beamfarm_image::exr::{ImageMeta, Maker};
use beamfarm_image::merge::Average;
use beamfarm_proto::VERSION;
use beamfarm_worker::signals;
use std::convert::Infallible;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::oneshot;
use tracing::{Instrument, Span, error_span, warn};

/// Why no more passes were taken.
pub enum Stop {
    /// The farm ended by itself.
    Ended(End),
    /// The time is over.
    Time,
    /// Someone sent a signal.
    Signal,
    /// What had to keep running did not.
    Broken(String),
}

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
    let farm = watch.farm().clone();
    let exposure = watch.terms().exposure;
    let before = farm.snapshot();
    let seconds = Duration::try_from_secs_f64(before.seconds).unwrap_or_default();
    let history = History::new(&output.exr, before.sum.prefix(), seconds);
    drop(before);
    watch.recall(history.points());
    let makes_image = args.first_pass == 0;
    let keeper = directory.map(|Directory { folder, entries }| {
        let keeper = Keeper::start(folder, farm.clone(), entries);
        keeper.map_err(Failure::io)
    });
    let keeper = keeper.transpose()?;
    let mut drain = signals::drain().map_err(Failure::io)?;
    let (close, closed) = oneshot::channel::<()>();
    let closed = async {
        // Comes as an error: nothing is ever sent.
        let _ = closed.await;
    };
    let address = entrance.listener.local_addr().map_err(Failure::io)?;
    log_configuration(watch, address, &output.exr, farm.progress().limit);
    if output.drops_photons {
        warn!(
            "the image will be biased: the scene's targeting = \"reject\" drops photons that miss all targets"
        );
    }
    let mut server = tokio::spawn(server::run(entrance, watch.clone(), closed).in_current_span());
    let told = args.onlookers.tell(watch);
    let time = async {
        match args.time {
            Some(time) => tokio::time::sleep(time).await,
            None => std::future::pending().await,
        }
    };
    let show = async {
        if !args.quiet {
            progress::show(watch.clone()).await;
        }
        std::future::pending::<Infallible>().await
    };
    let keep = async {
        if makes_image {
            history.clone().keep(farm.clone()).await;
        }
        std::future::pending::<Infallible>().await
    };
    let write_on_request = write_on_request(watch, || write_now(&farm, output, exposure));
    let broken = |what: &str, how: String| Stop::Broken(format!("{what}: {how}"));
    let stop = {
        tokio::pin!(crew);
        let crew_broken = async {
            match (&mut crew).await {
                // It ends in peace only with the farm.
                Ok(()) => std::future::pending().await,
                Err(message) => message,
            }
        };
        tokio::select! {
            // First: a job that was finished before needs no crew.
            biased;
            end = farm.ended() => Stop::Ended(end),
            () = time => Stop::Time,
            _ = drain.wait_for(|drain| *drain) => Stop::Signal,
            message = crew_broken => Stop::Broken(message),
            served = &mut server => match served {
                Ok(()) => broken("the server", "ended early".into()),
                Err(error) => broken("the server", error.to_string()),
            },
            never = show => match never {},
            never = keep => match never {},
            failed = write_on_request => match failed {
                Ok(never) => match never {},
                Err(error) => broken("SIGHUP", error.to_string()),
            },
        }
    };
    farm.stop();
    drop(close);
    progress::clear();

    let (folder, kept) = match keeper {
        None => (None, Ok(())),
        Some(keeper) => tokio::task::spawn_blocking(|| keeper.finish())
            .await
            .map_err(Failure::io)?,
    };
    let written = match makes_image {
        true => write(&farm, output, exposure, Some(history)).await,
        false => Ok(None),
    };
    // Workers and onlookers hear of the end meanwhile.
    told.last_words().await;
    if !server.is_finished() {
        let _ = server.await;
    }
    let summary = Summary {
        args,
        output,
        farm: &farm,
        image: written?,
        stop,
    };
    if !args.quiet {
        summary.print();
    }
    if let Some(folder) = folder {
        let reported = folder.write_report(&summary.report());
        kept.and(reported).map_err(|error| {
            Failure::io(format!(
                "{error}; what the job folder holds is older than the image"
            ))
        })?;
    } else {
        kept?;
    }
    summary.verdict()
}

/// An image as it was written.
pub struct Written {
    pub average: Average,
    pub meta: ImageMeta,
}

/// Write the image of the complete prefix now, and go on. Returns what was written, for people.
async fn write_now(farm: &Arc<Farm>, output: &Output, exposure: f32) -> Result<String, Failure> {
    match write(farm, output, exposure, None).await? {
        Some(Written { average, .. }) => Ok(format!(
            "wrote {} with {} passes",
            output.exr.display(),
            average.passes
        )),
        None => Err(Failure::nothing("no pass is complete")),
    }
}

async fn write(
    farm: &Arc<Farm>,
    output: &Output,
    exposure: f32,
    history: Option<Arc<History>>,
) -> Result<Option<Written>, Failure> {
    let (farm, output) = (farm.clone(), output.clone());
    let span = Span::current();
    let write = move || {
        let _job = span.entered();
        let Some(average) = farm.average() else {
            return Ok(None);
        };
        let meta = ImageMeta {
            scene: farm.job().scene,
            maker: Maker::Passes(farm.job().settings),
            render_seconds: farm.snapshot().seconds,
            version: VERSION.into(),
            layers: farm.job().layers.clone(),
            standard_error: output.standard_error,
            drops_photons: output.drops_photons,
        };
        output.write(&average, &meta, exposure)?;
        if let Some(history) = history {
            history.finish(&average, &farm.progress())?;
        }
        Ok(Some(Written { average, meta }))
    };
    tokio::task::spawn_blocking(write)
        .await
        .map_err(Failure::io)?
}
