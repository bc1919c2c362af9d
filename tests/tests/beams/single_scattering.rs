//! A point light in thin fog against numerical integration along the ray (method: single scattering in closed form).

use beamfarm_harness::point_in_fog::PointInFog;
use beamfarm_harness::render::{average, scene};
use glam::{DVec2, DVec3};

/// Fog so thin that light scattered twice is below 1e-3 of light scattered once.
const FOG: PointInFog = PointInFog {
    sigma_s: [4e-4, 3e-4, 2e-4],
    sigma_a: [0.2, 0.5, 0.0],
};
const SIZE: usize = PointInFog::SIZE;

#[test]
fn point_light_in_fog_is_the_integral_along_the_ray() {
    let render = "render = { passes = 200, paths = 4000, seed = 11 }\n";
    let toml = format!("{render}{}", FOG.scene());
    let image = average(&scene(&toml));
    // Blocks of 4 x 4 pixels. The light itself is a singularity that kernels blur, so the blocks around it are left
    // out.
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
                let (integral, distance) = FOG.pixel_integral(DVec2::new(x as f64, y as f64));
                expected += integral / 16.0;
                nearest = nearest.min(distance);
            }
            if nearest < 0.15 {
                continue;
            }
            for c in 0..3 {
                // Neighbouring pixels see the same beams, so a block's error may be as large as a pixel's. Five
                // standard errors, 1e-3 for light scattered twice, and 5e-3 for the blur of kernels.
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
