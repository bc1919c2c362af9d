//! All kinds of attackers at once on one coordinator, with a few honest workers: the test for a change of a protocol as
//! a whole.
//!
//! A seed alone decides what they do, but not the order in which they are heard. `BEAMFARM_LONG=1` plays more rounds.

mod deliveries;
mod floods;
mod framers;
mod grammar;
mod idlers;
mod liars;
mod scene;
mod studio;

use crate::farm::harness::{
    Coordinator, LONG, Machine, RawWorker, WorkerHandle, free_port, identity_of, introduction, spec, start_worker,
    within,
};
use crate::farm::series::{Site, frame, job_of};
use crate::farm::view::{self, View, changed};
use beamfarm_coordinator::revisions::Quality;
use beamfarm_coordinator::security::Security;
use beamfarm_coordinator::{End, Farm, JobSpec, Timing, WorkerState};
use beamfarm_proto::VERSION;
use scene::{Dice, Stage, Truth};
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use tokio::time::timeout;
use tonic::Code;

const PASSES: u64 = 24;
const TIMING: Timing = Timing {
    heartbeat: Duration::from_millis(50),
    lease: Duration::from_millis(600),
};

/// The longest that a job may take: this, and this many times as long as one of its passes. Those who keep blocks cost
/// it some leases; attackers on the same machine cost the rest.
const LONGEST: Duration = Duration::from_secs(5);
const PASSES_LONG: f64 = 20.0 * PASSES as f64;
/// The longest that a revision may take: what one worker keeps goes to another after a second or two, who may keep it
/// as well.
const SHOWN: Duration = Duration::from_secs(10);
/// The longest time without anything new.
const STILL: Duration = Duration::from_secs(3);

fn seeds() -> std::ops::Range<u64> {
    match std::env::var_os("BEAMFARM_LONG") {
        Some(_) => 1..20,
        None => 1..2,
    }
}

/// Attackers at work, until dropped.
struct Attack {
    tasks: JoinSet<()>,
    seed: u64,
}

impl Attack {
    fn new(seed: u64) -> Self {
        Self {
            tasks: JoinSet::new(),
            seed,
        }
    }

    fn begin<F: Future<Output = ()> + Send + 'static>(&mut self, attacker: impl FnOnce(Dice) -> F) {
        let dice = Dice::new(self.seed, self.tasks.len() as u64);
        self.tasks.spawn(attacker(dice));
    }

    /// Every attack on a farm.
    fn on_farm(stage: &Arc<Stage>, seed: u64) -> Self {
        let mut attack = Self::new(seed);
        let new = || stage.clone();
        for lie in liars::LIES {
            attack.begin(|dice| liars::lies(new(), format!("liar {lie:?} {seed}"), lie, dice));
        }
        for idle in idlers::IDLE {
            attack.begin(|dice| idlers::idles(new(), format!("idler {idle:?} {seed}"), idle, dice));
        }
        for i in 0..2 {
            attack.begin(|dice| deliveries::delivers(new(), format!("deliveries {i} {seed}"), dice));
            attack.begin(|dice| framers::frames(new(), format!("framer {i} {seed}"), dice));
            attack.begin(|dice| grammar::to_farm(new(), format!("grammar {i} {seed}"), dice));
        }
        attack.begin(|dice| deliveries::misframes(new(), dice));
        attack.begin(|dice| floods::connections(new(), dice));
        attack.begin(|dice| floods::registrations(new(), seed, dice));
        attack.begin(|dice| floods::streams(new(), format!("streams {seed}"), dice));
        attack.begin(|dice| floods::pages(new(), dice));
        attack.begin(|dice| floods::deaf(new(), dice));
        attack
    }

    /// Every attack on a live view, except by those who are never found out.
    fn on_view(stage: &Arc<Stage>, seed: u64) -> Self {
        let mut attack = Self::new(seed);
        let new = || stage.clone();
        for spoil in studio::SPOILS.into_iter().filter(|spoil| spoil.is_found()) {
            attack.begin(|dice| studio::spoils(new(), format!("{spoil:?} {seed}"), spoil, dice));
        }
        for i in 0..2 {
            attack.begin(|dice| grammar::to_view(new(), format!("grammar {i} {seed}"), dice));
        }
        attack.begin(|dice| deliveries::misframes(new(), dice));
        attack.begin(|dice| floods::connections(new(), dice));
        attack
    }

    /// Fails if any of them has stopped already.
    async fn end(mut self) {
        self.tasks.abort_all();
        while let Some(ended) = self.tasks.join_next().await {
            let error = ended.expect_err("an attacker does not end");
            assert!(error.is_cancelled(), "seed {}: an attacker failed: {error}", self.seed);
        }
    }
}

/// What must hold for an attacked job.
fn holds(stage: &Stage, farm: &Farm, machine: &Machine, truth: &Truth, seed: u64) {
    assert_eq!(farm.end(), Some(End::Complete), "seed {seed}");
    assert_eq!(machine.panics(), [""; 0], "seed {seed}");
    assert_eq!(stage.wrongs(), [""; 0], "seed {seed}");
    assert!(farm.average().unwrap() == truth.average(), "seed {seed}: other bits");
    let progress = farm.progress();
    assert_eq!(progress.divergent, 0, "seed {seed}");
    for view in &progress.workers_seen {
        if !stage.is_attacker(view.key) {
            assert_ne!(view.state, WorkerState::ShutOut, "seed {seed}: {view:?}");
            assert_eq!(view.audits_failed, 0, "seed {seed}: {view:?}");
        }
    }
}

/// Whoever delivered wrong pixels that were accepted is shut out by its key, unless those of another liar made the
/// coordinator drop them before they were checked.
async fn liars_are_out(stage: &Stage, dropped: u64, seed: u64) {
    for liar in stage.liars() {
        for name in ["another", scene::HONEST] {
            let again = RawWorker::come(&stage.url, introduction(name, identity_of(&liar))).await;
            let refused = again.err().map(|status| status.code());
            let is_out = refused == Some(Code::PermissionDenied);
            assert!(is_out || dropped > 0, "seed {seed}: {liar}: {refused:?}");
        }
    }
}

async fn all_went_well(workers: impl IntoIterator<Item = WorkerHandle>, seed: u64) {
    for worker in workers {
        if let Err(error) = worker.join().await {
            panic!("seed {seed}: {error}");
        }
    }
}

/// Waits for the job's end; the length of a lease and the time of a pass limit how late it may come.
async fn ends(stage: &Stage, farm: &Arc<Farm>, truth: &Truth, seed: u64) {
    let (begun, mut news) = (Instant::now(), Instant::now());
    let mut before = (0, 0);
    let longest = LONGEST.as_secs_f64() + PASSES_LONG * truth.pass;
    let mut still = Duration::ZERO;
    while timeout(Duration::from_millis(10), farm.ended()).await.is_err() {
        let progress = farm.progress();
        let now = (progress.passes, progress.audits);
        if before != now {
            (before, news) = (now, Instant::now());
        }
        still = still.max(news.elapsed());
        assert!(
            begun.elapsed().as_secs_f64() < longest && still < STILL,
            "seed {seed}: {longest:.1} s, still {still:?}: {:?}, {progress:#?}",
            stage.wrongs()
        );
    }
}

async fn job(seed: u64, honest: usize, attack: impl Fn(&Arc<Stage>, u64) -> Attack) {
    let mut spec = spec(PASSES);
    spec.audit_every = 1;
    let truth = Arc::new(Truth::of(&spec));
    let coordinator = Coordinator::start_on(free_port(), spec, TIMING).await;
    coordinator.stay();
    let stage = Stage::new(coordinator.address);
    stage.tell(coordinator.farm.job().scene, truth.clone());
    let attack = attack(&stage, seed);
    let honest: Vec<_> = (0..honest).map(|_| coordinator.worker(1)).collect();
    ends(&stage, &coordinator.farm, &truth, seed).await;
    attack.end().await;
    holds(&stage, &coordinator.farm, &coordinator.machine, &truth, seed);
    liars_are_out(&stage, coordinator.farm.progress().dropped, seed).await;
    all_went_well(honest, seed).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_is_complete_whoever_attacks_it() {
    for seed in seeds() {
        job(seed, 3, Attack::on_farm).await;
    }
}

/// One worker renders everything, and nobody checks what it renders.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_is_complete_where_all_but_one_do_nothing() {
    for seed in seeds() {
        job(seed, 1, |stage, seed| {
            let mut attack = Attack::new(seed);
            for idle in idlers::IDLE {
                attack.begin(|dice| idlers::idles(stage.clone(), format!("idler {idle:?} {seed}"), idle, dice));
            }
            attack
        })
        .await;
    }
}

/// What a worker did at one job follows it to the others.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_series_is_complete_whoever_attacks_it() {
    for seed in seeds() {
        let specs = [1, 2, 3].map(|number| JobSpec {
            audit_every: 1,
            ..frame(number, PASSES / 3)
        });
        let truths = specs.each_ref().map(|spec| Arc::new(Truth::of(spec)));
        let jobs = specs.map(|spec| job_of(spec, TIMING.lease));
        let site = Site::beginning_with(jobs[0].clone(), Security::default());
        let stage = Stage::new(site.address);
        for (job, truth) in jobs.iter().zip(&truths) {
            stage.tell(job.farm().job().scene, truth.clone());
        }
        let attack = Attack::on_farm(&stage, seed);
        let honest = [(); 3].map(|()| start_worker(stage.url.clone(), 1, LONG));
        let mut open = vec![];
        for (i, (job, truth)) in jobs.iter().zip(&truths).enumerate() {
            if i > 0 {
                assert!(within("hunger", site.series.wants_another()).await);
                site.series.open(job.clone());
            }
            open.push((job, truth));
            while open.len() > 1 || i + 1 == jobs.len() && !open.is_empty() {
                let (job, truth) = open.remove(0);
                ends(&stage, job.farm(), truth, seed).await;
                site.series.close(job);
            }
        }
        site.series.seal();
        attack.end().await;
        for (job, truth) in jobs.iter().zip(&truths) {
            holds(&stage, job.farm(), &site.machine, truth, seed);
        }
        let dropped = jobs.iter().map(|job| job.farm().progress().dropped).sum();
        liars_are_out(&stage, dropped, seed).await;
        all_went_well(honest, seed).await;
    }
}

/// Honest workers' pictures arrive whole and right, and those who spoil pictures are shut out by their key.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_live_view_shows_each_revision_whoever_attacks_it() {
    const LIMIT: u64 = 3;
    for seed in seeds() {
        let mut view = View::start().await;
        let address = view.url.strip_prefix("http://").unwrap().parse().unwrap();
        let stage = Stage::new(address);
        let mut attack = Attack::on_view(&stage, seed);
        let honest = [(); 2].map(|()| start_worker(view.url.clone(), 1, LONG));
        let are_found = || {
            let mut spoils = studio::SPOILS.into_iter().filter(|spoil| spoil.is_found());
            spoils.all(|spoil| stage.is_out(&format!("{spoil:?} {seed}")))
        };
        // Those who keep what they get come when all others are found out.
        let mut rest = 2;
        for power in 30..60 {
            let text = changed(&power.to_string());
            let number = view.revise(&text);
            view.settle(number, LIMIT);
            let revised = Instant::now();
            let quality = Quality::Passes(LIMIT);
            let shown = view.shows("all passes", |picture| {
                picture.revision == number && picture.quality == quality
            });
            let shown = shown.await;
            assert!(
                revised.elapsed() < SHOWN,
                "seed {seed}, {power}: {:?}",
                revised.elapsed()
            );
            let mut spec = spec(LIMIT);
            spec.bundle.files.insert("scene.toml".into(), text.into());
            assert!(
                *shown.content.film() == Truth::of(&spec).average().beauty,
                "seed {seed}, {power}"
            );
            if !are_found() {
                continue;
            }
            if rest == 2 {
                for spoil in studio::SPOILS.into_iter().filter(|spoil| !spoil.is_found()) {
                    let new = || stage.clone();
                    attack.begin(|dice| studio::spoils(new(), format!("{spoil:?} {seed}"), spoil, dice));
                }
            }
            if rest == 0 {
                break;
            }
            rest -= 1;
        }
        attack.end().await;
        assert_eq!(view.machine.panics(), [""; 0], "seed {seed}");
        assert_eq!(stage.wrongs(), [""; 0], "seed {seed}");
        for spoil in studio::SPOILS {
            let secret = identity_of(&format!("{spoil:?} {seed}"));
            let again = view::RawWorker::greet(&view.url, VERSION, secret).await;
            let is_out = again.err().map(|status| status.code()) == Some(Code::PermissionDenied);
            assert_eq!(is_out, spoil.is_found(), "seed {seed}: {spoil:?}");
        }
        view.revisions.finish();
        all_went_well(honest, seed).await;
    }
}
