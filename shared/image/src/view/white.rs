//! White balance: the light of a temperature becomes the screen's white.
//!
//! The light is a black body up to 4000 K and daylight from 5000 K on, as in the reference illuminants of CIE 224:2017,
//! and a mixture in between. The change of white is von Kries' on Bradford's cone responses (Lam 1985), which keeps the
//! luminance of the light that becomes white.

type Matrix = [[f64; 3]; 3];

/// The temperature that changes nothing, kelvin: sRGB's white is D65, daylight of 6500 K.
pub const NEUTRAL: f32 = 6500.0;

/// Supported temperatures, kelvin: where the formulas hold.
pub const RANGE: std::ops::RangeInclusive<f32> = 1000.0..=25_000.0;

/// The matrix for linear Rec. 709 pixels; `None` changes nothing. Temperatures beyond [`RANGE`] are clamped to it.
pub(crate) fn balance(kelvin: f32) -> Option<[[f32; 3]; 3]> {
    if kelvin == NEUTRAL || kelvin.is_nan() {
        return None;
    }
    let from = of_rec709();
    let cones = |[x, y]: [f64; 2]| transformed(&BRADFORD, xyz([x, y]));
    let (light, white) = (cones(chromaticity(kelvin)), cones(WHITE));
    let mut gains = [[0.0; 3]; 3];
    for i in 0..3 {
        gains[i][i] = white[i] / light[i];
    }
    let to_cones = multiplied(&BRADFORD, &from);
    let balance = multiplied(&inverse(&to_cones), &multiplied(&gains, &to_cones));
    Some(balance.map(|row| row.map(|v| v as f32)))
}

/// CIE 1931 x and y of the light of a temperature in kelvin.
pub fn chromaticity(kelvin: f32) -> [f64; 2] {
    let t = f64::from(kelvin.clamp(*RANGE.start(), *RANGE.end()));
    match t {
        ..=4000.0 => black_body(t),
        5000.0.. => daylight(t),
        _ => {
            // Mixed at equal luminance.
            let (from, to) = (xyz(black_body(t)), xyz(daylight(t)));
            let share = (t - 4000.0) / 1000.0;
            let [x, y, z] = [0, 1, 2].map(|i| from[i] + share * (to[i] - from[i]));
            [x / (x + y + z), y / (x + y + z)]
        }
    }
}

/// Krystek 1985, "An algorithm to calculate correlated colour temperature", Color Research and Application 10 (1):
/// within 8e-5 of u and v of CIE 1960 from 1000 K to 15000 K.
fn black_body(t: f64) -> [f64; 2] {
    let u = (0.860_117_757 + 1.541_182_54e-4 * t + 1.286_412_12e-7 * t * t)
        / (1.0 + 8.424_202_35e-4 * t + 7.081_451_63e-7 * t * t);
    let v = (0.317_398_726 + 4.228_062_45e-5 * t + 4.204_816_91e-8 * t * t)
        / (1.0 - 2.897_418_16e-5 * t + 1.614_560_53e-7 * t * t);
    let scale = 2.0 * u - 8.0 * v + 4.0;
    [3.0 * u / scale, 2.0 * v / scale]
}

/// CIE 15:2004, 3.1, from 4000 K to 25000 K. Daylights are named by temperatures from before the second radiation
/// constant changed from 1.4380 to 1.4388 cm K: D65 has 6504 K.
fn daylight(called: f64) -> [f64; 2] {
    let t = called * (1.4388 / 1.4380);
    let [third, second, first, rest] = match t {
        ..=7000.0 => [-4.6070e9, 2.9678e6, 99.11, 0.244_063],
        _ => [-2.0064e9, 1.9018e6, 247.48, 0.237_040],
    };
    let x = ((third / t + second) / t + first) / t + rest;
    [x, -3.0 * x * x + 2.870 * x - 0.275]
}

/// Rec. 709 (ITU-R BT.709): x and y of the primaries, and of white.
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
const WHITE: [f64; 2] = [0.3127, 0.3290];

/// XYZ to cone responses (Lam 1985, as in ICC.1:2010).
const BRADFORD: Matrix = [
    [0.8951, 0.2664, -0.1614],
    [-0.7502, 1.7135, 0.0367],
    [0.0389, -0.0685, 1.0296],
];

/// XYZ at luminance 1.
fn xyz([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

/// Linear Rec. 709 to XYZ: (1, 1, 1) is white.
fn of_rec709() -> Matrix {
    let columns = PRIMARIES.map(xyz);
    let primaries: Matrix = [0, 1, 2].map(|row| [0, 1, 2].map(|column: usize| columns[column][row]));
    let shares = transformed(&inverse(&primaries), xyz(WHITE));
    primaries.map(|row| [0, 1, 2].map(|i| row[i] * shares[i]))
}

fn transformed(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn multiplied(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| [0, 1, 2].map(|column| (0..3).map(|i| row[i] * b[i][column]).sum()))
}

/// The inverse by cofactors; the matrix must have one.
fn inverse(m: &Matrix) -> Matrix {
    let cofactor = |row: usize, column: usize| {
        let [r, s] = [(row + 1) % 3, (row + 2) % 3];
        let [c, d] = [(column + 1) % 3, (column + 2) % 3];
        m[r][c] * m[s][d] - m[r][d] * m[s][c]
    };
    let determinant: f64 = (0..3).map(|i| m[0][i] * cofactor(0, i)).sum();
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| cofactor(column, row) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(kelvin: f32, expected: [f64; 2], tolerance: f64) {
        let found = chromaticity(kelvin);
        let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
        assert!(off < tolerance, "{kelvin} K: {found:?}, not {expected:?}");
    }

    /// Black bodies by Planck's law and the CIE 1931 observer (Wyszecki and Stiles 1982; A has 2856 K), and daylights
    /// from the tables of CIE 15:2004.
    #[test]
    fn lights_have_their_published_colours() {
        near(2000.0, [0.5267, 0.4133], 2e-4);
        near(2856.0, [0.447_58, 0.407_45], 4e-4);
        near(4000.0, [0.3805, 0.3768], 3e-4);
        near(5000.0, [0.345_67, 0.358_50], 2e-4);
        near(5500.0, [0.332_42, 0.347_43], 2e-4);
        near(6500.0, [0.312_72, 0.329_03], 1e-4);
        near(7500.0, [0.299_02, 0.314_85], 2e-4);
    }

    #[test]
    fn the_light_becomes_grey_of_its_own_luminance() {
        let to_rec709 = inverse(&of_rec709());
        for kelvin in [1000.0, 1900.0, 2856.0, 4000.0, 4500.0, 5000.0, 5500.0, 7500.0, 25_000.0] {
            let light = transformed(&to_rec709, xyz(chromaticity(kelvin))).map(|v| v as f32);
            let balance = balance(kelvin).unwrap();
            let grey = balance.map(|row| row[0] * light[0] + row[1] * light[1] + row[2] * light[2]);
            assert!(grey.iter().all(|v| (v - 1.0).abs() < 1e-4), "{kelvin}: {grey:?}");
        }
    }

    /// A slider makes no jumps: neither where one formula follows another nor around the neutral temperature.
    #[test]
    fn temperatures_follow_each_other() {
        assert_eq!(balance(NEUTRAL), None);
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let matrix = |kelvin| balance(kelvin).unwrap_or(identity);
        for at in [4000.0, 5000.0, 6500.0, 7000.0 * 1.4380 / 1.4388] {
            let (before, after) = (matrix(at - 1.0), matrix(at + 1.0));
            for (a, b) in before.as_flattened().iter().zip(after.as_flattened()) {
                assert!((a - b).abs() < 2e-3, "{at}: {before:?} {after:?}");
            }
        }
        // The warmer the balanced light, the bluer the result.
        let blue = |kelvin| matrix(kelvin)[2][2];
        assert!((10..250).all(|i| blue(100.0 * i as f32) > blue(100.0 * (i + 1) as f32)));
    }
}
