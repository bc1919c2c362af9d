use super::*;
use proptest::prelude::*;

const RULES: Rules = Rules {
    passes: 4,
    lease: Duration::from_secs(30),
    failures_per_pass: 3,
    refusals_per_worker: 2,
};

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn pixels(pass_index: u64) -> PixelHash {
    *blake3::hash(&pass_index.to_le_bytes()).as_bytes()
}

fn granted(ledger: &mut Ledger, worker: WorkerId, now: u64) -> (LeaseId, u64) {
    match ledger.lease(worker, at(now)).unwrap() {
        Grant::Lease(lease, block) => (lease, block.start()),
        other => panic!("{other:?}"),
    }
}

fn deliver(
    ledger: &mut Ledger,
    worker: WorkerId,
    (lease, pass): (LeaseId, u64),
) -> Result<Accepted, LedgerError> {
    ledger.accept(worker, lease, Block::leaf(pass), pixels(pass))
}

#[test]
fn passes_are_handed_out_lowest_first() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (ledger.register(), ledger.register());
    let first = granted(&mut ledger, a, 0);
    assert_eq!(first.1, 0);
    assert_eq!(granted(&mut ledger, b, 0).1, 1);
    ledger.lost(a);
    assert_eq!(granted(&mut ledger, b, 1).1, 0);
    assert_eq!(granted(&mut ledger, b, 1).1, 2);
    assert_eq!(granted(&mut ledger, b, 1).1, 3);
    assert_eq!(ledger.lease(b, at(1)), Ok(Grant::NotNow));
}

#[test]
fn the_prefix_waits_for_the_gap() {
    let mut ledger = Ledger::new(RULES, 0);
    let worker = ledger.register();
    let leases: Vec<_> = (0..4).map(|_| granted(&mut ledger, worker, 0)).collect();
    for i in [1, 3, 2] {
        assert_eq!(deliver(&mut ledger, worker, leases[i]), Ok(Accepted::New));
        assert_eq!(ledger.prefix(), 0);
    }
    assert_eq!(deliver(&mut ledger, worker, leases[0]), Ok(Accepted::New));
    assert_eq!(ledger.prefix(), 4);
    assert!(ledger.is_complete());
    assert_eq!(ledger.lease(worker, at(1)), Ok(Grant::Done));
}

#[test]
fn a_lease_ends_unless_a_heartbeat_names_it() {
    let mut ledger = Ledger::new(RULES, 0);
    let (slow, other) = (ledger.register(), ledger.register());
    let kept = granted(&mut ledger, slow, 0);
    let forgotten = granted(&mut ledger, slow, 0);
    ledger.beat(slow, [kept.0], at(20)).unwrap();
    assert_eq!(ledger.expire(at(29)), 0);
    assert_eq!(ledger.expire(at(30)), 1);
    assert_eq!(granted(&mut ledger, other, 31).1, forgotten.1);
    assert_eq!(ledger.expire(at(50)), 1);
    assert_eq!(granted(&mut ledger, other, 50).1, kept.1);
}

#[test]
fn a_heartbeat_extends_only_leases_of_its_sender() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (ledger.register(), ledger.register());
    let lease = granted(&mut ledger, a, 0);
    ledger.beat(b, [lease.0, LeaseId(99)], at(20)).unwrap();
    assert_eq!(ledger.expire(at(30)), 1);
}

#[test]
fn late_results_count_and_later_ones_are_duplicates() {
    let mut ledger = Ledger::new(RULES, 0);
    let (slow, quick) = (ledger.register(), ledger.register());
    let old = granted(&mut ledger, slow, 0);
    ledger.expire(at(30));
    let new = granted(&mut ledger, quick, 30);
    assert_eq!(old.1, new.1);
    assert_eq!(deliver(&mut ledger, slow, old), Ok(Accepted::New));
    // The second lease is over: its end puts nothing back.
    assert_eq!(ledger.lost(quick), 0);
    assert_eq!(granted(&mut ledger, quick, 31).1, 1);
    assert_eq!(deliver(&mut ledger, quick, new), Ok(Accepted::Duplicate));
    assert_eq!(ledger.done(), 1);
}

#[test]
fn other_bits_for_the_same_pass_are_an_error() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (ledger.register(), ledger.register());
    let first = granted(&mut ledger, a, 0);
    ledger.lost(a);
    let second = granted(&mut ledger, b, 0);
    deliver(&mut ledger, a, first).unwrap();
    let block = Block::leaf(0);
    let divergent = ledger.accept(b, second.0, block, [1; 32]);
    let expected = LedgerError::Divergent {
        block,
        first: a,
        second: b,
    };
    assert_eq!(divergent, Err(expected));
    assert_eq!(ledger.pixel_hash(0), Some(pixels(0)));
}

#[test]
fn results_without_a_lease_are_refused() {
    let mut ledger = Ledger::new(RULES, 7);
    let (a, b) = (ledger.register(), ledger.register());
    let (lease, pass) = granted(&mut ledger, a, 0);
    let block = Block::leaf(pass);
    let stranger = WorkerId(1);
    assert_eq!(
        ledger.check(stranger, lease, block),
        Err(LedgerError::UnknownWorker(stranger))
    );
    for (worker, lease, block) in [
        (b, lease, block),
        (a, LeaseId(1), block),
        (a, LeaseId(u64::MAX), block),
        (a, lease, Block::leaf(1)),
        (a, lease, Block { level: 1, index: 0 }),
    ] {
        let refused = ledger.accept(worker, lease, block, pixels(0));
        assert!(matches!(refused, Err(LedgerError::NotLeased { .. })));
    }
    assert_eq!(ledger.done(), 0);
}

#[test]
fn a_pass_that_keeps_failing_ends_the_job_before_it() {
    let mut ledger = Ledger::new(RULES, 0);
    let worker = ledger.register();
    let zero = granted(&mut ledger, worker, 0);
    let mut one = granted(&mut ledger, worker, 0);
    let two = granted(&mut ledger, worker, 0);
    for attempt in 1..=3 {
        assert_eq!(one.1, 1);
        assert!(ledger.failed().is_none());
        let block = Block::leaf(1);
        // Said twice, as when the reply got lost, it counts once.
        for _ in 0..2 {
            let message = "2 pixels are NaN";
            ledger.fail(worker, one.0, block, message).unwrap();
        }
        if attempt < 3 {
            one = granted(&mut ledger, worker, 0);
        }
    }
    let failure = ledger.failed().unwrap().clone();
    assert_eq!((failure.pass_index, failure.attempts), (1, 3));
    assert_eq!(ledger.limit(), 1);
    assert_eq!(ledger.lease(worker, at(0)), Ok(Grant::NotNow));
    assert_eq!(deliver(&mut ledger, worker, two), Ok(Accepted::NotNeeded));
    assert_eq!(deliver(&mut ledger, worker, zero), Ok(Accepted::New));
    assert!(ledger.is_complete());
}

#[test]
fn a_worker_that_sends_rubbish_is_shut_out_and_its_pass_goes_elsewhere() {
    let mut ledger = Ledger::new(RULES, 0);
    let (bad, good) = (ledger.register(), ledger.register());
    for _ in 0..2 {
        let (lease, pass) = granted(&mut ledger, bad, 0);
        assert_eq!(pass, 0);
        ledger.refuse(bad, lease, Block::leaf(pass));
    }
    assert_eq!(ledger.lease(bad, at(0)), Err(LedgerError::ShutOut(bad)));
    assert_eq!(granted(&mut ledger, good, 0).1, 0);
}

/// What can happen to a farm.
#[derive(Clone, Debug)]
enum Event {
    Lease { worker: usize },
    Deliver { which: usize },
    DeliverTwice { which: usize },
    Fail { which: usize },
    Refuse { which: usize },
    Beat { worker: usize },
    Lost { worker: usize },
    Wait { seconds: u64 },
}

fn event() -> impl Strategy<Value = Event> {
    let worker = 0..4usize;
    let which = any::<usize>();
    prop_oneof![
        6 => worker.clone().prop_map(|worker| Event::Lease { worker }),
        6 => which.prop_map(|which| Event::Deliver { which }),
        1 => which.prop_map(|which| Event::DeliverTwice { which }),
        1 => which.prop_map(|which| Event::Fail { which }),
        1 => which.prop_map(|which| Event::Refuse { which }),
        2 => worker.clone().prop_map(|worker| Event::Beat { worker }),
        1 => worker.prop_map(|worker| Event::Lost { worker }),
        2 => (0..40u64).prop_map(|seconds| Event::Wait { seconds }),
    ]
}

proptest! {
    /// Whatever happens, no pass is lost, none counts twice, the prefix has no gap, and a worker that stays finishes the
    /// job.
    #[test]
    fn no_pass_is_lost_and_none_counts_twice(
        passes in 1..20u64,
        events in prop::collection::vec(event(), 0..200),
    ) {
        let rules = Rules { passes, failures_per_pass: u32::MAX, refusals_per_worker: u32::MAX, ..RULES };
        let mut ledger = Ledger::new(rules, 100);
        let workers: Vec<_> = (0..4).map(|_| ledger.register()).collect();
        let mut now = Duration::ZERO;
        let mut held: Vec<(WorkerId, LeaseId, u64)> = Vec::new();
        let mut counted = BTreeSet::new();
        let mut accept = |ledger: &mut Ledger, (worker, lease, pass): (WorkerId, LeaseId, u64)| {
            let accepted = deliver(ledger, worker, (lease, pass)).unwrap();
            // New if and only if it is the first of its pass.
            assert_eq!(accepted == Accepted::New, counted.insert(pass));
        };
        for event in events {
            match event {
                Event::Lease { worker } => {
                    if let Grant::Lease(lease, block) = ledger.lease(workers[worker], now).unwrap() {
                        prop_assert!(block.start() < passes);
                        prop_assert!(ledger.pixel_hash(block.start()).is_none());
                        held.push((workers[worker], lease, block.start()));
                    }
                }
                Event::Deliver { which } | Event::DeliverTwice { which } if !held.is_empty() => {
                    let result = held[which % held.len()];
                    accept(&mut ledger, result);
                    if matches!(event, Event::Deliver { .. }) {
                        held.swap_remove(which % held.len());
                    }
                }
                Event::Fail { which } if !held.is_empty() => {
                    let (worker, lease, pass) = held.swap_remove(which % held.len());
                    ledger.fail(worker, lease, Block::leaf(pass), "no").unwrap();
                }
                Event::Refuse { which } if !held.is_empty() => {
                    let (worker, lease, pass) = held.swap_remove(which % held.len());
                    ledger.refuse(worker, lease, Block::leaf(pass));
                }
                Event::Beat { worker } => {
                    let own = held.iter().filter(|h| h.0 == workers[worker]).map(|h| h.1);
                    ledger.beat(workers[worker], own, now).unwrap();
                }
                Event::Lost { worker } => {
                    ledger.lost(workers[worker]);
                }
                Event::Wait { seconds } => {
                    now += at(seconds);
                    ledger.expire(now);
                }
                _ => {}
            }
            let gap = (0..).find(|p| ledger.pixel_hash(*p).is_none()).unwrap();
            prop_assert_eq!(ledger.prefix(), gap);
        }
        // Everyone but a newcomer vanishes.
        now += rules.lease;
        let last = ledger.register();
        loop {
            match ledger.lease(last, now).unwrap() {
                Grant::Lease(lease, block) => accept(&mut ledger, (last, lease, block.start())),
                Grant::NotNow => prop_assert!(false, "a pass is lost"),
                Grant::Done => break,
            }
        }
        prop_assert_eq!(ledger.prefix(), passes);
        prop_assert_eq!(ledger.done(), passes);
        prop_assert_eq!(ledger.accepted_per_worker().map(|w| w.1).sum::<u64>(), passes);
    }

    /// A pass that fails for good ends the job before it, however the others arrive.
    #[test]
    fn a_failed_pass_leaves_the_prefix_before_it(passes in 1..12u64, bad in 0..12u64, order in any::<u64>()) {
        let bad = bad % passes;
        let mut ledger = Ledger::new(Rules { passes, ..RULES }, 0);
        let worker = ledger.register();
        let mut held = Vec::new();
        let mut step = order;
        loop {
            let grant = ledger.lease(worker, Duration::ZERO).unwrap();
            if let Grant::Lease(lease, block) = grant {
                held.push((lease, block.start()));
            }
            step = step.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if held.is_empty() {
                prop_assert_eq!(grant, Grant::Done);
                break;
            }
            if step >> 63 == 0 && matches!(grant, Grant::Lease(..)) {
                continue;
            }
            let (lease, pass) = held.swap_remove((step >> 33) as usize % held.len());
            if pass == bad {
                ledger.fail(worker, lease, Block::leaf(pass), "no").unwrap();
            } else {
                deliver(&mut ledger, worker, (lease, pass)).unwrap();
            }
        }
        prop_assert_eq!(ledger.prefix(), bad);
        prop_assert_eq!(ledger.failed().map(|f| f.pass_index), Some(bad));
    }
}
