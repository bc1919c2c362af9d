//! Workers whose pixels are wrong, always or from some time on.

use super::scene::{Dice, Stage};
use crate::farm::harness::{RawWorker, encode, leaf, node_of};
use beamfarm_image::job::Block;
use beamfarm_image::merge::Node;
use beamfarm_proto::{Grant, LeaseId, wire};
use std::sync::Arc;
use tonic::Status;

/// What is wrong with a worker's deliveries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lie {
    /// The last bit of one value.
    LastBit,
    /// A black picture.
    Black,
    /// A picture that is too bright.
    Bright,
    /// The picture of another pass.
    AnotherPass,
    /// One block in four has a wrong bit.
    Seldom,
    /// The right picture first, then another one.
    TwoThings,
    /// One right picture, then every pass fails.
    Fails,
}

pub const LIES: [Lie; 7] = [
    Lie::LastBit,
    Lie::Black,
    Lie::Bright,
    Lie::AnotherPass,
    Lie::Seldom,
    Lie::TwoThings,
    Lie::Fails,
];

/// Lies until it is found out, then comes back under other names.
pub async fn lies(stage: Arc<Stage>, who: String, lie: Lie, mut dice: Dice) {
    let mut before = 0;
    loop {
        let worker = stage.come(&who, &mut before, &mut dice).await;
        if let Err(status) = life(&stage, &who, &worker, lie, &mut dice).await {
            stage.hear(&who, &status);
        }
    }
}

async fn life(stage: &Stage, who: &str, worker: &RawWorker, lie: Lie, dice: &mut Dice) -> Result<(), Status> {
    let _attendance = worker.try_attend().await?;
    let mut count = 0;
    loop {
        dice.pause().await;
        let leased = match worker.grant().await? {
            Grant::Lease(lease, block) => (lease, block),
            Grant::NotNow => continue,
            Grant::Done | Grant::Elsewhere => return Ok(()),
        };
        count += 1;
        let is_honest = match lie {
            Lie::Seldom => dice.below(4) > 0,
            Lie::Fails => count == 1,
            _ => false,
        };
        let truth = stage.truth(worker.scene).node(leased.1);
        if is_honest {
            submit(worker, leased, &truth).await?;
        } else if lie == Lie::Fails {
            let request = wire::FailRequest {
                worker: worker.id,
                lease: leased.0.0,
                message: "no luck".into(),
                pass_index: leased.1.start(),
            };
            worker.farm.clone().fail(request).await?;
        } else {
            if lie == Lie::TwoThings {
                submit(worker, leased, &truth).await?;
            }
            let wrong = wrong(stage, worker, leased.1, lie, dice);
            if submit(worker, leased, &wrong).await? {
                stage.lied(who);
            }
        }
    }
}

/// Delivers; returns whether the delivery was taken as new.
async fn submit(worker: &RawWorker, leased: (LeaseId, Block), node: &Node) -> Result<bool, Status> {
    let bytes = encode(node, &worker.meta(leased.1));
    Ok(!worker.submit(leased, bytes).await?.duplicate)
}

fn wrong(stage: &Stage, worker: &RawWorker, block: Block, lie: Lie, dice: &mut Dice) -> Node {
    let truth = stage.truth(worker.scene);
    let mut node = truth.node(block);
    let values = node.sum.pixels.as_flattened_mut();
    match lie {
        Lie::Black => values.fill(0.0),
        Lie::Bright => values.iter_mut().for_each(|value| *value = 1.5 * *value + 0.01),
        Lie::AnotherPass if block.level == 0 => {
            node = leaf(block.start(), truth.film(block.start() + 1));
        }
        Lie::AnotherPass => node = node_of(block, &|pass_index| truth.film(pass_index + 1)),
        // No two liars that lie in the same way agree.
        _ => {
            let at = dice.below(values.len());
            values[at] = values[at].next_up();
        }
    }
    node
}
