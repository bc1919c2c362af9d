//! Whatever happens, no pass is lost and none counts twice.

use super::*;
use beamfarm_proto::Grant;
use proptest::prelude::*;

/// Events at a farm.
#[derive(Clone, Debug)]
enum Event {
    Lease(usize),
    Deliver(usize),
    DeliverTwice(usize),
    Fail(usize, u64),
    Refuse(usize),
    GiveBack(usize),
    Claim(usize, u64),
    Beat(usize),
    Lost(usize),
    Wait(u64),
    Intake(u32),
    Extend(u64),
}

const WORKERS: usize = 5;

fn event() -> impl Strategy<Value = Event> {
    let worker = || 0..WORKERS;
    prop_oneof![
        8 => worker().prop_map(Event::Lease),
        8 => any::<usize>().prop_map(Event::Deliver),
        1 => any::<usize>().prop_map(Event::DeliverTwice),
        1 => (any::<usize>(), any::<u64>()).prop_map(|(which, pass)| Event::Fail(which, pass)),
        1 => any::<usize>().prop_map(Event::Refuse),
        1 => any::<usize>().prop_map(Event::GiveBack),
        1 => (worker(), 0..200u64).prop_map(|(worker, pass)| Event::Claim(worker, pass)),
        2 => worker().prop_map(Event::Beat),
        1 => worker().prop_map(Event::Lost),
        3 => (0..40u64).prop_map(Event::Wait),
        1 => (0..6u32).prop_map(Event::Intake),
        1 => (0..20u64).prop_map(Event::Extend),
    ]
}

/// Mirrors the tree sum: siblings merge and cannot be separated.
#[derive(Default)]
struct Sum {
    nodes: BTreeMap<Block, Vec<(Block, PixelHash)>>,
}

impl Sum {
    fn insert(&mut self, mut block: Block, pixels: PixelHash) {
        let mut content = vec![(block, pixels)];
        while let Some(sibling) = self.nodes.remove(&block.sibling()) {
            content.extend(sibling);
            block = block.parent();
        }
        self.nodes.insert(block, content);
    }

    fn remove(&mut self, blocks: &[Block]) -> Vec<Block> {
        let holds = |node: &Block| blocks.iter().any(|b| node.passes().contains(&b.start()));
        let gone: Vec<Block> = self.nodes.keys().copied().filter(holds).collect();
        self.nodes.retain(|node, _| !gone.contains(node));
        gone
    }

    fn content(&self) -> impl Iterator<Item = &(Block, PixelHash)> {
        self.nodes.values().flatten()
    }
}

struct Farm {
    ledger: Ledger,
    sum: Sum,
    workers: Vec<WorkerId>,
    liars: BTreeSet<WorkerId>,
    held: Vec<(WorkerId, LeaseId, Block)>,
    now: Duration,
    first: u64,
}

impl Farm {
    fn new(rules: Rules, liars: usize) -> Self {
        let mut ledger = Ledger::new(rules, 100);
        let names = (0..WORKERS).map(|i| i.to_string());
        let workers: Vec<_> = names.map(|name| join(&mut ledger, &name)).collect();
        Self {
            ledger,
            sum: Sum::default(),
            liars: workers[..liars].iter().copied().collect(),
            workers,
            held: Vec::new(),
            now: Duration::ZERO,
            first: rules.first_pass,
        }
    }

    fn lease(&mut self, worker: WorkerId) -> Option<Grant> {
        let grant = self.ledger.lease(worker, self.now).ok()?;
        if let Grant::Lease(lease, block) = grant {
            self.held.push((worker, lease, block));
        }
        self.check();
        Some(grant)
    }

    fn deliver(&mut self, (worker, lease, block): (WorkerId, LeaseId, Block)) {
        let mut hash = pixels(block);
        if self.liars.contains(&worker) {
            hash[0] ^= 1 + worker.0 as u8;
        }
        let accepted = self.ledger.accept(worker, lease, block, hash, self.now);
        if accepted == Ok(Accepted::New) {
            self.sum.insert(block, hash);
        }
        if !self.ledger.stained().is_empty() {
            let gone = self.sum.remove(self.ledger.stained());
            self.ledger.reopen(&gone);
        }
        self.check();
    }

    fn happen(&mut self, event: Event) {
        let pick = |which: usize, len: usize| (len > 0).then(|| which % len.max(1));
        let at_hand = self.held.len();
        match event {
            Event::Lease(worker) => {
                self.lease(self.workers[worker]);
            }
            Event::Deliver(which) => {
                if let Some(i) = pick(which, at_hand) {
                    let held = self.held.swap_remove(i);
                    self.deliver(held);
                }
            }
            Event::DeliverTwice(which) => {
                if let Some(i) = pick(which, at_hand) {
                    self.deliver(self.held[i]);
                }
            }
            Event::Fail(which, pass) => {
                if let Some(i) = pick(which, at_hand) {
                    let (worker, lease, block) = self.held.swap_remove(i);
                    let pass = block.start() + pass % (block.len() + 1);
                    let _ = self.ledger.fail(worker, lease, pass, "no", self.now);
                }
            }
            Event::Refuse(which) => {
                if let Some(i) = pick(which, at_hand) {
                    let (worker, lease, block) = self.held.swap_remove(i);
                    self.ledger.refuse(worker, lease, block);
                }
            }
            Event::GiveBack(which) => {
                if let Some(i) = pick(which, at_hand) {
                    let (worker, lease, _) = self.held.swap_remove(i);
                    self.ledger.give_back(worker, &[lease].into()).unwrap();
                }
            }
            Event::Claim(worker, pass) => {
                let level = level::highest_at(pass);
                let block = Block {
                    level,
                    index: pass >> level,
                };
                if let Some(lease) = self.ledger.claim(self.workers[worker], block, self.now) {
                    self.held.push((self.workers[worker], lease, block));
                }
            }
            Event::Beat(worker) => {
                let worker = self.workers[worker];
                let own = self.held.iter().filter(|held| held.0 == worker);
                let own: Vec<_> = own.map(|held| (held.1, 1)).collect();
                let _ = self.ledger.beat(worker, own, self.now);
            }
            Event::Lost(worker) => {
                self.ledger.lost(self.workers[worker]);
            }
            Event::Wait(seconds) => {
                self.now += at(seconds);
                self.ledger.expire(self.now);
            }
            Event::Intake(seconds) => self.ledger.set_intake(f64::from(seconds)),
            Event::Extend(more) => self.ledger.extend(self.ledger.limit() + more),
        }
        self.check();
    }

    /// Every pass is exactly one of open, leased and done; several workers may lease the same one.
    fn check(&self) {
        let ledger = &self.ledger;
        let mut times = BTreeMap::<u64, [u32; 3]>::new();
        for pass in ledger.open.iter().flatten() {
            times.entry(pass).or_default()[0] += 1;
        }
        let active = ledger.active.iter().map(|id| &ledger.leases[id.0 as usize]);
        for pass in active
            .filter(|lease| !lease.audit)
            .flat_map(|lease| lease.block.passes())
        {
            times.entry(pass).or_default()[1] = 1;
        }
        for pass in ledger.done.values().flat_map(|done| done.block.passes()) {
            times.entry(pass).or_default()[2] += 1;
        }
        for pass in self.first..ledger.limit() {
            let [open, leased, done] = times.get(&pass).copied().unwrap_or_default();
            assert_eq!(open + leased + done, 1, "pass {pass}: {open} {leased} {done}");
        }
        assert!(ledger.open.iter().all(|range| range.end <= ledger.limit()));
        let counted = ledger.done.values().map(|done| done.block.len()).sum::<u64>();
        assert_eq!(ledger.done(), counted);
        let of_workers = ledger.workers.values().map(|worker| worker.passes).sum::<u64>();
        assert_eq!(of_workers, counted);
        let gap = (self.first..).find(|pass| times.get(pass).is_none_or(|t| t[2] == 0));
        assert_eq!(Some(ledger.prefix()), gap);
        // The sum matches the ledger, whatever was taken back.
        let mut summed: Vec<_> = self.sum.content().copied().collect();
        summed.sort();
        let mut entered: Vec<_> = ledger
            .done
            .values()
            .filter_map(|done| Some((done.block, done.by?.1)))
            .collect();
        entered.sort();
        assert_eq!(summed, entered);
    }

    /// The honest workers do what is left.
    fn finish(&mut self) {
        self.now += self.ledger.rules.lease;
        self.ledger.set_intake(0.0);
        for _ in 0..100_000 {
            let mut done = true;
            for worker in self.workers.clone() {
                if self.liars.contains(&worker) {
                    continue;
                }
                match self.lease(worker) {
                    Some(Grant::Lease(..)) => {
                        let held = self.held.pop().unwrap();
                        self.deliver(held);
                        done = false;
                    }
                    Some(Grant::NotNow) => done = false,
                    Some(Grant::Done | Grant::Elsewhere) | None => {}
                }
            }
            if done {
                return;
            }
            self.now += at(1);
        }
        panic!("a pass is lost: {:?}", self.ledger);
    }
}

fn patient(passes: u64, audit_every: u64) -> Rules {
    Rules {
        passes,
        failures_per_pass: u32::MAX,
        failures_per_worker: u32::MAX,
        refusals_per_worker: u32::MAX,
        audit_every,
        ..RULES
    }
}

/// Long tests, as elsewhere: `BEAMFARM_LONG=1`.
fn is_long() -> bool {
    std::env::var("BEAMFARM_LONG").is_ok_and(|value| !value.is_empty() && value != "0")
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: if is_long() { 256 } else { 96 },
        rng_seed: proptest::test_runner::RngSeed::Fixed(20),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_pass_is_lost_and_none_counts_twice(
        first_pass in 0..10u64,
        passes in 1..150u64,
        audit_every in 0..4u64,
        lost in prop::collection::vec((0..170u64, 0..4u32, any::<bool>()), 0..30),
        events in prop::collection::vec(event(), 0..300),
    ) {
        let rules = Rules { first_pass, ..patient(first_pass + passes, audit_every) };
        let mut farm = Farm::new(rules, 0);
        // An earlier run of the job had these, with the same or different pixels.
        for (pass, level, right) in lost {
            let block = Block { level, index: pass >> level };
            let hash = if right { pixels(block) } else { [9; 32] };
            farm.ledger.expect(block, &Who::from("before"), hash);
        }
        events.into_iter().for_each(|event| farm.happen(event));
        farm.finish();
        prop_assert_eq!(farm.ledger.prefix(), farm.ledger.limit());
        prop_assert!(farm.ledger.is_over(farm.now));
        let honest = |(block, hash): &(Block, PixelHash)| *hash == pixels(*block);
        prop_assert!(farm.sum.content().all(honest));
    }

    /// Liars whose blocks are all checked leave nothing behind, whatever happens.
    #[test]
    fn liars_are_found(
        passes in 1..100u64,
        liars in 1..3usize,
        events in prop::collection::vec(event(), 0..300),
    ) {
        let mut farm = Farm::new(patient(passes, 1), liars);
        events.into_iter().for_each(|event| farm.happen(event));
        farm.finish();
        prop_assert_eq!(farm.ledger.prefix(), farm.ledger.limit());
        for (block, hash) in farm.sum.content() {
            prop_assert_eq!(*hash, pixels(*block), "{}", block);
        }
        let honest = farm.workers.iter().filter(|worker| !farm.liars.contains(worker));
        for worker in honest {
            prop_assert!(farm.ledger.lease(*worker, farm.now).is_ok());
        }
    }

    /// A pass that fails for good ends the job before it, in whatever order the others arrive.
    #[test]
    fn a_failed_pass_leaves_the_prefix_before_it(
        passes in 1..60u64,
        bad in 0..60u64,
        events in prop::collection::vec(event(), 0..100),
    ) {
        let bad = bad % passes;
        let rules = Rules { failures_per_pass: 3, ..patient(passes, 0) };
        let mut farm = Farm::new(rules, 0);
        for event in events {
            match event {
                Event::Fail(..) | Event::Deliver(_) | Event::DeliverTwice(_) => {
                    if let Some((worker, lease, block)) = farm.held.pop() {
                        match block.passes().contains(&bad) {
                            true => farm.ledger.fail(worker, lease, bad, "no", farm.now).unwrap(),
                            false => farm.deliver((worker, lease, block)),
                        }
                    }
                }
                event => farm.happen(event),
            }
        }
        farm.held.clear();
        farm.now += farm.ledger.rules.lease;
        let workers = farm.workers.clone();
        let mut turn = 0;
        while !farm.ledger.is_over(farm.now) {
            let worker = workers[turn % workers.len()];
            turn += 1;
            prop_assert!(turn < 10_000);
            farm.lease(worker);
            if let Some((worker, lease, block)) = farm.held.pop() {
                match block.passes().contains(&bad) {
                    true => farm.ledger.fail(worker, lease, bad, "no", farm.now).unwrap(),
                    false => farm.deliver((worker, lease, block)),
                }
            }
            farm.now += at(1);
        }
        prop_assert_eq!(farm.ledger.prefix(), bad);
        prop_assert_eq!(farm.ledger.failed().map(|f| f.pass_index), Some(bad));
    }
}
