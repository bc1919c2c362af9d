//! Blocks that an earlier run of the job accepted and lost.

use super::*;
use beamfarm_proto::Grant;

fn lease(ledger: &mut Ledger, worker: WorkerId) -> (LeaseId, Block) {
    match ledger.lease(worker, at(0)) {
        Ok(Grant::Lease(lease, block)) => (lease, block),
        other => panic!("{other:?}"),
    }
}

fn accept(
    ledger: &mut Ledger,
    worker: WorkerId,
    (lease, block): (LeaseId, Block),
    hash: PixelHash,
) -> Result<Accepted, LedgerError> {
    ledger.accept(worker, lease, block, hash, at(0))
}

fn block(level: u32, index: u64) -> Block {
    Block { level, index }
}

/// A job of 64 passes of which the first 16 are done.
fn resumed() -> Ledger {
    let rules = Rules { passes: 64, ..RULES };
    let mut ledger = Ledger::new(rules, 0);
    let first = block(4, 0);
    ledger.resume([(first, Some((&Who::from("before"), pixels(first))), false)]);
    ledger
}

#[test]
fn lost_blocks_are_leased_as_they_were() {
    let mut ledger = resumed();
    // The first two would have other sizes otherwise; the third is a size that is never leased, the fourth overlaps,
    // the last is done.
    for lost in [block(2, 4), block(1, 11), block(5, 1), block(0, 17), block(4, 0)] {
        ledger.expect(lost, &Who::from("before"), pixels(lost));
    }
    let a = join(&mut ledger, "a");
    let leased: Vec<_> = (0..4).map(|_| lease(&mut ledger, a)).collect();
    let blocks: Vec<Block> = leased.iter().map(|(_, block)| *block).collect();
    assert_eq!(blocks, [block(2, 4), block(0, 20), block(0, 21), block(1, 11)]);
    for leased in leased {
        let hash = pixels(leased.1);
        assert_eq!(accept(&mut ledger, a, leased, hash), Ok(Accepted::New));
    }
    assert_eq!(ledger.take_notes(), []);
    assert_eq!(ledger.audits_pending(), (0, 0));
    assert!(ledger.earlier.is_empty());
}

/// A lost block is rendered with different pixels. Returns the ledger, its worker and the block.
fn differs() -> (Ledger, WorkerId, Block) {
    let mut ledger = resumed();
    let lost = block(1, 8);
    ledger.expect(lost, &Who::from("before"), [9; 32]);
    let a = join(&mut ledger, "a");
    let leased = lease(&mut ledger, a);
    assert_eq!(leased.1, lost);
    let hash = pixels(lost);
    assert_eq!(accept(&mut ledger, a, leased, hash), Ok(Accepted::New));
    let before = ledger.earlier_workers[&Who::from("before").known_by()];
    assert_eq!(ledger.take_notes(), [Note::Disputed(lost, before, a)]);
    assert_eq!(ledger.audits_pending(), (1, 1));
    (ledger, a, lost)
}

#[test]
fn who_was_convicted_before_stays_out() {
    let mut ledger = resumed();
    ledger.resume_convicted(&Who::from("liar"));
    assert_eq!(
        ledger.register("liar", 1, Some(CANARY), None, at(0)),
        Err(Sentence::Key)
    );
    join(&mut ledger, "other");
}

#[test]
fn other_pixels_than_before_are_judged_by_others() {
    let (mut ledger, a, lost) = differs();
    // Neither those who differ nor the one that shares a name with one of them.
    assert_ne!(lease(&mut ledger, a).1, lost);
    let namesake = join(&mut ledger, "before");
    let other = lease(&mut ledger, namesake);
    assert_ne!(other.1, lost);
    accept(&mut ledger, namesake, other, pixels(other.1)).unwrap();
    let judge = join(&mut ledger, "b");
    let check = lease(&mut ledger, judge);
    assert_eq!(check.1, lost);
    let hash = pixels(lost);
    assert_eq!(accept(&mut ledger, judge, check, hash), Ok(Accepted::Confirmed));
    let before = ledger.earlier_workers[&Who::from("before").known_by()];
    assert_eq!(
        ledger.take_notes(),
        [
            Note::Confirmed(lost, judge, hash),
            Note::ShutOut(before, Sentence::WrongPixels),
            Note::ShutOut(namesake, Sentence::Key)
        ]
    );
    // Its blocks from before and after go.
    assert_eq!(ledger.stained(), [block(4, 0), other.1]);
    assert_eq!(
        ledger.register("before", 1, Some(CANARY), None, at(0)),
        Err(Sentence::Key)
    );
}

#[test]
fn it_may_have_been_right_before() {
    let (mut ledger, a, lost) = differs();
    let judge = join(&mut ledger, "b");
    let check = lease(&mut ledger, judge);
    assert_eq!(check.1, lost);
    assert_eq!(accept(&mut ledger, judge, check, [9; 32]), Ok(Accepted::Confirmed));
    assert_eq!(ledger.take_notes(), [Note::ShutOut(a, Sentence::WrongPixels)]);
    assert_eq!(ledger.stained(), [lost]);
}

#[test]
fn lives_that_differ_about_what_is_there_are_judged_too() {
    let mut ledger = resumed();
    ledger.expect(block(4, 0), &Who::from("before"), pixels(block(4, 0)));
    assert_eq!(ledger.audits_pending(), (0, 0));
    ledger.expect(block(4, 0), &Who::from("long before"), [9; 32]);
    assert_eq!(ledger.audits_pending(), (1, 1));
    let a = join(&mut ledger, "a");
    let check = lease(&mut ledger, a);
    assert_eq!(check.1, block(4, 0));
    let hash = pixels(check.1);
    assert_eq!(accept(&mut ledger, a, check, hash), Ok(Accepted::Confirmed));
    assert_eq!(ledger.audits_pending(), (0, 0));
}
