//! Phase functions: 1/sr, integrating to 1 over the sphere.
//!
//! `cos_theta` is the cosine between the old and the new direction of travel: 1 is straight on, and `g > 0` scatters
//! forwards. (Some renderers point both directions away from the vertex, which flips the sign of the cosine.)

use crate::math::{Frame, PI, Vec2, Vec3, sin_cos};

/// A phase function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// 1/(4 pi) in every direction.
    Isotropic,
    /// Henyey-Greenstein; `g` in (-1, 1) is the mean cosine between the old and the new direction of travel.
    HenyeyGreenstein {
        /// Mean cosine.
        g: f32,
    },
    /// A weighted sum of two lobes.
    Blend {
        /// Share of the second, between 0 and 1.
        weight: f32,
        /// Their mean cosines, 0 for isotropic scattering.
        g: [f32; 2],
    },
}

/// Constants of one phase function, for loops that evaluate it often. Isotropic scattering is `g = 0`, with the same
/// bits for every direction, so one formula serves both.
///
/// Henyey & Greenstein 1941: `(1 - g^2) / (4 pi x^(3/2))` with `x = 1 + g^2 - 2 g cos`. Here `x` is written as
/// `(1 - |g|)^2 + 2 |g| (1 - s cos)`, `s` the sign of `g`: a sum of two terms that are never negative, so that nothing
/// cancels near the peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLobe {
    /// `(1 - g^2) / (4 pi)`.
    pub scale: f32,
    /// `(1 - |g|)^2`: `x` at the peak.
    pub peak: f32,
    /// `2 |g|`.
    pub slope: f32,
    /// 1 for a forward peak (and for `g = 0`), -1 for a backward one.
    pub sign: f32,
}

impl PhaseLobe {
    /// A Henyey-Greenstein lobe times `share`.
    #[inline]
    pub fn new(g: f32, share: f32) -> Self {
        let a = g.abs();
        Self {
            scale: share * ((1.0 - a) * (1.0 + a) / (4.0 * PI)),
            peak: (1.0 - a) * (1.0 - a),
            slope: 2.0 * a,
            sign: if g < 0.0 { -1.0 } else { 1.0 },
        }
    }

    /// Value (1/sr) at the cosine between the old and the new direction of travel. A cosine that rounding has moved out
    /// of [-1, 1] is clamped.
    ///
    /// A dot product of unit vectors in single precision is off by 1e-7, which is 10 % of `x` at the peak of
    /// `|g| = 0.999`: where that matters, use [`PhaseLobe::eval_directions`].
    #[inline]
    pub fn eval(&self, cos_theta: f32) -> f32 {
        let x = self.peak + self.slope * (1.0 - self.sign * cos_theta).max(0.0);
        self.scale / (x * x.sqrt())
    }

    /// Value (1/sr) for two unit directions of travel, accurate to 1e-3 even at the peak of `|g| = 0.999`:
    /// `2 (1 - s cos) = |old - s new|^2` does not cancel.
    #[inline]
    pub fn eval_directions(&self, old: Vec3, new: Vec3) -> f32 {
        let x = self.peak + 0.5 * self.slope * (old - self.sign * new).length_squared();
        self.scale / (x * x.sqrt())
    }
}

impl Phase {
    /// Two Henyey-Greenstein lobes; `weight` is the share of the second and may be 0 or 1.
    pub fn blend(weight: f32, g: [f32; 2]) -> Self {
        let single = |g: f32| match g {
            0.0 => Self::Isotropic,
            g => Self::HenyeyGreenstein { g },
        };
        match (weight, g) {
            (0.0, [g, _]) | (1.0, [_, g]) => single(g),
            (_, [first, second]) if first == second => single(first),
            _ => Self::Blend { weight, g },
        }
    }

    /// The constants for evaluation: the values of both lobes add up, and the second is 0 except for blends.
    #[inline]
    pub fn lobes(&self) -> [PhaseLobe; 2] {
        let (weight, [first, second]) = match *self {
            Self::Isotropic => (0.0, [0.0; 2]),
            Self::HenyeyGreenstein { g } => (0.0, [g, 0.0]),
            Self::Blend { weight, g } => (weight, g),
        };
        [PhaseLobe::new(first, 1.0 - weight), PhaseLobe::new(second, weight)]
    }

    /// Value in 1/sr; see [`PhaseLobe::eval`].
    #[inline]
    pub fn eval(&self, cos_theta: f32) -> f32 {
        let [first, second] = self.lobes();
        first.eval(cos_theta) + second.eval(cos_theta)
    }

    /// Value in 1/sr for two unit directions of travel; see [`PhaseLobe::eval_directions`].
    #[inline]
    pub fn eval_directions(&self, old: Vec3, new: Vec3) -> f32 {
        let [first, second] = self.lobes();
        first.eval_directions(old, new) + second.eval_directions(old, new)
    }

    /// Its largest value, 1/sr.
    #[inline]
    pub fn peak(&self) -> f32 {
        let peak = |lobe: PhaseLobe| lobe.scale / (lobe.peak * lobe.peak.sqrt());
        let [first, second] = self.lobes().map(peak);
        first + second
    }

    /// Mean cosine between the old and the new direction of travel.
    #[inline]
    pub fn mean_cosine(&self) -> f32 {
        match *self {
            Self::Isotropic => 0.0,
            Self::HenyeyGreenstein { g } => g,
            Self::Blend { weight, g } => g[0] + (g[1] - g[0]) * weight,
        }
    }

    /// Density per solid angle of [`Phase::sample`]: the phase function itself.
    #[inline]
    pub fn pdf(&self, cos_theta: f32) -> f32 {
        self.eval(cos_theta)
    }

    /// Draws a new direction of travel for a photon or a camera path that travels along the unit vector `dir`. The
    /// sample's weight is 1.
    #[inline]
    pub fn sample(&self, dir: Vec3, u: Vec2) -> Vec3 {
        let (g, u) = match *self {
            Self::Isotropic => (0.0, u),
            Self::HenyeyGreenstein { g } => (g, u),
            // Once it is chosen, the rest of the number is uniform again.
            Self::Blend { weight, g } if u.x < weight => (g[1], u.with_x(u.x / weight)),
            Self::Blend { weight, g } => (g[0], u.with_x((u.x - weight) / (1.0 - weight))),
        };
        let a = g.abs();
        // The inverted cumulative distribution, solved for v = 1 - s cos, where nothing cancels and g = 0 needs no
        // case: v = 2 (1 - a)^2 u (1 + a - a u) / (1 + a - 2 a u)^2.
        let d = (1.0 - a) + 2.0 * a * (1.0 - u.x);
        let ratio = (1.0 - a) / d;
        let v = 2.0 * ratio * ratio * u.x * (1.0 + a * (1.0 - u.x));
        let sin_theta = (v * (2.0 - v)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.y);
        let cos_theta = if g < 0.0 { v - 1.0 } else { 1.0 - v };
        Frame::from_normal(dir)
            .to_world(Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta))
            // Long paths would drift off the unit sphere.
            .normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Henyey-Greenstein in double precision from the angle, in its textbook form.
    fn reference(g: f64, theta: f64) -> f64 {
        let x = 1.0 + g * g - 2.0 * g * libm::cos(theta);
        (1.0 - g * g) / (4.0 * std::f64::consts::PI * x * x.sqrt())
    }

    #[test]
    fn isotropic_is_g_zero_bit_for_bit() {
        let (iso, hg) = (Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.0 });
        assert_eq!(iso.lobes(), hg.lobes());
        for i in 0..=100 {
            let cos = i as f32 / 50.0 - 1.0;
            assert_eq!(iso.eval(cos).to_bits(), (0.25 / PI).to_bits());
            assert_eq!(hg.eval(cos).to_bits(), iso.eval(cos).to_bits());
            let u = Vec2::new(i as f32 / 101.0, 0.3);
            assert_eq!(iso.sample(Vec3::Y, u), hg.sample(Vec3::Y, u));
        }
    }

    #[test]
    fn value_matches_double_precision_at_every_angle() {
        for g in [-0.999f32, -0.9, -0.3, 1e-6, 0.3, 0.7, 0.95, 0.999] {
            let lobe = PhaseLobe::new(g, 1.0);
            let old = Vec3::new(0.48, 0.6, 0.64);
            let frame = Frame::from_normal(old);
            for theta in [0.0, 1e-5, 3e-4, 1e-3, 1e-2, 0.1, 0.5, 1.5, 2.5, 3.0, 3.1] {
                let new = frame.to_world(Vec3::new(libm::sin(theta) as f32, 0.0, libm::cos(theta) as f32));
                let expected = reference(f64::from(g), theta);
                let value = f64::from(lobe.eval_directions(old, new));
                assert!(
                    (value / expected - 1.0).abs() < 1e-3,
                    "g {g}, theta {theta}: {value} {expected}"
                );
                let value = f64::from(lobe.eval(libm::cos(theta) as f32));
                let tolerance = if g.abs() > 0.99 { 0.2 } else { 1e-4 };
                assert!(
                    (value / expected - 1.0).abs() < tolerance,
                    "g {g}, theta {theta}: {value} {expected}"
                );
            }
        }
    }

    /// Half isotropic and half not; at the extreme weights, one lobe, to the bit.
    #[test]
    fn blends_are_sums_in_shares() {
        let g = [0.0, 0.7];
        let [first, second] = g.map(|g| Phase::HenyeyGreenstein { g });
        assert_eq!(Phase::blend(0.0, g), Phase::Isotropic);
        assert_eq!(Phase::blend(1.0, g), second);
        assert_eq!(Phase::blend(0.3, [0.7; 2]), second);
        for weight in [0.1, 0.3, 0.75] {
            let blend = Phase::blend(weight, g);
            for i in 0..=100 {
                let cos = i as f32 / 50.0 - 1.0;
                let expected = (1.0 - weight) * first.eval(cos) + weight * second.eval(cos);
                assert!((blend.eval(cos) / expected - 1.0).abs() < 1e-6);
                let new = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                assert!((blend.eval_directions(Vec3::Z, new) / expected - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn cosines_beyond_one_stay_finite() {
        for g in [-0.999_999, -0.999, 0.0, 0.999, 0.999_999] {
            let lobe = PhaseLobe::new(g, 1.0);
            for cos in [-1.000_001, -1.0, 1.0, 1.000_001] {
                assert!(lobe.eval(cos).is_finite() && lobe.eval(cos) > 0.0);
            }
        }
    }

    #[test]
    fn sampled_cosine_inverts_the_distribution() {
        // P(cos > c) = (1 - g^2)/(2g) [1/(1-g) - 1/sqrt(1 + g^2 - 2 g c)], in double precision.
        for g in [-0.999f32, -0.5, 0.2, 0.9, 0.999] {
            for i in 0..200 {
                let u = (i as f32 + 0.5) / 200.0;
                let dir = Phase::HenyeyGreenstein { g }.sample(Vec3::Z, Vec2::new(u, 0.1));
                assert!((dir.length() - 1.0).abs() < 3e-7);
                let s = if g < 0.0 { -1.0 } else { 1.0 };
                let chord = (Vec3::Z - dir * s).as_dvec3().length_squared();
                let a = f64::from(g.abs());
                let x = (1.0 - a) * (1.0 - a) + a * chord;
                let p = (1.0 - a * a) / (2.0 * a) * (1.0 / (1.0 - a) - 1.0 / x.sqrt());
                assert!((p - f64::from(u)).abs() < 1e-3, "g {g}, u {u}: {p}");
            }
        }
    }

    #[test]
    fn extreme_uniforms_are_unit_directions() {
        let top = 1.0 - 1.0 / (1u32 << 24) as f32;
        for g in [-0.999_999, -0.999, 0.0, 0.999, 0.999_999] {
            for (x, y) in [(0.0, 0.0), (top, top), (0.0, top), (top, 0.0)] {
                for dir in [Vec3::Z, -Vec3::Z, Vec3::X] {
                    for phase in [
                        Phase::HenyeyGreenstein { g },
                        Phase::blend(0.3, [g, 0.5]),
                        Phase::blend(1e-7, [0.5, g]),
                        Phase::blend(top, [0.5, g]),
                    ] {
                        let new = phase.sample(dir, Vec2::new(x, y));
                        assert!((new.length() - 1.0).abs() < 3e-7);
                    }
                }
            }
        }
    }
}
