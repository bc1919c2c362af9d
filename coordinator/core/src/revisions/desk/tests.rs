use super::*;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const FULL: [u32; 2] = [320, 200];
const SIZE: [u32; 2] = [3, 2];

fn settings() -> JobSettings {
    JobSettings {
        seed: 1,
        alpha: 0.5,
        schedule: beamfarm_image::job::ScheduleKind::Pass,
        budget: None,
        paths_per_pass: 10,
        reference_paths: 10,
        techniques: Default::default(),
        engine: Default::default(),
    }
}

fn style() -> Style {
    Style {
        settings: settings(),
        origin: [0.0; 3],
    }
}

fn job(limit: u64) -> Job {
    let [width, height] = SIZE;
    Job {
        settings: settings(),
        width,
        height,
        limit,
    }
}

/// The film that a worker would render, marked with its task.
fn rendered(task: &Task) -> Film {
    let mut film = Film::new(task.width, task.height);
    if let Work::Pass { pass_index, .. } = task.work {
        film.pixels.fill([(100 * task.revision.0 + pass_index) as f32; 3]);
    }
    film
}

fn is_pass(task: &Task) -> bool {
    matches!(task.work, Work::Pass { .. })
}

const SOON: Duration = Duration::from_millis(30);
const NOW: Duration = Duration::from_secs(1);

fn begun(workers: u64) -> Desk {
    let mut desk = Desk::new(FULL, style());
    (0..workers).for_each(|worker| desk.join(WorkerId(worker)));
    desk.revise(RevisionNumber(1), FULL, style());
    desk
}

#[test]
fn sketches_come_first_and_then_passes() {
    let mut desk = begun(1);
    let worker = WorkerId(0);
    desk.settle(RevisionNumber(1), job(2));
    let mut widths = Vec::new();
    let mut passes = Vec::new();
    while let Some(task) = desk.next(worker, NOW) {
        assert_eq!(desk.next(worker, NOW), None, "one at a time");
        match task.work {
            Work::Sketch { .. } => widths.push(task.width),
            Work::Pass { pass_index, .. } => passes.push(pass_index),
        }
        let verdict = desk.finish(worker, task.number, &rendered(&task), (SOON, NOW));
        assert!(
            matches!(verdict, Verdict::Sketch { .. } | Verdict::Pass { .. }),
            "{verdict:?}"
        );
    }
    assert!(widths.is_sorted() && widths.last() == Some(&FULL[0]), "{widths:?}");
    // The first appears at once, however slow the scene is.
    assert!(widths[0] < 64, "{widths:?}");
    assert_eq!(passes, [0, 1]);
    desk.extend(3);
    let pass = desk.next(worker, NOW).filter(is_pass).unwrap();
    desk.revise(RevisionNumber(2), FULL, style());
    desk.give_back(worker, pass.number);
    assert!(desk.next(worker, NOW).is_some_and(|task| task.width > widths[0]));
}

#[test]
fn a_change_drops_all_but_the_coarsest_sketch() {
    let mut desk = begun(2);
    let [a, b] = [0, 1].map(WorkerId);
    let coarse = desk.next(a, NOW).unwrap();
    let finer = desk.next(b, NOW).unwrap();
    desk.revise(RevisionNumber(2), FULL, style());
    assert_eq!(desk.drop_of(a), None);
    assert_eq!(desk.drop_of(b), Some(finer.number));
    assert_eq!(desk.drop_of(b), None, "told once");
    // One worker continues and gets nothing new; the other starts the new revision before it has released its task.
    assert_eq!(desk.next(a, NOW), None);
    let newer = desk.next(b, NOW).unwrap();
    assert_eq!(newer.revision, RevisionNumber(2));
    let verdict = desk.finish(a, coarse.number, &rendered(&coarse), (SOON, NOW));
    assert!(
        matches!(
            verdict,
            Verdict::Sketch {
                revision: RevisionNumber(1),
                ..
            }
        ),
        "{verdict:?}"
    );
    // A dropped picture arrives anyway.
    assert_eq!(
        desk.finish(b, finer.number, &rendered(&finer), (SOON, NOW)),
        Verdict::Late
    );
    let verdict = desk.finish(b, newer.number, &rendered(&newer), (SOON, NOW));
    assert!(
        matches!(
            verdict,
            Verdict::Sketch {
                revision: RevisionNumber(2),
                ..
            }
        ),
        "{verdict:?}"
    );
}

#[test]
fn older_pictures_never_follow_newer_ones() {
    let mut desk = begun(2);
    let [a, b] = [0, 1].map(WorkerId);
    let old = desk.next(a, NOW).unwrap();
    desk.revise(RevisionNumber(2), FULL, style());
    let new = desk.next(b, NOW).unwrap();
    assert!(matches!(
        desk.finish(b, new.number, &rendered(&new), (SOON, NOW)),
        Verdict::Sketch { .. }
    ));
    assert_eq!(desk.finish(a, old.number, &rendered(&old), (SOON, NOW)), Verdict::Late);
}

#[test]
fn what_lost_workers_had_is_for_others() {
    let mut desk = begun(2);
    let [a, b] = [0, 1].map(WorkerId);
    desk.settle(RevisionNumber(1), job(4));
    let first = desk.next(a, NOW).unwrap();
    desk.leave(a);
    let again = desk.next(b, NOW).unwrap();
    assert_eq!((first.width, first.work), (again.width, again.work));
    // Its delivery comes through another stream that is closed: nobody can deliver it.
    assert_eq!(
        desk.finish(a, first.number, &rendered(&first), (SOON, NOW)),
        Verdict::Late
    );
    desk.finish(b, again.number, &rendered(&again), (SOON, NOW));
    let mut passes = Vec::new();
    desk.join(WorkerId(2));
    let mut lost = None;
    for _ in 0..20 {
        if let Some(task) = desk.next(WorkerId(2), NOW) {
            if is_pass(&task) && lost.is_none() {
                lost = Some(task);
                desk.leave(WorkerId(2));
                desk.join(WorkerId(2));
                continue;
            }
            if let Work::Pass { pass_index, .. } = task.work {
                passes.push(pass_index);
            }
            desk.finish(WorkerId(2), task.number, &rendered(&task), (SOON, NOW));
        }
    }
    assert_eq!(passes, [0, 1, 2, 3]);
    assert_eq!(desk.passes().unwrap().1.prefix(), 4);
}

#[test]
fn wrong_pictures_count_for_nothing_and_end_a_revision() {
    let mut desk = begun(1);
    let worker = WorkerId(0);
    desk.settle(RevisionNumber(1), job(4));
    while let Some(task) = desk.next(worker, NOW) {
        let mut film = rendered(&task);
        if is_pass(&task) {
            film.pixels[1][2] = f32::NAN;
        }
        let verdict = desk.finish(worker, task.number, &film, (SOON, NOW));
        assert_eq!(matches!(verdict, Verdict::Wrong(_)), is_pass(&task), "{verdict:?}");
    }
    assert!(desk.has_failed());
    assert_eq!(desk.passes().unwrap().1.passes(), 0);
    desk.revise(RevisionNumber(2), FULL, style());
    assert!(desk.next(worker, NOW).is_some());
    let task = TaskNumber(99);
    assert_eq!(desk.finish(worker, task, &Film::new(1, 1), (SOON, NOW)), Verdict::Late);
}

/// An honest worker next to one that does as `other` says. Returns the time until all passes are done.
fn beside_an_honest_one(mut other: impl FnMut(&mut Desk, Task, Duration)) -> (Desk, Duration) {
    let [bad, honest] = [0, 1].map(WorkerId);
    let mut desk = begun(2);
    desk.settle(RevisionNumber(1), job(6));
    let step = Duration::from_millis(100);
    for turn in 1..600 {
        let now = turn * step;
        // It always takes tasks first.
        for _ in 0..2 {
            if let Some(task) = desk.next(bad, now) {
                other(&mut desk, task, now);
            }
        }
        if let Some(task) = desk.next(honest, now) {
            let verdict = desk.finish(honest, task.number, &rendered(&task), (SOON, now + SOON));
            assert!(!matches!(verdict, Verdict::Wrong(_)), "{verdict:?}");
        }
        assert!(!desk.has_failed() && !desk.is_to_blame(honest));
        if desk.passes().unwrap().1.prefix() == 6 {
            return (desk, now);
        }
    }
    panic!("the view is halted");
}

#[test]
fn what_a_worker_keeps_is_for_others() {
    let mut kept = 0;
    let (mut desk, after) = beside_an_honest_one(|_, _, _| kept += 1);
    // Its first task was waited for as long as where nothing is known.
    assert!(
        kept >= 1 && after < PATIENCE + Duration::from_secs(10),
        "{kept}, {after:?}"
    );
    assert!(!desk.is_to_blame(WorkerId(0)));
    // From the next revision on at most eight such tasks, or a second.
    desk.revise(RevisionNumber(2), FULL, style());
    let held = desk.next(WorkerId(0), after + Duration::from_secs(100));
    assert!(held.is_none_or(|task| task.revision == RevisionNumber(2)));
}

/// Whatever becomes of a copy and of its copies: one worker keeps its task, and others get it as well.
#[test]
fn what_is_late_is_for_others_until_one_brings_it() {
    for ends in ["leaves", "gives back", "fails", "keeps"] {
        let mut desk = begun(6);
        let mut now = NOW;
        let kept = desk.next(WorkerId(0), now).unwrap();
        for spoiler in (1..5).map(WorkerId) {
            // Nothing is known yet, and there is other work.
            now += PATIENCE + SOON;
            let task = desk.next(spoiler, now).unwrap();
            assert_eq!(task.work, kept.work, "{ends}: {spoiler:?}");
            match ends {
                "leaves" => desk.leave(spoiler),
                "gives back" => desk.give_back(spoiler, task.number),
                "fails" => drop(desk.finish(spoiler, task.number, &Film::new(1, 1), (SOON, now))),
                _ => {}
            }
        }
        now += PATIENCE + SOON;
        let task = desk.next(WorkerId(5), now).unwrap();
        assert_eq!(task.work, kept.work, "{ends}");
        let verdict = desk.finish(WorkerId(5), task.number, &rendered(&task), (SOON, now));
        assert!(matches!(verdict, Verdict::Sketch { .. }), "{ends}: {verdict:?}");
        assert_eq!(desk.drop_of(WorkerId(0)), Some(kept.number));
        // The worker that keeps the task has to wait.
        assert_eq!(desk.next(WorkerId(0), now), None, "{ends}");
    }
}

/// Idle workers soon take over passes for which no time is known.
#[test]
fn nobody_idles_while_others_are_late() {
    let mut desk = begun(2);
    let [keeps, honest] = [0, 1].map(WorkerId);
    desk.settle(RevisionNumber(1), job(1));
    let kept = loop {
        let task = desk.next(keeps, NOW).unwrap();
        if is_pass(&task) {
            break task;
        }
        desk.finish(keeps, task.number, &rendered(&task), (SOON, NOW));
    };
    let soon = NOW + LEAST_PATIENCE;
    assert_eq!(desk.next(honest, soon), None);
    let task = desk.next(honest, soon + SOON).unwrap();
    assert_eq!(task.work, kept.work);
    let verdict = desk.finish(honest, task.number, &rendered(&task), (SOON, soon + SOON));
    assert!(matches!(verdict, Verdict::Pass { prefix: 1, .. }), "{verdict:?}");
}

#[test]
fn a_worker_that_fails_at_what_others_render_is_sent_away() {
    let (desk, after) = beside_an_honest_one(|desk, task, _| desk.give_back(WorkerId(0), task.number));
    assert!(
        desk.is_to_blame(WorkerId(0)) && after < Duration::from_secs(3),
        "{after:?}"
    );
    let (desk, after) = beside_an_honest_one(|desk, task, now| {
        let mut film = rendered(&task);
        film.pixels[0][0] = f32::NAN;
        let verdict = desk.finish(WorkerId(0), task.number, &film, (SOON, now));
        assert!(matches!(verdict, Verdict::Wrong(_)), "{verdict:?}");
    });
    assert!(
        desk.is_to_blame(WorkerId(0)) && after < Duration::from_secs(3),
        "{after:?}"
    );
    let (desk, _) = beside_an_honest_one(|desk, task, now| {
        let verdict = desk.finish(WorkerId(0), task.number, &Film::new(1, 1), (SOON, now));
        assert!(matches!(verdict, Verdict::Wrong(_)), "{verdict:?}");
    });
    assert!(desk.is_to_blame(WorkerId(0)));
}

/// Such as one that runs out of memory at times.
#[test]
fn a_worker_that_fails_now_and_then_stays() {
    let mut desk = begun(2);
    let [now_and_then, other] = [0, 1].map(WorkerId);
    for number in 2..12 {
        desk.revise(RevisionNumber(number), FULL, style());
        let task = desk.next(now_and_then, NOW).unwrap();
        desk.give_back(now_and_then, task.number);
        for worker in [other, now_and_then] {
            let task = desk.next(worker, NOW).unwrap();
            desk.finish(worker, task.number, &rendered(&task), (SOON, NOW));
        }
        assert!(!desk.is_to_blame(now_and_then));
    }
}

/// A sketch of an older revision does not decide who failed at the last one's.
#[test]
fn nobody_is_to_blame_for_another_revision() {
    let mut desk = begun(2);
    let [slow, fails] = [0, 1].map(WorkerId);
    for number in 2..12 {
        let old = desk.next(slow, NOW).unwrap();
        desk.revise(RevisionNumber(number), FULL, style());
        let task = desk.next(fails, NOW).unwrap();
        assert_eq!(task.revision, RevisionNumber(number));
        desk.give_back(fails, task.number);
        desk.finish(slow, old.number, &rendered(&old), (SOON, NOW));
        assert!(!desk.is_to_blame(fails), "{number}");
    }
}

/// A task that nobody can render is nobody's fault.
#[test]
fn a_revision_that_all_fail_at_ends() {
    let mut desk = begun(3);
    desk.settle(RevisionNumber(1), job(6));
    for turn in 0..100 {
        let worker = WorkerId(turn % 3);
        if let Some(task) = desk.next(worker, NOW) {
            desk.give_back(worker, task.number);
        }
    }
    assert!(desk.has_failed());
    assert!((0..3).all(|worker| !desk.is_to_blame(WorkerId(worker))));
    desk.revise(RevisionNumber(2), FULL, style());
    assert!(!desk.has_failed() && desk.next(WorkerId(1), NOW).is_some());
}

/// Events at a desk.
#[derive(Clone, Debug)]
enum Move {
    Revise,
    Settle,
    Join(u64),
    Leave(u64),
    Take(u64),
    /// The worker delivers its current task, or the n-th task that was ever handed out.
    Deliver(u64, Option<usize>),
    GiveBack(u64),
}

fn moves() -> impl Strategy<Value = Vec<Move>> {
    let worker = 0u64..4;
    let one = prop_oneof![
        1 => Just(Move::Revise),
        2 => Just(Move::Settle),
        2 => worker.clone().prop_map(Move::Join),
        1 => worker.clone().prop_map(Move::Leave),
        8 => worker.clone().prop_map(Move::Take),
        8 => (worker.clone(), proptest::option::weighted(0.2, 0usize..60)).prop_map(|(w, n)| Move::Deliver(w, n)),
        1 => worker.prop_map(Move::GiveBack),
    ];
    proptest::collection::vec(one, 1..120)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, rng_seed: RngSeed::Fixed(22), ..ProptestConfig::default() })]

    /// In any order of events: pictures never get worse, the sum holds each pass of the newest revision once and
    /// nothing else, and if workers stay, all passes arrive.
    #[test]
    fn nothing_of_an_older_revision_enters_a_sum(moves in moves()) {
        let mut desk = begun(1);
        let mut revision = 1;
        let mut given: Vec<(WorkerId, Task)> = Vec::new();
        let mut in_hand: BTreeMap<u64, Task> = BTreeMap::new();
        let mut shown = None;
        let mut look = |verdict: &Verdict| {
            let now = match *verdict {
                Verdict::Sketch { revision, step, .. } => (revision, Quality::Sketch(step)),
                Verdict::Pass { revision, prefix } if prefix > 0 => (revision, Quality::Passes(prefix)),
                _ => return true,
            };
            let passes = matches!(now.1, Quality::Passes(_));
            let grows = shown.is_none_or(|shown| shown < now || passes && shown == now);
            shown = Some(now);
            grows
        };
        for step in moves {
            match step {
                Move::Revise => {
                    revision += 1;
                    desk.revise(RevisionNumber(revision), FULL, style());
                }
                Move::Settle => desk.settle(RevisionNumber(revision), job(5)),
                Move::Join(worker) if !desk.seats.contains_key(&WorkerId(worker)) => {
                    desk.join(WorkerId(worker));
                    in_hand.remove(&worker);
                }
                Move::Join(_) => {}
                Move::Leave(worker) => desk.leave(WorkerId(worker)),
                Move::Take(worker) => {
                    if let Some(task) = desk.next(WorkerId(worker), NOW) {
                        prop_assert_eq!(task.revision, RevisionNumber(revision));
                        given.push((WorkerId(worker), task));
                        in_hand.insert(worker, task);
                    }
                }
                Move::Deliver(worker, old) => {
                    let task = match old {
                        None => in_hand.remove(&worker),
                        Some(n) => given.get(n).map(|(_, task)| *task),
                    };
                    if let Some(task) = task {
                        let verdict = desk.finish(WorkerId(worker), task.number, &rendered(&task), (SOON, NOW));
                        prop_assert!(look(&verdict), "{verdict:?}");
                    }
                }
                Move::GiveBack(worker) => {
                    if let Some(task) = in_hand.remove(&worker) {
                        desk.give_back(WorkerId(worker), task.number);
                    }
                }
            }
        }
        // One worker stays after all others have left.
        (0..4).for_each(|worker| desk.leave(WorkerId(worker)));
        if desk.has_failed() {
            revision += 1;
            desk.revise(RevisionNumber(revision), FULL, style());
        }
        desk.settle(RevisionNumber(revision), job(5));
        desk.join(WorkerId(9));
        while let Some(task) = desk.next(WorkerId(9), NOW) {
            let verdict = desk.finish(WorkerId(9), task.number, &rendered(&task), (SOON, NOW));
            prop_assert!(look(&verdict), "{verdict:?}");
        }
        let (_, sum) = desk.passes().unwrap();
        prop_assert_eq!((sum.prefix(), sum.passes()), (5, 5));
        let average = sum.average_of(5).unwrap();
        let expected = 100.0 * revision as f32 + 2.0;
        prop_assert!(average.beauty.pixels.iter().flatten().all(|value| (value - expected).abs() < 1e-3));
    }
}
