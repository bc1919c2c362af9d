//! Log-log plots as SVG. Colours are those of a light page; the page's style sheet finds them by their values and puts others
//! in their place on a dark one.

use super::analysis::superscript;
use crate::failure::Failure;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::RGBColor;
use std::ops::Range;

/// Colours after Okabe and Ito, told apart with any kind of colour vision; on light, and on dark ground.
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

/// A renderer's error against time.
pub struct Curve {
    pub name: String,
    /// Seconds and errors, above zero, sorted by time.
    pub points: Vec<(f64, f64)>,
    /// Place in the list of all curves, which says what it looks like.
    pub look: usize,
}

/// Dashes and gaps in pixels, and the width of the line.
fn dashes(look: usize) -> (i32, i32, u32) {
    [(1, 0, 3), (9, 5, 2), (2, 4, 2), (14, 4, 2), (5, 3, 2)][(look + look / PALETTE.len()) % 5]
}

const RADIUS: i32 = 5;

/// Corners of the marker around the origin; nothing for a circle.
fn marker(look: usize) -> Vec<(i32, i32)> {
    let r = RADIUS;
    match look % PALETTE.len() {
        0 => Vec::new(),
        1 => vec![(-r, -r), (r, -r), (r, r), (-r, r)],
        2 => vec![(0, -r - 2), (r + 1, r - 1), (-r - 1, r - 1)],
        3 => vec![(0, -r - 2), (r + 2, 0), (0, r + 2), (-r - 2, 0)],
        4 => vec![(0, r + 2), (r + 1, 1 - r), (-r - 1, 1 - r)],
        _ => {
            let (a, b) = (r + 1, 2);
            #[rustfmt::skip]
            let cross = vec![(-b, -a), (b, -a), (b, -b), (a, -b), (a, b), (b, b), (b, a), (-b, a), (-b, b), (-a, b), (-a, -b), (-b, -b)];
            cross
        }
    }
}

const SIZE: (u32, u32) = (540, 430);

/// The plot of these curves, all but empty ones; nothing if there is none. `seconds`: what the horizontal axis counts.
pub fn svg(curves: &[Curve], seconds: &str, error: &str) -> Result<Option<String>, Failure> {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let (Some(x), Some(y)) = (
        range(points().map(|point| point.0)),
        range(points().map(|point| point.1)),
    ) else {
        return Ok(None);
    };
    let mut text = String::new();
    draw(&mut text, curves, [x, y], seconds, error)
        .map_err(|message| Failure::io(format!("plot: {message}")))?;
    Ok(Some(text))
}

/// A logarithmic axis with powers of ten for labels. plotters has one of its own, whose labels are plain numbers at places
/// that depend on the size of the plot.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Decades {
    /// Logarithms to base 10 of its ends.
    low: f64,
    high: f64,
}

/// The axis for these values: with room around them, and two powers of ten at least.
fn range(values: impl Iterator<Item = f64>) -> Option<Decades> {
    let logs = values.map(libm::log10);
    let (low, high) = logs
        .map(|v| (v, v))
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    let room = 0.06 * (high - low) + 0.05;
    let (low, high) = (low - room, high + room);
    if high.floor() - low.ceil() >= 1.0 {
        return Some(Decades { low, high });
    }
    let low = low.floor();
    Some(Decades {
        low,
        high: high.ceil().max(low + 1.0),
    })
}

impl Decades {
    fn powers(self) -> impl Iterator<Item = i32> {
        (self.low.floor() as i32)..=(self.high.ceil() as i32)
    }
}

impl Ranged for Decades {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let at = (libm::log10(*value) - self.low) / (self.high - self.low);
        limit.0 + (f64::from(limit.1 - limit.0) * at).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let multiples = match hint.weight().allow_light_points() {
            true => 2..10,
            false => 1..2,
        };
        // A hair of tolerance, for ends that are powers of ten themselves.
        let ends = self.low - 1e-9..=self.high + 1e-9;
        let powers = self.powers().map(|power| libm::exp10(f64::from(power)));
        let values = powers.flat_map(|power| multiples.clone().map(move |n| f64::from(n) * power));
        values.filter(|v| ends.contains(&libm::log10(*v))).collect()
    }

    fn range(&self) -> Range<f64> {
        libm::exp10(self.low)..libm::exp10(self.high)
    }
}

impl ValueFormatter<f64> for Decades {
    fn format(value: &f64) -> String {
        let exponent = libm::log10(*value).round();
        format!("10{}", superscript(&format!("{exponent:.0}")))
    }
}

fn draw(
    text: &mut String,
    curves: &[Curve],
    [x, y]: [Decades; 2],
    seconds: &str,
    error: &str,
) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| error.to_string();
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .margin_right(18)
        .x_label_area_size(50)
        .y_label_area_size(68)
        .build_cartesian_2d(x, y)
        .map_err(|e| failed(&e))?;
    let ink = colour(INK.0);
    let font = |size: i32| TextStyle::from(("sans-serif", size)).color(&ink);
    chart
        .configure_mesh()
        .bold_line_style(colour(GRID.0))
        .light_line_style(colour(FAINT_GRID.0))
        .axis_style(colour(INK.0))
        .x_label_style(font(17))
        .y_label_style(font(17))
        .axis_desc_style(font(17))
        .x_desc(seconds)
        .y_desc(error)
        .draw()
        .map_err(|e| failed(&e))?;
    // The first lies on top.
    for curve in curves.iter().rev() {
        let colour = colour(PALETTE[curve.look % PALETTE.len()].0);
        let (dash, gap, width) = dashes(curve.look);
        let style = colour.stroke_width(width);
        let drawn = match gap {
            0 => chart
                .draw_series(LineSeries::new(curve.points.clone(), style))
                .map(drop),
            _ => chart
                .draw_series(DashedLineSeries::new(
                    curve.points.clone(),
                    dash,
                    gap,
                    style,
                ))
                .map(drop),
        };
        drawn.map_err(|e| failed(&e))?;
        let corners = marker(curve.look);
        let drawn = match corners.is_empty() {
            true => {
                let circle =
                    |at| EmptyElement::at(at) + Circle::new((0, 0), RADIUS, colour.filled());
                chart
                    .draw_series(curve.points.iter().copied().map(circle))
                    .map(drop)
            }
            false => {
                let shape =
                    |at| EmptyElement::at(at) + Polygon::new(corners.clone(), colour.filled());
                chart
                    .draw_series(curve.points.iter().copied().map(shape))
                    .map(drop)
            }
        };
        drawn.map_err(|e| failed(&e))?;
    }
    area.present().map_err(|e| failed(&e))
}

/// A bit of a curve, for a legend.
pub fn swatch(look: usize) -> Result<String, Failure> {
    const SWATCH: (u32, u32) = (46, 18);
    let failed = |error: &dyn std::fmt::Display| Failure::io(format!("plot: {error}"));
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SWATCH).into_drawing_area();
        let colour = colour(PALETTE[look % PALETTE.len()].0);
        let (dash, gap, width) = dashes(look);
        let (left, right, middle) = (1, SWATCH.0 as i32 - 1, SWATCH.1 as i32 / 2);
        let mut from = left;
        while from < right {
            let to = if gap == 0 {
                right
            } else {
                (from + dash).min(right)
            };
            let ends = vec![(from, middle), (to, middle)];
            area.draw(&PathElement::new(ends, colour.stroke_width(width)))
                .map_err(|e| failed(&e))?;
            from = to + gap;
        }
        let centre = (SWATCH.0 as i32 / 2, middle);
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
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::coord::ranged1d::BoldPoints;

    #[test]
    fn axes_hold_their_values_and_two_powers_of_ten() {
        let cases: [&[f64]; 6] = [
            &[1.0],
            &[0.5, 0.7],
            &[1.0, 1e-3],
            &[3.0, 200.0],
            &[0.02, 0.08],
            &[1e-9, 1e9],
        ];
        for values in cases {
            let axis = range(values.iter().copied()).unwrap();
            for v in values {
                assert!((0..=1000).contains(&axis.map(v, (0, 1000))), "{values:?}");
            }
            let powers = axis.key_points(BoldPoints(9));
            assert!(powers.len() >= 2, "{values:?}: {powers:?}");
        }
        assert_eq!(range(std::iter::empty()), None);
    }

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
        let texts: Vec<&str> = document
            .descendants()
            .filter_map(|node| node.text())
            .collect();
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
