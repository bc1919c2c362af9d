//! A coordinator in this process, and a worker under a test's control.

use beamfarm_coordinator::limits::Limits;
use beamfarm_coordinator::security::Security;
use beamfarm_coordinator::{End, Entrance, Farm, JobSpec, Progress, Start, Terms, Timing, Watch, server};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{BlockMeta, encode_block};
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, EngineKind, JobSettings, PassStats, ScheduleKind, Techniques};
use beamfarm_image::merge::Node;
use beamfarm_image::radius::Schedule;
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{FileHash, Grant, Job, LeaseId, VERSION, WireHash, wire};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_worker::offer::Offered;
use beamfarm_worker::security::Credentials;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Once, OnceLock, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

/// A small scene with a medium, glass and shadow.
pub const SCENE: &str = r#"
[image]
width = 40
height = 30
[render]
passes = 7
paths = 500
seed = 11
[camera]
origin = [0.0, 1.0, 3.0]
target = [0.0, 1.0, 0.0]
fov = 50.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.3, 0.4, 0.5]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [0, 1, 0]
radius = 0.35
material = "glass"
[[shapes]]
type = "rectangle"
transform = [{ scale = 3.0 }, { translate = [0, 1, -2] }]
[[lights]]
type = "point"
position = [0.5, 2, 0.5]
power = 100.0
"#;

pub const WIDTH: u32 = 40;
pub const HEIGHT: u32 = 30;

/// Nothing in these tests takes this long. As the length of a lease it means that only a broken connection can end one.
pub const LONG: Duration = Duration::from_secs(3600);

/// How long to wait for something that must happen, on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Its result. Failing is better than waiting for ever.
pub async fn within<T>(what: &str, awaited: impl Future<Output = T>) -> T {
    match timeout(PATIENCE, awaited).await {
        Ok(result) => result,
        Err(_) => panic!("waited {PATIENCE:?} for {what}"),
    }
}

pub fn settings() -> JobSettings {
    JobSettings {
        seed: 11,
        alpha: 0.7,
        schedule: ScheduleKind::Pass,
        budget: None,
        paths_per_pass: 500,
        reference_paths: 500,
        techniques: Techniques::default(),
        engine: EngineKind::default(),
    }
}

pub fn spec(passes: u64) -> JobSpec {
    let scene = "scene.toml".to_string();
    let bytes = SCENE.as_bytes().to_vec();
    JobSpec {
        bundle: Bundle {
            files: [(scene.clone(), bytes)].into(),
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

pub fn free_port() -> std::net::TcpListener {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    listener
}

/// A coordinator. Its server dies with it.
pub struct Coordinator {
    pub farm: Arc<Farm>,
    pub watch: Arc<Watch>,
    pub address: SocketAddr,
    /// Keeps the server open when the job is over.
    staying: watch::Sender<bool>,
    pub machine: Machine,
}

/// Everything that a server runs. When it is dropped, connections break without notice, as when a process is killed.
pub struct Machine {
    runtime: Option<Runtime>,
    name: String,
}

/// Messages of panics in threads of machines, by the machine's name.
static PANICS: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());

impl Machine {
    pub fn new() -> Self {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |panic| {
                if let Some(name) = std::thread::current().name() {
                    let mut panics = PANICS.lock().unwrap_or_else(PoisonError::into_inner);
                    panics.push((name.to_owned(), panic.to_string()));
                }
                before(panic);
            }));
        });
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let name = format!("machine {}", COUNT.fetch_add(1, Ordering::Relaxed));
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name(&name)
            .enable_all()
            .build()
            .unwrap();
        Self {
            runtime: Some(runtime),
            name,
        }
    }

    pub fn spawn<T: Send + 'static>(&self, task: impl Future<Output = T> + Send + 'static) -> JoinHandle<T> {
        self.runtime.as_ref().unwrap().spawn(task)
    }

    /// Messages of its tasks that panicked.
    pub fn panics(&self) -> Vec<String> {
        let panics = PANICS.lock().unwrap_or_else(PoisonError::into_inner);
        let own = panics.iter().filter(|(name, _)| *name == self.name);
        own.map(|(_, said)| said.clone()).collect()
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

impl Coordinator {
    pub async fn start(spec: JobSpec) -> Self {
        let heartbeat = Duration::from_millis(50);
        let lease = LONG;
        Self::start_on(free_port(), spec, Timing { heartbeat, lease }).await
    }

    pub async fn start_on(listener: std::net::TcpListener, spec: JobSpec, timing: Timing) -> Self {
        let doors = (Security::default(), Limits::default());
        Self::start_behind(listener, spec, timing, doors).await
    }

    pub async fn start_behind(
        listener: std::net::TcpListener,
        spec: JobSpec,
        timing: Timing,
        doors: (Security, Limits),
    ) -> Self {
        Self::start_with(listener, spec, timing, doors, Start::default()).await
    }

    pub async fn start_with(
        listener: std::net::TcpListener,
        spec: JobSpec,
        timing: Timing,
        (security, limits): (Security, Limits),
        start: Start,
    ) -> Self {
        let address = listener.local_addr().unwrap();
        let farm = Farm::new(spec, timing, start);
        let watch = Watch::new(farm.clone(), Terms::default());
        let (serving, watching) = (farm.clone(), watch.clone());
        let machine = Machine::new();
        let (staying, mut stays) = watch::channel(false);
        machine.spawn(async move {
            let listener = TcpListener::from_std(listener).unwrap();
            let ended = async {
                serving.ended().await;
                let _ = stays.wait_for(|stays| !stays).await;
            };
            let entrance = Entrance {
                listener,
                security,
                limits,
            };
            server::run(entrance, watching, ended).await;
        });
        Self {
            farm,
            watch,
            address,
            staying,
            machine,
        }
    }

    /// A coordinator that resumes what another one left.
    pub async fn resume_on(listener: std::net::TcpListener, spec: JobSpec, timing: Timing, start: Start) -> Self {
        let doors = (Security::default(), Limits::default());
        Self::start_with(listener, spec, timing, doors, start).await
    }

    /// Keeps answering after the job's end, until dropped.
    pub fn stay(&self) {
        self.staying.send_replace(true);
    }

    /// How the job ends; panics with its state if it does not.
    pub async fn ended(&self) -> End {
        match timeout(PATIENCE, self.farm.ended()).await {
            Ok(end) => end,
            Err(_) => panic!("the job does not end: {:#?}", self.farm.progress()),
        }
    }

    /// Waits until the job's progress satisfies `find`; panics with its state if it never does.
    pub async fn shows<T>(&self, what: &str, find: impl Fn(&Progress) -> Option<T>) -> T {
        let begun = Instant::now();
        loop {
            let progress = self.farm.progress();
            if let Some(found) = find(&progress) {
                return found;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "waited {PATIENCE:?} for {what}: {progress:#?}"
            );
            sleep(Duration::from_millis(2)).await;
        }
    }

    /// A client of its calls to workers.
    pub async fn connect(&self) -> FarmClient<Channel> {
        within("a connection", FarmClient::connect(self.url())).await.unwrap()
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Starts a worker of the library.
    pub fn worker(&self, threads: usize) -> WorkerHandle {
        start_worker(self.url(), threads, LONG)
    }
}

pub type WorkerResult = Result<beamfarm_worker::Summary, beamfarm_worker::WorkerError>;

/// A worker of the library.
pub struct WorkerHandle {
    pub drain: watch::Sender<bool>,
    task: JoinHandle<WorkerResult>,
}

impl WorkerHandle {
    pub async fn join(self) -> WorkerResult {
        within("a worker's end", self.task).await.unwrap()
    }
}

pub fn start_worker(url: String, threads: usize, patience: Duration) -> WorkerHandle {
    start_worker_with(url, threads, patience, LONG)
}

pub fn start_worker_with(url: String, threads: usize, patience: Duration, grace: Duration) -> WorkerHandle {
    start(beamfarm_worker::Config {
        threads,
        patience,
        grace,
        ..config(url)
    })
}

/// A worker that renders this many blocks at the same time.
pub fn start_worker_with_lanes(url: String, threads: usize, at_once: usize) -> WorkerHandle {
    start(beamfarm_worker::Config {
        threads,
        at_once: Some(at_once),
        ..config(url)
    })
}

/// A worker of one thread with these credentials.
pub fn start_worker_with_credentials(url: String, credentials: Credentials) -> WorkerHandle {
    start(beamfarm_worker::Config {
        credentials,
        ..config(url)
    })
}

fn config(url: String) -> beamfarm_worker::Config {
    beamfarm_worker::Config {
        url,
        credentials: Credentials::default(),
        threads: 1,
        at_once: None,
        name: "test".into(),
        state: None,
        cache: None,
        patience: LONG,
        grace: LONG,
    }
}

/// A worker of this name that renders with these engines.
pub fn start_worker_offering(url: String, name: &str, offered: Offered) -> WorkerHandle {
    let name = name.into();
    start_offering(
        beamfarm_worker::Config {
            name,
            threads: 2,
            ..config(url)
        },
        offered,
    )
}

fn start(config: beamfarm_worker::Config) -> WorkerHandle {
    start_offering(config, Offered::processors())
}

fn start_offering(config: beamfarm_worker::Config, offered: Offered) -> WorkerHandle {
    let (drain, receiver) = watch::channel(false);
    let task = tokio::spawn(beamfarm_worker::run(config, offered, receiver));
    WorkerHandle { drain, task }
}

/// A worker that does what the test says.
pub struct RawWorker {
    pub farm: FarmClient<Channel>,
    /// Its key.
    pub id: u64,
    /// Its number in logs.
    pub number: u64,
    pub scene: beamfarm_image::job::SceneHash,
    /// The job's engine.
    pub engine: EngineKind,
}

/// The identity of a worker that a test plays: the same for the same name.
pub fn identity_of(name: &str) -> Bytes {
    FileHash::of(name.as_bytes()).to_wire()
}

/// The introduction of a worker that renders as this machine does.
pub fn introduction(name: &str, identity: Bytes) -> wire::RegisterRequest {
    wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        name: name.into(),
        identity,
        threads: 1,
        offers: vec![wire::Offer::of_processors(canary())],
        ..Default::default()
    }
}

/// An open stream of heartbeats.
pub type Attendance = (mpsc::Sender<wire::Heartbeat>, Streaming<wire::Notice>);

impl RawWorker {
    pub async fn register(coordinator: &Coordinator) -> Self {
        Self::named(coordinator, "raw").await
    }

    pub async fn named(coordinator: &Coordinator, name: &str) -> Self {
        Self::try_named(coordinator, name).await.unwrap()
    }

    pub async fn try_named(coordinator: &Coordinator, name: &str) -> Result<Self, Status> {
        let offers = vec![wire::Offer::of_processors(canary())];
        let (worker, untested) = Self::offering(coordinator, name, offers, Vec::new()).await?;
        assert!(!untested);
        Ok(worker)
    }

    /// With what it offers and lacks, and whether it must show a test picture first.
    pub async fn offering(
        coordinator: &Coordinator,
        name: &str,
        offers: Vec<wire::Offer>,
        lacks: Vec<wire::Lack>,
    ) -> Result<(Self, bool), Status> {
        let who = (name, identity_of(name));
        Self::with_identity(coordinator, who, offers, lacks).await
    }

    /// With a name and an identity that need not belong together.
    pub async fn with_identity(
        coordinator: &Coordinator,
        (name, identity): (&str, Bytes),
        offers: Vec<wire::Offer>,
        lacks: Vec<wire::Lack>,
    ) -> Result<(Self, bool), Status> {
        let request = wire::RegisterRequest {
            protocol: beamfarm_proto::PROTOCOL,
            offers,
            lacks,
            ..introduction(name, identity)
        };
        let (worker, reply) = Self::come(&coordinator.url(), request).await?;
        Ok((worker, reply.untested))
    }

    /// Registers with whoever answers there.
    pub async fn come(url: &str, request: wire::RegisterRequest) -> Result<(Self, wire::RegisterReply), Status> {
        let farm = within("a connection", FarmClient::connect(url.to_owned())).await;
        let mut farm = farm.map_err(|error| Status::unavailable(error.to_string()))?;
        let reply = within("an answer about a worker", farm.register(request)).await?;
        let reply = reply.into_inner();
        let job = Job::try_from(reply.job.clone().unwrap()).unwrap();
        let worker = Self {
            farm,
            id: reply.worker,
            number: reply.number,
            scene: job.scene,
            engine: job.settings.engine,
        };
        Ok((worker, reply))
    }

    pub async fn attend(&self) -> Attendance {
        self.try_attend().await.unwrap()
    }

    pub async fn try_attend(&self) -> Result<Attendance, Status> {
        let (sender, beats) = mpsc::channel(4);
        let beat = wire::Heartbeat {
            worker: self.id,
            ..Default::default()
        };
        sender.try_send(beat).unwrap();
        let mut farm = self.farm.clone();
        let notices = farm.attend(ReceiverStream::new(beats));
        let notices = within("an answer to a heartbeat", notices).await?;
        Ok((sender, notices.into_inner()))
    }

    pub async fn grant(&self) -> Result<Grant, Status> {
        let request = wire::LeaseRequest {
            worker: self.id,
            scene: self.scene.to_wire(),
            ..Default::default()
        };
        let mut farm = self.farm.clone();
        let reply = within("an answer about a lease", farm.lease(request)).await?;
        Ok(Grant::try_from(reply.into_inner()).unwrap())
    }

    /// Asks until there is a pass.
    pub async fn lease(&self) -> (LeaseId, Block) {
        let (begun, mut refusals) = (Instant::now(), 0);
        while begun.elapsed() < PATIENCE {
            match self.grant().await.unwrap() {
                Grant::Lease(lease, block) => return (lease, block),
                Grant::NotNow => refusals += 1,
                Grant::Done => panic!("the job is over"),
                Grant::Elsewhere => panic!("another job has work"),
            }
        }
        panic!("no lease in {PATIENCE:?}: {refusals} times there was none");
    }

    pub fn header(&self, (lease, block): (LeaseId, Block), bytes: &[u8]) -> wire::SubmitHeader {
        wire::SubmitHeader {
            worker: self.id,
            lease: lease.0,
            block: Some(block.into()),
            size: bytes.len() as u64,
            hash: FileHash::of(bytes).to_wire(),
            stats: Some(PassStats::default().into()),
        }
    }

    /// Delivers exactly these parts.
    pub async fn send(&self, parts: Vec<Part>) -> Result<wire::SubmitReply, Status> {
        let parts = parts.into_iter().map(|part| wire::SubmitRequest { part: Some(part) });
        let parts: Vec<_> = parts.collect();
        let mut farm = self.farm.clone();
        let reply = farm.submit(tokio_stream::iter(parts));
        Ok(within("an answer to a block", reply).await?.into_inner())
    }

    /// Delivers these bytes in the proper form.
    pub async fn submit(&self, leased: (LeaseId, Block), bytes: Vec<u8>) -> Result<wire::SubmitReply, Status> {
        let header = self.header(leased, &bytes);
        let mut parts = vec![Part::Header(header)];
        // Chunks that end at arbitrary places.
        parts.extend(bytes.chunks(1001).map(|chunk| Part::Data(chunk.to_vec().into())));
        self.send(parts).await
    }

    /// Delivers the picture of [`film`].
    pub async fn deliver(&self, leased: (LeaseId, Block)) -> Result<wire::SubmitReply, Status> {
        let bytes = encode(&node(leased.1), &self.meta(leased.1));
        self.submit(leased, bytes).await
    }

    pub fn meta(&self, block: Block) -> BlockMeta {
        BlockMeta {
            scene: self.scene,
            block,
            seed: settings().seed,
            alpha: settings().alpha,
            radius_scale: Schedule::new(&settings()).scale(block.start()),
            version: VERSION.into(),
            engine: self.engine,
        }
    }
}

/// Hash of the test picture that every worker of the library sends.
pub fn canary() -> Bytes {
    static CANARY: OnceLock<[u8; 32]> = OnceLock::new();
    let hash = CANARY.get_or_init(|| beamfarm_worker::canary().unwrap());
    Bytes::copy_from_slice(hash)
}

/// A pass as the farm names it.
pub fn leaf(pass_index: u64, film: Film) -> Node {
    let scale = Schedule::new(&settings()).scale(pass_index);
    Node::leaf(pass_index, film).with_radius_scale(scale)
}

/// A block of passes that is not actually rendered.
pub fn node(block: Block) -> Node {
    node_of(block, &film)
}

/// A block of these passes.
pub fn node_of(block: Block, film: &impl Fn(u64) -> Film) -> Node {
    match block.level {
        0 => leaf(block.start(), film(block.start())),
        _ => {
            let level = block.level - 1;
            let index = 2 * block.index;
            let left = Block { level, index };
            Node::join(node_of(left, film), node_of(left.sibling(), film)).unwrap()
        }
    }
}

pub fn encode(node: &Node, meta: &BlockMeta) -> Vec<u8> {
    encode_block(node, meta, &[]).unwrap()
}

/// A picture for a pass that is not actually rendered: noise, the same every time.
pub fn film(pass_index: u64) -> Film {
    let mut film = Film::new(WIDTH, HEIGHT);
    for (i, pixel) in film.pixels.iter_mut().enumerate() {
        let mut sampler = Sampler::new(3, pass_index, Purpose::Test, i as u64);
        *pixel = [0; 3].map(|_| 10.0 * sampler.next_1d());
    }
    film
}
