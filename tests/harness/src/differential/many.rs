//! Many seeds, one thread each.

use super::{Effort, Verdict, examine};
use crate::random_scene::RandomScene;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::Instant;

/// The result for a seed.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The seed.
    pub seed: u64,
    /// Its scene.
    pub scene: RandomScene,
    /// The verdict; the message if something panicked.
    pub verdict: Result<Verdict, String>,
    /// How long it took.
    pub seconds: f64,
}

impl Outcome {
    /// Whether it is a fault.
    pub fn is_fault(&self) -> bool {
        !matches!(&self.verdict, Ok(verdict) if !verdict.is_fault())
    }

    /// As one line.
    pub fn line(&self) -> String {
        let verdict = match &self.verdict {
            Ok(verdict) => verdict.to_string(),
            Err(message) => format!("PANIC: {message}"),
        };
        let Self {
            seed, seconds, scene, ..
        } = self;
        format!("seed {seed}: {verdict} [{}; {seconds:.1} s]", scene.summary())
    }
}

/// Compares the renderers on a scene, with one thread. A panic is a fault like any other.
pub fn examine_alone(scene: &RandomScene, effort: &Effort) -> Result<Verdict, String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| error.to_string())?;
    let look = || pool.install(|| scene.load().map(|loaded| examine(&loaded, effort)));
    match catch_unwind(AssertUnwindSafe(look)) {
        Ok(verdict) => verdict,
        Err(panic) => Err(message(panic.as_ref())),
    }
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("?").to_owned()
}

/// Examines the scenes of all these seeds, and passes on each result as soon as it is known.
pub fn examine_seeds(seeds: &[u64], effort: &Effort, mut each: impl FnMut(Outcome)) {
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    let threads = thread::available_parallelism().map_or(1, |n| n.get());
    thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, seeds) = (sender.clone(), &next, &seeds);
            scope.spawn(move || {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&seed) = seeds.get(number) else {
                        break;
                    };
                    let scene = RandomScene::new(seed);
                    let started = Instant::now();
                    let verdict = examine_alone(&scene, effort);
                    let seconds = started.elapsed().as_secs_f64();
                    if sender
                        .send(Outcome {
                            seed,
                            scene,
                            verdict,
                            seconds,
                        })
                        .is_err()
                    {
                        break;
                    }
                }
            });
        }
        drop(sender);
        receiver.into_iter().for_each(&mut each);
    });
}
