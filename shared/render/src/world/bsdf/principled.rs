//! The principled BSDF (Burley 2012) in Mitsuba 3's form, reduced to a diffuse lobe with retro-reflection and a GGX
//! lobe between dielectric and metal.

use super::coat::ClearCoat;
use super::energy::{Layer, mean_of_schlick};
use super::film::ThinFilm;
use super::microfacet::{Facets, MIN_ALPHA};
use super::microfibers::Fuzz;
use super::{BsdfFlags, BsdfSample, Distribution, Subsurface, half_vector, lit_side, reflects};
use crate::math::{Rgb, Vec2, Vec3, mean};
use crate::world::fresnel::{fresnel_dielectric, schlick_weight};
use crate::world::scalar::Scalar;
use crate::world::texture::{Texture, TexturePoint};

/// What the interface of a principled surface reflects.
#[derive(Clone, Debug)]
pub enum Interface {
    /// By the index of refraction inside over the one outside.
    Eta(f32),
    /// By the reflectance at normal incidence over 0.08, from 0 to 1.
    Specular(Scalar),
}

impl Interface {
    /// The index of refraction inside over the one outside.
    #[inline]
    pub fn eta(&self, at: &TexturePoint) -> f32 {
        match self {
            Self::Eta(eta) => *eta,
            Self::Specular(specular) => 2.0 / (1.0 - (0.08 * specular.eval(at)).max(0.0).sqrt()) - 1.0,
        }
    }

    /// The same for a surface that transmits light, whose sides must differ: with nearly equal indices, half vectors
    /// lose their digits.
    pub fn eta_of_glass(&self) -> f32 {
        let eta = self.eta(&TexturePoint::default());
        match eta >= 1.0 {
            true => eta.max(1.0 + LEAST_CONTRAST),
            false => eta.min(1.0 - LEAST_CONTRAST),
        }
    }

    pub(super) fn reads(&self) -> BsdfFlags {
        match self {
            Self::Eta(_) => BsdfFlags::empty(),
            Self::Specular(specular) => BsdfFlags::reading([specular.texture()]),
        }
    }
}

/// Least difference from one of the relative index of a principled surface that transmits light.
const LEAST_CONTRAST: f32 = 1e-3;

/// Lobes of a principled surface other than its diffuse one and its reflection; each weight is from 0 to 1.
#[derive(Clone, Debug)]
pub struct Extras {
    /// How far the reflection at normal incidence takes on the base's hue.
    pub spec_tint: Scalar,
    /// Share of the entering light that is transmitted instead of scattered diffusely.
    pub spec_trans: Scalar,
    /// Light at grazing angles, as on cloth.
    pub sheen: Scalar,
    /// How far the sheen takes on the base's hue.
    pub sheen_tint: Scalar,
    /// A second reflection, of a coat.
    pub clearcoat: Scalar,
    /// From 0, a rough coat, to 1, a smooth one.
    pub clearcoat_gloss: Scalar,
    /// From diffuse scattering to the flat look of subsurface scattering.
    pub flatness: Scalar,
    /// Roughness of the diffuse base, from 0 to 1, instead of flatness: see [`super::OrenNayar`].
    pub diffuse_roughness: Scalar,
    /// Factor on the dielectric's reflectance at normal incidence; at grazing angles it reflects everything.
    pub specular_color: Texture,
    /// A layer of fibres over everything, instead of Burley's sheen.
    pub fuzz: Option<Fuzz>,
    /// A clear coat over what lies below the fibres, instead of Burley's.
    pub coat: Option<ClearCoat>,
    /// A film over the reflection, beneath the coat.
    pub film: Option<ThinFilm>,
    /// Light that scatters beneath the surface.
    pub subsurface: Option<Subsurface>,
}

impl Extras {
    /// None of them.
    pub const NONE: Self = Self {
        spec_tint: Scalar::constant(0.0),
        spec_trans: Scalar::constant(0.0),
        sheen: Scalar::constant(0.0),
        sheen_tint: Scalar::constant(0.0),
        clearcoat: Scalar::constant(0.0),
        clearcoat_gloss: Scalar::constant(0.0),
        flatness: Scalar::constant(0.0),
        diffuse_roughness: Scalar::constant(0.0),
        specular_color: Texture::Constant(Rgb::ONE),
        fuzz: None,
        coat: None,
        film: None,
        subsurface: None,
    };

    fn all(&self) -> [&Scalar; 8] {
        [
            &self.spec_tint,
            &self.spec_trans,
            &self.sheen,
            &self.sheen_tint,
            &self.clearcoat,
            &self.clearcoat_gloss,
            &self.flatness,
            &self.diffuse_roughness,
        ]
    }

    /// The flags that they add to a surface.
    pub(super) fn flags(&self) -> BsdfFlags {
        use BsdfFlags as F;
        let reads = (self.all().iter()).fold(F::empty(), |flags, scalar| flags | F::reading([scalar.texture()]));
        let of_coat = (F::GLOSSY | F::NARROW_LOBE).when(!self.clearcoat.is_zero());
        let beneath = match &self.subsurface {
            None => F::empty(),
            Some(subsurface) => F::REFRACTS | F::BOUNDS_MEDIA | F::reading([subsurface.weight.texture()]),
        };
        let over = self.coat.as_ref().map_or(F::empty(), ClearCoat::flags)
            | self.film.as_ref().map_or(F::empty(), ThinFilm::reads)
            | self.fuzz.as_ref().map_or(F::empty(), Fuzz::reads)
            | F::reading([&self.specular_color]);
        of_coat | over | (F::REFRACTS | F::BENDS | F::BOUNDS_MEDIA).when(self.transmits()) | beneath | reads
    }

    /// Whether the dielectric's reflection has its own colour.
    pub fn has_specular_color(&self) -> bool {
        !matches!(&self.specular_color, Texture::Constant(color) if *color == Rgb::ONE)
    }

    /// Whether light may go through.
    pub fn transmits(&self) -> bool {
        !self.spec_trans.is_zero()
    }

    /// Whether any is present.
    pub fn are_some(&self) -> bool {
        [
            &self.spec_tint,
            &self.spec_trans,
            &self.sheen,
            &self.clearcoat,
            &self.flatness,
            &self.diffuse_roughness,
        ]
        .iter()
        .any(|scalar| !scalar.is_zero())
            || self.subsurface.is_some()
            || self.fuzz.is_some()
            || self.coat.is_some()
            || self.film.is_some()
            || self.has_specular_color()
    }
}

/// A principled surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principled {
    /// Albedo of the base, and of metals at normal incidence, in [0, 1].
    pub base_color: Rgb,
    /// From 0, dielectric, to 1, metal.
    pub metallic: f32,
    /// From 0 to 1; its square is the roughness of the microfacets.
    pub roughness: f32,
    /// Square root of (roughness across / roughness along x); 1 where isotropic.
    pub aspect: f32,
    /// Index of refraction inside over the one outside.
    pub eta: f32,
    /// Reflects on both sides.
    pub two_sided: bool,
    /// Light scatters among the microfacets more than once, and the base receives what they do not reflect.
    pub multiple: bool,
    /// Which lobes count: the GGX lobe, the diffuse one, and that of multiple bounces.
    pub(super) lobes: [bool; 3],
    /// Factor on the diffuse value: bump shadowing.
    pub(super) lit: f32,
}

/// A principled surface with multiple scattering: the parameters of its two wide lobes.
#[derive(Clone, Copy)]
pub(super) struct Bounces {
    pub layer: Layer,
    /// Share of light left after multiple scattering among the microfacets.
    pub further: Rgb,
}

impl Bounces {
    /// For dielectric and metallic facets: their reflectances for diffuse light, and their shares.
    pub fn new(layer: Layer, means: [Rgb; 2], shares: [f32; 2]) -> Self {
        let [dielectric, metal] = [0, 1].map(|i| layer.losses.further_bounces(means[i]) * shares[i]);
        let further = dielectric + metal;
        Self { layer, further }
    }

    /// Albedo of a white base and of the multiple-bounce lobe, towards a direction.
    pub fn albedos(&self, wo: Vec3) -> (f32, Rgb) {
        let loss = self.layer.losses.towards(wo);
        (1.0 - self.layer.towards(wo, loss), self.further * loss)
    }

    /// Values of both, likewise.
    pub fn values(&self, directions: [Vec3; 2]) -> (f32, Rgb) {
        let losses = directions.map(|w| self.layer.losses.towards(w));
        let albedos = [0, 1].map(|i| self.layer.towards(directions[i], losses[i]));
        (
            self.layer.base(albedos),
            self.further * self.layer.losses.returned(losses),
        )
    }
}

impl Principled {
    pub(super) const ALL_LOBES: [bool; 3] = [true; 3];

    pub(super) fn facets(&self) -> Facets {
        Facets {
            distribution: Distribution::Ggx,
            alpha: (self.roughness * self.roughness).max(MIN_ALPHA),
            aspect: self.aspect,
        }
    }

    pub(super) fn alpha(&self) -> f32 {
        self.facets().alpha
    }

    /// The microfacets' reflection and the diffuse lobe, separately.
    pub(super) fn lobes(self) -> [Self; 2] {
        // Only the active ones.
        let [gloss, base, more] = self.lobes;
        [[gloss, false, more], [false, base, false]].map(|lobes| Self { lobes, ..self })
    }

    /// The narrow part, where the microfacets are smooth, and the wide part.
    pub(super) fn narrow_and_wide(self) -> [Self; 2] {
        let [gloss, base, more] = self.lobes;
        [[gloss, false, false], [false, base, more]].map(|lobes| Self { lobes, ..self })
    }

    /// Whether diffuse scattering counts.
    pub(super) fn has_base(&self) -> bool {
        self.lobes[1]
    }

    /// The same with a factor on the diffuse value.
    pub(super) fn with_base_lit(self, lit: f32) -> Self {
        Self { lit, ..self }
    }

    /// Whether light scatters more than once. The tables do not cover boundaries seen from the denser side.
    pub(super) fn is_multiple(&self) -> bool {
        self.multiple && self.eta >= 1.0
    }

    fn bounces(&self) -> Bounces {
        let layer = Layer::of(self.facets(), self.eta);
        let means = [Rgb::splat(layer.mean_fresnel), mean_of_schlick(self.base_color)];
        Bounces::new(layer, means, [1.0 - self.metallic, self.metallic])
    }

    /// Fresnel reflectance for the dielectric share, Schlick's approximation for the metallic one. `cos`: to the
    /// microfacet.
    pub(super) fn fresnel(&self, cos: f32) -> Rgb {
        // An index of 1 turns off the dielectric share only. In Mitsuba the metal would vanish with it, but metal has
        // no index.
        let (dielectric, cos_t) = fresnel_dielectric(cos.min(1.0), self.eta);
        let schlick = schlick_weight(if self.eta < 1.0 { cos_t } else { cos });
        let metal = self.base_color * (1.0 - schlick) + schlick;
        Rgb::splat((1.0 - self.metallic) * dielectric) + metal * self.metallic
    }

    pub(super) fn albedo(&self) -> Rgb {
        (self.base_color * (1.0 - self.metallic) + self.fresnel(1.0)).min(Rgb::ONE)
    }

    #[inline(never)]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if !reflects(wo, wi, self.two_sided) {
            return Rgb::ZERO;
        }
        let facets = self.facets();
        let m = half_vector(wo, wi);
        let cos_d = wo.dot(m).abs();
        let [glossy, base, more] = self.lobes.map(f32::from);
        let base = base * self.lit;
        if self.is_multiple() {
            let specular = self.fresnel(cos_d) * (glossy * facets.correlated(wo, wi, m));
            let (white, further) = self.bounces().values([wo, wi]);
            return specular + self.base_color * (base * (1.0 - self.metallic) * white) + further * more;
        }
        let density = glossy * facets.density(m) / (facets.extent(wo) * facets.extent(wi));
        let specular = self.fresnel(cos_d) * density;
        // Burley 2015, eq. 4.
        let (fo, fi) = (schlick_weight(wo.z.abs()), schlick_weight(wi.z.abs()));
        let rr = 2.0 * self.roughness * cos_d * cos_d;
        let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi);
        let retro = rr * (fo + fi + fo * fi * (rr - 1.0));
        let diffuse = base * (1.0 - self.metallic) * (lambert + retro) * std::f32::consts::FRAC_1_PI;
        specular + self.base_color * diffuse
    }

    /// Probability of sampling the microfacets.
    pub(super) fn specular_probability(&self, wo: Vec3) -> f32 {
        let [glossy, base, more] = self.lobes.map(f32::from);
        let specular = glossy * mean(self.fresnel(wo.z.abs()));
        let diffuse = base * (1.0 - self.metallic) * mean(self.base_color);
        if self.is_multiple() {
            let (white, further) = self.bounces().albedos(wo);
            let wide = diffuse * white + more * mean(further);
            return match (specular > 0.0, diffuse > 0.0) {
                (true, true) => (specular / (specular + wide)).clamp(0.1, 0.9),
                (true, false) => specular / (specular + wide),
                (false, _) => 0.0,
            };
        }
        match (specular > 0.0, diffuse > 0.0) {
            (true, true) => (specular / (specular + diffuse)).clamp(0.1, 0.9),
            (true, false) => 1.0,
            (false, _) => 0.0,
        }
    }

    #[inline(never)]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !reflects(wo, wi, self.two_sided) {
            return 0.0;
        }
        self.facets().pdf_over_diffuse(self.specular_probability(wo), wo, wi)
    }

    #[inline(never)]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let wo = wo * sign;
        let p = self.specular_probability(wo);
        let wi = self.facets().sample_over_diffuse(p, wo, u_lobe, u)?;
        BsdfSample::in_lobe(wo * sign, wi * sign, self.pdf(wo, wi), || self.eval(wo, wi))
    }
}
