//! `beamfarm live`: a scene to view and edit in the browser while it renders.
//!
//! `bench` holds the scene's text and what follows from it; `view` has workers render it, coarsely while it changes and
//! as `render` does at rest; `page` and `socket` serve browsers.

mod bench;
mod disk;
mod jobs;
mod launch;
mod messages;
mod page;
mod socket;
mod view;

use crate::address;
use crate::failure::Failure;
use crate::loaded::suits_device;
use crate::local::{self, Crew, Shape};
use crate::open_page::{open_page, tell_page, tell_whole_page};
use crate::security::ListenArgs;
use crate::settings::{DeviceArgs, SceneArgs};
use beamfarm_coordinator::security::Security;
use beamfarm_coordinator::{Entrance, server};
use beamfarm_image::job::EngineKind;
use beamfarm_proto::Token;
use beamfarm_worker::cli::{LogArgs, LogFormat, end_with_parent};
use beamfarm_worker::{canary, say, signals};
use bench::Bench;
use clap::Args;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use tokio::net::TcpListener;
use view::LiveView;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm live scene.toml --open                     look at it in the browser, and change it there
  beamfarm live scene.toml --width 960                smaller, and quicker
  beamfarm live scene.toml --engine gpu               on a device with Vulkan
  beamfarm live scene.toml --listen 0.0.0.0:7325 --token-file token
                                                      for browsers and workers on other machines, too
  beamfarm worker --connect http://HOST:7325 --token-file token
                                                      on each of them

While something moves you see sketches, coarse at first. At rest the picture converges, with the bits that
`beamfarm render` gives the saved scene after as many passes. Only \"Save\" changes the scene file, and there only
the values that you changed. What an editor writes into the file is shown at once. SIGINT (Ctrl-C) ends the view.";

#[derive(Args)]
pub struct LiveArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// What renders: cpu, or gpu for a device with Vulkan [default: the scene's, or cpu]
    #[arg(long, value_name = "ENGINE", help_heading = "Device")]
    engine: Option<EngineKind>,

    #[command(flatten)]
    device: DeviceArgs,

    /// Worker processes on this machine; 0: only those of other machines [default: 1]
    #[arg(long, value_name = "W", help_heading = "Device")]
    workers: Option<u16>,

    /// Threads of each worker [default: the number of cores divided by that of workers]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    threads: Option<u16>,

    /// Address or name, and port to listen on [default: a free port of 127.0.0.1]
    ///
    /// Workers and browsers connect to it. By default workers get a token made for this run. The page always has
    /// another token: that of --operator-token-file, or one that is printed with its address.
    #[arg(long, value_name = "ADDR:PORT", value_parser = address::listen, help_heading = "Farm")]
    listen: Option<SocketAddr>,

    #[command(flatten)]
    security: ListenArgs,

    /// Open the page in a browser
    #[arg(long)]
    open: bool,

    /// Print nothing but errors, and where the page is
    #[arg(short, long)]
    quiet: bool,

    /// End when standard input does, for programs that start this one
    #[arg(long, hide = true)]
    with_parent: bool,
}

pub fn main(args: LiveArgs, log: &LogArgs) -> Result<(), Failure> {
    if args.with_parent {
        end_with_parent().map_err(Failure::io)?;
    }
    let address = args.listen.unwrap_or(SocketAddr::from((Ipv4Addr::LOCALHOST, 0)));
    let mut security = args.security.read(address)?;
    if security.token.is_none() && args.listen.is_none() {
        // Other users of this machine can reach the port as well.
        security.token = Some(Token::random().map_err(Failure::io)?);
    }
    let has_own_token = security.operator.is_none();
    let page = match security.operator.take() {
        Some(token) => token,
        None => Token::random().map_err(Failure::io)?,
    };
    if security
        .token
        .as_ref()
        .is_some_and(|token| token.matches(page.reveal().as_bytes()))
    {
        let message = "--operator-token-file: the page of a live view needs another token than its workers";
        return Err(Failure::usage(message));
    }
    // Workers only render the scene and must not change it.
    security.operator = Some(page.clone());
    let bench = Bench::open(&args.scene)?;
    let engine = args
        .engine
        .or(bench.description().defaults.engine.said())
        .unwrap_or_default();
    if engine == EngineKind::Gpu {
        let settings = bench.style(engine).settings;
        suits_device(bench.description(), settings, &[], &args.device.here())?;
    }
    let canary = canary().map_err(Failure::io)?;
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    let door = Door {
        address,
        security,
        page,
        has_own_token,
    };
    let done = runtime.block_on(run(args, log, door, (bench, engine), canary));
    // An abandoned pilot may still be running.
    runtime.shutdown_background();
    done
}

/// The entrance for browsers and workers.
struct Door {
    address: SocketAddr,
    security: Security,
    /// The browsers' token.
    page: Token,
    /// Whether it was generated for this view, so that it must be printed.
    has_own_token: bool,
}

async fn run(
    args: LiveArgs,
    log: &LogArgs,
    door: Door,
    (bench, engine): (Bench, EngineKind),
    canary: [u8; 32],
) -> Result<(), Failure> {
    let Door {
        address,
        security,
        page,
        has_own_token,
    } = door;
    let listener = TcpListener::bind(address)
        .await
        .map_err(|error| Failure::io(format!("cannot listen on {address}: {error}")))?;
    let address = listener.local_addr().map_err(Failure::io)?;
    // Before anything shows that it is listening.
    let drain = signals::drain().map_err(Failure::io)?;
    let view = LiveView::new(args.scene.clone(), bench, engine, canary);
    let url = format!("{}://{}", security.scheme(), reached_here(address));
    match log.log_format {
        _ if has_own_token => tell_whole_page(&url, &page),
        LogFormat::Text => tell_page(&url, &page),
        _ => beamfarm_worker::complain!("page: {url}/"),
    }
    if args.listen.is_some() && !args.quiet {
        say!("listening on {}://{address}", security.scheme());
    }
    let _page = args.open.then(|| open_page(&url, &page)).flatten();
    let crew = crew(&args, log, &security, &url).map(|crew| crew.at(url.clone(), engine));
    let entrance = Entrance {
        security,
        ..Entrance::from(listener)
    };
    let ended = |mut drain: tokio::sync::watch::Receiver<bool>| async move {
        let _ = drain.wait_for(|drain| *drain).await;
    };
    let delivered = {
        let view = view.clone();
        move || view.revisions.delivered()
    };
    let crew = async {
        match crew {
            Some(crew) => local::run(crew, std::future::pending::<()>, delivered).await,
            None => std::future::pending().await,
        }
    };
    let served = server::look(
        entrance,
        page::routes(view.clone()),
        view.revisions.clone(),
        ended(drain),
    );
    let done = tokio::select! {
        () = served => Ok(()),
        broken = crew => Err(Failure::job(broken.err().unwrap_or_default())),
        () = Arc::clone(&view).rest_again_and_again() => Ok(()),
        () = disk::watch(view.clone()) => Ok(()),
    };
    view.jobs.end().await;
    done
}

/// The address by which this machine reaches a listener.
fn reached_here(address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => SocketAddr::from((Ipv4Addr::LOCALHOST, address.port())),
        IpAddr::V6(ip) if ip.is_unspecified() => SocketAddr::from((std::net::Ipv6Addr::LOCALHOST, address.port())),
        _ => address,
    }
}

/// The workers on this machine; `None` if they would have to trust a certificate.
fn crew(args: &LiveArgs, log: &LogArgs, security: &Security, url: &str) -> Option<Crew> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let workers = args.workers.map_or(1, usize::from);
    if security.tls.is_some() && workers > 0 {
        beamfarm_worker::complain!(
            "note: with --tls-cert workers connect from outside: `beamfarm worker --connect {url}`"
        );
        return None;
    }
    let threads = args.threads.map(usize::from);
    (workers > 0).then(|| Crew {
        shape: Shape::new(Some(workers), threads, cores),
        // Set when the engine is known.
        engine: EngineKind::Cpu,
        on_device: Shape::on_device(Some(workers), threads, cores),
        gpu: args.device.gpu.clone(),
        url: url.to_owned(),
        token: security.token.clone(),
        log: log.log.as_deref().unwrap_or("warn").to_owned(),
        log_format: log.log_format,
        program: None,
    })
}
