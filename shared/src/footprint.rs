//! Photon differentials: how large a share of the light one photon stands for, carried along its path.
//!
//! Igehy 1999, Tracing ray differentials; Schjøth et al. 2007, Photon differentials. Only radii of kernels depend on
//! these: they change constants of noise and blur, never the limit.

use crate::math::{Frame, Vec3};

/// Two tangent displacements of a photon's position and the matching changes of its direction.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    position: [Vec3; 2],
    direction: [Vec3; 2],
}

impl Footprint {
    /// A round footprint: `radius` in scene units at the start, `spread` in radians, around the unit vector `dir`.
    pub fn new(dir: Vec3, radius: f32, spread: f32) -> Self {
        let frame = Frame::from_normal(dir);
        Self {
            position: [frame.s * radius, frame.t * radius],
            direction: [frame.s * spread, frame.t * spread],
        }
    }

    /// Radius: root mean square of the two displacements.
    pub fn radius(&self) -> f32 {
        let [a, b] = self.position;
        (0.5 * (a.length_squared() + b.length_squared())).sqrt()
    }

    /// After free flight over `t`.
    pub fn advanced(&self, t: f32) -> Self {
        Self {
            position: [0, 1].map(|i| self.position[i] + self.direction[i] * t),
            direction: self.direction,
        }
    }

    /// Displacements along the ray's cross-section moved into the surface with unit normal `n`.
    fn onto_surface(&self, dir: Vec3, n: Vec3) -> [Vec3; 2] {
        let cos = dir.dot(n);
        // At grazing angles the displacement is as long as one likes; a tenth keeps it bounded.
        let cos = if cos.abs() < 0.1 {
            0.1f32.copysign(cos)
        } else {
            cos
        };
        self.position.map(|p| p - dir * (p.dot(n) / cos))
    }

    /// After a mirror reflection of direction `dir` at a surface with normal `n` that turns by `curvature`.
    pub fn reflected(&self, dir: Vec3, n: Vec3, curvature: f32) -> Self {
        let position = self.onto_surface(dir, n);
        let direction = [0, 1].map(|i| {
            let dn = position[i] * curvature;
            let change = self.direction[i].dot(n) + dir.dot(dn);
            self.direction[i] - 2.0 * (dn * dir.dot(n) + n * change)
        });
        Self {
            position,
            direction,
        }
        .bounded()
    }

    /// After a refraction from `dir` to `refracted`; `eta` is the index on the incoming side over the other one.
    pub fn refracted(&self, dir: Vec3, refracted: Vec3, n: Vec3, curvature: f32, eta: f32) -> Self {
        let position = self.onto_surface(dir, n);
        let (n, curvature) = if dir.dot(n) < 0.0 {
            (n, curvature)
        } else {
            (-n, -curvature)
        };
        let (cos_i, cos_t) = (dir.dot(n), refracted.dot(n).min(-0.05));
        let mu = eta * cos_i - cos_t;
        let direction = [0, 1].map(|i| {
            let dn = position[i] * curvature;
            let change = self.direction[i].dot(n) + dir.dot(dn);
            let dmu = (eta - eta * eta * cos_i / cos_t) * change;
            self.direction[i] * eta - dn * mu - n * dmu
        });
        Self {
            position,
            direction,
        }
        .bounded()
    }

    /// After scattering into `dir` with a density of `pdf` per steradian, as one of `paths` photons.
    pub fn scattered(&self, dir: Vec3, pdf: f32, paths: f32) -> Self {
        Self::new(dir, self.radius(), spread(pdf, paths))
    }

    fn bounded(mut self) -> Self {
        for d in &mut self.direction {
            let length = d.length();
            if length > 1.0 {
                *d /= length;
            } else if length.is_nan() {
                *d = Vec3::ZERO;
            }
        }
        self
    }
}

/// Half angle of the cone that one of `paths` photons covers where directions have density `pdf` per steradian.
pub fn spread(pdf: f32, paths: f32) -> f32 {
    (1.0 / (std::f32::consts::PI * pdf * paths)).sqrt().min(0.5)
}
