//! The figure: three panels with the number of passes as horizontal axis.

use super::Curves;
use crate::measure::figure::{Decades, FINE, fine, shown_at};
use beamfarm_render::cpu::convergence::Theory;
use plotters::coord::Shift;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1200, 420);
/// Ratio between plotted points: a twelfth of a decade.
const STEP: f64 = 1.211_527_658_628_588_4;
/// Okabe and Ito 2008: distinguishable with impaired colour vision.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// Measured and expected values, by pass.
type Curve = Vec<(f64, f64)>;

/// The figure as SVG.
pub fn figure(results: &[Curves], theory: &Theory) -> Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, fine(SIZE)).into_drawing_area();
        root.fill(&WHITE).map_err(|error| error.to_string())?;
        let panels = root.split_evenly((1, 3));
        let limit = theory.truth;
        let square = limit * limit;
        type Pick<'a> = &'a dyn Fn(&Curves, usize) -> (f64, f64);
        // Place the legend where no curve starts or ends.
        let [upper, lower] = [SeriesLabelPosition::UpperLeft, SeriesLabelPosition::LowerLeft];
        let of: [(&str, SeriesLabelPosition, Pick); 3] = [
            ("variance of a pass, relative", upper, &|r, i| {
                (r.passes[i].variance / square, r.theory[i].variance / square)
            }),
            ("variance of the average, relative", lower.clone(), &|r, i| {
                let variance = r.averages[i].variance;
                (variance / square, r.theory[i].average_variance / square)
            }),
            ("bias of the average, relative, without sign", lower, &|r, i| {
                let bias = r.averages[i].mean - limit;
                let of = |bias: f64| (bias / limit).abs();
                (of(bias), of(r.theory[i].average_bias))
            }),
        ];
        for (panel, (title, legend, pick)) in panels.iter().zip(of) {
            let curves: Vec<(f64, Curve)> = results
                .iter()
                .map(|r| (r.alpha, (0..r.theory.len()).map(|i| pick(r, i)).collect()))
                .collect();
            draw(panel, title, legend, &curves).map_err(|error| error.to_string())?;
        }
        root.present().map_err(|error| error.to_string())?;
    }
    Ok(shown_at(svg, SIZE))
}

fn draw<'a>(
    panel: &DrawingArea<SVGBackend<'a>, Shift>,
    title: &str,
    legend: SeriesLabelPosition,
    curves: &[(f64, Curve)],
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let values = || curves.iter().flat_map(|(_, curve)| curve);
    let expected = || values().map(|v| v.1).filter(|v| *v > 0.0);
    // From theory: a bias lost in noise would stretch the panel arbitrarily.
    let low = expected().fold(f64::INFINITY, f64::min).max(1e-12) / 3.0;
    let high = expected().fold(low, f64::max) * 3.0;
    let passes = curves.iter().map(|(_, c)| c.len()).max().unwrap_or(1);
    let (Some(x), Some(y)) = (
        Decades::around([1.0, passes as f64].into_iter()),
        Decades::around([low, high].into_iter()),
    ) else {
        return Ok(());
    };
    let font = ("sans-serif", 14 * FINE);
    let thin = |share: f64| BLACK.mix(share).stroke_width(FINE as u32);
    let mut chart = ChartBuilder::on(panel)
        .caption(title, ("sans-serif", 17 * FINE))
        .margin(10 * FINE)
        .x_label_area_size(42 * FINE)
        .y_label_area_size(52 * FINE)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .x_desc("passes")
        .label_style(font)
        .axis_desc_style(font)
        .set_all_tick_mark_size(5 * FINE)
        .axis_style(thin(0.8))
        .bold_line_style(thin(0.22))
        .light_line_style(thin(0.08))
        .draw()?;
    for ((alpha, curve), colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let thin = thinned(curve.len());
        let line: Vec<(f64, f64)> = thin.iter().map(|&i| ((i + 1) as f64, curve[i].1)).collect();
        chart
            .draw_series([PathElement::new(line, colour.stroke_width(FINE as u32 * 3 / 2))])?
            .label(format!("alpha = {alpha}"))
            .legend(|(x, y)| {
                let ends = [(x, y), (x + 16 * FINE, y)];
                PathElement::new(ends, colour.stroke_width(2 * FINE as u32))
            });
        let dots = thin.iter().filter(|&&i| curve[i].0 >= low && curve[i].0 <= high);
        let dot = |&i: &usize| Circle::new(((i + 1) as f64, curve[i].0), 5 * FINE / 2, colour.filled());
        chart.draw_series(dots.map(dot))?;
    }
    chart
        .configure_series_labels()
        .position(legend)
        .margin(8 * FINE as u32)
        .legend_area_size(22 * FINE as u32)
        .label_font(font)
        .background_style(WHITE.mix(0.8))
        .draw()
}

/// Indices of passes, spread evenly on a logarithmic axis, from zero.
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
