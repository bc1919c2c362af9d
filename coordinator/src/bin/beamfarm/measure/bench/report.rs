//! The page: one file, without anything from elsewhere.

use super::analysis::{Clock, fit, power, seconds};
use super::crops::{self, Row};
use super::plot::{self, Curve, FAINT_GRID, GRID, INK, PALETTE};
use super::record::{Findings, SceneFindings};
use super::table::{self, Table};
use crate::failure::Failure;
use askama::Template;
use beamfarm_image::atomic::write_file;
use beamfarm_proto::VERSION;
use std::path::Path;

#[derive(Template)]
#[template(path = "bench.html")]
struct Page<'a> {
    title: &'a str,
    about: String,
    /// Colours of the plots on a light and on a dark page.
    colours: Vec<(String, &'static str)>,
    scenes: Vec<SceneView<'a>>,
    map_end: u32,
}

struct SceneView<'a> {
    name: &'a str,
    about: Vec<String>,
    plots: Vec<PlotView>,
    legend: Vec<LegendEntry>,
    tables: Vec<Table>,
    details: Vec<Table>,
    crops: Vec<Row>,
}

struct PlotView {
    label: String,
    svg: String,
}

struct LegendEntry {
    swatch: String,
    name: String,
    note: String,
}

/// Write it.
pub fn write(findings: &Findings, path: &Path) -> Result<(), Failure> {
    let scenes = findings.scenes.iter().map(view);
    let colours = PALETTE.iter().chain([&INK, &GRID, &FAINT_GRID]);
    let machine = &findings.machine;
    let mut about = format!(
        "beamfarm {VERSION}, {} cores of {} ({}; {}), {}",
        machine.cores,
        if machine.cpu.is_empty() {
            "an unknown processor"
        } else {
            &machine.cpu
        },
        machine.architecture,
        machine.vectors.join(", "),
        machine.system
    );
    if let Some(date) = &findings.date {
        about.push_str(&format!(", {date}"));
    }
    let page = Page {
        title: &findings.title,
        about,
        colours: colours.map(|(light, dark)| (plot::hex(*light), *dark)).collect(),
        scenes: scenes.collect::<Result<_, _>>()?,
        map_end: (100.0 * crops::SCALE) as u32,
    };
    let text = page.render().map_err(Failure::io)?;
    Ok(write_file(path, text.as_bytes())?)
}

fn view(scene: &SceneFindings) -> Result<SceneView<'_>, Failure> {
    let all = table::curves(scene);
    let error = match (&scene.reference, scene.peers.is_empty()) {
        (Some(reference), _) if reference.noise.is_some() => "relMSE, less the reference's noise",
        (Some(_), _) => "relMSE",
        (None, true) => "relMSE, estimated",
        (None, false) => "relMSE (ours: estimated)",
    };
    let mut plots = Vec::new();
    for clock in [Clock::Wall, Clock::Cores] {
        let curves = all.iter().enumerate().map(|(look, (name, points))| Curve {
            name: name.clone(),
            points: clock.curve(points),
            look,
        });
        let curves: Vec<Curve> = curves.filter(|curve| !curve.points.is_empty()).collect();
        if let Some(svg) = plot::svg(&curves, clock.unit(), error)? {
            let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
            let label = format!("{error} against {}: {}", clock.unit(), names.join(", "));
            plots.push(PlotView { label, svg });
        }
    }
    let legend = all.iter().enumerate().map(|(look, (name, points))| {
        let note = match fit(&Clock::Wall.curve(points)) {
            Some(fit) => {
                format!("slope {:.2} from {} on", fit.slope, seconds(fit.from_seconds)).replace('-', "\u{2212}")
            }
            None => String::new(),
        };
        Ok(LegendEntry {
            swatch: plot::swatch(look)?,
            name: name.clone(),
            note,
        })
    });
    let legend = legend.collect::<Result<_, Failure>>()?;
    let mut tables = vec![table::times(scene, Clock::Wall)];
    tables.push(table::ratios(scene, Clock::Wall));
    tables.push(table::times(scene, Clock::Cores));
    tables.push(table::ratios(scene, Clock::Cores));
    tables.push(table::memory(scene));
    tables.retain(|table| !table.rows.is_empty());
    Ok(SceneView {
        name: &scene.name,
        about: about(scene),
        plots,
        legend,
        tables,
        details: vec![table::records(scene)],
        crops: crops::rows(scene)?,
    })
}

/// What was rendered with, and compared with.
fn about(scene: &SceneFindings) -> Vec<String> {
    let runs = scene.runs.iter().map(|run| {
        let s = &run.settings;
        let radius = match s.overrides.radius {
            Some(radius) => format!(", radius {radius}"),
            None => String::new(),
        };
        format!(
            "{}: {} x {} pixels, {} paths a pass, alpha {:.3}, radii shrink once a {}{radius}, seed {}, {} threads.",
            run.name, s.width, s.height, s.paths_per_pass, s.alpha, s.schedule, s.seed, s.threads
        )
    });
    let mut lines: Vec<String> = runs.collect();
    lines.push(match scene.reference.as_ref().map(|reference| reference.noise) {
        Some(Some(noise)) => format!(
            "Compared with a reference whose own noise, relMSE {}, is taken off.",
            power(noise)
        ),
        Some(None) => "Compared with a reference whose own noise is not known.".into(),
        None => "No reference: errors are the renderer's own estimate, which knows no bias.".into(),
    });
    lines
}
