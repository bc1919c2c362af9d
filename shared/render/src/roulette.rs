//! Russian roulette: when a path ends by chance.

use crate::sampler::Sampler;

/// Camera paths go on with this many times their throughput.
pub(crate) const FACTOR: f32 = 2.0;

/// From this many turns on, camera paths that only deltas have turned end by chance.
pub(crate) const DEPTH_OF_DELTAS: u32 = 24;

/// From this many scatterings on, a path goes on with a probability of at most [`MOST_TRAPPED`], so that light which is
/// trapped (total internal reflection in a clear sphere, say) ends as well. Late and mild, because each survival makes
/// the path heavier.
const TRAPPED_DEPTH: u32 = 1024;
const MOST_TRAPPED: f32 = 0.999;

/// Whether a path of so many scatterings goes on, which it does with the probability `q`, or surely where that is one
/// or more: by what its throughput is to be divided.
#[inline]
pub(crate) fn survives(q: f32, depth: u32, sampler: &mut Sampler) -> Option<f32> {
    let q = if depth > TRAPPED_DEPTH { q.min(MOST_TRAPPED) } else { q };
    if q >= 1.0 {
        return Some(1.0);
    }
    (q > 0.0 && sampler.next_1d() < q).then_some(q)
}
