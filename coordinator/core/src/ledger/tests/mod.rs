use super::*;
use beamfarm_proto::Grant;

mod audits;
mod earlier;
mod interleavings;
mod shares;

const RULES: Rules = Rules {
    first_pass: 0,
    passes: 4,
    lease: Duration::from_secs(30),
    failures_per_pass: 3,
    failures_per_worker: 5,
    refusals_per_worker: 2,
    back_off: Duration::ZERO,
    audit_every: 0,
    audit_salt: [0; 32],
};

const CANARY: PixelHash = [1; 32];

fn join(ledger: &mut Ledger, name: &str) -> WorkerId {
    ledger.register(name, 1, Some(CANARY), None, Duration::ZERO).unwrap()
}

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// A block's pixels as every honest worker renders them.
fn pixels(block: Block) -> PixelHash {
    let numbers = [block.start().to_le_bytes(), block.len().to_le_bytes()];
    *blake3::hash(&numbers.concat()).as_bytes()
}

fn granted(ledger: &mut Ledger, worker: WorkerId, now: u64) -> (LeaseId, u64) {
    match ledger.lease(worker, at(now)).unwrap() {
        Grant::Lease(lease, block) => (lease, block.start()),
        other => panic!("{other:?}"),
    }
}

fn deliver(ledger: &mut Ledger, worker: WorkerId, (lease, pass): (LeaseId, u64)) -> Result<Accepted, LedgerError> {
    let (block, now) = (Block::leaf(pass), Duration::ZERO);
    ledger.accept(worker, lease, block, pixels(block), now)
}

#[test]
fn passes_are_handed_out_lowest_first() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
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
    let worker = join(&mut ledger, "worker");
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
    let (slow, other) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
    let kept = granted(&mut ledger, slow, 0);
    let forgotten = granted(&mut ledger, slow, 0);
    ledger.beat(slow, [(kept.0, 0)], at(20)).unwrap();
    assert_eq!(ledger.expire(at(29)), 0);
    assert_eq!(ledger.expire(at(30)), 1);
    assert_eq!(granted(&mut ledger, other, 31).1, forgotten.1);
    assert_eq!(ledger.expire(at(50)), 1);
    assert_eq!(granted(&mut ledger, other, 50).1, kept.1);
}

#[test]
fn a_heartbeat_extends_only_leases_of_its_sender() {
    let mut ledger = Ledger::new(RULES, 0);
    let (a, b) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
    let lease = granted(&mut ledger, a, 0);
    ledger.beat(b, [(lease.0, 0), (LeaseId(99), 0)], at(20)).unwrap();
    assert_eq!(ledger.expire(at(30)), 1);
}

#[test]
fn who_hangs_up_is_gone_unless_a_stream_of_its_is_open() {
    let mut ledger = Ledger::new(RULES, 0);
    let (early, there) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
    granted(&mut ledger, early, 0);
    ledger.attend(there, at(0)).unwrap();
    granted(&mut ledger, there, 0);
    assert_eq!(ledger.hung_up(there), None);
    assert_eq!(ledger.hung_up(early), Some(1));
    assert_eq!(ledger.hung_up(early), None);
    assert!(ledger.has_company());
    assert_eq!(ledger.detach(there), 1);
    assert!(!ledger.has_company());
    // It comes over another connection.
    ledger.attend(early, at(1)).unwrap();
    assert!(ledger.has_company());
}

#[test]
fn late_results_count_and_later_ones_are_duplicates() {
    let mut ledger = Ledger::new(RULES, 0);
    let (slow, quick) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
    let old = granted(&mut ledger, slow, 0);
    ledger.expire(at(30));
    let new = granted(&mut ledger, quick, 30);
    assert_eq!(old.1, new.1);
    assert_eq!(deliver(&mut ledger, slow, old), Ok(Accepted::New));
    // The second lease is over: its end reopens nothing.
    assert_eq!(ledger.lost(quick), 0);
    assert_eq!(granted(&mut ledger, quick, 31).1, 1);
    assert_eq!(deliver(&mut ledger, quick, new), Ok(Accepted::Confirmed));
    assert_eq!(ledger.done(), 1);
}

#[test]
fn results_without_a_lease_are_refused() {
    let mut ledger = Ledger::new(RULES, 7);
    let (a, b) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
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
        let refused = ledger.accept(worker, lease, block, pixels(block), at(0));
        assert!(matches!(refused, Err(LedgerError::NotLeased { .. })));
    }
    assert_eq!(ledger.done(), 0);
}

#[test]
fn a_pass_that_keeps_failing_ends_the_job_before_it() {
    let mut ledger = Ledger::new(RULES, 0);
    let worker = join(&mut ledger, "worker");
    let zero = granted(&mut ledger, worker, 0);
    let mut one = granted(&mut ledger, worker, 0);
    let two = granted(&mut ledger, worker, 0);
    for attempt in 1..=3 {
        assert_eq!(one.1, 1);
        assert!(ledger.failed().is_none());
        // Reported twice, as when the reply got lost, it counts once.
        for _ in 0..2 {
            let message = "2 pixels are NaN";
            ledger.fail(worker, one.0, 1, message, at(0)).unwrap();
        }
        if attempt < 3 {
            one = granted(&mut ledger, worker, 0);
        }
    }
    let failure = ledger.failed().unwrap().clone();
    assert_eq!((failure.pass_index, failure.attempts), (1, 3));
    assert_eq!(failure.workers, 1);
    assert_eq!(ledger.limit(), 1);
    assert_eq!(ledger.lease(worker, at(0)), Ok(Grant::NotNow));
    assert_eq!(deliver(&mut ledger, worker, two), Ok(Accepted::NotNeeded));
    assert_eq!(deliver(&mut ledger, worker, zero), Ok(Accepted::New));
    assert!(ledger.is_complete());
}

#[test]
fn a_worker_that_sends_rubbish_is_shut_out_and_its_pass_goes_elsewhere() {
    let mut ledger = Ledger::new(RULES, 0);
    let (bad, good) = (join(&mut ledger, "worker"), join(&mut ledger, "worker"));
    for _ in 0..2 {
        let (lease, pass) = granted(&mut ledger, bad, 0);
        assert_eq!(pass, 0);
        ledger.refuse(bad, lease, Block::leaf(pass));
    }
    assert_eq!(
        ledger.lease(bad, at(0)),
        Err(LedgerError::ShutOut(bad, Sentence::Refusals))
    );
    assert_eq!(granted(&mut ledger, good, 0).1, 0);
}
