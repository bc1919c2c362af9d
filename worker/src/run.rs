//! The life of a worker: register, load the scene, then lease, render and upload until the job is over.

use crate::cache::Cache;
use crate::client::{CallError, Client, Introduction, Registration};
use crate::error::WorkerError;
use crate::live;
use crate::render::{Prepared, Renderer};
use crate::security::{Credentials, with_hint};
use crate::session::{Session, SessionEnd, Summary};
use crate::signals::drained;
use beamfarm_image::bundle::Bundle;
use beamfarm_proto::Job;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tracing::{debug, info, warn};

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
    /// How long to go on rendering and delivering when told to finish.
    pub grace: Duration,
}

/// Work for a coordinator until its job is over, or until `drain` becomes true and what is at hand is delivered or
/// given back.
pub async fn run(config: Config, drain: watch::Receiver<bool>) -> Result<Summary, WorkerError> {
    let mut summary = Summary::default();
    work(&config, &drain, &mut summary).await?;
    Ok(summary)
}

async fn work(config: &Config, drain: &watch::Receiver<bool>, summary: &mut Summary) -> Result<(), WorkerError> {
    let address = |message| WorkerError::Address {
        url: config.url.clone(),
        message,
    };
    let link = config.credentials.link(&config.url).map_err(address)?;
    let client = Client::new(link, config.patience);
    let renderer = Arc::new(Renderer::new(config.threads)?);
    let cache = Cache::new(config.cache.clone());
    let introduction = Introduction {
        name: config.name.clone(),
        threads: config.threads as u32,
        canary: renderer.canary().await?,
    };
    let fail = |error| match error {
        CallError::Unreachable(message) => WorkerError::Unreachable {
            url: config.url.clone(),
            message: with_hint(&config.url, message),
        },
        CallError::Refused(message) => WorkerError::Refused(message),
        CallError::Forgotten => WorkerError::Refused("it forgets workers at once".into()),
        CallError::NoFarm => WorkerError::Refused("it has neither a farm nor a live view".into()),
    };
    let mut loaded: Option<(Job, Arc<Prepared>)> = None;
    let mut known: Option<Registration> = None;
    loop {
        let scene = loaded.as_ref().map(|(job, _)| job.scene);
        let get_ready = async {
            let registration = match known.take() {
                Some(registration) => registration,
                None => match client.register(&introduction, scene, Vec::new()).await {
                    Err(CallError::NoFarm) => return Ok(None),
                    registered => registered.map_err(fail)?,
                },
            };
            let job = &registration.job;
            let prepared = match &loaded {
                Some((known, prepared)) if known == job => prepared.clone(),
                _ => {
                    let bundle = fetch(&client, &cache, job).await.map_err(fail)?;
                    renderer.prepare(bundle, job).await?
                }
            };
            Ok::<_, WorkerError>(Some((registration, prepared)))
        };
        let ready = tokio::select! {
            ready = get_ready => ready?,
            () = drained(drain.clone()) => return Ok(()),
        };
        let Some((registration, prepared)) = ready else {
            let tools = live::Tools {
                client: &client,
                renderer: renderer.clone(),
                cache: cache.clone(),
                introduction: &introduction,
            };
            summary.passes += live::attend(tools, drain.clone()).await.map_err(fail)?;
            return Ok(());
        };
        loaded = Some((registration.job.clone(), prepared.clone()));
        info!(
            worker = registration.worker.0,
            name = config.name,
            "rendering scene {} for {}",
            registration.job.scene,
            config.url
        );
        let session = Session::new(
            &client,
            &renderer,
            &introduction,
            registration,
            prepared,
            config.grace,
            drain.clone(),
        );
        match session.run(summary).await {
            Ok(SessionEnd::Over) => return Ok(()),
            Ok(SessionEnd::Stuck(message)) => return Err(WorkerError::Stuck(message)),
            Ok(SessionEnd::OtherJob(registration)) => {
                warn!("the coordinator has another job now");
                known = Some(*registration);
            }
            Err(error) => return Err(fail(error)),
        }
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
