//! What lights emit: their power, and photons distributed in position and direction as their densities say.

use crate::surfaces::lights::setup::{
    BOUNDS, RADIANCE, SAMPLES, SIGNIFICANCE, ball, emitter, of_ball, point, rectangle, shapes, sky, speckled, spot,
    sun, wide_sun,
};
use beamfarm_harness::quadrature::Rect;
use beamfarm_harness::{Chi2, MeanEstimate, Suite};
use beamfarm_render::math::{Frame, PI, Ray, Rgb, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::geometry::{Geometry, Object};
use beamfarm_render::world::light::{EmissionSample, EmissionUniforms, Light, LightKind, Ramp};

fn emission(rng: &mut Sampler) -> EmissionUniforms {
    EmissionUniforms {
        position: rng.next_2d(),
        direction: rng.next_2d(),
        primitive: rng.next_1d(),
    }
}

fn emissions(light: &Light, objects: &[Object], seed: u64) -> impl Iterator<Item = EmissionSample> {
    let mut rng = Sampler::new(seed, 0, Purpose::Test, 0);
    (0..SAMPLES).map(move |_| light.sample_emission(objects, &BOUNDS, emission(&mut rng)))
}

#[test]
fn mean_emission_is_the_power() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let mut lights: Vec<(String, Vec<Object>, Light)> = shapes()
        .into_iter()
        .map(|(name, shape)| {
            let (objects, light) = emitter(shape);
            (name.to_string(), objects, light)
        })
        .collect();
    let up = Vec3::new(0.2, 1.0, -0.3);
    for (name, light) in [
        ("point", point(Vec3::ONE)),
        ("spot", spot(Vec3::ONE, up, 15.0, 20.0)),
        ("spot without a plateau", spot(Vec3::ONE, up, 0.0, 60.0)),
        ("spot without a ramp", spot(Vec3::ONE, up, 30.0, 30.0)),
        ("wide spot", spot(Vec3::ONE, up, 100.0, 170.0)),
        ("narrow spot", spot(Vec3::ONE, up, 0.01, 0.05)),
        (
            "smooth spot",
            of_ball(spot(Vec3::ONE, up, 10.0, 50.0), 0.0, Ramp::Smooth),
        ),
        ("ball", of_ball(spot(Vec3::ONE, up, 15.0, 20.0), 0.3, Ramp::Linear)),
        ("sun", sun(up)),
        ("narrow sun", wide_sun(up, 0.5)),
        ("wide sun", wide_sun(up, 150.0)),
        ("even sky", sky(None)),
        ("image", sky(Some(speckled(9, 6, 50.0)))),
        ("column", sky(Some(speckled(1, 4, 2.0)))),
        ("row", sky(Some(speckled(5, 1, 2.0)))),
        ("pixel", sky(Some(speckled(1, 1, 2.0)))),
    ] {
        lights.push((name.to_string(), Vec::new(), light));
    }
    for (name, objects, light) in &lights {
        let power = light.power(objects, &BOUNDS);
        for channel in 0..3 {
            let mean: MeanEstimate = emissions(light, objects, 1)
                .map(|sample| f64::from(sample.power[channel]))
                .collect();
            suite.mean(format!("{name} {channel}"), &mean, f64::from(power[channel]));
        }
    }
    suite.finish();
}

/// Radiant exitance, solid angles and projected areas as plain numbers.
#[test]
fn powers_of_simple_lights() {
    let close = |a: Rgb, b: Rgb| assert!((a / b - 1.0).abs().max_element() < 1e-5, "{a} != {b}");
    let (objects, ball) = emitter(ball(Vec3::ZERO, 0.5));
    close(ball.power(&objects, &BOUNDS), RADIANCE * (PI * PI));
    let (objects, square) = emitter(rectangle(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 3.0));
    close(square.power(&objects, &BOUNDS), RADIANCE * (6.0 * PI));
    close(point(Vec3::ZERO).power(&[], &BOUNDS), RADIANCE * (4.0 * PI));
    close(sun(Vec3::X).power(&[], &BOUNDS), RADIANCE * (49.0 * PI));
    close(sky(None).power(&[], &BOUNDS), RADIANCE * (4.0 * PI * 49.0 * PI));
    let hemisphere = spot(Vec3::ZERO, Vec3::X, 90.0, 90.0);
    close(hemisphere.power(&[], &BOUNDS), RADIANCE * (2.0 * PI));
    // 2 pi (1 - (sin c - sin b) / (c - b)) with b = 0, c = pi / 2.
    let ramp = spot(Vec3::ZERO, Vec3::X, 0.0, 90.0);
    close(ramp.power(&[], &BOUNDS), RADIANCE * (2.0 * PI * (1.0 - 2.0 / PI)));
    // The mean of 1 - angle / cutoff over a small disc is a third.
    let narrow = spot(Vec3::ZERO, Vec3::X, 0.0, 0.01);
    let cutoff = 0.01f32.to_radians();
    close(narrow.power(&[], &BOUNDS), RADIANCE * (PI * cutoff * cutoff / 3.0));
}

/// 1/pdf sums to solid angles, and the power to the falloff's integral, ring by ring around the axis.
#[test]
fn spot_emission_follows_its_falloff() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let axis = Vec3::new(-0.4, 0.3, 0.6).normalize();
    let cones = [(15.0, 20.0), (0.0, 40.0), (80.0, 170.0), (0.5, 0.6), (25.0, 25.0)];
    let cones = cones.map(|(b, c)| (b, c, Ramp::Linear));
    let smooth = [(15.0, 20.0), (0.0, 40.0), (80.0, 170.0)].map(|(b, c)| (b, c, Ramp::Smooth));
    for (beam_width, cutoff, ramp) in cones.into_iter().chain(smooth) {
        let light = of_ball(spot(Vec3::ZERO, axis, beam_width, cutoff), 0.0, ramp);
        let rings = 6;
        let width = f64::from(cutoff).to_radians() / rings as f64;
        let mut solid = vec![MeanEstimate::new(); rings];
        let mut flux = vec![MeanEstimate::new(); rings];
        for sample in emissions(&light, &[], 2) {
            // From the chord, which stays precise at small angles.
            let chord = (sample.dir - axis).as_dvec3().length();
            let angle = 2.0 * libm::asin(0.5 * chord);
            for ring in 0..rings {
                let inside = (ring as f64..(ring + 1) as f64).contains(&(angle / width));
                let (a, b) = if inside {
                    (1.0 / f64::from(sample.pdf_dir), f64::from(sample.power.x))
                } else {
                    (0.0, 0.0)
                };
                solid[ring].add(a);
                flux[ring].add(b);
            }
        }
        for ring in 0..rings {
            let name = format!("{ramp:?} {beam_width} {cutoff} ring {ring}");
            let (from, to) = (ring as f64 * width, (ring + 1) as f64 * width);
            let tau = 2.0 * std::f64::consts::PI;
            let one_minus_cos = |x: f64| 2.0 * libm::pow(libm::sin(0.5 * x), 2.0);
            suite.mean(
                format!("{name} solid angle"),
                &solid[ring],
                tau * (one_minus_cos(to) - one_minus_cos(from)),
            );
            let (b, c) = (f64::from(beam_width).to_radians(), f64::from(cutoff).to_radians());
            let steps = 20_000;
            let h = (to - from) / f64::from(steps);
            let integral: f64 = (0..steps)
                .map(|i| {
                    let x = from + (f64::from(i) + 0.5) * h;
                    let share = match ramp {
                        Ramp::Linear => (c - x) / (c - b),
                        Ramp::Smooth => (libm::cos(x) - libm::cos(c)) / (libm::cos(b) - libm::cos(c)),
                    };
                    let falloff = match (x <= b, ramp) {
                        (true, _) => 1.0,
                        (false, Ramp::Linear) => share,
                        (false, Ramp::Smooth) => share * share * (3.0 - 2.0 * share),
                    };
                    falloff * libm::sin(x) * h
                })
                .sum();
            suite.mean(
                format!("{name} flux"),
                &flux[ring],
                tau * integral * f64::from(RADIANCE.x),
            );
        }
    }
    suite.finish();
}

#[test]
fn emitted_directions_follow_their_density() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let test = Chi2::default();
    let draw =
        |light: &Light, objects: &[Object], rng: &mut Sampler| light.sample_emission(objects, &BOUNDS, emission(rng));
    let lamp = point(Vec3::ONE);
    suite.chi2(
        "point",
        &test.sphere(Vec3::Y, |rng| Some(draw(&lamp, &[], rng).dir), |_| 0.25 / PI),
    );
    let edges = (Vec3::new(0.3, 1.0, 0.2), Vec3::new(1.0, -0.2, 0.4));
    let (objects, panel) = emitter(rectangle(Vec3::ONE, edges.0, edges.1));
    let normal = edges.0.cross(edges.1).normalize();
    suite.chi2(
        "panel",
        &test.sphere(
            normal,
            |rng| Some(draw(&panel, &objects, rng).dir),
            |dir| dir.dot(normal).max(0.0) / PI,
        ),
    );
    let sky = sky(Some(speckled(9, 6, 50.0)));
    let LightKind::Environment(environment) = &sky.kind else {
        unreachable!()
    };
    suite.chi2(
        "sky",
        &Chi2 { depth: 7, ..test }.sphere(
            Vec3::Y,
            |rng| Some(draw(&sky, &[], rng).dir),
            |dir| environment.pdf(-dir),
        ),
    );
    suite.finish();
}

#[test]
fn emitted_positions_follow_their_density() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let test = Chi2 {
        depth: 7,
        ..Chi2::default()
    };
    let side = f64::from(BOUNDS.radius);
    let square = Rect {
        x: (-side, side),
        y: (-side, side),
    };
    let in_disc = |p: Vec2| {
        if p.length() <= BOUNDS.radius {
            1.0 / (PI * BOUNDS.radius * BOUNDS.radius)
        } else {
            0.0
        }
    };
    for (name, light) in [
        ("sun", sun(Vec3::new(0.3, -1.0, 0.2))),
        ("sky", sky(Some(speckled(4, 5, 9.0)))),
    ] {
        let result = test.plane(
            square,
            |rng| {
                let sample = light.sample_emission(&[], &BOUNDS, emission(rng));
                let local = Frame::from_normal(sample.dir).to_local(sample.origin - BOUNDS.center);
                assert!((local.z / BOUNDS.radius + 1.0).abs() < 1e-5, "starts outside");
                assert_eq!(sample.pdf_pos, in_disc(Vec2::ZERO));
                Some(local.truncate())
            },
            in_disc,
        );
        suite.chi2(name, &result);
    }
    let (objects, panel) = emitter(rectangle(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y));
    let result = test.plane(
        Rect {
            x: (0.0, 2.0),
            y: (0.0, 1.0),
        },
        |rng| {
            let sample = panel.sample_emission(&objects, &BOUNDS, emission(rng));
            assert_eq!(sample.origin.z, 0.0);
            assert_eq!(sample.normal, Some(Vec3::Z));
            Some(sample.origin.truncate())
        },
        |_| 0.5,
    );
    suite.chi2("panel", &result);
    suite.finish();
}

#[test]
fn emission_starts_on_the_surface_and_leaves_it() {
    for (name, shape) in shapes() {
        let (objects, light) = emitter(shape);
        let geometry = Geometry::new(&objects);
        for sample in emissions(&light, &objects, 3).take(2000) {
            let normal = sample.normal.unwrap();
            assert!(sample.dir.dot(normal) >= 0.0 && (sample.dir.length() - 1.0).abs() < 1e-5);
            // Seen from above, the surface is where the sample says.
            let ray = Ray {
                origin: sample.origin + normal * 0.01,
                dir: -normal,
            };
            let hit = geometry.intersect(&objects, &ray, f32::INFINITY, &|_| false).unwrap();
            assert!((hit.t - 0.01).abs() < 1e-4, "{name}: {}", hit.t);
            assert!((hit.ng - normal).length() < 1e-3, "{name}");
        }
    }
}
