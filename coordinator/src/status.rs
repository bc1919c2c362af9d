//! `beamfarm status`: the state of a job.

use crate::failure::Failure;
use crate::output::print_text;
use crate::remote::{RemoteArgs, failed};
use beamfarm_image::job::{EngineKind, MAX_PASSES};
use beamfarm_proto::wire::{self, JobState};
use beamfarm_proto::{Device, Fingerprint};
use clap::Args;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;
use std::fmt::Write;
use std::time::{Duration, SystemTime};

pub const EXAMPLES: &str = "\
Examples:
  beamfarm status http://coordinator:7325
  beamfarm status http://coordinator:7325 --json | jq .prefix

The same as a page: open the URL in a browser. For Prometheus: URL/metrics.
--json prints one object; times are seconds, a field is null when its value is not known.";

#[derive(Args)]
pub struct StatusArgs {
    #[command(flatten)]
    remote: RemoteArgs,

    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

pub fn main(args: StatusArgs) -> Result<(), Failure> {
    let json = args.json;
    args.remote.call(async |mut control| {
        let reply = control.status(wire::StatusRequest {}).await;
        let report = Report::from(reply.map_err(failed)?.into_inner());
        match json {
            true => print_text(&format!("{}\n", report.json()?)),
            false => print_text(&report.text()),
        }
    })
}

/// The reply as a JSON object.
pub fn json(reply: wire::StatusReply) -> Result<String, Failure> {
    Report::from(reply).json()
}

/// The reply in the form for scripts.
#[derive(Serialize)]
struct Report {
    version: String,
    job: String,
    scene: String,
    width: u32,
    height: u32,
    engine: String,
    state: &'static str,
    failure: Option<String>,
    first_pass: u64,
    prefix: u64,
    passes: u64,
    limit: u64,
    elapsed: f64,
    remaining: Option<f64>,
    passes_per_second: f64,
    relative_standard_error: Option<f64>,
    error_passes: u64,
    connected: u32,
    counters: Counters,
    workers: Vec<Worker>,
    unable: Vec<Unable>,
    events: Vec<Event>,
}

#[derive(Serialize)]
struct Counters {
    registered: u32,
    duplicates: u64,
    refused: u64,
    failures: u64,
    lost_leases: u64,
    divergent: u64,
    audits: u64,
    dropped: u64,
    photon_paths: u64,
    beams: u64,
}

#[derive(Serialize)]
struct Worker {
    id: u64,
    name: String,
    /// Fingerprint of its key.
    key: Option<String>,
    threads: u32,
    passes: u64,
    seconds_per_pass: Option<f64>,
    last_seen: f64,
    audits_passed: u64,
    audits_failed: u64,
    state: String,
    device: Option<DeviceReport>,
}

/// A worker's device.
#[derive(Serialize)]
struct DeviceReport {
    name: String,
    kind: String,
    driver: String,
    memory: Option<u64>,
    #[serde(skip)]
    words: String,
}

impl From<Device> for DeviceReport {
    fn from(device: Device) -> Self {
        Self {
            words: device.to_string(),
            name: device.name,
            kind: device.kind,
            driver: device.driver,
            memory: device.memory,
        }
    }
}

/// A worker without the job's engine.
#[derive(Serialize)]
struct Unable {
    name: String,
    reason: String,
    times: u64,
}

#[derive(Serialize)]
struct Event {
    time: String,
    kind: String,
    text: String,
}

fn seconds(milliseconds: u64) -> f64 {
    milliseconds as f64 / 1000.0
}

impl From<wire::StatusReply> for Report {
    fn from(reply: wire::StatusReply) -> Self {
        let state = match reply.state() {
            JobState::Unspecified => "unknown",
            JobState::Running => "running",
            JobState::Paused => "paused",
            JobState::Complete => "complete",
            JobState::Stopped => "stopped",
            JobState::Failed => "failed",
        };
        let scene = reply.scene.iter().fold(String::new(), |mut text, byte| {
            // Writing into a string cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        });
        let counters = reply.counters.unwrap_or_default();
        Self {
            version: reply.version,
            job: reply.job,
            scene,
            width: reply.width,
            height: reply.height,
            engine: reply.engine,
            state,
            failure: Some(reply.failure).filter(|failure| !failure.is_empty()),
            first_pass: reply.first_pass,
            prefix: reply.prefix,
            passes: reply.passes,
            limit: reply.limit,
            elapsed: seconds(reply.elapsed_ms),
            remaining: reply.remaining_ms.map(seconds),
            passes_per_second: reply.passes_per_second,
            relative_standard_error: reply.relative_standard_error,
            error_passes: reply.error_passes,
            connected: reply.connected,
            counters: Counters {
                registered: counters.registered,
                duplicates: counters.duplicates,
                refused: counters.refused,
                failures: counters.failures,
                lost_leases: counters.lost_leases,
                divergent: counters.divergent,
                audits: counters.audits,
                dropped: counters.dropped,
                photon_paths: counters.photon_paths,
                beams: counters.beams,
            },
            workers: reply.workers.into_iter().map(Worker::from).collect(),
            unable: reply.unable.into_iter().map(Unable::from).collect(),
            events: reply.events.into_iter().map(Event::from).collect(),
        }
    }
}

impl From<wire::Worker> for Worker {
    fn from(worker: wire::Worker) -> Self {
        Self {
            id: worker.id,
            name: worker.name,
            key: worker.key.parse().ok().map(|key: Fingerprint| key.to_string()),
            threads: worker.threads,
            passes: worker.passes,
            seconds_per_pass: worker.seconds_per_pass,
            last_seen: seconds(worker.last_seen_ms),
            audits_passed: worker.audits_passed,
            audits_failed: worker.audits_failed,
            state: worker.state,
            device: worker.device.map(|device| Device::from(device).into()),
        }
    }
}

impl From<wire::Unable> for Unable {
    fn from(unable: wire::Unable) -> Self {
        let wire::Unable { name, reason, times } = unable;
        Self { name, reason, times }
    }
}

impl From<wire::Event> for Event {
    fn from(event: wire::Event) -> Self {
        let since = Duration::from_millis(event.time_ms);
        let time = SystemTime::UNIX_EPOCH.checked_add(since);
        let time = time.unwrap_or(SystemTime::UNIX_EPOCH);
        Self {
            time: humantime::format_rfc3339_seconds(time).to_string(),
            kind: event.kind,
            text: event.text,
        }
    }
}

/// Removes control characters: text from outside must not control a terminal.
fn plain(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

fn whole(seconds: f64) -> humantime::FormattedDuration {
    let seconds = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    humantime::format_duration(Duration::from_secs(seconds.as_secs()))
}

impl Report {
    fn json(&self) -> Result<String, Failure> {
        serde_json::to_string_pretty(self).map_err(Failure::io)
    }

    fn text(&self) -> String {
        let mut lines = vec![format!("job       {}, {}", plain(&self.job), self.state)];
        if let Some(failure) = &self.failure {
            lines.push(format!("failure   {}", plain(failure)));
        }
        // Rounded down, so that nothing looks finished before it is.
        let done = self.prefix.saturating_sub(self.first_pass) as f64;
        let all = self.limit.saturating_sub(self.first_pass).max(1) as f64;
        let percent = 100.0 * done / all;
        let percent = (10.0 * percent).floor() / 10.0;
        lines.push(match self.limit {
            MAX_PASSES => format!("passes    {}", self.prefix),
            limit => format!("passes    {} of {limit} ({percent} %)", self.prefix),
        });
        lines.push(format!("rate      {:.2} passes/s", self.passes_per_second));
        if !self.engine.is_empty() && self.engine != EngineKind::Cpu.identity() {
            lines.push(format!("engine    {}", plain(&self.engine)));
        }
        lines.push(format!("running   {}", whole(self.elapsed)));
        if let Some(remaining) = self.remaining {
            lines.push(format!("ends in   {}", whole(remaining)));
        }
        if let Some(error) = self.relative_standard_error {
            let of = self.error_passes;
            lines.push(format!("error     {:.2} % after {of} passes", 100.0 * error));
        }
        lines.push(format!(
            "workers   {} connected, {} ever",
            self.connected, self.counters.registered
        ));
        for (count, what) in [
            (self.counters.lost_leases, "leases ended without a result"),
            (self.counters.failures, "attempts failed"),
            (self.counters.refused, "deliveries were refused"),
            (self.counters.divergent, "blocks are in dispute"),
            (self.counters.dropped, "passes were taken out again"),
        ] {
            if count > 0 {
                lines.push(format!("          {count} {what}"));
            }
        }
        for unable in &self.unable {
            let (name, reason) = (plain(&unable.name), plain(&unable.reason));
            lines.push(format!("          {name} cannot serve this job: {reason}"));
        }
        let mut text = lines.join("\n") + "\n";
        if !self.workers.is_empty() {
            text += &format!("\n{}\n", self.table());
        }
        text
    }

    fn table(&self) -> Table {
        let mut table = Table::new();
        table.load_style(NOTHING);
        let has_devices = self.workers.iter().any(|worker| worker.device.is_some());
        let mut header = vec![
            "worker",
            "key",
            "state",
            "threads",
            "passes",
            "passes/s",
            "last seen",
            "audits",
        ];
        header.extend(has_devices.then_some("device"));
        table.set_header(header);
        for worker in &self.workers {
            let rate = worker.seconds_per_pass.filter(|seconds| *seconds > 0.0);
            let mut row = vec![
                plain(&worker.name),
                worker.key.as_ref().map_or("-".into(), |key| key[..8].into()),
                worker.state.clone(),
                worker.threads.to_string(),
                worker.passes.to_string(),
                rate.map_or("-".into(), |seconds| format!("{:.2}", 1.0 / seconds)),
                format!("{} ago", whole(worker.last_seen)),
                format!("{} ok, {} wrong", worker.audits_passed, worker.audits_failed),
            ];
            row.extend(worker.device.iter().map(|device| plain(&device.words)));
            table.add_row(row);
        }
        for column in 3..=6 {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reply_reads_well() {
        let worker = wire::Worker {
            name: "host\u{1b}[31m".into(),
            key: "0123456789abcdef".repeat(2),
            threads: 4,
            passes: 9,
            seconds_per_pass: Some(0.5),
            last_seen_ms: 1500,
            state: "working".into(),
            device: Some(wire::Device {
                name: "Card\u{1b}".into(),
                kind: "discrete".into(),
                memory: Some(3 << 29),
                ..wire::Device::default()
            }),
            ..wire::Worker::default()
        };
        let reply = wire::StatusReply {
            job: "disco-12345678".into(),
            state: JobState::Running.into(),
            prefix: 999,
            limit: 1000,
            elapsed_ms: 61_000,
            relative_standard_error: Some(0.0123),
            error_passes: 512,
            workers: vec![worker],
            engine: EngineKind::Gpu.identity(),
            unable: vec![wire::Unable {
                name: "desk".into(),
                reason: "no card".into(),
                times: 2,
            }],
            ..wire::StatusReply::default()
        };
        let report = Report::from(reply);
        let text = report.text();
        assert!(text.contains("999 of 1000 (99.9 %)"), "{text}");
        assert!(text.contains("1.23 % after 512 passes"), "{text}");
        assert!(text.contains("1m 1s") && text.contains("2.00"), "{text}");
        assert!(!text.contains('\u{1b}') && !text.contains("ends in"), "{text}");
        assert!(text.contains("01234567  working"), "{text}");
        assert!(text.contains("engine    gpu 8\n"), "{text}");
        assert!(text.contains("Card, discrete, 1.5 GiB"), "{text}");
        assert!(text.contains("desk cannot serve this job: no card"), "{text}");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["state"], "running");
        assert_eq!(json["workers"][0]["last_seen"], 1.5);
        assert_eq!(json["workers"][0]["device"]["memory"], 3 << 29);
        assert_eq!(json["unable"][0]["times"], 2);
        assert!(json["remaining"].is_null());
    }
}
