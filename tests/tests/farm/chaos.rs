//! Rounds of misfortune, each of which ends with the bits of an undisturbed run.
//!
//! Two workers are separate processes (this test, started again) behind a proxy that delays, cuts and damages
//! connections. They are killed, stopped and continued at random times. A third one sends damaged, truncated, stale and
//! duplicate blocks. In every other round the coordinator dies without notice and another one takes its place, with
//! nothing or with what a checkpoint held.
//!
//! `BEAMFARM_CHAOS_ROUNDS=1000` makes it a long test; `BEAMFARM_CHAOS_SEED=17` repeats the round of that number.

use crate::farm::harness::{Coordinator, LONG, RawWorker, SCENE, free_port, settings, spec};
use beamfarm_coordinator::{DoneBlock, End, Start, Timing};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::encode_block;
use beamfarm_image::job::Block;
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_proto::{Grant, LeaseId};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::Scene;
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::broadcast;
use tokio::time::sleep;

const ROUNDS: u64 = 12;
const PASSES: u64 = 40;
const URL: &str = "BEAMFARM_CHAOS_URL";
const NAME: &str = "BEAMFARM_CHAOS_NAME";

/// Random numbers for one purpose in one round.
struct Dice(Sampler);

impl Dice {
    fn new(round: u64, purpose: u64) -> Self {
        Self(Sampler::new(99, round, Purpose::Test, purpose))
    }
    fn below(&mut self, n: u64) -> u64 {
        ((f64::from(self.0.next_1d()) * n as f64) as u64).min(n - 1)
    }
    fn ms(&mut self, from: u64, to: u64) -> Duration {
        Duration::from_millis(from + self.below(to - from))
    }
}

/// A worker, if this process was started as one.
#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
async fn worker_process() {
    let Ok(url) = std::env::var(URL) else {
        return;
    };
    let (_drain, receiver) = tokio::sync::watch::channel(false);
    let config = beamfarm_worker::Config {
        url,
        credentials: Default::default(),
        threads: 1,
        at_once: None,
        name: std::env::var(NAME).unwrap(),
        state: None,
        cache: None,
        patience: Duration::from_secs(10),
        grace: LONG,
    };
    let code = match beamfarm_worker::run(config, beamfarm_worker::offer::Offered::processors(), receiver).await {
        Ok(_) => 0,
        Err(_) => 1,
    };
    std::process::exit(code);
}

fn start_process(url: &str, name: &str) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "farm::chaos::worker_process", "--nocapture"])
        .env(URL, url)
        .env(NAME, name)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Both ends of a worker process.
struct Process {
    child: Child,
    url: String,
    name: String,
}

impl Process {
    fn start(url: &str, name: &str) -> Self {
        Self {
            child: start_process(url, name),
            url: url.into(),
            name: name.into(),
        }
    }
    fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
    fn replace(&mut self) {
        self.kill();
        self.child = start_process(&self.url, &self.name);
    }
    fn signal(&self, signal: &str) {
        let pid = self.child.id().to_string();
        let _ = Command::new("kill").args([signal, &pid]).status();
    }
    fn is_dead(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(Some(_)))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// What happens to a connection.
#[derive(Clone, Copy)]
enum Fate {
    Fine,
    Slow,
    Cut(u64),
    /// A bit of the worker's data flips.
    Damaged(u64),
}

/// Passes connections on to the coordinator, not all of them well. `cut` ends those that are open.
async fn proxy(listener: TcpListener, to: SocketAddr, round: u64, cut: broadcast::Sender<()>) {
    let mut dice = Dice::new(round, 1);
    loop {
        let Ok((near, _)) = listener.accept().await else {
            return;
        };
        let fate = match dice.below(6) {
            0 => Fate::Cut(2_000 + dice.below(100_000)),
            1 => Fate::Damaged(3_000 + dice.below(60_000)),
            2 => Fate::Slow,
            _ => Fate::Fine,
        };
        let mut cut = cut.subscribe();
        tokio::spawn(async move {
            let Ok(far) = TcpStream::connect(to).await else {
                return;
            };
            let (near_in, near_out) = near.into_split();
            let (far_in, far_out) = far.into_split();
            let back = match fate {
                Fate::Damaged(_) => Fate::Fine,
                fate => fate,
            };
            tokio::select! {
                () = pass_on(near_in, far_out, fate) => {}
                () = pass_on(far_in, near_out, back) => {}
                _ = cut.recv() => {}
            }
        });
    }
}

async fn pass_on(mut from: tokio::net::tcp::OwnedReadHalf, mut to: tokio::net::tcp::OwnedWriteHalf, fate: Fate) {
    let mut buffer = vec![0; 16 << 10];
    let mut sent = 0;
    while let Ok(count @ 1..) = from.read(&mut buffer).await {
        let mut count = count as u64;
        match fate {
            Fate::Fine => {}
            Fate::Slow => sleep(Duration::from_millis(5)).await,
            Fate::Cut(at) => count = count.min(at.saturating_sub(sent)),
            Fate::Damaged(at) => {
                if (sent..sent + count).contains(&at) {
                    buffer[(at - sent) as usize] ^= 0x10;
                }
            }
        }
        let bytes = &buffer[..count as usize];
        if count == 0 || to.write_all(bytes).await.is_err() {
            return;
        }
        sent += count;
    }
}

struct Truth {
    passes: Vec<Node>,
    average: Average,
}

impl Truth {
    /// The job without a farm.
    fn render() -> Self {
        let bundle = Bundle {
            scene: "scene.toml".into(),
            files: [("scene.toml".into(), SCENE.into())].into(),
        };
        let scene = Scene::new(beamfarm_scene::load(&bundle).unwrap());
        let plan = RenderPlan::new(&scene, settings());
        let camera = scene.description().camera;
        let mut sum = TreeSum::new(camera.width, camera.height);
        let mut passes = Vec::new();
        for pass_index in 0..PASSES {
            let image = render_pass(&scene, &plan, pass_index).expect("a pass");
            let leaf = Node::leaf(pass_index, image.film);
            passes.push(leaf.with_radius_scale(image.radius_scale));
            sum.insert(passes[pass_index as usize].clone()).unwrap();
        }
        let average = sum.average().unwrap();
        Self { passes, average }
    }

    fn block(&self, block: Block) -> Node {
        if block.level == 0 {
            return self.passes[block.start() as usize].clone();
        }
        let (level, index) = (block.level - 1, 2 * block.index);
        let left = Block { level, index };
        Node::join(self.block(left), self.block(left.sibling())).unwrap()
    }
}

/// Asks for blocks, and does the wrong thing with them. Ends with its connection.
async fn mischief(coordinator: Arc<Coordinator>, truth: Arc<Truth>, round: u64) {
    let mut dice = Dice::new(round, 2);
    let mut kept: Vec<(LeaseId, Block)> = Vec::new();
    let mut worker = RawWorker::named(&coordinator, "mischief").await;
    loop {
        let leased = match worker.grant().await {
            Ok(Grant::Lease(lease, block)) => (lease, block),
            Ok(Grant::NotNow) => continue,
            Ok(Grant::Done | Grant::Elsewhere) => return,
            Err(status) if status.code() == tonic::Code::PermissionDenied => {
                // Shut out for rubbish: it comes back as a new one.
                kept.clear();
                worker = RawWorker::named(&coordinator, "mischief").await;
                continue;
            }
            Err(_) => return,
        };
        let bytes = |block| encode_block(&truth.block(block), &worker.meta(block), &[]).unwrap();
        let mut good = bytes(leased.1);
        match dice.below(8) {
            0 => {
                good.truncate(good.len() / 2);
                let _ = worker.submit(leased, good).await;
            }
            1 => {
                // Damaged, under the hash of the good one.
                let header = worker.header(leased, &good);
                let at = good.len() - 1 - dice.below(1000) as usize;
                good[at] ^= 4;
                use beamfarm_proto::wire::submit_request::Part;
                let parts = vec![Part::Header(header), Part::Data(good.into())];
                let _ = worker.send(parts).await;
            }
            2 => {
                let _ = worker.submit(leased, good.clone()).await;
                let _ = worker.submit(leased, good).await;
            }
            3 => kept.push(leased),
            4 if !kept.is_empty() => {
                // One from long ago.
                kept.push(leased);
                let stale = kept.swap_remove(dice.below(kept.len() as u64) as usize);
                let _ = worker.submit(stale, bytes(stale.1)).await;
            }
            5 => {
                let wrong = (leased.0, leased.1.sibling());
                let _ = worker.submit(wrong, good).await;
            }
            _ => {
                let _ = worker.submit(leased, good).await;
            }
        }
        sleep(dice.ms(1, 15)).await;
    }
}

/// What a checkpoint taken now would restore.
fn checkpoint(coordinator: &Coordinator) -> Start {
    let sum = coordinator.farm.snapshot().sum;
    let done = coordinator.farm.blocks().into_iter().filter_map(|done| {
        Some(DoneBlock {
            block: done.block,
            hash: done.by?.1,
            worker: "before".into(),
            audited: done.confirmed,
        })
    });
    Start {
        done: done.collect(),
        sum: Some(sum),
        ..Start::default()
    }
}

async fn round(truth: &Arc<Truth>, round: u64) {
    let mut dice = Dice::new(round, 0);
    let timing = Timing {
        heartbeat: Duration::from_millis(40),
        lease: Duration::from_millis(250),
    };
    let mut spec = spec(PASSES);
    spec.audit_every = [0, 4, 1][dice.below(3) as usize];
    let port = free_port();
    let listener = port.try_clone().unwrap();
    let first = Coordinator::start_on(listener, spec.clone(), timing).await;
    let mut coordinator = Arc::new(first);
    let gate = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", gate.local_addr().unwrap());
    let (cut, _) = broadcast::channel(1);
    let proxy = tokio::spawn(proxy(gate, coordinator.address, round, cut.clone()));
    let mut processes: Vec<Process> = (0..2).map(|i| Process::start(&url, &format!("process {i}"))).collect();
    let mut imp = tokio::spawn(mischief(coordinator.clone(), truth.clone(), round));
    // The number of attacks after which the coordinator dies, if it does.
    let mut restart = round.is_multiple_of(2).then(|| 2 + dice.below(6));
    let begun = std::time::Instant::now();
    for act in 0.. {
        assert!(begun.elapsed() < Duration::from_secs(60), "round {round} hangs");
        let pause = dice.ms(10, 60);
        let ended = tokio::time::timeout(pause, coordinator.farm.ended()).await;
        if let Ok(end) = ended {
            assert_eq!(end, End::Complete, "round {round}");
            break;
        }
        for process in &mut processes {
            if process.is_dead() {
                process.replace();
            }
        }
        let victim = dice.below(2) as usize;
        match dice.below(8) {
            0 | 1 if act < 30 => processes[victim].replace(),
            2 if act < 30 => {
                processes[victim].signal("-STOP");
                sleep(dice.ms(50, 400)).await;
                processes[victim].signal("-CONT");
            }
            3 => {
                let _ = cut.send(());
            }
            _ => {}
        }
        if restart.is_some_and(|after| act >= after) {
            restart = None;
            let start = match dice.below(2) {
                0 => Start::default(),
                _ => checkpoint(&coordinator),
            };
            imp.abort();
            let _ = (&mut imp).await;
            drop(coordinator);
            let _ = cut.send(());
            let listener = port.try_clone().unwrap();
            let next = Coordinator::resume_on(listener, spec.clone(), timing, start).await;
            coordinator = Arc::new(next);
            imp = tokio::spawn(mischief(coordinator.clone(), truth.clone(), round + 1_000_000));
        }
    }
    let average = coordinator.farm.average().unwrap();
    assert!(average == truth.average, "round {round}: other bits");
    let progress = coordinator.farm.progress();
    assert_eq!((progress.prefix, progress.passes), (PASSES, PASSES));
    assert_eq!((progress.divergent, progress.failures), (0, 0), "round {round}");
    imp.abort();
    proxy.abort();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_round_ends_with_the_same_bits() {
    let truth = Arc::new(Truth::render());
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let rounds = match number("BEAMFARM_CHAOS_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("BEAMFARM_CHAOS_ROUNDS").unwrap_or(ROUNDS),
    };
    for seed in rounds {
        round(&truth, seed).await;
    }
}
