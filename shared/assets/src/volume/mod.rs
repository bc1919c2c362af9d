//! Volumes as read from files: densities on a sample lattice.

mod bytes;
mod vdb;
mod vol;

use crate::Flaw;
use beamfarm_render::world::medium::bricks::{BRICK, Core, RawDensity};

/// Read a density from an OpenVDB (.vdb) or Mitsuba (.vol) file, as its extension says. `grid` names a grid of an
/// OpenVDB file. Without it, the grid `density` is taken, or else the only one that can be a density.
///
/// Samples are unchecked: they may be negative or NaN.
pub fn read(name: &str, bytes: &[u8], grid: Option<&str>) -> Result<RawDensity, Flaw> {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    match (ending.as_deref(), grid) {
        (Some("vdb"), _) => vdb::read(bytes, grid),
        (Some("vol"), None) => vol::read(bytes),
        (Some("vol"), Some(grid)) => Err(format!("a .vol file's grid has no name; expected no grid `{grid}`").into()),
        _ => Err("unsupported kind of volume file; expected .vdb or .vol".into()),
    }
}

/// Read an albedo: one grid, or three for red, green and blue, which .vol files may hold. Otherwise like [`read`].
pub fn read_albedo(name: &str, bytes: &[u8], grid: Option<&str>) -> Result<Vec<RawDensity>, Flaw> {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending);
    match (ending, grid) {
        (Some(vol), None) if vol.eq_ignore_ascii_case("vol") => vol::read_channels(bytes),
        _ => Ok(vec![read(name, bytes, grid)?]),
    }
}

/// A brick of samples in the renderer's order, stored compactly.
fn core(samples: [f32; BRICK * BRICK * BRICK]) -> Core {
    match samples.iter().all(|s| s.to_bits() == samples[0].to_bits()) {
        true => Core::Constant(samples[0]),
        false => Core::Samples(Box::new(samples)),
    }
}

#[cfg(test)]
mod tests;
