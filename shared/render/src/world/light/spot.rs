//! The spot light: a cone of light with a plateau, then a ramp; from a point or from a whole ball.
//!
//! A ball looks the same from all sides, like Blender's: the radiance along a line through it depends on the line's
//! direction only. Photons start from points whose density in the ball is proportional to 1 / sqrt(r^2 - R^2), with R
//! the distance from the centre. That is uniform over the disc seen from any side (the Abel transform of a disc), and
//! the direction of a photon is independent of its point.
//!
//! Cosines enter as 1 - cos = 2 sin^2(angle / 2), which stays precise in narrow cones.

use super::direct::{Cone, from_point};
use super::{DirectSample, SoftBall};
use crate::math::{Frame, PI, Rgb, Vec2, Vec3, atan2, sin, sin_cos};
use crate::warp;

/// A ball counts as a point if its radius over its distance is below this.
const POINT: f32 = 1e-9;

/// A spot light.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Centre, render space.
    pub position: Vec3,
    /// `n` is the axis.
    pub frame: Frame,
    /// W/sr on the axis, of the whole ball.
    pub intensity: Rgb,
    /// Half angle of the cone in radians.
    pub cutoff: f32,
    /// Half angle of the plateau in radians, below `cutoff`.
    pub beam_width: f32,
    /// Shape of the falloff between the two.
    pub ramp: Ramp,
    /// Scene units; 0 is a point.
    pub radius: f32,
    /// Whether the ball's falloff is soft, see [`super::SoftBall`].
    pub soft: bool,
}

/// Shape of a spot's falloff from 1 to 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// Linear in the angle: Mitsuba 3's spot.
    Linear,
    /// x^2 (3 - 2 x), x linear in the cosine: Blender's spot.
    Smooth,
}

impl Spot {
    /// W/sr in a direction of any length.
    pub(crate) fn intensity(&self, dir: Vec3) -> Rgb {
        self.intensity * self.falloff(angle_from_axis(&self.frame, dir))
    }

    /// Fraction of the axial intensity at an angle from the axis.
    pub(super) fn falloff(&self, angle: f32) -> f32 {
        match self.ramp {
            Ramp::Smooth if angle > self.beam_width && angle < self.cutoff => {
                let [b, c] = [self.beam_width, self.cutoff].map(one_minus_cos);
                let x = ((c - one_minus_cos(angle)) / (c - b)).clamp(0.0, 1.0);
                x * x * (3.0 - 2.0 * x)
            }
            Ramp::Linear | Ramp::Smooth => falloff(angle, self.beam_width, self.cutoff),
        }
    }

    /// Integral of the falloff over all directions, sr.
    pub fn solid_angle(&self) -> f32 {
        match self.ramp {
            Ramp::Linear => linear_solid_angle(self.beam_width, self.cutoff),
            // The ramp's mean over the cosine is one half.
            Ramp::Smooth => PI * (one_minus_cos(self.beam_width) + one_minus_cos(self.cutoff)),
        }
    }

    /// Draws a direction: uniformly in the plateau with its share of the flux, otherwise in the ramp with a density
    /// that falls linearly in the cosine. Returns the direction, its angle, and its density per solid angle.
    pub(super) fn sample(&self, u: Vec2) -> (Vec3, f32, f32) {
        let [b, c] = [self.beam_width, self.cutoff].map(one_minus_cos);
        let total = self.solid_angle();
        let share = (2.0 * PI * b / total).min(1.0);
        let (h, pdf) = if u.x < share || c <= b {
            ((u.x / share).min(1.0) * b, 1.0 / total)
        } else {
            let left = (1.0 - u.x) / (1.0 - share);
            let root = left.min(1.0).sqrt();
            let pdf = (1.0 - share) * root / (PI * (c - b));
            (c - (c - b) * root, pdf)
        };
        let sin_theta = (h * (2.0 - h)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u.y);
        let dir = Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, 1.0 - h);
        (self.frame.to_world(dir), atan2(sin_theta, 1.0 - h), pdf)
    }

    /// Density of [`Self::sample`] per solid angle.
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        let angle = angle_from_axis(&self.frame, dir);
        let [b, c] = [self.beam_width, self.cutoff].map(one_minus_cos);
        let total = self.solid_angle();
        let share = (2.0 * PI * b / total).min(1.0);
        if angle <= self.beam_width || c <= b {
            f32::from(angle <= self.cutoff) / total
        } else {
            let root = ((c - one_minus_cos(angle)) / (c - b)).max(0.0);
            (1.0 - share) * root / (PI * (c - b))
        }
    }

    /// A starting point of light. `depth`: a third uniform number.
    pub fn start(&self, u: Vec2, depth: f32) -> Vec3 {
        if self.radius == 0.0 {
            return self.position;
        }
        let across = warp::concentric_disk(u);
        let half_chord = (1.0 - across.length_squared()).max(0.0).sqrt();
        let local = across.extend(half_chord * along_chord(depth));
        self.position + self.frame.to_world(local) * self.radius
    }

    /// Area of the disc seen from any side: the intensity over it is the radiance.
    pub(super) fn area(&self) -> f32 {
        PI * self.radius * self.radius
    }

    /// Light of the spot towards a point. The numbers are those of [`Self::start`].
    pub(super) fn towards(&self, from: Vec3, u: Vec2, depth: f32) -> Option<DirectSample> {
        let offset = self.position - from;
        let Some(view) = self.view(from) else {
            return self.sample_from_start(self.position, from);
        };
        let wi = match &view {
            SeenAs::Ball(cone) => cone.direction(u),
            SeenAs::Beam => -self.sample(u).0,
        };
        let (pdf, intensity) = (self.view_pdf(&view, wi), self.intensity(-wi));
        let (distance, misses) = match self.soft {
            false => {
                // The line's chord through the ball.
                let half2 = self.radius * self.radius - offset.cross(wi).length_squared();
                (offset.dot(wi) + half2.max(0.0).sqrt() * along_chord(depth), half2 < 0.0)
            }
            true => {
                let ball = SoftBall {
                    center: self.position,
                    radius: self.radius,
                };
                (offset.length_squared() / offset.dot(wi), !ball.is_seen(from, wi))
            }
        };
        let misses = misses && matches!(view, SeenAs::Beam);
        let is_lit = !misses && distance > 0.0 && pdf > 0.0 && intensity != Rgb::ZERO;
        is_lit.then(|| DirectSample {
            wi,
            normal: -wi,
            primitive: 0,
            distance,
            weight: intensity / (self.area() * pdf),
            pdf,
            unmet: true,
        })
    }

    /// Light towards a point from one point of [`Self::start`], as if all light came from it.
    pub(crate) fn sample_from_start(&self, start: Vec3, from: Vec3) -> Option<DirectSample> {
        let intensity = self.intensity(from - start);
        from_point(start - from, intensity).filter(|_| intensity != Rgb::ZERO)
    }

    /// Density of emitted photons per area across `wi` at a point, over the density with which [`Self::towards`]
    /// chooses that line. `distance`: of the light along it.
    pub(super) fn photon_density(&self, from: Vec3, wi: Vec3, distance: f32) -> f32 {
        let falloff = self.falloff(angle_from_axis(&self.frame, -wi));
        let area = match self.view(from) {
            None => distance * distance,
            Some(view) => self.area() * self.view_pdf(&view, wi),
        };
        falloff / (self.solid_angle() * area)
    }

    /// How directions to the ball are drawn; `None` if it counts as a point.
    fn view(&self, from: Vec3) -> Option<SeenAs> {
        if self.radius == 0.0 || self.radius <= POINT * from.distance(self.position) {
            return None;
        }
        let cone = match self.soft {
            false => Cone::around_ball(self.position, self.radius, from),
            true => Cone::around_soft(self.position, self.radius, from),
        };
        Some(match cone {
            Some(cone) if 1.0 <= cone.pdf() * self.solid_angle() => SeenAs::Ball(cone),
            Some(_) | None => SeenAs::Beam,
        })
    }

    fn view_pdf(&self, view: &SeenAs, wi: Vec3) -> f32 {
        match view {
            SeenAs::Ball(cone) => cone.pdf(),
            SeenAs::Beam => self.pdf(-wi),
        }
    }
}

/// A spot with a size, seen from a point.
enum SeenAs {
    /// It fills a cone narrower than its beam.
    Ball(Cone),
    /// Its beam is narrower, or the point is inside the ball.
    Beam,
}

/// Starting position on a chord of the ball, from -1 to 1.
fn along_chord(u: f32) -> f32 {
    sin(PI * (u - 0.5))
}

/// Fraction of the axial intensity at an angle from the axis, for a ramp linear in the angle.
#[inline]
pub(super) fn falloff(angle: f32, beam_width: f32, cutoff: f32) -> f32 {
    if angle <= beam_width {
        1.0
    } else if angle < cutoff {
        (cutoff - angle) / (cutoff - beam_width)
    } else {
        0.0
    }
}

/// Angle from the frame's `n`.
#[inline]
fn angle_from_axis(frame: &Frame, dir: Vec3) -> f32 {
    let local = frame.to_local(dir);
    atan2(local.truncate().length(), local.z)
}

/// Integral of the falloff over all directions, sr: 2 pi (1 - (sin c - sin b) / (c - b)).
fn linear_solid_angle(beam_width: f32, cutoff: f32) -> f32 {
    let (b, c) = (f64::from(beam_width), f64::from(cutoff));
    // (sin c - sin b) / (c - b) = cos(middle) sin(half) / half, and 1 - x y = (1 - x) + x (1 - y).
    let (middle, half) = (0.5 * (c + b), 0.5 * (c - b));
    let one_minus_cos = 2.0 * libm::pow(libm::sin(0.5 * middle), 2.0);
    let one_minus_sinc = if half < 1e-3 {
        half * half / 6.0
    } else {
        1.0 - libm::sin(half) / half
    };
    let integral = one_minus_cos + (1.0 - one_minus_cos) * one_minus_sinc;
    (2.0 * std::f64::consts::PI * integral) as f32
}

#[inline]
fn one_minus_cos(angle: f32) -> f32 {
    let half = sin(0.5 * angle);
    2.0 * half * half
}
