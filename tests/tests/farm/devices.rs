//! Workers with devices: who gets passes of which job, what the others are told, and devices that compute other bits.

use crate::farm::harness::{Coordinator, RawWorker, canary, free_port, leaf, spec, start_worker_offering};
use beamfarm_coordinator::{End, EventKind, JobSpec, Timing, WorkerState};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{encode_block, node_hash};
use beamfarm_image::job::{EngineKind, JobSettings};
use beamfarm_image::merge::Node;
use beamfarm_proto::wire;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_worker::engine::{Engine, EngineError, Planned};
use beamfarm_worker::offer::Offered;
use std::sync::Arc;
use std::time::Duration;
use tonic::Code;

fn spec_for(engine: EngineKind, passes: u64) -> JobSpec {
    let mut spec = spec(passes);
    spec.settings.engine = engine;
    spec
}

fn card(canary: Option<u8>) -> wire::Offer {
    wire::Offer {
        gpu_bits: EngineKind::Gpu.gpu_bits(),
        canary: canary.map(|byte| vec![byte; 32].into()).unwrap_or_default(),
        device: Some(wire::Device {
            name: "Card".into(),
            kind: "discrete".into(),
            driver: "driver 1".into(),
            memory: Some(1 << 30),
        }),
    }
}

fn no_card() -> wire::Lack {
    wire::Lack {
        gpu_bits: EngineKind::Gpu.gpu_bits(),
        reason: "no Vulkan device was found".into(),
    }
}

#[tokio::test]
async fn passes_go_only_to_those_that_offer_the_jobs_engine() {
    let coordinator = Coordinator::start(spec_for(EngineKind::Gpu, 1)).await;
    let processors = || vec![wire::Offer::of_processors(canary())];
    for _ in 0..2 {
        let refused = RawWorker::offering(&coordinator, "desk", processors(), vec![no_card()]).await;
        let refused = refused.err().expect("it is refused");
        assert_eq!(refused.code(), Code::FailedPrecondition);
        assert_eq!(
            refused.message(),
            "the job is for the engine gpu, which this worker does not offer: no Vulkan device was found"
        );
    }
    // An offer may be of an engine that is unknown here.
    let unknown = wire::Offer {
        gpu_bits: 999,
        ..card(Some(1))
    };
    let refused = RawWorker::offering(&coordinator, "future", vec![unknown], Vec::new()).await;
    assert_eq!(
        refused.err().map(|status| status.code()),
        Some(Code::FailedPrecondition)
    );
    let progress = coordinator.farm.progress();
    let unable = progress
        .unable
        .iter()
        .map(|unable| (&*unable.name, &*unable.reason, unable.times));
    assert_eq!(
        unable.collect::<Vec<_>>(),
        [
            ("desk", "no Vulkan device was found", 2),
            ("future", "it does not say why", 1)
        ]
    );
    assert_eq!(progress.registered, 0);
    let events = coordinator.farm.events(0);
    assert!(events.iter().any(|event| event.kind == EventKind::Unable));

    // Both are offered, and the job's engine decides. Nothing is checked, so there is no test picture.
    let offers = [processors(), vec![card(None)]].concat();
    let (worker, untested) = RawWorker::offering(&coordinator, "node", offers, Vec::new())
        .await
        .unwrap();
    assert!(!untested);
    // Who came without one may come back with one.
    let with = RawWorker::offering(&coordinator, "desk", vec![card(None)], Vec::new()).await;
    assert!(with.is_ok());
    let unable = coordinator.farm.progress().unable;
    assert_eq!(unable.len(), 1);
    let leased = worker.lease().await;
    let view = coordinator.farm.progress().workers_seen.remove(0);
    let device = view.device.map(|device| device.to_string());
    assert_eq!(device.as_deref(), Some("Card, discrete, 1.0 GiB"));
    worker.deliver(leased).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);

    let coordinator = Coordinator::start(spec_for(EngineKind::Cpu, 1)).await;
    let refused = RawWorker::offering(&coordinator, "card", vec![card(Some(1))], Vec::new()).await;
    assert_eq!(
        refused.err().map(|status| status.code()),
        Some(Code::FailedPrecondition)
    );
    RawWorker::named(&coordinator, "desk").await;
}

/// A device takes long to render it, so it is not asked for where it is not needed.
#[tokio::test]
async fn a_test_picture_is_asked_for_where_it_is_looked_at() {
    let mut spec = spec_for(EngineKind::Gpu, 4);
    spec.audit_every = 1;
    let coordinator = Coordinator::start(spec).await;
    let offering = async |name: &str, offer| RawWorker::offering(&coordinator, name, vec![offer], Vec::new()).await;
    let (none, untested) = offering("a", card(None)).await.unwrap();
    assert!(untested && none.id == 0);
    assert_eq!(coordinator.farm.progress().registered, 0);
    let (a, untested) = offering("a", card(Some(1))).await.unwrap();
    let (b, _) = offering("b", card(Some(1))).await.unwrap();
    let (odd, _) = offering("odd", card(Some(2))).await.unwrap();
    assert!(!untested);
    let leased = a.lease().await;
    a.deliver(leased).await.unwrap();
    let check = b.lease().await;
    assert_eq!(check.1, leased.1);
    b.deliver(check).await.unwrap();
    // Two agree now: their picture is the engine's.
    let refused = odd.grant().await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
    let refused = offering("odd too", card(Some(2))).await.err().expect("it is refused");
    assert!(refused.message().contains("other bits"), "{refused}");
}

/// Camera paths only, as in the test picture, so that the kernels are compiled once for both.
const BALL: &str = "
    image = { width = 24, height = 16 }
    render = { passes = 6, paths = 1, targeting = \"off\" }
    camera = { origin = [0, 0, 0], target = [0, 0, -1], fov = 50 }
    shapes = [{ type = \"sphere\", center = [0, 0, -3], radius = 1, material = \"grey\" }]
    lights = [{ type = \"point\", position = [1, 2, 0], intensity = 3 }]
    [materials.grey]
    type = \"diffuse\"";

/// What an overheated card returns: the right picture with one bit of one pass flipped.
fn with_a_flipped_bit(engine: &Engine, pass_index: u64) -> Node {
    let image = engine.pass(pass_index).unwrap();
    let mut film = image.film;
    let value = film.pixels.iter_mut().flatten().find(|value| **value > 0.0);
    let value = value.expect("there is light");
    *value = f32::from_bits(value.to_bits() ^ 1);
    leaf(pass_index, film).with_radius_scale(image.radius_scale)
}

/// Passes of a software device; one of three workers has a card that computes wrong bits.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_card_that_computes_wrong_bits_is_shut_out() {
    let offered = match tokio::task::spawn_blocking(|| Offered::device("")).await.unwrap() {
        Ok(offered) => offered,
        Err(EngineError::NoDevice(why)) => return println!("not tried: {why}"),
        Err(error) => panic!("{error}"),
    };
    let name = "ball.toml".to_owned();
    let bundle = Bundle {
        files: [(name.clone(), BALL.into())].into(),
        scene: name,
    };
    let description = beamfarm_scene::load(&bundle).unwrap();
    let settings = JobSettings {
        engine: EngineKind::Gpu,
        ..description.defaults.job_settings()
    };
    let [width, height] = [description.camera.width, description.camera.height];
    let scene = Scene::new(description);
    let plan = RenderPlan::new(&scene, settings);
    let spec = JobSpec {
        bundle,
        settings,
        width,
        height,
        audit_every: 1,
        ..spec(6)
    };
    // All share one device, so each bit of the others is right.
    let engines = offered.engines.clone();
    let engine = tokio::task::spawn_blocking(move || engines.engine(Arc::new(Planned { scene, plan })));
    let engine = Arc::new(engine.await.unwrap().unwrap());
    let picture = beamfarm_worker::canary_by(&offered.engines, EngineKind::Gpu).unwrap();

    let timing = Timing {
        heartbeat: Duration::from_millis(50),
        lease: Duration::from_secs(60),
    };
    let coordinator = Coordinator::start_on(free_port(), spec, timing).await;
    coordinator.stay();
    let mut offer = wire::Offer::from(&offered.offers[0]);
    offer.canary = picture.to_vec().into();
    let (hot, _) = RawWorker::offering(&coordinator, "hot", vec![offer.clone()], Vec::new())
        .await
        .unwrap();
    let _attendance = hot.attend().await;
    let leased = hot.lease().await;
    let (rendering, pass_index) = (engine.clone(), leased.1.start());
    let wrong = tokio::task::spawn_blocking(move || with_a_flipped_bit(&rendering, pass_index));
    let mut meta = hot.meta(leased.1);
    (meta.seed, meta.alpha) = (settings.seed, settings.alpha);
    meta.radius_scale = beamfarm_image::radius::Schedule::new(&settings).scale(pass_index);
    let wrong = encode_block(&wrong.await.unwrap(), &meta, &[]).unwrap();
    hot.submit(leased, wrong).await.unwrap();

    let workers = ["one", "other"].map(|name| start_worker_offering(coordinator.url(), name, offered.clone()));
    assert_eq!(coordinator.ended().await, End::Complete);
    for worker in workers {
        worker.join().await.unwrap();
    }
    let progress = coordinator.farm.progress();
    let view = |name: &str| progress.workers_seen.iter().find(|view| view.name == name).unwrap();
    assert_eq!(view("hot").state, WorkerState::ShutOut);
    assert_eq!((view("hot").passes, view("hot").audits_failed), (0, 1));
    assert!(view("one").audits_failed + view("other").audits_failed == 0);
    let refused = hot.grant().await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
    // Nor may it come back under its name.
    let back = RawWorker::offering(&coordinator, "hot", vec![offer], Vec::new()).await;
    assert_eq!(back.err().map(|status| status.code()), Some(Code::PermissionDenied));
    // Only the bits that the device renders count.
    for done in coordinator.farm.blocks() {
        let block = done.block;
        assert_eq!(block.level, 0);
        let engine = engine.clone();
        let image = tokio::task::spawn_blocking(move || engine.pass(block.start()).unwrap());
        let node = Node::leaf(block.start(), image.await.unwrap().film);
        assert_eq!(coordinator.farm.block_hash(block), Some(node_hash(&node)), "{block}");
    }
}
