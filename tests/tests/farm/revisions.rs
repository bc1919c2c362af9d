//! Revisions of a scene over real connections: workers of the library, and workers that are slow, late or lost.

use crate::farm::harness::{LONG, SCENE, leaf, settings, start_worker, within};
use crate::farm::view::{RawWorker, View, changed, description, pixels};
use beamfarm_coordinator::revisions::{Content, Job, Picture, Quality};
use beamfarm_image::film::Film;
use beamfarm_image::merge::TreeSum;
use beamfarm_proto::wire::order::Order as Kind;
use beamfarm_proto::wire::report::Part;
use beamfarm_proto::{Task, VERSION, Work, wire};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use std::time::{Duration, Instant};
use tonic::Code;

fn is_average(picture: &Picture, passes: u64) -> bool {
    picture.quality == Quality::Passes(passes)
}

fn film(picture: &Picture) -> &Film {
    picture.content.film()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn passes_of_a_revision_have_the_bits_of_its_job() {
    let mut view = View::start().await;
    let _crew = [1, 2].map(|threads| start_worker(view.url.clone(), threads, LONG));
    for power in ["30", "70"] {
        let text = changed(power);
        let number = view.revise(&text);
        view.settle(number, 5);
        let shown = view
            .shows("five passes", |picture| {
                picture.revision == number && is_average(picture, 5)
            })
            .await;
        let scene = Scene::new(description(&text));
        let plan = RenderPlan::new(&scene, settings());
        let mut sum = TreeSum::new(view.full[0], view.full[1]);
        for pass_index in 0..5 {
            sum.insert(leaf(
                pass_index,
                render_pass(&scene, &plan, pass_index).expect("a pass").film,
            ))
            .unwrap();
        }
        let expected = sum.average().unwrap();
        assert!(*film(&shown) == expected.beauty, "power {power}");
        match &shown.content {
            Content::Average(average) => assert_eq!(average.passes, 5),
            Content::Sketch(_) => panic!("a sketch"),
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_arrives_late_enters_no_sum() {
    let mut view = View::start().await;
    let mut worker = view.worker().await;
    let first = view.revise(SCENE);
    view.settle(first, 3);
    let old = worker.pass().await;
    worker.begin(&old).await;
    let half = pixels(&old, 1000.0, 0.5);
    worker.say(Part::Data(half.clone().into())).await;

    // The scene changes halfway.
    let second = view.revise(&changed("30"));
    view.settle(second, 3);
    assert_eq!(worker.order().await, Kind::Drop(old.number.0));
    worker.say(Part::Data(half.into())).await;
    worker.deliver(&old, 1000.0).await;
    worker.say(Part::Dropped(old.number.0)).await;
    for _ in 0..3 {
        let pass = worker.pass().await;
        assert_eq!(pass.revision, second);
        worker.deliver(&pass, 2.0).await;
    }
    let shown = view.shows("three passes", |picture| is_average(picture, 3)).await;
    assert_eq!(shown.revision, second);
    assert!(film(&shown).pixels.iter().flatten().all(|value| *value == 2.0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_lost_worker_had_in_hand_another_one_does() {
    let mut view = View::start().await;
    let mut lost = view.worker().await;
    let number = view.revise(SCENE);
    view.settle(number, 2);
    let pass = lost.pass().await;
    lost.begin(&pass).await;
    lost.say(Part::Data(pixels(&pass, 9.0, 0.9).into())).await;
    drop(lost);
    let mut other = view.worker().await;
    let mut seen = Vec::new();
    for _ in 0..2 {
        let pass = other.pass().await;
        other.deliver(&pass, 3.0).await;
        if let Work::Pass { pass_index, .. } = pass.work {
            seen.push(pass_index);
        }
    }
    // In either order: the lost one's pass is free once its loss is known.
    seen.sort_unstable();
    assert_eq!(seen, [0, 1]);
    let shown = view.shows("two passes", |picture| is_average(picture, 2)).await;
    assert!(film(&shown).pixels.iter().flatten().all(|value| *value == 3.0));
}

/// Another worker renders the pass that it keeps, and all passes arrive.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_keeps_a_pass_halts_nothing() {
    let mut view = View::start().await;
    let mut keeps = view.worker().await;
    let number = view.revise(SCENE);
    view.settle(number, 6);
    let kept = keeps.pass().await;
    let _honest = start_worker(view.url.clone(), 1, LONG);
    view.shows("all passes", |picture| is_average(picture, 6)).await;
    // It was told, and its late delivery counts for nothing.
    assert_eq!(keeps.order().await, Kind::Drop(kept.number.0));
    keeps.deliver(&kept, 1000.0).await;
    keeps.say(Part::Dropped(kept.number.0)).await;
    let next = view.revise(&changed("30"));
    view.settle(next, 6);
    view.shows("the next revision's passes", |picture| {
        picture.revision == next && is_average(picture, 6)
    })
    .await;
}

/// Whatever it does wrong, it does not come back under its key.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_spoils_what_others_can_render_is_sent_away() {
    for spoils in ["fails", "has NaN", "gives back"] {
        let mut view = View::start().await;
        let mut bad = view.worker().await;
        let number = view.revise(SCENE);
        view.settle(number, 6);
        let spoiling = async {
            loop {
                let order = match bad.orders.message().await {
                    Ok(Some(order)) => order.order.unwrap(),
                    Ok(None) => panic!("the stream ends without a word"),
                    Err(status) => return status,
                };
                let Kind::Task(task) = order else { continue };
                let task = Task::try_from(task).unwrap();
                match spoils {
                    "fails" => {
                        let misfortune = wire::Misfortune {
                            task: task.number.0,
                            message: "no luck".into(),
                        };
                        bad.say(Part::Misfortune(misfortune)).await;
                    }
                    "has NaN" => bad.deliver(&task, f32::NAN).await,
                    _ => bad.say(Part::Dropped(task.number.0)).await,
                }
            }
        };
        let _honest = start_worker(view.url.clone(), 1, LONG);
        let mut spoiling = std::pin::pin!(spoiling);
        let mut ended = None;
        // Before the other one was there it may have failed alone, for which nobody is blamed yet.
        for power in 30..36 {
            let shown = view.shows("all passes", |picture| {
                picture.revision.0 == view.number && is_average(picture, 6)
            });
            tokio::select! {
                _ = shown => {}
                status = &mut spoiling => {
                    ended = Some(status);
                    break;
                }
            }
            let next = view.revise(&changed(&power.to_string()));
            view.settle(next, 6);
        }
        let ended = match ended {
            Some(ended) => ended,
            None => within("its end", spoiling).await,
        };
        assert_eq!(ended.code(), Code::PermissionDenied, "{spoils}: {ended}");
        let again = RawWorker::attend(&view.url, VERSION).await;
        assert_eq!(again.err().unwrap().code(), Code::PermissionDenied, "{spoils}");
        let last = view.revise(&changed("50"));
        view.shows("another revision", |picture| picture.revision == last).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn work_is_dropped_in_the_middle_of_a_pass() {
    let mut view = View::start().await;
    let _worker = start_worker(view.url.clone(), 1, LONG);
    let number = view.revise(SCENE);
    // A pass that takes minutes.
    let [width, height] = view.full;
    let settings = beamfarm_image::job::JobSettings {
        paths_per_pass: 200_000_000,
        ..settings()
    };
    let job = Job {
        settings,
        width,
        height,
        limit: 1,
    };
    view.revisions.settle(number, job);
    view.shows("a sketch of full size", |picture| film(picture).width == width)
        .await;
    tokio::time::sleep(Duration::from_millis(500)).await;
    let begun = Instant::now();
    let next = view.revise(&changed("30"));
    view.shows("another revision", |picture| picture.revision == next).await;
    let took = begun.elapsed();
    assert!(took < Duration::from_secs(20), "it took {took:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn those_who_make_no_sense_are_sent_away() {
    let mut view = View::start().await;
    let refused = RawWorker::attend(&view.url, "another").await.err().unwrap();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    view.revise(SCENE);
    let many = |task: &Task| Part::Data(vec![0; pixels(task, 0.0, 1.0).len() + 4].into());
    let wrongs: [fn(&Task) -> Part; 2] = [
        |_| Part::Greeting(wire::Greeting::default()),
        |task| Part::Data(vec![0; 12 * task.width as usize * task.height as usize + 4].into()),
    ];
    for wrong in wrongs {
        let mut worker = view.worker().await;
        let task = worker.task().await;
        worker.begin(&task).await;
        worker.say(wrong(&task)).await;
        let end = within("the end", worker.orders.message()).await;
        assert_eq!(end.unwrap_err().code(), Code::InvalidArgument);
    }
    // Data that nobody asked for.
    let mut worker = view.worker().await;
    let task = worker.task().await;
    worker.say(many(&task)).await;
    let end = within("the end", worker.orders.message()).await;
    assert_eq!(end.unwrap_err().code(), Code::InvalidArgument);
    // NaN is no picture, and is reported.
    let mut worker = view.worker().await;
    let task = worker.task().await;
    worker.deliver(&task, f32::NAN).await;
    let mut trouble = view.revisions.trouble();
    let said = within("trouble", trouble.wait_for(Option::is_some)).await;
    assert!(said.unwrap().as_deref().unwrap().contains("not finite"));
}
