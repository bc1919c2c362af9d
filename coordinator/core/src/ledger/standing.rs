//! What is known about a worker.

use super::{PixelHash, Rules};
use beamfarm_proto::{Device, Fingerprint};
use std::time::Duration;

/// A worker waits at most so many times [`Rules::back_off`] after a failure, or [`Rules::lease`] when it is late.
const LONGEST_BACK_OFF: u32 = 64;
/// Part that the last block has in a worker's time per pass.
const RECENT: f64 = 0.3;

/// Why a worker is shut out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Sentence {
    /// What it sent was no block of this job, again and again.
    #[error("it sent wrong results too often")]
    Refusals,
    /// It failed again and again, with no success in between.
    #[error("too many of its attempts in a row failed")]
    Failures,
    /// Others rendered one of its blocks with other bits.
    #[error("it delivered other pixels than two other workers did")]
    WrongPixels,
    /// It delivered the same block twice, with different bits.
    #[error("it delivered different pixels for the same passes")]
    Contradiction,
    /// Proven workers compute other bits.
    #[error("its test picture differs from that of other workers: it computes other bits")]
    Canary,
    /// It did, before it came back.
    #[error("a worker with its key delivered wrong pixels")]
    Key,
}

impl Sentence {
    /// Whether who has the key stays shut out until the end of the job, whatever coordinator it has.
    pub fn is_conviction(self) -> bool {
        matches!(self, Self::WrongPixels | Self::Contradiction)
    }
}

/// How alike what two workers render on is: the less, the less likely are both wrong in the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Likeness {
    /// Other drivers, as of other makers.
    OtherDriver,
    /// Devices of other kinds with one driver.
    OtherKind,
    /// Devices of one kind, or processors.
    Alike,
}

/// Who a worker is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Who {
    /// What it calls itself. For people: anybody may call himself so.
    pub name: String,
    /// What it is known by. `None`: in a job of before there were any, its name has to do.
    pub key: Option<Fingerprint>,
}

impl Who {
    /// What tells it from others.
    pub fn known_by(&self) -> KnownBy {
        match self.key {
            Some(key) => KnownBy::Key(key),
            None => KnownBy::Name(self.name.clone()),
        }
    }
}

impl From<&str> for Who {
    /// Of whom only the name is known.
    fn from(name: &str) -> Self {
        Self {
            name: name.into(),
            key: None,
        }
    }
}

/// What tells workers apart from one life of the job to the next.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum KnownBy {
    /// The fingerprint of its secret.
    Key(Fingerprint),
    /// Its name, where that is all there is.
    Name(String),
}

/// A worker.
#[derive(Clone, Debug)]
pub(super) struct Worker {
    pub who: Who,
    pub threads: u32,
    /// What it renders on, unless processors do.
    pub device: Option<Device>,
    /// An earlier life of the job knew it.
    pub is_earlier: bool,
    /// Hash of its test picture, if there is one.
    pub canary: Option<PixelHash>,
    pub refusals: u32,
    pub failures_in_a_row: u32,
    /// How often leases of it ran out since it last delivered something.
    pub late: u32,
    /// Gets nothing before this time.
    pub not_before: Duration,
    pub last_seen: Duration,
    /// Open streams of heartbeats.
    pub attending: u32,
    pub gone: bool,
    /// It was told that another job has work, and may come back.
    pub away: bool,
    pub shut_out: Option<Sentence>,
    /// Passes that count.
    pub passes: u64,
    pub seconds_per_pass: Option<f64>,
    /// So many passes it renders best together.
    pub together: u32,
    pub audits_passed: u64,
    pub audits_failed: u64,
    /// Blocks of it that were to be checked because they were its first.
    pub tried: u32,
    /// Another worker found the same pixels as this one.
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

    /// How alike their devices are.
    pub fn likeness(&self, other: &Self) -> Likeness {
        match (&self.device, &other.device) {
            (Some(own), Some(other)) if own.driver != other.driver => Likeness::OtherDriver,
            (Some(own), Some(other)) if own.name != other.name => Likeness::OtherKind,
            _ => Likeness::Alike,
        }
    }

    /// There, and to be given passes.
    pub fn is_present(&self, rules: &Rules, now: Duration) -> bool {
        let seen = self.last_seen + rules.lease > now;
        !self.gone && self.shut_out.is_none() && seen
    }

    /// There, or at another job of the same coordinator, from where it can be called back.
    pub fn is_at_hand(&self, rules: &Rules, now: Duration) -> bool {
        let seen = self.last_seen + rules.lease > now;
        self.is_present(rules, now) || (self.away && self.shut_out.is_none() && seen)
    }

    /// One that an earlier life of the job knew, and that is not here.
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

    /// Its last attempt did not fail, and where blocks are checked others found the same pixels.
    fn is_believed(&self, rules: &Rules) -> bool {
        self.failures_in_a_row == 0 && (self.is_proven || rules.audit_every == 0)
    }

    /// Known to render passes.
    pub fn is_able(&self, rules: &Rules) -> bool {
        self.seconds_per_pass.is_some() && self.is_believed(rules)
    }

    /// Nothing speaks against it.
    pub fn is_reliable(&self, rules: &Rules) -> bool {
        self.late == 0 && self.is_believed(rules)
    }

    /// Leases of it ran out.
    pub fn is_late(&mut self, rules: &Rules, now: Duration) {
        let doublings = self.late.min(LONGEST_BACK_OFF.ilog2());
        self.late += 1;
        self.not_before = self.not_before.max(now + rules.lease * (1 << doublings));
    }

    /// An attempt failed. Returns whether that was one too many.
    pub fn failed(&mut self, rules: &Rules, now: Duration) -> bool {
        let doublings = self.failures_in_a_row.min(LONGEST_BACK_OFF.ilog2());
        self.failures_in_a_row += 1;
        self.not_before = now + rules.back_off * (1 << doublings);
        self.failures_in_a_row >= rules.failures_per_worker
    }
}
