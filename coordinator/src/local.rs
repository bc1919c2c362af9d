//! Worker processes on this machine.

use beamfarm_coordinator::Farm;
use beamfarm_image::job::EngineKind;
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

/// Worker deaths in a row, with no pass delivered in between, after which further workers would die as well.
const DEATHS_IN_A_ROW: u32 = 5;
/// Pause before a dead worker is replaced, multiplied by the deaths in a row.
const PAUSE: Duration = Duration::from_millis(100);
/// Up to this many cores there is one worker, which renders one pass per core at a time. All its threads work on all of
/// these passes: they share the prepared scene, and none waits while any pass has work. With more cores there are
/// several workers, as each delivers blocks one after another. To be revised after measurements on large machines.
const CORES_OF_ONE: usize = 4;
/// Threads per worker beyond that; fewer if the number of cores is not divisible.
const THREADS_PER_WORKER: usize = 4;

/// The number of workers and the size of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Number of processes.
    pub workers: usize,
    /// Threads per process.
    pub threads: usize,
    /// Passes that each renders at a time.
    pub at_once: usize,
}

impl Shape {
    /// The requested shape, completed so that workers times threads is the number of cores.
    pub fn new(workers: Option<usize>, threads: Option<usize>, cores: usize) -> Self {
        let of_one_pass = |workers, threads| Self {
            workers,
            threads,
            at_once: 1,
        };
        match (workers, threads) {
            (Some(workers), Some(threads)) => of_one_pass(workers, threads),
            (Some(workers), None) => of_one_pass(workers, (cores / workers).max(1)),
            (None, Some(threads)) => of_one_pass((cores / threads).max(1), threads),
            (None, None) if cores <= CORES_OF_ONE => Self {
                workers: 1,
                threads: cores,
                at_once: cores,
            },
            (None, None) => {
                let divides = |threads: &usize| cores.is_multiple_of(*threads);
                let threads = (1..=THREADS_PER_WORKER).rev().find(divides).unwrap_or(1);
                of_one_pass(cores / threads, threads)
            }
        }
    }

    /// The shape for a device, which all share: one worker with all cores for the scene. It keeps two passes under way,
    /// so that the device has work while a picture is transferred.
    pub fn on_device(workers: Option<usize>, threads: Option<usize>, cores: usize) -> Self {
        let workers = workers.unwrap_or(1);
        let threads = threads.unwrap_or((cores / workers).max(1));
        Self {
            workers,
            threads,
            at_once: threads.min(2),
        }
    }

    /// Passes rendered at a time.
    pub fn passes_at_once(self) -> usize {
        self.workers * self.at_once
    }
}

/// How to start workers.
#[derive(Clone, Debug)]
pub struct Crew {
    pub shape: Shape,
    /// Their engine.
    pub engine: EngineKind,
    /// Their shape for the engine gpu.
    pub on_device: Shape,
    /// Device for the engine gpu: its number or part of its name.
    pub gpu: Option<String>,
    /// The coordinator's URL and credentials.
    pub url: String,
    pub token: Option<Token>,
    /// Log filter of the workers.
    pub log: String,
    /// Log format of the workers.
    pub log_format: LogFormat,
    /// The executable with the subcommand `worker`; `None`: this program.
    pub program: Option<PathBuf>,
}

impl Crew {
    /// The engines that workers offer: only what the job needs. Without a named device the best one is used.
    fn offers(&self) -> Vec<String> {
        let gpu = match self.engine {
            EngineKind::Cpu => Vec::new(),
            EngineKind::Gpu => vec![format!("--gpu={}", self.gpu.as_deref().unwrap_or_default())],
        };
        [format!("--engine={}", self.engine)].into_iter().chain(gpu).collect()
    }

    /// The crew for a job with this engine at this address.
    pub fn at(self, url: String, engine: EngineKind) -> Self {
        let shape = match engine {
            EngineKind::Cpu => self.shape,
            EngineKind::Gpu => self.on_device,
        };
        Self {
            shape,
            engine,
            url,
            ..self
        }
    }
}

/// Runs [`run`] for one farm.
pub fn run_until_end(crew: Crew, farm: &Arc<Farm>) -> impl Future<Output = Result<(), String>> + use<> {
    let (of_end, of_passes) = (farm.clone(), farm.clone());
    let ended = move || {
        let farm = of_end.clone();
        async move { drop(farm.ended().await) }
    };
    run(crew, ended, move || of_passes.progress().passes)
}

/// Keep the crew running, replacing workers that die, until `ended` resolves. The error is that workers keep dying.
/// `delivered`: the passes delivered so far. Dropping the future kills the workers.
pub async fn run<E>(
    crew: Crew,
    ended: impl Fn() -> E + Clone + Send + 'static,
    delivered: impl Fn() -> u64 + Clone + Send + 'static,
) -> Result<(), String>
where
    E: Future<Output = ()> + Send + 'static,
{
    let program = match &crew.program {
        Some(program) => program.clone(),
        None => std::env::current_exe().map_err(|error| error.to_string())?,
    };
    let deaths = Arc::new(Deaths::default());
    let mut places = JoinSet::new();
    for place in 0..crew.shape.workers {
        let (ended, delivered) = (ended.clone(), delivered.clone());
        let keep = keep(place, crew.clone(), program.clone(), ended, delivered, deaths.clone());
        places.spawn(keep.in_current_span());
    }
    while let Some(place) = places.join_next().await {
        place.map_err(|error| error.to_string())??;
    }
    Ok(())
}

/// Counts deaths since a pass was last delivered.
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
            crew.shape.threads
        );
        // Kept open as the worker's life line: see `--with-parent`.
        let _life_line = child.stdin.take();
        let status = tokio::select! {
            // First: at the end of a job both are ready, and the worker was not lost.
            biased;
            () = ended() => {
                let _ = child.wait().await;
                return Ok(());
            }
            status = child.wait() => status.map_err(|error| error.to_string())?,
        };
        // A worker may hear of the end before this task wakes up, so check again.
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

/// Environment variables for remote coordinators, removed for local workers.
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
        // Only this user can read a process's environment.
        Some(token) => command.env(TOKEN_VARIABLE, token.reveal()),
        None => command.env_remove(TOKEN_VARIABLE),
    };
    command
        .args(["worker", "--connect", &crew.url])
        .args(["--threads", &crew.shape.threads.to_string()])
        .args(["--at-once", &crew.shape.at_once.to_string()])
        .args(["--name", &name(place)])
        .args(crew.offers())
        // The scene is already on this machine.
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
            let shape = Shape::new(None, None, cores);
            assert_eq!(shape.workers * shape.threads, cores);
            assert!(shape.threads <= THREADS_PER_WORKER && shape.passes_at_once() <= cores);
        }
        let split = |workers, threads, cores| {
            let shape = Shape::new(workers, threads, cores);
            (shape.workers, shape.threads, shape.at_once)
        };
        assert_eq!(split(None, None, 1), (1, 1, 1));
        assert_eq!(split(None, None, 2), (1, 2, 2));
        assert_eq!(split(None, None, 4), (1, 4, 4));
        assert_eq!(split(None, None, 64), (16, 4, 1));
        assert_eq!(split(None, None, 6), (2, 3, 1));
        assert_eq!(split(Some(2), None, 8), (2, 4, 1));
        assert_eq!(split(None, Some(3), 8), (2, 3, 1));
        assert_eq!(split(Some(9), None, 8), (9, 1, 1));
        assert_eq!(split(None, Some(9), 8), (1, 9, 1));
        let split = |workers, threads, cores| {
            let shape = Shape::on_device(workers, threads, cores);
            (shape.workers, shape.threads, shape.at_once)
        };
        assert_eq!(split(None, None, 2), (1, 2, 2));
        assert_eq!(split(None, None, 64), (1, 64, 2));
        assert_eq!(split(Some(2), None, 8), (2, 4, 2));
        assert_eq!(split(None, Some(3), 8), (1, 3, 2));
        assert_eq!(split(Some(9), None, 8), (9, 1, 1));
    }

    #[test]
    fn a_delivered_pass_forgives_deaths() {
        let deaths = Deaths::default();
        assert_eq!(deaths.count(0), 1);
        assert_eq!(deaths.count(0), 2);
        assert_eq!(deaths.count(1), 1);
        assert_eq!(deaths.count(1), 2);
    }

    /// The job ends and its worker exits before the task that waits for the end wakes up.
    #[cfg(unix)]
    #[tokio::test]
    async fn a_worker_that_heard_of_the_end_first_was_not_lost() {
        let crew = Crew {
            shape: Shape::new(Some(1), Some(1), 1),
            engine: EngineKind::Cpu,
            on_device: Shape::on_device(None, None, 1),
            gpu: None,
            url: "http://127.0.0.1:1".into(),
            token: None,
            log: "warn".into(),
            log_format: LogFormat::Text,
            program: None,
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
