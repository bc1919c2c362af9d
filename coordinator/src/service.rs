//! The calls of farm.proto. Each unwraps its message, asks the [`Farm`], and wraps the answer.

use crate::chunks::{FileStream, in_chunks};
use crate::examine::{Claim, Flaw};
use crate::farm::{Farm, Refusal, Unwelcome};
use crate::intake::{Delivery, Intake};
use crate::keys::Keys;
use crate::ledger::{Accepted, LedgerError};
use crate::limits::{Limits, Pace};
use crate::rarely::Rarely;
use beamfarm_image::exr::encoded_size;
use beamfarm_image::job::{Block, SceneHash};
use beamfarm_proto::wire::farm_server::Farm as FarmService;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{FileHash, LeaseId, VERSION, WireHash, WorkerId, wire};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use tracing::{Instrument, Span, warn};

/// Longest message about a failure, in bytes.
const TEXT_BYTES: usize = 1000;
/// Longest name that is remembered: there may be many.
const NAME_BYTES: usize = 200;
/// Blocks that a worker may claim.
const HELD: usize = 16;
/// Deliveries of one worker at the same time. It sends one after the other.
const DELIVERIES: usize = 2;

pub(crate) struct Service {
    farm: Arc<Farm>,
    /// Deliveries that are decoded at the same time; others wait as bytes.
    decoders: Arc<Semaphore>,
    limits: Limits,
    intake: Arc<Intake>,
    keys: Keys,
    /// Leases whose block is on its way in.
    arriving: Arriving,
    /// Registrations that are refused for their version.
    other_versions: Rarely,
}

/// Each lease has one delivery at a time, and each worker a few.
#[derive(Clone, Default)]
struct Arriving(Arc<Mutex<BTreeSet<(WorkerId, LeaseId)>>>);

impl Arriving {
    /// A place for the delivery of a lease, until it is dropped.
    fn begin(&self, claim: &Claim) -> Result<Arrival, Status> {
        let Claim { worker, lease, .. } = *claim;
        let mut leases = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let of_worker = (worker, LeaseId(0))..=(worker, LeaseId(u64::MAX));
        // Those before may be the remains of a connection that broke.
        if leases.range(of_worker).count() >= DELIVERIES || !leases.insert((worker, lease)) {
            return Err(Status::resource_exhausted("this block is on its way in already"));
        }
        Ok(Arrival(self.clone(), (worker, lease)))
    }
}

struct Arrival(Arriving, (WorkerId, LeaseId));

impl Drop for Arrival {
    fn drop(&mut self) {
        let Self(Arriving(leases), lease) = self;
        leases.lock().unwrap_or_else(PoisonError::into_inner).remove(lease);
    }
}

impl Service {
    pub fn new(farm: Arc<Farm>, limits: Limits) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let job = farm.job();
        let largest = encoded_size(job.width, job.height, &job.layers) as u64;
        let intake = Arc::new(Intake::new(largest));
        Self {
            farm,
            decoders: Arc::new(Semaphore::new(cores)),
            limits,
            intake,
            keys: Keys::default(),
            arriving: Arriving::default(),
            other_versions: Rarely::default(),
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
            LedgerError::ShutOut(..) => Self::permission_denied(message),
            LedgerError::NotLeased { .. } => Self::invalid_argument(message),
        }
    }
}

impl From<Unwelcome> for Status {
    fn from(unwelcome: Unwelcome) -> Self {
        match unwelcome {
            Unwelcome::Sentenced(sentence) => Self::permission_denied(sentence.to_string()),
            Unwelcome::Crowd => Self::resource_exhausted(unwelcome.to_string()),
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

/// Leases with the number of passes that are rendered of each.
fn leases(beat: &wire::Heartbeat) -> Vec<(LeaseId, u64)> {
    let rendered = beat.rendered.iter().copied().chain(std::iter::repeat(0));
    let leases = beat.leases.iter().map(|lease| LeaseId(*lease));
    leases.zip(rendered).collect()
}

/// Why the bytes of a delivery are not there.
enum BodyError {
    /// The connection.
    Cut(Status),
    /// The sender.
    Wrong(String),
}

async fn read_body(
    parts: &mut Streaming<wire::SubmitRequest>,
    size: u64,
    delivery: &mut Delivery,
) -> Result<Vec<u8>, BodyError> {
    let mut bytes = Vec::with_capacity(size as usize);
    while let Some(part) = parts.message().await.map_err(BodyError::Cut)? {
        let Some(Part::Data(data)) = part.part else {
            return Err(BodyError::Wrong("a part that is not data".into()));
        };
        if (bytes.len() + data.len()) as u64 > size {
            let message = format!("more than the {size} bytes announced");
            return Err(BodyError::Wrong(message));
        }
        let arrived = (bytes.len() + data.len()) as u64;
        delivery.grow(arrived).await.map_err(BodyError::Cut)?;
        bytes.extend_from_slice(&data);
    }
    match bytes.len() as u64 == size {
        true => Ok(bytes),
        false => Err(BodyError::Wrong(format!(
            "{} bytes of the {size} announced",
            bytes.len()
        ))),
    }
}

fn shortened(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}

#[tonic::async_trait]
impl FarmService for Service {
    async fn register(&self, request: Request<wire::RegisterRequest>) -> Result<Response<wire::RegisterReply>, Status> {
        let request = request.into_inner();
        let name = shortened(&request.name, NAME_BYTES);
        if request.version != VERSION {
            let version = shortened(&request.version, NAME_BYTES);
            if let Some(count) = self.other_versions.tell() {
                let of = format!("{count} registrations of other versions");
                warn!(
                    name,
                    "{name:?} is refused: it is version {version:?}, this is {VERSION} ({of})"
                );
            }
            let message = format!("version {version}; this coordinator is version {VERSION}");
            return Err(Status::failed_precondition(message));
        }
        if !request.scene.is_empty() {
            // A worker with another scene may stay: the reply tells it what to fetch.
            SceneHash::from_wire(&request.scene, "scene")?;
        }
        let canary = FileHash::from_wire(&request.canary, "canary")?;
        let worker = self.farm.register(name, request.threads, canary.0)?;
        let key = self.keys.issue(worker, |worker| self.farm.knows(worker))?;
        let mut leases = Vec::new();
        if request.scene == self.farm.job().scene.to_wire() {
            let held = request.held.into_iter().take(HELD);
            let held = held.filter_map(|block| Block::try_from(block).ok());
            leases = self.farm.claim(worker, held);
        }
        let lease = |(lease, block): (LeaseId, Block)| wire::Lease {
            lease: lease.0,
            block: Some(block.into()),
        };
        let heartbeat = self.farm.timing().heartbeat;
        Ok(Response::new(wire::RegisterReply {
            worker: key,
            number: worker.0,
            job: Some(self.farm.job().into()),
            heartbeat_ms: u32::try_from(heartbeat.as_millis()).unwrap_or(u32::MAX),
            leases: leases.into_iter().map(lease).collect(),
        }))
    }

    type FetchFileStream = FileStream;

    async fn fetch_file(
        &self,
        request: Request<wire::FetchFileRequest>,
    ) -> Result<Response<Self::FetchFileStream>, Status> {
        let hash = FileHash::from_wire(&request.into_inner().hash, "hash")?;
        let Some(bytes) = self.farm.file(hash) else {
            let message = format!("no file of this scene has the hash {hash}");
            return Err(Status::invalid_argument(message));
        };
        Ok(Response::new(in_chunks(bytes)))
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
        let (key, worker) = (first.worker, self.keys.worker(first.worker)?);
        let farm = self.farm.clone();
        farm.beat(worker, leases(&first))?;
        let attendance = farm.attend(worker)?;
        let (sender, receiver) = mpsc::channel(1);
        let pace = Pace::new(self.limits.beats_per_second);
        let attend = async move {
            let _attendance = attendance;
            loop {
                tokio::select! {
                    beat = beats.message() => match beat {
                        Ok(Some(beat)) if beat.worker == key => {
                            if let Err(error) = farm.beat(worker, leases(&beat)) {
                                let _ = sender.send(Err(error.into())).await;
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
                        // It is there until it hangs up.
                        while let Ok(Ok(Some(_))) = timeout(farm.timing().lease, beats.message()).await {}
                        break;
                    }
                    () = sender.closed() => break,
                    () = sleep(farm.timing().lease) => break,
                }
            }
        };
        tokio::spawn(attend.in_current_span());
        Ok(Response::new(ReceiverStream::new(receiver)))
    }

    async fn lease(&self, request: Request<wire::LeaseRequest>) -> Result<Response<wire::LeaseReply>, Status> {
        let request = request.into_inner();
        let worker = self.keys.worker(request.worker)?;
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
        let worker = self.keys.worker(header.worker)?;
        let claim = Claim::of(worker, header)?;
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
        let _arrival = self.arriving.begin(&claim)?;
        let mut delivery = self.intake.begin();
        let bytes = match read_body(&mut parts, claim.size, &mut delivery).await {
            Ok(bytes) => bytes,
            Err(BodyError::Cut(status)) => return Err(status),
            Err(BodyError::Wrong(message)) => return refuse(message),
        };
        let permit = self.decoders.clone().acquire_owned().await;
        let farm = self.farm.clone();
        let span = Span::current();
        let submitted = tokio::task::spawn_blocking(move || {
            let _job = span.entered();
            let _permit = permit;
            let accepted = farm.submit(&claim, &bytes);
            (accepted, bytes)
        });
        let (accepted, bytes) = submitted.await.map_err(|error| Status::internal(error.to_string()))?;
        drop(bytes);
        self.farm.set_intake(self.intake.seconds_per_block());
        let duplicate = accepted? != Accepted::New;
        Ok(Response::new(wire::SubmitReply { duplicate }))
    }

    async fn fail(&self, request: Request<wire::FailRequest>) -> Result<Response<wire::FailReply>, Status> {
        let request = request.into_inner();
        let (worker, lease) = (self.keys.worker(request.worker)?, LeaseId(request.lease));
        let message = shortened(&request.message, TEXT_BYTES);
        self.farm.fail(worker, lease, request.pass_index, message)?;
        Ok(Response::new(wire::FailReply {}))
    }

    async fn give_back(
        &self,
        request: Request<wire::GiveBackRequest>,
    ) -> Result<Response<wire::GiveBackReply>, Status> {
        let request = request.into_inner();
        let leases = request.leases.into_iter().map(LeaseId).collect();
        let worker = self.keys.worker(request.worker)?;
        self.farm.give_back(worker, &leases, request.leaving)?;
        Ok(Response::new(wire::GiveBackReply {}))
    }
}
