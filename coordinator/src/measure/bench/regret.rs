//! `beamfarm bench --regret`: how much worse the chosen plan is than the best available plan.
//!
//! Every plan that the pilot considered renders twice for the same time, with a different seed each time. Plans are
//! compared by error times time. The error is relMSE against the scene's reference. Without one, each image of one seed
//! is compared with a combination of all plans' images of the other seed. Uncertainties come from a jackknife over
//! blocks of pixels.

use super::comparison::Reference;
use super::overrides::load;
use super::run::{Integrator, Run, Step, Task, cpu_seconds};
use super::suite::{SceneCase, Suite};
use super::table::Table;
use crate::failure::Failure;
use beamfarm_image::film::Film;
use beamfarm_image::job::MAX_PASSES;
use beamfarm_render::cpu::pass::Cpu;
use beamfarm_render::plan::pilot::{Candidate, Choice, Question};
use beamfarm_worker::say;
use serde::Serialize;
use std::path::Path;

/// Side of a jackknife block in pixels.
const BLOCK: usize = 8;
/// Errors below this fraction of the reference's own noise are clamped to it.
const TOLD: f64 = 0.1;
/// Iterations of weighting plans by their distance from the combined image.
const ROUNDS: usize = 3;

/// A plan of a scene, with its results.
#[derive(Debug, Serialize)]
struct Row {
    scene: String,
    plan: String,
    chosen: bool,
    /// The pilot's expected error times time, relative to its first plan.
    predicted: f64,
    paths_per_pass: u32,
    passes: u64,
    core_seconds: f64,
    /// relMSE after that time, minus the reference's own noise.
    error: f64,
    /// Error times time relative to the best plan, and the standard error of its logarithm.
    ratio: f64,
    uncertainty: f64,
}

/// Measure all scenes of a suite and write regret.csv.
pub fn main(suite: &Suite, output: &Path, quiet: bool) -> Result<(), Failure> {
    let Some(seconds) = suite.seconds else {
        return Err(Failure::usage(
            "--regret: expected --seconds, the time that each plan gets",
        ));
    };
    let mut rows: Vec<Row> = Vec::new();
    let mut told = Vec::new();
    for case in &suite.scenes {
        let (of_scene, pilot_seconds) = measure(case, suite, seconds)?;
        if let Some(line) = summary(&of_scene, pilot_seconds) {
            if !quiet {
                say!("{}", line.join("  "));
            }
            told.push(line);
        }
        rows.extend(of_scene);
        write_csv(&rows, &output.join("regret.csv"))?;
    }
    if !quiet {
        say!("\n{}", table(&rows, told, seconds).plain());
    }
    Ok(())
}

fn write_csv(rows: &[Row], path: &Path) -> Result<(), Failure> {
    let mut writer = csv::Writer::from_path(path).map_err(Failure::io)?;
    rows.iter()
        .try_for_each(|row| writer.serialize(row))
        .map_err(Failure::io)?;
    writer.flush().map_err(Failure::io)
}

fn measure(case: &SceneCase, suite: &Suite, seconds: f64) -> Result<(Vec<Row>, f64), Failure> {
    let overrides = suite.runs.first().map(|run| run.overrides.clone()).unwrap_or_default();
    let (description, said) = load(&case.path, &overrides)?;
    let size = [description.camera.width, description.camera.height];
    let paths = overrides.paths.or(description.defaults.paths_per_pass);
    let question = Question::new(said, paths);
    let begun = cpu_seconds();
    let choice = Choice::new(&Cpu, &description, question);
    let pilot_seconds = cpu_seconds().zip(begun).map_or(0.0, |(now, then)| now - then);
    let Some(choice) = choice else {
        return Ok((Vec::new(), pilot_seconds));
    };
    // The chosen plan comes first.
    let chosen = choice.candidates[choice.best];
    let mut candidates = vec![chosen];
    let others = Choice::all(&Cpu, &description, question);
    candidates.extend(
        others
            .into_iter()
            .filter(|other| other.settings.techniques != chosen.settings.techniques),
    );
    let reference = case.reference.as_ref();
    let reference = reference.map(|path| Reference::read(path, case.reference_noise, size));
    let reference = reference.transpose()?;
    let runs = candidates.iter().map(|candidate| {
        let task = |seed: u64| {
            let mut overrides = overrides.clone();
            overrides.seed = Some(said.seed.wrapping_add(seed));
            overrides.threads = Some(1);
            Task {
                scene: case.path.clone(),
                overrides,
                integrator: Integrator::Beams,
                paths_per_pass: candidate.settings.paths_per_pass,
                techniques: candidate.settings.techniques,
                passes: MAX_PASSES,
                seconds: Some(seconds),
            }
        };
        both([task(0), task(1)], size)
    });
    let runs = runs.collect::<Result<Vec<_>, _>>()?;
    Ok((rows(&case.name, &candidates, &runs, reference.as_ref()), pilot_seconds))
}

/// Run both at once, each on one thread.
fn both(tasks: [Task; 2], size: [u32; 2]) -> Result<[Step; 2], Failure> {
    let last = |task: &Task| -> Result<Step, Failure> {
        let mut last = Err(Failure::job("no pass was rendered"));
        for step in Run::start(task, size)? {
            last = Ok(step?);
        }
        last
    };
    let [first, second] = std::thread::scope(|scope| {
        let threads = tasks.each_ref().map(|task| scope.spawn(move || last(task)));
        threads.map(|thread| thread.join().unwrap_or_else(|_| Err(Failure::job("a run broke off"))))
    });
    Ok([first?, second?])
}

fn rows(scene: &str, candidates: &[Candidate], runs: &[[Step; 2]], reference: Option<&Reference>) -> Vec<Row> {
    let truths = match reference {
        Some(reference) => [0, 1].map(|_| (reference.image.clone(), reference.noise.unwrap_or(0.0))),
        None => [1, 0].map(|seed| together(&runs.iter().map(|run| &run[seed].image).collect::<Vec<_>>(), runs)),
    };
    // Per plan, the error of each block over both seeds.
    let blocks: Vec<Vec<f64>> = runs.iter().map(|run| blocks(run, &truths)).collect();
    let seconds = |run: &[Step; 2]| run.iter().filter_map(|step| step.sample.core_seconds).sum::<f64>() / 2.0;
    let cost = |plan: usize, left_out: Option<usize>| {
        let kept = blocks[plan].iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
        let (sum, count) = kept.fold((0.0, 0), |(sum, count), (_, value)| (sum + value, count + 1));
        // A reference cannot resolve errors far below its own noise.
        let least = TOLD * truths[0].1.max(f64::MIN_POSITIVE);
        (sum / f64::from(count.max(1))).max(least) * seconds(&runs[plan])
    };
    let best = (0..runs.len()).min_by(|&a, &b| cost(a, None).total_cmp(&cost(b, None)));
    let best = best.unwrap_or(0);
    let predicted = candidates[0].cost();
    let row = |(plan, candidate): (usize, &Candidate)| {
        let ratio = |left_out| libm::log(cost(plan, left_out) / cost(best, left_out));
        let all = blocks[plan].len();
        let without: Vec<f64> = (0..all).map(|block| ratio(Some(block))).collect();
        let mean = without.iter().sum::<f64>() / all as f64;
        let squares: f64 = without.iter().map(|value| (value - mean) * (value - mean)).sum();
        Row {
            scene: scene.to_owned(),
            plan: candidate.settings.techniques.to_string(),
            chosen: plan == 0,
            predicted: candidate.cost() / predicted,
            paths_per_pass: candidate.settings.paths_per_pass,
            passes: runs[plan].iter().map(|step| step.sample.passes).sum::<u64>() / 2,
            core_seconds: seconds(&runs[plan]),
            error: cost(plan, None) / seconds(&runs[plan]),
            ratio: libm::exp(ratio(None)),
            uncertainty: libm::sqrt(squares * (all - 1) as f64 / all as f64),
        }
    };
    candidates.iter().enumerate().map(row).collect()
}

/// Mean relative squared error of each block over both seeds, minus the reference's noise.
fn blocks(run: &[Step; 2], truths: &[(Film, f64); 2]) -> Vec<f64> {
    let (width, height) = (truths[0].0.width as usize, truths[0].0.height as usize);
    let mut blocks = Vec::new();
    for top in (0..height).step_by(BLOCK) {
        for left in (0..width).step_by(BLOCK) {
            let (mut sum, mut count) = (0.0, 0);
            for (step, (truth, noise)) in run.iter().zip(truths) {
                for y in top..(top + BLOCK).min(height) {
                    for x in left..(left + BLOCK).min(width) {
                        let pixel = y * width + x;
                        sum += square_error(&step.image, truth, pixel) - noise;
                        count += 1;
                    }
                }
            }
            blocks.push(sum / f64::from(count));
        }
    }
    blocks
}

fn square_error(image: &Film, truth: &Film, pixel: usize) -> f64 {
    let of_channel = |channel: usize| {
        let (x, t) = (image.pixels[pixel][channel], truth.pixels[pixel][channel]);
        let (x, t) = (f64::from(x), f64::from(t));
        (x - t) * (x - t) / (t * t + 0.01)
    };
    (0..3).map(of_channel).sum::<f64>() / 3.0
}

fn rel_mse(image: &Film, truth: &Film) -> f64 {
    let pixels = 0..image.pixels.len();
    pixels.map(|pixel| square_error(image, truth, pixel)).sum::<f64>() / image.pixels.len() as f64
}

/// A combination of all plans' images, and its noise as relMSE. Starts from the median of each pixel, which a few
/// fireflies or a plan that missed a light do not affect.
fn together(images: &[&Film], runs: &[[Step; 2]]) -> (Film, f64) {
    let mut truth = images[0].clone();
    let values = truth.pixels.len();
    for pixel in 0..values {
        for channel in 0..3 {
            let mut of_plans: Vec<f32> = images.iter().map(|image| image.pixels[pixel][channel]).collect();
            of_plans.sort_by(f32::total_cmp);
            truth.pixels[pixel][channel] = of_plans[of_plans.len() / 2];
        }
    }
    let mut weights = vec![1.0; images.len()];
    for _ in 0..ROUNDS {
        weights = (images.iter())
            .map(|image| 1.0 / rel_mse(image, &truth).max(f64::MIN_POSITIVE))
            .collect();
        let total: f64 = weights.iter().sum();
        for pixel in 0..values {
            for channel in 0..3 {
                let of_plan = |(image, weight): (&&Film, &f64)| weight * f64::from(image.pixels[pixel][channel]);
                let sum: f64 = images.iter().zip(&weights).map(of_plan).sum();
                truth.pixels[pixel][channel] = (sum / total) as f32;
            }
        }
    }
    let total: f64 = weights.iter().sum();
    // Half the squared difference of a plan's two images estimates its variance.
    let variance = |run: &[Step; 2]| {
        let of_pixel = |pixel: usize| {
            let of_channel = |channel: usize| {
                let [a, b] = [0, 1].map(|seed: usize| f64::from(run[seed].image.pixels[pixel][channel]));
                let t = f64::from(truth.pixels[pixel][channel]);
                0.5 * (a - b) * (a - b) / (t * t + 0.01)
            };
            (0..3).map(of_channel).sum::<f64>() / 3.0
        };
        (0..values).map(of_pixel).sum::<f64>() / values as f64
    };
    let noise = runs.iter().zip(&weights).map(|(run, weight)| {
        let share = weight / total;
        share * share * variance(run)
    });
    let noise = noise.sum();
    (truth, noise)
}

/// Summary of a scene.
fn summary(rows: &[Row], pilot_seconds: f64) -> Option<Vec<String>> {
    let best = rows.iter().find(|row| row.ratio == 1.0)?;
    let chosen = rows.iter().find(|row| row.chosen)?;
    Some(vec![
        chosen.scene.clone(),
        format!("{:.2}", chosen.ratio),
        format!("{:.2}", chosen.uncertainty),
        chosen.plan.clone(),
        best.plan.clone(),
        format!("{pilot_seconds:.1}"),
    ])
}

fn table(rows: &[Row], told: Vec<Vec<String>>, seconds: f64) -> Table {
    let regrets: Vec<f64> = rows.iter().filter(|row| row.chosen).map(|row| row.ratio).collect();
    let mean = libm::exp(regrets.iter().copied().map(libm::log).sum::<f64>() / regrets.len() as f64);
    let most = regrets.iter().copied().fold(1.0, f64::max);
    Table {
        title: format!(
            "Squared error x time of the chosen plan over that of the best, {seconds} s each: geometric mean \
             {mean:.3}, at most {most:.2}"
        ),
        head: ["scene", "regret", "± of its log", "chosen", "best", "pilot, core-s"]
            .map(str::to_owned)
            .to_vec(),
        rows: told,
    }
}
