//! A medium of constant density: every transmittance has a closed form.

use super::transmittance::OPAQUE_DEPTH;
use crate::math::{Rgb, Vec3, exp_neg, ln};
use crate::world::phase::Phase;

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
    /// Reached the end of the segment; `weight` = Tr / probability per channel.
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

    /// Whether it scatters at all: other media need no beams or camera segments.
    pub fn scatters(&self) -> bool {
        self.sigma_s.max_element() > 0.0
    }

    /// Transmittance over `distance`, which may be infinite.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let sigma_t = self.sigma_t();
        let one = |s: f32| if s > 0.0 { exp_neg(-s * distance) } else { 1.0 };
        let x = one(sigma_t.x);
        if sigma_t.y == sigma_t.x && sigma_t.z == sigma_t.x {
            return Rgb::splat(x);
        }
        Rgb::new(x, one(sigma_t.y), one(sigma_t.z))
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

    /// Extinction by channel, per scene unit; channels that do not scatter take the least value of the others.
    pub fn scattering_sigma_t(&self) -> Rgb {
        let (sigma_t, least) = (self.sigma_t(), self.least_sigma_t());
        let of = |c: usize| {
            if self.sigma_s[c] > 0.0 { sigma_t[c] } else { least }
        };
        Rgb::new(of(0), of(1), of(2))
    }

    /// Distance beyond which the transmittance of scattering channels is negligible.
    pub fn reach(&self) -> f32 {
        OPAQUE_DEPTH / self.least_sigma_t()
    }

    /// Samples where a photon of flux `power` scatters within `length` (which may be infinite). The distance is drawn
    /// for one channel, chosen in proportion to its flux, and weighted by the density over all channels.
    pub fn sample_flight(&self, power: Rgb, length: f32, u: [f32; 2]) -> Flight {
        let sigma_t = self.sigma_t();
        let share = power / (power.x + power.y + power.z);
        let channel = if u[0] < share.x {
            0
        } else if u[0] < share.x + share.y || share.z == 0.0 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::phase::Phase;

    /// The channels' shares may add up to slightly less than one. The rest must not go to a channel without light,
    /// which would fly on to where the others' density is zero.
    #[test]
    fn no_flight_is_drawn_for_a_channel_without_light() {
        let medium = Homogeneous {
            sigma_a: Rgb::ZERO,
            sigma_s: Rgb::new(2000.0, 1000.0, 1.0),
            phase: Phase::Isotropic,
        };
        let last = 1.0 - f32::EPSILON / 2.0;
        let mut short_of_one = 0;
        for i in 1..1000 {
            let power = Rgb::new(0.7 * i as f32, 1.3, 0.0);
            let share = power / power.element_sum();
            short_of_one += u32::from(share.x + share.y < 1.0);
            for length in [0.5, f32::INFINITY] {
                let flight = medium.sample_flight(power, length, [last, 0.9]);
                assert!(
                    matches!(flight, Flight::Scattered { weight, .. } if weight.is_finite()),
                    "{power}: {flight:?}"
                );
            }
        }
        assert!(short_of_one > 0);
    }
}
