//! The record of a job's error over time, next to its image.

use crate::failure::Failure;
use beamfarm_coordinator::store::RETRY;
use beamfarm_coordinator::watch::Point;
use beamfarm_coordinator::{Progress, Watch};
use beamfarm_image::atomic::write_file;
use beamfarm_image::input;
use beamfarm_image::job::PassStats;
use beamfarm_image::merge::Average;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep};
use tracing::{Span, warn};

pub const HELP: &str = "\
Beside the image OUT.exr stands OUT.csv: a row whenever the number of passes has doubled, and the last. Its columns:
passes, wall_seconds since the job began, worker_seconds (the same summed over the workers that were there),
photon_paths, beams, beam_evaluations, surface_photons (of all passes that had arrived by then),
relative_standard_error (estimated; empty for one pass).";

/// Time between checks of the number of passes.
const LOOK: Duration = Duration::from_millis(50);

/// The job at a number of complete passes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    passes: u64,
    wall_seconds: f64,
    worker_seconds: f64,
    photon_paths: u64,
    beams: u64,
    beam_evaluations: u64,
    surface_photons: u64,
    relative_standard_error: Option<f64>,
}

/// The rows so far, and their file.
pub struct History {
    path: PathBuf,
    started: Instant,
    /// Time that earlier coordinators spent on the job.
    before: Duration,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    rows: Vec<Row>,
    worker_seconds: f64,
    looked: Duration,
}

impl State {
    /// Credit the current workers with the time since the last call.
    fn look(&mut self, now: Duration, workers: u32) {
        let since = now.saturating_sub(self.looked).as_secs_f64();
        self.worker_seconds += since * f64::from(workers);
        self.looked = now;
    }

    fn is_due(&self, passes: u64) -> bool {
        let last = self.rows.last().map_or(0, |row| row.passes);
        passes > 0 && passes >= last.saturating_mul(2)
    }

    fn add(&mut self, average: &Average, stats: PassStats) {
        let error = average.relative_standard_error();
        let row = Row {
            passes: average.passes,
            wall_seconds: self.looked.as_secs_f64(),
            worker_seconds: self.worker_seconds,
            photon_paths: stats.paths,
            beams: stats.beams,
            beam_evaluations: stats.beam_evaluations,
            surface_photons: stats.surface_photons,
            relative_standard_error: Some(error).filter(|error| error.is_finite()),
        };
        // A row with the same passes may get an error at the end, but not before.
        if self.rows.last().is_none_or(|last| last.passes < row.passes) {
            self.rows.push(row);
        }
    }
}

impl History {
    /// The record next to this image. A resumed job keeps the rows up to its number of passes and continues from time
    /// `before`; a new job starts empty. Its clock starts now.
    pub fn new(exr: &Path, passes: u64, before: Duration) -> Arc<Self> {
        let path = exr.with_extension("csv");
        let mut rows = Vec::new();
        if passes > 0
            && let Ok(file) = input::open(&path)
        {
            let mut reader = csv::Reader::from_reader(file);
            let known = reader.deserialize().map_while(Result::ok);
            rows.extend(known.take_while(|row: &Row| row.passes <= passes));
        }
        let worker_seconds = rows.last().map_or(0.0, |row| row.worker_seconds);
        Arc::new(Self {
            path,
            started: Instant::now(),
            before,
            state: Mutex::new(State {
                rows,
                worker_seconds,
                looked: before,
            }),
        })
    }

    /// The known errors, in pass order.
    pub fn points(&self) -> Vec<Point> {
        let rows = &self.state().rows;
        let point = |row: &Row| {
            row.relative_standard_error.map(|error| Point {
                passes: row.passes,
                seconds: row.wall_seconds,
                error,
            })
        };
        rows.iter().filter_map(point).collect()
    }

    /// Elapsed time without pauses.
    fn elapsed(&self, progress: &Progress) -> Duration {
        self.before + self.started.elapsed().saturating_sub(progress.paused_for)
    }

    /// Keep the record up to date, forever, and report errors to `watch`.
    pub async fn keep(self: Arc<Self>, watch: Arc<Watch>) {
        let farm = watch.farm().clone();
        let mut ticks = interval(LOOK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            ticks.tick().await;
            let progress = farm.progress();
            let due = {
                let mut state = self.state();
                state.look(self.elapsed(&progress), progress.workers);
                state.is_due(progress.prefix)
            };
            if !due {
                continue;
            }
            let (history, farm, watch) = (self.clone(), farm.clone(), watch.clone());
            let span = Span::current();
            let add = move || {
                let _job = span.entered();
                match farm.average() {
                    Some(average) => {
                        let written = history.write(&average, &progress);
                        if let Some(point) = history.points().last() {
                            watch.note_error(point.passes, point.error);
                        }
                        written
                    }
                    None => Ok(()),
                }
            };
            match tokio::task::spawn_blocking(add).await {
                Ok(Ok(())) => {}
                // It is written again at the end; a failure then fails the job.
                Ok(Err(failure)) => {
                    warn!("{failure}");
                    sleep(RETRY).await;
                }
                Err(error) => warn!("{error}"),
            }
        }
    }

    /// Add the last row.
    pub fn finish(&self, average: &Average, progress: &Progress) -> Result<(), Failure> {
        self.state().look(self.elapsed(progress), progress.workers);
        self.write(average, progress)
    }

    fn write(&self, average: &Average, progress: &Progress) -> Result<(), Failure> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut state = self.state();
        state.add(average, progress.stats);
        for row in &state.rows {
            writer.serialize(row).map_err(Failure::io)?;
        }
        let bytes = writer.into_inner().map_err(Failure::io)?;
        Ok(write_file(&self.path, &bytes)?)
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::film::Film;
    use beamfarm_image::merge::{Node, TreeSum};

    fn average(passes: u64) -> Average {
        let mut sum = TreeSum::new(1, 1);
        for pass in 0..passes {
            let mut film = Film::new(1, 1);
            film.pixels[0] = [1.0 + pass as f32; 3];
            sum.insert(Node::leaf(pass, film)).unwrap();
        }
        sum.average().unwrap()
    }

    #[test]
    fn rows_come_with_doublings() {
        let mut state = State::default();
        assert!(!state.is_due(0) && state.is_due(1));
        let mut kept = Vec::new();
        for passes in 1..=20 {
            state.look(Duration::from_secs(passes), 3);
            if state.is_due(passes) {
                state.add(&average(passes), PassStats::default());
                kept.push(passes);
            }
        }
        assert_eq!(kept, [1, 2, 4, 8, 16]);
        assert_eq!(state.rows[4].wall_seconds, 16.0);
        assert_eq!(state.rows[4].worker_seconds, 48.0);
        assert_eq!(state.rows[0].relative_standard_error, None);
        assert!(state.rows[1].relative_standard_error.is_some());
        // The end of a job whose last row exists already.
        state.add(&average(16), PassStats::default());
        assert_eq!(state.rows.len(), 5);
    }

    #[test]
    fn the_file_stands_beside_the_image() {
        let folder = tempfile::tempdir().unwrap();
        let history = History::new(&folder.path().join("a.b.exr"), 0, Duration::ZERO);
        let stats = PassStats {
            paths: 7,
            ..PassStats::default()
        };
        let progress = Progress {
            stats,
            ..Progress::default()
        };
        history.finish(&average(1), &progress).unwrap();
        history.finish(&average(2), &progress).unwrap();
        let text = std::fs::read_to_string(folder.path().join("a.b.csv")).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert!(lines[0].starts_with("passes,wall_seconds,worker_seconds,photon_paths"));
        assert!(lines[1].starts_with("1,") && lines[1].contains(",7,") && lines[1].ends_with(','));
        assert!(lines[2].starts_with("2,") && !lines[2].ends_with(','));

        // A resumed job keeps the rows up to its passes.
        let again = History::new(&folder.path().join("a.b.exr"), 1, Duration::from_secs(9));
        assert_eq!(again.points(), []);
        again.finish(&average(3), &progress).unwrap();
        let point = again.points()[0];
        assert!(point.passes == 3 && point.seconds >= 9.0 && point.error > 0.0);
        let text = std::fs::read_to_string(folder.path().join("a.b.csv")).unwrap();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows.len(), 3, "{text}");
        assert_eq!(rows[..2], lines[..2]);
        assert!(rows[2].starts_with("3,9."), "{text}");
    }
}
