//! Subsurface scattering: light sinks into a medium beneath the surface, scatters there, and leaves elsewhere. This is
//! the surface's part of it. The medium is one of the scene, and paths or beams carry light in it as in any other.
//!
//! The boundary is diffuse both ways, as in the random walks of production renderers (Chiang, Kutz and Burley 2016,
//! Practical and Controllable Subsurface Scattering for Production Path Tracing): light leaves uniformly to all
//! directions of the other side, apart from reflection by the outer interface, and nothing is reflected back inside.

use crate::math::{Rgb, Vec3};
use crate::world::fresnel::mean_fresnel;
use crate::world::medium::Homogeneous;
use crate::world::phase::Phase;
use crate::world::scalar::Scalar;
use crate::world::texture::TexturePoint;

/// Light that sinks in.
#[derive(Clone, Debug)]
pub struct Subsurface {
    /// Share of the light that would otherwise scatter diffusely, in [0, 1].
    pub weight: Scalar,
    /// Reflectance of the medium under uniform illumination, each channel above 0: the visible colour if neither
    /// crossing of the surface tints light.
    pub reflectance: Rgb,
    /// Transport mean free path without absorption, 1 / (sigma_t (1 - g)), per channel, above 0, scene units.
    pub radius: Rgb,
    /// Mean cosine of the medium's phase function, in (-1, 1).
    pub g: f32,
    /// One over the square root of the interface's transmittance for light from all sides.
    spread: f32,
}

/// The same, looked up at a hit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Beneath {
    pub weight: f32,
    /// Pi times the value, without the interface's transmittance. Above 1 where the surface is brighter than the
    /// medium: light crosses it twice.
    pub amplitude: Rgb,
    /// One over the square root of a smooth interface's transmittance for light from all sides.
    pub spread: f32,
}

impl Subsurface {
    /// `eta`: index of the interface, inside over outside.
    pub fn new(weight: Scalar, reflectance: Rgb, (radius, g): (Rgb, f32), eta: f32) -> Self {
        Self {
            weight,
            reflectance,
            radius,
            g,
            spread: 1.0 / (1.0 - mean_fresnel(eta)).sqrt(),
        }
    }

    /// The medium beneath: under a flat, diffuse surface lit from all sides, it reflects the given reflectance.
    ///
    /// Uses van de Hulst's formula for spherical albedos (1980, Multiple Light Scattering, quoted in d'Eon, A
    /// Hitchhiker's Guide to Multiple Scattering, eq. 53.7), accurate within 0.01.
    pub fn medium(&self) -> Homogeneous {
        let albedo = |a: f32| {
            let a = a.clamp(0.0, 1.0);
            let s = 4.09712 + 4.20863 * a - (9.59217 + 41.6808 * a + 17.7126 * a * a).sqrt();
            ((1.0 - s * s) / (1.0 - self.g * s * s)).clamp(0.0, 1.0)
        };
        let asked = self.reflectance;
        let albedo = Rgb::new(albedo(asked.x), albedo(asked.y), albedo(asked.z));
        let sigma_t = (self.radius * (1.0 - self.g)).recip();
        Homogeneous {
            sigma_a: sigma_t * (Rgb::ONE - albedo),
            sigma_s: sigma_t * albedo,
            phase: match self.g == 0.0 {
                true => Phase::Isotropic,
                false => Phase::HenyeyGreenstein { g: self.g },
            },
        }
    }

    /// `scale`: the share that is not metal. Each crossing takes the square root of the surface's share and colour, so
    /// that light and camera may change places.
    pub(super) fn at(&self, color: Rgb, scale: f32, at: &TexturePoint) -> Beneath {
        let weight = self.weight.eval(at);
        let share = color / self.reflectance * (weight * scale);
        Beneath {
            weight,
            amplitude: Vec3::new(share.x.sqrt(), share.y.sqrt(), share.z.sqrt()),
            spread: self.spread,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::ln;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;

    fn beneath(reflectance: Rgb, radius: Rgb, g: f32) -> Homogeneous {
        Subsurface::new(Scalar::constant(1.0), reflectance, (radius, g), 1.0).medium()
    }

    /// Share of cosine-distributed walks from a plane that return to it; and its standard error.
    fn sent_back(medium: &Homogeneous, channel: usize, walks: u32) -> [f64; 2] {
        let [sigma_s, sigma_t] = [medium.sigma_s, medium.sigma_t()].map(|rgb| rgb[channel]);
        let mut sums = [0.0f64; 2];
        let mut sampler = Sampler::new(7, 0, Purpose::Photons, 0);
        for _ in 0..walks {
            let mut dir = warp::cosine_hemisphere(sampler.next_2d());
            let (mut depth, mut weight) = (0.0f32, 1.0f32);
            loop {
                depth += dir.z * -ln(1.0 - sampler.next_1d()) / sigma_t;
                if depth <= 0.0 {
                    break;
                }
                weight *= sigma_s / sigma_t;
                if weight < 0.05 {
                    if sampler.next_1d() > 0.25 {
                        weight = 0.0;
                        break;
                    }
                    weight *= 4.0;
                }
                dir = medium.phase.sample(dir, sampler.next_2d());
            }
            sums[0] += f64::from(weight);
            sums[1] += f64::from(weight) * f64::from(weight);
        }
        let n = f64::from(walks);
        let mean = sums[0] / n;
        [mean, ((sums[1] / n - mean * mean) / n).sqrt()]
    }

    #[test]
    fn the_medium_sends_back_what_was_asked_for() {
        for g in [0.0f32, 0.5, 0.8, -0.4] {
            for asked in [0.05f32, 0.2, 0.5, 0.8, 0.95] {
                let medium = beneath(Rgb::splat(asked), Rgb::splat(0.3), g);
                let [found, error] = sent_back(&medium, 0, 4000);
                let off = (found - f64::from(asked)).abs();
                // Four standard errors, plus the formula's error.
                assert!(off < 4.0 * error + 0.01, "g {g}: {found} +- {error}, not {asked}");
            }
        }
        let white = beneath(Rgb::ONE, Rgb::ONE, 0.0);
        assert!(white.sigma_a.abs().max_element() < 1e-4, "{white:?}");
    }

    #[test]
    fn radii_are_the_mean_free_paths_of_transport() {
        let radius = Rgb::new(1.0, 0.2, 0.1);
        for g in [0.0f32, 0.8] {
            let medium = beneath(Rgb::splat(0.7), radius, g);
            let reduced = medium.sigma_t() * (1.0 - g);
            assert!((reduced * radius - Rgb::ONE).abs().max_element() < 1e-5);
        }
    }
}
