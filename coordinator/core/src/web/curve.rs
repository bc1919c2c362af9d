//! The error over time as a plot with logarithmic axes, as errors fall by powers of time.

use crate::html;
use crate::html::Html;
use crate::watch::Point;
use std::fmt::Write;

/// Size of the plot and position of its axes, in SVG units.
const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 260.0;
const LEFT: f64 = 68.0;
const RIGHT: f64 = 500.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 206.0;

/// A grid line with its label.
struct Tick {
    at: f64,
    label: String,
}

/// The plot as SVG; `None` for fewer than two points.
pub(super) fn svg(points: &[Point]) -> Option<Html> {
    let usable = |point: &&Point| point.seconds > 0.0 && point.error > 0.0;
    let points: Vec<&Point> = points.iter().filter(usable).collect();
    let (first, last) = (points.first()?, points.last()?);
    if first.seconds >= last.seconds {
        return None;
    }
    let errors = || points.iter().map(|point| point.error);
    let x = Axis::new(first.seconds, last.seconds, LEFT, RIGHT);
    let y = Axis::new(
        errors().fold(f64::INFINITY, f64::min),
        errors().fold(0.0, f64::max),
        BOTTOM,
        TOP,
    );
    let mut line = String::new();
    for point in &points {
        // Writing into a string cannot fail.
        let _ = write!(line, "{:.1},{:.1} ", x.at(point.seconds), y.at(point.error));
    }
    // As many dots as can be told apart.
    let every = points.len().div_ceil(24);
    let dots = points.iter().rev().step_by(every).map(|point| {
        let label = format!(
            "{} after {}, {} passes",
            percent(point.error),
            seconds(point.seconds),
            point.passes
        );
        html!(
            "\n<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\"><title>{label}</title></circle>",
            x = x.at(point.seconds),
            y = y.at(point.error),
            label = label,
        )
    });
    let words = format!(
        "The estimated error fell from {} after {} to {} after {}.",
        percent(first.error),
        seconds(first.seconds),
        percent(last.error),
        seconds(last.seconds)
    );
    let (x_ticks, y_ticks) = (x.ticks(seconds), y.ticks(percent));
    Some(html!(
        r#"<svg class="curve" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg" role="img" aria-label="Error against time. {words}">
<g class="grid">{grid}
</g>
<g class="labels">{labels}
<text x="{right}" y="{below}" text-anchor="end">time for which the job has run</text>
</g>
<polyline points="{line}"/>{dots}
</svg>"#,
        width = WIDTH,
        height = HEIGHT,
        words = words,
        grid = grid(&x_ticks, &y_ticks),
        labels = labels(&x_ticks, &y_ticks),
        right = RIGHT,
        below = HEIGHT - 6.0,
        line = line,
        dots = dots.collect::<Html>(),
    ))
}

fn grid(x: &[Tick], y: &[Tick]) -> Html {
    let upright = x.iter().map(|tick| {
        html!(
            "\n<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top}\" y2=\"{bottom}\"/>",
            x = tick.at,
            top = TOP,
            bottom = BOTTOM,
        )
    });
    let level = y.iter().map(|tick| {
        html!(
            "\n<line x1=\"{left}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>",
            left = LEFT,
            right = RIGHT,
            y = tick.at,
        )
    });
    upright.chain(level).collect()
}

fn labels(x: &[Tick], y: &[Tick]) -> Html {
    let below = x.iter().map(|tick| {
        html!(
            "\n<text x=\"{x:.1}\" y=\"{y}\" text-anchor=\"middle\">{label}</text>",
            x = tick.at,
            y = BOTTOM + 20.0,
            label = tick.label,
        )
    });
    let beside = y.iter().map(|tick| {
        html!(
            "\n<text x=\"{x}\" y=\"{y:.1}\" text-anchor=\"end\">{label}</text>",
            x = LEFT - 6.0,
            y = tick.at + 4.0,
            label = tick.label,
        )
    });
    below.chain(beside).collect()
}

struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    /// An axis that covers at least `low` to `high` and spans the positions `from` to `to`.
    fn new(low: f64, high: f64, from: f64, to: f64) -> Self {
        let (low, high) = (libm::log10(low), libm::log10(high));
        // At least a factor of two, so that a nearly flat line does not look steep.
        let missing = (0.301 - (high - low)).max(0.0) / 2.0;
        Self {
            low: low - missing - 0.02,
            high: high + missing + 0.02,
            from,
            to,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (libm::log10(value) - self.low) / (self.high - self.low);
        self.from + share * (self.to - self.from)
    }

    /// Round numbers: powers of ten, with as many steps between them as there is space for.
    fn ticks(&self, label: fn(f64) -> String) -> Vec<Tick> {
        let decades = self.high - self.low;
        let steps: &[f64] = match decades {
            d if d > 4.0 => &[1.0],
            d if d > 2.0 => &[1.0, 3.0],
            d if d > 0.9 => &[1.0, 2.0, 5.0],
            _ => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
        };
        let decades = self.low.floor() as i32..=self.high.ceil() as i32;
        let values = decades.flat_map(|decade| {
            let power = libm::exp10(f64::from(decade));
            steps.iter().map(move |step| step * power)
        });
        let inside = |value: &f64| {
            let log = libm::log10(*value);
            log >= self.low && log <= self.high
        };
        let tick = |value: f64| Tick {
            at: self.at(value),
            label: label(value),
        };
        values.filter(inside).map(tick).collect()
    }
}

/// `2.5 %`, with the significant digits.
pub(super) fn percent(error: f64) -> String {
    let percent = 100.0 * error;
    let digits = match percent {
        p if p >= 10.0 => 0,
        p if p >= 1.0 => 1,
        p if p >= 0.1 => 2,
        _ => 3,
    };
    let text = format!("{percent:.digits$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    format!("{text} %")
}

/// `90 s`, `12 min`, `3.5 h`.
fn seconds(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 120.0 => (s, "s"),
        s if s < 7200.0 => (s / 60.0, "min"),
        s if s < 172_800.0 => (s / 3600.0, "h"),
        s => (s / 86_400.0, "d"),
    };
    let digits = usize::from(value < 10.0) + usize::from(value < 1.0);
    let text = format!("{value:.digits$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    format!("{text} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(passes: u64, seconds: f64, error: f64) -> Point {
        Point { passes, seconds, error }
    }

    #[test]
    fn a_power_law_is_a_straight_line() {
        let points: Vec<Point> = (1..=8)
            .map(|i| point(1 << i, f64::from(1 << i), 0.3 / f64::from(1 << i).sqrt()))
            .collect();
        let svg = svg(&points).unwrap().into_string();
        let line = svg.split("points=\"").nth(1).unwrap();
        let line = line.split('"').next().unwrap();
        let places: Vec<(f64, f64)> = line
            .split_whitespace()
            .map(|pair| {
                let (x, y) = pair.split_once(',').unwrap();
                (x.parse().unwrap(), y.parse().unwrap())
            })
            .collect();
        assert_eq!(places.len(), 8);
        let step = (places[1].0 - places[0].0, places[1].1 - places[0].1);
        for pair in places.windows(2) {
            assert!((pair[1].0 - pair[0].0 - step.0).abs() < 0.21);
            assert!((pair[1].1 - pair[0].1 - step.1).abs() < 0.21);
        }
        // Time increases to the right, and less error is further down.
        assert!(step.0 > 0.0 && step.1 > 0.0);
        for (x, y) in places {
            assert!((LEFT..=RIGHT).contains(&x) && (TOP..=BOTTOM).contains(&y));
        }
        roxmltree::Document::parse(svg.trim()).unwrap();
    }

    #[test]
    fn too_little_is_no_curve() {
        assert!(svg(&[]).is_none());
        assert!(svg(&[point(2, 1.0, 0.1)]).is_none());
        assert!(svg(&[point(2, 1.0, 0.0), point(4, 2.0, 0.1)]).is_none());
        let flat = [point(2, 1.0, 0.1), point(4, 1.001, 0.1)];
        assert!(!svg(&flat).unwrap().into_string().contains("NaN"));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(percent(0.1234), "12 %");
        assert_eq!(percent(0.01234), "1.2 %");
        assert_eq!(percent(0.002), "0.2 %");
        assert_eq!(percent(1.0), "100 %");
        assert_eq!(seconds(0.5), "0.5 s");
        assert_eq!(seconds(90.0), "90 s");
        assert_eq!(seconds(150.0), "2.5 min");
        assert_eq!(seconds(36_000.0), "10 h");
    }
}
