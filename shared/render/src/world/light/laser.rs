//! A laser: parallel light from a disc.
//!
//! All light has one direction, and a point is lit if the line back from it meets the disc. Shadow rays and photons see
//! the same light, and no ray meets it by chance.

use super::DirectSample;
use crate::math::{Frame, PI, Ray, Rgb, Vec2, Vec3, exp_neg, ln_1p, one_minus_exp_neg, sin_cos};

/// Where a Gaussian beam is cut off, in radii: 1.5e-8 of its light lies beyond.
const CUT: f32 = 3.0;

/// A laser.
#[derive(Clone, Copy, Debug)]
pub struct Laser {
    /// Centre of the disc, render space.
    pub position: Vec3,
    /// `n` is the direction of travel.
    pub frame: Frame,
    /// Radius of the disc; for a Gaussian beam, where the irradiance is 1 / e^2 of that at the centre. Scene units.
    pub radius: f32,
    /// Irradiance at the centre, W/m^2 across the direction.
    pub irradiance: Rgb,
    /// How it varies across the beam.
    pub profile: Profile,
}

/// How irradiance varies across a laser's beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Constant up to the radius.
    Flat,
    /// As exp(-2 r^2 / w^2) with w the radius, up to 3 w.
    Gaussian,
}

impl Profile {
    /// Power of a beam of radius 1 with irradiance 1 W/m^2 at the centre, W.
    pub fn area(self) -> f32 {
        match self {
            Self::Flat => PI,
            // The integral of exp(-2 r^2) 2 pi r from 0 to the cut.
            Self::Gaussian => 0.5 * PI * one_minus_exp_neg(2.0 * CUT * CUT),
        }
    }

    /// Where it ends, in radii.
    pub fn end(self) -> f32 {
        match self {
            Self::Flat => 1.0,
            Self::Gaussian => CUT,
        }
    }
}

impl Laser {
    /// Beyond this distance from its axis there is no light; scene units.
    pub fn reach(&self) -> f32 {
        self.radius * self.profile.end()
    }

    /// Area that would receive all the light at the central irradiance.
    fn area(&self) -> f32 {
        self.radius * self.radius * self.profile.area()
    }

    /// W.
    pub(super) fn power(&self) -> Rgb {
        self.irradiance * self.area()
    }

    /// Mean irradiance over the whole disc, W/m^2 across the direction.
    pub(super) fn mean_irradiance(&self) -> Rgb {
        self.irradiance * (self.profile.area() / (PI * self.profile.end() * self.profile.end()))
    }

    /// Share of the middle's irradiance at a point, whatever is before or behind it; nothing behind the disc.
    fn share(&self, at: Vec3) -> f32 {
        let offset = at - self.position;
        let across2 = offset.cross(self.frame.n).length_squared() / (self.radius * self.radius);
        let end = self.profile.end();
        // Also for NaN.
        if !(across2 <= end * end && offset.dot(self.frame.n) >= 0.0) {
            return 0.0;
        }
        match self.profile {
            Profile::Flat => 1.0,
            Profile::Gaussian => exp_neg(-2.0 * across2),
        }
    }

    /// W/m^2 across the direction at a point.
    pub(crate) fn irradiance_at(&self, at: Vec3) -> Rgb {
        self.irradiance * self.share(at)
    }

    /// Density of its light per area across the direction, at a point that its photons can reach.
    pub(crate) fn density_at(&self, at: Vec3) -> f32 {
        self.share(at) / self.area()
    }

    /// A starting point of light, and the density of such points per area.
    pub fn start(&self, u: Vec2) -> (Vec3, f32) {
        let (r2, share) = match self.profile {
            Profile::Flat => (u.x, 1.0),
            Profile::Gaussian => {
                let depth = -ln_1p(-u.x * one_minus_exp_neg(2.0 * CUT * CUT));
                (0.5 * depth, exp_neg(-depth))
            }
        };
        let (sin, cos) = sin_cos(2.0 * PI * u.y);
        let r = self.radius * r2.max(0.0).sqrt();
        let across = self.frame.to_world(Vec3::new(r * cos, r * sin, 0.0));
        (self.position + across, share / self.area())
    }

    /// The starting point of light that reaches a point; `None` outside the beam. The disc crosses the whole line
    /// through it, in front of the point or behind it.
    pub(crate) fn start_towards(&self, at: Vec3) -> Option<Vec3> {
        let offset = at - self.position;
        let across = offset - self.frame.n * offset.dot(self.frame.n);
        (across.length_squared() <= self.reach() * self.reach()).then(|| self.position + across)
    }

    /// Light towards a point.
    pub(super) fn towards(&self, from: Vec3) -> Option<DirectSample> {
        let weight = self.irradiance_at(from);
        (weight != Rgb::ZERO).then(|| DirectSample {
            wi: -self.frame.n,
            normal: self.frame.n,
            primitive: 0,
            distance: (from - self.position).dot(self.frame.n),
            weight,
            pdf: 1.0,
            unmet: true,
        })
    }

    /// The part of a segment inside the beam, or slightly more.
    pub(super) fn clip(&self, ray: &Ray, length: f32) -> Option<[f32; 2]> {
        let n = self.frame.n;
        let offset = ray.origin - self.position;
        let (height, slope) = (offset.dot(n), ray.dir.dot(n));
        // In front of the disc.
        let crossing = -height / slope;
        let mut range = match slope {
            _ if slope > 0.0 => [crossing.max(0.0), length],
            _ if slope < 0.0 => [0.0, crossing.min(length)],
            _ if height >= 0.0 => [0.0, length],
            _ => return None,
        };
        // In the cylinder: |p + t q| <= r across the axis.
        let (p, q) = (offset.cross(n), ray.dir.cross(n));
        let (pq, qq) = (p.dot(q), q.length_squared());
        let r = self.reach() * (1.0 + 1e-5);
        if qq == 0.0 {
            return (p.length_squared() <= r * r && range[0] < range[1]).then_some(range);
        }
        // Closest approach of the lines, without cancellation.
        let nearest = -pq / qq;
        let apart2 = (p + q * nearest).length_squared();
        let half = ((r * r - apart2) / qq).sqrt();
        // NaN where they are too far apart.
        if half >= 0.0 {
            range = [range[0].max(nearest - half), range[1].min(nearest + half)];
        }
        (half >= 0.0 && range[0] < range[1]).then_some(range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::world::light::{EmissionUniforms, Light, LightKind, SceneBounds};
    use beamfarm_image::layer::LightGroup;

    const BOUNDS: SceneBounds = SceneBounds {
        center: Vec3::ZERO,
        radius: 9.0,
    };

    fn laser(profile: Profile) -> Laser {
        Laser {
            position: Vec3::new(0.3, -0.2, 0.5),
            frame: Frame::from_normal(Vec3::new(1.0, 2.0, -0.4).normalize()),
            radius: 0.3,
            irradiance: Rgb::new(3.0, 2.0, 0.5),
            profile,
        }
    }

    fn light(laser: Laser) -> Light {
        Light {
            name: "laser".into(),
            kind: LightKind::Laser(laser),
            group: LightGroup::named("laser"),
        }
    }

    const BOTH: [Profile; 2] = [Profile::Flat, Profile::Gaussian];

    /// Integrated over a lattice on a plane across the beam, the irradiance from shadow rays is the power that photons
    /// carry. With a flat profile it is the power over the area, with a Gaussian one twice that at the centre.
    #[test]
    fn planes_get_the_power() {
        for profile in BOTH {
            let laser = laser(profile);
            let light = light(laser);
            let power = light.power(&[], &BOUNDS);
            let middle = laser.position + laser.frame.n * 2.0;
            let lit = |at: Vec3| {
                let found = light.sample_direct(&[], at, Vec2::ZERO, 0.0);
                found.map_or(Rgb::ZERO, |direct| {
                    assert!((direct.wi + laser.frame.n).length() < 1e-6 && (direct.distance - 2.0).abs() < 1e-5);
                    direct.weight / direct.pdf
                })
            };
            let circle = PI * laser.radius * laser.radius;
            let expected = match profile {
                Profile::Flat => power / circle,
                Profile::Gaussian => power * 2.0 / circle,
            };
            assert!((lit(middle) / expected - 1.0).abs().max_element() < 1e-6);
            const N: u32 = 600;
            let mut sum = [0.0f64; 3];
            let half = 1.1 * laser.reach();
            for i in 0..N * N {
                let at = Vec2::new((i % N) as f32 + 0.5, (i / N) as f32 + 0.5) * (2.0 / N as f32) - 1.0;
                let here = lit(middle + laser.frame.to_world((at * half).extend(0.0)));
                for (sum, value) in sum.iter_mut().zip(here.to_array()) {
                    *sum += f64::from(value) * f64::from(4.0 * half * half) / f64::from(N * N);
                }
            }
            for (sum, power) in sum.into_iter().zip(power.to_array()) {
                assert!((sum / f64::from(power) - 1.0).abs() < 1e-3, "{profile:?} {sum} {power}");
            }
            // None behind the disc, nor beside it.
            assert_eq!(lit(laser.position - laser.frame.n), Rgb::ZERO);
            assert_eq!(lit(middle + laser.frame.s * (1.001 * laser.reach())), Rgb::ZERO);
        }
    }

    /// Photons start where the irradiance says: in rings of equal expected counts, from the closed-form integral of the
    /// profile, and with the densities of their places.
    #[test]
    fn photons_start_as_bright_as_the_beam_is() {
        const N: usize = 40_000;
        const RINGS: usize = 10;
        for profile in BOTH {
            let laser = laser(profile);
            let light = light(laser);
            let power = light.power(&[], &BOUNDS);
            let mut rings = [0usize; RINGS];
            for i in 0..N {
                let mut sampler = Sampler::new(1, 0, Purpose::Test, i as u64);
                let start = light.sample_emission(&[], &BOUNDS, EmissionUniforms::draw(&mut sampler));
                assert_eq!((start.dir, start.power), (laser.frame.n, power));
                let there = laser.density_at(start.origin + start.dir);
                assert!((there / start.pdf_pos - 1.0).abs() < 1e-3 || there == 0.0, "{there}");
                let offset = (start.origin - laser.position) / laser.radius;
                assert!(offset.dot(start.dir).abs() < 1e-5);
                let r2 = f64::from(offset.length_squared());
                let below = match profile {
                    Profile::Flat => r2,
                    Profile::Gaussian => 1.0 - libm::exp(-2.0 * r2),
                };
                rings[((below * RINGS as f64) as usize).min(RINGS - 1)] += 1;
            }
            let expected = N as f64 / RINGS as f64;
            let chi2: f64 = rings
                .iter()
                .map(|n| libm::pow(*n as f64 - expected, 2.0) / expected)
                .sum();
            // 9 degrees of freedom: one in a thousand exceeds 27.9.
            assert!(chi2 < 27.9, "{profile:?} {chi2} {rings:?}");
        }
    }

    /// The part inside the beam, checked at points along lines.
    #[test]
    fn segments_are_clipped_by_the_beam() {
        let laser = laser(Profile::Flat);
        let (mut met, mut of) = (0, 0);
        for line in 0..4000 {
            let mut sampler = Sampler::new(1, 0, Purpose::Test, line);
            let mut ray = Ray {
                origin: 1.5 * crate::warp::uniform_sphere(sampler.next_2d()),
                dir: crate::warp::uniform_sphere(sampler.next_2d()),
            };
            if line % 4 == 0 {
                ray.dir = laser.frame.n * if line % 8 == 0 { 1.0 } else { -1.0 };
            }
            let range = laser.clip(&ray, 3.0);
            met += usize::from(range.is_some());
            for i in 0..50 {
                let t = 0.06 * (i as f32 + 0.5);
                let at = ray.at(t);
                let offset = at - laser.position;
                let depth = (laser.reach() - offset.cross(laser.frame.n).length()).min(offset.dot(laser.frame.n));
                let is_in = range.is_some_and(|[start, end]| (start..=end).contains(&t));
                assert!(
                    is_in == (depth > 0.0) || depth.abs() < 2e-5,
                    "{line} {t} {depth} {range:?}"
                );
                of += usize::from(is_in);
            }
        }
        assert!(met > 150 && of > 1000, "{met} {of}");
    }
}
