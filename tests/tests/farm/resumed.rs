//! Blocks that were accepted after the last checkpoint and are rendered again when the job is resumed.

use crate::farm::harness::{Coordinator, LONG, RawWorker, encode, free_port, node, spec};
use beamfarm_coordinator::store::{Asked, Folder, Keeper, Looks, Resumed};
use beamfarm_coordinator::{DoneBlock, End, Entry, EntryState, EventKind, Start, Timing};
use beamfarm_image::exr::node_hash;
use beamfarm_image::job::Block;
use beamfarm_image::merge::TreeSum;
use beamfarm_proto::Grant;
use std::path::Path;
use std::time::Duration;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tonic::Code;

const PASSES: u64 = 20;
/// A block of more than one pass.
const PAIR: Block = Block { level: 1, index: 8 };

/// Resumes a job that had these blocks, none of them in its checkpoint.
async fn resume(lost: Vec<(Block, [u8; 32])>) -> (Coordinator, UnboundedReceiver<Entry>) {
    let (sender, entries) = unbounded_channel();
    let done = lost.into_iter().map(|(block, hash)| DoneBlock {
        block,
        hash,
        worker: "before".into(),
        audited: false,
    });
    let start = Start {
        done: done.collect(),
        entries: Some(sender),
        ..Start::default()
    };
    let timing = Timing {
        heartbeat: Duration::from_millis(50),
        lease: LONG,
    };
    let coordinator = Coordinator::resume_on(free_port(), spec(PASSES), timing, start).await;
    (coordinator, entries)
}

/// Delivers every block it can get.
async fn work(coordinator: &Coordinator, name: &str) -> Vec<Block> {
    let worker = RawWorker::named(coordinator, name).await;
    let mut blocks = Vec::new();
    // At its last request nobody may be there any more.
    while let Ok(Grant::Lease(lease, block)) = worker.grant().await {
        worker.deliver((lease, block)).await.unwrap();
        blocks.push(block);
    }
    blocks
}

fn lines(entries: &mut UnboundedReceiver<Entry>, state: EntryState) -> Vec<Entry> {
    let entries = std::iter::from_fn(|| entries.try_recv().ok());
    entries.filter(|entry| entry.state == state).collect()
}

#[tokio::test]
async fn the_same_bits_again_are_nothing_to_speak_of() {
    let lost = [PAIR, Block::leaf(3)].map(|block| (block, node_hash(&node(block))));
    let (coordinator, mut entries) = resume(lost.into()).await;
    let blocks = work(&coordinator, "a").await;
    assert_eq!(coordinator.ended().await, End::Complete);
    // The same block as before, so that it can be compared.
    assert!(blocks.contains(&PAIR), "{blocks:?}");
    let progress = coordinator.farm.progress();
    assert_eq!((progress.divergent, progress.audits), (0, 0));
    let events = coordinator.farm.events(0);
    let mut kinds = events.iter().map(|event| event.kind);
    assert!(kinds.all(|kind| kind != EventKind::Divergent));
    // What the ledger file records of each block, whatever its size.
    let told = lines(&mut entries, EntryState::Done);
    assert_eq!(told.len(), blocks.len());
    for entry in told {
        assert_eq!(entry.hash, Some(node_hash(&node(entry.block))));
        assert_eq!(entry.worker.name, "a");
        assert!(entry.radius_scale > 0.0 && entry.took > Duration::ZERO);
    }
}

#[tokio::test]
async fn other_bits_than_before_are_told_and_decided() {
    for block in [PAIR, Block::leaf(3)] {
        let (coordinator, mut entries) = resume(vec![(block, [9; 32])]).await;
        let blocks = work(&coordinator, "a").await;
        assert!(blocks.contains(&block));
        let progress = coordinator.farm.progress();
        assert_eq!((progress.prefix, progress.divergent), (PASSES, 1));
        assert_eq!(coordinator.farm.end(), None, "others may still decide");
        let events = coordinator.farm.events(0);
        let told = events.iter().filter(|event| event.kind == EventKind::Divergent);
        let told: Vec<&str> = told.map(|event| &*event.text).collect();
        assert_eq!(told.len(), 1);
        assert!(told[0].contains("\"before\"") && told[0].contains(&block.to_string()));

        assert_eq!(work(&coordinator, "b").await, [block]);
        assert_eq!(coordinator.ended().await, End::Complete);
        assert_eq!(coordinator.farm.progress().divergent, 0);
        let audited = lines(&mut entries, EntryState::Audited);
        assert_eq!(audited.len(), 1);
        assert_eq!(audited[0].hash, Some(node_hash(&node(block))));
        let mut sum = TreeSum::new(40, 30);
        for pass in 0..PASSES {
            sum.insert(node(Block::leaf(pass))).unwrap();
        }
        assert!(coordinator.farm.average() == sum.average());
    }
}

/// A coordinator of the job in this folder, started like `serve`.
async fn start_in(folder: &Path) -> (Coordinator, Keeper) {
    let mut spec = spec(PASSES);
    let (folder, resumed) = Folder::open(folder, &mut spec, Looks::default(), Asked::default()).unwrap();
    let (sender, entries) = unbounded_channel();
    let mut start = Start {
        entries: Some(sender),
        sum: Some(folder.shape().empty_sum()),
        ..Start::default()
    };
    if let Some(Resumed {
        checkpoint,
        done,
        convicted,
    }) = resumed
    {
        (start.sum, start.done, start.convicted) = (Some(checkpoint.sum), done, convicted);
    }
    let timing = Timing {
        heartbeat: Duration::from_millis(50),
        lease: LONG,
    };
    let coordinator = Coordinator::resume_on(free_port(), spec, timing, start).await;
    let keeper = Keeper::start(folder, coordinator.farm.clone(), entries).unwrap();
    (coordinator, keeper)
}

#[tokio::test]
async fn a_liar_stays_out_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (coordinator, keeper) = start_in(&path).await;
    let [liar, honest] = [
        RawWorker::named(&coordinator, "liar").await,
        RawWorker::named(&coordinator, "honest").await,
    ];
    let leased = honest.lease().await;
    honest.deliver(leased).await.unwrap();
    // Two pictures of one pass.
    let leased = liar.lease().await;
    liar.deliver(leased).await.unwrap();
    let mut other = node(leased.1);
    other.sum.pixels[0][0] += 1.0;
    let bytes = encode(&other, &liar.meta(leased.1));
    let refused = liar.submit(leased, bytes).await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied);
    coordinator.farm.stop();
    tokio::task::spawn_blocking(|| keeper.finish().1.unwrap())
        .await
        .unwrap();
    drop(coordinator);
    let (coordinator, keeper) = start_in(&path).await;
    let refused = RawWorker::try_named(&coordinator, "liar").await.err();
    assert_eq!(refused.map(|status| status.code()), Some(Code::PermissionDenied));
    let rest = work(&coordinator, "honest").await;
    assert!(rest.contains(&leased.1));
    assert_eq!(coordinator.ended().await, End::Complete);
    tokio::task::spawn_blocking(|| keeper.finish().1.unwrap())
        .await
        .unwrap();
}
