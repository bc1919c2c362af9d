//! All lobes of the principled BSDF (Burley 2012, 2015) in Mitsuba 3's form: a possibly tinted reflection between
//! dielectric and metal, rough glass beneath it, a coat, a diffuse base that may look flat or be rough, sheen, and
//! subsurface scattering in a medium beneath. Surfaces without these further lobes are [`Principled`].

mod sampling;
mod ways;

use super::coat::Coating;
use super::energy::{GlassAlbedo, Layer, mean_of_schlick};
use super::film::Film;
use super::flags::FOLLOWED_BELOW;
use super::microfibers::Microfibers;
use super::oren_nayar;
use super::principled::{Bounces, Extras, Interface, Principled};
use super::rough_dielectric::RoughDielectric;
use super::subsurface::Beneath;
use super::{BsdfFlags, Distribution, TransportMode, half_vector};
use crate::math::{PI, Rgb, Vec3, luminance};
use crate::world::fresnel::{fresnel_dielectric, schlick_weight};
use crate::world::texture::TexturePoint;
use std::f32::consts::FRAC_1_PI;

/// A principled surface with further lobes, looked up at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layered {
    /// The surface without them.
    base: Principled,
    spec_tint: f32,
    spec_trans: f32,
    /// Flatness of the diffuse base, or its roughness.
    shape: f32,
    sheen: Sheen,
    coat: Coating,
    /// The dielectric's reflectance at normal incidence, if it differs from that of its index.
    normal: Rgb,
    film: Film,
    /// Light that leaves diffusely on the other side.
    beneath: Beneath,
    /// Which parts are present.
    parts: Parts,
    /// Which groups of lobes count.
    groups: Groups,
    /// Normals of the layer below the coat and of the coat, where they differ.
    normals: [Vec3; 2],
}

/// Reflection at grazing angles.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sheen {
    None,
    /// An additional lobe that takes nothing from the others, and how far it takes on the base's hue.
    Burley {
        weight: f32,
        tint: f32,
    },
    /// Fibres over everything: light that they send back does not reach what lies below.
    Microfibers(Microfibers),
}

bitflags::bitflags! {
    /// Parts, as bits: surfaces are passed by value, and options would take more room.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    struct Parts: u8 {
        /// Light may go through somewhere: the far side is an inside, not a back.
        const TRANSMITS = 1;
        /// A reflection with its own colour.
        const NORMAL = 2;
        /// A film.
        const FILM = 4;
        /// A medium beneath.
        const BENEATH = 8;
        /// A rough diffuse base.
        const ROUGH_BASE = 16;
        /// A coat whose normal differs from that of the layer below.
        const TWO_NORMALS = 32;
    }
}

bitflags::bitflags! {
    /// Groups of lobes.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    struct Groups: u8 {
        /// Reflection and transmission.
        const GLOSS = 1;
        /// The coat's reflection.
        const COAT = 2;
        /// Diffuse scattering, and Burley's sheen.
        const BASE = 4;
        /// Multiple scattering among the microfacets.
        const BOUNCES = 8;
        /// Fibres.
        const FIBERS = 16;
    }
}

/// Cap on a layer's reflectance at normal incidence, below 1.
const MOST_NORMAL: f32 = 0.99;

impl Layered {
    pub(super) fn new(base: Principled, extras: &Extras, interface: &Interface, at: &TexturePoint) -> Self {
        let transmits = extras.transmits();
        let film = (extras.film.as_ref().map(|film| film.at(at))).filter(|film| film.weight > 0.0);
        let is_rough = !extras.diffuse_roughness.is_zero();
        let mut parts = Parts::empty();
        parts.set(Parts::TRANSMITS, transmits);
        parts.set(Parts::NORMAL, extras.has_specular_color());
        parts.set(Parts::FILM, film.is_some());
        parts.set(Parts::BENEATH, extras.subsurface.is_some());
        parts.set(Parts::ROUGH_BASE, is_rough);
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
            shape: match is_rough {
                true => extras.diffuse_roughness.eval(at),
                false => extras.flatness.eval(at),
            },
            sheen: Sheen::of(extras, at),
            coat: match &extras.coat {
                Some(coat) => Coating::clear(coat, at),
                None => Coating::burley(extras.clearcoat.eval(at), extras.clearcoat_gloss.eval(at)),
            },
            normal: match extras.has_specular_color() {
                true => (extras.specular_color.eval(at) * at_normal(base.eta)).min(Rgb::ONE),
                false => Rgb::ZERO,
            },
            film: film.unwrap_or_default(),
            beneath: (extras.subsurface.as_ref())
                .map(|subsurface| subsurface.at(base.base_color, 1.0 - base.metallic, at))
                .unwrap_or_default(),
            parts,
            groups: match base.multiple {
                true => Groups::all(),
                false => Groups::all() - Groups::BOUNCES,
            },
            normals: [Vec3::Z; 2],
        }
    }

    /// The same with another index inside over the one outside.
    pub(super) fn bending(self, eta: f32) -> Self {
        Self {
            base: Principled { eta, ..self.base },
            ..self
        }
    }

    /// Whether diffuse scattering or fibres count.
    pub(super) fn has_base(&self) -> bool {
        self.groups.intersects(Groups::BASE | Groups::FIBERS)
    }

    /// The same with a factor on the value of diffuse scattering and fibres.
    pub(super) fn with_base_lit(self, lit: f32) -> Self {
        let base = self.base.with_base_lit(lit);
        Self { base, ..self }
    }

    /// The gloss and the coat, and what lies beneath. None: only the latter counts.
    pub(super) fn gloss_and_base(self) -> Option<[Self; 2]> {
        self.parted(Groups::GLOSS | Groups::COAT | Groups::BOUNCES)
    }

    fn normal(&self) -> Option<Rgb> {
        self.parts.contains(Parts::NORMAL).then_some(self.normal)
    }

    fn film(&self) -> Option<&Film> {
        self.parts.contains(Parts::FILM).then_some(&self.film)
    }

    fn beneath(&self) -> Option<&Beneath> {
        self.parts.contains(Parts::BENEATH).then_some(&self.beneath)
    }

    fn transmits(&self) -> bool {
        self.parts.contains(Parts::TRANSMITS)
    }

    fn fibers(&self) -> Option<&Microfibers> {
        match &self.sheen {
            Sheen::Microfibers(fibers) => Some(fibers),
            Sheen::None | Sheen::Burley { .. } => None,
        }
    }

    /// Share of the light towards a direction that the fibres leave.
    fn below_fibers(&self, camera: Vec3) -> f32 {
        self.fibers().map_or(1.0, |fibers| fibers.lets_through(camera.z))
    }

    #[inline(always)]
    fn has(&self, group: Groups) -> bool {
        self.groups.contains(group)
    }

    fn of(self, groups: Groups) -> Self {
        Self { groups, ..self }
    }

    /// Splits the active groups into these and the others; none if either is empty.
    fn parted(self, these: Groups) -> Option<[Self; 2]> {
        let both = [self.groups & these, self.groups - these];
        (!both[0].is_empty()).then(|| both.map(|groups| self.of(groups)))
    }

    /// The surface's flags.
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

    /// Weight of diffuse light that returns on the same side.
    fn diffuse(&self) -> f32 {
        let back = self.beneath().map_or(1.0, |beneath| 1.0 - beneath.weight);
        (1.0 - self.base.metallic) * (1.0 - self.spec_trans) * back
    }

    /// Weight of transmission.
    fn glass(&self) -> f32 {
        (1.0 - self.base.metallic) * self.spec_trans
    }

    /// The base's hue, of luminance one.
    fn tint(&self) -> Rgb {
        let color = self.base.base_color;
        let luminance = luminance(color);
        if luminance > 0.0 { color / luminance } else { Rgb::ONE }
    }

    /// Reflectance of the microfacets for light from the front.
    fn fresnel(&self, cos: f32) -> Rgb {
        let found = self.without_film(cos);
        let Some(film) = self.film() else { return found };
        let metallic = self.base.metallic;
        let dielectric = self.normal().unwrap_or_else(|| Rgb::splat(at_normal(self.base.eta)));
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
        if self.spec_tint == 0.0 && self.normal().is_none() {
            return plain;
        }
        let (eta, cos) = (self.base.eta, cos.min(1.0));
        let (dielectric, cos_t) = fresnel_dielectric(cos, eta);
        let r0 = at_normal(eta);
        if let Some(normal) = self.normal() {
            // From there to one, along the untinted curve.
            let share = ((dielectric - r0) / (1.0 - r0)).clamp(0.0, 1.0);
            let colored = normal + (Rgb::ONE - normal) * share;
            return plain + (colored - dielectric) * (1.0 - self.base.metallic);
        }
        let schlick = schlick_weight(if eta < 1.0 { cos_t } else { cos });
        let tinted = self.tint() * (r0 * (1.0 - schlick)) + schlick;
        plain + (tinted - dielectric) * ((1.0 - self.base.metallic) * self.spec_tint)
    }

    /// Total reflection of the dielectric's microfacets.
    fn layer(&self) -> Layer {
        let layer = Layer::of(self.base.facets(), self.base.eta);
        match self.filmed_normal() {
            Some(normal) => layer.reflecting(normal.max_element().min(MOST_NORMAL)),
            None => layer,
        }
    }

    /// The dielectric's reflectance at normal incidence, if it differs from that of its index.
    fn filmed_normal(&self) -> Option<Rgb> {
        let Some(film) = self.film() else {
            return self.normal();
        };
        let plain = self.normal().unwrap_or_else(|| Rgb::splat(at_normal(self.base.eta)));
        let filmed = film.reflectance(1.0, plain);
        Some(plain + (filmed - plain) * film.weight)
    }

    fn transmission_tint(&self) -> Rgb {
        self.color_of_glass() * self.glass()
    }

    /// Colour factor of one side: light that crosses both sides takes on the base's colour.
    fn color_of_glass(&self) -> Rgb {
        let color = self.base.base_color;
        Rgb::new(color.x.sqrt(), color.y.sqrt(), color.z.sqrt())
    }

    /// As a boundary of rough glass: transmission from either side, and reflection inside.
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

    /// The far side is an inside, not a back.
    fn has_inside(&self) -> bool {
        self.parts.intersects(Parts::TRANSMITS | Parts::BENEATH)
    }

    fn is_inside(&self, wo: Vec3) -> bool {
        self.has_inside() && wo.z < 0.0
    }

    /// Pi times the value of light that leaves diffusely on the other side, if that counts: reciprocal.
    fn through(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        match self.beneath() {
            Some(beneath) if self.has(Groups::BASE) => {
                let (outside, cos_to_coat, share) = self.crossing_ways(wo, wi, mode);
                beneath.amplitude * (self.let_in(beneath, outside, cos_to_coat) * share * self.base.lit)
            }
            _ => Rgb::ZERO,
        }
    }

    /// Transmission of the layer above from a direction, over the square root of its mean over all directions.
    fn let_in(&self, beneath: &Beneath, outside: Vec3, cos_to_coat: f32) -> f32 {
        let cos = outside.z.abs().min(1.0);
        let through_coat = self.coat.crossed(cos_to_coat) * self.fibers().map_or(1.0, |fibers| fibers.crossed(cos));
        if !self.base.is_multiple() {
            return (1.0 - fresnel_dielectric(cos, self.base.eta).0) * beneath.spread * through_coat;
        }
        let layer = self.layer();
        let reflected = layer.towards(outside, layer.losses.towards(outside));
        (1.0 - reflected) / (1.0 - layer.mean_albedo()).max(f32::MIN_POSITIVE).sqrt() * through_coat
    }

    /// Turns both directions so that the one to the path's origin is on the front, for two-sided surfaces. None: the
    /// back is black, or `wo` is on neither side.
    fn turned(&self, wo: Vec3) -> Option<f32> {
        match wo.z {
            z if z > 0.0 => Some(1.0),
            z if z < 0.0 && self.base.two_sided && !self.has_inside() => Some(-1.0),
            _ => None,
        }
    }

    pub(super) fn albedo(&self) -> Rgb {
        let through = self.transmission_tint();
        let beneath = self.beneath().map_or(0.0, |beneath| beneath.weight) * (1.0 - self.base.metallic);
        let sum = self.base.base_color * (self.diffuse() + beneath) + through + self.fresnel(1.0);
        let below = (sum + self.coat.odds(1.0, self.base.eta)).min(Rgb::ONE);
        match self.fibers() {
            None => below,
            Some(fibers) => below * fibers.lets_through(1.0) + fibers.color * fibers.albedo(1.0),
        }
    }

    #[inline(never)]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        if wo.z * wi.z < 0.0 || self.is_inside(wo) {
            if self.beneath().is_some() {
                return match wo.z * wi.z < 0.0 {
                    true => self.through(wo, wi, mode) * FRAC_1_PI,
                    false => Rgb::ZERO,
                };
            }
            let counts = self.transmits() && self.has(Groups::GLOSS) && self.glass() > 0.0;
            return match counts {
                true => self.boundary().eval(wo, wi, mode) * self.filmed(wo, wi) * self.crossing(wo, wi),
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
        let ways = self.ways(wo, wi, mode);
        // Both receive the light, where their normals are the same.
        let (below, of_coat) = (ways.below, ways.coat);
        let [wo, wi] = below.directions;
        let m = half_vector(wo, wi);
        let cos_d = wo.dot(m).abs();
        let cosines = of_coat.cosines();
        let [over_narrow, over_wide] = self.coat.passed(cosines, || self.layer());
        let mut value = Rgb::ZERO;
        let of_base = below.share * below.lit * self.base.lit;
        if self.has(Groups::GLOSS) && below.is_lit() {
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
            value += glossy * over_narrow * below.share;
        }
        if self.has(Groups::COAT) && self.coat.is_some() && of_coat.is_lit() {
            let [wo, wi] = of_coat.directions;
            value += self.coat.eval(wo, wi, self.base.eta) * of_coat.share;
        }
        let mut coupled = None;
        if self.base.is_multiple() {
            let mut more = Rgb::ZERO;
            if below.is_lit() {
                let (white, further) = self.bounces().values([wo, wi]);
                coupled = Some(white * PI);
                more = further * over_wide * below.share;
            }
            if self.has(Groups::BOUNCES) {
                value += more + self.coat.further(cosines) * of_coat.share;
            }
        }
        if self.has(Groups::BASE) && below.is_lit() {
            value += self.eval_base(wo, wi, cos_d, coupled) * over_wide * of_base;
        }
        if let Some(fibers) = self.fibers() {
            value *= fibers.lets_through(mode.towards_camera(wo, wi).z.max(0.0));
            if self.has(Groups::FIBERS) && below.is_lit() {
                value += fibers.eval(wo, wi, mode) * of_base;
            }
        }
        value
    }

    /// A film's factor on transmission through glass from either side, and on reflection inside it.
    fn filmed(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if self.film().is_none() {
            return Rgb::ONE;
        }
        let Some(cos) = self.boundary().cos_of_facet(wo, wi) else {
            return Rgb::ZERO;
        };
        let eta = if wo.z > 0.0 { self.base.eta } else { 1.0 / self.base.eta };
        let (plain, beyond) = fresnel_dielectric(cos.min(1.0), eta);
        let filmed = match wo.z > 0.0 {
            true => self.film_reflects(cos, plain),
            false => self.film_reflects(beyond, plain),
        };
        match wo.z * wi.z > 0.0 {
            true => filmed / plain.max(f32::MIN_POSITIVE),
            false => (Rgb::ONE - filmed) / (1.0 - plain).max(f32::MIN_POSITIVE),
        }
    }

    /// Reflectance of glass with its film, from either side, for light at this cosine outside. `plain`: without the
    /// film.
    fn film_reflects(&self, cos: f32, plain: f32) -> Rgb {
        match self.film() {
            // Everything, beyond the critical angle.
            Some(film) if plain < 1.0 => {
                let filmed = film.reflectance(cos, Rgb::splat(at_normal(self.base.eta)));
                Rgb::splat(plain) + (filmed - plain) * film.weight
            }
            _ => Rgb::splat(plain),
        }
    }

    /// Share of transmitted light that fibres leave: they lie on the outside.
    fn crossing(&self, wo: Vec3, wi: Vec3) -> f32 {
        match (wo.z > 0.0, wi.z > 0.0) {
            (true, false) => self.below_fibers(wo),
            (false, true) => self.below_fibers(wi),
            _ => 1.0,
        }
    }

    /// Multiple scattering.
    fn bounces(&self) -> Bounces {
        let metal = mean_of_schlick(self.base.base_color);
        // Glass scales its single bounce so that nothing is lost.
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

    /// `coupled`: transmission of the layer above to a white base and back, over the value of that. None: Burley's
    /// shape.
    fn eval_base(&self, wo: Vec3, wi: Vec3, cos_d: f32, coupled: Option<f32>) -> Rgb {
        // Burley 2015, eq. 4; Burley 2012 for the flat look.
        let (fo, fi) = (schlick_weight(wo.z), schlick_weight(wi.z));
        let rr = 2.0 * self.base.roughness * cos_d * cos_d;
        let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi);
        let retro = rr * (fo + fi + fo * fi * (rr - 1.0));
        if self.parts.contains(Parts::ROUGH_BASE) {
            let value = oren_nayar::value(self.base.base_color, self.shape, wo, wi);
            return value * (self.diffuse() * coupled.unwrap_or(1.0)) + self.burley_sheen(cos_d);
        }
        let mut shape = coupled.unwrap_or(lambert + retro);
        if self.shape > 0.0 {
            let towards = |f: f32| 1.0 + (0.5 * rr - 1.0) * f;
            let fss = towards(fo) * towards(fi);
            let flat = 1.25 * (fss * (1.0 / (wo.z + wi.z).max(f32::MIN_POSITIVE) - 0.5) + 0.5);
            shape += (flat - shape) * self.shape;
        }
        let value = self.base.base_color * (self.diffuse() * shape * FRAC_1_PI);
        value + self.burley_sheen(cos_d)
    }

    fn burley_sheen(&self, cos_d: f32) -> Rgb {
        match self.sheen {
            // As in Mitsuba, it accompanies diffuse scattering.
            Sheen::Burley { weight, tint } if self.diffuse() > 0.0 => {
                let hue = Rgb::ONE + (self.tint() - Rgb::ONE) * tint;
                hue * (weight * (1.0 - self.base.metallic) * schlick_weight(cos_d))
            }
            _ => Rgb::ZERO,
        }
    }
}

impl Sheen {
    fn of(extras: &Extras, at: &TexturePoint) -> Self {
        if let Some(fuzz) = &extras.fuzz {
            let fibers = fuzz.at(at);
            return match fibers.color.max_element() > 0.0 {
                true => Self::Microfibers(fibers),
                false => Self::None,
            };
        }
        let (weight, tint) = (extras.sheen.eval(at), extras.sheen_tint.eval(at));
        match weight > 0.0 {
            true => Self::Burley { weight, tint },
            false => Self::None,
        }
    }
}

/// Reflectance of a dielectric at normal incidence.
fn at_normal(eta: f32) -> f32 {
    (eta - 1.0) * (eta - 1.0) / ((eta + 1.0) * (eta + 1.0))
}
