//! Workers as others see them.

use super::Ledger;
use super::standing::Worker;
use beamfarm_image::job::Block;
use beamfarm_proto::{Device, Fingerprint, LeaseId, WorkerId};
use std::collections::BTreeMap;
use std::time::Duration;

/// Workers that are there, and those that are gone, of those that are shown.
const PRESENT_SHOWN: usize = 4096;
const GONE_SHOWN: usize = 200;

/// A worker as others see it.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerView {
    /// Its number.
    pub id: WorkerId,
    /// What it calls itself: the machine, say. Comes from outside.
    pub name: String,
    /// What it is known by; `None`: an earlier life of the job knew of none.
    pub key: Option<Fingerprint>,
    /// Rendering threads.
    pub threads: u32,
    /// What it renders on, unless processors do.
    pub device: Option<Device>,
    /// Passes of it that count.
    pub passes: u64,
    /// Time that it takes for a pass, averaged over the last few; `None` before the first.
    pub seconds_per_pass: Option<f64>,
    /// Time since its last sign of life.
    pub last_seen: Duration,
    /// Blocks of it that another worker rendered again with the same bits.
    pub audits_passed: u64,
    /// Blocks of it that others rendered with other bits.
    pub audits_failed: u64,
    /// What it is at.
    pub state: WorkerState,
    /// The block that it was given first of those that it holds, and how many passes of it are rendered.
    pub rendering: Option<(Block, u64)>,
}

/// What a worker is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkerState {
    /// Holds leases.
    Working,
    /// Is there and waits.
    Idle,
    /// Waits because its last attempts failed, or never came.
    BackingOff,
    /// Signed off, or its connection broke.
    Gone,
    /// Gets nothing any more: it sent wrong pixels, or nothing but failures.
    ShutOut,
}

impl WorkerState {
    /// One or two words, for people.
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
    /// The workers that are there, and those that were here last: of too many the newest.
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
