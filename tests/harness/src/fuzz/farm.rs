//! Calls to a coordinator, from the message to the ledger and the sum, without a network.
//!
//! What is refused changes nothing that counts, and what is accepted is what it claims to be: whatever came, the job
//! ends with the right bits.

use axum::Router;
use beamfarm_coordinator::ledger::Done;
use beamfarm_coordinator::limits::Limits;
use beamfarm_coordinator::{End, Farm, JobSpec, Series, Start, Terms, Timing, Watch, WorkerState, server};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{BlockMeta, decode_block, encode_block};
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, EngineKind, JobSettings, MAX_PASSES, ScheduleKind, Techniques};
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_image::radius::Schedule;
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::control_client::ControlClient;
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{FileHash, Grant, VERSION, WireHash, wire};
use prost::Message;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};
use tonic::{Code, Status};

const WIDTH: u32 = 5;
const HEIGHT: u32 = 4;
/// Calls per input.
const CALLS: usize = 16;
/// Bytes in one part of a delivery.
const PART: usize = 1001;

thread_local! {
    static RUNTIME: Option<Runtime> = Builder::new_current_thread().enable_all().build().ok();
}

fn settings() -> JobSettings {
    JobSettings {
        seed: 11,
        alpha: 0.7,
        schedule: ScheduleKind::Pass,
        budget: None,
        paths_per_pass: 5,
        reference_paths: 5,
        techniques: Techniques::default(),
        engine: EngineKind::default(),
    }
}

fn spec(passes: u64) -> JobSpec {
    let scene = "scene.toml".to_string();
    JobSpec {
        bundle: Bundle {
            files: [(scene.clone(), b"# nobody reads it".to_vec())].into(),
            scene,
        },
        settings: settings(),
        width: WIDTH,
        height: HEIGHT,
        layers: Vec::new(),
        first_pass: 0,
        passes,
        audit_every: 0,
    }
}

/// What a worker of this job delivers for a block.
fn delivery(block: Block) -> Option<Vec<u8>> {
    let settings = settings();
    let meta = BlockMeta {
        scene: spec(1).bundle.hash(),
        block,
        seed: settings.seed,
        alpha: settings.alpha,
        radius_scale: Schedule::new(&settings).scale(block.start()),
        version: VERSION.into(),
        engine: settings.engine,
    };
    encode_block(&node(block)?, &meta, &[]).ok()
}

fn node(block: Block) -> Option<Node> {
    let leaf = |pass: u64| {
        let mut film = Film::new(WIDTH, HEIGHT);
        for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
            *value = (i as f32 + pass as f32) / 8.0;
        }
        Node::leaf(pass, film).with_radius_scale(Schedule::new(&settings()).scale(pass))
    };
    let mut leaves = block.passes().map(leaf);
    match block.level {
        0 => leaves.next(),
        1 => Node::join(leaves.next()?, leaves.next()?).ok(),
        // No larger blocks are handed out here.
        _ => None,
    }
}

/// The picture of these blocks.
fn average(nodes: impl IntoIterator<Item = Node>) -> Option<Average> {
    let mut sum = TreeSum::new(WIDTH, HEIGHT).with_fence(0);
    for node in nodes {
        sum.insert(node).ok()?;
    }
    sum.average()
}

/// Everything that counts in a job.
#[derive(Clone, Debug, PartialEq)]
struct State {
    prefix: u64,
    passes: u64,
    limit: u64,
    paused: bool,
    end: Option<End>,
    done: Vec<Done>,
    average: Option<Average>,
}

/// The workers: number, state, passes that count, what each is rendering.
type Crew = Vec<(u64, WorkerState, u64, Option<(Block, u64)>)>;

/// A coordinator, and a way to call it.
struct Site {
    farm: Arc<Farm>,
    router: Router,
}

impl Site {
    async fn new(passes: u64) -> Self {
        let timing = Timing {
            heartbeat: Duration::from_millis(1),
            lease: Duration::from_secs(3600),
        };
        let farm = Farm::new(spec(passes), timing, Start::default());
        let watch = Watch::new(farm.clone(), Terms::default());
        let router = server::router(&Series::of(watch), Limits::default()).await;
        Self { farm, router }
    }

    fn state(&self) -> State {
        let progress = self.farm.progress();
        State {
            prefix: progress.prefix,
            passes: progress.passes,
            limit: progress.limit,
            paused: progress.paused,
            end: self.farm.end(),
            done: self.farm.blocks(),
            average: self.farm.average(),
        }
    }

    fn crew(&self) -> Crew {
        let seen = self.farm.progress().workers_seen.into_iter();
        seen.map(|view| (view.id.0, view.state, view.passes, view.rendering))
            .collect()
    }

    async fn worker(&self, name: &str) -> Worker {
        let mut farm = FarmClient::new(self.router.clone());
        let request = wire::RegisterRequest {
            protocol: beamfarm_proto::PROTOCOL,
            version: VERSION.into(),
            name: name.into(),
            identity: vec![1; 32].into(),
            threads: 1,
            offers: vec![wire::Offer::of_processors(FileHash([1; 32]).to_wire())],
            ..wire::RegisterRequest::default()
        };
        let reply = taken(farm.register(request).await);
        Worker {
            farm,
            id: reply.worker,
            scene: self.farm.job().scene.to_wire(),
        }
    }

    /// The job is complete, and has the bits that it would have without the refused calls.
    fn check_end(&self, nodes: impl IntoIterator<Item = Node>) {
        assert_eq!(self.farm.end(), Some(End::Complete));
        assert_eq!(self.farm.average(), average(nodes));
    }
}

struct Worker {
    farm: FarmClient<Router>,
    id: u64,
    scene: Bytes,
}

impl Worker {
    /// A block, if there is one now.
    async fn lease(&mut self) -> Option<(u64, Block)> {
        let request = wire::LeaseRequest {
            worker: self.id,
            scene: self.scene.clone(),
            ..Default::default()
        };
        match Grant::try_from(taken(self.farm.lease(request).await)) {
            Ok(Grant::Lease(lease, block)) => Some((lease.0, block)),
            Ok(Grant::NotNow | Grant::Done | Grant::Elsewhere) => None,
            Err(error) => panic!("{error}"),
        }
    }

    async fn submit(&mut self, header: wire::SubmitHeader, bytes: &[u8]) -> Result<(), Status> {
        let parts = bytes.chunks(PART);
        let parts = parts.map(|part| Part::Data(Bytes::copy_from_slice(part)));
        let parts: Vec<_> = std::iter::once(Part::Header(header))
            .chain(parts)
            .map(|part| wire::SubmitRequest { part: Some(part) })
            .collect();
        let reply = self.farm.submit(tokio_stream::iter(parts)).await?;
        let _ = reply.into_inner();
        Ok(())
    }

    /// As workers do.
    async fn deliver(&mut self, (lease, block): (u64, Block)) {
        let Some(bytes) = delivery(block) else {
            panic!("{block} is larger than expected")
        };
        let header = header(self.id, lease, block, &bytes);
        if let Err(status) = self.submit(header, &bytes).await {
            panic!("{block}: {status}");
        }
    }

    /// Delivers blocks until the job is over.
    async fn finish(&mut self, site: &Site) {
        for _ in 0..1000 {
            if let Some(leased) = self.lease().await {
                self.deliver(leased).await;
            } else if site.farm.end().is_some() {
                return;
            }
        }
        panic!("the job does not end: {:?} {:?}", site.state(), site.crew());
    }
}

fn header(worker: u64, lease: u64, block: Block, bytes: &[u8]) -> wire::SubmitHeader {
    wire::SubmitHeader {
        worker,
        lease,
        block: Some(block.into()),
        size: bytes.len() as u64,
        hash: FileHash::of(bytes).to_wire(),
        stats: None,
    }
}

/// Calls that must succeed.
fn taken<T>(answer: Result<tonic::Response<T>, Status>) -> T {
    match answer {
        Ok(reply) => reply.into_inner(),
        Err(status) => panic!("{status}"),
    }
}

/// A refusal, not a panic in the code that should refuse.
fn check_refusal(status: &Status) {
    let broken = [Code::Unknown, Code::Cancelled, Code::Unimplemented];
    assert!(!broken.contains(&status.code()), "{status}");
}

fn block_on<T>(work: impl Future<Output = T>) -> Option<T> {
    RUNTIME.with(|runtime| Some(runtime.as_ref()?.block_on(work)))
}

/// Calls of clients that steer, one after the other: each a byte that selects the call, a length, and the message.
pub fn control(data: &[u8]) {
    block_on(steer(data));
}

async fn steer(mut data: &[u8]) {
    let site = Site::new(4).await;
    let mut worker = site.worker("a").await;
    if let Some(leased) = worker.lease().await {
        worker.deliver(leased).await;
    }
    let crew = site.crew();
    let mut control = ControlClient::new(site.router.clone());
    let mut expected = site.state();
    for _ in 0..CALLS {
        let Some(([kind, length], rest)) = data.split_first_chunk() else {
            break;
        };
        let (message, rest) = rest.split_at(rest.len().min(usize::from(*length)));
        data = rest;
        let over = expected.end.is_some();
        let (answer, allowed) = match kind % 6 {
            0 => {
                let reply = taken(control.status(wire::StatusRequest {}).await);
                let found = (reply.prefix, reply.passes, reply.limit);
                assert_eq!(found, (expected.prefix, expected.passes, expected.limit));
                continue;
            }
            1 => (control.cancel(wire::CancelRequest {}).await.map(drop), !over),
            2 => (control.pause(wire::PauseRequest {}).await.map(drop), !over),
            3 => (control.resume(wire::ResumeRequest {}).await.map(drop), !over),
            4 => {
                let Ok(request) = wire::ExtendRequest::decode(message) else {
                    continue;
                };
                let passes = request.passes;
                let answer = control.extend(request).await.map(drop);
                let fits = (expected.limit..=MAX_PASSES).contains(&passes);
                if fits && !over {
                    expected.limit = passes;
                }
                (answer, fits && !over)
            }
            // Nobody writes images here.
            _ => (control.write_now(wire::WriteNowRequest {}).await.map(drop), false),
        };
        match answer {
            Ok(()) => assert!(allowed, "{kind}: {expected:?}"),
            Err(status) => {
                assert!(!allowed, "{kind}: {status}");
                check_refusal(&status);
            }
        }
        if allowed {
            match kind % 6 {
                1 => expected.end = Some(End::Stopped),
                2 => expected.paused = true,
                3 => expected.paused = false,
                _ => {}
            }
        }
        assert_eq!(site.state(), expected);
    }
    assert_eq!(site.crew(), crew);
}

/// A message that gives leases back. Its numbers of workers and leases count from the first existing one.
pub fn give_back(data: &[u8]) {
    let Ok(request) = wire::GiveBackRequest::decode(data) else {
        return;
    };
    block_on(return_leases(request));
}

async fn return_leases(mut request: wire::GiveBackRequest) {
    let site = Site::new(6).await;
    let mut here = site.worker("here").await;
    let mut there = site.worker("there").await;
    if let Some(leased) = here.lease().await {
        here.deliver(leased).await;
    }
    let mut held = Vec::new();
    for _ in 0..2 {
        held.extend(here.lease().await);
    }
    let others = there.lease().await;
    let first = held.first().map_or(0, |(lease, _)| *lease);
    request.worker = request.worker.wrapping_add(here.id);
    for lease in &mut request.leases {
        *lease = lease.wrapping_add(first);
    }
    let named: BTreeSet<u64> = request.leases.iter().copied().collect();
    let is_here = request.worker == here.id;
    let is_known = is_here || request.worker == there.id;
    let is_given = |lease: u64| request.leaving || named.contains(&lease);
    let (state, crew) = (site.state(), site.crew());
    let answer = here.farm.give_back(request.clone()).await;
    // Giving back never removes what is already delivered.
    assert_eq!(site.state(), state);
    match answer {
        Ok(_) => assert!(is_known),
        Err(status) => {
            assert!(!is_known, "{status}");
            check_refusal(&status);
            assert_eq!(site.crew(), crew);
        }
    }
    // Leases no longer held are handed out again, and nothing else.
    let mut free: Vec<Block> = held
        .iter()
        .filter(|(lease, _)| is_here && is_given(*lease))
        .map(|(_, block)| *block)
        .collect();
    if let Some((lease, block)) = others
        && request.worker == there.id
        && is_given(lease)
    {
        free.push(block);
    }
    let mut third = site.worker("third").await;
    for block in free {
        assert_eq!(third.lease().await.map(|leased| leased.1), Some(block));
    }
    // Whoever delivers them in the end.
    for leased in held {
        here.deliver(leased).await;
    }
    if let Some(leased) = others {
        there.deliver(leased).await;
    }
    third.finish(&site).await;
    site.check_end((0..6).filter_map(|pass| node(Block::leaf(pass))));
}

/// A delivery: a byte whose lowest bit asks to correct size and hash, the length of the header, the header, the
/// picture. The numbers of worker and lease count from the existing ones.
pub fn submit(data: &[u8]) {
    submitted(data);
}

/// As [`submit`]; returns whether it was accepted.
pub fn submitted(data: &[u8]) -> bool {
    let Some(([flags, length], rest)) = data.split_first_chunk() else {
        return false;
    };
    let (header, bytes) = rest.split_at(rest.len().min(usize::from(*length)));
    let Ok(mut header) = wire::SubmitHeader::decode(header) else {
        return false;
    };
    if flags & 1 == 1 {
        header.size = bytes.len() as u64;
        header.hash = FileHash::of(bytes).to_wire();
    }
    block_on(send(header, bytes)).unwrap_or(false)
}

async fn send(mut header: wire::SubmitHeader, bytes: &[u8]) -> bool {
    let site = Site::new(2).await;
    let mut worker = site.worker("a").await;
    let Some(leased) = worker.lease().await else {
        panic!("no pass to be had");
    };
    header.worker = header.worker.wrapping_add(worker.id);
    header.lease = header.lease.wrapping_add(leased.0);
    let before = site.state();
    let answer = worker.submit(header, bytes).await;
    let node_of = |block| node(block).into_iter();
    let first = match &answer {
        Ok(()) => {
            let Ok((node, _)) = decode_block(bytes, WIDTH, HEIGHT, &[]) else {
                panic!("what cannot be read was taken");
            };
            assert_eq!(node.block, leased.1);
            let sum = site.farm.snapshot().sum;
            let held: Vec<&Node> = sum.nodes().map(|node| &**node).collect();
            assert_eq!(held, [&node]);
            Some(node)
        }
        Err(status) => {
            check_refusal(status);
            assert_eq!(site.state(), before);
            // Neither the pass nor the worker is lost.
            worker.deliver(leased).await;
            node(leased.1)
        }
    };
    worker.finish(&site).await;
    site.check_end(first.into_iter().chain(node_of(Block::leaf(1))));
    answer.is_ok()
}

/// Initial inputs, by target and name.
pub fn seeds() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let extend = |passes| {
        let message = wire::ExtendRequest { passes }.encode_to_vec();
        [vec![4, message.len() as u8], message].concat()
    };
    let give_back = |worker, leases: &[u64], leaving| {
        let leases = leases.to_vec();
        wire::GiveBackRequest {
            worker,
            leases,
            leaving,
        }
        .encode_to_vec()
    };
    let block = Block::leaf(0);
    let bytes = delivery(block).unwrap_or_default();
    let header = header(0, 0, block, &bytes).encode_to_vec();
    let submit = |flags| [&[flags, header.len() as u8], &header[..], &bytes].concat();
    vec![
        (
            "control",
            "all",
            [&[0, 0, 2, 0, 3, 0][..], &extend(9), &[5, 0, 1, 0, 2, 0]].concat(),
        ),
        (
            "control",
            "extend",
            [extend(4), extend(3), extend(u64::MAX), extend(MAX_PASSES)].concat(),
        ),
        ("give_back", "one", give_back(0, &[0], false)),
        ("give_back", "both", give_back(0, &[1, 0, 1, 300], false)),
        ("give_back", "leaving", give_back(0, &[], true)),
        ("give_back", "of_another", give_back(1, &[0, 1, 2], false)),
        ("give_back", "unknown", give_back(7, &[0, 1], true)),
        ("submit", "sealed", submit(1)),
        ("submit", "open", submit(0)),
    ]
}
