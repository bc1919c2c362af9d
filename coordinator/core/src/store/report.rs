//! report.json: how a job stands.

use super::description::FORMAT;
use beamfarm_image::bias::{Bias, Channel, PartBias};
use beamfarm_image::merge::Fireflies;
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
    /// Engine of the passes, with the version of its bits.
    pub engine: String,
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
    /// Whether the errors are too large on average: there are not two replications of passes yet.
    pub is_upper_error: bool,
    /// The same at its percentiles 50, 90, 95, 99 of blocks of 8 x 8 pixels.
    pub percentiles: Option<[f64; 4]>,
    /// Median of the relative standard errors of blocks of 8 x 8 pixels that are not black.
    pub median_error: Option<f64>,
    /// Few pixels that hold most of the error, if there are such.
    pub fireflies: Option<FirefliesReport>,
    /// Estimated bias, in words.
    pub bias: Option<String>,
    /// The same in numbers; `None` when nothing is known.
    pub bias_estimate: Option<BiasReport>,
    /// Time that the job has taken, over all its coordinators.
    pub seconds: f64,
    /// Passes of which two workers found the same pixels, of those that are there.
    pub confirmed_passes: u64,
    /// Workers that this coordinator has seen.
    pub workers: Vec<String>,
    /// Why no more passes were taken.
    pub stopped: Stopped,
}

/// Few pixels that hold most of the error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirefliesReport {
    /// How many.
    pub pixels: usize,
    /// Their part of the error, as a sum of squares.
    pub share: f64,
    /// Column and row of the worst.
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
    /// The channel whose bias is the clearest; `None`: the mean of all.
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

/// Estimated bias, as far as the kernels' radii are its cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BiasReport {
    /// Of the image as a whole, whether or not it is more than noise.
    pub image: PartBiasReport,
    /// The least bias of the image's mean that is found almost always, relative to it.
    pub least_seen: f64,
    /// Number of tiles of 32 x 32 pixels.
    pub tiles: usize,
    /// Those that are biased, the worst first.
    pub biased: Vec<PartBiasReport>,
    /// Number of those of which nothing is known: a bias as large as the standard error of a pixel would not be seen.
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
    /// The version of the format that there is.
    pub const FORMAT: u32 = FORMAT;

    pub(super) fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut json = serde_json::to_vec_pretty(self)?;
        json.push(b'\n');
        Ok(json)
    }
}
