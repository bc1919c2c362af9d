//! Scene settings that a run overrides.

use crate::failure::Failure;
use beamfarm_image::job::{EngineKind, JobSettings, ScheduleKind};
use beamfarm_render::cpu::pass::Cpu;
use beamfarm_render::plan::pilot::{Choice, Question};
use beamfarm_render::world::SceneDescription;
use beamfarm_scene::{ImportOptions, SceneFile};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What stands in place of the scene's own settings.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Overrides {
    /// Photon paths that each pass emits [default: the scene's]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Sampling")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paths: Option<u32>,

    /// How quickly radii shrink, between 0 and 1 [default: the scene's]
    #[arg(long, value_name = "A", help_heading = "Sampling")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,

    /// Fixed base radius of beams and photons, scene units [default: the scene's, or photon differentials]
    #[arg(long, value_name = "R", help_heading = "Sampling")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,

    /// Shrink radii once a `pass` or once a `beam` [default: the scene's]
    #[arg(long, value_name = "KIND", value_parser = schedule, help_heading = "Sampling")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub schedule: Option<ScheduleKind>,

    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "S", help_heading = "Sampling")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,

    /// Rendering threads [default: one per core]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<u16>,

    /// Width in pixels [default: the scene's]
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..=MAX_SIDE), help_heading = "Image")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<u32>,

    /// Height in pixels [default: the scene's]
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u32).range(1..=MAX_SIDE), help_heading = "Image")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<u32>,

    /// What renders the passes: cpu, or gpu for a device with Vulkan [default: the scene's, or cpu]
    #[arg(long, value_name = "cpu|gpu", value_parser = str::parse::<EngineKind>, help_heading = "Device")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine: Option<EngineKind>,

    /// Device of the engine gpu, by number or part of its name [default: the best]
    ///
    /// `beamfarm devices` lists them.
    #[arg(long, value_name = "N|NAME", help_heading = "Device")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gpu: Option<String>,
}

/// The largest image side in pixels.
const MAX_SIDE: i64 = 1 << 14;

fn schedule(text: &str) -> Result<ScheduleKind, String> {
    match text {
        "pass" => Ok(ScheduleKind::Pass),
        "beam" => Ok(ScheduleKind::Beam),
        _ => Err("expected pass or beam".into()),
    }
}

impl Overrides {
    /// These settings, completed by others.
    pub fn or(&self, other: &Self) -> Self {
        Self {
            paths: self.paths.or(other.paths),
            alpha: self.alpha.or(other.alpha),
            radius: self.radius.or(other.radius),
            schedule: self.schedule.or(other.schedule),
            seed: self.seed.or(other.seed),
            threads: self.threads.or(other.threads),
            width: self.width.or(other.width),
            height: self.height.or(other.height),
            engine: self.engine.or(other.engine),
            gpu: self.gpu.clone().or_else(|| other.gpu.clone()),
        }
    }

    /// Override the scene's settings. Returns the settings of the passes, without what a pilot chooses.
    pub fn apply(&self, description: &mut SceneDescription) -> Result<JobSettings, String> {
        let defaults = &mut description.defaults;
        let settings = JobSettings {
            seed: self.seed.unwrap_or(defaults.seed),
            alpha: self.alpha.unwrap_or(defaults.alpha),
            schedule: self.schedule.unwrap_or(defaults.schedule),
            ..defaults.job_settings()
        };
        settings.check().map_err(|error| error.to_string())?;
        if let Some(radius) = self.radius {
            if !(radius > 0.0 && radius.is_finite()) {
                return Err(format!("radius is {radius}; expected a positive length"));
            }
            defaults.radius = Some(radius);
        }
        for (name, side) in [("width", self.width), ("height", self.height)] {
            if side.is_some_and(|side| !(1..=MAX_SIDE).contains(&i64::from(side))) {
                return Err(format!("{name} is out of range; expected 1 to {MAX_SIDE} pixels"));
            }
        }
        if self.threads == Some(0) {
            return Err("threads is 0; expected at least 1".into());
        }
        let camera = &mut description.camera;
        camera.width = self.width.unwrap_or(camera.width);
        camera.height = self.height.unwrap_or(camera.height);
        let paths = self.paths.or(description.defaults.paths_per_pass);
        let engine = self.engine.or(description.defaults.engine.said()).unwrap_or_default();
        Ok(JobSettings {
            paths_per_pass: paths.unwrap_or(settings.paths_per_pass),
            engine,
            ..settings
        })
    }
}

/// Add the pilot's choice for what neither the scene nor the overrides set.
pub fn chosen(description: &SceneDescription, settings: JobSettings, overrides: &Overrides) -> JobSettings {
    let paths = overrides.paths.or(description.defaults.paths_per_pass);
    let choice = Choice::new(&Cpu, description, Question::new(settings, paths));
    choice.map_or(settings, |choice| choice.settings())
}

/// Read a scene as it will be rendered.
pub fn load(scene: &Path, overrides: &Overrides) -> Result<(SceneDescription, JobSettings), Failure> {
    let file = SceneFile::read(scene, &ImportOptions::default())?;
    let mut description = file.load()?;
    let settings = overrides
        .apply(&mut description)
        .map_err(|message| Failure::usage(format!("{}: {message}", scene.display())))?;
    Ok((description, settings))
}
