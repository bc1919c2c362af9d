//! The coordinator, as a worker sees it. Every call retries while the coordinator is unreachable, for as long as the
//! worker's patience lasts.

use crate::security::{Link, describe};
use beamfarm_image::job::{Block, EngineKind, PassStats, SceneHash};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::wire::revisions_client::RevisionsClient;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{
    CHUNK_BYTES, FileEntry, FileHash, Grant, Identity, Job, Lack, LeaseId, Offer, PROTOCOL, VERSION, WireError,
    WireHash, WorkerId, WorkerKey, wire,
};
use std::future::Future;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status, Streaming};

/// Most bytes of a message: twice those of a manifest with the most files and the longest paths.
const MESSAGE_BYTES: usize = 36 << 20;
/// Pauses between attempts double from the first of these to the second.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// Why a call failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CallError {
    /// The coordinator was unreachable for longer than the worker's patience.
    Unreachable(String),
    /// The coordinator wants to see this engine's test picture first.
    Untested(EngineKind),
    /// The coordinator does not know this worker: register again.
    Forgotten,
    /// There is no farm, but possibly a live view.
    NoFarm,
    /// The coordinator rejects the worker or the call.
    Refused(String),
}

/// The coordinator's first reply to a worker.
#[derive(Clone, Debug)]
pub struct Registration {
    /// The worker's number.
    pub worker: WorkerId,
    /// The worker's key for all other calls.
    pub key: WorkerKey,
    /// What to render.
    pub job: Job,
    /// Time between heartbeats.
    pub heartbeat: Duration,
    /// Leases of those held blocks that are still wanted.
    pub leases: Vec<(LeaseId, Block)>,
    /// Whether similar jobs follow.
    pub in_series: bool,
}

/// A worker's introduction to the coordinator.
#[derive(Clone, Debug)]
pub struct Introduction {
    /// Name for the coordinator's log.
    pub name: String,
    /// The secret that it is known by.
    pub identity: Identity,
    /// Rendering threads.
    pub threads: u32,
    /// Hash of the processors' test picture.
    pub canary: [u8; 32],
    /// The engines that it offers, with the test pictures requested so far.
    pub offers: Vec<Offer>,
    /// Engines that it lacks.
    pub lacks: Vec<Lack>,
}

impl Introduction {
    /// Whether it offers this engine, but has no test picture of it yet.
    pub fn lacks_picture(&self, engine: EngineKind) -> bool {
        let mut offers = self.offers.iter();
        offers.any(|offer| offer.engine == engine && offer.canary.is_none())
    }

    /// Sets the hash of the engine's test picture.
    pub fn show(&mut self, engine: EngineKind, canary: [u8; 32]) {
        let offers = self.offers.iter_mut();
        offers
            .filter(|offer| offer.engine == engine)
            .for_each(|offer| offer.canary = Some(canary));
    }
}

/// A rendered block to be delivered.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// Its lease.
    pub lease: LeaseId,
    /// Its passes.
    pub block: Block,
    /// The EXR.
    pub bytes: Bytes,
    /// Render statistics.
    pub stats: PassStats,
}

/// A connection to a coordinator. Clones share it.
#[derive(Clone, Debug)]
pub struct Client {
    link: Link,
    patience: Duration,
}

impl Client {
    /// Calls over this connection.
    pub fn new(link: Link, patience: Duration) -> Self {
        Self { link, patience }
    }

    /// The same with less patience.
    pub fn hasty(&self, patience: Duration) -> Self {
        Self {
            link: self.link.clone(),
            patience: patience.min(self.patience),
        }
    }

    /// Registers the worker, with the scene and the blocks that it still holds, if any, and its previous key.
    pub async fn register(
        &self,
        introduction: &Introduction,
        scene: Option<SceneHash>,
        held: Vec<Block>,
        before: Option<WorkerKey>,
    ) -> Result<Registration, CallError> {
        let request = wire::RegisterRequest {
            version: VERSION.into(),
            protocol: PROTOCOL,
            scene: scene.map(|scene| scene.to_wire()).unwrap_or_default(),
            name: introduction.name.clone(),
            identity: introduction.identity.reveal().to_vec().into(),
            threads: introduction.threads,
            offers: introduction.offers.iter().map(wire::Offer::from).collect(),
            lacks: introduction.lacks.iter().map(wire::Lack::from).collect(),
            held: held.into_iter().map(wire::Block::from).collect(),
            before: before.map_or(0, |key| key.0),
        };
        let reply = self
            .persist(|mut farm| {
                let request = request.clone();
                async move { farm.register(request).await }
            })
            .await?
            .into_inner();
        if reply.protocol != PROTOCOL {
            let theirs = reply.protocol;
            return Err(CallError::Refused(format!(
                "the coordinator is of another version: it has protocol {theirs}, and this worker, version {VERSION}, \
                 {PROTOCOL}"
            )));
        }
        let refused = |error: WireError| CallError::Refused(error.to_string());
        let job = Job::try_from(reply.job.unwrap_or_default()).map_err(refused)?;
        if reply.untested {
            return Err(CallError::Untested(job.settings.engine));
        }
        let mut leases = Vec::new();
        for lease in reply.leases {
            let block = Block::try_from(lease.block.unwrap_or_default()).map_err(refused)?;
            leases.push((LeaseId(lease.lease), block));
        }
        Ok(Registration {
            leases,
            worker: WorkerId(reply.number),
            key: WorkerKey(reply.worker),
            job,
            heartbeat: Duration::from_millis(reply.heartbeat_ms.max(1).into()),
            in_series: reply.in_series,
        })
    }

    /// A file of the scene; its size and content are checked.
    pub async fn fetch(&self, file: &FileEntry) -> Result<Vec<u8>, CallError> {
        let fetch = |mut farm: FarmClient<Link>| async move {
            let hash = file.hash.to_wire();
            let request = wire::FetchFileRequest { hash };
            whole(file, farm.fetch_file(request).await?.into_inner()).await
        };
        self.persist(fetch).await
    }

    /// Opens the stream of heartbeats, starting with one.
    pub async fn attend(
        &self,
        first: wire::Heartbeat,
    ) -> Result<(mpsc::Sender<wire::Heartbeat>, Streaming<wire::Notice>), CallError> {
        self.persist(|mut farm| {
            let (sender, beats) = mpsc::channel(4);
            // There is room for it.
            let _ = sender.try_send(first.clone());
            async move {
                let notices = farm.attend(ReceiverStream::new(beats)).await?;
                Ok((sender, notices.into_inner()))
            }
        })
        .await
    }

    /// The next passes, or `NotNow` after some seconds. `together`: number of passes that are best rendered together.
    pub async fn lease(&self, key: WorkerKey, scene: SceneHash, together: usize) -> Result<Grant, CallError> {
        let request = wire::LeaseRequest {
            worker: key.0,
            scene: scene.to_wire(),
            together: u32::try_from(together).unwrap_or(u32::MAX),
        };
        let reply = self
            .persist(|mut farm| {
                let request = request.clone();
                async move { farm.lease(request).await }
            })
            .await?;
        Grant::try_from(reply.into_inner()).map_err(|error| CallError::Refused(error.to_string()))
    }

    /// Delivers a block.
    pub async fn submit(&self, key: WorkerKey, delivery: &Delivery) -> Result<(), CallError> {
        let header = wire::SubmitHeader {
            worker: key.0,
            lease: delivery.lease.0,
            block: Some(delivery.block.into()),
            size: delivery.bytes.len() as u64,
            hash: FileHash::of(&delivery.bytes).to_wire(),
            stats: Some(delivery.stats.into()),
        };
        self.persist(|mut farm| {
            let mut rest = delivery.bytes.clone();
            let chunks = std::iter::from_fn(move || {
                let chunk = rest.split_to(rest.len().min(CHUNK_BYTES));
                (!chunk.is_empty()).then_some(Part::Data(chunk))
            });
            let parts = std::iter::once(Part::Header(header.clone())).chain(chunks);
            let parts = parts.map(|part| wire::SubmitRequest { part: Some(part) });
            async move { farm.submit(tokio_stream::iter(parts)).await }
        })
        .await
        .map(|_| ())
    }

    /// Gives leases back, or signs off.
    pub async fn give_back(&self, key: WorkerKey, leases: Vec<LeaseId>, leaving: bool) -> Result<(), CallError> {
        let request = wire::GiveBackRequest {
            worker: key.0,
            leases: leases.into_iter().map(|lease| lease.0).collect(),
            leaving,
        };
        self.persist(|mut farm| {
            let request = request.clone();
            async move { farm.give_back(request).await }
        })
        .await
        .map(|_| ())
    }

    /// Reports that a leased block cannot be rendered, because of this pass.
    pub async fn fail(&self, key: WorkerKey, lease: LeaseId, pass_index: u64, message: &str) -> Result<(), CallError> {
        let request = wire::FailRequest {
            worker: key.0,
            lease: lease.0,
            message: message.into(),
            pass_index,
        };
        self.persist(|mut farm| {
            let request = request.clone();
            async move { farm.fail(request).await }
        })
        .await
        .map(|_| ())
    }

    /// Opens the stream of a live view's orders.
    pub async fn attend_revisions(
        &self,
        greeting: wire::Greeting,
    ) -> Result<(mpsc::Sender<wire::Report>, Streaming<wire::Order>), CallError> {
        self.persist_on(|link| {
            let (sender, reports) = mpsc::channel(4);
            let first = wire::Report {
                part: Some(wire::report::Part::Greeting(greeting.clone())),
            };
            // There is room for it.
            let _ = sender.try_send(first);
            let mut revisions = RevisionsClient::new(link).max_decoding_message_size(MESSAGE_BYTES);
            async move {
                let orders = revisions.attend(ReceiverStream::new(reports)).await?;
                Ok((sender, orders.into_inner()))
            }
        })
        .await
    }

    /// A file of a live view's scene; its content is checked.
    pub async fn fetch_of_revision(&self, file: &FileEntry) -> Result<Vec<u8>, CallError> {
        self.persist_on(|link| async {
            let request = wire::FetchFileRequest {
                hash: file.hash.to_wire(),
            };
            let chunks = RevisionsClient::new(link).fetch_file(request).await?;
            whole(file, chunks.into_inner()).await
        })
        .await
    }

    async fn persist<T, F>(&self, call: impl Fn(FarmClient<Link>) -> F) -> Result<T, CallError>
    where
        F: Future<Output = Result<T, Status>>,
    {
        self.persist_on(|link| call(FarmClient::new(link).max_decoding_message_size(MESSAGE_BYTES)))
            .await
    }

    async fn persist_on<T, F>(&self, call: impl Fn(Link) -> F) -> Result<T, CallError>
    where
        F: Future<Output = Result<T, Status>>,
    {
        let mut begun = Instant::now();
        let mut pause = FIRST_PAUSE;
        loop {
            let status = match call(self.link.clone()).await {
                Ok(reply) => return Ok(reply),
                Err(status) => status,
            };
            match status.code() {
                Code::NotFound => return Err(CallError::Forgotten),
                Code::Unimplemented => return Err(CallError::NoFarm),
                Code::InvalidArgument
                | Code::FailedPrecondition
                | Code::PermissionDenied
                | Code::Unauthenticated
                | Code::DataLoss
                | Code::OutOfRange => return Err(CallError::Refused(status.message().into())),
                // It is reachable, but overloaded.
                Code::ResourceExhausted => begun = Instant::now(),
                _ => {}
            }
            if begun.elapsed() + pause > self.patience {
                return Err(CallError::Unreachable(describe(&status)));
            }
            let wait = pause.mul_f64(jitter());
            tracing::debug!("{}; trying again in {wait:?}", describe(&status));
            sleep(wait).await;
            pause = (2 * pause).min(LONGEST_PAUSE);
        }
    }
}

/// A file from its chunks, if it is the requested one.
async fn whole(file: &FileEntry, mut chunks: Streaming<wire::FileChunk>) -> Result<Vec<u8>, Status> {
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        if (bytes.len() + chunk.data.len()) as u64 > file.size {
            return Err(Status::aborted(format!("{} is too long", file.path)));
        }
        bytes.extend_from_slice(&chunk.data);
    }
    match FileHash::of(&bytes) == file.hash {
        true => Ok(bytes),
        false => Err(Status::aborted(format!("{} arrived damaged", file.path))),
    }
}

/// A random number between 0.5 and 1.5: workers that lost their coordinator together must not return together.
fn jitter() -> f64 {
    let random = RandomState::new().build_hasher().finish() >> 32;
    0.5 + random as f64 / f64::from(u32::MAX)
}
