//! The record of all frames: one file that is updated after each frame and stays valid if the command is killed.

use crate::again::{Again, warn_of};
use crate::failure::Failure;
use crate::job::JobArgs;
use beamfarm_coordinator::store::{RETRY, Report, Stopped};
use beamfarm_coordinator::{FrameState, FrameView};
use beamfarm_image::atomic::write_file;
use beamfarm_image::exr::{MadeOf, pixel_hash};
use beamfarm_image::film::Film;
use beamfarm_image::input;
use beamfarm_proto::VERSION;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::future::pending;
use std::path::{Path, PathBuf};
use tokio::time::{Instant, sleep_until};

/// Version of the format.
const FORMAT: u32 = 1;

/// How a frame ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Its number.
    pub frame: i64,
    /// `complete`, `target-error`, `time`, `asked` or `failed`, as in a job's report.
    pub stopped: String,
    /// Why it failed.
    pub message: Option<String>,
    /// The stopping conditions of the command; the frame is up to date only for the same ones.
    pub asked: String,
    /// Hash of the scene bundle.
    pub scene: Option<String>,
    pub seed: Option<u64>,
    /// Path of the image, if any.
    pub image: Option<String>,
    /// Hash of its pixels.
    pub pixels: Option<String>,
    /// Passes in the image.
    pub passes: u64,
    pub relative_standard_error: Option<f64>,
    /// Time spent on it, over all commands.
    pub seconds: f64,
}

impl FrameRecord {
    /// A frame that was rendered.
    pub fn of(frame: i64, args: &JobArgs, report: &Report, message: Option<String>) -> Self {
        Self {
            frame,
            stopped: match message {
                Some(_) => Stopped::Failed.as_str().into(),
                None => report.stopped.as_str().into(),
            },
            message,
            asked: asked(args),
            scene: Some(report.scene.clone()),
            seed: Some(report.seed),
            image: report.image.clone(),
            pixels: report.pixels.clone(),
            passes: report.prefix,
            relative_standard_error: report.relative_standard_error,
            seconds: report.seconds,
        }
    }

    /// A frame whose image exists without a record: the command that wrote it was killed.
    pub fn kept(frame: i64, args: &JobArgs, image: &Path, (made, film): (MadeOf, &Film)) -> Self {
        Self {
            frame,
            stopped: Stopped::Complete.as_str().into(),
            message: None,
            asked: asked(args),
            seed: Some(made.seed),
            image: Some(image.display().to_string()),
            pixels: Some(pixel_hash(film)),
            passes: made.passes,
            relative_standard_error: Some(made.relative_error).filter(|error| error.is_finite()),
            seconds: made.seconds,
            scene: Some(made.scene),
        }
    }

    /// Whether the record describes this image.
    pub fn is_of(&self, image: &Path, made: &MadeOf) -> bool {
        self.image.as_deref() == Some(&*image.to_string_lossy())
            && self.passes == made.passes
            && self.seed == Some(made.seed)
            && self.scene.as_ref() == Some(&made.scene)
    }

    /// A frame that failed before its first pass.
    pub fn failed(frame: i64, args: &JobArgs, message: String) -> Self {
        Self {
            frame,
            stopped: Stopped::Failed.as_str().into(),
            message: Some(message),
            asked: asked(args),
            scene: None,
            seed: None,
            image: None,
            pixels: None,
            passes: 0,
            relative_standard_error: None,
            seconds: 0.0,
        }
    }

    /// Whether it met what was requested.
    pub fn is_complete(&self) -> bool {
        let ends = [Stopped::Complete, Stopped::TargetError, Stopped::Time];
        ends.iter().any(|end| end.as_str() == self.stopped)
    }

    /// Whether this command has the same stopping conditions.
    pub fn answers(&self, args: &JobArgs) -> bool {
        self.is_complete() && self.asked == asked(args)
    }

    /// The frame in the page's list.
    pub fn view(&self) -> FrameView {
        FrameView {
            state: match self.is_complete() {
                true => FrameState::Done,
                false if self.message.is_some() => FrameState::Failed,
                false => FrameState::Stopped,
            },
            passes: self.passes,
            error: self.relative_standard_error,
            seconds: Some(self.seconds),
            message: self.message.clone(),
            picture: self.image.as_ref().map(|image| Path::new(image).with_extension("png")),
            ..FrameView::waiting(self.frame)
        }
    }
}

/// A frame's stopping conditions, in words.
fn asked(args: &JobArgs) -> String {
    let passes = args.passes.map(|passes| format!("{passes} passes"));
    let time = args.time.map(|time| format!("{} s", time.as_secs_f64()));
    let error = args.target_error.map(|error| match args.target_percentile {
        Some(percentile) => format!("error {error} at {percentile} %"),
        None => format!("error {error}"),
    });
    let all: Vec<String> = [passes, time, error].into_iter().flatten().collect();
    match all.is_empty() {
        true => "the scene's passes".into(),
        false => all.join(", "),
    }
}

/// The file's content.
#[derive(Serialize, Deserialize)]
struct Whole {
    format: u32,
    version: String,
    /// Failed frames, in order.
    failed: Vec<i64>,
    /// All frames ever rendered to this name, in order.
    frames: Vec<FrameRecord>,
}

/// The record of all frames.
pub struct Record {
    path: PathBuf,
    frames: BTreeMap<i64, FrameRecord>,
    /// Why the file is out of date, and when to retry.
    behind: Option<(Failure, Instant)>,
}

/// The largest report that is read, in bytes: a few hundred per frame.
const MOST_BYTES: u64 = 1 << 30;

impl Record {
    /// Read the record; empty if the file is missing or is something else.
    pub fn open(path: PathBuf) -> Self {
        let known = input::read(&path, MOST_BYTES).ok();
        let known = known.and_then(|bytes| serde_json::from_slice::<Whole>(&bytes).ok());
        let known = known.filter(|whole| whole.format == FORMAT);
        let frames = known.into_iter().flat_map(|whole| whole.frames);
        Self {
            path,
            frames: frames.map(|frame| (frame.frame, frame)).collect(),
            behind: None,
        }
    }

    /// The record of a frame.
    pub fn get(&self, frame: i64) -> Option<&FrameRecord> {
        self.frames.get(&frame)
    }

    /// Record how a frame ended. If the file cannot be written now, [`Self::keep`] or [`Self::finish`] writes it.
    pub fn enter(&mut self, frame: FrameRecord) {
        self.frames.insert(frame.frame, frame);
        self.try_write();
    }

    fn try_write(&mut self) {
        self.behind = self.write().err().map(|failure| {
            warn_of(&failure);
            (failure, Instant::now() + RETRY)
        });
    }

    /// Resolves after an overdue write was retried; never if nothing is overdue. May be dropped and called again.
    pub async fn keep(&mut self) {
        match &self.behind {
            Some((_, due)) => sleep_until(*due).await,
            None => pending().await,
        }
        self.try_write();
    }

    /// Write what is overdue. `is_over`: do not wait for a disk.
    pub async fn finish(&mut self, is_over: bool) -> Result<(), Failure> {
        if self.behind.take().is_none() {
            return Ok(());
        }
        let mut again = Again::default();
        loop {
            if let Some(written) = again.settled(self.write(), is_over).await {
                return written;
            }
        }
    }

    fn write(&self) -> Result<(), Failure> {
        let frames: Vec<FrameRecord> = self.frames.values().cloned().collect();
        let failed = frames.iter().filter(|frame| frame.message.is_some());
        let whole = Whole {
            format: FORMAT,
            version: VERSION.into(),
            failed: failed.map(|frame| frame.frame).collect(),
            frames,
        };
        let mut json = serde_json::to_vec_pretty(&whole).map_err(Failure::io)?;
        json.push(b'\n');
        Ok(write_file(&self.path, &json)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(frame: i64, stopped: &str, message: Option<&str>) -> FrameRecord {
        FrameRecord {
            frame,
            stopped: stopped.into(),
            message: message.map(Into::into),
            asked: "4 passes".into(),
            scene: None,
            seed: Some(u64::MAX),
            image: Some("a.0001.exr".into()),
            pixels: None,
            passes: 4,
            relative_standard_error: Some(0.125),
            seconds: 0.5,
        }
    }

    #[test]
    fn frames_of_other_commands_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.report.json");
        let mut first = Record::open(path.clone());
        first.enter(record(2, "complete", None));
        first.enter(record(1, "failed", Some("no")));
        let mut again = Record::open(path.clone());
        assert_eq!(again.get(2), Some(&record(2, "complete", None)));
        again.enter(record(3, "asked", None));
        let text = std::fs::read_to_string(&path).unwrap();
        let whole: Whole = serde_json::from_str(&text).unwrap();
        assert_eq!(whole.failed, [1]);
        let states = whole.frames.iter().map(|frame| frame.view().state);
        let states: Vec<FrameState> = states.collect();
        assert_eq!(states, [FrameState::Failed, FrameState::Done, FrameState::Stopped]);
        // A file of another kind is replaced.
        std::fs::write(&path, "{").unwrap();
        assert_eq!(Record::open(path).get(2), None);
    }

    /// A missing folder stands for a full disk.
    #[tokio::test]
    async fn what_cannot_be_written_is_known_and_written_later() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("later/a.report.json");
        let mut record_of_all = Record::open(path.clone());
        record_of_all.enter(record(1, "complete", None));
        assert!(record_of_all.behind.is_some());
        let said = record_of_all.finish(true).await.unwrap_err().to_string();
        assert!(said.contains("a.report.json"), "{said}");
        record_of_all.enter(record(2, "complete", None));
        std::fs::create_dir(folder.path().join("later")).unwrap();
        record_of_all.finish(true).await.unwrap();
        let written = Record::open(path.clone());
        assert!([1, 2].iter().all(|frame| written.get(*frame).is_some()));
        // Nothing is left to write.
        std::fs::remove_file(&path).unwrap();
        record_of_all.finish(true).await.unwrap();
        assert!(!path.exists());
    }
}
