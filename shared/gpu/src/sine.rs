//! Sine and cosine without 64-bit floats, as in `kernels/math.wgsl`.

const SIGN: u32 = 1 << 31;

/// 2/pi in 32-bit words, with the point after the second bit.
const TWO_OVER_PI: [u32; 7] = [
    0x28be_60db,
    0x9391_054a,
    0x7f09_d5f4,
    0x7d4d_3770,
    0x36d8_a566,
    0x4f10_e410,
    0x7f94_58ea,
];

/// Sine and cosine of an angle in radians; NaN if it is not finite. The sine of -0 is 0.
#[must_use]
pub fn sin_cos(x: f32) -> (f32, f32) {
    if !x.is_finite() {
        return (f32::NAN, f32::NAN);
    }
    let (a, quarters) = reduced(x);
    let z = a * a;
    // Cephes' polynomials.
    let s = a + a * z * (-1.666_665_5e-1 + z * (8.332_161e-3 + z * -1.951_529_6e-4));
    let c = 1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    let (sine, cosine) = if quarters & 1 == 0 { (s, c) } else { (c, s) };
    let negate = |x: f32, if_set: u32| if if_set & 2 == 0 { x } else { -x };
    (negate(sine, quarters), negate(cosine, quarters.wrapping_add(1)))
}

/// An angle reduced to [-pi/4, pi/4], and the number of quarter turns. After Payne and Hanek: the mantissa times the
/// relevant 96 bits of 2/pi.
fn reduced(x: f32) -> (f32, u32) {
    let bits = x.to_bits();
    if bits & !SIGN < std::f32::consts::FRAC_PI_4.to_bits() {
        return (x, 0);
    }
    let mantissa = (bits << 8) | SIGN;
    let exponent = ((bits >> 23) & 255) - 126;
    let (word, shift) = ((exponent >> 5) as usize, exponent & 31);
    let at = |i: usize| u64::from(TWO_OVER_PI[i]);
    let shifted = |before: u64, after: u64| ((before << 32 | after) << shift >> 32) as u32;
    let high = shifted(if word > 0 { at(word - 1) } else { 0 }, at(word));
    let middle = shifted(at(word), at(word + 1));
    let low = shifted(at(word + 1), if shift > 0 { at(word + 2) } else { 0 });
    // Quarter turns, modulo four, with 62 bits after the point.
    let product = |a: u32| u64::from(mantissa) * u64::from(a);
    let p = product(middle)
        .wrapping_add(product(low) >> 32)
        .wrapping_add(u64::from(mantissa.wrapping_mul(high)) << 32);
    let (mut quarters, mut p) = ((p >> 62) as u32, p & (u64::MAX >> 2));
    let mut sign = bits & SIGN;
    if p >= 1 << 61 {
        quarters += 1;
        sign ^= SIGN;
        p = (1 << 62) - p;
    }
    // Its first 32 bits times pi/2.
    let zeros = p.leading_zeros();
    let first = (p << zeros) >> 32;
    let angle = ((first * 0xc90f_daa2) >> 32) as u32 as f32 * f32::from_bits((98 - zeros) << 23);
    if bits & SIGN != 0 {
        quarters = 0u32.wrapping_sub(quarters);
    }
    (f32::from_bits(angle.to_bits() ^ sign), quarters)
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_render::math;

    /// Error in units in the last place; denormal numbers share one unit.
    fn ulps(got: f32, exact: f64) -> f64 {
        if f64::from(got) == exact || (got.is_infinite() && exact.abs() > f64::from(f32::MAX)) {
            return 0.0;
        }
        let exponent = (libm::frexp(exact).1 - 24).max(-149);
        (f64::from(got) - exact).abs() * libm::exp2(-f64::from(exponent))
    }

    /// Bit patterns spread over all exponents.
    fn patterns(count: u32) -> impl Iterator<Item = f32> {
        (0..count).map(|i| f32::from_bits(i.wrapping_mul(0x9e37_79b9)))
    }

    /// Checks a function of two numbers against its 64-bit version, for all pairs.
    fn near(name: &str, most: f64, pairs: impl Iterator<Item = (f32, f32)>, of: fn(f32, f32) -> (f32, f64)) {
        for (x, y) in pairs {
            let (got, exact) = of(x, y);
            let off = ulps(got, exact);
            assert!(off <= most, "{name} of {x:e}, {y:e}: {got:e}, off by {off} ulp");
        }
    }

    #[test]
    fn functions_are_as_exact_as_is_said() {
        const COUNT: u32 = 1 << 18;
        let finite = || patterns(COUNT).filter(|x| x.is_finite());
        let one = || finite().map(|x| (x, 0.0));
        // Typical angles, in addition to those of any size.
        let angles = (0..COUNT).map(|i| (i as f32 * 3.1e-5 - 1.0, 0.0));
        let angles = || one().chain(angles.clone());
        near("sine", 1.6, angles(), |x, _| (sin_cos(x).0, libm::sin(x.into())));
        near("cosine", 1.6, angles(), |x, _| (sin_cos(x).1, libm::cos(x.into())));
        // Beyond, results are denormal or infinite.
        let exponents = (0..COUNT).map(|i| (i as f32 * 6.7e-4 - 87.0, 0.0));
        near("exponential", 1.0, exponents.chain(one()), |x, _| {
            (math::exp(x), libm::exp(x.into()))
        });
        near("ln", 1.0, one().filter(|(x, _)| *x > 0.0), |x, _| {
            (math::ln(x), libm::log(x.into()))
        });
        let cosines = (0..COUNT).map(|i| (i as f32 / COUNT as f32 * 2.0 - 1.0, 0.0));
        let cosines = cosines.chain(one().filter(|(x, _)| x.abs() <= 1.0));
        near("arc_cos", 1.0, cosines, |x, _| (math::acos(x), libm::acos(x.into())));
        let others = || (0..COUNT).map(|i| f32::from_bits(i.wrapping_mul(0x85eb_ca6b).rotate_left(7)));
        let points = patterns(COUNT)
            .zip(others())
            .filter(|(x, y)| !x.is_nan() && !y.is_nan());
        near("arc_tan2", 1.6, points, |x, y| {
            (math::atan2(y, x), libm::atan2(y.into(), x.into()))
        });
        let powers = patterns(COUNT)
            .zip(others())
            .filter(|(x, y)| x.is_finite() && !y.is_nan());
        let powers = powers.map(|(x, y)| (x.abs(), (y.to_bits() as i32) as f32 / 2.0e7));
        near("power", 1.0, powers, |x, y| {
            (math::powf(x, y), libm::pow(x.into(), y.into()))
        });
    }

    #[test]
    fn sines_of_what_is_no_angle_are_no_numbers() {
        for x in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            assert!(sin_cos(x).0.is_nan() && sin_cos(x).1.is_nan());
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert_eq!(sin_cos(1e-40), (1e-40, 1.0));
        assert_eq!(sin_cos(-0.0).0.to_bits(), 0);
    }
}
