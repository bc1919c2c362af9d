use super::*;
use crate::store::checkpoint::tests::checkpoint;
use beamfarm_image::job::{EngineKind, JobSettings, ScheduleKind, Techniques};
use beamfarm_image::layer::Layer;

fn spec(passes: u64) -> JobSpec {
    let scene = "scene.toml".to_string();
    JobSpec {
        bundle: Bundle {
            files: [(scene.clone(), b"a".to_vec()), ("b".into(), b"b".to_vec())].into(),
            scene,
        },
        settings: JobSettings {
            seed: u64::MAX,
            alpha: 2.0 / 3.0,
            schedule: ScheduleKind::Pass,
            budget: None,
            paths_per_pass: 500,
            reference_paths: 500,
            techniques: Techniques::default(),
            engine: EngineKind::default(),
        },
        width: 5,
        height: 3,
        layers: vec![Layer::Depth, Layer::Albedo, Layer::Objects],
        first_pass: 0,
        passes,
        audit_every: 0,
    }
}

const ASKED: Asked = Asked {
    limit: true,
    restart: false,
};

fn open(path: &Path, spec: &mut JobSpec) -> Result<(Folder, Option<Resumed>), StoreError> {
    Folder::open(path, spec, Looks::default(), ASKED)
}

/// The number of passes found on opening.
fn passes(path: &Path) -> u64 {
    let (_, resumed) = open(path, &mut spec(100)).unwrap();
    resumed.map_or(0, |resumed| resumed.checkpoint.sum.passes())
}

#[test]
fn a_job_is_found_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep/a.job");
    let (mut job, resumed) = open(&path, &mut spec(8)).unwrap();
    assert!(resumed.is_none());
    // Only one opener at a time.
    let error = open(&path, &mut spec(8)).err().unwrap();
    assert!(matches!(error, StoreError::InUse(_)), "{error}");
    for n in 1..6 {
        job.save(&mut checkpoint(0..n)).unwrap();
    }
    drop(job);
    let (job, resumed) = open(&path, &mut spec(8)).unwrap();
    let resumed = resumed.unwrap();
    assert_eq!((resumed.checkpoint.number, resumed.checkpoint.sum.prefix()), (4, 5));
    assert_eq!(job.next_number, 5);
    let mut names: Vec<_> = fs::read_dir(&path)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["checkpoint-0", "checkpoint-1", JOB, LEDGER, LOCK, SCENE]);
    let file = path.join(SCENE).join(FileHash::of(b"b").to_string());
    assert_eq!(fs::read(file).unwrap(), b"b");
}

/// Jobs on processors are the same as before other engines existed. Jobs of other engines continue only with the same
/// engine.
#[test]
fn a_job_keeps_its_engine() {
    let folder = tempfile::tempdir().unwrap();
    let of = |engine| {
        let mut spec = spec(8);
        spec.settings.engine = engine;
        spec
    };
    for engine in [EngineKind::Cpu, EngineKind::Gpu] {
        let path = folder.path().join(engine.to_string());
        let (mut job, _) = open(&path, &mut of(engine)).unwrap();
        job.save(&mut checkpoint(0..5))
            .unwrap_or_else(|error| panic!("{error}"));
        drop(job);
        let text = fs::read_to_string(path.join(JOB)).unwrap();
        assert!(
            text.contains(&format!("\"engine\": \"{}\"", engine.identity())),
            "{text}"
        );
        let (description, _) = Folder::inspect(&path).unwrap();
        assert_eq!(description.settings(&path).unwrap().engine, engine);
        let (_, resumed) = open(&path, &mut of(engine)).unwrap();
        assert!(resumed.is_some());
    }
    let digest = |engine| Description::new(&of(engine), Looks::default()).digest();
    assert_ne!(digest(EngineKind::Cpu), digest(EngineKind::Gpu));
    let mut other = Description::new(&of(EngineKind::Gpu), Looks::default());
    other.engine = Some("gpu 999".into());
    let error = other.settings(folder.path()).unwrap_err().to_string();
    assert!(error.contains("the engine is \"gpu 999\"; expected cpu "), "{error}");
}

#[test]
fn another_job_is_refused_by_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(8)).unwrap();
    job.save(&mut checkpoint(0..5)).unwrap();
    drop(job);
    type Change = fn(&mut JobSpec);
    let cases: [(Change, &str); 9] = [
        (|s| s.settings.seed = 3, "seed 18446744073709551615 there, 3 here"),
        (|s| s.settings.alpha = 0.6, "alpha 0.6666666666666666 there, 0.6 here"),
        (|s| s.settings.paths_per_pass = 7, "paths per pass 500 there, 7 here"),
        (|s| s.settings.engine = EngineKind::Gpu, " there, gpu 8 here"),
        (|s| s.width = 6, "width 5 there, 6 here"),
        (
            |s| s.layers.truncate(1),
            "layers depth,albedo,crypto_object there, depth here",
        ),
        (|s| s.first_pass = 2, "first pass 0 there, 2 here"),
        (|s| s.passes = 4, "passes up to 5 there, 4 here"),
        (|s| drop(s.bundle.files.insert("b".into(), b"c".to_vec())), "scene "),
    ];
    for (change, expected) in cases {
        let mut other = spec(8);
        change(&mut other);
        let error = open(&path, &mut other).err().unwrap();
        assert!(matches!(error, StoreError::Different { .. }), "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
    // The number of passes may be raised, and the raise is remembered.
    drop(open(&path, &mut spec(9)).unwrap());
    let mut unasked = spec(3);
    drop(Folder::open(&path, &mut unasked, Looks::default(), Asked::default()).unwrap());
    assert_eq!(unasked.passes, 9);
    // Nor does a job without a limit run forever when no stopping condition is given.
    let mut endless = spec(beamfarm_image::job::MAX_PASSES);
    drop(open(&path, &mut endless).unwrap());
    for (scene, expected) in [(3, 5), (7, 7)] {
        let mut unasked = spec(scene);
        drop(Folder::open(&path, &mut unasked, Looks::default(), Asked::default()).unwrap());
        assert_eq!(unasked.passes, expected);
    }
}

/// If the scene's number of passes changes, the new number applies unless another was requested.
#[test]
fn the_scenes_number_of_passes_counts_when_it_changes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let unasked = |passes| {
        let mut spec = spec(passes);
        drop(Folder::open(&path, &mut spec, Looks::default(), Asked::default()).unwrap());
        spec.passes
    };
    assert_eq!([8, 8, 12].map(unasked), [8, 8, 12]);
    drop(open(&path, &mut spec(30)).unwrap());
    assert_eq!([12, 12, 16, 16].map(unasked), [30, 30, 16, 16]);
}

#[test]
fn another_picture_begins_anew_where_nothing_is_lost_or_somebody_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    drop(open(&path, &mut spec(8)).unwrap());
    let mut other = spec(8);
    other.bundle.files.insert("scene.toml".into(), b"c".to_vec());
    // Nothing was rendered yet.
    let (mut job, resumed) = open(&path, &mut other).unwrap();
    assert!(resumed.is_none());
    job.save(&mut checkpoint(0..5)).unwrap();
    drop(job);
    match open(&path, &mut spec(8)).err().unwrap() {
        StoreError::Different { scene, .. } => assert_eq!(scene.as_deref(), Some("c")),
        error => panic!("{error}"),
    }
    let restart = Asked { restart: true, ..ASKED };
    let (_, resumed) = Folder::open(&path, &mut spec(8), Looks::default(), restart).unwrap();
    assert!(resumed.is_none());
    assert_eq!(passes(&path), 0);
    // Damaged files are not discarded unasked.
    fs::write(path.join("checkpoint-0"), "damaged").unwrap();
    assert!(open(&path, &mut other).is_err());
    assert!(path.join("checkpoint-0").exists());
}

#[test]
fn other_folders_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("thesis.tex"), "").unwrap();
    let error = open(folder.path(), &mut spec(8)).err().unwrap();
    assert!(error.to_string().contains("no job.json, but \"thesis.tex\""), "{error}");
    assert!(!folder.path().join(LOCK).exists());
    for (json, expected) in [
        ("{", "EOF"),
        ("{\"format\":9}", "format 9; this version of beamfarm, "),
        ("{\"format\":1}", "missing field"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(JOB), json).unwrap();
        let error = open(folder.path(), &mut spec(8)).err().unwrap();
        assert!(error.to_string().contains(expected), "{error}");
    }
}

/// Killed between any two steps of creating the directory.
#[test]
fn half_made_directories_are_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    drop(open(&path, &mut spec(8)).unwrap());
    fs::remove_file(path.join(JOB)).unwrap();
    drop(open(&path, &mut spec(8)).unwrap());
    fs::remove_file(path.join(JOB)).unwrap();
    fs::remove_file(path.join(LEDGER)).unwrap();
    let scene = path.join(SCENE).join(FileHash::of(b"b").to_string());
    fs::remove_file(&scene).unwrap();
    drop(open(&path, &mut spec(8)).unwrap());
    assert!(path.join(JOB).exists() && scene.exists());
}

#[test]
fn a_damaged_checkpoint_gives_way_to_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    for n in 1..4 {
        job.save(&mut checkpoint(0..n)).unwrap();
    }
    drop(job);
    // Number 0, with one pass, was overwritten by number 2, with three.
    let [even, odd] = CHECKPOINTS.map(|name| path.join(name));
    let good = fs::read(&even).unwrap();
    assert_eq!(passes(&path), 3);
    let damage = |bytes: &mut Vec<u8>| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
    };
    let mut bad = good.clone();
    damage(&mut bad);
    fs::write(&even, &bad).unwrap();
    assert_eq!(passes(&path), 2);
    fs::write(&even, &good[..good.len() - 1]).unwrap();
    assert_eq!(passes(&path), 2);
    fs::write(&even, b"").unwrap();
    assert_eq!(passes(&path), 2);
    // The next one overwrites the damaged one.
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    job.save(&mut checkpoint(0..6)).unwrap();
    drop(job);
    assert_eq!(passes(&path), 6);
    for file in [&even, &odd] {
        let mut bytes = fs::read(file).unwrap();
        damage(&mut bytes);
        fs::write(file, bytes).unwrap();
    }
    assert_eq!(passes(&path), 0);
}

/// A half-written file next to the checkpoints changes nothing, and the next one replaces it.
#[test]
fn what_was_being_written_when_the_power_went_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    job.save(&mut checkpoint(0..2)).unwrap();
    fs::write(path.join("checkpoint-1.part"), b"half").unwrap();
    drop(job);
    assert_eq!(passes(&path), 2);
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    job.save(&mut checkpoint(0..3)).unwrap();
    assert!(!path.join("checkpoint-1.part").exists());
    drop(job);
    assert_eq!(passes(&path), 3);
}

/// A failed write leaves both checkpoints as they were.
#[test]
fn a_failed_checkpoint_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    job.save(&mut checkpoint(0..2)).unwrap();
    // A folder blocks the next one.
    let part = path.join("checkpoint-1.part");
    fs::create_dir(&part).unwrap();
    let error = job.save(&mut checkpoint(0..3)).unwrap_err();
    assert!(error.to_string().contains("checkpoint-1"), "{error}");
    assert_eq!(job.next_number, 1);
    fs::remove_dir(&part).unwrap();
    job.save(&mut checkpoint(0..3)).unwrap();
    drop(job);
    assert_eq!(passes(&path), 3);
}

/// Partial files are removed; files of others are left alone.
#[test]
fn what_was_being_written_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    drop(open(&path, &mut spec(8)).unwrap());
    let names = ["checkpoint-0.part", ".beamfarm-a", "scene/.beamfarm-b"];
    let gone = names.map(|name| path.join(name));
    let stays = ["notes.part", "scene/notes"].map(|name| path.join(name));
    for file in gone.iter().chain(&stays) {
        fs::write(file, "half").unwrap();
    }
    drop(open(&path, &mut spec(8)).unwrap());
    assert!(!gone.iter().any(|file| file.exists()));
    assert!(stays.iter().all(|file| file.exists()));
}

#[test]
fn a_checkpoint_that_cannot_be_read_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    job.save(&mut checkpoint(0..2)).unwrap();
    drop(job);
    // Opens, but cannot be read even by root.
    fs::create_dir(path.join("checkpoint-1")).unwrap();
    let error = open(&path, &mut spec(100)).err().unwrap();
    assert!(matches!(error, StoreError::Io { .. }), "{error}");
    assert!(error.to_string().contains("checkpoint-1"), "{error}");
    fs::remove_dir(path.join("checkpoint-1")).unwrap();
    assert_eq!(passes(&path), 2);
}

fn entry(pass: u64, state: crate::EntryState) -> Entry {
    Entry {
        time: std::time::SystemTime::now(),
        block: Block::leaf(pass),
        state,
        worker: "a".into(),
        radius_scale: 1.0,
        hash: Some([pass as u8; 32]),
        took: std::time::Duration::ZERO,
        message: None,
    }
}

/// Killed between the verdict on a worker and the next checkpoint.
#[test]
fn wrong_passes_do_not_come_back_from_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(100)).unwrap();
    let (done, dropped) = (crate::EntryState::Done, crate::EntryState::Dropped);
    for pass in [0, 1, 2, 3, 4] {
        job.enter(&entry(pass, done));
    }
    // A verdict that the first checkpoint includes.
    job.enter(&entry(4, dropped));
    job.enter(&entry(4, done));
    job.save(&mut Checkpoint {
        ledger: job.ledger_end(),
        ..checkpoint(0..5)
    })
    .unwrap();
    let found = |path: &Path| {
        let (_, resumed) = open(path, &mut spec(100)).unwrap();
        let Resumed { checkpoint, done, .. } = resumed.unwrap();
        let done: Vec<u64> = done.iter().map(|done| done.block.start()).collect();
        (checkpoint.sum.passes(), checkpoint.sum.prefix(), done)
    };
    job.enter(&entry(3, dropped));
    job.append().unwrap();
    drop(job);
    let (passes, prefix, known) = found(&path);
    // Whatever was summed with pass 3 goes with it; pass 4 stays, whether or not the prefix reaches it.
    assert!(prefix <= 3 && passes < 5, "{prefix} {passes}");
    assert_eq!(known, [0, 1, 2, 4]);
    // The line is torn: the verdict was never announced.
    let ledger = path.join(LEDGER);
    let bytes = fs::read(&ledger).unwrap();
    fs::write(&ledger, &bytes[..bytes.len() - 1]).unwrap();
    assert_eq!(found(&path), (5, 5, vec![0, 1, 2, 3, 4]));
}

/// Without a checkpoint, rendered blocks can still be compared.
#[test]
fn lines_without_a_checkpoint_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.job");
    let (mut job, _) = open(&path, &mut spec(8)).unwrap();
    job.enter(&entry(3, crate::EntryState::Done));
    job.append().unwrap();
    drop(job);
    let (job, resumed) = open(&path, &mut spec(8)).unwrap();
    let resumed = resumed.unwrap();
    assert_eq!(resumed.checkpoint.sum.passes(), 0);
    assert_eq!(resumed.done[0].hash, [3; 32]);
    assert_eq!(job.next_number, 0);
}

/// The owner of the folder may have put anything there: no file of others is written, and nothing blocks.
#[cfg(target_os = "linux")]
#[test]
fn links_and_pipes_in_a_foreign_folder_are_refused() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let private = folder.path().join("private");
    let whole = folder.path().join("whole.job");
    let (mut job, _) = open(&whole, &mut spec(8)).unwrap();
    job.save(&mut checkpoint(0..3)).unwrap();
    drop(job);
    // Each by its name, in place of a file that exists or is still to be written.
    let part = format!("checkpoint-1.{PART}");
    for name in [JOB, LEDGER, LOCK, "checkpoint-0", "checkpoint-1", &part] {
        for kind in ["link", "pipe", "zero", "folder"] {
            let path = folder.path().join(format!("{name}-{kind}.job"));
            fs::create_dir(&path).unwrap();
            fs::create_dir(path.join(SCENE)).unwrap();
            for from in [whole.clone(), whole.join(SCENE)] {
                for entry in fs::read_dir(&from).unwrap().map(Result::unwrap) {
                    let way = entry.path();
                    let to = path.join(way.strip_prefix(&whole).unwrap());
                    if way.is_file() {
                        fs::copy(&way, to).unwrap();
                    }
                }
            }
            let own = path.join(name);
            let _ = fs::remove_file(&own);
            fs::write(&private, "nobody's business\nof a coordinator").unwrap();
            match kind {
                "link" => symlink(&private, &own).unwrap(),
                "zero" => symlink("/dev/zero", &own).unwrap(),
                "pipe" => {
                    // Not by a child process: it would hold other tests' locks until it starts.
                    let (kind, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::RUSR);
                    rustix::fs::mknodat(rustix::fs::CWD, &own, kind, mode, 0).unwrap();
                }
                _ => fs::create_dir(&own).unwrap(),
            }
            let opened = open(&path, &mut spec(8));
            match opened {
                Err(error) => assert!(error.to_string().contains(name), "{name}, {kind}: {error}"),
                // A checkpoint is renamed over whatever is there, or the other one is used.
                Ok((mut job, _)) => {
                    assert!(
                        name.starts_with("checkpoint") && kind != "zero" || name == part,
                        "{name}, {kind}"
                    );
                    let _ = job.save(&mut checkpoint(0..4));
                    let _ = job.save(&mut checkpoint(0..5));
                }
            }
            let text = fs::read_to_string(&private).unwrap();
            assert_eq!(text, "nobody's business\nof a coordinator", "{name}, {kind}");
        }
    }
}
