//! Every fuzz target on its seeds and on mutations of them: nothing panics, nothing takes more memory than its input
//! allows, nothing takes long. Bounded and the same in every run; for an open-ended search use `tests/fuzz`.

#![allow(clippy::unwrap_used)]

use beamfarm_harness::fuzz::{TARGETS, Target, farm, layers, mutate};
use beamfarm_harness::render::is_long;
use rand_pcg::Pcg32;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::time::{Duration, Instant};

/// Mutations of a target's seeds in all: where tests may take long, and otherwise.
const MUTATIONS: [usize; 2] = [3000, 1000];
/// Memory in bytes that a reader may hold: this, or `PER_BYTE` times its input if that is more.
const ALLOWED: usize = 256 << 20;
/// For images, in which a few bytes may fill any area with one colour: 2^24 pixels and their alpha.
const ALLOWED_PACKED: usize = 512 << 20;
/// For sparse volumes, whose tiles and empty bricks take almost nothing in the file: the size of 2^26 bricks.
const ALLOWED_SPARSE: usize = 2 << 30;
const PER_BYTE: usize = 64;
/// Time that one input may take: far more than any needs.
const PATIENCE: Duration = Duration::from_secs(10);

/// Counts the memory that a thread holds.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(change: isize) {
    // A thread that is ending has no cells any more.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + change);
        let _ = MOST.try_with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: everything is left to the system's allocator; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Seeds by name, in that order.
fn seeds(target: &Target) -> Vec<(String, Vec<u8>)> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = tests.join("fuzz/seeds").join(target.name);
    // Volumes have test data elsewhere.
    let volumes = matches!(target.name, "vdb" | "vol").then(|| tests.join("data/volumes"));
    let mut seeds = Vec::new();
    for folder in [Some(own), volumes].into_iter().flatten() {
        let Ok(entries) = std::fs::read_dir(folder) else {
            continue;
        };
        for path in entries.map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if !name.ends_with("md") && (!path.starts_with(tests.join("data")) || name.ends_with(target.name)) {
                seeds.push((name, std::fs::read(path).unwrap()));
            }
        }
    }
    seeds.sort();
    assert!(!seeds.is_empty(), "{} has no seeds", target.name);
    seeds
}

/// Names the input if the reader panics.
struct Naming<'a>(&'a str, &'a [u8]);

impl Drop for Naming<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let file = std::env::temp_dir().join(format!("beamfarm-fuzz-{}", self.0));
            let written = std::fs::write(&file, self.1);
            eprintln!("by {} (kept in {}: {written:?})", self.0, file.display());
        }
    }
}

fn run(target: &Target, name: &str, input: &[u8]) {
    let name = format!("{}-{name}", target.name);
    let naming = Naming(&name, input);
    let before = HELD.get();
    MOST.set(before);
    let begun = Instant::now();
    (target.run)(input);
    let (taken, held) = (begun.elapsed(), (MOST.get() - before) as usize);
    let allowed = match target.name {
        "vdb" => ALLOWED_SPARSE,
        "gltf" | "ktx2" | "webp" => ALLOWED_PACKED,
        _ => ALLOWED.max(PER_BYTE * input.len()),
    };
    assert!(held <= allowed, "{held} bytes held; {allowed} allowed");
    assert!(taken < PATIENCE, "took {taken:?}");
    drop(naming);
}

fn run_all(name: &str) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let seeds = seeds(target);
    let mutations = MUTATIONS[usize::from(!is_long())];
    for (i, (name, seed)) in seeds.iter().enumerate() {
        run(target, name, seed);
        let (_, other) = &seeds[(i + 1) % seeds.len()];
        for mutation in 0..mutations.div_ceil(seeds.len()) as u64 {
            let mut random = Pcg32::new(mutation, i as u64);
            let input = mutate(seed, other, &mut random);
            run(target, &format!("{mutation}-{name}"), &input);
        }
    }
}

macro_rules! targets {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            run_all(stringify!($name));
        })*

        #[test]
        fn every_target_is_run() {
            let run = [$(stringify!($name)),*];
            for target in TARGETS {
                assert!(run.contains(&target.name), "{}", target.name);
                let body = format!("fuzz/fuzz_targets/{}.rs", target.name);
                assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(body).exists(), "{}", target.name);
            }
        }
    };
}

targets! { block control exr give_back gltf hdr jpeg ktx2 mitsuba obj ply png scene submit vdb vol webp wire }

/// Without deliveries that are accepted, mutations would get nowhere.
#[test]
fn good_deliveries_are_taken() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/submit");
    for name in ["open", "sealed"] {
        let seed = std::fs::read(folder.join(name)).unwrap();
        assert!(
            farm::submitted(&seed),
            "{name} is refused: of another version? The test write_seeds writes it again"
        );
    }
}

/// Makes the seeds of formats that only this project or a library writes.
#[test]
#[ignore = "writes files"]
fn write_seeds() {
    use beamfarm_image::exr::{BlockMeta, encode_block};
    use beamfarm_image::film::Film;
    use beamfarm_image::job::{Block, EngineKind, JobSettings, PassStats, SceneHash, ScheduleKind, Techniques};
    use beamfarm_image::merge::Node;
    use beamfarm_proto::{WireHash, wire};
    use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
    use prost::Message;

    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).unwrap();

    let leaf = |pass: u64| {
        let mut film = Film::new(5, 4);
        for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
            *value = (i as f32 + pass as f32) / 8.0;
        }
        Node::leaf(pass, film).with_radius_scale(0.25)
    };
    let pair = Node::join(leaf(12), leaf(13)).unwrap();
    let mut depth = leaf(12).sum;
    depth.pixels.iter_mut().for_each(|p| *p = [p[0], 0.0, 0.0]);
    let light = leaf(3).sum;
    let layered = leaf(12).with_layers(vec![depth, light]);
    for (name, node, layers) in [
        ("leaf", leaf(12), &[][..]),
        ("pair", pair, &[]),
        ("layers", layered, &layers()),
    ] {
        let meta = BlockMeta {
            scene: SceneHash([7; 32]),
            block: node.block,
            seed: 3,
            alpha: 0.5,
            radius_scale: 0.25,
            version: "0.1.0".into(),
            engine: EngineKind::default(),
        };
        let bytes = encode_block(&node, &meta, layers).unwrap();
        write(&format!("block/{name}.exr"), &bytes);
        write(&format!("exr/block_{name}.exr"), &bytes);
    }

    let pixels = SpecificChannels::rgb(|p: exr::prelude::Vec2<usize>| (p.x() as f32 / 4.0, p.y() as f32 / 4.0, 1f32));
    let tiled = Encoding {
        blocks: exr::prelude::Blocks::Tiles(exr::prelude::Vec2(4, 4)),
        ..Encoding::FAST_LOSSLESS
    };
    for (name, encoding) in [
        ("rle", Encoding::FAST_LOSSLESS),
        ("zip", Encoding::SMALL_LOSSLESS),
        ("piz", Encoding::SMALL_FAST_LOSSLESS),
        ("tiles", tiled),
    ] {
        let layer = Layer::new((9, 7), LayerAttributes::named("picture"), encoding, pixels.clone());
        let mut bytes = Vec::new();
        Image::from_layer(layer)
            .write()
            .to_buffered(std::io::Cursor::new(&mut bytes))
            .unwrap();
        write(&format!("exr/{name}.exr"), &bytes);
    }

    let entry = |path: &str| wire::FileEntry {
        path: path.into(),
        hash: SceneHash([1; 32]).to_wire(),
        size: 3,
    };
    let settings = JobSettings {
        seed: 9,
        alpha: 0.7,
        schedule: ScheduleKind::Beam,
        budget: None,
        paths_per_pass: 5,
        reference_paths: 6,
        techniques: Techniques::default(),
        engine: EngineKind::default(),
    };
    let block = Block { level: 3, index: 9 };
    let message = |name: &str, kind: u8, message: Vec<u8>| {
        write(&format!("wire/{name}"), &[vec![kind], message].concat());
    };
    let register = wire::RegisterReply {
        protocol: beamfarm_proto::PROTOCOL,
        worker: 5,
        number: 1,
        job: Some(wire::Job {
            scene: SceneHash([2; 32]).to_wire(),
            manifest: Some(wire::Manifest {
                scene: "b.toml".into(),
                files: vec![entry("%2E%2E/a.ply"), entry("b.toml")],
            }),
            settings: Some(settings.into()),
            width: 5,
            height: 4,
            layers: layers().iter().map(|layer| layer.to_string()).collect(),
        }),
        heartbeat_ms: 100,
        in_series: false,
        untested: false,
        leases: vec![wire::Lease {
            lease: 4,
            block: Some(block.into()),
        }],
    };
    message("register", 0, register.encode_to_vec());
    let lease = beamfarm_proto::Grant::Lease(beamfarm_proto::LeaseId(4), block);
    message("lease", 1, wire::LeaseReply::from(lease).encode_to_vec());
    let header = wire::SubmitHeader {
        worker: 5,
        lease: 4,
        block: Some(block.into()),
        size: 1000,
        hash: SceneHash([3; 32]).to_wire(),
        stats: Some(PassStats::default().into()),
    };
    let submit = wire::SubmitRequest {
        part: Some(wire::submit_request::Part::Header(header)),
    };
    message("submit", 2, submit.encode_to_vec());
    let heartbeat = wire::Heartbeat {
        worker: 5,
        leases: vec![1, 2, 300],
        rendered: vec![0, 1, 2],
    };
    message("heartbeat", 3, heartbeat.encode_to_vec());
    for (target, name, bytes) in farm::seeds() {
        write(&format!("{target}/{name}"), &bytes);
    }
}
