use super::*;
use std::time::{Duration, SystemTime};

fn entry(block: Block, state: EntryState, hash: u8) -> Entry {
    Entry {
        time: SystemTime::now(),
        block,
        state,
        worker: "a \"name\"\n".into(),
        radius_scale: 0.5,
        hash: Some([hash; 32]),
        took: Duration::from_millis(1500),
        message: None,
    }
}

fn leaf(pass: u64) -> Block {
    Block::leaf(pass)
}

#[test]
fn a_line_a_block_and_a_torn_one_is_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ledger.jsonl");
    let mut lines = Lines::open(&path, 11).unwrap();
    let pair = Block { level: 1, index: 1 };
    for entry in [
        entry(leaf(0), EntryState::Done, 1),
        entry(leaf(1), EntryState::Failed, 0),
        entry(leaf(1), EntryState::Done, 2),
        entry(leaf(0), EntryState::Audited, 1),
        entry(pair, EntryState::Done, 3),
        entry(leaf(4), EntryState::Done, 4),
        entry(leaf(4), EntryState::Dropped, 4),
        entry(leaf(5), EntryState::Done, 5),
    ] {
        lines.push(&entry);
    }
    lines.sync().unwrap();
    let whole = std::fs::read(&path).unwrap();
    let text = String::from_utf8(whole.clone()).unwrap();
    assert_eq!(text.lines().count(), 8);
    let first: serde_json::Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(first["block"], serde_json::json!([0, 0]));
    assert_eq!(first["seed"], 11);
    assert_eq!(first["state"], "done");
    assert_eq!(first["seconds"], 1.5);

    let last = text.trim_end().rfind('\n').unwrap() + 1;
    for end in last + 1..whole.len() {
        std::fs::write(&path, &whole[..end]).unwrap();
        let mut lines = Lines::open(&path, 11).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), whole[..last]);
        // The next line is whole again.
        lines.push(&entry(leaf(5), EntryState::Done, 5));
        lines.append().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 8);
    }

    let done = lines.done().unwrap();
    let found: Vec<(Block, u8, bool)> = done.iter().map(|d| (d.block, d.hash[0], d.audited)).collect();
    assert_eq!(
        found,
        [
            (leaf(0), 1, true),
            (leaf(1), 2, false),
            (pair, 3, false),
            (leaf(5), 5, false)
        ]
    );
    assert_eq!(done[0].worker, "a \"name\"\n".into());
    // After the line itself there is no mention of it.
    assert_eq!(lines.dropped(0).unwrap(), [leaf(4)]);
    assert_eq!(lines.dropped(last as u64).unwrap(), []);
    assert_eq!(lines.dropped(1 << 40).unwrap(), []);
}

/// Disagreements between runs of the job are reported, unless they were decided.
#[test]
fn other_pixels_for_the_same_block_are_not_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = Lines::open(&folder.path().join("ledger.jsonl"), 0).unwrap();
    for pass in 0..3 {
        lines.push(&entry(leaf(pass), EntryState::Done, 1));
        lines.push(&entry(leaf(pass), EntryState::Done, 1));
        lines.push(&entry(leaf(pass), EntryState::Done, 2));
    }
    lines.push(&entry(leaf(1), EntryState::Audited, 2));
    lines.push(&entry(leaf(2), EntryState::Dropped, 2));
    lines.append().unwrap();
    let done = lines.done().unwrap();
    let found: Vec<_> = done.iter().map(|d| (d.block.start(), d.hash[0], d.audited)).collect();
    assert_eq!(found, [(0, 2, false), (1, 2, true), (0, 1, false)]);
}

#[test]
fn of_overlapping_blocks_the_last_counts() {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = Lines::open(&folder.path().join("ledger.jsonl"), 0).unwrap();
    let quad = Block { level: 2, index: 0 };
    lines.push(&entry(quad, EntryState::Done, 1));
    lines.push(&entry(leaf(2), EntryState::Done, 2));
    lines.push(&entry(leaf(7), EntryState::Done, 2));
    lines.push(&entry(Block { level: 2, index: 1 }, EntryState::Done, 3));
    lines.append().unwrap();
    let done = lines.done().unwrap();
    let found: Vec<u8> = done.iter().map(|d| d.hash[0]).collect();
    assert_eq!(found, [2, 3]);
}

#[test]
fn foreign_lines_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ledger.jsonl");
    std::fs::write(&path, "{}\nnonsense\n\n{\"block\":[60,1]}\n\u{0}\n").unwrap();
    let mut lines = Lines::open(&path, 0).unwrap();
    lines.push(&entry(leaf(0), EntryState::Done, 1));
    lines.append().unwrap();
    assert_eq!(lines.done().unwrap().len(), 1);
}

#[test]
fn damaged_lines_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ledger.jsonl");
    let mut lines = Lines::open(&path, 0).unwrap();
    for pass in 0..3 {
        lines.push(&entry(leaf(pass), EntryState::Done, 1));
    }
    lines.push(&entry(leaf(0), EntryState::ShutOut, 0));
    lines.append().unwrap();
    assert_eq!(lines.convicted().unwrap(), [Who::from("a \"name\"\n")]);
    let whole = std::fs::read(&path).unwrap();
    let second = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let end = second + whole[second..].iter().position(|byte| *byte == b'\n').unwrap();
    for at in second..end {
        // Also if it is still valid JSON.
        for flip in [1, 2, 16] {
            let mut damaged = whole.clone();
            damaged[at] ^= flip;
            std::fs::write(&path, &damaged).unwrap();
            let lines = Lines::open(&path, 0).unwrap();
            let known: Vec<u64> = lines.done().unwrap().iter().map(|d| d.block.start()).collect();
            assert_eq!(known, [0, 2], "byte {at}");
            assert_eq!(
                lines.each(0, |_, _, _| {}).unwrap().len(),
                1 + usize::from(damaged[at] == b'\n')
            );
        }
    }
    // Nor is a line about a worker.
    let third = whole.len() - 60;
    let mut damaged = whole.clone();
    damaged[third] ^= 1;
    std::fs::write(&path, &damaged).unwrap();
    assert!(Lines::open(&path, 0).unwrap().convicted().unwrap().is_empty());
}

/// Two workers with the same name are told apart by their keys.
#[test]
fn workers_are_known_by_their_keys() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ledger.jsonl");
    let [honest, liar] = [1, 2].map(|byte| Who {
        name: "node0".into(),
        key: beamfarm_proto::Identity::from_bytes(&[byte; 32]).map(|identity| identity.fingerprint()),
    });
    let by = |who: &Who, entry: Entry| Entry {
        worker: who.clone(),
        ..entry
    };
    let mut lines = Lines::open(&path, 0).unwrap();
    lines.push(&by(&honest, entry(leaf(0), EntryState::Done, 1)));
    lines.push(&by(&liar, entry(leaf(1), EntryState::Done, 1)));
    lines.push(&by(&liar, entry(leaf(0), EntryState::ShutOut, 0)));
    lines.append().unwrap();
    let lines = Lines::open(&path, 0).unwrap();
    let workers: Vec<Who> = lines.done().unwrap().into_iter().map(|done| done.worker).collect();
    assert_eq!(workers, [honest, liar.clone()]);
    assert_eq!(lines.convicted().unwrap(), [liar]);
}

/// Dropped blocks stay out even if the lines are damaged or come from a build without checksums.
#[test]
fn what_was_dropped_does_not_come_back_for_want_of_a_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ledger.jsonl");
    let mut lines = Lines::open(&path, 0).unwrap();
    lines.push(&entry(leaf(0), EntryState::Done, 1));
    lines.push(&entry(leaf(0), EntryState::Dropped, 1));
    lines.append().unwrap();
    let whole = std::fs::read_to_string(&path).unwrap();
    let (first, last) = whole.trim_end().rsplit_once('\n').unwrap();
    let unchecked = format!("{}}}", &last[..last.find(",\"check\"").unwrap()]);
    for last in [unchecked.as_str(), &last.replace("\"seconds\":1.5", "\"seconds\":1.6")] {
        std::fs::write(&path, format!("{first}\n{last}\n")).unwrap();
        let lines = Lines::open(&path, 0).unwrap();
        assert_eq!(lines.each(0, |_, _, _| {}).unwrap(), [2]);
        assert_eq!(lines.dropped(0).unwrap(), [leaf(0)]);
        assert!(lines.done().unwrap().is_empty());
    }
}

/// A disk that accepts nothing, or loses what it had accepted: all lines are there as soon as it works again.
#[test]
fn what_a_disk_lost_is_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ledger.jsonl");
    let mut lines = Lines::open(&path, 11).unwrap();
    for pass in 0..3 {
        lines.push(&entry(leaf(pass), EntryState::Done, 1));
    }
    lines.sync().unwrap();
    let synced = std::fs::read(&path).unwrap();
    lines.push(&entry(leaf(3), EntryState::Done, 1));
    lines.append().unwrap();
    let all = std::fs::read(&path).unwrap();
    // The open file can no longer be written, as on a file system that is gone.
    let dead = || File::open(&path).unwrap();
    for left in [&synced, &all] {
        lines.file = dead();
        std::fs::write(&path, left).unwrap();
        lines.push(&entry(leaf(4), EntryState::Failed, 1));
        let end = lines.end();
        lines.append().unwrap_err();
        assert_eq!(lines.end(), end);
        lines.append().unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), end);
    }
    lines.sync().unwrap();
    let passes: Vec<Block> = lines.done().unwrap().iter().map(|done| done.block).collect();
    assert_eq!(passes, [leaf(0), leaf(1), leaf(2), leaf(3)]);
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text.lines().count(), 6);
    assert_eq!(lines.end(), text.len() as u64);

    // A different file in its place is not overwritten.
    std::fs::write(&path, &synced).unwrap();
    lines.file = dead();
    lines.push(&entry(leaf(5), EntryState::Done, 1));
    lines.append().unwrap_err();
    let error = lines.append().unwrap_err().to_string();
    assert!(error.contains("less than the"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), synced);
}
