//! A job from its first pass to its image.

use crate::again::Again;
use crate::at_work::AtWork;
use crate::directory::Directory;
use crate::failure::Failure;
use crate::job::JobArgs;
use crate::onlookers::{Share, hang_ups, log_configuration};
use crate::output::Output;
use crate::progress;
use crate::summary::Summary;
use beamfarm_coordinator::store::Keeper;
use beamfarm_coordinator::{Entrance, Terms, Watch, server};
use beamfarm_image::view::View;
use std::future::{Future, pending};
use std::sync::Arc;
use tokio::sync::{oneshot, watch};
use tokio::task::JoinError;
use tracing::{Instrument, error_span, warn};

/// Serve a farm until its job ends or `drain` asks for it, then write the complete passes. `crew` runs alongside and
/// ends early only to report a failure.
pub async fn conduct(
    args: &JobArgs,
    output: &Output,
    watch: Arc<Watch>,
    directory: Option<Directory>,
    entrance: impl Into<Entrance>,
    crew: impl Future<Output = Result<(), String>>,
    drain: watch::Receiver<bool>,
) -> Result<(), Failure> {
    let span = error_span!("job", job = watch.id());
    let job = run(args, output, &watch, directory, entrance.into(), crew, drain);
    let done = job.instrument(span).await;
    args.onlookers.tell_end(&done);
    done
}

/// Stopping conditions and display of the job.
pub fn terms(args: &JobArgs, output: &Output, view: View) -> Terms {
    Terms {
        title: output.title(),
        time: args.time,
        target: args.target_error,
        first_pass: args.first_pass,
        view,
        drops_photons: output.drops_photons,
        names: output.names.clone(),
        empty_depth: output.empty_depth,
    }
}

async fn run(
    args: &JobArgs,
    output: &Output,
    watch: &Arc<Watch>,
    directory: Option<Directory>,
    entrance: Entrance,
    crew: impl Future<Output = Result<(), String>>,
    mut drain: watch::Receiver<bool>,
) -> Result<(), Failure> {
    let farm = watch.farm();
    let job = AtWork::begin(args, output, watch, String::new());
    let mut hang_ups = hang_ups().map_err(Failure::io)?;
    let keeper = directory.map(|Directory { folder, entries }| {
        let keeper = Keeper::start(folder, farm.clone(), entries);
        keeper.map_err(Failure::io)
    });
    let keeper = keeper.transpose()?;
    let (close, closed) = oneshot::channel::<()>();
    let closed = async {
        // Resolves with an error, as nothing is ever sent.
        let _ = closed.await;
    };
    let address = entrance.listener.local_addr().map_err(Failure::io)?;
    log_configuration(watch, address, &output.exr, farm.progress().limit);
    warn_of_bias(output);
    let mut server = tokio::spawn(server::run(entrance, watch.clone(), closed).in_current_span());
    let told = args.onlookers.tell(watch, Share::default());
    let drained = async {
        let _ = drain.wait_for(|drain| *drain).await;
    };
    let broken = async {
        tokio::select! {
            biased;
            message = broken_crew(crew) => message,
            served = &mut server => broken_server(served),
        }
    };
    let stop = job.until_it_stops(async {}, drained, &mut hang_ups, broken).await;
    farm.stop();
    drop(close);
    progress::clear();

    let (mut folder, kept) = match keeper {
        None => (None, Ok(())),
        Some(keeper) => tokio::task::spawn_blocking(|| keeper.finish())
            .await
            .map_err(Failure::io)?,
    };
    // Another signal stops the wait for a disk.
    let (mut again, never) = (Again::default(), || false);
    let image = loop {
        if let Some(image) = again.settled(job.write().await, false).await {
            break image;
        }
    };
    let kept = again
        .keep_end(&never, folder.as_mut(), farm, kept.map_err(Failure::from))
        .await;
    let sketch = match &image {
        Ok(None) => job.write_sketch(&stop).await,
        _ => Ok(None),
    };
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
        sketch: sketch?,
        stop,
    };
    if !args.quiet {
        summary.print();
    }
    // In the folder and in the exit code as well.
    let reported = again.report(&never, folder.as_ref(), &summary.report()).await;
    kept.and(reported).map_err(|failure| match folder {
        Some(_) => failure.and("what the job folder holds is older than the image"),
        None => failure,
    })?;
    summary.verdict()
}

pub fn warn_of_bias(output: &Output) {
    if output.drops_photons {
        warn!("the image will be biased: the scene's targeting = \"reject\" drops photons that miss all targets");
    }
}

/// The crew's failure. A crew that ends without one waits for the farm to end.
pub async fn broken_crew(crew: impl Future<Output = Result<(), String>>) -> String {
    match crew.await {
        Ok(()) => pending().await,
        Err(message) => message,
    }
}

/// A server that ends on its own has failed.
pub fn broken_server(served: Result<(), JoinError>) -> String {
    match served {
        Ok(()) => "the server: ended early".into(),
        Err(error) => format!("the server: {error}"),
    }
}
