//! The calls of live.proto.

use super::{Outcome, Revisions};
use crate::chunks::{FileStream, in_chunks};
use crate::greeting::{fingerprint, same_program, shortened};
use beamfarm_image::film::Film;
use beamfarm_proto::wire::order::Order as Kind;
use beamfarm_proto::wire::report::Part;
use beamfarm_proto::wire::revisions_server::Revisions as RevisionsService;
use beamfarm_proto::{FileHash, Fingerprint, RevisionNumber, TaskNumber, WireHash, WorkerId, wire};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use tracing::{Instrument, info, warn};

/// The most workers at a time.
const WORKERS: usize = 1024;
/// Longest name and message that are logged, in bytes.
const TEXT_BYTES: usize = 1000;
/// Bytes per pixel.
const PIXEL: usize = 12;
/// Time between checks for late tasks.
const LOOK: Duration = Duration::from_secs(1);
/// Why a worker is sent away.
const SENT_AWAY: &str = "it failed too often at what other workers could render";
/// Time for a worker to introduce itself.
const GREETING: Duration = Duration::from_secs(10);

pub(crate) struct Service {
    revisions: Arc<Revisions>,
    registered: AtomicU64,
}

impl Service {
    pub fn new(revisions: Arc<Revisions>) -> Self {
        Self {
            revisions,
            registered: AtomicU64::new(0),
        }
    }
}

type Orders = mpsc::Sender<Result<wire::Order, Status>>;

#[tonic::async_trait]
impl RevisionsService for Service {
    type AttendStream = ReceiverStream<Result<wire::Order, Status>>;

    async fn attend(&self, request: Request<Streaming<wire::Report>>) -> Result<Response<Self::AttendStream>, Status> {
        let mut reports = request.into_inner();
        let first = tokio::time::timeout(GREETING, reports.message()).await;
        let first = first.map_err(|_| Status::invalid_argument("no greeting"))??;
        let Some(Part::Greeting(greeting)) = first.and_then(|first| first.part) else {
            return Err(Status::invalid_argument("expected a greeting first"));
        };
        let name = shortened(&greeting.name, TEXT_BYTES).to_owned();
        if let Err(message) = same_program(&greeting.version, greeting.protocol) {
            warn!(name, "{name:?} is refused: {message}");
            return Err(Status::failed_precondition(message));
        }
        if FileHash::from_wire(&greeting.canary, "canary")?.0 != self.revisions.canary() {
            warn!(
                name,
                "{name:?} is refused: its test picture has other bits than this machine's"
            );
            return Err(Status::permission_denied("its test picture has other bits"));
        }
        let key = fingerprint(&greeting.identity)?;
        if self.revisions.has_sent_away(key) {
            return Err(Status::permission_denied(SENT_AWAY));
        }
        if self.revisions.workers() >= WORKERS {
            return Err(Status::resource_exhausted("too many workers"));
        }
        let worker = WorkerId(self.registered.fetch_add(1, Ordering::Relaxed));
        self.revisions.join(worker);
        info!(
            worker = worker.0,
            name,
            threads = greeting.threads,
            "a worker looks at the scene"
        );
        let (orders, receiver) = mpsc::channel(4);
        let attendance = Attendance {
            revisions: self.revisions.clone(),
            worker,
            key,
            told: None,
            arriving: None,
        };
        tokio::spawn(attendance.run(reports, orders).in_current_span());
        Ok(Response::new(ReceiverStream::new(receiver)))
    }

    type FetchFileStream = FileStream;

    async fn fetch_file(
        &self,
        request: Request<wire::FetchFileRequest>,
    ) -> Result<Response<Self::FetchFileStream>, Status> {
        let hash = FileHash::from_wire(&request.into_inner().hash, "hash")?;
        let Some(bytes) = self.revisions.file(hash) else {
            // The next revision may have come meanwhile, which is no reason to give up.
            return Err(Status::not_found(format!(
                "no file of this revision has the hash {hash}"
            )));
        };
        Ok(Response::new(in_chunks(bytes)))
    }
}

/// A picture that is arriving.
struct Arriving {
    outcome: Outcome,
    size: [u32; 2],
    bytes: Vec<u8>,
}

/// A worker's stream.
struct Attendance {
    revisions: Arc<Revisions>,
    worker: WorkerId,
    /// The fingerprint that it is known by.
    key: Fingerprint,
    /// The revision that the worker has been sent.
    told: Option<RevisionNumber>,
    arriving: Option<Arriving>,
}

impl Drop for Attendance {
    fn drop(&mut self) {
        self.revisions.leave(self.worker);
    }
}

impl Attendance {
    async fn run(mut self, mut reports: Streaming<wire::Report>, orders: Orders) {
        let mut news = self.revisions.news();
        let mut over = self.revisions.is_over();
        // When the current task was handed out.
        let mut begun = Instant::now();
        loop {
            match self.give_orders(&orders).await {
                Ok(true) => begun = Instant::now(),
                Ok(false) => {}
                Err(()) => break,
            }
            if self.revisions.sends_away(self.worker, self.key) {
                warn!(worker = self.worker.0, "a worker is sent away: {SENT_AWAY}");
                let _ = orders.send(Err(Status::permission_denied(SENT_AWAY))).await;
                break;
            }
            tokio::select! {
                report = reports.message() => match report {
                    Ok(Some(wire::Report { part: Some(part) })) => {
                        if let Err(message) = self.take(part, begun).await {
                            warn!(worker = self.worker.0, "a worker is sent away: {message}");
                            let _ = orders.send(Err(Status::invalid_argument(message))).await;
                            break;
                        }
                    }
                    // Hung up, was cut off, or sent nonsense.
                    _ => break,
                },
                _ = news.changed() => {}
                // Nothing notifies of late tasks.
                () = tokio::time::sleep(LOOK) => {}
                () = becomes_true(&mut over) => break,
                () = orders.closed() => break,
            }
        }
        info!(worker = self.worker.0, "a worker has gone");
    }

    /// Returns whether a task was handed out.
    async fn give_orders(&mut self, orders: &Orders) -> Result<bool, ()> {
        let (dropped, next) = self.revisions.orders(self.worker);
        let mut messages = Vec::new();
        messages.extend(dropped.map(|TaskNumber(number)| Kind::Drop(number)));
        let is_new = next.is_some();
        if let Some((revision, task)) = next {
            if self.told != Some(revision.number) {
                self.told = Some(revision.number);
                messages.push(Kind::Revision((&*revision).into()));
            }
            messages.push(Kind::Task(task.into()));
        }
        for order in messages {
            orders
                .send(Ok(wire::Order { order: Some(order) }))
                .await
                .map_err(|_| ())?;
        }
        Ok(is_new)
    }

    /// An error is the worker's fault.
    async fn take(&mut self, part: Part, begun: Instant) -> Result<(), String> {
        match part {
            Part::Greeting(_) => Err("a second greeting".into()),
            Part::Outcome(outcome) => {
                let task = TaskNumber(outcome.task);
                // Keep nothing of a picture that is no longer wanted.
                let size = self.revisions.size_of(self.worker, task).unwrap_or([0, 0]);
                let outcome = Outcome {
                    task,
                    took: begun.elapsed(),
                    stats: outcome.stats.unwrap_or_default().into(),
                };
                self.arriving = Some(Arriving {
                    outcome,
                    size,
                    bytes: Vec::with_capacity(size[0] as usize * size[1] as usize * PIXEL),
                });
                Ok(())
            }
            Part::Data(data) => {
                let Some(arriving) = &mut self.arriving else {
                    return Err("data of no task".into());
                };
                let [width, height] = arriving.size;
                let all = width as usize * height as usize * PIXEL;
                if all == 0 {
                    return Ok(());
                }
                if arriving.bytes.len() + data.len() > all {
                    return Err(format!("more than the {all} bytes of {width} x {height} pixels"));
                }
                arriving.bytes.extend_from_slice(&data);
                if arriving.bytes.len() == all
                    && let Some(arriving) = self.arriving.take()
                {
                    let film = film(arriving.size, &arriving.bytes);
                    self.revisions.deliver(self.worker, arriving.outcome, film).await;
                }
                Ok(())
            }
            Part::Dropped(task) => {
                let task = TaskNumber(task);
                self.arriving.take_if(|arriving| arriving.outcome.task == task);
                self.revisions.give_back(self.worker, task, None);
                Ok(())
            }
            Part::Misfortune(misfortune) => {
                let message = shortened(&misfortune.message, TEXT_BYTES).to_owned();
                warn!(worker = self.worker.0, "{message}");
                self.revisions
                    .give_back(self.worker, TaskNumber(misfortune.task), Some(message));
                Ok(())
            }
        }
    }
}

async fn becomes_true(value: &mut watch::Receiver<bool>) {
    // An error means that the sender is gone, which has the same effect.
    let _ = value.wait_for(|value| *value).await;
}

fn film([width, height]: [u32; 2], bytes: &[u8]) -> Film {
    let value = |bytes: &[u8]| match bytes.try_into() {
        Ok(bytes) => f32::from_le_bytes(bytes),
        Err(_) => f32::NAN,
    };
    let pixel = |bytes: &[u8]| [value(&bytes[0..4]), value(&bytes[4..8]), value(&bytes[8..12])];
    Film {
        width,
        height,
        pixels: bytes.chunks_exact(PIXEL).map(pixel).collect(),
    }
}
