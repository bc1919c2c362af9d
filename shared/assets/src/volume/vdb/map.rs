//! Grid transforms, from index space to the file's world space.

use crate::Flaw;
use crate::volume::bytes::Bytes;
use glam::{DAffine3, DMat3, DVec3};

/// Read an affine map.
pub fn read(bytes: &mut Bytes) -> Result<DAffine3, Flaw> {
    const WHAT: &str = "the grid's transform";
    let name = String::from_utf8_lossy(bytes.counted(WHAT)?);
    match &*name {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = vector(bytes)?;
            // The voxel's side lengths, and values derived from them.
            bytes.take(4 * 3 * 8, WHAT)?;
            Ok(DAffine3::from_scale(scale))
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let translation = vector(bytes)?;
            let scale = vector(bytes)?;
            bytes.take(4 * 3 * 8, WHAT)?;
            let scale = DMat3::from_diagonal(scale);
            Ok(DAffine3::from_mat3_translation(scale, translation))
        }
        "TranslationMap" => Ok(DAffine3::from_translation(vector(bytes)?)),
        "AffineMap" | "UnitaryMap" => {
            // Rows of a matrix that is multiplied from the right.
            let mut rows = [DVec3::ZERO; 4];
            for (i, row) in rows.iter_mut().enumerate() {
                *row = vector(bytes)?;
                let last = bytes.f64(WHAT)?;
                let expected = [0.0, 0.0, 0.0, 1.0][i];
                // OpenVDB's own tolerance.
                if !(expected - 1e-8..=expected + 1e-8).contains(&last) {
                    return Err(format!(
                        "its transform is no affine map: row {i} (from zero) of its matrix ends with {last}; expected {expected}"
                    )
                    .into());
                }
            }
            let [x, y, z, translation] = rows;
            Ok(DAffine3::from_cols(x, y, z, translation))
        }
        "NonlinearFrustumMap" => {
            Err("its transform is a frustum; expected an affine map, which lattices in world space have".into())
        }
        _ => Err(format!("its transform is of the unsupported kind {name:?}").into()),
    }
}

fn vector(bytes: &mut Bytes) -> Result<DVec3, Flaw> {
    const WHAT: &str = "the grid's transform";
    Ok(DVec3::new(bytes.f64(WHAT)?, bytes.f64(WHAT)?, bytes.f64(WHAT)?))
}
