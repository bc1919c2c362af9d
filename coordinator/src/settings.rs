//! Which options name a scene, and what its passes depend on? What becomes of them is in `loaded`.

use crate::aov::Aov;
use crate::blame::blamed;
use crate::failure::Failure;
use crate::frame_list as frames;
use crate::import::ImportArgs;
use beamfarm_image::job::{EngineChoice, MAX_PASSES};
use beamfarm_scene::{ImportOptions, SceneError, SceneFile, SceneText, is_gltf, is_mitsuba};
use beamfarm_worker::engine::Where;
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

/// The scene, and what its passes depend on.
#[derive(Args, Clone, Debug, Default)]
pub struct SceneArgs {
    /// Scene file: TOML, Mitsuba 3 (.xml) or glTF (.glb, .gltf)
    pub scene: PathBuf,

    #[command(flatten)]
    pub import: ImportArgs,

    /// Photon paths that each pass emits [default: the scene's, or as many as the pilot finds best]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Sampling")]
    pub paths: Option<u32>,

    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "S", help_heading = "Sampling")]
    pub seed: Option<u64>,

    /// How quickly radii shrink, between 0 and 1 [default: the scene's]
    ///
    /// Small values remove blur sooner, large values remove noise sooner.
    #[arg(long, value_name = "A", help_heading = "Sampling")]
    pub alpha: Option<f64>,

    /// The frame whose number goes into the seed.
    #[arg(skip)]
    pub seed_of_frame: Option<i64>,

    /// The scene itself if it is not in a file; `scene` is then its name.
    #[arg(skip)]
    pub text: Option<Arc<SceneText>>,
}

/// What passes depend on, and what is rendered beside the image.
#[derive(Args, Clone, Debug, Default)]
pub struct SettingsArgs {
    #[command(flatten)]
    pub of: SceneArgs,

    /// Choose radii for the least error after N passes; `inf`: for any number [default: inf]
    ///
    /// A pilot of a few seconds finds the radii; passes beyond N shrink them again. With `inf` radii shrink from the
    /// first pass on, which is right when passes may be added without end.
    #[arg(long, value_name = "N", value_parser = budget, help_heading = "Sampling")]
    pub budget: Option<Budgeted>,

    /// Layers to render into the same EXR, separated by commas
    ///
    /// The option may be repeated.
    #[arg(
        long,
        value_name = "LAYER",
        value_enum,
        value_delimiter = ',',
        help_heading = "Image"
    )]
    pub aov: Vec<Aov>,

    /// What renders the passes: cpu, gpu or auto [default: the scene's, or cpu]
    ///
    /// The engine gpu is a device with Vulkan. Its passes have other bits than those of processors and belong to
    /// another job; `beamfarm explain` says whether it can render a scene. With auto `render` lets both engines render
    /// a few passes, takes the better one and says why.
    #[arg(long, value_name = "ENGINE", help_heading = "Device")]
    pub engine: Option<EngineChoice>,

    /// Where the device of the engine gpu is; `None` if its capabilities do not matter.
    #[arg(skip = Some(Where::Elsewhere))]
    pub device: Option<Where>,

    /// Whether the engine may be chosen by measuring.
    #[arg(skip)]
    pub measures: bool,

    /// Whether to report nothing about long waits.
    #[arg(skip)]
    pub silent: bool,
}

/// Which device renders.
#[derive(Args, Clone, Debug)]
pub struct DeviceArgs {
    /// Device of the engine gpu, by number or part of its name [default: the best]
    ///
    /// `beamfarm devices` lists them.
    #[arg(long, value_name = "N|NAME", help_heading = "Device")]
    pub gpu: Option<String>,
}

impl DeviceArgs {
    /// A device on this machine.
    pub fn here(&self) -> Where {
        Where::Here(self.gpu.clone().unwrap_or_default())
    }
}

/// What `--budget` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Budgeted {
    /// A number of passes.
    Passes(u64),
    /// `inf`.
    Endless,
}

fn budget(text: &str) -> Result<Budgeted, String> {
    match text.parse() {
        Ok(passes @ 1..=MAX_PASSES) => Ok(Budgeted::Passes(passes)),
        _ if text == "inf" => Ok(Budgeted::Endless),
        _ => Err("expected a number of passes, or inf".into()),
    }
}

impl SceneArgs {
    /// The scene's files with the requested changes.
    pub fn file(&self) -> Result<SceneFile, Failure> {
        let options = self.import.options(&self.scene)?;
        let file = match &self.text {
            Some(text) => SceneFile::of_text(text, &options),
            None => SceneFile::read(&self.scene, &options),
        };
        file.map_err(|error| self.failure(error, &options))
    }

    /// Check that the scene can be rendered.
    pub fn check(&self, file: &SceneFile) -> Result<(), Failure> {
        let options = self.import.options(&self.scene)?;
        let loaded = file.load().map_err(|error| self.failure(error, &options))?;
        drop(loaded);
        Ok(())
    }

    /// The error together with all other errors of the scene file.
    pub fn failure(&self, error: SceneError, options: &ImportOptions) -> Failure {
        let is_native = !is_mitsuba(&self.scene) && !is_gltf(&self.scene);
        let errors = match (&self.text, is_native && error.file == self.scene) {
            (Some(text), _) => beamfarm_scene::errors_of_text(text, options),
            (None, true) => beamfarm_scene::errors(&self.scene, options),
            (None, false) => Vec::new(),
        };
        let errors = if errors.is_empty() { vec![error] } else { errors };
        blamed(&self.scene, options, errors, is_native).into()
    }

    /// The same options for the native form of the scene, which contains its parameters' values.
    pub fn of_native(&self) -> Vec<OsString> {
        let mut args: Vec<OsString> = Vec::new();
        let import = &self.import;
        for folder in &import.allow_outside {
            args.extend(["--allow-outside".into(), folder.into()]);
        }
        let mut add = |name: &str, value: Option<String>| {
            args.extend(value.into_iter().flat_map(|value| [name.into(), value.into()]));
        };
        for (name, value) in import.parameters.iter().filter(|_| !is_mitsuba(&self.scene)) {
            add("-D", Some(format!("{name}={value}")));
        }
        add("--scale", import.scale.map(|scale| scale.to_string()));
        add("--width", import.width.map(|width| width.to_string()));
        add("--height", import.height.map(|height| height.to_string()));
        add("--crop", import.crop.map(|[x, y, w, h]| format!("{x},{y},{w},{h}")));
        add("--paths", self.paths.map(|paths| paths.to_string()));
        add("--seed", self.seed.map(|seed| seed.to_string()));
        add("--alpha", self.alpha.map(|alpha| alpha.to_string()));
        args
    }

    /// The job's seed, given the scene's own.
    pub fn seed_or(&self, seed: u64) -> u64 {
        let seed = self.seed.unwrap_or(seed);
        match self.seed_of_frame {
            Some(frame) => frames::seed_of(seed, frame),
            None => seed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_passes_or_without_end() {
        assert_eq!(budget("64"), Ok(Budgeted::Passes(64)));
        assert_eq!(budget("inf"), Ok(Budgeted::Endless));
        for text in ["", "0", "-1", "64.5", "infinity", "9007199254740993"] {
            assert!(budget(text).is_err(), "{text}");
        }
    }
}
