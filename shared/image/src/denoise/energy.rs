//! What filters lose of the light, given back.
//!
//! Noise is skewed: a few pixels hold what many lack. A filter that dims the brightest removes light along with the
//! fireflies. What both halves have lost around a pixel was light; what only one has lost was its own firefly.

use super::plane::{Colours, Plane, each};
use super::weights::Pictures;

/// Halvings of the resolution at which losses are compared, and the radius of the windows there, applied twice: about
/// 64 pixels across, so that a loss of a hundredth stands out from the noise.
const HALVINGS: usize = 3;
const WINDOW: usize = 2;

/// The denoised average, with the light that both halves have lost. It goes to where noise is, in proportion to the
/// standard deviation: what has none has lost nothing. But no more than in proportion to the radiance: next to a bright
/// lamp, dark pixels whose noise is great would become bright.
pub fn restored(before: &Pictures, denoised: &Pictures, variance: &Colours) -> Colours {
    each(|c| {
        let lost = |of: usize| wide(&Plane::of([&before[of][c], &denoised[of][c]], |[old, new]| old - new));
        let missing = Plane::of([&lost(0), &lost(1), &lost(2)], |[even, odd, all]| {
            all * agreement(even, odd)
        });
        let share = Plane::of([&denoised[2][c], &variance[c]], |[value, variance]| {
            value.min(variance.max(0.0).sqrt()).max(0.0)
        });
        let around = wide(&share);
        Plane::of(
            [&denoised[2][c], &missing, &share, &around],
            |[value, missing, share, around]| match around > 0.0 {
                true => value + missing * (share / around),
                false => value,
            },
        )
    })
}

/// How much of their mean two independent estimates have in common: 1 if they are equal, 0 if one is zero or they
/// differ in sign.
fn agreement(a: f32, b: f32) -> f32 {
    let square = 0.25 * (a + b) * (a + b);
    match a * b > 0.0 && square > 0.0 {
        true => (a * b / square).min(1.0),
        false => 0.0,
    }
}

/// Means over wide windows.
fn wide(plane: &Plane) -> Plane {
    let mut sizes = Vec::with_capacity(HALVINGS);
    let mut coarse = plane.clone();
    for _ in 0..HALVINGS {
        sizes.push((coarse.width, coarse.height));
        coarse = coarse.halved();
    }
    coarse = coarse.blurred(WINDOW).blurred(WINDOW);
    for (width, height) in sizes.into_iter().rev() {
        coarse = coarse.doubled(width, height);
    }
    coarse
}
