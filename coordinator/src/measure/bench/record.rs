//! Results of a benchmark, and the files for programs.

use super::analysis::{Clock, Fit, TARGETS, TimeTo, fit, time_to};
use super::comparison::{Comparison, Reference};
use super::machine::Machine;
use super::overrides::Overrides;
use super::run::Sample;
use super::suite::Point;
use crate::failure::Failure;
use beamfarm_image::atomic::write_file;
use beamfarm_image::film::Film;
use beamfarm_image::view::View;
use beamfarm_proto::VERSION;
use beamfarm_worker::engine::KernelTime;
use serde::Serialize;
use std::path::Path;

/// All results.
pub struct Findings {
    pub title: String,
    pub date: Option<String>,
    pub machine: Machine,
    pub scenes: Vec<SceneFindings>,
}

/// Results of one scene.
pub struct SceneFindings {
    pub name: String,
    pub hash: String,
    pub view: View,
    pub crops: Vec<[u32; 2]>,
    pub reference: Option<Reference>,
    pub runs: Vec<RunFindings>,
    pub peers: Vec<PeerFindings>,
}

/// One run of it.
pub struct RunFindings {
    pub name: String,
    pub settings: Settings,
    pub records: Vec<Record>,
    /// Time per pass of each of a device's kernels.
    pub kernels: Vec<KernelTime>,
    /// Some of the images, each with its number of passes.
    pub images: Vec<(u64, Film)>,
}

/// Results of another renderer.
pub struct PeerFindings {
    pub name: String,
    pub points: Vec<Point>,
    pub image: Option<(Film, Comparison)>,
}

/// Settings of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    pub width: u32,
    pub height: u32,
    pub paths_per_pass: u32,
    pub alpha: f64,
    pub schedule: String,
    pub seed: u64,
    pub threads: u16,
    /// What differs from the scene's own settings.
    pub overrides: Overrides,
}

/// A run after some passes. Counts are sums over these passes; times exclude measuring.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    pub scene: String,
    pub run: String,
    pub width: u32,
    pub height: u32,
    pub threads: u16,
    pub passes: u64,
    pub prepare_seconds: f64,
    pub wall_seconds: f64,
    pub core_seconds: Option<f64>,
    pub photon_paths: u64,
    pub beams: u64,
    pub beam_evaluations: u64,
    pub surface_photons: u64,
    pub peak_memory_bytes: Option<u64>,
    pub bytes_per_beam: Option<f64>,
    /// Peak of the whole process.
    pub bytes_per_pixel: Option<f64>,
    pub rmse: Option<f64>,
    pub rel_mse: Option<f64>,
    pub net_rel_mse: Option<f64>,
    pub mean_ratio: Option<f64>,
    pub block_deviation: Option<f64>,
    pub block_x: Option<u32>,
    pub block_y: Option<u32>,
    pub estimated_relative_error: Option<f64>,
    pub estimated_rel_mse: Option<f64>,
}

impl Record {
    pub fn new(scene: &str, run: &str, settings: &Settings, sample: &Sample, found: Option<Comparison>) -> Self {
        let pixels = u64::from(settings.width) * u64::from(settings.height);
        let beams = sample.beams > 0;
        Self {
            scene: scene.to_owned(),
            run: run.to_owned(),
            width: settings.width,
            height: settings.height,
            threads: settings.threads,
            passes: sample.passes,
            prepare_seconds: sample.prepare_seconds,
            wall_seconds: sample.wall_seconds,
            core_seconds: sample.core_seconds,
            photon_paths: sample.photon_paths,
            beams: sample.beams,
            beam_evaluations: sample.beam_evaluations,
            surface_photons: sample.surface_photons,
            peak_memory_bytes: sample.peak_memory_bytes,
            bytes_per_beam: beams.then(|| sample.beam_bytes as f64 / sample.beams as f64),
            bytes_per_pixel: sample.peak_memory_bytes.map(|bytes| bytes as f64 / pixels as f64),
            rmse: found.map(|found| found.rmse),
            rel_mse: found.map(|found| found.rel_mse),
            net_rel_mse: found.and_then(|found| found.net_rel_mse),
            mean_ratio: found.map(|found| found.mean_ratio),
            block_deviation: found.map(|found| found.block_deviation),
            block_x: found.map(|found| found.block[0]),
            block_y: found.map(|found| found.block[1]),
            estimated_relative_error: sample.estimated_relative_error,
            estimated_rel_mse: sample.estimated_rel_mse,
        }
    }

    /// The best available estimate of the error as relMSE: measured, minus the reference's noise if known; the
    /// renderer's own estimate without a reference.
    pub fn error(&self) -> Option<f64> {
        self.net_rel_mse.or(self.rel_mse).or(self.estimated_rel_mse)
    }
}

impl RunFindings {
    /// Error over time, where the error is positive.
    pub fn points(&self) -> Vec<Point> {
        let point = |record: &Record| {
            record.error().map(|rel_mse| Point {
                wall_seconds: record.wall_seconds,
                core_seconds: record.core_seconds,
                rel_mse,
            })
        };
        let positive = |point: &Point| point.rel_mse > 0.0 && point.wall_seconds > 0.0;
        self.records.iter().filter_map(point).filter(positive).collect()
    }
}

impl Findings {
    pub fn records(&self) -> impl Iterator<Item = &Record> {
        let runs = self.scenes.iter().flat_map(|scene| &scene.runs);
        runs.flat_map(|run| &run.records)
    }

    /// One row per record.
    pub fn write_csv(&self, path: &Path) -> Result<(), Failure> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for record in self.records() {
            writer.serialize(record).map_err(Failure::io)?;
        }
        let bytes = writer.into_inner().map_err(Failure::io)?;
        Ok(write_file(path, &bytes)?)
    }

    /// Everything except the images.
    pub fn write_json(&self, path: &Path) -> Result<(), Failure> {
        #[derive(Serialize)]
        struct File<'a> {
            beamfarm: &'a str,
            title: &'a str,
            #[serde(skip_serializing_if = "Option::is_none")]
            date: Option<&'a str>,
            machine: &'a Machine,
            scenes: Vec<SceneEntry<'a>>,
        }
        #[derive(Serialize)]
        struct SceneEntry<'a> {
            name: &'a str,
            hash: &'a str,
            reference_noise: Option<f64>,
            runs: Vec<RunEntry<'a>>,
            peers: Vec<PeerEntry<'a>>,
        }
        #[derive(Serialize)]
        struct RunEntry<'a> {
            name: &'a str,
            settings: &'a Settings,
            /// By wall-clock time.
            slope: Option<Fit>,
            times_to: Vec<Time>,
            records: &'a [Record],
            #[serde(skip_serializing_if = "<[_]>::is_empty")]
            kernels: &'a [KernelTime],
        }
        #[derive(Serialize)]
        struct PeerEntry<'a> {
            name: &'a str,
            slope: Option<Fit>,
            times_to: Vec<Time>,
            points: &'a [Point],
            #[serde(skip_serializing_if = "Option::is_none")]
            image: Option<&'a Comparison>,
        }
        #[derive(Serialize)]
        struct Time {
            rel_mse: f64,
            #[serde(flatten)]
            wall: TimeTo,
        }
        let times = |curve: &[(f64, f64)]| {
            let time = |rel_mse| Time {
                rel_mse,
                wall: time_to(curve, rel_mse),
            };
            TARGETS.into_iter().map(time).collect()
        };
        let scenes = self.scenes.iter().map(|scene| SceneEntry {
            name: &scene.name,
            hash: &scene.hash,
            reference_noise: scene.reference.as_ref().and_then(|r| r.noise),
            runs: scene
                .runs
                .iter()
                .map(|run| {
                    let curve = Clock::Wall.curve(&run.points());
                    RunEntry {
                        name: &run.name,
                        settings: &run.settings,
                        slope: fit(&curve),
                        times_to: times(&curve),
                        records: &run.records,
                        kernels: &run.kernels,
                    }
                })
                .collect(),
            peers: scene
                .peers
                .iter()
                .map(|peer| {
                    let curve = Clock::Wall.curve(&peer.points);
                    PeerEntry {
                        name: &peer.name,
                        slope: fit(&curve),
                        times_to: times(&curve),
                        points: &peer.points,
                        image: peer.image.as_ref().map(|(_, found)| found),
                    }
                })
                .collect(),
        });
        let file = File {
            beamfarm: VERSION,
            title: &self.title,
            date: self.date.as_deref(),
            machine: &self.machine,
            scenes: scenes.collect(),
        };
        let bytes = serde_json::to_vec_pretty(&file).map_err(Failure::io)?;
        Ok(write_file(path, &bytes)?)
    }
}
