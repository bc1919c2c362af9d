//! Indices of refraction of materials.

use super::required;
use crate::parse::{Fault, MaterialRecord};

/// That of the inside over that of the outside. `default`: of the inside.
pub fn relative_ior(record: &MaterialRecord, default: Option<f64>) -> Result<f32, Fault> {
    let (ior, span) = match (&record.ior, default) {
        (None, Some(ior)) => (ior, record.kind.span()),
        (ior, _) => {
            let ior = required(ior, &record.kind, "ior")?;
            (ior.get_ref().0, ior.span())
        }
    };
    let exterior = record.exterior_ior.as_ref().map_or(1.0, |ior| ior.get_ref().0);
    let eta = (ior / exterior) as f32;
    if !(1e-2..=1e2).contains(&eta) {
        return Err(Fault::new(
            span,
            format!("expected `ior` / `exterior_ior` from 0.01 to 100, found {eta}"),
        ));
    }
    Ok(eta)
}
