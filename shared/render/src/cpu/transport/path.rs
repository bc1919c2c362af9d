//! A camera path up to its first vertex: what it carries, how it leaves a surface, and whether it survives.

use super::vertex::Vertex;
use crate::cpu::beam::estimate::{Turn, Way};
use crate::math::{Ray, Rgb, Vec3};
use crate::roulette;
use crate::sampler::Sampler;
use crate::world::Scene;
use crate::world::bsdf::BsdfSample;
use crate::world::geometry::SurfaceHit;
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::MediumId;
use crate::world::spectrum::Wave;

/// A camera path on its way, or a branch of one.
#[derive(Clone, Copy)]
pub(super) struct Path<H> {
    pub ray: Ray,
    /// What the ray does not see.
    pub hidden: H,
    /// Throughput from the film.
    pub beta: Rgb,
    /// Throughput without the compression by refraction, and as if the path were no branch.
    pub track: Rgb,
    /// The path's wavelength, once it has met a dispersive surface.
    pub wave: Option<Wave>,
    pub medium: MediumId,
    pub way: Way,
    pub depth: u32,
    /// Whether it has followed a lobe that is not a delta.
    pub is_blurred: bool,
    /// The probability of all the branches that it took, had they been chosen by chance.
    pub share: f32,
    /// Factor on all light except what the path meets: one over the probability of looking for it, or zero if it is not
    /// looked for.
    pub rest: f32,
    /// The followed lobe that the direction was drawn from, if lights were sampled there as well.
    pub drawn: Option<Lobe>,
}

/// Where a lobe that is not a delta was followed.
#[derive(Clone, Copy)]
pub(super) struct Lobe {
    pub point: Vec3,
    pub density: f32,
    pub distance: f32,
    pub object: u32,
}

impl<H> Path<H> {
    /// Russian roulette: the path goes on with the probability `q`.
    pub(super) fn survives(&mut self, q: f32, sampler: &mut Sampler) -> bool {
        let survived = roulette::survives(q, self.depth, sampler);
        if let Some(q) = survived {
            self.beta /= q;
            self.track /= q;
        }
        survived.is_some()
    }

    /// Leave a surface in a sampled direction. Returns false if the path ends.
    pub(super) fn turn(
        &mut self,
        vertex: &Vertex,
        sample: &BsdfSample,
        scene: &Scene,
        mask: impl VisibilityMask<Hidden = H>,
        sampler: &mut Sampler,
    ) -> bool {
        let hit: &SurfaceHit = vertex.hit;
        let wi = vertex.frame.to_world(sample.wi).normalize();
        if vertex.bump_shadowing.is_some() && sample.wi.z * hit.ng.dot(wi) <= 0.0 {
            return false;
        }
        if sample.transmitted {
            self.medium = scene.medium_beyond(hit, wi, self.medium);
        }
        self.beta *= vertex.weight(sample);
        self.track *= sample.weight;
        if sample.transmitted {
            // The compression of radiance by refraction comes and goes along the path.
            let eta = vertex
                .material
                .eta_of_crossing(hit.ng.dot(self.ray.dir) > 0.0, self.wave);
            self.track /= eta * eta;
        }
        self.depth += 1;
        self.is_blurred |= !sample.delta;
        if sample.delta {
            let q = match self.is_blurred {
                true => roulette::FACTOR * self.track.max_element(),
                // A sharp path has no noise but that of roulette, which comes late and depends on the reflectance
                // alone.
                false if self.depth > roulette::DEPTH_OF_DELTAS => sample.weight.max_element(),
                false => 1.0,
            };
            if !self.survives(q, sampler) {
                return false;
            }
        }
        self.drawn = (!sample.delta).then_some(Lobe {
            point: hit.point,
            density: sample.pdf,
            distance: 0.0,
            object: hit.object,
        });
        self.ray = hit.spawn_ray(wi);
        self.hidden = mask.from(match sample.transmitted {
            true => Start::Refracted(hit.object),
            false => Start::Reflected(hit.object),
        });
        self.way = self.way.then(match sample.transmitted {
            true => Turn::Refracted,
            false => Turn::Reflected,
        });
        self.beta.max_element() > 0.0
    }
}
