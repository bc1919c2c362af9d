//! All lobes of the principled BSDF (Burley 2012, 2015) in the form that Mitsuba 3 gives it: a reflection between
//! dielectric and metal that may be tinted, rough glass beneath it, a coat, a diffuse base that may look flat, sheen,
//! and light that sinks into a medium beneath. Surfaces without the further lobes are [`Principled`] ones.

use super::coat::Coating;
use super::energy::{GlassAlbedo, Layer, mean_of_schlick};
use super::film::Film;
use super::flags::FOLLOWED_BELOW;
use super::principled::{Bounces, Extras, Interface, Principled};
use super::rough_dielectric::RoughDielectric;
use super::subsurface::Beneath;
use super::{BsdfFlags, BsdfSample, Distribution, TransportMode, half_vector};
use crate::math::{PI, Rgb, Vec2, Vec3, luminance, mean};
use crate::warp;
use crate::world::fresnel::{fresnel_dielectric, schlick_weight};
use crate::world::texture::TexturePoint;
use std::f32::consts::FRAC_1_PI;

/// A principled surface with further lobes, looked up at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layered {
    /// What it is without them.
    base: Principled,
    spec_tint: f32,
    spec_trans: f32,
    sheen: f32,
    sheen_tint: f32,
    flatness: f32,
    coat: Coating,
    /// What the dielectric share reflects at normal incidence, if that is not what its index says.
    normal: Option<Rgb>,
    film: Option<Film>,
    /// Light may go through somewhere: its inside is an inside, not a back.
    transmits: bool,
    /// What comes out diffusely on the other side; `None`: the surface has no medium beneath it.
    beneath: Option<Beneath>,
    /// Which of its groups of lobes count.
    groups: Groups,
}

bitflags::bitflags! {
    /// Groups of lobes.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    struct Groups: u8 {
        /// The reflection and what goes through.
        const GLOSS = 1;
        /// The coat's reflection.
        const COAT = 2;
        /// What is diffuse, and sheen.
        const BASE = 4;
        /// What the microfacets scatter more than once.
        const BOUNCES = 8;
    }
}

/// Probabilities of sampling them.
#[derive(Clone, Copy, Debug, Default)]
struct Odds {
    gloss: f32,
    coat: f32,
    base: f32,
}

/// What is less than all that a layer may reflect at normal incidence.
const MOST_NORMAL: f32 = 0.99;
/// Least probability of what there is.
const LEAST_ODDS: f32 = 0.1;

impl Layered {
    pub(super) fn new(base: Principled, extras: &Extras, interface: &Interface, at: &TexturePoint) -> Self {
        let transmits = extras.transmits();
        let beneath = extras.subsurface.as_ref();
        Self {
            base: Principled {
                eta: match transmits {
                    true => interface.eta_of_glass(),
                    false => base.eta,
                },
                ..base
            },
            spec_tint: extras.spec_tint.eval(at),
            spec_trans: extras.spec_trans.eval(at),
            sheen: extras.sheen.eval(at),
            sheen_tint: extras.sheen_tint.eval(at),
            flatness: extras.flatness.eval(at),
            coat: match &extras.coat {
                Some(coat) => Coating::clear(coat, at),
                None => Coating::burley(extras.clearcoat.eval(at), extras.clearcoat_gloss.eval(at)),
            },
            normal: extras.has_specular_color().then(|| {
                let color = extras.specular_color.eval(at);
                (color * at_normal(base.eta)).min(Rgb::ONE)
            }),
            film: (extras.film.as_ref().map(|film| film.at(at))).filter(|film| film.weight > 0.0),
            transmits,
            beneath: beneath.map(|subsurface| subsurface.at(base.base_color, 1.0 - base.metallic, at)),
            groups: match base.multiple {
                true => Groups::all(),
                false => Groups::all() - Groups::BOUNCES,
            },
        }
    }

    /// The same with another index inside over the one outside.
    pub(super) fn bending(self, eta: f32) -> Self {
        Self {
            base: Principled { eta, ..self.base },
            ..self
        }
    }

    /// The gloss and the coat, and what is beneath. None: only the latter counts.
    pub(super) fn gloss_and_base(self) -> Option<[Self; 2]> {
        self.parted(Groups::GLOSS | Groups::COAT | Groups::BOUNCES)
    }

    #[inline(always)]
    fn has(&self, group: Groups) -> bool {
        self.groups.contains(group)
    }

    fn of(self, groups: Groups) -> Self {
        Self { groups, ..self }
    }

    /// These groups of those that count, and the others; none where these are none.
    fn parted(self, these: Groups) -> Option<[Self; 2]> {
        let both = [self.groups & these, self.groups - these];
        (!both[0].is_empty()).then(|| both.map(|groups| self.of(groups)))
    }

    /// The lobes that are followed, the others, and the probability of the first.
    #[inline]
    pub(super) fn narrow_and_wide(self, wo: Vec3) -> Option<(f32, [Self; 2])> {
        let mut these = Groups::empty();
        these.set(Groups::GLOSS, self.base.alpha() < FOLLOWED_BELOW);
        these.set(Groups::COAT, self.coat.is_narrow(FOLLOWED_BELOW));
        let [narrow, wide] = self.parted(these)?;
        let odds = self.odds(wo);
        let taken = [
            (narrow.has(Groups::GLOSS), odds.gloss),
            (narrow.has(Groups::COAT), odds.coat),
        ];
        let p: f32 = taken.iter().map(|(is_taken, p)| f32::from(*is_taken) * p).sum();
        Some((p, [narrow, wide]))
    }

    /// What holds of it.
    #[inline]
    pub(super) fn flags(&self) -> BsdfFlags {
        use BsdfFlags as F;
        let coat = F::of_coat([self.coat.alpha(); 2]) | F::NARROW_LOBE.when(self.coat.is_narrow(FOLLOWED_BELOW));
        F::of_coat([self.base.alpha(); 2]).when(self.has(Groups::GLOSS))
            | coat.when(self.has(Groups::COAT) && self.coat.is_some())
            | F::REFRACTS.when(self.has_inside())
            | F::ROUGH
            | F::WIDE
    }

    /// Weight of what is diffuse and comes back at once.
    fn diffuse(&self) -> f32 {
        let back = self.beneath.map_or(1.0, |beneath| 1.0 - beneath.weight);
        (1.0 - self.base.metallic) * (1.0 - self.spec_trans) * back
    }

    /// Weight of what goes through.
    fn glass(&self) -> f32 {
        (1.0 - self.base.metallic) * self.spec_trans
    }

    /// The base's hue, of luminance one.
    fn tint(&self) -> Rgb {
        let color = self.base.base_color;
        let luminance = luminance(color);
        if luminance > 0.0 { color / luminance } else { Rgb::ONE }
    }

    /// What microfacets reflect of light from the front.
    fn fresnel(&self, cos: f32) -> Rgb {
        let found = self.without_film(cos);
        let Some(film) = &self.film else { return found };
        let metallic = self.base.metallic;
        let dielectric = self.normal.unwrap_or_else(|| Rgb::splat(at_normal(self.base.eta)));
        let mut filmed = Rgb::ZERO;
        if metallic < 1.0 {
            filmed += film.reflectance(cos, dielectric) * (1.0 - metallic);
        }
        if metallic > 0.0 {
            filmed += film.reflectance(cos, self.base.base_color) * metallic;
        }
        found + (filmed - found) * film.weight
    }

    fn without_film(&self, cos: f32) -> Rgb {
        let plain = self.base.fresnel(cos);
        if self.spec_tint == 0.0 && self.normal.is_none() {
            return plain;
        }
        let (eta, cos) = (self.base.eta, cos.min(1.0));
        let (dielectric, cos_t) = fresnel_dielectric(cos, eta);
        let r0 = at_normal(eta);
        if let Some(normal) = self.normal {
            // From there to one as without the colour.
            let share = ((dielectric - r0) / (1.0 - r0)).clamp(0.0, 1.0);
            let colored = normal + (Rgb::ONE - normal) * share;
            return plain + (colored - dielectric) * (1.0 - self.base.metallic);
        }
        let schlick = schlick_weight(if eta < 1.0 { cos_t } else { cos });
        let tinted = self.tint() * (r0 * (1.0 - schlick)) + schlick;
        plain + (tinted - dielectric) * ((1.0 - self.base.metallic) * self.spec_tint)
    }

    /// What the microfacets of the dielectric share reflect in all.
    fn layer(&self) -> Layer {
        let layer = Layer::of(self.base.facets(), self.base.eta);
        match self.filmed_normal() {
            Some(normal) => layer.reflecting(normal.max_element().min(MOST_NORMAL)),
            None => layer,
        }
    }

    /// What the dielectric share reflects at normal incidence where that is not what its index says.
    fn filmed_normal(&self) -> Option<Rgb> {
        let Some(film) = &self.film else { return self.normal };
        let plain = self.normal.unwrap_or_else(|| Rgb::splat(at_normal(self.base.eta)));
        let filmed = film.reflectance(1.0, plain);
        Some(plain + (filmed - plain) * film.weight)
    }

    fn transmission_tint(&self) -> Rgb {
        self.color_of_glass() * self.glass()
    }

    /// Of one of its sides: light that goes through both has the base's colour.
    fn color_of_glass(&self) -> Rgb {
        let color = self.base.base_color;
        Rgb::new(color.x.sqrt(), color.y.sqrt(), color.z.sqrt())
    }

    /// As a boundary of rough glass: what goes through from either side, and what its inside reflects.
    fn boundary(&self) -> RoughDielectric {
        RoughDielectric {
            distribution: Distribution::Ggx,
            alpha: self.base.alpha(),
            aspect: self.base.aspect,
            eta: self.base.eta,
            reflectance: Rgb::splat(self.glass()),
            transmittance: self.transmission_tint(),
            kept: self.base.multiple.then(|| self.color_of_glass()),
        }
    }

    /// Its other side is an inside, not a back.
    fn has_inside(&self) -> bool {
        self.transmits || self.beneath.is_some()
    }

    fn is_inside(&self, wo: Vec3) -> bool {
        self.has_inside() && wo.z < 0.0
    }

    /// Pi times the value of what comes out diffusely on the other side, if that counts: the same both ways.
    fn through(&self, outside: Vec3) -> Rgb {
        match &self.beneath {
            Some(beneath) if self.has(Groups::BASE) => beneath.amplitude * self.let_in(beneath, outside),
            _ => Rgb::ZERO,
        }
    }

    /// What the layer above lets in from a direction, over the root of what it does from all sides.
    fn let_in(&self, beneath: &Beneath, outside: Vec3) -> f32 {
        let cos = outside.z.abs().min(1.0);
        let through_coat = self.coat.crossed(cos);
        if !self.base.is_multiple() {
            return (1.0 - fresnel_dielectric(cos, self.base.eta).0) * beneath.spread * through_coat;
        }
        let layer = self.layer();
        let reflected = layer.towards(outside, layer.losses.towards(outside));
        (1.0 - reflected) / (1.0 - layer.mean_albedo()).max(f32::MIN_POSITIVE).sqrt() * through_coat
    }

    /// Probability that a sample of the base comes out on the other side, seen from the front.
    fn sunk(&self) -> f32 {
        let Some(beneath) = &self.beneath else { return 0.0 };
        if !self.has(Groups::BASE) {
            return 0.0;
        }
        let (through, back) = (mean(beneath.amplitude), self.back(1.0) + self.more());
        match through + back > 0.0 {
            true => through / (through + back),
            false => 0.0,
        }
    }

    /// How much of the base comes back at once, roughly; `white`: what would if it were white, for the layer above it.
    fn back(&self, white: f32) -> f32 {
        let sheen = match self.diffuse() > 0.0 {
            true => 0.1 * self.sheen * (1.0 - self.base.metallic),
            false => 0.0,
        };
        self.diffuse() * mean(self.base.base_color) * white + sheen
    }

    /// What is scattered more than once of light from all sides, if that counts.
    fn more(&self) -> f32 {
        match self.base.is_multiple() && self.has(Groups::BOUNCES) {
            true => {
                let bounces = self.bounces();
                mean(bounces.further) * bounces.layer.losses.mean()
            }
            false => 0.0,
        }
    }

    /// Both directions with that to the path's origin on the front, for surfaces that are alike on both sides. None:
    /// the back is black, or `wo` is on neither side.
    fn turned(&self, wo: Vec3) -> Option<f32> {
        match wo.z {
            z if z > 0.0 => Some(1.0),
            z if z < 0.0 && self.base.two_sided && !self.has_inside() => Some(-1.0),
            _ => None,
        }
    }

    pub(super) fn albedo(&self) -> Rgb {
        let through = self.transmission_tint();
        let beneath = self.beneath.map_or(0.0, |beneath| beneath.weight) * (1.0 - self.base.metallic);
        let sum = self.base.base_color * (self.diffuse() + beneath) + through + self.fresnel(1.0);
        (sum + self.coat.odds(1.0, self.base.eta)).min(Rgb::ONE)
    }

    /// Probabilities of sampling each group, seen from the front.
    fn odds(&self, wo: Vec3) -> Odds {
        let share = |counts: bool, weight: f32| if counts { weight } else { 0.0 };
        if self.is_inside(wo) {
            let beneath = self.beneath.map_or(0.0, |beneath| mean(beneath.amplitude));
            return Odds {
                gloss: share(self.has(Groups::GLOSS) && self.transmits && self.glass() > 0.0, 1.0),
                base: share(self.has(Groups::BASE) && beneath > 0.0, 1.0),
                coat: 0.0,
            };
        }
        let cos = wo.z.abs().min(1.0);
        let entered = 1.0 - fresnel_dielectric(cos, self.base.eta).0;
        let gloss = mean(self.fresnel(cos)) + entered * mean(self.transmission_tint());
        let (mut white, mut more) = (1.0, 0.0);
        if self.base.is_multiple() {
            let (beneath, further) = self.bounces().albedos(wo);
            white = beneath;
            more = share(self.has(Groups::BOUNCES), mean(further));
        }
        let base = self.back(white) + self.beneath.map_or(0.0, |beneath| mean(beneath.amplitude));
        let below = self.coat.lets_in(cos);
        let bounces = share(self.has(Groups::BOUNCES), self.coat.further([cos; 2]));
        let odds = [
            share(self.has(Groups::GLOSS), gloss) * below,
            share(self.has(Groups::COAT), self.coat.odds(cos, self.base.eta)),
            (share(self.has(Groups::BASE), base) + more) * below + bounces,
        ];
        let sum: f32 = odds.iter().sum();
        if sum <= 0.0 {
            return Odds::default();
        }
        let odds = odds.map(|odds| if odds > 0.0 { (odds / sum).max(LEAST_ODDS) } else { 0.0 });
        let sum: f32 = odds.iter().sum();
        let [gloss, coat, base] = odds.map(|odds| odds / sum);
        Odds { gloss, coat, base }
    }

    /// Probability that a microfacet reflects light from the front, where it is sampled.
    fn reflected(&self, cos: f32) -> f32 {
        let through = (1.0 - fresnel_dielectric(cos.min(1.0), self.base.eta).0) * mean(self.transmission_tint());
        if through <= 0.0 {
            return 1.0;
        }
        let reflected = mean(self.fresnel(cos));
        reflected / (reflected + through)
    }

    #[inline(never)]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        if wo.z * wi.z < 0.0 || self.is_inside(wo) {
            if self.beneath.is_some() {
                return match wo.z * wi.z < 0.0 {
                    true => self.through(if wo.z > 0.0 { wo } else { wi }) * FRAC_1_PI,
                    false => Rgb::ZERO,
                };
            }
            let counts = self.transmits && self.has(Groups::GLOSS) && self.glass() > 0.0;
            return match counts {
                true => self.boundary().eval(wo, wi, mode),
                false => Rgb::ZERO,
            };
        }
        let Some(sign) = self.turned(wo) else {
            return Rgb::ZERO;
        };
        let (wo, wi) = (wo * sign, wi * sign);
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let m = half_vector(wo, wi);
        let cos_d = wo.dot(m).abs();
        let cosines = [wo.z, wi.z];
        let [over_narrow, over_wide] = self.coat.passed(cosines, || self.layer());
        let mut value = Rgb::ZERO;
        if self.has(Groups::GLOSS) {
            let facets = self.base.facets();
            let density = match self.base.is_multiple() {
                true => facets.correlated(wo, wi, m),
                false => facets.density(m) / (facets.extent(wo) * facets.extent(wi)),
            };
            let mut glossy = self.fresnel(cos_d) * density;
            if self.base.multiple && self.glass() > 0.0 {
                let camera = mode.towards_camera(wo, wi);
                let brightened = GlassAlbedo::of(facets, self.base.eta).brightened(camera, self.color_of_glass());
                let of_glass = self.fresnel(cos_d) * brightened * facets.correlated(wo, wi, m);
                glossy += (of_glass - glossy) * self.glass();
            }
            value += glossy * over_narrow;
        }
        if self.has(Groups::COAT) && self.coat.is_some() {
            value += self.coat.eval(wo, wi, self.base.eta);
        }
        let mut coupled = None;
        if self.base.is_multiple() {
            let (white, further) = self.bounces().values([wo, wi]);
            coupled = Some(white * PI);
            if self.has(Groups::BOUNCES) {
                value += further * over_wide + self.coat.further(cosines);
            }
        }
        if self.has(Groups::BASE) {
            value += self.eval_base(wo, wi, cos_d, coupled) * over_wide;
        }
        value
    }

    /// What is scattered more than once.
    fn bounces(&self) -> Bounces {
        let metal = mean_of_schlick(self.base.base_color);
        // Of glass one bounce is scaled so that nothing is lost.
        let shares = [(1.0 - self.base.metallic) * (1.0 - self.spec_trans), self.base.metallic];
        if let Some(normal) = self.filmed_normal() {
            let layer = self.layer();
            let plain = Layer::of(self.base.facets(), self.base.eta);
            return Bounces::new(layer, [plain.mean_of(normal), metal], shares);
        }
        let layer = Layer::of(self.base.facets(), self.base.eta);
        let plain = Rgb::splat(layer.mean_fresnel);
        let tinted = mean_of_schlick(self.tint() * at_normal(self.base.eta));
        let dielectric = plain + (tinted - plain) * self.spec_tint;
        Bounces::new(layer, [dielectric, metal], shares)
    }

    /// `coupled`: what the layer above lets through to a white base and back, over the value of that. None: Burley's
    /// shape.
    fn eval_base(&self, wo: Vec3, wi: Vec3, cos_d: f32, coupled: Option<f32>) -> Rgb {
        // Burley 2015, eq. 4, and 2012 for what looks flat.
        let (fo, fi) = (schlick_weight(wo.z), schlick_weight(wi.z));
        let rr = 2.0 * self.base.roughness * cos_d * cos_d;
        let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi);
        let retro = rr * (fo + fi + fo * fi * (rr - 1.0));
        let mut shape = coupled.unwrap_or(lambert + retro);
        if self.flatness > 0.0 {
            let towards = |f: f32| 1.0 + (0.5 * rr - 1.0) * f;
            let fss = towards(fo) * towards(fi);
            let flat = 1.25 * (fss * (1.0 / (wo.z + wi.z).max(f32::MIN_POSITIVE) - 0.5) + 0.5);
            shape += (flat - shape) * self.flatness;
        }
        let mut value = self.base.base_color * (self.diffuse() * shape * FRAC_1_PI);
        // As in Mitsuba, sheen goes with what is diffuse.
        if self.sheen > 0.0 && self.diffuse() > 0.0 {
            let hue = Rgb::ONE + (self.tint() - Rgb::ONE) * self.sheen_tint;
            value += hue * (self.sheen * (1.0 - self.base.metallic) * schlick_weight(cos_d));
        }
        value
    }

    #[inline(never)]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let odds = self.odds(wo);
        if self.is_inside(wo) {
            return match (odds.gloss > 0.0, wi.z > 0.0) {
                (true, _) => self.boundary().pdf(wo, wi),
                (false, true) => odds.base * warp::cosine_hemisphere_pdf(wi.z),
                (false, false) => 0.0,
            };
        }
        let Some(sign) = self.turned(wo) else {
            return 0.0;
        };
        let (wo, wi) = (wo * sign, wi * sign);
        if wi.z < 0.0 {
            return match self.transmits && odds.gloss > 0.0 {
                true => odds.gloss * self.pdf_through(wo, wi),
                false => odds.base * self.sunk() * warp::cosine_hemisphere_pdf(-wi.z),
            };
        }
        if wi.z == 0.0 {
            return 0.0;
        }
        let m = half_vector(wo, wi);
        let cos_d = wo.dot(m);
        let mut pdf = odds.base * (1.0 - self.sunk()) * warp::cosine_hemisphere_pdf(wi.z);
        if odds.gloss > 0.0 {
            pdf += odds.gloss * self.reflected(cos_d) * self.base.facets().reflection_pdf(wo, m);
        }
        if odds.coat > 0.0 {
            pdf += self.coat.pdf(odds.coat, wo, m);
        }
        pdf
    }

    /// Density of going through from the front, if a microfacet is what is sampled.
    fn pdf_through(&self, wo: Vec3, wi: Vec3) -> f32 {
        let boundary = self.boundary();
        // Of the boundary, with another probability of going through.
        let Some(cos) = boundary.cos_of_facet(wo, wi) else {
            return 0.0;
        };
        let entered = 1.0 - fresnel_dielectric(cos, self.base.eta).0;
        match entered > 0.0 {
            true => boundary.pdf(wo, wi) * (1.0 - self.reflected(cos)) / entered,
            false => 0.0,
        }
    }

    #[inline(never)]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        let odds = self.odds(wo);
        if self.is_inside(wo) {
            if odds.gloss > 0.0 {
                return self.boundary().sample(wo, u_lobe, u, mode);
            }
            let wi = (odds.base > 0.0).then(|| warp::cosine_hemisphere(u))?;
            return BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi, mode));
        }
        let sign = self.turned(wo)?;
        let front = wo * sign;
        let mut transmitted = false;
        let wi = if u_lobe < odds.gloss {
            let m = self.base.facets().sample_visible(front, u);
            let cos = front.dot(m);
            if cos <= 0.0 {
                return None;
            }
            if u_lobe / odds.gloss < self.reflected(cos) {
                (m * (2.0 * cos) - front).normalize()
            } else {
                let eta = self.base.eta;
                let cos_t = fresnel_dielectric(cos.min(1.0), eta).1;
                transmitted = true;
                (m * (cos / eta - cos_t) - front / eta).normalize()
            }
        } else if u_lobe < odds.gloss + odds.coat {
            self.coat.sample(front, u)?
        } else if odds.base > 0.0 {
            let wi = warp::cosine_hemisphere(u);
            let rest = (u_lobe - odds.gloss - odds.coat) / odds.base;
            transmitted = rest < self.sunk();
            if transmitted { -wi } else { wi }
        } else {
            return None;
        };
        // Light that would need a second bounce among the facets is lost.
        if (wi.z < 0.0) != transmitted || wi.z == 0.0 {
            return None;
        }
        let wi = wi * sign;
        BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi, mode))
    }
}

/// Reflectance of a dielectric at normal incidence.
fn at_normal(eta: f32) -> f32 {
    (eta - 1.0) * (eta - 1.0) / ((eta + 1.0) * (eta + 1.0))
}
