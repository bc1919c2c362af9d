//! Kernel radii: the size that they are fractions of, and how a photon's footprint becomes a radius.

mod extent;

use crate::math::Vec3;
use crate::plan::footprint::Footprint;
use crate::world::Scene;
use crate::world::medium::Medium;

/// Turns footprints into kernel radii, before the pass's scale.
#[derive(Clone, Copy, Debug)]
pub struct KernelRadii {
    /// Smallest base radius, scene units.
    pub floor: f32,
    /// Largest base radius of light that has passed only specular surfaces, scene units.
    pub ceiling: f32,
    /// Largest base radius of light that has been scattered, scene units.
    pub smooth_ceiling: f32,
}

/// The size by which a scene's kernels count as wide or narrow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Middle of the scene, or of the part that the camera sees.
    pub center: Vec3,
    /// Its radius, scene units.
    pub radius: f32,
    /// Whether this is a part of the scene.
    pub is_of_part: bool,
}

impl Extent {
    /// The extent of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self::by_rays(scene, extent::SIDE)
    }

    /// A rougher extent, by fewer rays.
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

/// Kernel radius over footprint radius, so that neighbouring kernels overlap. Surface kernels overlap more, because
/// they average over fewer photons, and yet more where scattered light leaves little to blur.
const BEAM_OVERLAP: f32 = 1.5;
const SURFACE_OVERLAP: f32 = 3.0;
const SMOOTH_SURFACE_OVERLAP: f32 = 7.5;
/// Floor and ceilings of base radii, as fractions of the radius of the scene or of the part that the camera sees.
const FLOOR: f32 = 5e-4;
const CEILING: f32 = 1.6e-2;
const SMOOTH_CEILING: f32 = 4e-2;

/// Widest base radii of beams in a medium, scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WidestBeams {
    /// For light that has passed only specular surfaces.
    pub sharp: f32,
    /// For scattered light.
    pub smooth: f32,
}

impl WidestBeams {
    /// For a medium: sharp light is not blurred by more than its free path.
    pub fn within(medium: &Medium) -> Self {
        Self {
            sharp: medium.free_path(),
            smooth: f32::MAX,
        }
    }

    /// The same, limited to this radius.
    #[must_use]
    pub fn at_most(self, radius: f32) -> Self {
        Self {
            sharp: self.sharp.min(radius),
            smooth: self.smooth.min(radius),
        }
    }
}

impl KernelRadii {
    /// Every kernel has the same radius.
    pub fn fixed(radius: f32) -> Self {
        Self {
            floor: radius,
            ceiling: radius,
            smooth_ceiling: radius,
        }
    }

    /// For a scene, or the visible part of one, of this radius.
    pub fn of_extent(extent: f32) -> Self {
        Self {
            floor: extent * FLOOR,
            ceiling: extent * CEILING,
            smooth_ceiling: extent * SMOOTH_CEILING,
        }
    }

    /// All radii multiplied by a factor.
    pub fn times(self, factor: f32) -> Self {
        Self {
            floor: self.floor * factor,
            ceiling: self.ceiling * factor,
            smooth_ceiling: self.smooth_ceiling * factor,
        }
    }

    /// All radii limited to this one.
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

    /// The base radius of a surface photon for its footprint. `share`: factor on the footprint's radius, if there are
    /// more surface photons than beams.
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
