//! Several jobs behind one address: workers go from one to the next, and back when they are needed.

use crate::farm::harness::{
    LONG, Machine, RawWorker, SCENE, WorkerHandle, encode, free_port, identity_of, introduction, node, settings, spec,
    start_worker_with_credentials, within,
};
use beamfarm_coordinator::security::{Security, Tls};
use beamfarm_coordinator::{End, Entrance, Farm, JobSpec, Series, Start, Terms, Timing, Watch, server};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::merge::TreeSum;
use beamfarm_proto::{Grant, Token, wire};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_worker::security::Credentials;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tonic::Code;
use tonic::transport::Certificate;

/// The scene at a frame: its lamp is elsewhere.
pub fn frame(number: u64, passes: u64) -> JobSpec {
    let mut spec = spec(passes);
    spec.bundle.files.insert("scene.toml".into(), text(number).into());
    spec
}

fn text(number: u64) -> String {
    SCENE.replace("position = [0.5, 2, 0.5]", &format!("position = [0.{number}, 2, 0.5]"))
}

/// Pixels of that job without a farm.
fn alone(number: u64, passes: u64) -> String {
    let scene = Scene::new(beamfarm_scene::load(&frame(number, passes).bundle).unwrap());
    let plan = RenderPlan::new(&scene, settings());
    let camera = &scene.description().camera;
    let mut sum = TreeSum::new(camera.width, camera.height);
    for pass in 0..passes {
        let leaf = crate::farm::harness::leaf(pass, render_pass(&scene, &plan, pass).expect("a pass").film);
        sum.insert(leaf).unwrap();
    }
    pixel_hash(&sum.average().unwrap().beauty)
}

fn pixels(watch: &Watch) -> String {
    pixel_hash(&watch.farm().average().unwrap().beauty)
}

/// A coordinator with several jobs.
pub struct Site {
    pub series: Arc<Series>,
    first: Arc<Watch>,
    pub address: SocketAddr,
    _close: oneshot::Sender<()>,
    server: JoinHandle<()>,
    pub machine: Machine,
}

fn job(number: u64, passes: u64) -> Arc<Watch> {
    job_of(frame(number, passes), LONG)
}

pub fn job_of(spec: JobSpec, lease: Duration) -> Arc<Watch> {
    let heartbeat = Duration::from_millis(50);
    let farm = Farm::new(spec, Timing { heartbeat, lease }, Start::default());
    Watch::new(farm, Terms::default())
}

impl Site {
    fn start(passes: u64, security: Security) -> Self {
        Self::beginning_with(job(1, passes), security)
    }

    pub fn beginning_with(first: Arc<Watch>, security: Security) -> Self {
        let series = Series::beginning_with(first.clone());
        let listener = free_port();
        let address = listener.local_addr().unwrap();
        let (close, closed) = oneshot::channel();
        let machine = Machine::new();
        let serving = series.clone();
        let server = machine.spawn(async move {
            let entrance = Entrance {
                security,
                ..Entrance::from(TcpListener::from_std(listener).unwrap())
            };
            let closed = async {
                let _ = closed.await;
            };
            server::serve(entrance, serving, closed).await;
        });
        Self {
            series,
            first,
            address,
            _close: close,
            server,
            machine,
        }
    }

    async fn open(&self, number: u64, passes: u64) -> Arc<Watch> {
        let job = job(number, passes);
        self.series.open(job.clone());
        job
    }

    fn worker(&self) -> WorkerHandle {
        start_worker_with_credentials(format!("http://{}", self.address), Credentials::default())
    }

    /// A worker under the test's control, at the job to which the series sends it. `before`: its key until now.
    async fn register(&self, before: u64) -> RawWorker {
        let request = wire::RegisterRequest {
            protocol: beamfarm_proto::PROTOCOL,
            before,
            ..introduction("raw", identity_of("raw"))
        };
        let url = format!("http://{}", self.address);
        let (worker, reply) = RawWorker::come(&url, request).await.unwrap();
        assert!(reply.in_series);
        worker
    }

    async fn close(self) {
        drop(self._close);
        within("the server's end", self.server).await.unwrap();
    }
}

fn is_at(worker: &RawWorker, job: &Watch) -> bool {
    worker.scene == job.farm().job().scene
}

/// With a token and over TLS, like a single job.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_stay_for_all_jobs_of_a_series() {
    let authority = crate::farm::security::Authority::new();
    let (certificate, key) = authority.issue("localhost");
    let token = Token::parse("a-token-for-tests-alone").ok();
    let security = Security {
        tls: Tls::new(certificate.as_bytes(), key.as_bytes(), None).ok(),
        token: token.clone(),
        ..Default::default()
    };
    let site = Site::start(3, security);
    let credentials = Credentials {
        authority: Some(Certificate::from_pem(authority.pem())),
        token,
        ..Default::default()
    };
    let url = format!("https://localhost:{}", site.address.port());
    let workers = [(); 2].map(|()| start_worker_with_credentials(url.clone(), credentials.clone()));
    let mut jobs = vec![site.first.clone()];
    for number in 2..=4 {
        assert!(within("hunger", site.series.wants_another()).await);
        jobs.push(site.open(number, 3).await);
        // The job before it need not be over for that.
        let before = &jobs[jobs.len() - 2];
        assert_eq!(within("a job's end", before.farm().ended()).await, End::Complete);
        site.series.close(before);
    }
    site.series.seal();
    within("the end", site.series.over()).await;
    for worker in workers {
        worker.join().await.unwrap();
    }
    for (number, job) in (1..).zip(&jobs) {
        assert_eq!(pixels(job), alone(number, 3), "job {number}");
        // Nobody had to register twice.
        assert!(job.farm().progress().registered <= 2);
    }
    assert_eq!(site.series.passes(), 12);
    site.close().await;
}

/// While one worker holds the last pass of a job, others render the next job; when that pass is lost, one of them comes
/// back for it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nobody_waits_for_the_last_pass_of_others() {
    let site = Site::start(1, Security::default());
    let slow = site.register(0).await;
    let attendance = slow.attend().await;
    assert!(is_at(&slow, &site.first));
    slow.lease().await;
    let worker = site.worker();
    assert!(within("hunger", site.series.wants_another()).await);
    let second = site.open(2, 2).await;
    assert_eq!(
        within("the second job's end", second.farm().ended()).await,
        End::Complete
    );
    assert_eq!(site.first.farm().end(), None);
    // A third one may not begin while two are open.
    assert!(
        timeout(Duration::from_millis(300), site.series.wants_another())
            .await
            .is_err()
    );
    site.series.close(&second);
    assert!(within("hunger", site.series.wants_another()).await);
    let third = site.open(3, 2000).await;
    while third.farm().progress().passes == 0 {
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    drop((attendance, slow));
    assert_eq!(
        within("the first job's end", site.first.farm().ended()).await,
        End::Complete
    );
    // In the middle of the third one.
    assert_eq!(third.farm().end(), None);
    assert_eq!(pixels(&site.first), alone(1, 1));
    assert_eq!(pixels(&second), alone(2, 2));
    site.series.cancel();
    worker.join().await.unwrap();
    site.close().await;
}

/// A worker that was called to a job but accepted by another one on the way does not keep others from being called
/// instead.
#[tokio::test]
async fn a_worker_that_went_elsewhere_is_not_waited_for() {
    let site = Site::start(2, Security::default());
    let (slow, lost) = (site.register(0).await, site.register(0).await);
    let (_attendance, attendance) = (slow.attend().await, lost.attend().await);
    let (_kept, _lease) = (slow.lease().await, lost.lease().await);
    let [called, other] = [site.register(0).await, site.register(0).await];
    let _attending = (called.attend().await, other.attend().await);
    let second = site.open(2, 1).await;
    assert_eq!(called.grant().await.unwrap(), Grant::Elsewhere);
    // There is one pass, for one of them.
    assert_eq!(other.grant().await.unwrap(), Grant::NotNow);
    drop((attendance, lost));
    let came = loop {
        // The lost pass is handed out once the coordinator has seen the connection break.
        let came = site.register(called.id).await;
        if is_at(&came, &site.first) {
            break came;
        }
    };
    came.lease().await;
    let begun = Instant::now();
    let grant = loop {
        match other.grant().await.unwrap() {
            Grant::NotNow => {}
            grant => break grant,
        }
    };
    assert_eq!(grant, Grant::Elsewhere);
    assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
    assert!(is_at(&site.register(other.id).await, &second));
    site.series.cancel();
}

/// A worker that comes when no job has a pass waits for the next job.
#[tokio::test]
async fn a_worker_that_comes_between_two_jobs_waits() {
    let site = Site::start(1, Security::default());
    site.first.farm().stop();
    site.series.close(&site.first);
    let register = site.register(0);
    let open = async {
        assert!(within("hunger", site.series.wants_another()).await);
        tokio::time::sleep(Duration::from_millis(100)).await;
        site.open(2, 1).await
    };
    let (worker, second) = tokio::join!(register, open);
    assert!(is_at(&worker, &second));
    let leased = worker.lease().await;
    worker.deliver(leased).await.unwrap();
    assert_eq!(second.farm().ended().await, End::Complete);
    // Only when everything is over is the end reported.
    site.series.seal();
    assert_eq!(worker.grant().await.unwrap(), Grant::Done);
}

/// When a liar is found out at one job, wherever it is then, what it did elsewhere is rendered again.
#[tokio::test]
async fn who_lies_at_one_job_is_out_at_all() {
    let checked = |number, passes| JobSpec {
        audit_every: 1,
        ..frame(number, passes)
    };
    let first = job_of(checked(1, 1), LONG);
    let site = Site::beginning_with(first.clone(), Security::default());
    let url = format!("http://{}", site.address);
    let come = async |name: &str, before| {
        let request = wire::RegisterRequest {
            protocol: beamfarm_proto::PROTOCOL,
            before,
            ..introduction(name, identity_of(name))
        };
        RawWorker::come(&url, request).await.map(|(worker, _)| worker)
    };
    let lie = async |liar: &RawWorker| {
        let leased = liar.lease().await;
        let mut node = node(leased.1);
        node.sum.pixels[7][1] += 1.0;
        liar.submit(leased, encode(&node, &liar.meta(leased.1))).await.unwrap();
    };
    let honest = [come("one", 0).await.unwrap(), come("two", 0).await.unwrap()];
    let _attending = [honest[0].attend().await, honest[1].attend().await];
    let liar = come("liar", 0).await.unwrap();
    let _attendance = liar.attend().await;
    lie(&liar).await;
    let second = job_of(checked(2, 4), LONG);
    site.series.open(second.clone());
    assert_eq!(liar.grant().await.unwrap(), Grant::Elsewhere);
    let liar = come("liar", liar.id).await.unwrap();
    let _attendance = liar.attend().await;
    assert!(is_at(&liar, &second));
    lie(&liar).await;
    assert_eq!(second.farm().progress().passes, 1);
    for honest in &honest {
        let leased = honest.lease().await;
        assert_eq!(leased.1.start(), 0);
        honest.deliver(leased).await.unwrap();
    }
    assert_eq!(first.farm().progress().dropped, 1);
    assert_eq!(liar.grant().await.unwrap_err().code(), Code::PermissionDenied);
    assert_eq!(second.farm().progress().passes, 0);
    let again = come("liar", liar.id).await.err().unwrap();
    assert_eq!(again.code(), Code::PermissionDenied);
    site.series.cancel();
}
