//! `beamfarm reference`: the ground truth of a scene, rendered in this process.

use crate::again::Again;
use crate::aov::Aov;
use crate::failure::Failure;
use crate::import::ImportArgs;
use crate::loaded::Choosing;
use crate::output::{Output, REFERENCE, check};
use crate::progress::{self, BAR_LENGTH, ESTIMATE, LINE};
use crate::settings::{SceneArgs, SettingsArgs};
use crate::sketch::{LOOK, Sketch};
use crate::summary::describe_error;
use crate::view_args::ViewArgs;
use beamfarm_image::exr::{ImageMeta, Maker, Names, pixel_hash};
use beamfarm_image::job::{MAX_PASSES, ReferenceSettings};
use beamfarm_image::merge::{Average, MergeError, Node, TreeSum};
use beamfarm_proto::VERSION;
use beamfarm_render::cpu::reference::{SampleLayers, render_sample, render_sample_with_layers};
use beamfarm_render::world::{Scene, SceneDescription};
use beamfarm_scene::SceneFile;
use beamfarm_worker::say;
use beamfarm_worker::signals;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::{Duration, Instant};

pub const EXAMPLES: &str = "\
Examples:
  beamfarm reference scene.toml --time 10m -o reference.exr
  beamfarm reference scene.xml -D spp=256 --samples 4096
  beamfarm compare scene.exr reference.exr";

pub const LIMITS: &str = "\
A volumetric path tracer: null collisions, light sampled at every vertex, no photons and no kernels. Its
only error is noise, which the layer stderr of the EXR holds.

What it does not find is missing from its image at any number of samples: light of point, spot and
directional lights by way of mirrors and glass, which means their caustics and all they light from behind
glass. What it finds only rarely shows as fireflies, and is too dark where there are none: caustics of
small area lights, and small area lights behind glass. The standard error does not know of light that
was never found.

SIGINT (Ctrl-C) writes the samples that are complete; another one after a second kills.";

/// Number of samples if neither it nor a time is given.
pub const SAMPLES: u64 = 64;

#[derive(Args)]
pub struct ReferenceArgs {
    /// Scene file: TOML, Mitsuba 3 (.xml) or glTF (.glb, .gltf)
    scene: PathBuf,

    #[command(flatten)]
    import: ImportArgs,

    /// Where to write the image: OUT.exr, with OUT.png beside it
    ///
    /// [default: SCENE-reference.exr, in the current folder]
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: Option<PathBuf>,

    /// Number of samples of each pixel [default: 64, or no limit with --time]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_PASSES))]
    #[arg(help_heading = "Stopping")]
    samples: Option<u64>,

    /// Stop after this time: 60s, 5m, 1h30m
    ///
    /// The image is that of the samples which are complete by then.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, help_heading = "Stopping")]
    time: Option<Duration>,

    /// Scatter paths at most N times [default: no limit]
    ///
    /// Surfaces and media count together; 1 is direct light.
    #[arg(long, value_name = "N", help_heading = "Sampling")]
    max_depth: Option<u32>,

    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "S", help_heading = "Sampling")]
    seed: Option<u64>,

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
    aov: Vec<SampleAov>,

    /// Threads [default: one per core]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    threads: Option<u16>,

    #[command(flatten)]
    view: ViewArgs,

    /// Print nothing but errors
    #[arg(short, long, help_heading = "Output")]
    quiet: bool,
}

/// What `--aov` takes.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
#[value(rename_all = "snake_case")]
enum SampleAov {
    /// R, G, B: lights that the camera sees, and direct light on surfaces
    Direct,
    /// R, G, B: all other light of surfaces. The beauty is direct + surface + volume
    Surface,
    /// R, G, B: light that media scatter towards the camera
    Volume,
    /// light_NAME.R, G, B for each group of lights: what comes from it. The beauty is their sum
    Lights,
    /// All of them
    All,
}

impl SampleAov {
    /// The corresponding layers of passes.
    fn of_passes(self) -> Vec<Aov> {
        match self {
            Self::Direct => vec![Aov::Direct],
            Self::Surface => vec![Aov::Surface],
            Self::Volume => vec![Aov::Volume],
            Self::Lights => vec![Aov::Lights],
            Self::All => vec![Aov::Direct, Aov::Surface, Aov::Volume, Aov::Lights],
        }
    }
}

pub fn main(args: ReferenceArgs) -> Result<(), Failure> {
    args.output.as_deref().map_or(Ok(()), check)?;
    let loaded = SettingsArgs {
        of: SceneArgs {
            scene: args.scene.clone(),
            import: args.import.clone(),
            // The path tracer emits no photons and needs no pilot.
            paths: Some(1),
            seed: args.seed,
            alpha: None,
            seed_of_frame: None,
            text: None,
        },
        budget: None,
        aov: args.aov.iter().flat_map(|aov| aov.of_passes()).collect(),
        engine: None,
        // Samples have their own engines.
        device: None,
        measures: false,
        silent: false,
    }
    .load_by(
        SceneFile::load,
        |_| Choosing::Nothing,
        |early| early.announce(args.quiet),
    )?;
    refuse_photon_rules(&loaded.description)?;
    let view = args.view.over(loaded.defaults.view);
    let output = Output::new(args.output.as_deref(), &args.scene, REFERENCE, true)?;
    let left_out = match args.quiet {
        true => Vec::new(),
        false => loaded.announce(),
    };
    let settings = ReferenceSettings {
        seed: loaded.settings.seed,
        max_depth: args.max_depth,
    };
    let hash = loaded.bundle.hash();
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    let stop = runtime.block_on(async { signals::drain() });
    let stop = stop.map_err(Failure::io)?;
    // Zero threads mean one per core.
    let threads = args.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(Failure::io)?;

    let mut scene = pool.install(|| Scene::new(loaded.description));
    let layers = SampleLayers::new(&scene, &loaded.layers).map_err(Failure::usage)?;
    let started = Instant::now();
    let shown = Showing {
        samples: match (args.samples, args.time) {
            (Some(samples), _) => samples,
            (None, Some(_)) => MAX_PASSES,
            (None, None) => SAMPLES,
        },
        started,
        time: args.time,
    };
    let goes_on = || !*stop.borrow() && args.time.is_none_or(|time| started.elapsed() < time);
    let mut last = Shown::default();
    let rendered = pool.install(|| {
        samples((&scene, &layers), settings, shown.samples, goes_on, |sum, count| {
            if !args.quiet {
                shown.show(&mut last, sum, count);
            }
        })
    });
    let (sum, failed) = match rendered {
        Ok(sum) => (sum, None),
        Err((sum, error)) => (*sum, Some(error)),
    };
    progress::clear();

    let seconds = started.elapsed().as_secs_f64();
    let average = sum.average();
    if let Some(average) = &average {
        let meta = ImageMeta {
            scene: hash,
            scene_file: output.scene_file.clone(),
            maker: Maker::Reference(settings),
            render_seconds: seconds,
            version: VERSION.into(),
            layers: loaded.layers,
            standard_error: output.standard_error,
            drops_photons: false,
            names: Names::default(),
            empty_depth: None,
        };
        let mut again = Again::default();
        runtime.block_on(async {
            loop {
                let attempt = output.write(average, &meta, view).map_err(Failure::from);
                if let Some(written) = again.settled(attempt, false).await {
                    break written;
                }
            }
        })?;
        if !args.quiet {
            summarise(average, &output, seconds);
        }
    }
    let mut written = "nothing was written";
    if average.is_none() && failed.is_none() {
        let sketch = pool.install(|| {
            Sketch::by(&mut scene, LOOK, |scene, _| {
                Some((render_sample(scene, &settings, 0, || true)?, None))
            })
        });
        if let Some(sketch) = sketch {
            let words = output.write_sketch(&sketch, hash, view)?;
            if !args.quiet {
                say!("{words}; no sample is complete, and it is part of none");
            }
            written = "a coarse picture was written";
        }
    }
    for part in left_out {
        say!("left out: {part}");
    }
    match (failed, average) {
        (Some(error), average) => Err(Failure::job(format!(
            "{error}; {}",
            match average {
                Some(average) => format!("the image is that of the {} samples before", average.passes),
                None => "nothing was written".into(),
            }
        ))),
        (None, Some(_)) => Ok(()),
        (None, None) => Err(Failure::nothing(format!(
            "stopped before the first sample was complete; {written}"
        ))),
    }
}

/// A path tracer has no photons that rules could apply to.
pub fn refuse_photon_rules(description: &SceneDescription) -> Result<(), Failure> {
    let photon_rules = &description.photon_rules;
    if photon_rules.is_empty() {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{}\nbut a path tracer has no photons: take \"photon\" out of the rays of what is named here (or put it into \
         `visible`), or take many passes of `render` for the truth",
        photon_rules.join("\n")
    )))
}

/// Render up to `count` samples, one after another, until `goes_on` returns false. `tell` receives the sum and the
/// number of samples after each. An error comes with the sum of the samples before it.
pub fn samples(
    (scene, layers): (&Scene, &SampleLayers),
    settings: ReferenceSettings,
    count: u64,
    goes_on: impl Fn() -> bool + Sync,
    mut tell: impl FnMut(&TreeSum, u64),
) -> Result<TreeSum, (Box<TreeSum>, MergeError)> {
    let camera = &scene.description().camera;
    let mut sum = TreeSum::new(camera.width, camera.height).with_layers(layers.count());
    for sample in 0..count {
        let image = render_sample_with_layers(scene, &settings, layers, sample, &goes_on);
        let Some(image) = image else { break };
        let leaf = Node::leaf(sample, image.film).with_layers(image.layers);
        if let Err(error) = sum.insert(leaf) {
            return Err((Box::new(sum), error));
        }
        tell(&sum, sample + 1);
    }
    Ok(sum)
}

fn summarise(average: &Average, output: &Output, seconds: f64) {
    say!("wrote {} and {}", output.exr.display(), output.png.display());
    let samples = average.passes;
    say!(
        "{samples} samples in {seconds:.1} s ({:.2} samples/s)",
        samples as f64 / seconds
    );
    describe_error(average);
    say!("pixels {}", pixel_hash(&average.beauty));
}

/// Progress display for the samples of one scene.
struct Showing {
    samples: u64,
    started: Instant,
    time: Option<Duration>,
}

impl Showing {
    fn show(&self, shown: &mut Shown, sum: &TreeSum, samples: u64) {
        let elapsed = self.started.elapsed();
        if elapsed >= shown.next_estimate {
            shown.error = sum.average().map(|a| a.relative_standard_error());
            let cost = self.started.elapsed() - elapsed;
            shown.next_estimate = elapsed + ESTIMATE.max(20 * cost);
        }
        let by_samples = samples as f64 / self.samples as f64;
        let by_time = self.time.map_or(0.0, |time| elapsed.as_secs_f64() / time.as_secs_f64());
        let fraction = by_samples.max(by_time).min(1.0);
        let remaining = elapsed.as_secs_f64() * (1.0 / fraction - 1.0);
        let limit = match self.samples {
            MAX_PASSES => String::new(),
            limit => format!("/{limit}"),
        };
        let line = format!(
            "{} %  {samples}{limit} samples  {:.2} samples/s  {}",
            (100.0 * fraction) as u32,
            samples as f64 / elapsed.as_secs_f64(),
            progress::expectation(Duration::try_from_secs_f64(remaining).ok(), shown.error),
        );
        match progress::bar() {
            Some(bar) => {
                bar.set_position((fraction * BAR_LENGTH as f64) as u64);
                bar.set_message(line);
            }
            None if elapsed >= shown.next_line => {
                say!("{line}");
                shown.next_line = elapsed + LINE;
            }
            None => {}
        }
    }
}

/// The last progress shown, and when the next is due, counted from the start.
struct Shown {
    error: Option<f64>,
    next_estimate: Duration,
    next_line: Duration,
}

impl Default for Shown {
    fn default() -> Self {
        Self {
            error: None,
            next_estimate: ESTIMATE,
            next_line: LINE,
        }
    }
}
