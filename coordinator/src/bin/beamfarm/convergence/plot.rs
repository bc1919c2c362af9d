//! The figure: three panels over the number of passes.

use super::Curves;
use beamfarm_shared::convergence::Theory;
use plotters::coord::Shift;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1200, 420);
/// From dot to dot: a twelfth of a decade.
const STEP: f64 = 1.211_527_658_628_588_4;
/// Okabe and Ito 2008: told apart by those who see few colours, too.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// Measured and expected, by pass.
type Curve = Vec<(f64, f64)>;

/// The figure as SVG.
pub fn figure(results: &[Curves], theory: &Theory) -> Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(|error| error.to_string())?;
        let panels = root.split_evenly((1, 3));
        let limit = theory.truth;
        let square = limit * limit;
        type Pick<'a> = &'a dyn Fn(&Curves, usize) -> (f64, f64);
        let of: [(&str, Pick); 3] = [
            ("variance of a pass, relative", &|r, i| {
                (r.passes[i].variance / square, r.theory[i].variance / square)
            }),
            ("variance of the average, relative", &|r, i| {
                let variance = r.averages[i].variance;
                (variance / square, r.theory[i].average_variance / square)
            }),
            ("bias of the average, relative, without sign", &|r, i| {
                let bias = r.averages[i].mean - limit;
                let of = |bias: f64| (bias / limit).abs();
                (of(bias), of(r.theory[i].average_bias))
            }),
        ];
        for (panel, (title, pick)) in panels.iter().zip(of) {
            let curves: Vec<(f64, Curve)> = results
                .iter()
                .map(|r| (r.alpha, (0..r.theory.len()).map(|i| pick(r, i)).collect()))
                .collect();
            draw(panel, title, &curves).map_err(|error| error.to_string())?;
        }
        root.present().map_err(|error| error.to_string())?;
    }
    Ok(svg)
}

fn draw<'a>(
    panel: &DrawingArea<SVGBackend<'a>, Shift>,
    title: &str,
    curves: &[(f64, Curve)],
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let values = || curves.iter().flat_map(|(_, curve)| curve);
    let expected = || values().map(|v| v.1).filter(|v| *v > 0.0);
    // From theory: a bias that is lost in noise would stretch the panel without end.
    let low = expected().fold(f64::INFINITY, f64::min).max(1e-12) / 3.0;
    let high = expected().fold(low, f64::max) * 3.0;
    let passes = curves.iter().map(|(_, c)| c.len()).max().unwrap_or(1);
    let mut chart = ChartBuilder::on(panel)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(
            (1.0..passes as f64 * 1.1).log_scale(),
            (low..high).log_scale(),
        )?;
    let label = |v: &f64| format!("{v:.0e}");
    chart
        .configure_mesh()
        .x_desc("passes")
        .y_label_formatter(&label)
        .x_label_formatter(&|v| format!("{v:.0}"))
        .light_line_style(BLACK.mix(0.04))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    for ((alpha, curve), colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let thin = thinned(curve.len());
        let line: Vec<(f64, f64)> = thin.iter().map(|&i| ((i + 1) as f64, curve[i].1)).collect();
        chart
            .draw_series([PathElement::new(line, colour.stroke_width(1))])?
            .label(format!("alpha = {alpha}"))
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], *colour));
        let dots = thin
            .iter()
            .filter(|&&i| curve[i].0 >= low && curve[i].0 <= high);
        let dot = |&i: &usize| Circle::new(((i + 1) as f64, curve[i].0), 2, colour.filled());
        chart.draw_series(dots.map(dot))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.8))
        .draw()
}

/// Numbers of passes, spread evenly over a logarithmic axis, from zero.
fn thinned(count: usize) -> Vec<usize> {
    let mut thin: Vec<usize> = Vec::new();
    let mut at = 1.0;
    while at as usize <= count {
        if thin.last() != Some(&(at as usize - 1)) {
            thin.push(at as usize - 1);
        }
        at *= STEP;
    }
    if thin.last() != Some(&(count - 1)) {
        thin.push(count - 1);
    }
    thin
}
