//! Whether a few pixels hold most of an image's error, which is larger than that of a path tracer in the same time.

use super::images::Images;

/// Error of the passes that a few pixels hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outliers {
    /// Relative mean square error of the passes, over that of the path tracer for the same number of samples, of which
    /// a pass counts for several.
    pub ratio: f64,
    /// How many pixels hold most of it.
    pub pixels: usize,
    /// Share of the error that they hold.
    pub share: f64,
}

/// Times the error of a path tracer from which on outliers are too many.
const RATIO: f64 = 20.0;
/// Share of the pixels, and of the error that they hold at least.
const PIXELS: f64 = 0.01;
const SHARE: f64 = 0.6;
/// Samples of the path tracer that a pass is given for: about what it costs. The time that it takes here would make
/// another verdict each time.
const SAMPLES_OF_PASS: f64 = 5.0;
/// Relative error that is none: squared.
const FLOOR: f64 = 1e-7;

/// The outliers of the passes' picture, if they are too many.
pub fn outliers(passes: &Images, reference: &Images) -> Option<Outliers> {
    let count = passes.pixels.len() as f64;
    let all = reference.pixels.iter().flatten();
    let mean = all.map(|e| e.mean()).sum::<f64>() / (3.0 * count);
    if mean <= 0.0 {
        // What the path tracer never found has no error to compare with.
        return None;
    }
    let mut ours = Vec::with_capacity(passes.pixels.len());
    let mut theirs = 0.0;
    for (p, r) in passes.pixels.iter().zip(&reference.pixels) {
        let mut error = 0.0;
        for (p, r) in p.iter().zip(r) {
            let weight = 1.0 / (r.mean() * r.mean() + 0.01 * mean * mean + f64::MIN_POSITIVE);
            let variance = r.std_error() * r.std_error();
            let off = p.mean() - r.mean();
            // Noise of the path tracer in a pixel is no error of the passes.
            error += weight * (off * off - 4.0 * variance).max(0.0);
            theirs += weight * variance;
        }
        ours.push(error);
    }
    ours.sort_by(|a, b| b.total_cmp(a));
    let sum: f64 = ours.iter().sum();
    let pixels = (PIXELS * count).ceil() as usize;
    let share = ours.iter().take(pixels).sum::<f64>() / sum;
    let samples = SAMPLES_OF_PASS * passes.samples as f64 / reference.samples as f64;
    let ratio = sum / (3.0 * count) * samples / (theirs / (3.0 * count)).max(FLOOR);
    (ratio > RATIO && share > SHARE).then_some(Outliers { ratio, pixels, share })
}
