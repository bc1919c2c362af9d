//! The form that all keys of a value share. The rest are numbers, which can be interpolated.

use super::turn::{axis_and_angle, from_axis_and_angle};
use crate::source::Fault;
use glam::{DMat3, DQuat, DVec3, DVec4};
use std::fmt::Write;
use toml::Spanned;
use toml::de::DeValue;

/// The form of a value, and how many numbers represent it.
#[derive(Debug)]
pub enum Form {
    /// One number.
    Number,
    /// The numbers of its items.
    List(Vec<Form>),
    /// The numbers of its fields.
    Table(Vec<(String, Form)>),
    /// A rotation as a unit quaternion: four numbers.
    Turn,
    /// An affine map, as the product of a translation (three numbers), a rotation (four), a stretch (nine) and this
    /// sign, which is -1 for mirror images.
    Matrix { sign: f64 },
    /// No numbers: the same TOML in all keys.
    Fixed(String),
}

/// The numbers of all keys.
#[derive(Debug)]
pub struct Parts {
    /// One list of numbers per key.
    pub values: Vec<Vec<f64>>,
    /// Offsets of the unit quaternions.
    pub turns: Vec<usize>,
}

type Values<'k, 't> = [&'k Spanned<DeValue<'t>>];

impl Parts {
    pub fn of(keys: usize) -> Self {
        Self {
            values: vec![Vec::new(); keys],
            turns: Vec::new(),
        }
    }

    fn push(&mut self, key: usize, numbers: impl IntoIterator<Item = f64>) {
        self.values[key].extend(numbers);
    }

    fn begin_turn(&mut self) {
        self.turns.push(self.values[0].len());
    }
}

/// A finite number.
pub fn number(value: &Spanned<DeValue<'_>>) -> Result<f64, Fault> {
    let read = match value.get_ref() {
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .map(|integer| integer as f64),
        DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
        _ => None,
    };
    let finite = read.filter(|number| number.is_finite());
    finite.ok_or_else(|| Fault::new(value.span(), "expected a finite number"))
}

impl Form {
    /// The common form of one or more keys, with their numbers.
    pub fn of(values: &Values<'_, '_>, parts: &mut Parts) -> Result<Self, Fault> {
        let is_number = |value: &DeValue<'_>| matches!(value, DeValue::Integer(_) | DeValue::Float(_));
        let is_color = |value: &DeValue<'_>| value.as_array().is_some_and(|items| items.len() == 3);
        if values
            .iter()
            .all(|value| is_number(value.get_ref()) || is_color(value.get_ref()))
            && values.iter().any(|value| is_number(value.get_ref()))
            && values.iter().any(|value| is_color(value.get_ref()))
        {
            return Self::of_greys(values, parts);
        }
        match values[0].get_ref() {
            first if is_number(first) => {
                for (key, value) in values.iter().enumerate() {
                    if !is_number(value.get_ref()) {
                        return Err(other_form(value));
                    }
                    parts.push(key, [number(value)?]);
                }
                Ok(Self::Number)
            }
            DeValue::Array(first) => {
                let lists = values.iter().map(|value| match value.get_ref() {
                    DeValue::Array(items) if items.len() == first.len() => Ok(items),
                    _ => Err(other_form(value)),
                });
                let lists: Vec<_> = lists.collect::<Result<_, _>>()?;
                let forms = (0..first.len()).map(|i| {
                    let items: Vec<_> = lists.iter().map(|list| &list[i]).collect();
                    Self::of(&items, parts)
                });
                Ok(Self::List(forms.collect::<Result<_, _>>()?))
            }
            DeValue::Table(first) => {
                let mut fields = Vec::new();
                for (name, _) in first {
                    let name = name.get_ref().as_ref();
                    let field = |value: &&Spanned<DeValue<'_>>| value.get_ref().get(name).is_some();
                    if let Some(value) = values.iter().find(|value| !field(value)) {
                        return Err(other_form(value));
                    }
                    let field: Vec<_> = values.iter().filter_map(|value| value.get_ref().get(name)).collect();
                    let form = match name {
                        "rotate" => Self::of_turns(&field, parts)?,
                        "matrix" => Self::of_matrices(&field, parts)?,
                        _ => Self::of(&field, parts)?,
                    };
                    fields.push((name.to_owned(), form));
                }
                let more = |value: &&&Spanned<DeValue<'_>>| {
                    value
                        .get_ref()
                        .as_table()
                        .is_none_or(|table| table.len() != fields.len())
                };
                match values.iter().find(more) {
                    Some(value) => Err(other_form(value)),
                    None => Ok(Self::Table(fields)),
                }
            }
            first => {
                let same = |value: &DeValue<'_>| match (first, value) {
                    (DeValue::String(a), DeValue::String(b)) => a == b,
                    (DeValue::Boolean(a), DeValue::Boolean(b)) => a == b,
                    _ => false,
                };
                match values.iter().find(|value| !same(value.get_ref())) {
                    Some(value) => Err(Fault::new(
                        value.span(),
                        "there is nothing between this and the other keys; expected numbers, or `interpolation = \"step\"`",
                    )),
                    None => Ok(Self::Fixed(match first {
                        DeValue::String(text) => toml::Value::String(text.to_string()).to_string(),
                        DeValue::Boolean(yes) => yes.to_string(),
                        _ => return Err(Fault::new(values[0].span(), "expected numbers")),
                    })),
                }
            }
        }
    }

    /// Colours, some of which are given as one number.
    fn of_greys(values: &Values<'_, '_>, parts: &mut Parts) -> Result<Self, Fault> {
        for (key, value) in values.iter().enumerate() {
            for channel in 0..3 {
                let of_channel = value.get_ref().as_array().map_or(*value, |items| &items[channel]);
                parts.push(key, [number(of_channel)?]);
            }
        }
        Ok(Self::List(vec![Self::Number, Self::Number, Self::Number]))
    }

    /// Rotations about a common axis interpolate the angle, beyond full turns too; others interpolate the rotation.
    fn of_turns(values: &Values<'_, '_>, parts: &mut Parts) -> Result<Self, Fault> {
        let axis = |value: &&Spanned<DeValue<'_>>| vector(value.get_ref().get("axis")?);
        let angle = |value: &&Spanned<DeValue<'_>>| number(value.get_ref().get("angle")?).ok();
        let axes: Vec<Option<DVec3>> = values.iter().map(axis).collect();
        if axes.iter().any(Option::is_none) || axes.iter().all(|axis| *axis == axes[0]) {
            return Self::of(values, parts);
        }
        parts.begin_turn();
        for (key, (value, axis)) in values.iter().zip(axes).enumerate() {
            let turn = axis
                .zip(angle(value))
                .and_then(|(axis, angle)| from_axis_and_angle(axis, angle));
            let turn =
                turn.ok_or_else(|| Fault::new(value.span(), "expected { axis = [x, y, z], angle = degrees }"))?;
            parts.push(key, turn.to_array());
        }
        Ok(Self::Turn)
    }

    fn of_matrices(values: &Values<'_, '_>, parts: &mut Parts) -> Result<Self, Fault> {
        let maps = values.iter().map(|value| {
            let map = affine(value).and_then(|(linear, translation)| Some((polar(linear)?, translation)));
            map.ok_or_else(|| {
                let message =
                    "expected four rows of four numbers, the last one [0, 0, 0, 1], of a map that has an inverse";
                Fault::new(value.span(), message)
            })
        });
        let maps: Vec<(Polar, DVec3)> = maps.collect::<Result<_, _>>()?;
        let sign = maps[0].0.sign;
        if let Some(k) = maps.iter().position(|(polar, _)| polar.sign != sign) {
            return Err(Fault::new(
                values[k].span(),
                "it mirrors, and the first key does not, or the other way round: there is nothing between them",
            ));
        }
        for (key, (_, translation)) in maps.iter().enumerate() {
            parts.push(key, translation.to_array());
        }
        parts.begin_turn();
        for (key, (polar, _)) in maps.iter().enumerate() {
            parts.push(key, polar.rotation.to_array());
            parts.push(key, polar.stretch.to_cols_array());
        }
        Ok(Self::Matrix { sign })
    }

    /// A value of this form, as TOML.
    pub fn written(&self, numbers: &[f64]) -> String {
        let mut text = String::new();
        self.write(&mut numbers.iter().copied(), &mut text);
        text
    }

    fn write(&self, numbers: &mut impl Iterator<Item = f64>, text: &mut String) {
        match self {
            Self::Number => push_number(text, numbers.next().unwrap_or_default()),
            Self::List(items) => bracketed(text, items, |text, item| item.write(numbers, text)),
            Self::Table(fields) => {
                text.push('{');
                for (i, (name, form)) in fields.iter().enumerate() {
                    let name = toml::Value::String(name.clone());
                    let _ = write!(text, "{}{name} = ", if i > 0 { ", " } else { " " });
                    form.write(numbers, text);
                }
                text.push_str(" }");
            }
            Self::Turn => {
                let (axis, angle) = axis_and_angle(DVec4::from_array(taken(numbers)));
                text.push_str("{ axis = ");
                bracketed(text, &axis, |text, x| push_number(text, *x));
                text.push_str(", angle = ");
                push_number(text, angle);
                text.push_str(" }");
            }
            Self::Matrix { sign } => {
                let translation: [f64; 3] = taken(numbers);
                let rotation = DMat3::from_quat(DQuat::from_array(taken(numbers)));
                let stretch = DMat3::from_cols_array(&taken(numbers));
                let linear = rotation * stretch * *sign;
                let row = |i: usize| [linear.x_axis[i], linear.y_axis[i], linear.z_axis[i], translation[i]];
                let rows = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
                bracketed(text, &rows, |text, row| {
                    bracketed(text, row, |text, x| push_number(text, *x))
                });
            }
            Self::Fixed(value) => text.push_str(value),
        }
    }
}

fn other_form(value: &Spanned<DeValue<'_>>) -> Fault {
    let message = "it has another form than the value of the first key; expected the same fields, \
        and as many numbers, in all of them";
    Fault::new(value.span(), message)
}

fn taken<const N: usize>(numbers: &mut impl Iterator<Item = f64>) -> [f64; N] {
    std::array::from_fn(|_| numbers.next().unwrap_or_default())
}

/// Written without losing a bit.
fn push_number(text: &mut String, x: f64) {
    let _ = write!(text, "{x:?}");
}

fn bracketed<T>(text: &mut String, items: &[T], mut write: impl FnMut(&mut String, &T)) {
    text.push('[');
    for (i, item) in items.iter().enumerate() {
        if i > 0 {
            text.push_str(", ");
        }
        write(text, item);
    }
    text.push(']');
}

fn vector(value: &Spanned<DeValue<'_>>) -> Option<DVec3> {
    let items = value.get_ref().as_array().filter(|items| items.len() == 3)?;
    let numbers: Vec<f64> = items.iter().map(number).collect::<Result<_, _>>().ok()?;
    Some(DVec3::from_slice(&numbers))
}

fn affine(value: &Spanned<DeValue<'_>>) -> Option<(DMat3, DVec3)> {
    let rows = value.get_ref().as_array().filter(|rows| rows.len() == 4)?;
    let mut numbers = [[0.0; 4]; 4];
    for (row, into) in rows.iter().zip(&mut numbers) {
        let row = row.get_ref().as_array().filter(|row| row.len() == 4)?;
        for (value, into) in row.iter().zip(into) {
            *into = number(value).ok()?;
        }
    }
    let [a, b, c, last] = numbers;
    let column = |i: usize| DVec3::new(a[i], b[i], c[i]);
    (last == [0.0, 0.0, 0.0, 1.0]).then(|| (DMat3::from_cols(column(0), column(1), column(2)), column(3)))
}

/// A linear map's polar decomposition.
struct Polar {
    rotation: DQuat,
    /// Symmetric and positive; applied first.
    stretch: DMat3,
    /// -1 for maps that mirror.
    sign: f64,
}

/// By Newton's iteration (Higham 1986), as in Shoemake and Duff, "Matrix animation and polar decomposition" (1992).
fn polar(map: DMat3) -> Option<Polar> {
    let volume = map.determinant();
    let size = map.x_axis.length() * map.y_axis.length() * map.z_axis.length();
    if !size.is_finite() || volume.is_nan() || volume.abs() <= 1e-12 * size {
        return None;
    }
    let sign = volume.signum();
    let map = map * sign;
    let mut orthogonal = map;
    for _ in 0..64 {
        let next = (orthogonal + orthogonal.inverse().transpose()) * 0.5;
        let change = next - orthogonal;
        orthogonal = next;
        if change.to_cols_array().iter().all(|x| x.abs() < 1e-15) {
            break;
        }
    }
    let rotation = DQuat::from_mat3(&orthogonal).normalize();
    let stretch = DMat3::from_quat(rotation).transpose() * map;
    rotation.is_finite().then_some(Polar {
        rotation,
        stretch,
        sign,
    })
}
