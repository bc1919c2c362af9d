//! Distributions of microfacet normals, isotropic or stretched along x. Facets with two roughnesses are those of their
//! geometric mean, stretched (Heitz 2014, Understanding the masking-shadowing function, section 5.4).
//!
//! All functions take directions in the local frame. Masking and shadowing are Smith's, uncorrelated unless noted: G =
//! G1(wo) G1(wi).

use super::{beckmann, ggx, half_vector};
use crate::math::{Vec2, Vec3};
use crate::warp;

/// Lower roughness would cost single precision its digits.
pub(super) const MIN_ALPHA: f32 = 1e-3;

/// Keeps values finite where both directions lie in the surface.
const LEAST_BELOW: f32 = 1e-12;

/// The statistics of a rough surface's slopes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Distribution {
    /// Trowbridge and Reitz's, with long tails.
    #[default]
    Ggx,
    /// Gaussian slopes.
    Beckmann,
}

/// A distribution with a roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Facets {
    pub distribution: Distribution,
    /// Roughness, at least [`MIN_ALPHA`]: the geometric mean of the roughness along x and across it.
    pub alpha: f32,
    /// Square root of (roughness across / roughness along); 1 where isotropic. Neither roughness is below
    /// [`MIN_ALPHA`].
    pub aspect: f32,
}

impl Facets {
    /// One roughness in all directions.
    #[inline]
    pub fn even(distribution: Distribution, alpha: f32) -> Self {
        Self {
            distribution,
            alpha,
            aspect: 1.0,
        }
    }

    /// The vector with its x multiplied by this and its y divided by it.
    #[inline]
    fn drawn(&self, v: Vec3, by: f32) -> Vec3 {
        Vec3::new(v.x * by, v.y / by, v.z)
    }

    /// A direction as isotropic facets of the same mean roughness meet it; not normalised.
    #[inline]
    fn drawn_out(&self, v: Vec3) -> Vec3 {
        match self.is_even() {
            true => v,
            false => self.drawn(v, 1.0 / self.aspect),
        }
    }

    /// Isotropic.
    #[inline]
    pub fn is_even(&self) -> bool {
        self.aspect == 1.0
    }

    /// Roughness in the plane of the normal and a direction.
    pub fn alpha_towards(&self, v: Vec3) -> f32 {
        let (x, y) = (v.x / self.aspect, v.y * self.aspect);
        let length2 = v.x * v.x + v.y * v.y;
        match length2 > 0.0 {
            true => self.alpha * ((x * x + y * y) / length2).sqrt(),
            false => self.alpha,
        }
    }

    /// D(m) in 1/sr for a unit normal with `m.z >= 0`.
    #[inline]
    pub fn density(&self, m: Vec3) -> f32 {
        let m = match self.is_even() {
            true => m,
            false => self.drawn(m, self.aspect),
        };
        match self.distribution {
            Distribution::Ggx => ggx::density(self.alpha, m),
            Distribution::Beckmann => beckmann::density(self.alpha, m),
        }
    }

    /// The number with `G1(v) = 2 |z| / extent(v)`. At least about half of `alpha`, so that the cosines in the
    /// microfacet formulas cancel and nothing is infinite at grazing angles.
    #[inline]
    pub fn extent(&self, v: Vec3) -> f32 {
        let v = self.drawn_out(v);
        match self.distribution {
            Distribution::Ggx => ggx::extent(self.alpha, v),
            Distribution::Beckmann => beckmann::extent(self.alpha, v),
        }
    }

    /// Smith's masking of the side that `v` is on.
    #[inline]
    pub fn g1(&self, v: Vec3) -> f32 {
        2.0 * v.z.abs() / self.extent(v)
    }

    /// A normal visible from `wo`, `wo.z > 0`, with density `G1(wo) max(0, wo . m) D(m) / wo.z` per solid angle.
    #[inline]
    pub fn sample_visible(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let seen = self.drawn_out(wo);
        let m = match self.distribution {
            Distribution::Ggx => ggx::sample_visible(self.alpha, seen, u),
            Distribution::Beckmann => beckmann::sample_visible(self.alpha, seen, u),
        };
        match self.is_even() {
            true => m,
            false => self.drawn_out(m).normalize(),
        }
    }

    /// The direction into which a visible normal reflects `wo`, `wo.z > 0`. None: the light would need a second bounce.
    #[inline]
    pub fn sample_reflection(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let m = self.sample_visible(wo, u);
        let cos_o = wo.dot(m);
        let wi = (m * (2.0 * cos_o) - wo).normalize();
        (cos_o > 0.0 && wi.z > 0.0).then_some(wi)
    }

    /// `D G / (4 cos cos)` for the half vector `m`, with height-correlated masking and shadowing of directions on the
    /// same side: less light is lost (Heitz 2014, Understanding the masking-shadowing function, eq. 99).
    #[inline]
    pub fn correlated(&self, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
        let (o, i) = (wo.z.abs(), wi.z.abs());
        let below = 2.0 * (self.extent(wo) * i + self.extent(wi) * o - 2.0 * o * i);
        self.density(m) / below.max(LEAST_BELOW)
    }

    /// Density of [`Self::sample_reflection`] with the half vector `m`.
    #[inline]
    pub fn reflection_pdf(&self, wo: Vec3, m: Vec3) -> f32 {
        self.density(m) / (2.0 * self.extent(wo))
    }

    /// Facets over a diffuse lobe: a direction, if the facets are chosen with the probability `p`. `wo.z > 0`; `u_lobe`
    /// chooses the lobe. None: the light would need a second bounce.
    #[inline]
    pub fn sample_over_diffuse(&self, p: f32, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<Vec3> {
        match u_lobe < p {
            true => self.sample_reflection(wo, u),
            false => Some(warp::cosine_hemisphere(u)),
        }
    }

    /// Density of [`Self::sample_over_diffuse`], for directions on the same side.
    #[inline]
    pub fn pdf_over_diffuse(&self, p: f32, wo: Vec3, wi: Vec3) -> f32 {
        p * self.reflection_pdf(wo, half_vector(wo, wi)) + (1.0 - p) * warp::cosine_hemisphere_pdf(wi.z.abs())
    }
}
