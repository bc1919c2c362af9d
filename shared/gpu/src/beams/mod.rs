//! A pass's photon beams on a device: cut into pieces, with a hierarchy over the pieces from which segments of camera
//! paths gather.
//!
//! | step                                       | kernels                                |
//! | ------------------------------------------ | -------------------------------------- |
//! | [`Walls`]: what stands near each beam      | `walls.wgsl`, by the search of `near.wgsl` |
//! | what hides a beam from a point             | `hidden.wgsl` |
//! | [`Pieces`]: beams to pieces in their order | `pieces.wgsl`, and those of [`crate::hierarchy`] |
//! | what one piece brings to one segment       | `estimate.wgsl`, `attenuation.wgsl`; its twin is [`crate::twin::beams`] |
//! | [`Gather`]: the sum along each segment     | `gather.wgsl`, by tiles `tile.wgsl`    |

mod gather;
mod pieces;
#[cfg(test)]
mod tests;
mod walls;

pub use gather::{Functions, Gather, Hiding, Segments, Way};
pub use pieces::Pieces;
pub use walls::{FlatWalls, Hull, Near, Plane, WallBuffers, WallShape, Walls};

use beamfarm_render::world::medium::Medium;
use bytemuck::{Pod, Zeroable};

/// A beam, as in [`beamfarm_render::cpu::beam::PhotonBeam`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Beam {
    /// Start, render space.
    pub origin: [f32; 3],
    /// Kernel radius there, scene units.
    pub radius: f32,
    /// Unit direction of propagation.
    pub dir: [f32; 3],
    /// Change of the kernel radius per unit of length.
    pub radius_slope: f32,
    /// Flux at the start, W, divided by the number of emitted paths.
    pub power: [f32; 3],
    /// Length, scene units.
    pub length: f32,
    /// Start and end of the kernel, from `origin` along `dir`.
    pub extent: [f32; 2],
    /// Number of the medium; from bit [`WAVE_BITS`](Self::WAVE_BITS) on, four bits with the wavelength of its light,
    /// from 1 on, or 0; above those its light group, likewise.
    pub medium: u32,
    /// The walls near it: the number of their planes in the lowest [`WALL_BITS`](Self::WALL_BITS), and above that the
    /// index of the first plane. Zero before the search for walls.
    pub walls: u32,
}

impl Beam {
    /// Bits of `walls` for the number of planes.
    pub const WALL_BITS: u32 = 4;
    /// Bits of `medium` below the wavelength.
    pub const WAVE_BITS: u32 = 20;
}

/// What a beam starts and ends on: for each end a unit normal, on either side, and [`NONE`](Self::NONE),
/// [`SURFACE`](Self::SURFACE) or [`BOUNDARY`](Self::BOUNDARY).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BeamEnds {
    /// Normal at its start.
    pub start: [f32; 3],
    /// Kind of its start.
    pub start_is: u32,
    /// Normal at its end.
    pub end: [f32; 3],
    /// Kind of its end.
    pub end_is: u32,
}

impl BeamEnds {
    /// Nothing: the normal is meaningless.
    pub const NONE: u32 = 0;
    /// A surface.
    pub const SURFACE: u32 = 1;
    /// A boundary of its medium that is no wall: nothing behind it sees the beam.
    pub const BOUNDARY: u32 = 2;
}

/// A piece of a beam, from `start` (exclusive) to `end`, measured from the beam's origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Piece {
    /// Origin of the beam.
    pub origin: [f32; 3],
    /// Start of the piece along the beam.
    pub start: f32,
    /// Direction of the beam.
    pub dir: [f32; 3],
    /// End of the piece along the beam.
    pub end: f32,
    /// Power of the beam.
    pub power: [f32; 3],
    /// Kernel radius at the beam's origin.
    pub radius: f32,
    /// Radius slope of the beam.
    pub radius_slope: f32,
    /// The larger of the radii at the two ends of the piece.
    pub max_radius: f32,
    /// Number of the beam.
    pub beam: u32,
    /// Number of the medium in the lowest 16 bits; above that, the wall flags of `kernels/beam.wgsl`.
    pub medium: u32,
}

/// A segment of a camera path in a medium.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// Start, render space.
    pub origin: [f32; 3],
    /// Length, scene units; segments whose length is not above 0 find nothing.
    pub length: f32,
    /// Unit direction.
    pub dir: [f32; 3],
    /// Number of the medium.
    pub medium: u32,
    /// Together with the beam's number, the address of the chords' random numbers.
    pub pixel: u32,
    /// First word of the transmittance's steps along it, if the density varies.
    pub steps: u32,
    /// Number of steps.
    pub step_count: u32,
    /// Above eight bits, the wavelength of the path, from 1 on, or 0.
    pub bits: u32,
}

/// How a medium scatters light; at density 1 if its density varies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Scattering {
    /// Scattering, RGB, per scene unit.
    pub sigma_s: [f32; 3],
    /// Padding.
    pub spare_s: u32,
    /// Extinction, RGB, per scene unit.
    pub sigma_t: [f32; 3],
    /// Padding.
    pub spare_t: u32,
    /// As in [`beamfarm_render::world::phase::PhaseLobe`]: scale, peak, slope, sign.
    pub lobes: [[f32; 4]; 2],
}

impl From<&Medium> for Scattering {
    fn from(medium: &Medium) -> Self {
        Self {
            sigma_s: medium.sigma_s().to_array(),
            sigma_t: medium.sigma_t().to_array(),
            lobes: medium.phase().lobes().map(|l| [l.scale, l.peak, l.slope, l.sign]),
            ..Self::default()
        }
    }
}

/// The light gathered along a segment, or one piece's contribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Brought {
    /// RGB, before the path's throughput.
    pub radiance: [f32; 3],
    /// Number of contributing pieces.
    pub count: u32,
}
