//! Workers that take leases, and do nothing with them or only give them back.

use super::scene::{Dice, HONEST, Stage};
use crate::farm::harness::{RawWorker, encode, introduction};
use beamfarm_image::job::Block;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{Grant, LeaseId, WireHash, wire};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{sleep, timeout};
use tokio_stream::StreamExt;
use tonic::Status;

/// What a worker does with what it has leased.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Idle {
    /// Keeps all that it can get, and sends heartbeats.
    Keeps,
    /// The same, and reports progress.
    Boasts,
    /// Sends nothing.
    Hides,
    /// Delivers byte by byte.
    Drips,
    /// Gives it back and asks again.
    GivesBack,
    /// Hangs up and comes again.
    HangsUp,
    /// Claims to have all passes from before, and keeps them.
    Claims,
}

pub const IDLE: [Idle; 7] = [
    Idle::Keeps,
    Idle::Boasts,
    Idle::Hides,
    Idle::Drips,
    Idle::GivesBack,
    Idle::HangsUp,
    Idle::Claims,
];

/// How long those that could live for ever stay before they start again.
const LIFE: Duration = Duration::from_millis(700);

pub async fn idles(stage: Arc<Stage>, who: String, idle: Idle, mut dice: Dice) {
    let mut before = 0;
    loop {
        let mut worker = stage.come(&who, &mut before, &mut dice).await;
        let mut held = Vec::new();
        if idle == Idle::Claims {
            let mut request = introduction(HONEST, stage.secret(&who));
            request.scene = worker.scene.to_wire();
            let first = dice.below(24) as u64;
            request.held = (0..16).map(|i| Block::leaf(first + i).into()).collect();
            match RawWorker::come(&stage.url, request).await {
                Ok((claims, reply)) => {
                    held.extend(reply.leases.iter().map(|lease| lease.lease));
                    worker = claims;
                }
                Err(status) => stage.hear(&who, &status),
            }
        }
        let life = life(&stage, &worker, idle, held, &mut dice);
        if let Ok(Err(status)) = timeout(LIFE, life).await {
            stage.hear(&who, &status);
        }
    }
}

async fn life(
    stage: &Stage,
    worker: &RawWorker,
    idle: Idle,
    mut held: Vec<u64>,
    dice: &mut Dice,
) -> Result<(), Status> {
    let attendance = match idle {
        Idle::Hides => None,
        _ => Some(worker.try_attend().await?),
    };
    let mut rendered = 0;
    loop {
        dice.pause().await;
        if let Some((beats, _)) = &attendance {
            rendered += 1;
            let beat = wire::Heartbeat {
                worker: worker.id,
                leases: held.clone(),
                rendered: match idle {
                    Idle::Boasts => held.iter().map(|_| dice.pick(&[rendered, 1, 0, u64::MAX])).collect(),
                    _ => Vec::new(),
                },
            };
            // As fast as they are taken.
            let _ = beats.try_send(beat);
        }
        let (lease, block) = match worker.grant().await? {
            Grant::Lease(lease, block) => (lease, block),
            Grant::NotNow => continue,
            Grant::Done | Grant::Elsewhere => return Ok(()),
        };
        held.push(lease.0);
        match idle {
            Idle::Keeps | Idle::Boasts | Idle::Hides | Idle::Claims => {}
            Idle::Drips => drip(stage, worker, (lease, block)).await?,
            Idle::GivesBack => {
                let request = wire::GiveBackRequest {
                    worker: worker.id,
                    leases: std::mem::take(&mut held),
                    leaving: dice.below(8) == 0,
                };
                worker.farm.clone().give_back(request).await?;
            }
            Idle::HangsUp => return Ok(()),
        }
    }
}

/// The right block, so slowly that it never arrives.
async fn drip(stage: &Stage, worker: &RawWorker, leased: (LeaseId, Block)) -> Result<(), Status> {
    let bytes = encode(&stage.truth(worker.scene).node(leased.1), &worker.meta(leased.1));
    let header = Part::Header(worker.header(leased, &bytes));
    let drops = tokio_stream::iter(bytes).then(|byte| async move {
        sleep(Duration::from_millis(10)).await;
        Part::Data(vec![byte].into())
    });
    let parts = tokio_stream::once(header).chain(drops);
    let parts = parts.map(|part| wire::SubmitRequest { part: Some(part) });
    worker.farm.clone().submit(parts).await.map(|_| ())
}
