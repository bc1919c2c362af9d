//! Workers as shown to others.

use super::Ledger;
use super::standing::Worker;
use beamfarm_image::job::Block;
use beamfarm_proto::{Device, Fingerprint, LeaseId, WorkerId};
use std::collections::BTreeMap;
use std::time::Duration;

/// The most present and gone workers that are listed.
const PRESENT_SHOWN: usize = 4096;
const GONE_SHOWN: usize = 200;

/// A worker as shown to others.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerView {
    /// Its number.
    pub id: WorkerId,
    /// Its name for itself, such as the machine's name. Comes from outside.
    pub name: String,
    /// The fingerprint of its key; `None`: known only by name from an earlier run of the job.
    pub key: Option<Fingerprint>,
    /// Rendering threads.
    pub threads: u32,
    /// Its device; `None`: processors.
    pub device: Option<Device>,
    /// Passes of it that count.
    pub passes: u64,
    /// Seconds per pass, averaged over the last few; `None` before the first.
    pub seconds_per_pass: Option<f64>,
    /// Time since its last sign of life.
    pub last_seen: Duration,
    /// Blocks of it that another worker confirmed.
    pub audits_passed: u64,
    /// Blocks of it that others rendered with different bits.
    pub audits_failed: u64,
    /// Its current state.
    pub state: WorkerState,
    /// The oldest block that it holds, and how many of its passes are rendered.
    pub rendering: Option<(Block, u64)>,
}

/// What a worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkerState {
    /// It holds leases.
    Working,
    /// It is present and waits.
    Idle,
    /// It waits because its last attempts failed or never arrived.
    BackingOff,
    /// It signed off, or its connection broke.
    Gone,
    /// It gets nothing more because it sent wrong pixels or nothing but failures.
    ShutOut,
}

impl WorkerState {
    /// One or two words, for display.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Working => "working",
            Self::Idle => "idle",
            Self::BackingOff => "backing off",
            Self::Gone => "gone",
            Self::ShutOut => "shut out",
        }
    }
}

impl Ledger {
    /// Present workers, and those that left most recently; the newest if there are too many.
    pub fn views(&self, now: Duration) -> Vec<WorkerView> {
        let mut held: BTreeMap<WorkerId, (Block, u64)> = BTreeMap::new();
        for LeaseId(place) in &self.active {
            let lease = &self.leases[*place as usize];
            held.entry(lease.worker).or_insert((lease.block, lease.rendered));
        }
        let view = |(id, worker): (&WorkerId, &Worker)| WorkerView {
            id: *id,
            name: worker.who.name.clone(),
            key: worker.who.key,
            threads: worker.threads,
            device: worker.device.clone(),
            passes: worker.passes,
            seconds_per_pass: worker.seconds_per_pass,
            last_seen: now.saturating_sub(worker.last_seen),
            audits_passed: worker.audits_passed,
            audits_failed: worker.audits_failed,
            state: match worker {
                _ if worker.shut_out.is_some() => WorkerState::ShutOut,
                _ if !worker.is_present(&self.rules, now) => WorkerState::Gone,
                _ if worker.not_before > now => WorkerState::BackingOff,
                _ if held.contains_key(id) => WorkerState::Working,
                _ => WorkerState::Idle,
            },
            rendering: held.get(id).copied(),
        };
        let mut views: Vec<WorkerView> = Vec::new();
        let (mut present, mut gone) = (0, 0);
        for worker in self.workers.iter().rev() {
            let (count, most) = match worker.1.is_present(&self.rules, now) {
                true => (&mut present, PRESENT_SHOWN),
                false => (&mut gone, GONE_SHOWN),
            };
            *count += 1;
            if *count <= most {
                views.push(view(worker));
            }
        }
        views.reverse();
        views
    }
}
