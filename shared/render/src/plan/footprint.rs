//! Photon differentials: the share of the light that one photon stands for, carried along its path.
//!
//! Igehy 1999, Tracing ray differentials; Schjøth et al. 2007, Photon differentials. Only kernel radii depend on these.
//! They change constants of noise and blur, never the limit.

use crate::math::{Frame, Vec3};

/// Two tangent displacements of a photon's position and the matching changes of its direction.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    position: [Vec3; 2],
    direction: [Vec3; 2],
    /// Whether a medium or a surface that is not specular has scattered the photon: such light has no sharp edges.
    smooth: bool,
}

impl Footprint {
    /// A round footprint around the unit vector `dir`: `radius` in scene units at the start, `spread` in radians.
    pub fn new(dir: Vec3, radius: f32, spread: f32) -> Self {
        let frame = Frame::from_normal(dir);
        Self {
            position: [frame.s * radius, frame.t * radius],
            direction: [frame.s * spread, frame.t * spread],
            smooth: false,
        }
    }

    /// Whether the photon has been scattered on its way.
    pub fn is_smooth(&self) -> bool {
        self.smooth
    }

    /// The displacements of the position, scene units, and the matching changes of the direction.
    pub fn displacements(&self) -> [[Vec3; 2]; 2] {
        [self.position, self.direction]
    }

    /// Radius: root mean square of the two displacements.
    pub fn radius(&self) -> f32 {
        let [a, b] = self.position;
        (0.5 * (a.length_squared() + b.length_squared())).sqrt()
    }

    /// The footprint after free flight over the distance `t`.
    pub fn advanced(&self, t: f32) -> Self {
        Self {
            position: [
                self.position[0] + self.direction[0] * t,
                self.position[1] + self.direction[1] * t,
            ],
            ..*self
        }
    }

    /// Moves the displacements along the ray, from its cross-section onto the surface with unit normal `n`.
    fn onto_surface(&self, dir: Vec3, n: Vec3) -> [Vec3; 2] {
        let cos = dir.dot(n);
        // At grazing angles the displacement grows without bound; a cosine of a tenth limits it.
        let cos = if cos.abs() < 0.1 { 0.1f32.copysign(cos) } else { cos };
        let [a, b] = self.position;
        let onto = |p: Vec3| p - dir * (p.dot(n) / cos);
        [onto(a), onto(b)]
    }

    /// Displacements on a surface, seen across the ray that leaves it: along the ray they add no width.
    fn leaving(&self, position: [Vec3; 2], direction: [Vec3; 2], dir: Vec3) -> Self {
        let across = |p: Vec3| p - dir * p.dot(dir);
        Self {
            position: [across(position[0]), across(position[1])],
            direction,
            smooth: self.smooth,
        }
        .bounded()
    }

    /// The footprint after a mirror reflection of direction `dir`, at a surface with normal `n` that turns by
    /// `curvature`.
    pub fn reflected(&self, dir: Vec3, n: Vec3, curvature: f32) -> Self {
        let position = self.onto_surface(dir, n);
        let turn = |i: usize| {
            let dn = position[i] * curvature;
            let change = self.direction[i].dot(n) + dir.dot(dn);
            self.direction[i] - 2.0 * (dn * dir.dot(n) + n * change)
        };
        self.leaving(position, [turn(0), turn(1)], dir - n * (2.0 * dir.dot(n)))
    }

    /// The footprint after refraction from `dir` to `refracted`; `eta` is the index on the incoming side over the other
    /// one.
    pub fn refracted(&self, dir: Vec3, refracted: Vec3, n: Vec3, curvature: f32, eta: f32) -> Self {
        let position = self.onto_surface(dir, n);
        let (n, curvature) = if dir.dot(n) < 0.0 {
            (n, curvature)
        } else {
            (-n, -curvature)
        };
        let (cos_i, cos_t) = (dir.dot(n), refracted.dot(n).min(-0.05));
        let mu = eta * cos_i - cos_t;
        let turn = |i: usize| {
            let dn = position[i] * curvature;
            let change = self.direction[i].dot(n) + dir.dot(dn);
            let dmu = (eta - eta * eta * cos_i / cos_t) * change;
            self.direction[i] * eta - dn * mu - n * dmu
        };
        self.leaving(position, [turn(0), turn(1)], refracted)
    }

    /// The footprint after scattering into `dir` with density `pdf` per steradian, as one of `paths` photons. `widely`:
    /// by more than a narrow lobe.
    pub fn scattered(&self, dir: Vec3, pdf: f32, paths: f32, widely: bool) -> Self {
        Self {
            smooth: self.smooth || widely,
            ..Self::new(dir, self.radius(), spread(pdf, paths))
        }
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

/// Half angle of the cone that one of `paths` photons covers, where directions have density `pdf` per steradian.
pub fn spread(pdf: f32, paths: f32) -> f32 {
    (1.0 / (std::f32::consts::PI * pdf * paths)).sqrt().min(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// The surface that the rays meet.
    #[derive(Clone, Copy, Debug)]
    enum Surface {
        /// Through the origin.
        Plane,
        /// With this centre; passes through the origin.
        Sphere(DVec3),
    }

    impl Surface {
        /// Where a ray that starts near the origin meets the surface, and the outward normal there.
        fn meet(self, origin: DVec3, dir: DVec3, normal: DVec3) -> (DVec3, DVec3) {
            match self {
                Self::Plane => {
                    let t = -origin.dot(normal) / dir.dot(normal);
                    (origin + dir * t, normal)
                }
                Self::Sphere(center) => {
                    let offset = origin - center;
                    let (b, c) = (offset.dot(dir), offset.length_squared() - center.length_squared());
                    let half = (b * b - c).sqrt();
                    // The rays start less than a chord before the origin.
                    let t = if (half - b).abs() < (half + b).abs() {
                        half - b
                    } else {
                        -half - b
                    };
                    let point = origin + dir * t;
                    (point, (point - center).normalize())
                }
            }
        }
    }

    /// Snell's law, from the side of index `from` to that of index `to`.
    fn refract(dir: DVec3, n: DVec3, from: f64, to: f64) -> DVec3 {
        let n = if dir.dot(n) < 0.0 { n } else { -n };
        let tangential = (dir - n * dir.dot(n)) * (from / to);
        tangential - n * (1.0 - tangential.length_squared()).sqrt()
    }

    /// Rays next to a ray, traced through a surface one by one, are as far from it as the footprint says: through
    /// planes and spheres, into and out of glass and a bubble, at several angles, and off a mirror.
    #[test]
    fn footprints_are_what_neighbouring_rays_do() {
        const BEFORE: f64 = 0.1;
        const AFTER: f64 = 0.3;
        const STEP: f64 = 1e-6;
        let normal = DVec3::new(0.48, -0.6, 0.64);
        let tangent = normal.any_orthonormal_vector();
        let surfaces = [(Surface::Plane, 0.0), (Surface::Sphere(normal * -0.8), 1.25)];
        for (surface, curvature) in surfaces {
            for (degrees, side) in [0.0f64, 20.0, 40.0, 70.0]
                .into_iter()
                .flat_map(|degrees| [(degrees, -1.0), (degrees, 1.0)])
            {
                let (sin, cos) = (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
                let dir = tangent * sin + normal * (side * cos);
                for (outside, inside) in [(1.0, 1.5), (1.5, 1.0), (1.0, 1.0)] {
                    let (from, to) = if side < 0.0 {
                        (outside, inside)
                    } else {
                        (inside, outside)
                    };
                    for mirror in [true, false] {
                        if !mirror && sin * from / to >= 0.95 {
                            continue;
                        }
                        let leave = |dir: DVec3, n: DVec3| match mirror {
                            true => dir - n * (2.0 * dir.dot(n)),
                            false => refract(dir, n, from, to),
                        };
                        let out = leave(dir, normal);
                        let started = Footprint::new(dir.as_vec3(), 0.02, 0.1);
                        let arrived = started.advanced(BEFORE as f32);
                        let (d, n, c) = (dir.as_vec3(), normal.as_vec3(), curvature as f32);
                        let footprint = match mirror {
                            true => arrived.reflected(d, n, c),
                            false => arrived.refracted(d, out.as_vec3(), n, c, (from / to) as f32),
                        };
                        let footprint = footprint.advanced(AFTER as f32);
                        for i in 0..2 {
                            let moved = dir * -BEFORE + started.position[i].as_dvec3() * STEP;
                            let turned = (dir + started.direction[i].as_dvec3() * STEP).normalize();
                            let (point, n) = surface.meet(moved, turned, normal);
                            let neighbour = leave(turned, n);
                            // Where it crosses the plane that is perpendicular to the ray at its end.
                            let t = (AFTER - point.dot(out)) / neighbour.dot(out);
                            let traced = (point + neighbour * t - out * AFTER) / STEP;
                            let said = footprint.position[i].as_dvec3();
                            assert!(
                                (said - traced).length() < 2e-3 * (0.02 + traced.length()),
                                "{surface:?}, {degrees} degrees, {from} to {to}, mirror: {mirror}: \
                                 {said} not {traced}"
                            );
                        }
                    }
                }
            }
        }
    }
}
