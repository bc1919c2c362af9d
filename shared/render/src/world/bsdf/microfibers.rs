//! Sheen of a layer of fine fibres: T. Zeltner, B. Burley, M. J.-Y. Chiang, Practical Multiple-Scattering Sheen Using
//! Linearly Transformed Cosines, 2022. The layer reflects into a cosine lobe transformed by a matrix, with the total
//! albedo of fibres of that roughness.
//!
//! Both depend on the viewing direction only; photons swap the directions. Albedo and matrix are our own fits to the
//! authors' table for layers with a volume of fibres, which Cycles looks up: polynomials of 2 sqrt(cos) - 1 and 3
//! sqrt(roughness) - 2, with albedos within 0.012 and their means within 0.7 %.

use super::{BsdfFlags, BsdfSample, TransportMode, lit_side, reflects};
use crate::math::{Rgb, Vec2, Vec3, exp};
use crate::warp;
use crate::world::scalar::Scalar;
use crate::world::texture::{Texture, TexturePoint};
use std::f32::consts::FRAC_1_PI;

/// A layer of fibres over a surface.
#[derive(Clone, Debug)]
pub struct Fuzz {
    /// Share of the surface that has it, from 0 to 1.
    pub weight: Scalar,
    /// From 0 to 1: the rougher, the less grazing the angles at which it shows.
    pub roughness: Scalar,
    /// Factor on the reflection, in [0, 1].
    pub color: Texture,
}

impl Fuzz {
    pub(super) fn reads(&self) -> BsdfFlags {
        BsdfFlags::reading([self.weight.texture(), self.roughness.texture()]) | BsdfFlags::reading([&self.color])
    }

    pub(super) fn at(&self, at: &TexturePoint) -> Microfibers {
        Microfibers {
            color: self.color.eval(at) * self.weight.eval(at),
            roughness: self.roughness.eval(at),
        }
    }
}

/// Fibres over black.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// The fibres.
    pub fibers: Microfibers,
    /// Reflects on both sides.
    pub two_sided: bool,
}

/// Fibres, looked up at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfibers {
    /// Factor on the reflection, in [0, 1].
    pub color: Rgb,
    /// From 0 to 1; below 0.1 the fibres fade.
    pub roughness: f32,
}

/// Least roughness of the fits.
const LEAST: f32 = 0.1;
/// Share of samples drawn from the transformed lobe.
const TRANSFORMED: f32 = 0.8;

/// Logarithm of the albedo: rows by powers of the root of the cosine, columns by powers of that of the roughness.
const ALBEDO: [[f32; 7]; 7] = [
    [-1.133, 1.1998, -1.16, 1.3884, -1.3805, 0.74013, -0.13179],
    [-1.8695, 3.0566, -3.7011, 6.5418, -4.8962, -3.7079, 4.2094],
    [-1.5596, 3.3781, -5.9468, 3.0977, 7.7787, -9.0887, 1.9852],
    [-0.5239, 1.6546, 1.5874, -17.888, 19.094, 9.0915, -13.185],
    [0.16538, -1.7707, 12.322, -15.577, -9.0082, 20.111, -5.8945],
    [0.24068, -1.7102, 0.60735, 12.067, -14.453, -6.3551, 9.75],
    [0.011082, 0.18208, -6.7057, 11.857, 2.4043, -12.653, 4.7097],
];
/// Logarithm of the matrix's first number.
const WIDTH: [[f32; 6]; 6] = [
    [-1.0086, 0.97776, -0.16956, 0.3981, -0.33063, -0.055302],
    [0.51842, -0.098517, -0.63708, -0.19246, 0.73913, -0.20292],
    [-0.52456, 0.91512, 0.1362, -2.0466, 1.3275, 0.11522],
    [0.2158, -1.1508, 1.6533, 0.49772, -1.3798, 0.13836],
    [0.3593, -0.67969, -0.0084709, 1.3458, -0.9541, -0.018762],
    [-0.21569, 0.76028, -1.0283, -0.2969, 0.78863, -0.01644],
];
/// The matrix's second number over the first.
const LEAN: [[f32; 6]; 6] = [
    [-0.184, -0.30204, 0.30188, 0.65416, -0.28034, -0.20141],
    [0.49801, 0.32514, -2.9675, 1.6973, 2.0896, -1.6401],
    [-0.93917, 2.6678, 1.0056, -6.0727, 0.53657, 2.9192],
    [0.44071, -4.9826, 9.4299, -0.44622, -8.5041, 3.9573],
    [0.64361, -1.3112, -2.9665, 6.3682, 1.2671, -4.1306],
    [-0.5203, 4.0335, -5.7507, -1.9432, 5.8182, -1.5101],
];
/// Logarithm of the albedo of diffuse light, within 2 %.
const MEAN: [f32; 6] = [-2.417, 2.375, -0.743, -0.02, -0.244, 0.253];

#[inline]
fn polynomial<const N: usize>(coefficients: &[f32; N], x: f32) -> f32 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[inline]
fn surface<const N: usize>(rows: &[[f32; N]; N], s: f32, t: f32) -> f32 {
    rows.iter().rev().fold(0.0, |sum, row| sum * s + polynomial(row, t))
}

impl Microfibers {
    fn root(&self) -> f32 {
        3.0 * self.roughness.max(LEAST).sqrt() - 2.0
    }

    /// Factor that fades fibres below the fits' range.
    fn fading(&self) -> f32 {
        let share = (self.roughness / LEAST).min(1.0);
        share * share
    }

    fn root_of(cos: f32) -> f32 {
        2.0 * cos.abs().min(1.0).sqrt() - 1.0
    }

    /// Albedo of white fibres for uniform light, towards a direction at this cosine: less than 0.77.
    pub(super) fn albedo(&self, cos: f32) -> f32 {
        exp(surface(&ALBEDO, Self::root_of(cos), self.root())) * self.fading()
    }

    /// The same, averaged over all directions.
    pub(super) fn mean_albedo(&self) -> f32 {
        exp(polynomial(&MEAN, self.root())) * self.fading()
    }

    /// Factor on what lies below, seen from a direction at this cosine.
    pub(super) fn lets_through(&self, cos: f32) -> f32 {
        1.0 - self.color.max_element() * self.albedo(cos)
    }

    /// For light that leaves on only one side of a surface: each crossing counts separately.
    pub(super) fn crossed(&self, cos: f32) -> f32 {
        self.lets_through(cos) / (1.0 - self.color.max_element() * self.mean_albedo()).sqrt()
    }

    /// The matrix's numbers for a viewing direction at this cosine.
    fn matrix(&self, cos: f32) -> [f32; 2] {
        let (s, t) = (Self::root_of(cos), self.root());
        let a = exp(surface(&WIDTH, s, t));
        [a, a * surface(&LEAN, s, t)]
    }

    /// Density of the transformed lobe over the cosine; both directions are in front.
    fn density(&self, camera: Vec3, light: Vec3) -> f32 {
        let [a, b] = self.matrix(camera.z);
        let [x, y] = to_plane(camera, light);
        let (x, y) = (a * x + b * light.z, a * y);
        let share = a / (x * x + y * y + light.z * light.z);
        FRAC_1_PI * share * share
    }

    /// Value. Both directions in front.
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        let (camera, light) = (mode.towards_camera(wo, wi), mode.towards_camera(wi, wo));
        self.color * (self.albedo(camera.z) * self.density(camera, light))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        // Photons, whose value has another lobe, need some samples everywhere.
        let even = warp::cosine_hemisphere_pdf(wi.z);
        TRANSFORMED * self.density(wo, wi) * wi.z + (1.0 - TRANSFORMED) * even
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Vec3 {
        if u.x >= TRANSFORMED {
            return warp::cosine_hemisphere(Vec2::new((u.x - TRANSFORMED) / (1.0 - TRANSFORMED), u.y));
        }
        let [a, b] = self.matrix(wo.z);
        let w = warp::cosine_hemisphere(Vec2::new(u.x / TRANSFORMED, u.y));
        let (x, y) = ((w.x - b * w.z) / a, w.y / a);
        let [cos, sin] = azimuth(wo);
        Vec3::new(x * cos - y * sin, x * sin + y * cos, w.z).normalize()
    }
}

/// Cosine and sine of the angle around the normal.
fn azimuth(w: Vec3) -> [f32; 2] {
    let radius = (w.x * w.x + w.y * w.y).sqrt();
    match radius > 0.0 {
        true => [w.x / radius, w.y / radius],
        false => [1.0, 0.0],
    }
}

/// Components of a direction along another one and across it, both projected onto the surface.
fn to_plane(along: Vec3, w: Vec3) -> [f32; 2] {
    let [cos, sin] = azimuth(along);
    [cos * w.x + sin * w.y, cos * w.y - sin * w.x]
}

impl Sheen {
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        match reflects(wo, wi, self.two_sided) {
            true => self.fibers.eval(wo * wo.z.signum(), wi * wo.z.signum(), mode),
            false => Rgb::ZERO,
        }
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match reflects(wo, wi, self.two_sided) {
            true => self.fibers.pdf(wo * wo.z.signum(), wi * wo.z.signum()),
            false => 0.0,
        }
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        let sign = lit_side(wo, self.two_sided)?;
        let wi = self.fibers.sample(wo * sign, u) * sign;
        BsdfSample::in_lobe(wo, wi, self.pdf(wo, wi), || self.eval(wo, wi, mode))
    }
}
