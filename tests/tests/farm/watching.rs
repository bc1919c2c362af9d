//! Watching and steering: the page, metrics, health, and the calls of control.proto.

use crate::farm::harness::{Coordinator, RawWorker, spec, within};
use beamfarm_coordinator::{End, Progress, WorkerState};
use beamfarm_image::png::encode_png;
use beamfarm_image::view::{View, ViewTransform};
use beamfarm_proto::wire::control_client::ControlClient;
use beamfarm_proto::{Grant, VERSION, wire};
use std::time::{Duration, Instant};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tonic::Code;
use tonic::transport::{Channel, Endpoint};

/// Nothing here takes this long.
const PATIENCE: Duration = Duration::from_secs(30);

/// An answer over HTTP: its head and its body.
pub struct Answer {
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    fn text(&self) -> &str {
        std::str::from_utf8(&self.body).unwrap()
    }
    fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| {
            let (key, value) = line.split_once(": ")?;
            key.eq_ignore_ascii_case(name).then_some(value)
        })
    }
}

async fn ask(coordinator: &Coordinator, request: &str) -> Answer {
    let answer = async {
        let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
        let request = format!("{request} HTTP/1.0\r\nHost: {}\r\n\r\n", coordinator.address);
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).await.unwrap();
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        Answer {
            head: String::from_utf8(bytes[..end].to_vec()).unwrap(),
            body: bytes[end + 4..].to_vec(),
        }
    };
    within(request, answer).await
}

/// A coordinator with some passes done, and its worker.
async fn with_passes(limit: u64, passes: u64) -> (Coordinator, RawWorker) {
    let coordinator = Coordinator::start(spec(limit)).await;
    let worker = RawWorker::register(&coordinator).await;
    for _ in 0..passes {
        let leased = worker.lease().await;
        worker.deliver(leased).await.unwrap();
    }
    (coordinator, worker)
}

async fn control(coordinator: &Coordinator) -> ControlClient<Channel> {
    within("a connection", ControlClient::connect(coordinator.url()))
        .await
        .unwrap()
}

#[tokio::test]
async fn the_page_has_its_numbers_without_a_script() {
    let (coordinator, _worker) = with_passes(8, 4).await;
    let page = ask(&coordinator, "GET /").await;
    assert!(page.head.starts_with("HTTP/1.0 200"), "{}", page.head);
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.starts_with("default-src 'none'") && !policy.contains("unsafe"));
    assert_eq!(page.header("x-content-type-options"), Some("nosniff"));
    let text = page.text();
    for expected in [
        "4 of 8 passes",
        "50 %",
        "Passes 0 to 3 at 0 EV",
        "/image.png?passes=4",
        "<th scope=\"row\">raw</th>",
        "<noscript>",
    ] {
        assert!(text.contains(expected), "{expected} is not in {text}");
    }
    assert!(!text.contains("<script>") && !text.contains(" style=") && !text.contains("http://"));
    for file in ["/page.css", "/page.js", "/icon.svg"] {
        assert!(text.contains(file));
        let answer = ask(&coordinator, &format!("GET {file}")).await;
        assert!(answer.head.starts_with("HTTP/1.0 200") && !answer.body.is_empty());
        assert!(!answer.text().contains("http://") || file == "/icon.svg");
    }
    assert!(ask(&coordinator, "GET /nothing").await.head.contains("404"));
}

#[tokio::test]
async fn pictures_are_of_the_passes_that_they_name() {
    let (coordinator, worker) = with_passes(8, 0).await;
    assert!(ask(&coordinator, "GET /image.png").await.head.contains("404"));
    assert!(
        ask(&coordinator, "GET /")
            .await
            .text()
            .contains("No pass is complete yet")
    );
    let leased = worker.lease().await;
    worker.deliver(leased).await.unwrap();
    let one = ask(&coordinator, "GET /image.png").await;
    assert_eq!(one.header("beamfarm-passes"), Some("1"));
    assert!(one.body.starts_with(b"\x89PNG"));
    let leased = worker.lease().await;
    worker.deliver(leased).await.unwrap();
    // Averages come at a bounded rate: the next one after about a second.
    let begun = Instant::now();
    let two = loop {
        let answer = ask(&coordinator, "GET /image.png").await;
        let passes = answer.header("beamfarm-passes");
        if passes == Some("2") {
            break answer;
        }
        assert!(begun.elapsed() < PATIENCE, "still of {passes:?} passes");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert!(two.body != one.body);
    // The one before is still there for those who have just been told of it.
    let again = ask(&coordinator, "GET /image.png?passes=1").await;
    assert_eq!(again.header("beamfarm-passes"), Some("1"));
    assert!(again.body == one.body);
    let dark = ask(&coordinator, "GET /image.png?passes=2&exposure=-3").await;
    let error = ask(&coordinator, "GET /image.png?passes=2&view=error").await;
    let nonsense = ask(&coordinator, "GET /image.png?passes=2&exposure=NaN").await;
    assert!(dark.body != two.body && error.body != two.body && error.body != dark.body);
    assert!(nonsense.body == two.body);
    let average = coordinator.farm.average().unwrap();
    let expected = encode_png(&average.beauty, View::exposed(-3.0)).unwrap();
    assert!(dark.body == expected);
    let look = View {
        transform: ViewTransform::Agx,
        exposure: 1.0,
        white_balance: 3000.0,
    };
    let address = "GET /image.png?passes=2&exposure=1&curve=agx&white_balance=3000";
    assert!(ask(&coordinator, address).await.body == encode_png(&average.beauty, look).unwrap());
    // Nonsense parameters are ignored.
    let nonsense = ask(&coordinator, "GET /image.png?passes=2&curve=raw&white_balance=1").await;
    assert!(nonsense.body == two.body);
}

#[tokio::test]
async fn an_open_page_hears_the_news_and_the_end() {
    let (coordinator, worker) = with_passes(4, 2).await;
    let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
    stream
        .write_all(b"GET /live HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .await
        .unwrap();
    let mut lines = BufReader::new(stream).lines();
    let mut wait_for = async |event: &str, data: &str| {
        let found = async {
            let mut now = String::new();
            while let Some(line) = lines.next_line().await.unwrap() {
                if let Some(name) = line.strip_prefix("event: ") {
                    now = name.to_owned();
                } else if now == event && line.contains(data) {
                    return;
                }
            }
            panic!("no {event} with {data}");
        };
        timeout(PATIENCE, found).await.unwrap();
    };
    wait_for("state", "2 of 4 passes").await;
    wait_for("image", "data: 2").await;
    let leased = worker.lease().await;
    worker.deliver(leased).await.unwrap();
    wait_for("state", "3 of 4 passes").await;
    wait_for("image", "data: 3").await;
    let leased = worker.lease().await;
    worker.deliver(leased).await.unwrap();
    wait_for("state", "Complete").await;
    wait_for("image", "data: 4").await;
    wait_for("over", "data: over").await;
    // There is still time for the last picture.
    let last = ask(&coordinator, "GET /image.png?passes=4").await;
    assert_eq!(last.header("beamfarm-passes"), Some("4"));
}

#[tokio::test]
async fn names_of_workers_cannot_write_the_page() {
    let coordinator = Coordinator::start(spec(2)).await;
    let mut farm = coordinator.connect().await;
    let request = wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        offers: vec![wire::Offer::of_processors(crate::farm::harness::canary())],
        version: VERSION.into(),
        identity: crate::farm::harness::identity_of("raw"),
        name: "</td><script>alert(1)</script>".into(),
        threads: 3,
        ..Default::default()
    };
    farm.register(request).await.unwrap();
    let page = ask(&coordinator, "GET /").await;
    assert!(!page.text().contains("<script>"), "{}", page.text());
    assert!(page.text().contains("&#60;script&#62;alert(1)"));
}

#[tokio::test]
async fn metrics_follow_the_job() {
    let (coordinator, _worker) = with_passes(8, 3).await;
    let answer = ask(&coordinator, "GET /metrics").await;
    let kind = answer.header("content-type").unwrap();
    assert!(kind.starts_with("application/openmetrics-text"), "{kind}");
    let text = answer.text();
    for line in [
        "beamfarm_passes_completed_total 3",
        "beamfarm_passes_prefix 3.0",
        "beamfarm_passes_limit 8.0",
        "beamfarm_worker_registrations_total 1",
        "beamfarm_refused_deliveries_total 0",
        "beamfarm_job_ended 0.0",
        &format!("beamfarm_build_info{{version=\"{VERSION}\"}} 1"),
        "# EOF",
    ] {
        assert!(text.lines().any(|found| found == line), "{line} is not in {text}");
    }
    // Unique names with the prefix, and no label that depends on the process.
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        assert!(line.starts_with("beamfarm_"), "{line}");
        assert!(!line.contains("worker=") && !line.contains("name="), "{line}");
    }
    let health = ask(&coordinator, "GET /healthz").await;
    assert!(health.head.contains("200") && health.text() == "ok\n");
}

#[tokio::test]
async fn health_is_told_over_grpc() {
    use tonic_health::pb::HealthCheckRequest;
    use tonic_health::pb::health_check_response::ServingStatus;
    use tonic_health::pb::health_client::HealthClient;
    let coordinator = Coordinator::start(spec(1)).await;
    let endpoint = Endpoint::from_shared(coordinator.url()).unwrap();
    let mut health = HealthClient::new(endpoint.connect().await.unwrap());
    for service in ["", "beamfarm.v1.Farm", "beamfarm.v1.Control"] {
        let service = service.to_owned();
        let reply = health.check(HealthCheckRequest { service }).await.unwrap();
        assert_eq!(reply.into_inner().status(), ServingStatus::Serving);
    }
}

#[tokio::test]
async fn status_tells_how_the_job_stands() {
    let (coordinator, worker) = with_passes(8, 2).await;
    let _attendance = worker.attend().await;
    let mut control = control(&coordinator).await;
    let reply = control.status(wire::StatusRequest {}).await.unwrap();
    let reply = reply.into_inner();
    assert_eq!(reply.state(), wire::JobState::Running);
    assert_eq!((reply.prefix, reply.passes, reply.limit), (2, 2, 8));
    assert_eq!(reply.version, VERSION);
    assert_eq!(&reply.scene[..], coordinator.farm.job().scene.0);
    let expected = coordinator.farm.average().unwrap().relative_standard_error();
    assert_eq!(reply.relative_standard_error, Some(expected));
    assert_eq!(reply.workers.len(), 1);
    assert_eq!((&*reply.workers[0].name, reply.workers[0].passes), ("raw", 2));
    assert!(reply.events.iter().any(|event| event.kind == "joined"));
}

#[tokio::test]
async fn a_paused_job_hands_out_nothing() {
    let (coordinator, worker) = with_passes(8, 1).await;
    let mut control = control(&coordinator).await;
    control.pause(wire::PauseRequest {}).await.unwrap();
    assert!(matches!(worker.grant().await, Ok(Grant::NotNow)));
    let reply = control.status(wire::StatusRequest {}).await.unwrap();
    assert_eq!(reply.into_inner().state(), wire::JobState::Paused);
    assert!(ask(&coordinator, "GET /").await.text().contains("Paused"));
    control.resume(wire::ResumeRequest {}).await.unwrap();
    assert!(matches!(worker.grant().await, Ok(Grant::Lease(..))));
}

#[tokio::test]
async fn a_job_can_be_extended_until_it_ends() {
    let (coordinator, worker) = with_passes(2, 1).await;
    let mut control = control(&coordinator).await;
    let mut extend = async |passes| control.extend(wire::ExtendRequest { passes }).await;
    extend(3).await.unwrap();
    for passes in [0, 2, u64::MAX] {
        let refused = extend(passes).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused}");
    }
    for _ in 0..2 {
        let leased = worker.lease().await;
        worker.deliver(leased).await.unwrap();
    }
    assert_eq!(coordinator.ended().await, End::Complete);
    assert_eq!(coordinator.farm.average().unwrap().passes, 3);
}

#[tokio::test]
async fn cancelling_ends_a_job_with_what_is_there() {
    let (coordinator, _worker) = with_passes(8, 3).await;
    let mut control = control(&coordinator).await;
    let reply = control.cancel(wire::CancelRequest {}).await.unwrap();
    assert_eq!(reply.into_inner().prefix, 3);
    assert_eq!(coordinator.ended().await, End::Stopped);
    assert_eq!(coordinator.farm.average().unwrap().passes, 3);
}

#[tokio::test]
async fn images_are_written_on_request_where_somebody_can() {
    let (coordinator, _worker) = with_passes(8, 1).await;
    let mut control = control(&coordinator).await;
    let refused = control.write_now(wire::WriteNowRequest {}).await;
    assert_eq!(refused.unwrap_err().code(), Code::Internal);
    let mut requests = coordinator.watch.write_requests();
    let writer = tokio::spawn(async move {
        let answers = [Ok("written".to_owned()), Err("disk full".to_owned()), Ok(String::new())];
        for answer in answers {
            requests.recv().await.unwrap().send(answer).unwrap();
        }
    });
    let reply = control.write_now(wire::WriteNowRequest {}).await.unwrap();
    assert_eq!(reply.into_inner().message, "written");
    let refused = control.write_now(wire::WriteNowRequest {}).await;
    assert_eq!(refused.unwrap_err().message(), "disk full");
    // The page's button; other pages cannot press it.
    let foreign = "POST /write HTTP/1.0\r\nOrigin: http://elsewhere\r\nX:";
    assert!(ask(&coordinator, foreign).await.head.contains("403"));
    let pressed = ask(&coordinator, "POST /write").await;
    assert_eq!(pressed.header("location"), Some("/?done=true"));
    writer.await.unwrap();
}

#[tokio::test]
async fn workers_that_are_gone_are_seen_to_be() {
    let (coordinator, worker) = with_passes(8, 1).await;
    let attendance = worker.attend().await;
    drop(attendance);
    let gone = |progress: &Progress| {
        let state = progress.workers_seen[0].state;
        (state == WorkerState::Gone).then_some(())
    };
    coordinator.shows("a worker that is gone", gone).await;
    assert!(ask(&coordinator, "GET /").await.text().contains("gone"));
}
