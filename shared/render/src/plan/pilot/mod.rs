//! How each kind of light is found, and how many photon paths a pass traces, where the scene does not say: a pilot
//! decides.
//!
//! A pass with M paths has the variance c + p / M, with c from what its camera paths draw by chance and p from photons,
//! and takes the work a + b M. The error after a given time goes as the product of the two, which is least at
//!
//! ```text
//! M = sqrt(p a / (c b)).
//! ```
//!
//! The pilot renders small images, with the same photons and different camera paths, and with different photons and the
//! same camera paths. Work is counted, not timed, so every machine finds the same number. The pilot does this for each
//! way to find the scene's light that may be the best, and takes the one with the least product.

mod pictures;
mod ways;

use crate::plan::RenderPlan;
use crate::plan::budget::shrunk;
use crate::plan::engine::Engine;
use crate::plan::targeting::{MIN_GAIN, Places};
use crate::world::{Scene, SceneDescription};
use beamfarm_image::job::{JobSettings, Techniques};
pub use pictures::{Balance, Variances};
use pictures::{Effort, Found, Judged, More, Pictures};
use std::cell::Cell;
use std::time::Duration;

/// Pixels along the longer side of pictures, from the largest to those for slow plans.
const SIDES: [u32; 3] = [48, 24, 12];
/// Photon paths of a set.
const PATHS: u32 = 3_000;
/// What every plan gets, in pictures of the second size.
const SCOUTS: Effort = Effort {
    cameras: 2,
    paths: PATHS,
};
/// The same, for cheap passes.
const FEWER: Effort = Effort {
    paths: PATHS / 2,
    ..SCOUTS
};
const FEWEST: Effort = Effort {
    paths: PATHS / 4,
    ..SCOUTS
};
/// For plans that may be the best.
const FULL: Effort = Effort {
    cameras: 8,
    paths: PATHS,
};
/// For every plan, if its first pictures find no light at all.
const MANY_PHOTONS: Effort = Effort {
    cameras: 2,
    paths: 16 * PATHS,
};
/// At most this many plans are looked at closely, and none that costs more than the best times this factor.
const KEPT: usize = 2;
const CLOSE: f64 = 3.0;
/// Missing light may cost this factor more than is known: a plan without doubt is preferred if it is not worse by more.
const TRUSTED: f64 = 3.0;
/// The best plan is looked at again up to this many times, each time with this factor more of what it lacks.
const LOOKS: usize = 5;
const MORE_PATHS: u32 = 8;
const MORE_CAMERAS: usize = 4;
/// Most counted work of a plan's first pictures, and of closer looks at the best, nanoseconds of a core.
const SCOUTING: f64 = 1e9;
const LONGEST: f64 = 5e8;
/// Factor on that limit where pictures should be as large as those that they are compared with.
const LATE: f64 = 4.0;
/// A closer look takes at most the budget divided by this.
const LARGE: f64 = 4.0;
/// A pilot's budget is this share of the work of all passes that the scene asks for, or this many nanoseconds of a core
/// if that is more: nobody says how long a scene with short passes will render. It looks at about this many plans. If
/// the budget does not allow pictures of all of them at the least effort, there is no pilot.
const SHARE: f64 = 0.1;
const ENOUGH: f64 = 1e9;
const PLANS: f64 = 16.0;
/// First pictures and closer looks together take at most this many budgets.
const ALL: f64 = 2.0;
/// Predicts how long other pictures, and a pass, will take.
const PROBE: Effort = Effort {
    cameras: 1,
    paths: PATHS / 4,
};
/// Another plan must cost less than this share of what is best for most scenes, because the pilot is noisy. From 0.65
/// to 0.9, the mean regret of the suite is the same.
const MARGIN: f64 = 0.85;
/// The same for plain photons against aimed ones. A tenth of the aimed photons start as plain ones do, so they miss
/// nothing that plain ones find, but small pictures do not show light that only rare plain photons bring. The share is
/// lower still where an aimed photon is worth more than [`MIN_GAIN`] plain ones: the rarest light is seen least.
const UNAIMED: f64 = 0.7;
/// Least and largest number of paths to choose.
const LEAST: f64 = 500.0;
const MOST: f64 = 500_000.0;

/// A plan that a pilot tried.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The settings, with the best number of photon paths, or the number that was set.
    pub settings: JobSettings,
    /// What the pilot found.
    pub balance: Balance,
}

impl Candidate {
    /// Relative error times time.
    pub fn cost(&self) -> f64 {
        self.balance.cost(self.settings.paths_per_pass)
    }
}

/// What a pilot is to decide.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// The settings of the passes.
    pub settings: JobSettings,
    /// Photon paths of a pass, if their number is set.
    pub paths: Option<u32>,
    /// How long the job will take, if that is known: the pilot may take a tenth of it on two cores.
    pub time: Option<Duration>,
}

impl Question {
    /// A question for a job of unknown length.
    pub fn new(settings: JobSettings, paths: Option<u32>) -> Self {
        Self {
            settings,
            paths,
            time: None,
        }
    }
}

/// A pilot's choice.
#[derive(Clone, Debug)]
pub struct Choice {
    /// All candidates. The first is what is best for most scenes.
    pub candidates: Vec<Candidate>,
    /// Index of the chosen candidate.
    pub best: usize,
    /// Counted work of all pictures, nanoseconds of a core.
    pub work: f64,
}

impl Choice {
    /// Let a pilot choose what the settings leave open. `None`: there is nothing to choose.
    pub fn new(engine: &impl Engine, description: &SceneDescription, question: Question) -> Option<Self> {
        let Question { settings, paths, .. } = question;
        let mut race = Race::new(engine, description, question);
        let said = settings.techniques;
        let mut first = ways::neighbours(&race.scenes[0], said, said);
        if first.len() == 1 && paths.is_some() {
            return None;
        }
        race.probe_first(description);
        if race.scouts.is_none() {
            first.truncate(1);
        }
        let mut trials = race.scouts(first.clone(), &[]);
        if trials.len() == 1 && (paths.is_some() || !trials[0].plan.has_photons()) {
            return None;
        }
        judge(&mut trials);
        let best = &trials[race.best(&trials)];
        let most = CLOSE * race.cost(best);
        // What was far worse alone is not better in combination.
        let is_hopeless = |way: &Techniques| {
            let mut tried = trials.iter().filter(|trial| trial.plan.settings.techniques == *way);
            tried.any(|trial| race.cost(trial) > most)
        };
        let second = ways::neighbours(&race.scenes[0], said, best.plan.settings.techniques);
        // As many as in the first round.
        let second = second.into_iter().zip(&first).filter(|(_, first)| !is_hopeless(first));
        let second: Vec<Techniques> = second.map(|(second, _)| second).collect();
        let known: Vec<RenderPlan> = trials.iter().map(|trial| trial.plan.clone()).collect();
        trials.extend(race.scouts(second, &known));
        race.run(&mut trials);
        Some(Self {
            best: race.chosen(&trials),
            candidates: race.candidates(&trials),
            work: race.work_done.get(),
        })
    }

    /// All possible plans, looked at as closely as the best ones: a baseline for judging a choice.
    pub fn all(engine: &impl Engine, description: &SceneDescription, question: Question) -> Vec<Candidate> {
        let mut race = Race::new(engine, description, question);
        race.probe_first(description);
        race.most_work = f64::INFINITY;
        let mut trials = race.scouts(ways::all(&race.scenes[0], question.settings.techniques), &[]);
        judge(&mut trials);
        for trial in &mut trials {
            race.look_again(trial, FULL, LONGEST);
        }
        judge(&mut trials);
        race.candidates(&trials)
    }

    /// The settings of the best candidate.
    pub fn settings(&self) -> JobSettings {
        self.candidates[self.best].settings
    }
}

/// A plan under trial.
struct Trial {
    plan: RenderPlan,
    /// Whether it is one of the best by first pictures. First pictures are not compared with closer looks.
    is_kept: bool,
    effort: Effort,
    /// Index of the pictures' size.
    size: usize,
    pictures: Pictures,
    judged: Judged,
}

/// Plans under trial; the more promising ones are looked at more closely.
struct Race<'e, E> {
    engine: &'e E,
    /// The scene at each of [`SIDES`].
    scenes: Vec<Scene>,
    /// For plans of the largest size.
    places: Places,
    /// Pixels of the image that the pilot is for.
    pixels: f64,
    settings: JobSettings,
    /// Photon paths of a pass, if set.
    paths: Option<u32>,
    time: Option<Duration>,
    /// Counted work done so far, and the most allowed, nanoseconds of a core.
    work_done: Cell<f64>,
    most_work: f64,
    /// What every plan gets at first. `None`: passes are so cheap that only the first plan is looked at.
    scouts: Option<Effort>,
    /// Most counted work of first pictures, and of closer looks.
    scouting: f64,
    longest: f64,
    /// Index of the size of the first plan's first pictures. At one size, something rare is in the pictures of all
    /// plans or of none.
    size: Option<usize>,
}

impl<'e, E: Engine> Race<'e, E> {
    fn new(engine: &'e E, description: &SceneDescription, question: Question) -> Self {
        let Question { settings, paths, time } = question;
        let mut scenes: Vec<Scene> = Vec::new();
        for side in SIDES {
            let small = shrunk(description, side);
            scenes.push(match scenes.first() {
                Some(first) => Scene::new_like(first, small),
                None => Scene::new(small),
            });
        }
        Self {
            engine,
            scenes,
            places: Places::default(),
            pixels: f64::from(description.camera.width) * f64::from(description.camera.height),
            settings,
            paths,
            time,
            work_done: Cell::default(),
            most_work: f64::INFINITY,
            scouts: Some(SCOUTS),
            scouting: SCOUTING,
            longest: LONGEST,
            size: None,
        }
    }

    /// Sets the limits on work, from pictures of the first plan.
    fn probe_first(&mut self, description: &SceneDescription) {
        let said = vec![self.settings.techniques];
        for plan in ways::plans_of(&self.scenes[0], self.settings, said, &[], &mut self.places) {
            let pictures = self.probe(&plan);
            let pass = pictures.work_of_pass(self.paths.unwrap_or(self.settings.paths_per_pass));
            let all = description.defaults.passes as f64 * pass;
            let budget = ENOUGH.max(SHARE * all);
            let budget = match self.time {
                Some(time) => budget.min(SHARE * 1e9 * time.as_secs_f64()),
                None => budget,
            };
            self.most_work = ALL * budget;
            let smallest = SIDES.len() - 1;
            let fits = |effort: &Effort| PLANS * self.work(&pictures, (smallest, PROBE), (smallest, *effort)) <= budget;
            self.scouts = [SCOUTS, FEWER, FEWEST].into_iter().find(fits);
            self.scouting = SCOUTING.min(budget / PLANS);
            self.longest = LONGEST.min(budget / LARGE);
            self.size = Some(self.first_size(&pictures));
        }
    }

    fn probe(&self, plan: &RenderPlan) -> Pictures {
        self.pictures(plan, SIDES.len() - 1, PROBE)
    }

    fn work_left(&self) -> f64 {
        self.most_work - self.work_done.get()
    }

    fn pictures(&self, plan: &RenderPlan, size: usize, effort: Effort) -> Pictures {
        let pictures = Pictures::new(self.engine, &self.scenes[size], plan, self.pixels, effort);
        self.work_done
            .set(self.work_done.get() + pictures.work.iter().sum::<f64>());
        pictures
    }

    /// First pictures of the plans that differ from those known.
    fn scouts(&mut self, ways: Vec<Techniques>, known: &[RenderPlan]) -> Vec<Trial> {
        let known: Vec<&RenderPlan> = known.iter().collect();
        let plans = ways::plans_of(&self.scenes[0], self.settings, ways, &known, &mut self.places);
        let effort = self.effort();
        let mut scouts: Vec<Trial> = Vec::new();
        for plan in plans {
            // There is always at least one.
            if self.work_left() <= 0.0 && !(scouts.is_empty() && known.is_empty()) {
                break;
            }
            let size = self.first_size(&self.probe(&plan));
            let pictures = self.pictures(&plan, size, effort);
            scouts.push(Trial {
                plan,
                is_kept: false,
                effort,
                size,
                judged: pictures.judged(&Found::new([&pictures].into_iter())),
                pictures,
            });
        }
        scouts
    }

    fn run(&self, trials: &mut [Trial]) {
        if !judge(trials) {
            // No light at all: so few photons allow no conclusion.
            for trial in trials.iter_mut() {
                self.look_again(trial, MANY_PHOTONS, self.scouting);
            }
            judge(trials);
        }
        let mut order: Vec<usize> = (0..trials.len()).collect();
        order.sort_by(|&a, &b| self.cost(&trials[a]).total_cmp(&self.cost(&trials[b])));
        let most = CLOSE * self.cost(&trials[order[0]]);
        order.retain(|&trial| self.cost(&trials[trial]) <= most);
        order.truncate(KEPT);
        order.extend(self.witness(trials, &order));
        // All at one size, for the same reason as the first pictures.
        let size = order
            .iter()
            .map(|&trial| self.largest(&trials[trial], FULL, self.longest));
        let size = size.max().unwrap_or_default();
        for &trial in &order {
            self.keep(&mut trials[trial], size);
        }
        judge(trials);
        for _ in 0..LOOKS {
            // Closer looks may have made the best worse than the others seem.
            let cost = |&trial: &usize| self.cost(&trials[trial]);
            let least = (0..trials.len()).min_by(|a, b| cost(a).total_cmp(&cost(b)));
            if let Some(other) = least.filter(|&trial| !trials[trial].is_kept) {
                self.keep(&mut trials[other], size);
                judge(trials);
                continue;
            }
            let best = self.best(trials);
            let mut effort = trials[best].effort;
            match trials[best].judged.wants {
                Some(More::Photons) => effort.paths *= MORE_PATHS,
                Some(More::CameraPaths) => effort.cameras *= MORE_CAMERAS,
                None => break,
            }
            self.look_again(&mut trials[best], effort, self.longest);
            judge(trials);
        }
    }

    /// If none of the best plans aims its photons, the best plan that does. Compared with what it finds, the others are
    /// known to miss light that plain photons bring once in a million.
    fn witness(&self, trials: &[Trial], best: &[usize]) -> Option<usize> {
        let aims = |trial: &usize| trials[*trial].plan.targets.is_some();
        let plain = |trial: &usize| trials[*trial].plan.has_photons();
        if best.iter().any(aims) || !best.iter().any(plain) {
            return None;
        }
        let aimed = (0..trials.len()).filter(aims);
        aimed.min_by(|&a, &b| self.cost(&trials[a]).total_cmp(&self.cost(&trials[b])))
    }

    /// Look at one of the best plans closely, with pictures of this size if they do not take too long.
    fn keep(&self, trial: &mut Trial, size: usize) {
        trial.is_kept = true;
        let work = self.work(&trial.pictures, (trial.size, trial.effort), (size, FULL));
        match work < (LATE * self.longest).min(self.work_left()) {
            true => self.picture(trial, FULL, size),
            false => self.look_again(trial, FULL, self.longest),
        }
    }

    fn candidates(&self, trials: &[Trial]) -> Vec<Candidate> {
        let candidates = trials.iter().map(|trial| Candidate {
            settings: JobSettings {
                paths_per_pass: self.paths_of(trial),
                techniques: trial.plan.settings.techniques,
                ..self.settings
            },
            balance: trial.judged.balance,
        });
        candidates.collect()
    }

    /// The size index of a plan's first pictures, judged by its smallest ones: that of the first plan, except for plans
    /// that would take too long.
    fn first_size(&self, smallest: &Pictures) -> usize {
        let last = self.scenes.len() - 1;
        let work = |size: usize| self.work(smallest, (last, PROBE), (size, self.effort()));
        match self.size {
            Some(size) if work(size) < LATE * self.scouting => size,
            _ => (1..last).find(|size| work(*size) < self.scouting).unwrap_or(last),
        }
    }

    /// The largest size that a plan's next pictures may have within the limit; otherwise that of its current pictures.
    fn largest(&self, trial: &Trial, effort: Effort, most: f64) -> usize {
        let fits = |size: &usize| self.work(&trial.pictures, (trial.size, trial.effort), (*size, effort)) < most;
        (0..trial.size).find(fits).unwrap_or(trial.size)
    }

    /// Another round of pictures of a plan, as large as allowed, if any are.
    fn look_again(&self, trial: &mut Trial, effort: Effort, most: f64) {
        let most = most.min(self.work_left());
        let size = self.largest(trial, effort, most);
        if self.work(&trial.pictures, (trial.size, trial.effort), (size, effort)) < most {
            self.picture(trial, effort, size);
        }
    }

    fn picture(&self, trial: &mut Trial, effort: Effort, size: usize) {
        trial.pictures = self.pictures(&trial.plan, size, effort);
        (trial.effort, trial.size) = (effort, size);
    }

    /// Counted work of pictures of another size and effort, extrapolated from some pictures.
    fn work(&self, pictures: &Pictures, (scene, effort): (usize, Effort), (other, wanted): (usize, Effort)) -> f64 {
        let pixels = |scene: usize| {
            let camera = &self.scenes[scene].description().camera;
            f64::from(camera.width) * f64::from(camera.height)
        };
        let paths = f64::from(wanted.paths) / f64::from(effort.paths);
        let cameras = wanted.cameras as f64 / effort.cameras as f64;
        let [camera, photons] = pictures.work;
        camera * cameras * (pixels(other) / pixels(scene)) + photons * paths
    }

    fn effort(&self) -> Effort {
        self.scouts.unwrap_or(FEWEST)
    }

    fn paths_of(&self, trial: &Trial) -> u32 {
        self.paths.unwrap_or_else(|| trial.judged.balance.paths())
    }

    fn cost(&self, trial: &Trial) -> f64 {
        trial.judged.balance.cost(self.paths_of(trial))
    }

    /// The best plan. If it is still in doubt, the best of those that are not: its error is known only to be no less
    /// than it seems. If it certainly lacks light, not even that is known.
    fn chosen(&self, trials: &[Trial]) -> usize {
        let best = self.best(trials);
        if trials[best].judged.wants.is_none() {
            return best;
        }
        let most = match trials[best].judged.lacks {
            true => f64::INFINITY,
            false => TRUSTED * self.cost(&trials[best]),
        };
        let sure = (0..trials.len()).filter(|&i| trials[i].judged.wants.is_none() && self.cost(&trials[i]) <= most);
        let sure = sure.min_by(|&a, &b| self.cost(&trials[a]).total_cmp(&self.cost(&trials[b])));
        sure.unwrap_or(best)
    }

    fn best(&self, trials: &[Trial]) -> usize {
        let any_kept = trials.iter().any(|trial| trial.is_kept);
        let mut numbers = (0..trials.len()).filter(|&number| !any_kept || trials[number].is_kept);
        let mut best = numbers.next().unwrap_or(0);
        for number in numbers {
            let trial = &trials[number];
            let lost = trials[best].plan.gain().filter(|_| trial.plan.targets.is_none());
            let margin = match (lost, best) {
                (Some(gain), _) if trial.plan.has_photons() => UNAIMED * (MIN_GAIN / gain).min(1.0),
                (_, 0) => MARGIN,
                _ => 1.0,
            };
            if self.cost(trial) < margin * self.cost(&trials[best]) {
                best = number;
            }
        }
        best
    }
}

/// Judges each trial by what all of them found. Returns whether any light was found.
fn judge(trials: &mut [Trial]) -> bool {
    let found = Found::new(trials.iter().map(|trial| &trial.pictures));
    for trial in trials {
        trial.judged = trial.pictures.judged(&found);
    }
    found.any()
}

impl Balance {
    /// The number of paths with the least error after a given time.
    pub fn paths(&self) -> u32 {
        let Variances { camera, photons } = self.variances;
        let square = photons * self.camera_work / (camera * self.photon_work);
        // Without any variance there is nothing to choose.
        let paths = if square.is_nan() { LEAST } else { square.sqrt() };
        let paths = paths.clamp(LEAST, MOST);
        // No more than two digits are known.
        let unit = libm::pow(10.0, libm::floor(libm::log10(paths)) - 1.0);
        (libm::round(paths / unit) * unit) as u32
    }

    /// Relative error times time with this many paths, for comparison with other plans.
    pub fn cost(&self, paths: u32) -> f64 {
        let paths = f64::from(paths);
        let variance = self.variances.camera + self.variances.photons / paths;
        variance * (self.camera_work + self.photon_work * paths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(camera: f64, photons: f64) -> Balance {
        Balance {
            variances: Variances { camera, photons },
            camera_work: 4e6,
            photon_work: 1500.0,
        }
    }

    #[test]
    fn the_number_of_paths_has_the_least_cost() {
        for balance in [made(0.1, 300.0), made(2.0, 5000.0), made(0.01, 9000.0)] {
            let paths = balance.paths();
            let least = balance.cost(paths);
            let others = (1..200).map(|k| (LEAST * libm::pow(1.04, f64::from(k))) as u32);
            // Rounding to two digits hardly matters: the cost is flat there.
            assert!(
                others.map(|other| balance.cost(other)).all(|cost| cost > 0.998 * least),
                "{paths}"
            );
        }
    }

    #[test]
    fn images_without_noise_have_paths() {
        assert_eq!(made(0.0, 0.0).paths(), LEAST as u32);
        assert_eq!(made(0.1, 0.0).paths(), LEAST as u32);
        assert_eq!(made(0.0, 0.1).paths(), MOST as u32);
    }
}
