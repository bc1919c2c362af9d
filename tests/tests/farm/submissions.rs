//! What a coordinator refuses, one fault at a time.

use crate::farm::harness::{Coordinator, HEIGHT, RawWorker, WIDTH, encode, film, spec};
use beamfarm_coordinator::End;
use beamfarm_image::exr::{BlockMeta, encoded_size};
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, PassStats, SceneHash};
use beamfarm_image::merge::Node;
use beamfarm_proto::wire;
use beamfarm_proto::wire::submit_request::Part;
use tonic::Code;

/// A fresh worker sends the bytes that `make` returns for its lease. They must be refused with this code and message,
/// be counted as refused, and leave the pass to the next worker.
async fn refused(code: Code, message: &str, make: impl Fn(&RawWorker, Block) -> Vec<u8>) {
    let coordinator = Coordinator::start(spec(1)).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let bytes = make(&worker, leased.1);
    let status = worker.submit(leased, bytes).await.unwrap_err();
    assert_eq!(status.code(), code, "{status}");
    assert!(status.message().contains(message), "{status}");
    let progress = coordinator.farm.progress();
    assert_eq!((progress.refused, progress.passes), (1, 0));
    let next = RawWorker::register(&coordinator).await;
    let leased = next.lease().await;
    next.deliver(leased).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);
}

async fn refused_meta(message: &str, change: impl Fn(&mut BlockMeta)) {
    refused(Code::InvalidArgument, message, |worker, block| {
        let mut meta = worker.meta(block);
        change(&mut meta);
        encode(&Node::leaf(meta.block.start(), film(0)), &meta)
    })
    .await;
}

#[tokio::test]
async fn metadata_of_another_job() {
    refused_meta("version", |meta| meta.version = "0.0.0".into()).await;
    refused_meta("scene", |meta| meta.scene = SceneHash([9; 32])).await;
    refused_meta("seed", |meta| meta.seed += 1).await;
    refused_meta("alpha", |meta| meta.alpha = meta.alpha.next_up()).await;
    refused_meta("radius scale", |meta| {
        meta.radius_scale = meta.radius_scale.next_down();
    })
    .await;
    refused_meta("block", |meta| meta.block = Block::leaf(1)).await;
}

#[tokio::test]
async fn another_size_of_picture() {
    for (width, height) in [(HEIGHT, WIDTH), (WIDTH, HEIGHT - 1), (1, 1)] {
        refused(Code::InvalidArgument, "", |worker, block| {
            let film = Film::new(width, height);
            encode(&Node::leaf(0, film), &worker.meta(block))
        })
        .await;
    }
}

#[tokio::test]
async fn rubbish() {
    let code = Code::InvalidArgument;
    refused(code, "", |_, _| Vec::new()).await;
    refused(code, "", |_, _| vec![0; 10_000]).await;
    refused(code, "", |_, _| b"\x76\x2f\x31\x01\x02\0\0\0".to_vec()).await;
    refused(code, "", |worker, block| {
        let mut bytes = encode(&Node::leaf(0, film(0)), &worker.meta(block));
        bytes.pop();
        bytes
    })
    .await;
    refused(code, "", |worker, block| {
        let mut bytes = encode(&Node::leaf(0, film(0)), &worker.meta(block));
        bytes.push(0);
        bytes
    })
    .await;
}

#[tokio::test]
async fn more_than_a_picture_can_hold() {
    let size = encoded_size(WIDTH, HEIGHT, &[]) + 1;
    refused(Code::InvalidArgument, "bytes", |_, _| vec![0; size]).await;
}

#[tokio::test]
async fn more_or_less_than_announced() {
    for (announced, message) in [(-1, "more than"), (1, "of the")] {
        let coordinator = Coordinator::start(spec(1)).await;
        let worker = RawWorker::register(&coordinator).await;
        let leased = worker.lease().await;
        let bytes = encode(&Node::leaf(0, film(0)), &worker.meta(leased.1));
        let header = wire::SubmitHeader {
            size: bytes.len().saturating_add_signed(announced) as u64,
            ..worker.header(leased, &bytes)
        };
        let parts = vec![Part::Header(header), Part::Data(bytes.into())];
        let status = worker.send(parts).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
        assert!(status.message().contains(message), "{status}");
        assert_eq!(coordinator.farm.progress().refused, 1);
    }
}

#[tokio::test]
async fn parts_in_the_wrong_order() {
    let coordinator = Coordinator::start(spec(1)).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let header = || Part::Header(worker.header(leased, &[]));
    let data = || Part::Data(vec![0].into());
    for parts in [vec![], vec![data()], vec![data(), header()], vec![header(), header()]] {
        let status = worker.send(parts).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
    }
    assert_eq!(coordinator.farm.progress().passes, 0);
}

#[tokio::test]
async fn damaged_bytes_may_be_sent_again() {
    let coordinator = Coordinator::start(spec(1)).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let mut bytes = encode(&Node::leaf(0, film(0)), &worker.meta(leased.1));
    let header = worker.header(leased, &bytes);
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    let parts = vec![Part::Header(header), Part::Data(bytes.into())];
    let status = worker.send(parts).await.unwrap_err();
    assert_eq!(status.code(), Code::Aborted);
    assert!(!worker.deliver(leased).await.unwrap().duplicate);
}

#[tokio::test]
async fn pixels_that_are_not_finite() {
    for value in [f32::NAN, f32::INFINITY, f32::MAX] {
        // The encoder refuses to write them, so they are poked into the last pixel.
        let poke = |worker: &RawWorker, block: Block| {
            let mut bytes = encode(&Node::leaf(0, film(0)), &worker.meta(block));
            let last = bytes.len() - 4;
            bytes[last..].copy_from_slice(&value.to_le_bytes());
            bytes
        };
        refused(Code::InvalidArgument, "NaN, infinite or out of range", poke).await;
    }
}

#[tokio::test]
async fn pixels_that_the_worker_itself_calls_bad() {
    let coordinator = Coordinator::start(spec(1)).await;
    let worker = RawWorker::register(&coordinator).await;
    for attempt in 1..=3 {
        let leased = worker.lease().await;
        let bytes = encode(&Node::leaf(0, film(0)), &worker.meta(leased.1));
        let stats = PassStats {
            non_finite: 2,
            ..PassStats::default()
        };
        let header = wire::SubmitHeader {
            stats: Some(stats.into()),
            ..worker.header(leased, &bytes)
        };
        let parts = vec![Part::Header(header), Part::Data(bytes.into())];
        let status = worker.send(parts).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
        assert_eq!(coordinator.farm.progress().failures, attempt);
    }
    // The pass is to blame, not the worker: the job ends.
    assert!(matches!(coordinator.ended().await, End::Failed(_)));
    assert!(coordinator.farm.average().is_none());
}

#[tokio::test]
async fn passes_that_were_not_leased() {
    let coordinator = Coordinator::start(spec(3)).await;
    let worker = RawWorker::register(&coordinator).await;
    let other = RawWorker::register(&coordinator).await;
    let (lease, block) = worker.lease().await;
    let status = worker.deliver((lease, Block::leaf(1))).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let status = other.deliver((lease, block)).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let beyond = wire::SubmitHeader {
        block: Some(wire::Block { level: 70, index: 1 }),
        ..worker.header((lease, block), &[])
    };
    let status = worker.send(vec![Part::Header(beyond)]).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let stranger = wire::SubmitHeader {
        worker: worker.id.wrapping_add(1000),
        ..worker.header((lease, block), &[])
    };
    let status = worker.send(vec![Part::Header(stranger)]).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    worker.deliver((lease, block)).await.unwrap();
    assert_eq!(coordinator.farm.progress().passes, 1);
}

#[tokio::test]
async fn duplicates_count_once_and_other_bits_are_an_error() {
    let coordinator = Coordinator::start(spec(2)).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let next = worker.lease().await;
    assert!(!worker.deliver(leased).await.unwrap().duplicate);
    assert!(worker.deliver(leased).await.unwrap().duplicate);
    let mut other = film(0);
    other.pixels[7][1] = other.pixels[7][1].next_up();
    let bytes = encode(&Node::leaf(0, other), &worker.meta(leased.1));
    let status = worker.submit(leased, bytes).await.unwrap_err();
    assert_eq!(status.code(), Code::PermissionDenied);
    assert!(status.message().contains("different pixels"), "{status}");
    let progress = coordinator.farm.progress();
    assert_eq!((progress.duplicates, progress.dropped), (1, 1));
    // It contradicts itself, so neither version is believed.
    assert_eq!(progress.passes, 0);
    let status = worker.deliver(next).await.unwrap_err();
    assert_eq!(status.code(), Code::PermissionDenied);
    let other = RawWorker::named(&coordinator, "other").await;
    for _ in 0..2 {
        let leased = other.lease().await;
        other.deliver(leased).await.unwrap();
    }
    assert_eq!(coordinator.ended().await, End::Complete);
}

#[tokio::test]
async fn a_worker_that_sends_nothing_but_rubbish_is_shut_out() {
    let coordinator = Coordinator::start(spec(1)).await;
    let worker = RawWorker::register(&coordinator).await;
    for _ in 0..3 {
        let leased = worker.lease().await;
        worker.submit(leased, vec![1, 2, 3]).await.unwrap_err();
    }
    let status = worker.grant().await.unwrap_err();
    assert_eq!(status.code(), Code::PermissionDenied);
}
