//! Light of which hardly any photon comes near the visible part: that of the sky over a large scene, of a dome, or of a
//! huge distant lamp. The few photons that do are bright, and small pictures or few passes cannot tell their light from
//! none.

use super::kernel::Extent;
use crate::math::mean;
use crate::sampler::{Purpose, Sampler};
use crate::world::Scene;
use crate::world::light::{EmissionUniforms, LightKind};

/// A light is not left to photons if less than this share of its photons comes near the visible part.
const LEAST_NEAR: f32 = 1e-3;
/// If its share of the light there is below this, it does not matter how it is found.
const LEAST_LIGHT: f32 = 0.02;
/// Photons that estimate a light's first share, and directions that estimate its light.
const PHOTONS: u64 = 4096;
const SAMPLES: u64 = 64;
/// With more lights than this, they are not looked at one by one.
const MANY: usize = 256;

/// Whether a light that matters is rare in this sense.
pub(super) fn has_rare_light(scene: &Scene, extent: &Extent) -> bool {
    if !extent.is_of_part {
        return false;
    }
    let share = extent.radius / scene.bounds().radius;
    if share * share < LEAST_NEAR && !scene.environments.is_empty() {
        return true;
    }
    if scene.lights().len() > MANY {
        return false;
    }
    let arriving: Vec<f32> = (0..scene.lights().len())
        .map(|light| arriving(scene, light, extent))
        .collect();
    let total: f32 = arriving.iter().sum();
    arriving.iter().enumerate().any(|(light, arriving)| {
        let is_surface = matches!(scene.lights()[light].kind, LightKind::Area { .. });
        is_surface && *arriving > LEAST_LIGHT * total && near(scene, light, extent) < LEAST_NEAR
    })
}

/// Irradiance from a light at the middle of the visible part, ignoring occlusion, W/m^2 from all sides.
fn arriving(scene: &Scene, light: usize, extent: &Extent) -> f32 {
    let (source, objects) = (&scene.lights()[light], scene.objects());
    let sum: f32 = (0..SAMPLES)
        .filter_map(|i| {
            let mut sampler = Sampler::new(0, light as u64, Purpose::Probes, i);
            let (u, more) = source.draw_direct(objects, &mut sampler);
            source.sample_direct(objects, extent.center, u, more)
        })
        .map(|direct| mean(direct.weight))
        .filter(|weight| weight.is_finite())
        .sum();
    sum / SAMPLES as f32
}

/// Share of a light's power that goes towards the visible part.
fn near(scene: &Scene, light: usize, extent: &Extent) -> f32 {
    let (mut all, mut near) = (0.0, 0.0);
    for i in 0..PHOTONS {
        let mut sampler = Sampler::new(1, light as u64, Purpose::Probes, i);
        let uniforms = EmissionUniforms::draw(&mut sampler);
        let photon = scene.lights()[light].sample_emission(scene.objects(), scene.bounds(), uniforms);
        let (power, offset) = (mean(photon.power), extent.center - photon.origin);
        let ahead = offset.dot(photon.dir);
        let off2 = offset.length_squared() - ahead * ahead;
        let is_near = off2 < extent.radius * extent.radius && ahead > -extent.radius;
        all += power;
        near += if is_near { power } else { 0.0 };
    }
    if all > 0.0 { near / all } else { 1.0 }
}
