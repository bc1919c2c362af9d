use super::*;
use crate::examine::Claim;
use crate::store::{Asked, Looks};
use crate::{JobSpec, Start, Timing};
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{BlockMeta, encode_block};
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, EngineKind, JobSettings, PassStats, ScheduleKind, Techniques};
use beamfarm_image::merge::Node;
use beamfarm_image::radius::Schedule;
use beamfarm_proto::{FileHash, Grant, VERSION, WorkerId};
use std::path::Path;
use tokio::sync::mpsc::unbounded_channel;

fn spec() -> JobSpec {
    let scene = "scene.toml".to_string();
    JobSpec {
        bundle: Bundle {
            files: [(scene.clone(), b"a".to_vec())].into(),
            scene,
        },
        settings: JobSettings {
            seed: 1,
            alpha: 0.7,
            schedule: ScheduleKind::Pass,
            budget: None,
            paths_per_pass: 500,
            reference_paths: 500,
            techniques: Techniques::default(),
            engine: EngineKind::default(),
        },
        width: 2,
        height: 1,
        layers: Vec::new(),
        first_pass: 0,
        passes: 1,
        audit_every: 1,
    }
}

/// Deliver what is leased, with pixels of this value.
async fn deliver(farm: &Farm, worker: WorkerId, value: f32) {
    let Ok(Grant::Lease(lease, block)) = farm.lease(worker).await else {
        panic!("nothing is leased");
    };
    let film = Film {
        pixels: vec![[value; 3]; 2],
        ..Film::new(2, 1)
    };
    let settings = farm.job().settings;
    let meta = BlockMeta {
        scene: farm.job().scene,
        block,
        seed: settings.seed,
        alpha: settings.alpha,
        radius_scale: Schedule::new(&settings).scale(block.start()),
        version: VERSION.into(),
        engine: settings.engine,
    };
    let bytes = encode_block(&Node::leaf(block.start(), film), &meta, &[]).unwrap();
    let claim = Claim {
        worker,
        lease,
        block,
        size: bytes.len() as u64,
        hash: FileHash::of(&bytes),
        stats: PassStats::default(),
    };
    farm.submit(&claim, &bytes).unwrap();
}

/// What a coordinator that starts now would find.
fn found(path: &Path) -> f32 {
    let (_, checkpoint) = Folder::inspect(path).unwrap();
    let sum = checkpoint.unwrap().sum;
    let first = sum.nodes().next().unwrap();
    assert_eq!(first.block, Block::leaf(0));
    first.sum.pixels[0][0]
}

/// The number of passes is unchanged but the pixels differ: a wrong pass was dropped and rendered again between checks.
#[tokio::test]
async fn a_sum_whose_passes_were_replaced_is_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.job");
    let (folder, _) = Folder::open(&path, &mut spec(), Looks::default(), Asked::default()).unwrap();
    let (sender, entries) = unbounded_channel();
    let start = Start {
        entries: Some(sender),
        ..Start::default()
    };
    let farm = Farm::new(spec(), Timing::default(), start);
    let [liar, a, b] = ["liar", "a", "b"].map(|name| farm.register(name.into(), 1, Some([1; 32]), None).unwrap());
    let mut work = Work::new(folder, farm.clone(), entries, true);
    deliver(&farm, liar, 2.0).await;
    work.save().unwrap();
    deliver(&farm, a, 1.0).await;
    deliver(&farm, b, 1.0).await;
    assert_eq!(farm.progress().dropped, 1);
    deliver(&farm, a, 1.0).await;
    assert_eq!(farm.progress().passes, 1);
    work.finish().unwrap();
    drop(work);
    assert_eq!(found(&path), 1.0);
}
