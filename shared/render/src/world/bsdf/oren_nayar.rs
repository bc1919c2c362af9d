//! Rough diffuse surfaces: the Oren-Nayar model in Y. Fujii's form (A tiny improvement of Oren-Nayar reflectance model,
//! 2012), with its lost light restored by further bounces (J. Portsmouth, P. Kutz, S. Hill, EON: A practical
//! energy-preserving rough diffuse BRDF, 2024). A white surface is white.
//!
//! As in Cycles, the further bounces have one more factor of the reflectance than in that paper.

use super::{BsdfSample, lit_side, reflects};
use crate::math::{PI, Rgb, Vec2, Vec3, acos};
use crate::warp;
use std::f32::consts::FRAC_1_PI;

/// Parameters at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrenNayar {
    /// Colour, in [0, 1].
    pub reflectance: Rgb,
    /// From 0, Lambertian, to 1.
    pub roughness: f32,
    /// Reflects on both sides.
    pub two_sided: bool,
}

impl OrenNayar {
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        match reflects(wo, wi, self.two_sided) {
            true => value(self.reflectance, self.roughness, wo, wi),
            false => Rgb::ZERO,
        }
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match reflects(wo, wi, self.two_sided) {
            true => warp::cosine_hemisphere_pdf(wi.z.abs()),
            false => 0.0,
        }
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let wi = warp::cosine_hemisphere(u) * sign;
        BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi))
    }
}

/// Value for two directions on one side; reciprocal.
pub(super) fn value(color: Rgb, roughness: f32, wo: Vec3, wi: Vec3) -> Rgb {
    // Fujii's A over pi, and B over A.
    let (a, b) = (1.0 / (PI + roughness * (0.5 * PI - 2.0 / 3.0)), roughness);
    let cosines = [wo.z.abs(), wi.z.abs()];
    let in_plane = wo.x * wi.x + wo.y * wi.y;
    let t = match in_plane > 0.0 {
        true => in_plane / cosines[0].max(cosines[1]).max(f32::MIN_POSITIVE),
        false => in_plane,
    };
    let single = (a * (1.0 + b * t)).max(0.0);
    let mean = a * (PI + b * (2.0 * PI - 5.6) / 3.0);
    let lost = cosines.map(|cos| (1.0 - a * (PI + b * shape(cos))).max(0.0));
    // Lambertian surfaces lose nothing.
    let returned = lost[0] * lost[1] / (1.0 - mean).max(f32::MIN_POSITIVE) * (mean * FRAC_1_PI);
    let further = color * color / (Rgb::ONE - color * (1.0 - mean)).max(Rgb::splat(f32::MIN_POSITIVE));
    color * (Rgb::splat(single) + further * returned)
}

/// Albedo of Fujii's second term, over B: G of Portsmouth et al., without its quotient of terms that vanish at grazing
/// angles.
fn shape(cos: f32) -> f32 {
    let cos = cos.min(1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let product = sin * cos;
    sin * (acos(cos) - 2.0 / 3.0 - product) + 2.0 / 3.0 * product * (1.0 + sin + sin * sin) / (1.0 + sin)
}
