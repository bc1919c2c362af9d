//! Light towards a point, and the densities of its samples.

use super::*;
use crate::world::lights::{AREA, ENVIRONMENT, SMOOTH_SPOT, SPOT, SUN, TWO_SIDED_AREA};
use crate::world::tests::scenes::{GREY, diffuse, even};
use beamfarm_render::math::{PI, Vec2};
use beamfarm_render::world::light::{DirectSample, LightHit, LightPoint, Ramp};

const DIRECTS: Program = lit!(
    "directs",
    "struct Query { point: vec3f, light: u32, u: vec3f, triangle: u32, wi: vec3f, distance: f32, normal: vec3f, dir: vec3f }
    struct Answer {
        wi: vec3f, distance: f32, normal: vec3f, pdf: f32, weight: vec3f, triangle: u32,
        unmet: u32, pdf_direct: f32, photon_density: f32, emitted_density: f32,
    }
    @group(0) @binding(0) var<storage, read> queries: array<Query>;
    @group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
    fn each(i: u32) {
        if (i >= arrayLength(&queries)) { return; }
        let query = queries[i];
        let direct = sample_direct(query.light, query.point, query.u);
        let hit = LightHit(query.normal, query.distance, query.triangle);
        answers[i] = Answer(
            direct.wi, direct.distance, direct.normal, direct.pdf, direct.weight, direct.triangle, u32(direct.unmet),
            pdf_direct(query.light, query.point, query.wi, hit),
            photon_density(query.light, query.point, query.wi, hit),
            emitted_density(query.light, query.dir, query.triangle),
        );
    }"
);

/// A place, a light, numbers, and how a ray from there meets the light.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Query {
    pub point: [f32; 3],
    pub light: u32,
    pub u: [f32; 3],
    pub triangle: u32,
    pub wi: [f32; 3],
    pub distance: f32,
    pub normal: [f32; 3],
    pub padding_2: u32,
    pub dir: [f32; 3],
    pub padding_3: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Answer {
    pub wi: [f32; 3],
    pub distance: f32,
    pub normal: [f32; 3],
    pub pdf: f32,
    pub weight: [f32; 3],
    pub triangle: u32,
    pub unmet: u32,
    pub pdf_direct: f32,
    pub photon_density: f32,
    pub emitted_density: f32,
}

pub fn answers(world: &FlatWorld, queries: &[Query]) -> Option<Vec<Answer>> {
    let tested = tested()?;
    let device = &tested.device;
    let buffers = world.upload(device).unwrap();
    let input = device.buffer("queries", queries).unwrap();
    let output = device
        .empty("answers", size_of::<Answer>() as u64 * queries.len() as u64)
        .unwrap();
    let given = [
        &input,
        &output,
        &buffers.lights,
        &buffers.emitters,
        &buffers.choices.sources,
        &buffers.choices.tables,
        &buffers.textures.textures,
        &buffers.textures.texels,
    ];
    let kernel = tested.kernel(&DIRECTS, "main");
    let mut work = device.work();
    let groups = Groups::Count(queries.len().div_ceil(64) as u32);
    work.run(&kernel, &given, groups).unwrap();
    work.submit().unwrap();
    Some(device.read(&output, queries.len()).unwrap())
}

pub fn sampled(scene: &Scene, query: &Query) -> Option<DirectSample> {
    let description = scene.description();
    let [x, y, z] = query.u;
    let light = &description.lights[query.light as usize];
    light.sample_direct(&description.objects, query.point.into(), Vec2::new(x, y), z)
}

/// A place that the light reaches half of the time, and where a ray from there may meet it.
pub fn query(scene: &Scene, light: u32, chance: &mut Chance) -> Query {
    let kind = &scene.description().lights[light as usize].kind;
    let near = chance.direction() * (4.0 * chance.unit());
    let point = match kind {
        LightKind::Spot(spot) if chance.unit() < 0.8 => {
            let angle = spot.cutoff * 1.2 * chance.unit();
            let (sine, cosine) = beamfarm_render::math::sin_cos(angle);
            let (y, x) = beamfarm_render::math::sin_cos(2.0 * PI * chance.unit());
            let dir = spot.frame.to_world(Vec3::new(sine * x, sine * y, cosine));
            spot.position + dir * (chance.of(&[0.2, 1.0, 5.0, 1000.0]) * chance.unit()) + near * spot.radius * 0.2
        }
        LightKind::Projector(projector) => {
            let at = (2.4 * chance.two() - 1.2) * projector.half;
            let [right, up, forward] = projector.axes;
            projector.position + (right * at.x + up * at.y + forward) * chance.of(&[0.01, 1.0, 100.0, -1.0])
        }
        _ => near,
    };
    let u = [chance.unit(), chance.unit(), chance.unit()];
    let mut query = Query {
        point: point.to_array(),
        light,
        u,
        dir: chance.direction().to_array(),
        ..Query::zeroed()
    };
    // Another sample of the light, or any direction.
    let v = chance.two();
    let objects = &scene.description().objects;
    let other = scene.description().lights[light as usize].sample_direct(objects, point, v, chance.unit());
    let (wi, distance, normal) = match other {
        Some(other) if chance.unit() < 0.9 => {
            query.triangle = other.primitive;
            (other.wi, other.distance, other.normal)
        }
        _ => (chance.direction(), 1.5, chance.direction()),
    };
    if matches!(kind, LightKind::Spot(_)) && chance.unit() < 0.9 {
        query.dir = (-wi).to_array();
    }
    (query.wi, query.distance, query.normal) = (wi.to_array(), distance, normal.to_array());
    query
}

/// Whether numbers agree up to rounding of sines.
fn near(a: f32, b: f32, room: f32) -> bool {
    a.to_bits() == b.to_bits() || (a - b).abs() <= room * b.abs()
}

/// The same for values as large as on a spot's axis: where its ramp ends, it falls like a square root.
fn near_of(a: f32, b: f32, on_axis: f32) -> bool {
    near(a, b, 1e-3) || (a * a - b * b).abs() <= 1e-4 * on_axis * on_axis
}

/// Identical if no sine is involved; else up to rounding.
#[test]
fn light_at_a_point_is_the_renderers() {
    let scene = Scene::new(all_kinds());
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let count = world.lights.len() as u32;
    let mut chance = Chance::new(4);
    let queries: Vec<Query> = (0..1000 * count)
        .map(|i| query(&scene, i % count, &mut chance))
        .collect();
    let Some(answers) = answers(&world, &queries) else {
        return;
    };
    let description = scene.description();
    let (objects, bounds) = (&*description.objects, &description.bounds);
    let mut lit = vec![[0; 2]; count as usize];
    for (query, got) in queries.iter().zip(&answers) {
        let flat = &world.lights[query.light as usize];
        let light = &description.lights[query.light as usize];
        let own = sampled(&scene, query);
        let is_spot = [SPOT, SMOOTH_SPOT].contains(&flat.kind);
        let is_ball = is_spot && flat.radius > 0.0;
        let is_drawn = is_ball || [SUN, ENVIRONMENT].contains(&flat.kind);
        let place = format!("{} {query:?}: {got:?}, and not {own:?}", flat.kind);
        lit[query.light as usize][usize::from(own.is_some())] += 1;
        match own {
            // At the end of a ramp, rounding may make it dark, or a chord of zero length.
            None if is_ball => assert!(got.pdf == 0.0 || got.weight[2] * got.pdf < 1e-3, "{place}"),
            None => assert_eq!(got.pdf, 0.0, "{place}"),
            Some(own) if got.pdf == 0.0 => assert!(is_ball && own.weight.z * own.pdf < 1e-3, "{place}"),
            Some(own) => {
                let aside = (Vec3::from(got.wi) - own.wi).abs().max_element();
                let turned = (Vec3::from(got.normal) - own.normal).abs().max_element();
                let rest = [got.weight[0], got.weight[1], got.weight[2], got.pdf, got.distance];
                let own_rest = [own.weight.x, own.weight.y, own.weight.z, own.pdf, own.distance];
                assert_eq!((got.triangle, got.unmet == 1), (own.primitive, own.unmet), "{place}");
                if is_ball {
                    assert!(aside < 1e-6 && turned < 1e-6, "{place}");
                    let area = PI * flat.radius * flat.radius;
                    assert!(near_of(rest[3], own_rest[3], 1.0 / flat.solid_angle), "{place}");
                    assert!(
                        (rest[4] - own_rest[4]).abs() < 1e-3 * flat.radius + 1e-6 * own_rest[4],
                        "{place}"
                    );
                    let radiance = |of: &[f32; 5], k: usize| of[k] * of[3];
                    let same = |k: usize| near_of(radiance(&rest, k), radiance(&own_rest, k), VALUE[k] / area);
                    assert!((0..3).all(same), "{place}");
                } else if flat.kind == SMOOTH_SPOT {
                    assert_eq!((aside, turned), (0.0, 0.0), "{place}");
                    let weight = |k: usize| VALUE[k] / own.distance / own.distance;
                    assert!((0..3).all(|k| near_of(rest[k], own_rest[k], weight(k))), "{place}");
                    assert_eq!((own.pdf, own.distance), (got.pdf, got.distance), "{place}");
                } else {
                    assert!(
                        aside < 5e-7 && turned < 5e-7 && (is_drawn || aside + turned == 0.0),
                        "{place}"
                    );
                    assert_eq!(rest.map(f32::to_bits), own_rest.map(f32::to_bits), "{place}");
                }
            }
        }
        let (at, wi, dir) = (query.point.into(), query.wi.into(), query.dir.into());
        let hit = LightHit {
            normal: query.normal.into(),
            primitive: query.triangle,
            distance: query.distance,
        };
        let on = LightPoint {
            normal: hit.normal,
            primitive: query.triangle,
        };
        let met = hit.distance.is_finite().then_some(hit);
        let densities = [got.pdf_direct, got.photon_density, got.emitted_density];
        let own = [
            light.pdf_direct(objects, at, wi, met),
            light.photon_density(objects, bounds, at, wi, hit),
            light.emitted_density(objects, bounds, dir, on),
        ];
        // On a spot's axis.
        let area = match is_ball {
            true => PI * flat.radius * flat.radius,
            false => flat.solid_angle * query.distance * query.distance,
        };
        let on_axis = [0.0, 1.0 / area, 1.0 / (flat.solid_angle * area)];
        let same = |k: usize| match is_spot {
            true => near_of(densities[k], own[k], on_axis[k]),
            false => densities[k].to_bits() == own[k].to_bits(),
        };
        let both_nan = |k: usize| densities[k].is_nan() && own[k].is_nan();
        assert!(
            (0..3).all(|k| same(k) || both_nan(k)),
            "{place}: {densities:?}, and not {own:?}"
        );
    }
    for (light, [dark, bright]) in world.lights.iter().zip(&lit) {
        assert!(*bright > 100, "{}: {dark} {bright}", light.kind);
        assert!(
            *dark > 50 || ![SPOT, AREA].contains(&light.kind),
            "{}: {dark} {bright}",
            light.kind
        );
    }
}

/// Rectangles with one and two sides, from near and far: points agree up to rounding of sines, densities exactly.
#[test]
fn light_of_rectangles_is_the_renderers() {
    for two_sided in [false, true] {
        let mut description = empty();
        description.materials.push(even(diffuse(GREY)).into());
        description.bounds.radius = 6.0;
        let corners = [[-1.0, -1.5], [1.0, -1.5], [1.0, 1.5], [-1.0, 1.5]];
        let corners = corners.map(|[x, y]| Vec3::new(x, 0.6 * y + 0.5, 0.8 * y - 0.5));
        add_lamp(
            &mut description,
            corners.to_vec(),
            vec![[1, 2, 0], [0, 2, 3]],
            two_sided,
        );
        let scene = Scene::new(description);
        let world = FlatWorld::new(&scene, u64::MAX).unwrap();
        let mut chance = Chance::new(6);
        let queries: Vec<Query> = (0..4000).map(|_| query(&scene, 0, &mut chance)).collect();
        let Some(answers) = answers(&world, &queries) else {
            return;
        };
        let light = &scene.description().lights[0];
        let objects = &*scene.description().objects;
        let rectangle = objects[0].shape.mesh().and_then(|mesh| mesh.rectangle()).unwrap();
        let [mut by_angle, mut by_area] = [0, 0];
        for (query, got) in queries.iter().zip(&answers) {
            let own = sampled(&scene, query);
            let place = format!("{query:?}: {got:?}, and not {own:?}");
            let hit = LightHit {
                normal: query.normal.into(),
                primitive: query.triangle,
                distance: query.distance,
            };
            let met = query.distance.is_finite().then_some(hit);
            let pdf = light.pdf_direct(objects, query.point.into(), query.wi.into(), met);
            assert_eq!(got.pdf_direct.to_bits(), pdf.to_bits(), "{place}: {pdf}");
            let Some(own) = own else {
                assert_eq!(got.pdf, 0.0, "{place}");
                continue;
            };
            assert_eq!((got.pdf, got.weight), (own.pdf, own.weight.to_array()), "{place}");
            // Rounding of a sine moves a point more if the rectangle is seen from the side.
            let room = match rectangle.seen_from(query.point.into()) {
                Some(_) if own.wi.dot(own.normal).abs() < 0.02 => continue,
                Some(_) => {
                    by_angle += 1;
                    5e-3
                }
                None => {
                    by_area += 1;
                    0.0
                }
            };
            assert!((Vec3::from(got.wi) - own.wi).abs().max_element() <= room, "{place}");
            assert!(
                (got.distance - own.distance).abs() <= 10.0 * room * (1.0 + own.distance),
                "{place}"
            );
            assert_eq!(Vec3::from(got.normal), own.normal, "{place}");
        }
        assert!(by_angle > 500 && by_area > 10, "{by_angle} {by_area}");
    }
}

/// Balls and discs, from inside, outside and far away, up to rounding; and densities of directions integrate to one.
#[test]
fn light_of_round_lamps_is_the_renderers() {
    const COUNT: u32 = 4000;
    let lamps = [
        (Vec3::splat(0.75), true, [false, false]),
        (Vec3::splat(0.75), true, [true, false]),
        (Vec3::new(-1.5, 1.5, 1.5), true, [false, true]),
        (Vec3::new(0.5, 2.0, 1.0), false, [false, false]),
        (Vec3::splat(1.25), false, [true, false]),
        (Vec3::splat(1.25), false, [false, true]),
    ];
    for (scale, is_ball, sides) in lamps {
        let mut description = empty();
        description.materials.push(even(diffuse(GREY)).into());
        description.bounds.radius = 6.0;
        add_round_lamp(&mut description, scale, is_ball, sides);
        let scene = Scene::new(description);
        let world = FlatWorld::new(&scene, u64::MAX).unwrap();
        let mut chance = Chance::new(5);
        // All around one place, and from anywhere.
        let place = chance.direction() * 2.0;
        let around = |chance: &mut Chance| {
            let ray = beamfarm_render::math::Ray {
                origin: place,
                dir: chance.direction(),
            };
            let all = &scene.description().objects;
            let hit = scene.geometry().intersect(all, &ray, f32::INFINITY, &|_| true);
            let (distance, normal) = hit.map_or((f32::INFINITY, Vec3::Y), |hit| (hit.t, hit.ng));
            Query {
                point: place.to_array(),
                wi: ray.dir.to_array(),
                distance,
                normal: normal.to_array(),
                ..Query::zeroed()
            }
        };
        let anywhere = (0..COUNT).map(|_| query(&scene, 0, &mut chance)).collect::<Vec<_>>();
        let all: Vec<Query> = (anywhere.into_iter())
            .chain((0..10 * COUNT).map(|_| around(&mut chance)))
            .collect();
        let Some(answers) = answers(&world, &all) else {
            return;
        };
        let name = format!("{scale}, ball: {is_ball}, {sides:?}");
        let light = &scene.description().lights[0];
        let (objects, bounds) = (&*scene.description().objects, &scene.description().bounds);
        let mut lit = [0, 0];
        for (query, got) in all.iter().zip(&answers).take(COUNT as usize) {
            let own = sampled(&scene, query);
            lit[usize::from(own.is_some())] += 1;
            let what = format!("{name}: {query:?}: {got:?}, and not {own:?}");
            let place = Vec3::from(query.point);
            // A cosine at the lamp, for samples by area: rounding moves it uniformly.
            let cosine = |distance: f32, pdf: f32| match pdf > 0.0 {
                true => world.lights[0].pdf_pos * distance * distance / pdf,
                false => 0.0,
            };
            let Some(own) = own else {
                assert!(cosine(got.distance, got.pdf) < 1e-5, "{what}");
                continue;
            };
            let is_cone = is_ball && sides == [false, false] && place.distance(Vec3::new(0.5, -0.25, 1.0)) > 0.7501;
            let size = 1.0 + own.distance;
            assert!(
                (Vec3::from(got.wi) - own.wi).length() * own.distance < 2e-5 * size,
                "{what}"
            );
            let room = if is_cone { 1e-3 } else { 2e-5 };
            assert!((got.distance - own.distance).abs() < room * size, "{what}");
            assert!((Vec3::from(got.normal) - own.normal).length() < 100.0 * room, "{what}");
            match is_cone {
                true => assert!(near(got.pdf, own.pdf, 1e-4), "{what}"),
                false => {
                    let off = cosine(got.distance, got.pdf) - cosine(own.distance, own.pdf);
                    assert!(off.abs() < 1e-4, "{what}");
                }
            }
            let radiance = |weight: f32, pdf: f32| weight * pdf;
            assert!(near(radiance(got.weight[1], got.pdf), VALUE.y, 1e-5), "{what}");
        }
        assert!(lit.iter().all(|count| *count > 50) || sides[1], "{name}: {lit:?}");
        for (query, got) in all.iter().zip(&answers) {
            let (at, wi) = (query.point.into(), query.wi.into());
            let hit = LightHit {
                normal: query.normal.into(),
                primitive: query.triangle,
                distance: query.distance,
            };
            let on = LightPoint {
                normal: hit.normal,
                primitive: query.triangle,
            };
            let own = [
                light.pdf_direct(objects, at, wi, hit.distance.is_finite().then_some(hit)),
                light.photon_density(objects, bounds, at, wi, hit),
                light.emitted_density(objects, bounds, query.dir.into(), on),
            ];
            let found = [got.pdf_direct, got.photon_density, got.emitted_density];
            let same = |k: usize| near(found[k], own[k], 1e-4) || found[k].is_nan() && own[k].is_nan();
            // Photons of a light that is not met are never requested.
            let is_asked = |k: &usize| *k != 1 || query.distance.is_finite();
            assert!(
                (0..3).filter(is_asked).all(same),
                "{name}: {query:?}: {found:?}, and not {own:?}"
            );
        }
        // Where a ray meets the emitting side.
        let of = answers.iter().skip(COUNT as usize).map(|got| f64::from(got.pdf_direct));
        let n = f64::from(10 * COUNT);
        let (sum, squares) = of.fold((0.0, 0.0), |(sum, squares), x| (sum + x, squares + x * x));
        let sphere = 4.0 * std::f64::consts::PI;
        let error = (squares / n - (sum / n) * (sum / n)).sqrt() / n.sqrt();
        // A two-sided ball hides half of itself, and one that emits inwards is not seen.
        let is_hidden = is_ball && sides != [false, false];
        assert!(
            is_hidden || (sphere * (sum / n) - 1.0).abs() < 5.0 * sphere * error || sum == 0.0,
            "{name}: {sum} {error}"
        );
    }
}

/// One over the density, at its samples, has the light's solid angle as its mean; and the density integrates to one
/// over all directions. Within five standard errors: one in a million exceeds them by chance.
#[test]
fn densities_are_those_of_samples() {
    const COUNT: u32 = 30_000;
    let mut description = all_kinds();
    description.lights.truncate(0);
    description.objects.truncate(0);
    let mut chance = Chance::new(1);
    // In front of all lamps, and on the axis of a spot.
    let at = Vec3::new(1.0, 3.0, 4.0);
    let LightKind::Spot(mut ball) = spot(1.0, 2.2, Ramp::Linear, 0.5, &mut chance) else {
        panic!()
    };
    ball.position = at - ball.frame.n * 1.5;
    add_light(&mut description, "ball", LightKind::Spot(ball));
    add_light(&mut description, "sun", sun(Vec3::NEG_Y, 0.6));
    add_light(&mut description, "sky", sky(VALUE));
    add_lamps(&mut description);
    let scene = Scene::new(description);
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let lights = world.lights.len() as u32;
    let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
    let queries: Vec<Query> = (0..COUNT * lights)
        .map(|i| {
            let (u, dir) = (
                sampler.next_2d(),
                beamfarm_render::warp::uniform_sphere(sampler.next_2d()),
            );
            let mut query = Query {
                point: at.to_array(),
                light: i % lights,
                u: [u.x, u.y, sampler.next_1d()],
                wi: dir.to_array(),
                distance: f32::INFINITY,
                ..Query::zeroed()
            };
            let object = scene.description().lights[query.light as usize].kind.object();
            let ray = beamfarm_render::math::Ray { origin: at, dir };
            let others = |other: u32| Some(other) != object;
            let hit = scene
                .geometry()
                .intersect(&scene.description().objects, &ray, f32::INFINITY, &others);
            if let Some(hit) = hit {
                (query.normal, query.distance) = (hit.ng.to_array(), hit.t);
            }
            query
        })
        .collect();
    let Some(answers) = answers(&world, &queries) else {
        return;
    };
    let within = |values: &mut dyn Iterator<Item = f64>, expected: f64, place: &str| {
        let (mut sum, mut squares) = (0.0, 0.0);
        values.for_each(|x| (sum, squares) = (sum + x, squares + x * x));
        let n = f64::from(COUNT);
        let mean = sum / n;
        let error = (squares / n - mean * mean).max(0.0).sqrt() / n.sqrt();
        assert!(
            (mean - expected).abs() < 5.0 * error + 2e-6 * expected,
            "{place}: {mean} +- {error}, not {expected}"
        );
    };
    for light in 0..lights {
        let of = || {
            answers
                .iter()
                .zip(&queries)
                .filter(|(_, query)| query.light == light)
                .map(|(answer, _)| answer)
        };
        let kind = world.lights[light as usize].kind;
        let place = format!("light {light} of kind {kind}");
        let flat = &world.lights[light as usize];
        let cap = |one_minus_cos: f64| 2.0 * std::f64::consts::PI * one_minus_cos;
        let solid_angle = match kind {
            SPOT => {
                let sin2 = f64::from(ball.radius * ball.radius) / 1.5 / 1.5;
                cap(1.0 - (1.0 - sin2).sqrt())
            }
            SUN => cap(f64::from(flat.plateau)),
            ENVIRONMENT => cap(2.0),
            _ => lamp_seen(&world, flat, at),
        };
        // Light seen from its dark side is not drawn.
        let seen = &mut of().map(|answer| {
            if answer.pdf > 0.0 {
                1.0 / f64::from(answer.pdf)
            } else {
                0.0
            }
        });
        within(seen, solid_angle, &place);
        let sphere = 4.0 * std::f64::consts::PI;
        // A rough sheet hides itself.
        if [AREA, TWO_SIDED_AREA, ENVIRONMENT].contains(&kind) && flat.count < 3 {
            within(
                &mut of().map(|answer| sphere * f64::from(answer.pdf_direct)),
                1.0,
                &place,
            );
        }
    }
}

/// The solid angle of the triangles of a lamp that face a point (Van Oosterom and Strackee 1983).
fn lamp_seen(world: &FlatWorld, light: &crate::world::lights::Light, at: Vec3) -> f64 {
    let of = &world.emitters[light.first as usize..][..light.count as usize];
    let angles = of.iter().map(|emitter| {
        let [a, b, c] = [emitter.a, emitter.b, emitter.c].map(|corner| (Vec3::from(corner) - at).as_dvec3());
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let cosines = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * libm::atan2(-a.dot(b.cross(c)), cosines)
    });
    let facing = |angle: f64| {
        if light.kind == TWO_SIDED_AREA {
            angle.abs()
        } else {
            angle.max(0.0)
        }
    };
    angles.map(facing).sum()
}
