//! The life of a worker: register, load the scene, then lease, render and upload until the job is over.

use crate::cache::Cache;
use crate::client::{CallError, Client, Delivery, Registration};
use crate::render::{Prepared, Renderer};
use crate::security::Credentials;
use beamfarm_proto::{Grant, Job, LeaseId, VERSION, wire};
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::error::SceneError;
use beamfarm_shared::exr::{BlockMeta, encode_block};
use beamfarm_shared::job::Block;
use beamfarm_shared::merge::Node;
use beamfarm_shared::pass::PassImage;
use beamfarm_shared::radius::Schedule;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::{interval, sleep};
use tracing::{debug, info, warn};

/// The next pass is leased when the current one has taken this fraction of the time of the one before. Early enough that
/// rendering need not wait for it; late enough that a worker does not sit on a pass that another one, with nothing to do,
/// could have begun.
const LEASE_AHEAD: f64 = 0.75;

/// What a worker is told on its command line.
#[derive(Clone, Debug)]
pub struct Config {
    /// Coordinator, as http://host:port or https://host:port.
    pub url: String,
    /// Who to be there, and whom to believe.
    pub credentials: Credentials,
    /// Rendering threads, at least one.
    pub threads: usize,
    /// Name for the coordinator's log.
    pub name: String,
    /// Where to keep files of scenes; `None` keeps them in memory only.
    pub cache: Option<PathBuf>,
    /// How long to go on trying to reach the coordinator.
    pub patience: Duration,
}

/// What a worker did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Passes that the coordinator took.
    pub passes: u64,
}

/// Why a worker stopped before its job did.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The coordinator's address makes no sense.
    #[error("{url}: expected http://HOST:PORT or https://HOST:PORT ({message})")]
    Address {
        /// What was given.
        url: String,
        /// What is wrong with it.
        message: String,
    },
    /// A certificate, a key or the token cannot be read.
    #[error("{0}")]
    Security(String),
    /// The coordinator cannot be reached, or no longer.
    #[error("cannot reach the coordinator at {url}: {message}")]
    Unreachable {
        /// Its address.
        url: String,
        /// What the last attempt said.
        message: String,
    },
    /// The coordinator wants nothing from this worker.
    #[error("refused by the coordinator: {0}")]
    Refused(String),
    /// The job's scene cannot be read here.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Anything else.
    #[error("{0}")]
    Internal(String),
}

/// Why a session ended.
enum SessionEnd {
    Done,
    Failed(WorkerError),
    Forgotten,
}

/// Work for a coordinator until its job is over, or until `drain` becomes true and the pass at hand is delivered.
pub async fn run(config: Config, drain: watch::Receiver<bool>) -> Result<Summary, WorkerError> {
    let address = |message| WorkerError::Address {
        url: config.url.clone(),
        message,
    };
    let link = config.credentials.link(&config.url).map_err(address)?;
    let client = Client::new(link, config.patience);
    let renderer = Renderer::new(config.threads)?;
    let cache = Cache::new(config.cache.clone());
    let mut loaded: Option<(Job, Arc<Prepared>)> = None;
    let mut summary = Summary::default();
    let fail = |error| match error {
        CallError::Unreachable(message) => WorkerError::Unreachable {
            url: config.url.clone(),
            message,
        },
        CallError::Refused(message) => WorkerError::Refused(message),
        CallError::Forgotten => WorkerError::Refused("it forgets workers at once".into()),
    };
    loop {
        let scene = loaded.as_ref().map(|(job, _)| job.scene);
        let registration = tokio::select! {
            registration = client.register(&config.name, config.threads as u32, scene) => {
                registration.map_err(fail)?
            }
            () = drained(drain.clone()) => return Ok(summary),
        };
        let job = &registration.job;
        let prepared = match &loaded {
            Some((known, prepared)) if known == job => prepared.clone(),
            _ => {
                let bundle = fetch(&client, &cache, job).await.map_err(fail)?;
                let prepared = renderer.prepare(bundle, job).await?;
                loaded = Some((job.clone(), prepared.clone()));
                prepared
            }
        };
        info!("rendering scene {} for {}", job.scene, config.url);
        let session = Session {
            client: &client,
            renderer: &renderer,
            registration: &registration,
            prepared,
            held: Mutex::default(),
            drain: drain.clone(),
        };
        match session.run(&mut summary, fail).await {
            SessionEnd::Done => return Ok(summary),
            SessionEnd::Failed(error) => return Err(error),
            SessionEnd::Forgotten => {
                warn!("the coordinator has forgotten this worker: registering again")
            }
        }
    }
}

async fn drained(mut drain: watch::Receiver<bool>) {
    if drain.wait_for(|drain| *drain).await.is_err() {
        // Nobody is left who could ask for it.
        std::future::pending::<()>().await;
    }
}

async fn fetch(client: &Client, cache: &Cache, job: &Job) -> Result<Bundle, CallError> {
    let mut bundle = Bundle {
        scene: job.manifest.scene.clone(),
        ..Bundle::default()
    };
    for file in &job.manifest.files {
        let bytes = match cache.get(file.hash) {
            Some(bytes) => bytes,
            None => {
                debug!("fetching {} ({} bytes)", file.path, file.size);
                let bytes = client.fetch(file).await?;
                if let Err(error) = cache.put(file.hash, &bytes) {
                    warn!("cannot cache {}: {error}", file.path);
                }
                bytes
            }
        };
        bundle.files.insert(file.path.clone(), bytes);
    }
    let hash = bundle.hash();
    if hash != job.scene {
        let message = format!("its files make scene {hash}, not {}", job.scene);
        return Err(CallError::Refused(message));
    }
    Ok(bundle)
}

/// A pass that is rendered and not yet delivered.
struct Finished {
    lease: LeaseId,
    block: Block,
    image: Result<PassImage, String>,
}

/// The time between a registration and the end of the job, or of what the coordinator remembers.
struct Session<'a> {
    client: &'a Client,
    renderer: &'a Renderer,
    registration: &'a Registration,
    prepared: Arc<Prepared>,
    /// Leases for the heartbeat: from the moment they are given until their block is delivered.
    held: Mutex<BTreeSet<LeaseId>>,
    drain: watch::Receiver<bool>,
}

impl Session<'_> {
    async fn run(
        &self,
        summary: &mut Summary,
        fail: impl Fn(CallError) -> WorkerError,
    ) -> SessionEnd {
        // One pass waits here while the one before is on its way and the one after is being rendered.
        let (finished, deliveries) = mpsc::channel(1);
        let work =
            async { tokio::try_join!(self.render(finished), self.deliver(deliveries, summary)) };
        let end = tokio::select! {
            end = work => end.map(|_| ()),
            end = self.heartbeat() => end,
        };
        match end {
            Ok(()) => SessionEnd::Done,
            Err(CallError::Forgotten) => SessionEnd::Forgotten,
            Err(error) => SessionEnd::Failed(fail(error)),
        }
    }

    /// Lease and render, one pass after the other, until there is nothing more to do.
    async fn render(&self, finished: mpsc::Sender<Finished>) -> Result<(), CallError> {
        let mut before: Option<Duration> = None;
        let mut next = self.lease().await?;
        while let Some((lease, block)) = next {
            let (over, rendered) = oneshot::channel::<()>();
            let finished = &finished;
            let render = async move {
                let begun = Instant::now();
                let image = self.renderer.pass(&self.prepared, block.start()).await;
                let took = begun.elapsed();
                debug!("{block} took {:.3} s", took.as_secs_f64());
                drop(over);
                let done = Finished {
                    lease,
                    block,
                    image,
                };
                // Fails when delivering has failed, which ends the session.
                let _ = finished.send(done).await;
                took
            };
            let lease_ahead = async {
                match before {
                    Some(before) => {
                        let _ = tokio::time::timeout(before.mul_f64(LEASE_AHEAD), rendered).await;
                    }
                    None => {
                        let _ = rendered.await;
                    }
                }
                self.lease().await
            };
            let (took, ahead) = tokio::join!(render, lease_ahead);
            before = Some(took);
            next = ahead?;
        }
        Ok(())
    }

    /// The next pass; `None` when there will be none, or when this worker shall finish.
    async fn lease(&self) -> Result<Option<(LeaseId, Block)>, CallError> {
        let Registration { worker, job, .. } = self.registration;
        loop {
            let grant = tokio::select! {
                biased;
                () = drained(self.drain.clone()) => return Ok(None),
                grant = self.client.lease(*worker, job.scene) => grant?,
            };
            match grant {
                Grant::Lease(lease, block) => {
                    self.held().insert(lease);
                    return Ok(Some((lease, block)));
                }
                Grant::NotNow => {}
                Grant::Done => return Ok(None),
            }
        }
    }

    /// Encode and upload, one block at a time.
    async fn deliver(
        &self,
        mut finished: mpsc::Receiver<Finished>,
        summary: &mut Summary,
    ) -> Result<(), CallError> {
        let Registration { worker, job, .. } = self.registration;
        while let Some(done) = finished.recv().await {
            let Finished { lease, block, .. } = done;
            let encoded = match done.image {
                Ok(image) => encode(job, block, image).await,
                Err(message) => Err(message),
            };
            match encoded {
                Ok((bytes, stats)) => {
                    let delivery = Delivery {
                        lease,
                        block,
                        bytes: bytes.into(),
                        stats,
                    };
                    self.client.submit(*worker, &delivery).await?;
                    summary.passes += block.len();
                }
                Err(message) => {
                    warn!("{block}: {message}");
                    self.client.fail(*worker, lease, &message).await?;
                }
            }
            self.held().remove(&lease);
        }
        Ok(())
    }

    /// Send heartbeats until the coordinator says that the job is over.
    async fn heartbeat(&self) -> Result<(), CallError> {
        let mut ticks = interval(self.registration.heartbeat);
        loop {
            let (beats, mut notices) = self.client.attend(self.beat()).await?;
            loop {
                tokio::select! {
                    notice = notices.message() => match notice {
                        Ok(Some(notice)) if notice.done => return Ok(()),
                        Ok(Some(_)) => {}
                        // Cut off. The next attempt tells whether the coordinator is still there.
                        Ok(None) | Err(_) => break,
                    },
                    _ = ticks.tick() => {
                        // Room for several: a full channel means that the connection stalls, and that it will break.
                        let _ = beats.try_send(self.beat());
                    }
                }
            }
            warn!("lost the coordinator; trying to reach it again");
            sleep(self.registration.heartbeat.min(Duration::from_millis(200))).await;
        }
    }

    fn beat(&self) -> wire::Heartbeat {
        wire::Heartbeat {
            worker: self.registration.worker.0,
            leases: self.held().iter().map(|lease| lease.0).collect(),
        }
    }

    fn held(&self) -> std::sync::MutexGuard<'_, BTreeSet<LeaseId>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn encode(
    job: &Job,
    block: Block,
    image: PassImage,
) -> Result<(Vec<u8>, beamfarm_shared::job::PassStats), String> {
    let meta = BlockMeta {
        scene: job.scene,
        block,
        seed: job.settings.seed,
        alpha: job.settings.alpha,
        radius_scale: Schedule::new(&job.settings).scale(block.start()),
        version: VERSION.into(),
    };
    let layers = job.layers.clone();
    let encoded = tokio::task::spawn_blocking(move || {
        let node = Node::leaf(block.start(), image.film).with_layers(image.layers);
        encode_block(&node, &meta, &layers).map(|bytes| (bytes, image.stats))
    });
    match encoded.await {
        Ok(encoded) => encoded.map_err(|error| error.to_string()),
        Err(error) => Err(error.to_string()),
    }
}
