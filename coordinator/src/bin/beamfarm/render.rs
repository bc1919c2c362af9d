//! `beamfarm render`: a farm of processes on this machine.

use crate::conduct::conduct;
use crate::directory::prepare;
use crate::failure::Failure;
use crate::job::JobArgs;
use crate::local::{self, Crew};
use beamfarm_coordinator::security::{ENTER, Security};
use beamfarm_coordinator::{Entrance, Farm, Timing};
use beamfarm_proto::Token;
use beamfarm_worker::cli::{LogArgs, LogFormat};
use beamfarm_worker::{complain, say};
use clap::Args;
use std::io::{IsTerminal, Write};
use std::net::Ipv4Addr;
use tokio::net::TcpListener;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm render scene.toml                        all cores, the scene's own number of passes
  beamfarm render scene.toml --time 60s             as many passes as a minute allows
  beamfarm render scene.toml --passes 1000 -o a.exr
  beamfarm render scene.toml --workers 1 --threads 8
  beamfarm render scene.xml -D spp=256              a scene of Mitsuba 3, with a value for its $spp

SIGINT (Ctrl-C) writes the passes that are complete; another one after a second kills.";

#[derive(Args)]
pub struct RenderArgs {
    #[command(flatten)]
    job: JobArgs,

    /// Worker processes [default: one per core up to four cores, above that one per four]
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u16).range(1..))]
    workers: Option<u16>,

    /// Threads of each worker [default: so that workers times threads is the number of cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,

    /// Open the page that shows the job in a browser
    #[arg(long)]
    open: bool,
}

/// Open the page. Its link holds the token, and what programs are started with is for all to see: the browser gets a
/// file that leads there, and that nobody else can read. It is removed with the value.
fn open_page(crew: &Crew) -> Option<tempfile::NamedTempFile> {
    let Crew { url, token, .. } = crew;
    let make = || {
        let mut file = tempfile::Builder::new()
            .prefix("beamfarm-")
            .suffix(".html")
            .tempfile()?;
        let link = format!("{url}{ENTER}#{}", token.reveal());
        writeln!(
            file,
            "<!doctype html><meta http-equiv=\"refresh\" content=\"0; url={link}\"><a href=\"{link}\">The job</a>"
        )?;
        open::that_detached(file.path())?;
        Ok::<_, std::io::Error>(file)
    };
    match make() {
        Ok(file) => Some(file),
        Err(error) => {
            complain!("warning: no browser can be opened: {error}");
            None
        }
    }
}

/// Say where the job can be watched: to people with what opens it, but not where it would stay in a file.
fn tell_page(crew: &Crew) {
    let Crew { url, token, .. } = crew;
    match std::io::stderr().is_terminal() {
        true => complain!("page: {url}{ENTER}#{}", token.reveal()),
        false => complain!("page: {url}/"),
    }
}

pub fn main(args: RenderArgs, log: &LogArgs) -> Result<(), Failure> {
    let loaded = args.job.settings.load()?;
    let exposure = args.job.exposure(&loaded)?;
    let output = args.job.image(&loaded)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (workers, threads) = local::split(args.workers.map(usize::from), args.threads.map(usize::from), cores);
    let left_out = match args.job.quiet {
        true => Vec::new(),
        false => loaded.announce(),
    };
    let mut spec = args.job.spec(loaded)?;
    // Other users of this machine reach the port as well.
    let token = match Token::read(None).map_err(Failure::usage)? {
        Some(token) => token,
        None => Token::random().map_err(Failure::io)?,
    };
    let (directory, start) = prepare(&args.job, &mut spec, &output, exposure, false)?;
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    runtime.block_on(async {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
            .await
            .map_err(|error| Failure::io(format!("cannot listen on 127.0.0.1: {error}")))?;
        let address = listener.local_addr().map_err(Failure::io)?;
        let farm = Farm::new(spec, Timing::default(), start);
        let crew = Crew {
            workers,
            threads,
            url: format!("http://{address}"),
            token: token.clone(),
            log: log.log.as_deref().unwrap_or("warn").to_owned(),
            log_format: log.log_format,
        };
        if !args.job.quiet && log.log_format == LogFormat::Text {
            tell_page(&crew);
        }
        let _page = args.open.then(|| open_page(&crew));
        let crew = local::run(crew, farm.clone());
        let entrance = Entrance {
            security: Security {
                token: Some(token),
                ..Security::default()
            },
            ..Entrance::from(listener)
        };
        conduct(&args.job, &output, exposure, farm, directory, entrance, crew).await
    })?;
    for part in left_out {
        say!("left out: {part}");
    }
    Ok(())
}
