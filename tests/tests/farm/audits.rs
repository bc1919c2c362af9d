//! Workers that compute other bits are found, and the image is right.

use crate::farm::harness::{Coordinator, LONG, RawWorker, canary, encode, free_port, identity_of, node, spec, within};
use beamfarm_coordinator::{End, EventKind, Progress, Timing, WorkerState};
use beamfarm_image::job::Block;
use beamfarm_image::merge::{Average, TreeSum};
use beamfarm_proto::{Grant, VERSION, wire};
use std::sync::Arc;
use std::time::Instant;
use tonic::{Code, Status};

const PASSES: u64 = 60;

fn expected(passes: u64) -> Average {
    let first = node(Block::leaf(0));
    let mut sum = TreeSum::new(first.sum.width, first.sum.height);
    for pass_index in 0..passes {
        sum.insert(node(Block::leaf(pass_index))).unwrap();
    }
    sum.average().unwrap()
}

/// Delivers whatever is leased until the job is over or the coordinator wants nothing more. A liar's pictures are wrong
/// in the last bit of one pixel, in one block of `lies`.
async fn work(worker: Arc<RawWorker>, lies: Option<u64>) -> Result<(), Status> {
    let _attendance = worker.attend().await;
    let mut count = 0;
    loop {
        let (lease, block) = match worker.grant().await? {
            Grant::Lease(lease, block) => (lease, block),
            Grant::NotNow => continue,
            Grant::Done | Grant::Elsewhere => return Ok(()),
        };
        let mut node = node(block);
        if lies.is_some_and(|lies| count % lies == 0) {
            // Two liars lie differently: pixels on which two workers agree would count.
            let place = 8 * count + worker.number % 8;
            let place = place as usize % node.sum.pixels.len();
            let pixel = &mut node.sum.pixels[place];
            pixel[1] = pixel[1].next_up();
        }
        count += 1;
        let bytes = encode(&node, &worker.meta(block));
        worker.submit((lease, block), bytes).await?;
        tokio::task::yield_now().await;
    }
}

/// Here a worker may be kept waiting for longer than the test may take.
#[tokio::test]
async fn a_worker_that_waits_is_told_of_a_check_at_once() {
    let mut spec = spec(1);
    spec.audit_every = 1;
    let timing = Timing {
        heartbeat: LONG,
        lease: LONG,
    };
    let coordinator = Coordinator::start_on(free_port(), spec, timing).await;
    let first = RawWorker::register(&coordinator).await;
    let second = Arc::new(RawWorker::register(&coordinator).await);
    let _attendances = (first.attend().await, second.attend().await);
    let leased = first.lease().await;
    let begun = Instant::now();
    let waiting = tokio::spawn({
        let second = second.clone();
        async move { second.lease().await }
    });
    // It has asked and had no answer yet, and before the delivery there is none.
    let has_asked = |progress: &Progress| {
        let mut workers = progress.workers_seen.iter();
        let view = workers.find(|view| view.id.0 == second.number)?;
        (view.last_seen < begun.elapsed()).then_some(())
    };
    coordinator.shows("a question", has_asked).await;
    assert!(!waiting.is_finished(), "there is nothing to be had");
    first.deliver(leased).await.unwrap();
    let check = within("a check", waiting).await.unwrap();
    assert_eq!(check.1, leased.1);
    second.deliver(check).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);
    assert_eq!(coordinator.farm.progress().audits, 1);
}

async fn liar_among(honest: usize, lies: u64) {
    let mut spec = spec(PASSES);
    spec.audit_every = 1;
    let coordinator = Coordinator::start(spec).await;
    coordinator.stay();
    let liar = Arc::new(RawWorker::named(&coordinator, "liar").await);
    let lying = tokio::spawn(work(liar.clone(), Some(lies)));
    let mut others = Vec::new();
    for i in 0..honest {
        let worker = RawWorker::named(&coordinator, &format!("honest {i}")).await;
        others.push(tokio::spawn(work(Arc::new(worker), None)));
    }
    assert_eq!(coordinator.ended().await, End::Complete);
    assert!(coordinator.farm.average().unwrap() == expected(PASSES));
    for other in others {
        within("an honest worker's end", other).await.unwrap().unwrap();
    }
    let caught = within("the liar's end", lying).await;
    let caught = caught.unwrap().unwrap_err();
    assert_eq!(caught.code(), Code::PermissionDenied, "{caught}");
    let progress = coordinator.farm.progress();
    assert_eq!(progress.divergent, 0);
    let views = progress.workers_seen;
    let view = views.iter().find(|view| view.id.0 == liar.number).unwrap();
    assert_eq!((view.state, view.passes), (WorkerState::ShutOut, 0));
    assert!(view.audits_failed > 0);
    let mut honest = views.iter().filter(|view| view.id.0 != liar.number);
    assert!(honest.all(|view| view.audits_failed == 0));
    let events = coordinator.farm.events(0);
    assert!(events.iter().any(|event| event.kind == EventKind::Divergent));
    assert!(events.iter().any(|event| event.kind == EventKind::ShutOut));
    // Nor may it come back.
    let mut farm = coordinator.connect().await;
    let again = wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        name: "honest 0".into(),
        identity: identity_of("liar"),
        offers: vec![wire::Offer::of_processors(canary())],
        ..Default::default()
    };
    let refused = farm.register(again).await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
}

/// A liar takes the names of honest workers. It is shut out under any name, and they are accepted again. A worker
/// without an identity is refused.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nobody_is_shut_out_for_what_others_do_in_his_name() {
    let mut spec = spec(PASSES);
    spec.audit_every = 1;
    let coordinator = Coordinator::start(spec).await;
    coordinator.stay();
    let offers = || vec![wire::Offer::of_processors(canary())];
    let as_one = |name, identity| RawWorker::with_identity(&coordinator, (name, identity), offers(), Vec::new());
    let honest = ["node0", "node1"];
    let mut others = Vec::new();
    for name in honest {
        let worker = RawWorker::named(&coordinator, name).await;
        others.push(tokio::spawn(work(Arc::new(worker), None)));
    }
    let mut lying = Vec::new();
    for name in honest {
        let (liar, _) = as_one(name, identity_of(&format!("liar as {name}"))).await.unwrap();
        lying.push(tokio::spawn(work(Arc::new(liar), Some(1))));
    }
    assert_eq!(coordinator.ended().await, End::Complete);
    assert!(coordinator.farm.average().unwrap() == expected(PASSES));
    for other in others {
        within("an honest worker's end", other).await.unwrap().unwrap();
    }
    for liar in lying {
        let caught = within("a liar's end", liar).await.unwrap().unwrap_err();
        assert_eq!(caught.code(), Code::PermissionDenied, "{caught}");
    }
    for name in honest {
        RawWorker::named(&coordinator, name).await;
        for taken in [name, "another"] {
            let refused = as_one(taken, identity_of(&format!("liar as {name}"))).await;
            let refused = refused.err().unwrap();
            assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
            assert!(refused.message().contains("its key"), "{refused}");
        }
    }
    for nobody in [0, 31, 33] {
        let refused = as_one("node0", vec![1; nobody].into()).await.err().unwrap();
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_always_lies_is_found() {
    liar_among(2, 1).await;
}

/// As users run it: few passes, and a random one block in 64 is checked.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn liars_spoil_no_short_job() {
    const SHORT: u64 = 16;
    for round in 0..10 {
        let mut spec = spec(SHORT);
        spec.audit_every = 64;
        let coordinator = Coordinator::start(spec).await;
        coordinator.stay();
        let mut workers = Vec::new();
        for (name, lies) in [("liar", Some(1)), ("one", None), ("other", None)] {
            let worker = RawWorker::named(&coordinator, &format!("{name} {round}")).await;
            workers.push(tokio::spawn(work(Arc::new(worker), lies)));
        }
        assert_eq!(coordinator.ended().await, End::Complete);
        assert!(coordinator.farm.average().unwrap() == expected(SHORT), "round {round}");
        assert_eq!(coordinator.farm.progress().divergent, 0);
        for worker in workers {
            let _ = within("a worker's end", worker).await.unwrap();
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_machine_with_other_bits_does_not_get_in() {
    let coordinator = Coordinator::start(spec(1)).await;
    RawWorker::named(&coordinator, "first").await;
    let mut farm = coordinator.connect().await;
    let mut request = wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        name: "second".into(),
        identity: identity_of("second"),
        offers: vec![wire::Offer::of_processors(vec![3; 32].into())],
        ..Default::default()
    };
    let refused = farm.register(request.clone()).await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied);
    assert!(refused.message().contains("other bits"), "{refused}");
    request.offers = vec![wire::Offer::of_processors(vec![3; 31].into())];
    let refused = farm.register(request).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    assert_eq!(coordinator.farm.progress().registered, 1);
    let events = coordinator.farm.events(0);
    assert!(events.iter().any(|event| event.text.contains("second")));
}

/// A worker that lies only after its first blocks, when it is hardly checked any more, and so that it shows.
#[tokio::test]
async fn passes_that_look_unlike_others_are_checked_at_once() {
    for lie in 0..4 {
        let mut spec = spec(PASSES);
        spec.audit_every = 1_000_000;
        let coordinator = Coordinator::start(spec).await;
        let [honest, liar] = [
            RawWorker::named(&coordinator, "honest").await,
            RawWorker::named(&coordinator, "liar").await,
        ];
        let third = Arc::new(RawWorker::named(&coordinator, "third").await);
        let (_honest, _liar) = (honest.attend().await, liar.attend().await);
        for _ in 0..15 {
            for worker in [&honest, &liar] {
                let leased = worker.lease().await;
                worker.deliver(leased).await.unwrap();
            }
        }
        let trials = coordinator.farm.progress();
        assert_eq!((trials.audits, trials.audits_pending), (4, 0), "{trials:#?}");
        let leased = liar.lease().await;
        let mut wrong = node(leased.1);
        let values = wrong.sum.pixels.as_flattened_mut();
        match lie {
            0 => values.iter_mut().for_each(|v| *v *= 1.5),
            1 => values.iter_mut().for_each(|v| *v -= 1.0),
            2 => values.iter_mut().for_each(|v| *v *= 0.5),
            _ => values.iter_mut().step_by(5).for_each(|v| *v = 1e20),
        }
        let bytes = encode(&wrong, &liar.meta(leased.1));
        liar.submit(leased, bytes).await.unwrap();
        assert_eq!(coordinator.farm.progress().audits_pending, 1, "{lie}");
        let workers = [Arc::new(honest), third];
        for worker in workers.map(|worker| tokio::spawn(work(worker, None))) {
            within("an honest worker", worker).await.unwrap().unwrap();
        }
        assert_eq!(coordinator.ended().await, End::Complete);
        let average = coordinator.farm.snapshot().sum.average().unwrap();
        assert_eq!(average.beauty, expected(PASSES).beauty, "{lie}");
        let progress = coordinator.farm.progress();
        let views = progress.workers_seen.iter();
        let out: Vec<_> = views.filter(|view| view.state == WorkerState::ShutOut).collect();
        assert_eq!(out.len(), 1, "{lie}");
        assert_eq!(out[0].name, "liar");
    }
}
