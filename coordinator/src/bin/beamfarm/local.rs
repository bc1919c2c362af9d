//! Worker processes on this machine.

use beamfarm_proto::{TOKEN_VARIABLE, Token};
use beamfarm_worker::cli::LogFormat;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;
use tokio::process::{Child, Command};
use tokio::task::JoinSet;
use tokio::time::sleep;
use tracing::{Instrument, info, warn};

/// So many workers in a row may die with no pass delivered in between. More means that the next one would die as well.
const DEATHS_IN_A_ROW: u32 = 5;
/// Pause before a dead worker is replaced, times the deaths in a row.
const PAUSE: Duration = Duration::from_millis(100);
/// Above this many cores workers have several threads: each process holds the scene and a pass's photon beams, and a
/// worker's threads share them. On a few cores processes of one thread waste no time in waiting for each other. To be
/// revised when measured on large machines.
const SINGLE_THREADED_CORES: usize = 4;
/// Threads of a worker above that; fewer when the cores cannot be divided by it.
const THREADS_PER_WORKER: usize = 4;

/// Workers, and threads of each: what was asked for, filled up so that their product is the number of cores.
pub fn split(workers: Option<usize>, threads: Option<usize>, cores: usize) -> (usize, usize) {
    match (workers, threads) {
        (Some(workers), Some(threads)) => (workers, threads),
        (Some(workers), None) => (workers, (cores / workers).max(1)),
        (None, Some(threads)) => ((cores / threads).max(1), threads),
        (None, None) if cores <= SINGLE_THREADED_CORES => (cores, 1),
        (None, None) => {
            let divides = |threads: &usize| cores.is_multiple_of(*threads);
            let threads = (1..=THREADS_PER_WORKER).rev().find(divides).unwrap_or(1);
            (cores / threads, threads)
        }
    }
}

/// How to start workers.
#[derive(Clone, Debug)]
pub struct Crew {
    pub workers: usize,
    pub threads: usize,
    /// The coordinator's address, and what opens it.
    pub url: String,
    pub token: Option<Token>,
    /// Filter of the workers' logs.
    pub log: String,
    /// Form of the workers' logs.
    pub log_format: LogFormat,
}

/// Keep the crew at work, replacing those that die, until what it works for has `ended` or workers keep dying; that is
/// the error. `delivered`: how much they have delivered so far. Dropping the future kills the workers.
pub async fn run<E>(
    crew: Crew,
    ended: impl Fn() -> E + Clone + Send + 'static,
    delivered: impl Fn() -> u64 + Clone + Send + 'static,
) -> Result<(), String>
where
    E: Future<Output = ()> + Send + 'static,
{
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let deaths = Arc::new(Deaths::default());
    let mut places = JoinSet::new();
    for place in 0..crew.workers {
        let (ended, delivered) = (ended.clone(), delivered.clone());
        let keep = keep(place, crew.clone(), program.clone(), ended, delivered, deaths.clone());
        places.spawn(keep.in_current_span());
    }
    while let Some(place) = places.join_next().await {
        place.map_err(|error| error.to_string())??;
    }
    Ok(())
}

/// Deaths since a pass was last delivered.
#[derive(Default)]
struct Deaths {
    in_a_row: AtomicU32,
    passes: AtomicU64,
}

impl Deaths {
    fn count(&self, passes: u64) -> u32 {
        if self.passes.swap(passes, Ordering::Relaxed) != passes {
            self.in_a_row.store(0, Ordering::Relaxed);
        }
        self.in_a_row.fetch_add(1, Ordering::Relaxed) + 1
    }
}

async fn keep<E: Future<Output = ()>>(
    place: usize,
    crew: Crew,
    program: PathBuf,
    ended: impl Fn() -> E,
    delivered: impl Fn() -> u64,
    deaths: Arc<Deaths>,
) -> Result<(), String> {
    loop {
        let mut child =
            start(place, &crew, &program).map_err(|error| format!("cannot start {}: {error}", program.display()))?;
        let name = name(place);
        info!(
            name,
            "started worker process {} with {} threads",
            child.id().unwrap_or_default(),
            crew.threads
        );
        // The other end of its life line: see `--with-parent`.
        let _life_line = child.stdin.take();
        let status = tokio::select! {
            // First: at the end of a job both are true, and the worker was not lost.
            biased;
            () = ended() => {
                let _ = child.wait().await;
                return Ok(());
            }
            status = child.wait() => status.map_err(|error| error.to_string())?,
        };
        // Workers may be told of the end before those who wait for it wake up: who asks anew is told as well.
        tokio::select! {
            biased;
            () = ended() => return Ok(()),
            () = std::future::ready(()) => {}
        }
        let in_a_row = deaths.count(delivered());
        let how = describe(status);
        if in_a_row >= DEATHS_IN_A_ROW {
            return Err(format!(
                "{in_a_row} workers died in a row without delivering anything; the last one {how}"
            ));
        }
        warn!(name, "a worker {how}; starting another one");
        sleep(PAUSE * in_a_row).await;
    }
}

/// What may be set for coordinators elsewhere.
const ELSEWHERE: [&str; 4] = [
    "BEAMFARM_TLS_CA",
    "BEAMFARM_TLS_CERT",
    "BEAMFARM_TLS_KEY",
    "BEAMFARM_TOKEN_FILE",
];

fn name(place: usize) -> String {
    format!("local {place}")
}

fn start(place: usize, crew: &Crew, program: &PathBuf) -> std::io::Result<Child> {
    let mut command = Command::new(program);
    for variable in ELSEWHERE {
        command.env_remove(variable);
    }
    match &crew.token {
        // Only this user can read the environment of a process.
        Some(token) => command.env(TOKEN_VARIABLE, token.reveal()),
        None => command.env_remove(TOKEN_VARIABLE),
    };
    command
        .args(["worker", "--connect", &crew.url])
        .args(["--threads", &crew.threads.to_string()])
        .args(["--name", &name(place)])
        // The scene is on this machine already.
        .args(["--no-cache", "--with-parent", "--log", &crew.log])
        .args(["--log-format", crew.log_format.as_str()])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .kill_on_drop(true)
        .spawn()
}

fn describe(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!("was killed by signal {signal}");
    }
    match status.code() {
        Some(code) => format!("ended with exit code {code}"),
        None => "ended".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_cores_are_used() {
        for cores in 1..=256 {
            let (workers, threads) = split(None, None, cores);
            assert_eq!(workers * threads, cores);
            assert!(threads <= THREADS_PER_WORKER);
        }
        assert_eq!(split(None, None, 4), (4, 1));
        assert_eq!(split(None, None, 64), (16, 4));
        assert_eq!(split(None, None, 6), (2, 3));
        assert_eq!(split(Some(2), None, 8), (2, 4));
        assert_eq!(split(None, Some(3), 8), (2, 3));
        assert_eq!(split(Some(9), None, 8), (9, 1));
        assert_eq!(split(None, Some(9), 8), (1, 9));
    }

    #[test]
    fn a_delivered_pass_forgives_deaths() {
        let deaths = Deaths::default();
        assert_eq!(deaths.count(0), 1);
        assert_eq!(deaths.count(0), 2);
        assert_eq!(deaths.count(1), 1);
        assert_eq!(deaths.count(1), 2);
    }

    /// The job ends, its worker hears of it and exits, and who waits for the end wakes up too late.
    #[cfg(unix)]
    #[tokio::test]
    async fn a_worker_that_heard_of_the_end_first_was_not_lost() {
        let crew = Crew {
            workers: 1,
            threads: 1,
            url: "http://127.0.0.1:1".into(),
            token: None,
            log: "warn".into(),
            log_format: LogFormat::Text,
        };
        let asked = Arc::new(AtomicU32::new(0));
        let ended = {
            let asked = asked.clone();
            move || {
                let late = asked.fetch_add(1, Ordering::Relaxed) == 0;
                async move {
                    if late {
                        std::future::pending::<()>().await;
                    }
                }
            }
        };
        let deaths = Arc::new(Deaths::default());
        let kept = keep(0, crew, "true".into(), ended, || 0, deaths.clone()).await;
        assert_eq!(kept, Ok(()));
        assert_eq!(asked.load(Ordering::Relaxed), 2);
        assert_eq!(deaths.in_a_row.load(Ordering::Relaxed), 0);
    }
}
