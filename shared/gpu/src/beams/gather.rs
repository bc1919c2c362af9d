//! What segments of camera paths gather of the pieces.

use super::pieces::most_pieces;
use super::{Near, Pieces};
use crate::device::{Buffer, Groups, Kernel, Kind, Work};
use crate::error::Result;
use crate::kernels::{GATHER, GATHER_WALLED, Needs, SIZES};
use crate::self_test::{Tested, Together};
use crate::sizes::{Sizes, Sizing};
use crate::world::geometry::GeometryBuffers;
use bytemuck::{Pod, Zeroable};

/// From which part of the hierarchy to before which: `kernels/gather.wgsl` has the same struct.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PieceParts {
    pub first: u32,
    pub end: u32,
    pub level: u32,
    pub spare: u32,
}

/// How much of the hierarchy a dispatch looks at.
#[derive(Clone, Copy)]
pub(super) struct Share {
    /// A part is what a node of this level is around: 4 to the power of one more, so many pieces.
    pub level: u32,
    /// So many parts, at most.
    pub at_once: u32,
}

impl Share {
    /// Drivers in software end loops after 2^16 turns, all of a few threads together, without a word. So many pieces
    /// keep them below 2^15, or, where a look past walls may take a ray for each or densities vary, mostly
    /// far below.
    fn of(tested: &Tested, takes_long: bool) -> Self {
        match (tested.device.listed().kind, takes_long) {
            (Kind::Software, true) => Self { level: 3, at_once: 1 },
            (Kind::Software, false) => Self { level: 5, at_once: 1 },
            (_, _) => Self {
                level: 6,
                at_once: u32::MAX,
            },
        }
    }
}

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
    /// Where the density of some medium varies.
    pub varying: Option<Functions<'a>>,
    /// Where groups of lights have layers: the number of the one whose light is gathered, from 1 on, or 0.
    pub light_group: Option<&'a Buffer>,
}

/// Densities that vary and the transmittance along beams and segments, in buffers: see `kernels/attenuation.wgsl`.
#[derive(Clone, Copy)]
pub struct Functions<'a> {
    /// Densities.
    pub volumes: &'a Buffer,
    /// Along beams.
    pub of_beams: &'a Buffer,
    /// Along segments.
    pub of_segments: &'a Buffer,
}

/// What hides beams, in buffers.
#[derive(Clone, Copy)]
pub struct Hiding<'a> {
    /// What walls there are.
    pub near: Near<'a>,
    /// Their planes: [`Walls::planes`](super::Walls::planes).
    pub planes: &'a Buffer,
    /// The beams that know which of these are theirs, of which the pieces are.
    pub beams: &'a Buffer,
}

/// Sums up along segments, as many as are counted on the device, what beams of their medium bring.
pub struct Gather {
    threads: Sizing,
    /// Of a dispatch, where there are several.
    of_parts: Kernel,
    here: Buffer,
    by_ray: Kernel,
    by_tile: Kernel,
    /// From which part of the hierarchy to before which, dispatch by dispatch.
    ranges: Vec<Buffer>,
}

impl Gather {
    /// For any number of segments, and so many beams at most that nothing hides.
    ///
    /// # Errors
    /// The device's.
    pub fn new<'a>(on: impl Into<Together<'a>>, most_beams: u32) -> Result<Self> {
        Self::of_media(on, Needs::ALL, most_beams)
    }

    /// The same in a scene that kernels are made so for: the density of some medium may vary.
    ///
    /// # Errors
    /// The device's.
    pub fn of_media<'a>(on: impl Into<Together<'a>>, needs: Needs, most_beams: u32) -> Result<Self> {
        let on = on.into();
        Self::with_share(on, Err(needs), most_beams, Share::of(&on, needs.varies))
    }

    /// For beams that the walls of a scene may hide: see [`Self::run_by_walls`].
    ///
    /// # Errors
    /// The device's.
    pub fn by_walls<'a>(on: impl Into<Together<'a>>, geometry: &GeometryBuffers, most_beams: u32) -> Result<Self> {
        let on = on.into();
        Self::with_share(on, Ok(geometry), most_beams, Share::of(&on, true))
    }

    /// With so much of the hierarchy a dispatch. `walls`: of the scene that they stand in, or what kernels of one
    /// without any are made for.
    pub(super) fn with_share<'a>(
        on: impl Into<Together<'a>>,
        walls: std::result::Result<&GeometryBuffers, Needs>,
        most_beams: u32,
        share: Share,
    ) -> Result<Self> {
        let on = on.into();
        let kernel = |entry| match walls {
            Ok(geometry) => geometry.kernel(&on, &GATHER_WALLED, entry),
            Err(needs) => on.kernel_for(&GATHER, entry, needs),
        };
        let Share { level, at_once } = share;
        let parts = most_pieces(most_beams).div_ceil(1 << (2 * level + 2));
        let at_once = at_once.min(parts);
        let range = |first| {
            let range = PieceParts {
                first,
                end: first + at_once,
                level,
                spare: 0,
            };
            on.device.buffer("parts", &[range])
        };
        Ok(Self {
            ranges: (0..parts).step_by(at_once as usize).map(range).collect::<Result<_>>()?,
            threads: Sizing::new(on, "threads")?,
            of_parts: on.kernel(&SIZES, "of_parts"),
            here: on.empty("sizes", size_of::<Sizes>() as u64)?,
            by_ray: kernel("by_ray"),
            by_tile: kernel("by_tile"),
        })
    }

    /// Write [`Brought`](super::Brought) for each segment: the sum over pieces in their order, from zero.
    ///
    /// # Errors
    /// The device's.
    pub fn run(&self, work: &mut Work, way: Way, of: &Segments, pieces: &Pieces, gathered: &Buffer) -> Result<()> {
        self.run_with(work, way, of, (pieces, &[]), gathered)
    }

    /// The same but for beams that walls hide, where this is made [for that](Self::by_walls).
    ///
    /// # Errors
    /// The device's.
    pub fn run_by_walls(
        &self,
        work: &mut Work,
        way: Way,
        of: &Segments,
        (pieces, hiding): (&Pieces, Hiding),
        gathered: &Buffer,
    ) -> Result<()> {
        let Hiding { near, planes, beams } = hiding;
        let Near { geometry, walls } = near;
        let more = [&geometry.in_order()[..], &[&walls.hull, planes, beams]].concat();
        self.run_with(work, way, of, (pieces, &more), gathered)
    }

    fn run_with(
        &self,
        work: &mut Work,
        way: Way,
        of: &Segments,
        (pieces, more): (&Pieces, &[&Buffer]),
        gathered: &Buffer,
    ) -> Result<()> {
        let varying = of.varying.map(|of| [of.volumes, of.of_beams, of.of_segments]);
        let varying = varying.as_ref().map_or(&[][..], |of| &of[..]);
        let more = &[of.light_group.as_slice(), more, varying].concat();
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
            let groups = if self.ranges.len() > 1 {
                // All are there that there may be room for.
                work.run(
                    &self.of_parts,
                    &[sizes, &self.here, pieces.count(), range],
                    Groups::Count(1),
                )?;
                &self.here
            } else {
                sizes
            };
            work.run(kernel, &[&buffers[..], more].concat(), Groups::From(groups))?;
        }
        Ok(())
    }
}
