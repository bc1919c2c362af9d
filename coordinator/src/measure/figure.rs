//! Shared by figures: axes, powers of ten, and subpixel coordinates.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// plotters has integer coordinates; this many per pixel keep slanted lines and dashes from wobbling.
pub const FINE: i32 = 4;

/// A size in pixels, in these coordinates.
pub fn fine((width, height): (u32, u32)) -> (u32, u32) {
    (width * FINE as u32, height * FINE as u32)
}

/// An SVG in these coordinates, displayed at `size` in pixels.
pub fn shown_at(svg: String, size: (u32, u32)) -> String {
    let attributes = |(width, height)| format!("<svg width=\"{width}\" height=\"{height}\"");
    svg.replacen(&attributes(fine(size)), &attributes(size), 1)
}

/// A logarithmic axis labelled with powers of ten. The axis of plotters has plain numbers at positions that depend on
/// the plot's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decades {
    /// Logarithms to base 10 of its ends.
    low: f64,
    high: f64,
}

impl Decades {
    /// An axis with a margin around these values, spanning at least two powers of ten.
    pub fn around(values: impl Iterator<Item = f64>) -> Option<Self> {
        let logs = values.map(libm::log10);
        let (low, high) = logs.map(|v| (v, v)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let room = 0.06 * (high - low) + 0.05;
        let (low, high) = (low - room, high + room);
        if high.floor() - low.ceil() >= 1.0 {
            return Some(Self { low, high });
        }
        let low = low.floor();
        Some(Self {
            low,
            high: high.ceil().max(low + 1.0),
        })
    }

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
        // A small tolerance for ends that are powers of ten.
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

/// An integer as a superscript.
pub fn superscript(exponent: &str) -> String {
    let raised = exponent.chars().map(|digit| match digit {
        '-' => '\u{207b}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        digit => digit
            .to_digit(10)
            .and_then(|d| char::from_u32(0x2070 + d))
            .unwrap_or(digit),
    });
    raised.collect()
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
            let axis = Decades::around(values.iter().copied()).unwrap();
            for v in values {
                assert!((0..=1000).contains(&axis.map(v, (0, 1000))), "{values:?}");
            }
            let powers = axis.key_points(BoldPoints(9));
            assert!(powers.len() >= 2, "{values:?}: {powers:?}");
        }
        assert_eq!(Decades::around(std::iter::empty()), None);
    }
}
