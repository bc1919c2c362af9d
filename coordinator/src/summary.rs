//! The summary at the end of a job: on stdout, in report.json and as exit code.

use crate::failure::Failure;
use crate::image::Written;
use crate::job::JobArgs;
use crate::output::{Output, denoised_name};
use crate::progress::si;
use beamfarm_coordinator::store::{BiasReport, Report, Stopped};
use beamfarm_coordinator::{End, Farm};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::job::{EngineKind, MAX_PASSES, PassStats};
use beamfarm_image::merge::{Average, REPLICATION};
use beamfarm_proto::VERSION;
use beamfarm_worker::say;

/// With fewer photons than this in the whole job, their light is known to no better than a tenth even if all carry the
/// same.
const FEW_PHOTONS: u64 = 100;

/// Why the job stopped.
pub enum Stop {
    /// The farm ended by itself.
    Ended(End),
    /// The time limit was reached.
    Time,
    /// Someone sent a signal.
    Signal,
    /// Something that had to keep running failed.
    Broken(String),
}

/// A finished job.
pub struct Summary<'a> {
    pub args: &'a JobArgs,
    pub output: &'a Output,
    pub farm: &'a Farm,
    /// The image that was written.
    pub image: Option<Written>,
    /// What was written in its place, for display.
    pub sketch: Option<String>,
    pub stop: Stop,
}

/// Print which passes an image is made of, and how good it is.
pub fn describe(average: &Average, pass_set: &str) {
    say!("passes 0 to {}, set {pass_set}", average.passes - 1);
    describe_error(average);
    if let Some(bias) = &average.bias {
        say!("{bias}");
        if let Some(tiles) = bias.tiles_in_words() {
            say!("{tiles}");
        }
    }
    say!("pixels {}", pixel_hash(&average.beauty));
}

/// Print how noisy an image is, and whether a few pixels cause most of it.
pub fn describe_error(average: &Average) {
    let error = average.relative_standard_error();
    if !error.is_finite() {
        return;
    }
    let noise = average.noise();
    let median = noise.median.map_or_else(String::new, |median| {
        format!(", median of lit 8 x 8 blocks {:.2} %", 100.0 * median)
    });
    let upper = match average.has_upper_error() {
        true => format!(" (upper estimates: fewer than {} passes)", 2 * REPLICATION),
        false => String::new(),
    };
    say!("relative standard error {:.2} %{median}{upper}", 100.0 * error);
    if let Some(fireflies) = noise.fireflies {
        say!("{fireflies}");
    }
}

/// A note if so few photons are left that their light, and its share of the error, is hardly known.
fn rare_photons(stats: &PassStats) -> Option<String> {
    let arrived = stats.surface_photons + stats.beams;
    let are_rare = stats.paths > 0 && arrived < FEW_PHOTONS && arrived < stats.paths / FEW_PHOTONS;
    are_rare.then(|| {
        format!(
            "note: {} photon paths left {arrived} photons and beams in all: this picture and its error hardly include \
             the light that they bring; aim photons (-D render.targeting=on), or let camera paths find that light \
             (-D render.caustics=paths -D render.surfaces=paths -D render.media=paths)",
            stats.paths
        )
    })
}

impl Summary<'_> {
    fn pass_set(&self) -> Option<String> {
        let Written { average, meta } = self.image.as_ref()?;
        Some(meta.pass_set(&self.farm.job().settings, average))
    }

    fn stopped(&self) -> Stopped {
        if self.farm.stopped_at().is_some() {
            return Stopped::TargetError;
        }
        match &self.stop {
            Stop::Ended(End::Complete) => Stopped::Complete,
            Stop::Ended(End::Stopped) | Stop::Signal => Stopped::Asked,
            Stop::Ended(End::Failed(_)) | Stop::Broken(_) => Stopped::Failed,
            Stop::Time => Stopped::Time,
        }
    }

    /// Print the summary for people.
    pub fn print(&self) {
        let progress = self.farm.progress();
        let seconds = self.farm.snapshot().seconds;
        if let Some(Written { average, .. }) = &self.image {
            say!(
                "wrote {}, {} and {}",
                self.output.exr.display(),
                self.output.png.display(),
                self.output.exr.with_extension("csv").display()
            );
            if self.output.denoise && average.passes > 1 {
                let denoised = denoised_name(&self.output.exr);
                say!("wrote {} and its PNG: denoised, and biased", denoised.display());
            }
            say!(
                "{} passes in {seconds:.1} s ({:.2} passes/s, {}beams/s) from {} {}",
                average.passes,
                average.passes as f64 / seconds,
                si(progress.stats.beams as f64 / seconds),
                progress.registered,
                if progress.registered == 1 { "worker" } else { "workers" },
            );
            let engine = self.farm.job().settings.engine;
            if engine != EngineKind::Cpu {
                say!("rendered by the engine {}", engine.identity());
            }
            // Devices do not measure it.
            if progress.stats.beam_bytes > 0 {
                say!("{:.0} bytes a beam", progress.stats.bytes_per_beam());
            }
            if self.stopped() == Stopped::TargetError {
                say!("stopped at the first test that met --target-error");
            }
            describe(average, &self.pass_set().unwrap_or_default());
            if let Some(rare) = rare_photons(&progress.stats) {
                say!("{rare}");
            }
        }
        if let Some(sketch) = &self.sketch {
            say!("{sketch}; no pass is complete, and it is part of none");
        }
        if self.args.first_pass > 0 && progress.prefix > self.args.first_pass {
            say!(
                "passes {} to {} are complete; `beamfarm merge` makes an image of them and those before",
                self.args.first_pass,
                progress.prefix - 1
            );
        }
        for (count, what) in [
            (progress.lost_leases, "leases were lost and handed out again"),
            (progress.duplicates, "blocks arrived twice, with equal bits"),
            (
                self.confirmed_passes(),
                "passes were rendered by two workers, with equal bits",
            ),
            (
                progress.dropped,
                "passes were dropped for their worker's wrong pixels, and rendered again",
            ),
            (progress.failures, "attempts at a pass failed"),
            (progress.refused, "deliveries were refused"),
        ] {
            if count > 0 {
                say!("{count} {what}");
            }
        }
    }

    fn confirmed_passes(&self) -> u64 {
        let blocks = self.farm.blocks();
        let confirmed = blocks.iter().filter(|done| done.confirmed);
        confirmed.map(|done| done.block.len()).sum()
    }

    /// The summary for programs.
    pub fn report(&self) -> Report {
        let progress = self.farm.progress();
        let reached = self.farm.snapshot();
        let average = self.image.as_ref().map(|written| &written.average);
        let errors = average
            .map(|average| average.errors())
            .filter(|errors| errors.image.is_finite());
        let noise = average.map(Average::noise);
        let bias = average.and_then(|average| average.bias.as_ref());
        let workers = progress.workers_seen.iter();
        let limit = self.args.passes.or_else(|| {
            // A limit set by the target error was not requested.
            let is_asked = progress.limit < MAX_PASSES && self.farm.stopped_at().is_none();
            is_asked.then_some(progress.limit)
        });
        Report {
            format: Report::FORMAT,
            version: VERSION.into(),
            scene: self.farm.job().scene.to_string(),
            engine: self.farm.job().settings.engine.identity(),
            seed: self.farm.job().settings.seed,
            first_pass: self.args.first_pass,
            prefix: average.map_or(reached.sum.prefix(), |average| average.passes),
            passes: reached.sum.passes(),
            limit,
            pass_set: self.pass_set(),
            image: average.map(|_| self.output.exr.display().to_string()),
            pixels: average.map(|average| pixel_hash(&average.beauty)),
            relative_standard_error: errors.map(|errors| errors.image),
            is_upper_error: average.is_some_and(Average::has_upper_error),
            percentiles: errors.map(|errors| [50, 90, 95, 99].map(|p| errors.at(Some(p)))),
            median_error: noise.and_then(|noise| noise.median),
            fireflies: noise.and_then(|noise| noise.fireflies).map(Into::into),
            bias: bias.map(ToString::to_string),
            bias_estimate: bias.and_then(BiasReport::new),
            seconds: reached.seconds,
            confirmed_passes: self.confirmed_passes(),
            workers: workers.map(|worker| worker.name.clone()).collect(),
            stopped: self.stopped(),
        }
    }

    /// The exit code.
    pub fn verdict(self) -> Result<(), Failure> {
        let progress = self.farm.progress();
        let is_part = self.args.first_pass > 0;
        let written = match (&self.image, is_part) {
            (Some(Written { average, .. }), _) => {
                format!("the image is that of the {} passes before", average.passes)
            }
            (None, true) => "the job folder has the passes before".into(),
            (None, false) if self.sketch.is_some() => "a coarse picture was written".into(),
            (None, false) => "nothing was written".into(),
        };
        if let Stop::Ended(End::Failed(failure)) = self.stop {
            return Err(Failure::job(format!(
                "pass {} failed {} times: {}; {written}",
                failure.pass_index, failure.attempts, failure.message
            )));
        }
        if let Stop::Broken(message) = self.stop {
            return Err(Failure::job(format!("{message}; {written}")));
        }
        if progress.divergent > 0 {
            return Err(Failure::job(format!(
                "{} blocks were delivered twice with different pixels, and nobody decided which are right: a machine \
                 miscalculates, and the image is not to be trusted (the log names them)",
                progress.divergent
            )));
        }
        if let (Stop::Signal, true) = (&self.stop, self.args.preemptible) {
            return Err(Failure::preempted(format!("stopped by a signal; {written}")));
        }
        let has_passes = is_part && progress.prefix > self.args.first_pass;
        match (self.stop, self.image) {
            (_, Some(_)) => Ok(()),
            _ if has_passes => Ok(()),
            (Stop::Signal | Stop::Ended(End::Stopped), None) => Err(Failure::nothing(format!(
                "stopped before the first pass was complete; {written}"
            ))),
            (_, None) => Err(Failure::nothing(format!(
                "the time was over before the first pass was complete; {written}; give it more with --time"
            ))),
        }
    }
}
