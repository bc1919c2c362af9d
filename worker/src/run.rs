//! The life of a worker: it registers, loads the scene, then leases, renders and uploads until the job is over.

use crate::cache::Cache;
use crate::client::{CallError, Client, Introduction, Registration};
use crate::config::Config;
use crate::error::WorkerError;
use crate::identity;
use crate::live;
use crate::offer::Offered;
use crate::render::{Prepared, Renderer, Source};
use crate::security::with_hint;
use crate::session::{Session, SessionEnd, Summary};
use crate::signals::drained;
use beamfarm_image::bundle::{self, Bundle};
use beamfarm_image::job::{EngineKind, SceneHash};
use beamfarm_proto::{FileEntry, Job, WorkerKey};
use beamfarm_scene::{File, Files, Store};
use std::collections::BTreeMap;
use std::sync::Arc;
use tokio::sync::watch;
use tracing::{debug, info, warn};

/// Works for a coordinator with these engines until its job is over, or until `drain` becomes true and current work is
/// delivered or given back.
pub async fn run(config: Config, offered: Offered, drain: watch::Receiver<bool>) -> Result<Summary, WorkerError> {
    let mut summary = Summary::default();
    work(&config, offered, &drain, &mut summary).await?;
    Ok(summary)
}

/// A worker's next step.
enum Next {
    /// Render passes of this job, which is loaded.
    Job(Box<Registration>, Arc<Prepared>),
    /// Register again; this was its key.
    Again(WorkerKey),
    /// Render the test picture of this engine first.
    Test(EngineKind),
    /// There is no farm.
    NoFarm,
}

async fn work(
    config: &Config,
    offered: Offered,
    drain: &watch::Receiver<bool>,
    summary: &mut Summary,
) -> Result<(), WorkerError> {
    let address = |message| WorkerError::Address {
        url: config.url.clone(),
        message,
    };
    let link = config.credentials.link(&config.url).map_err(address)?;
    let client = Client::new(link, config.patience);
    let renderer = Arc::new(Renderer::new(config.threads, offered.engines.clone())?);
    let cache = Cache::new(config.cache.clone());
    // Takes milliseconds; those of devices take longer and are rendered on request.
    let canary = renderer.canary(EngineKind::Cpu).await?;
    let mut introduction = Introduction {
        name: config.name.clone(),
        identity: identity::of(config.state.as_deref(), &config.name).map_err(WorkerError::Security)?,
        threads: config.threads as u32,
        canary,
        offers: offered.offers.clone(),
        lacks: offered.lacks.clone(),
    };
    introduction.show(EngineKind::Cpu, canary);
    let fail = |error| match error {
        CallError::Unreachable(message) => WorkerError::Unreachable {
            url: config.url.clone(),
            message: with_hint(&config.url, message),
        },
        CallError::Refused(message) => WorkerError::Refused(message),
        CallError::Forgotten => WorkerError::Refused("it forgets workers at once".into()),
        CallError::Untested(engine) => WorkerError::Refused(format!("it wants the test picture of {engine} again")),
        CallError::NoFarm => WorkerError::Refused("it has neither a farm nor a live view".into()),
    };
    let mut loaded: Option<(Job, Arc<Prepared>)> = None;
    let mut known: Option<Registration> = None;
    let mut key: Option<WorkerKey> = None;
    // Data of earlier jobs that this one may share.
    let mut kept = Kept::default();
    loop {
        let scene = loaded.as_ref().map(|(job, _)| job.scene);
        let get_ready = async {
            let registration = match known.take() {
                Some(registration) => registration,
                None => match client.register(&introduction, scene, Vec::new(), key).await {
                    Err(CallError::NoFarm) => return Ok(Next::NoFarm),
                    Err(CallError::Untested(engine)) if introduction.lacks_picture(engine) => {
                        return Ok(Next::Test(engine));
                    }
                    registered => registered.map_err(fail)?,
                },
            };
            let job = &registration.job;
            let prepared = match &loaded {
                Some((known, prepared)) if known == job => prepared.clone(),
                _ if registration.in_series => {
                    let files = match kept.fetch(&client, &cache, job).await {
                        // The job ended before this worker had its files.
                        Err(CallError::Forgotten) => return Ok(Next::Again(registration.key)),
                        files => files.map_err(fail)?,
                    };
                    let before = loaded.as_ref().map(|(_, prepared)| prepared.clone());
                    let source = Source::Shared(files, kept.store.clone(), before);
                    renderer.prepare(source, job).await?
                }
                _ => {
                    let bundle = match fetch(&client, &cache, job).await {
                        // Also after the last job of a series.
                        Err(CallError::Forgotten) => return Ok(Next::Again(registration.key)),
                        bundle => bundle.map_err(fail)?,
                    };
                    renderer.prepare(Source::Whole(bundle), job).await?
                }
            };
            Ok::<_, WorkerError>(Next::Job(Box::new(registration), prepared))
        };
        let ready = tokio::select! {
            ready = get_ready => ready?,
            () = drained(drain.clone()) => return Ok(()),
        };
        let (registration, prepared) = match ready {
            Next::Job(registration, prepared) => (*registration, prepared),
            Next::Again(own) => {
                key = Some(own);
                continue;
            }
            Next::Test(engine) => {
                info!("rendering the test picture of the engine {engine}");
                let tested = tokio::select! {
                    tested = renderer.canary(engine) => tested?,
                    () = drained(drain.clone()) => return Ok(()),
                };
                introduction.show(engine, tested);
                continue;
            }
            Next::NoFarm => {
                let tools = live::Tools {
                    client: &client,
                    renderer: renderer.clone(),
                    cache: cache.clone(),
                    introduction: &introduction,
                    offered: &offered,
                };
                summary.passes += live::attend(tools, drain.clone()).await.map_err(fail)?;
                return Ok(());
            }
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
            config,
            drain.clone(),
        );
        match session.run(summary).await {
            Ok(SessionEnd::Over) => return Ok(()),
            Ok(SessionEnd::Stuck(message)) => return Err(WorkerError::Stuck(message)),
            Ok(SessionEnd::OtherJob(registration)) => {
                match registration.in_series {
                    true => debug!("that job is over"),
                    false => warn!("the coordinator has another job now"),
                }
                key = Some(registration.key);
                known = Some(*registration);
            }
            Ok(SessionEnd::Elsewhere(own)) => {
                debug!("the coordinator has another job for this worker");
                key = Some(own);
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
        let bytes = fetch_file(client, cache, file).await?;
        bundle.files.insert(file.path.clone(), bytes);
    }
    check(job, bundle.hash())?;
    Ok(bundle)
}

async fn fetch_file(client: &Client, cache: &Cache, file: &FileEntry) -> Result<Vec<u8>, CallError> {
    if let Some(bytes) = cache.get(file.hash) {
        return Ok(bytes);
    }
    debug!("fetching {} ({} bytes)", file.path, file.size);
    let bytes = client.fetch(file).await?;
    if let Err(error) = cache.put(file.hash, &bytes) {
        warn!("cannot cache {}: {error}", file.path);
    }
    Ok(bytes)
}

fn check(job: &Job, hash: SceneHash) -> Result<(), CallError> {
    match hash == job.scene {
        true => Ok(()),
        false => {
            let message = format!("its files make scene {hash}, not {}", job.scene);
            Err(CallError::Refused(message))
        }
    }
}

/// Data shared by successive jobs.
#[derive(Default)]
struct Kept {
    /// Files of the latest one.
    files: Files,
    store: Arc<tokio::sync::Mutex<Store>>,
}

impl Kept {
    /// The files of a job; those of the previous job are not fetched again.
    async fn fetch(&mut self, client: &Client, cache: &Cache, job: &Job) -> Result<Files, CallError> {
        // Kept until all files of this job are here: another job may come first.
        let before = self.files.files.values().map(|file| (file.hash(), file.clone()));
        let before: BTreeMap<[u8; 32], File> = before.collect();
        let mut files = Files {
            scene: job.manifest.scene.clone(),
            ..Files::default()
        };
        for entry in &job.manifest.files {
            let file = match before.get(&entry.hash.0) {
                Some(file) => file.clone(),
                None => {
                    let bytes = fetch_file(client, cache, entry).await?;
                    File::known(entry.hash.0, bytes.into())
                }
            };
            files.files.insert(entry.path.clone(), file);
        }
        let hashes = files.files.iter().map(|(path, file)| (path.as_str(), file.hash()));
        check(job, bundle::hash_of(&files.scene, hashes))?;
        self.files = files.clone();
        Ok(files)
    }
}
