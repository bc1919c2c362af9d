//! The scene and the settings of a job, from the command line.

use crate::failure::Failure;
use beamfarm_coordinator::JobSpec;
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::error::SceneError;
use beamfarm_shared::job::{JobSettings, MAX_PASSES};
use beamfarm_shared::scene::{RenderDefaults, SceneDescription, read_bundle};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What passes depend on beside the scene.
#[derive(Args, Clone, Debug)]
pub struct SettingsArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,

    /// Photon paths that each pass emits [default: the scene's]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..))]
    pub paths: Option<u32>,

    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,

    /// How quickly radii shrink, between 0 and 1: small values remove blur sooner, large ones noise [default: the scene's]
    #[arg(long, value_name = "A")]
    pub alpha: Option<f64>,
}

impl SettingsArgs {
    /// Read the scene.
    pub fn load(&self) -> Result<Loaded, Failure> {
        let bundle = read_bundle(&self.scene)?;
        // Its errors name files relative to the scene's folder.
        let folder = self.scene.parent().unwrap_or(Path::new(""));
        let description = SceneDescription::load(&bundle).map_err(|error| SceneError {
            file: folder.join(&error.file),
            ..error
        })?;
        let defaults = description.defaults;
        let settings = JobSettings {
            seed: self.seed.unwrap_or(defaults.seed),
            alpha: self.alpha.unwrap_or(defaults.alpha),
            paths_per_pass: self.paths.unwrap_or(defaults.paths_per_pass),
            ..defaults.job_settings()
        };
        settings.check().map_err(Failure::usage)?;
        Ok(Loaded {
            bundle,
            description,
            defaults,
            settings,
        })
    }
}

/// A scene that was read and found good.
pub struct Loaded {
    pub bundle: Bundle,
    pub description: SceneDescription,
    pub defaults: RenderDefaults,
    pub settings: JobSettings,
}

/// A job: its settings, when it ends, and where its image goes.
#[derive(Args, Clone, Debug)]
pub struct JobArgs {
    #[command(flatten)]
    pub settings: SettingsArgs,

    /// Where to write the image: OUT.exr, with OUT.png beside it [default: the scene's name, in the current folder]
    #[arg(short, long, value_name = "OUT.exr")]
    pub output: Option<PathBuf>,

    /// Number of passes [default: the scene's, or no limit with --time]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_PASSES))]
    pub passes: Option<u64>,

    /// Stop after this time with the passes that are complete by then: 60s, 5m, 1h30m
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub time: Option<Duration>,

    /// Exposure of the PNG in stops: 1 doubles the brightness [default: the scene's]
    #[arg(long, value_name = "EV", allow_negative_numbers = true)]
    pub exposure: Option<f32>,

    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl JobArgs {
    /// Exposure of the PNG, stops.
    pub fn exposure(&self, loaded: &Loaded) -> Result<f32, Failure> {
        let exposure = self.exposure.unwrap_or(loaded.defaults.exposure);
        match exposure.is_finite() {
            true => Ok(exposure),
            false => Err(Failure::usage("--exposure: expected a number of stops")),
        }
    }

    /// What the coordinator is to do.
    pub fn spec(&self, loaded: Loaded) -> JobSpec {
        let camera = &loaded.description.camera;
        let passes = match (self.passes, self.time) {
            (Some(passes), _) => passes,
            (None, Some(_)) => MAX_PASSES,
            (None, None) => loaded.defaults.passes,
        };
        JobSpec {
            settings: loaded.settings,
            width: camera.width,
            height: camera.height,
            passes,
            bundle: loaded.bundle,
        }
    }
}
