//! Surfaces that emit only into a cone around their normals, like Blender's area lights with a spread: a softbox behind
//! a grid of slats.
//!
//! At an angle t to the normal, slats hide a share tan t / tan a of the surface, where a is the cone's half angle. The
//! rest is brightened to keep the power: the integral of (1 - tan t / tan a) cos t over the cone is pi (tan a - a) /
//! tan a, that of cos t over the hemisphere pi. So the radiance is (tan a - tan t) / (tan a - a) times that of a
//! surface of the same power with uniform radiance (Cycles' `area_light_spread_attenuation`).

use crate::math::Vec3;

/// The cone that a surface emits into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// tan a.
    tan: f32,
    /// cos a, and sin^2 a.
    cos: f32,
    sin2: f32,
    /// 1 / (tan a - a).
    scale: f32,
}

impl Spread {
    /// From the cone's full angle, degrees, at least 1; `None` if it is the whole hemisphere, or nearly so.
    pub fn new(degrees: f64) -> Option<Self> {
        let a = (0.5 * degrees).to_radians();
        let (sin, cos) = libm::sincos(a);
        let tan = sin / cos;
        (cos > 1e-6).then(|| Self {
            tan: tan as f32,
            cos: cos as f32,
            sin2: (sin * sin) as f32,
            scale: (1.0 / (tan - a)) as f32,
        })
    }

    /// Radiance relative to that of a uniform surface. `cos`: of the angle to the normal.
    pub(crate) fn share(&self, cos: f32) -> f32 {
        let tan = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        // Also for NaN.
        if cos > 0.0 && tan < self.tan {
            (self.tan - tan) * self.scale
        } else {
            0.0
        }
    }

    /// Maps a cosine-distributed direction around +z into the cone.
    pub(super) fn narrowed(&self, dir: Vec3) -> Vec3 {
        let across = dir.truncate() * self.sin2.sqrt();
        across.extend((1.0 - across.length_squared()).max(0.0).sqrt())
    }

    /// Projected solid angle of the cone over that of the hemisphere.
    pub(super) fn projected(&self) -> f32 {
        self.sin2
    }

    /// Whether it emits at an angle of this cosine.
    pub(super) fn holds(&self, cos: f32) -> bool {
        // Rounding may move a drawn direction over the edge.
        cos >= self.cos * (1.0 - 1e-6)
    }

    /// The tangent of its half angle, the cosine, and the solid angle over 2 pi.
    pub(super) fn cone(&self) -> [f32; 3] {
        [self.tan, self.cos, self.sin2 / (1.0 + self.cos)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, Rgb, Vec2};
    use crate::sampler::{Purpose, Sampler};
    use crate::world::geometry::{Object, Placement, Shape};
    use crate::world::light::{EmissionUniforms, Light, LightHit, LightKind, LightPoint, SceneBounds};
    use beamfarm_image::layer::LightGroup;

    const BOUNDS: SceneBounds = SceneBounds {
        center: Vec3::ZERO,
        radius: 9.0,
    };
    const ANGLES: [f64; 5] = [1.0, 20.0, 90.0, 150.0, 178.0];

    fn disc(degrees: f64, two_sided: bool) -> (Vec<Object>, Light) {
        let object = Object {
            light: Some(0),
            ..Object::new(Shape::Disc {
                placement: Placement::IDENTITY,
                flip: false,
            })
        };
        let light = Light {
            name: String::new(),
            group: LightGroup::named(""),
            kind: LightKind::Area {
                object: 0,
                radiance: Rgb::new(3.0, 2.0, 0.5),
                pattern: None,
                two_sided,
                spread: Spread::new(degrees),
                soft: false,
            },
        };
        (vec![object], light)
    }

    /// Against the formula in angles, and its integral over the hemisphere: the power is that without a spread.
    #[test]
    fn the_cone_has_all_of_the_power() {
        for degrees in ANGLES {
            let spread = Spread::new(degrees).unwrap();
            let a = (0.5 * degrees).to_radians();
            const N: u32 = 20_000;
            let mut sum = 0.0;
            for i in 0..N {
                let t = a * (f64::from(i) + 0.5) / f64::from(N);
                let (sin, cos) = libm::sincos(t);
                let expected = (libm::tan(a) - libm::tan(t)) / (libm::tan(a) - a);
                let found = f64::from(spread.share(cos as f32));
                // Angles closer than this share a cosine in single precision.
                let room = 4e-4 / (libm::tan(a) - a) + 2e-5;
                assert!((found - expected).abs() < room, "{degrees} {t} {found} {expected}");
                sum += expected * 2.0 * sin * cos * a / f64::from(N);
            }
            assert!((sum - 1.0).abs() < 1e-4, "{degrees}: {sum}");
            assert_eq!(spread.share(libm::cos(a * 1.01) as f32), 0.0);
            assert_eq!(spread.share(-1.0), 0.0);
        }
        assert_eq!(Spread::new(180.0), None);
    }

    /// Photons carry the power on average, in directions with the density that they report, and stand for the radiance.
    #[test]
    fn photons_carry_it() {
        for two_sided in [false, true] {
            for degrees in &ANGLES[1..] {
                let (objects, light) = disc(*degrees, two_sided);
                let power = light.power(&objects, &BOUNDS);
                let sides = if two_sided { 2.0 } else { 1.0 };
                assert!(
                    (power / (Rgb::new(3.0, 2.0, 0.5) * (sides * PI * PI)) - 1.0)
                        .abs()
                        .max_element()
                        < 1e-6
                );
                const N: usize = 20_000;
                let (mut sum, mut squares, mut up) = (0.0, 0.0, 0);
                for i in 0..N {
                    let mut sampler = Sampler::new(1, 0, Purpose::Test, i as u64);
                    let start = light.sample_emission(&objects, &BOUNDS, EmissionUniforms::draw(&mut sampler));
                    let normal = start.normal.unwrap();
                    let cos = normal.dot(start.dir);
                    let at = crate::world::texture::TexturePoint::default();
                    let radiance = light.radiance_area(normal.z * cos, &at);
                    let expected = radiance * (cos / (start.pdf_dir * start.pdf_pos));
                    assert!(
                        (start.power - expected).abs().max_element() < 2e-3 * power.x,
                        "{start:?} {expected}"
                    );
                    let on = LightPoint {
                        normal: Vec3::Z,
                        primitive: 0,
                    };
                    let density = light.emitted_density(&objects, &BOUNDS, start.dir, on);
                    assert!((density * cos / (start.pdf_dir * start.pdf_pos) - 1.0).abs() < 1e-4);
                    let x = f64::from(start.power.x / power.x);
                    (sum, squares) = (sum + x, squares + x * x);
                    up += usize::from(normal.z > 0.0);
                }
                let n = N as f64;
                let error = ((squares / n - (sum / n) * (sum / n)) / n).sqrt();
                assert!(
                    (sum / n - 1.0).abs() < 4.0 * error + 1e-6,
                    "{degrees}: {} {error}",
                    sum / n
                );
                let half = if two_sided { 0.5 } else { 1.0 };
                assert!((up as f64 / n - half).abs() < 4.0 * 0.5 / n.sqrt() * (2.0 - 2.0 * half) + 1e-9);
            }
        }
    }

    /// The irradiance at a point in front of the disc, from shadow rays, is the integral over the disc; and the ratio
    /// for MIS between shadow rays and photons is that of their densities.
    #[test]
    fn shadow_rays_find_what_is_emitted() {
        let from = Vec3::new(0.5, 0.2, 3.0);
        for degrees in &ANGLES[1..] {
            let (objects, light) = disc(*degrees, false);
            let spread = Spread::new(*degrees).unwrap();
            // Irradiance of a horizontal surface.
            const N: i32 = 1000;
            let mut expected = 0.0;
            for i in 0..N * N {
                let at = Vec2::new((i % N) as f32 + 0.5, (i / N) as f32 + 0.5) * (2.0 / N as f32) - 1.0;
                if at.length_squared() < 1.0 {
                    let offset = from - at.extend(0.0);
                    let cos = f64::from(offset.normalize().z);
                    let area = 4.0 / f64::from(N * N);
                    expected += 3.0 * f64::from(spread.share(cos as f32)) * cos * cos * area
                        / f64::from(offset.length_squared());
                }
            }
            const M: usize = 40_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for i in 0..M {
                let mut sampler = Sampler::new(2, 0, Purpose::Test, i as u64);
                let (u, more) = light.draw_direct(&objects, &mut sampler);
                let found = light.sample_direct(&objects, from, u, more);
                let value = found.map_or(0.0, |direct| {
                    let at = LightHit {
                        normal: direct.normal,
                        primitive: 0,
                        distance: direct.distance,
                    };
                    let ratio = light.photon_density(&objects, &BOUNDS, from, direct.wi, at);
                    let on = LightPoint {
                        normal: direct.normal,
                        primitive: 0,
                    };
                    let emitted = light.emitted_density(&objects, &BOUNDS, -direct.wi, on);
                    assert!((ratio * direct.pdf / emitted - 1.0).abs() < 1e-4);
                    f64::from(-direct.wi.z * direct.weight.x)
                });
                (sum, squares) = (sum + value, squares + value * value);
            }
            let m = M as f64;
            let error = ((squares / m - (sum / m) * (sum / m)) / m).sqrt();
            assert!(
                (sum / m - expected).abs() < 4.0 * error + 1e-3 * expected,
                "{degrees}: {} {expected} {error}",
                sum / m
            );
        }
    }
}
