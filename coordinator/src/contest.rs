//! Which engine is better for a scene on this machine: each renders some of its first passes, as `render` would.

use beamfarm_image::film::Film;
use beamfarm_image::job::{EngineKind, JobSettings};
use beamfarm_image::layer::Layer;
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::{Scene, SceneDescription};
use beamfarm_worker::engine::{self, EngineError, Engines, NotRendered, Planned};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Passes per engine: at least `LEAST`, then until `TIME` is over, at most `MOST`.
const LEAST: u64 = 4;
const TIME: Duration = Duration::from_millis(1500);
const MOST: u64 = 64;

/// A scene and how one engine would render it.
pub struct Contestant<'a> {
    pub description: &'a SceneDescription,
    /// Includes the engine.
    pub settings: JobSettings,
    pub layers: &'a [Layer],
    /// Device number, or part of its name.
    pub gpu: &'a str,
}

/// The device that takes part: the named one, or the best card. A software driver is not a card: it is slower than the
/// processors it runs on.
pub fn device(gpu: &str) -> Result<String, EngineError> {
    match gpu {
        "" => Ok(engine::best_card()?.to_string()),
        gpu => Ok(gpu.to_owned()),
    }
}

/// The better engine, and why, for display.
///
/// # Errors
/// One of the engines cannot render the scene.
pub fn held(cpu: &Contestant<'_>, gpu: &Contestant<'_>) -> Result<(EngineKind, String), EngineError> {
    let both = [cpu.render()?, gpu.render()?];
    let same = both.iter().map(|run| run.films.len()).min().unwrap_or_default();
    let [cpu, gpu] = both.map(|run| run.mark(same));
    Ok(judge(cpu, gpu, same))
}

/// What an engine rendered.
struct Run {
    /// Passes from the first on.
    films: Vec<Film>,
    /// Seconds per pass.
    seconds: f64,
}

/// How good an engine is.
#[derive(Clone, Copy, Debug)]
struct Mark {
    /// Seconds per pass.
    seconds: f64,
    /// Relative standard error of a single pass.
    error: f64,
}

impl Mark {
    /// Variance times time, up to a common factor.
    fn cost(self) -> f64 {
        self.error * self.error * self.seconds
    }
}

impl Contestant<'_> {
    /// Passes do not wait for each other, as with workers. Preparation before the first, such as compiling kernels,
    /// does not count.
    fn render(&self) -> Result<Run, EngineError> {
        let broke = |what: String| EngineError::Broke(what);
        let scene = Scene::new(self.description.clone());
        let plan = RenderPlan::new(&scene, self.settings).with_layers(&scene, self.layers);
        let plan = plan.map_err(|error| broke(error.to_string()))?;
        let engine = Engines::new(self.gpu).engine(Arc::new(Planned { scene, plan }))?;
        let at_once = match self.settings.engine {
            EngineKind::Cpu => rayon::current_num_threads(),
            EngineKind::Gpu => engine.together(),
        };
        let at_once = at_once.max(1) as u64;
        let passes = |indices: &[u64]| {
            let images = engine.passes(indices).map_err(|why| match why {
                NotRendered::Machine(why) => why,
                NotRendered::Pass(why) => broke(why.to_string()),
            })?;
            Ok::<_, EngineError>(images.into_iter().map(|image| image.film).collect::<Vec<Film>>())
        };
        passes(&[0])?;
        let mut films = Vec::new();
        let begun = Instant::now();
        while (films.len() as u64) < LEAST || begun.elapsed() < TIME && (films.len() as u64) < MOST {
            let first = films.len() as u64;
            let indices: Vec<u64> = (first..first + at_once).collect();
            match self.settings.engine {
                EngineKind::Cpu => {
                    let each: Result<Vec<_>, _> = indices.par_chunks(1).map(passes).collect();
                    films.extend(each?.into_iter().flatten());
                }
                EngineKind::Gpu => films.extend(passes(&indices)?),
            }
        }
        let seconds = begun.elapsed().as_secs_f64() / films.len() as f64;
        Ok(Run { films, seconds })
    }
}

impl Run {
    /// Judged by its first `passes` passes: later ones have narrower kernels and more noise.
    fn mark(self, passes: usize) -> Mark {
        let mut sum = self.films.first().map(|film| TreeSum::new(film.width, film.height));
        for (index, film) in self.films.into_iter().take(passes).enumerate() {
            // Cannot fail: they have the same size and come in order.
            if let Some(sum) = &mut sum {
                let _ = sum.insert(Node::leaf(index as u64, film));
            }
        }
        let average = sum.and_then(|sum| sum.average());
        let error = average.map_or(f64::NAN, |average| average.relative_standard_error());
        Mark {
            seconds: self.seconds,
            error: error * (passes as f64).sqrt(),
        }
    }
}

/// If an error is unknown, as for a black picture, only time counts.
fn judge(cpu: Mark, gpu: Mark, passes: usize) -> (EngineKind, String) {
    let known = [cpu, gpu].iter().all(|mark| mark.error.is_finite() && mark.error > 0.0);
    let cost = |mark: Mark| if known { mark.cost() } else { mark.seconds };
    let ratio = cost(gpu) / cost(cpu);
    let (better, worse, other, ratio) = match ratio < 1.0 {
        true => (EngineKind::Gpu, EngineKind::Cpu, [gpu, cpu], ratio),
        false => (EngineKind::Cpu, EngineKind::Gpu, [cpu, gpu], 1.0 / ratio),
    };
    let [own, other] = other.map(|mark| {
        let ms = 1000.0 * mark.seconds;
        match known {
            true => format!("{ms:.2} ms a pass with {:.1} % error", 100.0 * mark.error),
            false => format!("{ms:.2} ms a pass"),
        }
    });
    let what = if known { "error² x time" } else { "time" };
    let note = format!(
        "engine {better}: {what} is {ratio:.3} of that of {worse}, by {passes} passes of each ({own}; {worse} {other})"
    );
    (better, note)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(seconds: f64, error: f64) -> Mark {
        Mark { seconds, error }
    }

    #[test]
    fn the_smaller_error_at_equal_time_wins() {
        let (engine, note) = judge(mark(0.1, 0.2), mark(0.02, 0.2), 8);
        assert_eq!(engine, EngineKind::Gpu);
        assert_eq!(
            note,
            "engine gpu: error² x time is 0.200 of that of cpu, by 8 passes of each (20.00 ms a pass with 20.0 % error; \
             cpu 100.00 ms a pass with 20.0 % error)"
        );
        // Faster passes with much more noise.
        let (engine, note) = judge(mark(0.1, 0.1), mark(0.05, 0.2), 8);
        assert_eq!(engine, EngineKind::Cpu);
        assert!(
            note.starts_with("engine cpu: error² x time is 0.500 of that of gpu"),
            "{note}"
        );
        for error in [0.0, f64::NAN] {
            let (engine, note) = judge(mark(0.1, error), mark(0.05, 0.2), 4);
            assert_eq!(engine, EngineKind::Gpu);
            assert!(note.contains("time is 0.500 of") && !note.contains('%'), "{note}");
        }
    }

    #[test]
    fn noise_is_that_of_a_pass() {
        let of = |values: &[f32]| {
            let film = |value: &f32| {
                let mut film = Film::new(4, 4);
                film.pixels.fill([*value; 3]);
                film
            };
            let films = values.iter().map(film).collect();
            Run { films, seconds: 0.5 }
        };
        let values = [9.0, 11.0, 9.5, 10.5, 9.0, 11.0, 10.5, 9.5];
        let few = of(&values[..4]).mark(4);
        assert_eq!(few.seconds, 0.5);
        // Later passes are ignored, and twice the noise gives twice the error.
        assert_eq!(of(&values).mark(4).error, few.error);
        let wider = values.map(|value| 2.0 * value - 10.0);
        assert!((of(&wider).mark(4).error / few.error - 2.0).abs() < 1e-6);
        // The error is that of one pass, however many there are.
        let more = of(&values).mark(8).error;
        assert!((0.5..2.0).contains(&(more / few.error)), "{more} {few:?}");
    }
}
