//! What finds which light, and how many photon paths a pass traces, where the scene does not say: found by a pilot.
//!
//! A pass with M paths has the variance c + p / M, c of what its camera paths draw by chance and p of photons, and
//! takes the work a + b M. The error after a given time goes as the product of the two, which is least at
//!
//! ```text
//! M = sqrt(p a / (c b)).
//! ```
//!
//! The pilot renders small images of the same photons by other camera paths and of other photons by the same ones. Work
//! is counted, not timed: every machine finds the same number. It does so for each way to find the scene's light that
//! may be the best, and takes the one of the least product.

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

/// Pixels along the longer side of pictures, from the largest to those of plans that take long.
const SIDES: [u32; 3] = [48, 24, 12];
/// Photon paths of a set.
const PATHS: u32 = 3_000;
/// What every plan gets, in pictures of the second size.
const SCOUTS: Effort = Effort {
    cameras: 2,
    paths: PATHS,
};
/// The same where passes take little.
const FEWER: Effort = Effort {
    paths: PATHS / 2,
    ..SCOUTS
};
const FEWEST: Effort = Effort {
    paths: PATHS / 4,
    ..SCOUTS
};
/// What those get that may be the best.
const FULL: Effort = Effort {
    cameras: 8,
    paths: PATHS,
};
/// What every plan gets where that finds no light at all.
const MANY_PHOTONS: Effort = Effort {
    cameras: 2,
    paths: 16 * PATHS,
};
/// Plans that are looked at closely are at most so many, none worse than the best by this factor.
const KEPT: usize = 2;
const CLOSE: f64 = 3.0;
/// What is missing may cost so many times more than is known: a plan without doubt is taken that is not worse by more.
const TRUSTED: f64 = 3.0;
/// As often the best one is looked at again, with so many times more of what it lacks.
const LOOKS: usize = 5;
const MORE_PATHS: u32 = 8;
const MORE_CAMERAS: usize = 4;
/// Counted work of the first pictures of a plan at most, and of those of the best, nanoseconds of a core.
const SCOUTING: f64 = 1e9;
const LONGEST: f64 = 5e8;
/// By how much more pictures may take so that they are as large as those that they are compared with.
const LATE: f64 = 4.0;
/// A closer look takes at most this part of the budget.
const LARGE: f64 = 4.0;
/// Share of the work of all passes that the scene asks for that a pilot may take, or so many nanoseconds of a core if
/// that is more: nobody says how long a scene of short passes will be rendered. About how many plans it looks at: where
/// it may not look at all of them by the least effort there is none.
const SHARE: f64 = 0.1;
const ENOUGH: f64 = 1e9;
const PLANS: f64 = 16.0;
/// Of that, what first pictures and closer looks take together at most.
const ALL: f64 = 2.0;
/// What tells how long other pictures will take, and a pass.
const PROBE: Effort = Effort {
    cameras: 1,
    paths: PATHS / 4,
};
/// What others must be better by than what is best for most scenes: the pilot is noisy. From 0.65 to 0.9 the mean
/// regret of the suite is the same.
const MARGIN: f64 = 0.85;
/// The same for photons that are not aimed, beside those that are: of the aimed ones a tenth start as plain ones do, so
/// that they miss nothing which those find, whereas of light that comes by rare ones nothing tells a small picture. And
/// by as much more as an aimed one is worth more plain ones than it must be: of the rarest light least is seen.
const UNAIMED: f64 = 0.7;
/// Fewest and most paths that are chosen.
const LEAST: f64 = 500.0;
const MOST: f64 = 500_000.0;

/// What a pilot tried.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// With as many photon paths as are best, or as were said.
    pub settings: JobSettings,
    /// What it found.
    pub balance: Balance,
}

impl Candidate {
    /// Relative error times time.
    pub fn cost(&self) -> f64 {
        self.balance.cost(self.settings.paths_per_pass)
    }
}

/// What a pilot is asked.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// What is said of the passes.
    pub settings: JobSettings,
    /// As many photon paths as a pass is to have, whatever is best.
    pub paths: Option<u32>,
    /// How long the job will take, if that is said: of a tenth of it the pilot makes do on two cores.
    pub time: Option<Duration>,
}

impl Question {
    /// Of a job of any length.
    pub fn new(settings: JobSettings, paths: Option<u32>) -> Self {
        Self {
            settings,
            paths,
            time: None,
        }
    }
}

/// What a pilot chose among.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The first is what is best for most scenes.
    pub candidates: Vec<Candidate>,
    /// Number of the one that was taken.
    pub best: usize,
    /// Counted work of all pictures, nanoseconds of a core.
    pub work: f64,
}

impl Choice {
    /// Let a pilot choose what the settings do not say. `None`: there is nothing to choose.
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
        // What was far worse alone is not better beside something else.
        let is_hopeless = |way: &Techniques| {
            let mut tried = trials.iter().filter(|trial| trial.plan.settings.techniques == *way);
            tried.any(|trial| race.cost(trial) > most)
        };
        let second = ways::neighbours(&race.scenes[0], said, best.plan.settings.techniques);
        // As many as were first.
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

    /// Every plan that there may be, looked at as closely as the best ones are: what a choice may be compared with.
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

    /// The settings that were found best.
    pub fn settings(&self) -> JobSettings {
        self.candidates[self.best].settings
    }
}

/// A plan that is tried.
struct Trial {
    plan: RenderPlan,
    /// It is one of the best by first pictures. What those say is not compared with closer looks.
    is_kept: bool,
    effort: Effort,
    /// Number of their size.
    size: usize,
    pictures: Pictures,
    judged: Judged,
}

/// Plans that are tried, those that do well more closely.
struct Race<'e, E> {
    engine: &'e E,
    /// Of [`SIDES`].
    scenes: Vec<Scene>,
    /// For plans of the largest.
    places: Places,
    /// Of the image that the pilot is for.
    pixels: f64,
    settings: JobSettings,
    /// Photon paths of a pass, if they are said.
    paths: Option<u32>,
    time: Option<Duration>,
    /// Counted work that was done, and all that may be, nanoseconds of a core.
    work_done: Cell<f64>,
    most_work: f64,
    /// What every plan gets at first. `None`: the passes take so little that no plan but the first is looked at.
    scouts: Option<Effort>,
    /// Counted work that first pictures may take, and those of the best.
    scouting: f64,
    longest: f64,
    /// Number of the size of the first plan's first pictures: what is rare is there in those of all plans of that size,
    /// or in none.
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

    /// What pictures may take, by those of the first plan.
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

    /// First pictures of what differs from what is known.
    fn scouts(&mut self, ways: Vec<Techniques>, known: &[RenderPlan]) -> Vec<Trial> {
        let known: Vec<&RenderPlan> = known.iter().collect();
        let plans = ways::plans_of(&self.scenes[0], self.settings, ways, &known, &mut self.places);
        let effort = self.effort();
        let mut scouts: Vec<Trial> = Vec::new();
        for plan in plans {
            // There is one in any case.
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
            // No light at all: nothing is concluded from so few photons.
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
        // All of one size, for the same reason as the first ones.
        let size = order
            .iter()
            .map(|&trial| self.largest(&trials[trial], FULL, self.longest));
        let size = size.max().unwrap_or_default();
        for &trial in &order {
            self.keep(&mut trials[trial], size);
        }
        judge(trials);
        for _ in 0..LOOKS {
            // By closer looks the best may have become worse than what the others seem to be.
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

    /// Where none of the best aims its photons, the best that does: beside what it finds, those are known to miss light
    /// that plain photons bring once in a million.
    fn witness(&self, trials: &[Trial], best: &[usize]) -> Option<usize> {
        let aims = |trial: &usize| trials[*trial].plan.targets.is_some();
        let plain = |trial: &usize| trials[*trial].plan.has_photons();
        if best.iter().any(aims) || !best.iter().any(plain) {
            return None;
        }
        let aimed = (0..trials.len()).filter(aims);
        aimed.min_by(|&a, &b| self.cost(&trials[a]).total_cmp(&self.cost(&trials[b])))
    }

    /// Look at one of the best closely, by pictures of a size if these do not take too long.
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

    /// The number of the first pictures of a plan, by the smallest ones: of those of the first plan, but for plans that
    /// take too long.
    fn first_size(&self, smallest: &Pictures) -> usize {
        let last = self.scenes.len() - 1;
        let work = |size: usize| self.work(smallest, (last, PROBE), (size, self.effort()));
        match self.size {
            Some(size) if work(size) < LATE * self.scouting => size,
            _ => (1..last).find(|size| work(*size) < self.scouting).unwrap_or(last),
        }
    }

    /// The number of the largest other pictures of a plan that may be made: of those that there are where none may be.
    fn largest(&self, trial: &Trial, effort: Effort, most: f64) -> usize {
        let fits = |size: &usize| self.work(&trial.pictures, (trial.size, trial.effort), (*size, effort)) < most;
        (0..trial.size).find(fits).unwrap_or(trial.size)
    }

    /// Other pictures of a plan, as large as they may be, if any may be made.
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

    /// Counted work of pictures of another size and effort, from that of some.
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

    /// The best one; where it is still in doubt, the best of those that are not: all that is known of the error of the
    /// first is that it is not less. Of one that certainly lacks light that is not even known.
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

/// Each by what all of them found. Whether that is anything.
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
        // Two digits say all that is known.
        let unit = libm::pow(10.0, libm::floor(libm::log10(paths)) - 1.0);
        (libm::round(paths / unit) * unit) as u32
    }

    /// Relative error times time with so many paths, to be compared with that of others.
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
            // Two digits of it are kept, and the cost is flat there.
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
