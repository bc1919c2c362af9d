//! Which light is sampled.

use crate::surfaces::lights::setup::{
    BOUNDS, SAMPLES, SIGNIFICANCE, ball, disc, emitter, light, point, rectangle, sky, spot, sun,
};
use beamfarm_harness::z_test::MeanEstimate;
use beamfarm_harness::{Suite, render};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{PI, Rgb, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::light::{Light, LightKind, LightSelector, LightSources};
use glam::Affine3A;

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
    // By light and by tenth of the rescaled random number.
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
    let (_, _, p) = beamfarm_harness::chi2::chi2(&observed, &expected);
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.p_value("selection", p);
    suite.finish();
    let none = LightSelector::new(&[dark], &[], &BOUNDS);
    assert!(none.sample(0.5).is_none() && none.pmf(0) == 0.0);
}

/// Lights of all kinds, near and far, some of which shine on one side only.
fn all_kinds() -> (Vec<Object>, Vec<Light>) {
    let shapes = [
        rectangle(Vec3::new(-1.0, 2.0, -1.0), Vec3::X, Vec3::Z),
        ball(Vec3::new(2.0, 0.0, 0.0), 0.5),
        disc(Affine3A::from_translation(Vec3::new(0.0, 0.0, -2.0))),
    ];
    let mut objects = Vec::new();
    let mut lights = Vec::new();
    for (i, shape) in shapes.into_iter().enumerate() {
        let (object, mut light) = emitter(shape);
        if let LightKind::Area { object, .. } = &mut light.kind {
            *object = i as u32;
        }
        objects.extend(object);
        lights.push(light);
    }
    lights.extend([
        point(Vec3::new(0.5, 0.5, 0.5)),
        spot(Vec3::new(-2.0, 0.0, 0.0), Vec3::X, 10.0, 30.0),
        spot(Vec3::new(0.0, -2.0, 0.0), Vec3::Y, 80.0, 110.0),
        sun(Vec3::new(0.3, -1.0, 0.2)),
        sky(None),
    ]);
    (objects, lights)
}

/// At every point the probabilities sum to one, and no light that contributes there has probability zero.
#[test]
fn every_light_that_shines_on_a_point_may_be_chosen_there() {
    let (objects, lights) = all_kinds();
    let by_power = LightSelector::new(&lights, &objects, &BOUNDS);
    let sources = LightSources::new(&lights, &objects, &BOUNDS);
    let mut rng = Sampler::new(12, 0, Purpose::Test, 0);
    let mut never = vec![0; lights.len()];
    for i in 0..20_000 {
        let at = Vec3::from([rng.next_1d(), rng.next_1d(), rng.next_1d()].map(|u| 6.0 * u - 3.0));
        let normal = (i % 4 != 0).then(|| warp::uniform_sphere(rng.next_2d()));
        let choice = sources.choice_at(at, normal, &by_power);
        let sum: f32 = (0..lights.len()).map(|i| choice.pmf(i)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{at}: {sum}");
        for (i, light) in lights.iter().enumerate() {
            let u = (rng.next_2d(), rng.next_1d());
            let Some(direct) = light.sample_direct(&objects, at, u.0, u.1) else {
                continue;
            };
            let cos = normal.map_or(1.0, |normal| normal.dot(direct.wi));
            let is_lit = cos > 1e-5 && direct.weight.max_element() > 0.0;
            // A fifth of the choices goes by power.
            let least = 0.2 * by_power.pmf(i) * (1.0 - 1e-5);
            assert!(!is_lit || choice.pmf(i) >= least, "light {i} at {at}");
            never[i] += usize::from(choice.pmf(i) == 0.0);
        }
    }
    // A point behind a light, below its horizon or outside its cone is recognised.
    assert!(never[0] > 0 && never[4] > 0 && never[6] > 0, "{never:?}");
}

/// Four fifths of the choices go by irradiance, one by power; the draws follow the probabilities.
#[test]
fn lights_near_a_point_are_chosen_more_often_there() {
    let positions = [[0.0, 0.0, 1.0], [0.0, 3.0, 4.0], [0.0, 0.0, -2.0]].map(Vec3::from);
    let lights = positions.map(point);
    let by_power = LightSelector::new(&lights, &[], &BOUNDS);
    let sources = LightSources::new(&lights, &[], &BOUNDS);
    let mut suite = Suite::new(SIGNIFICANCE);
    for (normal, irradiances) in [
        (None, [1.0, 1.0 / 25.0, 1.0 / 4.0]),
        (Some(Vec3::Z), [1.0, 0.8 / 25.0, 0.0]),
    ] {
        let choice = sources.choice_at(Vec3::ZERO, normal, &by_power);
        let total: f64 = irradiances.iter().sum();
        let lit = irradiances.iter().filter(|e| **e > 0.0).count() as f64;
        let expected = irradiances.map(|e| match e > 0.0 {
            true => 0.8 * e / total + 0.2 / lit,
            false => 0.0,
        });
        let mut observed = [0; 3];
        let mut rng = Sampler::new(13, 0, Purpose::Test, 0);
        for _ in 0..SAMPLES {
            let chosen = choice.sample(rng.next_1d()).unwrap();
            assert_eq!(chosen.pmf, choice.pmf(chosen.light));
            observed[chosen.light] += 1;
        }
        for (i, p) in expected.iter().enumerate() {
            assert!((f64::from(choice.pmf(i)) - p).abs() < 1e-6, "light {i}");
        }
        let counts = expected.map(|p| p * SAMPLES as f64);
        let (_, _, p) = beamfarm_harness::chi2::chi2(&observed, &counts);
        suite.p_value("choice", p);
    }
    suite.finish();
}

/// A floor lit by a lamp high above, while a wall blocks a nearer lamp. The estimate is right, and finds the lamp as
/// often as the probability says, twice as often as a single choice: what is wasted on the other lamp is bounded.
#[test]
fn a_near_light_behind_a_wall_does_not_hide_a_far_one() {
    let scene = render::scene(
        r#"
[image]
width = 8
height = 8
[render]
passes = 200
paths = 1
seed = 5
[camera]
origin = [3.0, 0.0, 2.0]
target = [0.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
fov = 0.01
[materials.floor]
type = "diffuse"
reflectance = 0.5
two_sided = true
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "rectangle"
material = "floor"
[[shapes]]
type = "rectangle"
material = "black"
transform = [ { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [0.0, 0.5, 0.0] } ]
[[lights]]
type = "point"
position = [0.0, 0.0, 4.0]
intensity = 16.0
[[lights]]
type = "point"
position = [0.0, 1.0, 0.5]
intensity = 16.0
"#,
    );
    let settings = scene.description().defaults.job_settings();
    let plan = RenderPlan::new(&scene, settings);
    let mut radiance = MeanEstimate::new();
    let mut is_lit = MeanEstimate::new();
    for pass_index in 0..200 {
        for pixel in render_pass(&scene, &plan, pass_index).expect("a pass").film.pixels {
            radiance.add(f64::from(pixel[0]));
            is_lit.add(f64::from(u8::from(pixel[0] > 0.0)));
        }
    }
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.mean("radiance", &radiance, 0.5 / std::f64::consts::PI);
    let hidden = 16.0 / 1.25 * 0.5 / 1.25f64.sqrt();
    suite.mean("share of the lamp", &is_lit, 2.0 * (0.8 / (1.0 + hidden) + 0.1));
    suite.finish();
}
