//! A dielectric coat over a diffuse base, smooth or rough, in Mitsuba 3's form: light enters through the coat, bounces
//! between base and coat until it leaves, and its last bounce spreads it over all directions.

use super::microfacet::{Facets, MIN_ALPHA};
use super::{BsdfSample, Distribution, half_vector, lit_side, mirrored, reflects};
use crate::math::{Rgb, Vec2, Vec3, mean};
use crate::warp;
use crate::world::fresnel::{fresnel_dielectric, mean_fresnel};

/// A coat as its base sees it: how light comes back from between the two. A smooth coat is no more than that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    eta: f32,
    /// Share of the base's light that the coat sends back to the base.
    internal: f32,
    nonlinear: bool,
}

impl Coat {
    /// A smooth one. `eta`: index of refraction inside over the one outside. `nonlinear`: the bounces between base and
    /// coat take on the base's colour; otherwise they leave it unchanged.
    pub fn new(eta: f32, nonlinear: bool) -> Self {
        Self {
            eta,
            internal: mean_fresnel(1.0 / eta),
            nonlinear,
        }
    }

    /// Index of refraction inside over the one outside.
    pub fn eta(&self) -> f32 {
        self.eta
    }

    /// Share of the base's light that the coat sends back to the base.
    pub fn internal(&self) -> f32 {
        self.internal
    }

    /// Whether the bounces between base and coat take on the base's colour.
    pub fn is_nonlinear(&self) -> bool {
        self.nonlinear
    }

    /// The base's contribution without the coat's transmittances: pi times its value.
    fn base(&self, reflectance: Rgb) -> Rgb {
        let returned = match self.nonlinear {
            true => reflectance * self.internal,
            false => Rgb::splat(self.internal),
        };
        reflectance / ((Rgb::ONE - returned) * (self.eta * self.eta))
    }

    /// Albedo over [`Self::base`], for light that has entered.
    fn escape(&self) -> f32 {
        (1.0 - self.internal) * (self.eta * self.eta)
    }
}

/// A smooth coat over a diffuse base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    eta: f32,
    base: Rgb,
    specular: Rgb,
    /// Albedo over `base`, for light that has entered.
    escape: f32,
    two_sided: bool,
    /// Whether the coat's reflection is included, or only the base's scattering.
    mirrors: bool,
}

impl Plastic {
    pub(super) fn new(coat: &Coat, reflectance: Rgb, specular: Rgb, two_sided: bool) -> Self {
        Self {
            eta: coat.eta,
            base: coat.base(reflectance),
            specular,
            escape: coat.escape(),
            two_sided,
            mirrors: true,
        }
    }

    /// The base alone, still under its coat.
    pub(super) fn without_mirror(self) -> Self {
        Self { mirrors: false, ..self }
    }

    fn fresnel(&self, v: Vec3) -> f32 {
        fresnel_dielectric(v.z.abs().min(1.0), self.eta).0
    }

    pub(super) fn albedo(&self) -> Rgb {
        let fresnel = self.fresnel(Vec3::Z);
        self.specular * fresnel + self.base * (self.escape * (1.0 - fresnel))
    }

    /// Probability of sampling the coat's reflection.
    pub(super) fn mirror_probability(&self, wo: Vec3) -> f32 {
        if !self.mirrors || lit_side(wo, self.two_sided).is_none() {
            return 0.0;
        }
        let fresnel = self.fresnel(wo);
        let specular = fresnel * mean(self.specular);
        let diffuse = (1.0 - fresnel) * mean(self.base) * self.escape;
        if specular > 0.0 {
            specular / (specular + diffuse)
        } else {
            0.0
        }
    }

    #[inline(never)]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if !reflects(wo, wi, self.two_sided) {
            return Rgb::ZERO;
        }
        let entered = (1.0 - self.fresnel(wo)) * (1.0 - self.fresnel(wi));
        self.base * (entered * std::f32::consts::FRAC_1_PI)
    }

    #[inline(never)]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !reflects(wo, wi, self.two_sided) {
            return 0.0;
        }
        (1.0 - self.mirror_probability(wo)) * warp::cosine_hemisphere_pdf(wi.z.abs())
    }

    #[inline(never)]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let p = self.mirror_probability(wo);
        if u_lobe < p {
            let weight = self.specular * (self.fresnel(wo) / p);
            return Some(mirrored(wo, weight, p));
        }
        let wi = warp::cosine_hemisphere(u);
        let pdf = (1.0 - p) * warp::cosine_hemisphere_pdf(wi.z);
        let entered = (1.0 - self.fresnel(wo)) * (1.0 - self.fresnel(wi));
        (pdf > 0.0).then(|| BsdfSample {
            wi: wi * sign,
            weight: self.base * (entered / (1.0 - p)),
            pdf,
            delta: false,
            transmitted: false,
        })
    }
}

/// Number of cosines at which a rough coat's transmittance is stored.
const COSINES: usize = 64;

/// A rough coat.
#[derive(Clone, Debug)]
pub struct RoughCoat {
    facets: Facets,
    /// From outside to the base, over all microfacets, at cosines equidistant from 0 to 1.
    transmittance: [f32; COSINES],
    seen_from_base: Coat,
}

impl RoughCoat {
    /// `alpha`: roughness, at least 1e-3 (smaller values are raised to that). Otherwise as [`Coat::new`].
    pub fn new(distribution: Distribution, alpha: f32, eta: f32, nonlinear: bool) -> Self {
        let alpha = alpha.max(MIN_ALPHA);
        let facets = Facets::even(distribution, alpha);
        let cosine = |i: usize| (i as f32 / (COSINES - 1) as f32).max(1e-6);
        let few = gauss_legendre(32);
        let transmittance = std::array::from_fn(|i| through_facets(&facets, cosine(i), eta, true, &few));
        // Mitsuba's mean over the same cosines, with full weight at the ends: a few per cent below the integral.
        let many = gauss_legendre(64);
        let reflected = |i| through_facets(&facets, cosine(i), 1.0 / eta, false, &many) * cosine(i);
        let internal = 2.0 * (0..COSINES).map(reflected).sum::<f32>() / COSINES as f32;
        Self {
            facets,
            transmittance,
            seen_from_base: Coat {
                eta,
                internal,
                nonlinear,
            },
        }
    }

    /// Roughness of its microfacets.
    pub fn alpha(&self) -> f32 {
        self.facets.alpha
    }

    /// Their distribution.
    pub fn distribution(&self) -> Distribution {
        self.facets.distribution
    }

    /// How light comes back from between the coat and its base.
    pub fn seen_from_base(&self) -> &Coat {
        &self.seen_from_base
    }

    /// Share of the light from outside that reaches the base, at cosines equidistant from 0 to 1.
    pub fn transmittances(&self) -> &[f32] {
        &self.transmittance
    }

    fn transmittance(&self, cos: f32) -> f32 {
        let x = cos * (COSINES - 1) as f32;
        let i = (x as usize).min(COSINES - 2);
        let fraction = x - i as f32;
        self.transmittance[i] * (1.0 - fraction) + self.transmittance[i + 1] * fraction
    }
}

/// Share of the light from a direction at `cos` that a rough boundary with relative index `eta` transmits or reflects
/// in one bounce. `rule`: nodes and weights for the two numbers that visible normals are drawn from.
fn through_facets(facets: &Facets, cos: f32, eta: f32, transmitted: bool, rule: &[(f32, f32)]) -> f32 {
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for &(x, weight_x) in rule {
        for &(y, weight_y) in rule {
            let m = facets.sample_visible(wo, Vec2::new(x, y));
            let cos_o = wo.dot(m).clamp(0.0, 1.0);
            let (fresnel, cos_t) = fresnel_dielectric(cos_o, eta);
            let (wi, share) = match transmitted {
                true => (wo / eta - m * (cos_o / eta - cos_t), 1.0 - fresnel),
                false => (m * (2.0 * cos_o) - wo, fresnel),
            };
            if wi.z > 0.0 {
                sum += weight_x * weight_y * share * facets.g1(wi);
            }
        }
    }
    sum
}

/// Nodes and weights of Gauss's rule on [0, 1], by Newton's method on Legendre's polynomial.
fn gauss_legendre(n: u32) -> Vec<(f32, f32)> {
    let node = |i: u32| {
        let mut x = libm::cos(std::f64::consts::PI * (f64::from(i) + 0.75) / (f64::from(n) + 0.5));
        let mut derivative = 1.0;
        for _ in 0..8 {
            let (mut p, mut before) = (x, 1.0);
            for k in 2..=n {
                let k = f64::from(k);
                (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
            }
            derivative = f64::from(n) * (x * p - before) / (x * x - 1.0);
            x -= p / derivative;
        }
        let weight = 1.0 / ((1.0 - x * x) * derivative * derivative);
        ((0.5 * (x + 1.0)) as f32, weight as f32)
    };
    (0..n).map(node).collect()
}

/// A rough coat over a diffuse base.
#[derive(Clone, Copy, Debug)]
pub struct RoughPlastic<'a> {
    coat: &'a RoughCoat,
    base: Rgb,
    specular: Rgb,
    two_sided: bool,
}

impl PartialEq for RoughPlastic<'_> {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.coat, other.coat)
            && (self.base, self.specular, self.two_sided) == (other.base, other.specular, other.two_sided)
    }
}

impl<'a> RoughPlastic<'a> {
    pub(super) fn new(coat: &'a RoughCoat, reflectance: Rgb, specular: Rgb, two_sided: bool) -> Self {
        Self {
            coat,
            base: coat.seen_from_base.base(reflectance),
            specular,
            two_sided,
        }
    }

    #[inline(never)]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if !reflects(wo, wi, self.two_sided) {
            return Rgb::ZERO;
        }
        let facets = &self.coat.facets;
        let m = half_vector(wo, wi);
        let fresnel = fresnel_dielectric(wo.dot(m).abs().min(1.0), self.coat.seen_from_base.eta).0;
        let d = facets.density(m) / (facets.extent(wo) * facets.extent(wi));
        let entered = self.coat.transmittance(wo.z.abs()) * self.coat.transmittance(wi.z.abs());
        self.specular * (fresnel * d) + self.base * (entered * std::f32::consts::FRAC_1_PI)
    }

    pub(super) fn albedo(&self) -> Rgb {
        let transmitted = self.coat.transmittance(1.0);
        let escape = self.coat.seen_from_base.escape();
        self.specular * (1.0 - transmitted) + self.base * (escape * transmitted)
    }

    pub(super) fn alpha(&self) -> f32 {
        self.coat.alpha()
    }

    /// Whether the base counts.
    pub(super) fn has_base(&self) -> bool {
        self.base != Rgb::ZERO
    }

    /// The same with a factor on the base's scattering.
    pub(super) fn with_base_lit(self, factor: f32) -> Self {
        let base = self.base * factor;
        Self { base, ..self }
    }

    /// The coat's reflection, and the base under the coat.
    pub(super) fn lobes(self) -> [Self; 2] {
        let (base, specular) = (Rgb::ZERO, Rgb::ZERO);
        [Self { base, ..self }, Self { specular, ..self }]
    }

    /// Probability of sampling the coat's reflection.
    pub(super) fn specular_probability(&self, wo: Vec3) -> f32 {
        let transmitted = self.coat.transmittance(wo.z.abs());
        let specular = (1.0 - transmitted) * mean(self.specular);
        let diffuse = transmitted * mean(self.base);
        match (specular > 0.0, diffuse > 0.0) {
            (true, true) => specular / (specular + diffuse),
            (true, false) => 1.0,
            (false, _) => 0.0,
        }
    }

    #[inline(never)]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !reflects(wo, wi, self.two_sided) {
            return 0.0;
        }
        let p = self.specular_probability(wo);
        self.coat.facets.pdf_over_diffuse(p, wo, wi)
    }

    #[inline(never)]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let wo = wo * sign;
        let p = self.specular_probability(wo);
        let wi = self.coat.facets.sample_over_diffuse(p, wo, u_lobe, u)?;
        BsdfSample::in_lobe(wo * sign, wi * sign, self.pdf(wo, wi), || self.eval(wo, wi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_is_exact_for_polynomials() {
        for n in [2, 5, 32, 64] {
            let rule = gauss_legendre(n);
            for power in [0, 1, 3] {
                let term = |(x, w): &(f32, f32)| f64::from(*w) * libm::pow(f64::from(*x), f64::from(power));
                let sum: f64 = rule.iter().map(term).sum();
                let exact = 1.0 / f64::from(power + 1);
                assert!((sum - exact).abs() < 1e-6, "{n} {power}: {sum}");
            }
        }
    }

    #[test]
    fn an_almost_smooth_coat_is_the_smooth_one() {
        let rough = RoughCoat::new(Distribution::Beckmann, 1e-3, 1.5, false);
        for cos in [0.2, 0.5, 0.77, 1.0] {
            let smooth = 1.0 - fresnel_dielectric(cos, 1.5).0;
            let value = rough.transmittance(cos);
            assert!((value - smooth).abs() < 2e-3, "{cos}: {value} {smooth}");
        }
    }
}
