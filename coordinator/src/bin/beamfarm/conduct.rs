//! A job from its first pass to its image.

use crate::failure::Failure;
use crate::history::History;
use crate::job::JobArgs;
use crate::output::Output;
use crate::progress::{self, si};
use beamfarm_coordinator::{End, Entrance, Farm, server};
use beamfarm_proto::VERSION;
use beamfarm_shared::exr::{ImageMeta, Maker, pixel_hash};
use beamfarm_shared::merge::Average;
use beamfarm_worker::signals;
use std::convert::Infallible;
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// Why no more passes were taken.
enum Stop {
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
    entrance: impl Into<Entrance>,
    crew: impl Future<Output = Result<(), String>>,
) -> Result<(), Failure> {
    let started = Instant::now();
    let history = History::new(&output.exr);
    let mut drain = signals::drain().map_err(Failure::io)?;
    let (close, closed) = oneshot::channel::<()>();
    let closed = async {
        // Comes as an error: nothing is ever sent.
        let _ = closed.await;
    };
    let mut server = tokio::spawn(server::run(entrance.into(), farm.clone(), closed));
    let time = async {
        match args.time {
            Some(time) => tokio::time::sleep(time).await,
            None => std::future::pending().await,
        }
    };
    let show = async {
        if !args.quiet {
            progress::show(farm.clone(), args.time).await;
        }
        std::future::pending::<Infallible>().await
    };
    let keep = async {
        history.clone().keep(farm.clone()).await;
        std::future::pending::<Infallible>().await
    };
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
        }
    };
    farm.stop();
    drop(close);
    progress::clear();

    let elapsed = started.elapsed();
    let written = write(&farm, output, exposure, elapsed, history).await;
    // Workers hear of the end meanwhile.
    if !server.is_finished() {
        let _ = server.await;
    }
    let average = written?;
    if !args.quiet {
        summarise(&farm, average.as_ref(), output, elapsed);
    }
    verdict(stop, &farm, average)
}

async fn write(
    farm: &Arc<Farm>,
    output: &Output,
    exposure: f32,
    elapsed: Duration,
    history: Arc<History>,
) -> Result<Option<Average>, Failure> {
    let (farm, output) = (farm.clone(), output.clone());
    let write = move || {
        let average = farm.average();
        if let Some(average) = &average {
            let meta = ImageMeta {
                scene: farm.job().scene,
                maker: Maker::Passes(farm.job().settings),
                render_seconds: elapsed.as_secs_f64(),
                version: VERSION.into(),
                layers: farm.job().layers.clone(),
                standard_error: output.standard_error,
            };
            output.write(average, &meta, exposure)?;
            history.finish(average, &farm.progress())?;
        }
        Ok(average)
    };
    tokio::task::spawn_blocking(write)
        .await
        .map_err(Failure::io)?
}

fn summarise(farm: &Farm, average: Option<&Average>, output: &Output, elapsed: Duration) {
    let progress = farm.progress();
    let seconds = elapsed.as_secs_f64();
    if let Some(average) = average {
        println!(
            "wrote {}, {} and {}",
            output.exr.display(),
            output.png.display(),
            output.exr.with_extension("csv").display()
        );
        println!(
            "{} passes in {seconds:.1} s ({:.2} passes/s, {}beams/s) from {} workers",
            average.passes,
            average.passes as f64 / seconds,
            si(progress.stats.beams as f64 / seconds),
            progress.registered,
        );
        if progress.stats.beams > 0 {
            println!("{:.0} bytes a beam", progress.stats.bytes_per_beam());
        }
        let error = average.relative_standard_error();
        if error.is_finite() {
            println!("relative standard error {:.2} %", 100.0 * error);
        }
        if let Some(bias) = &average.bias {
            println!("{bias}");
        }
        println!("pixels {}", pixel_hash(&average.beauty));
    }
    for (count, what) in [
        (
            progress.lost_leases,
            "passes were lost and handed out again",
        ),
        (progress.duplicates, "passes arrived twice, with equal bits"),
        (progress.failures, "attempts at a pass failed"),
        (progress.refused, "deliveries were refused"),
    ] {
        if count > 0 {
            println!("{count} {what}");
        }
    }
}

fn verdict(stop: Stop, farm: &Farm, average: Option<Average>) -> Result<(), Failure> {
    let written = match &average {
        Some(average) => format!("the image is that of the {} passes before", average.passes),
        None => "nothing was written".into(),
    };
    let progress = farm.progress();
    if let Stop::Ended(End::Failed(failure)) = stop {
        return Err(Failure::job(format!(
            "pass {} failed {} times: {}; {written}",
            failure.pass_index, failure.attempts, failure.message
        )));
    }
    if let Stop::Broken(message) = stop {
        return Err(Failure::job(format!("{message}; {written}")));
    }
    if progress.divergent > 0 {
        return Err(Failure::job(format!(
            "{} passes were delivered twice with different pixels: one of the machines miscalculates, and the image is \
             not to be trusted (the log names them)",
            progress.divergent
        )));
    }
    match (stop, average) {
        (_, Some(_)) => Ok(()),
        (Stop::Signal, None) => Err(Failure::nothing(
            "stopped before the first pass was complete",
        )),
        (_, None) => Err(Failure::nothing(
            "the time was over before the first pass was complete; give it more with --time",
        )),
    }
}
