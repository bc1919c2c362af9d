//! The steps of a transform in a text: a list of inline tables, on one line or several, or an array of tables.

use super::digits;
use super::part::Part;
use super::set::put;
use glam::DVec3;
use toml_edit::{Array, ArrayOfTables, InlineTable, Item, TableLike, Value};

/// Axes whose sine is below this are equal.
const SAME_AXIS: f64 = 1e-5;

pub enum Steps<'a> {
    Inline(&'a mut Array),
    Tables(&'a mut ArrayOfTables),
}

impl<'a> Steps<'a> {
    /// The steps under `transform`, created if missing.
    pub fn of(table: &'a mut dyn TableLike) -> Result<Self, String> {
        match table.entry("transform").or_insert(Item::Value(Array::new().into())) {
            Item::Value(value) => Self::of_value(value),
            Item::ArrayOfTables(tables) => Ok(Self::Tables(tables)),
            _ => Err("its transform is no list".to_owned()),
        }
    }

    pub fn of_value(value: &'a mut Value) -> Result<Self, String> {
        value
            .as_array_mut()
            .map(Self::Inline)
            .ok_or_else(|| "its transform is no list".to_owned())
    }

    fn len(&self) -> usize {
        match self {
            Self::Inline(list) => list.len(),
            Self::Tables(list) => list.len(),
        }
    }

    fn step(&mut self, index: usize) -> Option<&mut dyn TableLike> {
        match self {
            Self::Inline(list) => Some(list.get_mut(index)?.as_inline_table_mut()?),
            Self::Tables(list) => Some(list.get_mut(index)?),
        }
    }

    /// The last step's vector, if it is a translation.
    pub fn last_translation(&mut self) -> Option<DVec3> {
        let last = self.step(self.len().checked_sub(1)?)?;
        vector(&Part::Table(last).get("translate")?)
    }

    /// Append a translation, or merge it with the last one.
    pub fn translate(&mut self, by: DVec3) {
        match (self.last_translation(), self.len().checked_sub(1)) {
            (Some(before), Some(last)) => {
                if let Some(step) = self.step(last) {
                    put(step, "translate", digits::vector(digits::sum_of_vectors(before, by)));
                }
            }
            _ => self.insert(self.len(), "translate", digits::vector(by)),
        }
    }

    /// Insert a rotation before a trailing translation, or append it.
    pub fn turn(&mut self, axis: DVec3, degrees: f64) {
        let end = self.len() - usize::from(self.last_translation().is_some());
        if end
            .checked_sub(1)
            .is_some_and(|before| self.turn_further(before, axis, degrees))
        {
            return;
        }
        self.insert(end, "rotate", rotation(axis, degrees));
    }

    /// Append a rotation about a point.
    pub fn turn_about(&mut self, point: DVec3, axis: DVec3, degrees: f64) {
        let there = digits::vector(DVec3::ZERO - point);
        for (name, value) in [
            ("translate", there),
            ("rotate", rotation(axis, degrees)),
            ("translate", digits::vector(point)),
        ] {
            self.insert(self.len(), name, value);
        }
    }

    /// Add to a step's angle if it has the same axis.
    fn turn_further(&mut self, index: usize, axis: DVec3, degrees: f64) -> bool {
        let rotation = self
            .step(index)
            .and_then(|step| step.get_mut("rotate")?.as_table_like_mut());
        let Some(rotation) = rotation else {
            return false;
        };
        let part = Part::Table(rotation);
        let given = part.get("axis").and_then(|axis| vector(&axis)?.try_normalize());
        let angle = part.get("angle").and_then(|angle| angle.number());
        let (Some(given), Some(angle)) = (given, angle) else {
            return false;
        };
        if given.cross(axis).length() > SAME_AXIS {
            return false;
        }
        let sum = digits::sum(angle, degrees * given.dot(axis).signum());
        put(rotation, "angle", digits::value(digits::rounded(sum % 360.0, 9)));
        true
    }

    /// Insert a step at an index, or append it.
    fn insert(&mut self, index: usize, name: &str, value: Value) {
        let mut step = InlineTable::new();
        step.insert(name, value);
        match self {
            Self::Inline(list) => insert_inline(list, index, step.into()),
            Self::Tables(list) => {
                let mut table = step.into_table();
                let beside = list.get(index).or(list.get(list.len().saturating_sub(1)));
                let space = beside.and_then(|table| table.decor().prefix()?.as_str());
                if let Some(space) = space.filter(|space| !space.contains('#')) {
                    table.decor_mut().set_prefix(space.to_owned());
                }
                list.insert(index, table);
            }
        }
    }
}

/// The rotation of a step.
pub fn rotation(axis: DVec3, degrees: f64) -> Value {
    let mut rotation = InlineTable::new();
    rotation.insert("axis", digits::vector(axis));
    rotation.insert("angle", digits::value(degrees));
    rotation.into()
}

/// Three numbers.
pub fn vector(part: &Part<'_>) -> Option<DVec3> {
    let numbers = <[f64; 3]>::try_from(part.numbers()?);
    numbers.ok().map(DVec3::from)
}

/// Insert a step formatted like its neighbours; comments stay with their steps.
fn insert_inline(list: &mut Array, index: usize, mut step: Value) {
    let string = |raw: Option<&toml_edit::RawString>| raw.and_then(|raw| raw.as_str()).map(str::to_owned);
    let before = |value: &Value| string(value.decor().prefix());
    // If steps are on their own lines, each begins with a newline.
    let first = list.get(0).and_then(before).unwrap_or_default();
    let lines = first.rfind('\n').map(|end| first[end..].to_owned());
    let between = lines.clone().unwrap_or_else(|| " ".to_owned());
    if let Some(next) = list.get_mut(index) {
        step.decor_mut().set_prefix(before(next).unwrap_or_default());
        next.decor_mut().set_prefix(between);
    } else if let Some(last) = index.checked_sub(1).and_then(|last| list.get_mut(last)) {
        let suffix = string(last.decor().suffix()).unwrap_or_default();
        last.decor_mut().set_suffix("");
        let behind = format!("{suffix}{}", list.trailing().as_str().unwrap_or_default());
        if behind.contains('#') {
            let line = lines.unwrap_or_else(|| "\n".to_owned());
            step.decor_mut().set_prefix(format!("{}{line}", behind.trim_end()));
            list.set_trailing(behind.rfind('\n').map_or("\n", |end| &behind[end..]).to_owned());
        } else {
            step.decor_mut().set_prefix(between);
            if !list.trailing_comma() {
                step.decor_mut().set_suffix(suffix);
            }
        }
    }
    list.insert_formatted(index, step);
}
