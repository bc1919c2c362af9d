//! `beamfarm cancel`, `pause`, `resume`, `extend` and `write`: control a running job.

use crate::failure::Failure;
use crate::remote::{RemoteArgs, failed};
use beamfarm_image::job::MAX_PASSES;
use beamfarm_proto::wire;
use beamfarm_worker::say;
use clap::Args;

pub const CANCEL_EXAMPLES: &str = "\
Examples:
  beamfarm cancel http://coordinator:7325

The coordinator ends as after SIGTERM: it writes the image of the passes that are complete.";

pub const PAUSE_EXAMPLES: &str = "\
Examples:
  beamfarm pause http://coordinator:7325
  beamfarm resume http://coordinator:7325

Passes that workers have at hand are finished and count. The time of a job with --time goes on.";

pub const EXTEND_EXAMPLES: &str = "\
Examples:
  beamfarm extend http://coordinator:7325 --passes 2000       2000 passes in all

The image is the one that the job would have had with as many passes from the start.";

pub const WRITE_EXAMPLES: &str = "\
Examples:
  beamfarm write http://coordinator:7325
  kill -HUP PID                                               the same, on the coordinator's machine

The image goes where the job's image will go, and the job goes on.";

#[derive(Args)]
pub struct ExtendArgs {
    #[command(flatten)]
    remote: RemoteArgs,

    /// Total number of passes of the job
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_PASSES))]
    passes: u64,
}

pub fn cancel(args: RemoteArgs) -> Result<(), Failure> {
    args.call(async |mut control| {
        let reply = control.cancel(wire::CancelRequest {}).await;
        let prefix = reply.map_err(failed)?.into_inner().prefix;
        say!("cancelled with {prefix} complete passes");
        Ok(())
    })
}

pub fn pause(args: RemoteArgs) -> Result<(), Failure> {
    args.call(async |mut control| {
        control.pause(wire::PauseRequest {}).await.map_err(failed)?;
        say!("paused");
        Ok(())
    })
}

pub fn resume(args: RemoteArgs) -> Result<(), Failure> {
    args.call(async |mut control| {
        let reply = control.resume(wire::ResumeRequest {}).await;
        reply.map_err(failed)?;
        say!("resumed");
        Ok(())
    })
}

pub fn extend(args: ExtendArgs) -> Result<(), Failure> {
    let passes = args.passes;
    args.remote.call(async |mut control| {
        let reply = control.extend(wire::ExtendRequest { passes }).await;
        reply.map_err(failed)?;
        say!("the job has {passes} passes now");
        Ok(())
    })
}

pub fn write(args: RemoteArgs) -> Result<(), Failure> {
    args.call(async |mut control| {
        let reply = control.write_now(wire::WriteNowRequest {}).await;
        say!("{}", reply.map_err(failed)?.into_inner().message);
        Ok(())
    })
}
