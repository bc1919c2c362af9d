//! Transforms of the scene file, in double precision.

use super::parse::Step;
use glam::{DAffine3, DMat3, DVec3};

/// The steps' product: the first step is applied first.
pub fn compose(steps: &[Step]) -> Result<DAffine3, String> {
    let mut total = DAffine3::IDENTITY;
    for step in steps {
        total = matrix(step)? * total;
    }
    Ok(total)
}

fn matrix(step: &Step) -> Result<DAffine3, String> {
    Ok(match step {
        Step::Scale(factors) => DAffine3::from_scale(factors.0),
        Step::Rotate { axis, angle } => {
            let axis = axis
                .0
                .try_normalize()
                .ok_or("the axis of `rotate` has no direction")?;
            DAffine3::from_mat3(rotation(axis, angle.0))
        }
        Step::Translate(offset) => DAffine3::from_translation(offset.0),
        Step::Matrix(rows) => {
            let rows = rows.map(|row| row.map(|x| x.0));
            if rows[3] != [0.0, 0.0, 0.0, 1.0] {
                return Err(format!(
                    "the last row of `matrix` must be [0, 0, 0, 1], found {:?}",
                    rows[3]
                ));
            }
            let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
            DAffine3::from_cols(column(0), column(1), column(2), column(3))
        }
        Step::LookAt { origin, target, up } => {
            let up = up.map_or(DVec3::Y, |up| up.0);
            let forward = (target.0 - origin.0)
                .try_normalize()
                .ok_or("origin and target of `look_at` are the same point")?;
            let left = up
                .cross(forward)
                .try_normalize()
                .ok_or("`up` of `look_at` must not be parallel to its direction of view")?;
            DAffine3::from_cols(left, forward.cross(left), forward, origin.0)
        }
    })
}

/// Rotation around a unit axis, by the right-hand rule (Rodrigues' formula). Sine and cosine come from libm, so that
/// every machine places the scene alike; quarter turns are exact.
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

/// Whether a map can be inverted safely: its columns are far from lying in one plane, and neither it nor its inverse
/// holds numbers whose squares overflow single precision.
pub fn is_invertible(map: &DAffine3) -> bool {
    const LARGEST: f64 = 1e15;
    let m = map.matrix3;
    let volume = m.determinant().abs();
    let box_volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let fits = |m: &DMat3| m.to_cols_array().iter().all(|x| x.abs() < LARGEST);
    volume > 1e-12 * box_volume
        && map.translation.abs().max_element() < LARGEST
        && fits(&m)
        && fits(&m.inverse())
}
