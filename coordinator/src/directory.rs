//! Where a job is kept while it runs, and what it starts with.

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

/// The most differing fields that are listed.
const SHOWN: usize = 20;

/// A job directory, and the channel on which the farm reports to it.
pub struct Directory {
    pub folder: Folder,
    pub entries: UnboundedReceiver<Entry>,
}

/// What a job starts with, and where it is kept. `by_default`: create a directory even if none was requested.
///
/// An existing directory is resumed; `spec` then gets its number of passes unless another was requested.
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

/// Lists how a job folder differs from this job, field by field, and what to do about it.
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
    // In place of the scene's hashes, and in addition to differences outside the scene.
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

/// The image of a prefix that the job has already passed is no longer available.
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
