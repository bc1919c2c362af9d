//! Which worker renders what of which revision: a state machine without clock or network.
//!
//! A worker does one task at a time. Sketches of the last revision are handed out from coarse to fine, each once; then
//! its passes, once the job is known. A new revision drops every task under way except the coarsest sketch, which is
//! nearly done: during a steady drag you see pictures that are one change old rather than none. A delivery for a task
//! that its worker no longer holds is ignored.
//!
//! No worker stops the view. A task that it fails at, or that takes several times as long as usual, goes to others. A
//! worker that keeps failing at tasks which others then render is sent away. If no worker can render a task, none is to
//! blame, and the revision ends.

use super::ladder::{Ladder, Step};
use beamfarm_image::film::Film;
use beamfarm_image::job::JobSettings;
use beamfarm_image::layer::LayerCounts;
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_image::radius::Schedule;
use beamfarm_proto::{RevisionNumber, Task, TaskNumber, Work, WorkerId};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Failures at a revision after which a worker gets no more of it, and failures in a row at tasks that others then
/// rendered after which it is sent away.
const FAILURES: usize = 3;
/// A task that takes this many times as long as usual is also given to another worker.
const LONGEST: u32 = 8;
/// The shortest such time, for tasks that take next to nothing.
const LEAST_PATIENCE: Duration = Duration::from_secs(1);
/// The time where no such task has been timed yet and there is other work.
const PATIENCE: Duration = Duration::from_secs(20);
/// A worker that was too slow, so that another delivered first, gets nothing for this long. The time doubles with each
/// repetition.
const BACK_OFF: Duration = Duration::from_secs(1);
const MOST_DOUBLINGS: u32 = 6;

/// What the passes of a revision render, once known.
#[derive(Clone, Debug)]
pub struct Job {
    /// What passes depend on besides the scene.
    pub settings: JobSettings,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Total number of passes.
    pub limit: u64,
}

/// The settings of a revision's sketches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Sketches set their own number of photon paths.
    pub settings: JobSettings,
    /// The origin of render space, in world coordinates.
    pub origin: [f64; 3],
}

/// How good a picture is. Within a revision each picture shown is better than the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quality {
    /// A sketch of this step.
    Sketch(usize),
    /// The average of this many passes.
    Passes(u64),
}

/// A task under way.
#[derive(Clone, Copy, Debug)]
struct Doing {
    task: Task,
    what: What,
    begun: Duration,
    /// Whether another worker has it as well.
    is_shared: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    Sketch(usize),
    Pass(u64),
}

/// A worker.
#[derive(Debug, Default)]
struct Seat {
    doing: Option<Doing>,
    /// The task it must still be told to drop.
    to_drop: Option<TaskNumber>,
    /// Tasks that it failed at and others rendered, since it last rendered one.
    blames: usize,
    /// Tasks in a row that it did not deliver in time.
    late: u32,
    /// It gets nothing before this time.
    not_before: Duration,
}

/// The passes of a revision.
struct Passes {
    job: Job,
    /// The first pass that was never handed out.
    next: u64,
    /// Passes that were handed out and lost.
    returned: BTreeSet<u64>,
    sum: TreeSum,
}

/// What became of a delivery.
#[derive(Debug, PartialEq)]
pub enum Verdict {
    /// A sketch that is newer or better than what is shown.
    Sketch {
        /// The revision.
        revision: RevisionNumber,
        /// Its step.
        step: usize,
        /// The number of steps.
        steps: usize,
    },
    /// A pass that counts.
    Pass {
        /// The revision.
        revision: RevisionNumber,
        /// Complete passes, from the first on.
        prefix: u64,
    },
    /// No longer wanted.
    Late,
    /// Not what was asked for, and why.
    Wrong(String),
}

/// The longest that a task may take, given the usual time.
fn in_time(usual: Duration) -> Duration {
    (usual * LONGEST).max(LEAST_PATIENCE)
}

/// The state of a live view.
pub struct Desk {
    revision: RevisionNumber,
    style: Style,
    ladder: Ladder,
    steps: Vec<Step>,
    /// The first step that was not handed out.
    next_step: usize,
    passes: Option<Passes>,
    seats: BTreeMap<WorkerId, Seat>,
    last_task: u64,
    /// The best picture of the newest revision that has one.
    shown: Option<(RevisionNumber, Quality)>,
    /// Who failed at which task of the revision, and how often each worker failed.
    failed: BTreeMap<What, BTreeSet<WorkerId>>,
    failures: BTreeMap<WorkerId, usize>,
    /// The longest time of a sketch of the last revisions, and the mean time of this revision's passes.
    sketches: Option<Duration>,
    mean_pass: Option<Duration>,
}

impl Desk {
    /// A desk with sketches up to this size. Hands out nothing before the first [`Self::revise`].
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
            failed: BTreeMap::new(),
            failures: BTreeMap::new(),
            sketches: None,
            mean_pass: None,
        }
    }

    /// Start a new revision. All tasks under way except the coarsest sketch are dropped.
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
        self.failed.clear();
        self.failures.clear();
        self.mean_pass = None;
        for seat in self.seats.values_mut() {
            if let Some(doing) = seat.doing.take_if(|doing| doing.what != What::Sketch(0)) {
                seat.to_drop = Some(doing.task.number);
            }
        }
    }

    /// Set what the passes of a revision render. Has no effect if there is a newer revision.
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

    /// Set the total number of passes.
    pub fn extend(&mut self, limit: u64) {
        if let Some(passes) = &mut self.passes {
            passes.job.limit = limit;
        }
    }

    /// A worker has come.
    pub fn join(&mut self, worker: WorkerId) {
        self.seats.insert(worker, Seat::default());
    }

    /// A worker is gone; its task goes to others.
    pub fn leave(&mut self, worker: WorkerId) {
        if let Some(doing) = self.seats.remove(&worker).and_then(|seat| seat.doing) {
            self.take_back(doing);
        }
    }

    /// The number of workers present.
    pub fn workers(&self) -> usize {
        self.seats.len()
    }

    /// The task that a worker must be told to drop; returned once.
    pub fn drop_of(&mut self, worker: WorkerId) -> Option<TaskNumber> {
        self.seats.get_mut(&worker)?.to_drop.take()
    }

    /// Whether a worker must go because it failed too often at what others can render.
    pub fn is_to_blame(&self, worker: WorkerId) -> bool {
        self.seats.get(&worker).is_some_and(|seat| seat.blames >= FAILURES)
    }

    /// The next task of an idle worker; `None` if it is busy or there is nothing to do.
    pub fn next(&mut self, worker: WorkerId, now: Duration) -> Option<Task> {
        let seat = self.seats.get(&worker)?;
        if seat.doing.is_some() || seat.not_before > now || self.has_given_up(worker) || self.is_to_blame(worker) {
            return None;
        }
        let late = self.late_for(worker, now, PATIENCE);
        let what = late
            .or_else(|| self.fresh_for(worker))
            .or_else(|| self.late_for(worker, now, LEAST_PATIENCE))?;
        let task = self.task(what)?;
        let seat = self.seats.get_mut(&worker)?;
        seat.doing = Some(Doing {
            task,
            what,
            begun: now,
            is_shared: false,
        });
        Some(task)
    }

    /// Whether the worker failed so often at this revision that it gets no more of it.
    fn has_given_up(&self, worker: WorkerId) -> bool {
        self.failures.get(&worker).is_some_and(|failures| *failures >= FAILURES)
    }

    fn has_failed_at(&self, worker: WorkerId, what: What) -> bool {
        self.failed.get(&what).is_some_and(|failed| failed.contains(&worker))
    }

    /// Whether a worker may have a task. One that failed at it may not, as long as another has not.
    fn may_have(&self, worker: WorkerId, what: What) -> bool {
        let Some(failed) = self.failed.get(&what).filter(|failed| failed.contains(&worker)) else {
            return true;
        };
        let mut others = self.seats.keys();
        !others.any(|other| !failed.contains(other) && !self.has_given_up(*other) && !self.is_to_blame(*other))
    }

    /// A task that another worker has not delivered in time. `unknown`: the time where no such task has been timed.
    fn late_for(&mut self, worker: WorkerId, now: Duration, unknown: Duration) -> Option<What> {
        let patience = |what: What| {
            let usual = match what {
                What::Sketch(_) => self.sketches,
                What::Pass(_) => self.mean_pass,
            };
            usual.map_or(unknown, in_time)
        };
        let is_late = |doing: &Doing| {
            let is_wanted = doing.task.revision == self.revision && !doing.is_shared;
            is_wanted && now.saturating_sub(doing.begun) > patience(doing.what)
        };
        let late = self.seats.iter().filter_map(|(id, seat)| Some((*id, seat.doing?)));
        let (slow, what) = late
            .filter(|(_, doing)| is_late(doing))
            .map(|(id, doing)| (id, doing.what))
            .find(|(_, what)| self.may_have(worker, *what))?;
        if let Some(doing) = self.seats.get_mut(&slow).and_then(|seat| seat.doing.as_mut()) {
            doing.is_shared = true;
        }
        Some(what)
    }

    /// The next sketch or pass that no worker has.
    fn fresh_for(&mut self, worker: WorkerId) -> Option<What> {
        while self.next_step < self.steps.len() {
            let what = What::Sketch(self.next_step);
            if !self.may_have(worker, what) {
                return None;
            }
            self.next_step += 1;
            // Skip a sketch that all have failed at.
            if !self.has_failed_at(worker, what) {
                return Some(what);
            }
        }
        let passes = self.passes.as_ref()?;
        let mut returned = passes.returned.iter().copied();
        let returned = returned.find(|pass_index| self.may_have(worker, What::Pass(*pass_index)));
        let passes = self.passes.as_mut()?;
        if let Some(lost) = returned {
            passes.returned.remove(&lost);
            return Some(What::Pass(lost));
        }
        if passes.next >= passes.job.limit {
            return None;
        }
        passes.next += 1;
        Some(What::Pass(passes.next - 1))
    }

    fn task(&mut self, what: What) -> Option<Task> {
        let ([width, height], work) = match what {
            What::Sketch(number) => {
                let step = self.steps.get(number)?;
                let settings = JobSettings {
                    paths_per_pass: step.paths,
                    budget: None,
                    ..self.style.settings
                };
                let sketch = Work::Sketch {
                    settings,
                    // The same in all revisions, so that noise stands still.
                    index: number as u64,
                    origin: self.style.origin,
                };
                ([step.width, step.height], sketch)
            }
            What::Pass(pass_index) => {
                let Job {
                    settings,
                    width,
                    height,
                    ..
                } = self.passes.as_ref()?.job;
                ([width, height], Work::Pass { settings, pass_index })
            }
        };
        self.last_task += 1;
        Some(Task {
            number: TaskNumber(self.last_task),
            revision: self.revision,
            width,
            height,
            work,
        })
    }

    /// The size of the task that the worker is rendering, if it is this one.
    pub fn size_of(&self, worker: WorkerId, task: TaskNumber) -> Option<[u32; 2]> {
        let doing = self.seats.get(&worker)?.doing?;
        (doing.task.number == task).then_some([doing.task.width, doing.task.height])
    }

    /// A worker refuses a task that nobody told it to drop.
    pub fn give_back(&mut self, worker: WorkerId, task: TaskNumber) {
        if let Some(doing) = self.release(worker, task) {
            self.fail(worker, doing);
            self.take_back(doing);
        }
    }

    fn fail(&mut self, worker: WorkerId, doing: Doing) {
        if doing.task.revision == self.revision {
            self.failed.entry(doing.what).or_default().insert(worker);
            *self.failures.entry(worker).or_default() += 1;
        }
    }

    /// A worker has rendered a task that others may have failed at or not delivered.
    fn has_done(&mut self, worker: WorkerId, done: Doing, took: Duration, now: Duration) {
        // Failures are recorded for the last revision only.
        let is_last = done.task.revision == self.revision;
        let failed = is_last.then(|| self.failed.remove(&done.what)).flatten();
        for failed in failed.unwrap_or_default() {
            if let Some(seat) = self.seats.get_mut(&failed).filter(|_| failed != worker) {
                seat.blames += 1;
            }
        }
        let is_same = |doing: &mut Doing| doing.what == done.what && doing.task.revision == done.task.revision;
        for (id, seat) in &mut self.seats {
            if *id == worker {
                (seat.late, seat.blames) = (0, 0);
            } else if let Some(doing) = seat.doing.take_if(is_same) {
                seat.to_drop = Some(doing.task.number);
                if now.saturating_sub(doing.begun) > in_time(took) {
                    seat.not_before = now + BACK_OFF * (1 << seat.late.min(MOST_DOUBLINGS));
                    seat.late += 1;
                }
            }
        }
    }

    /// A worker has rendered a task. `took`: from order to delivery; `now`: as for [`Self::next`].
    pub fn finish(
        &mut self,
        worker: WorkerId,
        task: TaskNumber,
        film: &Film,
        (took, now): (Duration, Duration),
    ) -> Verdict {
        let Some(doing) = self.release(worker, task) else {
            return Verdict::Late;
        };
        let asked = [doing.task.width, doing.task.height];
        if [film.width, film.height] != asked {
            self.fail(worker, doing);
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
                    self.fail(worker, doing);
                    self.take_back(doing);
                    return Verdict::Wrong(format!("{bad} pixels of a sketch are not finite"));
                }
                if step == 0 {
                    self.ladder.learn(took);
                    self.sketches = None;
                }
                self.sketches = self.sketches.max(Some(took));
                self.has_done(worker, doing, took, now);
                let quality = Quality::Sketch(step);
                if self.shown.is_some_and(|shown| shown >= (revision, quality)) {
                    return Verdict::Late;
                }
                self.shown = Some((revision, quality));
                let steps = self.steps.len();
                Verdict::Sketch { revision, step, steps }
            }
            What::Pass(pass_index) => {
                // Passes of older revisions were dropped and released.
                let Some(passes) = self.passes.as_mut().filter(|_| revision == self.revision) else {
                    return Verdict::Late;
                };
                let scale = Schedule::new(&passes.job.settings).scale(pass_index);
                let node = Node::leaf(pass_index, film.clone());
                let inserted = node
                    .check(passes.job.width, passes.job.height, LayerCounts::default())
                    .and_then(|()| passes.sum.insert(node.with_radius_scale(scale)));
                if let Err(error) = inserted {
                    self.fail(worker, doing);
                    self.take_back(doing);
                    return Verdict::Wrong(error.to_string());
                }
                let (prefix, done) = (passes.sum.prefix(), passes.sum.passes() as u32);
                let before = self.mean_pass.unwrap_or_default() * (done - 1);
                self.mean_pass = Some((before + took) / done);
                self.has_done(worker, doing, took, now);
                if prefix > 0 {
                    self.shown = Some((revision, Quality::Passes(prefix)));
                }
                Verdict::Pass { revision, prefix }
            }
        }
    }

    /// The last revision's passes: their job and their sum.
    pub fn passes(&self) -> Option<(&Job, &TreeSum)> {
        self.passes.as_ref().map(|passes| (&passes.job, &passes.sum))
    }

    /// Whether every worker has failed too often at the last revision to get more of it.
    pub fn has_failed(&self) -> bool {
        let mut workers = self.seats.keys();
        !self.seats.is_empty() && workers.all(|worker| self.has_given_up(*worker))
    }

    fn release(&mut self, worker: WorkerId, task: TaskNumber) -> Option<Doing> {
        let seat = self.seats.get_mut(&worker)?;
        seat.doing.take_if(|doing| doing.task.number == task)
    }

    fn take_back(&mut self, doing: Doing) {
        if doing.task.revision != self.revision {
            return;
        }
        // Another worker has it as well; its copy counts as late again if it does not deliver.
        let mut has_another = false;
        for other in self.seats.values_mut().filter_map(|seat| seat.doing.as_mut()) {
            if other.what == doing.what && other.task.revision == doing.task.revision {
                (has_another, other.is_shared) = (true, false);
            }
        }
        if has_another {
            return;
        }
        match doing.what {
            // Finer sketches that were handed out meanwhile are handed out again, and count only if they are better.
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
