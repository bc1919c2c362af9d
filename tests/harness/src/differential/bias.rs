//! Whether the means of two renderers differ by more than noise and an allowance.

use super::images::{BLOCK, Images};
use crate::suite::sidak;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::fmt;

/// How much means may differ apart from noise.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    /// Share of the mean of the whole image.
    pub whole: f64,
    /// Share of the mean of a block.
    pub block: f64,
    /// For parts, the share of the same cell's beauty: a part that hardly matters may be further off.
    pub of_beauty: f64,
}

/// The allowance for the final verdict.
pub const STRICT: Allowance = Allowance {
    whole: 0.005,
    block: 0.01,
    of_beauty: 0.002,
};

/// The blur of kernels in the first passes may be this large, if it goes away.
pub const SHRINKING: Allowance = Allowance {
    whole: 0.02,
    block: 0.06,
    of_beauty: 0.01,
};

/// Where two means differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Name of the part of the beauty.
    pub part: String,
    /// Column and row of the block; none for the whole image.
    pub block: Option<[usize; 2]>,
    /// Colour channel.
    pub channel: usize,
    /// Mean of the passes.
    pub passes: f64,
    /// Mean of the path tracer.
    pub reference: f64,
    /// Standard error of their difference.
    pub error: f64,
    /// Probability of a difference this far beyond the allowance if there is no true difference.
    pub p_value: f64,
    /// The darker side's light comes from a few images, so its error is not known.
    pub is_heavy: bool,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.block {
            None => write!(f, "{}, image", self.part)?,
            Some([x, y]) => write!(f, "{}, block {x},{y}", self.part)?,
        }
        let Self {
            passes,
            reference,
            error,
            ..
        } = self;
        let name = ["red", "green", "blue"][self.channel];
        write!(
            f,
            ", {name}: {passes:.4e} for {reference:.4e} ({:+.1} % +- {:.1} %)",
            100.0 * (passes / reference - 1.0),
            100.0 * error / reference.abs(),
        )
    }
}

/// Mean, variance of the mean, and skewness of some values.
struct Moments {
    mean: f64,
    error: f64,
    skewness: f64,
    count: f64,
}

impl Moments {
    fn new(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / count;
        let moment = |power: f64| values.clone().map(|v| libm::pow(v - mean, power)).sum::<f64>() / count;
        let (second, third) = (moment(2.0), moment(3.0));
        let skewness = match second > 0.0 {
            true => third / (second * second.sqrt()),
            false => 0.0,
        };
        Self {
            mean,
            error: (second / (count - 1.0)).sqrt(),
            skewness,
            count,
        }
    }
}

/// Single precision along paths and in means: share of a value.
const ROUNDING: f64 = 2e-5;

/// All differences that are significant at this level, over all cells, parts and channels together (Šidák 1967), least
/// likely first.
pub fn differences(
    names: &[String],
    [passes, reference]: [&Images; 2],
    allowance: &Allowance,
    significance: f64,
) -> Vec<Difference> {
    let mut found = Vec::new();
    let mut tests = 0;
    let beauty = |cell: usize, channel: usize| {
        let images = &reference.means[0][cell];
        images.iter().map(|v| f64::from(v[channel])).sum::<f64>() / images.len() as f64
    };
    // The precision left by the brightest block.
    let cells = reference.means[0].len();
    let brightest = (0..cells).flat_map(|cell| (0..3).map(move |c| (cell, c)));
    let dark = 1e-6 * brightest.map(|(cell, c)| beauty(cell, c)).fold(0.0, f64::max);
    for (part, name) in names.iter().enumerate() {
        // Rare light may not have come here yet.
        let has_tail = [0, 1, 2].map(|channel| {
            (0..cells).any(|cell| {
                [passes, reference].iter().any(|images| {
                    let values = images.means[part][cell].iter().map(|v| v[channel].into());
                    Moments::new(values).skewness > HEAVY
                })
            })
        });
        for cell in 0..cells {
            let own = if cell == 0 { allowance.whole } else { allowance.block };
            for channel in 0..3 {
                let moments =
                    |images: &Images| Moments::new(images.means[part][cell].iter().map(|v| v[channel].into()));
                let (p, r) = (moments(passes), moments(reference));
                if p.mean == 0.0 && r.mean == 0.0 {
                    continue;
                }
                tests += 1;
                let of_beauty = if part == 0 { 0.0 } else { allowance.of_beauty };
                let allowed = own * r.mean.abs() + of_beauty * beauty(cell, channel) + dark;
                let beyond = (p.mean - r.mean).abs() - allowed;
                if beyond.is_nan() || beyond > 0.0 {
                    let p_value = p_value(beyond, [&p, &r]);
                    // Passes that find almost none of the path tracer's light, or far more, have no such excuse.
                    let is_unseen = r.mean == 0.0 && has_tail[channel];
                    let is_heavy = match p.mean < r.mean {
                        true => p.skewness > HEAVY && p.mean > 0.5 * r.mean,
                        false => r.skewness > HEAVY || p.skewness > HEAVY && p.mean < 3.0 * r.mean,
                    };
                    let is_small = (p.mean - r.mean).abs() < SMALL * beauty(cell, channel);
                    let is_heavy = is_heavy || is_unseen || part > 0 && is_small && has_tail[channel];
                    found.push(Difference {
                        part: name.clone(),
                        block: (cell > 0).then(|| {
                            let index = cell - 1;
                            [index % passes.columns, index / passes.columns].map(|i| i * BLOCK)
                        }),
                        channel,
                        passes: p.mean,
                        reference: r.mean,
                        error: p.error.hypot(r.error),
                        p_value,
                        is_heavy,
                    });
                }
            }
        }
    }
    let level = sidak(significance, tests);
    found.retain(|difference| difference.p_value.is_nan() || difference.p_value < level);
    found.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    found
}

/// Skewness of images from which on a single one may hold nearly the whole difference: the sample mean of a heavy tail
/// is usually too small, and so is its error. (One deviating image of n gives about the root of n.)
const HEAVY: f64 = 3.0;

/// For a part with a tail: the allowed difference in a block where none was seen, as a share of the block's beauty.
const SMALL: f64 = 0.02;

/// Two-sided p-value of a difference (Welch 1947).
fn p_value(beyond: f64, [a, b]: [&Moments; 2]) -> f64 {
    let error = a.error.hypot(b.error).max(ROUNDING * a.mean.abs().max(b.mean.abs()));
    if !(beyond / error).is_finite() {
        return f64::NAN;
    }
    let fourth = |m: &Moments| libm::pow(m.error / error, 4.0) / (m.count - 1.0);
    let freedom = (1.0 / (fourth(a) + fourth(b))).clamp(1.0, 1e6);
    match StudentsT::new(0.0, 1.0, freedom) {
        Ok(student) => 2.0 * student.sf(beyond / error),
        Err(_) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MeanEstimate;

    fn images(value: impl Fn(usize) -> f32) -> Images {
        let cell: Vec<[f32; 3]> = (0..40).map(|i| [value(i); 3]).collect();
        Images {
            means: vec![vec![cell; 2]],
            pixels: vec![[MeanEstimate::new(); 3]; 64],
            seconds: 1.0,
            work: 1.0,
            columns: 1,
        }
    }

    #[test]
    fn what_differs_is_found_and_what_does_not_is_not() {
        let names = ["beauty".to_owned()];
        let noisy = |mean: f32| images(move |i| mean + if i % 2 == 0 { 0.01 } else { -0.01 });
        let compare = |a: &Images, b: &Images| differences(&names, [a, b], &STRICT, 1e-3);
        assert!(compare(&noisy(1.004), &noisy(1.0)).is_empty());
        let found = compare(&noisy(1.02), &noisy(1.0));
        assert_eq!(found.len(), 6);
        assert!(found.iter().all(|d| !d.is_heavy));
        // One image holds everything.
        let rare = images(|i| if i == 7 { 1.0 } else { 0.0 });
        assert!(compare(&noisy(0.2), &rare).iter().all(|d| d.is_heavy));
        assert!(compare(&images(|_| f32::NAN), &noisy(1.0)).len() == 6);
    }
}
