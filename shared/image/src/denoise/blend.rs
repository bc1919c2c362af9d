//! How much of a filtered picture to take over, pixel by pixel.

use super::plane::{Colours, Plane, each};
use super::weights::Pictures;

/// Radius of the windows over which errors are compared; applied twice in a row.
const WINDOW: usize = 4;
/// Standard deviation of the mean over such windows, for pixels that are independent with standard deviation 1: the
/// root of the sum of the squared weights, which after two windows form a triangle in x and in y.
const SPREAD: f32 = 2.0 / 3.0 / (2 * WINDOW + 1) as f32;
/// Radius over which to smooth shares.
const SMOOTH: usize = 4;
/// Radius of the surroundings whose radiance errors are compared with, in pixels.
const SURROUNDINGS: usize = 3;
/// Part of the mean radiance, which is 1, with which errors in the dark are compared at least.
const DARK: f32 = 0.1;

/// Guards against a candidate that fits only by chance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caution {
    /// No guard.
    None,
    /// The candidate must be better by more than a standard error of the compared means, as if pixels were independent.
    StandardError,
}

/// Pictures into which filtered ones are blended, judged by the error of the halves.
pub struct Blend<'a> {
    pictures: &'a Pictures,
    now: Pictures,
    /// Weight of a pixel's squared error.
    weight: Plane,
}

impl<'a> Blend<'a> {
    /// Starts from the unfiltered pictures, whose halves have this variance each.
    pub fn new(pictures: &'a Pictures, variance: &Colours) -> Self {
        let grey = |of: &Colours| {
            let [r, g, b] = of;
            Plane::of([r, g, b], |[r, g, b]| (r + g + b) / 3.0)
        };
        let [even, odd, _] = pictures;
        let mean = Plane::of([&grey(even), &grey(odd)], |[even, odd]| 0.5 * (even + odd));
        // The surroundings of a lamp are as dark as what lies next to it.
        let mean = Plane::of([&mean.blurred(SURROUNDINGS), &mean.blurred(1)], |[far, near]| {
            if near.abs() < far { near.abs() } else { far }
        });
        let weight = Plane::of([&mean, &grey(variance)], |[mean, variance]| {
            1.0 / (mean * mean + DARK * DARK + variance)
        });
        Self {
            pictures,
            now: pictures.clone(),
            weight,
        }
    }

    /// The current pictures.
    pub fn pictures(&self) -> &Pictures {
        &self.now
    }

    /// The final pictures.
    pub fn into_pictures(self) -> Pictures {
        self.now
    }

    /// Move each pixel towards a candidate, as far as that lowers the error of the mean of both halves around it. The
    /// picture of all passes moves with them: its own filter has less noisy weights, but there is nothing to judge it
    /// by.
    ///
    /// Let the halves a and b now be u and v, with changes p and q. The noise of a is independent of that of b, so the
    /// squared error of (u + v) / 2 is, on average, [(u - b)² + (v - a)² - (a - b)²] / 2 - (u - v)² / 4. With u + t p
    /// and v + t q, it is a parabola in t, whose second derivative is (p + q)² / 2. Its slope at 0 is estimated by the
    /// mean over a window, whose standard error caution uses.
    pub fn take_in(&mut self, candidate: &Pictures, caution: Caution) {
        let [a, b, _] = self.pictures;
        let [u, v, _] = &self.now;
        let [x, y, _] = candidate;
        let mut bend = Plane::new(self.weight.width, self.weight.height);
        let mut slope = bend.clone();
        for c in 0..3 {
            bend = Plane::of([&bend, &u[c], &v[c], &x[c], &y[c]], |[sum, u, v, x, y]| {
                let both = (x - u) + (y - v);
                sum + 0.5 * both * both
            });
            slope = Plane::of(
                [&slope, &a[c], &b[c], &u[c], &v[c], &x[c], &y[c]],
                |[sum, a, b, u, v, x, y]| {
                    let (p, q) = (x - u, y - v);
                    sum + p * (u - b) + q * (v - a) - 0.5 * (u - v) * (p - q)
                },
            );
        }
        let weighted = |sum: &Plane| Plane::of([sum, &self.weight], |[sum, weight]| sum * weight);
        let mean = |plane: &Plane| plane.blurred(WINDOW).blurred(WINDOW);
        let (bend, slope) = (weighted(&bend), weighted(&slope));
        let squares = mean(&Plane::of([&slope], |[slope]| slope * slope));
        let (bend, slope) = (mean(&bend), mean(&slope));
        let share = Plane::of([&bend, &slope, &squares], |[bend, slope, squares]| {
            let slope = match caution {
                Caution::None => slope,
                Caution::StandardError => slope + SPREAD * squares.sqrt(),
            };
            match slope < 0.0 && bend > 0.0 {
                true => (-slope / bend).min(1.0),
                false => 0.0,
            }
        });
        let share = share.blurred(SMOOTH);
        self.now = std::array::from_fn(|of: usize| {
            each(|c| {
                Plane::of([&self.now[of][c], &candidate[of][c], &share], |[now, new, share]| {
                    now + share * (new - now)
                })
            })
        });
    }
}
