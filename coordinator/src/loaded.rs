//! What becomes of the options: the scene is read, its engine found, and what nobody set is chosen by a pilot.

use crate::aov::Aov;
use crate::contest::{self, Contestant};
use crate::failure::Failure;
use crate::import::announce;
use crate::outlook::Outlook;
use crate::progress;
use crate::settings::{Budgeted, SceneArgs, SettingsArgs};
use crate::sketch::Sketch;
use beamfarm_coordinator::JobSpec;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::{EngineKind, JobSettings, MAX_PASSES, SceneHash, Techniques};
use beamfarm_image::layer::{Layer, MAX_LAYERS};
use beamfarm_image::view::View;
use beamfarm_render::cpu::pass::Cpu;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::budget::Pilot;
use beamfarm_render::plan::pilot::{Choice, Question};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::{RenderDefaults, Scene, SceneDescription};
use beamfarm_scene::{SceneError, SceneFile};
use beamfarm_worker::engine::{self, EngineError, Where};
use std::time::Duration;

impl SceneArgs {
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
