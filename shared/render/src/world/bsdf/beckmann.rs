//! The Beckmann distribution of microfacet normals (Walter et al. 2007). See [`super::microfacet`].

use crate::math::{PI, Vec2, Vec3, erf, erf_inv, erfc, exp};

const INV_SQRT_PI: f32 = 0.564_189_6;

/// Walter et al. 2007, eq. 25.
#[inline]
pub fn density(alpha: f32, m: Vec3) -> f32 {
    let cos2 = m.z * m.z;
    let alpha2 = alpha * alpha;
    let exponent = (m.x * m.x + m.y * m.y) / (alpha2 * cos2);
    // Beyond this the density is zero, and cos^4 may be as well.
    if exponent.is_nan() || exponent > 80.0 {
        return 0.0;
    }
    exp(-exponent) / (PI * alpha2 * cos2 * cos2)
}

/// Smith's masking in closed form (Walter et al. 2007, eq. 26, 27), with the cosine factored out.
#[inline]
pub fn extent(alpha: f32, v: Vec3) -> f32 {
    let z = v.z.abs();
    let t = alpha * (v.x * v.x + v.y * v.y).sqrt();
    if t == 0.0 {
        return 2.0 * z;
    }
    let a = z / t;
    z * (1.0 + erf(a)) + t * exp(-a * a) * INV_SQRT_PI
}

/// Visible slopes (Heitz & d'Eon 2014): along `wo`'s azimuth by Newton's method on the closed-form cumulative
/// distribution; across it a Gaussian.
#[inline(never)]
pub fn sample_visible(alpha: f32, wo: Vec3, u: Vec2) -> Vec3 {
    let v = Vec3::new(alpha * wo.x, alpha * wo.y, wo.z).normalize();
    let sin = (v.x * v.x + v.y * v.y).sqrt();
    let along = if sin > 0.0 { Vec2::new(v.x, v.y) / sin } else { Vec2::X };
    let x = visible_slope(v.z, sin, u.x);
    let y = gaussian(u.y);
    let slope = (along * x + along.perp() * y) * alpha;
    Vec3::new(-slope.x, -slope.y, 1.0).normalize()
}

/// Largest slope that single precision draws.
const MAX_SLOPE: f32 = 4.25;

/// A slope with the density `(cos - sin x) e^(-x^2)`, up to a factor, below `cos / sin`.
fn visible_slope(cos: f32, sin: f32, u: f32) -> f32 {
    let cumulative = |x: f32| cos * erfc(-x) + sin * exp(-x * x) * INV_SQRT_PI;
    let (mut low, mut high) = (-MAX_SLOPE, MAX_SLOPE);
    if cos < sin * MAX_SLOPE {
        high = cos / sin;
    }
    let wanted = u * cumulative(high);
    let mut x = gaussian(u).clamp(low, high);
    for _ in 0..20 {
        let error = cumulative(x) - wanted;
        if error > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let slope = 2.0 * INV_SQRT_PI * (cos - sin * x) * exp(-x * x);
        let newton = x - error / slope;
        // Where Newton's step leaves the bracket (or is NaN), halve the bracket.
        let next = if newton >= low && newton <= high {
            newton
        } else {
            0.5 * (low + high)
        };
        let change = next - x;
        x = next;
        if change.abs() < 1e-6 {
            break;
        }
    }
    x
}

/// A number with the density `e^(-x^2) / sqrt(pi)`.
#[inline]
fn gaussian(u: f32) -> f32 {
    erf_inv((2.0 * u - 1.0).clamp(-0.999_999_9, 0.999_999_9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_invert_their_cumulative_distribution() {
        for cos in [1.0f64, 0.99, 0.7, 0.1, 1e-3, 0.0] {
            let sin = (1.0 - cos * cos).sqrt();
            let cumulative = |x: f64| cos * libm::erfc(-x) + sin * libm::exp(-x * x) * f64::from(INV_SQRT_PI);
            let total = cumulative(if sin > 0.0 { cos / sin } else { 30.0 });
            for i in 0..=1000 {
                let u = (i as f32 / 1000.0).min(1.0 - 1.0 / (1u32 << 24) as f32);
                let x = visible_slope(cos as f32, sin as f32, u);
                let back = cumulative(f64::from(x)) / total;
                assert!((back - f64::from(u)).abs() < 1e-6, "{cos} {u}: {x} {back}");
            }
        }
    }
}
