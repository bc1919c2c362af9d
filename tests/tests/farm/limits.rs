//! Peers that take more than their share of connections, calls, bytes and time.

use crate::farm::harness::{Coordinator, LONG, RawWorker, film, free_port, leaf, spec};
use beamfarm_coordinator::limits::Limits;
use beamfarm_coordinator::security::{Security, Tls};
use beamfarm_coordinator::{End, Timing};
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{Token, VERSION, wire};
use rcgen::{CertificateParams, KeyPair};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_stream::StreamExt;
use tonic::metadata::AsciiMetadataValue;
use tonic::{Code, Request};

const SOON: Duration = Duration::from_millis(300);
/// How long to wait for something that must happen. Failing is better than waiting for ever.
const PATIENCE: Duration = Duration::from_secs(20);

async fn coordinator(limits: Limits, security: Security) -> Coordinator {
    let timing = Timing {
        heartbeat: LONG,
        lease: LONG,
    };
    Coordinator::start_behind(free_port(), spec(2), timing, (security, limits)).await
}

/// Waits until the other side hangs up, and returns what it sent before.
async fn hung_up(mut stream: TcpStream) -> Vec<u8> {
    let mut said = Vec::new();
    let _ = timeout(PATIENCE, stream.read_to_end(&mut said)).await.unwrap();
    said
}

#[tokio::test]
async fn connections_beyond_the_limit_are_closed() {
    let limits = Limits {
        connections: 2,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let first = RawWorker::register(&coordinator).await;
    let idle = TcpStream::connect(coordinator.address).await.unwrap();
    let third = TcpStream::connect(coordinator.address).await.unwrap();
    assert!(hung_up(third).await.is_empty());
    // Those who are in stay in, and a place that becomes free is taken again.
    let leased = first.lease().await;
    first.deliver(leased).await.unwrap();
    drop(idle);
    let begun = Instant::now();
    while FarmClient::connect(coordinator.url()).await.is_err() {
        assert!(begun.elapsed() < PATIENCE);
        tokio::task::yield_now().await;
    }
}

/// Idle connections, even more than there are places, keep nobody out who has something to say.
#[tokio::test]
async fn strangers_make_room() {
    let limits = Limits {
        connections: 16,
        strangers: 4,
        greeting: LONG,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let first = RawWorker::register(&coordinator).await;
    let mut idle = Vec::new();
    for i in 0..40 {
        let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
        if i % 2 == 0 {
            // A request that anybody may make is no greeting.
            let ask = b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n";
            stream.write_all(ask).await.unwrap();
            let mut answer = [0; 12];
            timeout(PATIENCE, stream.read_exact(&mut answer))
                .await
                .unwrap()
                .unwrap();
            assert_eq!(&answer, b"HTTP/1.1 200");
        }
        idle.push(stream);
    }
    let second = RawWorker::register(&coordinator).await;
    for worker in [&first, &second] {
        let leased = worker.lease().await;
        worker.deliver(leased).await.unwrap();
    }
    // The oldest are gone.
    for stream in idle.drain(..36) {
        hung_up(stream).await;
    }
}

#[tokio::test]
async fn connections_that_never_say_anything_useful_are_closed() {
    let limits = Limits {
        greeting: SOON,
        ..Default::default()
    };
    let key = KeyPair::generate().unwrap();
    let params = CertificateParams::new(["localhost".to_string()]).unwrap();
    let certificate = params.self_signed(&key).unwrap();
    let tls = Tls::new(certificate.pem().as_bytes(), key.serialize_pem().as_bytes(), None);
    let doors = [
        Security::default(),
        Security {
            tls: Some(tls.unwrap()),
            ..Default::default()
        },
        Security {
            token: Some(Token::parse("a-token-for-tests-alone").unwrap()),
            ..Default::default()
        },
    ];
    for security in doors {
        let coordinator = coordinator(limits, security).await;
        let beginnings: [&[u8]; 6] = [
            b"",
            b"G",
            b"GET /healthz HTTP/1.1\r\nhost: local",
            b"PRI * HTTP/2.0\r\n\r\nSM",
            // A whole greeting with empty settings, then no request.
            b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0",
            // Half of a TLS greeting.
            b"\x16\x03\x01\x02\x00\x01",
        ];
        for beginning in beginnings {
            let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
            stream.write_all(beginning).await.unwrap();
            hung_up(stream).await;
        }
    }
}

#[tokio::test]
async fn headers_may_drip_no_longer_than_the_greeting() {
    let limits = Limits {
        greeting: SOON,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
    stream.write_all(b"GET / HTTP/1.1\r\n").await.unwrap();
    let begun = Instant::now();
    // Fails when the other side has hung up.
    while stream.write_all(b"x: y\r\n").await.is_ok() {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn large_headers_are_refused() {
    let coordinator = coordinator(Limits::default(), Security::default()).await;
    let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
    let long = "x".repeat(100_000);
    let request = format!("GET / HTTP/1.1\r\nhost: localhost\r\nlong: {long}\r\n\r\n");
    // The other side may hang up in the middle.
    let _ = stream.write_all(request.as_bytes()).await;
    let mut said = vec![0; 12];
    let read = timeout(PATIENCE, stream.read_exact(&mut said)).await;
    assert!(read.unwrap().is_err() || said == b"HTTP/1.1 431");
    let mut farm = coordinator.connect().await;
    let mut request = Request::new(wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        ..Default::default()
    });
    let long = AsciiMetadataValue::try_from(long).unwrap();
    request.metadata_mut().insert("long", long);
    assert!(farm.register(request).await.is_err());
    assert_eq!(coordinator.farm.progress().registered, 0);
    RawWorker::register(&coordinator).await;
}

#[tokio::test]
async fn large_messages_are_refused() {
    let coordinator = coordinator(Limits::default(), Security::default()).await;
    let mut worker = RawWorker::register(&coordinator).await;
    let request = wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        name: "x".repeat(2 << 20),
        ..Default::default()
    };
    let refused = worker.farm.register(request).await.unwrap_err();
    assert_eq!(refused.code(), Code::OutOfRange, "{refused}");
    let leased = worker.lease().await;
    let bytes = vec![0; 2 << 20];
    let header = worker.header(leased, &bytes[..1000]);
    let parts = vec![Part::Header(header), Part::Data(bytes.into())];
    let refused = worker.send(parts).await.unwrap_err();
    assert_eq!(refused.code(), Code::OutOfRange, "{refused}");
    worker.deliver(leased).await.unwrap();
}

#[tokio::test]
async fn calls_beyond_the_limit_wait() {
    let limits = Limits {
        calls: 2,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let worker = RawWorker::register(&coordinator).await;
    let open = (worker.attend().await, worker.attend().await);
    let waiting = timeout(SOON, worker.grant()).await;
    assert!(waiting.is_err(), "a third call is open");
    // Another connection does not affect it.
    RawWorker::register(&coordinator).await;
    drop(open);
    timeout(PATIENCE, worker.lease()).await.unwrap();
}

#[tokio::test]
async fn requests_that_come_too_often_wait() {
    let limits = Limits {
        requests_per_second: 50.0,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let worker = RawWorker::register(&coordinator).await;
    let begun = Instant::now();
    for _ in 0..100 {
        let request = wire::FailRequest::default();
        assert!(worker.farm.clone().fail(request).await.is_err());
    }
    assert!(begun.elapsed() >= Duration::from_millis(900));
}

#[tokio::test]
async fn an_upload_that_drips_is_cut_off() {
    let limits = Limits {
        stall: SOON,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let bytes = crate::farm::harness::encode(&leaf(leased.1.start(), film(leased.1.start())), &worker.meta(leased.1));
    for (chunk, pause) in [(1, 10), (1000, 3_600_000)] {
        let header = Part::Header(worker.header(leased, &bytes));
        let data = bytes.clone();
        let chunks = (0..bytes.len() / chunk).map(move |i| data[i * chunk..][..chunk].to_vec());
        let drip = tokio_stream::iter(chunks).then(move |chunk| async move {
            tokio::time::sleep(Duration::from_millis(pause)).await;
            Part::Data(chunk.into())
        });
        let parts = tokio_stream::once(header)
            .chain(drip)
            .map(|part| wire::SubmitRequest { part: Some(part) });
        let sent = timeout(PATIENCE, worker.farm.clone().submit(parts)).await;
        assert!(sent.unwrap().is_err());
    }
    // The connection and the lease are still good.
    worker.deliver(leased).await.unwrap();
    let other = worker.lease().await;
    worker.deliver(other).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);
}

/// Endless deliveries take no more room than one for each lease.
#[tokio::test]
async fn a_lease_has_one_delivery_at_a_time() {
    let coordinator = coordinator(Limits::default(), Security::default()).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let mut endless = tokio::task::JoinSet::new();
    for _ in 0..5 {
        let header = Part::Header(worker.header(leased, &[1; 1000]));
        let first = wire::SubmitRequest { part: Some(header) };
        let parts = tokio_stream::once(first).chain(tokio_stream::pending());
        let mut farm = worker.farm.clone();
        endless.spawn(async move { farm.submit(parts).await.map(|_| ()) });
    }
    for _ in 0..4 {
        let ended = timeout(PATIENCE, endless.join_next()).await.unwrap().unwrap();
        assert_eq!(ended.unwrap().unwrap_err().code(), Code::ResourceExhausted);
    }
    endless.abort_all();
    let begun = Instant::now();
    while let Err(status) = worker.deliver(leased).await {
        assert_eq!(status.code(), Code::ResourceExhausted, "{status}");
        assert!(begun.elapsed() < PATIENCE);
    }
}

#[tokio::test]
async fn an_answer_that_nobody_reads_ends_its_connection() {
    let limits = Limits {
        stall: SOON,
        requests_per_second: 1e9,
        ..Default::default()
    };
    let coordinator = coordinator(limits, Security::default()).await;
    let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
    // So many pipelined requests that their answers fill all buffers. None of the answers is read.
    let request = b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(1000);
    let begun = Instant::now();
    while let Ok(sent) = timeout(PATIENCE, stream.write_all(&request)).await {
        assert!(begun.elapsed() < 2 * PATIENCE);
        if sent.is_err() {
            return;
        }
    }
    panic!("still connected");
}
