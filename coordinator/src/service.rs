//! The calls of farm.proto. Each unwraps its message, asks the [`Farm`], and wraps the answer.

use crate::examine::{Claim, Flaw};
use crate::farm::{Farm, Refusal};
use crate::ledger::{Accepted, LedgerError};
use crate::limits::{Limits, Pace};
use beamfarm_proto::wire::farm_server::Farm as FarmService;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{CHUNK_BYTES, FileHash, LeaseId, VERSION, WireHash, WorkerId, wire};
use beamfarm_shared::exr::encoded_size;
use beamfarm_shared::job::SceneHash;
use std::sync::Arc;
use tokio::sync::{Semaphore, mpsc};
use tokio::time::sleep;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use tracing::warn;

/// Longest name of a worker, and longest message about a failure, in bytes.
const TEXT_BYTES: usize = 1000;

pub(crate) struct Service {
    farm: Arc<Farm>,
    /// Deliveries that are decoded at the same time; others wait as bytes.
    decoders: Arc<Semaphore>,
    limits: Limits,
}

impl Service {
    pub fn new(farm: Arc<Farm>, limits: Limits) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            farm,
            decoders: Arc::new(Semaphore::new(cores)),
            limits,
        }
    }

    fn check_scene(&self, scene: SceneHash) -> Result<(), Status> {
        let expected = self.farm.job().scene;
        if scene == expected {
            return Ok(());
        }
        let message = format!("scene {scene}; this job renders {expected}");
        Err(Status::failed_precondition(message))
    }
}

impl From<LedgerError> for Status {
    fn from(error: LedgerError) -> Self {
        let message = error.to_string();
        match error {
            LedgerError::UnknownWorker(_) => Self::not_found(message),
            LedgerError::ShutOut(_) => Self::permission_denied(message),
            LedgerError::NotLeased { .. } => Self::invalid_argument(message),
            LedgerError::Divergent { .. } => Self::data_loss(message),
        }
    }
}

impl From<Refusal> for Status {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Ledger(error) => error.into(),
            Refusal::Flaw(Flaw::Damaged) => Self::aborted(Flaw::Damaged.to_string()),
            Refusal::Flaw(flaw) => Self::invalid_argument(flaw.to_string()),
        }
    }
}

fn shortened(text: &str) -> &str {
    &text[..text.floor_char_boundary(TEXT_BYTES)]
}

#[tonic::async_trait]
impl FarmService for Service {
    async fn register(
        &self,
        request: Request<wire::RegisterRequest>,
    ) -> Result<Response<wire::RegisterReply>, Status> {
        let request = request.into_inner();
        let name = shortened(&request.name);
        if request.version != VERSION {
            let version = shortened(&request.version);
            warn!("{name:?} is refused: it is version {version}, this is {VERSION}");
            let message = format!("version {version}; this coordinator is version {VERSION}");
            return Err(Status::failed_precondition(message));
        }
        if !request.scene.is_empty() {
            // A worker with another scene may stay: the reply tells it what to fetch.
            SceneHash::from_wire(&request.scene, "scene")?;
        }
        let worker = self.farm.register(name, request.threads);
        let heartbeat = self.farm.timing().heartbeat;
        Ok(Response::new(wire::RegisterReply {
            worker: worker.0,
            job: Some(self.farm.job().into()),
            heartbeat_ms: u32::try_from(heartbeat.as_millis()).unwrap_or(u32::MAX),
        }))
    }

    type FetchFileStream = ReceiverStream<Result<wire::FileChunk, Status>>;

    async fn fetch_file(
        &self,
        request: Request<wire::FetchFileRequest>,
    ) -> Result<Response<Self::FetchFileStream>, Status> {
        let hash = FileHash::from_wire(&request.into_inner().hash, "hash")?;
        let Some(mut bytes) = self.farm.file(hash) else {
            let message = format!("no file of this scene has the hash {hash}");
            return Err(Status::invalid_argument(message));
        };
        let (sender, receiver) = mpsc::channel(2);
        tokio::spawn(async move {
            while !bytes.is_empty() {
                let data = bytes.split_to(bytes.len().min(CHUNK_BYTES));
                // Fails when the worker has gone.
                if sender.send(Ok(wire::FileChunk { data })).await.is_err() {
                    break;
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(receiver)))
    }

    type AttendStream = ReceiverStream<Result<wire::Notice, Status>>;

    async fn attend(
        &self,
        request: Request<Streaming<wire::Heartbeat>>,
    ) -> Result<Response<Self::AttendStream>, Status> {
        let mut beats = request.into_inner();
        let Some(first) = beats.message().await? else {
            return Err(Status::invalid_argument("no heartbeat"));
        };
        let worker = WorkerId(first.worker);
        let farm = self.farm.clone();
        farm.beat(worker, first.leases.into_iter().map(LeaseId))?;
        let attendance = farm.attend(worker);
        let (sender, receiver) = mpsc::channel(1);
        let pace = Pace::new(self.limits.beats_per_second);
        tokio::spawn(async move {
            let _attendance = attendance;
            loop {
                tokio::select! {
                    beat = beats.message() => match beat {
                        Ok(Some(beat)) if beat.worker == worker.0 => {
                            let leases = beat.leases.into_iter().map(LeaseId);
                            if farm.beat(worker, leases).is_err() {
                                break;
                            }
                            pace.next().await;
                        }
                        // Hung up, cut off, or not making sense.
                        _ => break,
                    },
                    _ = farm.ended() => {
                        // Fails when the worker has gone.
                        let _ = sender.send(Ok(wire::Notice { done: true })).await;
                        break;
                    }
                    () = sender.closed() => break,
                    () = sleep(farm.timing().lease) => break,
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(receiver)))
    }

    async fn lease(
        &self,
        request: Request<wire::LeaseRequest>,
    ) -> Result<Response<wire::LeaseReply>, Status> {
        let request = request.into_inner();
        let worker = WorkerId(request.worker);
        // A worker of the coordinator before, with another scene, shall hear that it is unknown, and register again.
        self.farm.beat(worker, [])?;
        self.check_scene(SceneHash::from_wire(&request.scene, "scene")?)?;
        let grant = self.farm.lease(worker).await?;
        Ok(Response::new(grant.into()))
    }

    async fn submit(
        &self,
        request: Request<Streaming<wire::SubmitRequest>>,
    ) -> Result<Response<wire::SubmitReply>, Status> {
        let mut parts = request.into_inner();
        let first = parts.message().await?.and_then(|first| first.part);
        let Some(Part::Header(header)) = first else {
            return Err(Status::invalid_argument("expected a header first"));
        };
        let claim = Claim::try_from(header)?;
        self.farm.check(&claim)?;
        let refuse = |message: String| {
            let flaw = Flaw::Foreign(message);
            self.farm.reject(&claim, &flaw);
            Err(Status::from(Refusal::Flaw(flaw)))
        };
        let job = self.farm.job();
        let limit = encoded_size(job.width, job.height, &job.layers) as u64;
        if claim.size > limit {
            return refuse(format!("{} bytes; expected at most {limit}", claim.size));
        }
        let mut bytes = Vec::with_capacity(claim.size as usize);
        while let Some(part) = parts.message().await? {
            let Some(Part::Data(data)) = part.part else {
                return refuse("a part that is not data".into());
            };
            if (bytes.len() + data.len()) as u64 > claim.size {
                return refuse(format!("more than the {} bytes announced", claim.size));
            }
            bytes.extend_from_slice(&data);
        }
        if (bytes.len() as u64) < claim.size {
            let (found, announced) = (bytes.len(), claim.size);
            return refuse(format!("{found} bytes of the {announced} announced"));
        }
        let permit = self.decoders.clone().acquire_owned().await;
        let farm = self.farm.clone();
        let submitted = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            farm.submit(&claim, &bytes)
        });
        let accepted = submitted
            .await
            .map_err(|error| Status::internal(error.to_string()))??;
        let duplicate = accepted == Accepted::Duplicate;
        Ok(Response::new(wire::SubmitReply { duplicate }))
    }

    async fn fail(
        &self,
        request: Request<wire::FailRequest>,
    ) -> Result<Response<wire::FailReply>, Status> {
        let request = request.into_inner();
        let (worker, lease) = (WorkerId(request.worker), LeaseId(request.lease));
        self.farm.fail(worker, lease, shortened(&request.message))?;
        Ok(Response::new(wire::FailReply {}))
    }
}
