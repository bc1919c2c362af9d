//! Mitsuba's .vol: a dense grid.

use super::bytes::Bytes;
use super::{Flaw, core};
use beamfarm_render::world::medium::bricks::{BRICK, RawDensity};
use glam::{DAffine3, DVec3, IVec3, UVec3};
use std::collections::BTreeMap;

/// The most samples along an axis. Bricks are padded at the border, so that a long thin grid takes 64 times the file's
/// size.
const MAX_RESOLUTION: i32 = 1 << 16;

/// Read a grid of one channel.
pub fn read(bytes: &[u8]) -> Result<RawDensity, Flaw> {
    let channels = read_channels(bytes)?;
    let count = channels.len();
    let [density] = <[RawDensity; 1]>::try_from(channels)
        .map_err(|_| format!("the grid has {count} channels; expected 1, the density"))?;
    Ok(density)
}

/// Read a grid of one or three channels of 32-bit floats. As in Mitsuba 3's `gridvolume` by default, it fills the unit
/// cube and the file's bounding box is ignored. Samples are at cell centres.
pub fn read_channels(bytes: &[u8]) -> Result<Vec<RawDensity>, Flaw> {
    let mut bytes = Bytes::new(bytes);
    if bytes.take(3, "the header")? != b"VOL" {
        return Err("not a Mitsuba volume: it does not begin with \"VOL\"".into());
    }
    let version = bytes.u8("the header")?;
    if version != 3 {
        return Err(format!("version {version} of the format is unsupported; expected 3").into());
    }
    let encoding = bytes.i32("the header")?;
    if encoding != 1 {
        return Err(format!("encoding {encoding} is unsupported; expected 1, 32-bit floats").into());
    }
    let resolution: [i32; 3] = bytes.i32s("the header")?;
    if resolution.iter().any(|r| !(1..=MAX_RESOLUTION).contains(r)) {
        let [x, y, z] = resolution;
        return Err(
            format!("the grid is {x} x {y} x {z}; expected 1 to {MAX_RESOLUTION} samples along each axis").into(),
        );
    }
    let channels = bytes.i32("the header")?;
    if ![1, 3].contains(&channels) {
        return Err(format!("the grid has {channels} channels; expected 1 or 3").into());
    }
    let channels = channels as usize;
    bytes.take(6 * 4, "the bounding box")?;
    let [nx, ny, nz] = resolution.map(|r| r as usize);
    let expected = 4 * (channels as u64) * (nx as u64) * (ny as u64) * (nz as u64);
    if bytes.left() as u64 != expected {
        let of_channels = match channels {
            1 => String::new(),
            n => format!(" of {n} channels"),
        };
        return Err(format!(
            "a grid of {nx} x {ny} x {nz} samples{of_channels} takes {expected} bytes; {} follow the header",
            bytes.left()
        )
        .into());
    }
    let values = bytes.take(bytes.left(), "the samples")?;
    let (values, _) = values.as_chunks::<4>();
    let count = UVec3::new(nx as u32, ny as u32, nz as u32).as_dvec3();
    let channel = |channel: usize| {
        let mut cores = BTreeMap::new();
        for z in 0..nz.div_ceil(BRICK) {
            for y in 0..ny.div_ceil(BRICK) {
                for x in 0..nx.div_ceil(BRICK) {
                    // Samples beyond the border repeat the last one. They are never used.
                    let samples = std::array::from_fn(|i| {
                        let x = (x * BRICK + i % BRICK).min(nx - 1);
                        let y = (y * BRICK + i / BRICK % BRICK).min(ny - 1);
                        let z = (z * BRICK + i / (BRICK * BRICK)).min(nz - 1);
                        f32::from_le_bytes(values[channel + channels * (x + nx * (y + ny * z))])
                    });
                    cores.insert([x as i32, y as i32, z as i32], core(samples));
                }
            }
        }
        RawDensity {
            cores,
            samples: [IVec3::ZERO, IVec3::from(resolution) - 1],
            domain: [DVec3::splat(-0.5), count - 0.5],
            to_object: DAffine3::from_scale(1.0 / count) * DAffine3::from_translation(DVec3::splat(0.5)),
        }
    };
    Ok((0..channels).map(channel).collect())
}
