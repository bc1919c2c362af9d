//! What all attackers know, and what is recorded about them.

use crate::farm::harness::{HEIGHT, RawWorker, WIDTH, identity_of, introduction, leaf, node_of};
use beamfarm_coordinator::JobSpec;
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, SceneHash};
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{Fingerprint, Identity};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::time::sleep;
use tonic::{Code, Status};

/// What honest workers call themselves.
pub const HONEST: &str = "test";

/// Random numbers of an attacker.
pub struct Dice(Pcg32);

impl Dice {
    pub fn new(seed: u64, stream: u64) -> Self {
        Self(Pcg32::new(seed, stream))
    }

    pub fn below(&mut self, n: usize) -> usize {
        self.0.next_u32() as usize % n.max(1)
    }

    pub fn pick<T: Clone>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())].clone()
    }

    pub fn bytes(&mut self, longest: usize) -> Vec<u8> {
        (0..self.below(longest + 1)).map(|_| self.0.next_u32() as u8).collect()
    }

    pub fn pcg(&mut self) -> &mut Pcg32 {
        &mut self.0
    }

    /// Leaves the machine time for others.
    pub async fn pause(&mut self) {
        let milliseconds = 3 + self.below(12) as u64;
        sleep(Duration::from_millis(milliseconds)).await;
    }
}

/// The passes of a job as honest workers render them.
pub struct Truth {
    films: Vec<Film>,
    /// Mean time of one pass, in seconds.
    pub pass: f64,
}

impl Truth {
    pub fn of(spec: &JobSpec) -> Self {
        let scene = Scene::new(beamfarm_scene::load(&spec.bundle).unwrap());
        let plan = RenderPlan::new(&scene, spec.settings);
        let begun = Instant::now();
        let pass = |pass_index| render_pass(&scene, &plan, pass_index).unwrap().film;
        let films: Vec<Film> = (0..spec.passes).map(pass).collect();
        let pass = begun.elapsed().as_secs_f64() / films.len() as f64;
        Self { films, pass }
    }

    pub fn film(&self, pass_index: u64) -> Film {
        self.films[pass_index as usize % self.films.len()].clone()
    }

    pub fn node(&self, block: Block) -> Node {
        node_of(block, &|pass_index| self.film(pass_index))
    }

    pub fn average(&self) -> Average {
        let mut sum = TreeSum::new(WIDTH, HEIGHT);
        for (pass_index, film) in (0..).zip(&self.films) {
            sum.insert(leaf(pass_index, film.clone())).unwrap();
        }
        sum.average().unwrap()
    }
}

/// What has happened to attackers so far.
#[derive(Default)]
struct Seen {
    /// By fingerprint: what the secret is made from.
    attackers: BTreeMap<Fingerprint, String>,
    /// Those whose wrong pixels were taken as new.
    liars: BTreeSet<String>,
    /// Those who were told that they are shut out for good.
    out: BTreeSet<String>,
    /// What must not happen.
    wrongs: Vec<String>,
}

/// A coordinator under attack.
pub struct Stage {
    pub url: String,
    pub address: SocketAddr,
    truths: Mutex<BTreeMap<SceneHash, Arc<Truth>>>,
    seen: Mutex<Seen>,
}

impl Stage {
    pub fn new(address: SocketAddr) -> Arc<Self> {
        Arc::new(Self {
            url: format!("http://{address}"),
            address,
            truths: Mutex::default(),
            seen: Mutex::default(),
        })
    }

    /// Attackers know what honest workers render of this scene.
    pub fn tell(&self, scene: SceneHash, truth: Arc<Truth>) {
        self.truths.lock().unwrap().insert(scene, truth);
    }

    pub fn truth(&self, scene: SceneHash) -> Arc<Truth> {
        self.truths.lock().unwrap()[&scene].clone()
    }

    /// The secret made from this, which from now on counts as an attacker's.
    pub fn secret(&self, of: &str) -> Bytes {
        let secret = identity_of(of);
        let key = Identity::from_bytes(&secret).unwrap().fingerprint();
        self.seen().attackers.insert(key, of.into());
        secret
    }

    /// Registers, under some name, with the secret made from `who`, until accepted.
    pub async fn come(&self, who: &str, before: &mut u64, dice: &mut Dice) -> RawWorker {
        loop {
            dice.pause().await;
            let name = dice.pick(&[HONEST, who, "", "\u{202e}node\n\0"]);
            let mut request = introduction(name, self.secret(who));
            request.before = *before;
            match RawWorker::come(&self.url, request).await {
                Ok((worker, _)) => {
                    if self.seen().out.contains(who) {
                        self.wrong(format!("{who}, who is out, is taken in"));
                    }
                    *before = worker.id;
                    return worker;
                }
                Err(status) => self.hear(who, &status),
            }
        }
    }

    /// Records what an attacker is answered.
    pub fn hear(&self, who: &str, status: &Status) {
        // A task that panicked answers with one of these.
        if matches!(status.code(), Code::Unknown | Code::Cancelled) {
            self.wrong(format!("{who} is answered {status}"));
        }
        let is_for_good = ["pixels", "failed too often"]
            .iter()
            .any(|why| status.message().contains(why));
        if status.code() == Code::PermissionDenied && is_for_good {
            self.seen().out.insert(who.into());
        }
    }

    /// Wrong pixels were accepted.
    pub fn lied(&self, who: &str) {
        self.seen().liars.insert(who.into());
    }

    pub fn wrong(&self, what: String) {
        self.seen().wrongs.push(what);
    }

    pub fn wrongs(&self) -> Vec<String> {
        self.seen().wrongs.clone()
    }

    pub fn liars(&self) -> BTreeSet<String> {
        self.seen().liars.clone()
    }

    pub fn is_out(&self, who: &str) -> bool {
        self.seen().out.contains(who)
    }

    pub fn is_attacker(&self, key: Option<Fingerprint>) -> bool {
        key.is_some_and(|key| self.seen().attackers.contains_key(&key))
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
