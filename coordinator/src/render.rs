//! `beamfarm render`: a farm of processes on this machine.

use crate::conduct::{conduct, terms};
use crate::directory::prepare;
use crate::early;
use crate::failure::Failure;
use crate::frames::{self, Site};
use crate::job::JobArgs;
use crate::local::{self, Crew, Shape};
use crate::open_page::{open_page, tell_page};
use crate::settings::DeviceArgs;
use beamfarm_coordinator::security::Security;
use beamfarm_coordinator::{Entrance, Farm, Timing, Watch};
use beamfarm_image::job::EngineKind;
use beamfarm_proto::Token;
use beamfarm_worker::cli::{LogArgs, LogFormat, end_with_parent};
use beamfarm_worker::{say, signals};
use clap::Args;
use std::net::Ipv4Addr;
use tokio::net::TcpListener;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm render scene.toml                        all cores, the scene's own number of passes
  beamfarm render scene.toml --time 60s             as many passes as a minute allows
  beamfarm render scene.toml --passes 1000 -o a.exr
  beamfarm render scene.toml --workers 1 --threads 8
  beamfarm render scene.toml --engine gpu           on a device with Vulkan; `beamfarm devices` lists them
  beamfarm render scene.toml --engine auto          on the better engine here, by some passes of each
  beamfarm render scene.toml --target-error 1%      until the error is 1 %
  beamfarm render scene.toml --passes 8 --denoise   scene.denoised.exr and .png as well
  beamfarm render scene.toml --frames 1-48 -o out/frame.####.exr
                                                    frames of its animation, one after the other
  beamfarm render scene.xml -D spp=256              a Mitsuba 3 scene, with a value for its $spp
  beamfarm render model.glb -D camera.fov=40        a glTF file, with its camera and lights or made-up ones

SIGINT (Ctrl-C) ends the job and writes the passes that are complete; another one after a second kills.";

#[derive(Args)]
pub struct RenderArgs {
    #[command(flatten)]
    job: JobArgs,

    /// Worker processes [default: 1 on up to four cores, one for every four cores on more]
    ///
    /// The default worker on up to four cores renders a pass on each. The engine gpu has one worker by default.
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    workers: Option<u16>,

    /// Threads of each worker [default: the number of cores divided by that of workers]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    threads: Option<u16>,

    #[command(flatten)]
    device: DeviceArgs,

    /// Open the page that shows the job in a browser
    #[arg(long)]
    open: bool,

    /// End when standard input does, for programs that start this one
    #[arg(long, hide = true)]
    with_parent: bool,
}

pub fn main(args: RenderArgs, log: &LogArgs) -> Result<(), Failure> {
    let mut args = RenderArgs {
        job: args.job.with_implied_layers(),
        ..args
    };
    args.job.settings.device = Some(args.device.here());
    args.job.settings.measures = true;
    if args.with_parent {
        end_with_parent().map_err(Failure::io)?;
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    // Other users of this machine can reach the port as well.
    let token = match Token::read(None).map_err(Failure::usage)? {
        Some(token) => token,
        None => Token::random().map_err(Failure::io)?,
    };
    let (workers, threads) = (args.workers.map(usize::from), args.threads.map(usize::from));
    let crew = Crew {
        shape: Shape::new(workers, threads, cores),
        engine: EngineKind::Cpu,
        on_device: Shape::on_device(workers, threads, cores),
        gpu: args.device.gpu.clone(),
        url: String::new(),
        token: Some(token.clone()),
        log: log.log.as_deref().unwrap_or("warn").to_owned(),
        log_format: log.log_format,
        program: None,
    };
    let security = Security {
        token: Some(token.clone()),
        ..Security::default()
    };
    if let Some(list) = &args.job.frames.frames {
        let site = Site {
            listen: (Ipv4Addr::LOCALHOST, 0).into(),
            security,
            crew: Some(crew),
            audit_every: 0,
            keeps_jobs: false,
            open: args.open,
            says_address: false,
        };
        return frames::run(&args.job, list, site);
    }
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    // Before anything shows that it is listening.
    let mut drain = runtime.block_on(async { signals::drain() }).map_err(Failure::io)?;
    let loaded = runtime.block_on(early::load(&args.job, &mut drain))?;
    let engine = loaded.settings.engine;
    let view = args.job.view.over(loaded.defaults.view);
    let output = args.job.image(&loaded)?;
    let left_out = match args.job.quiet {
        true => Vec::new(),
        false => loaded.announce(),
    };
    let mut spec = args.job.spec(loaded)?;
    let (directory, start) = prepare(&args.job, &mut spec, &output, view, false)?;
    runtime.block_on(async {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
            .await
            .map_err(|error| Failure::io(format!("cannot listen on 127.0.0.1: {error}")))?;
        let address = listener.local_addr().map_err(Failure::io)?;
        let farm = Farm::new(spec, Timing::default(), start);
        let crew = crew.at(format!("http://{address}"), engine);
        if !args.job.quiet && log.log_format == LogFormat::Text {
            tell_page(&crew.url, &token);
        }
        let _page = args.open.then(|| open_page(&crew.url, &token));
        let crew = local::run_until_end(crew, &farm);
        let entrance = Entrance {
            security,
            ..Entrance::from(listener)
        };
        let watch = Watch::new(farm, terms(&args.job, &output, view));
        conduct(&args.job, &output, watch, directory, entrance, crew, drain).await
    })?;
    for part in left_out {
        say!("left out: {part}");
    }
    Ok(())
}
