//! Who renders what of which revision: a state machine without clock or network.
//!
//! A worker does one task at a time. Of the last revision, sketches are handed out from coarse to fine, each once; when
//! none is left and the job is known, its passes. A new revision drops whatever is under way but the coarsest sketch,
//! which is nearly done: a steady drag shows pictures that are one change old rather than none. What arrives for a task
//! that is not its worker's any more counts for nothing.

use super::ladder::{Ladder, Step};
use beamfarm_image::film::Film;
use beamfarm_image::job::JobSettings;
use beamfarm_image::layer::LayerCounts;
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_image::radius::Schedule;
use beamfarm_proto::{RevisionNumber, Task, TaskNumber, Work, WorkerId};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Failures of a revision's tasks after which no more are handed out.
const FAILURES: u32 = 3;

/// What the passes of a revision are, once that is known.
#[derive(Clone, Debug)]
pub struct Job {
    /// What passes depend on beside the scene.
    pub settings: JobSettings,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Passes in all.
    pub limit: u64,
}

/// What sketches of a revision are made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Without the number of photon paths.
    pub settings: JobSettings,
    /// The world's point that is the origin of render space.
    pub origin: [f64; 3],
}

/// How good a picture is; of one revision only better ones follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quality {
    /// A sketch of this step.
    Sketch(usize),
    /// The average of so many passes.
    Passes(u64),
}

/// What is under way.
#[derive(Clone, Copy, Debug)]
struct Doing {
    task: Task,
    what: What,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Sketch(usize),
    Pass(u64),
}

/// A worker.
#[derive(Debug, Default)]
struct Seat {
    doing: Option<Doing>,
    /// What it has not been told yet that nobody wants.
    to_drop: Option<TaskNumber>,
}

/// The passes of a revision.
struct Passes {
    job: Job,
    /// First that was never handed out.
    next: u64,
    /// Handed out, and lost.
    returned: BTreeSet<u64>,
    sum: TreeSum,
}

/// What became of a delivery.
#[derive(Debug, PartialEq)]
pub enum Verdict {
    /// A sketch that is newer or better than what is shown.
    Sketch {
        /// Of what.
        revision: RevisionNumber,
        /// Its step, and how many there are.
        step: usize,
        /// See `step`.
        steps: usize,
    },
    /// A pass counts: so many are complete from the first on.
    Pass {
        /// Of what.
        revision: RevisionNumber,
        /// Complete passes.
        prefix: u64,
    },
    /// Nobody wants it any more.
    Late,
    /// It is not what was asked for: why.
    Wrong(String),
}

/// The state of a live view.
pub struct Desk {
    revision: RevisionNumber,
    style: Style,
    ladder: Ladder,
    steps: Vec<Step>,
    /// First step that was not handed out.
    next_step: usize,
    passes: Option<Passes>,
    seats: BTreeMap<WorkerId, Seat>,
    last_task: u64,
    /// The best picture of the newest revision that has one.
    shown: Option<(RevisionNumber, Quality)>,
    failures: u32,
}

impl Desk {
    /// A desk with sketches of up to this size. Nothing is handed out before the first [`Self::revise`].
    pub fn new(full: [u32; 2], style: Style) -> Self {
        let ladder = Ladder::new(full);
        Self {
            revision: RevisionNumber(0),
            style,
            steps: Vec::new(),
            ladder,
            next_step: 0,
            passes: None,
            seats: BTreeMap::new(),
            last_task: 0,
            shown: None,
            failures: 0,
        }
    }

    /// The scene has changed. All but the coarsest sketches under way are dropped.
    pub fn revise(&mut self, revision: RevisionNumber, full: [u32; 2], style: Style) {
        debug_assert!(revision > self.revision);
        self.revision = revision;
        self.style = style;
        self.ladder.resize(full);
        self.steps = self.ladder.steps();
        if self.shown.is_none() {
            self.steps.insert(0, self.ladder.glance());
        }
        self.next_step = 0;
        self.passes = None;
        self.failures = 0;
        for seat in self.seats.values_mut() {
            if let Some(doing) = seat.doing.take_if(|doing| doing.what != What::Sketch(0)) {
                seat.to_drop = Some(doing.task.number);
            }
        }
    }

    /// What the passes of a revision are is known now. Of no effect when there is a newer one.
    pub fn settle(&mut self, revision: RevisionNumber, job: Job) {
        if revision != self.revision || self.passes.is_some() {
            return;
        }
        self.passes = Some(Passes {
            sum: TreeSum::new(job.width, job.height),
            next: 0,
            returned: BTreeSet::new(),
            job,
        });
    }

    /// So many passes in all.
    pub fn extend(&mut self, limit: u64) {
        if let Some(passes) = &mut self.passes {
            passes.job.limit = limit;
        }
    }

    /// A worker is there.
    pub fn join(&mut self, worker: WorkerId) {
        self.seats.insert(worker, Seat::default());
    }

    /// A worker is gone, and what it had in hand is for others.
    pub fn leave(&mut self, worker: WorkerId) {
        if let Some(doing) = self.seats.remove(&worker).and_then(|seat| seat.doing) {
            self.take_back(doing);
        }
    }

    /// Workers that are there.
    pub fn workers(&self) -> usize {
        self.seats.len()
    }

    /// What a worker has to be told to drop, once.
    pub fn drop_of(&mut self, worker: WorkerId) -> Option<TaskNumber> {
        self.seats.get_mut(&worker)?.to_drop.take()
    }

    /// What an idle worker is to do; `None`: it has something to do, or there is nothing.
    pub fn next(&mut self, worker: WorkerId) -> Option<Task> {
        let seat = self.seats.get_mut(&worker)?;
        if seat.doing.is_some() || self.failures >= FAILURES {
            return None;
        }
        let (what, [width, height], work) = if let Some(step) = self.steps.get(self.next_step) {
            let settings = JobSettings {
                paths_per_pass: step.paths,
                budget: None,
                ..self.style.settings
            };
            let sketch = Work::Sketch {
                settings,
                // The same in all revisions: noise stands still.
                index: self.next_step as u64,
                origin: self.style.origin,
            };
            self.next_step += 1;
            (What::Sketch(self.next_step - 1), [step.width, step.height], sketch)
        } else {
            let passes = self.passes.as_mut()?;
            let pass_index = match passes.returned.pop_first() {
                Some(lost) => lost,
                None if passes.next < passes.job.limit => {
                    passes.next += 1;
                    passes.next - 1
                }
                None => return None,
            };
            let Job {
                settings,
                width,
                height,
                ..
            } = passes.job;
            (
                What::Pass(pass_index),
                [width, height],
                Work::Pass { settings, pass_index },
            )
        };
        self.last_task += 1;
        let task = Task {
            number: TaskNumber(self.last_task),
            revision: self.revision,
            width,
            height,
            work,
        };
        seat.doing = Some(Doing { task, what });
        Some(task)
    }

    /// The size of what a worker is rendering, if it is this task.
    pub fn size_of(&self, worker: WorkerId, task: TaskNumber) -> Option<[u32; 2]> {
        let doing = self.seats.get(&worker)?.doing?;
        (doing.task.number == task).then_some([doing.task.width, doing.task.height])
    }

    /// A worker has dropped a task, or says that it cannot be rendered.
    pub fn give_back(&mut self, worker: WorkerId, task: TaskNumber, has_failed: bool) {
        let Some(doing) = self.release(worker, task) else {
            return;
        };
        if has_failed && doing.task.revision == self.revision {
            self.failures += 1;
        }
        self.take_back(doing);
    }

    /// A worker has rendered a task. `took`: from its order to its picture.
    pub fn finish(&mut self, worker: WorkerId, task: TaskNumber, film: &Film, took: Duration) -> Verdict {
        let Some(doing) = self.release(worker, task) else {
            return Verdict::Late;
        };
        let asked = [doing.task.width, doing.task.height];
        if [film.width, film.height] != asked {
            self.take_back(doing);
            return Verdict::Wrong(format!(
                "expected {} x {} pixels, found {} x {}",
                asked[0], asked[1], film.width, film.height
            ));
        }
        let revision = doing.task.revision;
        match doing.what {
            What::Sketch(step) => {
                let bad = film.non_finite();
                if bad > 0 {
                    self.failures += u32::from(revision == self.revision);
                    return Verdict::Wrong(format!("{bad} pixels of a sketch are not finite"));
                }
                if step == 0 {
                    self.ladder.learn(took);
                }
                let quality = Quality::Sketch(step);
                if self.shown.is_some_and(|shown| shown >= (revision, quality)) {
                    return Verdict::Late;
                }
                self.shown = Some((revision, quality));
                let steps = self.steps.len();
                Verdict::Sketch { revision, step, steps }
            }
            What::Pass(pass_index) => {
                // Those of older revisions were dropped and released.
                let Some(passes) = self.passes.as_mut().filter(|_| revision == self.revision) else {
                    return Verdict::Late;
                };
                let scale = Schedule::new(&passes.job.settings).scale(pass_index);
                let node = Node::leaf(pass_index, film.clone());
                let inserted = node
                    .check(passes.job.width, passes.job.height, LayerCounts::default())
                    .and_then(|()| passes.sum.insert(node.with_radius_scale(scale)));
                if let Err(error) = inserted {
                    passes.returned.insert(pass_index);
                    self.failures += 1;
                    return Verdict::Wrong(error.to_string());
                }
                let prefix = passes.sum.prefix();
                if prefix > 0 {
                    self.shown = Some((revision, Quality::Passes(prefix)));
                }
                Verdict::Pass { revision, prefix }
            }
        }
    }

    /// The passes of the last revision: their job and their sum.
    pub fn passes(&self) -> Option<(&Job, &TreeSum)> {
        self.passes.as_ref().map(|passes| (&passes.job, &passes.sum))
    }

    /// Whether so much went wrong with the last revision that no more of it is handed out.
    pub fn has_failed(&self) -> bool {
        self.failures >= FAILURES
    }

    fn release(&mut self, worker: WorkerId, task: TaskNumber) -> Option<Doing> {
        let seat = self.seats.get_mut(&worker)?;
        seat.doing.take_if(|doing| doing.task.number == task)
    }

    fn take_back(&mut self, doing: Doing) {
        if doing.task.revision != self.revision {
            return;
        }
        match doing.what {
            // Finer ones that were handed out meanwhile will be handed out again, and only count where they are better.
            What::Sketch(step) => self.next_step = self.next_step.min(step),
            What::Pass(pass_index) => {
                if let Some(passes) = &mut self.passes {
                    passes.returned.insert(pass_index);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
