//! A medium of constant density: every transmittance in closed form.

use crate::math::Rgb;
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

impl Homogeneous {
    /// Extinction, RGB, per scene unit.
    #[inline]
    pub fn sigma_t(&self) -> Rgb {
        self.sigma_a + self.sigma_s
    }
}
