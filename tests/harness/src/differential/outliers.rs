//! Whether a few pixels hold most of an image's error, and this error exceeds that of a path tracer in the same time.

use super::images::Images;

/// Error of the passes in a few pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outliers {
    /// Relative mean square error of the passes, over that of the path tracer in about the same time.
    pub ratio: f64,
    /// How many pixels hold most of it.
    pub pixels: usize,
    /// Share of the error that they hold.
    pub share: f64,
}

/// The ratio to a path tracer's error from which on outliers are too many.
const RATIO: f64 = 20.0;
/// Share of the pixels examined, and the share of the error from which on they are too many.
const PIXELS: f64 = 0.01;
const SHARE: f64 = 0.6;
/// Squared relative error that counts as none.
const FLOOR: f64 = 1e-7;

/// The outliers of a picture, if they are too many.
pub fn outliers(images: &Images, reference: &Images) -> Option<Outliers> {
    tail(images, reference).filter(|o| o.ratio > RATIO && o.share > SHARE)
}

/// Whether the scene itself has the outliers that passes had: in some of its `controls` the path tracer's error is not
/// far smaller, all compared with the same deep picture. A light in thick smoke has a tail that few pictures show.
pub fn are_of_scene(found: &Outliers, mut controls: impl Iterator<Item = Images>, reference: &Images) -> bool {
    controls.any(|control| tail(&control, reference).is_some_and(|own| RATIO * own.ratio.max(1.0) > found.ratio))
}

/// The pixels that hold most of the error.
fn tail(images: &Images, reference: &Images) -> Option<Outliers> {
    let count = images.pixels.len() as f64;
    let all = reference.pixels.iter().flatten();
    let mean = all.map(|e| e.mean()).sum::<f64>() / (3.0 * count);
    if mean <= 0.0 {
        // There is no error to compare with where the path tracer found nothing.
        return None;
    }
    let mut ours = Vec::with_capacity(images.pixels.len());
    let mut theirs = 0.0;
    for (p, r) in images.pixels.iter().zip(&reference.pixels) {
        let mut error = 0.0;
        for (p, r) in p.iter().zip(r) {
            let weight = 1.0 / (r.mean() * r.mean() + 0.01 * mean * mean + f64::MIN_POSITIVE);
            let variance = r.std_error() * r.std_error();
            let off = p.mean() - r.mean();
            // The deep picture's noise in a pixel is not this picture's error.
            error += weight * (off * off - 4.0 * variance).max(0.0);
            theirs += weight * variance;
        }
        ours.push(error);
    }
    ours.sort_by(|a, b| b.total_cmp(a));
    let sum: f64 = ours.iter().sum();
    let pixels = (PIXELS * count).ceil() as usize;
    let share = ours.iter().take(pixels).sum::<f64>() / sum;
    let work = images.work / reference.work;
    let ratio = sum / (3.0 * count) * work / (theirs / (3.0 * count)).max(FLOOR);
    Some(Outliers { ratio, pixels, share })
}
