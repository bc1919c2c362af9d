//! Vectors, frames, rays, and the one set of transcendental functions that every pixel uses.
//!
//! The functions here come from the `libm` crate, compiled in, so that their last bit does not depend on the platform.

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
/// Natural logarithm.
#[inline]
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
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
/// `e^x` per channel.
#[inline]
pub fn exp_rgb(x: Rgb) -> Rgb {
    Rgb::new(exp(x.x), exp(x.y), exp(x.z))
}
/// Mean of the three channels: the scalar that probabilities are made of.
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
