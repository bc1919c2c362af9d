//! Moving scenes. At any moment such a scene file equals a static one, with the keys' values and the frame's files at
//! that moment. This module makes the static one before anything else reads it.

mod clock;
mod curve;
mod form;
mod keys;
mod sequence;
#[cfg(test)]
mod tests;
mod turn;

use crate::source::Fault;
pub use clock::{AnimationRecord, Clock, FPS, When, frames};
pub use curve::{Curve, Interpolation};
pub use form::Parts;
use keys::Track;
pub use sequence::numbered;
use std::collections::BTreeSet;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Tables that cannot have keys.
const STILL: [&str; 3] = ["animation", "image", "render"];

/// What changes with time in a scene file, in file order.
#[derive(Debug, Default)]
pub struct Moving {
    /// When something may start or stop moving, or the file changes.
    breaks: BTreeSet<Instant>,
    /// Whether anything changes while the shutter is open.
    blurs: bool,
    /// Values as TOML, with the places they replace.
    values: Vec<Value>,
}

/// A finite time in frames.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Instant(f64);

impl Eq for Instant {}

impl PartialOrd for Instant {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Instant {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[derive(Debug)]
struct Value {
    text: String,
    place: Range<usize>,
    /// A field to add to the enclosing table, as TOML.
    beside: Option<(&'static str, String)>,
}

impl Moving {
    /// Find everything that moves in a scene file, and its value at a time.
    pub fn of(root: &DeTable<'_>, text: &str, clock: &Clock, time: f64) -> Result<Self, Fault> {
        let mut moving = Self::default();
        let walk = Walk { text, clock, time };
        for (key, value) in root {
            if !STILL.contains(&key.get_ref().as_ref()) {
                let kind = Kind::of(key.get_ref());
                walk.value(kind, key.get_ref(), value, &mut moving)?;
            }
        }
        Ok(moving)
    }

    /// A numbered file sequence.
    fn sequence(&mut self, kind: Kind, name: &str, [open, close]: [f64; 2], time: f64, place: Range<usize>) {
        let quoted = |text: String| toml::Value::String(text).to_string();
        let (file, beside) = match kind {
            _ if !sequence::has_frames(name) => (sequence::at(name, time), None),
            Kind::Shapes => {
                self.blurs |= open != close;
                self.breaks.extend(sequence::frames([open, close]).map(Instant));
                let (frame, weight) = sequence::between(time);
                let next = quoted(sequence::of_frame(name, frame + 1));
                let toward = format!("{{ file = {next}, weight = {weight:?} }}");
                (
                    sequence::of_frame(name, frame),
                    (weight > 0.0).then_some(("toward", toward)),
                )
            }
            Kind::Others => {
                self.blurs |= sequence::at(name, open) != sequence::at(name, close);
                self.breaks.extend(sequence::breaks([open, close]).map(Instant));
                (sequence::at(name, time), None)
            }
        };
        self.values.push(Value {
            text: quoted(file),
            place,
            beside,
        });
    }

    /// Whether anything changes while the shutter is open.
    pub fn blurs(&self) -> bool {
        self.blurs
    }

    /// Where in the file something moves.
    pub fn places(&self) -> Vec<Range<usize>> {
        self.values.iter().map(|value| value.place.clone()).collect()
    }

    /// Times, in order, whose files are all that passes need.
    pub fn times_of_files(&self, clock: &Clock) -> Vec<f64> {
        let [open, close] = clock.open();
        let within = self.breaks.iter().map(|instant| instant.0);
        let mut times = vec![open, close];
        times.extend(within.filter(|time| (open..=close).contains(time)));
        times.sort_by(f64::total_cmp);
        // At a time when the file changes, each side needs its own file.
        let between: Vec<f64> = times.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        times.extend(between);
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Replace what moves by its values.
    pub fn put<'t>(&'t self, mut root: Spanned<DeTable<'t>>) -> Result<Spanned<DeTable<'t>>, Fault> {
        let mut values = self.values.iter();
        for (key, value) in root.get_mut().iter_mut() {
            if !STILL.contains(&key.get_ref().as_ref()) {
                put(value, &mut values)?;
            }
        }
        Ok(root)
    }
}

/// What a table's files are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Shapes, which are interpolated between frames.
    Shapes,
    Others,
}

impl Kind {
    /// The kind for a top-level field.
    fn of(name: &str) -> Self {
        match name {
            "shapes" => Self::Shapes,
            _ => Self::Others,
        }
    }
}

struct Walk<'t> {
    text: &'t str,
    clock: &'t Clock,
    time: f64,
}

impl Walk<'_> {
    fn value(&self, kind: Kind, name: &str, value: &Spanned<DeValue<'_>>, moving: &mut Moving) -> Result<(), Fault> {
        match value.get_ref() {
            DeValue::Table(table) if keys::are_in(table) => {
                let track = Track::read(table, value.span(), self.text)?;
                let open = self.clock.needed(&value.span())?;
                track.covers(open)?;
                moving.blurs |= track.varies(open);
                moving.breaks.extend(track.times().iter().map(|time| Instant(*time)));
                moving.values.push(Value {
                    text: track.at(self.time),
                    place: value.span(),
                    beside: None,
                });
                Ok(())
            }
            DeValue::Table(table) => table.iter().try_for_each(|(key, value)| {
                // Images on shapes are not meshes.
                let kind = match &**key.get_ref() {
                    "image" => Kind::Others,
                    _ => kind,
                };
                self.value(kind, key.get_ref(), value, moving)
            }),
            DeValue::Array(items) => items.iter().try_for_each(|item| self.value(kind, name, item, moving)),
            DeValue::String(file) if self.clock.is_given() && sequence::is_one(name, file) => {
                let place = value.span();
                moving.sequence(kind, file, self.clock.open(), self.time, place);
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

/// Replace everything at the places of values.
fn put<'t>(value: &mut Spanned<DeValue<'t>>, values: &mut std::slice::Iter<'t, Value>) -> Result<(), Fault> {
    // An array of tables may have the span of its first table.
    let may_move = match value.get_ref() {
        DeValue::Table(table) => keys::are_in(table),
        other => matches!(other, DeValue::String(_)),
    };
    let next = values.as_slice().first();
    if let Some(next) = next.filter(|next| may_move && next.place == value.span()) {
        values.next();
        let placed = DeValue::parse(&next.text).map_err(|error| Fault::new(value.span(), error.message()))?;
        *value = moved(placed.into_inner(), value.span());
        return Ok(());
    }
    match value.get_mut() {
        DeValue::Table(table) => {
            let mut beside = Vec::new();
            for (_, value) in table.iter_mut() {
                let next = values.as_slice().first();
                let next = next.filter(|next| next.place == value.span());
                beside.extend(next.and_then(|next| Some((value.span(), next.beside.as_ref()?))));
                put(value, values)?;
            }
            for (place, (name, text)) in beside {
                let added = DeValue::parse(text).map_err(|error| Fault::new(place.clone(), error.message()))?;
                let key = Spanned::new(place.clone(), (*name).into());
                table.insert(key, moved(added.into_inner(), place));
            }
            Ok(())
        }
        DeValue::Array(items) => items.iter_mut().try_for_each(|item| put(item, values)),
        _ => Ok(()),
    }
}

/// A value whose spans, nested ones too, are set to this place.
fn moved(value: DeValue<'_>, place: Range<usize>) -> Spanned<DeValue<'_>> {
    let value = match value {
        DeValue::Array(items) => {
            let mut list = toml::de::DeArray::new();
            items
                .iter()
                .for_each(|item| list.push(moved(item.get_ref().clone(), place.clone())));
            DeValue::Array(list)
        }
        DeValue::Table(table) => {
            let fields = table.into_iter().map(|(key, value)| {
                let key = Spanned::new(place.clone(), key.into_inner());
                (key, moved(value.into_inner(), place.clone()))
            });
            DeValue::Table(fields.collect())
        }
        other => other,
    };
    Spanned::new(place, value)
}
