//! A pass's surface photons on a device, and their contribution at points of surfaces that camera paths have reached:
//! the processor's `SurfacePhotonMap` and `photon_radiance`.
//!
//! | step                                                 | kernels                                           |
//! | ---------------------------------------------------- | ------------------------------------------------- |
//! | [`PhotonMap`]: photons in the order of a hierarchy   | `photon_map.wgsl`, and those of [`crate::hierarchy`] |
//! | [`PhotonEstimate`]: the sum for each request         | `photons.wgsl`                                    |
//!
//! Photons are [`SurfacePhoton`]s of `photon.wgsl`, whoever traces them. Requests are [`PhotonRequest`]s of
//! `photon_request.wgsl`, which says how paths fill them. Sums run over photons in the map's order, one after another,
//! so that their bits depend only on the photons and the order in which they were stored.
//!
//! Cost of a lookup where 19 kernels cover the point, with 100,000 photons in a room lit by a lamp: 125 boxes and 58
//! photons with the hierarchy's curve through the photons' centres. Hilbert's curve would take 86 and 48, and a tree
//! built with the surface area heuristic, which does not suit devices, 61 and 35. Boxes around the kernels' discs
//! instead of balls save less than 4 % of either on flat walls; photons sorted by size first cost half as many boxes
//! again.

mod estimate;
mod map;
#[cfg(test)]
mod tests;

pub use estimate::{PhotonEstimate, PhotonRequests};
pub use map::PhotonMap;

use beamfarm_render::cpu::photon_map::{self, Arrival, SeenBy};
use beamfarm_render::plan::weights::FoundBy;
use bytemuck::{Pod, Zeroable};

/// A surface photon, as in [`beamfarm_render::cpu::photon_map::SurfacePhoton`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfacePhoton {
    /// Position, render space.
    pub point: [f32; 3],
    /// Kernel radius, scene units.
    pub radius: f32,
    /// Unit geometric normal at the point.
    pub ng: [f32; 3],
    /// If both techniques find its light: the expected number of photons, without the camera path's density.
    pub expected: f32,
    /// Unit direction that the light came from.
    pub wi: [f32; 3],
    /// Its last scattering: direct, caustic, scattered, surface, 0 to 3; plus 256 if lobes that paths do not follow see
    /// it, and 512 for lobes that they do follow; from bit 16 on, four bits with the wavelength of its light, from 1
    /// on, or 0; above those its light group, likewise.
    pub arrival: u32,
    /// Flux, W, divided by the number of emitted paths.
    pub power: [f32; 3],
    /// Which technique finds its light: photons, paths, both, paths by rule, 0 to 3; from bit 8 on the class of its
    /// light.
    pub found_by: u32,
    /// Walls cross its kernel only where the dot product of this with the offset is above 1; NaN if there is no such
    /// bound.
    pub beyond: [f32; 3],
    /// Height above the surface at which walls are tested, scene units; zero if none crosses.
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
    /// No request.
    Nothing = 0,
    /// With full weight.
    All = 1,
    /// With MIS weights against the ray that continues from a first vertex.
    First = 2,
    /// The same at later vertices, without light from surfaces.
    Later = 3,
    /// With MIS weights against photons that go from here to the first vertex.
    Last = 4,
}

/// A point at which light is requested: see `kernels/photon_request.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhotonRequest {
    /// Point of the surface, render space.
    pub point: [f32; 3],
    /// A [`Counted`]; from bit 8 on, the lights whose photons do not count, as class bits.
    pub kind: u32,
    /// Unit geometric normal, on either side.
    pub ng: [f32; 3],
    /// For the last kind: density of the first vertex' direction, per projected solid angle there.
    pub density: f32,
    /// Unit shading normal.
    pub ns: [f32; 3],
    /// Index of the radiance vector that receives the result.
    pub slot: u32,
    /// Unit direction to the path's origin.
    pub wo: [f32; 3],
    /// 1: requested by lobes that paths follow; 2: value and density are those of the request's surface; 4: light from
    /// surfaces does not count; 8: nor does light that rules keep off the photons' surface; above eight bits the
    /// wavelength of the path, from 1 on, whose weight is part of the value, or 0.
    pub bits: u32,
    /// The throughput from the film; times the BSDF's value, 1/sr, if that is constant on the side of `wo`.
    pub value: [f32; 3],
    /// Factor on the expected number of photons.
    pub photon_scale: f32,
    /// The shading normal before a map turned it, and the squared roughness of a surface with the map's slopes;
    /// negative without a map.
    pub shadowing: [f32; 4],
}
