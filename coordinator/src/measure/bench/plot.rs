//! Log-log plots as SVG. They use the colours of the light page; the page's style sheet replaces each by its value on a
//! dark page.

use crate::failure::Failure;
use crate::measure::figure::{Decades, FINE, fine, shown_at};
use plotters::prelude::*;
use plotters::style::RGBColor;

/// Colours after Okabe and Ito, distinguishable with any colour vision; for light and for dark backgrounds.
pub const PALETTE: [([u8; 3], &str); 6] = [
    ([0x00, 0x72, 0xb2], "#5db4f0"),
    ([0xd5, 0x5e, 0x00], "#ff8a45"),
    ([0x00, 0x9e, 0x73], "#2fd0a0"),
    ([0xb8, 0x5a, 0x90], "#ec9fcb"),
    ([0xb8, 0x7d, 0x00], "#f2c14e"),
    ([0x5c, 0x5c, 0x66], "#b9b9c6"),
];
pub const INK: ([u8; 3], &str) = ([0x2a, 0x2a, 0x30], "#d8d8de");
pub const GRID: ([u8; 3], &str) = ([0xc9, 0xc9, 0xce], "#4a4a52");
pub const FAINT_GRID: ([u8; 3], &str) = ([0xec, 0xec, 0xef], "#2b2b31");

/// `#rrggbb`.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

fn colour([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// A renderer's error over time.
pub struct Curve {
    pub name: String,
    /// (seconds, error), both positive, sorted by time.
    pub points: Vec<(f64, f64)>,
    /// Index among all curves, which determines its style.
    pub look: usize,
}

/// Dash length, gap length and line width.
fn dashes(look: usize) -> (i32, i32, u32) {
    let (dash, gap, width) =
        [(1, 0, 3), (9, 5, 2), (2, 4, 2), (14, 4, 2), (5, 3, 2)][(look + look / PALETTE.len()) % 5];
    (dash * FINE, gap * FINE, width * FINE as u32)
}

const RADIUS: i32 = 5 * FINE;

/// Corners of the marker around the origin; empty for a circle.
fn marker(look: usize) -> Vec<(i32, i32)> {
    let (r, one) = (RADIUS, FINE);
    match look % PALETTE.len() {
        0 => Vec::new(),
        1 => vec![(-r, -r), (r, -r), (r, r), (-r, r)],
        2 => vec![(0, -r - 2 * one), (r + one, r - one), (-r - one, r - one)],
        3 => {
            let long = r + 2 * one;
            vec![(0, -long), (long, 0), (0, long), (-long, 0)]
        }
        4 => vec![(0, r + 2 * one), (r + one, one - r), (-r - one, one - r)],
        _ => {
            let (a, b) = (r + one, 2 * one);
            #[rustfmt::skip]
            let cross = vec![(-b, -a), (b, -a), (b, -b), (a, -b), (a, b), (b, b), (b, a), (-b, a), (-b, b), (-a, b), (-a, -b), (-b, -b)];
            cross
        }
    }
}

const SIZE: (u32, u32) = (540, 430);

/// The plot of the non-empty curves; `None` if there are none. `seconds`: label of the horizontal axis.
pub fn svg(curves: &[Curve], seconds: &str, error: &str) -> Result<Option<String>, Failure> {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let (Some(x), Some(y)) = (
        Decades::around(points().map(|point| point.0)),
        Decades::around(points().map(|point| point.1)),
    ) else {
        return Ok(None);
    };
    let mut text = String::new();
    draw(&mut text, curves, [x, y], seconds, error).map_err(|message| Failure::io(format!("plot: {message}")))?;
    Ok(Some(shown_at(text, SIZE)))
}

fn draw(text: &mut String, curves: &[Curve], [x, y]: [Decades; 2], seconds: &str, error: &str) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| error.to_string();
    let area = SVGBackend::with_string(text, fine(SIZE)).into_drawing_area();
    let mut chart = ChartBuilder::on(&area)
        .margin(10 * FINE)
        .margin_right(18 * FINE)
        .x_label_area_size(50 * FINE)
        .y_label_area_size(68 * FINE)
        .build_cartesian_2d(x, y)
        .map_err(|e| failed(&e))?;
    let ink = colour(INK.0);
    let thin = |c| colour(c).stroke_width(FINE as u32);
    let font = TextStyle::from(("sans-serif", 17 * FINE)).color(&ink);
    chart
        .configure_mesh()
        .bold_line_style(thin(GRID.0))
        .light_line_style(thin(FAINT_GRID.0))
        .axis_style(thin(INK.0))
        .set_all_tick_mark_size(5 * FINE)
        .x_label_style(font.clone())
        .y_label_style(font.clone())
        .axis_desc_style(font)
        .x_desc(seconds)
        .y_desc(error)
        .draw()
        .map_err(|e| failed(&e))?;
    // The first curve is drawn on top.
    for curve in curves.iter().rev() {
        let colour = colour(PALETTE[curve.look % PALETTE.len()].0);
        let (dash, gap, width) = dashes(curve.look);
        let style = colour.stroke_width(width);
        let drawn = match gap {
            0 => chart
                .draw_series(LineSeries::new(curve.points.clone(), style))
                .map(drop),
            _ => chart
                .draw_series(DashedLineSeries::new(curve.points.clone(), dash, gap, style))
                .map(drop),
        };
        drawn.map_err(|e| failed(&e))?;
        let corners = marker(curve.look);
        let drawn = match corners.is_empty() {
            true => {
                let circle = |at| EmptyElement::at(at) + Circle::new((0, 0), RADIUS, colour.filled());
                chart.draw_series(curve.points.iter().copied().map(circle)).map(drop)
            }
            false => {
                let shape = |at| EmptyElement::at(at) + Polygon::new(corners.clone(), colour.filled());
                chart.draw_series(curve.points.iter().copied().map(shape)).map(drop)
            }
        };
        drawn.map_err(|e| failed(&e))?;
    }
    area.present().map_err(|e| failed(&e))
}

/// A sample of a curve for a legend.
pub fn swatch(look: usize) -> Result<String, Failure> {
    const SWATCH: (u32, u32) = (46, 18);
    let failed = |error: &dyn std::fmt::Display| Failure::io(format!("plot: {error}"));
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, fine(SWATCH)).into_drawing_area();
        let colour = colour(PALETTE[look % PALETTE.len()].0);
        let (dash, gap, width) = dashes(look);
        let (right, height) = fine(SWATCH);
        let (left, right, middle) = (FINE, right as i32 - FINE, height as i32 / 2);
        let mut from = left;
        while from < right {
            let to = if gap == 0 { right } else { (from + dash).min(right) };
            let ends = vec![(from, middle), (to, middle)];
            area.draw(&PathElement::new(ends, colour.stroke_width(width)))
                .map_err(|e| failed(&e))?;
            from = to + gap;
        }
        let centre = ((left + right) / 2, middle);
        let corners = marker(look);
        let drawn = match corners.is_empty() {
            true => area.draw(&Circle::new(centre, RADIUS, colour.filled())),
            false => {
                let moved = corners.iter().map(|(x, y)| (x + centre.0, y + centre.1));
                area.draw(&Polygon::new(moved.collect::<Vec<_>>(), colour.filled()))
            }
        };
        drawn.map_err(|e| failed(&e))?;
        area.present().map_err(|e| failed(&e))?;
    }
    Ok(shown_at(text, SWATCH))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_are_sound_svg() {
        let curve = |look| Curve {
            name: "a".into(),
            points: vec![(1.0, 0.1), (2.0, 0.05), (64.0, 1e-3 * (1 + look) as f64)],
            look,
        };
        let curves: Vec<Curve> = (0..8).map(curve).collect();
        let text = svg(&curves, "seconds", "relMSE").unwrap().unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        let width = document.root_element().attribute("width");
        assert_eq!(width, Some(SIZE.0.to_string().as_str()));
        let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
        let has = |wanted: &str| texts.iter().any(|text| text.trim() == wanted);
        assert!(
            has("10\u{207b}\u{b2}") && has("10\u{b9}") && has("seconds"),
            "{texts:?}"
        );
        for (light, _) in PALETTE {
            assert!(text.contains(&hex(light)), "{}", hex(light));
        }
        for look in 0..8 {
            assert!(roxmltree::Document::parse(&swatch(look).unwrap()).is_ok());
        }
        assert_eq!(svg(&[], "s", "e").unwrap(), None);
    }
}
