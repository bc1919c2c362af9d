//! Workers of a live view that spoil what others could render.

use super::scene::{Dice, Stage};
use crate::farm::view::{RawWorker, pixels};
use beamfarm_proto::wire::order::Order as Kind;
use beamfarm_proto::wire::report::Part;
use beamfarm_proto::{Task, VERSION, wire};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::sleep;
use tonic::Status;

/// What a worker does with its tasks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spoil {
    /// It fails at all of them.
    Fails,
    /// Its pictures are not finite.
    Nan,
    /// It says that it dropped its tasks.
    GivesBack,
    /// It keeps its tasks.
    Keeps,
    /// Its pictures come one piece after another, and never whole.
    Drips,
    /// Its pictures have more or fewer pixels than were asked for.
    Shapes,
    /// The counts of its pixels are not finite.
    Counts,
    /// It hangs up and comes again.
    HangsUp,
    /// It answers for tasks that are not its own.
    Others,
}

pub const SPOILS: [Spoil; 9] = [
    Spoil::Fails,
    Spoil::Nan,
    Spoil::GivesBack,
    Spoil::Keeps,
    Spoil::Drips,
    Spoil::Shapes,
    Spoil::Counts,
    Spoil::HangsUp,
    Spoil::Others,
];

impl Spoil {
    /// Whether a view finds it out and shuts it out.
    pub fn is_found(self) -> bool {
        matches!(self, Self::Fails | Self::Nan | Self::GivesBack | Self::Counts)
    }
}

/// Spoils what it gets, and comes again when it is sent away.
pub async fn spoils(stage: Arc<Stage>, who: String, spoil: Spoil, mut dice: Dice) {
    loop {
        dice.pause().await;
        let ended = match RawWorker::greet(&stage.url, VERSION, stage.secret(&who)).await {
            Ok(worker) => life(worker, spoil, &mut dice).await,
            Err(status) => status,
        };
        stage.hear(&who, &ended);
    }
}

async fn life(mut worker: RawWorker, spoil: Spoil, dice: &mut Dice) -> Status {
    loop {
        let task = match worker.orders.message().await {
            Ok(Some(wire::Order {
                order: Some(Kind::Task(task)),
            })) => Task::try_from(task).unwrap(),
            Ok(Some(_)) => continue,
            Ok(None) => return Status::unavailable("it is over"),
            Err(status) => return status,
        };
        let number = task.number.0;
        let outcome = |number, non_finite| {
            Part::Outcome(wire::Outcome {
                task: number,
                stats: Some(wire::PassStats {
                    non_finite,
                    ..Default::default()
                }),
                ..Default::default()
            })
        };
        let failure = |number| {
            Part::Misfortune(wire::Misfortune {
                task: number,
                message: "no luck".into(),
            })
        };
        let data = |share| Part::Data(pixels(&task, 1.0, share).into());
        let parts = match spoil {
            Spoil::Fails => vec![failure(number)],
            Spoil::Nan => {
                let value = dice.pick(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
                vec![outcome(number, 0), Part::Data(pixels(&task, value, 1.0).into())]
            }
            Spoil::GivesBack => vec![Part::Dropped(number)],
            Spoil::Keeps => Vec::new(),
            Spoil::Drips => vec![outcome(number, 0), data(0.01), data(0.01)],
            Spoil::Shapes => match dice.below(2) {
                0 => vec![outcome(number, 0), data(0.9), data(0.2)],
                _ => vec![outcome(number, 0), data(0.9), outcome(number, 0), data(0.1)],
            },
            Spoil::Counts => vec![outcome(number, 1), data(1.0)],
            Spoil::HangsUp => return Status::unavailable("it hangs up"),
            Spoil::Others => {
                let other = dice.pick(&[0, number + 1, number.wrapping_sub(1), u64::MAX]);
                vec![outcome(other, 0), data(1.0), failure(other), Part::Dropped(other)]
            }
        };
        for part in parts {
            if worker.reports.send(wire::Report { part: Some(part) }).await.is_err() {
                break;
            }
            if spoil == Spoil::Drips {
                sleep(Duration::from_millis(20)).await;
            }
        }
        dice.pause().await;
    }
}
