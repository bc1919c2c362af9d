//! The scene and the settings of its passes, from the command line.

use crate::aov::Aov;
use crate::blame::blamed;
use crate::contest::{self, Contestant};
use crate::failure::Failure;
use crate::frame_list as frames;
use crate::import::{ImportArgs, announce};
use crate::outlook::Outlook;
use crate::progress;
use crate::sketch::Sketch;
use beamfarm_coordinator::JobSpec;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::{EngineChoice, EngineKind, JobSettings, MAX_PASSES, SceneHash, Techniques};
use beamfarm_image::layer::{Layer, MAX_LAYERS};
use beamfarm_image::view::View;
use beamfarm_render::cpu::pass::Cpu;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::budget::Pilot;
use beamfarm_render::plan::pilot::{Choice, Question};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::{RenderDefaults, Scene, SceneDescription};
use beamfarm_scene::{ImportOptions, SceneError, SceneFile, SceneText, is_gltf, is_mitsuba};
use beamfarm_worker::engine::{self, EngineError, Where};
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

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

    /// The settings of a job with this engine, as far as they are given.
    fn said(&self, defaults: &RenderDefaults, engine: EngineKind) -> Result<JobSettings, Failure> {
        let settings = JobSettings {
            seed: self.seed_or(defaults.seed),
            alpha: self.alpha.unwrap_or(defaults.alpha),
            engine,
            ..defaults.job_settings()
        };
        settings.check().map_err(Failure::usage)?;
        let paths = self.paths.or(defaults.paths_per_pass);
        Ok(JobSettings {
            paths_per_pass: paths.unwrap_or(settings.paths_per_pass),
            ..settings
        })
    }

    /// The settings of a job with this engine. Missing ones are chosen as `choosing` says, on the processors.
    pub fn choose(
        &self,
        description: &SceneDescription,
        engine: EngineKind,
        chosen: Choosing,
    ) -> Result<Chosen, Failure> {
        let defaults = description.defaults;
        let settings = self.said(&defaults, engine)?;
        let paths = self.paths.or(defaults.paths_per_pass);
        let time = match chosen {
            Choosing::Nothing => return Ok(Chosen { settings, choice: None }),
            Choosing::Again(before) => {
                let settings = JobSettings {
                    paths_per_pass: paths.unwrap_or(before.paths_per_pass),
                    techniques: before.techniques,
                    ..settings
                };
                return Ok(Chosen { settings, choice: None });
            }
            Choosing::By(time) => time,
        };
        let question = Question { settings, paths, time };
        let choice = Choice::new(&Cpu, description, question);
        let settings = choice.as_ref().map_or(settings, Choice::settings);
        Ok(Chosen { settings, choice })
    }
}

/// The engine of a job.
struct FoundEngine {
    engine: EngineKind,
    /// Its settings, if it was measured.
    chosen: Option<Chosen>,
    /// Why it was chosen, if it was not given.
    note: Option<String>,
}

impl SettingsArgs {
    /// The engine of a job: the given one, that of the job when it began, or the better one.
    fn found(
        &self,
        description: &SceneDescription,
        layers: &[Layer],
        choosing: Choosing,
    ) -> Result<FoundEngine, Failure> {
        let is = |engine, note| FoundEngine {
            engine,
            chosen: None,
            note,
        };
        if let Some(engine) = self.engine.unwrap_or(description.defaults.engine).said() {
            return Ok(is(engine, None));
        }
        let gpu = match (&self.device, choosing) {
            (_, Choosing::Again(before)) => return Ok(is(before.engine, None)),
            (None, _) => return Ok(is(EngineKind::Cpu, None)),
            (Some(Where::Here(gpu)), _) if self.measures => gpu,
            (Some(_), _) => {
                return Err(Failure::usage(
                    "the engine is auto, and only `render` measures which is better: expected --engine cpu or \
                     --engine gpu",
                ));
            }
        };
        let stays = |why: &EngineError| {
            let text = why.to_string();
            let mut lines = text.lines().map(str::trim);
            let first = lines.next().unwrap_or_default();
            let reason = lines
                .next()
                .map_or(first.to_owned(), |reason| format!("{first} {reason}"));
            is(EngineKind::Cpu, Some(format!("engine cpu: {reason}")))
        };
        let gpu = match contest::device(gpu) {
            Ok(gpu) => gpu,
            Err(why) => return Ok(stays(&why)),
        };
        // Known before any pilot: whether the device can render the scene.
        let said = self.of.said(&description.defaults, EngineKind::Gpu)?;
        let place = Where::Here(gpu.clone());
        if let Err(why) = device_takes(description, said, layers, &place)? {
            return Ok(stays(&why));
        }
        let [cpu, own] = [EngineKind::Cpu, EngineKind::Gpu].map(|engine| self.of.choose(description, engine, choosing));
        let (cpu, own) = (cpu?, own?);
        let contestant = |chosen: &Chosen| Contestant {
            description,
            settings: chosen.settings,
            layers,
            gpu: &gpu,
        };
        let result = self.waiting("measuring the engines", || {
            contest::held(&contestant(&cpu), &contestant(&own))
        });
        match result {
            Ok((engine, note)) => Ok(FoundEngine {
                engine,
                chosen: Some(if engine == EngineKind::Cpu { cpu } else { own }),
                note: Some(note),
            }),
            Err(why) => Ok(FoundEngine {
                chosen: Some(cpu),
                ..stays(&why)
            }),
        }
    }

    fn waiting<T>(&self, what: &str, work: impl FnOnce() -> T) -> T {
        match self.silent {
            true => work(),
            false => progress::while_it_lasts(what, work),
        }
    }

    /// Read the scene and, unless `quiet`, print on stderr what is known before its pilot.
    pub fn load(&self, quiet: bool) -> Result<Loaded, Failure> {
        self.load_by(SceneFile::load, |_| Choosing::By(None), |early| early.announce(quiet))
    }

    /// Read the scene and decode its files with `decode`. `choosing`: given the scene's hash, how missing settings are
    /// chosen. `tell` receives what is known before the pilot, which may take long.
    pub fn load_by(
        &self,
        decode: impl FnOnce(&SceneFile) -> Result<SceneDescription, SceneError>,
        choosing: impl FnOnce(SceneHash) -> Choosing,
        tell: impl FnOnce(Early),
    ) -> Result<Loaded, Failure> {
        let file = self.of.file()?;
        let options = self.of.import.options(&self.of.scene)?;
        let what = format!("loading {}", self.of.scene.display());
        let description = self.waiting(&what, || decode(&file));
        let description = description.map_err(|error| self.of.failure(error, &options))?;
        let defaults = description.defaults;
        let Outlook { notes, sketch } = Outlook::new(&description, defaults.job_settings());
        let mut notes: Vec<String> = file
            .notes
            .iter()
            .chain(&description.notes)
            .cloned()
            .chain(notes)
            .collect();
        self.of.import.refuse(&notes)?;
        let outside = file.reach.note();
        notes.extend(outside.map(|note| format!("{}: {note}", self.of.scene.display())));
        let left_out = file.left_out.clone();
        let bundle = file.canonical_bundle();
        let told = notes.len();
        tell(Early {
            notes: notes.clone(),
            sketch: sketch.clone(),
            scene: bundle.hash(),
            view: defaults.view,
        });
        let aovs = Aov::all(&self.aov);
        let layers: Vec<Layer> = aovs.iter().flat_map(|aov| aov.layers(&description)).collect();
        let choosing = choosing(bundle.hash());
        let found = self.found(&description, &layers, choosing)?;
        let engine = found.engine;
        // Before the pilot, which takes time: the device may be unable to render the scene in any case.
        let place = self.device.as_ref().filter(|_| engine == EngineKind::Gpu);
        if let Some(place) = place {
            let said = self.of.said(&defaults, engine)?;
            suits_device(&description, said, &layers, place)?;
        }
        let chosen = found.chosen.map(Ok);
        let chosen = chosen.unwrap_or_else(|| self.of.choose(&description, engine, choosing));
        let Chosen { settings, choice } = chosen?;
        if let Some(place) = place.filter(|_| choice.is_some()) {
            suits_device(&description, settings, &layers, place)?;
        }
        notes.extend(found.note);
        if choice.is_some() {
            let paths = self.of.paths.or(defaults.paths_per_pass);
            notes.extend(found_by_pilot(&settings, paths.is_none()));
        }
        let settings = match self.budget {
            None | Some(Budgeted::Endless) => settings,
            Some(Budgeted::Passes(passes)) => {
                let budget = Pilot::new(&Cpu, &description, settings).budget(passes);
                notes.push(format!(
                    "the pilot chose {:.3} of the base radii for {passes} passes",
                    budget.scale
                ));
                let budget = Some(budget);
                JobSettings { budget, ..settings }
            }
        };
        if layers.len() > MAX_LAYERS {
            return Err(Failure::usage(format!(
                "--aov lights: the scene has so many lights that there would be {} layers; expected at most {MAX_LAYERS}. \
                 Give lights that belong together the same `group`",
                layers.len()
            )));
        }
        if layers.contains(&Layer::Alpha) && shows_environment(&description) {
            notes.push(
                "--aov alpha: R, G and B hold what the camera sees of the environment as well, which a compositor would \
                 add to what it puts behind; without \"camera\" in the light's `visible` they do not"
                    .into(),
            );
        }
        Ok(Loaded {
            layers,
            standard_error: aovs.contains(&Aov::Stderr),
            notes,
            told,
            sketch,
            left_out,
            bundle,
            description,
            defaults,
            settings,
            choice,
        })
    }
}

/// Check that devices can render passes with these settings.
pub fn suits_device(
    description: &SceneDescription,
    settings: JobSettings,
    layers: &[Layer],
    place: &Where,
) -> Result<(), Failure> {
    Ok(device_takes(description, settings, layers, place)??)
}

/// The same; the inner error says why the device cannot.
fn device_takes(
    description: &SceneDescription,
    settings: JobSettings,
    layers: &[Layer],
    place: &Where,
) -> Result<Result<(), EngineError>, Failure> {
    let scene = Scene::new(description.clone());
    let plan = RenderPlan::new(&scene, settings).with_layers(&scene, layers);
    Ok(engine::check(&scene, &plan.map_err(Failure::usage)?, place).map(drop))
}

/// Whether the camera sees an environment light.
fn shows_environment(description: &SceneDescription) -> bool {
    let rules = description.rules.as_ref();
    let hides = |light| rules.is_some_and(|rules| rules.hides_light(rules.camera, light));
    let mut lights = description.lights.iter().enumerate();
    lights.any(|(i, light)| matches!(light.kind, LightKind::Environment(_)) && !hides(i))
}

/// The pilot's choice in words. `chose_paths`: whether it chose the number of paths.
fn found_by_pilot(settings: &JobSettings, chose_paths: bool) -> Option<String> {
    let techniques = (settings.techniques != Techniques::default()).then(|| settings.techniques.to_string());
    let paths = chose_paths.then(|| format!("{} photon paths a pass", settings.paths_per_pass));
    let chosen: Vec<String> = techniques.into_iter().chain(paths).collect();
    (!chosen.is_empty()).then(|| format!("the pilot chose {}", chosen.join(", ")))
}

/// How missing settings are chosen.
#[derive(Clone, Copy, Debug)]
pub enum Choosing {
    /// By a pilot, for a job of this length, if known.
    By(Option<Duration>),
    /// As when the job began.
    Again(JobSettings),
    /// Not at all, as they are unused.
    Nothing,
}

/// The settings of a job.
pub struct Chosen {
    pub settings: JobSettings,
    /// The pilot's candidates, if there was a choice.
    pub choice: Option<Choice>,
}

/// A scene that was read and validated.
pub struct Loaded {
    pub bundle: Bundle,
    pub description: SceneDescription,
    pub defaults: RenderDefaults,
    pub settings: JobSettings,
    /// Requested layers.
    pub layers: Vec<Layer>,
    /// Whether the standard error was requested.
    pub standard_error: bool,
    /// The pilot's candidates, if there was a choice.
    pub choice: Option<Choice>,
    /// Replaced parts of a converted scene, and parts without effect.
    notes: Vec<String>,
    /// How many of these notes were printed before the pilot.
    told: usize,
    /// A coarse picture. `None`: the scene cannot be rendered.
    pub sketch: Option<Sketch>,
    /// Parts of a Mitsuba scene that were left out.
    left_out: Vec<String>,
}

/// What is known of a scene before its pilot.
pub struct Early {
    pub notes: Vec<String>,
    /// A coarse picture. `None`: the scene cannot be rendered.
    pub sketch: Option<Sketch>,
    pub scene: SceneHash,
    /// The scene's display settings.
    pub view: View,
}

impl Early {
    /// Print the notes on stderr.
    pub fn announce(&self, quiet: bool) {
        if !quiet {
            announce(&self.notes, &[]);
        }
    }
}

impl Loaded {
    /// Passes of a job for which `asked` are requested and which may have another stopping condition.
    pub fn number_of_passes(&self, asked: Option<u64>, has_other_end: bool) -> u64 {
        match (asked, has_other_end) {
            (Some(passes), _) => passes,
            (None, true) => MAX_PASSES,
            (None, false) => self.defaults.passes,
        }
    }

    /// The job for a coordinator: passes from `first_pass` to `passes`, exclusive. Without checks by other workers.
    pub fn into_spec(self, first_pass: u64, passes: u64) -> JobSpec {
        let camera = &self.description.camera;
        JobSpec {
            settings: self.settings,
            width: camera.width,
            height: camera.height,
            layers: self.layers,
            first_pass,
            passes,
            audit_every: 0,
            bundle: self.bundle,
        }
    }

    /// Notes, and what was left out.
    pub fn news(&self) -> (&[String], &[String]) {
        (&self.notes, &self.left_out)
    }

    /// Print the remaining notes on stderr. Returns what was left out, for the summary.
    pub fn announce(&self) -> Vec<String> {
        announce(&self.notes[self.told..], &self.left_out);
        self.left_out.clone()
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
