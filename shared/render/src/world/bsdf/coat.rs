//! The coat over a principled surface: a clear coat of dielectric microfacets, or the coat lobe of Burley's model.

use super::energy::Layer;
use super::microfacet::{Facets, MIN_ALPHA};
use super::{BsdfFlags, Distribution, NormalPerturbation, half_vector};
use crate::math::{PI, Vec2, Vec3, exp, ln, sin_cos};
use crate::world::fresnel::{fresnel_dielectric, schlick_weight};
use crate::world::scalar::Scalar;
use crate::world::texture::TexturePoint;

/// A layer of varnish. Light that it reflects does not reach what lies below.
#[derive(Clone, Debug)]
pub struct ClearCoat {
    /// Share of the surface that is coated, from 0 to 1.
    pub weight: Scalar,
    /// From 0 to 1; its square is the roughness of its microfacets.
    pub roughness: Scalar,
    /// Index of refraction over the one outside, at least 1.
    pub eta: f32,
    /// Which way it faces.
    pub facing: CoatFacing,
}

/// Where the normal of a coat comes from.
#[derive(Clone, Debug)]
pub enum CoatFacing {
    /// From the layer below: a bump or normal map of the material turns both.
    Below,
    /// From the shape: the coat evens out bumps and normal maps below it.
    Shape,
    /// From a bump or normal map for the coat alone.
    Own(NormalPerturbation),
}

impl ClearCoat {
    /// The flags that a coat adds to its surface.
    pub(super) fn flags(&self) -> BsdfFlags {
        let alphas = self.roughness.range().map(|roughness| roughness * roughness);
        let turned = match &self.facing {
            CoatFacing::Own(map) => map.reads(),
            CoatFacing::Below | CoatFacing::Shape => BsdfFlags::empty(),
        };
        BsdfFlags::of_coat(alphas) | BsdfFlags::reading([self.weight.texture(), self.roughness.texture()]) | turned
    }
}

/// A coat, looked up at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coating {
    None,
    /// An additional lobe that takes nothing from the others (Burley 2012, appendix B.2, gamma = 1).
    Burley {
        weight: f32,
        alpha: f32,
    },
    /// See [`ClearCoat`].
    Clear {
        weight: f32,
        alpha: f32,
        eta: f32,
    },
}

/// Roughness of Burley's coat at gloss 0 and at gloss 1.
const BURLEY_ALPHAS: [f32; 2] = [0.1, 1e-3];
/// Roughness that Burley's coat uses for masking.
const BURLEY_MASKING: Facets = Facets {
    distribution: Distribution::Ggx,
    alpha: 0.25,
    aspect: 1.0,
};
/// Burley's coat is not sampled below this cosine at the microfacet: densities there are unbounded.
const LEAST_COSINE: f32 = 1e-6;

impl Coating {
    pub fn burley(weight: f32, gloss: f32) -> Self {
        let alpha = BURLEY_ALPHAS[0] * (1.0 - gloss) + BURLEY_ALPHAS[1] * gloss;
        match weight > 0.0 {
            true => Self::Burley { weight, alpha },
            false => Self::None,
        }
    }

    pub fn clear(coat: &ClearCoat, at: &TexturePoint) -> Self {
        let (weight, roughness) = (coat.weight.eval(at), coat.roughness.eval(at));
        match weight > 0.0 {
            true => Self::Clear {
                weight,
                alpha: (roughness * roughness).max(MIN_ALPHA),
                eta: coat.eta,
            },
            false => Self::None,
        }
    }

    pub fn is_some(&self) -> bool {
        !matches!(self, Self::None)
    }

    /// Roughness of the coat's lobe.
    pub fn alpha(&self) -> f32 {
        match *self {
            Self::None => 0.0,
            Self::Burley { alpha, .. } | Self::Clear { alpha, .. } => alpha,
        }
    }

    /// Paths follow Burley's coat at any roughness.
    pub fn is_narrow(&self, below: f32) -> bool {
        match *self {
            Self::None => false,
            Self::Burley { .. } => true,
            Self::Clear { alpha, .. } => alpha < below,
        }
    }

    /// The coat's first-bounce reflection. `below`: the index of the surface over the one outside.
    pub fn eval(&self, wo: Vec3, wi: Vec3, below: f32) -> f32 {
        let m = half_vector(wo, wi);
        let cos = wo.dot(m).abs();
        match *self {
            Self::None => 0.0,
            Self::Burley { weight, alpha } => {
                let masked = BURLEY_MASKING.g1(wo) * BURLEY_MASKING.g1(wi);
                0.25 * weight * burley_fresnel(cos, below) * masked * gtr1(alpha, m)
            }
            Self::Clear { weight, alpha, eta } => {
                weight * fresnel_dielectric(cos.min(1.0), eta).0 * facets(alpha).correlated(wo, wi, m)
            }
        }
    }

    /// Reflection of further bounces on the coat.
    pub fn further(&self, cosines: [f32; 2]) -> f32 {
        match *self {
            Self::Clear { weight, alpha, eta } => weight * Layer::of(facets(alpha), eta).returned(cosines),
            Self::None | Self::Burley { .. } => 0.0,
        }
    }

    /// Approximate reflectance for light at this cosine.
    pub fn odds(&self, cos: f32, below: f32) -> f32 {
        match *self {
            Self::None => 0.0,
            Self::Burley { weight, .. } => weight * burley_fresnel(cos, below),
            Self::Clear { weight, eta, .. } => weight * fresnel_dielectric(cos.min(1.0), eta).0,
        }
    }

    /// Share of light at this cosine that reaches the surface below.
    pub fn lets_in(&self, cos: f32) -> f32 {
        match *self {
            Self::Clear { weight, alpha, eta } => {
                let layer = Layer::of(facets(alpha), eta);
                1.0 - weight * layer.albedo(cos, layer.losses.at(cos))
            }
            Self::None | Self::Burley { .. } => 1.0,
        }
    }

    /// Share of diffuse light that reaches the surface below.
    fn lets_in_diffuse(&self) -> f32 {
        match *self {
            Self::Clear { weight, alpha, eta } => 1.0 - weight * Layer::of(facets(alpha), eta).mean_albedo(),
            Self::None | Self::Burley { .. } => 1.0,
        }
    }

    /// Factors on narrow and on wide scattering below the coat. Light that the coat reflects back inside returns, so
    /// that light is lost on only one of the two crossings. `layer`: what lies between the coat and the wide
    /// scattering.
    pub fn passed(&self, cosines: [f32; 2], layer: impl FnOnce() -> Layer) -> [f32; 2] {
        if !matches!(self, Self::Clear { .. }) {
            return [1.0; 2];
        }
        let [o, i] = cosines.map(|cos| self.lets_in(cos));
        let (through_coat, reflected) = (self.lets_in_diffuse(), layer().mean_albedo());
        // Both layers hold back diffuse light of mostly the same directions.
        let same = self.weight() * deviation((1.0 - through_coat) / self.weight()) * deviation(reflected);
        let together = through_coat + same / (1.0 - reflected).max(f32::MIN_POSITIVE);
        [o.min(i), o * i / together]
    }

    fn weight(&self) -> f32 {
        match *self {
            Self::None => 0.0,
            Self::Burley { weight, .. } | Self::Clear { weight, .. } => weight,
        }
    }

    /// For light that leaves on only one side of a surface: each crossing counts separately.
    pub fn crossed(&self, cos: f32) -> f32 {
        match self {
            Self::Clear { .. } => self.lets_in(cos) / self.lets_in_diffuse().max(f32::MIN_POSITIVE).sqrt(),
            Self::None | Self::Burley { .. } => 1.0,
        }
    }

    /// Density of [`Self::sample`], times the probability of sampling the coat. `m`: the half vector.
    pub fn pdf(&self, p: f32, wo: Vec3, m: Vec3) -> f32 {
        match *self {
            Self::None => 0.0,
            Self::Burley { alpha, .. } => match wo.dot(m) > LEAST_COSINE {
                true => p * gtr1(alpha, m) * m.z / (4.0 * wo.dot(m)),
                false => 0.0,
            },
            Self::Clear { alpha, .. } => p * facets(alpha).reflection_pdf(wo, m),
        }
    }

    /// A direction into which the coat reflects.
    pub fn sample(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        match *self {
            Self::None => None,
            Self::Burley { alpha, .. } => {
                let m = sample_gtr1(alpha, u);
                (wo.dot(m) > LEAST_COSINE).then(|| (m * (2.0 * wo.dot(m)) - wo).normalize())
            }
            Self::Clear { alpha, .. } => facets(alpha).sample_reflection(wo, u),
        }
    }
}

fn facets(alpha: f32) -> Facets {
    Facets::even(Distribution::Ggx, alpha)
}

/// Standard deviation, over diffuse light, of a smooth dielectric's reflectance, given its mean: a fit to indices from
/// 1.1 to 2.5, 3 to 15 % too high. Rough dielectrics have less.
fn deviation(mean: f32) -> f32 {
    mean.max(0.0).sqrt() * (0.5 - 1.4 * mean).max(0.0)
}

fn burley_fresnel(cos: f32, below: f32) -> f32 {
    let cos = match below < 1.0 {
        true => fresnel_dielectric(cos.min(1.0), below).1,
        false => cos,
    };
    let schlick = schlick_weight(cos);
    0.04 * (1.0 - schlick) + schlick
}

/// The microfacet distribution of Burley's coat.
#[inline]
fn gtr1(alpha: f32, m: Vec3) -> f32 {
    let alpha2 = alpha * alpha;
    // 1 + (alpha^2 - 1) cos^2, without cancellation.
    let sin2 = m.x * m.x + m.y * m.y;
    let t = sin2 + alpha2 * m.z * m.z;
    (alpha2 - 1.0) / (PI * ln(alpha2) * t)
}

/// A normal with the density `gtr1 cos`.
#[inline]
fn sample_gtr1(alpha: f32, u: Vec2) -> Vec3 {
    let alpha2 = alpha * alpha;
    let cos2 = ((1.0 - exp(ln(alpha2) * (1.0 - u.y))) / (1.0 - alpha2)).clamp(0.0, 1.0);
    let sin = (1.0 - cos2).sqrt();
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.x);
    Vec3::new(sin * cos_phi, sin * sin_phi, cos2.sqrt())
}
