//! The command line of a worker, shared by `beamfarm worker` and `beamfarm-worker`.

use crate::complain;
use crate::config::Config;
use crate::engine::{self, EngineError};
use crate::error::WorkerError;
use crate::offer::Offered;
use crate::run::run;
use crate::security::SecurityArgs;
use crate::session::Summary;
use crate::{cache, exit, identity, signals};
use beamfarm_image::job::EngineKind;
use beamfarm_proto::{PROTOCOL, VERSION};
use clap::{Args, ValueEnum};
use futures_util::future::join_all;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::LazyLock;
use std::time::Duration;
use tokio::sync::watch;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::{self, MakeWriter};
use tracing_subscriber::prelude::*;

/// Options of a worker.
#[derive(Args, Clone, Debug)]
pub struct WorkerArgs {
    /// Coordinator to work for: http://HOST:PORT or https://HOST:PORT
    #[arg(long, value_name = "URL", env = "BEAMFARM_CONNECT", help_heading = "Farm")]
    pub connect: String,

    /// Who to be, and whom to believe.
    #[command(flatten)]
    pub security: SecurityArgs,

    /// Rendering threads [default: one per core]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    pub threads: Option<u16>,

    /// Engines to offer: cpu, gpu or both [default: cpu, and gpu where a card passes its test]
    ///
    /// Jobs of other engines are left to other workers. A card passes if it computes the same bits as processors do.
    #[arg(long, value_name = "ENGINE", value_delimiter = ',', help_heading = "Device")]
    pub engine: Vec<EngineKind>,

    /// Device for jobs of the engine gpu, by number or part of its name, or `all` [default: the best card]
    ///
    /// `beamfarm devices` lists them. With `all` it is every card. Each of several devices is a worker of its own. A
    /// driver in software is only used if it is named.
    #[arg(long, value_name = "N|NAME", value_delimiter = ',', help_heading = "Device")]
    pub gpu: Vec<String>,

    /// Blocks of passes rendered at the same time, by all threads together
    #[arg(long, hide = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub at_once: Option<u16>,

    /// Name of this worker in the coordinator's log [default: the machine's]
    #[arg(long, help_heading = "Farm")]
    pub name: Option<String>,

    /// Folder that keeps scene files between jobs
    ///
    /// It may be deleted at any time. [default: beamfarm in $XDG_CACHE_HOME or ~/.cache]
    #[arg(long, value_name = "DIR", env = "BEAMFARM_CACHE", help_heading = "Farm")]
    pub cache: Option<PathBuf>,

    /// Folder with the secret that identifies this worker
    ///
    /// It is made at the first start, so that what others do in the worker's name is not held against it. Use one
    /// folder for each name, and keep it to this machine's user. [default: beamfarm in $XDG_STATE_HOME or
    /// ~/.local/state]
    #[arg(long, value_name = "DIR", env = "BEAMFARM_STATE", help_heading = "Farm")]
    pub state: Option<PathBuf>,

    /// Keep scene files in memory only
    ///
    /// This overrides --cache and BEAMFARM_CACHE.
    #[arg(long, help_heading = "Farm")]
    pub no_cache: bool,

    /// How long to try to reach the coordinator: 90s, 10m, 2h
    ///
    /// This holds at the start and whenever the coordinator is lost.
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = humantime::parse_duration)]
    #[arg(help_heading = "Farm")]
    pub patience: Duration,

    /// How long to go on with passes at hand after SIGINT or SIGTERM
    ///
    /// What cannot be done in that time is given back at once, for others to render.
    #[arg(long, value_name = "TIME", default_value = "20s", value_parser = humantime::parse_duration)]
    #[arg(help_heading = "Farm")]
    pub grace: Duration,

    /// Exit with 75 instead of 0 after SIGTERM or SIGINT
    ///
    /// For schedulers that restart whatever failed elsewhere.
    #[arg(long, help_heading = "Farm")]
    pub preemptible: bool,

    /// End when standard input does, and leave Ctrl-C to the parent process
    #[arg(long, hide = true)]
    pub with_parent: bool,
}

/// The option for logs.
#[derive(Args, Clone, Debug)]
pub struct LogArgs {
    /// What to log on standard error: error, warn, info, debug, or a filter
    ///
    /// A filter names parts of the program, as in beamfarm_coordinator=debug.
    #[arg(long, value_name = "FILTER", env = "RUST_LOG", global = true)]
    pub log: Option<String>,

    /// Form of the log
    #[arg(long, value_enum, value_name = "FORM", default_value_t, global = true)]
    pub log_format: LogFormat,
}

/// Form of the log.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogFormat {
    /// Lines for people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

impl LogFormat {
    /// The value of the option.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Json => "json",
        }
    }
}

impl LogArgs {
    /// Starts logging. An invalid filter is a usage error.
    pub fn init<W>(&self, default: &str, writer: W) -> Result<(), String>
    where
        W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
    {
        let filter = self.log.as_deref().unwrap_or(default);
        // A bare level applies to this program, not to the libraries below it.
        let filter = match filter.parse::<LevelFilter>() {
            Ok(level) => format!("warn,beamfarm={level}"),
            Err(_) => filter.to_owned(),
        };
        let filter: Targets = filter.parse().map_err(|error| format!("--log: {error}"))?;
        // If the log cannot be written, a complaint about it cannot be either.
        let log = fmt::layer().log_internal_errors(false).with_writer(writer);
        let log = match self.log_format {
            LogFormat::Text => log
                .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
                .with_target(false)
                .boxed(),
            // A span's fields are next to the event's, so that queries need no path to them.
            LogFormat::Json => log
                .json()
                .flatten_event(true)
                .with_current_span(true)
                .with_span_list(false)
                .boxed(),
        };
        tracing_subscriber::registry().with(log.with_filter(filter)).init();
        Ok(())
    }
}

/// The commit that the program was built from, with a `+` if its sources had been changed.
pub const COMMIT: &str = env!("BEAMFARM_COMMIT");

/// The version, the build's commit and features, and what must match for two programs to work on one job.
pub fn long_version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let [cpu, gpu] = [EngineKind::Cpu, EngineKind::Gpu].map(EngineKind::identity);
        let (engines, features, built) = match cfg!(feature = "gpu") {
            true => ("cpu, gpu", "gpu", ""),
            false => ("cpu", "none", ", not in this build"),
        };
        format!(
            "{VERSION}\ncommit: {COMMIT}\nengines: {engines}\nfeatures: {features}\n\
             bits of passes: {cpu}; {gpu}{built}\nprotocol: {PROTOCOL}"
        )
    });
    &TEXT
}

/// Runs a worker to its end.
pub fn main(args: WorkerArgs) -> ExitCode {
    // The runtime's one thread only waits; rendering has its own.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build();
    let result = match runtime {
        Ok(runtime) => {
            let result = runtime.block_on(work(args));
            // A pass that nobody wants any more may still be rendering.
            runtime.shutdown_background();
            result
        }
        Err(error) => Err(WorkerError::Internal(error.to_string())),
    };
    let code = match result {
        Ok((summary, stopped)) => {
            tracing::info!("done after {} passes", summary.passes);
            match stopped {
                true => exit::PREEMPTED,
                false => exit::DONE,
            }
        }
        Err(error) => {
            complain!("error: {error}");
            match error {
                WorkerError::Address { .. } | WorkerError::Security(_) | WorkerError::Scene(_) => exit::USAGE,
                WorkerError::Unreachable { .. } => exit::UNREACHABLE,
                WorkerError::Usage(_) => exit::USAGE,
                WorkerError::Refused(_) => exit::REFUSED,
                WorkerError::Engine(error) => match error {
                    EngineError::NotBuilt | EngineError::NoDevice(_) => exit::REFUSED,
                    EngineError::Scene(_) => exit::USAGE,
                    EngineError::Broke(_) => exit::IO,
                },
                WorkerError::Internal(_) | WorkerError::Stuck(_) => exit::IO,
            }
        }
    };
    ExitCode::from(code)
}

/// The summary, and whether a signal ended the work such that a scheduler should start it again.
async fn work(args: WorkerArgs) -> Result<(Summary, bool), WorkerError> {
    let internal = |error: std::io::Error| WorkerError::Internal(error.to_string());
    let drain = if args.with_parent {
        signals::ignore_interrupt().map_err(internal)?;
        end_with_parent().map_err(internal)?;
        watch::channel(false).1
    } else {
        signals::drain().map_err(internal)?
    };
    let asked = (args.engine.clone(), args.gpu.clone());
    let offers = tokio::task::spawn_blocking(move || offers(&asked.0, &asked.1)).await;
    let offers = offers.unwrap_or_else(|error| Err(WorkerError::Internal(error.to_string())))?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let url = match args.connect.contains("://") {
        true => args.connect,
        false => format!("http://{}", args.connect),
    };
    let config = Config {
        url,
        credentials: args.security.read().map_err(WorkerError::Security)?,
        threads: args.threads.map_or(cores, usize::from),
        at_once: args.at_once.map(usize::from),
        name: args.name.unwrap_or_else(machine_name),
        state: match args.with_parent {
            // It lives no longer than the parent's job.
            true => None,
            false => args.state.or_else(identity::default_folder),
        },
        cache: match args.no_cache {
            true => None,
            false => Some(args.cache.unwrap_or_else(cache::default_folder)),
        },
        patience: args.patience,
        grace: args.grace,
    };
    let summary = run_all(config, offers, &drain).await?;
    let stopped = args.preemptible && *drain.borrow();
    Ok((summary, stopped))
}

/// The offers of this process's workers, and the device that tells them apart, if there are several. One of them has
/// the processors.
fn offers(engines: &[EngineKind], gpus: &[String]) -> Result<Vec<(Offered, String)>, WorkerError> {
    let without = !engines.is_empty() && !engines.contains(&EngineKind::Gpu);
    if without && !gpus.is_empty() {
        return Err(WorkerError::Usage("--gpu: --engine has no gpu".into()));
    }
    let cards = match gpus {
        [all] if all == "all" => engine::cards()?.iter().map(usize::to_string).collect(),
        gpus => gpus.to_vec(),
    };
    if let Some(twice) = cards.iter().enumerate().find(|(i, card)| cards[..*i].contains(card)) {
        return Err(WorkerError::Usage(format!("--gpu {}: it is there twice", twice.1)));
    }
    let (first, others) = match cards.split_first() {
        None => return Ok(vec![(Offered::look(engines, None)?, String::new())]),
        Some((first, others)) => (Offered::look(engines, Some(first))?, others),
    };
    let mut all = vec![(first, cards[0].clone())];
    for card in others {
        all.push((Offered::device(card)?, card.clone()));
    }
    Ok(all)
}

/// Runs a worker for each offer. Several workers fail only if all of them do: one may do what another cannot.
async fn run_all(
    config: Config,
    offers: Vec<(Offered, String)>,
    drain: &watch::Receiver<bool>,
) -> Result<Summary, WorkerError> {
    let several = offers.len();
    let one = |(i, (offered, card)): (usize, (Offered, String))| {
        let mut config = config.clone();
        if several > 1 {
            config.name = format!("{} gpu {card}", config.name);
        }
        if i > 0 {
            // Workers without processors only add up pictures.
            config.threads = (config.threads / several).max(1);
        }
        async move {
            let name = config.name.clone();
            let ended = run(config, offered, drain.clone()).await;
            if let Err(error) = &ended
                && several > 1
            {
                tracing::warn!(name, "{name:?} has ended: {error}");
            }
            ended
        }
    };
    let mut summary = Summary::default();
    let mut failed = None;
    let mut has_done = false;
    for ended in join_all(offers.into_iter().enumerate().map(one)).await {
        match ended {
            Ok(done) => {
                summary.passes += done.passes;
                has_done = true;
            }
            Err(error) => failed = failed.or(Some(error)),
        }
    }
    match failed.filter(|_| !has_done) {
        Some(error) => Err(error),
        None => Ok(summary),
    }
}

/// Ends this process when its parent ends. The parent holds the other end of standard input, which closes when it dies,
/// however that happens.
pub fn end_with_parent() -> std::io::Result<()> {
    let wait = || {
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        std::process::exit(exit::DONE.into());
    };
    std::thread::Builder::new().name("parent".into()).spawn(wait)?;
    Ok(())
}

fn machine_name() -> String {
    let files = ["/proc/sys/kernel/hostname", "/etc/hostname"];
    let read = files.iter().find_map(|file| std::fs::read_to_string(file).ok());
    let name = read.or_else(|| std::env::var("HOSTNAME").ok());
    let name = name.or_else(|| std::env::var("COMPUTERNAME").ok());
    name.map_or_else(|| "unnamed".into(), |name| name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_says_what_it_was_built_from() {
        let text = long_version();
        let (first, rest) = text.split_once('\n').unwrap();
        assert_eq!(first, VERSION);
        for line in [
            "commit: ",
            "engines: cpu",
            "features: ",
            "bits of passes: cpu ",
            "protocol: ",
        ] {
            assert!(rest.lines().any(|one| one.starts_with(line)), "{text}");
        }
    }

    #[test]
    fn devices_are_for_those_that_offer_them_and_each_once() {
        let offers = |engines: &[EngineKind], gpus: &[&str]| {
            let gpus: Vec<String> = gpus.iter().map(|gpu| (*gpu).to_owned()).collect();
            offers(engines, &gpus)
        };
        let said = |engines: &[EngineKind], gpus: &[&str]| offers(engines, gpus).unwrap_err().to_string();
        assert_eq!(said(&[EngineKind::Cpu], &["0"]), "--gpu: --engine has no gpu");
        assert_eq!(said(&[], &["7", "8", "7"]), "--gpu 7: it is there twice");
        let missing = offers(&[EngineKind::Gpu], &["nobody's"]).unwrap_err();
        assert!(matches!(missing, WorkerError::Engine(_)), "{missing}");
        let alone = offers(&[EngineKind::Cpu], &[]).unwrap();
        assert_eq!((alone.len(), &*alone[0].1), (1, ""));
    }
}
