//! What segments of camera paths gather of the pieces.

use super::Pieces;
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::GATHER;
use crate::self_test::Tested;
use crate::sizes::Sizing;

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
}

impl Gather {
    /// For any number of segments.
    ///
    /// # Errors
    /// The device's.
    pub fn new(tested: &Tested) -> Result<Self> {
        Ok(Self {
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
        let buffers = [
            sizes,
            of.segments,
            of.media,
            of.key,
            pieces.count(),
            pieces.pieces(),
            pieces.nodes(),
            pieces.levels(),
            gathered,
        ];
        work.run(kernel, &buffers, Groups::From(sizes))?;
        Ok(())
    }
}
