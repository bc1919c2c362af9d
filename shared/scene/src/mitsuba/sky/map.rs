//! Bakes a sky to a latitude-longitude image for an environment.

use super::hosek_wilkie::coefficients;
use super::{Sky, sun};
use exr::prelude::WritableImage;
use exr::prelude::{Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2};
use glam::DVec3;
use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;
use std::io::Cursor;

/// Pixels per row with a sun; the real sun is three pixels wide.
const WIDTH: usize = 2048;
/// Pixels per row without a sun, when there is no detail.
const WIDTH_OF_SKY: usize = 512;
/// Samples along a pixel's side, by which the sun's coverage of a pixel is measured.
const PLACES: usize = 16;
/// Mitsuba 3's divisor for the model's values: the integral of the CIE y curve.
const NORM: f64 = 106.750_259_399_414_06;

/// The sky's image as an OpenEXR file.
pub fn picture(sky: &Sky) -> Result<Vec<u8>, String> {
    let width = if sky.sun_scale > 0.0 { WIDTH } else { WIDTH_OF_SKY };
    let mut map = Map {
        width,
        pixels: vec![[0.0; 3]; width * width / 2],
    };
    map.add_sky(sky)?;
    map.add_sun(sky);
    map.write().map_err(|error| format!("its picture: {error}"))
}

struct Map {
    width: usize,
    pixels: Vec<[f64; 3]>,
}

impl Map {
    /// The direction of a point of the image, in pixels.
    fn direction(&self, x: f64, y: f64) -> DVec3 {
        let [phi, theta] = [x, y].map(|x| x * 2.0 * PI / self.width as f64);
        let (sine, cosine) = (libm::sin(theta), libm::cos(theta));
        DVec3::new(sine * libm::sin(phi), cosine, -sine * libm::cos(phi))
    }

    fn add_sky(&mut self, sky: &Sky) -> Result<(), String> {
        let dome = Dome::new(sky)?;
        for i in 0..self.pixels.len() {
            let direction = self.direction((i % self.width) as f64 + 0.5, (i / self.width) as f64 + 0.5);
            self.pixels[i] = dome.radiance(sky, direction).map(|c| sky.sky_scale * c);
        }
        Ok(())
    }

    /// Add the sun as a disc of uniform radiance, cut off by the horizon.
    fn add_sun(&mut self, sky: &Sky) {
        let height = libm::asin(sky.up.dot(sky.sun).clamp(0.0, 1.0)).to_degrees();
        let irradiance = sun::irradiance(sky.turbidity, height);
        let edge = libm::cos(sky.half_aperture);
        let pixel = 2.0 * PI / self.width as f64;
        let reach = libm::cos((sky.half_aperture + pixel).min(PI));
        let mut whole = 0.0;
        let mut covered = Vec::new();
        for i in 0..self.pixels.len() {
            let (x, y) = (i % self.width, i / self.width);
            if self.direction(x as f64 + 0.5, y as f64 + 0.5).dot(sky.sun) < reach {
                continue;
            }
            let place = |j: usize| (j as f64 + 0.5) / PLACES as f64;
            let places = (0..PLACES * PLACES).map(|j| [place(j % PLACES), place(j / PLACES)]);
            let inside = places.map(|[u, v]| self.direction(x as f64 + u, y as f64 + v));
            let inside = inside.filter(|direction| direction.dot(sky.sun) >= edge);
            let [mut all, mut seen] = [0.0; 2];
            for direction in inside {
                all += 1.0;
                seen += f64::from(u8::from(direction.dot(sky.up) >= 0.0));
            }
            let share = 1.0 / (PLACES * PLACES) as f64;
            let sine = libm::sin((y as f64 + 0.5) * pixel);
            whole += all * share * sine * pixel * pixel;
            covered.push((i, seen * share));
        }
        if whole > 0.0 {
            let radiance = irradiance.map(|e| sky.sun_scale * e / whole);
            for (i, share) in covered {
                for (c, radiance) in radiance.iter().enumerate() {
                    self.pixels[i][c] += share * radiance;
                }
            }
        }
    }

    fn write(&self) -> Result<Vec<u8>, exr::error::Error> {
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
            let [r, g, b] = self.pixels[at.y() * self.width + at.x()].map(rounded);
            (r, g, b)
        });
        let encoding = Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        };
        let size = (self.width, self.width / 2);
        let image = Image::from_layer(Layer::new(size, LayerAttributes::default(), encoding, channels));
        let mut bytes = Vec::new();
        image.write().non_parallel().to_buffered(Cursor::new(&mut bytes))?;
        Ok(bytes)
    }
}

/// The sky model for one sun position.
struct Dome {
    shapes: [[f64; 9]; 3],
    strengths: [f64; 3],
}

impl Dome {
    fn new(sky: &Sky) -> Result<Self, String> {
        let elevation = libm::asin(sky.up.dot(sky.sun).clamp(0.0, 1.0)) as f32;
        let albedo = sky.albedo.map(|c| c as f32);
        let (shapes, strengths) = coefficients(elevation.min(FRAC_PI_2), sky.turbidity as f32, albedo)?;
        Ok(Self {
            shapes: shapes.map(|channel| channel.map(f64::from)),
            strengths: strengths.map(f64::from),
        })
    }

    /// Equation 8 of the paper; black below the horizon.
    fn radiance(&self, sky: &Sky, direction: DVec3) -> [f64; 3] {
        let above = direction.dot(sky.up);
        if above < 0.0 {
            return [0.0; 3];
        }
        let cosine = direction.dot(sky.sun).clamp(-1.0, 1.0);
        let (gamma, squared) = (libm::acos(cosine), cosine * cosine);
        std::array::from_fn(|channel| {
            let [a, b, c, d, e, f, g, i, h] = self.shapes[channel];
            let around = 1.0 + h * h - 2.0 * h * cosine;
            let halo = (1.0 + squared) / (around * around.sqrt());
            let shape = (1.0 + a * libm::exp(b / (above + 0.01)))
                * (c + d * libm::exp(e * gamma) + f * squared + g * halo + i * above.sqrt());
            self.strengths[channel] * shape / NORM
        })
    }
}

/// Rounded to 12 binary digits, which compress better and do not depend on the model's last bits.
fn rounded(x: f64) -> f32 {
    let bits = (x.max(0.0) as f32).to_bits();
    f32::from_bits(bits.saturating_add(1 << 11) & !((1 << 12) - 1)).min(f32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(sun: DVec3, half_aperture: f64) -> Sky {
        Sky {
            turbidity: 3.0,
            albedo: [0.3; 3],
            up: DVec3::Z,
            sun,
            half_aperture: half_aperture.to_radians(),
            sky_scale: 1.0,
            sun_scale: 1.0,
        }
    }

    /// Values from Mitsuba 3.9.1 (`sunsky` with `sun_scale` 0, variant `scalar_rgb`).
    #[test]
    fn the_sky_is_mitsubas() {
        let sky = sky(DVec3::new(0.6, 0.0, 0.8), 0.2679);
        let dome = Dome::new(&sky).unwrap();
        for (direction, expected) in [
            ([0.0, 0.0, 1.0], [0.02908008, 0.04823563, 0.0955867]),
            ([0.6, 0.0, 0.8], [0.16737437, 0.19585194, 0.22569825]),
            ([0.99995, 0.0, 0.0099995], [0.19624613, 0.23940052, 0.2589462]),
            ([0.0, 0.8, 0.6], [0.03643848, 0.06651475, 0.12866047]),
            ([-0.8, 0.0, 0.6], [0.03023734, 0.05903038, 0.11911251]),
        ] {
            let found = dome.radiance(&sky, DVec3::from(direction));
            for c in 0..3 {
                assert!(
                    (found[c] / expected[c] - 1.0).abs() < 1e-3,
                    "{direction:?}: {found:?}, {expected:?}"
                );
            }
        }
        assert_eq!(dome.radiance(&sky, DVec3::new(0.6, 0.0, -0.8)), [0.0; 3]);
    }

    /// The sun's size does not matter; at the horizon half of it is visible.
    #[test]
    fn the_sun_sends_what_its_table_says() {
        for (elevation, aperture, share) in [(50.0, 0.2679, 1.0), (50.0, 4.0, 1.0), (0.0, 4.0, 0.5)] {
            let angle = f64::to_radians(elevation);
            let sun = DVec3::new(libm::cos(angle), 0.0, libm::sin(angle));
            let sky = sky(sun, aperture);
            let mut map = Map {
                width: WIDTH,
                pixels: vec![[0.0; 3]; WIDTH * WIDTH / 2],
            };
            map.add_sun(&sky);
            let pixel = 2.0 * PI / WIDTH as f64;
            let solid = |i: usize| pixel * pixel * libm::sin(((i / WIDTH) as f64 + 0.5) * pixel);
            let sent = (0..map.pixels.len()).map(|i| map.pixels[i][1] * solid(i)).sum::<f64>();
            let expected = share * sun::irradiance(3.0, elevation)[1];
            assert!(
                (sent / expected - 1.0).abs() < 0.01,
                "{elevation} {aperture}: {sent}, {expected}"
            );
        }
    }
}
