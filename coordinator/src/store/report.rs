//! report.json: how a job stands.

use super::description::FORMAT;
use serde::Serialize;

/// Why no more passes were taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// All passes are there.
    Complete,
    /// The error is small enough.
    TargetError,
    /// The time was over.
    Time,
    /// Someone asked for it, by a signal or a call.
    Asked,
    /// A pass could not be rendered, or something that had to keep running did not.
    Failed,
}

impl Stopped {
    /// One word, as in report.json.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::TargetError => "target-error",
            Self::Time => "time",
            Self::Asked => "asked",
            Self::Failed => "failed",
        }
    }
}

/// How a job stands when its coordinator ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of the format.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Hash of the scene bundle.
    pub scene: String,
    /// Seed of the whole job.
    pub seed: u64,
    /// First pass of the image, or of the part that this job is.
    pub first_pass: u64,
    /// The passes before this one are complete, from the first on: those of the image.
    pub prefix: u64,
    /// Passes that are there, with those beyond a gap or beyond the image.
    pub passes: u64,
    /// Passes that were asked for; `None`: no limit.
    pub limit: Option<u64>,
    /// Names the passes of the image, as its attribute beamfarmPassSet does.
    pub pass_set: Option<String>,
    /// The image.
    pub image: Option<String>,
    /// Hash of its pixels.
    pub pixels: Option<String>,
    /// Estimated relative standard error of the image.
    pub relative_standard_error: Option<f64>,
    /// The same at its percentiles 50, 90, 95, 99 of blocks of 8 x 8 pixels.
    pub percentiles: Option<[f64; 4]>,
    /// Estimated bias, in words.
    pub bias: Option<String>,
    /// Time that the job has taken, over all its coordinators.
    pub seconds: f64,
    /// Workers that this coordinator has seen.
    pub workers: Vec<String>,
    /// Why no more passes were taken.
    pub stopped: Stopped,
}

impl Report {
    /// The version of the format that there is.
    pub const FORMAT: u32 = FORMAT;

    pub(super) fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut json = serde_json::to_vec_pretty(self)?;
        json.push(b'\n');
        Ok(json)
    }
}
