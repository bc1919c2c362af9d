//! A medium of constant density: every transmittance in closed form.

use super::transmittance::OPAQUE_DEPTH;
use crate::math::{Rgb, Vec3, exp_neg, ln};
use crate::phase::Phase;

/// A homogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct Homogeneous {
    /// Absorption, RGB, per scene unit.
    pub sigma_a: Rgb,
    /// Scattering, RGB, per scene unit.
    pub sigma_s: Rgb,
    /// Phase function.
    pub phase: Phase,
}

/// Where a photon's flight through a medium ended.
#[derive(Clone, Copy, Debug)]
pub enum Flight {
    /// Scattered after `distance`; `weight` = Tr sigma_s / pdf per channel.
    Scattered {
        /// Distance, scene units.
        distance: f32,
        /// Factor on the flux.
        weight: Rgb,
    },
    /// Got to the end of the segment; `weight` = Tr / probability per channel.
    Passed {
        /// Factor on the flux.
        weight: Rgb,
    },
}

impl Homogeneous {
    /// Extinction, RGB, per scene unit.
    #[inline]
    pub fn sigma_t(&self) -> Rgb {
        self.sigma_a + self.sigma_s
    }

    /// Whether light is scattered at all: beams and camera segments in other media are of no use.
    pub fn scatters(&self) -> bool {
        self.sigma_s.max_element() > 0.0
    }

    /// Transmittance over `distance`, which may be infinite.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let sigma_t = self.sigma_t();
        let one = |s: f32| if s > 0.0 { exp_neg(-s * distance) } else { 1.0 };
        Rgb::new(one(sigma_t.x), one(sigma_t.y), one(sigma_t.z))
    }

    /// The smallest extinction of the channels that scatter; infinite if none does.
    pub fn least_sigma_t(&self) -> f32 {
        let sigma_t = self.sigma_t();
        let mut smallest = f32::INFINITY;
        for c in 0..3 {
            if self.sigma_s[c] > 0.0 {
                smallest = smallest.min(sigma_t[c]);
            }
        }
        smallest
    }

    /// Distance beyond which no channel that scatters lets anything through that counts.
    pub fn reach(&self) -> f32 {
        OPAQUE_DEPTH / self.least_sigma_t()
    }

    /// Sample where a photon of flux `power` scatters within `length` (which may be infinite). The distance is drawn for
    /// one channel, chosen in proportion to its flux, and weighted by the density of all of them.
    pub fn sample_flight(&self, power: Rgb, length: f32, u: [f32; 2]) -> Flight {
        let sigma_t = self.sigma_t();
        let share = power / (power.x + power.y + power.z);
        let channel = if u[0] < share.x {
            0
        } else if u[0] < share.x + share.y {
            1
        } else {
            2
        };
        let distance = -ln(1.0 - u[1]) / sigma_t[channel];
        if distance < length {
            let tr = self.transmittance(distance);
            let pdf = (share * sigma_t * tr).element_sum();
            let weight = tr * self.sigma_s * (1.0 / pdf);
            Flight::Scattered { distance, weight }
        } else {
            let tr = self.transmittance(length);
            let probability = (share * tr).element_sum();
            Flight::Passed {
                weight: if probability > 0.0 {
                    tr * (1.0 / probability)
                } else {
                    Vec3::ZERO
                },
            }
        }
    }
}
