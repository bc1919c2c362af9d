//! Workers that deliver what is no block of the job, in every way.

use super::scene::{Dice, Stage};
use crate::farm::harness::{HEIGHT, RawWorker, WIDTH, encode, leaf};
use beamfarm_harness::fuzz::mutate;
use beamfarm_image::exr::encoded_size;
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, PassStats, SceneHash};
use beamfarm_image::merge::Node;
use beamfarm_proto::wire::submit_request::Part;
use beamfarm_proto::{Grant, LeaseId, wire};
use prost::Message;
use std::future::poll_fn;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::timeout;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::{Service, http};
use tonic::transport::Channel;

/// Ways to be wrong.
const WAYS: usize = 27;
/// Bytes of a block's header, the same for every block.
const HEADER: usize = 600;
/// How long to wait for an answer; some calls are held open.
const SOON: Duration = Duration::from_millis(100);

/// Delivers rubbish until it is shut out, then goes on under another key.
pub async fn delivers(stage: Arc<Stage>, who: String, mut dice: Dice) {
    for life_count in 0.. {
        let who = format!("{who} {life_count}");
        let mut before = 0;
        let worker = stage.come(&who, &mut before, &mut dice).await;
        if let Err(status) = life(&stage, &who, &worker, &mut dice).await {
            stage.hear(&who, &status);
        }
    }
}

async fn life(stage: &Stage, who: &str, worker: &RawWorker, dice: &mut Dice) -> Result<(), Status> {
    let _attendance = worker.try_attend().await?;
    loop {
        dice.pause().await;
        let leased = match worker.grant().await? {
            Grant::Lease(lease, block) => (lease, block),
            Grant::NotNow => continue,
            Grant::Done | Grant::Elsewhere => return Ok(()),
        };
        let way = dice.below(WAYS);
        let parts = parts(stage, worker, leased, way, dice);
        match worker.send(parts).await {
            // None of these may be taken as the right block in another encoding.
            Ok(reply) if !reply.duplicate => stage.wrong(format!("{who}: a delivery of the way {way} is taken")),
            Ok(_) => {}
            Err(status) => stage.hear(&format!("{who}, way {way}"), &status),
        }
    }
}

/// A delivery with one fault: in the header, the bytes, the picture's metadata, its pixels or its parts.
fn parts(stage: &Stage, worker: &RawWorker, leased: (LeaseId, Block), way: usize, dice: &mut Dice) -> Vec<Part> {
    let block = leased.1;
    let truth = stage.truth(worker.scene).node(block);
    let mut meta = worker.meta(block);
    let bytes = encode(&truth, &meta);
    let right = worker.header(leased, &bytes);
    let data = |bytes: &[u8]| Part::Data(bytes.to_vec().into());
    let with = |header: wire::SubmitHeader| vec![Part::Header(header), data(&bytes)];
    let sent = |bytes: &[u8]| vec![Part::Header(worker.header(leased, bytes)), data(bytes)];
    let other_block = Block {
        level: block.level + 1,
        index: block.index,
    };
    match way {
        0 => with(wire::SubmitHeader {
            hash: vec![7; 32].into(),
            ..right
        }),
        1 => with(wire::SubmitHeader {
            hash: vec![7; 31].into(),
            ..right
        }),
        2 => with(wire::SubmitHeader {
            size: right.size - 1,
            ..right
        }),
        3 => with(wire::SubmitHeader {
            size: right.size + 1,
            ..right
        }),
        4 => with(wire::SubmitHeader {
            size: u64::MAX,
            ..right
        }),
        5 => with(wire::SubmitHeader { size: 0, ..right }),
        6 => with(wire::SubmitHeader {
            block: Some(other_block.into()),
            ..right
        }),
        7 => with(wire::SubmitHeader {
            block: Some(wire::Block {
                level: u32::MAX,
                index: u64::MAX,
            }),
            ..right
        }),
        8 => with(wire::SubmitHeader {
            block: None,
            lease: u64::MAX,
            ..right
        }),
        9 => with(wire::SubmitHeader {
            lease: dice.below(50) as u64 + 1_000_000,
            ..right
        }),
        10 => with(wire::SubmitHeader {
            worker: worker.number,
            ..right
        }),
        11 => with(wire::SubmitHeader {
            stats: Some(
                PassStats {
                    non_finite: u64::MAX,
                    ..PassStats::default()
                }
                .into(),
            ),
            ..right
        }),
        12 => vec![Part::Header(right.clone()), Part::Header(right), data(&bytes)],
        13 => vec![data(&bytes), Part::Header(right)],
        14 => vec![Part::Header(right), data(&bytes), data(&[0]), data(&[])],
        15 => vec![Part::Header(right), data(&bytes[..bytes.len() / 2])],
        16 => vec![],
        17 => {
            let other = Film::new(HEIGHT, WIDTH);
            meta.block = Block::leaf(block.start());
            sent(&encode(&Node::leaf(block.start(), other), &meta))
        }
        18 => {
            meta.block = Block::leaf(block.start() + 1);
            sent(&encode(
                &leaf(block.start() + 1, truth_film(stage, worker, block)),
                &meta,
            ))
        }
        19 => {
            meta.scene = SceneHash([9; 32]);
            sent(&encode(&truth, &meta))
        }
        20 => {
            meta.seed ^= 1 << 40;
            sent(&encode(&truth, &meta))
        }
        21 => {
            meta.radius_scale = meta.radius_scale.next_down();
            sent(&encode(&truth, &meta))
        }
        22 | 23 => {
            let value = dice.pick(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX]);
            let mut bytes = bytes;
            let at = bytes.len() - 4 * (1 + dice.below(WIDTH as usize));
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            sent(&bytes)
        }
        24 => sent(&vec![0; encoded_size(WIDTH, HEIGHT, &[]) + dice.below(2)]),
        25 => sent(&compressed(&bytes, dice)),
        // The header is damaged, none of its pixels.
        _ => {
            let mut damaged = mutate(&bytes[..HEADER], &bytes[100..], dice.pcg());
            if damaged[..] == bytes[..HEADER] {
                damaged.push(0);
            }
            damaged.extend(&bytes[HEADER..]);
            sent(&damaged)
        }
    }
}

fn truth_film(stage: &Stage, worker: &RawWorker, block: Block) -> Film {
    stage.truth(worker.scene).film(block.start())
}

/// The same, but declared as compressed rows, so that the decoder for that compression reads them.
fn compressed(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    const ATTRIBUTE: &[u8] = b"compression\0compression\0\x01\0\0\0";
    let mut bytes = bytes.to_vec();
    let found = bytes.windows(ATTRIBUTE.len()).position(|piece| piece == ATTRIBUTE);
    bytes[found.unwrap() + ATTRIBUTE.len()] = 1 + dice.below(255) as u8;
    // A window of a billion pixels a side.
    if dice.below(2) == 0 {
        const WINDOW: &[u8] = b"dataWindow\0box2i\0\x10\0\0\0";
        let found = bytes.windows(WINDOW.len()).position(|piece| piece == WINDOW);
        let at = found.unwrap() + WINDOW.len() + 8;
        bytes[at..at + 8].copy_from_slice(&[0xff, 0xff, 0xff, 0x3f, 0xff, 0xff, 0xff, 0x3f]);
    }
    bytes
}

/// Messages whose gRPC length prefix is wrong.
pub async fn misframes(stage: Arc<Stage>, mut dice: Dice) {
    loop {
        dice.pause().await;
        let Ok(mut channel) = Channel::from_shared(stage.url.clone()).unwrap().connect().await else {
            continue;
        };
        for _ in 0..20 {
            dice.pause().await;
            let call = dice.pick(&[
                "Farm/Lease",
                "Farm/Submit",
                "Farm/Attend",
                "Farm/Register",
                "Revisions/Attend",
            ]);
            let request = http::Request::post(format!("{}/beamfarm.v1.{call}", stage.url))
                .header("content-type", "application/grpc")
                .header("te", "trailers")
                .body(Body::new(axum::body::Body::from(misframed(&mut dice))))
                .unwrap();
            if poll_fn(|context| channel.poll_ready(context)).await.is_err() {
                break;
            }
            let answer = timeout(SOON, channel.call(request)).await;
            if let Ok(Ok(answer)) = answer
                && let Some(status) = Status::from_header_map(answer.headers())
            {
                stage.hear(&format!("who misframes {call}"), &status);
            }
        }
    }
}

fn misframed(dice: &mut Dice) -> Vec<u8> {
    let message = wire::LeaseRequest::default().encode_to_vec();
    let length = dice.pick(&[0, 1, message.len() as u32 + 1, 1 << 20, 1 << 31, u32::MAX]);
    let mut bytes = vec![dice.pick(&[0, 0, 1, 2, 255])];
    bytes.extend(length.to_be_bytes());
    bytes.extend(message);
    bytes.extend(dice.bytes(64));
    bytes
}
