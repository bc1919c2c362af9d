//! Where a camera path may go two ways: at a smooth dielectric, and at a coat over other lobes.

use super::path::Path;
use super::vertex::Vertex;
use super::{CameraTracer, PathContext};
use crate::math::Rgb;
use crate::sampler::Sampler;
use crate::world::bsdf::{BsdfSample, TransportMode};
use crate::world::mask::VisibilityMask;

/// Share of a pixel's light below which a branch no longer splits, but goes one way by chance.
const MIN_SHARE: f32 = 1e-3;
/// Share from which on branches always look for everything. Looking more often costs more than the noise that it
/// removes.
const FULL_SHARE: f32 = 0.3;

/// Branches of a camera path that are yet to be followed.
pub(super) struct Branches<H> {
    pub waiting: Vec<Path<H>>,
    pub splits: u32,
}

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// At a surface with a delta lobe and others, chance decides whether the path goes on along the delta lobe, or
    /// whether only the other lobes count. Either way the delta lobe's sample is returned, for the light that it meets.
    pub(super) fn delta_or_rest(
        &self,
        path: &mut Path<V::Hidden>,
        vertex: &mut Vertex<'_>,
        radiance: &mut Rgb,
        context: &mut PathContext<'_>,
    ) -> Option<BsdfSample> {
        let p = vertex.bsdf.delta_probability(vertex.local_wo);
        let along = context.sampler.next_1d() < p;
        let u = context.sampler.next_2d();
        let mut delta = vertex.bsdf.sample(vertex.local_wo, 0.0, u, TransportMode::Radiance);
        if let Some(delta) = &mut delta {
            delta.weight *= p;
        }
        let rest = path.rest;
        path.rest = if along { rest / p } else { 0.0 };
        if !along {
            vertex.bsdf = vertex.bsdf.without_delta();
            let beta = path.beta * (rest / (1.0 - p));
            if beta != Rgb::ZERO {
                *radiance += context.tint() * self.scattered(vertex, beta, context);
            }
        }
        path.share *= p;
        path.track /= p;
        delta
    }

    /// Go both of two ways: the likelier one is returned, and the other waits. If the less likely way is not
    /// worthwhile, choose one of them by chance.
    pub(super) fn split(
        &self,
        path: &mut Path<V::Hidden>,
        vertex: &Vertex,
        ways: [BsdfSample; 2],
        branches: &mut Branches<V::Hidden>,
        sampler: &mut Sampler,
    ) -> Option<BsdfSample> {
        let [mut strong, mut weak] = ways;
        if weak.pdf > strong.pdf {
            (strong, weak) = (weak, strong);
        }
        if path.share * weak.pdf < MIN_SHARE || branches.splits == self.plan.splits {
            let is_weak = weak.pdf > 0.0 && sampler.next_1d() < weak.pdf;
            return Some(if is_weak { weak } else { strong });
        }
        branches.splits += 1;
        let mut other = *path;
        for (path, way) in [(&mut other, &mut weak), (path, &mut strong)] {
            path.share *= way.pdf;
            path.track /= way.pdf;
            way.weight *= way.pdf;
            // Look for the rest with a probability in proportion to the branch's share, weighted by the inverse.
            let (had, has) = (1.0 / path.rest, (path.share / FULL_SHARE).min(1.0));
            if path.rest > 0.0 && has < had {
                path.rest = if sampler.next_1d() < has / had { 1.0 / has } else { 0.0 };
            }
        }
        if other.turn(vertex, &weak, self.scene, self.mask, sampler) {
            branches.waiting.push(other);
        }
        Some(strong)
    }
}
