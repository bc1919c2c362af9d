//! A worker of beamfarm on its own, for containers: the same as `beamfarm worker`.

use beamfarm_worker::cli::{self, LogArgs, WorkerArgs};
use beamfarm_worker::complain;
use beamfarm_worker::engine::spare_desktop;
use beamfarm_worker::exit;
use clap::Parser;
use std::process::ExitCode;

/// Render passes for a beamfarm coordinator until its job is done
#[derive(Parser)]
#[command(name = "beamfarm-worker", version, long_version = cli::long_version(), after_help = exit::HELP)]
struct Options {
    #[command(flatten)]
    worker: WorkerArgs,
    #[command(flatten)]
    log: LogArgs,
}

fn main() -> ExitCode {
    // SAFETY: this is the only thread.
    unsafe { spare_desktop() };
    let options = Options::parse();
    if let Err(message) = options.log.init("info", std::io::stderr) {
        complain!("error: {message}");
        return ExitCode::from(exit::USAGE);
    }
    cli::main(options.worker)
}
