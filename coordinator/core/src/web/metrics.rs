//! `/metrics` for Prometheus: the job's counters, read on request.

use super::Web;
use crate::farm::Progress;
use crate::ledger::WorkerState;
use crate::watch::Watch;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use beamfarm_proto::VERSION;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, text};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::{ConstGauge, Gauge};
use prometheus_client::registry::Registry;
use std::collections::BTreeMap;
use std::fmt::{self, Error};
use std::sync::Arc;

pub(super) async fn serve(State(web): State<Arc<Web>>) -> Response {
    let mut registry = Registry::with_prefix("beamfarm");
    registry.register_collector(Box::new(Numbers(web.watch())));
    let mut page = String::new();
    match text::encode(&mut page, &registry) {
        Ok(()) => {
            let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
            ([(CONTENT_TYPE, kind)], page).into_response()
        }
        Err(error) => {
            let failed = axum::http::StatusCode::INTERNAL_SERVER_ERROR;
            (failed, error.to_string()).into_response()
        }
    }
}

struct Numbers(Arc<Watch>);

impl fmt::Debug for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Numbers")
    }
}

impl Collector for Numbers {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> Result<(), Error> {
        let progress = self.0.farm().progress();
        for (name, help, value) in counters(&progress) {
            let counter = ConstCounter::new(value);
            let metric = encoder.encode_descriptor(name, help, None, MetricType::Counter)?;
            counter.encode(metric)?;
        }
        for (name, help, value) in gauges(&self.0, &progress) {
            let metric = encoder.encode_descriptor(name, help, None, MetricType::Gauge)?;
            ConstGauge::new(value).encode(metric)?;
        }
        let workers = Family::<[(&str, &str); 1], Gauge>::default();
        for state in [
            WorkerState::Working,
            WorkerState::Idle,
            WorkerState::BackingOff,
            WorkerState::Gone,
            WorkerState::ShutOut,
        ] {
            let of_state = progress.workers_seen.iter().filter(|w| w.state == state);
            let count = i64::try_from(of_state.count()).unwrap_or(i64::MAX);
            let label = [("state", state.as_str())];
            workers.get_or_create(&label).set(count);
        }
        let help = "Workers by what they are at; of those that are gone, the last few hundred";
        workers.encode(encoder.encode_descriptor("workers", help, None, MetricType::Gauge)?)?;
        let devices = Family::<[(&str, String); 3], Gauge>::default();
        let mut memory: BTreeMap<[(&str, String); 3], u64> = BTreeMap::new();
        let there = progress.workers_seen.iter().filter(|worker| is_there(worker.state));
        for device in there.filter_map(|worker| worker.device.as_ref()) {
            let label = [
                ("device", device.name.clone()),
                ("kind", device.kind.clone()),
                ("driver", device.driver.clone()),
            ];
            devices.get_or_create(&label).inc();
            let bytes = memory.entry(label).or_default();
            *bytes = bytes.saturating_add(device.memory.unwrap_or(0));
        }
        let help = "Workers that are there, by the device that they render on";
        devices.encode(encoder.encode_descriptor("devices", help, None, MetricType::Gauge)?)?;
        let sums = Family::<[(&str, String); 3], Gauge>::default();
        for (label, bytes) in memory {
            let bytes = i64::try_from(bytes).unwrap_or(i64::MAX);
            sums.get_or_create(&label).set(bytes);
        }
        let help = "Memory of these devices";
        sums.encode(encoder.encode_descriptor("device_memory_bytes", help, None, MetricType::Gauge)?)?;
        let build = Family::<[(&str, &str); 1], Gauge>::default();
        build.get_or_create(&[("version", VERSION)]).set(1);
        let help = "The coordinator's version";
        build.encode(encoder.encode_descriptor("build_info", help, None, MetricType::Gauge)?)
    }
}

fn is_there(state: WorkerState) -> bool {
    !matches!(state, WorkerState::Gone | WorkerState::ShutOut)
}

/// Names are prefixed with `beamfarm_` and suffixed with `_total`.
fn counters(progress: &Progress) -> [(&'static str, &'static str, u64); 14] {
    let stats = progress.stats;
    [
        (
            "worker_registrations",
            "Workers that registered",
            progress.registered.into(),
        ),
        (
            "lost_leases",
            "Leases that ended without a result",
            progress.lost_leases,
        ),
        (
            "failed_attempts",
            "Attempts at a block of passes that failed",
            progress.failures,
        ),
        ("refused_deliveries", "Deliveries that were refused", progress.refused),
        (
            "duplicate_deliveries",
            "Deliveries of a block that was there already, with the same bits",
            progress.duplicates,
        ),
        (
            "audited_blocks",
            "Blocks that another worker rendered again with the same bits",
            progress.audits,
        ),
        (
            "dropped_passes",
            "Passes that counted and do so no more, because of who rendered them",
            progress.dropped,
        ),
        ("photon_paths", "Photon paths of the passes that counted", stats.paths),
        ("beams", "Photon beams of the passes that counted", stats.beams),
        (
            "surface_photons",
            "Surface photons of the passes that counted",
            stats.surface_photons,
        ),
        (
            "beam_evaluations",
            "Pairs of beam and camera segment that were evaluated for the passes that counted",
            stats.beam_evaluations,
        ),
        (
            "beam_bytes",
            "Bytes that beams took in the passes that counted",
            stats.beam_bytes,
        ),
        (
            "non_finite_values",
            "Pixel values of the passes that counted that were NaN or infinite",
            stats.non_finite,
        ),
        (
            "passes_completed",
            "Passes that counted, with those that were dropped later",
            progress.passes.saturating_add(progress.dropped),
        ),
    ]
}

fn gauges(watch: &Watch, progress: &Progress) -> Vec<(&'static str, &'static str, f64)> {
    let mut gauges = vec![
        (
            "passes_prefix",
            "Complete passes from the first on: what the image is made of",
            progress.prefix as f64,
        ),
        (
            "passes_limit",
            "First pass that the job will not have",
            progress.limit as f64,
        ),
        (
            "workers_connected",
            "Workers with a connection",
            progress.workers.into(),
        ),
        (
            "workers_unable",
            "Workers that came and do not offer the job's engine, the last hundred",
            progress.unable.len() as f64,
        ),
        (
            "disputed_blocks",
            "Blocks whose bits are in dispute",
            progress.divergent as f64,
        ),
        ("job_paused", "1 while nobody is given passes", progress.paused.into()),
        (
            "job_ended",
            "1 when the job is over",
            f64::from(watch.farm().end().is_some()),
        ),
        (
            "job_elapsed_seconds",
            "Time since the coordinator started, without pauses",
            watch.worked().as_secs_f64(),
        ),
        (
            "job_progress_ratio",
            "Share of the job that is done",
            watch.fraction(progress),
        ),
    ];
    if let Some(remaining) = watch.remaining(progress) {
        let help = "Estimated time to the end";
        gauges.push(("job_remaining_seconds", help, remaining.as_secs_f64()));
    }
    if let Some(point) = watch.curve().last() {
        let help = "Estimated relative standard error of the image, when it was last looked at";
        gauges.push(("image_relative_standard_error_ratio", help, point.error));
    }
    gauges
}
