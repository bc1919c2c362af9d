//! The scene and the settings of a job, from the command line.

use crate::blame::blamed;
use crate::failure::Failure;
use crate::frame_list::{self as frames, FrameArgs};
use crate::onlookers::OnlookerArgs;
use crate::outlook::Outlook;
use crate::output::Output;
use crate::progress;
use crate::sketch::Sketch;
use crate::view_args::ViewArgs;
use beamfarm_coordinator::{JobSpec, Target};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::Targeting;
use beamfarm_image::job::{JobSettings, MAX_PASSES, SceneHash, Techniques};
use beamfarm_image::layer::{Layer, MAX_LAYERS};
use beamfarm_image::view::View;
use beamfarm_render::cpu::pass::Cpu;
use beamfarm_render::plan::aov::light_layers;
use beamfarm_render::plan::budget::Pilot;
use beamfarm_render::plan::pilot::Choice;
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::{RenderDefaults, SceneDescription};
use beamfarm_scene::{Edits, ImportOptions, SceneError, SceneFile, is_gltf, is_mitsuba};
use beamfarm_worker::complain;
use clap::{Args, ValueEnum};
use std::ffi::OsString;
use std::num::ParseFloatError;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The scene, and what its passes depend on.
#[derive(Args, Clone, Debug)]
pub struct SceneArgs {
    /// Scene file: TOML, Mitsuba 3's XML if its name ends in .xml, or glTF if in .glb or .gltf
    pub scene: PathBuf,

    #[command(flatten)]
    pub import: ImportArgs,

    /// Photon paths that each pass emits [default: the scene's, or as many as a pilot finds best]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..))]
    pub paths: Option<u32>,

    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,

    /// How quickly radii shrink, between 0 and 1: small values remove blur sooner, large ones noise [default: the
    /// scene's]
    #[arg(long, value_name = "A")]
    pub alpha: Option<f64>,

    /// The frame whose number goes into the seed.
    #[arg(skip)]
    pub seed_of_frame: Option<i64>,
}

/// What passes depend on, and what is rendered beside the image.
#[derive(Args, Clone, Debug)]
pub struct SettingsArgs {
    #[command(flatten)]
    pub of: SceneArgs,

    /// Choose radii for the least error after N passes; those beyond shrink again. A pilot of seconds finds them. With
    /// `inf` radii shrink from the first pass on, which is right when passes may be added without end [default: inf]
    #[arg(long, value_name = "N", value_parser = budget)]
    pub budget: Option<Budgeted>,

    /// Layers to render as well, into the same EXR. Repeat it, or separate them by commas
    #[arg(long, value_name = "LAYER", value_enum, value_delimiter = ',')]
    pub aov: Vec<Aov>,
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

/// What `--aov` takes.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
#[value(rename_all = "snake_case")]
pub enum Aov {
    /// A: share of the pixel that surfaces and media cover. R, G, B are premultiplied by nature; an environment that
    /// the camera sees is in them as well
    Alpha,
    /// Z: distance of the first surface along the camera's axis, scene units; where there is none, infinite, or the
    /// scene's `empty_depth`
    Depth,
    /// X, Y, Z: its shading normal, world space
    Normal,
    /// R, G, B: its reflectance
    Albedo,
    /// R, G, B: lights that are seen, and surfaces that are lit straight by lights
    Direct,
    /// R, G, B: all other light of surfaces. The beauty is direct + surface + volume
    Surface,
    /// R, G, B: light that media scatter towards the camera
    Volume,
    /// light_NAME.R, G, B for each group of lights: what comes from it. The beauty is their sum
    Lights,
    /// R, G, B: standard error of the beauty
    Stderr,
    /// u, v: how the first surface moves in the image, pixels a frame, to the right and up. Of files of each frame it
    /// takes an open shutter
    Motion,
    /// Y: photon beams that a pass finds in the pixel
    BeamDensity,
    /// Y: photon targets before the first surface, or on it. Where the scene's targeting is "reject", photons that miss
    /// them are dropped, and the image is biased
    Targets,
    /// R, G, B: what passes of odd index add to the beauty: about half of it, which knows nothing of the noise of the
    /// other half, for `beamfarm denoise`
    Odd,
    /// CryptoObject00 to 02: which objects cover the pixel, by the convention of Cryptomatte
    CryptoObject,
    /// CryptoMaterial00 to 02: which materials do
    CryptoMaterial,
    /// All of them
    All,
}

impl Aov {
    /// What a picture is denoised by.
    const DENOISING: [Self; 4] = [Self::Depth, Self::Normal, Self::Albedo, Self::Odd];

    /// Those that were asked for, each once.
    pub fn all(asked: &[Self]) -> Vec<Self> {
        let wanted = |aov: &Self| asked.contains(aov) || asked.contains(&Self::All);
        let kinds = Self::value_variants().iter().copied();
        kinds.filter(wanted).collect()
    }

    /// What the names of its channels in an image begin with.
    pub fn channels(self) -> &'static str {
        match self {
            Self::Alpha => "A",
            Self::Depth => "depth.",
            Self::Normal => "normal.",
            Self::Albedo => "albedo.",
            Self::Direct => "direct.",
            Self::Surface => "surface.",
            Self::Volume => "volume.",
            Self::Lights => "light_",
            Self::Stderr => "stderr.",
            Self::Motion => "motion.",
            Self::BeamDensity => "beam_density.",
            Self::Targets => "targets.",
            Self::Odd => "odd.",
            Self::CryptoObject => "CryptoObject",
            Self::CryptoMaterial => "CryptoMaterial",
            Self::All => "",
        }
    }

    fn layers(self, description: &SceneDescription) -> Vec<Layer> {
        match self {
            Self::Alpha => vec![Layer::Alpha],
            Self::Depth => vec![Layer::Depth],
            Self::Normal => vec![Layer::Normal],
            Self::Albedo => vec![Layer::Albedo],
            Self::Direct => vec![Layer::Direct],
            Self::Surface => vec![Layer::Surface],
            Self::Volume => vec![Layer::Volume],
            Self::Lights => light_layers(description),
            Self::Motion => vec![Layer::Motion],
            Self::BeamDensity => vec![Layer::BeamDensity],
            Self::Targets => vec![Layer::Targets],
            Self::Odd => vec![Layer::Odd],
            Self::CryptoObject => vec![Layer::Objects],
            Self::CryptoMaterial => vec![Layer::Materials],
            Self::Stderr | Self::All => Vec::new(),
        }
    }
}

impl SceneArgs {
    /// The scene's files, changed as was asked for.
    pub fn file(&self) -> Result<SceneFile, Failure> {
        let options = self.import.options(&self.scene)?;
        SceneFile::read(&self.scene, &options).map_err(|error| self.failure(error, &options))
    }

    /// Whether the scene can be rendered.
    pub fn check(&self, file: &SceneFile) -> Result<(), Failure> {
        let options = self.import.options(&self.scene)?;
        let loaded = file.load().map_err(|error| self.failure(error, &options))?;
        drop(loaded);
        Ok(())
    }

    /// With all else that is wrong with the scene file.
    pub fn failure(&self, error: SceneError, options: &ImportOptions) -> Failure {
        let is_native = !is_mitsuba(&self.scene) && !is_gltf(&self.scene);
        let errors = match !is_native || error.file != self.scene {
            true => Vec::new(),
            false => beamfarm_scene::errors(&self.scene, options),
        };
        let errors = if errors.is_empty() { vec![error] } else { errors };
        blamed(&self.scene, options, errors, is_native).into()
    }

    /// The same options for the scene in its native form, which has the values of its parameters.
    pub fn of_native(&self) -> Vec<OsString> {
        let mut args: Vec<OsString> = Vec::new();
        let mut add = |name: &str, value: Option<String>| {
            args.extend(value.into_iter().flat_map(|value| [name.into(), value.into()]));
        };
        let import = &self.import;
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

    /// The seed of a job of the scene, whose own is this.
    pub fn seed_or(&self, seed: u64) -> u64 {
        let seed = self.seed.unwrap_or(seed);
        match self.seed_of_frame {
            Some(frame) => frames::seed_of(seed, frame),
            None => seed,
        }
    }

    /// The settings of a job of the scene, by a pilot what nobody says.
    pub fn choose(&self, description: &SceneDescription) -> Result<Chosen, Failure> {
        let defaults = description.defaults;
        let settings = JobSettings {
            seed: self.seed_or(defaults.seed),
            alpha: self.alpha.unwrap_or(defaults.alpha),
            ..defaults.job_settings()
        };
        settings.check().map_err(Failure::usage)?;
        let paths = self.paths.or(defaults.paths_per_pass);
        let settings = JobSettings {
            paths_per_pass: paths.unwrap_or(settings.paths_per_pass),
            ..settings
        };
        let choice = Choice::new(&Cpu, description, settings, paths);
        let settings = choice.as_ref().map_or(settings, Choice::settings);
        Ok(Chosen { settings, choice })
    }
}

impl SettingsArgs {
    /// Read the scene, and say on stderr what is known of it before its pilot, unless this is to be `quiet`.
    pub fn load(&self, quiet: bool) -> Result<Loaded, Failure> {
        self.load_by(SceneFile::load, |early| early.announce(quiet))
    }

    /// Read the scene, and decode its files by `decode`. `tell` is given what is known of it before its pilot, which
    /// may take long.
    pub fn load_by(
        &self,
        decode: impl FnOnce(&SceneFile) -> Result<SceneDescription, SceneError>,
        tell: impl FnOnce(Early),
    ) -> Result<Loaded, Failure> {
        let file = self.of.file()?;
        let options = self.of.import.options(&self.of.scene)?;
        let what = format!("loading {}", self.of.scene.display());
        let description = progress::while_it_lasts(&what, || decode(&file));
        let description = description.map_err(|error| self.of.failure(error, &options))?;
        self.of.import.refuse(file.notes.iter().chain(&description.notes))?;
        let defaults = description.defaults;
        let Outlook { notes, sketch } = Outlook::new(&description, defaults.job_settings());
        let notes: Vec<String> = file
            .notes
            .iter()
            .chain(&description.notes)
            .cloned()
            .chain(notes)
            .collect();
        let left_out = file.left_out.clone();
        let bundle = file.canonical_bundle();
        let told = notes.len();
        tell(Early {
            notes: notes.clone(),
            sketch: sketch.clone(),
            scene: bundle.hash(),
            view: defaults.view,
        });
        let Chosen { settings, choice } = self.of.choose(&description)?;
        let mut notes = notes;
        if choice.is_some() {
            let paths = self.of.paths.or(defaults.paths_per_pass);
            notes.extend(found_by_pilot(&settings, paths.is_none()));
        }
        let settings = match self.budget {
            None | Some(Budgeted::Endless) => settings,
            Some(Budgeted::Passes(passes)) => {
                let budget = Pilot::new(&Cpu, &description, settings).budget(passes);
                notes.push(format!(
                    "radii for {passes} passes: {:.3} of the base radii, found by a pilot",
                    budget.scale
                ));
                let budget = Some(budget);
                JobSettings { budget, ..settings }
            }
        };
        let aovs = Aov::all(&self.aov);
        let layers: Vec<Layer> = aovs.iter().flat_map(|aov| aov.layers(&description)).collect();
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

/// Whether the camera sees light from all around.
fn shows_environment(description: &SceneDescription) -> bool {
    let rules = description.rules.as_ref();
    let hides = |light| rules.is_some_and(|rules| rules.hides_light(rules.camera, light));
    let mut lights = description.lights.iter().enumerate();
    lights.any(|(i, light)| matches!(light.kind, LightKind::Environment(_)) && !hides(i))
}

/// What a pilot chose, in words. `chose_paths`: their number as well.
fn found_by_pilot(settings: &JobSettings, chose_paths: bool) -> Option<String> {
    let techniques =
        (settings.techniques != Techniques::default()).then(|| format!("light of {}", settings.techniques));
    let paths = chose_paths.then(|| format!("{} photon paths a pass", settings.paths_per_pass));
    let chosen: Vec<String> = techniques.into_iter().chain(paths).collect();
    (!chosen.is_empty()).then(|| format!("{}, found by a pilot", chosen.join(", ")))
}

/// The settings of a job.
pub struct Chosen {
    pub settings: JobSettings,
    /// What a pilot chose among, if there was anything to choose.
    pub choice: Option<Choice>,
}

/// A scene that was read and found good.
pub struct Loaded {
    pub bundle: Bundle,
    pub description: SceneDescription,
    pub defaults: RenderDefaults,
    pub settings: JobSettings,
    /// Layers that were asked for.
    pub layers: Vec<Layer>,
    /// Whether the standard error was asked for.
    pub standard_error: bool,
    /// What a pilot chose among, if there was anything to choose.
    pub choice: Option<Choice>,
    /// What was replaced of a scene in another form, and what of a scene has no effect.
    notes: Vec<String>,
    /// How many of these were said before there was a pilot.
    told: usize,
    /// The picture, coarse. `None`: it cannot be rendered.
    pub sketch: Option<Sketch>,
    /// What was left out of a Mitsuba scene.
    left_out: Vec<String>,
}

/// What is known of a scene before its pilot.
pub struct Early {
    pub notes: Vec<String>,
    /// The picture, coarse. `None`: it cannot be rendered.
    pub sketch: Option<Sketch>,
    pub scene: SceneHash,
    /// How the scene has itself shown.
    pub view: View,
}

impl Early {
    /// Say on stderr what became of the scene.
    pub fn announce(&self, quiet: bool) {
        if !quiet {
            announce(&self.notes, &[]);
        }
    }
}

impl Loaded {
    /// What became of the scene: notes, and what was left out.
    pub fn news(&self) -> (&[String], &[String]) {
        (&self.notes, &self.left_out)
    }

    /// Say on stderr what else became of the scene. Returns what was left out, for the summary.
    pub fn announce(&self) -> Vec<String> {
        announce(&self.notes[self.told..], &self.left_out);
        self.left_out.clone()
    }
}

/// Say on stderr what became of a Mitsuba scene.
pub fn announce(notes: &[String], left_out: &[String]) {
    for note in notes {
        complain!("note: {note}");
    }
    for part in left_out {
        complain!("left out: {part}");
    }
}

/// The field of a scene that says which frame of it is rendered.
const FRAME: &str = "animation.frame";

/// How a scene is read, and what is changed of it.
#[derive(Args, Clone, Debug)]
pub struct ImportArgs {
    /// Change a field of the scene: -D camera.fov=40, -D lights.0.power=100, -D materials.glass.ior=1.33. Of a Mitsuba
    /// scene: the value of what it writes as $NAME. May be repeated
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parameter)]
    parameters: Vec<(String, String)>,

    /// Size of the image against the scene's: 50%, or 0.5
    #[arg(long, value_name = "S", value_parser = scale, conflicts_with_all = ["width", "height"])]
    scale: Option<f64>,

    /// Pixels a row; without --height the picture keeps its proportions [default: the scene's]
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..))]
    width: Option<u32>,

    /// Rows of pixels; without --width the picture keeps its proportions [default: the scene's]
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u32).range(1..))]
    height: Option<u32>,

    /// Render only this window of it: X,Y,W,H in pixels, from the upper left
    #[arg(long, value_name = "X,Y,W,H", value_parser = crop)]
    crop: Option<[u32; 4]>,

    /// Leave out the parts of a Mitsuba scene that are not supported, and say which, instead of failing
    #[arg(long)]
    skip_unsupported: bool,

    /// Let glass, water and diamond that a Mitsuba scene names bend light of each wavelength by another angle
    #[arg(long)]
    spectral: bool,

    /// Fail where a note says that something of the scene is not as it should be, and could be wrong in the picture:
    /// glass that is open, media that overlap, fields that have no effect
    #[arg(long)]
    strict: bool,

    /// Read the scene as it is at this frame.
    #[arg(skip)]
    pub frame: Option<i64>,
}

fn parameter(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE".to_owned()),
    }
}

/// A number, or one with a percent sign.
fn share(text: &str) -> Result<f64, ParseFloatError> {
    match text.strip_suffix('%') {
        Some(percent) => percent.trim_end().parse::<f64>().map(|n| n / 100.0),
        None => text.parse(),
    }
}

fn scale(text: &str) -> Result<f64, String> {
    match share(text) {
        Ok(number) if number > 0.0 && number <= 1000.0 => Ok(number),
        _ => Err("expected a percentage as in 50%, or a factor as in 0.5".into()),
    }
}

fn crop(text: &str) -> Result<[u32; 4], String> {
    let numbers: Result<Vec<u32>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let window = numbers.ok().and_then(|numbers| <[u32; 4]>::try_from(numbers).ok());
    let window = window.filter(|[_, _, width, height]| *width > 0 && *height > 0);
    window.ok_or_else(|| "expected X,Y,W,H as in 100,50,320,240".into())
}

impl ImportArgs {
    /// Whether the command line says which frame it is.
    pub fn says_frame(&self) -> bool {
        self.parameters.iter().any(|(name, _)| name == FRAME)
    }

    /// Fails where notes on the scene are errors, and there are any.
    fn refuse<'n>(&self, notes: impl Iterator<Item = &'n String>) -> Result<(), Failure> {
        let notes: Vec<String> = notes.cloned().collect();
        match (self.strict, notes.len()) {
            (false, _) | (_, 0) => Ok(()),
            (true, count) => {
                announce(&notes, &[]);
                let noun = if count == 1 { "note" } else { "notes" };
                Err(Failure::usage(format!(
                    "{count} {noun} on the scene, which --strict does not let pass"
                )))
            }
        }
    }

    /// What the reader is told about a scene.
    pub fn options(&self, scene: &Path) -> Result<ImportOptions, Failure> {
        let is_mitsuba = is_mitsuba(scene);
        if !is_mitsuba && self.skip_unsupported {
            let path = scene.display();
            let message = format!("{path}: --skip-unsupported is for Mitsuba scenes, whose names end in .xml");
            return Err(Failure::usage(message));
        }
        if !is_mitsuba && self.spectral {
            let path = scene.display();
            let message = format!(
                "{path}: --spectral is for Mitsuba scenes, whose names end in .xml; here a material says `ior = {{ preset \
                 = \"bk7\" }}`"
            );
            return Err(Failure::usage(message));
        }
        let (parameters, mut fields) = match is_mitsuba {
            true => (self.parameters.clone(), Vec::new()),
            false => (Vec::new(), self.parameters.clone()),
        };
        fields.extend(self.frame.map(|frame| (FRAME.to_owned(), frame.to_string())));
        Ok(ImportOptions {
            parameters,
            skip_unsupported: self.skip_unsupported,
            spectral: self.spectral,
            edits: Edits {
                fields,
                width: self.width,
                height: self.height,
                scale: self.scale,
                crop: self.crop,
            },
        })
    }
}

/// A job: its settings, when it ends, and where its image goes.
#[derive(Args, Clone, Debug)]
pub struct JobArgs {
    #[command(flatten)]
    pub settings: SettingsArgs,

    /// Where to write the image: OUT.exr, with OUT.png and OUT.csv beside it; with --frames a run of # in its name is
    /// the frame's number, as in frame.####.exr [default: the scene's name, in the current folder; FOLDER-NAME.exr
    /// where another folder's scene has that]
    #[arg(short, long, value_name = "OUT.exr")]
    pub output: Option<PathBuf>,

    /// Number of passes [default: the scene's, or no limit with --time or --target-error]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_PASSES))]
    pub passes: Option<u64>,

    /// Stop after this time with the passes that are complete by then: 60s, 5m, 1h30m
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub time: Option<Duration>,

    /// Stop when the relative standard error of the image is at most this: 1%, or 0.01. Looks after 2, 3, 4, 6, 8, 12,
    /// ... passes and leaves out those beyond, so that the same scene and seed stop at the same pass on any machines
    #[arg(long, value_name = "E", value_parser = target_error)]
    pub target_error: Option<f64>,

    /// Ask --target-error of this share of the image's blocks of 8 x 8 pixels, in percent, each for itself [default: of
    /// the image as a whole]
    #[arg(long, value_name = "P", requires = "target_error", value_parser = clap::value_parser!(u32).range(1..=100))]
    pub target_percentile: Option<u32>,

    /// Folder that keeps all that the job needs to go on after it was interrupted [default: OUT.job beside OUT.exr;
    /// `render` only uses it if it is there]
    #[arg(long, value_name = "DIR")]
    pub job: Option<PathBuf>,

    /// Insist that the job folder is there
    #[arg(long)]
    pub resume: bool,

    /// Begin anew where the job folder has passes of another scene or with other settings; the image stays until there
    /// is a new one
    #[arg(long, conflicts_with = "resume")]
    pub restart: bool,

    /// Exit with 75 instead of 0 when SIGTERM or SIGINT ends the job before its last pass, for schedulers that start
    /// whatever failed again: the next start goes on from the job folder
    #[arg(long)]
    pub preemptible: bool,

    /// Render only passes K to N - 1, for `beamfarm merge`
    #[arg(long, value_name = "K", default_value_t = 0, hide_default_value = true)]
    pub first_pass: u64,

    /// Write a picture with less noise as well, OUT.denoised.exr and .png: biased, beside the image and never in its
    /// place. Renders the layers that it needs, as `--aov odd,albedo,normal,depth` does
    #[arg(long)]
    pub denoise: bool,

    #[command(flatten)]
    pub view: ViewArgs,

    /// Print nothing but errors
    #[arg(short, long)]
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
    /// The same, with the layers that other options take.
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

    /// Where the image goes, and what it says of itself.
    pub fn image(&self, loaded: &Loaded) -> Result<Output, Failure> {
        self.image_called("", loaded)
    }

    /// The same. `ending`: of its name, where none was asked for.
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

    /// What the coordinator is to do.
    pub fn spec(&self, loaded: Loaded) -> Result<JobSpec, Failure> {
        let camera = &loaded.description.camera;
        let has_other_end = self.time.is_some() || self.target_error.is_some();
        let passes = match (self.passes, has_other_end) {
            (Some(passes), _) => passes,
            (None, true) => MAX_PASSES,
            (None, false) => loaded.defaults.passes,
        };
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
        Ok(JobSpec {
            settings: loaded.settings,
            width: camera.width,
            height: camera.height,
            layers: loaded.layers,
            first_pass: self.first_pass,
            passes,
            audit_every: 0,
            bundle: loaded.bundle,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_factors_and_windows_have_four_sides() {
        for (text, expected) in [("50%", 0.5), ("0.25", 0.25), ("200 %", 2.0)] {
            assert_eq!(scale(text), Ok(expected), "{text}");
        }
        assert_eq!(crop("1, 2,3,4"), Ok([1, 2, 3, 4]));
        for text in ["", "0", "-1", "nan", "x%"] {
            assert!(scale(text).is_err() && crop(text).is_err(), "{text}");
        }
        for text in ["1,2,3", "1,2,3,0", "1,2,3,4,5", "1,2,-3,4"] {
            assert!(crop(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_budget_is_passes_or_without_end() {
        assert_eq!(budget("64"), Ok(Budgeted::Passes(64)));
        assert_eq!(budget("inf"), Ok(Budgeted::Endless));
        for text in ["", "0", "-1", "64.5", "infinity", "9007199254740993"] {
            assert!(budget(text).is_err(), "{text}");
        }
    }

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
