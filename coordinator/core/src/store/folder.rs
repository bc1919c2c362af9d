//! The directory as a whole: creating, opening and writing it.

use super::StoreError;
use super::checkpoint::{Checkpoint, Damage, Shape};
use super::description::{Description, Looks};
use super::lines::Lines;
use super::report::Report;
use crate::JobSpec;
use crate::farm::{DoneBlock, Entry, Farm};
use crate::ledger::Who;
use beamfarm_image::atomic::{sync_folder, write_file};
use beamfarm_image::bundle::{Bundle, MAX_BYTES};
use beamfarm_image::error::ImageError;
use beamfarm_image::input;
use beamfarm_image::job::{Block, JobSettings, SceneHash};
use beamfarm_proto::FileHash;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use tracing::warn;

pub(super) const JOB: &str = "job.json";
const LOCK: &str = "lock";
pub(super) const LEDGER: &str = "ledger.jsonl";
const REPORT: &str = "report.json";
pub(super) const SCENE: &str = "scene";
const CHECKPOINTS: [&str; 2] = ["checkpoint-0", "checkpoint-1"];
/// Suffix of a checkpoint that is being written.
const PART: &str = "part";
/// Prefix of other files that are being written.
const TEMPORARY: &str = ".beamfarm-";

/// A job directory locked by this process.
pub struct Folder {
    path: PathBuf,
    description: Description,
    shape: Shape,
    lines: Lines,
    next_number: u64,
    /// Holds the lock on the directory.
    _lock: File,
}

/// What an earlier coordinator left.
#[derive(Debug)]
pub struct Resumed {
    /// The passes that are done.
    pub checkpoint: Checkpoint,
    /// Who rendered what according to the ledger, including blocks that are not in the checkpoint.
    pub done: Vec<DoneBlock>,
    /// Workers that were shut out for wrong pixels.
    pub convicted: Vec<Who>,
}

/// How to open a directory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Asked {
    /// Whether the caller asked for a number of passes or another stopping condition. If not, the directory's number of
    /// passes applies, if it has one, and overrides the job's.
    pub limit: bool,
    /// Whether to discard its contents.
    pub restart: bool,
}

impl Folder {
    /// Open the directory of this job: a new one, or one that holds the same job and its state. A directory with
    /// another job that has no passes is reused.
    pub fn open(
        path: &Path,
        spec: &mut JobSpec,
        looks: Looks,
        asked: Asked,
    ) -> Result<(Self, Option<Resumed>), StoreError> {
        create_private(path).map_err(StoreError::io(path))?;
        match read_description(path) {
            Ok(_) => {}
            Err(StoreError::Missing(_)) => refuse_foreign(path)?,
            Err(error) => return Err(error),
        }
        let lock = lock(path)?;
        let mut description = Description::new(spec, looks);
        description.scene_passes = (!asked.limit).then_some(spec.passes);
        // Only under the lock: another coordinator may have been at work until just now.
        let known = match read_description(path) {
            Ok(known) => known,
            Err(StoreError::Missing(_)) => {
                return Self::create(path, spec, description, lock).map(|folder| (folder, None));
            }
            Err(error) => return Err(error),
        };
        let mut differences = known.differences(&description);
        if known.first_pass != description.first_pass {
            let (there, here) = (known.first_pass, description.first_pass);
            differences.push(format!("first pass {there} there, {here} here"));
        }
        if asked.restart || !differences.is_empty() {
            let has_passes = match newest_checkpoint(path, &Shape::of(&known))? {
                Some(checkpoint) => checkpoint.sum.passes() > 0,
                // What cannot be read may still be valuable.
                None => CHECKPOINTS.iter().any(|name| path.join(name).exists()),
            };
            if has_passes && !asked.restart {
                return Err(StoreError::Different {
                    path: path.to_owned(),
                    differences: differences.join("; "),
                    scene: (known.scene != description.scene)
                        .then(|| read_scene(path, &known))
                        .flatten(),
                });
            }
            clear(path).map_err(StoreError::io(path))?;
            return Self::create(path, spec, description, lock).map(|folder| (folder, None));
        }
        let scenes = description.scene_passes;
        let description = description.going_on_from(&known);
        let (mut folder, checkpoint) = Self::with(path, description, lock)?;
        let held = checkpoint.as_ref().and_then(|c| c.sum.nodes().last());
        let held = held.map_or(0, |node| node.block.passes().end);
        if !asked.limit {
            // A job without a limit was ended by some other condition, which nobody asks for now. The scene's own
            // number counts again if it was changed.
            let is_news = known.scene_passes.is_some_and(|before| scenes != Some(before));
            spec.passes = match known.passes {
                Some(passes) if !is_news => passes,
                _ => spec.passes.max(held),
            };
            folder.description.passes = known.passes.map(|_| spec.passes);
        }
        if held > spec.passes {
            return Err(StoreError::Different {
                path: path.to_owned(),
                differences: format!(
                    "passes up to {held} there, {} here; the number of passes can be raised, not lowered",
                    spec.passes
                ),
                scene: None,
            });
        }
        write_bundle(path, &spec.bundle)?;
        folder.description.scene_passes = scenes.or(known.scene_passes);
        if (folder.description.passes, folder.description.scene_passes) != (known.passes, known.scene_passes) {
            folder.write_description()?;
        }
        let done = folder.lines.done();
        let done = done.map_err(StoreError::io(&folder.path.join(LEDGER)))?;
        let convicted = folder.lines.convicted();
        let convicted = convicted.map_err(StoreError::io(&folder.path.join(LEDGER)))?;
        let resumed = match checkpoint {
            Some(checkpoint) => Some(Resumed {
                checkpoint,
                done,
                convicted,
            }),
            None if done.is_empty() && convicted.is_empty() => None,
            None => Some(Resumed {
                checkpoint: Checkpoint::new(&folder.shape),
                done,
                convicted,
            }),
        };
        Ok((folder, resumed))
    }

    /// Open an existing directory with any job.
    pub fn inspect(path: &Path) -> Result<(Description, Option<Checkpoint>), StoreError> {
        let description = read_description(path)?;
        let lock = lock(path)?;
        let (folder, checkpoint) = Self::with(path, description, lock)?;
        Ok((folder.description, checkpoint))
    }

    /// The settings of a directory's passes, if it exists and holds this scene.
    pub fn settings(path: &Path, scene: SceneHash) -> Option<JobSettings> {
        let description = read_description(path).ok()?;
        let settings = description.settings(path).ok()?;
        (description.scene == scene.to_string()).then_some(settings)
    }

    fn create(path: &Path, spec: &JobSpec, description: Description, lock: File) -> Result<Self, StoreError> {
        sync_parent(path)?;
        write_bundle(path, &spec.bundle)?;
        let (folder, _) = Self::with(path, description, lock)?;
        // Last: a directory with a job.json is complete.
        folder.write_description()?;
        Ok(folder)
    }

    pub(super) fn with(
        path: &Path,
        description: Description,
        lock: File,
    ) -> Result<(Self, Option<Checkpoint>), StoreError> {
        let shape = Shape::of(&description);
        clean(path);
        let ledger = path.join(LEDGER);
        let lines = Lines::open(&ledger, description.seed)?;
        let mut checkpoint = newest_checkpoint(path, &shape)?;
        if let Some(checkpoint) = &mut checkpoint {
            let dropped = lines.dropped(checkpoint.ledger);
            drop_again(checkpoint, dropped.map_err(StoreError::io(&ledger))?);
        }
        let folder = Self {
            lines,
            path: path.to_owned(),
            description,
            shape,
            next_number: checkpoint.as_ref().map_or(0, |c| c.number + 1),
            _lock: lock,
        };
        Ok((folder, checkpoint))
    }

    /// The directory's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The dimensions of the job's sum.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// What is rendered.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Raise the number of passes in job.json to at least this.
    pub(super) fn extend(&mut self, passes: u64) -> Result<(), StoreError> {
        if self.description.passes.is_none_or(|known| known >= passes) {
            return Ok(());
        }
        self.description.passes = Some(passes);
        self.write_description()
    }

    pub(super) fn write_description(&self) -> Result<(), StoreError> {
        let path = self.path.join(JOB);
        let json = self.description.to_json();
        let json = json.map_err(|error| StoreError::io(&path)(error.into()))?;
        write_whole(&path, &json)
    }

    /// Remove the report. It says how the job ended, and a running job has not.
    pub(super) fn withdraw_report(&self) -> Result<(), StoreError> {
        let path = self.path.join(REPORT);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(StoreError::io(&path)(error)),
            _ => Ok(()),
        }
    }

    /// Write the report.
    pub fn write_report(&self, report: &Report) -> Result<(), StoreError> {
        let path = self.path.join(REPORT);
        let json = report.to_json();
        let json = json.map_err(|error| StoreError::io(&path)(error.into()))?;
        write_whole(&path, &json)
    }

    pub(super) fn enter(&mut self, entry: &Entry) {
        self.lines.push(entry);
    }

    /// Length in bytes of all lines that were added.
    pub(super) fn ledger_end(&self) -> u64 {
        self.lines.end()
    }

    /// Append the lines and wait until they are on the disk.
    pub(super) fn sync(&mut self) -> Result<(), StoreError> {
        let synced = self.lines.sync();
        synced.map_err(StoreError::io(&self.path.join(LEDGER)))
    }

    pub(super) fn append(&mut self) -> Result<(), StoreError> {
        let appended = self.lines.append();
        appended.map_err(StoreError::io(&self.path.join(LEDGER)))
    }

    /// Write what a [`Keeper`](super::Keeper) could not write at its end: the farm's state and the lines.
    pub fn save_end(&mut self, farm: &Farm) -> Result<(), StoreError> {
        let synced = self.sync();
        let mut checkpoint = Checkpoint::of(farm.snapshot(), self.ledger_end());
        self.save(&mut checkpoint).and(synced)
    }

    /// Write a checkpoint over the older one. On failure both remain as they were.
    pub fn save(&mut self, checkpoint: &mut Checkpoint) -> Result<(), StoreError> {
        checkpoint.number = self.next_number;
        // Before the checkpoint that builds on it. A ledger that cannot be written must not prevent a checkpoint.
        let synced = self.sync();
        let name = CHECKPOINTS[(self.next_number % 2) as usize];
        let path = self.path.join(name);
        let part = path.with_added_extension(PART);
        let write = || {
            let file = create_new(&part)?;
            checkpoint.write(&self.shape.digest, &file)?;
            file.sync_all()?;
            fs::rename(&part, &path)?;
            sync_folder(&self.path)
        };
        if let Err(error) = write() {
            // Frees its disk space.
            let _ = fs::remove_file(&part);
            return Err(StoreError::io(&path)(error));
        }
        self.next_number += 1;
        synced
    }
}

/// Wait until the directory's name is on the disk.
pub(super) fn sync_parent(path: &Path) -> Result<(), StoreError> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => sync_folder(parent).map_err(StoreError::io(parent)),
        _ => Ok(()),
    }
}

/// The largest job.json, in bytes: a few hundred for each file of the largest scene.
const MOST_JOB: u64 = 64 << 20;

pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    write_file(path, bytes).map_err(|error| match error {
        ImageError::Io { path, source } => StoreError::Io { path, source },
        other => StoreError::io(path)(io::Error::other(other)),
    })
}

fn read_description(path: &Path) -> Result<Description, StoreError> {
    let file = path.join(JOB);
    match input::read(&file, MOST_JOB) {
        Ok(json) => Description::from_json(&file, &json),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(StoreError::Missing(path.to_owned())),
        Err(error) => Err(StoreError::io(&file)(error)),
    }
}

/// Accept only what a coordinator may have left that was killed before it wrote job.json.
pub(super) fn refuse_foreign(path: &Path) -> Result<(), StoreError> {
    for entry in fs::read_dir(path).map_err(StoreError::io(path))? {
        let name = entry.map_err(StoreError::io(path))?.file_name();
        let name = name.to_string_lossy();
        let own = [LOCK, SCENE, LEDGER].contains(&&*name) || name.starts_with(TEMPORARY);
        if !own {
            return Err(StoreError::Foreign {
                path: path.to_owned(),
                message: format!("it has no {JOB}, but {name:?}"),
            });
        }
    }
    Ok(())
}

pub(super) fn lock(path: &Path) -> Result<File, StoreError> {
    let name = path.join(LOCK);
    let mut options = File::options();
    options.write(true).create(true).truncate(false);
    // The owner of the folder may have put a link to other people's files there.
    let file = input::open_as(&name, &mut options, false);
    let file = file.map_err(StoreError::io(&name))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StoreError::InUse(path.to_owned())),
        Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {
            warn!("{}: this file system has no locks", name.display());
            Ok(file)
        }
        Err(TryLockError::Error(error)) => Err(StoreError::io(&name)(error)),
    }
}

impl Folder {
    /// The scene of a job directory that others may write to.
    pub fn bundle(path: &Path, description: &Description) -> Result<Bundle, StoreError> {
        let mut bundle = Bundle {
            scene: description.scene_file.clone(),
            ..Bundle::default()
        };
        for part in &description.files {
            let file = path.join(SCENE).join(&part.hash);
            let bytes = input::read(&file, MAX_BYTES).map_err(StoreError::io(&file))?;
            bundle.files.insert(part.path.clone(), bytes);
        }
        Ok(bundle)
    }
}

/// The text of the scene file in a directory.
fn read_scene(path: &Path, description: &Description) -> Option<String> {
    let file = path.join(SCENE).join(description.scene_hash()?);
    String::from_utf8(input::read(&file, MAX_BYTES).ok()?).ok()
}

/// Create a new file in place of whatever is there.
fn create_new(path: &Path) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    File::create_new(path)
}

/// Remove everything that was reached. If interrupted, it leaves a job without passes.
fn clear(path: &Path) -> io::Result<()> {
    for name in CHECKPOINTS.into_iter().chain([REPORT, LEDGER, JOB]) {
        match fs::remove_file(path.join(name)) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    match fs::remove_dir_all(path.join(SCENE)) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Create the folder, if missing. Private, as it holds the scene.
fn create_private(path: &Path) -> std::io::Result<()> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent)?;
    }
    let builder = &mut fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(builder, 0o700);
    match builder.create(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        created => created,
    }
}

/// Write the scene's files that are missing.
fn write_bundle(path: &Path, bundle: &Bundle) -> Result<(), StoreError> {
    let folder = path.join(SCENE);
    fs::create_dir_all(&folder).map_err(StoreError::io(&folder))?;
    for bytes in bundle.files.values() {
        let file = folder.join(FileHash::of(bytes).to_string());
        let there = fs::metadata(&file).is_ok_and(|known| known.len() == bytes.len() as u64);
        if !there {
            write_whole(&file, bytes)?;
        }
    }
    Ok(())
}

/// Remove partial files of a coordinator that was killed: they take disk space.
fn clean(path: &Path) {
    let folders = [path.to_owned(), path.join(SCENE)];
    let entries = folders.iter().filter_map(|folder| fs::read_dir(folder).ok());
    for entry in entries.flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let part = |name: &str| Path::new(name).with_added_extension(PART);
        let is_part = CHECKPOINTS.map(part).contains(&PathBuf::from(&*name));
        if is_part || name.starts_with(TEMPORARY) {
            // If it stays, it only takes disk space.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Take out blocks that were found to be wrong while or after the checkpoint was written. Their replacements may be
/// included already; they are rendered once more.
fn drop_again(checkpoint: &mut Checkpoint, blocks: Vec<Block>) {
    let before = checkpoint.sum.passes();
    for block in blocks {
        checkpoint.sum.remove(block);
    }
    let dropped = before - checkpoint.sum.passes();
    if dropped > 0 {
        warn!(
            "{dropped} passes of the checkpoint are dropped: their worker was found to be wrong after it was written"
        );
    }
}

fn newest_checkpoint(path: &Path, shape: &Shape) -> Result<Option<Checkpoint>, StoreError> {
    let mut newest: Option<Checkpoint> = None;
    let mut damaged = Vec::new();
    for name in CHECKPOINTS {
        let file = path.join(name);
        let read = match input::open(&file) {
            Ok(open) => Checkpoint::read(shape, open),
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => Err(error.into()),
        };
        // A disk that cannot be read now may be readable later, so overwrite nothing.
        let read = match read {
            Err(Damage::Io(error)) if error.kind() != ErrorKind::UnexpectedEof => {
                return Err(StoreError::io(&file)(error));
            }
            read => read,
        };
        match read {
            Ok(checkpoint) => {
                if newest.as_ref().is_none_or(|c| c.number < checkpoint.number) {
                    newest = Some(checkpoint);
                }
            }
            Err(damage) => damaged.push((file, damage)),
        }
    }
    let instead = match &newest {
        Some(checkpoint) => format!("the other one is used, with {} passes", checkpoint.sum.passes()),
        None => "there is no other one: the job starts from nothing".into(),
    };
    for (file, damage) in damaged {
        warn!("{} is damaged ({damage}); {instead}", file.display());
    }
    Ok(newest)
}

#[cfg(test)]
mod tests;
