//! A job before its coordinator starts: its scene is loaded, and a pilot may be running.

use crate::failure::Failure;
use crate::job::JobArgs;
use crate::loaded::{Early, Loaded};
use crate::output::{Output, check};
use beamfarm_scene::SceneFile;
use beamfarm_worker::say;
use std::path::Path;
use tokio::sync::{oneshot, watch};
use tracing::warn;

/// Load the scene of a job. A signal interrupts even a long pilot, and then writes a coarse picture if there is one.
pub async fn load(args: &JobArgs, drain: &mut watch::Receiver<bool>) -> Result<Loaded, Failure> {
    // Check first, as a pilot may take as long as rendering.
    args.output.as_deref().map_or(Ok(()), check)?;
    let (sender, loaded) = oneshot::channel();
    let (known, early) = oneshot::channel();
    let own = args.clone();
    // A thread that is not joined.
    std::thread::spawn(move || {
        let tell = |early: Early| {
            early.announce(own.quiet);
            if let Err(failure) = own
                .sketch
                .as_deref()
                .map_or(Ok(()), |path| write(Some(path), &own, &early).map(drop))
            {
                warn!("{failure}");
            }
            // Fails if loading was stopped.
            let _ = known.send(early);
        };
        let choosing = |scene| own.choosing("", scene);
        let _ = sender.send(own.settings.load_by(SceneFile::load, choosing, tell));
    });
    tokio::select! {
        biased;
        loaded = loaded => loaded.map_err(Failure::io)?,
        _ = drain.wait_for(|drain| *drain) => Err(stopped(args, early)),
    }
}

fn stopped(args: &JobArgs, mut early: oneshot::Receiver<Early>) -> Failure {
    let early = early.try_recv().ok().filter(|_| args.first_pass == 0);
    let written = early.map(|early| write(args.output.as_deref(), args, &early));
    let written = match written {
        Some(Err(failure)) => return failure,
        Some(Ok(Some(words))) => {
            if !args.quiet {
                say!("{words}; no pass is complete, and it is part of none");
            }
            "a coarse picture was written"
        }
        Some(Ok(None)) | None => "nothing was written",
    };
    let message = format!("stopped before the first pass; {written}");
    match args.preemptible {
        true => Failure::preempted(message),
        false => Failure::nothing(message),
    }
}

fn write(path: Option<&Path>, args: &JobArgs, early: &Early) -> Result<Option<String>, Failure> {
    let Some(sketch) = &early.sketch else { return Ok(None) };
    let output = Output::new(path, &args.settings.of.scene, "", false)?;
    Ok(Some(output.write_sketch(
        sketch,
        early.scene,
        args.view.over(early.view),
    )?))
}
