//! Frames are made ready while the one before renders: read, and given their settings by a pilot.

use super::names::Names;
use super::record::FrameRecord;
use crate::directory::{Directory, prepare};
use crate::failure::Failure;
use crate::job::{Aov, Budgeted, JobArgs};
use crate::onlookers::Share;
use crate::output::{Output, denoised_name};
use beamfarm_coordinator::{JobSpec, Start};
use beamfarm_image::error::ImageError;
use beamfarm_image::exr::{MadeOf, read_rgb};
use beamfarm_image::png::{view_of, write_png};
use beamfarm_image::view::View;
use beamfarm_proto::VERSION;
use beamfarm_render::world::RenderDefaults;
use beamfarm_scene::{SceneFile, Store};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tokio::sync::mpsc::Sender;
use tracing::{Span, debug};

/// What is to be rendered, and how.
pub struct Order {
    pub args: JobArgs,
    pub frames: Vec<i64>,
    pub names: Names,
    /// Of the frames that earlier commands rendered.
    pub known: BTreeMap<i64, FrameRecord>,
    pub audit_every: u64,
    /// Keep a job folder of each frame even if nobody asked for it.
    pub keeps_jobs: bool,
    /// What frames have in common is decoded once.
    pub store: Mutex<Store>,
}

/// A frame that can be rendered.
pub struct Ready {
    pub frame: i64,
    /// As if it was the only one.
    pub args: JobArgs,
    pub output: Output,
    pub view: View,
    pub spec: JobSpec,
    pub directory: Option<Directory>,
    pub start: Start,
    pub notes: Vec<String>,
    pub left_out: Vec<String>,
}

/// What became of a frame before its turn.
pub enum Prepared {
    Ready(Box<Ready>),
    /// Its image is there.
    Kept(Box<FrameRecord>),
    Failed(Box<FrameRecord>),
}

/// Prepare all frames in order, each when the one before is taken.
pub async fn prepare_all(order: Arc<Order>, sender: Sender<Prepared>) {
    for frame in order.frames.clone() {
        // An error means that nobody wants more.
        let Ok(permit) = sender.reserve().await else {
            return;
        };
        let (order, span) = (order.clone(), Span::current());
        let args = order.of_frame(frame);
        let asked = args.clone();
        let work = move || span.in_scope(|| order.prepared(frame, args));
        let prepared = tokio::task::spawn_blocking(work).await;
        let prepared = prepared.unwrap_or_else(|error| Err(Failure::io(error)));
        permit.send(prepared.unwrap_or_else(|failure| {
            let failed = FrameRecord::failed(frame, &asked, failure.to_string());
            Prepared::Failed(Box::new(failed))
        }));
    }
}

impl Order {
    /// Which part of all frames this one is.
    pub fn share(&self, frame: i64) -> Share {
        Share {
            before: self.frames.iter().take_while(|other| **other < frame).count(),
            of: self.frames.len(),
        }
    }

    /// What a command would be told that renders this frame alone.
    pub fn of_frame(&self, frame: i64) -> JobArgs {
        let mut args = self.args.clone();
        args.settings.of.import.frame = Some(frame);
        args.settings.of.seed_of_frame = args.frames.seed_per_frame.then_some(frame);
        args.output = self.names.image(frame);
        args.job = self.names.job(frame);
        args
    }

    fn prepared(&self, frame: i64, args: JobArgs) -> Result<Prepared, Failure> {
        let ending = Names::ending(frame);
        let of = &args.settings.of;
        let image = Output::path(args.output.as_deref(), &of.scene, &ending)?;
        if let Some(made) = MadeOf::read(&image)
            && image.with_extension("png").exists()
            && (!args.denoise || denoised_name(&image).exists())
        {
            // No pilot is needed to see that nothing is to be done.
            let file = of.file()?;
            let view = args.view.over(file.defaults()?.view);
            if self.is_there(frame, &args, (&image, &made), file)? {
                show(&image, view)?;
                let known = self.known.get(&frame).filter(|known| known.is_of(&image, &made));
                let record = known
                    .cloned()
                    .unwrap_or_else(|| FrameRecord::kept(frame, &args, &image, made));
                return Ok(Prepared::Kept(Box::new(record)));
            }
        }
        let begun = Instant::now();
        let decode = |file: &SceneFile| {
            let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
            file.load_from(&mut store)
        };
        let loaded = args.settings.load_by(decode, |_| {})?;
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

    /// Whether the image is the one that this command would make.
    fn is_there(
        &self,
        frame: i64,
        args: &JobArgs,
        (image, made): (&Path, &MadeOf),
        file: SceneFile,
    ) -> Result<bool, Failure> {
        let defaults = file.defaults()?;
        let is_enough = match self.known.get(&frame) {
            Some(known) if known.answers(args) && known.is_of(image, made) => true,
            _ => has_passes(args, made, &defaults),
        };
        Ok(
            is_enough
                && has_settings(args, made, &defaults)
                && file.canonical_bundle().hash().to_string() == made.scene,
        )
    }
}

/// Have the PNG beside an image show it in this view.
fn show(image: &Path, view: View) -> Result<(), ImageError> {
    let png = image.with_extension("png");
    match view_of(&png) == Some(view) {
        true => Ok(()),
        false => write_png(&png, &read_rgb(image)?, view),
    }
}

/// Whether it has the passes that are asked for. Where a time or an error is, the record of all frames has to say so.
fn has_passes(args: &JobArgs, made: &MadeOf, defaults: &RenderDefaults) -> bool {
    let is_open = args.time.is_some() || args.target_error.is_some();
    match args.passes {
        Some(passes) => made.passes >= passes,
        None => !is_open && made.passes >= defaults.passes,
    }
}

/// Whether it is made with the settings that are asked for, as far as no pilot chooses them.
fn has_settings(args: &JobArgs, made: &MadeOf, defaults: &RenderDefaults) -> bool {
    let of = &args.settings.of;
    let paths = of.paths.or(defaults.paths_per_pass).map(u64::from);
    let budget = match args.settings.budget {
        None | Some(Budgeted::Endless) => made.budget.is_none(),
        Some(Budgeted::Passes(passes)) => {
            let begins = format!("{passes} passes at ");
            made.budget.as_ref().is_some_and(|budget| budget.starts_with(&begins))
        }
    };
    let shown = |aov: &Aov| made.channels.iter().any(|name| name.starts_with(aov.channels()));
    // Another version may render other bits.
    made.version == VERSION
        && made.seed == of.seed_or(defaults.seed)
        && made.alpha == of.alpha.unwrap_or(defaults.alpha)
        && paths.is_none_or(|paths| paths == made.paths_per_pass)
        && budget
        && Aov::all(&args.settings.aov).iter().all(shown)
}
