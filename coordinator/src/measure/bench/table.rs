//! Tables of a report, for the page and the terminal.

use super::analysis::{Clock, TARGETS, digits, error_at, fit, power, time_to, times_faster};
use super::record::{Record, RunFindings, SceneFindings};
use super::suite::Point;
use crate::measure::figure::superscript;
use beamfarm_worker::engine::KernelTime;
use comfy_table::presets::UTF8_FULL_CONDENSED;

/// Rows of text; the first column names the row.
pub struct Table {
    pub title: String,
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// The table as plain text.
    pub fn plain(&self) -> String {
        let mut table = comfy_table::Table::new();
        table.load_style(UTF8_FULL_CONDENSED);
        table.set_header(&self.head).add_rows(&self.rows);
        format!("{}\n{table}", self.title)
    }
}

/// Every curve of error over time: the runs, then the other renderers.
pub fn curves(scene: &SceneFindings) -> Vec<(String, Vec<Point>)> {
    let runs = scene.runs.iter().map(|run| (run.name.clone(), run.points()));
    let peers = scene.peers.iter().map(|peer| (peer.name.clone(), peer.points.clone()));
    runs.chain(peers).collect()
}

/// Times to reach the errors in [`TARGETS`].
pub fn times(scene: &SceneFindings, clock: Clock) -> Table {
    let mut head = vec!["renderer".to_owned()];
    head.extend(TARGETS.map(target_name));
    head.push("slope".into());
    let known = curves(scene)
        .into_iter()
        .map(|(name, points)| (name, clock.curve(&points)));
    let rows = known.filter(|(_, curve)| !curve.is_empty()).map(|(name, curve)| {
        let mut row = vec![name];
        row.extend(TARGETS.map(|target| time_to(&curve, target).text()));
        row.push(match fit(&curve) {
            Some(fit) => format!("{:.2} ({} points)", fit.slope, fit.points).replace('-', "\u{2212}"),
            None => "\u{2013}".into(),
        });
        row
    });
    Table {
        title: format!("Time to an error, {}", clock.unit()),
        head,
        rows: rows.collect(),
    }
}

/// Time per pass of each of a device's kernels.
pub fn kernels(run: &RunFindings) -> Table {
    let all: f64 = run.kernels.iter().map(|kernel| kernel.seconds).sum();
    let row = |kernel: &KernelTime| {
        vec![
            kernel.kernel.clone(),
            kernel.dispatches.to_string(),
            format!("{:.3}", 1e3 * kernel.seconds),
            format!("{:.1}", 100.0 * kernel.seconds / all),
        ]
    };
    Table {
        title: format!("Kernels of a pass, {}: {:.3} ms in all", run.name, 1e3 * all),
        head: ["kernel", "dispatches", "ms", "%"].map(str::to_owned).to_vec(),
        rows: run.kernels.iter().map(row).collect(),
    }
}

/// How many times sooner each run reaches an error than other renderers and than runs of another engine, as far as
/// their times on this clock are known.
pub fn ratios(scene: &SceneFindings, clock: Clock) -> Table {
    let mut head = vec!["run".to_owned(), "against".to_owned()];
    head.extend(TARGETS.map(target_name));
    let mut rows = Vec::new();
    for (i, run) in scene.runs.iter().enumerate() {
        let ours = clock.curve(&run.points());
        let engine = run.settings.overrides.engine;
        let later = scene.runs[i + 1..].iter();
        let others = later.filter(|other| other.settings.overrides.engine != engine);
        let others = others.map(|other| (&other.name, other.points()));
        let peers = scene.peers.iter().map(|peer| (&peer.name, peer.points.clone()));
        for (name, points) in others.chain(peers) {
            let theirs = clock.curve(&points);
            if ours.is_empty() || theirs.is_empty() {
                continue;
            }
            let mut row = vec![run.name.clone(), name.clone()];
            row.extend(TARGETS.map(|target| times_faster(time_to(&ours, target), time_to(&theirs, target))));
            rows.push(row);
        }
    }
    Table {
        title: format!("Times faster, {}", clock.unit()),
        head,
        rows,
    }
}

/// Errors of all scenes at a given time, one column per renderer.
pub fn errors_at(scenes: &[SceneFindings], seconds: f64) -> Table {
    let mut names: Vec<String> = Vec::new();
    for (name, _) in scenes.iter().flat_map(curves) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let row = |scene: &SceneFindings| {
        let known = curves(scene);
        let error = |name: &String| {
            let (_, points) = known.iter().find(|(known, _)| known == name)?;
            error_at(&Clock::Wall.curve(points), seconds)
        };
        let errors = names.iter().map(|name| error(name).map_or("\u{2013}".into(), power));
        [scene.name.clone()].into_iter().chain(errors).collect()
    };
    Table {
        title: format!("relMSE after {seconds} wall seconds of rendering"),
        rows: scenes.iter().map(row).collect(),
        head: ["scene".to_owned()].into_iter().chain(names).collect(),
    }
}

fn target_name(target: f64) -> String {
    format!("relMSE 10{}", superscript(&format!("{:.0}", libm::log10(target))))
}

/// All records.
pub fn records(scene: &SceneFindings) -> Table {
    let percent = |value: f64| format!("{} %", digits(100.0 * value).replace('-', "\u{2212}"));
    let mut head = vec!["renderer".to_owned()];
    let records: Vec<&Record> = scene.runs.iter().flat_map(|run| &run.records).collect();
    let mut rows: Vec<Vec<String>> = records.iter().map(|r| vec![r.run.clone()]).collect();
    let mut add = |name: &str, value: &dyn Fn(&Record) -> Option<String>| {
        head.push(name.to_owned());
        for (row, record) in rows.iter_mut().zip(&records) {
            row.push(value(record).unwrap_or_else(|| "\u{2013}".into()));
        }
    };
    add("passes", &|r| Some(r.passes.to_string()));
    add("wall s", &|r| Some(digits(r.wall_seconds)));
    add("core-s", &|r| r.core_seconds.map(digits));
    add("photon paths", &|r| Some(count(r.photon_paths)));
    add("beams", &|r| Some(count(r.beams)));
    add("beam evaluations", &|r| Some(count(r.beam_evaluations)));
    add("surface photons", &|r| Some(count(r.surface_photons)));
    add("RMSE", &|r| r.rmse.map(digits));
    add("relMSE", &|r| r.rel_mse.map(power));
    add("net relMSE", &|r| r.net_rel_mse.map(power));
    add("mean ratio", &|r| r.mean_ratio.map(|v| format!("{v:.4}")));
    add("largest 8 x 8 block", &|r| {
        let at = r.block_x.zip(r.block_y)?;
        Some(format!("{} at {}, {}", percent(r.block_deviation?), at.0, at.1))
    });
    add("estimated relMSE", &|r| r.estimated_rel_mse.map(power));
    add("estimated error", &|r| r.estimated_relative_error.map(percent));
    // Other renderers' images, as far as known.
    for peer in &scene.peers {
        let Some((_, found)) = &peer.image else {
            continue;
        };
        let mut row = vec!["\u{2013}".to_owned(); head.len()];
        let mut set = |name: &str, text: String| {
            if let Some(i) = head.iter().position(|column| column == name) {
                row[i] = text;
            }
        };
        let point = peer.points.iter().find(|point| point.rel_mse == found.error());
        set("renderer", peer.name.clone());
        if let Some(point) = point {
            set("wall s", digits(point.wall_seconds));
            set("core-s", point.core_seconds.map_or("\u{2013}".into(), digits));
        }
        set("RMSE", digits(found.rmse));
        set("relMSE", power(found.rel_mse));
        set("net relMSE", found.net_rel_mse.map_or("\u{2013}".into(), power));
        set("mean ratio", format!("{:.4}", found.mean_ratio));
        let at = found.block;
        let block = format!("{} at {}, {}", percent(found.block_deviation), at[0], at[1]);
        set("largest 8 x 8 block", block);
        rows.push(row);
    }
    Table {
        title: "All measurements".into(),
        head,
        rows,
    }
}

/// Peak memory of the runs.
pub fn memory(scene: &SceneFindings) -> Table {
    let head = [
        "renderer",
        "peak of the process",
        "bytes a pixel at the peak",
        "beams a pass",
        "bytes a beam",
        "beams' share a pass",
    ];
    let rows = scene.runs.iter().filter_map(|run| {
        let record = run.records.last()?;
        let dash = || "\u{2013}".to_owned();
        let beams = record.beams as f64 / record.passes as f64;
        let optional = |value: Option<f64>| value.map_or_else(dash, digits);
        Some(vec![
            run.name.clone(),
            record.peak_memory_bytes.map_or_else(dash, |b| megabytes(b as f64)),
            optional(record.bytes_per_pixel),
            digits(beams),
            optional(record.bytes_per_beam),
            record.bytes_per_beam.map_or_else(dash, |b| megabytes(b * beams)),
        ])
    });
    Table {
        title: "Memory".into(),
        rows: rows.collect(),
        head: head.map(str::to_owned).to_vec(),
    }
}

fn megabytes(bytes: f64) -> String {
    format!("{} MB", digits(1e-6 * bytes))
}

/// An integer, without an exponent if that is short.
fn count(n: u64) -> String {
    match n {
        0..1_000_000 => n.to_string(),
        n => power(n as f64),
    }
}
