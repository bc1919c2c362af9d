//! What is known about a worker.

use super::{PixelHash, Rules};
use beamfarm_proto::{Device, Fingerprint};
use std::time::Duration;

/// The longest wait, as a multiple of [`Rules::back_off`] after failures, or of [`Rules::lease`] after expired leases.
const LONGEST_BACK_OFF: u32 = 64;
/// Weight of the last block in a worker's seconds per pass.
const RECENT: f64 = 0.3;

/// Why a worker is shut out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Sentence {
    /// It repeatedly sent what is no block of this job.
    #[error("it sent wrong results too often")]
    Refusals,
    /// It failed repeatedly, with no success in between.
    #[error("too many of its attempts in a row failed")]
    Failures,
    /// Others rendered one of its blocks with different bits.
    #[error("it delivered other pixels than two other workers did")]
    WrongPixels,
    /// It delivered the same block twice, with different bits.
    #[error("it delivered different pixels for the same passes")]
    Contradiction,
    /// Proven workers compute other bits.
    #[error("its test picture differs from that of other workers: it computes other bits")]
    Canary,
    /// It was convicted before it came back with the same key.
    #[error("a worker with its key delivered wrong pixels")]
    Key,
}

impl Sentence {
    /// Whether the owner of the key stays shut out until the end of the job, across coordinators.
    pub fn is_conviction(self) -> bool {
        matches!(self, Self::WrongPixels | Self::Contradiction)
    }
}

/// How alike the devices of two workers are. The less alike, the less likely they make the same error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Likeness {
    /// Different drivers, such as from different makers.
    OtherDriver,
    /// Different kinds of device, same driver.
    OtherKind,
    /// The same kind of device, or processors.
    Alike,
}

/// The identity of a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Who {
    /// Its name for itself. For people; anybody can use any name.
    pub name: String,
    /// The fingerprint of its key. `None`: the job is older than keys, and only the name identifies the worker.
    pub key: Option<Fingerprint>,
}

impl Who {
    /// What identifies it.
    pub fn known_by(&self) -> KnownBy {
        match self.key {
            Some(key) => KnownBy::Key(key),
            None => KnownBy::Name(self.name.clone()),
        }
    }
}

impl From<&str> for Who {
    /// A worker known only by name.
    fn from(name: &str) -> Self {
        Self {
            name: name.into(),
            key: None,
        }
    }
}

/// What identifies a worker across runs of the job.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum KnownBy {
    /// The fingerprint of its secret.
    Key(Fingerprint),
    /// Its name, if there is nothing else.
    Name(String),
}

/// A worker.
#[derive(Clone, Debug)]
pub(super) struct Worker {
    pub who: Who,
    pub threads: u32,
    /// Its device; `None`: processors.
    pub device: Option<Device>,
    /// Known from an earlier run of the job.
    pub is_earlier: bool,
    /// Hash of its test picture, if any.
    pub canary: Option<PixelHash>,
    pub refusals: u32,
    pub failures_in_a_row: u32,
    /// How many of its leases expired since its last delivery.
    pub late: u32,
    /// It gets nothing before this time.
    pub not_before: Duration,
    pub last_seen: Duration,
    /// Open heartbeat streams.
    pub attending: u32,
    pub gone: bool,
    /// Sent to another job; it may come back.
    pub away: bool,
    pub shut_out: Option<Sentence>,
    /// Passes that count.
    pub passes: u64,
    pub seconds_per_pass: Option<f64>,
    /// How many passes it renders best together.
    pub together: u32,
    pub audits_passed: u64,
    pub audits_failed: u64,
    /// How many of its blocks were checked because they were its first.
    pub tried: u32,
    /// Whether another worker found the same pixels as this one.
    pub is_proven: bool,
}

impl Worker {
    pub fn new(who: Who, threads: u32, now: Duration) -> Self {
        Self {
            who,
            threads,
            device: None,
            is_earlier: false,
            canary: None,
            refusals: 0,
            failures_in_a_row: 0,
            late: 0,
            not_before: Duration::ZERO,
            last_seen: now,
            attending: 0,
            gone: false,
            away: false,
            shut_out: None,
            passes: 0,
            seconds_per_pass: None,
            together: 1,
            audits_passed: 0,
            audits_failed: 0,
            tried: 0,
            is_proven: false,
        }
    }

    /// How alike the devices of two workers are.
    pub fn likeness(&self, other: &Self) -> Likeness {
        match (&self.device, &other.device) {
            (Some(own), Some(other)) if own.driver != other.driver => Likeness::OtherDriver,
            (Some(own), Some(other)) if own.name != other.name => Likeness::OtherKind,
            _ => Likeness::Alike,
        }
    }

    /// Whether it is present and may be given passes.
    pub fn is_present(&self, rules: &Rules, now: Duration) -> bool {
        let seen = self.last_seen + rules.lease > now;
        !self.gone && self.shut_out.is_none() && seen
    }

    /// Whether it is present, or at another job of the coordinator and can be called back.
    pub fn is_at_hand(&self, rules: &Rules, now: Duration) -> bool {
        let seen = self.last_seen + rules.lease > now;
        self.is_present(rules, now) || (self.away && self.shut_out.is_none() && seen)
    }

    /// A worker known from an earlier run of the job that is not present.
    pub fn earlier(who: Who) -> Self {
        Self {
            is_earlier: true,
            gone: true,
            ..Self::new(who, 0, Duration::ZERO)
        }
    }

    pub fn seen(&mut self, now: Duration) {
        self.last_seen = self.last_seen.max(now);
        self.gone = false;
    }

    /// A result arrived.
    pub fn delivered(&mut self, passes: u64, took: Duration) {
        self.failures_in_a_row = 0;
        if std::mem::take(&mut self.late) > 0 {
            self.not_before = Duration::ZERO;
        }
        let last = took.as_secs_f64() / passes as f64;
        let mean = self.seconds_per_pass.unwrap_or(last);
        self.seconds_per_pass = Some(mean + RECENT * (last - mean));
    }

    /// Whether its last attempt did not fail and, where blocks are checked, another worker found the same pixels.
    fn is_believed(&self, rules: &Rules) -> bool {
        self.failures_in_a_row == 0 && (self.is_proven || rules.audit_every == 0)
    }

    /// Whether it is known to render passes.
    pub fn is_able(&self, rules: &Rules) -> bool {
        self.seconds_per_pass.is_some() && self.is_believed(rules)
    }

    /// Whether nothing speaks against it.
    pub fn is_reliable(&self, rules: &Rules) -> bool {
        self.late == 0 && self.is_believed(rules)
    }

    /// Some of its leases expired.
    pub fn is_late(&mut self, rules: &Rules, now: Duration) {
        let doublings = self.late.min(LONGEST_BACK_OFF.ilog2());
        self.late += 1;
        self.not_before = self.not_before.max(now + rules.lease * (1 << doublings));
    }

    /// An attempt failed. Returns whether it was one too many.
    pub fn failed(&mut self, rules: &Rules, now: Duration) -> bool {
        let doublings = self.failures_in_a_row.min(LONGEST_BACK_OFF.ilog2());
        self.failures_in_a_row += 1;
        self.not_before = now + rules.back_off * (1 << doublings);
        self.failures_in_a_row >= rules.failures_per_worker
    }
}
