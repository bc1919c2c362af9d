//! Which lights photons start from, and how many from each: one choice, by scene, estimators and rules.

use crate::plan::estimators::Estimators;
use crate::world::light::{LightSelector, SceneBounds};
use crate::world::{Scene, lights_that_leave};

/// Share of the photons that is spread evenly over the lights. A light's power does not tell what it brings through
/// glass or fog, and nothing reveals that a light without photons is missing.
const EVENLY: f64 = 0.2;

/// A choice among the lights whose photons bring something and may leave it. Shares go by the power that each sends
/// into the visible part of the scene, however far the scene extends around that, and partly evenly. `extent`: radius
/// of the visible part, scene units.
pub(super) fn emitters(scene: &Scene, estimators: &Estimators, extent: f32) -> LightSelector {
    let bounds = scene.bounds();
    let seen = SceneBounds {
        radius: bounds.radius.min(extent),
        ..*bounds
    };
    let leaves = lights_that_leave(scene.description());
    let lights = scene.lights().iter().enumerate();
    let powers = lights.map(|(i, light)| match leaves[i] && estimators.brings_photons(i) {
        true => f64::from(crate::math::mean(light.power(scene.objects(), &seen))).max(0.0),
        false => 0.0,
    });
    LightSelector::of_weights(&some_evenly(&powers.collect::<Vec<f64>>()))
}

/// Shares in proportion to the powers, apart from the part spread evenly over lights whose power is not zero.
fn some_evenly(powers: &[f64]) -> Vec<f64> {
    let total: f64 = powers.iter().sum();
    let count = powers.iter().filter(|power| **power > 0.0).count();
    let share = |power: &f64| match *power > 0.0 {
        true => (1.0 - EVENLY) * (power / total) + EVENLY / count as f64,
        false => 0.0,
    };
    powers.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_light_is_left_out_that_has_power() {
        assert_eq!(some_evenly(&[0.0, 0.0]), [0.0, 0.0]);
        assert_eq!(some_evenly(&[0.0, 3.0]), [0.0, 1.0]);
        let shares = some_evenly(&[1e12, 0.0, 1.0]);
        assert!(
            (shares[0] - 0.9).abs() < 1e-9 && (shares[2] - 0.1).abs() < 1e-9,
            "{shares:?}"
        );
    }
}
