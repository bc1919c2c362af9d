//! How many photons each light gets.
//!
//! A photon of light i stands for power_i / q_i, with q_i its share of the photons. If each photon of a light brought
//! equally much of what the camera finds of that light, the second moment of the picture would be the sum of power_i
//! found_i moment_i / q_i, where moment_i is that of the weights of aimed photons (see [`super`]). It is least for q_i
//! in proportion to the root of that product. Half of the photons still go by power, because camera paths miss things:
//! no light's share is less than half of its share by power, and no second moment more than doubles.

use super::{Viewpoint, discs};
use crate::world::Scene;
use crate::world::light::LightSelector;
use beamfarm_image::job::Targeting;

/// Share of photons that go to lights by their power.
const BY_POWER: f64 = 0.5;
/// A choice is made only if one photon is then worth this many photons of lights chosen by power.
const MIN_GAIN: f64 = 2.0;
/// Fewest places over all lights, from even and from odd camera paths each, for a choice. With so few, it pays only
/// where most of the light found comes from lights of little power.
pub(super) const MIN_PLACES: usize = 16;
/// Most lights that [`choose`] names.
const MAX_TOLD: usize = 4;

/// What camera paths found of a light's emission.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Its share of the photons by power.
    power: f64,
    /// Light that came by the places of even and of odd paths, and the number of these places.
    weight: [f64; 2],
    count: [usize; 2],
    /// Second moment of its photons' weights; 1 for plain photons.
    moment: f64,
}

impl Found {
    pub(super) fn new(power: f64, places: &[Viewpoint], moment: f64) -> Self {
        let mut found = Self {
            power,
            moment,
            ..Self::default()
        };
        let most = discs::heaviest(places);
        for place in places {
            let half = usize::from(place.odd);
            found.weight[half] += f64::from(place.weight.min(most));
            found.count[half] += 1;
        }
        found
    }
}

/// Chooses lights by what is found of them, if that pays. Also what to report, if there is a choice.
pub(super) fn choose(scene: &Scene, found: &[Found], mode: Targeting) -> (Option<LightSelector>, Option<String>) {
    let shining = found.iter().filter(|light| light.power > 0.0).count();
    let count = |half: usize| found.iter().map(|light| light.count[half]).sum::<usize>();
    let is_known = count(0).min(count(1)) >= MIN_PLACES;
    if shining < 2 || !is_known || mode == Targeting::Reject {
        return (None, None);
    }
    // Chosen by even paths, judged by odd ones.
    let gain = gain(found, &shares(found, |light| light.weight[0]), |light| light.weight[1]);
    if gain < MIN_GAIN {
        let told = format!("lights get photons by power: by what is seen of them a photon would be worth {gain:.1}");
        return (None, Some(told));
    }
    let shares = shares(found, |light| light.weight[0] + light.weight[1]);
    let selector = LightSelector::of_weights(&shares);
    let mut order: Vec<usize> = (0..found.len()).filter(|&i| found[i].power > 0.0).collect();
    let more = |i: usize| shares[i] / found[i].power;
    order.sort_by(|&a, &b| more(b).total_cmp(&more(a)).then(a.cmp(&b)));
    let told = order.iter().take(MAX_TOLD).map(|&i| {
        format!(
            "\"{}\" gets {:.1} % of the photons, {:.1} % by power",
            scene.lights()[i].name,
            100.0 * shares[i],
            100.0 * found[i].power,
        )
    });
    let told: Vec<String> = told.collect();
    let told = format!(
        "lights get photons by what is seen of them, which makes a photon worth {gain:.1}: {}",
        told.join(", ")
    );
    (Some(selector), Some(told))
}

/// Shares of the photons, by light.
fn shares(found: &[Found], weight: impl Fn(&Found) -> f64) -> Vec<f64> {
    let wanted = |light: &Found| (light.power * weight(light) * light.moment).sqrt();
    let total: f64 = found.iter().map(wanted).sum();
    let of_one = |light: &Found| BY_POWER * light.power + (1.0 - BY_POWER) * (wanted(light) / total);
    found.iter().map(of_one).collect()
}

/// Second moment with photons by power, over that with photons by these shares.
fn gain(found: &[Found], shares: &[f64], weight: impl Fn(&Found) -> f64) -> f64 {
    let (mut before, mut after) = (0.0, 0.0);
    for (light, share) in found.iter().zip(shares).filter(|(light, _)| light.power > 0.0) {
        let moment = weight(light) * light.moment;
        before += moment;
        after += moment * (light.power / share);
    }
    before / after
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(lights: &[(f64, f64)]) -> Vec<Found> {
        let of_one = |&(power, weight): &(f64, f64)| Found {
            power,
            weight: [weight; 2],
            count: [100; 2],
            moment: 1.0,
        };
        lights.iter().map(of_one).collect()
    }

    /// Shares sum to one, none is less than half of that by power, and one visible light of forty gets half of the
    /// photons.
    #[test]
    fn lights_get_photons_by_what_is_seen_and_never_none() {
        let mut lights = vec![(0.025, 0.0); 40];
        lights[7].1 = 3.0;
        let lights = found(&lights);
        let of_each = shares(&lights, |light| light.weight[0]);
        assert!((of_each.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (i, share) in of_each.iter().enumerate() {
            let expected = if i == 7 { 0.5125 } else { 0.0125 };
            assert!((share - expected).abs() < 1e-12, "{i}: {share}");
        }
        let gain = gain(&lights, &of_each, |light| light.weight[1]);
        assert!((gain - 0.5125 / 0.025).abs() < 1e-9, "{gain}");
    }

    /// If all lights are seen in proportion to their power, there is nothing to gain. The shares have the least second
    /// moment among those that leave half to power.
    #[test]
    fn shares_have_the_least_second_moment() {
        let even = found(&[(0.2, 0.4), (0.3, 0.6), (0.5, 1.0)]);
        let of_each = shares(&even, |light| light.weight[0]);
        assert!((gain(&even, &of_each, |light| light.weight[0]) - 1.0).abs() < 1e-12);

        let lights = found(&[(0.2, 5.0), (0.3, 0.1), (0.5, 0.7)]);
        let moment = |shares: &[f64]| -> f64 {
            let terms = lights.iter().zip(shares);
            terms.map(|(l, share)| l.power * l.weight[0] / share).sum()
        };
        let wanted: Vec<f64> = (shares(&lights, |light| light.weight[0]).iter().zip(&lights))
            .map(|(share, light)| 2.0 * share - light.power)
            .collect();
        let least = moment(&wanted);
        for (from, to) in [(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)] {
            let mut moved = wanted.clone();
            moved[from] -= 1e-3;
            moved[to] += 1e-3;
            assert!(moment(&moved) > least, "{from} to {to}");
        }
    }
}
