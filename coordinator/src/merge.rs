//! `beamfarm merge`: one image from jobs that each rendered a part of its passes.

use crate::failure::Failure;
use crate::output::{Output, check};
use crate::summary::describe;
use crate::view_args::ViewArgs;
use beamfarm_coordinator::store::{Checkpoint, Description, Folder};
use beamfarm_image::exr::{ImageMeta, Maker, Names};
use beamfarm_image::job::{Block, PassStats, SceneHash};
use beamfarm_image::layer::{Layer, LayerCounts};
use beamfarm_image::merge::{Errors, MergeError, TreeSum};
use beamfarm_worker::say;
use clap::Args;
use std::path::{Path, PathBuf};

pub const EXAMPLES: &str = "\
Examples:
  beamfarm render scene.toml --passes 500 --job a.job
  beamfarm render scene.toml --first-pass 500 --passes 1000 --job b.job     on another machine
  beamfarm merge a.job b.job -o scene.exr
  beamfarm merge a.job b.job -o scene.exr --job all.job
  beamfarm render scene.toml --job all.job --passes 2000                    goes on from there

The image has the bits of one job over all passes. Jobs must have the same scene, settings, size and layers, must
not have a pass in common, and must leave none out.";

#[derive(Args)]
pub struct MergeArgs {
    /// Job folders, none of them in use
    #[arg(required = true, value_name = "JOB")]
    jobs: Vec<PathBuf>,

    /// Where to write the image: OUT.exr, with OUT.png beside it
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: PathBuf,

    /// Make a job folder of them as well
    ///
    /// `render` and `serve` go on from there.
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    job: Option<PathBuf>,

    #[command(flatten)]
    view: ViewArgs,

    /// Print nothing but errors
    #[arg(short, long, help_heading = "Output")]
    quiet: bool,
}

/// The jobs that were read so far.
struct Merged {
    first: PathBuf,
    description: Description,
    sum: TreeSum,
    seconds: f64,
    stats: PassStats,
    /// Prefixes that were tested.
    tested: Vec<(u64, Errors)>,
    /// Which job has which passes.
    parts: Vec<(PathBuf, Vec<Block>)>,
}

pub fn main(args: MergeArgs) -> Result<(), Failure> {
    check(&args.output)?;
    let mut merged: Option<Merged> = None;
    for path in &args.jobs {
        let (description, checkpoint) = Folder::inspect(path)?;
        let Some(checkpoint) = checkpoint else {
            let message = format!("{}: no pass of it is complete", path.display());
            return Err(Failure::usage(message));
        };
        let merged = merged.get_or_insert_with(|| Merged {
            first: path.clone(),
            sum: TreeSum::new(description.width, description.height)
                .with_layers(LayerCounts::of_names(&description.layers)),
            description: description.clone(),
            seconds: 0.0,
            stats: PassStats::default(),
            tested: Vec::new(),
            parts: Vec::new(),
        });
        let differences = merged.description.differences(&description);
        if !differences.is_empty() {
            return Err(Failure::usage(format!(
                "{} and {} are different jobs: {}",
                merged.first.display(),
                path.display(),
                differences.join("; ").replace(" there, ", " and ").replace(" here", "")
            )));
        }
        for node in checkpoint.sum.nodes() {
            let inserted = merged.sum.insert_shared(node.clone());
            inserted.map_err(|error| overlap(&error, merged, path))?;
        }
        merged.seconds += checkpoint.seconds;
        merged.stats += checkpoint.stats;
        // Only the part that starts at pass 0 has a prefix.
        merged.tested.extend(checkpoint.tested);
        let blocks = checkpoint.sum.nodes().map(|node| node.block).collect();
        merged.parts.push((path.clone(), blocks));
    }
    // clap requires at least one.
    let merged = merged.ok_or_else(|| Failure::usage("no jobs"))?;
    write(&args, merged)
}

fn overlap(error: &MergeError, merged: &Merged, path: &Path) -> Failure {
    if let MergeError::Overlap { pass_index, .. } = error {
        let holds = |block: &Block| block.passes().contains(pass_index);
        let has = |part: &&(PathBuf, Vec<Block>)| part.1.iter().any(holds);
        if let Some((other, _)) = merged.parts.iter().find(has) {
            return Failure::usage(format!(
                "{} and {} both have pass {pass_index}",
                other.display(),
                path.display()
            ));
        }
    }
    Failure::usage(format!("{}: {error}", path.display()))
}

/// Missing passes before the last one.
fn gaps(sum: &TreeSum) -> Vec<String> {
    let mut next = 0;
    let mut gaps = Vec::new();
    for node in sum.nodes() {
        let passes = node.block.passes();
        match passes.start - next {
            0 => {}
            1 => gaps.push(format!("pass {next}")),
            _ => gaps.push(format!("passes {next} to {}", passes.start - 1)),
        }
        next = passes.end;
    }
    gaps
}

/// Create a job folder that continues after these passes.
fn keep(job: &Path, merged: &Merged) -> Result<(), Failure> {
    let Merged { description, sum, .. } = merged;
    // As in a job that rendered them itself: the next prefix to be tested lies ahead.
    let mut kept = TreeSum::new(description.width, description.height)
        .with_layers(LayerCounts::of_names(&description.layers))
        .with_fence(sum.prefix() + 1);
    for node in sum.nodes() {
        kept.insert_shared(node.clone()).map_err(Failure::io)?;
    }
    let checkpoint = Checkpoint {
        number: 0,
        sum: kept,
        tested: merged.tested.clone(),
        stats: merged.stats,
        seconds: merged.seconds,
        ledger: 0,
    };
    let parts: Vec<PathBuf> = merged.parts.iter().map(|(part, _)| part.clone()).collect();
    Ok(Folder::join(job, &parts, description.clone(), checkpoint)?)
}

fn write(args: &MergeArgs, merged: Merged) -> Result<(), Failure> {
    let gaps = gaps(&merged.sum);
    if !gaps.is_empty() {
        let message = format!("{} missing: no image can be made without", gaps.join(", "));
        return Err(Failure::usage(message));
    }
    let standard_error = merged.description.standard_error;
    let output = Output::new(Some(&args.output), &args.output, "", standard_error)?;
    let view = args.view.over(merged.description.view());
    if let Some(job) = &args.job {
        keep(job, &merged)?;
    }
    let Merged {
        first,
        description,
        sum,
        seconds,
        ..
    } = merged;
    let average = sum.average().ok_or_else(|| Failure::nothing("no pass is complete"))?;
    drop(sum);
    let bad = |what: &str, text: &str| Failure::usage(format!("{}: job.json: {what} {text:?}", first.display()));
    let scene: SceneHash = description
        .scene
        .parse()
        .map_err(|_| bad("scene", &description.scene))?;
    let layers: Result<Vec<Layer>, Failure> = description
        .layers
        .iter()
        .map(|name| name.parse().map_err(|_| bad("layer", name)))
        .collect();
    let settings = description.settings(&first)?;
    let names = match LayerCounts::of_names(&description.layers).mattes {
        0 => Names::default(),
        _ => names_of(&first, &description)?,
    };
    let meta = ImageMeta {
        scene,
        scene_file: None,
        maker: Maker::Passes(settings),
        render_seconds: seconds,
        version: description.version.clone(),
        layers: layers?,
        standard_error: description.standard_error,
        drops_photons: description.drops_photons,
        names,
        empty_depth: description.empty_depth,
    };
    output.write(&average, &meta, view)?;
    if !args.quiet {
        if let Some(job) = &args.job {
            say!("made {}", job.display());
        }
        say!("wrote {} and {}", output.exr.display(), output.png.display());
        describe(&average, &meta.pass_set(&settings, &average));
    }
    Ok(())
}

/// What the job's mattes separate; its folder contains the scene.
fn names_of(job: &Path, description: &Description) -> Result<Names, Failure> {
    let bundle = Folder::bundle(job, description)?;
    let scene = beamfarm_scene::load(&bundle).map_err(|error| Failure::usage(format!("{}: {error}", job.display())))?;
    Ok(scene.names())
}
