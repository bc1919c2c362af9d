//! Workers that compute wrong bits.

use super::*;
use beamfarm_proto::{Device, Grant, Identity};

const AUDITS: Rules = Rules {
    audit_every: 1,
    ..RULES
};

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

/// The first worker's block is checked by the second, whose result differs, and then by the third.
fn disputed(first: PixelHash, second: PixelHash) -> (Ledger, [WorkerId; 3], (LeaseId, Block)) {
    let mut ledger = Ledger::new(AUDITS, 0);
    let workers = ["a", "b", "c"].map(|name| join(&mut ledger, name));
    let [a, b, c] = workers;
    let leased = lease(&mut ledger, a);
    assert_eq!(accept(&mut ledger, a, leased, first), Ok(Accepted::New));
    let check = lease(&mut ledger, b);
    assert_eq!(check.1, leased.1);
    assert_eq!(accept(&mut ledger, b, check, second), Ok(Accepted::Disputed));
    assert_eq!(ledger.take_notes(), [Note::Disputed(leased.1, a, b)]);
    assert_eq!(ledger.audits_pending(), (1, 1));
    let check = lease(&mut ledger, c);
    assert_eq!(check.1, leased.1);
    (ledger, workers, check)
}

#[test]
fn a_worker_does_not_check_itself() {
    let mut ledger = Ledger::new(AUDITS, 0);
    let worker = join(&mut ledger, "a");
    for pass in 0..4 {
        let leased = lease(&mut ledger, worker);
        assert_eq!(leased.1, Block::leaf(pass));
        accept(&mut ledger, worker, leased, pixels(leased.1)).unwrap();
    }
    // With one worker the job may end.
    assert!(ledger.is_over(at(0)));
    assert_eq!(ledger.audits_pending(), (4, 0));
    let mut ledger = Ledger::new(AUDITS, 0);
    let (a, b) = (join(&mut ledger, "a"), join(&mut ledger, "b"));
    for _ in 0..4 {
        let leased = lease(&mut ledger, a);
        accept(&mut ledger, a, leased, pixels(leased.1)).unwrap();
    }
    assert!(ledger.is_complete() && !ledger.is_over(at(0)));
    for _ in 0..4 {
        let leased = lease(&mut ledger, b);
        assert_eq!(
            accept(&mut ledger, b, leased, pixels(leased.1)),
            Ok(Accepted::Confirmed)
        );
    }
    assert!(ledger.is_over(at(0)));
    let views = ledger.views(at(0));
    assert_eq!((views[0].passes, views[0].audits_passed), (4, 4));
}

/// A worker of another job of the coordinator may be called to check the blocks of a lone worker, and is waited for as
/// a newcomer is.
#[test]
fn workers_of_other_jobs_are_waited_for() {
    let crew = Arc::new(Crew::default());
    let own = |name: &str| Who {
        name: name.into(),
        key: Some(
            Identity::from_bytes(blake3::hash(name.as_bytes()).as_bytes())
                .unwrap()
                .fingerprint(),
        ),
    };
    let key = |name: &str| own(name).key.unwrap();
    let done = || {
        let mut ledger = Ledger::new(AUDITS, 0);
        ledger.join(crew.clone());
        let alone = ledger.register(own("alone"), 1, Some(CANARY), None, at(0)).unwrap();
        for _ in 0..4 {
            let leased = lease(&mut ledger, alone);
            accept(&mut ledger, alone, leased, pixels(leased.1)).unwrap();
        }
        ledger
    };
    // The worker itself is no judge.
    crew.seen(key("alone"));
    assert!(done().is_over(at(0)));
    crew.seen(key("other"));
    let mut ledger = done();
    assert!(!ledger.is_over(at(29)) && ledger.is_over(at(30)));
    // It comes.
    let other = ledger.register(own("other"), 1, Some(CANARY), None, at(1)).unwrap();
    for _ in 0..4 {
        let leased = lease(&mut ledger, other);
        assert_eq!(
            accept(&mut ledger, other, leased, pixels(leased.1)),
            Ok(Accepted::Confirmed)
        );
    }
    assert!(ledger.is_over(at(1)));
    // Or it has left, or lied elsewhere.
    crew.left(key("other"));
    assert!(done().is_over(at(0)));
    crew.seen(key("liar"));
    let mut ledger = done();
    assert!(!ledger.is_over(at(0)));
    let liar = ledger.register(own("liar"), 1, Some(CANARY), None, at(1)).unwrap();
    ledger.lost(liar);
    ledger.convict_key(key("liar"));
    assert!(ledger.is_over(at(1)));
}

/// Two of the three honest workers failed to render the block when it was only to be checked.
#[test]
fn who_failed_to_check_may_still_decide() {
    let mut ledger = Ledger::new(AUDITS, 0);
    let workers = ["liar", "b", "c", "d"].map(|name| join(&mut ledger, name));
    let [liar, b, c, d] = workers;
    let leased = lease(&mut ledger, liar);
    assert_eq!(accept(&mut ledger, liar, leased, [3; 32]), Ok(Accepted::New));
    for worker in [b, c] {
        let (lease, block) = lease(&mut ledger, worker);
        assert_eq!(block, leased.1);
        ledger.fail(worker, lease, 0, "no memory", at(0)).unwrap();
        // Not again, unless others disagree.
        assert_ne!(self::lease(&mut ledger, worker).1, block);
    }
    let right = pixels(leased.1);
    let check = lease(&mut ledger, d);
    assert_eq!(check.1, leased.1);
    assert_eq!(accept(&mut ledger, d, check, right), Ok(Accepted::Disputed));
    let check = lease(&mut ledger, b);
    assert_eq!(check.1, leased.1);
    assert_eq!(accept(&mut ledger, b, check, right), Ok(Accepted::Confirmed));
    assert_eq!(ledger.stained(), [leased.1]);
}

#[test]
fn an_auditor_that_leaves_does_not_hold_the_job_up() {
    let mut ledger = Ledger::new(AUDITS, 0);
    let (a, b) = (join(&mut ledger, "a"), join(&mut ledger, "b"));
    for _ in 0..4 {
        let leased = lease(&mut ledger, a);
        accept(&mut ledger, a, leased, pixels(leased.1)).unwrap();
    }
    lease(&mut ledger, b);
    assert!(!ledger.is_over(at(0)));
    ledger.lost(b);
    assert!(ledger.is_over(at(0)));
}

/// Whatever its heartbeats say: a block that it is late with goes to others as well, once to each.
#[test]
fn an_auditor_that_does_not_get_on_does_not_hold_the_job_up() {
    let mut ledger = Ledger::new(Rules { passes: 1, ..AUDITS }, 0);
    let [a, honest] = ["a", "honest"].map(|name| join(&mut ledger, name));
    let keepers = ["one", "two", "three"].map(|name| join(&mut ledger, name));
    let (first, block) = lease(&mut ledger, a);
    let vote = ledger.accept(a, first, block, pixels(block), at(1));
    assert_eq!(vote, Ok(Accepted::New));
    // A second is usual: the first copy after two, the second after four.
    let mut kept = Vec::new();
    for (keeper, now) in keepers.into_iter().zip([1, 3, 5]) {
        assert_eq!(ledger.lease(a, at(now)), Ok(Grant::NotNow), "its own");
        let (lease, pass) = granted(&mut ledger, keeper, now);
        assert_eq!(pass, 0);
        kept.push((keeper, lease));
        for (keeper, lease) in &kept {
            ledger.beat(*keeper, [(*lease, 0)], at(now)).unwrap();
            assert_eq!(ledger.lease(*keeper, at(now)), Ok(Grant::NotNow));
        }
    }
    assert_eq!(ledger.ask_again(honest, at(5)), Some(at(9)));
    let (lease, _) = granted(&mut ledger, honest, 9);
    let vote = ledger.accept(honest, lease, block, pixels(block), at(10));
    assert_eq!(vote, Ok(Accepted::Confirmed));
    assert!(ledger.is_over(at(10)));
    // The late result confirms the block, and nobody holds it any more.
    let (keeper, lease) = kept[0];
    let late = ledger.accept(keeper, lease, block, pixels(block), at(11));
    assert_eq!(late, Ok(Accepted::Duplicate));
    assert_eq!(ledger.expire(at(1000)), 0);
}

#[test]
fn a_third_worker_decides_against_the_first() {
    let good = pixels(Block::leaf(0));
    let (mut ledger, [a, b, c], check) = disputed([9; 32], good);
    // The liar's other blocks go as well.
    assert_eq!(accept(&mut ledger, c, check, good), Ok(Accepted::Confirmed));
    assert_eq!(ledger.take_notes(), [Note::ShutOut(a, Sentence::WrongPixels)]);
    assert_eq!(ledger.stained(), [Block::leaf(0)]);
    assert!(!ledger.is_over(at(0)));
    let dropped = ledger.reopen(&[Block::leaf(0)]);
    assert_eq!(dropped.len(), 1);
    assert_eq!((ledger.done(), ledger.prefix()), (0, 0));
    assert_eq!(lease(&mut ledger, b).1, Block::leaf(0));
    let shut_out = Err(LedgerError::ShutOut(a, Sentence::WrongPixels));
    assert_eq!(ledger.lease(a, at(0)), shut_out);
    // It cannot come back under its name.
    assert_eq!(ledger.register("a", 1, Some(CANARY), None, at(0)), Err(Sentence::Key));
}

#[test]
fn a_third_worker_decides_against_the_second() {
    let good = pixels(Block::leaf(0));
    let (mut ledger, [a, b, c], check) = disputed(good, [9; 32]);
    assert_eq!(accept(&mut ledger, c, check, good), Ok(Accepted::Confirmed));
    let notes = ledger.take_notes();
    let sentence = Sentence::WrongPixels;
    assert_eq!(
        notes,
        [Note::Confirmed(Block::leaf(0), c, good), Note::ShutOut(b, sentence)]
    );
    assert!(ledger.stained().is_empty());
    assert_eq!(ledger.views(at(0))[0].audits_passed, 1);
    assert_eq!(ledger.lease(b, at(0)), Err(LedgerError::ShutOut(b, sentence)));
    assert!(matches!(ledger.lease(a, at(0)), Ok(Grant::Lease(..))));
}

#[test]
fn the_third_may_be_the_liar_or_a_second_one() {
    let good = pixels(Block::leaf(0));
    let (mut ledger, [a, b, c], check) = disputed([8; 32], good);
    assert_eq!(accept(&mut ledger, c, check, [9; 32]), Ok(Accepted::Disputed));
    let d = join(&mut ledger, "d");
    let check = lease(&mut ledger, d);
    assert_eq!(accept(&mut ledger, d, check, good), Ok(Accepted::Confirmed));
    let out: Vec<_> = [a, b, c, d].map(|w| ledger.check(w, LeaseId(0), Block::leaf(9))).into();
    let is_out: Vec<bool> = out.iter().map(|r| matches!(r, Err(LedgerError::ShutOut(..)))).collect();
    assert_eq!(is_out, [true, false, true, false]);
}

#[test]
fn a_dispute_that_nobody_can_decide_ends_with_patience() {
    let mut ledger = Ledger::new(Rules { passes: 1, ..AUDITS }, 0);
    let (a, b) = (join(&mut ledger, "a"), join(&mut ledger, "b"));
    let leased = lease(&mut ledger, a);
    accept(&mut ledger, a, leased, [8; 32]).unwrap();
    let check = lease(&mut ledger, b);
    accept(&mut ledger, b, check, [9; 32]).unwrap();
    assert!(!ledger.is_over(at(29)));
    assert!(ledger.is_over(at(30)));
    assert_eq!(ledger.audits_pending(), (1, 1));
}

#[test]
fn a_worker_that_contradicts_itself_is_out() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (join(&mut ledger, "a"), join(&mut ledger, "b"));
    let leased = lease(&mut ledger, a);
    accept(&mut ledger, a, leased, [8; 32]).unwrap();
    let sentence = Sentence::Contradiction;
    assert_eq!(
        accept(&mut ledger, a, leased, [9; 32]),
        Err(LedgerError::ShutOut(a, sentence))
    );
    assert_eq!(ledger.stained(), [Block::leaf(0)]);
    ledger.reopen(&[Block::leaf(0)]);
    assert_eq!(lease(&mut ledger, b).1, Block::leaf(0));
}

#[test]
fn what_was_confirmed_stays() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (join(&mut ledger, "a"), join(&mut ledger, "b"));
    let zero = lease(&mut ledger, a);
    ledger.lost(a);
    let again = lease(&mut ledger, b);
    accept(&mut ledger, a, zero, pixels(zero.1)).unwrap();
    assert_eq!(accept(&mut ledger, b, again, pixels(zero.1)), Ok(Accepted::Confirmed));
    let one = lease(&mut ledger, a);
    accept(&mut ledger, a, one, pixels(one.1)).unwrap();
    ledger.convict(a, Sentence::WrongPixels);
    assert_eq!(ledger.stained(), [Block::leaf(1)]);
    // The sum holds passes 0 and 1 in one node: both go.
    assert_eq!(ledger.reopen(&[Block { level: 1, index: 0 }]).len(), 2);
    assert_eq!(lease(&mut ledger, b).1, Block::leaf(0));
}

#[test]
fn the_share_of_audits_is_what_was_asked_for() {
    let ledger = Ledger::new(
        Rules {
            audit_every: 64,
            ..RULES
        },
        0,
    );
    let drawn = (0..64_000).filter(|i| ledger.is_drawn(Block::leaf(*i))).count();
    // Binomial: mean 1000, standard deviation 31.4; within four of them.
    assert!((875..1125).contains(&drawn), "{drawn}");
    let other = Ledger::new(
        Rules {
            audit_every: 64,
            audit_salt: [1; 32],
            ..RULES
        },
        0,
    );
    assert!((0..64_000).any(|i| {
        let block = Block::leaf(i);
        ledger.is_drawn(block) != other.is_drawn(block)
    }));
    assert!(!(0..1000).any(|i| Ledger::new(RULES, 0).is_drawn(Block::leaf(i))));
}

/// However few are drawn: two blocks of each worker, none of them by the worker itself.
#[test]
fn first_blocks_are_checked() {
    let rules = Rules {
        passes: 8,
        audit_every: u64::MAX,
        ..RULES
    };
    let mut ledger = Ledger::new(rules, 0);
    for name in ["a", "b"] {
        let worker = join(&mut ledger, name);
        for i in 0..3 {
            let mut leased = lease(&mut ledger, worker);
            while ledger.is_to_be_checked(leased.1) {
                // From the worker before.
                assert_eq!(
                    accept(&mut ledger, worker, leased, pixels(leased.1)),
                    Ok(Accepted::Confirmed)
                );
                leased = lease(&mut ledger, worker);
            }
            assert_eq!(accept(&mut ledger, worker, leased, pixels(leased.1)), Ok(Accepted::New));
            assert_eq!(ledger.is_to_be_checked(leased.1), i < 2);
        }
    }
    // Without checks there are none.
    let mut ledger = Ledger::new(RULES, 0);
    let worker = join(&mut ledger, "a");
    let leased = lease(&mut ledger, worker);
    assert_eq!(accept(&mut ledger, worker, leased, pixels(leased.1)), Ok(Accepted::New));
    assert!(!ledger.is_to_be_checked(leased.1));
}

/// A worker that lies from its first pass on leaves nothing behind next to two honest ones, in any order of turns.
#[test]
fn liars_leave_nothing_behind_in_short_jobs() {
    for order in 0..27 {
        let rules = Rules {
            passes: 16,
            audit_every: 64,
            ..RULES
        };
        let mut ledger = Ledger::new(rules, 0);
        let workers = ["a", "b", "liar"].map(|name| join(&mut ledger, name));
        let mut sum = BTreeMap::new();
        for turn in 0..1000 {
            let worker = match turn {
                0..3 => workers[order / 3usize.pow(turn) % 3],
                _ => workers[turn as usize % 3],
            };
            let Ok(Grant::Lease(id, block)) = ledger.lease(worker, at(0)) else {
                continue;
            };
            let mut hash = pixels(block);
            hash[0] ^= u8::from(worker == workers[2]);
            if accept(&mut ledger, worker, (id, block), hash) == Ok(Accepted::New) {
                sum.insert(block, hash);
            }
            let stained = ledger.stained().to_vec();
            if !stained.is_empty() {
                ledger.reopen(&stained);
                sum.retain(|block, _| !stained.contains(block));
            }
        }
        assert!(ledger.is_over(at(0)), "{order}");
        assert_eq!(sum.len(), 16);
        assert!(sum.iter().all(|(block, hash)| *hash == pixels(*block)), "{order}");
    }
}

fn with_device(ledger: &mut Ledger, name: &str, [device, driver]: [&str; 2]) -> WorkerId {
    let device = Device {
        name: device.into(),
        kind: "discrete".into(),
        driver: driver.into(),
        memory: None,
    };
    let registered = ledger.register(name, 1, Some(CANARY), Some(device), at(0));
    registered.unwrap()
}

#[test]
fn devices_are_checked_by_those_of_other_makers() {
    const KINDS: [[&str; 2]; 3] = [["Card", "A 1"], ["Card", "A 1"], ["Other Card", "A 1"]];
    let mut ledger = Ledger::new(AUDITS, 0);
    let [a, same, other] = ["a", "same", "other"].map(|name| {
        let i = ["a", "same", "other"].iter().position(|one| *one == name).unwrap_or(0);
        with_device(&mut ledger, name, KINDS[i])
    });
    let first = lease(&mut ledger, a);
    accept(&mut ledger, a, first, pixels(first.1)).unwrap();
    // It is left to the other kind of card, and this one continues with the job.
    assert_eq!(lease(&mut ledger, same).1, Block::leaf(1));
    let maker = with_device(&mut ledger, "maker", ["llvmpipe", "Mesa 25"]);
    assert_eq!(lease(&mut ledger, other).1, Block::leaf(2));
    assert_eq!(lease(&mut ledger, maker).1, first.1);

    // A worker that is absent, or does not fetch the block, is not waited for.
    let mut ledger = Ledger::new(AUDITS, 0);
    let a = with_device(&mut ledger, "a", KINDS[0]);
    let same = with_device(&mut ledger, "same", KINDS[1]);
    let maker = with_device(&mut ledger, "maker", ["llvmpipe", "Mesa 25"]);
    let first = lease(&mut ledger, a);
    accept(&mut ledger, a, first, pixels(first.1)).unwrap();
    let own = lease(&mut ledger, same);
    assert_eq!(own.1, Block::leaf(1));
    let later = at(AUDITS.lease.as_secs());
    accept(&mut ledger, same, own, pixels(own.1)).unwrap();
    ledger.beat(maker, [], later).unwrap();
    assert!(matches!(ledger.lease(same, later), Ok(Grant::Lease(_, block)) if block == first.1));
    // A dispute goes to whoever comes first.
    let mut ledger = Ledger::new(AUDITS, 0);
    let a = with_device(&mut ledger, "a", KINDS[0]);
    let maker = with_device(&mut ledger, "maker", ["llvmpipe", "Mesa 25"]);
    let same = with_device(&mut ledger, "same", KINDS[1]);
    with_device(&mut ledger, "another maker", ["llvmpipe", "Mesa 26"]);
    let first = lease(&mut ledger, a);
    accept(&mut ledger, a, first, [7; 32]).unwrap();
    let check = lease(&mut ledger, maker);
    assert_eq!(
        accept(&mut ledger, maker, check, pixels(check.1)),
        Ok(Accepted::Disputed)
    );
    assert_eq!(lease(&mut ledger, same).1, first.1);
}

#[test]
fn where_nothing_is_checked_no_test_picture_is_needed() {
    let mut ledger = Ledger::new(RULES, 0);
    assert!(!ledger.asks_for_canary());
    let worker = ledger.register("a", 1, None, None, at(0)).unwrap();
    ledger.register("b", 1, Some([2; 32]), None, at(0)).unwrap();
    assert_eq!(
        ledger.register("c", 1, Some([3; 32]), None, at(0)),
        Err(Sentence::Canary)
    );
    assert_eq!(lease(&mut ledger, worker).1, Block::leaf(0));
    assert!(Ledger::new(AUDITS, 0).asks_for_canary());
}

#[test]
fn test_pictures_of_proven_workers_count() {
    let mut ledger = Ledger::new(AUDITS, 0);
    let add = |ledger: &mut Ledger, name: &str, canary: u8| ledger.register(name, 1, Some([canary; 32]), None, at(0));
    // Nobody knows yet who is right.
    let odd = add(&mut ledger, "odd", 1).unwrap();
    let (a, b) = (add(&mut ledger, "a", 2).unwrap(), add(&mut ledger, "b", 2).unwrap());
    let wrong = lease(&mut ledger, odd);
    let leased = lease(&mut ledger, a);
    accept(&mut ledger, a, leased, pixels(leased.1)).unwrap();
    let check = lease(&mut ledger, b);
    assert_eq!(check.1, leased.1);
    assert_eq!(accept(&mut ledger, b, check, pixels(check.1)), Ok(Accepted::Confirmed));
    let shut_out = LedgerError::ShutOut(odd, Sentence::Canary);
    assert_eq!(ledger.lease(odd, at(0)), Err(shut_out));
    assert_eq!(accept(&mut ledger, odd, wrong, [7; 32]), Err(shut_out));
    // Any number of workers with another picture: they have no vote.
    for name in ["c", "d", "e", "f"] {
        assert_eq!(add(&mut ledger, name, 1), Err(Sentence::Canary));
    }
    assert!(ledger.stained().is_empty());
    assert_eq!(lease(&mut ledger, a).1, wrong.1);
    add(&mut ledger, "g", 2).unwrap();
}

#[test]
fn where_nothing_is_checked_the_first_test_picture_counts() {
    let mut ledger = Ledger::new(RULES, 0);
    let mut add = |name: &str, canary: u8| ledger.register(name, 1, Some([canary; 32]), None, at(0));
    add("a", 1).unwrap();
    for name in ["b", "c", "d"] {
        assert_eq!(add(name, 2), Err(Sentence::Canary));
    }
    add("e", 1).unwrap();
}
