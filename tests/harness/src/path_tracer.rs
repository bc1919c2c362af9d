//! A plain path tracer for a room filled with a medium on a grid, to compare the renderer's images with.
//!
//! It is slow and simple: double precision, one colour channel at a time, and no code in common with the renderer.
//! Distances by delta tracking under the grid's largest density, direct light from the lamp at every vertex, the
//! optical depth towards the lamp in closed form.

use beamfarm_image::film::Film;
use glam::{DAffine3, DVec2, DVec3};
use rand_core::Rng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A density, trilinear between samples, 0 outside of its box.
#[derive(Clone, Debug)]
pub struct Grid {
    resolution: [usize; 3],
    /// At the cells' centres, x fastest.
    samples: Vec<f32>,
    max: f64,
    /// From world space to the space where a cell is a unit cube and the first one begins at the origin.
    to_cells: DAffine3,
}

impl Grid {
    /// `samples`: at the cells' centres, x fastest; `to_world`: from the unit cube that the grid fills.
    ///
    /// # Panics
    /// If the number of samples does not match the resolution.
    pub fn new(resolution: [usize; 3], samples: Vec<f32>, to_world: DAffine3) -> Self {
        assert_eq!(samples.len(), resolution.iter().product::<usize>());
        let cells = DVec3::from_array(resolution.map(|n| n as f64));
        Self {
            resolution,
            max: samples.iter().fold(0.0, |max, s| s.max(max)).into(),
            samples,
            to_cells: DAffine3::from_scale(cells) * to_world.inverse(),
        }
    }

    /// The grid as the bytes of a Mitsuba `.vol` file.
    pub fn vol(&self) -> Vec<u8> {
        Self::vol_of(&[self])
    }

    /// Grids of one resolution as the channels of a Mitsuba `.vol` file.
    pub fn vol_of(channels: &[&Self]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        let [x, y, z] = channels[0].resolution.map(|n| n as i32);
        for int in [1, x, y, z, channels.len() as i32] {
            bytes.extend(int.to_le_bytes());
        }
        let samples = (0..channels[0].samples.len()).flat_map(|i| channels.iter().map(move |c| c.samples[i]));
        for float in [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0].into_iter().chain(samples) {
            bytes.extend(float.to_le_bytes());
        }
        bytes
    }

    /// Density at a point in world space.
    pub fn density(&self, point: DVec3) -> f64 {
        self.in_cells(self.to_cells.transform_point3(point))
    }

    fn in_cells(&self, point: DVec3) -> f64 {
        let mut corner = [0; 3];
        let mut fraction = [0.0; 3];
        for axis in 0..3 {
            let n = self.resolution[axis];
            let x = point[axis];
            if x < 0.0 || x > n as f64 {
                return 0.0;
            }
            // In samples; within half a cell of the border, the outermost sample continues.
            let x = (x - 0.5).clamp(0.0, (n - 1) as f64);
            corner[axis] = x.floor() as usize;
            fraction[axis] = x - x.floor();
        }
        let mut sum = 0.0;
        for i in 0..8 {
            let mut weight = 1.0;
            let mut at = [0; 3];
            for axis in 0..3 {
                let next = i >> axis & 1;
                weight *= [1.0 - fraction[axis], fraction[axis]][next];
                at[axis] = (corner[axis] + next).min(self.resolution[axis] - 1);
            }
            let index = at[0] + self.resolution[0] * (at[1] + self.resolution[1] * at[2]);
            sum += weight * f64::from(self.samples[index]);
        }
        sum
    }

    /// The density integrated between two points. This is exact: the density is a cubic between two planes of samples,
    /// for which Gauss's rule with two points is exact.
    pub fn depth(&self, from: DVec3, to: DVec3) -> f64 {
        let (a, b) = (self.to_cells.transform_point3(from), self.to_cells.transform_point3(to));
        let mut cuts = vec![0.0, 1.0];
        for axis in 0..3 {
            let n = self.resolution[axis];
            let centers = (0..n).map(|i| i as f64 + 0.5);
            for plane in centers.chain([0.0, n as f64]) {
                let cut = (plane - a[axis]) / (b[axis] - a[axis]);
                if cut > 0.0 && cut < 1.0 {
                    cuts.push(cut);
                }
            }
        }
        cuts.sort_by(f64::total_cmp);
        let mut sum = 0.0;
        for pair in cuts.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            for sign in [-1.0, 1.0] {
                let at = middle + sign * half / 3f64.sqrt();
                sum += half * self.in_cells(a + (b - a) * at);
            }
        }
        sum * (to - from).length()
    }
}

/// A ball that emits and reflects nothing.
#[derive(Clone, Copy, Debug)]
pub struct Lamp {
    /// Its centre.
    pub center: DVec3,
    /// Its radius.
    pub radius: f64,
    /// Radiance, RGB.
    pub radiance: [f64; 3],
}

/// Pinhole camera. Its field of view is across the image's width; up is +y.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Where it is.
    pub origin: DVec3,
    /// What it looks at.
    pub target: DVec3,
    /// Field of view, degrees.
    pub fov: f64,
    /// Pixels along each side of the image.
    pub size: usize,
}

impl Camera {
    /// Direction through a point of the image, in pixels, from the top left.
    pub fn direction(&self, image: DVec2) -> DVec3 {
        let forward = (self.target - self.origin).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let half = 0.5 * self.size as f64;
        let tan = libm::tan(0.5 * self.fov.to_radians());
        let (x, y) = ((image.x - half) / half, (half - image.y) / half);
        (forward + tan * (x * right + y * up)).normalize()
    }
}

/// The cube [-1, 1]^3 with diffuse walls, a medium and a lamp within.
#[derive(Clone, Debug)]
pub struct Room {
    /// Reflectance, RGB, of the walls at x = -1, x = 1, y = -1, y = 1, z = -1, z = 1.
    pub walls: [[f64; 3]; 6],
    /// Absorption at density 1, RGB.
    pub sigma_a: [f64; 3],
    /// Scattering at density 1, RGB.
    pub sigma_s: [f64; 3],
    /// The phase function: weights of Henyey and Greenstein lobes and their mean cosines; 0 is isotropic.
    pub phase: Vec<(f64, f64)>,
    /// The density.
    pub grid: Grid,
    /// By channel, the part of `sigma_s` that scatters; the rest absorbs.
    pub albedo: Option<[Grid; 3]>,
    /// The light.
    pub lamp: Lamp,
    /// The camera.
    pub camera: Camera,
}

impl Room {
    /// Independent images with one path per pixel each.
    pub fn images(&self, count: u64, seed: u64) -> Vec<Film> {
        let image = |number| {
            let size = self.camera.size;
            let mut film = Film::new(size as u32, size as u32);
            let mut random = Random(Pcg64::new(seed.into(), number));
            for (i, pixel) in film.pixels.iter_mut().enumerate() {
                let corner = DVec2::new((i % size) as f64, (i / size) as f64);
                for (c, value) in pixel.iter_mut().enumerate() {
                    let image = corner + DVec2::new(random.next(), random.next());
                    let dir = self.camera.direction(image);
                    *value = self.radiance(self.camera.origin, dir, c, &mut random) as f32;
                }
            }
            film
        };
        (0..u128::from(count)).into_par_iter().map(image).collect()
    }

    /// One estimate of the radiance that a point sees in a direction, in one channel.
    fn radiance(&self, mut origin: DVec3, mut dir: DVec3, c: usize, random: &mut Random) -> f64 {
        let (mut sum, mut beta) = (0.0, 1.0);
        let mut seen_by_camera = true;
        loop {
            let (distance, hit) = self.nearest(origin, dir);
            match self.collision(origin, dir, distance, c, random) {
                Some(t) => {
                    origin += dir * t;
                    beta *= self.sigma_s[c] / (self.sigma_s[c] + self.sigma_a[c]);
                    if let Some(albedo) = &self.albedo {
                        beta *= albedo[c].density(origin);
                    }
                    let phase = |w: DVec3| self.phase_value(dir.dot(w));
                    sum += beta * self.direct(origin, phase, c, random);
                    dir = self.scattered(dir, random);
                }
                None => {
                    origin += dir * distance;
                    let Some(wall) = hit else {
                        // The lamp: at every later vertex `direct` counts it.
                        if seen_by_camera {
                            sum += beta * self.lamp.radiance[c];
                        }
                        return sum;
                    };
                    let mut normal = DVec3::ZERO;
                    normal[wall / 2] = [1.0, -1.0][wall % 2];
                    beta *= self.walls[wall][c];
                    let bsdf = |w: DVec3| normal.dot(w).max(0.0) / PI;
                    sum += beta * self.direct(origin, bsdf, c, random);
                    // Cosine-weighted: a point of the sphere that touches the wall (Lambert).
                    dir = (normal + random.on_sphere()).normalize();
                }
            }
            seen_by_camera = false;
            let survival = beta.min(1.0);
            if random.next() >= survival {
                return sum;
            }
            beta /= survival;
        }
    }

    /// Distance to the nearest surface, and which wall it is, or the lamp.
    fn nearest(&self, origin: DVec3, dir: DVec3) -> (f64, Option<usize>) {
        let mut nearest = (f64::INFINITY, None);
        for axis in 0..3 {
            if dir[axis] != 0.0 {
                let t = (1f64.copysign(dir[axis]) - origin[axis]) / dir[axis];
                if t < nearest.0 {
                    nearest = (t.max(0.0), Some(2 * axis + usize::from(dir[axis] > 0.0)));
                }
            }
        }
        let to_lamp = self.lamp.center - origin;
        let along = to_lamp.dot(dir);
        let within = self.lamp.radius * self.lamp.radius - (to_lamp - dir * along).length_squared();
        if within > 0.0 {
            let t = along - within.sqrt();
            if t > 0.0 && t < nearest.0 {
                nearest = (t, None);
            }
        }
        nearest
    }

    /// Distance to the next real collision, if nearer than `end` (delta tracking, Woodcock et al. 1965).
    fn collision(&self, origin: DVec3, dir: DVec3, end: f64, c: usize, random: &mut Random) -> Option<f64> {
        let majorant = (self.sigma_s[c] + self.sigma_a[c]) * self.grid.max;
        if majorant == 0.0 {
            return None;
        }
        let mut t = 0.0;
        loop {
            t -= libm::log(1.0 - random.next()) / majorant;
            if t >= end {
                return None;
            }
            if random.next() * self.grid.max < self.grid.density(origin + dir * t) {
                return Some(t);
            }
        }
    }

    /// The lamp's light that a vertex scatters on, for one direction uniform in the solid angle of the lamp's cone.
    fn direct(&self, vertex: DVec3, scattering: impl Fn(DVec3) -> f64, c: usize, random: &mut Random) -> f64 {
        let to_lamp = self.lamp.center - vertex;
        let (distance, axis) = (to_lamp.length(), to_lamp.normalize());
        let sin_max = (self.lamp.radius / distance).min(1.0);
        // 1 - cos, without cancellation.
        let height = sin_max * sin_max / (1.0 + (1.0 - sin_max * sin_max).sqrt());
        let dir = around(axis, 1.0 - height * random.next(), random);
        let (t, hit) = self.nearest(vertex, dir);
        // Past the lamp's rim by rounding.
        if hit.is_some() {
            return 0.0;
        }
        let transmittance = self.transmittance(vertex, vertex + dir * t, c);
        self.lamp.radiance[c] * scattering(dir) * TAU * height * transmittance
    }

    /// Between two points, in one channel.
    pub fn transmittance(&self, from: DVec3, to: DVec3, c: usize) -> f64 {
        libm::exp(-(self.sigma_s[c] + self.sigma_a[c]) * self.grid.depth(from, to))
    }

    /// Per steradian, for the cosine between the directions of travel before and after.
    fn phase_value(&self, cos: f64) -> f64 {
        let value = |(share, g): &(f64, f64)| {
            let squared = 1.0 + g * g - 2.0 * g * cos;
            share * (1.0 - g * g) / (4.0 * PI * squared * squared.sqrt())
        };
        self.phase.iter().map(value).sum()
    }

    /// A direction of travel after scattering, in proportion to the phase function.
    fn scattered(&self, dir: DVec3, random: &mut Random) -> DVec3 {
        let mut rest = random.next();
        let chosen = self.phase.iter().find(|(share, _)| {
            rest -= share;
            rest < 0.0
        });
        let g = chosen.map_or(0.0, |(_, g)| *g);
        if g == 0.0 {
            return random.on_sphere();
        }
        let ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * random.next());
        let cos = ((1.0 + g * g - ratio * ratio) / (2.0 * g)).clamp(-1.0, 1.0);
        around(dir, cos, random)
    }
}

/// A direction at a given cosine to an axis, at the azimuth of a random direction, so uniform around the axis.
fn around(axis: DVec3, cos: f64, random: &mut Random) -> DVec3 {
    let lean = random.on_sphere();
    let across = (lean - axis * lean.dot(axis)).normalize();
    (axis * cos + across * (1.0 - cos * cos).sqrt()).normalize()
}

struct Random(Pcg64);

impl Random {
    /// Uniform in [0, 1).
    fn next(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform on the unit sphere (Archimedes).
    fn on_sphere(&mut self) -> DVec3 {
        let z = 2.0 * self.next() - 1.0;
        let (sin, cos) = libm::sincos(TAU * self.next());
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeanEstimate, Suite};

    fn grid() -> Grid {
        let to_world = DAffine3::from_rotation_z(0.4) * DAffine3::from_scale(DVec3::splat(2.0));
        let samples = vec![0.0, 3.0, 1.0, 0.5, 2.0, 0.0, 0.0, 4.0, 1.0, 1.5, 0.0, 2.5];
        Grid::new([3, 2, 2], samples, to_world)
    }

    #[test]
    fn density_at_samples_between_them_and_beyond_the_border() {
        let grid = grid();
        let at = |x, y, z| grid.in_cells(DVec3::new(x, y, z));
        assert_eq!(at(1.5, 0.5, 0.5), 3.0);
        assert_eq!(at(1.5, 1.5, 1.5), 0.0);
        assert_eq!(at(1.0, 0.5, 0.5), 1.5);
        assert_eq!(at(0.5, 1.0, 1.5), 0.5 * (0.0 + 1.5));
        assert_eq!(at(2.9, 0.1, 0.0), 1.0);
        assert_eq!(at(3.1, 0.1, 0.0), 0.0);
    }

    #[test]
    fn depth_is_the_sum_of_many_densities() {
        let grid = grid();
        let (from, to) = (DVec3::new(-1.0, 0.3, 0.1), DVec3::new(1.5, 1.9, 1.8));
        let n = 100_000;
        let at = |i: u32| grid.density(from + (to - from) * ((f64::from(i) + 0.5) / f64::from(n)));
        let sum = (0..n).map(at).sum::<f64>() * (to - from).length() / f64::from(n);
        assert!((grid.depth(from, to) - sum).abs() < 1e-4 * sum);
        assert!(sum > 0.5);
    }

    /// Significance 1e-3.
    #[test]
    fn scattering_follows_the_phase_function() {
        let lamp = Lamp {
            center: DVec3::ZERO,
            radius: 0.1,
            radiance: [1.0; 3],
        };
        let camera = Camera {
            origin: DVec3::Z,
            target: DVec3::ZERO,
            fov: 60.0,
            size: 1,
        };
        let mut suite = Suite::new(1e-3);
        for phase in [
            vec![(1.0, -0.3)],
            vec![(1.0, 0.0)],
            vec![(1.0, 0.6)],
            vec![(0.2, 0.5), (0.8, -0.6)],
        ] {
            let g = phase.iter().map(|(share, g)| share * g).sum();
            let room = Room {
                walls: [[0.5; 3]; 6],
                sigma_a: [1.0; 3],
                sigma_s: [1.0; 3],
                phase,
                grid: grid(),
                albedo: None,
                lamp,
                camera,
            };
            let dir = DVec3::new(0.6, 0.0, -0.8);
            let mut random = Random(Pcg64::new(1, 2));
            let cosines: Vec<f64> = (0..20_000).map(|_| dir.dot(room.scattered(dir, &mut random))).collect();
            // Its mean cosine, and the share below -1/2 by quadrature of `phase_value`.
            let mean: MeanEstimate = cosines.iter().copied().collect();
            suite.mean(format!("mean cosine {g}"), &mean, g);
            let back: MeanEstimate = cosines.iter().map(|cos| f64::from(u8::from(*cos < -0.5))).collect();
            let cos = |i: i32| -1.0 + (f64::from(i) + 0.5) * 5e-4;
            let share: f64 = (0..1000).map(|i| TAU * room.phase_value(cos(i)) * 5e-4).sum();
            suite.mean(format!("backwards {g}"), &back, share);
        }
        suite.finish();
    }
}
