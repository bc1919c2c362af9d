//! What segments of camera paths gather from pieces of beams.

use super::pieces::most_pieces;
use super::{Near, Pieces};
use crate::device::{Buffer, Groups, Kernel, Kind, Work};
use crate::error::Result;
use crate::kernels::{GATHER, GATHER_WALLED, Needs, SIZES};
use crate::self_test::{Tested, Together};
use crate::sizes::{Sizes, Sizing};
use crate::world::geometry::GeometryBuffers;
use bytemuck::{Pod, Zeroable};

/// A range of parts of the hierarchy: `kernels/gather.wgsl` has the same struct.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PieceParts {
    pub first: u32,
    pub end: u32,
    pub level: u32,
    pub spare: u32,
}

/// Share of the hierarchy that one dispatch covers.
#[derive(Clone, Copy)]
pub(super) struct Share {
    /// Level of the nodes that are parts: one of them holds 4^(level + 1) pieces.
    pub level: u32,
    /// Most parts per dispatch.
    pub at_once: u32,
}

impl Share {
    /// Software drivers silently end loops after 2^16 iterations, counted over a few threads together. This many pieces
    /// keep the count below 2^15, or mostly far below where densities vary or each piece may need a ray to see past
    /// walls.
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

/// How segments search for pieces. Both ways give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Each by itself: for segments in any direction.
    ByRay,
    /// By 64 consecutive segments together: for neighbouring ones, such as those of 8 x 8 pixels.
    ByTile,
}

/// The input of a gather, in buffers.
#[derive(Clone, Copy)]
pub struct Segments<'a> {
    /// Number of segments, in its first word.
    pub count: &'a Buffer,
    /// [`Segment`](super::Segment)s.
    pub segments: &'a Buffer,
    /// [`Scattering`](super::Scattering) by medium number.
    pub media: &'a Buffer,
    /// Key of the chords' random numbers: two words, the low one first.
    pub key: &'a Buffer,
    /// Present if some medium's density varies.
    pub varying: Option<Functions<'a>>,
    /// Present if groups of lights have layers: the group whose light is gathered, from 1 on, or 0.
    pub light_group: Option<&'a Buffer>,
}

/// Varying densities, and the transmittance along beams and segments, in buffers: see `kernels/attenuation.wgsl`.
#[derive(Clone, Copy)]
pub struct Functions<'a> {
    /// Densities.
    pub volumes: &'a Buffer,
    /// Transmittance along beams.
    pub of_beams: &'a Buffer,
    /// Transmittance along segments.
    pub of_segments: &'a Buffer,
}

/// Occluders of beams, in buffers.
#[derive(Clone, Copy)]
pub struct Hiding<'a> {
    /// The walls.
    pub near: Near<'a>,
    /// Their planes: [`Walls::planes`](super::Walls::planes).
    pub planes: &'a Buffer,
    /// The beams that the pieces belong to; each knows its range of planes.
    pub beams: &'a Buffer,
}

/// Sums the contribution of a medium's beams along segments, which are counted on the device.
pub struct Gather {
    threads: Sizing,
    /// The kernel of a single dispatch, if there are several.
    of_parts: Kernel,
    here: Buffer,
    by_ray: Kernel,
    by_tile: Kernel,
    /// Range of the hierarchy for each dispatch.
    ranges: Vec<Buffer>,
}

impl Gather {
    /// For any number of segments and at most this many beams, without occlusion.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most_beams: u32) -> Result<Self> {
        Self::of_media(on, Needs::ALL, most_beams)
    }

    /// The same with kernels compiled for a scene: some medium's density may vary.
    ///
    /// # Errors
    /// Device errors.
    pub fn of_media<'a>(on: impl Into<Together<'a>>, needs: Needs, most_beams: u32) -> Result<Self> {
        let on = on.into();
        Self::with_share(on, Err(needs), most_beams, Share::of(&on, needs.varies))
    }

    /// For beams that walls may hide: see [`Self::run_by_walls`].
    ///
    /// # Errors
    /// Device errors.
    pub fn by_walls<'a>(on: impl Into<Together<'a>>, geometry: &GeometryBuffers, most_beams: u32) -> Result<Self> {
        let on = on.into();
        Self::with_share(on, Ok(geometry), most_beams, Share::of(&on, true))
    }

    /// With this share of the hierarchy per dispatch. `walls`: the scene's, or the needs of a scene without walls.
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

    /// Writes [`Brought`](super::Brought) for each segment: the sum over pieces in their order, from zero.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, way: Way, of: &Segments, pieces: &Pieces, gathered: &Buffer) -> Result<()> {
        self.run_with(work, way, of, (pieces, &[]), gathered)
    }

    /// The same for beams that walls may hide; requires [`Self::by_walls`].
    ///
    /// # Errors
    /// Device errors.
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
                // Binds every buffer that may be needed.
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
