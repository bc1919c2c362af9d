//! How much of a filtered picture is taken in, pixel by pixel.

use super::plane::{Colours, Plane, each};
use super::weights::Halves;

/// Radius of the windows over which errors are compared, twice in a row.
const WINDOW: usize = 4;
/// Radius over which shares are smoothed.
const SMOOTH: usize = 2;
/// Pixels around each whose radiance errors are compared with, to all sides.
const SURROUNDINGS: usize = 3;
/// Part of the mean radiance, which is 1, that errors in the dark are compared with at least.
const DARK: f32 = 0.1;

/// A picture to which filtered ones are blended, with the error of its halves.
pub struct Blend<'a> {
    halves: &'a Halves,
    now: Halves,
    /// How much the squared error of a pixel counts.
    weight: Plane,
}

impl<'a> Blend<'a> {
    /// The unfiltered halves, of this variance each.
    pub fn new(halves: &'a Halves, variance: &Colours) -> Self {
        let grey = |of: &Colours| {
            let [r, g, b] = of;
            Plane::of([r, g, b], |[r, g, b]| (r + g + b) / 3.0)
        };
        let [even, odd] = [grey(&halves[0]), grey(&halves[1])];
        let mean = Plane::of([&even, &odd], |[even, odd]| 0.5 * (even + odd)).blurred(SURROUNDINGS);
        let weight = Plane::of([&mean, &grey(variance)], |[mean, variance]| {
            1.0 / (mean * mean + DARK * DARK + variance)
        });
        Self {
            halves,
            now: halves.clone(),
            weight,
        }
    }

    /// As it is now.
    pub fn halves(&self) -> &Halves {
        &self.now
    }

    /// As it is at the end.
    pub fn into_halves(self) -> Halves {
        self.now
    }

    /// Move each pixel towards a candidate, as far as that lessens the error of the mean of both halves around it.
    ///
    /// Of halves a and b, now u and v, with changes p and q: as noise of a knows nothing of that in b, the squared
    /// error of (u + v) / 2 is, on average, [(u - b)² + (v - a)² - (a - b)²] / 2 - (u - v)² / 4. With u + t p and v + t
    /// q it is a parabola of t, whose second derivative is (p + q)² / 2.
    pub fn take_in(&mut self, candidate: &Halves) {
        let [a, b] = self.halves;
        let [u, v] = &self.now;
        let [x, y] = candidate;
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
        let mean = |sum: Plane| {
            let weighted = Plane::of([&sum, &self.weight], |[sum, weight]| sum * weight);
            weighted.blurred(WINDOW).blurred(WINDOW)
        };
        let (bend, slope) = (mean(bend), mean(slope));
        let share = Plane::of([&bend, &slope], |[bend, slope]| match slope < 0.0 && bend > 0.0 {
            true => (-slope / bend).min(1.0),
            false => 0.0,
        });
        let share = share.blurred(SMOOTH);
        self.now = std::array::from_fn(|side: usize| {
            each(|c| {
                Plane::of(
                    [&self.now[side][c], &candidate[side][c], &share],
                    |[now, new, share]| now + share * (new - now),
                )
            })
        });
    }
}
