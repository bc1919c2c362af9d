//! A point lamp that projects an image: a slide projector, or a spot with an image in its cone. Matches Mitsuba 3's
//! `projector` and the `texture` of its `spot`.
//!
//! Directions are drawn as points of the image plane at distance 1, uniformly where the image may be bright.

use super::spot;
use crate::math::{Rgb, Vec2, Vec3, atan2, mean};
use crate::world::texture::{Image, TextureFilter, Wrap};
use std::sync::Arc;

/// A lamp that projects an image.
#[derive(Clone, Debug)]
pub struct Projector {
    /// Position, render space.
    pub position: Vec3,
    /// Orthogonal unit vectors: to the image's right, up, and away from the lamp.
    pub axes: [Vec3; 3],
    /// Half the width and half the height of the image at distance 1.
    pub half: Vec2,
    /// The image.
    pub image: Arc<Image>,
    /// How it is interpolated.
    pub filter: TextureFilter,
    /// Two corners of a rectangle that contains all the image's light, from [`lit_part`]. The image spans (-1, -1),
    /// lower left, to (1, 1).
    pub lit: [Vec2; 2],
    /// W/sr on the axis where the image is 1.
    pub intensity: Rgb,
    /// Half angles, radians: a spot's cutoff and its plateau. Without them, the irradiance on a screen across the axis
    /// shows the image.
    pub cone: Option<[f32; 2]>,
}

/// The rectangle of an image outside which it is black, in the units of [`Projector::lit`]; the whole image if nothing
/// smaller is known.
pub fn lit_part(image: &Image, filter: TextureFilter) -> [Vec2; 2] {
    let width = image.width as usize;
    let is_lit = |at: &usize| image.pixels[*at] != Rgb::ZERO;
    // The neighbours that interpolation reaches, wrapped across the edge.
    let reach = match filter {
        TextureFilter::Bilinear => 1,
        TextureFilter::Nearest => 0,
    };
    let part = |first: Option<usize>, last: Option<usize>, count: usize| {
        let (low, high) = (first?.checked_sub(reach)?, last? + reach + 1);
        let share = |edge: usize| 2.0 * edge as f32 / count as f32 - 1.0;
        (high <= count).then(|| [share(low), share(high)])
    };
    let lit = || (0..image.pixels.len()).filter(is_lit);
    let columns = || lit().map(|at| at % width);
    let across = part(columns().min(), columns().max(), width).unwrap_or([-1.0, 1.0]);
    let rows = || lit().map(|at| at / width);
    // Rows go downwards.
    let [top, bottom] = part(rows().min(), rows().max(), image.height as usize).unwrap_or([-1.0, 1.0]);
    [Vec2::new(across[0], -bottom), Vec2::new(across[1], -top)]
}

impl Projector {
    /// W/sr in a direction of any length.
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
        let [low, high] = self.lit;
        let at = (low + (high - low) * u) * self.half;
        let dir = (right * at.x + up * at.y + forward).normalize();
        (dir, self.pdf(dir))
    }

    /// Density of [`Self::sample`].
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        let [right, up, forward] = self.axes;
        let z = dir.dot(forward);
        let [low, high] = self.lit.map(|corner| corner * self.half * z);
        // Rounding may move a drawn direction over the edge.
        let slack = self.half * z * 1e-5;
        let at = Vec2::new(dir.dot(right), dir.dot(up));
        match z > 0.0 && at.cmpge(low - slack).all() && at.cmple(high + slack).all() {
            true => {
                let [low, high] = self.lit;
                let share = 0.25 * (high - low).element_product();
                1.0 / (share * self.area() * z * z * z)
            }
            false => 0.0,
        }
    }

    /// Inward normals of the pyramid that contains all the light.
    pub fn planes(&self) -> [Vec3; 4] {
        let [right, up, forward] = self.axes;
        let [low, high] = self.lit;
        // Slightly wider: the extra directions are dark.
        let slack = self.half * 1e-5;
        let (low, high) = (low * self.half - slack, high * self.half + slack);
        [
            right - forward * low.x,
            forward * high.x - right,
            up - forward * low.y,
            forward * high.y - up,
        ]
    }

    /// Area of the image at distance 1.
    fn area(&self) -> f32 {
        4.0 * self.half.x * self.half.y
    }

    /// W: the integral of the intensity, at pixel centres, or on a finer lattice for small images.
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

    /// Mean intensity over the pyramid of light, mean channel, W/sr.
    pub(super) fn typical_intensity(&self) -> f32 {
        let [low, high] = self.lit.map(|corner| corner * self.half);
        // Solid angle of the rectangle between the axis and a point of the plane at distance 1.
        let solid_angle = |x: f32, y: f32| atan2(x * y, (1.0 + x * x + y * y).sqrt());
        let of_all = solid_angle(high.x, high.y) - solid_angle(low.x, high.y) - solid_angle(high.x, low.y)
            + solid_angle(low.x, low.y);
        mean(self.power()) / of_all.max(f32::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::world::light::{EmissionUniforms, Light, LightKind, SceneBounds};
    use beamfarm_image::layer::LightGroup;

    /// 4 x 2 pixels, red by column and green by row from the top left, as seen by a camera at the lamp.
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
            lit: [Vec2::NEG_ONE, Vec2::ONE],
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

    /// An image of 8 x 6 pixels, all black but two.
    fn mostly_black(lit: [usize; 2], filter: TextureFilter) -> Projector {
        let mut pixels = vec![Rgb::ZERO; 48];
        lit.into_iter().for_each(|at| pixels[at] = Rgb::new(1.0, 2.0, 3.0));
        let image = Image {
            alpha: Vec::new(),
            width: 8,
            height: 6,
            pixels,
        };
        Projector {
            lit: lit_part(&image, filter),
            image: Arc::new(image),
            filter,
            ..projector(None)
        }
    }

    /// No light lies outside the part in which directions are drawn, and that part fits the pixels.
    #[test]
    fn black_parts_of_pictures_send_no_photons() {
        // Columns 2 and 3 of rows 1 and 2 from the top.
        let near = [8 + 2, 2 * 8 + 3];
        let nearest = mostly_black(near, TextureFilter::Nearest);
        let close = |a: [Vec2; 2], b: [Vec2; 2]| a.iter().zip(b).all(|(a, b)| (*a - b).abs().max_element() < 1e-6);
        assert!(close(nearest.lit, [Vec2::new(-0.5, 0.0), Vec2::new(0.0, 2.0 / 3.0)]));
        let all = [Vec2::NEG_ONE, Vec2::ONE];
        for (lit, filter) in [
            (near, TextureFilter::Bilinear),
            // Interpolation wraps it to the other side.
            ([0, 47], TextureFilter::Bilinear),
            ([0, 47], TextureFilter::Nearest),
            (near, TextureFilter::Nearest),
        ] {
            let projector = mostly_black(lit, filter);
            assert_eq!(close(projector.lit, all), lit[0] == 0);
            let [right, up, forward] = projector.axes;
            for i in 0..90_000 {
                let at = Vec2::new((i % 300) as f32 + 0.5, (i / 300) as f32 + 0.5) / 150.0 - 1.0;
                let dir = right * (at.x * projector.half.x) + up * (at.y * projector.half.y) + forward;
                let is_drawn = projector.pdf(dir.normalize()) > 0.0;
                assert!(is_drawn || projector.intensity(dir) == Rgb::ZERO, "{at} {filter:?}");
                assert_eq!(
                    is_drawn,
                    projector.planes().iter().all(|plane| dir.dot(*plane) >= 0.0),
                    "{at}"
                );
            }
        }
        let black = Image {
            pixels: vec![Rgb::ZERO; 48],
            ..(*nearest.image).clone()
        };
        assert_eq!(lit_part(&black, TextureFilter::Nearest), all);
    }

    /// The mean power of photons, the lamp's power, and the integral of the intensity over a lattice of angles agree.
    /// For an even screen the power is the mean pixel times the area.
    #[test]
    fn photons_carry_what_the_lamp_emits() {
        let bounds = SceneBounds {
            center: Vec3::ZERO,
            radius: 10.0,
        };
        let slit = mostly_black([8 + 2, 2 * 8 + 3], TextureFilter::Bilinear);
        for projector in [projector(None), projector(Some([0.6, 0.4])), slit] {
            let light = Light {
                name: "lamp".into(),
                kind: LightKind::Projector(projector.clone()),
                group: LightGroup::named("lamp"),
            };
            let power = light.power(&[], &bounds);
            if projector.image.width == 4 && projector.cone.is_none() {
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
                // The density integrates to one over the sphere, checked with another distribution of directions.
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
