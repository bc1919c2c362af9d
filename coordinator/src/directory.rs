//! Where a job is kept while it runs, and what it begins with.

use crate::failure::Failure;
use crate::job::JobArgs;
use crate::output::{Output, job_beside};
use beamfarm_coordinator::store::{Asked, Folder, Looks, Resumed, StoreError};
use beamfarm_coordinator::{Entry, JobSpec, Start, Target};
use beamfarm_image::merge::Errors;
use beamfarm_image::view::View;
use beamfarm_worker::say;
use std::path::PathBuf;
use std::time::Duration;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};

/// Fields of a scene that are named.
const SHOWN: usize = 20;

/// A job directory and what the farm will tell it.
pub struct Directory {
    pub folder: Folder,
    pub entries: UnboundedReceiver<Entry>,
}

/// What a job begins with, and where it is kept. `by_default`: make a directory even if nobody asked for it.
///
/// A directory that is there is resumed; `spec` then has the number of passes that it says, unless someone asked for
/// another.
pub fn prepare(
    args: &JobArgs,
    spec: &mut JobSpec,
    output: &Output,
    view: View,
    by_default: bool,
) -> Result<(Option<Directory>, Start), Failure> {
    let mut start = Start {
        target: args.target(),
        ..Start::default()
    };
    let beside = job_beside(&output.exr);
    let path: Option<PathBuf> = match &args.job {
        Some(path) => Some(path.clone()),
        None if by_default || args.resume || args.first_pass > 0 || beside.is_dir() => Some(beside),
        None => None,
    };
    let Some(path) = path else {
        return Ok((None, start));
    };
    if args.resume && !path.is_dir() {
        return Err(StoreError::Missing(path).into());
    }
    let looks = Looks {
        view,
        standard_error: output.standard_error,
        drops_photons: output.drops_photons,
        empty_depth: output.empty_depth,
    };
    let asked = Asked {
        limit: args.passes.is_some() || args.time.is_some() || args.target_error.is_some(),
        restart: args.restart,
    };
    let opened = Folder::open(&path, spec, looks, asked);
    let (folder, resumed) = opened.map_err(|error| explain(error, spec))?;
    let (sender, entries) = unbounded_channel();
    start.entries = Some(sender);
    if let Some(Resumed {
        checkpoint,
        done,
        convicted,
    }) = resumed
    {
        let passes = checkpoint.sum.passes();
        let fence = checkpoint.sum.fence().unwrap_or(0);
        let mut tested = checkpoint.tested;
        tested.retain(|(passes, _)| *passes < fence);
        if let Some(target) = start.target {
            refuse_missed(target, &tested)?;
        }
        if !args.quiet {
            say!("resuming {} with {passes} passes", path.display());
        }
        start.sum = Some(checkpoint.sum);
        start.done = done;
        start.convicted = convicted;
        start.tested = tested;
        start.stats = checkpoint.stats;
        start.before = Duration::try_from_secs_f64(checkpoint.seconds).unwrap_or_default();
    } else {
        start.sum = Some(folder.shape().empty_sum());
    }
    Ok((Some(Directory { folder, entries }), start))
}

/// What a job folder and this job differ in, field by field, and what can be done about it.
fn explain(error: StoreError, spec: &JobSpec) -> Failure {
    let (path, differences, scene) = match error {
        StoreError::Different {
            path,
            differences,
            scene,
        } => (path, differences, scene),
        error => return error.into(),
    };
    let here = spec.bundle.files.get(&spec.bundle.scene);
    let here = here.map(|bytes| String::from_utf8_lossy(bytes)).unwrap_or_default();
    let fields = scene.map(|there| beamfarm_scene::differences(&there, &here));
    let fields = fields.unwrap_or_default();
    let more = fields.len().saturating_sub(SHOWN);
    let mut lines: Vec<String> = fields.into_iter().take(SHOWN).collect();
    lines.extend((more > 0).then(|| format!("and {more} more")));
    // In place of the scene's hashes, and beside what is no field of it.
    let others = differences
        .split("; ")
        .filter(|line| !line.starts_with("scene ") || lines.is_empty());
    let others: Vec<String> = others.map(str::to_owned).collect();
    lines.extend(others);
    Failure::usage(format!(
        "{} has passes of another picture:\n  {}\n--restart starts anew, and the image stays until there is a new one; \
         another -o or --job keeps both",
        path.display(),
        lines.join("\n  ")
    ))
}

/// The image of a prefix that was passed by cannot be had any more.
fn refuse_missed(target: Target, tested: &[(u64, Errors)]) -> Result<(), Failure> {
    let met = tested.iter().find(|(_, errors)| target.is_met_by(errors));
    match met {
        None => Ok(()),
        Some((passes, errors)) => Err(Failure::usage(format!(
            "--target-error: the first {passes} passes of this job met it, with {:.3} %, and were added up with later ones \
             since; ask for a smaller error, or start another job",
            100.0 * errors.at(target.percentile)
        ))),
    }
}
