//! Indices of refraction of materials.

use super::required;
use crate::parse::{Fault, MaterialRecord};
use beamfarm_render::world::bsdf::{Dispersion, Index, LINE_D};

/// The index inside over the index outside, at the d line. `default`: the inside's.
pub fn relative_ior(record: &MaterialRecord, default: Option<f64>) -> Result<f32, Fault> {
    let (dispersion, span) = indices(record, default)?;
    let eta = dispersion.eta(LINE_D);
    if !(1e-2..=1e2).contains(&eta) {
        return Err(Fault::new(
            span,
            format!("expected `ior` / `exterior_ior` from 0.01 to 100, found {eta}"),
        ));
    }
    Ok(eta)
}

/// Both indices by wavelength, if either depends on it.
pub fn dispersion(record: &MaterialRecord) -> Result<Option<Box<Dispersion>>, Fault> {
    if record.ior.is_none() {
        return Ok(None);
    }
    let (dispersion, _) = indices(record, None)?;
    let is_constant = |index: &Index| matches!(index, Index::Constant(_));
    let is_even = is_constant(&dispersion.inside) && is_constant(&dispersion.outside);
    Ok((!is_even).then(|| Box::new(dispersion)))
}

/// The index outside, at the d line.
pub fn index_outside(record: &MaterialRecord) -> Result<f32, Fault> {
    match &record.exterior_ior {
        None => Ok(1.0),
        Some(ior) => Ok(ior.get_ref().index(ior.span())?.at(LINE_D) as f32),
    }
}

fn indices(record: &MaterialRecord, default: Option<f64>) -> Result<(Dispersion, std::ops::Range<usize>), Fault> {
    let (inside, span) = match (&record.ior, default) {
        (None, Some(ior)) => (Index::Constant(ior), record.kind.span()),
        (ior, _) => {
            let ior = required(ior, &record.kind, "ior")?;
            (ior.get_ref().index(ior.span())?, ior.span())
        }
    };
    let outside = match &record.exterior_ior {
        None => Index::Constant(1.0),
        Some(ior) => ior.get_ref().index(ior.span())?,
    };
    Ok((Dispersion { inside, outside }, span))
}
