//! Vectors, frames, rays, and the one set of transcendental functions that every pixel uses.
//!
//! They come from the `libm` crate, compiled in, so that their last bit does not depend on the platform.

pub use glam::{Vec2, Vec3};

/// Linear RGB: radiance, flux, reflectance or a coefficient per channel, as the name of the variable says.
pub type Rgb = Vec3;

/// Pi.
pub const PI: f32 = std::f32::consts::PI;

/// `e^x`.
#[inline]
pub fn exp(x: f32) -> f32 {
    libm::expf(x)
}
/// `e^x` for `x <= 0`, zero below the smallest normal number. Relative error below 2e-7 + 1e-7 |x|. Only additions,
/// multiplications and bit operations, so that loops over it become vector code with the same bits at every width.
#[inline(always)]
pub fn exp_neg(x: f32) -> f32 {
    // e^x = 2^(n + f) with |f| <= 1/2; adding and subtracting 1.5 * 2^23 rounds to an integer.
    const ROUND: f32 = 12_582_912.0;
    let y = (if x < -87.0 { -87.0 } else { x }) * std::f32::consts::LOG2_E;
    let shifted = y + ROUND;
    let f = y - (shifted - ROUND);
    // (2^f - 1) / f, near the best polynomial of degree 5 (error 5e-9); grouped so that few operations wait for others.
    let f2 = f * f;
    let low = 6.931_472e-1 + 2.402_265e-1 * f;
    let middle = 5.550_357e-2 + 9.618_057e-3 * f;
    let high = 1.339_086_7e-3 + 1.546_144_8e-4 * f;
    let e = 1.0 + f * (low + f2 * (middle + f2 * high));
    let scale = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
    if x <= -87.0 { 0.0 } else { e * scale }
}
/// `1 - e^-x`, accurate for small `x` as well, where a plain difference would cancel.
#[inline]
pub fn one_minus_exp_neg(x: f32) -> f32 {
    -libm::expm1f(-x)
}
/// [`exp_neg`] per channel.
#[inline]
pub fn exp_rgb_neg(x: Rgb) -> Rgb {
    Rgb::new(exp_neg(x.x), exp_neg(x.y), exp_neg(x.z))
}
/// Natural logarithm.
#[inline]
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
}
/// `ln(1 + x)`, accurate for small `x` as well.
#[inline]
pub fn ln_1p(x: f32) -> f32 {
    libm::log1pf(x)
}
/// Sine and cosine of an angle in radians.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}
/// Sine of an angle in radians.
#[inline]
pub fn sin(x: f32) -> f32 {
    libm::sinf(x)
}
/// Cosine of an angle in radians.
#[inline]
pub fn cos(x: f32) -> f32 {
    libm::cosf(x)
}
/// Tangent of an angle in radians.
#[inline]
pub fn tan(x: f32) -> f32 {
    libm::tanf(x)
}
/// Arc cosine in radians; the argument is clamped to [-1, 1].
#[inline]
pub fn acos(x: f32) -> f32 {
    libm::acosf(x.clamp(-1.0, 1.0))
}
/// Arc sine in radians; the argument is clamped to [-1, 1].
#[inline]
pub fn asin(x: f32) -> f32 {
    libm::asinf(x.clamp(-1.0, 1.0))
}
/// Hyperbolic sine.
#[inline]
pub fn sinh(x: f32) -> f32 {
    libm::sinhf(x)
}
/// Hyperbolic cosine.
#[inline]
pub fn cosh(x: f32) -> f32 {
    libm::coshf(x)
}
/// Hyperbolic tangent.
#[inline]
pub fn tanh(x: f32) -> f32 {
    libm::tanhf(x)
}
/// Angle of the point (x, y) in (-pi, pi].
#[inline]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}
/// `x^y`.
#[inline]
pub fn powf(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}
/// The error function.
#[inline]
pub fn erf(x: f32) -> f32 {
    libm::erff(x)
}
/// `1 - erf(x)`.
#[inline]
pub fn erfc(x: f32) -> f32 {
    libm::erfcf(x)
}
/// The inverse of [`erf`] for |x| < 1. Giles 2012, Approximating the erfinv function: relative error below 1e-6.
pub fn erf_inv(x: f32) -> f32 {
    let horner = |coefficients: [f32; 9], w: f32| coefficients.iter().fold(0.0, |p, c| p * w + c);
    let w = -ln((1.0 - x) * (1.0 + x));
    let p = if w < 5.0 {
        let central = [
            2.810_226_4e-8,
            3.432_739_4e-7,
            -3.523_387_7e-6,
            -4.391_506_5e-6,
            2.185_808_7e-4,
            -1.253_725e-3,
            -4.177_681_6e-3,
            0.246_640_73,
            1.501_409_4,
        ];
        horner(central, w - 2.5)
    } else {
        let tail = [
            -2.002_142_6e-4,
            1.009_505_6e-4,
            1.349_343_2e-3,
            -3.673_428_4e-3,
            5.739_507_7e-3,
            -7.622_461_3e-3,
            9.438_870_5e-3,
            1.001_674,
            2.832_976_8,
        ];
        horner(tail, w.sqrt() - 3.0)
    };
    p * x
}
/// `e^x` per channel.
#[inline]
pub fn exp_rgb(x: Rgb) -> Rgb {
    Rgb::new(exp(x.x), exp(x.y), exp(x.z))
}
/// Prefetches a value where the machine can. Changes only the time taken.
#[inline(always)]
pub fn prefetch<T>(what: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch has no effect that the program can observe, and the reference is valid.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(what).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = what;
}
/// Mean of the three channels: the scalar that probabilities are computed from.
#[inline]
pub fn mean(c: Rgb) -> f32 {
    (c.x + c.y + c.z) * (1.0 / 3.0)
}
/// Rec. 709 luminance.
#[inline]
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}

/// A ray in render space. `dir` has unit length.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Unit direction of travel.
    pub dir: Vec3,
}

impl Ray {
    /// The point at distance `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.dir * t
    }
}

/// A right-handed orthonormal basis with `n` as its z axis.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// x axis.
    pub s: Vec3,
    /// y axis.
    pub t: Vec3,
    /// z axis.
    pub n: Vec3,
}

impl Frame {
    /// A basis around the unit vector `n` (Duff et al. 2017, revised orthonormal basis).
    #[inline]
    pub fn from_normal(n: Vec3) -> Self {
        let sign = if n.z >= 0.0 { 1.0f32 } else { -1.0 };
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }
    /// A basis around the unit vector `n` whose x axis is as near as possible to `along`, which may have any length. If
    /// `along` is parallel to `n`, the x axis is arbitrary.
    pub fn along(along: Vec3, n: Vec3) -> Self {
        match (along - n * n.dot(along)).try_normalize() {
            Some(s) => Self { s, t: n.cross(s), n },
            None => Self::from_normal(n),
        }
    }
    /// World to local.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }
    /// Local to world.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_inv_inverts_erf() {
        for i in 1..20_000 {
            let x = i as f32 / 10_000.0 - 1.0;
            let y = f64::from(erf_inv(x));
            // The error of x that the error of y causes: erf' = 2 / sqrt(pi) e^(-y^2).
            let slope = std::f64::consts::FRAC_2_SQRT_PI * libm::exp(-y * y);
            let error = (libm::erf(y) - f64::from(x)) / slope;
            assert!(error.abs() <= 2e-6 * y.abs(), "{x}: {y}, off by {error}");
        }
    }

    #[test]
    fn exp_neg_agrees_with_double_precision() {
        for i in 0..200_000 {
            let x = -(i as f32) * 4.3e-4;
            let exact = libm::exp(x as f64);
            let error = (exp_neg(x) as f64 - exact) / exact;
            let bound = 2e-7 - 1e-7 * f64::from(x);
            assert!(error.abs() < bound, "exp({x}) off by {error}");
        }
        assert_eq!(exp_neg(0.0), 1.0);
        assert_eq!(exp_neg(-90.0), 0.0);
        assert_eq!(exp_neg(f32::NEG_INFINITY), 0.0);
    }
}
