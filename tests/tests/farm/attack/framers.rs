//! Workers that speak in the name of others.

use super::scene::{Dice, Stage};
use crate::farm::harness::{RawWorker, encode};
use beamfarm_image::job::Block;
use beamfarm_proto::LeaseId;
use beamfarm_proto::wire;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{sleep, timeout};
use tonic::{Code, Status};

/// Range of the guessed numbers of workers and leases; some of them exist.
const NUMBERS: usize = 60;

/// Reports failures, gives back, delivers and sends heartbeats in the name of others: with guessed keys, and with its
/// own key for leases that others hold.
pub async fn frames(stage: Arc<Stage>, who: String, mut dice: Dice) {
    let mut before = 0;
    loop {
        // Another worker's number is no key either.
        if dice.below(2) == 0 {
            before = dice.below(NUMBERS) as u64;
        }
        let worker = stage.come(&who, &mut before, &mut dice).await;
        for _ in 0..10 {
            dice.pause().await;
            let number = dice.below(NUMBERS) as u64;
            let guess = dice.pick(&[
                0,
                number,
                worker.number,
                worker.id.wrapping_add(1),
                !worker.id,
                u64::MAX,
            ]);
            for (key, expected) in [(guess, Code::NotFound), (worker.id, Code::InvalidArgument)] {
                let lease = dice.below(NUMBERS) as u64;
                let answer = speak(&stage, &worker, key, lease, &mut dice).await;
                match answer {
                    Err(status) if status.code() == expected => {}
                    Err(status) => stage.hear(&who, &status),
                    Ok(()) => stage.wrong(format!("{who} speaks for another by {key}, of lease {lease}")),
                }
            }
            let beat = wire::Heartbeat {
                worker: worker.id,
                leases: (0..NUMBERS as u64).collect(),
                rendered: vec![u64::MAX; NUMBERS],
            };
            let give_back = wire::GiveBackRequest {
                worker: worker.id,
                leases: (0..NUMBERS as u64).collect(),
                leaving: false,
            };
            let mut farm = worker.farm.clone();
            if let Err(status) = farm.give_back(give_back).await {
                stage.hear(&who, &status);
            }
            let beats = tokio_stream::iter([beat.clone(), beat]);
            if let Ok(Err(status)) = timeout(Duration::from_millis(20), farm.attend(beats)).await {
                stage.hear(&who, &status);
            }
        }
        sleep(Duration::from_millis(20)).await;
    }
}

/// A failure or a delivery of a lease that is not the worker's.
async fn speak(stage: &Stage, worker: &RawWorker, key: u64, lease: u64, dice: &mut Dice) -> Result<(), Status> {
    let mut farm = worker.farm.clone();
    let pass_index = dice.below(24) as u64;
    if dice.below(2) == 0 {
        let request = wire::FailRequest {
            worker: key,
            lease,
            message: "why not".into(),
            pass_index,
        };
        return farm.fail(request).await.map(|_| ());
    }
    let leased = (LeaseId(lease), Block::leaf(pass_index));
    let bytes = encode(&stage.truth(worker.scene).node(leased.1), &worker.meta(leased.1));
    let guess = RawWorker {
        farm,
        id: key,
        number: worker.number,
        scene: worker.scene,
        engine: worker.engine,
    };
    guess.submit(leased, bytes).await.map(|_| ())
}
