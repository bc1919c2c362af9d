//! Diffuse on both sides: each side reflects and transmits uniformly in all directions (Lambertian).

use super::BsdfSample;
use crate::math::{PI, Rgb, Vec2, Vec3, mean};
use crate::warp;

/// Shares of light, whose sum is at most 1 in each channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Translucent {
    /// Reflected.
    pub reflectance: Rgb,
    /// Transmitted.
    pub transmittance: Rgb,
}

impl Translucent {
    /// Both shares, scaled down where together they would gain energy.
    pub fn new(reflectance: Rgb, transmittance: Rgb) -> Self {
        let most = (reflectance + transmittance).max_element().max(1.0);
        Self {
            reflectance: reflectance / most,
            transmittance: transmittance / most,
        }
    }

    /// Probability that scattered light is transmitted.
    fn share_through(&self) -> f32 {
        let [back, through] = [mean(self.reflectance), mean(self.transmittance)];
        if back + through > 0.0 {
            through / (back + through)
        } else {
            0.0
        }
    }

    fn goes_through(wo: Vec3, wi: Vec3) -> bool {
        wo.z * wi.z < 0.0
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        match Self::goes_through(wo, wi) {
            true => self.transmittance / PI,
            false => self.reflectance / PI,
        }
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let share = self.share_through();
        let share = if Self::goes_through(wo, wi) { share } else { 1.0 - share };
        share * warp::cosine_hemisphere_pdf(wi.z.abs())
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let share = self.share_through();
        let transmitted = u_lobe < share;
        let (value, share) = match transmitted {
            true => (self.transmittance, share),
            false => (self.reflectance, 1.0 - share),
        };
        let wi = warp::cosine_hemisphere(u);
        let pdf = share * warp::cosine_hemisphere_pdf(wi.z);
        let side = if (wo.z < 0.0) != transmitted { -1.0 } else { 1.0 };
        (pdf > 0.0).then(|| BsdfSample {
            wi: wi * side,
            weight: value / share,
            pdf,
            delta: false,
            transmitted,
        })
    }
}
