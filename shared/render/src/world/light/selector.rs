//! Choice of a light.

use super::{Light, SceneBounds, cdf};
use crate::math::mean;
use crate::world::geometry::Object;

/// Chooses lights, in proportion to their power unless stated otherwise.
#[derive(Clone, Debug)]
pub struct LightSelector {
    sums: Vec<f32>,
}

/// A chosen light.
#[derive(Clone, Copy, Debug)]
pub struct LightChoice {
    /// Index into the scene's lights.
    pub light: usize,
    /// Probability of the choice.
    pub pmf: f32,
    /// The uniform number, rescaled to [0, 1) within the choice; it has log2(1 / pmf) fewer bits.
    pub u: f32,
}

impl LightSelector {
    /// A selector by power. Lights without power are never chosen.
    pub fn new(lights: &[Light], objects: &[Object], bounds: &SceneBounds) -> Self {
        Self::of_some(lights, objects, bounds, |_| true)
    }

    /// A selector among some of the lights.
    pub fn of_some(lights: &[Light], objects: &[Object], bounds: &SceneBounds, is_one: impl Fn(usize) -> bool) -> Self {
        let weights: Vec<f64> = (0..lights.len())
            .map(|i| match is_one(i) {
                true => f64::from(mean(lights[i].power(objects, bounds))).max(0.0),
                false => 0.0,
            })
            .collect();
        Self::of_weights(&weights)
    }

    /// A selector in proportion to weights, not negative.
    pub(crate) fn of_weights(weights: &[f64]) -> Self {
        let dark = weights.iter().all(|&w| w == 0.0);
        Self {
            sums: if dark { Vec::new() } else { cdf::running_sums(weights) },
        }
    }

    /// Running sums of the lights' shares; empty if no light is ever chosen.
    pub fn sums(&self) -> &[f32] {
        &self.sums
    }

    /// Chooses a light by `u` in [0, 1). `None`: there are no lights.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<LightChoice> {
        if self.sums.is_empty() {
            return None;
        }
        let choice = cdf::choose(&self.sums, u);
        Some(LightChoice {
            light: choice.index,
            pmf: choice.pmf,
            u: choice.u,
        })
    }

    /// The number of lights, or 0 if none is ever chosen.
    #[inline]
    pub fn count(&self) -> usize {
        self.sums.len()
    }

    /// Probability of a light.
    #[inline]
    pub fn pmf(&self, light: usize) -> f32 {
        if self.sums.is_empty() {
            0.0
        } else {
            cdf::pmf(&self.sums, light)
        }
    }
}
