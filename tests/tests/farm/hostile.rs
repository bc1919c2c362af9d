//! Every call of the farm with damaged messages: the coordinator answers, survives, and renders the right image.

// Messages may get more fields.
#![allow(clippy::needless_update)]

use crate::farm::harness::{Coordinator, RawWorker, encode, film, identity_of, leaf, spec, within};
use beamfarm_coordinator::End;
use beamfarm_harness::fuzz::mutate;
use beamfarm_image::merge::TreeSum;
use beamfarm_proto::bytes::{Buf, BufMut, Bytes};
use beamfarm_proto::{VERSION, WireHash, wire};
use prost::Message;
use rand_pcg::Pcg32;
use std::time::Duration;
use tokio::time::timeout;
use tonic::client::Grpc;
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::codegen::http::uri::PathAndQuery;
use tonic::transport::Channel;
use tonic::{Code, Request, Status};

const PASSES: u64 = 3;
/// Damaged messages for each call.
const MUTATIONS: u64 = 200;

/// Messages as raw bytes.
#[derive(Default)]
struct Raw;

impl Codec for Raw {
    type Encode = Bytes;
    type Decode = Bytes;
    type Encoder = Self;
    type Decoder = Self;
    fn encoder(&mut self) -> Self {
        Self
    }
    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for Raw {
    type Item = Bytes;
    type Error = Status;
    fn encode(&mut self, item: Bytes, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        buffer.put(item);
        Ok(())
    }
}

impl Decoder for Raw {
    type Item = Bytes;
    type Error = Status;
    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<Bytes>, Status> {
        Ok(Some(buffer.copy_to_bytes(buffer.remaining())))
    }
}

/// Sends these messages to a call, and reads the answer for a while: some calls are held open.
pub async fn call(channel: &Channel, call: &str, messages: Vec<Vec<u8>>) -> Result<(), Status> {
    let path = PathAndQuery::try_from(format!("/beamfarm.v1.{call}")).unwrap();
    let mut grpc = Grpc::new(channel.clone());
    within("a connection", grpc.ready()).await.unwrap();
    let messages = tokio_stream::iter(messages.into_iter().map(Bytes::from));
    let talk = async {
        let answer = grpc.streaming(Request::new(messages), path, Raw).await?;
        let mut answer = answer.into_inner();
        while answer.message().await?.is_some() {}
        Ok(())
    };
    timeout(Duration::from_millis(200), talk).await.unwrap_or(Ok(()))
}

#[tokio::test]
async fn damaged_messages_do_no_harm() {
    let coordinator = Coordinator::start(spec(PASSES)).await;
    let worker = RawWorker::register(&coordinator).await;
    let leased = worker.lease().await;
    let mut exr = encode(&leaf(leased.1.start(), film(leased.1.start())), &worker.meta(leased.1));
    // No check could find finite pixels of another picture, so this one never arrives.
    exr.truncate(1000);
    let header = worker.header(leased, &exr);
    let part = |part| wire::SubmitRequest { part: Some(part) }.encode_to_vec();
    // Of workers that do not exist: a damaged number must not hit the one that keeps working.
    let nobody = worker.id ^ 1 << 40;
    let seeds: [(&str, Vec<Vec<u8>>); 7] = [
        (
            "Register",
            vec![
                wire::RegisterRequest {
                    protocol: beamfarm_proto::PROTOCOL,
                    version: VERSION.into(),
                    name: "name".into(),
                    identity: identity_of("name"),
                    threads: 1,
                    ..Default::default()
                }
                .encode_to_vec(),
            ],
        ),
        (
            "FetchFile",
            vec![
                wire::FetchFileRequest {
                    hash: worker.scene.to_wire(),
                }
                .encode_to_vec(),
            ],
        ),
        (
            "Attend",
            vec![
                wire::Heartbeat {
                    worker: nobody,
                    leases: vec![1, 2, 300],
                    ..Default::default()
                }
                .encode_to_vec();
                2
            ],
        ),
        (
            "Lease",
            vec![
                wire::LeaseRequest {
                    worker: nobody,
                    scene: worker.scene.to_wire(),
                    ..Default::default()
                }
                .encode_to_vec(),
            ],
        ),
        (
            "Submit",
            vec![
                part(wire::submit_request::Part::Header(wire::SubmitHeader {
                    worker: nobody,
                    ..header
                })),
                part(wire::submit_request::Part::Data(exr.into())),
            ],
        ),
        (
            "GiveBack",
            vec![
                wire::GiveBackRequest {
                    worker: nobody,
                    leases: vec![leased.0.0, 1, 300],
                    leaving: true,
                }
                .encode_to_vec(),
            ],
        ),
        (
            "Fail",
            vec![
                wire::FailRequest {
                    worker: nobody,
                    lease: leased.0.0,
                    message: "why".into(),
                    ..Default::default()
                }
                .encode_to_vec(),
            ],
        ),
    ];
    let channel = Channel::from_shared(coordinator.url()).unwrap();
    let channel = channel.connect().await.unwrap();
    let mut refused = 0;
    for (kind, (name, seed)) in seeds.iter().enumerate() {
        for mutation in 0..MUTATIONS {
            let mut random = Pcg32::new(mutation, kind as u64);
            let damaged = seed.iter().map(|seed| mutate(seed, &seed[1..], &mut random));
            if let Err(status) = call(&channel, &format!("Farm/{name}"), damaged.collect()).await {
                refused += 1;
                // A panic would answer with one of these.
                assert!(
                    !matches!(status.code(), Code::Unknown | Code::Cancelled),
                    "{name} {mutation}: {status}"
                );
            }
        }
    }
    assert!(refused > 3 * MUTATIONS, "{refused}");

    worker.deliver(leased).await.unwrap();
    let mut sum = TreeSum::new(film(0).width, film(0).height);
    for pass_index in 0..PASSES {
        sum.insert(leaf(pass_index, film(pass_index))).unwrap();
    }
    for _ in 1..PASSES {
        let leased = worker.lease().await;
        worker.deliver(leased).await.unwrap();
    }
    assert_eq!(coordinator.ended().await, End::Complete);
    assert_eq!(coordinator.farm.average().unwrap(), sum.average().unwrap());
}
