//! Batch sizes of photon tracing.

use super::{Capacities, STATE};
use crate::device::{Buffer, Device, Kind};
use crate::error::Result;
use crate::self_test::Together;
use bytemuck::{Pod, Zeroable};

/// Most rays per path. A trapped photon survives each scattering from its 1024th on with a probability a thousandth
/// below one.
const MOST_RAYS: u32 = 1 << 15;
/// Bytes of path states that are traced together.
const STATES: u64 = 256 << 20;

/// Batch sizes, which change no bit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    /// Paths that are traced together.
    pub batch: u32,
    /// Rays per path and dispatch.
    pub turns: u32,
    /// Most rays per path; a multiple of `turns`.
    pub most: u32,
}

impl Sizes {
    /// Sizes that suit a device. Software drivers silently end the loops of a thread after 2^16 iterations.
    pub fn of(device: &Device) -> Self {
        Self {
            batch: (device.largest_buffer().min(STATES) / STATE) as u32,
            turns: match device.listed().kind {
                Kind::Software => 16,
                _ => 256,
            },
            most: MOST_RAYS,
        }
    }

    /// Dispatches before each check for remaining paths, doubling each time.
    pub fn rounds(&self) -> Vec<u32> {
        let mut left = self.most.div_ceil(self.turns).max(1);
        let mut rounds = Vec::new();
        let mut next = 1;
        while left > 0 {
            rounds.push(next.min(left));
            left -= next.min(left);
            next = rounds.iter().sum();
        }
        rounds
    }
}

/// `Round` of `kernels/trace.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Round {
    /// The path of the first state.
    pub first: u32,
    /// Number of states.
    pub count: u32,
    /// 0: beams and photons are counted; 1: they are written.
    pub writes: u32,
    /// Rays per path.
    pub turns: u32,
    /// Capacity for beams.
    pub beams: u32,
    /// Capacity for photons.
    pub photons: u32,
    /// Capacity for steps, for beams in media of varying density.
    pub steps: u32,
}

/// Paths that are traced together.
pub(super) struct Batch {
    paths: u32,
    /// Their number.
    pub count: Buffer,
    /// The counting phase, which comes first.
    pub counting: Phase,
    /// The writing phase.
    pub writing: Phase,
}

/// One [`Round`].
pub(super) struct Phase {
    pub round: Buffer,
}

impl Batch {
    /// Workgroups with one thread per path.
    pub fn groups(&self) -> u32 {
        self.paths.div_ceil(64)
    }
}

/// All paths, batch by batch.
pub(super) fn batches(on: &Together, paths: u32, sizes: &Sizes, most: Capacities) -> Result<Vec<Batch>> {
    let step = sizes.batch.max(1);
    let batch = |first: u32| {
        let count = step.min(paths - first);
        let phase = |writes: u32| {
            let round = Round {
                first,
                count,
                writes,
                turns: sizes.turns,
                beams: most.beams,
                photons: most.photons,
                steps: most.steps,
            };
            Ok(Phase {
                round: on.device.buffer("round of photon paths", &[round])?,
            })
        };
        Ok(Batch {
            paths: count,
            count: on.value("number of paths in a batch", count)?,
            counting: phase(0)?,
            writing: phase(1)?,
        })
    };
    (0..paths).step_by(step as usize).map(batch).collect()
}
