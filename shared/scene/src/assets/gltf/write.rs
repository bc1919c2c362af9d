//! Values as TOML.

use glam::{DAffine3, DVec3};

/// A name or path as a TOML string.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A number as TOML with all its digits.
pub fn number(x: f64) -> String {
    match x.is_nan() {
        true => "nan".to_string(),
        false => format!("{x:?}"),
    }
}

pub fn vector(v: DVec3) -> String {
    numbers(&v.to_array())
}

pub fn numbers(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|x| number(*x)).collect();
    format!("[{}]", values.join(", "))
}

/// A transform step.
pub fn matrix(map: &DAffine3) -> String {
    let m = map.matrix3;
    let row = |i: usize| numbers(&[m.x_axis[i], m.y_axis[i], m.z_axis[i], map.translation[i]]);
    format!("{{ matrix = [{}, {}, {}, [0, 0, 0, 1]] }}", row(0), row(1), row(2))
}
