//! A job, from the command line: its settings, when it ends, and where its image goes.

use crate::aov::Aov;
use crate::failure::Failure;
use crate::frame_list::FrameArgs;
use crate::import::share;
use crate::loaded::{Choosing, Loaded};
use crate::onlookers::OnlookerArgs;
use crate::output::{Output, job_beside};
use crate::settings::SettingsArgs;
use crate::view_args::ViewArgs;
use beamfarm_coordinator::store::Folder;
use beamfarm_coordinator::{JobSpec, Target};
use beamfarm_image::job::{MAX_PASSES, SceneHash, Targeting};
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// A job: its settings, when it ends, and where its image goes.
#[derive(Args, Clone, Debug)]
pub struct JobArgs {
    #[command(flatten)]
    pub settings: SettingsArgs,

    /// Where to write the image: OUT.exr, with OUT.png and OUT.csv beside it
    ///
    /// With --frames a run of # in the name stands for the frame's number, as in frame.####.exr. [default: the scene's
    /// name, in the current folder; FOLDER-NAME.exr where the scene of another folder has that]
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    pub output: Option<PathBuf>,

    /// Number of passes [default: the scene's, or no limit with --time or --target-error]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_PASSES))]
    #[arg(help_heading = "Stopping")]
    pub passes: Option<u64>,

    /// Stop after this time: 60s, 5m, 1h30m
    ///
    /// The image is that of the passes which are complete by then.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, help_heading = "Stopping")]
    pub time: Option<Duration>,

    /// Stop when the image's relative standard error is at most this: 1%, or 0.01
    ///
    /// The error is tested after 2, 3, 4, 6, 8, 12, ... passes, and passes beyond the test that it meets are left out:
    /// the same scene and seed stop at the same pass on any machines.
    #[arg(long, value_name = "E", value_parser = target_error, help_heading = "Stopping")]
    pub target_error: Option<f64>,

    /// Percentage of 8 x 8 pixel blocks that must meet --target-error [default: the whole image]
    ///
    /// Each block must meet it by itself.
    #[arg(long, value_name = "P", requires = "target_error", value_parser = clap::value_parser!(u32).range(1..=100))]
    #[arg(help_heading = "Stopping")]
    pub target_percentile: Option<u32>,

    /// Folder that keeps what the job needs to resume [default: OUT.job beside OUT.exr]
    ///
    /// `render` uses the default folder only if it is there.
    #[arg(long, value_name = "DIR", help_heading = "Resuming")]
    pub job: Option<PathBuf>,

    /// Fail unless the job folder is there
    #[arg(long, help_heading = "Resuming")]
    pub resume: bool,

    /// Start anew if the job folder has passes of another scene or of other settings
    ///
    /// The image stays until there is a new one.
    #[arg(long, conflicts_with = "resume", help_heading = "Resuming")]
    pub restart: bool,

    /// Exit with 75 instead of 0 when a signal ends the job early
    ///
    /// For schedulers that restart whatever failed: after SIGTERM or SIGINT the next start goes on from the job folder.
    #[arg(long, help_heading = "Resuming")]
    pub preemptible: bool,

    /// Render only passes K to N - 1, for `beamfarm merge`
    #[arg(
        long,
        value_name = "K",
        default_value_t = 0,
        hide_default_value = true,
        help_heading = "Stopping"
    )]
    pub first_pass: u64,

    /// Write a denoised picture as well: OUT.denoised.exr and .png
    ///
    /// It is biased, and stands beside the image, never in its place. The layers that it needs are rendered, as by
    /// `--aov odd,albedo,normal,depth`.
    #[arg(long, help_heading = "Output")]
    pub denoise: bool,

    #[command(flatten)]
    pub view: ViewArgs,

    /// Print nothing but errors
    #[arg(short, long, help_heading = "Output")]
    pub quiet: bool,

    /// Write a coarse picture there, EXR, before anything else is tried, for programs that start this one
    #[arg(long, value_name = "OUT.exr", hide = true)]
    pub sketch: Option<PathBuf>,

    #[command(flatten)]
    pub onlookers: OnlookerArgs,

    #[command(flatten)]
    pub frames: FrameArgs,
}

/// A share of one: with a percent sign, or below one.
fn target_error(text: &str) -> Result<f64, String> {
    match share(text) {
        Ok(number) if number > 0.0 && number < 1.0 => Ok(number),
        _ => Err("expected a percentage as in 1%, or a fraction as in 0.01".into()),
    }
}

impl JobArgs {
    /// The same, with the layers that other options imply.
    pub fn with_implied_layers(mut self) -> Self {
        if self.denoise {
            self.settings.aov.extend(Aov::DENOISING);
        }
        self
    }

    /// When the image is good enough.
    pub fn target(&self) -> Option<Target> {
        let percentile = self.target_percentile;
        self.target_error.map(|error| Target { error, percentile })
    }

    /// How missing settings are chosen: for a resumed job, as when it began. `ending`: suffix of the default image
    /// name.
    pub fn choosing(&self, ending: &str, scene: SceneHash) -> Choosing {
        let image = Output::path(self.output.as_deref(), &self.settings.of.scene, ending);
        let folder = match (&self.job, image) {
            (Some(folder), _) => folder.clone(),
            (None, Ok(image)) => job_beside(&image),
            // Reported when it is needed.
            (None, Err(_)) => return Choosing::By(self.time),
        };
        let before = (!self.restart).then(|| Folder::settings(&folder, scene)).flatten();
        before.map_or(Choosing::By(self.time), Choosing::Again)
    }

    /// The image's path and metadata.
    pub fn image(&self, loaded: &Loaded) -> Result<Output, Failure> {
        self.image_called("", loaded)
    }

    /// The same. `ending`: suffix of the default image name.
    pub fn image_called(&self, ending: &str, loaded: &Loaded) -> Result<Output, Failure> {
        let output = self.output.as_deref();
        Ok(Output {
            drops_photons: loaded.defaults.targeting == Targeting::Reject,
            names: loaded.description.names(),
            sketch: loaded.sketch.clone(),
            empty_depth: loaded.defaults.empty_depth,
            denoise: self.denoise,
            ..Output::new(output, &self.settings.of.scene, ending, loaded.standard_error)?
        })
    }

    /// The job for the coordinator.
    pub fn spec(&self, loaded: Loaded) -> Result<JobSpec, Failure> {
        let has_other_end = self.time.is_some() || self.target_error.is_some();
        let passes = loaded.number_of_passes(self.passes, has_other_end);
        if self.first_pass >= passes {
            return Err(Failure::usage(format!(
                "--first-pass {}: expected less than the number of passes, {passes}",
                self.first_pass
            )));
        }
        if self.first_pass > 0 && self.target_error.is_some() {
            let message = "--target-error: the error of passes that do not begin with 0 is not known";
            return Err(Failure::usage(message));
        }
        Ok(loaded.into_spec(self.first_pass, passes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn target_errors_are_shares_of_one() {
        for (text, expected) in [("1%", 0.01), ("0.5 %", 0.005), ("0.02", 0.02), ("99%", 0.99)] {
            assert_eq!(target_error(text), Ok(expected), "{text}");
        }
        for text in ["", "%", "1", "2", "0", "0%", "100%", "-1%", "nan", "inf%", "1%%"] {
            assert!(target_error(text).is_err(), "{text}");
        }
    }
}
