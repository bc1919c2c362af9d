//! What the two sides of a live view exchange.

use crate::domain::Manifest;
use beamfarm_image::job::JobSettings;
use prost::bytes::Bytes;
use std::fmt;

/// Which of the states that a scene went through. Grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RevisionNumber(pub u64);

impl fmt::Display for RevisionNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "revision {}", self.0)
    }
}

/// A task's number at one coordinator. Grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TaskNumber(pub u64);

/// A scene as it is between two changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Revision {
    /// Which.
    pub number: RevisionNumber,
    /// Its files, the scene file among them.
    pub manifest: Manifest,
    /// The scene file itself.
    pub text: Bytes,
}

/// What a worker renders next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Which.
    pub number: TaskNumber,
    /// Of what.
    pub revision: RevisionNumber,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// How.
    pub work: Work,
}

/// How a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Work {
    /// Soon, and like the true one.
    Sketch {
        /// The seed, the number of photon paths and what finds which light count of these.
        settings: JobSettings,
        /// Number of the random numbers.
        index: u64,
        /// The world's point that is the origin of render space.
        origin: [f64; 3],
    },
    /// A pass of a job, to the bit.
    Pass {
        /// The job's.
        settings: JobSettings,
        /// Which.
        pass_index: u64,
    },
}
