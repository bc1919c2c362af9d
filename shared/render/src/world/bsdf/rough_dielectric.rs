//! Rough boundary between dielectrics: Walter et al. 2007 with visible normals (Heitz & d'Eon 2014), with one bounce or
//! with compensation for further ones.

use super::dielectric::radiance_scale;
use super::energy::GlassAlbedo;
use super::microfacet::Facets;
use super::{BsdfSample, Distribution, TransportMode};
use crate::math::{Rgb, Vec2, Vec3};
use crate::world::fresnel::fresnel_dielectric;

/// Indices of refraction closer than this do not scatter: light goes on within 1e-4 rad, and half vectors lose their
/// digits.
pub(super) const MIN_CONTRAST: f32 = 1e-4;

/// A rough dielectric boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughDielectric {
    /// Distribution of its microfacets.
    pub distribution: Distribution,
    /// Roughness, at least 1e-3: the geometric mean of the roughness along x and across it.
    pub alpha: f32,
    /// Square root of (roughness across / roughness along); 1 where isotropic.
    pub aspect: f32,
    /// Index of refraction inside over the one outside, not 1.
    pub eta: f32,
    /// Factor on the reflection.
    pub reflectance: Rgb,
    /// Factor on the transmission.
    pub transmittance: Rgb,
    /// Share of light left after a bounce, if it scatters among the microfacets more than once. None: one bounce only.
    pub kept: Option<Rgb>,
}

/// Two directions and the microfacet that takes one to the other. Everything is turned through the origin so that
/// `wo.z > 0`, which facets do not notice.
struct Facet {
    wo: Vec3,
    wi: Vec3,
    m: Vec3,
    /// Cosines to the microfacet, positive.
    cos_o: f32,
    cos_i: f32,
    reflectance: f32,
    reflection: bool,
    /// Index of refraction on the other side over the one on `wo`'s side.
    eta: f32,
}

impl Facet {
    /// Density of `wi` over that of `m`, for refraction: Walter et al. 2007, eq. 17. The length of the half vector,
    /// `|cos_o - eta cos_i|`, equals `|1 - eta^2| / (cos_o + eta cos_i)` by Snell's law, which does not cancel.
    fn refraction_jacobian(&self) -> f32 {
        let h = (1.0 - self.eta) * (1.0 + self.eta) / (self.cos_o + self.eta * self.cos_i);
        self.eta * self.eta * self.cos_i / (h * h)
    }
}

impl RoughDielectric {
    fn facets(&self) -> Facets {
        Facets {
            distribution: self.distribution,
            alpha: self.alpha,
            aspect: self.aspect,
        }
    }

    /// The relative index seen from the side of `wo`, and the sign that turns it up.
    #[inline]
    fn side(&self, wo: Vec3) -> (f32, f32) {
        if wo.z > 0.0 {
            (1.0, self.eta)
        } else {
            (-1.0, 1.0 / self.eta)
        }
    }

    #[inline]
    fn facet(&self, wo: Vec3, wi: Vec3) -> Option<Facet> {
        let (sign, eta) = self.side(wo);
        let (wo, wi) = (wo * sign, wi * sign);
        if wo.z <= 0.0 || wi.z == 0.0 {
            return None;
        }
        let reflection = wi.z > 0.0;
        let h = if reflection { wo + wi } else { wo + wi * eta };
        let length2 = h.length_squared();
        if length2 <= 0.0 {
            return None;
        }
        let m = h / (if h.z < 0.0 { -length2.sqrt() } else { length2.sqrt() });
        let cos_o = wo.dot(m);
        let cos_i = if reflection { wi.dot(m) } else { -wi.dot(m) };
        // No direction sees the back of a microfacet.
        if cos_o <= 0.0 || cos_i <= 0.0 {
            return None;
        }
        Some(Facet {
            wo,
            wi,
            m,
            cos_o,
            cos_i,
            reflectance: fresnel_dielectric(cos_o, eta).0,
            reflection,
            eta,
        })
    }

    /// Cosine of incidence at the microfacet that takes one direction to the other.
    pub(super) fn cos_of_facet(&self, wo: Vec3, wi: Vec3) -> Option<f32> {
        self.facet(wo, wi).map(|facet| facet.cos_o)
    }

    /// Walter et al. 2007, eq. 20 and 21, with the cosines of G and of the denominators cancelled.
    #[inline]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        let Some(f) = self.facet(wo, wi) else {
            return Rgb::ZERO;
        };
        let (d, brightened) = match self.kept {
            Some(kept) => self.masked_by_height(&f, kept, mode),
            None => {
                let masked = self.facets().extent(f.wo) * self.facets().extent(f.wi);
                (self.facets().density(f.m) / masked, Rgb::ONE)
            }
        };
        if f.reflection {
            self.reflectance * brightened * (f.reflectance * d)
        } else {
            let scale = radiance_scale(f.eta, mode);
            let through = 4.0 * scale * (1.0 - f.reflectance) * d * f.cos_o * f.refraction_jacobian();
            self.transmittance * brightened * through
        }
    }

    /// `D G / (4 cos cos)` of the facet, and its brightening factor.
    #[inline(never)]
    fn masked_by_height(&self, f: &Facet, kept: Rgb, mode: TransportMode) -> (f32, Rgb) {
        let facets = self.facets();
        let camera = mode.towards_camera(f.wo, f.wi);
        let brightened = GlassAlbedo::of(facets, f.eta).brightened(camera, kept);
        (facets.correlated(f.wo, f.wi, f.m), brightened)
    }

    #[inline]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.facet(wo, wi).map_or(0.0, |f| self.facet_pdf(&f))
    }

    /// Density of the visible normal, times the probability of its lobe, times the Jacobian of wi over m.
    #[inline]
    fn facet_pdf(&self, f: &Facet) -> f32 {
        let d = self.facets().density(f.m) / self.facets().extent(f.wo);
        if f.reflection {
            0.5 * f.reflectance * d
        } else {
            2.0 * (1.0 - f.reflectance) * d * f.cos_o * f.refraction_jacobian()
        }
    }

    /// Share of light left of what a visible facet sends on.
    #[inline]
    fn left(&self, f: &Facet, mode: TransportMode) -> Rgb {
        match self.kept {
            Some(kept) => {
                let (d, brightened) = self.masked_by_height(f, kept, mode);
                let drawn = self.facets().density(f.m) / (2.0 * self.facets().extent(f.wo));
                brightened * (d * f.wi.z.abs() / drawn.max(f32::MIN_POSITIVE))
            }
            None => Rgb::splat(self.facets().g1(f.wi)),
        }
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        let (sign, eta) = self.side(wo);
        let wo = wo * sign;
        if wo.z <= 0.0 {
            return None;
        }
        let m = self.facets().sample_visible(wo, u);
        let cos_o = wo.dot(m);
        if cos_o <= 0.0 {
            return None;
        }
        let (reflectance, cos_t) = fresnel_dielectric(cos_o, eta);
        let reflection = u_lobe < reflectance;
        let wi = if reflection {
            m * (2.0 * cos_o) - wo
        } else {
            m * (cos_o / eta - cos_t) - wo / eta
        }
        .normalize();
        // Light that would need a second bounce among the facets is lost.
        if (wi.z > 0.0) != reflection || wi.z == 0.0 {
            return None;
        }
        let tint = if reflection {
            self.reflectance
        } else {
            self.transmittance * radiance_scale(eta, mode)
        };
        let facet = Facet {
            wo,
            wi,
            m,
            cos_o,
            cos_i: if reflection { cos_o } else { cos_t },
            reflectance,
            reflection,
            eta,
        };
        let pdf = self.facet_pdf(&facet);
        (pdf > 0.0).then(|| BsdfSample {
            wi: wi * sign,
            weight: tint * self.left(&facet, mode),
            pdf,
            delta: false,
            transmitted: !reflection,
        })
    }
}
