//! The report page: one self-contained file.

use super::analysis::{Clock, fit, power, seconds};
use super::crops::{self, Row};
use super::plot::{self, Curve, FAINT_GRID, GRID, INK, PALETTE};
use super::record::{Findings, SceneFindings};
use super::table::{self, Table};
use crate::failure::Failure;
use beamfarm_coordinator::html;
use beamfarm_coordinator::html::Html;
use beamfarm_image::atomic::write_file;
use beamfarm_proto::VERSION;
use std::path::Path;

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
    svg: Html,
}

struct LegendEntry {
    swatch: Html,
    name: String,
    note: String,
}

/// Write it.
pub fn write(findings: &Findings, path: &Path) -> Result<(), Failure> {
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
    let scenes = findings.scenes.iter().map(|scene| Ok(view(scene)?.html()));
    let scenes = scenes.collect::<Result<Html, Failure>>()?;
    let text = page(&findings.title, &about, &scenes).into_string();
    Ok(write_file(path, text.as_bytes())?)
}

fn page(title: &str, about: &str, scenes: &Html) -> Html {
    html!(
        r#"<!DOCTYPE html>
<html lang="en" xmlns="http://www.w3.org/1999/xhtml">
<head>
<meta charset="utf-8"/>
<meta name="viewport" content="width=device-width, initial-scale=1"/>
<meta name="color-scheme" content="light dark"/>
<title>{title}</title>
<style>
{style}{dark}
</style>
</head>
<body>
<h1>{title}</h1>
<p class="about">{about}</p>
<p class="about">relMSE is the mean over pixels and channels of (x &#8722; ref)&#178; / (ref&#178; + 0.01). Times are those of
rendering alone; each run has the machine for itself. Times to an error are interpolated in log-log. &#8220;&#8804;&#8221;: the first
measurement is below the error already. &#8220;not reached (&#8776;)&#8221;: extrapolated along the slope, which is a least-squares fit in
log-log over the last ninth of the time and three measurements at least. One measurement alone is taken to move at slope &#8722;1.</p>{scenes}
<p class="about">Maps of the relative error (x &#8722; ref) / &#8730;(ref&#178; + 0.01): blue where an image is darker than the reference, red
where it is brighter, white where they agree; the colours end at {map_end} %.</p>
</body>
</html>
"#,
        title = title,
        style = Html::trusted(include_str!("report.css")),
        dark = dark_style(),
        about = about,
        scenes = scenes,
        map_end = (100.0 * crops::SCALE) as u32,
    )
}

/// Colours of the dark page, with replacements for the plots' colours.
fn dark_style() -> Html {
    let colours = PALETTE.iter().chain([&INK, &GRID, &FAINT_GRID]);
    let rules = colours.map(|(light, dark)| {
        html!(
            "\nsvg [stroke=\"{light}\"] {{ stroke: {dark}; }}\nsvg [fill=\"{light}\"] {{ fill: {dark}; }}",
            light = plot::hex(*light),
            dark = dark,
        )
    });
    html!(
        r#"@media (prefers-color-scheme: dark) {{
:root {{ --page: #161619; --ink: #e6e6ea; --soft: #a4a4ae; --line: #34343b; --band: #1d1d21; }}{rules}
}}"#,
        rules = rules.collect::<Html>(),
    )
}

impl SceneView<'_> {
    fn html(&self) -> Html {
        let about = self
            .about
            .iter()
            .map(|line| html!("\n<p class=\"about\">{line}</p>", line = line));
        let plots = self.plots.iter().map(|plot| {
            html!(
                "\n<figure role=\"img\" aria-label=\"{label}\">{svg}</figure>",
                label = plot.label,
                svg = plot.svg,
            )
        });
        let legend = self.legend.iter().map(|entry| {
            html!(
                "\n<li>{swatch}<span>{name} <span class=\"note\">{note}</span></span></li>",
                swatch = entry.swatch,
                name = entry.name,
                note = entry.note,
            )
        });
        let tables = self
            .tables
            .iter()
            .map(|table| html!("\n<h3>{title}</h3>{rows}", title = table.title, rows = rows(table)));
        let details = self.details.iter().map(|table| {
            html!(
                "\n<details>\n<summary>{title}</summary>{rows}\n</details>",
                title = table.title,
                rows = rows(table),
            )
        });
        html!(
            r#"
<section>
<h2>{name}</h2>{about}
<div class="plots">{plots}
</div>
<ul class="legend">{legend}
</ul>{tables}{details}{crops}
</section>"#,
            name = self.name,
            about = about.collect::<Html>(),
            plots = plots.collect::<Html>(),
            legend = legend.collect::<Html>(),
            tables = tables.collect::<Html>(),
            details = details.collect::<Html>(),
            crops = self.crops.iter().map(pictures).collect::<Html>(),
        )
    }
}

fn pictures(row: &Row) -> Html {
    let pictures = row.pictures.iter().map(|picture| {
        html!(
            r#"
<figure><img src="{source}" width="{width}" height="{height}" alt="{caption}"/><figcaption>{caption}</figcaption></figure>"#,
            source = picture.source,
            width = picture.width,
            height = picture.height,
            caption = picture.caption,
        )
    });
    html!(
        "\n<h3>{name}</h3>\n<div class=\"crops\">{pictures}\n</div>",
        name = row.name,
        pictures = pictures.collect::<Html>(),
    )
}

fn rows(table: &Table) -> Html {
    let head = table.head.iter().map(|cell| html!("<th>{cell}</th>", cell = cell));
    let rows = table.rows.iter().map(|row| {
        let cells = row.iter().map(|cell| html!("<td>{cell}</td>", cell = cell));
        html!("\n<tr>{cells}</tr>", cells = cells.collect::<Html>())
    });
    let is_wide = table.head.get(1).is_some_and(|cell| cell == "against");
    html!(
        r#"
<div class="scroll"><table{class}>
<thead><tr>{head}</tr></thead>
<tbody>{rows}
</tbody>
</table></div>"#,
        class = Html::when(is_wide, " class=\"two\""),
        head = head.collect::<Html>(),
        rows = rows.collect::<Html>(),
    )
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
            let svg = Html::trusted(svg);
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
            swatch: Html::trusted(plot::swatch(look)?),
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

/// What was rendered, and what it was compared with.
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
