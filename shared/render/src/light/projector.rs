//! A lamp at a point that throws a picture: a slide projector, or a spot with a picture in its cone. As Mitsuba 3's
//! `projector` and the `texture` of its `spot`.
//!
//! Directions are drawn by points of the picture's plane at distance 1, uniformly.

use super::spot;
use crate::math::{PI, Rgb, Vec2, Vec3, atan2, mean};
use crate::texture::{Image, TextureFilter, Wrap};
use std::sync::Arc;

/// A lamp that throws a picture.
#[derive(Clone, Debug)]
pub struct Projector {
    /// Where, render space.
    pub position: Vec3,
    /// Unit vectors to the picture's right, up, and away from the lamp, at right angles.
    pub axes: [Vec3; 3],
    /// Half the width and half the height of the picture at distance 1.
    pub half: Vec2,
    /// The picture.
    pub image: Arc<Image>,
    /// How it is interpolated.
    pub filter: TextureFilter,
    /// W/sr on the axis where the picture is 1.
    pub intensity: Rgb,
    /// Half angles, radians: the cutoff and the plateau below it of a spot. Without, a screen across the axis is lit
    /// as the picture is.
    pub cone: Option<[f32; 2]>,
}

impl Projector {
    /// W/sr in a direction, which need not be of unit length.
    pub fn intensity(&self, dir: Vec3) -> Rgb {
        let [right, up, forward] = self.axes;
        let z = dir.dot(forward);
        if z <= 0.0 {
            return Rgb::ZERO;
        }
        let at = Vec2::new(dir.dot(right), dir.dot(up)) / (z * self.half);
        if at.abs().max_element() > 1.0 {
            return Rgb::ZERO;
        }
        let picture = self.image.eval(0.5 + 0.5 * at, self.filter, Wrap::Repeat);
        let cos = z / dir.length();
        let factor = match self.cone {
            Some([cutoff, beam_width]) => {
                let across = Vec2::new(dir.dot(right), dir.dot(up)).length();
                spot::falloff(atan2(across, z), beam_width, cutoff)
            }
            None => 1.0 / (cos * cos * cos),
        };
        self.intensity * picture * factor
    }

    /// A unit direction, and its density per solid angle.
    pub(super) fn sample(&self, u: Vec2) -> (Vec3, f32) {
        let [right, up, forward] = self.axes;
        let at = (2.0 * u - 1.0) * self.half;
        let dir = (right * at.x + up * at.y + forward).normalize();
        (dir, self.pdf(dir))
    }

    /// Density of [`Self::sample`].
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        let [right, up, forward] = self.axes;
        let z = dir.dot(forward);
        // What rounding takes over the edge was drawn within it.
        let within = |across: f32, half: f32| across.abs() <= half * z * (1.0 + 1e-5);
        match z > 0.0 && within(dir.dot(right), self.half.x) && within(dir.dot(up), self.half.y) {
            true => 1.0 / (self.area() * z * z * z),
            false => 0.0,
        }
    }

    /// Of the picture at distance 1.
    fn area(&self) -> f32 {
        4.0 * self.half.x * self.half.y
    }

    /// W: the integral of the intensity, by the middles of pixels, or of a lattice where there are few.
    pub(super) fn power(&self) -> Rgb {
        let [columns, rows] = [self.image.width, self.image.height].map(|n| n.max(64));
        let [right, up, forward] = self.axes;
        let mut sum = [0.0f64; 3];
        for y in 0..rows {
            for x in 0..columns {
                let at = Vec2::new((x as f32 + 0.5) / columns as f32, (y as f32 + 0.5) / rows as f32);
                let at = (2.0 * at - 1.0) * self.half;
                let dir = right * at.x + up * at.y + forward;
                let cos = 1.0 / dir.length();
                let there = self.intensity(dir) * (cos * cos * cos);
                for (sum, value) in sum.iter_mut().zip(there.to_array()) {
                    *sum += f64::from(value);
                }
            }
        }
        let each = f64::from(self.area()) / (f64::from(columns) * f64::from(rows));
        Rgb::from_array(sum.map(|sum| (sum * each) as f32))
    }

    /// The cosine of an angle that nothing shines beyond.
    pub(super) fn least_cosine(&self) -> f32 {
        1.0 / (1.0 + self.half.length_squared()).sqrt() * (1.0 - 1e-5)
    }

    /// The mean over the cone around the picture, mean channel, W/sr.
    pub(super) fn typical_intensity(&self) -> f32 {
        let cos = self.least_cosine();
        let solid_angle = 2.0 * PI * (1.0 - cos);
        mean(self.power()) / solid_angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{EmissionUniforms, Light, LightKind, SceneBounds};
    use crate::sampler::{Purpose, Sampler};
    use beamfarm_image::layer::LightGroup;

    /// 4 x 2 pixels, red by column and green by row from the top left, as a camera at the lamp would see them.
    fn projector(cone: Option<[f32; 2]>) -> Projector {
        let pixels = (0..8).map(|i| Rgb::new((i % 4) as f32, (i / 4) as f32, 1.0));
        Projector {
            position: Vec3::new(1.0, 2.0, 3.0),
            axes: [Vec3::NEG_X, Vec3::Y, Vec3::Z],
            half: match cone {
                Some([cutoff, _]) => Vec2::splat(crate::math::tan(cutoff)),
                None => Vec2::new(0.8, 0.4),
            },
            image: Arc::new(Image {
                alpha: Vec::new(),
                width: 4,
                height: 2,
                pixels: pixels.collect(),
            }),
            filter: TextureFilter::Nearest,
            intensity: Rgb::splat(2.0),
            cone,
        }
    }

    #[test]
    fn pictures_stand_upright_and_light_screens_evenly() {
        let projector = projector(None);
        let at = |x: f32, y: f32| projector.intensity(Vec3::new(x, y, 1.0));
        let cubed = |x: f32, y: f32| crate::math::powf(1.0 + x * x + y * y, 1.5);
        for (x, y, red, green) in [(0.7, 0.3, 0.0, 0.0), (-0.7, 0.3, 3.0, 0.0), (-0.1, -0.2, 2.0, 1.0)] {
            let expected = Rgb::new(red, green, 1.0) * (2.0 * cubed(x, y));
            assert!((at(x, y) - expected).abs().max_element() < 1e-4, "{x} {y}");
        }
        for (x, y) in [(0.81, 0.0), (0.0, 0.41), (-0.81, 0.3)] {
            assert_eq!(at(x, y), Rgb::ZERO);
        }
        assert_eq!(projector.intensity(Vec3::NEG_Z), Rgb::ZERO);
    }

    /// The mean power of photons, that of the lamp, and the integral of the intensity over a lattice of angles are one;
    /// the power is that of the picture: for an even screen the mean pixel times the area.
    #[test]
    fn photons_carry_what_the_lamp_emits() {
        let bounds = SceneBounds {
            center: Vec3::ZERO,
            radius: 10.0,
        };
        for cone in [None, Some([0.6, 0.4])] {
            let projector = projector(cone);
            let light = Light {
                name: "lamp".into(),
                kind: LightKind::Projector(projector.clone()),
                group: LightGroup::named("lamp"),
            };
            let power = light.power(&[], &bounds);
            if cone.is_none() {
                let expected = Rgb::new(1.5, 0.5, 1.0) * (2.0 * 4.0 * 0.8 * 0.4);
                assert!((power - expected).abs().max_element() < 1e-4);
            }
            const N: usize = 40_000;
            let (mut sum, mut squares, mut ones) = (Rgb::ZERO, Rgb::ZERO, 0.0);
            for i in 0..N {
                let mut sampler = Sampler::new(1, 0, Purpose::Test, i as u64);
                let sample = light.sample_emission(&[], &bounds, EmissionUniforms::draw(&mut sampler));
                sum += sample.power;
                squares += sample.power * sample.power;
                // The density integrates to one over the sphere, found by directions of another distribution.
                let dir = crate::warp::uniform_sphere(sampler.next_2d());
                ones += projector.pdf(dir) * 4.0 * crate::math::PI;
            }
            let n = N as f32;
            let error = ((squares / n - (sum / n) * (sum / n)) / n)
                .to_array()
                .map(|v| v.max(0.0).sqrt());
            for ((mean, power), error) in (sum / n).to_array().into_iter().zip(power.to_array()).zip(error) {
                assert!(
                    (mean - power).abs() < 4.0 * error + 2e-3 * power,
                    "{mean} {power} {error}"
                );
            }
            // About a tenth of all directions: a standard error of 3 / sqrt(N).
            assert!((ones / n - 1.0).abs() < 4.0 * 4.0 / n.sqrt(), "{}", ones / n);
        }
    }
}
