//! Which light is sampled.

use crate::setup::{BOUNDS, SAMPLES, SIGNIFICANCE, emitter, light, point, rectangle, sun};
use beamfarm_shared::light::{LightKind, LightSelector};
use beamfarm_shared::math::{PI, Rgb, Vec3};
use beamfarm_shared::sampler::{Purpose, Sampler};
use beamfarm_tests::Suite;

#[test]
fn lights_are_chosen_by_power() {
    let (objects, panel) = emitter(rectangle(Vec3::ZERO, Vec3::X, Vec3::Y));
    let dark = light(LightKind::Point {
        position: Vec3::ZERO,
        intensity: Rgb::ZERO,
    });
    let lights = [
        dark.clone(),
        point(Vec3::ZERO),
        dark.clone(),
        panel,
        sun(Vec3::X),
        dark.clone(),
    ];
    let selector = LightSelector::new(&lights, &objects, &BOUNDS);
    let area = 49.0 * PI;
    let total = 4.0 * PI + PI + area;
    for (i, share) in [0.0, 4.0 * PI, 0.0, PI, area, 0.0].iter().enumerate() {
        assert!((selector.pmf(i) - share / total).abs() < 1e-6);
    }
    let mut rng = Sampler::new(8, 0, Purpose::Test, 0);
    // By light and by tenth of the rescaled number.
    let mut observed = vec![0u64; lights.len() * 10];
    for _ in 0..SAMPLES {
        let choice = selector.sample(rng.next_1d()).unwrap();
        assert_eq!(choice.pmf, selector.pmf(choice.light));
        assert!(choice.pmf > 0.0 && (0.0..1.0).contains(&choice.u));
        observed[choice.light * 10 + (choice.u * 10.0) as usize] += 1;
    }
    let expected: Vec<f64> = (0..observed.len())
        .map(|i| f64::from(selector.pmf(i / 10)) * 0.1 * SAMPLES as f64)
        .collect();
    let (_, _, p) = beamfarm_tests::chi2::chi2(&observed, &expected);
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.p_value("selection", p);
    suite.finish();
    let none = LightSelector::new(&[dark], &[], &BOUNDS);
    assert!(none.sample(0.5).is_none() && none.pmf(0) == 0.0);
}
