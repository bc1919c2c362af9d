//! Slopes and times from error over time. All in log-log coordinates, where convergence is a straight line.

use super::suite::Point;
use crate::measure::figure::superscript;
use serde::Serialize;

/// Errors for which the time is reported.
pub const TARGETS: [f64; 3] = [1e-1, 1e-2, 1e-3];

/// The clock that times are measured with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    Wall,
    Cores,
}

impl Clock {
    pub fn unit(self) -> &'static str {
        match self {
            Self::Wall => "wall seconds",
            Self::Cores => "core-seconds",
        }
    }

    /// (seconds, error) of the points whose time on this clock is known.
    pub fn curve(self, points: &[Point]) -> Vec<(f64, f64)> {
        let time = |point: &Point| match self {
            Self::Wall => Some(point.wall_seconds),
            Self::Cores => point.core_seconds,
        };
        let known = points.iter().filter_map(|point| Some((time(point)?, point.rel_mse)));
        known.filter(|(seconds, _)| *seconds > 0.0).collect()
    }
}

/// A straight line through the last points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// d log(error) / d log(seconds); -1 for an unbiased average.
    pub slope: f64,
    /// The number of points fitted.
    pub points: usize,
    /// Time of the first fitted point.
    pub from_seconds: f64,
}

/// The tail: points within this factor of the longest time, and at least three.
const TAIL: f64 = 9.0;
const TAIL_POINTS: usize = 3;
/// A flatter curve never reaches an error.
const STEEPEST_FLAT: f64 = -0.05;

/// Least-squares fit to the tail of a curve of (seconds, error), sorted by time. `None` for fewer than two times.
pub fn fit(curve: &[(f64, f64)]) -> Option<Fit> {
    let last = curve.last()?.0;
    let late = curve.iter().filter(|point| point.0 * TAIL >= last).count();
    let count = late.max(TAIL_POINTS).min(curve.len());
    let tail = &curve[curve.len() - count..];
    let logs = || tail.iter().map(|(t, e)| (libm::log(*t), libm::log(*e)));
    let n = count as f64;
    let (mean_t, mean_e) = logs().fold((0.0, 0.0), |(a, b), (t, e)| (a + t / n, b + e / n));
    let variance: f64 = logs().map(|(t, _)| (t - mean_t) * (t - mean_t)).sum();
    let covariance: f64 = logs().map(|(t, e)| (t - mean_t) * (e - mean_e)).sum();
    let slope = covariance / variance;
    (count >= 2 && slope.is_finite()).then_some(Fit {
        slope,
        points: count,
        from_seconds: tail[0].0,
    })
}

/// The time that a curve takes to reach an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "how", content = "seconds")]
pub enum TimeTo {
    /// Between two points.
    Interpolated(f64),
    /// The first point is already below it.
    AtMost(f64),
    /// Not reached; extrapolated along the fitted slope.
    Extrapolated(f64),
    /// Extrapolated from the only point at slope -1.
    Assumed(f64),
    /// Not reached, and the slope does not lead there.
    Never,
}

/// The first time that a curve of (seconds, error), sorted by time, is at or below the target.
pub fn time_to(curve: &[(f64, f64)], target: f64) -> TimeTo {
    let (first, last) = match curve {
        [] => return TimeTo::Never,
        [(seconds, error)] => return TimeTo::Assumed(seconds * error / target),
        [first, .., last] => (*first, *last),
    };
    if first.1 <= target {
        return TimeTo::AtMost(first.0);
    }
    let along = |(t, e): (f64, f64), slope: f64| t * libm::pow(target / e, 1.0 / slope);
    if let Some(pair) = curve.windows(2).find(|pair| pair[1].1 <= target) {
        let slope = libm::log(pair[1].1 / pair[0].1) / libm::log(pair[1].0 / pair[0].0);
        return TimeTo::Interpolated(along(pair[0], slope));
    }
    match fit(curve) {
        Some(fit) if fit.slope < STEEPEST_FLAT => TimeTo::Extrapolated(along(last, fit.slope)),
        _ => TimeTo::Never,
    }
}

/// The error at a time, for a curve of (seconds, error) sorted by time: interpolated, or extrapolated from the nearest
/// point at slope -1.
pub fn error_at(curve: &[(f64, f64)], seconds: f64) -> Option<f64> {
    let pair = curve
        .windows(2)
        .find(|pair| pair[0].0 <= seconds && seconds <= pair[1].0);
    if let Some(&[(t, e), (u, f)]) = pair {
        let slope = libm::log(f / e) / libm::log(u / t);
        return Some(e * libm::pow(seconds / t, if slope.is_finite() { slope } else { 0.0 }));
    }
    let nearest = match curve.first() {
        Some(first) if seconds < first.0 => first,
        _ => curve.last()?,
    };
    Some(nearest.1 * nearest.0 / seconds)
}

impl TimeTo {
    fn seconds(self) -> Option<f64> {
        match self {
            Self::Interpolated(t) | Self::AtMost(t) | Self::Extrapolated(t) | Self::Assumed(t) => Some(t),
            Self::Never => None,
        }
    }

    /// The text for a table.
    pub fn text(self) -> String {
        match self {
            Self::Interpolated(t) => seconds(t),
            Self::AtMost(t) => format!("\u{2264} {}", seconds(t)),
            Self::Extrapolated(t) => format!("not reached (\u{2248} {})", seconds(t)),
            Self::Assumed(t) => format!("\u{2248} {} at slope \u{2212}1", seconds(t)),
            Self::Never => "not reached".into(),
        }
    }
}

/// How many times sooner `ours` reaches the error than `theirs`, as text for a table.
pub fn times_faster(ours: TimeTo, theirs: TimeTo) -> String {
    let (Some(a), Some(b)) = (ours.seconds(), theirs.seconds()) else {
        return match theirs {
            TimeTo::Never if ours != TimeTo::Never => "never there".into(),
            _ => "\u{2013}".into(),
        };
    };
    let is_bound = |time: TimeTo| matches!(time, TimeTo::AtMost(_));
    let sure = |time: TimeTo| matches!(time, TimeTo::AtMost(_) | TimeTo::Interpolated(_));
    let sign = match (is_bound(ours), is_bound(theirs)) {
        (true, true) => return "\u{2013}".into(),
        (true, false) => "\u{2265} ",
        (false, true) => "\u{2264} ",
        (false, false) if sure(ours) && sure(theirs) => "",
        (false, false) => "\u{2248} ",
    };
    format!("{sign}{}", digits(b / a))
}

/// Seconds with three significant digits.
pub fn seconds(t: f64) -> String {
    format!("{} s", digits(t))
}

/// A number with three significant digits, without an exponent if that is short.
pub fn digits(value: f64) -> String {
    match value.abs() {
        v if v >= 1e6 => power(value),
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        v if v >= 1.0 => format!("{value:.2}"),
        v if v >= 0.0095 => format!("{value:.3}"),
        0.0 => "0".into(),
        _ => power(value),
    }
}

/// A number with three significant digits and a power of ten: 1.23·10⁻⁴.
pub fn power(value: f64) -> String {
    let text = format!("{value:.2e}");
    match text.split_once('e') {
        Some((mantissa, "0")) => mantissa.to_owned(),
        Some((mantissa, exponent)) => {
            let mantissa = mantissa.replace('-', "\u{2212}");
            format!("{mantissa}\u{b7}10{}", superscript(exponent))
        }
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(slope: f64, times: &[f64]) -> Vec<(f64, f64)> {
        let error = |t: &f64| (*t, 0.02 * libm::pow(*t, slope));
        times.iter().map(error).collect()
    }

    fn near(time: Option<f64>, expected: f64) -> bool {
        time.is_some_and(|time| (time / expected - 1.0).abs() < 1e-12)
    }

    #[test]
    fn the_slope_is_that_of_the_tail() {
        let mut curve = law(-0.6, &[1.0, 2.0, 4.0, 8.0, 16.0]);
        let found = fit(&curve).unwrap();
        assert!((found.slope + 0.6).abs() < 1e-12, "{found:?}");
        assert_eq!((found.points, found.from_seconds), (4, 2.0));
        // The start of the curve does not matter.
        curve[0].1 = 99.0;
        assert_eq!(fit(&curve), Some(found));
        // At least three points, by hand: logs (0, 0), (3, -3), (6, -3) have the slope -9/18.
        let e = |x: f64| libm::exp(x);
        let found = fit(&[(e(-5.0), 1.0), (e(0.0), 1.0), (e(3.0), e(-3.0)), (e(6.0), e(-3.0))]);
        let found = found.unwrap();
        assert!((found.slope + 0.5).abs() < 1e-12 && found.points == 3);
        assert_eq!(fit(&curve[..1]), None);
        assert_eq!(fit(&[(1.0, 1.0), (1.0, 0.5)]), None);
    }

    #[test]
    fn times_are_interpolated_in_log_log() {
        let curve = law(-0.6, &[1.0, 2.0, 4.0, 8.0]);
        let exact = |target: f64| libm::pow(0.02 / target, 1.0 / 0.6);
        assert_eq!(time_to(&curve, 0.1), TimeTo::AtMost(1.0));
        let time = time_to(&curve, 0.01);
        assert!(matches!(time, TimeTo::Interpolated(_)) && near(time.seconds(), exact(0.01)));
        let time = time_to(&curve, 1e-3);
        assert!(matches!(time, TimeTo::Extrapolated(_)) && near(time.seconds(), exact(1e-3)));
        assert!(
            time.text().starts_with("not reached (\u{2248} 147 s"),
            "{}",
            time.text()
        );
        assert_eq!(time_to(&[], 0.1), TimeTo::Never);
        assert!(near(time_to(&[(90.0, 3.3e-3)], 1e-2).seconds(), 29.7));
    }

    #[test]
    fn errors_are_interpolated_in_log_log() {
        let curve = law(-0.6, &[1.0, 2.0, 4.0, 8.0]);
        let is_near = |time: f64, expected: f64| near(error_at(&curve, time), expected);
        assert!(is_near(3.0, 0.02 * libm::pow(3.0, -0.6)) && is_near(8.0, 0.02 * libm::pow(8.0, -0.6)));
        assert!(is_near(16.0, 0.01 * libm::pow(8.0, -0.6)) && is_near(0.5, 0.04));
        assert_eq!(error_at(&[], 1.0), None);
        assert_eq!(error_at(&[(1.0, 0.5), (1.0, 0.5)], 1.0), Some(0.5));
    }

    #[test]
    fn a_curve_that_goes_up_again_was_there_first() {
        let curve = [(1.0, 0.2), (2.0, 0.05), (4.0, 0.2), (8.0, 0.2)];
        let time = time_to(&curve, 0.1).seconds().unwrap();
        assert!(near(Some(time), libm::sqrt(2.0)), "{time}");
        assert_eq!(time_to(&[(1.0, 0.2), (2.0, 0.2)], 0.1), TimeTo::Never);
        assert_eq!(TimeTo::Never.text(), "not reached");
    }

    #[test]
    fn ratios_say_how_sure_they_are() {
        use TimeTo::*;
        assert_eq!(times_faster(Interpolated(2.0), Interpolated(21.0)), "10.5");
        assert_eq!(times_faster(AtMost(2.0), Interpolated(21.0)), "\u{2265} 10.5");
        assert_eq!(times_faster(Interpolated(2.0), AtMost(21.0)), "\u{2264} 10.5");
        assert_eq!(times_faster(Extrapolated(2.0), Interpolated(21.0)), "\u{2248} 10.5");
        assert_eq!(times_faster(AtMost(2.0), AtMost(21.0)), "\u{2013}");
        assert_eq!(times_faster(Interpolated(2.0), Never), "never there");
        assert_eq!(times_faster(Never, Interpolated(2.0)), "\u{2013}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(digits(1234.5), "1234");
        assert_eq!(digits(0.0123), "0.012");
        assert_eq!(digits(1.234e7), "1.23\u{b7}10\u{2077}");
        assert_eq!(power(1.23e-4), "1.23\u{b7}10\u{207b}\u{2074}");
        assert_eq!(power(-2.0e13), "\u{2212}2.00\u{b7}10\u{b9}\u{b3}");
    }
}
