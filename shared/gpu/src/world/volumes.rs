//! Media of varying density: words of one buffer, as in `kernels/volumes.wgsl`.

use super::reason::{Of, Reason, Why};
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::medium::transmittance::Estimator;
use beamfarm_render::world::medium::{Heterogeneous, Medium};
use std::collections::BTreeMap;

/// How a walk estimates the transmittance. Free flights become ratio tracking, which has the same mean with less noise.
const BY_RATIO: u32 = 1;
const BY_RESIDUAL: u32 = 2;

/// Words of a record, and of a grid in it.
const RECORD: usize = 96;
const GRID: usize = 16;
/// Offset of the grids in a record: the density, and up to three of the albedo.
const GRIDS: usize = 32;

/// By medium the offset of its record, zero for a uniform one; then the records, and what they refer to: tables of
/// bricks, samples, and bounds. `used`: media that are used somewhere.
pub(super) fn flatten(media: &[Medium], used: &[u16], largest: u64, reasons: &mut Vec<Reason>) -> Vec<u32> {
    let varying = || {
        let media = (0_u16..).zip(media);
        media.filter_map(|(number, medium)| match medium {
            Medium::Heterogeneous(medium) if used.contains(&number) => Some((usize::from(number), medium)),
            Medium::Heterogeneous(_) | Medium::Homogeneous(_) => None,
        })
    };
    let mut words = Words {
        all: vec![0; media.len()],
        known: BTreeMap::new(),
    };
    let bytes = 4 * varying().map(|(_, medium)| words_of(medium)).sum::<u64>();
    if bytes > largest.min(4 * u64::from(u32::MAX)) {
        reasons.push(Reason {
            of: Of::Scene,
            field: "densities that vary",
            why: Why::Large {
                bytes,
                most: largest.min(4 * u64::from(u32::MAX)),
            },
        });
        return words.all;
    }
    for (number, medium) in varying() {
        let at = words.all.len();
        words.all[number] = at as u32;
        words.all.resize(at + RECORD, 0);
        words.record(at, medium);
    }
    words.all
}

/// Words of a medium that shares nothing.
fn words_of(medium: &Heterogeneous) -> u64 {
    let of = |bricks: &Bricks| {
        let lookup = bricks.lookup();
        (lookup.table.len() + lookup.values.len()) as u64
    };
    let albedo = medium
        .albedo()
        .map_or(0, |albedo| albedo.channels().iter().map(of).sum());
    1 + RECORD as u64 + of(medium.bricks()) + albedo + 3 * medium.majorants().ranges().len() as u64
}

struct Words {
    all: Vec<u32>,
    /// By address, for data that media share: table and samples.
    known: BTreeMap<*const u32, [u32; 2]>,
}

impl Words {
    fn record(&mut self, at: usize, medium: &Heterogeneous) {
        let majorants = medium.majorants();
        let ranges = self.all.len() as u32;
        for range in majorants.ranges() {
            self.all
                .extend([range.minorant, range.majorant, range.mean].map(f32::to_bits));
        }
        let estimator = match medium.estimator {
            Estimator::FreeFlight { .. } | Estimator::RatioTracking => BY_RATIO,
            Estimator::ResidualRatioTracking => BY_RESIDUAL,
        };
        let channels = medium.albedo().map_or(&[][..], |albedo| albedo.channels());
        let cells = majorants.count();
        let first = [
            estimator,
            channels.len() as u32,
            majorants.cell().to_bits(),
            ranges,
            majorants.deviation().to_bits(),
            cells.x,
            cells.y,
            cells.z,
        ];
        self.set(at, first);
        // Its axes, and then its translation.
        self.set(at + 8, medium.to_samples().to_cols_array().map(f32::to_bits));
        if let Some(albedo) = medium.albedo() {
            self.set(at + 20, albedo.from_density().to_cols_array().map(f32::to_bits));
        }
        let grids = std::iter::once(medium.bricks()).chain(channels);
        for (number, bricks) in grids.take((RECORD - GRIDS) / GRID).enumerate() {
            self.grid(at + GRIDS + GRID * number, bricks);
        }
    }

    fn grid(&mut self, at: usize, bricks: &Bricks) {
        let lookup = bricks.lookup();
        let [table, values] = match self.known.get(&lookup.table.as_ptr()) {
            Some(known) => *known,
            None => {
                let table = self.all.len();
                self.all.extend_from_slice(lookup.table);
                let values = self.all.len();
                self.all.extend(lookup.values.iter().map(|value| value.to_bits()));
                let both = [table as u32, values as u32];
                self.known.insert(lookup.table.as_ptr(), both);
                both
            }
        };
        let boxes = [lookup.domain, lookup.clamp];
        let corners = boxes.as_flattened().iter();
        let corners: Vec<u32> = corners.flat_map(|corner| corner.to_array().map(f32::to_bits)).collect();
        self.all[at..at + corners.len()].copy_from_slice(&corners);
        self.set(at + corners.len(), [lookup.count.x, lookup.count.y, table, values]);
    }

    fn set<const N: usize>(&mut self, at: usize, words: [u32; N]) {
        self.all[at..at + N].copy_from_slice(&words);
    }
}
