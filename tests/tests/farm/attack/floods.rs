//! Peers that take connections, calls and pages, and send little or read nothing.

use super::scene::{Dice, HONEST, Stage};
use crate::farm::harness::{RawWorker, introduction};
use beamfarm_proto::wire::control_client::ControlClient;
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::{WireHash, wire};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;

/// Connections that one attacker keeps open.
const OPEN: usize = 150;
const SOON: Duration = Duration::from_millis(100);

/// Beginnings of connections that lead nowhere.
const BEGINNINGS: [&[u8]; 8] = [
    b"",
    b"G",
    b"GET / HTTP/1.1\r\nhost: local",
    b"PRI * HTTP/2.0\r\n\r\nSM",
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0",
    // The head of a frame of 16 MiB that never comes.
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0\xff\xff\xff\x01\x04\0\0\0\x01",
    b"\x16\x03\x01\x02\x00\x01",
    b"\0\0\0\0\0\0\0\0\xff\xff\xff\xff",
];

/// Requests that anybody may make, and nonsense.
const PAGES: [&str; 11] = [
    "GET /",
    "GET /healthz",
    "GET /metrics",
    "GET /image.png",
    "GET /image.png?exposure=1e30&width=-1",
    "GET /image.exr",
    "GET /pixel?x=18446744073709551616&y=-1",
    "GET /thumbnail.png?frame=9223372036854775807",
    "GET /../../etc/passwd",
    "DELETE /",
    "POST /extend",
];

/// Connections that send a beginning and nothing more.
pub async fn connections(stage: Arc<Stage>, mut dice: Dice) {
    let mut open = VecDeque::new();
    loop {
        dice.pause().await;
        if let Ok(mut stream) = TcpStream::connect(stage.address).await {
            let _ = timeout(SOON, stream.write_all(dice.pick(&BEGINNINGS))).await;
            open.push_back(stream);
        }
        if open.len() > OPEN {
            open.pop_front();
        }
    }
}

/// Endless registrations of workers that never return.
pub async fn registrations(stage: Arc<Stage>, seed: u64, mut dice: Dice) {
    for count in 0.. {
        dice.pause().await;
        let who = format!("crowd {seed} {count}");
        let Ok(mut farm) = FarmClient::connect(stage.url.clone()).await else {
            continue;
        };
        for i in 0..10 {
            let request = introduction(HONEST, stage.secret(&format!("{who} {i}")));
            if let Err(status) = farm.register(request).await {
                stage.hear(&who, &status);
            }
        }
    }
}

/// Many calls on one connection, all of them open, some of them cancelled.
pub async fn streams(stage: Arc<Stage>, who: String, mut dice: Dice) {
    let mut before = 0;
    loop {
        let worker: RawWorker = stage.come(&who, &mut before, &mut dice).await;
        let mut calls = JoinSet::new();
        for i in 0..120 {
            let (mut farm, id, scene) = (worker.farm.clone(), worker.id, worker.scene.to_wire());
            calls.spawn(async move {
                match i % 4 {
                    0 => drop(farm.attend(tokio_stream::pending()).await),
                    1 => {
                        let (_parts, never) = tokio::sync::mpsc::channel(1);
                        drop(farm.submit(ReceiverStream::new(never)).await);
                    }
                    2 => drop(farm.fetch_file(wire::FetchFileRequest { hash: scene }).await),
                    _ => {
                        let request = wire::GiveBackRequest {
                            worker: id,
                            leases: vec![0; 1000],
                            leaving: false,
                        };
                        drop(farm.give_back(request).await);
                    }
                }
            });
        }
        let _ = timeout(SOON, async { while calls.join_next().await.is_some() {} }).await;
    }
}

/// Pages, one after the other.
pub async fn pages(stage: Arc<Stage>, mut dice: Dice) {
    loop {
        dice.pause().await;
        let page = dice.pick(&PAGES);
        let request = format!(
            "{page} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n\r\n",
            stage.address
        );
        let Ok(mut stream) = TcpStream::connect(stage.address).await else {
            continue;
        };
        if stream.write_all(request.as_bytes()).await.is_err() {
            continue;
        }
        let mut answer = Vec::new();
        let read = timeout(Duration::from_secs(5), stream.read_to_end(&mut answer)).await;
        if read.is_err() || !answer.starts_with(b"HTTP/1.1 ") || answer.starts_with(b"HTTP/1.1 500") {
            let answer = String::from_utf8_lossy(&answer[..answer.len().min(200)]).into_owned();
            stage.wrong(format!("{page} is answered {answer:?}"));
        }
        if let Ok(mut control) = ControlClient::connect(stage.url.clone()).await
            && let Err(status) = control.status(wire::StatusRequest {}).await
        {
            stage.hear("who asks how it stands", &status);
        }
    }
}

/// Streams of events and answers that nobody reads.
pub async fn deaf(stage: Arc<Stage>, mut dice: Dice) {
    let mut open = VecDeque::new();
    loop {
        dice.pause().await;
        if let Ok(mut stream) = TcpStream::connect(stage.address).await {
            let page = dice.pick(&["/live", "/image.exr", "/"]);
            let request = format!("GET {page} HTTP/1.1\r\nhost: {}\r\n\r\n", stage.address);
            let _ = timeout(SOON, stream.write_all(request.repeat(10).as_bytes())).await;
            open.push_back(stream);
        }
        if open.len() > OPEN / 5 {
            open.pop_front();
        }
    }
}
