//! The beams of a pass, laid out for evaluation, and their bounds, laid out for search.

use super::PhotonBeam;
use super::estimate::{LANES, Lanes};
use crate::medium::transmittance::StepFunctions;

/// The beams of one pass.
pub struct BeamMap {
    beams: Vec<PhotonBeam>,
    steps: StepFunctions,
    /// By medium.
    bounds: Vec<BoundsColumns>,
}

impl BeamMap {
    /// Build the map. `steps`: transmittance along the beams in heterogeneous media.
    pub fn new(beams: Vec<PhotonBeam>, steps: StepFunctions) -> Self {
        let mut bounds: Vec<BoundsColumns> = Vec::new();
        for (i, beam) in beams.iter().enumerate() {
            let medium = usize::from(beam.medium);
            if bounds.len() <= medium {
                bounds.resize_with(medium + 1, BoundsColumns::default);
            }
            bounds[medium].push(beam, i as u32);
        }
        bounds.iter_mut().for_each(BoundsColumns::pad);
        Self {
            bounds,
            beams,
            steps,
        }
    }

    /// The beams, in the order that they were traced in.
    pub fn beams(&self) -> &[PhotonBeam] {
        &self.beams
    }

    /// Transmittance along the beams in heterogeneous media.
    pub fn steps(&self) -> &StepFunctions {
        &self.steps
    }

    /// Bounds of the beams in a medium, if there are any.
    pub(super) fn bounds(&self, medium: u16) -> Option<&BoundsColumns> {
        self.bounds.get(usize::from(medium))
    }

    /// Memory that the map holds, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.beams[..])
            + self.bounds.iter().map(BoundsColumns::bytes).sum::<usize>()
            + self.steps.bytes()
    }
}

/// Where a beam is, its kernel included: a cylinder.
#[derive(Clone, Copy)]
pub(super) struct BeamBounds {
    pub origin: [f32; 3],
    pub dir: [f32; 3],
    pub radius: f32,
    pub start: f32,
    pub end: f32,
}

/// Bounds of beams, column by column, so that they can be compared with a bundle of segments at the rate of vector code: a
/// hierarchy of boxes around pieces of beams finds no quicker what a tile of the image sees, and takes longer to build.
#[derive(Default)]
pub(super) struct BoundsColumns {
    /// Origin, direction, radius, start, end: padded to whole vectors, with radii of minus infinity, which nothing meets.
    columns: [Vec<f32>; COLUMNS],
    /// Of the beams in the map.
    indices: Vec<u32>,
}

const COLUMNS: usize = 9;
const PADDING: [f32; COLUMNS] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::NEG_INFINITY, 0.0, 0.0];

/// Bounds of as many beams as there are lanes.
pub(super) struct BoundsChunk<'a>([&'a Lanes; COLUMNS]);

impl BoundsColumns {
    fn push(&mut self, beam: &PhotonBeam, index: u32) {
        let ([px, py, pz], [bx, by, bz]) = (beam.origin.to_array(), beam.dir.to_array());
        let [start, end] = beam.extent;
        let values = [px, py, pz, bx, by, bz, beam.max_radius(), start, end];
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(value);
        }
        self.indices.push(index);
    }

    fn pad(&mut self) {
        let length = self.indices.len().next_multiple_of(LANES);
        for (column, padding) in self.columns.iter_mut().zip(PADDING) {
            column.resize(length, padding);
        }
    }

    /// Keep those at these positions of another list.
    #[inline(always)]
    pub fn select(&mut self, from: &Self, positions: &[u32]) {
        let length = positions.len().next_multiple_of(LANES);
        let columns = self.columns.iter_mut().zip(&from.columns);
        for ((column, from), padding) in columns.zip(PADDING) {
            column.clear();
            column.resize(length, padding);
            // Without a branch for positions that cannot be: vector code.
            for (value, &at) in column.iter_mut().zip(positions) {
                *value = from.get(at as usize).copied().unwrap_or(padding);
            }
        }
        self.indices.clear();
        self.indices.resize(positions.len(), 0);
        for (index, &at) in self.indices.iter_mut().zip(positions) {
            *index = from.indices.get(at as usize).copied().unwrap_or(0);
        }
    }

    /// Number of beams.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Indices of the beams in the map.
    #[inline(always)]
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Bounds side by side. The last beams may be none, which nothing meets.
    #[inline(always)]
    pub fn chunks(&self) -> impl Iterator<Item = BoundsChunk<'_>> {
        let columns = self
            .columns
            .each_ref()
            .map(|column| column.as_chunks::<LANES>().0);
        (0..columns[0].len()).map(move |i| BoundsChunk(columns.map(|column| &column[i])))
    }

    fn bytes(&self) -> usize {
        let columns: usize = self.columns.iter().map(|c| size_of_val(&c[..])).sum();
        columns + size_of_val(&self.indices[..])
    }
}

impl BoundsChunk<'_> {
    #[inline(always)]
    pub fn get(&self, lane: usize) -> BeamBounds {
        let [px, py, pz, bx, by, bz, radius, start, end] = self.0;
        BeamBounds {
            origin: [px[lane], py[lane], pz[lane]],
            dir: [bx[lane], by[lane], bz[lane]],
            radius: radius[lane],
            start: start[lane],
            end: end[lane],
        }
    }
}
