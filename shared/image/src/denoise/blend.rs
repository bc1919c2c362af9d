//! How much of a filtered picture is taken in, pixel by pixel.

use super::plane::{Colours, Plane, each};
use super::weights::Pictures;

/// Radius of the windows over which errors are compared, twice in a row.
const WINDOW: usize = 4;
/// Standard deviation of the mean over such windows of what has one of 1 and is independent in all pixels: the root of
/// the sum of the squared weights, which twice in a row are a triangle in x and in y.
const SPREAD: f32 = 2.0 / 3.0 / (2 * WINDOW + 1) as f32;
/// Radius over which shares are smoothed.
const SMOOTH: usize = 4;
/// Pixels around each whose radiance errors are compared with, to all sides.
const SURROUNDINGS: usize = 3;
/// Part of the mean radiance, which is 1, that errors in the dark are compared with at least.
const DARK: f32 = 0.1;

/// What makes sure that a candidate is better, and does not only fit by chance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caution {
    /// Nothing.
    None,
    /// It is better by more than a standard error of the means that are compared, as if pixels were independent.
    StandardError,
}

/// Pictures to which filtered ones are blended, by the error of the halves.
pub struct Blend<'a> {
    pictures: &'a Pictures,
    now: Pictures,
    /// How much the squared error of a pixel counts.
    weight: Plane,
}

impl<'a> Blend<'a> {
    /// The unfiltered pictures; halves of this variance each.
    pub fn new(pictures: &'a Pictures, variance: &Colours) -> Self {
        let grey = |of: &Colours| {
            let [r, g, b] = of;
            Plane::of([r, g, b], |[r, g, b]| (r + g + b) / 3.0)
        };
        let [even, odd, _] = pictures;
        let mean = Plane::of([&grey(even), &grey(odd)], |[even, odd]| 0.5 * (even + odd));
        // What lies around a lamp is as dark as what lies next to it.
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

    /// As they are now.
    pub fn pictures(&self) -> &Pictures {
        &self.now
    }

    /// As they are at the end.
    pub fn into_pictures(self) -> Pictures {
        self.now
    }

    /// Move each pixel towards a candidate, as far as that lessens the error of the mean of both halves around it. The
    /// picture of all passes goes with them: its own filter has weights of less noise, and nothing that could judge it.
    ///
    /// Of halves a and b, now u and v, with changes p and q: as noise of a knows nothing of that in b, the squared
    /// error of (u + v) / 2 is, on average, [(u - b)² + (v - a)² - (a - b)²] / 2 - (u - v)² / 4. With u + t p and v + t
    /// q it is a parabola of t, whose second derivative is (p + q)² / 2. Its slope at 0 is known by its mean over a
    /// window, from which caution takes its standard error.
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
