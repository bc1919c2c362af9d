//! A job from its first pass to its image, rendered by worker processes, so that a crash of one does not take the
//! caller down.

use super::wait::{State, TICK};
use super::{Asked, Failure, Image, Notes};
use crate::conduct::broken_crew;
use crate::loaded::Choosing;
use crate::local::{self, Crew, Shape};
use crate::progress::ErrorEstimate;
use beamfarm_coordinator::security::Security;
use beamfarm_coordinator::{End, Entrance, Farm, Start, Target, Terms, Timing, Watch, server};
use beamfarm_image::exr::{ImageMeta, Maker};
use beamfarm_image::job::{EngineKind, MAX_PASSES, Targeting};
use beamfarm_proto::{Token, VERSION};
use beamfarm_worker::cli::LogFormat;
use std::future::pending;
use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::time::{MissedTickBehavior, interval};

/// When a job ends; by default after the scene's number of passes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Until {
    /// Number of passes.
    pub passes: Option<u64>,
    /// Time limit; the image is made of the passes that are complete by then.
    pub time: Option<Duration>,
    /// The relative standard error at which it ends.
    pub error: Option<f64>,
    /// The percentage of 8 x 8 pixel blocks that must meet `error`, in place of the whole image.
    pub percentile: Option<u32>,
}

/// What renders.
#[derive(Clone, Debug)]
pub struct Hands {
    /// The `beamfarm` executable of this version.
    pub program: PathBuf,
    /// Number of processes.
    pub workers: Option<usize>,
}

/// The result of a job.
pub struct Rendered {
    /// The image of the complete passes; `None` if there are none.
    pub image: Option<Image>,
    /// Messages about the scene.
    pub notes: Notes,
    /// Why the job ended early, if something failed.
    pub failure: Option<Failure>,
}

/// Why the job stopped.
enum Stop {
    Ended(End),
    Time,
    Asked,
    Broken(String),
}

/// Render a scene. `tell` returns `false` to stop with the passes that are complete.
pub fn render(
    asked: &Asked,
    until: Until,
    hands: &Hands,
    tell: &mut dyn FnMut(State) -> bool,
) -> Result<Rendered, Failure> {
    if let Some(error) = until.error.filter(|error| !(*error > 0.0 && *error < 1.0)) {
        let message = format!("error = {error}: expected a share of one, as 0.01");
        return Err(Failure::usage(message));
    }
    let loaded = asked.load(asked.settings()?, Choosing::By(until.time), tell)?;
    let notes = Notes::of(&loaded);
    let (defaults, names) = (loaded.defaults, loaded.description.names());
    let (standard_error, drops_photons) = (loaded.standard_error, defaults.targeting == Targeting::Reject);
    let has_other_end = until.time.is_some() || until.error.is_some();
    let passes = loaded.number_of_passes(until.passes, has_other_end);
    let spec = loaded.into_spec(0, passes);
    let target = until.error.map(|error| Target {
        error,
        percentile: until.percentile,
    });
    let start = Start {
        target,
        ..Start::default()
    };
    let title = asked.scene.path.file_stem().unwrap_or_default();
    let terms = Terms {
        title: title.to_string_lossy().into_owned(),
        time: until.time,
        target: until.error,
        first_pass: 0,
        view: defaults.view,
        drops_photons,
        names: names.clone(),
        empty_depth: defaults.empty_depth,
    };
    // Other users of this machine can reach the port as well.
    let token = Token::random().map_err(Failure::io)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let crew = Crew {
        shape: Shape::new(hands.workers, asked.threads, cores),
        engine: EngineKind::Cpu,
        on_device: Shape::on_device(hands.workers, asked.threads, cores),
        gpu: asked.gpu.clone(),
        url: String::new(),
        token: Some(token.clone()),
        log: "error".into(),
        log_format: LogFormat::Text,
        program: Some(hands.program.clone()),
    };
    let farm = Farm::new(spec, Timing::default(), start);
    let watch = Watch::new(farm.clone(), terms);
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    let stop = runtime.block_on(at_work(&watch, crew, token, until, tell))?;
    let settings = farm.job().settings;
    let image = farm.average().map(|average| Image {
        average,
        meta: ImageMeta {
            scene: farm.job().scene,
            scene_file: None,
            maker: Maker::Passes(settings),
            render_seconds: farm.snapshot().seconds,
            version: VERSION.into(),
            layers: farm.job().layers.clone(),
            standard_error,
            drops_photons,
            names,
            empty_depth: defaults.empty_depth,
        },
        view: defaults.view,
    });
    Ok(Rendered {
        failure: failure(stop, &farm, image.is_some()),
        image,
        notes,
    })
}

/// Serve the farm to its crew until it ends.
async fn at_work(
    watch: &Arc<Watch>,
    crew: Crew,
    token: Token,
    until: Until,
    tell: &mut dyn FnMut(State) -> bool,
) -> Result<Stop, Failure> {
    let farm = watch.farm();
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
    let listener = listener.map_err(|error| Failure::io(format!("cannot listen on 127.0.0.1: {error}")))?;
    let address = listener.local_addr().map_err(Failure::io)?;
    let entrance = Entrance {
        security: Security {
            token: Some(token),
            ..Security::default()
        },
        ..Entrance::from(listener)
    };
    let (close, closed) = oneshot::channel::<()>();
    let closed = async {
        // Resolves with an error, as nothing is ever sent.
        let _ = closed.await;
    };
    let server = tokio::spawn(server::run(entrance, watch.clone(), closed));
    let crew = crew.at(format!("http://{address}"), farm.job().settings.engine);
    let crew = local::run_until_end(crew, farm);
    let stop = {
        let mut broken = std::pin::pin!(broken_crew(crew));
        let mut time = std::pin::pin!(async {
            match until.time {
                Some(time) => tokio::time::sleep(time).await,
                None => pending().await,
            }
        });
        let mut error = ErrorEstimate::default();
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                biased;
                end = farm.ended() => break Stop::Ended(end),
                message = &mut broken => break Stop::Broken(message),
                () = &mut time => break Stop::Time,
                _ = ticks.tick() => {
                    let progress = farm.progress();
                    let state = State::Rendering {
                        passes: progress.prefix,
                        limit: (progress.limit < MAX_PASSES).then_some(progress.limit),
                        fraction: watch.fraction(&progress),
                        remaining: watch.remaining(&progress),
                        error: error.update(watch).await.filter(|error| error.is_finite()),
                    };
                    if !tell(state) {
                        break Stop::Asked;
                    }
                }
            }
        }
    };
    farm.stop();
    drop(close);
    let _ = server.await;
    Ok(stop)
}

fn failure(stop: Stop, farm: &Farm, has_image: bool) -> Option<Failure> {
    let divergent = farm.progress().divergent;
    match stop {
        Stop::Ended(End::Failed(failed)) => Some(Failure::job(format!(
            "pass {} failed {} times: {}",
            failed.pass_index, failed.attempts, failed.message
        ))),
        // A system that is out of memory kills processes with this signal and reports it nowhere else.
        Stop::Broken(message) if message.contains("killed by signal 9") => Some(Failure::memory(format!(
            "{message}: the system ends processes so when there is no memory left"
        ))),
        Stop::Broken(message) => Some(Failure::job(message)),
        _ if divergent > 0 => Some(Failure::job(format!(
            "{divergent} blocks were delivered twice with different pixels: this machine miscalculates, and the image is \
             not to be trusted"
        ))),
        Stop::Time if !has_image => Some(Failure::nothing("the time was over before the first pass was complete")),
        _ => None,
    }
}
