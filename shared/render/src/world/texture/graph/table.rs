//! Ramps and curves: tables over a number.

use crate::math::Rgb;

/// Interpolation between two entries of a [`Table`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// A straight line.
    Linear,
    /// The lower entry.
    Constant,
    /// A curve with zero slope at both ends.
    Ease,
}

/// One entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Position.
    pub at: f32,
    /// Colour; for a curve, the number three times.
    pub color: Rgb,
    /// Opacity.
    pub alpha: f32,
}

/// Ordered entries, at least one. Beyond the ends, ramps stay constant and curves go on straight.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    entries: Vec<Entry>,
    between: Between,
    extends: bool,
}

impl Table {
    /// A ramp. Sorts the entries; `None` if there are none.
    pub fn ramp(mut entries: Vec<Entry>, between: Between) -> Option<Self> {
        entries.sort_by(|a, b| a.at.total_cmp(&b.at));
        (!entries.is_empty()).then_some(Self {
            entries,
            between,
            extends: false,
        })
    }

    /// A curve through points, linear between and beyond them; `None` if there are none.
    pub fn curve(points: impl IntoIterator<Item = [f32; 2]>) -> Option<Self> {
        let entry = |[at, value]: [f32; 2]| Entry {
            at,
            color: Rgb::splat(value),
            alpha: 1.0,
        };
        let ramp = Self::ramp(points.into_iter().map(entry).collect(), Between::Linear)?;
        Some(Self { extends: true, ..ramp })
    }

    /// The entries.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The colour at `x`.
    pub fn color(&self, x: f32) -> Rgb {
        let (a, b, t) = self.around(x);
        a.color * (1.0 - t) + b.color * t
    }

    /// The opacity at `x`.
    pub fn alpha(&self, x: f32) -> f32 {
        let (a, b, t) = self.around(x);
        a.alpha * (1.0 - t) + b.alpha * t
    }

    /// Whether it extrapolates linearly beyond its ends.
    pub fn extends(&self) -> bool {
        self.extends
    }

    fn around(&self, x: f32) -> (&Entry, &Entry, f32) {
        let last = self.entries.len() - 1;
        let above = self.entries.partition_point(|entry| entry.at <= x);
        let pair = match (above, self.extends) {
            (0, false) => return (&self.entries[0], &self.entries[0], 0.0),
            (above, false) if above > last => return (&self.entries[last], &self.entries[last], 0.0),
            (above, _) => above.clamp(1, last.max(1)),
        };
        let a = &self.entries[pair - 1];
        let Some(b) = self.entries.get(pair) else {
            return (a, a, 0.0);
        };
        let width = b.at - a.at;
        let t = if width > 0.0 { (x - a.at) / width } else { 0.0 };
        let t = match self.between {
            Between::Linear => t,
            Between::Constant => 0.0,
            Between::Ease => t * t * (3.0 - 2.0 * t),
        };
        (a, b, t)
    }
}
