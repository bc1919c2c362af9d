//! Surface photons of a pass on a device, and what they bring to points of diffuse surfaces that camera paths have come
//! to: the processor's `SurfacePhotonMap` and `photon_radiance`.
//!
//! | step                                                 | kernels                                           |
//! | ---------------------------------------------------- | ------------------------------------------------- |
//! | [`PhotonMap`]: photons in the order of a hierarchy   | `photon_map.wgsl`, and those of [`crate::hierarchy`] |
//! | [`PhotonEstimate`]: the sum for each request         | `photons.wgsl`                                    |
//!
//! Photons are [`SurfacePhoton`]s of `photon.wgsl`, whoever traces them; what is asked are [`PhotonRequest`]s of
//! `photon_request.wgsl`, which says how paths fill them. Sums are of photons in the map's order, one after another, so
//! that their bits depend on nothing but the photons and the order that these were stored in.
//!
//! How much is looked at for one point where 19 kernels cover it, of 100,000 photons in a room lit by a lamp: along the
//! curve of the hierarchy by the photons' centres, 125 boxes and 58 photons. Hilbert's curve would make it 86 and 48,
//! and a tree by surface areas, which is not for devices, 61 and 35. Boxes around the discs that kernels are, and not
//! the balls, save below 4 % of either on flat walls; photons sorted by size first cost half as many boxes again.

mod estimate;
mod map;
#[cfg(test)]
mod tests;

pub use estimate::{PhotonEstimate, PhotonRequests};
pub use map::PhotonMap;

use beamfarm_render::cpu::photon_map::{self, Arrival, SeenBy};
use beamfarm_render::plan::weights::FoundBy;
use bytemuck::{Pod, Zeroable};

/// A photon on a surface, as [`beamfarm_render::cpu::photon_map::SurfacePhoton`] has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfacePhoton {
    /// Where, render space.
    pub point: [f32; 3],
    /// Kernel radius, scene units.
    pub radius: f32,
    /// Unit geometric normal there.
    pub ng: [f32; 3],
    /// Where both techniques find its light: the number of expected photons, the camera path's density left out.
    pub expected: f32,
    /// Unit direction that the light came from.
    pub wi: [f32; 3],
    /// Its last scattering: direct, caustic, scattered, surface, 0 to 3; with it, seen by lobes that paths do not
    /// follow, by those that they do: 256 and 512; above 16 bits, in four, the wavelength of its light, from 1 on, or
    /// 0; above those the group of lights that it comes from, likewise.
    pub arrival: u32,
    /// Flux, W, divided by the number of emitted paths.
    pub power: [f32; 3],
    /// Which technique finds its light: photons, paths, both, paths by rule, 0 to 3; from bit 8 on the class of the
    /// light that it comes from.
    pub found_by: u32,
    /// All walls that cross its kernel are where the offset from it times this is above 1, if it is a number.
    pub beyond: [f32; 3],
    /// How high above the surface walls are asked for, scene units; zero where none crosses.
    pub height: f32,
}

impl From<&photon_map::SurfacePhoton> for SurfacePhoton {
    fn from(photon: &photon_map::SurfacePhoton) -> Self {
        let (found_by, expected) = match photon.found_by {
            FoundBy::Photons => (0, 0.0),
            FoundBy::Paths => (1, 0.0),
            FoundBy::Both(expected) => (2, expected),
            FoundBy::PathsByRule => (3, 0.0),
        };
        Self {
            point: photon.point.to_array(),
            radius: photon.radius,
            ng: photon.ng.to_array(),
            expected,
            wi: photon.wi.to_array(),
            arrival: photon.wave.map_or(0, |wave| (wave.index() as u32 + 1) << 16)
                | seen_by(photon.lobes)
                | match photon.arrival {
                    Arrival::Direct => 0,
                    Arrival::Caustic => 1,
                    Arrival::Scattered => 2,
                    Arrival::Surface => 3,
                },
            power: photon.power.to_array(),
            found_by,
            beyond: photon.walls.beyond.to_array(),
            height: photon.walls.height,
        }
    }
}

fn seen_by(lobes: SeenBy) -> u32 {
    match lobes {
        SeenBy::Wide => 1 << 8,
        SeenBy::Followed => 1 << 9,
        SeenBy::All => 1 << 8 | 1 << 9,
    }
}

/// How photons count for a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Counted {
    /// Nothing is asked.
    Nothing = 0,
    /// As they are.
    All = 1,
    /// Balanced with the ray that goes on from a first vertex.
    First = 2,
    /// The same at later ones, without what surfaces send.
    Later = 3,
    /// Balanced with photons that go from here to the first vertex.
    Last = 4,
}

/// A point from which light is looked for: see `kernels/photon_request.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhotonRequest {
    /// Of the surface, render space.
    pub point: [f32; 3],
    /// A [`Counted`]; from bit 8 on lights whose photons do not count, by bits of classes.
    pub kind: u32,
    /// Unit geometric normal, on any side.
    pub ng: [f32; 3],
    /// Of the last kind: how densely the first vertex' direction was drawn, per projected solid angle there.
    pub density: f32,
    /// Unit shading normal.
    pub ns: [f32; 3],
    /// Which vector of the list of radiance gets it.
    pub slot: u32,
    /// Unit direction to where the path comes from.
    pub wo: [f32; 3],
    /// 1: the lobes that ask are ones that paths follow; 2: value and density are those of the surface that belongs to
    /// the request; 4: what surfaces send does not count; 8: nor what rules keep off the surface that photons are on;
    /// above eight bits the wavelength of the path, from 1 on, whose weight is part of the value, or 0.
    pub bits: u32,
    /// The throughput from the film; where the BSDF's value is the same on the side of `wo`, times that, 1/sr.
    pub value: [f32; 3],
    /// On the photons that are expected.
    pub photon_scale: f32,
    /// The shading normal before a map turned it, and the square of the roughness that a surface of the map's slopes
    /// might have; below zero where there is no map.
    pub shadowing: [f32; 4],
}
