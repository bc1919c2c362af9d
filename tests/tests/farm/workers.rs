//! Workers of the library at work.

use crate::farm::harness::{
    Coordinator, LONG, RawWorker, SCENE, WIDTH, free_port, leaf, settings, spec, start_worker, start_worker_with,
    start_worker_with_lanes,
};
use beamfarm_coordinator::{End, JobSpec, Progress, Timing, WorkerState, WorkerView};
use beamfarm_harness::render::with_threads;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::job::Block;
use beamfarm_image::merge::{Average, TreeSum};
use beamfarm_proto::FileHash;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_worker::WorkerError;
use std::time::Duration;

const PASSES: u64 = 7;

fn one_pass(progress: &Progress) -> Option<()> {
    (progress.prefix > 0).then_some(())
}

/// The job without a farm, on one thread, pass by pass. Returns the hash of each pass as well.
fn reference() -> (Average, Vec<String>) {
    let bundle = Bundle {
        scene: "scene.toml".into(),
        files: [("scene.toml".into(), SCENE.into())].into(),
    };
    with_threads(1, || {
        let scene = Scene::new(beamfarm_scene::load(&bundle).unwrap());
        let plan = RenderPlan::new(&scene, settings());
        let camera = scene.description().camera;
        let mut sum = TreeSum::new(camera.width, camera.height);
        let mut hashes = Vec::new();
        for pass_index in 0..PASSES {
            let film = render_pass(&scene, &plan, pass_index).expect("a pass").film;
            hashes.push(pixel_hash(&film));
            sum.insert(leaf(pass_index, film)).unwrap();
        }
        (sum.average().unwrap(), hashes)
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_and_threads_do_not_change_a_bit() {
    let (expected, hashes) = reference();
    for (workers, threads, at_once) in [
        (1, 1, 1),
        (1, 2, 1),
        (1, 1, 3),
        (1, 2, 2),
        (2, 1, 1),
        (2, 3, 1),
        (2, 3, 2),
        (4, 1, 1),
        (4, 2, 1),
    ] {
        let coordinator = Coordinator::start(spec(PASSES)).await;
        let worker = |_| start_worker_with_lanes(coordinator.url(), threads, at_once);
        let _crew: Vec<_> = (0..workers).map(worker).collect();
        assert_eq!(coordinator.ended().await, End::Complete);
        let average = coordinator.farm.average().unwrap();
        assert!(
            average == expected,
            "{workers} workers of {threads} threads, {at_once} blocks at once"
        );
        for done in coordinator.farm.blocks() {
            let (_, known) = done.by.unwrap();
            if done.block.level == 0 {
                let hash = &hashes[done.block.start() as usize];
                assert_eq!(FileHash(known).to_string(), *hash);
            }
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

/// A process that is killed before it opens its stream of heartbeats: nobody may wait for it, neither for what it holds
/// nor at the end of the job.
#[tokio::test]
async fn a_worker_that_hangs_up_before_its_first_heartbeat_is_gone() {
    let coordinator = Coordinator::start(spec(PASSES)).await;
    let gone = |count: usize| {
        move |progress: &Progress| {
            let gone = progress
                .workers_seen
                .iter()
                .filter(|worker| worker.state == WorkerState::Gone);
            (gone.count() == count).then_some(())
        }
    };
    let first = RawWorker::register(&coordinator).await;
    let (_, held) = first.lease().await;
    drop(first);
    coordinator.shows("that the first is gone", gone(1)).await;
    let second = RawWorker::register(&coordinator).await;
    assert_eq!(second.lease().await.1, held);
    coordinator.stay();
    coordinator.farm.stop();
    let last = RawWorker::register(&coordinator).await;
    drop((second, last));
    coordinator.shows("that all are gone", gone(3)).await;
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
    first.shows("a pass", one_pass).await;
    drop(first);
    // Another scene: wider, and with one more file.
    let mut other = spec(3);
    other.width = WIDTH + 2;
    let scene = SCENE.replace("width = 40", "width = 42");
    other.bundle.files.insert("scene.toml".into(), scene.into());
    other.bundle.files.insert("unused.bin".into(), vec![1; 3_000_000]);
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
    coordinator.shows("a pass", one_pass).await;
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

/// The job with passes that take about a second.
fn slow(passes: u64) -> JobSpec {
    let mut spec = spec(passes);
    spec.settings.paths_per_pass = 100_000;
    spec
}

/// Waits until the worker of this name renders something.
async fn rendering(coordinator: &Coordinator, name: &str) -> Block {
    let find = |progress: &Progress| {
        let mut workers = progress.workers_seen.iter();
        let found = workers.find(|worker| worker.name == name)?;
        Some(found.rendering?.0)
    };
    coordinator.shows("a block that is rendered", find).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_without_time_gives_its_pass_back() {
    let coordinator = Coordinator::start(slow(1)).await;
    let worker = start_worker_with(coordinator.url(), 1, LONG, Duration::ZERO);
    assert_eq!(rendering(&coordinator, "test").await, Block::leaf(0));
    worker.drain.send_replace(true);
    assert_eq!(worker.join().await.unwrap().passes, 0);
    // The lease would run for an hour.
    let other = RawWorker::register(&coordinator).await;
    assert_eq!(other.lease().await.1, Block::leaf(0));
    let progress = coordinator.farm.progress();
    assert_eq!((progress.failures, progress.passes), (0, 0));
    let left = |worker: &WorkerView| (worker.name == "test").then_some(worker.state);
    let states: Vec<_> = progress.workers_seen.iter().filter_map(left).collect();
    assert_eq!(states, [WorkerState::Gone]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restarted_coordinator_gets_what_was_being_rendered() {
    let timing = Timing {
        heartbeat: Duration::from_millis(50),
        lease: LONG,
    };
    let port = free_port();
    let listener = port.try_clone().unwrap();
    let first = Coordinator::start_on(listener, slow(2), timing).await;
    let other = RawWorker::register(&first).await;
    assert_eq!(other.lease().await.1, Block::leaf(0));
    let worker = first.worker(1);
    assert_eq!(rendering(&first, "test").await, Block::leaf(1));
    drop(first);
    // It would lease pass 0 here if it started afresh.
    let second = Coordinator::start_on(port, slow(2), timing).await;
    assert_eq!(rendering(&second, "test").await, Block::leaf(1));
    assert_eq!(second.ended().await, End::Complete);
    assert_eq!(worker.join().await.unwrap().passes, 2);
    let progress = second.farm.progress();
    assert_eq!((progress.duplicates, progress.refused), (0, 0));
}
