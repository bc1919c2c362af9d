//! Surface points where camera paths ask for light.

use crate::math::{Frame, Rgb, Vec3};
use crate::world::bsdf::{Bsdf, BsdfSample, BumpShadowing, Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::mask::Start;
use crate::world::medium::MediumId;
use crate::world::{Scene, SurfaceInteraction};

/// A surface point that asks for light.
#[derive(Clone, Copy)]
pub(super) struct Vertex<'a> {
    pub hit: &'a SurfaceHit,
    /// The material there.
    pub material: &'a Material,
    pub bsdf: Bsdf<'a>,
    /// Set where a bump or normal map has perturbed the hit's shading normal.
    pub bump_shadowing: Option<BumpShadowing>,
    pub frame: Frame,
    pub wo: Vec3,
    pub local_wo: Vec3,
    /// The medium through which the ray came here.
    pub medium: MediumId,
    /// This is gloss that obeys the rules for reflected and refracted rays.
    pub is_gloss: bool,
    /// The BSDF is the lobe that the path follows.
    pub is_followed: bool,
}

/// One lobe of a surface, chosen by chance, or all of them.
pub(super) struct OneLobe {
    /// One over the probability of the choice, unless samples contain it.
    pub weight: f32,
    /// Whether a path follows it.
    pub is_followed: bool,
    /// A uniform number with which to sample it.
    pub u: f32,
}

impl OneLobe {
    /// The only lobe, followed.
    pub(super) fn followed(u: f32) -> Self {
        Self {
            weight: 1.0,
            is_followed: true,
            u,
        }
    }
}

impl<'a> Vertex<'a> {
    /// A hit that a ray reached through a medium.
    pub(super) fn new(at: SurfaceInteraction<'a>, hit: &'a SurfaceHit, medium: MediumId) -> Self {
        Self {
            hit,
            material: at.material,
            bsdf: at.bsdf,
            bump_shadowing: at.bump_shadowing,
            frame: at.frame,
            wo: at.wo,
            local_wo: at.local_wo,
            medium,
            is_gloss: false,
            is_followed: false,
        }
    }

    /// Choose between the lobe that paths follow and all others, if there are both.
    pub(super) fn one_lobe(&mut self, u: f32) -> OneLobe {
        let delta = self.bsdf.delta_probability(self.local_wo);
        if delta > 0.0 {
            // Samples of the delta lobe contain its probability.
            if u < delta {
                return OneLobe::followed(0.0);
            }
            self.bsdf = self.bsdf.without_delta();
            return OneLobe {
                weight: 1.0 / (1.0 - delta),
                is_followed: false,
                u: (u - delta) / (1.0 - delta),
            };
        }
        let Some((p, [narrow, wide])) = self.bsdf.narrow_and_wide(self.local_wo) else {
            return OneLobe {
                weight: 1.0,
                is_followed: false,
                u,
            };
        };
        if u < p {
            self.bsdf = narrow;
            return OneLobe {
                weight: 1.0 / p,
                ..OneLobe::followed(u / p)
            };
        }
        self.bsdf = wide;
        OneLobe {
            weight: 1.0 / (1.0 - p),
            is_followed: false,
            u: (u - p) / (1.0 - p),
        }
    }

    /// The BSDF's value for light from `wi`, in the local frame.
    #[inline]
    pub(super) fn value(&self, wi: Vec3) -> Rgb {
        let bumps = self.bump_shadowing.as_ref();
        self.bsdf.eval_bumped(bumps, self.local_wo, wi, TransportMode::Radiance)
    }

    /// The weight of a sampled direction.
    #[inline]
    pub(super) fn weight(&self, sample: &BsdfSample) -> Rgb {
        let bumps = self.bump_shadowing.as_ref();
        (self.bsdf).weight_bumped(bumps, self.local_wo, sample, TransportMode::Radiance)
    }

    /// Density per solid angle of scattering from one local direction to another.
    #[inline]
    pub(super) fn pdf(&self, from: Vec3, to: Vec3) -> f32 {
        self.bsdf.pdf(from, to)
    }

    /// Whether this is a flat facet that scatters diffusely.
    #[inline]
    pub(super) fn is_even(&self) -> bool {
        self.bump_shadowing.is_none() && self.hit.ns == self.hit.ng && matches!(self.bsdf, Bsdf::Diffuse { .. })
    }

    /// The normal on the side from which a Lambertian surface is lit, if it is seen and lit from the same side.
    #[inline]
    pub(super) fn facing(&self) -> Option<Vec3> {
        let side = self.hit.ng.dot(self.wo).signum();
        matches!(self.bsdf, Bsdf::Diffuse { .. }).then_some(self.hit.ng * side)
    }

    /// What a ray to a light starts as: a shadow ray. If the path goes on by the same lobe and may meet the light as
    /// well, it starts as the path does.
    pub(super) fn shadow_start(&self, wi: Vec3) -> Start {
        match self.is_followed {
            true => self.gloss_towards(wi),
            false => Start::Shadow(self.hit.object),
        }
    }

    /// How a ray leaves gloss: reflected or refracted.
    pub(super) fn gloss_towards(&self, wi: Vec3) -> Start {
        match self.hit.ng.dot(wi) * self.hit.ng.dot(self.wo) < 0.0 {
            true => Start::Refracted(self.hit.object),
            false => Start::Reflected(self.hit.object),
        }
    }

    /// The medium that a ray from here enters: the one through which the vertex was reached, or the one beyond.
    pub(super) fn medium_towards(&self, scene: &Scene, wi: Vec3) -> MediumId {
        let crosses = self.hit.ng.dot(wi) * self.hit.ng.dot(self.wo) < 0.0;
        if crosses {
            scene.medium_beyond(self.hit, wi, self.medium)
        } else {
            self.medium
        }
    }
}
