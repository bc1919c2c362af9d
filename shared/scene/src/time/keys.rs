//! `{ keys = [[time, value], ...], interpolation = "linear" }` instead of a value.

use super::curve::{Curve, Interpolation};
use super::form::{Form, Parts, number};
use crate::source::Fault;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

const EXPECTED: &str = "expected { keys = [[frame, value], [frame, value], ...] }, perhaps with an `interpolation`";

/// Whether a table gives keys.
pub fn are_in(table: &DeTable<'_>) -> bool {
    table.iter().any(|(key, _)| key.get_ref() == "keys")
}

/// A value over time.
#[derive(Debug)]
pub struct Track {
    place: Range<usize>,
    times: Vec<f64>,
    values: Values,
}

#[derive(Debug)]
enum Values {
    /// Each value, as TOML, holds until the next key.
    Steps(Vec<String>),
    Between {
        form: Form,
        curve: Curve,
    },
}

impl Track {
    /// `text`: the whole file's.
    pub fn read(table: &DeTable<'_>, place: Range<usize>, text: &str) -> Result<Self, Fault> {
        let mut interpolation = Interpolation::Linear;
        let mut keys = None;
        for (name, value) in table {
            match (name.get_ref().as_ref(), value.get_ref()) {
                ("keys", DeValue::Array(items)) => keys = Some(items),
                ("interpolation", DeValue::String(word)) => {
                    interpolation = match word.as_ref() {
                        "linear" => Interpolation::Linear,
                        "smooth" => Interpolation::Smooth,
                        "step" => Interpolation::Step,
                        _ => {
                            let message = "expected \"linear\", \"smooth\" or \"step\"";
                            return Err(Fault::new(value.span(), message));
                        }
                    }
                }
                ("keys" | "interpolation", _) => return Err(Fault::new(value.span(), EXPECTED)),
                (other, _) => {
                    let message = format!("unknown field `{other}`; {EXPECTED}");
                    return Err(Fault::new(name.span(), message));
                }
            }
        }
        let keys = keys.filter(|keys| keys.len() >= 2);
        let keys = keys.ok_or_else(|| Fault::new(place.clone(), EXPECTED))?;
        let (times, values) = read_keys(keys)?;
        let values = match interpolation {
            Interpolation::Step => {
                let written = |value: &&Spanned<DeValue<'_>>| text.get(value.span()).unwrap_or_default().to_owned();
                Values::Steps(values.iter().map(written).collect())
            }
            _ => {
                let mut parts = Parts::of(values.len());
                let form = Form::of(&values, &mut parts)?;
                let curve = Curve::new(times.clone(), parts, interpolation);
                Values::Between { form, curve }
            }
        };
        Ok(Self { place, times, values })
    }

    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The value at a time, as TOML; held before the first key and after the last.
    pub fn at(&self, time: f64) -> String {
        match &self.values {
            Values::Steps(values) => {
                let later = self.times.partition_point(|key| *key <= time);
                values[later.saturating_sub(1)].clone()
            }
            Values::Between { form, curve } => form.written(&curve.at(time)),
        }
    }

    /// Refuse an exposure that keys do not cover.
    pub fn covers(&self, [open, close]: [f64; 2]) -> Result<(), Fault> {
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        if first <= open && close <= last {
            return Ok(());
        }
        let when = match open == close {
            true => format!("the frame is {open}"),
            false => format!("the shutter is open from {open} to {close}"),
        };
        let message = format!("{when}, and the keys tell of {first} to {last}; expected keys that go so far");
        Err(Fault::new(self.place.clone(), message))
    }

    /// Whether the value changes during this interval.
    pub fn varies(&self, [open, close]: [f64; 2]) -> bool {
        let start = self.at(open);
        let within = self.times.iter().filter(|time| (open..=close).contains(*time));
        within.chain([&close]).any(|time| self.at(*time) != start)
    }
}

type Keys<'k, 't> = (Vec<f64>, Vec<&'k Spanned<DeValue<'t>>>);

fn read_keys<'k, 't>(keys: &'k [Spanned<DeValue<'t>>]) -> Result<Keys<'k, 't>, Fault> {
    let mut times: Vec<f64> = Vec::new();
    let mut values = Vec::new();
    for key in keys {
        let pair = match key.get_ref() {
            DeValue::Array(pair) if pair.len() == 2 => pair,
            _ => return Err(Fault::new(key.span(), "expected [frame, value]")),
        };
        let time = number(&pair[0])?;
        if let Some(before) = times.last().filter(|before| **before >= time) {
            let message = format!("keys must be in the order of their times: {time} comes after {before}");
            return Err(Fault::new(key.span(), message));
        }
        times.push(time);
        values.push(&pair[1]);
    }
    Ok((times, values))
}
