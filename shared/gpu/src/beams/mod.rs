//! Photon beams of a pass on a device: cut into pieces, with a hierarchy over these, and what segments of camera paths
//! gather of them.
//!
//! | step                                       | kernels                                |
//! | ------------------------------------------ | -------------------------------------- |
//! | [`Walls`]: what stands near each beam      | `walls.wgsl`, by the search of `near.wgsl` |
//! | what of a beam a point does not see        | `hidden.wgsl` |
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

/// A beam, as [`beamfarm_render::cpu::beam::PhotonBeam`] has it.
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
    /// Where the kernel begins and ends, from `origin` along `dir`.
    pub extent: [f32; 2],
    /// Number of the medium; above [`WAVE_BITS`](Self::WAVE_BITS), in four bits, the wavelength of its light, from 1
    /// on, or 0; above those the group of lights that it comes from, likewise.
    pub medium: u32,
    /// The walls near it: how many planes they have, in the lowest [`WALL_BITS`](Self::WALL_BITS), and above that the
    /// number of the first of these. Zero where none were looked for.
    pub walls: u32,
}

impl Beam {
    /// So many bits of its walls say how many they are.
    pub const WALL_BITS: u32 = 4;
    /// So many bits of its medium say nothing of a wavelength.
    pub const WAVE_BITS: u32 = 20;
}

/// What a beam starts and ends on, each by the unit normal, on any side, and [`NONE`](Self::NONE),
/// [`SURFACE`](Self::SURFACE) or [`BOUNDARY`](Self::BOUNDARY).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BeamEnds {
    /// Normal of what it starts on.
    pub start: [f32; 3],
    /// What that is.
    pub start_is: u32,
    /// Normal of what it ends on.
    pub end: [f32; 3],
    /// What that is.
    pub end_is: u32,
}

impl BeamEnds {
    /// Nothing is there: the normal means nothing.
    pub const NONE: u32 = 0;
    /// A surface.
    pub const SURFACE: u32 = 1;
    /// A boundary of its medium that is no wall: what is behind it sees none of the beam.
    pub const BOUNDARY: u32 = 2;
}

/// A piece of a beam, from `start`, exclusive, to `end` from the beam's origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Piece {
    /// The beam's.
    pub origin: [f32; 3],
    /// Where it starts, along the beam.
    pub start: f32,
    /// The beam's.
    pub dir: [f32; 3],
    /// Where it ends, along the beam.
    pub end: f32,
    /// The beam's.
    pub power: [f32; 3],
    /// The beam's, at its origin.
    pub radius: f32,
    /// The beam's.
    pub radius_slope: f32,
    /// The larger of those at both ends of the piece.
    pub max_radius: f32,
    /// Number of the beam.
    pub beam: u32,
    /// Number of the medium in the lowest 16 bits; above that, what `kernels/beam.wgsl` says of walls.
    pub medium: u32,
}

/// A segment of a camera path in a medium.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// Start, render space.
    pub origin: [f32; 3],
    /// Length, scene units; nothing is found along one that is not above 0.
    pub length: f32,
    /// Unit direction.
    pub dir: [f32; 3],
    /// Number of the medium.
    pub medium: u32,
    /// With the beam's number, addresses the random numbers of chords.
    pub pixel: u32,
    /// Of the transmittance along it, where the density varies: the word at which its steps begin.
    pub steps: u32,
    /// How many they are.
    pub step_count: u32,
    /// Above eight bits the wavelength of the path, from 1 on, or 0.
    pub bits: u32,
}

/// How a medium scatters light; where its density varies, at density 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Scattering {
    /// RGB, per scene unit.
    pub sigma_s: [f32; 3],
    /// Nothing.
    pub spare_s: u32,
    /// Extinction, RGB, per scene unit.
    pub sigma_t: [f32; 3],
    /// Nothing.
    pub spare_t: u32,
    /// Those of [`beamfarm_render::world::phase::PhaseLobe`]: scale, peak, slope, sign.
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

/// What was gathered along a segment, or what one piece brings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Brought {
    /// RGB, before the path's throughput.
    pub radiance: [f32; 3],
    /// Pieces that brought any.
    pub count: u32,
}
