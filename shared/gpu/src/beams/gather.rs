//! What segments of camera paths gather of the pieces.

use super::Pieces;
use super::pieces::most_pieces;
use crate::device::{Buffer, Groups, Kernel, Kind, Work};
use crate::error::Result;
use crate::kernels::GATHER;
use crate::self_test::Tested;
use crate::sizes::Sizing;

/// The most pieces in a part of the hierarchy: see `kernels/gather.wgsl`.
const PART: u32 = 1 << 14;

/// How segments look for pieces. The bits are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Each for itself: for those that go anywhere.
    ByRay,
    /// Every 64 of the buffer together: for those that are near each other, as of 8 x 8 pixels.
    ByTile,
}

/// What gathers, in buffers.
#[derive(Clone, Copy)]
pub struct Segments<'a> {
    /// How many, in its first word.
    pub count: &'a Buffer,
    /// [`Segment`](super::Segment)s.
    pub segments: &'a Buffer,
    /// [`Scattering`](super::Scattering) of media by number.
    pub media: &'a Buffer,
    /// Two words, the low one first: addresses the random numbers of chords.
    pub key: &'a Buffer,
}

/// Sums up along segments, as many as are counted on the device, what beams of their medium bring.
pub struct Gather {
    threads: Sizing,
    by_ray: Kernel,
    by_tile: Kernel,
    /// From which part of the hierarchy to before which, dispatch by dispatch.
    ranges: Vec<Buffer>,
}

impl Gather {
    /// For any number of segments, and so many beams at most.
    ///
    /// # Errors
    /// The device's.
    pub fn new(tested: &Tested, most_beams: u32) -> Result<Self> {
        let at_once = match tested.device.listed().kind {
            Kind::Software => 1,
            _ => u32::MAX,
        };
        Self::with_parts(tested, most_beams, at_once)
    }

    /// With so many parts of the hierarchy a dispatch, at most.
    pub(super) fn with_parts(tested: &Tested, most_beams: u32, at_once: u32) -> Result<Self> {
        let parts = most_pieces(most_beams).div_ceil(PART);
        let at_once = at_once.min(parts);
        let range = |first| tested.device.buffer("parts", &[first, first + at_once]);
        Ok(Self {
            ranges: (0..parts).step_by(at_once as usize).map(range).collect::<Result<_>>()?,
            threads: Sizing::new(tested, "threads")?,
            by_ray: tested.kernel(&GATHER, "by_ray")?,
            by_tile: tested.kernel(&GATHER, "by_tile")?,
        })
    }

    /// Write [`Brought`](super::Brought) for each segment: the sum over pieces in their order, from zero.
    ///
    /// # Errors
    /// The device's.
    pub fn run(&self, work: &mut Work, way: Way, of: &Segments, pieces: &Pieces, gathered: &Buffer) -> Result<()> {
        self.threads.run(work, of.count)?;
        let sizes = &self.threads.sizes;
        let kernel = match way {
            Way::ByRay => &self.by_ray,
            Way::ByTile => &self.by_tile,
        };
        for range in &self.ranges {
            let buffers = [
                sizes,
                of.segments,
                of.media,
                of.key,
                pieces.count(),
                pieces.pieces(),
                pieces.nodes(),
                pieces.levels(),
                range,
                gathered,
            ];
            work.run(kernel, &buffers, Groups::From(sizes))?;
        }
        Ok(())
    }
}
