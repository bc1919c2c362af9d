//! The calls of control.proto.

use crate::farm::{End, Event, ExtendError, Unable};
use crate::ledger::WorkerView;
use crate::series::Series;
use crate::watch::{Watch, unix_time};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::control_server::Control;
use beamfarm_proto::{VERSION, wire};
use std::sync::Arc;
use std::time::Duration;
use tonic::{Request, Response, Status};
use tracing::info;

/// The most events in a reply.
const EVENTS: usize = 100;

pub(crate) struct Service {
    series: Arc<Series>,
}

impl Service {
    pub fn new(series: Arc<Series>) -> Self {
        Self { series }
    }

    /// The first job in line, if it is not over.
    fn running(&self) -> Result<Arc<Watch>, Status> {
        let watch = self.series.current();
        match watch.farm().end() {
            Some(_) if self.series.is_over() => Err(Status::failed_precondition("the job is over")),
            _ => Ok(watch),
        }
    }
}

fn milliseconds(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

fn worker(view: WorkerView) -> wire::Worker {
    wire::Worker {
        id: view.id.0,
        name: view.name,
        key: view.key.map_or_else(String::new, |key| key.to_string()),
        threads: view.threads,
        passes: view.passes,
        seconds_per_pass: view.seconds_per_pass,
        last_seen_ms: milliseconds(view.last_seen),
        audits_passed: view.audits_passed,
        audits_failed: view.audits_failed,
        state: view.state.as_str().into(),
        device: view.device.map(wire::Device::from),
    }
}

fn unable(unable: Unable) -> wire::Unable {
    let Unable { name, reason, times } = unable;
    wire::Unable { name, reason, times }
}

fn event(event: Event) -> wire::Event {
    wire::Event {
        time_ms: milliseconds(unix_time(event.time)),
        kind: event.kind.as_str().into(),
        text: event.text,
    }
}

#[tonic::async_trait]
impl Control for Service {
    async fn status(&self, _: Request<wire::StatusRequest>) -> Result<Response<wire::StatusReply>, Status> {
        let watch = self.series.current();
        // Called for its error estimate, which does not exist before the first pass.
        let _ = watch.picture().await;
        let progress = watch.farm().progress();
        let (state, failure) = match watch.farm().end() {
            None if progress.paused => (wire::JobState::Paused, String::new()),
            None => (wire::JobState::Running, String::new()),
            Some(End::Complete) => (wire::JobState::Complete, String::new()),
            Some(End::Stopped) => (wire::JobState::Stopped, String::new()),
            Some(End::Failed(failure)) => {
                let message = format!("pass {}: {}", failure.pass_index, failure.message);
                (wire::JobState::Failed, message)
            }
        };
        let job = watch.farm().job();
        let last = watch.curve().last().copied();
        let mut events = watch.farm().events(0);
        let old = events.len().saturating_sub(EVENTS);
        events.drain(..old);
        Ok(Response::new(wire::StatusReply {
            version: VERSION.into(),
            job: watch.id().into(),
            scene: Bytes::copy_from_slice(&job.scene.0),
            width: job.width,
            height: job.height,
            state: state.into(),
            failure,
            prefix: progress.prefix,
            passes: progress.passes,
            limit: progress.limit,
            elapsed_ms: milliseconds(watch.worked()),
            remaining_ms: watch.remaining(&progress).map(milliseconds),
            passes_per_second: watch.rates().passes,
            relative_standard_error: last.map(|point| point.error),
            error_passes: last.map_or(0, |point| point.passes),
            connected: progress.workers,
            counters: Some(wire::Counters {
                registered: progress.registered,
                duplicates: progress.duplicates,
                refused: progress.refused,
                failures: progress.failures,
                lost_leases: progress.lost_leases,
                divergent: progress.divergent,
                audits: progress.audits,
                dropped: progress.dropped,
                photon_paths: progress.stats.paths,
                beams: progress.stats.beams,
            }),
            workers: progress.workers_seen.into_iter().map(worker).collect(),
            first_pass: watch.terms().first_pass,
            events: events.into_iter().map(event).collect(),
            engine: job.settings.engine.identity(),
            unable: progress.unable.into_iter().map(unable).collect(),
        }))
    }

    async fn cancel(&self, _: Request<wire::CancelRequest>) -> Result<Response<wire::CancelReply>, Status> {
        let watch = self.running()?;
        info!("cancelled by a call");
        self.series.cancel();
        let prefix = watch.farm().progress().prefix;
        Ok(Response::new(wire::CancelReply { prefix }))
    }

    async fn pause(&self, _: Request<wire::PauseRequest>) -> Result<Response<wire::PauseReply>, Status> {
        self.running()?;
        self.series.pause(true);
        Ok(Response::new(wire::PauseReply {}))
    }

    async fn resume(&self, _: Request<wire::ResumeRequest>) -> Result<Response<wire::ResumeReply>, Status> {
        self.running()?;
        self.series.pause(false);
        Ok(Response::new(wire::ResumeReply {}))
    }

    async fn extend(&self, request: Request<wire::ExtendRequest>) -> Result<Response<wire::ExtendReply>, Status> {
        match self.running()?.farm().extend(request.into_inner().passes) {
            Ok(()) => Ok(Response::new(wire::ExtendReply {})),
            Err(error @ ExtendError::Over) => Err(Status::failed_precondition(error.to_string())),
            Err(error) => Err(Status::invalid_argument(error.to_string())),
        }
    }

    async fn write_now(&self, _: Request<wire::WriteNowRequest>) -> Result<Response<wire::WriteNowReply>, Status> {
        match self.running()?.write_now().await {
            Ok(message) => Ok(Response::new(wire::WriteNowReply { message })),
            Err(message) => Err(Status::internal(message)),
        }
    }
}
