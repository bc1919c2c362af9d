//! Every call with every field drawn from a table of extreme numbers and valid values.

use super::scene::{Dice, HONEST, Stage};
use crate::farm::harness::{canary, encode};
use crate::farm::hostile::call;
use beamfarm_image::job::Block;
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::report::Part as Reported;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{VERSION, WireHash, wire};
use prost::Message;
use std::sync::Arc;
use tonic::Code;
use tonic::transport::Channel;

const NUMBERS: [u64; 13] = [
    0,
    1,
    2,
    15,
    63,
    64,
    255,
    u32::MAX as u64,
    1 << 40,
    i64::MAX as u64,
    1 << 63,
    u64::MAX - 1,
    u64::MAX,
];
const TEXTS: [&str; 7] = ["", HONEST, "\0", "\u{202e}\u{feff}", "{}\n\"", "../../x", "node"];

/// What a worker could validly send.
struct Words {
    key: u64,
    leases: Vec<u64>,
    scene: Bytes,
    identity: Bytes,
    /// A block of the job without its end.
    block: Vec<u8>,
}

impl Dice {
    fn number(&mut self, right: &[u64]) -> u64 {
        match right.is_empty() || self.below(2) == 0 {
            true => self.pick(&NUMBERS),
            false => self.pick(right),
        }
    }

    fn narrow(&mut self) -> u32 {
        self.number(&[]) as u32
    }

    fn float(&mut self) -> f32 {
        self.pick(&[
            0.0,
            -0.0,
            -1.0,
            1e-45,
            f32::MAX,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
        ])
    }

    fn text(&mut self) -> String {
        match self.below(8) {
            0 => "µ".repeat(self.pick(&[100, 500, 501, 5000])),
            _ => self.pick(&TEXTS).into(),
        }
    }

    fn hash(&mut self, right: &Bytes) -> Bytes {
        match self.below(4) {
            0 => Bytes::new(),
            1 => vec![self.below(256) as u8; self.pick(&[1, 31, 32, 33, 4096])].into(),
            _ => right.clone(),
        }
    }

    fn numbers(&mut self, right: &[u64]) -> Vec<u64> {
        let count = self.pick(&[0, 1, 2, 17, 1000]);
        (0..count).map(|_| self.number(right)).collect()
    }

    fn block(&mut self) -> wire::Block {
        wire::Block {
            level: self.number(&[0, 1, 2]) as u32,
            index: self.number(&[0, 1, 2, 3]),
        }
    }

    fn some<T>(&mut self, of: impl FnOnce(&mut Self) -> T) -> Option<T> {
        (self.below(4) > 0).then(|| of(self))
    }

    fn several<T>(&mut self, of: impl Fn(&mut Self) -> T) -> Vec<T> {
        let count = self.pick(&[0, 1, 1, 2, 20]);
        (0..count).map(|_| of(self)).collect()
    }

    fn version(&mut self) -> String {
        match self.below(8) {
            0 => self.text(),
            _ => VERSION.into(),
        }
    }

    fn stats(&mut self) -> wire::PassStats {
        wire::PassStats {
            paths: self.number(&[]),
            beams: self.number(&[]),
            surface_photons: self.number(&[]),
            beam_evaluations: self.number(&[]),
            non_finite: self.number(&[0]),
            beam_bytes: self.number(&[]),
        }
    }

    fn offer(&mut self) -> wire::Offer {
        wire::Offer {
            gpu_bits: self.number(&[0, 0, 0]) as u32,
            canary: self.hash(&canary()),
            device: (self.below(8) == 0).then(|| wire::Device {
                name: self.text(),
                kind: self.text(),
                driver: self.text(),
                memory: Some(self.number(&[])),
            }),
        }
    }

    fn lack(&mut self) -> wire::Lack {
        wire::Lack {
            gpu_bits: self.narrow(),
            reason: self.text(),
        }
    }
}

/// A call of farm.proto.
fn of_farm(words: &Words, dice: &mut Dice) -> (&'static str, Vec<Vec<u8>>) {
    let key = [words.key];
    match dice.below(8) {
        0 => {
            let request = wire::RegisterRequest {
                protocol: beamfarm_proto::PROTOCOL,
                version: dice.version(),
                scene: dice.hash(&words.scene),
                name: dice.text(),
                threads: dice.narrow(),
                held: dice.several(Dice::block),
                before: dice.number(&key),
                offers: dice.several(Dice::offer),
                lacks: dice.several(Dice::lack),
                identity: words.identity.clone(),
            };
            ("Farm/Register", vec![request.encode_to_vec()])
        }
        1 => {
            let hash = dice.hash(&words.scene);
            ("Farm/FetchFile", vec![wire::FetchFileRequest { hash }.encode_to_vec()])
        }
        2 => {
            let beat = |dice: &mut Dice| wire::Heartbeat {
                worker: dice.number(&key),
                leases: dice.numbers(&words.leases),
                rendered: dice.numbers(&[]),
            };
            let beats = dice.several(|dice| beat(dice).encode_to_vec());
            ("Farm/Attend", beats)
        }
        3 => {
            let request = wire::LeaseRequest {
                worker: dice.number(&key),
                scene: dice.hash(&words.scene),
                together: dice.narrow(),
            };
            ("Farm/Lease", vec![request.encode_to_vec()])
        }
        4 => {
            let header = |dice: &mut Dice| wire::SubmitHeader {
                worker: dice.number(&key),
                lease: dice.number(&words.leases),
                block: dice.some(Dice::block),
                size: dice.number(&[words.block.len() as u64 + 4]),
                hash: dice.hash(&words.scene),
                stats: dice.some(Dice::stats),
            };
            let part = |dice: &mut Dice| match dice.below(3) {
                0 => Part::Header(header(dice)),
                1 => Part::Data(words.block.clone().into()),
                _ => Part::Data(dice.bytes(1000).into()),
            };
            let mut parts = dice.several(|dice| dice.some(part));
            if dice.below(4) > 0 {
                parts.insert(0, Some(Part::Header(header(dice))));
            }
            let parts = parts
                .into_iter()
                .map(|part| wire::SubmitRequest { part }.encode_to_vec());
            ("Farm/Submit", parts.collect())
        }
        5 => {
            let request = wire::GiveBackRequest {
                worker: dice.number(&key),
                leases: dice.numbers(&words.leases),
                leaving: dice.below(2) == 0,
            };
            ("Farm/GiveBack", vec![request.encode_to_vec()])
        }
        6 => {
            let request = wire::FailRequest {
                worker: dice.number(&key),
                lease: dice.number(&words.leases),
                message: dice.text(),
                pass_index: dice.number(&[]),
            };
            ("Farm/Fail", vec![request.encode_to_vec()])
        }
        _ => {
            let call = dice.pick(&[
                "Farm/Lease",
                "Farm/Register",
                "Farm/Submit",
                "Farm/Attend",
                "Farm/Nothing",
            ]);
            (call, vec![dice.bytes(200)])
        }
    }
}

/// A call of live.proto. Its pixels are never finite: finite ones could not be told from right ones.
fn of_live(words: &Words, dice: &mut Dice) -> (&'static str, Vec<Vec<u8>>) {
    if dice.below(8) == 0 {
        let hash = dice.hash(&words.scene);
        return (
            "Revisions/FetchFile",
            vec![wire::FetchFileRequest { hash }.encode_to_vec()],
        );
    }
    let greeting = |dice: &mut Dice| wire::Greeting {
        protocol: beamfarm_proto::PROTOCOL,
        version: dice.version(),
        name: dice.text(),
        threads: dice.narrow(),
        canary: dice.hash(&canary()),
        identity: words.identity.clone(),
    };
    let task = |dice: &mut Dice| {
        let near: Vec<u64> = (0..200).collect();
        dice.number(&near)
    };
    let part = |dice: &mut Dice| match dice.below(12) {
        0 => Reported::Greeting(greeting(dice)),
        1..4 => Reported::Outcome(wire::Outcome {
            task: task(dice),
            preparing_ms: dice.float(),
            rendering_ms: dice.float(),
            stats: dice.some(Dice::stats),
        }),
        4..8 => Reported::Data(vec![0xff; dice.pick(&[0, 1, 12, 12_000, 14_400, 1 << 20])].into()),
        8..10 => Reported::Dropped(task(dice)),
        _ => Reported::Misfortune(wire::Misfortune {
            task: task(dice),
            message: dice.text(),
        }),
    };
    let mut parts = dice.several(|dice| dice.some(part));
    if dice.below(8) > 0 {
        parts.insert(0, Some(Reported::Greeting(greeting(dice))));
    }
    let parts = parts.into_iter().map(|part| wire::Report { part }.encode_to_vec());
    ("Revisions/Attend", parts.collect())
}

/// Messages to a farm.
pub async fn to_farm(stage: Arc<Stage>, who: String, mut dice: Dice) {
    for count in 0.. {
        let who = format!("{who} {count}");
        let mut before = 0;
        let worker = stage.come(&who, &mut before, &mut dice).await;
        let scene = worker.scene;
        let mut block = encode(&stage.truth(scene).node(Block::leaf(0)), &worker.meta(Block::leaf(0)));
        block.truncate(block.len() - 4);
        let words = Words {
            key: worker.id,
            leases: (0..30).collect(),
            scene: scene.to_wire(),
            identity: stage.secret(&who),
            block,
        };
        talk(&stage, &who, &words, of_farm, &mut dice).await;
    }
}

/// Messages to a live view.
pub async fn to_view(stage: Arc<Stage>, who: String, mut dice: Dice) {
    for count in 0.. {
        let who = format!("{who} {count}");
        let words = Words {
            key: 0,
            leases: Vec::new(),
            scene: canary(),
            identity: stage.secret(&who),
            block: Vec::new(),
        };
        talk(&stage, &who, &words, of_live, &mut dice).await;
    }
}

type Grammar = fn(&Words, &mut Dice) -> (&'static str, Vec<Vec<u8>>);

async fn talk(stage: &Stage, who: &str, words: &Words, grammar: Grammar, dice: &mut Dice) {
    let channel = Channel::from_shared(stage.url.clone()).unwrap().connect().await;
    let Ok(channel) = channel else {
        return dice.pause().await;
    };
    for _ in 0..20 {
        dice.pause().await;
        let (name, messages) = grammar(words, dice);
        match call(&channel, name, messages).await {
            Err(status) if name == "Farm/Nothing" && status.code() == Code::Unimplemented => {}
            Err(status) => stage.hear(&format!("{who} by {name}"), &status),
            Ok(()) => {}
        }
    }
}
