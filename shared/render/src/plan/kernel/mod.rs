//! Kernel radii: of what size they are fractions, and how a photon's footprint becomes one.

mod extent;

use crate::math::Vec3;
use crate::plan::footprint::Footprint;
use crate::world::Scene;
use crate::world::medium::Medium;

/// From footprints to kernel radii, before the pass's scale.
#[derive(Clone, Copy, Debug)]
pub struct KernelRadii {
    /// Smallest base radius, scene units.
    pub floor: f32,
    /// Largest base radius of light that has been through specular surfaces only, scene units.
    pub ceiling: f32,
    /// Largest base radius of light that has been scattered, scene units.
    pub smooth_ceiling: f32,
}

/// The size by which kernels of a scene are wide or narrow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Middle of the scene, or of the part that the camera sees.
    pub center: Vec3,
    /// Radius of it, scene units.
    pub radius: f32,
    /// It is that of a part.
    pub is_of_part: bool,
}

impl Extent {
    /// Of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self::by_rays(scene, extent::SIDE)
    }

    /// By fewer rays.
    pub fn roughly_of(scene: &Scene) -> Self {
        Self::by_rays(scene, extent::FEW)
    }

    fn by_rays(scene: &Scene, side: usize) -> Self {
        let part = extent::of_part_seen(scene, side);
        let (center, radius) = part.unwrap_or((scene.bounds().center, scene.bounds().radius));
        Self {
            center,
            radius,
            is_of_part: part.is_some(),
        }
    }
}

/// Kernel radius over footprint radius: kernels of neighbouring photons overlap, those of surfaces by more, because
/// they average over fewer photons, and by yet more where light that has been scattered leaves little to blur.
const BEAM_OVERLAP: f32 = 1.5;
const SURFACE_OVERLAP: f32 = 3.0;
const SMOOTH_SURFACE_OVERLAP: f32 = 7.5;
/// Floor and ceilings of base radii as fractions of the radius of the scene, or of the part that the camera sees.
const FLOOR: f32 = 5e-4;
const CEILING: f32 = 1.6e-2;
const SMOOTH_CEILING: f32 = 4e-2;

/// Widest base radii of beams in a medium, scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WidestBeams {
    /// Of light that has been through specular surfaces only.
    pub sharp: f32,
    /// Of light that has been scattered.
    pub smooth: f32,
}

impl WidestBeams {
    /// Of a medium: what is sharp is not blurred by more than light flies.
    pub fn within(medium: &Medium) -> Self {
        Self {
            sharp: medium.free_path(),
            smooth: f32::MAX,
        }
    }

    /// None wider than this.
    #[must_use]
    pub fn at_most(self, radius: f32) -> Self {
        Self {
            sharp: self.sharp.min(radius),
            smooth: self.smooth.min(radius),
        }
    }
}

impl KernelRadii {
    /// All of one size.
    pub fn fixed(radius: f32) -> Self {
        Self {
            floor: radius,
            ceiling: radius,
            smooth_ceiling: radius,
        }
    }

    /// For a scene, or the part of one that matters, of this radius.
    pub fn of_extent(extent: f32) -> Self {
        Self {
            floor: extent * FLOOR,
            ceiling: extent * CEILING,
            smooth_ceiling: extent * SMOOTH_CEILING,
        }
    }

    /// All so many times as wide.
    pub fn times(self, factor: f32) -> Self {
        Self {
            floor: self.floor * factor,
            ceiling: self.ceiling * factor,
            smooth_ceiling: self.smooth_ceiling * factor,
        }
    }

    /// None larger than this one.
    pub fn at_most(self, radius: f32) -> Self {
        Self {
            floor: self.floor.min(radius),
            ceiling: self.ceiling.min(radius),
            smooth_ceiling: self.smooth_ceiling.min(radius),
        }
    }

    /// The base radius of a beam for its footprint.
    #[inline]
    pub fn beam(&self, footprint: &Footprint) -> f32 {
        self.bounded(footprint, footprint.radius() * BEAM_OVERLAP)
    }

    /// The base radius of a surface photon for its footprint. `share`: of that footprint's radius, when there are more
    /// surface photons than beams.
    #[inline]
    pub fn surface(&self, footprint: &Footprint, share: f32) -> f32 {
        let overlap = if footprint.is_smooth() {
            SMOOTH_SURFACE_OVERLAP
        } else {
            SURFACE_OVERLAP
        };
        self.bounded(footprint, footprint.radius() * share * overlap)
    }

    fn bounded(&self, footprint: &Footprint, radius: f32) -> f32 {
        let ceiling = if footprint.is_smooth() {
            self.smooth_ceiling
        } else {
            self.ceiling
        };
        radius.clamp(self.floor, ceiling)
    }
}
