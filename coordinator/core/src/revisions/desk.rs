//! Who renders what of which revision: a state machine without clock or network.
//!
//! A worker does one task at a time. Of the last revision, sketches are handed out from coarse to fine, each once; when
//! none is left and the job is known, its passes. A new revision drops whatever is under way but the coarsest sketch,
//! which is nearly done: a steady drag shows pictures that are one change old rather than none. What arrives for a task
//! that is not its worker's any more counts for nothing.
//!
//! No worker halts the view: what one does not bring in the time of several others, or fails at, is for others. Whoever
//! fails at what others then render is to blame, and sent away when that happens again and again; whoever fails at what
//! nobody can render is not, and a revision of that kind ends.

use super::ladder::{Ladder, Step};
use beamfarm_image::film::Film;
use beamfarm_image::job::JobSettings;
use beamfarm_image::layer::LayerCounts;
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_image::radius::Schedule;
use beamfarm_proto::{RevisionNumber, Task, TaskNumber, Work, WorkerId};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Tasks of a revision that a worker failed at, after which it gets no more of it; and tasks in a row that others then
/// rendered, after which it is sent away.
const FAILURES: usize = 3;
/// What takes so many times as long as such tasks take is given to another worker as well.
const LONGEST: u32 = 8;
/// It is not before so long, of tasks that take next to nothing.
const LEAST_PATIENCE: Duration = Duration::from_secs(1);
/// Where nothing is known of such tasks, and there is something else to do.
const PATIENCE: Duration = Duration::from_secs(20);
/// Who did not bring what others then did gets nothing for so long; twice as long the next time, and so on.
const BACK_OFF: Duration = Duration::from_secs(1);
const MOST_DOUBLINGS: u32 = 6;

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
    begun: Duration,
    /// Another worker has it as well.
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
    /// What it has not been told yet that nobody wants.
    to_drop: Option<TaskNumber>,
    /// Tasks that it failed at and others rendered, since it rendered one itself.
    blames: usize,
    /// Tasks in a row that it did not bring in time.
    late: u32,
    /// Gets nothing before this time.
    not_before: Duration,
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

/// The longest that a task may take of which others take so long.
fn in_time(usual: Duration) -> Duration {
    (usual * LONGEST).max(LEAST_PATIENCE)
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
    /// Who failed at which of the revision's tasks, and how often at any.
    failed: BTreeMap<What, BTreeSet<WorkerId>>,
    failures: BTreeMap<WorkerId, usize>,
    /// The longest that a sketch of the last revisions took, and the mean of this one's passes.
    sketches: Option<Duration>,
    mean_pass: Option<Duration>,
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
            failed: BTreeMap::new(),
            failures: BTreeMap::new(),
            sketches: None,
            mean_pass: None,
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
        self.failed.clear();
        self.failures.clear();
        self.mean_pass = None;
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

    /// Whether a worker is to go: it failed too often at what others can render.
    pub fn is_to_blame(&self, worker: WorkerId) -> bool {
        self.seats.get(&worker).is_some_and(|seat| seat.blames >= FAILURES)
    }

    /// What an idle worker is to do; `None`: it has something to do, or there is nothing.
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

    /// It failed so often at the revision that it gets no more of it.
    fn has_given_up(&self, worker: WorkerId) -> bool {
        self.failures.get(&worker).is_some_and(|failures| *failures >= FAILURES)
    }

    fn has_failed_at(&self, worker: WorkerId, what: What) -> bool {
        self.failed.get(&what).is_some_and(|failed| failed.contains(&worker))
    }

    /// Whether a worker may have a task: none that it failed at, as long as there is another who has not.
    fn may_have(&self, worker: WorkerId, what: What) -> bool {
        let Some(failed) = self.failed.get(&what).filter(|failed| failed.contains(&worker)) else {
            return true;
        };
        let mut others = self.seats.keys();
        !others.any(|other| !failed.contains(other) && !self.has_given_up(*other) && !self.is_to_blame(*other))
    }

    /// What another worker has not brought in time; so long is that where nothing is known of such tasks.
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

    /// The next sketch or pass that nobody has.
    fn fresh_for(&mut self, worker: WorkerId) -> Option<What> {
        while self.next_step < self.steps.len() {
            let what = What::Sketch(self.next_step);
            if !self.may_have(worker, what) {
                return None;
            }
            self.next_step += 1;
            // At a sketch that all failed at nobody tries once more.
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
                    // The same in all revisions: noise stands still.
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

    /// The size of what a worker is rendering, if it is this task.
    pub fn size_of(&self, worker: WorkerId, task: TaskNumber) -> Option<[u32; 2]> {
        let doing = self.seats.get(&worker)?.doing?;
        (doing.task.number == task).then_some([doing.task.width, doing.task.height])
    }

    /// A worker says that it does not render a task, which nobody told it to drop.
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

    /// A worker has rendered what others may have failed at, or have not brought.
    fn has_done(&mut self, worker: WorkerId, done: Doing, took: Duration, now: Duration) {
        // What failed is of the last revision alone.
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

    /// A worker has rendered a task. `took`: from its order to its picture; `now`: as for [`Self::next`].
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

    /// The passes of the last revision: their job and their sum.
    pub fn passes(&self) -> Option<(&Job, &TreeSum)> {
        self.passes.as_ref().map(|passes| (&passes.job, &passes.sum))
    }

    /// Whether so much went wrong with the last revision that nobody gets any more of it.
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
        // Another one has it as well, and it is late again if that one does not bring it.
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
