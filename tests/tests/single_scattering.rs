//! A point light in thin fog against numerical integration along the ray (method: single scattering in closed form).

use beamfarm_tests::render::{average, scene};
use glam::{DVec2, DVec3};

/// Fog so thin that light scattered twice is below 1e-3 of light scattered once.
const SIGMA_S: [f64; 3] = [4e-4, 3e-4, 2e-4];
const SIGMA_A: [f64; 3] = [0.2, 0.5, 0.0];
const INTENSITY: [f64; 3] = [3.0, 2.0, 1.0];
const LIGHT: DVec3 = DVec3::new(0.3, 0.4, -1.0);
const G: f64 = 0.4;
const SIZE: usize = 24;

#[test]
fn point_light_in_fog_is_the_integral_along_the_ray() {
    let toml = format!(
        r#"
[image]
width = {SIZE}
height = {SIZE}
[render]
passes = 200
paths = 4000
seed = 11
[world]
medium = "fog"
[camera]
origin = [0.0, 0.0, 2.0]
target = [0.0, 0.0, 0.0]
fov = 60.0
[media.fog]
type = "homogeneous"
sigma_a = {SIGMA_A:?}
sigma_s = {SIGMA_S:?}
phase = {{ type = "hg", g = {G} }}
# Walls that reflect nothing end beams and camera rays.
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "cube"
flip_normals = true
material = "black"
transform = [ {{ scale = 3.0 }} ]
[[lights]]
type = "point"
position = {:?}
intensity = {INTENSITY:?}
"#,
        LIGHT.to_array()
    );
    let image = average(&scene(&toml));
    // Blocks of 4 x 4 pixels: the light itself is a singularity that kernels blur, so the blocks around it are left out.
    let mut worst = 0.0f64;
    for by in 0..SIZE / 4 {
        for bx in 0..SIZE / 4 {
            let (mut got, mut expected, mut variance) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
            let mut nearest = f64::INFINITY;
            for i in 0..16 {
                let (x, y) = (bx * 4 + i % 4, by * 4 + i / 4);
                let pixel = image.beauty.pixels[y * SIZE + x];
                got += glam::Vec3::from(pixel).as_dvec3() / 16.0;
                let se = glam::Vec3::from(image.standard_error.pixels[y * SIZE + x]).as_dvec3();
                variance += se * se / 16.0;
                let (integral, distance) = pixel_integral(x, y);
                expected += integral / 16.0;
                nearest = nearest.min(distance);
            }
            if nearest < 0.15 {
                continue;
            }
            for c in 0..3 {
                // Neighbouring pixels see the same beams, so the block's error may be as large as a pixel's. Five standard
                // errors, 1e-3 for light scattered twice, and 5e-3 for the blur of kernels.
                let bound = 5.0 * variance[c].sqrt() + 6e-3 * expected[c];
                let off = (got[c] - expected[c]).abs();
                worst = worst.max(off / bound);
                assert!(
                    off < bound,
                    "block ({bx}, {by}) channel {c}: {} not {}, bound {bound}",
                    got[c],
                    expected[c]
                );
            }
        }
    }
    assert!(worst > 0.01, "suspiciously exact");
}

/// Radiance through a pixel, over 4 x 4 rays, and the nearest that one of them comes to the light.
fn pixel_integral(x: usize, y: usize) -> (DVec3, f64) {
    let origin = DVec3::new(0.0, 0.0, 2.0);
    let tan = libm::tan(30f64.to_radians());
    let mut sum = DVec3::ZERO;
    let mut nearest = f64::INFINITY;
    for i in 0..16 {
        let sub = DVec2::new((i % 4) as f64 + 0.5, (i / 4) as f64 + 0.5) / 4.0;
        let p = (DVec2::new(x as f64, y as f64) + sub) / SIZE as f64 * 2.0 - 1.0;
        let dir = DVec3::new(p.x * tan, -p.y * tan, -1.0).normalize();
        // To the wall of the box [-3, 3]^3.
        let mut length = f64::INFINITY;
        for axis in 0..3 {
            let wall = 3.0f64.copysign(dir[axis]);
            length = length.min((wall - origin[axis]) / dir[axis]);
        }
        let t0 = (LIGHT - origin).dot(dir);
        let h = (origin + dir * t0 - LIGHT).length();
        nearest = nearest.min(h);
        // t = t0 + h tan(a) makes the integrand smooth (equiangular).
        let (a0, a1) = (libm::atan2(-t0, h), libm::atan2(length - t0, h));
        let n = 400;
        for k in 0..n {
            let a = a0 + (a1 - a0) * (k as f64 + 0.5) / n as f64;
            let t = t0 + h * libm::tan(a);
            let from_light = origin + dir * t - LIGHT;
            let d2 = from_light.length_squared();
            let d = d2.sqrt();
            let cos = -(from_light / d).dot(dir);
            let q = 1.0 + G * G - 2.0 * G * cos;
            let phase = (1.0 - G * G) / (4.0 * std::f64::consts::PI * q * q.sqrt());
            // dt = (h^2 + (t - t0)^2) / h da = d^2 / h da.
            let jacobian = d2 / h * (a1 - a0) / n as f64;
            for c in 0..3 {
                let sigma_t = SIGMA_A[c] + SIGMA_S[c];
                let tr = libm::exp(-sigma_t * (t + d));
                sum[c] += SIGMA_S[c] * phase * tr * INTENSITY[c] / d2 * jacobian;
            }
        }
    }
    (sum / 16.0, nearest)
}
