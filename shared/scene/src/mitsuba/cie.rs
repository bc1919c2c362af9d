//! Spectra to linear sRGB, as Mitsuba 3's RGB variants do it.

/// What a spectrum stands for decides the light it is seen under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A reflectance or another factor from 0 to 1: under D65, clamped to that range.
    Factor,
    /// A factor without an upper bound, such as an index of refraction: under D65.
    Unbounded,
    /// Emission: as it is.
    Emission,
}

/// Linear sRGB of values at wavelengths (nm) in rising order, linear between them and zero beyond. As Mitsuba does, the
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

/// Linear sRGB of a spectrum that is 1 at all wavelengths: what `<spectrum value="1"/>` emits.
pub const EQUAL_ENERGY: [f64; 3] = [1.204794, 0.948291, 0.908916];

/// XYZ to linear sRGB (ITU-R BT.709 primaries, white D65), rounded as Mitsuba's.
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
    let t = (wavelength - FIRST) / SPACING;
    let i = (t as usize).min(TABLE.len() - 2);
    let fraction = t - i as f64;
    std::array::from_fn(|c| TABLE[i][c] + (TABLE[i + 1][c] - TABLE[i][c]) * fraction)
}

const STEPS: usize = 1000;
const FIRST: f64 = 360.0;
const LAST: f64 = 830.0;
const SPACING: f64 = 5.0;
/// Integral of the observer's y over the wavelengths, by Mitsuba's quadrature.
const Y_INTEGRAL: f64 = 106.750_259_399_414_06;
/// What D65 is divided by to have luminance 1.
const D65_LUMINANCE: f64 = 98.997_417_518_762_55;

/// The CIE 1931 standard observer's x, y, z and the CIE standard illuminant D65, every 5 nm from 360 nm.
#[rustfmt::skip]
const TABLE: [[f64; 4]; 95] = [
    [0.0001299, 3.917e-6, 0.0006061, 46.6383],
    [0.0002321, 6.965e-6, 0.001086, 49.3637],
    [0.0004149, 1.239e-5, 0.001946, 52.0891],
    [0.0007416, 2.202e-5, 0.003486, 51.0323],
    [0.001368, 3.9e-5, 0.00645, 49.9755],
    [0.002236, 6.4e-5, 0.01055, 52.3118],
    [0.004243, 0.00012, 0.02005, 54.6482],
    [0.00765, 0.000217, 0.03621, 68.7015],
    [0.01431, 0.000396, 0.06785, 82.7549],
    [0.02319, 0.00064, 0.1102, 87.1204],
    [0.04351, 0.00121, 0.2074, 91.486],
    [0.07763, 0.00218, 0.3713, 92.4589],
    [0.13438, 0.004, 0.6456, 93.4318],
    [0.21477, 0.0073, 1.03905, 90.057],
    [0.2839, 0.0116, 1.3856, 86.6823],
    [0.3285, 0.01684, 1.62296, 95.7736],
    [0.34828, 0.023, 1.74706, 104.865],
    [0.34806, 0.0298, 1.7826, 110.936],
    [0.3362, 0.038, 1.77211, 117.008],
    [0.3187, 0.048, 1.7441, 117.41],
    [0.2908, 0.06, 1.6692, 117.812],
    [0.2511, 0.0739, 1.5281, 116.336],
    [0.19536, 0.09098, 1.28764, 114.861],
    [0.1421, 0.1126, 1.0419, 115.392],
    [0.09564, 0.13902, 0.81295, 115.923],
    [0.05795, 0.1693, 0.6162, 112.367],
    [0.03201, 0.20802, 0.46518, 108.811],
    [0.0147, 0.2586, 0.3533, 109.082],
    [0.0049, 0.323, 0.272, 109.354],
    [0.0024, 0.4073, 0.2123, 108.578],
    [0.0093, 0.503, 0.1582, 107.802],
    [0.0291, 0.6082, 0.1117, 106.296],
    [0.06327, 0.71, 0.07825, 104.79],
    [0.1096, 0.7932, 0.05725, 106.239],
    [0.1655, 0.862, 0.04216, 107.689],
    [0.22575, 0.91485, 0.02984, 106.047],
    [0.2904, 0.954, 0.0203, 104.405],
    [0.3597, 0.9803, 0.0134, 104.225],
    [0.43345, 0.99495, 0.00875, 104.046],
    [0.51205, 1.0, 0.00575, 102.023],
    [0.5945, 0.995, 0.0039, 100.0],
    [0.6784, 0.9786, 0.00275, 98.1671],
    [0.7621, 0.952, 0.0021, 96.3342],
    [0.8425, 0.9154, 0.0018, 96.0611],
    [0.9163, 0.87, 0.00165, 95.788],
    [0.9786, 0.8163, 0.0014, 92.2368],
    [1.0263, 0.757, 0.0011, 88.6856],
    [1.0567, 0.6949, 0.001, 89.3459],
    [1.0622, 0.631, 0.0008, 90.0062],
    [1.0456, 0.5668, 0.0006, 89.8026],
    [1.0026, 0.503, 0.00034, 89.5991],
    [0.9384, 0.4412, 0.00024, 88.6489],
    [0.85445, 0.381, 0.00019, 87.6987],
    [0.7514, 0.321, 0.0001, 85.4936],
    [0.6424, 0.265, 5e-5, 83.2886],
    [0.5419, 0.217, 3e-5, 83.4939],
    [0.4479, 0.175, 2e-5, 83.6992],
    [0.3608, 0.1382, 1e-5, 81.863],
    [0.2835, 0.107, 0.0, 80.0268],
    [0.2187, 0.0816, 0.0, 80.1207],
    [0.1649, 0.061, 0.0, 80.2146],
    [0.1212, 0.04458, 0.0, 81.2462],
    [0.0874, 0.032, 0.0, 82.2778],
    [0.0636, 0.0232, 0.0, 80.281],
    [0.04677, 0.017, 0.0, 78.2842],
    [0.0329, 0.01192, 0.0, 74.0027],
    [0.0227, 0.00821, 0.0, 69.7213],
    [0.01584, 0.005723, 0.0, 70.6652],
    [0.0113592, 0.004102, 0.0, 71.6091],
    [0.00811092, 0.002929, 0.0, 72.979],
    [0.00579035, 0.002091, 0.0, 74.349],
    [0.00410946, 0.001484, 0.0, 67.9765],
    [0.00289933, 0.001047, 0.0, 61.604],
    [0.00204919, 0.00074, 0.0, 65.7448],
    [0.00143997, 0.00052, 0.0, 69.8856],
    [0.000999949, 0.0003611, 0.0, 72.4863],
    [0.000690079, 0.0002492, 0.0, 75.087],
    [0.000476021, 0.0001719, 0.0, 69.3398],
    [0.000332301, 0.00012, 0.0, 63.5927],
    [0.000234826, 8.48e-5, 0.0, 55.0054],
    [0.000166151, 6e-5, 0.0, 46.4182],
    [0.000117413, 4.24e-5, 0.0, 56.6118],
    [8.308e-5, 3e-5, 0.0, 66.8054],
    [5.871e-5, 2.12e-5, 0.0, 65.0941],
    [4.151e-5, 1.499e-5, 0.0, 63.3828],
    [2.935e-5, 1.06e-5, 0.0, 63.8434],
    [2.067e-5, 7.466e-6, 0.0, 64.304],
    [1.456e-5, 5.258e-6, 0.0, 61.8779],
    [1.025e-5, 3.703e-6, 0.0, 59.4519],
    [7.221e-6, 2.608e-6, 0.0, 55.7054],
    [5.086e-6, 1.837e-6, 0.0, 51.959],
    [3.582e-6, 1.293e-6, 0.0, 54.6998],
    [2.523e-6, 9.109e-7, 0.0, 57.4406],
    [1.777e-6, 6.415e-7, 0.0, 58.8765],
    [1.251e-6, 4.518e-7, 0.0, 60.3125],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `mi.load_string` in Mitsuba 3.9.1, variant scalar_rgb.
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
