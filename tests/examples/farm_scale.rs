//! How many workers a coordinator can serve: `cargo run --release -p beamfarm-tests --example farm_scale -- [WORKERS]
//! [PASSES] [WIDTHxHEIGHT] [LAYERS]`. The defaults are 1000 workers, 1000 passes, 1280x720 and no layers; layers are
//! given like `depth,normal`.
//!
//! A coordinator in a separate process accepts blocks from simulated workers, tasks of this process that send
//! ready-made images, each over its own connection. What it accepts per second of its CPU time is compared with what
//! one core can copy and sum. Meanwhile an onlooker keeps asking for its status and its page.

use beamfarm_coordinator::{Farm, JobSpec, Start, Terms, Timing, Watch, server};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{BlockMeta, encode_block};
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, EngineKind, JobSettings, ScheduleKind, Techniques};
use beamfarm_image::layer::{Layer, LayerCounts, parse_all};
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_image::radius::Schedule;
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::control_client::ControlClient;
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{CHUNK_BYTES, FileHash, Grant, Identity, VERSION, WireHash, wire};
use beamfarm_render::sampler::{Purpose, Sampler};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// The format of a pass.
#[derive(Clone)]
struct Shape {
    width: u32,
    height: u32,
    layers: Vec<Layer>,
}

impl Shape {
    /// Parsed from the rest of the command line.
    fn read(mut args: impl Iterator<Item = String>) -> Result<Self, AnyError> {
        let size = args.next().unwrap_or_else(|| "1280x720".into());
        let (width, height) = size.split_once('x').ok_or("expected WIDTHxHEIGHT")?;
        let layers = args.next().unwrap_or_default();
        let names: Vec<&str> = layers.split(',').filter(|name| !name.is_empty()).collect();
        Ok(Self {
            width: width.parse()?,
            height: height.parse()?,
            layers: parse_all(names.into_iter())?,
        })
    }

    fn args(&self) -> [String; 2] {
        let names: Vec<String> = self.layers.iter().map(Layer::to_string).collect();
        [format!("{}x{}", self.width, self.height), names.join(",")]
    }

    fn sum(&self) -> TreeSum {
        TreeSum::new(self.width, self.height).with_layers(LayerCounts::of(&self.layers))
    }

    fn leaf(&self, pass: u64, film: &Film) -> Node {
        let layers = self.layers.iter().map(|layer| used(film, layer.channels().len()));
        Node::leaf(pass, film.clone())
            .with_layers(layers.collect())
            .with_radius_scale(Schedule::new(&settings()).scale(pass))
    }

    fn noise(&self) -> Film {
        let mut film = Film::new(self.width, self.height);
        let mut sampler = Sampler::new(0, 0, Purpose::Test, 0);
        for pixel in &mut film.pixels {
            *pixel = [0; 3].map(|_| sampler.next_1d());
        }
        film
    }
}

/// The same with only this many values per pixel, as layers have them.
fn used(film: &Film, channels: usize) -> Film {
    let mut film = film.clone();
    for pixel in &mut film.pixels {
        pixel[channels..].fill(0.0);
    }
    film
}

fn settings() -> JobSettings {
    JobSettings {
        seed: 0,
        alpha: 0.5,
        schedule: ScheduleKind::Pass,
        budget: None,
        paths_per_pass: 1,
        reference_paths: 1,
        techniques: Techniques::default(),
        engine: EngineKind::default(),
    }
}

fn main() -> Result<(), AnyError> {
    let mut args = std::env::args().skip(1);
    let first = args.next();
    if first.as_deref() == Some("coordinator") {
        let passes = args.next().ok_or("expected a number of passes")?.parse()?;
        return coordinator(passes, &Shape::read(args)?);
    }
    let workers = first.map_or(Ok(1000), |text| text.parse())?;
    let passes: u64 = args.next().map_or(Ok(1000), |text| text.parse())?;
    let shape = Shape::read(args)?;
    let (copied, added) = one_core(&shape);
    println!(
        "one core copies a block of {} x {} and {} layers in {:.2} ms and sums it in {:.2} ms",
        shape.width,
        shape.height,
        shape.layers.len(),
        1e3 * copied,
        1e3 * added
    );
    let mut child = Command::new(std::env::current_exe()?)
        .args(["coordinator", &passes.to_string()])
        .args(shape.args())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut lines = BufReader::new(child.stdout.take().ok_or("no stdout")?).lines();
    let url = lines.next().ok_or("no address")??;
    let before = cpu_seconds(child.id())?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        // Image encoding must not keep this thread from answering.
        .max_blocking_threads(1)
        .enable_all()
        .build()?;
    let begun = Instant::now();
    let (taken, answered) = runtime.block_on(async {
        let asking = Arc::new(Mutex::new(Vec::new()));
        tokio::spawn(onlooker(url.clone(), asking.clone()));
        let taken = crowd(&url, workers, passes, &shape, child.id()).await?;
        let answered = asking.lock().map_err(|_| "a thread failed")?.clone();
        Ok::<_, AnyError>((taken, answered))
    })?;
    let wall = begun.elapsed().as_secs_f64();
    let cpu = cpu_seconds(child.id())? - before;
    drop(child.stdin.take());
    child.wait()?;
    let per_block = cpu / taken as f64;
    println!(
        "{workers} workers, {passes} passes in {taken} blocks in {wall:.1} s: {:.1} blocks/s, {:.2} ms of the coordinator's CPU time a block, {:.2} of what one core can copy and sum",
        taken as f64 / wall,
        1e3 * per_block,
        (copied + added) / per_block
    );
    for (what, take) in [("status", 0), ("page", 1)] {
        let mut times: Vec<f64> = answered.iter().map(|times: &[f64; 2]| times[take]).collect();
        times.sort_by(f64::total_cmp);
        if let (Some(most), Some(median)) = (times.last(), times.get(times.len() / 2)) {
            println!(
                "{what}: answered {} times, in {:.0} ms, at most {:.0} ms",
                times.len(),
                1e3 * median,
                1e3 * most
            );
        }
    }
    Ok(())
}

/// Serves one job. Ends with its standard input.
fn coordinator(passes: u64, shape: &Shape) -> Result<(), AnyError> {
    let scene = "scene.toml".to_owned();
    let spec = JobSpec {
        bundle: Bundle {
            files: [(scene.clone(), Vec::new())].into(),
            scene,
        },
        settings: settings(),
        width: shape.width,
        height: shape.height,
        layers: shape.layers.clone(),
        first_pass: 0,
        passes,
        audit_every: 64,
    };
    let runtime = tokio::runtime::Runtime::new()?;
    runtime.block_on(async {
        let listener = server::listen(SocketAddr::from(([127, 0, 0, 1], 0)))?;
        println!("http://{}", listener.local_addr()?);
        let farm = Farm::new(spec, Timing::default(), Start::default());
        let ended = tokio::task::spawn_blocking(|| {
            let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        });
        let watch = Watch::new(farm, Terms::default());
        server::run(listener, watch, async {
            let _ = ended.await;
        })
        .await;
        Ok(())
    })
}

/// Seconds that one core takes to copy a block's bytes, and to add the block to the sum.
fn one_core(shape: &Shape) -> (f64, f64) {
    const BLOCKS: u64 = 64;
    let film = shape.noise();
    let channels: usize = shape.layers.iter().map(|layer| layer.channels().len()).sum();
    let bytes = vec![1u8; film.pixels.len() * 4 * (3 + channels)];
    let mut copy = vec![0u8; bytes.len()];
    let begun = Instant::now();
    for _ in 0..BLOCKS {
        copy.copy_from_slice(std::hint::black_box(&bytes));
        std::hint::black_box(&mut copy);
    }
    let copied = begun.elapsed().as_secs_f64() / BLOCKS as f64;
    let mut sum = shape.sum();
    let mut added = 0.0;
    for pass in 0..BLOCKS {
        let node = shape.leaf(pass, &film);
        let begun = Instant::now();
        if let Err(error) = sum.insert(node) {
            eprintln!("{error}");
        }
        added += begun.elapsed().as_secs_f64();
    }
    (copied, added / BLOCKS as f64)
}

/// Runs all workers at once until all blocks have been accepted.
///
/// Returns how many blocks there were: passes arrive in larger blocks when the coordinator is overloaded.
async fn crowd(url: &str, workers: u64, passes: u64, shape: &Shape, coordinator: u32) -> Result<u64, AnyError> {
    let ready = Arc::new(ReadyMade {
        film: shape.noise(),
        shape: shape.clone(),
        known: Mutex::default(),
    });
    let taken = Arc::new(AtomicU64::new(0));
    let mut tasks = tokio::task::JoinSet::new();
    for index in 0..workers {
        tasks.spawn(worker(url.to_owned(), index, ready.clone(), taken.clone()));
    }
    let mut told = 0;
    let mut ticks = tokio::time::interval(Duration::from_millis(100));
    loop {
        tokio::select! {
            _ = ticks.tick() => {
                let now = taken.load(Ordering::Relaxed);
                if now >= told {
                    println!("{now:6} blocks taken, the coordinator holds {:.0} MB", resident(coordinator)? / 1e6);
                    told = now + passes / 10;
                }
            }
            ended = tasks.join_next() => match ended {
                Some(ended) => ended??,
                None => return Ok(taken.load(Ordering::Relaxed)),
            },
        }
    }
}

/// Keeps asking for status and page; measures the answers in seconds.
async fn onlooker(url: String, answered: Arc<Mutex<Vec<[f64; 2]>>>) -> Result<(), AnyError> {
    let mut control = ControlClient::connect(url.clone()).await?;
    loop {
        let begun = Instant::now();
        control.status(wire::StatusRequest::default()).await?;
        let status = begun.elapsed().as_secs_f64();
        let begun = Instant::now();
        let address = url.trim_start_matches("http://");
        let mut page = tokio::net::TcpStream::connect(address).await?;
        let request = format!("GET / HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
        page.write_all(request.as_bytes()).await?;
        let mut text = String::new();
        page.read_to_string(&mut text).await?;
        if !text.starts_with("HTTP/1.1 200") {
            return Err(format!("the page answers {}", text.lines().next().unwrap_or_default()).into());
        }
        let times = [status, begun.elapsed().as_secs_f64()];
        answered.lock().map_err(|_| "a thread failed")?.push(times);
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
}

async fn register(url: &str, index: u64) -> Result<(FarmClient<Channel>, wire::RegisterReply), AnyError> {
    let mut farm = FarmClient::connect(url.to_owned()).await?;
    let request = wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        name: format!("simulated {index}"),
        identity: Identity::random()?.reveal().to_vec().into(),
        threads: 1,
        offers: vec![wire::Offer::of_processors(vec![1; 32].into())],
        ..Default::default()
    };
    let reply = farm.register(request).await?.into_inner();
    Ok((farm, reply))
}

async fn worker(url: String, index: u64, ready: Arc<ReadyMade>, taken: Arc<AtomicU64>) -> Result<(), AnyError> {
    // A thousand at the same moment exceed the socket's backlog: retry a little later, as workers do.
    let (mut farm, reply) = loop {
        match register(&url, index).await {
            Ok(registered) => break registered,
            Err(error) => eprintln!("worker {index} tries again: {error}"),
        }
        tokio::time::sleep(Duration::from_millis(100 + index)).await;
    };
    let scene = reply.job.unwrap_or_default().scene;
    let (beats, receiver) = mpsc::channel(4);
    let every = Duration::from_millis(reply.heartbeat_ms.into()) / 2;
    tokio::spawn(async move {
        let beat = wire::Heartbeat {
            worker: reply.worker,
            ..Default::default()
        };
        while beats.send(beat.clone()).await.is_ok() {
            tokio::time::sleep(every).await;
        }
    });
    let mut notices = farm.attend(ReceiverStream::new(receiver)).await?.into_inner();
    let work = async {
        loop {
            let request = wire::LeaseRequest {
                worker: reply.worker,
                scene: scene.clone(),
                ..Default::default()
            };
            let grant = Grant::try_from(farm.lease(request).await?.into_inner())?;
            let (lease, block) = match grant {
                Grant::Lease(lease, block) => (lease, block),
                Grant::NotNow => continue,
                Grant::Done | Grant::Elsewhere => return Ok::<(), AnyError>(()),
            };
            let (ready, scene_hash) = (ready.clone(), scene.clone());
            let made = tokio::task::spawn_blocking(move || ready.image(block, &scene_hash));
            let Image { head, tail, hash } = made.await??;
            let header = wire::SubmitHeader {
                worker: reply.worker,
                lease: lease.0,
                block: Some(block.into()),
                size: (head.len() + tail.len()) as u64,
                hash: hash.to_wire(),
                stats: None,
            };
            // As workers do: when too much arrives at once, retry a little later.
            let mut pause = Duration::from_millis(50);
            loop {
                let mut rest = [head.clone(), tail.clone()];
                let chunks = std::iter::from_fn(move || {
                    let rest = rest.iter_mut().find(|rest| !rest.is_empty())?;
                    Some(Part::Data(rest.split_to(rest.len().min(CHUNK_BYTES))))
                });
                let parts = std::iter::once(Part::Header(header.clone())).chain(chunks);
                let parts = parts.map(|part| wire::SubmitRequest { part: Some(part) });
                match farm.submit(tokio_stream::iter(parts)).await {
                    Ok(_) => break,
                    Err(status) if status.code() == tonic::Code::ResourceExhausted => {
                        tokio::time::sleep(pause).await;
                        pause = (2 * pause).min(Duration::from_secs(5));
                    }
                    Err(status) => return Err(status.into()),
                }
            }
            taken.fetch_add(1, Ordering::Relaxed);
        }
    };
    tokio::select! {
        ended = work => ended,
        _ = notices.message() => Ok(()),
    }
}

/// An encoded block.
struct Image {
    head: Bytes,
    /// Shared by all blocks of a level: a thousand copies would not fit into memory.
    tail: Bytes,
    hash: FileHash,
}

/// Makes blocks that always hold the same film.
struct ReadyMade {
    film: Film,
    shape: Shape,
    /// One block of each level, and its bytes.
    known: Mutex<BTreeMap<u32, (Node, Bytes)>>,
}

impl ReadyMade {
    fn image(&self, block: Block, scene: &[u8]) -> Result<Image, AnyError> {
        let mut known = self.known.lock().map_err(|_| "a thread failed")?;
        if let Entry::Vacant(place) = known.entry(block.level) {
            let node = self.node(block)?;
            let bytes = self.encoded(&node, scene)?;
            place.insert((node, bytes));
        }
        let (node, like) = known.get_mut(&block.level).ok_or("no such level")?;
        node.block = block;
        let bytes = self.encoded(node, scene)?;
        let pairs = bytes.iter().rev().zip(like.iter().rev());
        let common = pairs.take_while(|(a, b)| a == b).count();
        Ok(Image {
            hash: FileHash::of(&bytes),
            head: Bytes::copy_from_slice(&bytes[..bytes.len() - common]),
            tail: like.slice(like.len() - common..),
        })
    }

    fn node(&self, block: Block) -> Result<Node, AnyError> {
        let mut sum = self.shape.sum();
        for pass in block.passes() {
            sum.insert(self.shape.leaf(pass, &self.film))?;
        }
        let node = sum.nodes().next().ok_or("an empty block")?;
        Ok(Node::clone(node))
    }

    fn encoded(&self, node: &Node, scene: &[u8]) -> Result<Bytes, AnyError> {
        let meta = BlockMeta {
            scene: beamfarm_image::job::SceneHash(scene.try_into()?),
            block: node.block,
            seed: settings().seed,
            alpha: settings().alpha,
            radius_scale: Schedule::new(&settings()).scale(node.block.start()),
            version: VERSION.into(),
            engine: settings().engine,
        };
        Ok(encode_block(node, &meta, &self.shape.layers)?.into())
    }
}

/// CPU seconds of a process so far (Linux).
fn cpu_seconds(pid: u32) -> Result<f64, AnyError> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok());
    Ok((ticks(11).unwrap_or(0.0) + ticks(12).unwrap_or(0.0)) / 100.0)
}

/// Bytes of memory of a process (Linux).
fn resident(pid: u32) -> Result<f64, AnyError> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    Ok(kilobytes.unwrap_or(0.0) * 1024.0)
}
