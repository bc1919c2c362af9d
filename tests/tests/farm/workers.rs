//! Workers of the library at work.

use crate::harness::{
    Coordinator, LONG, RawWorker, SCENE, WIDTH, free_port, leaf, settings, spec, start_worker,
};
use beamfarm_coordinator::{End, Timing};
use beamfarm_proto::FileHash;
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::exr::pixel_hash;
use beamfarm_shared::merge::{Average, TreeSum};
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::scene::SceneDescription;
use beamfarm_worker::WorkerError;
use std::time::Duration;

const PASSES: u64 = 7;

/// The job without a farm: on one thread, one pass after the other. Returns the hash of each pass as well.
fn reference() -> (Average, Vec<String>) {
    let bundle = Bundle {
        scene: "scene.toml".into(),
        files: [("scene.toml".into(), SCENE.into())].into(),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap().install(|| {
        let scene = Scene::new(SceneDescription::load(&bundle).unwrap());
        let plan = RenderPlan::new(&scene, settings());
        let camera = scene.description().camera;
        let mut sum = TreeSum::new(camera.width, camera.height);
        let mut hashes = Vec::new();
        for pass_index in 0..PASSES {
            let film = render_pass(&scene, &plan, pass_index).film;
            hashes.push(pixel_hash(&film));
            sum.insert(leaf(pass_index, film)).unwrap();
        }
        (sum.average().unwrap(), hashes)
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_and_threads_do_not_change_a_bit() {
    let (expected, hashes) = reference();
    for (workers, threads) in [(1, 1), (1, 2), (2, 1), (2, 3), (4, 1), (4, 2)] {
        let coordinator = Coordinator::start(spec(PASSES)).await;
        let _crew: Vec<_> = (0..workers).map(|_| coordinator.worker(threads)).collect();
        assert_eq!(coordinator.ended().await, End::Complete);
        let average = coordinator.farm.average().unwrap();
        assert!(
            average == expected,
            "{workers} workers of {threads} threads"
        );
        for (pass_index, hash) in hashes.iter().enumerate() {
            let known = coordinator.farm.pixel_hash(pass_index as u64).unwrap();
            assert_eq!(FileHash(known).to_string(), *hash);
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_pass_that_a_lost_worker_held_is_rendered_by_another() {
    let (expected, _) = reference();
    let coordinator = Coordinator::start(spec(PASSES)).await;
    let lost = RawWorker::register(&coordinator).await;
    let attendance = lost.attend().await;
    // In the middle of passes 0 and 1.
    lost.lease().await;
    lost.lease().await;
    let worker = coordinator.worker(1);
    drop((attendance, lost));
    assert_eq!(coordinator.ended().await, End::Complete);
    assert!(coordinator.farm.average().unwrap() == expected);
    worker.join().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_finds_a_restarted_coordinator_with_another_job() {
    let timing = Timing {
        heartbeat: Duration::from_millis(50),
        lease: LONG,
    };
    // The port stays open, so that nobody else gets it in between.
    let port = free_port();
    let listener = port.try_clone().unwrap();
    let first = Coordinator::start_on(listener, spec(u64::MAX >> 20), timing).await;
    let worker = first.worker(1);
    while first.farm.progress().prefix == 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    drop(first);
    // Another scene: wider, and with a file more.
    let mut other = spec(3);
    other.width = WIDTH + 2;
    let scene = SCENE.replace("width = 40", "width = 42");
    other.bundle.files.insert("scene.toml".into(), scene.into());
    other
        .bundle
        .files
        .insert("unused.bin".into(), vec![1; 3_000_000]);
    let second = Coordinator::start_on(port, other, timing).await;
    assert_eq!(second.ended().await, End::Complete);
    assert_eq!(second.farm.average().unwrap().beauty.width, WIDTH + 2);
    worker.join().await.unwrap();
}

#[tokio::test]
async fn a_worker_without_a_coordinator_gives_up() {
    // A port where nobody listens any more.
    let coordinator = Coordinator::start(spec(1)).await;
    let url = coordinator.url();
    drop(coordinator);
    let worker = start_worker(url.clone(), 1, Duration::from_millis(200));
    match worker.join().await {
        Err(WorkerError::Unreachable { url: named, .. }) => assert_eq!(named, url),
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_shall_finish_delivers_its_pass() {
    let coordinator = Coordinator::start(spec(u64::MAX >> 20)).await;
    let worker = coordinator.worker(1);
    while coordinator.farm.progress().prefix == 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    worker.drain.send_replace(true);
    let summary = worker.join().await.unwrap();
    assert_eq!(coordinator.farm.progress().prefix, summary.passes);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_scene_that_the_worker_cannot_read_is_named() {
    let mut spec = spec(1);
    let scene = SCENE.replace("ior = 1.5", "ior = \"much\"");
    spec.bundle.files.insert("scene.toml".into(), scene.into());
    let coordinator = Coordinator::start(spec).await;
    match coordinator.worker(1).join().await {
        Err(WorkerError::Scene(error)) => assert!(error.to_string().contains("scene.toml:")),
        other => panic!("{other:?}"),
    }
}
