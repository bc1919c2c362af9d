//! Rough metal: conductor microfacets, with one bounce or all of them.

use super::energy::Losses;
use super::microfacet::Facets;
use super::{BsdfSample, Distribution, half_vector, lit_side, reflects};
use crate::math::{Rgb, Vec2, Vec3, mean};
use crate::world::fresnel::fresnel_conductor;

/// Microfacet conductor, looked up at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughConductor {
    /// Distribution of its microfacets.
    pub distribution: Distribution,
    /// Roughness, at least 1e-3: the geometric mean of the roughness along x and across it.
    pub alpha: f32,
    /// Square root of (roughness across / roughness along); 1 where isotropic.
    pub aspect: f32,
    /// Real part of the index of refraction.
    pub eta: Rgb,
    /// Imaginary part.
    pub k: Rgb,
    /// Factor on the reflection.
    pub reflectance: Rgb,
    /// The conductor's reflectance for diffuse light, if light scatters among the microfacets more than once. None: one
    /// bounce only.
    pub mean_fresnel: Option<Rgb>,
    /// Reflects on both sides.
    pub two_sided: bool,
}

impl RoughConductor {
    fn facets(&self) -> Facets {
        Facets {
            distribution: self.distribution,
            alpha: self.alpha,
            aspect: self.aspect,
        }
    }

    fn fresnel(&self, cos: f32) -> Rgb {
        self.reflectance * fresnel_conductor(cos, self.eta, self.k)
    }

    /// Probability of sampling the microfacets, if light scatters more than once.
    fn probability(&self, losses: &Losses, mean_fresnel: Rgb, wo: Vec3) -> f32 {
        let (loss, cos) = (losses.towards(wo), wo.z.abs());
        let once = mean(self.fresnel(cos.min(1.0))) * (1.0 - loss);
        let more = mean(losses.further_bounces(self.reflectance * mean_fresnel)) * loss;
        match more > 0.0 {
            true => once / (once + more),
            false => 1.0,
        }
    }

    #[inline]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if !reflects(wo, wi, self.two_sided) {
            return Rgb::ZERO;
        }
        // Walter et al. 2007, eq. 20: F D G / (4 cos cos), with the cosines of G and of the denominator cancelled.
        let facets = self.facets();
        let m = half_vector(wo, wi);
        let fresnel = self.fresnel(wo.dot(m).abs());
        match self.mean_fresnel {
            None => fresnel * (facets.density(m) / (facets.extent(wo) * facets.extent(wi))),
            Some(mean_fresnel) => {
                let once = fresnel * facets.correlated(wo, wi, m);
                let losses = Losses::of(facets);
                let returned = losses.returned([wo, wi].map(|w| losses.towards(w)));
                once + losses.further_bounces(self.reflectance * mean_fresnel) * returned
            }
        }
    }

    #[inline]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !reflects(wo, wi, self.two_sided) {
            return 0.0;
        }
        let facets = self.facets();
        match self.mean_fresnel {
            None => facets.reflection_pdf(wo, half_vector(wo, wi)),
            Some(mean_fresnel) => {
                let p = self.probability(&Losses::of(facets), mean_fresnel, wo);
                facets.pdf_over_diffuse(p, wo, wi)
            }
        }
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let wo = wo * sign;
        if let Some(mean_fresnel) = self.mean_fresnel {
            return self.sample_all(wo, sign, mean_fresnel, u_lobe, u);
        }
        let facets = self.facets();
        let m = facets.sample_visible(wo, u);
        let cos_o = wo.dot(m);
        let wi = (m * (2.0 * cos_o) - wo).normalize();
        // Light that would need a second bounce among the facets is lost.
        (cos_o > 0.0 && wi.z > 0.0).then(|| BsdfSample {
            wi: wi * sign,
            weight: self.fresnel(cos_o) * facets.g1(wi),
            pdf: facets.density(m) / (2.0 * facets.extent(wo)),
            delta: false,
            transmitted: false,
        })
    }

    /// Samples the single-bounce and the multiple-bounce lobe. `wo` is on the front.
    fn sample_all(&self, wo: Vec3, sign: f32, mean_fresnel: Rgb, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let facets = self.facets();
        let p = self.probability(&Losses::of(facets), mean_fresnel, wo);
        let wi = facets.sample_over_diffuse(p, wo, u_lobe, u)?;
        BsdfSample::in_lobe(wo * sign, wi * sign, self.pdf(wo, wi), || self.eval(wo, wi))
    }
}
