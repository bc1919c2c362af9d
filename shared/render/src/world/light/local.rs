//! Chooses a light by what each would contribute to a point without occlusion: distance, the light's cone or plane, and
//! the surface's horizon (after Conty Estevez & Kulla 2018, importance sampling of many lights, without their tree).

use super::source::{LightSources, MAX_WEIGHED, Region, Source};
use super::{LightChoice, LightSelector};
use crate::math::{Vec3, mean};
use crate::sampler::Sampler;

/// Share of choices made by power alone: the strongest light may be behind a wall.
const BLIND: f32 = 0.2;

/// Least cosine at a flat light: points in front of its plane see more of it than its centre.
const MIN_COSINE: f32 = 0.05;

/// Most light samples expected at a point, over all lights. Two equally bright lights are both sampled; a light that
/// outshines the others is sampled nearly alone.
const SAMPLES: f32 = 2.0;

/// Probability of each light at a point.
#[derive(Clone, Debug)]
pub struct LocalChoice<'a> {
    by_power: &'a LightSelector,
    /// None where power alone decides.
    local: Option<[f32; MAX_WEIGHED]>,
}

impl LightSources {
    /// Probabilities at a point. `normal`: of a surface that is lit from that side only. `by_power`: lights that it
    /// never chooses are excluded.
    pub fn choice_at<'a>(&self, point: Vec3, normal: Option<Vec3>, by_power: &'a LightSelector) -> LocalChoice<'a> {
        let count = self.sources.len();
        if count == 1 || count > MAX_WEIGHED {
            return LocalChoice { by_power, local: None };
        }
        let mut irradiances = [0.0; MAX_WEIGHED];
        let (mut total, mut power) = (0.0, 0.0);
        for (light, source) in self.sources.iter().enumerate() {
            let pmf = by_power.pmf(light);
            let irradiance = source.irradiance_at(point, normal);
            if pmf > 0.0 && irradiance > 0.0 {
                irradiances[light] = irradiance;
                total += irradiance;
                power += pmf;
            }
        }
        if !(total > 0.0 && total < f32::INFINITY && power > 0.0) {
            let local = (total == 0.0).then_some([0.0; MAX_WEIGHED]);
            return LocalChoice { by_power, local };
        }
        for (light, p) in irradiances.iter_mut().enumerate().take(count) {
            if *p > 0.0 {
                *p = (1.0 - BLIND) * *p / total + BLIND * by_power.pmf(light) / power;
            }
        }
        LocalChoice {
            by_power,
            local: Some(irradiances),
        }
    }
}

impl LocalChoice<'_> {
    /// Chooses a light by `u` in [0, 1). `None`: no light reaches this point.
    pub fn sample(&self, u: f32) -> Option<LightChoice> {
        let Some(local) = &self.local else {
            return self.by_power.sample(u);
        };
        let mut left = u;
        let mut chosen = None;
        for (light, &pmf) in local.iter().enumerate().take(self.by_power.count()) {
            if pmf > 0.0 {
                let u = (left / pmf).min(1.0 - f32::EPSILON / 2.0);
                chosen = Some(LightChoice { light, pmf, u });
                left -= pmf;
                if left < 0.0 {
                    break;
                }
            }
        }
        chosen
    }

    /// Chooses lights independently, or one where power alone decides. Their `pmf` is [`Self::samples_of`].
    #[inline]
    pub fn each(&self, sampler: &mut Sampler, mut with: impl FnMut(LightChoice, &mut Sampler)) {
        let Some(local) = &self.local else {
            let u = sampler.next_1d_if(self.by_power.count() > 1);
            if let Some(choice) = self.by_power.sample(u) {
                with(choice, sampler);
            }
            return;
        };
        for (light, &p) in local.iter().enumerate().take(self.by_power.count()) {
            sampler.align(4);
            let pmf = (SAMPLES * p).min(1.0);
            if pmf == 1.0 || pmf > 0.0 && sampler.next_1d() < pmf {
                with(LightChoice { light, pmf, u: 0.0 }, sampler);
            }
        }
        sampler.align(4);
    }

    /// Expected number of times that [`Self::each`] chooses a light, at most 1.
    #[inline]
    pub fn samples_of(&self, light: usize) -> f32 {
        match &self.local {
            Some(local) => (SAMPLES * local[light]).min(1.0),
            None => self.by_power.pmf(light),
        }
    }

    /// Probability of a light.
    #[inline]
    pub fn pmf(&self, light: usize) -> f32 {
        match &self.local {
            Some(local) => local[light],
            None => self.by_power.pmf(light),
        }
    }
}

impl Source {
    /// Approximate irradiance from the light at a point, W/m^2, on a surface that faces it or has a normal. Zero only
    /// where the light contributes nothing.
    fn irradiance_at(&self, at: Vec3, normal: Option<Vec3>) -> f32 {
        match self {
            Self::Far {
                irradiance,
                direction,
                spread,
            } => {
                let cos = match (direction, normal) {
                    // Upper bound: for the end that is highest above the horizon.
                    (Some(direction), Some(normal)) => (spread - direction.dot(normal)).max(0.0),
                    (Some(_), None) => 1.0,
                    // Mean over a uniform sky.
                    (None, _) => 0.25,
                };
                irradiance * cos
            }
            Self::Beam(laser) => {
                let cos = normal.map_or(1.0, |normal| -laser.frame.n.dot(normal));
                mean(laser.irradiance_at(at)) * cos.max(0.0)
            }
            Self::Near {
                center,
                softening,
                intensity,
                region,
            } => {
                let offset = *center - at;
                let distance2 = offset.length_squared().max(*softening);
                let distance = distance2.sqrt();
                let at_light = match region {
                    Region::Everywhere => 1.0,
                    Region::Cone { apex, axis, cos } => {
                        let from = at - *apex;
                        let along = from.dot(*axis);
                        let cos2 = cos * cos;
                        if along > 0.0 && along * along >= cos2 * from.length_squared() {
                            1.0
                        } else {
                            0.0
                        }
                    }
                    Region::Pyramid { apex, planes } => {
                        let from = at - *apex;
                        if planes.iter().all(|plane| from.dot(*plane) >= 0.0) {
                            1.0
                        } else {
                            0.0
                        }
                    }
                    Region::Before { point, normal } => {
                        if (at - *point).dot(*normal) > 0.0 {
                            // Relative to the mean over the hemisphere.
                            2.0 * (-offset.dot(*normal) / distance).max(MIN_COSINE)
                        } else {
                            0.0
                        }
                    }
                };
                let cos = match normal {
                    // For the end that is highest above the horizon.
                    Some(normal) => ((offset.dot(normal) + softening.sqrt()) / distance).clamp(0.0, 1.0),
                    None => 1.0,
                };
                intensity / distance2 * at_light * cos
            }
        }
    }
}
