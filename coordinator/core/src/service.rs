//! The calls of farm.proto. Each unpacks its message, asks the farm that the worker is at, and packs the answer.

use crate::chunks::{FileStream, in_chunks};
use crate::examine::{Claim, Flaw};
use crate::farm::{Farm, Refusal, Unwelcome};
use crate::greeting::{fingerprint, same_program, shortened};
use crate::intake::Delivery;
use crate::keys::{Keys, Seat, Seats, unknown};
use crate::ledger::{Accepted, LedgerError, Sentence, Who};
use crate::limits::{Limits, Pace};
use crate::listener::HangUp;
use crate::rarely::Rarely;
use crate::series::{Series, Workplace};
use beamfarm_image::exr::encoded_size;
use beamfarm_image::job::{Block, SceneHash};
use beamfarm_proto::wire::farm_server::Farm as FarmService;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{FileHash, Lack, LeaseId, Offer, PROTOCOL, WireHash, wire};
use std::sync::Arc;
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use tracing::{Instrument, Span, warn};

/// Longest failure message, in bytes.
const TEXT_BYTES: usize = 1000;
/// Longest name that is remembered, in bytes; there may be many.
const NAME_BYTES: usize = 200;
/// The most engines that a worker may offer or report as missing.
const ENGINES: usize = 16;
/// The most blocks that a worker may claim.
const HELD: usize = 16;

pub(crate) struct Service {
    series: Arc<Series>,
    /// Limits the deliveries decoded at a time; others wait as bytes.
    decoders: Arc<Semaphore>,
    limits: Limits,
    keys: Keys,
    /// Limits log lines about registrations refused for their version.
    other_versions: Rarely,
}

impl Service {
    pub fn new(series: Arc<Series>, limits: Limits) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            series,
            decoders: Arc::new(Semaphore::new(cores)),
            limits,
            keys: Keys::default(),
            other_versions: Rarely::default(),
        }
    }

    /// The owner of a key, and the job that the worker is at.
    fn at_work(&self, key: u64) -> Result<(Arc<Workplace>, Seats), Status> {
        let seats = self.keys.seats(key)?;
        let place = self.series.place(seats.now.job).ok_or_else(unknown)?;
        self.series.tell_of_convicted(&place);
        Ok((place, seats))
    }

    /// The span that names the job in a call's log lines.
    fn span(&self, place: &Workplace) -> Span {
        match self.series.is_of_several() {
            true => place.span(),
            false => Span::none(),
        }
    }

    /// Where the worker was before, as far as those jobs are still open.
    fn seats_before(&self, key: u64) -> Option<Seats> {
        let mut seats = self.keys.known(key).filter(|_| key != 0)?;
        seats.before.retain(|seat| self.series.place(seat.job).is_some());
        Some(seats)
    }

    /// Whether a worker with this key delivered wrong pixels for any job.
    fn is_convicted(&self, who: &Who) -> bool {
        let convicted = self.series.convicted();
        convicted.iter().any(|convicted| convicted.known_by() == who.known_by())
    }

    /// Admit a worker to its job. `None`: it must render its test picture first.
    fn welcome(
        &self,
        place: &Workplace,
        before: Option<Seats>,
        request: &wire::RegisterRequest,
    ) -> Result<Option<Seats>, Status> {
        let name = shortened(&request.name, NAME_BYTES);
        let own = fingerprint(&request.identity)?;
        let who = Who {
            name: name.to_owned(),
            key: Some(own),
        };
        let farm = place.farm();
        let offer = offer_for(farm, name, request)?;
        if offer.canary.is_none() && farm.asks_for_canary() {
            return Ok(None);
        }
        if self.series.is_of_several() && self.is_convicted(&who) {
            return Err(Unwelcome::Sentenced(Sentence::Key).into());
        }
        let known = before.as_ref().and_then(|seats| seats.at(place.number));
        let worker = match known.filter(|worker| farm.knows(*worker)) {
            Some(worker) => {
                farm.welcome_back(worker)?;
                worker
            }
            None => farm.register(who, request.threads, offer.canary, offer.device)?,
        };
        let now = Seat {
            job: place.number,
            worker,
        };
        let mut seats = Seats {
            own,
            now,
            before: Vec::new(),
        };
        for earlier in before
            .into_iter()
            .flat_map(|seats| [vec![seats.now], seats.before].concat())
        {
            if seats.at(earlier.job).is_none() {
                seats.before.push(earlier);
            }
        }
        self.series.seen(&seats);
        Ok(Some(seats))
    }
}

/// The worker's offer for the job's engine.
fn offer_for(farm: &Farm, name: &str, request: &wire::RegisterRequest) -> Result<Offer, Status> {
    let engine = farm.job().settings.engine;
    for offer in request.offers.iter().take(ENGINES) {
        let offer = Option::<Offer>::try_from(offer.clone())?;
        if let Some(offer) = offer.filter(|offer| offer.engine == engine) {
            return Ok(offer);
        }
    }
    let lacks = request.lacks.iter().take(ENGINES);
    let mut lacks = lacks.filter_map(|lack| Option::<Lack>::from(lack.clone()));
    let lack = lacks.find(|lack| lack.engine == engine);
    let reason = lack.map_or_else(|| "it does not say why".into(), |lack| lack.reason);
    farm.cannot_serve(name, &reason);
    let message = format!("the job is for the engine {engine}, which this worker does not offer: {reason}");
    Err(Status::failed_precondition(message))
}

fn check_scene(farm: &Farm, scene: SceneHash) -> Result<(), Status> {
    let expected = farm.job().scene;
    if scene == expected {
        return Ok(());
    }
    let message = format!("scene {scene}; this job renders {expected}");
    Err(Status::failed_precondition(message))
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

/// Leases, each with its number of rendered passes.
fn leases(beat: &wire::Heartbeat) -> Vec<(LeaseId, u64)> {
    let rendered = beat.rendered.iter().copied().chain(std::iter::repeat(0));
    let leases = beat.leases.iter().map(|lease| LeaseId(*lease));
    leases.zip(rendered).collect()
}

/// Why a delivery's bytes are missing.
enum BodyError {
    /// The connection failed.
    Cut(Status),
    /// The sender is at fault.
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

#[tonic::async_trait]
impl FarmService for Service {
    async fn register(&self, request: Request<wire::RegisterRequest>) -> Result<Response<wire::RegisterReply>, Status> {
        let hang_up = request.extensions().get::<HangUp>().cloned();
        let request = request.into_inner();
        let name = shortened(&request.name, NAME_BYTES);
        if let Err(message) = same_program(&request.version, request.protocol) {
            if let Some(count) = self.other_versions.tell() {
                warn!(
                    name,
                    "{name:?} is refused: {message} ({count} registrations of other versions)"
                );
            }
            return Err(Status::failed_precondition(message));
        }
        // A worker with another scene may stay: the reply tells it what to fetch.
        let scene = match request.scene.is_empty() {
            true => None,
            false => Some(SceneHash::from_wire(&request.scene, "scene")?),
        };
        let before = self.seats_before(request.before);
        let held = scene.filter(|_| !request.held.is_empty());
        let Some(place) = self.series.place_for(before.as_ref(), held).await else {
            return Err(Status::resource_exhausted("there is no job yet"));
        };
        let farm = place.farm();
        let welcomed = self.span(&place).in_scope(|| {
            let Some(seats) = self.welcome(&place, before, &request)? else {
                return Ok(None);
            };
            let mut leases = Vec::new();
            if scene == Some(farm.job().scene) {
                let held = request.held.iter().take(HELD);
                let held = held.filter_map(|block| Block::try_from(*block).ok());
                leases = farm.claim(seats.now.worker, held);
            }
            Ok::<_, Status>(Some((seats, leases)))
        })?;
        let Some((seats, leases)) = welcomed else {
            return Ok(Response::new(wire::RegisterReply {
                job: Some(farm.job().into()),
                untested: true,
                protocol: PROTOCOL,
                ..wire::RegisterReply::default()
            }));
        };
        let worker = seats.now.worker;
        if let Some(hang_up) = hang_up {
            // Weak, so that workers' connections do not keep a finished job alive.
            let farm = Arc::downgrade(farm);
            let notice = async move {
                hang_up.happens().await;
                if let Some(farm) = farm.upgrade() {
                    farm.hung_up(worker);
                }
            };
            tokio::spawn(notice.instrument(self.span(&place)).in_current_span());
        }
        let knows = |seat: Seat| {
            let place = self.series.place(seat.job);
            place.is_some_and(|place| place.farm().knows(seat.worker))
        };
        let key = self.keys.issue(seats, knows)?;
        let lease = |(lease, block): (LeaseId, Block)| wire::Lease {
            lease: lease.0,
            block: Some(block.into()),
        };
        let heartbeat = farm.timing().heartbeat;
        Ok(Response::new(wire::RegisterReply {
            worker: key,
            number: worker.0,
            job: Some(farm.job().into()),
            heartbeat_ms: u32::try_from(heartbeat.as_millis()).unwrap_or(u32::MAX),
            leases: leases.into_iter().map(lease).collect(),
            in_series: self.series.goes_on(),
            untested: false,
            protocol: PROTOCOL,
        }))
    }

    type FetchFileStream = FileStream;

    async fn fetch_file(
        &self,
        request: Request<wire::FetchFileRequest>,
    ) -> Result<Response<Self::FetchFileStream>, Status> {
        let hash = FileHash::from_wire(&request.into_inner().hash, "hash")?;
        let Some(bytes) = self.series.file(hash) else {
            let message = format!("no file of this scene has the hash {hash}");
            return Err(match self.series.is_of_several() {
                // The job is over meanwhile: register again.
                true => Status::not_found(message),
                false => Status::invalid_argument(message),
            });
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
        let key = first.worker;
        let (place, seats) = self.at_work(key)?;
        let span = self.span(&place);
        let (series, farm, worker) = (self.series.clone(), place.farm().clone(), seats.now.worker);
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
                            series.seen(&seats);
                            if let Err(error) = farm.beat(worker, leases(&beat)) {
                                let _ = sender.send(Err(error.into())).await;
                                break;
                            }
                            pace.next().await;
                        }
                        // Hung up, was cut off, or sent nonsense.
                        _ => break,
                    },
                    _ = farm.ended() => {
                        // Fails when the worker is gone.
                        let elsewhere = series.goes_on();
                        let _ = sender.send(Ok(wire::Notice { done: !elsewhere, elsewhere })).await;
                        // The worker is present until it hangs up.
                        while let Ok(Ok(Some(_))) = timeout(farm.timing().lease, beats.message()).await {}
                        break;
                    }
                    () = sender.closed() => break,
                    () = sleep(farm.timing().lease) => break,
                }
            }
        };
        tokio::spawn(attend.instrument(span).in_current_span());
        Ok(Response::new(ReceiverStream::new(receiver)))
    }

    async fn lease(&self, request: Request<wire::LeaseRequest>) -> Result<Response<wire::LeaseReply>, Status> {
        let request = request.into_inner();
        let (place, seats) = self.at_work(request.worker)?;
        // A worker of the previous coordinator with another scene must hear that it is unknown, and register again.
        place.farm().beat(seats.now.worker, [])?;
        check_scene(place.farm(), SceneHash::from_wire(&request.scene, "scene")?)?;
        place.farm().renders_together(seats.now.worker, request.together);
        let lease = self.series.lease(&place, &seats);
        let grant = lease.instrument(self.span(&place)).await?;
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
        let (place, seats) = self.at_work(header.worker)?;
        let (farm, span) = (place.farm(), self.span(&place));
        let claim = Claim::of(seats.now.worker, header)?;
        farm.check(&claim)?;
        let refuse = |message: String| {
            let flaw = Flaw::Foreign(message);
            span.in_scope(|| farm.reject(&claim, &flaw));
            Err(Status::from(Refusal::Flaw(flaw)))
        };
        let job = farm.job();
        let limit = encoded_size(job.width, job.height, &job.layers) as u64;
        if claim.size > limit {
            return refuse(format!("{} bytes; expected at most {limit}", claim.size));
        }
        let _arrival = place.arriving.begin(&claim)?;
        let mut delivery = place.intake.begin();
        let bytes = match read_body(&mut parts, claim.size, &mut delivery).await {
            Ok(bytes) => bytes,
            Err(BodyError::Cut(status)) => return Err(status),
            Err(BodyError::Wrong(message)) => return refuse(message),
        };
        let permit = self.decoders.clone().acquire_owned().await;
        let (of_call, adding) = (Span::current(), farm.clone());
        let submitted = tokio::task::spawn_blocking(move || {
            let _call = of_call.entered();
            let _job = span.entered();
            let _permit = permit;
            let accepted = adding.submit(&claim, &bytes);
            (accepted, bytes)
        });
        let (accepted, bytes) = submitted.await.map_err(|error| Status::internal(error.to_string()))?;
        drop(bytes);
        farm.set_intake(place.intake.seconds_per_block());
        let duplicate = accepted? != Accepted::New;
        Ok(Response::new(wire::SubmitReply { duplicate }))
    }

    async fn fail(&self, request: Request<wire::FailRequest>) -> Result<Response<wire::FailReply>, Status> {
        let request = request.into_inner();
        let (place, seats) = self.at_work(request.worker)?;
        let message = shortened(&request.message, TEXT_BYTES);
        let _job = self.span(&place).entered();
        let (worker, lease) = (seats.now.worker, LeaseId(request.lease));
        place.farm().fail(worker, lease, request.pass_index, message)?;
        Ok(Response::new(wire::FailReply {}))
    }

    async fn give_back(
        &self,
        request: Request<wire::GiveBackRequest>,
    ) -> Result<Response<wire::GiveBackReply>, Status> {
        let request = request.into_inner();
        let leases = request.leases.into_iter().map(LeaseId).collect();
        let (place, seats) = self.at_work(request.worker)?;
        let _job = self.span(&place).entered();
        place.farm().give_back(seats.now.worker, &leases, request.leaving)?;
        if request.leaving {
            self.series.left(&seats);
        }
        Ok(Response::new(wire::GiveBackReply {}))
    }
}
