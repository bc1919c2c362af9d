//! Lights: what they emit, and how they are sampled, against closed forms and against each other.

use beamfarm_shared::geometry::{Geometry, Mesh, Object, Placement, Shape, bounds};
use beamfarm_shared::layer::LightGroup;
use beamfarm_shared::light::{
    DirectSample, EmissionSample, EmissionUniforms, Environment, Light, LightHit, LightKind,
    LightSelector, SceneBounds,
};
use beamfarm_shared::math::{Frame, PI, Ray, Rgb, Vec2, Vec3};
use beamfarm_shared::sampler::{Purpose, Sampler};
use beamfarm_shared::texture::Image;
use beamfarm_shared::warp;
use beamfarm_tests::quadrature::Rect;
use beamfarm_tests::{Chi2, MeanEstimate, Suite};
use glam::{Affine3A, Mat3};
use std::sync::Arc;

/// Chance of a false alarm per test function, if all is right and the seeds were new.
const SIGNIFICANCE: f64 = 0.01;
const SAMPLES: u64 = 200_000;
const RADIANCE: Rgb = Rgb::new(3.0, 2.0, 0.5);
const BOUNDS: SceneBounds = SceneBounds {
    center: Vec3::new(1.0, -2.0, 0.5),
    radius: 7.0,
};

fn light(kind: LightKind) -> Light {
    Light {
        name: String::new(),
        kind,
        group: LightGroup::named(""),
    }
}

fn placement(map: Affine3A) -> Placement {
    Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    }
}

fn sphere(map: Affine3A) -> Shape {
    Shape::Sphere {
        placement: placement(map),
        flip: false,
    }
}

fn ball(center: Vec3, radius: f32) -> Shape {
    sphere(Affine3A::from_translation(center) * Affine3A::from_scale(Vec3::splat(radius)))
}

fn disc(map: Affine3A) -> Shape {
    Shape::Disc {
        placement: placement(map),
        flip: false,
    }
}

fn cylinder(map: Affine3A, flip: bool) -> Shape {
    Shape::Cylinder {
        placement: placement(map),
        flip,
    }
}

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Shape {
    Shape::Mesh {
        mesh: Arc::new(Mesh {
            positions,
            triangles,
            ..Mesh::default()
        }),
        placement: Placement::IDENTITY,
    }
}

/// A rectangle from one corner along two edges; its normal is their cross product.
fn rectangle(corner: Vec3, a: Vec3, b: Vec3) -> Shape {
    mesh(
        vec![corner, corner + a, corner + a + b, corner + b],
        vec![[0, 1, 2], [0, 2, 3]],
    )
}

/// A tetrahedron around the origin, all corners at distance `size`.
fn tetrahedron(center: Vec3, size: f32) -> Shape {
    let corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]];
    mesh(
        corners
            .iter()
            .map(|c| center + Vec3::from(c.map(|x| x as f32)).normalize() * size)
            .collect(),
        vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
    )
}

fn emitter(shape: Shape) -> (Vec<Object>, Light) {
    let object = Object {
        name: String::new(),
        shape,
        material: 0,
        boundary: None,
        light: Some(0),
    };
    let kind = LightKind::Area {
        object: 0,
        radiance: RADIANCE,
    };
    (vec![object], light(kind))
}

fn point(position: Vec3) -> Light {
    light(LightKind::Point {
        position,
        intensity: RADIANCE,
    })
}

fn spot(position: Vec3, axis: Vec3, beam_width: f32, cutoff: f32) -> Light {
    light(LightKind::Spot {
        position,
        frame: Frame::from_normal(axis.normalize()),
        intensity: RADIANCE,
        cutoff: cutoff.to_radians(),
        beam_width: beam_width.to_radians(),
    })
}

fn sun(direction: Vec3) -> Light {
    light(LightKind::Directional {
        direction: direction.normalize(),
        irradiance: RADIANCE,
    })
}

fn sky(image: Option<Image>) -> Light {
    let rotation = Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(-0.4);
    let image = image.map(Arc::new);
    light(LightKind::Environment(Environment::new(
        image, RADIANCE, rotation,
    )))
}

/// Pixels of random brightness, some black, one `peak` times as bright.
fn speckled(width: u32, height: u32, peak: f32) -> Image {
    let mut rng = Sampler::new(5, 0, Purpose::Test, 0);
    let mut pixels: Vec<Rgb> = (0..width * height)
        .map(|_| {
            let lit = if rng.next_1d() < 0.5 { 0.0 } else { 1.0 };
            Rgb::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * lit
        })
        .collect();
    let at = pixels.len() / 3;
    pixels[at] = Rgb::splat(peak);
    Image {
        width,
        height,
        pixels,
    }
}

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

fn directs(
    light: &Light,
    objects: &[Object],
    from: Vec3,
) -> impl Iterator<Item = Option<DirectSample>> {
    let mut rng = Sampler::new(11, 0, Purpose::Test, 0);
    (0..SAMPLES).map(move |_| light.sample_direct(objects, from, rng.next_2d(), rng.next_1d()))
}

/// Shapes of every kind, with a name.
fn shapes() -> Vec<(&'static str, Shape)> {
    let tilt = Affine3A::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
    let at = Affine3A::from_translation(Vec3::new(0.5, 0.3, -1.0));
    vec![
        ("ball", ball(Vec3::new(0.5, 0.3, -1.0), 0.4)),
        (
            "ellipsoid",
            sphere(at * tilt * Affine3A::from_scale(Vec3::new(1.0, 0.3, 0.6))),
        ),
        (
            "disc",
            disc(at * tilt * Affine3A::from_scale(Vec3::new(0.8, 0.5, 1.0))),
        ),
        (
            "cylinder",
            cylinder(
                at * tilt * Affine3A::from_scale(Vec3::new(0.3, 0.5, 1.2)),
                false,
            ),
        ),
        (
            "rectangle",
            rectangle(
                Vec3::new(-1.0, 0.0, -0.5),
                Vec3::new(1.2, 0.1, 0.0),
                Vec3::new(0.3, 0.2, 0.9),
            ),
        ),
        ("tetrahedron", tetrahedron(Vec3::new(0.5, 0.3, -1.0), 0.8)),
    ]
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
        ("sun", sun(up)),
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
            suite.mean(
                format!("{name} {channel}"),
                &mean,
                f64::from(power[channel]),
            );
        }
    }
    suite.finish();
}

/// Radiant exitance, solid angles and projected areas in plain numbers.
#[test]
fn powers_of_simple_lights() {
    let close = |a: Rgb, b: Rgb| assert!((a / b - 1.0).abs().max_element() < 1e-5, "{a} != {b}");
    let (objects, ball) = emitter(ball(Vec3::ZERO, 0.5));
    close(ball.power(&objects, &BOUNDS), RADIANCE * (PI * PI));
    let (objects, square) = emitter(rectangle(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 3.0));
    close(square.power(&objects, &BOUNDS), RADIANCE * (6.0 * PI));
    close(point(Vec3::ZERO).power(&[], &BOUNDS), RADIANCE * (4.0 * PI));
    close(sun(Vec3::X).power(&[], &BOUNDS), RADIANCE * (49.0 * PI));
    close(
        sky(None).power(&[], &BOUNDS),
        RADIANCE * (4.0 * PI * 49.0 * PI),
    );
    let hemisphere = spot(Vec3::ZERO, Vec3::X, 90.0, 90.0);
    close(hemisphere.power(&[], &BOUNDS), RADIANCE * (2.0 * PI));
    // 2 pi (1 - (sin c - sin b) / (c - b)) with b = 0, c = pi / 2.
    let ramp = spot(Vec3::ZERO, Vec3::X, 0.0, 90.0);
    close(
        ramp.power(&[], &BOUNDS),
        RADIANCE * (2.0 * PI * (1.0 - 2.0 / PI)),
    );
    // Of 1 - angle / cutoff over a small disc: a third.
    let narrow = spot(Vec3::ZERO, Vec3::X, 0.0, 0.01);
    let cutoff = 0.01f32.to_radians();
    close(
        narrow.power(&[], &BOUNDS),
        RADIANCE * (PI * cutoff * cutoff / 3.0),
    );
}

/// 1/pdf sums to solid angles, and the power to the falloff's integral, ring by ring around the axis.
#[test]
fn spot_emission_follows_its_falloff() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let axis = Vec3::new(-0.4, 0.3, 0.6).normalize();
    for (beam_width, cutoff) in [
        (15.0, 20.0),
        (0.0, 40.0),
        (80.0, 170.0),
        (0.5, 0.6),
        (25.0, 25.0),
    ] {
        let light = spot(Vec3::ZERO, axis, beam_width, cutoff);
        let rings = 6;
        let width = f64::from(cutoff).to_radians() / rings as f64;
        let mut solid = vec![MeanEstimate::new(); rings];
        let mut flux = vec![MeanEstimate::new(); rings];
        for sample in emissions(&light, &[], 2) {
            // From the chord, which has digits left at small angles.
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
            let name = format!("{beam_width} {cutoff} ring {ring}");
            let (from, to) = (ring as f64 * width, (ring + 1) as f64 * width);
            let tau = 2.0 * std::f64::consts::PI;
            let one_minus_cos = |x: f64| 2.0 * libm::pow(libm::sin(0.5 * x), 2.0);
            suite.mean(
                format!("{name} solid angle"),
                &solid[ring],
                tau * (one_minus_cos(to) - one_minus_cos(from)),
            );
            let (b, c) = (
                f64::from(beam_width).to_radians(),
                f64::from(cutoff).to_radians(),
            );
            let steps = 20_000;
            let h = (to - from) / f64::from(steps);
            let integral: f64 = (0..steps)
                .map(|i| {
                    let x = from + (f64::from(i) + 0.5) * h;
                    let falloff = if x <= b { 1.0 } else { (c - x) / (c - b) };
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
    let draw = |light: &Light, objects: &[Object], rng: &mut Sampler| {
        light.sample_emission(objects, &BOUNDS, emission(rng))
    };
    let lamp = point(Vec3::ONE);
    suite.chi2(
        "point",
        &test.sphere(
            Vec3::Y,
            |rng| Some(draw(&lamp, &[], rng).dir),
            |_| 0.25 / PI,
        ),
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
                assert!(
                    (local.z / BOUNDS.radius + 1.0).abs() < 1e-5,
                    "starts outside"
                );
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
            let hit = geometry
                .intersect(&objects, &ray, f32::INFINITY, |_| false)
                .unwrap();
            assert!((hit.t - 0.01).abs() < 1e-4, "{name}: {}", hit.t);
            assert!((hit.ng - normal).length() < 1e-3, "{name}");
        }
    }
}

/// The density of a light in a direction by tracing a ray there, as integrators ask for it.
fn traced_pdf(light: &Light, objects: &[Object], geometry: &Geometry, from: Vec3, wi: Vec3) -> f32 {
    let ray = Ray {
        origin: from,
        dir: wi,
    };
    let hit = geometry
        .intersect(objects, &ray, f32::INFINITY, |_| false)
        .map(|hit| LightHit {
            normal: hit.ng,
            distance: hit.t,
        });
    light.pdf_direct(objects, from, wi, hit)
}

/// Inverse densities sum to the solid angle that the light fills, octant by octant, which rays in random directions
/// measure too. (Outlines cut through chi-square bins, so that quadrature of the density would be hard.)
#[test]
fn direct_sampling_covers_the_solid_angle() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, shape) in shapes() {
        let (low, high) = bounds(&shape);
        let (objects, light) = emitter(shape);
        let geometry = Geometry::new(&objects);
        for from in [
            Vec3::new(0.2, 2.0, 0.4),
            Vec3::new(2.0, 0.4, -0.5),
            Vec3::new(-0.5, -1.5, 0.0),
        ] {
            let to_center = 0.5 * (low + high) - from;
            let frame = Frame::from_normal(to_center.normalize());
            let ratio = 0.5 * (high - low).length() / to_center.length();
            let cos = (1.0 - ratio * ratio).max(0.0).sqrt();
            // Eight sectors of two rings each.
            let bin = |wi: Vec3| {
                let local = frame.to_local(wi);
                let sector = (local.x > 0.0) as usize
                    + 2 * (local.y > 0.0) as usize
                    + 4 * (local.x.abs() > local.y.abs()) as usize;
                2 * sector + (1.0 - local.z > 0.25 * (1.0 - cos)) as usize
            };
            let mut sampled = [MeanEstimate::new(); 16];
            for sample in directs(&light, &objects, from) {
                let inverse = sample.map_or((usize::MAX, 0.0), |sample| {
                    let pdf = traced_pdf(&light, &objects, &geometry, from, sample.wi);
                    // Within a rounding of the outline a ray may just miss; there the density is high.
                    (bin(sample.wi), if pdf > 0.0 { 1.0 / pdf } else { 0.0 })
                });
                for (i, estimate) in sampled.iter_mut().enumerate() {
                    estimate.add(if i == inverse.0 {
                        f64::from(inverse.1)
                    } else {
                        0.0
                    });
                }
            }
            let mut rng = Sampler::new(12, 0, Purpose::Test, 0);
            let mut traced = [MeanEstimate::new(); 16];
            for _ in 0..SAMPLES {
                let wi = frame.to_world(warp::uniform_cone(rng.next_2d(), cos));
                let lit = traced_pdf(&light, &objects, &geometry, from, wi) > 0.0;
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
                    suite.same_mean(
                        format!("{name} from {from} in {i}"),
                        &sampled[i],
                        &traced[i],
                    );
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
            distance: distance - radius,
        });
        // Height of the cap in units of the whole cone's, and azimuth in units of a turn.
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
fn environment_sampling_follows_its_density() {
    let sky = sky(Some(speckled(9, 6, 50.0)));
    let test = Chi2 {
        depth: 7,
        ..Chi2::default()
    };
    let result = test.sphere(
        Vec3::Y,
        |rng| {
            sky.sample_direct(&[], Vec3::ZERO, rng.next_2d(), 0.0)
                .map(|sample| sample.wi)
        },
        |wi| sky.pdf_direct(&[], Vec3::ZERO, wi, None),
    );
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.chi2("sky", &result);
    suite.finish();
}

#[test]
fn direct_samples_lie_on_the_light_at_their_distance_with_their_density() {
    for (name, shape) in shapes() {
        let (objects, light) = emitter(shape);
        let geometry = Geometry::new(&objects);
        let from = Vec3::new(0.2, 2.0, 0.4);
        let samples: Vec<DirectSample> = directs(&light, &objects, from)
            .take(5000)
            .flatten()
            .collect();
        let mut missed = 0.0;
        for sample in &samples {
            let ray = Ray {
                origin: from,
                dir: sample.wi,
            };
            let Some(hit) = geometry.intersect(&objects, &ray, f32::INFINITY, |_| false) else {
                missed += 1.0 / sample.pdf;
                continue;
            };
            let cos = hit.ng.dot(-sample.wi);
            if cos < 0.05 {
                // Grazing: the point is as uncertain as the surface is steep.
                continue;
            }
            assert!((hit.t / sample.distance - 1.0).abs() < 1e-5, "{name}");
            let pdf = traced_pdf(&light, &objects, &geometry, from, sample.wi);
            assert!((pdf / sample.pdf - 1.0).abs() < 1e-3, "{name}");
            let radiance = sample.weight * sample.pdf;
            assert!(
                (radiance - light.radiance_area(cos)).length() < 1e-4,
                "{name}"
            );
        }
        // Within a rounding of the outline a ray may just miss.
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

    // Sphere: pi L (r / d)^2 times the cosine to its centre, while all of it is above the horizon.
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
        let behind = irradiance(
            &light,
            &objects,
            Vec3::new(0.0, 0.0, 2.0 * distance),
            -Vec3::Z,
        );
        assert_eq!(behind.mean(), 0.0, "discs have one side");
    }

    // The inside of a cylinder of radius R and height H from the middle of its base: pi L H^2 / (R^2 + H^2), the rest of
    // what the other end leaves.
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
        assert_eq!(
            outside.mean(),
            0.0,
            "its outside cannot be seen from within"
        );
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
        suite.mean(
            format!("rectangle {a} {b} {d}"),
            &mean,
            pi * radiance * factor,
        );
    }

    // Constant radiance from all around, and radiance theta / pi from two rows, whose integral is pi / 4.
    let mean = irradiance(&sky(None), &[], Vec3::ZERO, normal);
    suite.mean("even sky", &mean, pi * radiance);
    let rows = Image {
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
    assert!(sample.delta && sample.pdf == 1.0);
    assert!((sample.wi - offset / 5.0).length() < 1e-6);
    assert!((sample.distance - 5.0).abs() < 1e-5);
    assert!((sample.weight - RADIANCE / 25.0).length() < 1e-6);
    assert!(direct(&point(from)).is_none(), "at the light itself");

    // Half way down the ramp.
    let turned = Mat3::from_axis_angle(Vec3::X, 17.5f32.to_radians()) * -offset;
    let sample = direct(&spot(from + offset, turned, 15.0, 20.0)).unwrap();
    assert!((sample.weight - RADIANCE / 50.0).length() < 1e-5);
    let turned = Mat3::from_axis_angle(Vec3::X, 21f32.to_radians()) * -offset;
    assert!(direct(&spot(from + offset, turned, 15.0, 20.0)).is_none());

    let sample = direct(&sun(Vec3::new(0.0, -3.0, 4.0))).unwrap();
    assert_eq!(sample.wi, -Vec3::new(0.0, -0.6, 0.8));
    assert!(sample.delta && sample.distance == f32::INFINITY);
    assert_eq!(sample.weight, RADIANCE);
}

#[test]
fn delta_lights_have_no_density() {
    for light in [
        point(Vec3::ONE),
        sun(Vec3::X),
        spot(Vec3::ONE, Vec3::X, 3.0, 5.0),
    ] {
        assert_eq!(light.pdf_direct(&[], Vec3::ZERO, Vec3::X, None), 0.0);
        assert_eq!(light.radiance_area(1.0), Rgb::ZERO);
    }
}

/// What Mitsuba 3.9.1's `envmap` returns for an image of 8 x 4 pixels with red = column + 1, green = row + 1.
#[test]
fn environment_is_oriented_as_mitsubas() {
    let pixels = (0..32)
        .map(|i| Rgb::new((i % 8 + 1) as f32, (i / 8 + 1) as f32, 1.0))
        .collect();
    let image = Image {
        width: 8,
        height: 4,
        pixels,
    };
    let environment = Environment::new(Some(Arc::new(image)), Rgb::ONE, Mat3::IDENTITY);
    for (dir, red, green) in [
        ([0.0, 0.0, 1.0], 4.5, 2.5),
        ([1.0, 0.0, 0.0], 2.5, 2.5),
        ([0.0, 0.0, -1.0], 4.5, 2.5),
        ([-1.0, 0.0, 0.0], 6.5, 2.5),
        ([0.0, 1.0, 0.0], 4.5, 1.0),
        ([0.0, -1.0, 0.0], 4.5, 4.0),
        ([1.0, 1.0, 0.0], 2.5, 1.75),
        ([1.0, 1.0, 1.0], 3.5, 1.91226),
        ([0.3, -0.2, 0.6], 3.90967, 2.77669),
        ([-0.5, 0.9, -0.1], 6.75133, 1.49223),
    ] {
        let value = environment.radiance(Vec3::from(dir).normalize());
        let expected = Rgb::new(red, green, 1.0);
        assert!((value - expected).length() < 2e-5, "{dir:?}: {value}");
    }
}

#[test]
fn environment_is_sampled_wherever_it_shines() {
    let image = speckled(300, 120, 1e7);
    let environment = Environment::new(Some(Arc::new(image)), RADIANCE, Mat3::IDENTITY);
    let mut rng = Sampler::new(7, 0, Purpose::Test, 0);
    let mut fluence = MeanEstimate::new();
    for _ in 0..SAMPLES {
        let dir = warp::uniform_sphere(rng.next_2d());
        assert!(environment.radiance(dir) == Rgb::ZERO || environment.pdf(dir) > 0.0);
        let sample = environment.sample(rng.next_2d());
        assert!(sample.pdf > 0.0 && (sample.dir.length() - 1.0).abs() < 1e-6);
        // Within a cell, the interpolated radiance is at most four times its mean.
        let ratio = environment.radiance(sample.dir) / sample.pdf;
        assert!(ratio.max_element() < 16.0 * environment.fluence().max_element());
        fluence.add(f64::from(ratio.x));
    }
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.mean("fluence", &fluence, f64::from(environment.fluence().x));
    suite.finish();
    let black = Image {
        width: 2,
        height: 2,
        pixels: vec![Rgb::ZERO; 4],
    };
    let black = Environment::new(Some(Arc::new(black)), RADIANCE, Mat3::IDENTITY);
    assert_eq!(black.fluence(), Rgb::ZERO);
    assert_eq!(black.pdf(Vec3::X), 0.25 / PI);
}

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
