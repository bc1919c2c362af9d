//! Prepares each frame while the one before renders: reads it and lets a pilot choose its settings.

use super::names::Names;
use super::record::FrameRecord;
use crate::again::Again;
use crate::directory::{Directory, prepare};
use crate::failure::Failure;
use crate::job::JobArgs;
use crate::onlookers::Share;
use crate::output::Output;
use beamfarm_coordinator::{JobSpec, Start};
use beamfarm_image::atomic::folder_of;
use beamfarm_image::bundle::MAX_BYTES;
use beamfarm_image::input;
use beamfarm_image::job::{EngineChoice, EngineKind};
use beamfarm_image::view::View;
use beamfarm_scene::{SceneFile, Store};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;
use tokio::sync::mpsc::Sender;
use tracing::{Span, debug};

/// What to render, and how.
pub struct Order {
    pub args: JobArgs,
    pub frames: Vec<i64>,
    pub names: Names,
    /// Records of frames that earlier commands rendered.
    pub known: BTreeMap<i64, FrameRecord>,
    pub audit_every: u64,
    /// Keep a job folder of each frame even if none was requested.
    pub keeps_jobs: bool,
    /// Shared by all frames, so that common files are decoded once.
    pub store: Mutex<Store>,
    /// The engine measured for the first frame, if any; all frames use it.
    pub engine: OnceLock<EngineKind>,
}

/// A frame that is ready to render.
pub struct Ready {
    pub frame: i64,
    /// The arguments for this frame alone.
    pub args: JobArgs,
    pub output: Output,
    pub view: View,
    pub spec: JobSpec,
    pub directory: Option<Directory>,
    pub start: Start,
    pub notes: Vec<String>,
    pub left_out: Vec<String>,
}

/// The result of preparing a frame.
pub enum Prepared {
    Ready(Box<Ready>),
    /// Its image already exists.
    Kept(Box<FrameRecord>),
    Failed(Box<FrameRecord>),
}

/// Prepare all frames in order, each when the one before is taken.
pub async fn prepare_all(order: Arc<Order>, sender: Sender<Prepared>) {
    for frame in order.frames.clone() {
        // An error means that no more frames are wanted.
        let Ok(permit) = sender.reserve().await else {
            return;
        };
        let args = order.of_frame(frame);
        let mut again = Again::default();
        let prepared = loop {
            let (order, args, span) = (order.clone(), args.clone(), Span::current());
            let work = move || {
                let prepared = span.in_scope(|| order.prepared(frame, args));
                prepared.map_err(|failure| match order.is_gone() {
                    true => failure.passing(),
                    false => failure,
                })
            };
            let prepared = tokio::task::spawn_blocking(work).await;
            let prepared = prepared.unwrap_or_else(|error| Err(Failure::io(error)));
            if let Some(prepared) = again.settled(prepared, sender.is_closed()).await {
                break prepared;
            }
        };
        permit.send(prepared.unwrap_or_else(|failure| {
            let failed = FrameRecord::failed(frame, &args, failure.to_string());
            Prepared::Failed(Box::new(failed))
        }));
    }
}

impl Order {
    /// This frame's share of the whole.
    pub fn share(&self, frame: i64) -> Share {
        Share {
            before: self.frames.iter().take_while(|other| **other < frame).count(),
            of: self.frames.len(),
        }
    }

    /// The arguments of a command that renders this frame alone.
    pub fn of_frame(&self, frame: i64) -> JobArgs {
        let mut args = self.args.clone();
        if let Some(engine) = self.engine.get() {
            args.settings.engine = Some(EngineChoice::Is(*engine));
        }
        args.settings.of.import.frame = Some(frame);
        args.settings.of.seed_of_frame = args.frames.seed_per_frame.then_some(frame);
        args.output = self.names.image(frame);
        args.job = self.names.job(frame);
        args
    }

    /// Whether the scene file or the images' folder has disappeared; both existed at the start.
    fn is_gone(&self) -> bool {
        let report = self.names.report();
        input::read(&self.args.settings.of.scene, MAX_BYTES).is_err() || std::fs::read_dir(folder_of(&report)).is_err()
    }

    fn prepared(&self, frame: i64, args: JobArgs) -> Result<Prepared, Failure> {
        let ending = Names::ending(frame);
        let of = &args.settings.of;
        let image = Output::path(args.output.as_deref(), &of.scene, &ending)?;
        if let Some(kept) = self.kept(frame, &args, &image)? {
            return Ok(Prepared::Kept(Box::new(kept)));
        }
        let begun = Instant::now();
        let decode = |file: &SceneFile| {
            let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
            file.load_from(&mut store)
        };
        let choosing = |scene| args.choosing(&ending, scene);
        let loaded = args.settings.load_by(decode, choosing, |_| {})?;
        let _ = self.engine.set(loaded.settings.engine);
        debug!(frame, seconds = begun.elapsed().as_secs_f64(), "loaded");
        let view = args.view.over(loaded.defaults.view);
        let output = args.image_called(&ending, &loaded)?;
        let (notes, left_out) = loaded.news();
        let (notes, left_out) = (notes.to_vec(), left_out.to_vec());
        let mut spec = args.spec(loaded)?;
        spec.audit_every = self.audit_every;
        let (directory, start) = prepare(&args, &mut spec, &output, view, self.keeps_jobs)?;
        Ok(Prepared::Ready(Box::new(Ready {
            frame,
            args,
            output,
            view,
            spec,
            directory,
            start,
            notes,
            left_out,
        })))
    }
}
