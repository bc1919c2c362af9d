//! The frames of an animation: each is a job; all share one coordinator and its workers.

mod ahead;
mod alone;
mod names;
mod one;
mod record;
mod stage;
mod there;

use crate::failure::Failure;
use crate::frame_list::FrameList;
use crate::job::JobArgs;
use crate::local::Crew;
use crate::onlookers::hang_ups;
use crate::progress;
use ahead::{Order, Prepared, prepare_all};
use alone::{Alone, clear};
use beamfarm_coordinator::security::Security;
use beamfarm_coordinator::server;
use beamfarm_coordinator::{FrameState, FrameView, Who};
use beamfarm_worker::{say, signals};
use names::Names;
use one::{Begun, Outcome};
use record::{FrameRecord, Record};
use stage::Stage;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, OnceLock};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tracing::Instrument;

/// The most frames in memory: those that render, and those waiting for a full disk.
const HELD: usize = 4;

/// Where frames are rendered.
pub struct Site {
    /// Address to listen on.
    pub listen: SocketAddr,
    pub security: Security,
    /// Workers on this machine, without the coordinator's address.
    pub crew: Option<Crew>,
    /// How many blocks are rendered twice: see [`beamfarm_coordinator::JobSpec::audit_every`].
    pub audit_every: u64,
    /// Keep a job folder of each frame even if none was requested.
    pub keeps_jobs: bool,
    /// Open the page.
    pub open: bool,
    /// Whether to print the listen address.
    pub says_address: bool,
}

/// Render frames of the scene's animation.
pub fn run(args: &JobArgs, list: &FrameList, site: Site) -> Result<(), Failure> {
    let of = &args.settings.of;
    if of.import.says_frame() {
        let message =
            "--frames says which frames are rendered, and -D animation.frame another one: expected one of them";
        return Err(Failure::usage(message));
    }
    let options = of.import.options(&of.scene)?;
    let range = beamfarm_scene::frames(&of.scene, &options).map_err(|error| of.failure(error, &options))?;
    let Some(range) = range else {
        return Err(Failure::usage(format!(
            "{}: --frames: the scene does not say which frames there are; expected a table such as `[animation]` with `frames = [1, 48]`",
            of.scene.display()
        )));
    };
    let frames = list
        .of(range)
        .map_err(|error| Failure::usage(format!("--frames: {error}")))?;
    let names = Names::new(args)?;
    let _alone = Alone::at(&names.report())?;
    clear(&names, &frames);
    let record = Record::open(names.report());
    let order = Order {
        known: frames
            .iter()
            .filter_map(|frame| Some((*frame, record.get(*frame)?.clone())))
            .collect(),
        args: args.clone(),
        audit_every: site.audit_every,
        keeps_jobs: site.keeps_jobs,
        store: Mutex::default(),
        engine: OnceLock::new(),
        frames,
        names,
    };
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::io)?;
    let done = runtime.block_on(async {
        let work = Work::new(Arc::new(order), record);
        work.render(site).await
    });
    progress::clear();
    args.onlookers.tell_end(&done);
    done
}

/// Frames rendered one after another.
struct Work {
    order: Arc<Order>,
    record: Record,
    /// Finished frames, from this command or an earlier one.
    through: BTreeMap<i64, FrameView>,
    /// Why frames failed, in order of failure.
    failures: Vec<(i64, String)>,
    /// Messages about scenes that were printed.
    said: BTreeSet<String>,
    running: JoinSet<Outcome>,
    /// Whether someone asked to stop.
    is_ended: bool,
}

impl Work {
    fn new(order: Arc<Order>, record: Record) -> Self {
        Self {
            order,
            record,
            through: BTreeMap::new(),
            failures: Vec::new(),
            said: BTreeSet::new(),
            running: JoinSet::new(),
            is_ended: false,
        }
    }

    async fn render(mut self, site: Site) -> Result<(), Failure> {
        // Before anything shows that it is listening.
        let mut drain = signals::drain().map_err(Failure::io)?;
        let hang_ups = hang_ups().map_err(Failure::io)?;
        let listener = server::listen(site.listen);
        let listener = listener.map_err(|error| Failure::io(format!("cannot listen on {}: {error}", site.listen)))?;
        if site.says_address && !self.order.args.quiet {
            let address = listener.local_addr().map_err(Failure::io)?;
            say!("listening on {}://{address}", site.security.scheme());
        }
        let (sender, mut prepared) = mpsc::channel(1);
        tokio::spawn(prepare_all(self.order.clone(), sender).in_current_span());
        // Workers start only when there is something to render.
        let first = loop {
            let prepared = tokio::select! {
                biased;
                _ = drain.wait_for(|drain| *drain) => None,
                prepared = prepared.recv() => prepared,
            };
            match prepared {
                None => {
                    let was_signal = *drain.borrow();
                    return self.conclude(was_signal).await;
                }
                Some(Prepared::Ready(ready)) => match self.begin(*ready, Vec::new()) {
                    Some(begun) => break begun,
                    None => continue,
                },
                Some(through) => self.skip(through),
            }
        };
        let (begun, breaker) = first;
        let mut stage = Stage::open(begun.watch.clone(), listener, site, hang_ups, &self.order)?;
        self.tell_all(&stage);
        self.start(&mut stage, begun, breaker);
        let series = stage.series.clone();
        let mut next = None;
        let mut is_last = false;
        loop {
            if is_last && next.is_none() {
                series.seal();
                if self.running.is_empty() {
                    break;
                }
            }
            tokio::select! {
                biased;
                Some(outcome) = self.running.join_next(), if !self.running.is_empty() => {
                    let outcome = outcome.map_err(Failure::io)?;
                    self.finish(&mut stage, outcome);
                }
                _ = drain.wait_for(|drain| *drain), if !self.is_ended => self.end(&stage),
                () = stage.keep() => {}
                () = self.record.keep() => {}
                came = prepared.recv(), if next.is_none() && !is_last => match came {
                    Some(Prepared::Ready(ready)) => next = Some(ready),
                    Some(through) => {
                        self.skip(through);
                        self.tell_all(&stage);
                    }
                    None => is_last = true,
                },
                wanted = series.wants_another(), if next.is_some() && self.running.len() < HELD => if let Some(ready) = next.take_if(|_| wanted)
                    && let Some((begun, breaker)) = self.begin(*ready, series.convicted())
                {
                    series.open(begun.watch.clone());
                    self.start(&mut stage, begun, breaker);
                }
            }
            if series.is_cancelled() {
                self.is_ended = true;
                (next, is_last) = (None, true);
                prepared.close();
            }
        }
        stage.close().await;
        let was_signal = *drain.borrow();
        self.conclude(was_signal).await
    }

    /// Start a frame whose turn has come; `None` if it fails at once.
    fn begin(&mut self, ready: ahead::Ready, convicted: Vec<Who>) -> Option<(Begun, stage::Breaker)> {
        let share = self.order.share(ready.frame);
        match Begun::new(ready, share, convicted, &mut self.said) {
            Ok(begun) => Some(begun),
            Err(failed) => {
                self.skip(Prepared::Failed(failed));
                None
            }
        }
    }

    fn start(&mut self, stage: &mut Stage, begun: Begun, breaker: stage::Breaker) {
        stage.series.note_frame(begun.view());
        stage.watch_over(begun.watch.clone(), breaker);
        let span = tracing::error_span!("job", job = begun.watch.id());
        let render = begun.render(stage.series.clone(), stage.address);
        self.running.spawn(render.instrument(span));
    }

    /// A frame is rendered or has failed.
    fn finish(&mut self, stage: &mut Stage, outcome: Outcome) {
        let Outcome { watch, record, label } = outcome;
        stage.series.close(&watch);
        stage.forget(&watch);
        stage.series.note_frame(record.view());
        if let Some(message) = &record.message {
            self.fail(record.frame, message.clone());
        } else if !self.order.args.quiet {
            progress::print(&format!("{label}: {}", in_a_line(&record)));
        }
        self.through.insert(record.frame, record.view());
        self.record.enter(record);
    }

    /// A frame that needs no rendering, or cannot be rendered.
    fn skip(&mut self, prepared: Prepared) {
        match prepared {
            Prepared::Ready(_) => {}
            Prepared::Kept(kept) => {
                let (frame, passes) = (kept.frame, kept.passes);
                if !self.order.args.quiet {
                    let label = self.order.share(frame).label(frame);
                    let image = kept.image.as_deref().unwrap_or_default();
                    progress::print(&format!("{label}: {image} is there already, with {passes} passes"));
                }
                let view = FrameView {
                    state: FrameState::Kept,
                    ..kept.view()
                };
                self.through.insert(frame, view);
                if self.record.get(frame) != Some(&*kept) {
                    self.record.enter(*kept);
                }
            }
            Prepared::Failed(failed) => {
                self.fail(failed.frame, failed.message.clone().unwrap_or_default());
                self.through.insert(failed.frame, failed.view());
                self.record.enter(*failed);
            }
        }
    }

    fn fail(&mut self, frame: i64, message: String) {
        let plain = message.strip_prefix("error: ").unwrap_or(&message).to_owned();
        progress::complain(&format!("frame {frame} failed: {plain}"));
        self.failures.push((frame, plain));
    }

    /// Update the page's list of frames.
    fn tell_all(&self, stage: &Stage) {
        let known: BTreeSet<i64> = stage.series.frames().iter().map(|view| view.frame).collect();
        for frame in &self.order.frames {
            match self.through.get(frame) {
                Some(view) => stage.series.note_frame(view.clone()),
                None if !known.contains(frame) => stage.series.note_frame(FrameView::waiting(*frame)),
                None => {}
            }
        }
    }

    /// A signal has arrived.
    fn end(&mut self, stage: &Stage) {
        self.is_ended = true;
        stage.series.cancel();
    }

    /// How the command ended.
    async fn conclude(mut self, was_signal: bool) -> Result<(), Failure> {
        let recorded = self.record.finish(was_signal || self.is_ended).await;
        let all = self.order.frames.len();
        let is_there = |view: &&FrameView| matches!(view.state, FrameState::Done | FrameState::Kept);
        let there = self.through.values().filter(is_there).count();
        if !self.order.args.quiet {
            progress::print(&format!(
                "{there} of {all} frames are there; {} tells of each",
                self.order.names.report().display()
            ));
        }
        if let Some((_, first)) = self.failures.first() {
            let distinct: BTreeSet<&String> = self.failures.iter().map(|(_, message)| message).collect();
            if self.failures.len() == all && distinct.len() == 1 && all > 1 {
                return Err(Failure::job(format!("all {all} frames failed: {first}")));
            }
            let list: Vec<String> = self
                .failures
                .iter()
                .map(|(frame, message)| format!("frame {frame}: {message}"))
                .collect();
            return Err(Failure::job(format!(
                "{} of {all} frames failed:\n  {}",
                self.failures.len(),
                list.join("\n  ")
            )));
        }
        recorded?;
        if there == all {
            return Ok(());
        }
        let message = format!("stopped when {there} of {all} frames were there");
        let has_some = self.through.values().any(|view| view.passes > 0);
        match (was_signal && self.order.args.preemptible, has_some) {
            (true, _) => Err(Failure::preempted(message)),
            (false, true) => Ok(()),
            (false, false) => Err(Failure::nothing(
                "stopped before the first pass of a frame was complete",
            )),
        }
    }
}

/// The result of a frame in one line.
fn in_a_line(record: &FrameRecord) -> String {
    let Some(image) = &record.image else {
        return "stopped before its first pass was complete".into();
    };
    let error = record.relative_standard_error;
    let error = error.map_or_else(String::new, |error| format!(", error {:.2} %", 100.0 * error));
    let pixels = record.pixels.as_deref().unwrap_or_default();
    format!(
        "wrote {image}, {} passes in {:.1} s{error}, pixels {pixels}",
        record.passes, record.seconds
    )
}
