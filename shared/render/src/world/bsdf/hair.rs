//! Hair and fur: scattering by a rough dielectric fibre that absorbs inside, after Chiang, Bitterli, Tappan and Burley
//! 2016 (A Practical and Controllable Hair and Fur Model for Production Path Tracing), with the additions of pbrt-v4.
//!
//! In the local frame x runs along the fibre and z is the normal, so that `wo` alone determines the offset across the
//! fibre. Light leaves the fibre where it entered: transmitted light goes on from the same point. The model attenuates
//! by the angle of `wo`; photons, which travel the other way, use the angle of `wi`. Averaged over a fibre both then
//! carry the same light.

use super::{BsdfSample, TransportMode};
use crate::math::{PI, Rgb, Vec2, Vec3, asin, atan2, cos, exp, exp_rgb, ln, mean, powf, sin_cos};
use crate::world::fresnel::fresnel_dielectric;

/// Lobes: reflected, transmitted, reflected once inside, and all the rest.
const LOBES: usize = 4;
/// Least roughness: single precision cannot draw narrower lobes.
const MIN_ROUGHNESS: f32 = 0.02;

/// The shape of a fibre, without its colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fibre {
    /// Index of refraction inside over the one outside.
    pub eta: f32,
    /// Variance of the first lobe along the fibre.
    variance: f32,
    /// Scale of the logistic distribution around the fibre.
    scale: f32,
    /// Sines and cosines of the scales' tilt, once, twice and four times.
    tilts: [[f32; 2]; 3],
    /// Factor on the roughness of the first lobe, squared.
    coat: f32,
    /// The negative logarithm of a colour is this times the square root of the absorption coefficient.
    of_color: f32,
}

impl Fibre {
    /// `beta_m`, `beta_n`: roughness along and around the fibre, 0 to 1 (eq. 7 and 8 of the paper, with pbrt's factor).
    /// `alpha`: tilt of the scales, degrees. `coat`: factor on the roughness of the first reflection, 1 for an uncoated
    /// fibre.
    pub fn new([beta_m, beta_n]: [f32; 2], alpha: f32, eta: f32, coat: f32) -> Self {
        /// Ratio of a logistic scale to a Gaussian's.
        const ROOT_PI_OVER_8: f32 = 0.626_657_1;
        let [m, n] = [beta_m, beta_n].map(|beta| beta.clamp(MIN_ROUGHNESS, 1.0));
        let variance = 0.726 * m + 0.812 * m * m + 3.7 * powf(m, 20.0);
        let scale = ROOT_PI_OVER_8 * (0.265 * n + 1.194 * n * n + 5.372 * powf(n, 22.0));
        let tilt = |times: f32| {
            let (sin, cos) = sin_cos(times * alpha * (PI / 180.0));
            [sin, cos]
        };
        let n2 = n * n;
        Self {
            eta,
            variance: variance * variance,
            scale,
            tilts: [1.0, 2.0, 4.0].map(tilt),
            coat: coat * coat,
            of_color: 5.969 - 0.215 * n + 2.532 * n2 - 10.73 * n2 * n + 5.574 * n2 * n2 + 0.245 * n2 * n2 * n,
        }
    }

    /// The absorption coefficient, per radius, of hair that has this colour in bulk (section 4.2 of the paper).
    pub fn absorption_of(&self, color: Rgb) -> Rgb {
        let root = color
            .clamp(Rgb::splat(1e-5), Rgb::ONE)
            .to_array()
            .map(|c| ln(c) / self.of_color);
        Rgb::from(root) * Rgb::from(root)
    }

    /// The bulk colour of hair with this absorption.
    fn color_of(&self, absorption: Rgb) -> Rgb {
        exp_rgb(Rgb::from(absorption.to_array().map(f32::sqrt)) * -self.of_color)
    }
}

/// A fibre with a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hair {
    /// Its shape.
    pub fibre: Fibre,
    /// Absorption coefficient inside, per radius.
    pub absorption: Rgb,
}

/// A direction as angles relative to the fibre.
#[derive(Clone, Copy)]
struct Angles {
    sin_theta: f32,
    cos_theta: f32,
    phi: f32,
}

impl Angles {
    fn of(w: Vec3) -> Self {
        Self {
            sin_theta: w.x,
            cos_theta: (1.0 - w.x * w.x).max(0.0).sqrt(),
            phi: atan2(w.z, w.y),
        }
    }
}

/// Everything that depends on where a fibre is hit.
struct Met {
    /// Angles between the normal and the direction, outside and inside, around the fibre.
    gamma: [f32; 2],
    /// Shares of light, by lobe.
    shares: [Rgb; LOBES],
}

impl Hair {
    /// The bulk colour.
    pub fn albedo(&self) -> Rgb {
        self.fibre.color_of(self.absorption)
    }

    /// The offset across the fibre that a direction sees, -1 to 1.
    fn offset(wo: Vec3) -> f32 {
        let across = (wo.y * wo.y + wo.z * wo.z).sqrt();
        let h = if across > 0.0 { wo.y / across } else { 0.0 };
        // A normal on the other side is that of the fibre seen from there.
        (if wo.z < 0.0 { h } else { -h }).clamp(-1.0, 1.0)
    }

    /// What a direction with this angle along the fibre meets at an offset.
    fn met(&self, at: Angles, h: f32) -> Met {
        let Angles {
            sin_theta, cos_theta, ..
        } = at;
        let eta = self.fibre.eta;
        let cos_theta = cos_theta.max(1e-6);
        let sin_theta_t = sin_theta / eta;
        let cos_theta_t = (1.0 - sin_theta_t * sin_theta_t).max(0.0).sqrt();
        // Effective index in a cross-section of the fibre (Marschner et al. 2003, appendix B).
        let eta_p = (eta * eta - sin_theta * sin_theta).max(0.0).sqrt() / cos_theta;
        let sin_gamma_t = (h / eta_p).clamp(-1.0, 1.0);
        let cos_gamma_t = (1.0 - sin_gamma_t * sin_gamma_t).max(0.0).sqrt();
        let passed = exp_rgb(self.absorption * (-2.0 * cos_gamma_t / cos_theta_t.max(1e-6)));
        let cos_gamma_o = (1.0 - h * h).max(0.0).sqrt();
        let (reflected, _) = fresnel_dielectric((cos_theta * cos_gamma_o).min(1.0), eta);
        let mut shares = [Rgb::ZERO; LOBES];
        shares[0] = Rgb::splat(reflected);
        shares[1] = passed * ((1.0 - reflected) * (1.0 - reflected));
        shares[2] = shares[1] * passed * reflected;
        let last = shares[2] * passed * reflected;
        shares[3] = last / (Rgb::ONE - passed * reflected).max(Rgb::splat(1e-6));
        Met {
            gamma: [asin(h), asin(sin_gamma_t)],
            shares,
        }
    }

    fn variance(&self, lobe: usize) -> f32 {
        let Fibre { variance, coat, .. } = self.fibre;
        match lobe {
            0 => variance * coat,
            1 => 0.25 * variance,
            _ => 4.0 * variance,
        }
    }

    /// Sine and cosine of the angle along the fibre after a lobe's tilt by the scales.
    fn tilted(&self, at: Angles, lobe: usize) -> [f32; 2] {
        let ([sin, cos], [s, c]) = (
            [at.sin_theta, at.cos_theta],
            match lobe {
                0 => {
                    let [s, c] = self.fibre.tilts[1];
                    [-s, c]
                }
                1 => self.fibre.tilts[0],
                2 => self.fibre.tilts[2],
                _ => return [at.sin_theta, at.cos_theta],
            },
        );
        [sin * c + cos * s, (cos * c - sin * s).abs()]
    }

    /// Density around the fibre, per radian.
    fn around(&self, phi: f32, lobe: usize, gamma: [f32; 2]) -> f32 {
        if lobe + 1 == LOBES {
            return 0.5 / PI;
        }
        trimmed_logistic(wrapped(phi - turn(lobe, gamma)), self.fibre.scale)
    }

    /// Probability of drawing each lobe.
    fn chances(shares: &[Rgb; LOBES]) -> [f32; LOBES] {
        let weights = shares.map(mean);
        let sum: f32 = weights.iter().sum();
        match sum > 0.0 {
            true => weights.map(|weight| weight / sum),
            false => [1.0, 0.0, 0.0, 0.0],
        }
    }

    /// Sum over the lobes of density times factor; a solid-angle density where the factors sum to one. `from` is
    /// already tilted.
    fn sum(&self, from: Angles, to: Angles, phi: f32, met: &Met, factors: &[Rgb; LOBES]) -> Rgb {
        let mut sum = Rgb::ZERO;
        for (lobe, factor) in factors.iter().enumerate() {
            if *factor != Rgb::ZERO {
                let along = longitudinal(
                    [to.sin_theta, to.cos_theta],
                    self.tilted(from, lobe),
                    self.variance(lobe),
                );
                sum += *factor * (along * self.around(phi, lobe, met.gamma));
            }
        }
        sum
    }

    /// The value times the cosine.
    fn scattered(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        let (o, i) = (Angles::of(wo), Angles::of(wi));
        let h = Self::offset(wo);
        let phi = i.phi - o.phi;
        let (from, to) = match mode {
            TransportMode::Radiance => (o, i),
            TransportMode::Flux => (i, o),
        };
        let met = self.met(from, h);
        self.sum(from, to, phi, &met, &met.shares)
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        // The caller multiplies by this cosine, which is no part of the model.
        self.scattered(wo, wi, mode) / wi.z.abs().max(1e-6)
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (Angles::of(wo), Angles::of(wi));
        let met = self.met(o, Self::offset(wo));
        let chances = Self::chances(&met.shares).map(Rgb::splat);
        self.sum(o, i, i.phi - o.phi, &met, &chances).x
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        let o = Angles::of(wo);
        let met = self.met(o, Self::offset(wo));
        let chances = Self::chances(&met.shares);
        let mut left = u_lobe;
        let mut lobe = 0;
        while lobe + 1 < LOBES && left >= chances[lobe] {
            left -= chances[lobe];
            lobe += 1;
        }
        let left = (left / chances[lobe]).clamp(0.0, 1.0 - f32::EPSILON);
        // d'Eon, Marschner and Hanika 2013, Importance sampling for physically-based hair fiber models.
        let v = self.variance(lobe);
        let [sin_o, cos_o] = self.tilted(o, lobe);
        let cos_theta = (1.0 + v * ln(u.x + (1.0 - u.x) * exp(-2.0 / v))).clamp(-1.0, 1.0);
        let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
        let sin_i = (-cos_theta * sin_o + sin_theta * cos(2.0 * PI * u.y) * cos_o).clamp(-1.0, 1.0);
        let cos_i = (1.0 - sin_i * sin_i).max(0.0).sqrt();
        let turned = match lobe + 1 == LOBES {
            true => 2.0 * PI * left,
            false => turn(lobe, met.gamma) + sample_trimmed_logistic(left, self.fibre.scale),
        };
        let (sin, cos) = sin_cos(o.phi + turned);
        let wi = Vec3::new(sin_i, cos_i * cos, cos_i * sin);
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0 && pdf < f32::INFINITY).then(|| BsdfSample {
            wi,
            weight: self.scattered(wo, wi, mode) / pdf,
            pdf,
            delta: false,
            transmitted: wi.z * wo.z < 0.0,
        })
    }
}

/// Angle by which a lobe turns light around the fibre.
fn turn(lobe: usize, [outside, inside]: [f32; 2]) -> f32 {
    let p = lobe as f32;
    2.0 * p * inside - 2.0 * outside + p * PI
}

/// Wraps to -pi..pi.
fn wrapped(phi: f32) -> f32 {
    let turns = (phi / (2.0 * PI)).round();
    (phi - 2.0 * PI * turns).clamp(-PI, PI)
}

/// Density along the fibre, per sine, of the angle with sine and cosine `i`, for light from `o` (d'Eon et al. 2011, An
/// energy-conserving hair reflectance model).
fn longitudinal(i: [f32; 2], o: [f32; 2], v: f32) -> f32 {
    let a = i[1] * o[1] / v;
    // cos(theta_i + theta_o) - 1, without cancellation.
    let (c, s) = (i[1] - o[1], i[0] + o[0]);
    let exponent = -0.5 * (c * c + s * s) / v;
    scaled_bessel(a) * exp(exponent) / (v * (1.0 - exp(-2.0 / v)))
}

/// The modified Bessel function of order zero times e^-x, for x >= 0 (Abramowitz and Stegun 1964, 9.8.1 and 9.8.2).
fn scaled_bessel(x: f32) -> f32 {
    let series = |factors: &[f32], t: f32| factors.iter().rev().fold(0.0, |sum, factor| sum * t + factor);
    if x < 3.75 {
        let t = (x / 3.75) * (x / 3.75);
        let factors = [
            1.0,
            3.515_622_9,
            3.089_942_4,
            1.206_749_2,
            0.265_973_2,
            0.036_076_8,
            0.004_581_3,
        ];
        return series(&factors, t) * exp(-x);
    }
    let factors = [
        0.398_942_3,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    series(&factors, 3.75 / x) / x.sqrt()
}

/// The logistic distribution function of this scale.
fn logistic_sum(x: f32, scale: f32) -> f32 {
    1.0 / (1.0 + exp(-x / scale))
}

/// Its density, truncated to -pi..pi.
fn trimmed_logistic(x: f32, scale: f32) -> f32 {
    let e = exp(-x.abs() / scale);
    let within = logistic_sum(PI, scale) - logistic_sum(-PI, scale);
    e / (scale * (1.0 + e) * (1.0 + e) * within)
}

fn sample_trimmed_logistic(u: f32, scale: f32) -> f32 {
    let [low, high] = [-PI, PI].map(|end| logistic_sum(end, scale));
    let at = low + u * (high - low);
    // Neither NaN nor infinite, thanks to the clamp.
    (-scale * ln(1.0 / at.max(f32::MIN_POSITIVE) - 1.0)).clamp(-PI, PI)
}

#[cfg(test)]
mod tests;
