//! All calls except submissions: who is let in, and what happens to the passes of a lost worker.

use crate::farm::harness::{Coordinator, LONG, RawWorker, film, free_port, leaf, spec, within};
use beamfarm_coordinator::{End, Timing};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::job::{Block, SceneHash};
use beamfarm_image::merge::TreeSum;
use beamfarm_proto::{FileHash, Grant, VERSION, WireHash, wire};
use std::time::Duration;
use tonic::Code;

#[tokio::test]
async fn another_version_is_turned_away() {
    let coordinator = Coordinator::start(spec(1)).await;
    let mut farm = coordinator.connect().await;
    for version in ["", "0.0.1", &format!("{VERSION}-x"), &"x".repeat(100_000)] {
        let request = wire::RegisterRequest {
            protocol: beamfarm_proto::PROTOCOL,
            version: version.into(),
            ..Default::default()
        };
        let refused = farm.register(request).await.unwrap_err();
        assert_eq!(refused.code(), Code::FailedPrecondition);
    }
    assert_eq!(coordinator.farm.progress().registered, 0);
}

#[tokio::test]
async fn another_scene_and_strangers_get_no_lease() {
    let coordinator = Coordinator::start(spec(1)).await;
    let mut worker = RawWorker::register(&coordinator).await;
    let (scene, id) = (worker.scene, worker.id);
    worker.scene = SceneHash([1; 32]);
    let refused = worker.grant().await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    worker.scene = scene;
    worker.id = id.wrapping_add(1);
    assert_eq!(worker.grant().await.unwrap_err().code(), Code::NotFound);
    worker.id = id;
    assert!(matches!(worker.grant().await, Ok(Grant::Lease(..))));
}

#[tokio::test]
async fn large_files_arrive_whole_and_unknown_ones_are_refused() {
    let mut spec = spec(1);
    // More than a message may hold, and no multiple of a chunk's size.
    let large: Vec<u8> = (0..5_000_001u32).map(|i| (i % 251) as u8).collect();
    spec.bundle.files.insert("large.bin".into(), large.clone());
    spec.bundle.files.insert("empty.bin".into(), Vec::new());
    let coordinator = Coordinator::start(spec).await;
    let mut farm = coordinator.connect().await;
    for expected in [large, Vec::new()] {
        let hash = FileHash::of(&expected).to_wire();
        let request = wire::FetchFileRequest { hash };
        let mut chunks = farm.fetch_file(request).await.unwrap().into_inner();
        let mut bytes = Vec::new();
        while let Some(chunk) = within("a chunk", chunks.message()).await.unwrap() {
            bytes.extend_from_slice(&chunk.data);
        }
        assert!(bytes == expected);
    }
    for hash in [vec![0; 32], vec![0; 31], Vec::new()] {
        let request = wire::FetchFileRequest { hash: hash.into() };
        let refused = farm.fetch_file(request).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument);
    }
}

/// More files, with longer paths, than a message holds by default.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn scenes_may_have_many_files() {
    let mut spec = spec(1);
    for i in 0..5000 {
        let path = format!("{i}{}.bin", "x".repeat(900));
        spec.bundle.files.insert(path, vec![7]);
    }
    let coordinator = Coordinator::start(spec).await;
    let summary = coordinator.worker(1).join().await.unwrap();
    assert_eq!(summary.passes, 1);
    assert_eq!(coordinator.ended().await, End::Complete);
}

#[tokio::test]
async fn a_broken_connection_frees_the_pass_at_once() {
    let coordinator = Coordinator::start(spec(1)).await;
    let lost = RawWorker::register(&coordinator).await;
    let other = RawWorker::register(&coordinator).await;
    let attendance = lost.attend().await;
    let (_, block) = lost.lease().await;
    assert_eq!(other.grant().await.unwrap(), Grant::NotNow);
    // The lease would run for an hour.
    drop((attendance, lost));
    assert_eq!(other.lease().await.1, block);
    assert_eq!(coordinator.farm.progress().lost_leases, 1);
}

#[tokio::test]
async fn a_silent_worker_loses_its_pass() {
    let timing = Timing {
        heartbeat: Duration::from_millis(20),
        lease: Duration::from_millis(60),
    };
    let coordinator = Coordinator::start_on(free_port(), spec(1), timing).await;
    let silent = RawWorker::register(&coordinator).await;
    let other = RawWorker::register(&coordinator).await;
    let leased = silent.lease().await;
    let again = other.lease().await;
    assert_eq!(again.1, leased.1);
    // It was slow, not dead. Both results are welcome, the second even after the job's end.
    assert!(!silent.deliver(leased).await.unwrap().duplicate);
    assert!(other.deliver(again).await.unwrap().duplicate);
    assert_eq!(coordinator.ended().await, End::Complete);
    assert_eq!(coordinator.farm.progress().audits, 1);
}

#[tokio::test]
async fn arrival_order_does_not_change_a_bit() {
    const PASSES: u64 = 11;
    let mut sum = TreeSum::new(film(0).width, film(0).height);
    for pass_index in 0..PASSES {
        sum.insert(leaf(pass_index, film(pass_index))).unwrap();
    }
    let expected = sum.average().unwrap();
    // Steps that visit all of 0..11.
    for step in [1, 3, 10] {
        let coordinator = Coordinator::start(spec(PASSES)).await;
        let worker = RawWorker::register(&coordinator).await;
        let mut leases = Vec::new();
        for _ in 0..PASSES {
            leases.push(worker.lease().await);
        }
        for i in 0..PASSES {
            let leased = leases[(i * step % PASSES) as usize];
            worker.deliver(leased).await.unwrap();
        }
        assert_eq!(coordinator.ended().await, End::Complete);
        assert_eq!(coordinator.farm.average().unwrap(), expected);
        for pass_index in 0..PASSES {
            let pass = Block::leaf(pass_index);
            let hash = coordinator.farm.block_hash(pass).unwrap();
            assert_eq!(FileHash(hash).to_string(), pixel_hash(&film(pass_index)));
        }
    }
}

#[tokio::test]
async fn stopping_keeps_the_prefix_and_tells_workers() {
    let coordinator = Coordinator::start(spec(10)).await;
    let worker = RawWorker::register(&coordinator).await;
    let mut attendance = worker.attend().await;
    let mut leases = Vec::new();
    for _ in 0..5 {
        leases.push(worker.lease().await);
    }
    // Pass 2 is missing.
    for i in [0, 1, 3, 4] {
        worker.deliver(leases[i]).await.unwrap();
    }
    coordinator.farm.stop();
    assert_eq!(coordinator.ended().await, End::Stopped);
    assert_eq!(coordinator.farm.average().unwrap().passes, 2);
    let notice = within("a notice", attendance.1.message()).await.unwrap();
    assert!(notice.unwrap().done);
}

#[tokio::test]
async fn workers_that_wait_hear_of_the_end() {
    let coordinator = Coordinator::start_on(
        free_port(),
        spec(1),
        Timing {
            heartbeat: LONG,
            lease: LONG,
        },
    )
    .await;
    let busy = RawWorker::register(&coordinator).await;
    let idle = RawWorker::register(&coordinator).await;
    let leased = busy.lease().await;
    let (grant, delivered) = tokio::join!(idle.grant(), async {
        tokio::task::yield_now().await;
        busy.deliver(leased).await
    });
    delivered.unwrap();
    assert_eq!(grant.unwrap(), Grant::Done);
}

#[tokio::test]
async fn a_pass_that_cannot_be_rendered_ends_the_job_before_it() {
    let coordinator = Coordinator::start(spec(6)).await;
    let worker = RawWorker::register(&coordinator).await;
    let mut leases = Vec::new();
    for _ in 0..5 {
        leases.push(worker.lease().await);
    }
    for i in [4, 0, 1] {
        worker.deliver(leases[i]).await.unwrap();
    }
    let mut bad = leases[3];
    for attempt in 1..=3 {
        let request = wire::FailRequest {
            worker: worker.id,
            lease: bad.0.0,
            message: "2 pixel values are not finite".into(),
            pass_index: 3,
        };
        worker.farm.clone().fail(request).await.unwrap();
        if attempt < 3 {
            bad = worker.lease().await;
            assert_eq!(bad.1, leases[3].1);
        }
    }
    // Pass 2 is still wanted.
    worker.deliver(leases[2]).await.unwrap();
    match coordinator.ended().await {
        End::Failed(failure) => {
            assert_eq!((failure.pass_index, failure.attempts), (3, 3));
            assert!(failure.message.contains("not finite"));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(coordinator.farm.average().unwrap().passes, 3);
    assert_eq!(coordinator.farm.progress().failures, 3);
}

/// A worker's number is public, and leases are counted as well: knowing both lets nobody act in another's name.
#[tokio::test]
async fn nobody_speaks_for_another() {
    let coordinator = Coordinator::start(spec(2)).await;
    let victim = RawWorker::named(&coordinator, "victim").await;
    let thief = RawWorker::named(&coordinator, "thief").await;
    let (lease, block) = victim.lease().await;
    let fail = |worker| wire::FailRequest {
        worker,
        lease: lease.0,
        message: "no".into(),
        pass_index: 0,
    };
    let give_back = |worker| wire::GiveBackRequest {
        worker,
        leases: vec![lease.0],
        leaving: true,
    };
    let mut farm = thief.farm.clone();
    for key in [victim.number, thief.id.wrapping_add(1), thief.id.wrapping_sub(1), 0] {
        let guess = RawWorker {
            farm: thief.farm.clone(),
            id: key,
            number: victim.number,
            scene: victim.scene,
            engine: Default::default(),
        };
        let answers = [
            guess.grant().await.map(|_| ()),
            guess.deliver((lease, block)).await.map(|_| ()),
            farm.fail(fail(key)).await.map(|_| ()),
            farm.give_back(give_back(key)).await.map(|_| ()),
        ];
        for answer in answers {
            assert_eq!(answer.unwrap_err().code(), Code::NotFound, "{key}");
        }
    }
    // Under its own name it holds no such lease.
    let status = thief.deliver((lease, block)).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let status = farm.fail(fail(thief.id)).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(coordinator.farm.progress().failures, 0);
    assert_eq!(coordinator.farm.progress().refused, 0);
    victim.deliver((lease, block)).await.unwrap();
    assert_eq!(coordinator.farm.progress().passes, 1);
}
