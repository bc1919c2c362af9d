//! Surface photons of a pass on a device.

use beamfarm_render::cpu::photon_map::{self, Arrival};
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
    /// Its last scattering: direct, caustic, scattered, surface, 0 to 3.
    pub arrival: u32,
    /// Flux, W, divided by the number of emitted paths.
    pub power: [f32; 3],
    /// Which technique finds its light: photons, paths, both, 0 to 2.
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
            FoundBy::Paths | FoundBy::PathsByRule => (1, 0.0),
            FoundBy::Both(expected) => (2, expected),
        };
        Self {
            point: photon.point.to_array(),
            radius: photon.radius,
            ng: photon.ng.to_array(),
            expected,
            wi: photon.wi.to_array(),
            arrival: match photon.arrival {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{PHOTON, Program};
    use crate::testing::same_layout;

    #[test]
    fn photons_lie_in_memory_as_kernels_have_them() {
        let program = Program {
            name: "photon",
            texts: &[
                PHOTON,
                "@group(0) @binding(0) var<storage, read_write> photons: array<SurfacePhoton>;
                @compute @workgroup_size(1) fn main() { photons[0].radius = 1.0; }",
            ],
        };
        assert_eq!(size_of::<SurfacePhoton>(), 80);
        same_layout!(
            &program,
            SurfacePhoton {
                point,
                radius,
                ng,
                expected,
                wi,
                arrival,
                power,
                found_by,
                beyond,
                height
            }
        );
    }
}
