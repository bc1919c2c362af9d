//! A scene and the settings of its passes.

use super::wait::{State, wait_for};
use super::{Failure, memory, wait};
use crate::aov::Aov;
use crate::loaded::{Choosing, Loaded};
use crate::settings::{Budgeted, SceneArgs, SettingsArgs};
use beamfarm_image::job::EngineChoice;
use beamfarm_scene::{SceneFile, SceneText};
use beamfarm_worker::engine::Where;
use clap::ValueEnum;
use std::sync::Arc;

/// A scene and the settings of its passes. A missing setting comes from the scene or a pilot.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// The scene.
    pub scene: Arc<SceneText>,
    /// Layers, named as for `--aov`.
    pub layers: Vec<String>,
    /// Photon paths per pass.
    pub paths: Option<u32>,
    /// Seed of all random numbers.
    pub seed: Option<u64>,
    /// How quickly radii shrink, between 0 and 1.
    pub alpha: Option<f64>,
    /// The number of passes that radii are optimised for.
    pub budget: Option<u64>,
    /// `cpu`, `gpu` or `auto`.
    pub engine: Option<String>,
    /// Device of the engine gpu: its number or part of its name.
    pub gpu: Option<String>,
    /// Threads for rendering and preparation; `None`: one per core.
    pub threads: Option<usize>,
}

/// Messages about a scene.
#[derive(Clone, Debug, Default)]
pub struct Notes {
    /// Possible mistakes in the scene, and what a pilot chose.
    pub notes: Vec<String>,
    /// Unsupported parts that were left out.
    pub left_out: Vec<String>,
}

impl Notes {
    pub(super) fn of(loaded: &Loaded) -> Self {
        let (notes, left_out) = loaded.news();
        Self {
            notes: notes.to_vec(),
            left_out: left_out.to_vec(),
        }
    }
}

impl Asked {
    /// The equivalent command-line settings.
    pub(super) fn settings(&self) -> Result<SettingsArgs, Failure> {
        let layer = |name: &String| {
            Aov::from_str(name, false).map_err(|_| {
                let names = Aov::value_variants().iter().filter_map(ValueEnum::to_possible_value);
                let names: Vec<String> = names.map(|value| value.get_name().to_owned()).collect();
                Failure::usage(format!(
                    "there is no layer {name:?}: expected one of {}",
                    names.join(", ")
                ))
            })
        };
        let engine = self.engine.as_deref().map(str::parse::<EngineChoice>).transpose();
        Ok(SettingsArgs {
            of: SceneArgs {
                scene: self.scene.path.clone(),
                paths: self.paths,
                seed: self.seed,
                alpha: self.alpha,
                text: Some(self.scene.clone()),
                ..SceneArgs::default()
            },
            budget: self.budget.map(Budgeted::Passes),
            aov: self.layers.iter().map(layer).collect::<Result<_, _>>()?,
            engine: engine.map_err(Failure::usage)?,
            device: Some(Where::Here(self.gpu.clone().unwrap_or_default())),
            measures: true,
            silent: true,
        })
    }

    /// Read the scene and choose missing settings as `choosing` says.
    pub(super) fn load(
        &self,
        settings: SettingsArgs,
        choosing: Choosing,
        tell: &mut dyn FnMut(State) -> bool,
    ) -> Result<Loaded, Failure> {
        let pool = wait::pool(self.threads)?;
        let load = move || pool.install(|| settings.load_by(SceneFile::load, |_| choosing, |_| ()));
        let loaded = wait_for(load, &mut || tell(State::Preparing))?;
        let camera = &loaded.description.camera;
        memory::check(camera.width, camera.height, loaded.layers.len())?;
        Ok(loaded)
    }
}
