//! Spectra to linear sRGB, computed like Mitsuba 3's RGB variants.

use beamfarm_render::world::spectrum::observer::{FIRST, OBSERVER, STEP};
use glam::DVec3;

/// What a spectrum represents, which decides the illuminant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A reflectance or another factor in [0, 1]: under D65, clamped to that range.
    Factor,
    /// A factor without an upper bound, such as an index of refraction: under D65.
    Unbounded,
    /// Emission: as it is.
    Emission,
}

/// Linear sRGB of values at ascending wavelengths (nm), linearly interpolated and zero outside. As in Mitsuba, the
/// integral is a sum over 1000 wavelengths, and negative channels become zero.
pub fn to_rgb(samples: &[(f64, f64)], kind: Kind) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    for i in 0..STEPS {
        let wavelength = FIRST + (LAST - FIRST) * i as f64 / (STEPS - 1) as f64;
        let Some(value) = interpolate(samples, wavelength) else {
            continue;
        };
        let [x, y, z, d65] = observer(wavelength);
        let light = match kind {
            Kind::Factor | Kind::Unbounded => d65 / D65_LUMINANCE,
            Kind::Emission => 1.0,
        };
        for (sum, weight) in xyz.iter_mut().zip([x, y, z]) {
            *sum += weight * value * light;
        }
    }
    let scale = (LAST - FIRST) / STEPS as f64 / Y_INTEGRAL;
    rgb(xyz.map(|sum| sum * scale)).map(|c| match kind {
        Kind::Factor => c.clamp(0.0, 1.0),
        Kind::Unbounded | Kind::Emission => c.max(0.0),
    })
}

/// Linear sRGB of a black body of a temperature in kelvin, divided by its luminance; negative channels become zero.
pub fn black_body(kelvin: f64) -> DVec3 {
    /// Planck's h c / k, nm K.
    const SECOND: f64 = 1.438_776_9e7;
    let mut xyz = [0.0; 3];
    for i in 0..STEPS {
        let wavelength = FIRST + (LAST - FIRST) * i as f64 / (STEPS - 1) as f64;
        // Scaled to avoid overflow.
        let shorter = 560.0 / wavelength;
        let square = shorter * shorter;
        let power = square * square * shorter / libm::expm1(SECOND / (wavelength * kelvin));
        for (sum, weight) in xyz.iter_mut().zip(observer(wavelength)) {
            *sum += weight * power;
        }
    }
    let luminance = xyz[1];
    DVec3::from_array(rgb(xyz.map(|sum| sum / luminance)).map(|c| c.max(0.0)))
}

/// Samples extended beyond both ends by their end values.
pub fn held(mut samples: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if let (Some(&(low, first)), Some(&(high, last))) = (samples.first(), samples.last()) {
        if low > FIRST {
            samples.insert(0, (FIRST, first));
        }
        if high < LAST {
            samples.push((LAST, last));
        }
    }
    samples
}

/// Linear sRGB of a spectrum that is 1 everywhere: what `<spectrum value="1"/>` emits.
pub const EQUAL_ENERGY: [f64; 3] = [1.204794, 0.948291, 0.908916];

/// XYZ to linear sRGB (ITU-R BT.709 primaries, D65 white), rounded like Mitsuba's.
fn rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240479 * x - 1.537150 * y - 0.498535 * z,
        -0.969256 * x + 1.875991 * y + 0.041556 * z,
        0.055648 * x - 0.204043 * y + 1.057311 * z,
    ]
}

fn interpolate(samples: &[(f64, f64)], at: f64) -> Option<f64> {
    let after = samples.partition_point(|(wavelength, _)| *wavelength <= at);
    let (x0, y0) = *samples.get(after.checked_sub(1)?)?;
    match samples.get(after) {
        Some((x1, y1)) => Some(y0 + (y1 - y0) * (at - x0) / (x1 - x0)),
        None => (at == x0).then_some(y0),
    }
}

fn observer(wavelength: f64) -> [f64; 4] {
    let t = (wavelength - FIRST) / STEP;
    let i = (t as usize).min(OBSERVER.len() - 2);
    let fraction = t - i as f64;
    std::array::from_fn(|c| OBSERVER[i][c] + (OBSERVER[i + 1][c] - OBSERVER[i][c]) * fraction)
}

const STEPS: usize = 1000;
const LAST: f64 = 830.0;
/// Integral of the observer's y over wavelength, by Mitsuba's quadrature.
const Y_INTEGRAL: f64 = 106.750_259_399_414_06;
/// Normalises D65 to luminance 1.
const D65_LUMINANCE: f64 = 98.997_417_518_762_55;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_holds_for_all_wavelengths() {
        for samples in [
            vec![(550.0, 2.0)],
            vec![(300.0, 2.0), (900.0, 2.0)],
            vec![(400.0, 2.0), (600.0, 2.0)],
        ] {
            for channel in to_rgb(&held(samples), Kind::Unbounded) {
                assert!((channel - 2.0).abs() < 3e-3, "{channel}");
            }
        }
    }

    /// Values from `mi.load_string` in Mitsuba 3.9.1, variant scalar_rgb.
    #[test]
    fn lists_of_wavelengths_give_the_colours_that_mitsuba_gives() {
        let rising = [(400.0, 0.1), (500.0, 0.5), (600.0, 0.8), (700.0, 0.9)];
        let peak = [(400.0, 0.1), (500.0, 2.0), (700.0, 0.2)];
        let flat = [(300.0, 1.0), (900.0, 1.0)];
        type Samples<'a> = &'a [(f64, f64)];
        let cases: [(Samples<'_>, Kind, [f64; 3]); 9] = [
            (&rising, Kind::Factor, [0.878015, 0.635779, 0.270342]),
            (&rising, Kind::Unbounded, [0.878015, 0.635779, 0.270342]),
            (&rising, Kind::Emission, [1.03331, 0.606869, 0.234725]),
            (&peak, Kind::Factor, [0.635677, 1.0, 1.0]),
            (&peak, Kind::Unbounded, [0.635677, 1.72078, 1.07502]),
            (&peak, Kind::Emission, [0.853908, 1.63506, 0.945967]),
            (&flat, Kind::Factor, [0.998985, 0.998874, 0.998802]),
            (&flat, Kind::Emission, [1.20488, 0.948228, 0.909267]),
            (&[(400.0, 0.1), (500.0, 0.5)], Kind::Factor, [0.0, 0.0222131, 0.340056]),
        ];
        for (samples, kind, expected) in cases {
            let found = to_rgb(samples, kind);
            for c in 0..3 {
                let error = (found[c] - expected[c]).abs();
                assert!(
                    error < 1e-5 * expected[c].max(1.0),
                    "{samples:?} {kind:?}: {found:?}, {expected:?}"
                );
            }
        }
    }
}
