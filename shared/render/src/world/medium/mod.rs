//! Participating media, one file per kind: [`Homogeneous`] has a closed-form transmittance, [`Heterogeneous`] an
//! unbiased estimate.

pub mod bricks;
mod heterogeneous;
mod homogeneous;
pub mod majorant;
pub mod procedural;
pub mod transmittance;

pub use heterogeneous::{Albedo, Heterogeneous, Track};
pub use homogeneous::{Flight, Homogeneous};

use crate::math::{Ray, Rgb};
use crate::sampler::Sampler;
use crate::world::phase::Phase;
use transmittance::StepFunctions;

/// Index into the scene's media. `None` stands for vacuum.
pub type MediumId = Option<u16>;

/// A medium.
#[derive(Clone, Debug)]
pub enum Medium {
    /// Constant density.
    Homogeneous(Homogeneous),
    /// Varying density.
    Heterogeneous(Heterogeneous),
}

/// The part of a ray where a medium scatters visible light.
#[derive(Clone, Copy, Debug)]
pub struct MediumSegment {
    /// Distances along the ray, finite.
    pub range: [f32; 2],
    /// Number of the transmittance in the [`StepFunctions`]; meaningless for a homogeneous medium.
    pub steps: u32,
}

impl Medium {
    /// Phase function.
    pub fn phase(&self) -> Phase {
        match self {
            Self::Homogeneous(medium) => medium.phase,
            Self::Heterogeneous(medium) => medium.phase,
        }
    }

    /// Scattering, RGB, per scene unit (at density 1).
    pub fn sigma_s(&self) -> Rgb {
        match self {
            Self::Homogeneous(medium) => medium.sigma_s,
            Self::Heterogeneous(medium) => medium.sigma_s,
        }
    }

    /// Extinction, RGB, per scene unit (at density 1).
    pub fn sigma_t(&self) -> Rgb {
        match self {
            Self::Homogeneous(medium) => medium.sigma_t(),
            Self::Heterogeneous(medium) => medium.sigma_t(),
        }
    }

    /// The shortest mean free path over all channels at the highest density; scene units.
    pub fn free_path(&self) -> f32 {
        let density = match self {
            Self::Homogeneous(_) => 1.0,
            Self::Heterogeneous(medium) => medium.bricks().max(),
        };
        1.0 / (self.sigma_t().max_element() * density)
    }

    /// Whether it scatters at all: other media need no beams or camera segments.
    pub fn scatters(&self) -> bool {
        self.sigma_s().max_element() > 0.0
    }

    /// Transmittance along a ray over `length`, which may be infinite: closed form, or one unbiased estimate.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, length: f32, sampler: &mut Sampler) -> Rgb {
        match self {
            Self::Homogeneous(medium) => medium.transmittance(length),
            Self::Heterogeneous(medium) => medium.transmittance(ray, length, sampler),
        }
    }

    /// The part of a ray on which beams or the camera see this medium, and the transmittance over all of `length`,
    /// which may be infinite. An estimated transmittance is one fixed function of the distance.
    pub fn segment(
        &self,
        ray: &Ray,
        length: f32,
        sampler: &mut Sampler,
        steps: &mut StepFunctions,
    ) -> (Option<MediumSegment>, Rgb) {
        match self {
            Self::Homogeneous(medium) => {
                let segment = MediumSegment {
                    range: [0.0, length.min(medium.reach())],
                    steps: 0,
                };
                (Some(segment), medium.transmittance(length))
            }
            Self::Heterogeneous(medium) => {
                let Some(track) = medium.track(ray, length) else {
                    return (None, Rgb::ONE);
                };
                let number = medium.walk(&track, sampler, steps);
                let function = steps.get(number);
                let [start, end] = track.range;
                let segment = MediumSegment {
                    range: [start, function.end().unwrap_or(end)],
                    steps: number,
                };
                (Some(segment), function.last(medium.sigma_t()))
            }
        }
    }

    /// What becomes of a path of throughput `beta` within `length`, which may be infinite: by [`Self::sample_flight`]
    /// in a medium that scatters; it passes any other.
    pub fn sample_way(&self, ray: &Ray, length: f32, beta: Rgb, sampler: &mut Sampler) -> Flight {
        match self.scatters() {
            true => self.sample_flight(ray, length, beta, sampler),
            false => Flight::Passed {
                weight: self.transmittance(ray, length, sampler),
            },
        }
    }

    /// Samples where a photon of flux `power` scatters within `length`, which may be infinite.
    pub fn sample_flight(&self, ray: &Ray, length: f32, power: Rgb, sampler: &mut Sampler) -> Flight {
        match self {
            Self::Homogeneous(medium) => medium.sample_flight(power, length, sampler.next_2d().into()),
            Self::Heterogeneous(medium) => match medium.track(ray, length) {
                Some(track) => medium.sample_flight(&track, power, sampler),
                None => Flight::Passed { weight: Rgb::ONE },
            },
        }
    }
}
