//! Transforms of the scene file, in double precision.

use super::parse::{Fault, LookAtRecord, RotateRecord, StepRecord, Steps, UvStepRecord, UvSteps};
use super::values::{Finite, Number};
use glam::{Affine3A, DAffine3, DMat3, DVec3};

/// The product of the steps; the first is applied first.
pub fn compose(steps: &Steps) -> Result<DAffine3, Fault> {
    let mut total = DAffine3::IDENTITY;
    for step in &steps.0 {
        let map = matrix(step.get_ref()).map_err(|message| Fault::new(step.span(), message))?;
        total = map * total;
    }
    Ok(total)
}

/// The product of steps that stay in the xy plane, which is u and v.
pub fn compose_uv(steps: &UvSteps) -> Result<DAffine3, Fault> {
    let mut total = DAffine3::IDENTITY;
    for step in steps.get_ref() {
        let map = uv_matrix(step.get_ref()).map_err(|message| Fault::new(step.span(), message))?;
        total = map * total;
    }
    Ok(total)
}

fn uv_matrix(step: &UvStepRecord) -> Result<DAffine3, &'static str> {
    let maps = [
        step.scale.map(|factors| match factors.0 {
            DVec3 { x, y, z } if z == 1.0 || (x == y && y == z) => Ok(DAffine3::from_scale(DVec3::new(x, y, 1.0))),
            _ => Err("texture coordinates are scaled by one number or by [u, v, 1]"),
        }),
        step.rotate.as_ref().map(|record| match record.axis.0 {
            DVec3 { x: 0.0, y: 0.0, .. } => rotate(record),
            _ => Err("texture coordinates are rotated around the axis [0, 0, 1]"),
        }),
        step.translate.map(|by| match by.0.z {
            0.0 => Ok(DAffine3::from_translation(by.0)),
            _ => Err("texture coordinates are moved by [u, v, 0]"),
        }),
        step.matrix.as_ref().map(|rows| {
            let rows: Vec<&[Number<Finite>]> = rows.iter().map(Vec::as_slice).collect();
            let [[a, b, c], [d, e, f], [g, h, i]] = rows[..] else {
                return Err("expected three rows of three numbers as `matrix`");
            };
            if [g, h, i].map(|x| x.0) != [0.0, 0.0, 1.0] {
                return Err("expected [0, 0, 1] as the last row of `matrix`");
            }
            Ok(DAffine3::from_cols(
                DVec3::new(a.0, d.0, 0.0),
                DVec3::new(b.0, e.0, 0.0),
                DVec3::Z,
                DVec3::new(c.0, f.0, 0.0),
            ))
        }),
    ];
    let mut given = maps.into_iter().flatten();
    match (given.next(), given.next()) {
        (Some(map), None) => map,
        _ => Err("expected exactly one of scale, rotate, translate, matrix in a step"),
    }
}

fn matrix(step: &StepRecord) -> Result<DAffine3, &'static str> {
    let maps = [
        step.scale.map(|factors| Ok(DAffine3::from_scale(factors.0))),
        step.rotate.as_ref().map(rotate),
        step.translate.map(|by| Ok(DAffine3::from_translation(by.0))),
        step.matrix.as_ref().map(|rows| affine(rows)),
        step.look_at.as_ref().map(look_at),
    ];
    let mut given = maps.into_iter().flatten();
    match (given.next(), given.next()) {
        (Some(map), None) => map,
        _ => Err("expected exactly one of scale, rotate, translate, matrix, look_at in a step"),
    }
}

fn rotate(record: &RotateRecord) -> Result<DAffine3, &'static str> {
    let axis = record.axis.0.try_normalize();
    let axis = axis.ok_or("the axis of a rotation must not be [0, 0, 0]")?;
    Ok(DAffine3::from_mat3(rotation(axis, record.angle.0)))
}

fn affine(rows: &[Vec<Number<Finite>>]) -> Result<DAffine3, &'static str> {
    let mut values = [[0.0; 4]; 4];
    if rows.len() != 4 || rows.iter().any(|row| row.len() != 4) {
        return Err("expected four rows of four numbers as `matrix`");
    }
    for (value, number) in values.iter_mut().flatten().zip(rows.iter().flatten()) {
        *value = number.0;
    }
    let rows = values;
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err("expected [0, 0, 0, 1] as the last row of `matrix`");
    }
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    Ok(DAffine3::from_cols(column(0), column(1), column(2), column(3)))
}

/// Takes the origin to `origin` and +z towards `target`, with `up` in the half plane of +y (Mitsuba's `lookat`).
fn look_at(record: &LookAtRecord) -> Result<DAffine3, &'static str> {
    let up = record.up.map_or(DVec3::Y, |up| up.0).normalize_or_zero();
    let forward = (record.target.0 - record.origin.0)
        .try_normalize()
        .ok_or("expected two different points as origin and target of `look_at`")?;
    let left = up.cross(forward);
    if left.length() < 1e-9 {
        return Err("`up` of `look_at` must not be zero or parallel to the direction from origin to target");
    }
    let left = left.normalize();
    let up = forward.cross(left);
    Ok(DAffine3::from_cols(left, up, forward, record.origin.0))
}

/// Rotation around a unit axis, by the right-hand rule (Rodrigues' formula). Sine and cosine come from libm, so that
/// all machines place the scene identically; quarter turns are exact.
pub fn rotation(axis: DVec3, degrees: f64) -> DMat3 {
    let (sin, cos) = match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        angle => libm::sincos(angle.to_radians()),
    };
    let column = |e: DVec3| e * cos + axis.cross(e) * sin + axis * (axis.dot(e) * (1.0 - cos));
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

/// A map in single precision.
pub fn single(map: &DAffine3) -> Affine3A {
    Affine3A {
        matrix3: map.matrix3.as_mat3().into(),
        translation: map.translation.as_vec3a(),
    }
}

/// Bound on coordinates and factors that keeps their squares far from single-precision overflow.
pub const LARGEST: f64 = 1e15;

/// Whether a map can be inverted safely: its columns are far from coplanar, and the squares of its numbers and of its
/// inverse's do not overflow single precision.
pub fn is_invertible(map: &DAffine3) -> bool {
    let m = map.matrix3;
    let volume = m.determinant().abs();
    let box_volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let fits = |m: &DMat3| m.to_cols_array().iter().all(|x| x.abs() < LARGEST);
    volume > 1e-12 * box_volume && map.translation.abs().max_element() < LARGEST && fits(&m) && fits(&m.inverse())
}
