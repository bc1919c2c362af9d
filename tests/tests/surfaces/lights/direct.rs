//! Light towards a point: samples, their densities, and the irradiance that they sum to.

use crate::surfaces::lights::setup::{
    RADIANCE, SAMPLES, SIGNIFICANCE, ball, cylinder, disc, emitter, light, patterned, point, rectangle, shapes, sky,
    spot, sun,
};
use beamfarm_harness::quadrature::Rect;
use beamfarm_harness::{Chi2, MeanEstimate, Suite};
use beamfarm_render::math::{Frame, PI, Ray, Rgb, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::geometry::{Geometry, Object, Shape, bounds};
use beamfarm_render::world::light::{DirectSample, Environment, Light, LightHit, LightKind};
use beamfarm_render::world::texture::{Image, TexturePoint};
use glam::{Affine3A, Mat3};
use std::sync::Arc;

fn directs(light: &Light, objects: &[Object], from: Vec3) -> impl Iterator<Item = Option<DirectSample>> {
    let mut rng = Sampler::new(11, 0, Purpose::Test, 0);
    (0..SAMPLES).map(move |_| light.sample_direct(objects, from, rng.next_2d(), rng.next_1d()))
}

/// A light's density in a direction, found by tracing a ray there as integrators do.
fn traced_pdf(light: &Light, objects: &[Object], geometry: &Geometry, from: Vec3, wi: Vec3) -> f32 {
    let ray = Ray { origin: from, dir: wi };
    let hit = geometry
        .intersect(objects, &ray, f32::INFINITY, &|_| false)
        .map(|hit| LightHit {
            normal: hit.ng,
            primitive: hit.primitive,
            distance: hit.t,
        });
    light.pdf_direct(objects, from, wi, hit)
}

const FROM: [Vec3; 3] = [
    Vec3::new(0.2, 2.0, 0.4),
    Vec3::new(2.0, 0.4, -0.5),
    Vec3::new(-0.5, -1.5, 0.0),
];

/// Inverse densities sum to the solid angle that the light fills, octant by octant, as also measured by rays in random
/// directions. (Outlines cut through chi-square bins, so quadrature of the density would be hard.)
#[test]
fn direct_sampling_covers_the_solid_angle() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, shape) in shapes() {
        let (low, high) = bounds(&shape);
        let patterned = [emitter(shape.clone()), patterned(shape)];
        for ((objects, light), from) in patterned.iter().flat_map(|emitter| FROM.map(|from| (emitter, from))) {
            let geometry = Geometry::new(objects);
            let to_center = 0.5 * (low + high) - from;
            let frame = Frame::from_normal(to_center.normalize());
            let ratio = 0.5 * (high - low).length() / to_center.length();
            let cos = (1.0 - ratio * ratio).max(0.0).sqrt();
            // Two rings of eight sectors each.
            let bin = |wi: Vec3| {
                let local = frame.to_local(wi);
                let sector = (local.x > 0.0) as usize
                    + 2 * (local.y > 0.0) as usize
                    + 4 * (local.x.abs() > local.y.abs()) as usize;
                2 * sector + (1.0 - local.z > 0.25 * (1.0 - cos)) as usize
            };
            let mut sampled = [MeanEstimate::new(); 16];
            for sample in directs(light, objects, from) {
                let inverse = sample.map_or((usize::MAX, 0.0), |sample| {
                    let pdf = traced_pdf(light, objects, &geometry, from, sample.wi);
                    // Within rounding of the outline a ray may just miss; there the density is high.
                    (bin(sample.wi), if pdf > 0.0 { 1.0 / pdf } else { 0.0 })
                });
                for (i, estimate) in sampled.iter_mut().enumerate() {
                    estimate.add(if i == inverse.0 { f64::from(inverse.1) } else { 0.0 });
                }
            }
            let mut rng = Sampler::new(12, 0, Purpose::Test, 0);
            let mut traced = [MeanEstimate::new(); 16];
            for _ in 0..SAMPLES {
                let wi = frame.to_world(warp::uniform_cone(rng.next_2d(), cos));
                let lit = traced_pdf(light, objects, &geometry, from, wi) > 0.0;
                for (i, estimate) in traced.iter_mut().enumerate() {
                    let solid_angle = 1.0 / warp::uniform_cone_pdf(cos);
                    estimate.add(if lit && i == bin(wi) {
                        f64::from(solid_angle)
                    } else {
                        0.0
                    });
                }
            }
            for i in 0..16 {
                if sampled[i].mean() > 0.0 || traced[i].mean() > 0.0 {
                    suite.same_mean(format!("{name} from {from} in {i}"), &sampled[i], &traced[i]);
                }
            }
        }
    }
    suite.finish();
}

#[test]
fn cones_around_spheres_are_sampled_uniformly() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let towards = Vec3::new(0.48, 0.64, 0.6);
    let frame = Frame::from_normal(towards);
    for (radius, distance) in [(0.4f32, 1.5f32), (0.499, 0.5), (2.0, 1000.0)] {
        let (objects, light) = emitter(ball(towards * distance, radius));
        let sin2 = f64::from(radius / distance) * f64::from(radius / distance);
        let height = sin2 / (1.0 + (1.0 - sin2).sqrt());
        let hit = Some(LightHit {
            normal: -towards,
            primitive: 0,
            distance: distance - radius,
        });
        // Height within the cap as a share of the whole cone's, and azimuth in turns.
        let unit = Rect {
            x: (0.0, 1.0),
            y: (-0.5, 0.5),
        };
        let result = Chi2::default().plane(
            unit,
            |rng| {
                let sample = light.sample_direct(&objects, Vec3::ZERO, rng.next_2d(), 0.0)?;
                let local = frame.to_local(sample.wi);
                let cap = 0.5 * (sample.wi - towards).as_dvec3().length_squared();
                let turn = libm::atan2f(local.y, local.x) / (2.0 * PI);
                Some(Vec2::new((cap / height) as f32, turn))
            },
            |_| {
                let pdf = light.pdf_direct(&objects, Vec3::ZERO, towards, hit);
                pdf * (2.0 * std::f64::consts::PI * height) as f32
            },
        );
        suite.chi2(format!("sphere {radius} at {distance}"), &result);
    }
    suite.finish();
}

#[test]
fn direct_samples_lie_on_the_light_at_their_distance_with_their_density() {
    let emitters = |(name, shape): (&'static str, Shape)| {
        let plain = emitter(shape.clone());
        [(name, plain, 1e-4), (name, patterned(shape), 3e-3)]
    };
    for (name, (objects, light), precision) in shapes().into_iter().flat_map(emitters) {
        let geometry = Geometry::new(&objects);
        let from = Vec3::new(0.2, 2.0, 0.4);
        let samples: Vec<DirectSample> = directs(&light, &objects, from).take(5000).flatten().collect();
        let mut missed = 0.0;
        for sample in &samples {
            let ray = Ray {
                origin: from,
                dir: sample.wi,
            };
            let Some(hit) = geometry.intersect(&objects, &ray, f32::INFINITY, &|_| false) else {
                missed += 1.0 / sample.pdf;
                continue;
            };
            let cos = hit.ng.dot(-sample.wi);
            if cos < 0.05 {
                // Grazing: the point is the more uncertain the steeper the surface.
                continue;
            }
            assert!((hit.t / sample.distance - 1.0).abs() < 1e-5, "{name}");
            let pdf = traced_pdf(&light, &objects, &geometry, from, sample.wi);
            assert!((pdf / sample.pdf - 1.0).abs() < 1e-3, "{name}");
            let radiance = sample.weight * sample.pdf;
            assert!(
                (radiance - light.radiance_area(cos, &hit.at)).length() < precision,
                "{name}"
            );
        }
        // Within rounding of the outline a ray may just miss.
        let all: f32 = samples.iter().map(|sample| 1.0 / sample.pdf).sum();
        assert!(missed <= 1e-5 * all, "{name}: {missed} of {all} missed");
    }
}

/// Irradiance at a point by direct sampling: mean of weight times cosine.
fn irradiance(light: &Light, objects: &[Object], from: Vec3, normal: Vec3) -> MeanEstimate {
    directs(light, objects, from)
        .map(|sample| {
            sample.map_or(0.0, |sample| {
                f64::from(sample.weight.x) * f64::from(sample.wi.dot(normal).max(0.0))
            })
        })
        .collect()
}

#[test]
fn irradiance_matches_closed_forms() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let radiance = f64::from(RADIANCE.x);
    let pi = std::f64::consts::PI;
    let normal = Vec3::new(0.6, 0.0, 0.8);

    // Sphere: pi L (r / d)^2 times the cosine to its centre, while the whole sphere is above the horizon.
    for (radius, distance) in [(0.5, 2.0), (0.9, 1.0), (1e-3, 1e4), (2e-4, 3e5)] {
        let towards = Vec3::new(0.48, 0.64, 0.6);
        let (objects, light) = emitter(ball(towards * distance, radius));
        let facing = irradiance(&light, &objects, Vec3::ZERO, towards);
        let share = f64::from(radius) / f64::from(distance);
        let name = format!("sphere {radius} at {distance}");
        suite.mean(name, &facing, pi * radiance * share * share);
        if radius < 0.6 {
            let cos = f64::from(normal.dot(towards));
            let tilted = irradiance(&light, &objects, Vec3::ZERO, normal);
            let name = format!("tilted, sphere {radius} at {distance}");
            suite.mean(name, &tilted, pi * radiance * share * share * cos);
        }
    }

    // Disc of radius R at distance d on the axis: pi L R^2 / (R^2 + d^2).
    for (radius, distance) in [(0.5f32, 2.0f32), (3.0, 0.7)] {
        let map = Affine3A::from_translation(Vec3::new(0.0, 0.0, distance))
            * Affine3A::from_rotation_x(PI)
            * Affine3A::from_scale(Vec3::splat(radius));
        let (objects, light) = emitter(disc(map));
        let mean = irradiance(&light, &objects, Vec3::ZERO, Vec3::Z);
        let (r2, d2) = (f64::from(radius * radius), f64::from(distance * distance));
        suite.mean(
            format!("disc {radius} at {distance}"),
            &mean,
            pi * radiance * r2 / (r2 + d2),
        );
        let behind = irradiance(&light, &objects, Vec3::new(0.0, 0.0, 2.0 * distance), -Vec3::Z);
        assert_eq!(behind.mean(), 0.0, "discs have one side");
    }

    // The inside of a cylinder of radius R and height H from the middle of its base: pi L H^2 / (R^2 + H^2), which is
    // all but what the other end subtends.
    for (radius, height) in [(0.5f32, 2.0f32), (3.0, 0.7)] {
        let map = Affine3A::from_scale(Vec3::new(radius, radius, height));
        let (objects, light) = emitter(cylinder(map, true));
        let mean = irradiance(&light, &objects, Vec3::ZERO, Vec3::Z);
        let (r2, h2) = (f64::from(radius * radius), f64::from(height * height));
        suite.mean(
            format!("cylinder {radius} x {height}"),
            &mean,
            pi * radiance * h2 / (r2 + h2),
        );
        let (objects, light) = emitter(cylinder(map, false));
        let outside = irradiance(&light, &objects, Vec3::ZERO, Vec3::Z);
        assert_eq!(outside.mean(), 0.0, "its outside cannot be seen from within");
    }

    // Rectangle a x b parallel to the surface at distance d, one corner above the point (Howell, A Catalog of Radiation
    // Heat Transfer Configuration Factors, B-3).
    for (a, b, d) in [(1.0f32, 2.0f32, 1.5f32), (4.0, 0.5, 0.8)] {
        let corner = Vec3::new(0.0, 0.0, d);
        let (objects, light) = emitter(rectangle(corner, Vec3::Y * b, Vec3::X * a));
        let mean = irradiance(&light, &objects, Vec3::ZERO, Vec3::Z);
        let (x, y) = (f64::from(a / d), f64::from(b / d));
        let (sx, sy) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        let factor = (x / sx * libm::atan2(y, sx) + y / sy * libm::atan2(x, sy)) / (2.0 * pi);
        suite.mean(format!("rectangle {a} {b} {d}"), &mean, pi * radiance * factor);
    }

    // Constant radiance from everywhere, and radiance theta / pi from an image of two rows, whose integral is pi / 4.
    let mean = irradiance(&sky(None), &[], Vec3::ZERO, normal);
    suite.mean("even sky", &mean, pi * radiance);
    let rows = Image {
        alpha: Vec::new(),
        width: 1,
        height: 2,
        pixels: vec![Rgb::ZERO, Rgb::ONE],
    };
    let gradient = light(LightKind::Environment(Environment::new(
        Some(Arc::new(rows)),
        RADIANCE,
        Mat3::IDENTITY,
    )));
    let mean = irradiance(&gradient, &[], Vec3::ZERO, Vec3::Y);
    suite.mean("gradient sky", &mean, 0.25 * pi * radiance);
    suite.finish();
}

#[test]
fn delta_lights_follow_the_inverse_square_law() {
    let from = Vec3::new(1.0, 2.0, 3.0);
    let offset = Vec3::new(0.0, 3.0, 4.0);
    let direct = |light: &Light| light.sample_direct(&[], from, Vec2::splat(0.3), 0.5);
    let sample = direct(&point(from + offset)).unwrap();
    assert!(sample.unmet && sample.pdf == 1.0);
    assert!((sample.wi - offset / 5.0).length() < 1e-6);
    assert!((sample.distance - 5.0).abs() < 1e-5);
    assert!((sample.weight - RADIANCE / 25.0).length() < 1e-6);
    assert!(direct(&point(from)).is_none(), "at the light itself");

    // Halfway down the ramp.
    let turned = Mat3::from_axis_angle(Vec3::X, 17.5f32.to_radians()) * -offset;
    let sample = direct(&spot(from + offset, turned, 15.0, 20.0)).unwrap();
    assert!((sample.weight - RADIANCE / 50.0).length() < 1e-5);
    let turned = Mat3::from_axis_angle(Vec3::X, 21f32.to_radians()) * -offset;
    assert!(direct(&spot(from + offset, turned, 15.0, 20.0)).is_none());

    let sample = direct(&sun(Vec3::new(0.0, -3.0, 4.0))).unwrap();
    assert_eq!(sample.wi, -Vec3::new(0.0, -0.6, 0.8));
    assert!(sample.unmet && sample.distance == f32::INFINITY);
    assert_eq!(sample.weight, RADIANCE);
}

#[test]
fn delta_lights_have_no_density() {
    for light in [point(Vec3::ONE), sun(Vec3::X), spot(Vec3::ONE, Vec3::X, 3.0, 5.0)] {
        assert_eq!(light.pdf_direct(&[], Vec3::ZERO, Vec3::X, None), 0.0);
        assert_eq!(light.radiance_area(1.0, &TexturePoint::default()), Rgb::ZERO);
    }
}
