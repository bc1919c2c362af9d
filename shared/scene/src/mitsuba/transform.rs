//! The operations of `<transform>`, which the native format has too.

use super::attributes::{Attributes, number, numbers, only, triple};
use super::write::Toml;
use crate::transform as native;
use glam::{DAffine3, DMat3, DVec3};

/// One operation.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    Translate([f64; 3]),
    Scale([f64; 3]),
    Rotate {
        axis: [f64; 3],
        degrees: f64,
    },
    LookAt {
        origin: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
    },
    /// The first three rows; the last is [0, 0, 0, 1].
    Matrix([[f64; 4]; 3]),
}

/// The operation of an element. `old`: the file is of a version before 2, whose rotations accept axes of any length.
pub fn step(tag: &str, attributes: &Attributes, old: bool) -> Result<Step, String> {
    let within = |message: String| format!("<{tag}>: {message}");
    let tag = if old && tag == "lookAt" { "lookat" } else { tag };
    let known: &[&str] = match tag {
        "translate" | "scale" => &["value", "x", "y", "z"],
        "rotate" => &["value", "x", "y", "z", "angle"],
        "lookat" => &["origin", "target", "up"],
        "matrix" => &["value"],
        _ => {
            return Err(format!(
                "<{tag}> cannot stand within <transform>; expected translate, rotate, scale, lookat or matrix"
            ));
        }
    };
    only(tag, attributes, known)?;
    let required = |name: &str| {
        attributes
            .get(name)
            .ok_or_else(|| format!("<{tag}> lacks the attribute \"{name}\""))
    };
    match tag {
        "translate" => Ok(Step::Translate(triple(tag, attributes, Some(0.0)).map_err(within)?)),
        "scale" => Ok(Step::Scale(triple(tag, attributes, Some(1.0)).map_err(within)?)),
        "rotate" => {
            let axis = triple(tag, attributes, Some(0.0)).map_err(within)?;
            if axis == [0.0; 3] {
                return Err("<rotate>: the axis must not be 0, 0, 0".to_string());
            }
            let degrees = number(required("angle")?).map_err(within)?;
            match old {
                true => Ok(Step::Rotate { axis, degrees }),
                false => Ok(rotation(axis, degrees)),
            }
        }
        "lookat" => look_at(
            point(required("origin")?).map_err(within)?,
            point(required("target")?).map_err(within)?,
            match attributes.get("up").filter(|text| !text.trim().is_empty()) {
                Some(text) => Some(point(text).map_err(within)?),
                None => None,
            },
        ),
        _ => matrix(required("value")?).map_err(within),
    }
}

/// Mitsuba puts the axis into Rodrigues' formula unnormalised: another length than 1 also scales and shears.
fn rotation(axis: [f64; 3], degrees: f64) -> Step {
    let a = DVec3::from(axis);
    if (a.length_squared() - 1.0).abs() < 1e-6 {
        return Step::Rotate { axis, degrees };
    }
    let (sin, cos) = libm::sincos(degrees.to_radians());
    let column = |e: DVec3| e * cos + a.cross(e) * sin + a * (a.dot(e) * (1.0 - cos));
    let (x, y, z) = (column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
    let row = |i: usize| [x[i], y[i], z[i], 0.0];
    Step::Matrix([row(0), row(1), row(2)])
}

fn point(text: &str) -> Result<[f64; 3], String> {
    <[f64; 3]>::try_from(numbers(text)?).map_err(|_| format!("expected three numbers, found \"{text}\""))
}

fn look_at(origin: [f64; 3], target: [f64; 3], up: Option<[f64; 3]>) -> Result<Step, String> {
    let direction = (DVec3::from(target) - DVec3::from(origin))
        .try_normalize()
        .ok_or("<lookat>: expected two different points as origin and target")?;
    let up = match up.filter(|up| *up != [0.0; 3]) {
        Some(up) => up,
        None => any_up(direction).into(),
    };
    if DVec3::from(up).normalize_or_zero().cross(direction).length() < 1e-9 {
        return Err("<lookat>: up must not be parallel to the direction from origin to target".to_string());
    }
    Ok(Step::LookAt { origin, target, up })
}

/// The first vector of Mitsuba's frame around a direction (Duff et al. 2017), used when `up` is missing.
fn any_up(n: DVec3) -> DVec3 {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x)
}

fn matrix(text: &str) -> Result<Step, String> {
    let n = numbers(text)?;
    match n[..] {
        [a, b, c, d, e, f, g, h, i] => Ok(Step::Matrix([[a, b, c, 0.0], [d, e, f, 0.0], [g, h, i, 0.0]])),
        _ if n.len() == 16 => {
            if n[12..] != [0.0, 0.0, 0.0, 1.0] {
                return Err("expected 0, 0, 0, 1 as the last row".to_string());
            }
            let row = |i: usize| [n[i], n[i + 1], n[i + 2], n[i + 3]];
            Ok(Step::Matrix([row(0), row(4), row(8)]))
        }
        _ => Err(format!("expected 9 or 16 numbers, found {}", n.len())),
    }
}

/// The product of the steps.
pub fn compose(steps: &[Step]) -> DAffine3 {
    steps.iter().fold(DAffine3::IDENTITY, |total, step| map(step) * total)
}

fn map(step: &Step) -> DAffine3 {
    match *step {
        Step::Translate(by) => DAffine3::from_translation(by.into()),
        Step::Scale(by) => DAffine3::from_scale(by.into()),
        Step::Rotate { axis, degrees } => DAffine3::from_mat3(native::rotation(axis.into(), degrees)),
        Step::LookAt { origin, target, up } => {
            let forward = (DVec3::from(target) - DVec3::from(origin)).normalize_or_zero();
            let left = DVec3::from(up).cross(forward).normalize_or_zero();
            DAffine3::from_cols(left, forward.cross(left), forward, origin.into())
        }
        Step::Matrix(rows) => {
            let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
            DAffine3::from_cols(column(0), column(1), column(2), column(3))
        }
    }
}

/// The steps restricted to the plane (Mitsuba drops the third row and column of a `to_uv`).
pub fn flat(steps: &[Step]) -> DMat3 {
    let m = compose(steps);
    let (x, y) = (m.matrix3.x_axis, m.matrix3.y_axis);
    DMat3::from_cols(
        DVec3::new(x.x, x.y, 0.0),
        DVec3::new(y.x, y.y, 0.0),
        DVec3::new(m.translation.x, m.translation.y, 1.0),
    )
}

/// The steps in the native format.
pub fn write(steps: &[Step]) -> Toml {
    Toml::Array(steps.iter().map(write_step).collect())
}

fn write_step(step: &Step) -> Toml {
    let vector = |v: &[f64; 3]| Toml::numbers(v);
    let (name, value) = match step {
        Step::Translate(by) => ("translate", vector(by)),
        Step::Scale([x, y, z]) if x == y && y == z => ("scale", Toml::Float(*x)),
        Step::Scale(by) => ("scale", vector(by)),
        Step::Rotate { axis, degrees } => (
            "rotate",
            Toml::table([("axis", vector(axis)), ("angle", Toml::Float(*degrees))]),
        ),
        Step::LookAt { origin, target, up } => (
            "look_at",
            Toml::table([
                ("origin", vector(origin)),
                ("target", vector(target)),
                ("up", vector(up)),
            ]),
        ),
        Step::Matrix(rows) => {
            let last = [0.0, 0.0, 0.0, 1.0];
            let rows = rows.iter().chain([&last]).map(|row| Toml::numbers(row));
            ("matrix", Toml::Array(rows.collect()))
        }
    };
    Toml::table([(name, value)])
}
