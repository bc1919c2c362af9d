//! Photon beams: [`trace`] makes them, [`store`] keeps them, [`estimate`] turns them into radiance.

mod edges;
pub mod estimate;
mod lanes;
mod order;
pub mod store;
pub mod trace;
pub mod walls;

use crate::math::{Rgb, Vec3};
use crate::plan::aov::GroupNumber;
use crate::world::spectrum::WaveNumber;

/// A segment of a photon path in a scattering medium. It is a long beam: it runs from where the photon entered or was
/// scattered to the next surface, whatever happened to the photon on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonBeam {
    /// Start, render space.
    pub origin: Vec3,
    /// Unit direction of propagation.
    pub dir: Vec3,
    /// Length, scene units.
    pub length: f32,
    /// Where the beam's kernel begins and ends, measured from `origin` along `dir`. It covers [0, length], and more
    /// where the beam starts or ends on a surface, so far that its whole width reaches that surface. What the kernel
    /// loses behind the surface on one side of the beam, it gains in front of it on the other.
    pub extent: [f32; 2],
    /// Flux at the start, W, before attenuation and scattering, divided by the number of emitted paths.
    pub power: Rgb,
    /// Kernel radius at the start, scene units.
    pub radius: f32,
    /// Change of the kernel radius per unit of length: the beam is a truncated cone.
    pub radius_slope: f32,
    /// Index into the scene's media.
    pub medium: u16,
    /// Group of the light that it comes from; see [`crate::plan::aov::LayerPlan::group`].
    pub group: Option<GroupNumber>,
    /// The wavelength of its light, if it has one. The power does not contain its weight.
    pub wave: Option<WaveNumber>,
    /// Index of the beam's transmittance among the pass's step functions, in a heterogeneous medium.
    pub steps: u32,
    /// Which of the pass's planes stand for the walls near it: a half-open range.
    pub walls: [u32; 2],
}

impl PhotonBeam {
    /// Kernel radius at distance `s`.
    #[inline]
    pub fn radius_at(&self, s: f32) -> f32 {
        self.radius + self.radius_slope * s
    }
    /// How far along the beam a point is.
    fn along(&self, point: Vec3) -> f32 {
        (point - self.origin).dot(self.dir)
    }
    /// Where the beam's kernel begins and ends, render space.
    #[inline]
    pub fn ends(&self) -> [Vec3; 2] {
        self.extent.map(|s| self.origin + self.dir * s)
    }
    /// The larger of the radii at the two ends.
    #[inline]
    pub fn max_radius(&self) -> f32 {
        let [start, end] = self.extent;
        self.radius_at(start).max(self.radius_at(end))
    }
}
