//! The messages of a live view as domain types.

use crate::domain::Manifest;
use beamfarm_image::job::JobSettings;
use prost::bytes::Bytes;
use std::fmt;

/// Number of a scene revision; it only grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RevisionNumber(pub u64);

impl fmt::Display for RevisionNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "revision {}", self.0)
    }
}

/// A task's number at one coordinator; it only grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TaskNumber(pub u64);

/// The state of a scene between two changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Revision {
    /// Its number.
    pub number: RevisionNumber,
    /// Its files, including the scene file.
    pub manifest: Manifest,
    /// The scene file's bytes.
    pub text: Bytes,
}

/// What a worker renders next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Its number.
    pub number: TaskNumber,
    /// The revision to render.
    pub revision: RevisionNumber,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// How to render it.
    pub work: Work,
}

/// How an image is rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Work {
    /// Quickly, for preview.
    Sketch {
        /// Only the seed, the number of photon paths and the techniques matter here.
        settings: JobSettings,
        /// Index that selects the random numbers.
        index: u64,
        /// The world point at the origin of render space.
        origin: [f64; 3],
    },
    /// Exactly, as a pass of a job.
    Pass {
        /// The job's settings.
        settings: JobSettings,
        /// The pass.
        pass_index: u64,
    },
}
