//! Which lobe of a layered surface is sampled, and its density.

use super::{Groups, Layered, Sheen};
use crate::math::{Vec2, Vec3, mean};
use crate::warp;
use crate::world::bsdf::flags::FOLLOWED_BELOW;
use crate::world::bsdf::{BsdfSample, TransportMode, half_vector};
use crate::world::fresnel::fresnel_dielectric;

/// Probabilities of sampling each group of lobes.
#[derive(Clone, Copy, Debug, Default)]
struct Odds {
    gloss: f32,
    coat: f32,
    base: f32,
    fibers: f32,
}

/// Least probability of a group that is present.
const LEAST_ODDS: f32 = 0.1;

impl Layered {
    /// The lobes that paths follow, the others, and the probability of the first.
    #[inline]
    pub(in crate::world::bsdf) fn narrow_and_wide(self, wo: Vec3) -> Option<(f32, [Self; 2])> {
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

    /// Probability that a sample of the base leaves on the other side, seen from the front.
    fn sunk(&self) -> f32 {
        let Some(beneath) = self.beneath() else { return 0.0 };
        if !self.has(Groups::BASE) {
            return 0.0;
        }
        let (through, back) = (mean(beneath.amplitude), self.back(1.0) + self.more());
        match through + back > 0.0 {
            true => through / (through + back),
            false => 0.0,
        }
    }

    /// Approximate share of the base that returns on the same side; `white`: that share for a white base, for the layer
    /// above it.
    fn back(&self, white: f32) -> f32 {
        let sheen = match self.sheen {
            Sheen::Burley { weight, .. } if self.diffuse() > 0.0 => 0.1 * weight * (1.0 - self.base.metallic),
            _ => 0.0,
        };
        self.diffuse() * mean(self.base.base_color) * white + sheen
    }

    /// Multiple scattering of light from all sides, if that counts.
    fn more(&self) -> f32 {
        match self.base.is_multiple() && self.has(Groups::BOUNCES) {
            true => {
                let bounces = self.bounces();
                mean(bounces.further) * bounces.layer.losses.mean()
            }
            false => 0.0,
        }
    }

    /// Probabilities of sampling each group, seen from the front.
    fn odds(&self, wo: Vec3) -> Odds {
        let share = |counts: bool, weight: f32| if counts { weight } else { 0.0 };
        if self.is_inside(wo) {
            let beneath = self.beneath().map_or(0.0, |beneath| mean(beneath.amplitude));
            return Odds {
                gloss: share(self.has(Groups::GLOSS) && self.transmits() && self.glass() > 0.0, 1.0),
                base: share(self.has(Groups::BASE) && beneath > 0.0, 1.0),
                ..Odds::default()
            };
        }
        let (wo, cos_to_coat) = self.seen_from(if self.has_two_normals() && wo.z < 0.0 { -wo } else { wo });
        let cos = wo.z.abs().min(1.0);
        let entered = 1.0 - fresnel_dielectric(cos, self.base.eta).0;
        let gloss = mean(self.fresnel(cos)) + entered * mean(self.transmission_tint());
        let (mut white, mut more) = (1.0, 0.0);
        if self.base.is_multiple() {
            let (beneath, further) = self.bounces().albedos(wo);
            white = beneath;
            more = share(self.has(Groups::BOUNCES), mean(further));
        }
        let base = self.back(white) + self.beneath().map_or(0.0, |beneath| mean(beneath.amplitude));
        let below_fibers = self.below_fibers(wo);
        let below = self.coat.lets_in(cos_to_coat) * below_fibers;
        let bounces = share(self.has(Groups::BOUNCES), self.coat.further([cos_to_coat; 2]));
        let odds = [
            share(self.has(Groups::GLOSS), gloss) * below,
            share(self.has(Groups::COAT), self.coat.odds(cos_to_coat, self.base.eta)) * below_fibers,
            (share(self.has(Groups::BASE), base) + more) * below + bounces * below_fibers,
            self.fibers().map_or(0.0, |fibers| {
                share(self.has(Groups::FIBERS), mean(fibers.color) * fibers.albedo(cos))
            }),
        ];
        let sum: f32 = odds.iter().sum();
        if sum <= 0.0 {
            return Odds::default();
        }
        let odds = odds.map(|odds| if odds > 0.0 { (odds / sum).max(LEAST_ODDS) } else { 0.0 });
        let sum: f32 = odds.iter().sum();
        let [gloss, coat, base, fibers] = odds.map(|odds| odds / sum);
        Odds {
            gloss,
            coat,
            base,
            fibers,
        }
    }

    /// Probability that a sampled microfacet reflects light from the front.
    fn reflected(&self, cos: f32) -> f32 {
        let through = (1.0 - fresnel_dielectric(cos.min(1.0), self.base.eta).0) * mean(self.transmission_tint());
        if through <= 0.0 {
            return 1.0;
        }
        let reflected = mean(self.fresnel(cos));
        reflected / (reflected + through)
    }

    #[inline(never)]
    pub(in crate::world::bsdf) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let odds = self.odds(wo);
        if self.is_inside(wo) {
            return match (odds.gloss > 0.0, wi.z < 0.0) {
                (true, is_reflection) => self.pdf_within(wo, wi, is_reflection),
                (false, false) => odds.base * warp::cosine_hemisphere_pdf(wi.z),
                (false, true) => 0.0,
            };
        }
        let Some(sign) = self.turned(wo) else {
            return 0.0;
        };
        let (wo, wi) = (wo * sign, wi * sign);
        if wi.z < 0.0 {
            return match self.transmits() && odds.gloss > 0.0 {
                true => odds.gloss * self.pdf_through(wo, wi),
                false => odds.base * self.sunk() * warp::cosine_hemisphere_pdf(-wi.z),
            };
        }
        if wi.z == 0.0 {
            return 0.0;
        }
        let ways = self.ways(wo, wi, TransportMode::Radiance);
        let mut pdf = 0.0;
        if ways.below.is_lit() {
            let [wo, wi] = ways.below.directions;
            let m = half_vector(wo, wi);
            let cos_d = wo.dot(m);
            pdf = odds.base * (1.0 - self.sunk()) * warp::cosine_hemisphere_pdf(wi.z);
            if odds.gloss > 0.0 {
                pdf += odds.gloss * self.reflected(cos_d) * self.base.facets().reflection_pdf(wo, m);
            }
        }
        if odds.coat > 0.0 && ways.coat.is_lit() {
            let [wo, wi] = ways.coat.directions;
            pdf += self.coat.pdf(odds.coat, wo, half_vector(wo, wi));
        }
        if let Some(fibers) = self.fibers().filter(|_| odds.fibers > 0.0 && ways.below.is_lit()) {
            let [wo, wi] = ways.below.directions;
            pdf += odds.fibers * fibers.pdf(wo, wi);
        }
        pdf
    }

    /// Density of glass for light from its inside. Beneath a film it reflects as often as the film does.
    fn pdf_within(&self, wo: Vec3, wi: Vec3, is_reflection: bool) -> f32 {
        let boundary = self.boundary();
        if self.film().is_none() {
            return boundary.pdf(wo, wi);
        }
        let Some(cos) = boundary.cos_of_facet(wo, wi) else {
            return 0.0;
        };
        let (plain, reflected) = self.reflected_within(cos);
        match is_reflection {
            true => reflected * self.base.facets().reflection_pdf(-wo, half_vector(-wo, -wi)),
            false if plain < 1.0 => boundary.pdf(wo, wi) * (1.0 - reflected) / (1.0 - plain),
            false => 0.0,
        }
    }

    /// Reflectance of a microfacet from the inside without its film, and the probability of reflection.
    fn reflected_within(&self, cos: f32) -> (f32, f32) {
        let (plain, beyond) = fresnel_dielectric(cos.min(1.0), 1.0 / self.base.eta);
        (plain, mean(self.film_reflects(beyond, plain)))
    }

    /// Samples glass beneath a film, from its inside.
    fn sample_within(&self, wo: Vec3, u_lobe: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        let front = -wo;
        let m = self.base.facets().sample_visible(front, u);
        let cos = front.dot(m);
        if cos <= 0.0 {
            return None;
        }
        let is_reflection = u_lobe < self.reflected_within(cos).1;
        let wi = match is_reflection {
            true => m * (2.0 * cos) - front,
            false => {
                let eta = 1.0 / self.base.eta;
                m * (cos / eta - fresnel_dielectric(cos.min(1.0), eta).1) - front / eta
            }
        };
        let wi = -wi.normalize();
        if (wi.z < 0.0) != is_reflection || wi.z == 0.0 {
            return None;
        }
        BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi, mode))
    }

    /// Density of transmission from the front, given that a microfacet is sampled.
    fn pdf_through(&self, wo: Vec3, wi: Vec3) -> f32 {
        let boundary = self.boundary();
        // As for the boundary, with another probability of transmission.
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
    pub(in crate::world::bsdf) fn sample(
        &self,
        wo: Vec3,
        u_lobe: f32,
        u: Vec2,
        mode: TransportMode,
    ) -> Option<BsdfSample> {
        let odds = self.odds(wo);
        if self.is_inside(wo) {
            if odds.gloss > 0.0 && self.film().is_some() {
                return self.sample_within(wo, u_lobe, u, mode);
            }
            if odds.gloss > 0.0 {
                let mut sample = self.boundary().sample(wo, u_lobe, u, mode)?;
                sample.weight *= self.crossing(wo, sample.wi);
                return Some(sample);
            }
            let wi = (odds.base > 0.0).then(|| warp::cosine_hemisphere(u))?;
            return BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi, mode));
        }
        let sign = self.turned(wo)?;
        let mut front = wo * sign;
        // In the frame of the sampled part, if that is not this one.
        let frames = self.has_two_normals().then(|| self.frames());
        let of_coat = u_lobe >= odds.gloss && u_lobe < odds.gloss + odds.coat;
        let frame = frames.map(|[below, coat]| if of_coat { coat } else { below });
        if let Some(frame) = &frame {
            front = frame.to_local(front);
            if front.z <= 0.0 {
                return None;
            }
        }
        let mut transmitted = false;
        // The last choice of all: without fibres nothing lies beyond the base.
        let fibers = (self.fibers()).filter(|_| odds.fibers > 0.0 && u_lobe >= odds.gloss + odds.coat + odds.base);
        let wi = if let Some(fibers) = fibers {
            fibers.sample(front, u)
        } else if u_lobe < odds.gloss {
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
        // On the other side light is diffuse, whatever the normals are here.
        let wi = match &frame {
            Some(frame) if !transmitted => frame.to_world(wi).normalize(),
            _ => wi,
        };
        if (wi.z < 0.0) != transmitted || wi.z == 0.0 {
            return None;
        }
        let wi = wi * sign;
        BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi, mode))
    }
}
