//! A picture that is less noisy than the average of its passes, but biased: it never replaces the average.
//!
//! The passes of even and of odd index make two pictures of the same scene with independent noise. A photon's kernel
//! covers many pixels, so neighbouring pixels have similar noise, and no filter can judge by the differences between
//! neighbours. Here, each half is filtered on its own at several resolutions. The other half, which that filter has not
//! seen, then decides pixel by pixel how much of the filtered half to take over. The same share is taken from the
//! average, filtered likewise, whose weights are less noisy. Where there is no gain, the average stays. At the end,
//! light that both halves have lost is given back.
//!
//! Distances of patches follow Rousselle, Knaus, Zwicker 2012, *Adaptive rendering with non-local means filtering*.

mod blend;
mod energy;
mod plane;
mod weights;

use crate::film::Film;
use blend::{Blend, Caution};
use plane::{Colours, Plane, each};
use weights::{Patch, Pictures, Strength, despiked, filtered};

/// Most halvings of the resolution.
const LEVELS: usize = 3;
/// Pictures with a shorter side than this are not halved, in pixels.
const MIN_SIDE: usize = 32;

/// What denoising needs: the average of passes, and its layers.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Number of passes.
    pub passes: u64,
    /// Their mean radiance.
    pub beauty: &'a Film,
    /// Mean over all passes of [`Layer::Odd`](crate::layer::Layer::Odd).
    pub odd: &'a Film,
    /// Mean of [`Layer::Albedo`](crate::layer::Layer::Albedo).
    pub albedo: &'a Film,
    /// Mean of [`Layer::Normal`](crate::layer::Layer::Normal).
    pub normal: &'a Film,
    /// Distance of the first surface, by pixel; infinite or very large where there is none.
    pub depth: &'a [f32],
}

/// A picture that cannot be denoised.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DenoiseError {
    /// There are no two halves.
    #[error("there are {0} passes; expected 2 at least, half of which tell the noise of the others")]
    Passes(u64),
    /// A layer has another size, or none.
    #[error("{what}: {found} pixels, expected {expected}")]
    Size {
        /// Which layer.
        what: &'static str,
        /// Pixels of the layer.
        found: usize,
        /// Pixels of the beauty.
        expected: usize,
    },
    /// A value is NaN or infinite.
    #[error("{what} has a NaN or an infinity at x = {x}, y = {y}")]
    NonFinite {
        /// Which layer.
        what: &'static str,
        /// Column of the first such pixel.
        x: u32,
        /// Row of the first such pixel.
        y: u32,
    },
}

impl Input<'_> {
    fn check(&self) -> Result<(), DenoiseError> {
        if self.passes < 2 {
            return Err(DenoiseError::Passes(self.passes));
        }
        let expected = self.beauty.pixels.len();
        let films = [
            ("beauty", self.beauty),
            ("odd", self.odd),
            ("albedo", self.albedo),
            ("normal", self.normal),
        ];
        for (what, film) in films {
            let found = film.pixels.len();
            let [width, height] = [film.width as usize, film.height as usize];
            let is_like = [film.width, film.height] == [self.beauty.width, self.beauty.height];
            if found == 0 || !is_like || width.checked_mul(height) != Some(found) {
                return Err(DenoiseError::Size { what, found, expected });
            }
            if let Some(i) = film.pixels.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
                let (x, y) = (i as u32 % film.width, i as u32 / film.width);
                return Err(DenoiseError::NonFinite { what, x, y });
            }
        }
        match self.depth.len() {
            found if found != expected => Err(DenoiseError::Size {
                what: "depth",
                found,
                expected,
            }),
            _ => Ok(()),
        }
    }
}

/// Denoises a picture. The bits of the result do not depend on the number of threads.
pub fn denoise(input: &Input) -> Result<Film, DenoiseError> {
    input.check()?;
    let beauty = input.beauty;
    // With values around one, no square overflows.
    let values = beauty.pixels.as_flattened();
    let magnitude = values.iter().map(|v| f64::from(v.abs())).sum::<f64>() / values.len() as f64;
    if magnitude == 0.0 {
        return Ok(beauty.clone());
    }
    let passes = input.passes as f64;
    let odd_passes = (input.passes / 2) as f64;
    let even_passes = passes - odd_passes;
    let even = colours(beauty, |i, c| {
        let even = f64::from(beauty.pixels[i][c]) - f64::from(input.odd.pixels[i][c]);
        even * passes / (even_passes * magnitude)
    });
    let odd = colours(beauty, |i, c| {
        f64::from(input.odd.pixels[i][c]) * passes / (odd_passes * magnitude)
    });
    let all = colours(beauty, |i, c| f64::from(beauty.pixels[i][c]) / magnitude);
    let level = Level {
        pictures: [even, odd, all],
        features: features(input),
        halvings: 0,
    };
    let all = energy::restored(&level.pictures, &level.denoised(), &level.variance());
    let mut film = Film::new(beauty.width, beauty.height);
    for (i, pixel) in film.pixels.iter_mut().enumerate() {
        *pixel = std::array::from_fn(|c| (f64::from(all[c].values[i]) * magnitude) as f32);
    }
    Ok(film)
}

fn colours(like: &Film, value: impl Fn(usize, usize) -> f64 + Sync) -> Colours {
    let (width, height) = (like.width as usize, like.height as usize);
    each(|c| {
        Plane::from_rows(width, height, |y, row| {
            for (x, out) in row.iter_mut().enumerate() {
                *out = value(y * width + x, c) as f32;
            }
        })
    })
}

/// How much features of pixels that belong together may differ, where their slope does not allow more.
const ALBEDO: f32 = 0.02;
const NORMAL: f32 = 0.06;
const NEARNESS: f32 = 0.03;
/// How many times its slope a feature may differ by.
const SLOPES: f32 = 2.0;

/// A feature, and how much it may differ.
struct Feature {
    plane: Plane,
    least: f32,
}

/// Albedo, normal, and nearness of the first surface: 1 at the camera, 1/2 at a mean distance, 0 where there is none.
fn features(input: &Input) -> Vec<Feature> {
    let (width, height) = (input.beauty.width as usize, input.beauty.height as usize);
    let film = |film: &Film, least| {
        let planes = colours(film, |i, c| f64::from(film.pixels[i][c]));
        planes.map(|plane| Feature { plane, least })
    };
    let mut features = Vec::from(film(input.albedo, ALBEDO));
    features.extend(film(input.normal, NORMAL));
    // Infinitely distant points, and those marked by a very large distance, hardly count.
    let (mut sum, mut squares) = (0.0, 0.0);
    for depth in input.depth.iter().map(|depth| f64::from(depth.abs())) {
        if depth.is_finite() && depth > 0.0 {
            sum += 1.0 / depth;
            squares += 1.0 / (depth * depth);
        }
    }
    let scale = if squares > 0.0 { sum / squares } else { 1.0 };
    let plane = Plane::from_rows(width, height, |y, row| {
        for (x, out) in row.iter_mut().enumerate() {
            let depth = f64::from(input.depth[y * width + x].abs());
            let near = scale / (scale + depth);
            *out = if near.is_finite() { near as f32 } else { 0.0 };
        }
    });
    features.push(Feature { plane, least: NEARNESS });
    features
}

/// How to compare pixels, from careful to bold.
const STRENGTHS: [Strength; 3] = [
    Strength {
        patch: Patch::Small,
        errors: 0.45,
    },
    Strength {
        patch: Patch::Large,
        errors: 0.45,
    },
    Strength {
        patch: Patch::Large,
        errors: 1.0,
    },
];

/// Radius over which relative variances are averaged, in pixels.
const VARIANCE_RADIUS: usize = 8;
/// Radius of the surroundings whose radiance variances are relative to, in pixels.
const RADIANCE_RADIUS: usize = 2;
/// Least radiance that variances are relative to, as a part of the mean radiance.
const DARK: f32 = 0.05;

/// Below this part of the mean radiance, which is 1, pixels are not told apart by their coarse parts.
const COARSE_DARK: f32 = 0.1;

/// The picture at one resolution.
struct Level {
    pictures: Pictures,
    features: Vec<Feature>,
    halvings: usize,
}

impl Level {
    fn denoised(&self) -> Pictures {
        let variance = self.variance();
        let features: Vec<(Plane, Plane)> = self.features.iter().map(Feature::with_tolerance).collect();
        let despiked = self.pictures.each_ref().map(despiked);
        // A firefly is alone in its window: no standard error of a mean could confirm it.
        let mut blend = Blend::new(&self.pictures, &variance);
        blend.take_in(&despiked, Caution::None);
        let calm = blend.into_pictures();
        let mut blend = Blend::new(&calm, &variance);
        for candidate in &filtered([&self.pictures, &despiked], &variance, &features, STRENGTHS) {
            blend.take_in(candidate, Caution::StandardError);
        }
        let [width, height] = self.size();
        if self.halvings < LEVELS && width.min(height) >= MIN_SIDE {
            let coarse = self.halved().denoised();
            let now = blend.pictures();
            let candidate = std::array::from_fn(|of: usize| with_coarse(&now[of], &coarse[of]));
            blend.take_in(&candidate, Caution::StandardError);
        }
        blend.into_pictures()
    }

    fn size(&self) -> [usize; 2] {
        [self.pictures[0][0].width, self.pictures[0][0].height]
    }

    /// Variance of each half, from the difference of the halves. Averaged widely, relative to the radiance: a pixel's
    /// own difference must not decide how much it is filtered, or pixels with the same error in both halves would keep
    /// it.
    fn variance(&self) -> Colours {
        let [even, odd, _] = &self.pictures;
        let mut mean = Plane::new(even[0].width, even[0].height);
        for plane in even.iter().chain(odd) {
            mean = Plane::of([&mean, plane], |[mean, value]| mean + value / 6.0);
        }
        let mean = mean.blurred(RADIANCE_RADIUS);
        let squares = mean.values.iter().map(|v| f64::from(v.abs())).sum::<f64>() / mean.values.len() as f64;
        let dark = DARK * squares as f32;
        let square = Plane::of([&mean], |[mean]| mean * mean + dark * dark + f32::MIN_POSITIVE);
        each(|c| {
            let relative = Plane::of([&even[c], &odd[c], &square], |[even, odd, square]| {
                0.5 * (even - odd) * (even - odd) / square
            });
            let relative = relative.blurred(VARIANCE_RADIUS);
            Plane::of([&relative, &square], |[relative, square]| relative * square)
        })
    }

    /// The same at half the resolution.
    fn halved(&self) -> Self {
        Self {
            pictures: std::array::from_fn(|of: usize| each(|c| self.pictures[of][c].halved())),
            features: self.features.iter().map(Feature::halved).collect(),
            halvings: self.halvings + 1,
        }
    }
}

/// Replaces the coarse part of a picture; less of it where a pixel is darker than the coarse pixels around it, because
/// a hundredth of a lamp within one of these would outshine it.
fn with_coarse(picture: &Colours, coarse: &Colours) -> Colours {
    let grey = |[r, g, b]: &Colours| Plane::of([r, g, b], |[r, g, b]| ((r + g + b) / 3.0).abs());
    let before = picture.each_ref().map(Plane::halved);
    let [fine, most] = [grey(picture), grey(&before).maxima()];
    let (width, height) = (fine.width, fine.height);
    let share = Plane::of(
        [&fine.blurred(1), &fine.blurred(3), &most.doubled(width, height)],
        |[near, far, most]| {
            let here = if near < far { near } else { far };
            ((here + COARSE_DARK) / (most + COARSE_DARK)).min(1.0)
        },
    );
    each(|c| {
        let change = Plane::of([&coarse[c], &before[c]], |[new, old]| new - old);
        Plane::of(
            [&picture[c], &change.doubled(width, height), &share],
            |[value, change, share]| value + share * change,
        )
    })
}

impl Feature {
    fn halved(&self) -> Self {
        Self {
            plane: self.plane.halved(),
            least: self.least,
        }
    }

    /// The plane, and the inverse square of how much it may differ. A ramp may differ by its slope; a step has none.
    fn with_tolerance(&self) -> (Plane, Plane) {
        let plane = &self.plane;
        let least = self.least * self.least;
        let inverse = Plane::from_rows(plane.width, plane.height, |y, row| {
            let last = (plane.width - 1, plane.height - 1);
            let (above, here, below) = (
                plane.row(y.saturating_sub(1)),
                plane.row(y),
                plane.row(last.1.min(y + 1)),
            );
            for (x, out) in row.iter_mut().enumerate() {
                let value = here[x];
                let slope = |before: f32, after: f32| {
                    let (before, after) = ((value - before).abs(), (after - value).abs());
                    if before < after { before } else { after }
                };
                let across = slope(here[x.saturating_sub(1)], here[last.0.min(x + 1)]);
                let down = slope(above[x], below[x]);
                let slopes = SLOPES * SLOPES * (across * across + down * down);
                *out = 1.0 / if slopes > least { slopes } else { least };
            }
        });
        (plane.clone(), inverse)
    }
}
