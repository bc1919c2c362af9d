//! Numbers as people write them, without the noise of binary arithmetic and pointers.

use glam::DVec3;
use toml_edit::{Array, Value};

/// Numbers with more significant digits than this are rounded to `KEPT`.
const LONGEST: usize = 10;
/// Significant digits kept of long numbers.
const KEPT: i32 = 6;
/// Decimal digits that a float with one digit before the point can be trusted with.
const TRUSTED: i32 = 14;
/// Integers up to here are exact as floats.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// The decimal exponent of a number's first digit.
fn magnitude(x: f64) -> i32 {
    match x.abs() {
        size if size > 0.0 && size.is_finite() => libm::floor(libm::log10(size)) as i32,
        _ => 0,
    }
}

/// Rounds to that many decimals; negative values round before the point.
pub fn rounded(x: f64, decimals: i32) -> f64 {
    let rounded = match decimals {
        0.. => format!("{x:.*}", decimals.min(300) as usize).parse().unwrap_or(x),
        _ => {
            let unit = libm::pow(10.0, f64::from(-decimals));
            (x / unit).round() * unit
        }
    };
    // Avoids -0.
    rounded + 0.0
}

/// Decimals that give a number that many significant digits.
pub fn decimals(x: f64, digits: i32) -> i32 {
    digits - 1 - magnitude(x)
}

/// Rounds to that many significant digits.
pub fn significant(x: f64, digits: i32) -> f64 {
    rounded(x, decimals(x, digits))
}

/// Significant digits in a number's shortest form.
fn length(x: f64) -> usize {
    let text = format!("{x:e}");
    let mantissa = text.split('e').next().unwrap_or_default();
    mantissa.chars().filter(char::is_ascii_digit).count()
}

/// A typed number stays as it is; one from a pointer is rounded.
pub fn short(x: f64) -> f64 {
    match length(x) <= LONGEST {
        true => x + 0.0,
        false => significant(x, KEPT),
    }
}

/// A vector rounded to significant digits of its length.
pub fn direction(v: DVec3, digits: i32) -> DVec3 {
    v.map(|x| rounded(x, decimals(v.length(), digits)))
}

/// A vector rounded to significant digits of `size`, unless its numbers look typed.
pub fn pointed(v: DVec3, size: f64, digits: i32) -> DVec3 {
    v.map(|x| match length(x) <= LONGEST {
        true => x + 0.0,
        false => rounded(x, decimals(size, digits)),
    })
}

/// The sum of short numbers, without binary noise.
pub fn sum(a: f64, b: f64) -> f64 {
    rounded(a + b, TRUSTED - magnitude(a.abs().max(b.abs())))
}

/// The sum of vectors, without binary noise.
pub fn sum_of_vectors(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(sum(a.x, b.x), sum(a.y, b.y), sum(a.z, b.z))
}

/// A number as TOML; an integer if it is whole.
pub fn value(x: f64) -> Value {
    match x.fract() == 0.0 && x.abs() < EXACT {
        true => Value::from(x as i64),
        false => Value::from(x),
    }
}

/// A vector as a TOML list.
pub fn vector(v: DVec3) -> Value {
    let list: Array = v.to_array().into_iter().map(value).collect();
    Value::Array(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_goes_and_what_was_typed_stays() {
        for (x, expected) in [
            (0.30000000000000004, "0.3"),
            (0.1234567, "0.1234567"),
            (123456.78901234567, "123457"),
            (-0.000123456789012345, "-0.000123457"),
            (-0.0, "0"),
            (1e-7, "0.0000001"),
            (1234567890123.0, "1234570000000"),
        ] {
            assert_eq!(value(short(x)).to_string(), expected);
        }
        assert_eq!(sum(0.1, 0.2), 0.3);
        assert_eq!(sum(1000.1, -1000.0), 0.1);
        assert_eq!(sum(sum(0.35, 1.17), -1.17), 0.35);
        assert_eq!(
            direction(DVec3::new(100.0, 1.23456, 1e-9), 4),
            DVec3::new(100.0, 1.2, 0.0)
        );
    }
}
