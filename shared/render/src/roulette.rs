//! Russian roulette: when a path ends by chance.

use crate::sampler::Sampler;

/// Camera paths survive with this many times their throughput as the probability.
pub(crate) const FACTOR: f32 = 2.0;

/// Beyond this depth, roulette also ends camera paths that only delta lobes have turned.
pub(crate) const DEPTH_OF_DELTAS: u32 = 24;

/// Beyond this many scatterings, a path goes on with a probability of at most [`MOST_TRAPPED`], so that trapped light
/// (total internal reflection in a clear sphere, say) ends as well. Late and mild, because each survival makes the path
/// heavier.
const TRAPPED_DEPTH: u32 = 1024;
const MOST_TRAPPED: f32 = 0.999;

/// Lets a path of this depth survive with the probability `q`, or surely where that is one or more. Returns what to
/// divide its throughput by; `None` ends the path.
#[inline]
pub(crate) fn survives(q: f32, depth: u32, sampler: &mut Sampler) -> Option<f32> {
    let q = if depth > TRAPPED_DEPTH { q.min(MOST_TRAPPED) } else { q };
    if q >= 1.0 {
        return Some(1.0);
    }
    (q > 0.0 && sampler.next_1d() < q).then_some(q)
}
