//! `beamfarm serve`: a farm for workers on other machines.

use crate::address;
use crate::conduct::{conduct, terms};
use crate::directory::prepare;
use crate::early;
use crate::failure::Failure;
use crate::frames::{self, Site};
use crate::job::JobArgs;
use crate::security::ListenArgs;
use beamfarm_coordinator::{Entrance, Farm, Timing, Watch, server};
use beamfarm_worker::cli::end_with_parent;
use beamfarm_worker::{say, signals};
use clap::Args;
use std::net::SocketAddr;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm serve scene.toml                             workers on this machine only
  openssl rand -hex 32 > token
  beamfarm serve scene.toml --listen 0.0.0.0:7325 --token-file token
                                                        workers from anywhere, who have the token
  beamfarm worker --connect http://HOST:7325 --token-file token
                                                        on each machine that is to work
  beamfarm serve scene.toml --listen 0.0.0.0:7325 --tls-cert a.pem --tls-key a.key --tls-client-ca ca.pem
                                                        encrypted, for workers with a certificate
  beamfarm serve scene.toml --frames all -o out/frame.####.exr --job jobs
                                                        frames of its animation, each with a folder below jobs

SIGINT and SIGTERM end the job and write the passes that are complete; another one after a second kills.";

#[derive(Args)]
pub struct ServeArgs {
    #[command(flatten)]
    job: JobArgs,

    /// Address or name, and port to listen on; port 0 takes a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:7325", value_parser = address::listen)]
    #[arg(help_heading = "Farm")]
    listen: SocketAddr,

    #[command(flatten)]
    security: ListenArgs,

    /// Have one block in N rendered again by another worker; 0: none
    ///
    /// So are the first two blocks of every worker. Both results are compared bit for bit. When two workers disagree a
    /// third one decides; the wrong one is shut out, and what nobody confirmed of its work is rendered again.
    #[arg(long, value_name = "N", default_value_t = 64, help_heading = "Farm")]
    audit_share: u64,

    /// End when standard input does, for programs that start this one
    #[arg(long, hide = true)]
    with_parent: bool,
}

pub fn main(args: ServeArgs) -> Result<(), Failure> {
    let args = ServeArgs {
        job: args.job.with_implied_layers(),
        ..args
    };
    if args.with_parent {
        end_with_parent().map_err(Failure::io)?;
    }
    let security = args.security.read(args.listen)?;
    if let Some(list) = &args.job.frames.frames {
        let site = Site {
            listen: args.listen,
            security,
            crew: None,
            audit_every: args.audit_share,
            keeps_jobs: true,
            open: false,
            says_address: true,
        };
        return frames::run(&args.job, list, site);
    }
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    // Before anything shows that it is listening.
    let mut drain = runtime.block_on(async { signals::drain() }).map_err(Failure::io)?;
    let loaded = runtime.block_on(early::load(&args.job, &mut drain))?;
    let view = args.job.view.over(loaded.defaults.view);
    let output = args.job.image(&loaded)?;
    let left_out = match args.job.quiet {
        true => Vec::new(),
        false => loaded.announce(),
    };
    let mut spec = args.job.spec(loaded)?;
    spec.audit_every = args.audit_share;
    let (directory, start) = prepare(&args.job, &mut spec, &output, view, true)?;
    runtime.block_on(async {
        let listener = server::listen(args.listen)
            .map_err(|error| Failure::io(format!("cannot listen on {}: {error}", args.listen)))?;
        let address = listener.local_addr().map_err(Failure::io)?;
        if !args.job.quiet {
            say!("listening on {}://{address}", security.scheme());
        }
        let farm = Farm::new(spec, Timing::default(), start);
        let entrance = Entrance {
            security,
            ..listener.into()
        };
        let crew = std::future::pending();
        let watch = Watch::new(farm, terms(&args.job, &output, view));
        conduct(&args.job, &output, watch, directory, entrance, crew, drain).await
    })?;
    for part in left_out {
        say!("left out: {part}");
    }
    Ok(())
}
