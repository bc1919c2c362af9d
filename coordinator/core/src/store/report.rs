//! report.json: the state of a job.

use super::description::FORMAT;
use beamfarm_image::bias::{Bias, Channel, PartBias};
use beamfarm_image::merge::Fireflies;
use serde::Serialize;

/// Why the job stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// All passes are done.
    Complete,
    /// The error met the target.
    TargetError,
    /// The time limit was reached.
    Time,
    /// Someone stopped it, by a signal or a call.
    Asked,
    /// A pass could not be rendered, or something that had to keep running failed.
    Failed,
}

impl Stopped {
    /// The word used in report.json.
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

/// The state of a job when its coordinator ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of the format.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Hash of the scene bundle.
    pub scene: String,
    /// Engine of the passes, with the version of its bits.
    pub engine: String,
    /// Seed of the whole job.
    pub seed: u64,
    /// First pass of the image, or of this job's part of it.
    pub first_pass: u64,
    /// End of the complete passes, exclusive: the image is made of those before it.
    pub prefix: u64,
    /// Passes that are done, including those beyond a gap or beyond the image.
    pub passes: u64,
    /// Requested passes; `None`: no limit.
    pub limit: Option<u64>,
    /// Identifies the passes of the image, as does its attribute beamfarmPassSet.
    pub pass_set: Option<String>,
    /// Path of the image.
    pub image: Option<String>,
    /// Hash of its pixels.
    pub pixels: Option<String>,
    /// Estimated relative standard error of the image.
    pub relative_standard_error: Option<f64>,
    /// Whether the errors are overestimates: there are fewer than two replications so far.
    pub is_upper_error: bool,
    /// The same at percentiles 50, 90, 95 and 99 of blocks of 8 x 8 pixels.
    pub percentiles: Option<[f64; 4]>,
    /// Median relative standard error of the blocks of 8 x 8 pixels that are not black.
    pub median_error: Option<f64>,
    /// The few pixels that hold most of the error, if any.
    pub fireflies: Option<FirefliesReport>,
    /// Estimated bias, in words.
    pub bias: Option<String>,
    /// The estimated bias in numbers; `None` when unknown.
    pub bias_estimate: Option<BiasReport>,
    /// Time spent on the job, over all its coordinators.
    pub seconds: f64,
    /// Passes for which two workers found the same pixels.
    pub confirmed_passes: u64,
    /// Workers that this coordinator has seen.
    pub workers: Vec<String>,
    /// Why the job stopped.
    pub stopped: Stopped,
}

/// A few pixels that hold most of the error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirefliesReport {
    /// Their number.
    pub pixels: usize,
    /// Their share of the squared error.
    pub share: f64,
    /// Column and row of the worst one.
    pub worst: [u32; 2],
}

impl From<Fireflies> for FirefliesReport {
    fn from(fireflies: Fireflies) -> Self {
        Self {
            pixels: fireflies.pixels,
            share: fireflies.share,
            worst: [fireflies.x, fireflies.y],
        }
    }
}

/// The bias of a part of the image, relative to its mean radiance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartBiasReport {
    /// Column and row of its first pixel.
    pub at: [u32; 2],
    /// The channel with the clearest bias; `None`: the mean of all.
    pub channel: Option<&'static str>,
    /// The bias.
    pub bias: f64,
    /// Its standard error.
    pub standard_error: f64,
}

impl From<&PartBias> for PartBiasReport {
    fn from(part: &PartBias) -> Self {
        let (channel, _) = part.clearest();
        let (bias, standard_error) = part.relative();
        Self {
            at: [part.x, part.y],
            channel: (channel != Channel::Mean).then(|| channel.as_str()),
            bias,
            standard_error,
        }
    }
}

/// The estimated bias, as far as the kernels' radii cause it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BiasReport {
    /// Bias of the whole image, significant or not.
    pub image: PartBiasReport,
    /// The least bias of the image's mean that is almost always detected, relative to the mean.
    pub least_seen: f64,
    /// Number of tiles of 32 x 32 pixels.
    pub tiles: usize,
    /// Biased tiles, the worst first.
    pub biased: Vec<PartBiasReport>,
    /// Number of tiles where nothing is known: a bias as large as a pixel's standard error would not be detected.
    pub not_known: usize,
}

impl BiasReport {
    /// `None` when nothing is known.
    pub fn new(bias: &Bias) -> Option<Self> {
        bias.is_known().then(|| Self {
            image: (&bias.image).into(),
            least_seen: bias.least_seen(),
            tiles: bias.tiles.len(),
            biased: bias.named().into_iter().map(Into::into).collect(),
            not_known: bias.unknown(),
        })
    }
}

impl Report {
    /// The current version of the format.
    pub const FORMAT: u32 = FORMAT;

    pub(super) fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut json = serde_json::to_vec_pretty(self)?;
        json.push(b'\n');
        Ok(json)
    }
}
