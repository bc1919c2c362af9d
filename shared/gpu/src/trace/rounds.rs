//! How much of photon paths is done at once.

use super::{Capacities, STATE};
use crate::device::{Buffer, Device, Kind};
use crate::error::Result;
use crate::self_test::Together;
use bytemuck::{Pod, Zeroable};

/// Rays of a path, at most. A photon that is trapped for as long goes on with a probability of a thousandth less than
/// one from its 1024th scattering on.
const MOST_RAYS: u32 = 1 << 15;
/// Bytes of the states of paths that are followed together.
const STATES: u64 = 256 << 20;

/// Sizes that change no bit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    /// Paths that are followed together.
    pub batch: u32,
    /// Rays of each in a dispatch.
    pub turns: u32,
    /// Rays of each, at most; a multiple of those.
    pub most: u32,
}

impl Sizes {
    /// What suits a device. Drivers in software end the loops of a thread after 2^16 turns, without a word.
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

    /// Dispatches before each look at which paths are left: as many again each time.
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
    /// The path that the first state is of.
    pub first: u32,
    /// As many states.
    pub count: u32,
    /// 0: beams and photons are counted; 1: they are written.
    pub writes: u32,
    /// Rays of each path.
    pub turns: u32,
    /// The most that there is room for.
    pub beams: u32,
    /// Likewise.
    pub photons: u32,
    /// Likewise: of beams in media whose density varies.
    pub steps: u32,
}

/// Paths that are followed together.
pub(super) struct Batch {
    paths: u32,
    /// How many they are.
    pub count: Buffer,
    /// How they are followed first.
    pub counting: Phase,
    /// How they are followed then.
    pub writing: Phase,
}

/// One [`Round`].
pub(super) struct Phase {
    pub round: Buffer,
}

impl Batch {
    /// Workgroups of a thread a path.
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
