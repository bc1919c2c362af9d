//! Wavelengths, for scenes in which some material refracts each by a different angle.
//!
//! Light is linear RGB until its path meets such a material. There it becomes light of one wavelength, which the path
//! keeps, with an RGB weight: the response of the sRGB primaries' matching functions to daylight (D65) at that
//! wavelength, over the density with which wavelengths are drawn. The weight's mean is one in each channel, so that
//! light that refracts alike at all wavelengths keeps its colour. Colours outside the sRGB gamut, such as pure spectral
//! ones, have weights with negative channels.
//!
//! A pass has [`WAVES`] wavelengths, drawn from (seed, pass), because photons and camera paths that meet must share
//! them. They are spaced at equal steps of probability and shifted by a common number, which is evenly spread over the
//! passes. A photon keeps its wavelength's number and leaves the weight to the camera path that finds it: see
//! [`WaveSet::factor`].

pub mod observer;

use crate::math::Rgb;
use crate::sampler::{Purpose, Sampler};
use observer::{FIRST, OBSERVER, STEP};
use std::sync::LazyLock;

/// The shortest and longest visible wavelength, nm.
pub const VISIBLE: [f64; 2] = [380.0, 780.0];

/// Wavelengths per pass. The example `wavelengths` of the tests compares other numbers.
pub const WAVES: u8 = 8;

/// The wavelength of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// In vacuum, nm.
    pub nm: f32,
    /// Factor on the path's light, linear sRGB; its mean over drawn wavelengths is one.
    pub weight: Rgb,
    /// Its number within the pass.
    pub number: WaveNumber,
}

/// Number of a wavelength within a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct WaveNumber(u8);

impl WaveNumber {
    /// Index, from 0 on.
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

impl Wave {
    /// A wavelength drawn from their distribution. `u`: uniform in [0, 1).
    pub fn at(u: f32) -> Self {
        let (nm, weight) = DISTRIBUTION.at(f64::from(u));
        Self {
            nm,
            weight,
            number: WaveNumber(0),
        }
    }
}

/// The wavelengths of a pass.
#[derive(Clone, Debug)]
pub struct WaveSet {
    waves: Vec<Wave>,
}

impl WaveSet {
    /// The wavelengths of a pass, this many.
    pub fn of_pass(count: u8, seed: u64, pass_index: u64) -> Self {
        Self::moved_by(
            count,
            Sampler::even(seed, pass_index, Purpose::Wavelengths, 0).next_1d(),
        )
    }

    fn moved_by(count: u8, u: f32) -> Self {
        let wave = |i| Wave {
            number: WaveNumber(i),
            ..Wave::at((f32::from(i) + u) / f32::from(count))
        };
        Self {
            waves: (0..count).map(wave).collect(),
        }
    }

    fn count(&self) -> f32 {
        self.waves.len() as f32
    }

    /// One of them. `u`: uniform in [0, 1).
    #[inline]
    pub fn choose(&self, u: f32) -> Wave {
        self.waves[((u * self.count()) as usize).min(self.waves.len() - 1)]
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Wave> {
        self.waves.iter()
    }

    /// Factor on a photon's power for a camera path, without the path's own weight. Both drew their wavelengths
    /// independently: they agree with a probability of one over the number of wavelengths.
    #[inline]
    pub fn factor(&self, photon: WaveNumber, path: Option<WaveNumber>) -> Rgb {
        match path {
            None => self.waves[photon.index()].weight,
            Some(path) if path == photon => Rgb::splat(self.count()),
            Some(_) => Rgb::ZERO,
        }
    }
}

/// Rows of the observer's table, over the visible wavelengths.
const ROWS: usize = ((VISIBLE[1] - VISIBLE[0]) / STEP) as usize + 1;
const BEFORE: usize = ((VISIBLE[0] - FIRST) / STEP) as usize;

/// The distribution of wavelengths: its density is constant between the observer's rows.
struct Distribution {
    /// Share of the wavelengths below each row.
    below: [f64; ROWS],
    /// At each row: response of the sRGB primaries to daylight, per step; the trapezoid sums are one.
    response: [[f64; 3]; ROWS],
}

/// XYZ to linear sRGB (IEC 61966-2-1).
const SRGB: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// Luminance of linear sRGB.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Share of the density of wavelengths that follows luminance; the rest follows the channels separately. With a share
/// of 1, luminance would have no colour noise, and blue much.
const BY_LUMINANCE: f64 = 0.5;

static DISTRIBUTION: LazyLock<Distribution> = LazyLock::new(Distribution::new);

impl Distribution {
    fn new() -> Self {
        let mut response = std::array::from_fn(|row| {
            let [x, y, z, daylight] = OBSERVER[BEFORE + row];
            SRGB.map(|[by_x, by_y, by_z]| daylight * (by_x * x + by_y * y + by_z * z))
        });
        for channel in 0..3 {
            let trapezoids = response
                .windows(2)
                .map(|rows| 0.5 * (rows[0][channel] + rows[1][channel]));
            let sum: f64 = trapezoids.sum();
            response.iter_mut().for_each(|row| row[channel] /= sum);
        }
        let wanted = response.map(|row| {
            let luminance: f64 = row.iter().zip(LUMINANCE).map(|(value, weight)| value * weight).sum();
            let channels: f64 = row.iter().map(|value| value.abs()).sum();
            BY_LUMINANCE * luminance.max(0.0) + (1.0 - BY_LUMINANCE) * channels / 3.0
        });
        let mut below = [0.0; ROWS];
        for row in 1..ROWS {
            below[row] = below[row - 1] + 0.5 * (wanted[row - 1] + wanted[row]);
        }
        let all = below[ROWS - 1];
        below.iter_mut().for_each(|value| *value /= all);
        Self { below, response }
    }

    /// The wavelength, nm, below which this share lies, and its weight.
    fn at(&self, u: f64) -> (f32, Rgb) {
        let row = self.below.partition_point(|below| *below <= u).clamp(1, ROWS - 1) - 1;
        let density = self.below[row + 1] - self.below[row];
        let place = ((u - self.below[row]) / density).clamp(0.0, 1.0);
        let (low, high) = (self.response[row], self.response[row + 1]);
        let weight = |channel: usize| ((low[channel] * (1.0 - place) + high[channel] * place) / density) as f32;
        let nm = VISIBLE[0] + STEP * (row as f64 + place);
        (nm as f32, Rgb::new(weight(0), weight(1), weight(2)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the midpoints of many parts of the unit interval.
    #[test]
    fn weights_have_a_mean_of_one() {
        let parts = 1 << 16;
        let mut sum = [0.0f64; 3];
        for part in 0..parts {
            let wave = Wave::at((part as f32 + 0.5) / parts as f32);
            assert!((380.0..=780.0).contains(&wave.nm), "{wave:?}");
            for (sum, weight) in sum.iter_mut().zip(wave.weight.to_array()) {
                *sum += f64::from(weight);
            }
        }
        for sum in sum {
            assert!((sum / f64::from(parts) - 1.0).abs() < 1e-4, "{sum}");
        }
    }

    /// An uneven spectrum: its colour from the observer's table, and from drawn wavelengths.
    #[test]
    fn colours_of_spectra_are_those_of_the_observer() {
        let spectrum = |nm: f64| libm::exp(-0.5 * ((nm - 520.0) / 40.0) * ((nm - 520.0) / 40.0));
        let mut xyz = [0.0; 3];
        let mut white = 0.0;
        for (row, [x, y, z, daylight]) in OBSERVER.into_iter().enumerate() {
            let power = daylight * spectrum(FIRST + STEP * row as f64);
            xyz = [xyz[0] + power * x, xyz[1] + power * y, xyz[2] + power * z];
            white += daylight * y;
        }
        let expected = SRGB.map(|row| (row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]) / white);
        let parts = 1 << 14;
        let mut sum = [0.0; 3];
        for part in 0..parts {
            let wave = Wave::at((part as f32 + 0.5) / parts as f32);
            for (sum, weight) in sum.iter_mut().zip(wave.weight.to_array()) {
                *sum += f64::from(weight) * spectrum(f64::from(wave.nm)) / f64::from(parts);
            }
        }
        for (sum, expected) in sum.into_iter().zip(expected) {
            assert!((sum - expected).abs() < 2e-3, "{sum} {expected}");
        }
    }

    /// The passes of a replication have one wavelength in each of as many parts of the distribution.
    #[test]
    fn sets_are_even_over_passes() {
        let mut shifts: Vec<f32> = (0..16)
            .map(|pass| WaveSet::of_pass(WAVES, 7, pass).waves[0].nm)
            .collect();
        shifts.sort_by(f32::total_cmp);
        for (part, nm) in shifts.iter().enumerate() {
            let edge = |part: usize| Wave::at(part as f32 / (16.0 * f32::from(WAVES))).nm;
            assert!((edge(part)..=edge(part + 1)).contains(nm), "{part}: {nm}");
        }
    }

    #[test]
    fn a_path_with_both_ends_bent_is_counted_once() {
        let set = WaveSet::moved_by(WAVES, 0.3);
        let mut sum = Rgb::ZERO;
        for photon in set.iter() {
            for path in set.iter() {
                sum += path.weight * set.factor(photon.number, Some(path.number));
            }
        }
        let once: Rgb = set.iter().map(|wave| set.factor(wave.number, None)).sum();
        assert!(
            (sum / (set.count() * set.count()) - once / set.count())
                .abs()
                .max_element()
                < 1e-5
        );
    }
}
