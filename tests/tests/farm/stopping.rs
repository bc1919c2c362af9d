//! A job reaches its target error at the same pass in whatever order passes arrive.

use crate::farm::harness::*;
use beamfarm_coordinator::{End, Start, Target};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::merge::{Average, TreeSum};
use beamfarm_render::sampler::{Purpose, Sampler};
use std::time::Duration;

const PASSES: u64 = 40;

fn average_of(passes: u64) -> Average {
    let mut sum = TreeSum::new(WIDTH, HEIGHT);
    for pass in 0..passes {
        sum.insert(leaf(pass, film(pass))).unwrap();
    }
    sum.average().unwrap()
}

/// Hands all passes out, then accepts them in an order that depends on the seed.
async fn stop(target: Target, seed: u64) -> (Option<u64>, Average) {
    let timing = beamfarm_coordinator::Timing {
        heartbeat: Duration::from_millis(50),
        lease: LONG,
    };
    let start = Start {
        target: Some(target),
        ..Start::default()
    };
    let doors = Default::default();
    let coordinator = Coordinator::start_with(free_port(), spec(PASSES), timing, doors, start).await;
    // As many workers as it takes to hold all passes.
    let mut workers = Vec::new();
    for _ in 0..=PASSES / 16 {
        workers.push(RawWorker::register(&coordinator).await);
    }
    let mut leased = Vec::new();
    let mut passes = 0;
    while passes < PASSES {
        let worker = &workers[leased.len() % workers.len()];
        let lease = worker.lease().await;
        passes += lease.1.len();
        leased.push((worker, lease));
    }
    let mut sampler = Sampler::new(seed, 0, Purpose::Test, 0);
    for i in (1..leased.len()).rev() {
        let j = (sampler.next_1d() * (i + 1) as f32) as usize;
        leased.swap(i, j.min(i));
    }
    for (worker, lease) in leased {
        // Some come after the end, when nobody may be there any more.
        let taken = worker.deliver(lease).await;
        assert!(taken.is_ok() || coordinator.farm.end().is_some(), "{taken:?}");
    }
    assert_eq!(coordinator.ended().await, End::Complete);
    let farm = coordinator.farm.clone();
    let average = tokio::task::spawn_blocking(move || farm.average());
    (coordinator.farm.stopped_at(), average.await.unwrap().unwrap())
}

#[tokio::test]
async fn passes_stop_where_they_would_one_by_one() {
    // Just met by 12 passes, and not by fewer.
    let error = average_of(12).errors().at(None);
    assert!((2..12).all(|passes| average_of(passes).errors().at(None) > error));
    for percentile in [None, Some(95)] {
        let error = average_of(12).errors().at(percentile);
        let target = Target { error, percentile };
        let expected = [2, 3, 4, 6, 8, 12]
            .into_iter()
            .find(|passes| target.is_met_by(&average_of(*passes).errors()))
            .unwrap();
        for seed in 0..4 {
            let (stopped_at, average) = stop(target, seed).await;
            assert_eq!(stopped_at, Some(expected));
            assert_eq!(average.passes, expected);
            assert_eq!(pixel_hash(&average.beauty), pixel_hash(&average_of(expected).beauty));
        }
    }
}

#[tokio::test]
async fn an_error_out_of_reach_takes_all_passes() {
    let target = Target {
        error: 1e-6,
        percentile: None,
    };
    let (stopped_at, average) = stop(target, 9).await;
    assert_eq!((stopped_at, average.passes), (None, PASSES));
    assert_eq!(pixel_hash(&average.beauty), pixel_hash(&average_of(PASSES).beauty));
}
