//! Numbers as people write them: without the noise of binary arithmetic and of pointers.

use glam::DVec3;
use toml_edit::{Array, Value};

/// Numbers of more significant digits than this are noise beyond the first few.
const LONGEST: usize = 10;
/// Significant digits that are left of those.
const KEPT: i32 = 6;
/// Decimal digits that a float of one digit before the point can be trusted with.
const TRUSTED: i32 = 14;
/// Whole numbers up to here are exact as floats.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// The power of ten that a number begins with.
fn magnitude(x: f64) -> i32 {
    match x.abs() {
        size if size > 0.0 && size.is_finite() => libm::floor(libm::log10(size)) as i32,
        _ => 0,
    }
}

/// To so many digits after the point; before it if there are fewer than none.
pub fn rounded(x: f64, decimals: i32) -> f64 {
    let rounded = match decimals {
        0.. => format!("{x:.*}", decimals.min(300) as usize).parse().unwrap_or(x),
        _ => {
            let unit = libm::pow(10.0, f64::from(-decimals));
            (x / unit).round() * unit
        }
    };
    // Not -0.
    rounded + 0.0
}

/// How many of a number's significant digits are after the point.
pub fn decimals(x: f64, digits: i32) -> i32 {
    digits - 1 - magnitude(x)
}

/// To so many significant digits.
pub fn significant(x: f64, digits: i32) -> f64 {
    rounded(x, decimals(x, digits))
}

/// Significant digits of the shortest text of a number.
fn length(x: f64) -> usize {
    let text = format!("{x:e}");
    let mantissa = text.split('e').next().unwrap_or_default();
    mantissa.chars().filter(char::is_ascii_digit).count()
}

/// A number that somebody typed as it is, one that a pointer made to a few digits.
pub fn short(x: f64) -> f64 {
    match length(x) <= LONGEST {
        true => x + 0.0,
        false => significant(x, KEPT),
    }
}

/// A vector, to so many significant digits of its length.
pub fn direction(v: DVec3, digits: i32) -> DVec3 {
    v.map(|x| rounded(x, decimals(v.length(), digits)))
}

/// A vector that a pointer made, to so many significant digits of a size; what somebody typed as it is.
pub fn pointed(v: DVec3, size: f64, digits: i32) -> DVec3 {
    v.map(|x| match length(x) <= LONGEST {
        true => x + 0.0,
        false => rounded(x, decimals(size, digits)),
    })
}

/// A sum of short numbers, short itself.
pub fn sum(a: f64, b: f64) -> f64 {
    rounded(a + b, TRUSTED - magnitude(a.abs().max(b.abs())))
}

/// A sum of vectors of short numbers.
pub fn sum_of_vectors(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(sum(a.x, b.x), sum(a.y, b.y), sum(a.z, b.z))
}

/// As TOML; whole where it is.
pub fn value(x: f64) -> Value {
    match x.fract() == 0.0 && x.abs() < EXACT {
        true => Value::from(x as i64),
        false => Value::from(x),
    }
}

/// As a list of three.
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
