//! Which worker gets what: blocks, failures, stragglers, claims, resumed jobs.

use super::*;
use beamfarm_proto::Grant;

fn block_of(grant: Result<Grant, LedgerError>) -> (LeaseId, Block) {
    match grant {
        Ok(Grant::Lease(lease, block)) => (lease, block),
        other => panic!("{other:?}"),
    }
}

fn rules(passes: u64) -> Rules {
    Rules { passes, ..RULES }
}

/// A ledger in which the passes before `first` are done, each in one second by a present worker, and taking in a block
/// takes a second too.
fn busy(first: u64, passes: u64) -> (Ledger, WorkerId) {
    let mut ledger = Ledger::new(rules(passes), 0);
    let worker = join(&mut ledger, "busy");
    for i in 0..first {
        let (lease, block) = block_of(ledger.lease(worker, at(i)));
        ledger.accept(worker, lease, block, pixels(block), at(i + 1)).unwrap();
    }
    ledger.set_intake(1.0);
    (ledger, worker)
}

#[test]
fn a_coordinator_in_a_hurry_leases_blocks() {
    let (mut ledger, worker) = busy(64, 1024);
    let now = at(65);
    let mut others = vec![worker];
    others.extend((0..3).map(|i| ledger.register(&*format!("{i}"), 1, Some(CANARY), None, now).unwrap()));
    // Four workers, each a pass a second, blocks of a second: 2^3.
    let blocks: Vec<Block> = others.iter().map(|w| block_of(ledger.lease(*w, now)).1).collect();
    let expected: Vec<Block> = (8..12).map(|index| Block { level: 3, index }).collect();
    assert_eq!(blocks, expected);
}

#[test]
fn a_block_is_done_as_a_whole() {
    let (mut ledger, worker) = busy(64, 1024);
    let (lease, block) = block_of(ledger.lease(worker, at(64)));
    assert_eq!(block, Block { level: 1, index: 32 });
    assert_eq!(
        ledger.accept(worker, lease, block, pixels(block), at(66)),
        Ok(Accepted::New)
    );
    assert_eq!((ledger.prefix(), ledger.done()), (66, 66));
    assert_eq!(ledger.block_hash(block), Some(pixels(block)));
    assert_eq!(ledger.block_hash(Block::leaf(64)), None);
}

#[test]
fn a_block_in_which_a_pass_fails_is_taken_apart() {
    let (mut ledger, bad) = busy(64, 1024);
    let now = at(64);
    let good = ledger.register("good", 1, Some(CANARY), None, now).unwrap();
    ledger.set_intake(4.0);
    let (lease, block) = block_of(ledger.lease(bad, now));
    assert_eq!(block, Block { level: 4, index: 4 });
    ledger.fail(bad, lease, 69, "NaN", now).unwrap();
    // Each gets all passes but the bad one; only a worker that has not failed gets that.
    let next = |ledger: &mut Ledger, worker| block_of(ledger.lease(worker, now)).1;
    let passes = |block: Block| block.passes();
    assert_eq!(passes(next(&mut ledger, bad)), 64..68);
    assert_eq!(passes(next(&mut ledger, bad)), 68..69);
    assert_eq!(passes(next(&mut ledger, bad)), 70..72);
    let (lease, block) = block_of(ledger.lease(good, now));
    assert_eq!(block, Block::leaf(69));
    assert_eq!(ledger.accept(good, lease, block, pixels(block), now), Ok(Accepted::New));
    assert!(ledger.failed().is_none());
}

#[test]
fn a_poison_pass_goes_to_several_workers() {
    let mut ledger = Ledger::new(rules(4), 0);
    let workers: Vec<_> = (0..4).map(|_| join(&mut ledger, "worker")).collect();
    // None of them has rendered anything: each gets its turn.
    for (i, worker) in workers.iter().enumerate() {
        assert!(ledger.failed().is_none());
        let (lease, block) = block_of(ledger.lease(*worker, at(i as u64)));
        assert_eq!(block, Block::leaf(0));
        ledger.fail(*worker, lease, 0, "NaN", at(i as u64)).unwrap();
    }
    let failure = ledger.failed().unwrap();
    assert_eq!((failure.pass_index, failure.workers), (0, 4));
    assert!(ledger.is_complete());
}

/// The word of workers that have rendered others is enough.
#[test]
fn a_poison_pass_need_not_go_to_all() {
    let mut ledger = Ledger::new(rules(8), 0);
    let workers: Vec<_> = (0..6).map(|_| join(&mut ledger, "worker")).collect();
    for worker in &workers[..3] {
        let (lease, block) = block_of(ledger.lease(*worker, at(0)));
        ledger.accept(*worker, lease, block, pixels(block), at(1)).unwrap();
    }
    for worker in &workers[..3] {
        assert!(ledger.failed().is_none());
        let (lease, block) = block_of(ledger.lease(*worker, at(1)));
        assert_eq!(block, Block::leaf(3));
        ledger.fail(*worker, lease, 3, "NaN", at(1)).unwrap();
    }
    let failure = ledger.failed().unwrap();
    assert_eq!((failure.pass_index, failure.workers), (3, 3));
}

/// The word of workers that fail at pass after pass, or whose pixels nobody confirmed, is not.
#[test]
fn who_fails_at_everything_ends_no_job() {
    for audit_every in [0, 1] {
        let rules = Rules {
            audit_every,
            ..rules(16)
        };
        let mut ledger = Ledger::new(rules, 0);
        let good = join(&mut ledger, "good");
        let bad: Vec<_> = (0..4).map(|_| join(&mut ledger, "bad")).collect();
        for (i, worker) in bad.iter().enumerate() {
            let (lease, block) = block_of(ledger.lease(*worker, at(0)));
            // With checks: wrong pixels, different for each. Without: a failure elsewhere.
            match audit_every {
                0 => {
                    ledger.accept(*worker, lease, block, pixels(block), at(1)).unwrap();
                    let (lease, block) = block_of(ledger.lease(*worker, at(1)));
                    ledger.fail(*worker, lease, block.start(), "no", at(1)).unwrap();
                }
                _ => drop(ledger.accept(*worker, lease, block, [i as u8; 32], at(1))),
            }
        }
        for worker in &bad {
            while let Ok(Grant::Lease(lease, block)) = ledger.lease(*worker, at(1)) {
                ledger.fail(*worker, lease, block.start(), "no", at(1)).unwrap();
                ledger.beat(good, [], at(1)).unwrap();
            }
        }
        assert_eq!(ledger.failed(), None, "{audit_every}");
    }
}

/// It is silent, or its heartbeats say that it is working.
#[test]
fn who_lets_leases_run_out_waits_longer_each_time() {
    let mut ledger = Ledger::new(rules(1000), 0);
    let (idle, good) = (join(&mut ledger, "idle"), join(&mut ledger, "good"));
    let mut now = at(0);
    let mut kept = None;
    for doublings in [0, 1, 2, 3, 4, 5, 6, 6] {
        for _ in 0..2 {
            kept = Some(block_of(ledger.lease(idle, now)));
        }
        now += RULES.lease;
        assert_eq!(ledger.expire(now), 2);
        let pause = RULES.lease * (1 << doublings);
        assert_eq!(ledger.ask_again(idle, now), Some(now + pause));
        assert_eq!(ledger.lease(idle, now), Ok(Grant::NotNow));
        let (lease, block) = block_of(ledger.lease(good, now));
        ledger.accept(good, lease, block, pixels(block), now).unwrap();
        now += pause;
    }
    block_of(ledger.lease(idle, now));
    now += RULES.lease;
    assert_eq!(ledger.expire(now), 1);
    // A late result is welcome, and so is its worker.
    let (lease, block) = kept.unwrap();
    ledger.accept(idle, lease, block, pixels(block), now).unwrap();
    block_of(ledger.lease(idle, now));
}

/// Neither to check what only one worker has rendered, nor to try what it failed at.
#[test]
fn a_job_does_not_wait_for_those_who_do_nothing() {
    for (gives_back, comes_again) in [(false, false), (true, false), (false, true), (true, true)] {
        let rules = Rules {
            audit_every: 1,
            ..rules(4)
        };
        let mut ledger = Ledger::new(rules, 0);
        let (mut idle, good) = (join(&mut ledger, "idle"), join(&mut ledger, "good"));
        let mut now = at(0);
        let mut has_failed = false;
        let mut rounds = 0;
        while !ledger.is_over(now) {
            rounds += 1;
            assert!(rounds < 1000, "{gives_back}, {comes_again}: {ledger:#?}");
            if comes_again {
                // As a new worker each time.
                idle = join(&mut ledger, "idle");
            }
            if let Ok(Grant::Lease(lease, block)) = ledger.lease(good, now) {
                match std::mem::replace(&mut has_failed, true) {
                    false => ledger.fail(good, lease, block.start(), "no", now).unwrap(),
                    true => drop(ledger.accept(good, lease, block, pixels(block), now + at(1)).unwrap()),
                }
            }
            if let Ok(Grant::Lease(lease, _)) = ledger.lease(idle, now) {
                match gives_back {
                    true => drop(ledger.give_back(idle, &[lease].into())),
                    false => ledger.beat(idle, [(lease, 0)], now).unwrap(),
                }
            }
            now += at(1);
            ledger.expire(now);
        }
        assert_eq!(ledger.done(), 4);
    }
}

#[test]
fn a_worker_that_fails_waits_and_is_shut_out_in_the_end() {
    let rules = Rules {
        back_off: Duration::from_secs(1),
        ..rules(100)
    };
    let mut ledger = Ledger::new(rules, 0);
    let (bad, good) = (join(&mut ledger, "bad"), join(&mut ledger, "good"));
    let mut now = at(0);
    for pause in [1, 2, 4, 8] {
        let (lease, block) = block_of(ledger.lease(bad, now));
        ledger.fail(bad, lease, block.start(), "no", now).unwrap();
        assert_eq!(ledger.lease(bad, now), Ok(Grant::NotNow));
        assert_eq!(ledger.ask_again(bad, now), Some(now + at(pause)));
        now += at(pause);
        ledger.beat(good, [], now).unwrap();
    }
    let (lease, block) = block_of(ledger.lease(bad, now));
    ledger.fail(bad, lease, block.start(), "no", now).unwrap();
    let sentence = Sentence::Failures;
    assert_eq!(ledger.take_notes(), [Note::ShutOut(bad, sentence)]);
    assert_eq!(ledger.lease(bad, now), Err(LedgerError::ShutOut(bad, sentence)));
    // The other worker gets the failed pass; a success would have restored the first.
    assert_eq!(block_of(ledger.lease(good, now)).1, Block::leaf(0));
}

#[test]
fn an_idle_worker_takes_over_what_others_take_long_for() {
    let mut ledger = Ledger::new(rules(3), 0);
    let (slow, quick) = (join(&mut ledger, "slow"), join(&mut ledger, "quick"));
    let old = block_of(ledger.lease(slow, at(0)));
    for i in 0..2 {
        let (lease, block) = block_of(ledger.lease(quick, at(i)));
        ledger.accept(quick, lease, block, pixels(block), at(i + 1)).unwrap();
    }
    // A second is usual; two are late.
    let mut early = Ledger::new(rules(1), 0);
    let (a, b) = (join(&mut early, "a"), join(&mut early, "b"));
    block_of(early.lease(a, at(0)));
    assert_eq!(early.lease(b, at(20)), Ok(Grant::NotNow));
    assert_eq!(ledger.ask_again(quick, at(2)), Some(at(2)));
    let again = block_of(ledger.lease(quick, at(2)));
    assert_eq!(again.1, old.1);
    // A third lease when the copy is late as well: two that never finish stop nobody.
    let third = join(&mut ledger, "third");
    assert_eq!(ledger.lease(third, at(3)), Ok(Grant::NotNow));
    assert_eq!(ledger.ask_again(third, at(3)), Some(at(4)));
    assert_eq!(block_of(ledger.lease(third, at(4))).1, old.1);
    assert_eq!(
        ledger.accept(quick, again.0, again.1, pixels(again.1), at(9)),
        Ok(Accepted::New)
    );
    let late = ledger.accept(slow, old.0, old.1, pixels(old.1), at(10));
    assert_eq!(late, Ok(Accepted::Confirmed));
    assert_eq!(ledger.take_notes(), [Note::Confirmed(old.1, slow, pixels(old.1))]);
}

/// Whatever its heartbeats say.
#[test]
fn a_lease_that_takes_far_too_long_ends() {
    let mut ledger = Ledger::new(rules(9), 0);
    let (hung, quick) = (join(&mut ledger, "hung"), join(&mut ledger, "quick"));
    let held = block_of(ledger.lease(hung, at(0)));
    for i in 0..2 {
        let (lease, block) = block_of(ledger.lease(quick, at(2 * i)));
        ledger
            .accept(quick, lease, block, pixels(block), at(2 * i + 2))
            .unwrap();
    }
    for now in [20, 40, 60] {
        ledger.beat(hung, [(held.0, 0)], at(now)).unwrap();
        ledger.beat(quick, [], at(now)).unwrap();
        assert_eq!(ledger.expire(at(now + 3)), 0);
    }
    // 32 times the usual two seconds per pass.
    assert_eq!(ledger.expire(at(64)), 1);
    assert_eq!(block_of(ledger.lease(quick, at(64))).1, held.1);
    // It counts when it arrives all the same.
    let late = ledger.accept(hung, held.0, held.1, pixels(held.1), at(65));
    assert_eq!(late, Ok(Accepted::New));
}

/// For example a software driver that must check many cards.
#[test]
fn a_worker_that_is_known_to_be_slow_has_its_time() {
    let mut ledger = Ledger::new(rules(1000), 0);
    let slow = join(&mut ledger, "slow");
    let first = block_of(ledger.lease(slow, at(0)));
    for i in 0..60 {
        let quick = join(&mut ledger, &format!("quick {i}"));
        let (lease, block) = block_of(ledger.lease(quick, at(0)));
        ledger.accept(quick, lease, block, pixels(block), at(1)).unwrap();
    }
    ledger.accept(slow, first.0, first.1, pixels(first.1), at(100)).unwrap();
    let held = block_of(ledger.lease(slow, at(100)));
    // 32 times the mean of the others is over long before.
    for now in (110..300).step_by(10) {
        ledger.beat(slow, [(held.0, 0)], at(now)).unwrap();
        assert_eq!(ledger.expire(at(now)), 0, "{now}");
    }
    ledger.beat(slow, [(held.0, 0)], at(100 + 32 * 100)).unwrap();
    assert_eq!(ledger.expire(at(100 + 32 * 100)), 1);
}

#[test]
fn nobody_leases_all_there_is() {
    let mut ledger = Ledger::new(rules(100), 0);
    let (greedy, other) = (join(&mut ledger, "greedy"), join(&mut ledger, "other"));
    for _ in 0..16 {
        block_of(ledger.lease(greedy, at(0)));
    }
    assert_eq!(ledger.lease(greedy, at(0)), Ok(Grant::NotNow));
    assert_eq!(block_of(ledger.lease(other, at(0))).1, Block::leaf(16));
}

/// Nor do other workers, while somebody has not tried.
#[test]
fn who_never_rendered_anything_ends_no_job() {
    let mut ledger = Ledger::new(rules(4), 0);
    let good = join(&mut ledger, "good");
    let first = block_of(ledger.lease(good, at(0)));
    for name in ["a", "b", "c", "d"] {
        let stranger = join(&mut ledger, name);
        let (lease, block) = block_of(ledger.lease(stranger, at(0)));
        assert_eq!(block, Block::leaf(1));
        ledger.fail(stranger, lease, 1, "no", at(0)).unwrap();
    }
    assert!(ledger.failed().is_none());
    ledger.accept(good, first.0, first.1, pixels(first.1), at(1)).unwrap();
    let (lease, block) = block_of(ledger.lease(good, at(1)));
    assert_eq!(block, Block::leaf(1));
    // Its word counts, once.
    ledger.fail(good, lease, 1, "no", at(1)).unwrap();
    let failure = ledger.failed().unwrap();
    assert_eq!((failure.pass_index, failure.workers), (1, 5));
}

#[test]
fn leases_that_are_given_back_are_open_at_once_and_no_failures() {
    let mut ledger = Ledger::new(rules(4), 0);
    let (leaving, other) = (join(&mut ledger, "leaving"), join(&mut ledger, "other"));
    let kept = block_of(ledger.lease(leaving, at(0)));
    let given = block_of(ledger.lease(leaving, at(0)));
    assert_eq!(ledger.give_back(other, &[given.0].into()), Ok(0));
    assert_eq!(ledger.give_back(leaving, &[given.0, LeaseId(77)].into()), Ok(1));
    assert_eq!(block_of(ledger.lease(other, at(0))).1, given.1);
    assert_eq!(ledger.lost(leaving), 1);
    assert_eq!(block_of(ledger.lease(other, at(0))).1, kept.1);
    assert!(ledger.attempts.is_empty());
}

#[test]
fn a_restarted_coordinator_takes_what_workers_hold() {
    let mut ledger = Ledger::new(rules(100), 0);
    let worker = join(&mut ledger, "worker");
    let held = Block { level: 2, index: 5 };
    let lease = ledger.claim(worker, held, at(0)).unwrap();
    assert_eq!(ledger.claim(worker, held, at(0)), None);
    for wrong in [
        Block { level: 3, index: 0 },
        Block { level: 0, index: 100 },
        Block { level: 52, index: 1 },
    ] {
        assert_eq!(ledger.claim(worker, wrong, at(0)), None);
    }
    assert_eq!(
        ledger.accept(worker, lease, held, pixels(held), at(1)),
        Ok(Accepted::New)
    );
    assert_eq!((ledger.prefix(), ledger.done()), (0, 4));
    assert_eq!(block_of(ledger.lease(worker, at(1))).1, Block::leaf(0));
}

#[test]
fn a_late_block_does_not_count_where_a_part_of_it_does() {
    let (mut ledger, slow) = busy(64, 1024);
    let old = block_of(ledger.lease(slow, at(64)));
    assert_eq!(old.1, Block { level: 1, index: 32 });
    ledger.lost(slow);
    ledger.set_intake(0.0);
    let quick = ledger.register("quick", 1, Some(CANARY), None, at(64)).unwrap();
    let part = block_of(ledger.lease(quick, at(64)));
    assert_eq!(part.1, Block::leaf(64));
    ledger.accept(quick, part.0, part.1, pixels(part.1), at(65)).unwrap();
    let late = ledger.accept(slow, old.0, old.1, pixels(old.1), at(65));
    assert_eq!(late, Ok(Accepted::NotNeeded));
    assert_eq!(block_of(ledger.lease(quick, at(65))).1, Block::leaf(65));
}

#[test]
fn a_resumed_job_goes_on_where_it_was() {
    let mut ledger = Ledger::new(rules(20), 0);
    let old = Who::from("old");
    let known = |block: Block| (block, Some((&old, pixels(block))), false);
    ledger.resume([known(Block { level: 1, index: 0 }), known(Block::leaf(2))]);
    ledger.resume_rest([Block { level: 2, index: 0 }, Block { level: 1, index: 4 }]);
    assert_eq!((ledger.prefix(), ledger.done()), (4, 6));
    let worker = join(&mut ledger, "new");
    let passes: Vec<u64> = (0..6).map(|_| granted(&mut ledger, worker, 0).1).collect();
    assert_eq!(passes, [4, 5, 6, 7, 10, 11]);
    ledger.extend(21);
    assert_eq!(ledger.limit(), 21);
    let passes: Vec<u64> = (0..9).map(|_| granted(&mut ledger, worker, 0).1).collect();
    assert_eq!(passes.last(), Some(&20));
}

#[test]
fn a_range_of_passes_begins_where_it_should() {
    let mut ledger = Ledger::new(
        Rules {
            first_pass: 10,
            ..rules(12)
        },
        0,
    );
    let worker = join(&mut ledger, "worker");
    assert_eq!(ledger.prefix(), 10);
    for pass in 10..12 {
        let leased = granted(&mut ledger, worker, 0);
        assert_eq!(leased.1, pass);
        deliver(&mut ledger, worker, leased).unwrap();
    }
    assert!(ledger.is_complete());
}

/// A worker sends heartbeats but renders no further pass.
#[test]
fn a_block_that_does_not_get_on_ends() {
    let (mut ledger, worker) = busy(64, 1024);
    ledger.set_intake(10.0);
    let (lease, block) = block_of(ledger.lease(worker, at(64)));
    assert_eq!(block.len(), 32);
    // A block that waits for the one before has not started.
    for now in (64..64 + 900).step_by(20) {
        ledger.beat(worker, [(lease, 0)], at(now)).unwrap();
        assert_eq!(ledger.expire(at(now)), 0, "{now}");
    }
    let (lease, _) = {
        ledger.lost(worker);
        block_of(ledger.lease(worker, at(1000)))
    };
    for (now, rendered) in [(1001, 1), (1030, 2), (1050, 2), (1061, 2)] {
        ledger.beat(worker, [(lease, rendered)], at(now)).unwrap();
        assert_eq!(ledger.expire(at(now)), 0, "{now}");
    }
    // 32 times the usual second after the last new pass.
    assert_eq!(ledger.expire(at(1062)), 1);
}

#[test]
fn workers_that_did_nothing_are_forgotten_when_there_are_too_many() {
    let (mut ledger, busy) = busy(4, 64);
    let mut number = 0;
    let mut crowd = |ledger: &mut Ledger, now| {
        let mut names = std::iter::repeat_with(|| {
            number += 1;
            format!("stranger {number}")
        });
        let registered = names.by_ref().map(|name| {
            let room = ledger.has_room(now);
            room.then(|| ledger.register(&*name, 1, Some(CANARY), None, now).unwrap())
        });
        registered.map_while(|worker| worker).last().unwrap()
    };
    let last = crowd(&mut ledger, at(5));
    // Present workers are not forgotten.
    assert!(!ledger.has_room(at(6)) && ledger.knows(last) && ledger.knows(busy));
    let (_, block) = block_of(ledger.lease(last, at(30)));
    let later = crowd(&mut ledger, at(50));
    assert!(ledger.knows(last) && ledger.knows(busy) && ledger.knows(later));
    assert!(!ledger.knows(WorkerId(last.0 - 1)));
    assert_eq!(block.start(), 4);
    // A status lists at most this many.
    assert!(ledger.views(at(51)).len() < 5000);
}

/// Machines that come and go, each with a pass that counts, leave room for later ones.
#[test]
fn a_long_job_may_have_had_any_number_of_workers() {
    let passes = 8_600;
    let mut ledger = Ledger::new(rules(passes), 0);
    for pass in 0..passes - 1 {
        assert!(ledger.has_room(at(pass)), "{pass}");
        let worker = ledger
            .register(&*format!("{pass}"), 1, Some(CANARY), None, at(pass))
            .unwrap();
        let (lease, block) = block_of(ledger.lease(worker, at(pass)));
        assert_eq!(block, Block::leaf(pass));
        ledger.accept(worker, lease, block, pixels(block), at(pass)).unwrap();
        ledger.lost(worker);
    }
    assert_eq!(ledger.done(), passes - 1);
}
