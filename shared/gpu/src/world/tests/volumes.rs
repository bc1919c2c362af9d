//! Varying densities and walks through them, against the renderer's own with the same random numbers.

use super::*;
use crate::kernels::{
    ARITHMETIC, BSDF, CAMERA, EMISSION, GROUPS, MATH, MEDIUM, Needs, PHASE, Program, SAMPLER, TEXELS, TEXTURE, VECTORS,
    VOLUMES, WALK, WARP, WIDE, WORLD,
};
use crate::sampler::Stream;
use crate::testing::{Chance, EACH, tested};
use beamfarm_render::math::{Ray, Rgb, Vec3, sin_cos};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::medium::bricks::{Bricks, Core, RawDensity};
use beamfarm_render::world::medium::transmittance::{Estimator, Step, StepFunctions};
use beamfarm_render::world::medium::{self, Flight, Heterogeneous};
use beamfarm_render::world::phase::Phase;
use glam::{DAffine3, DMat3, DVec3, IVec3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A query for a ray; answers are words.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Query {
    origin: [f32; 3],
    length: f32,
    dir: [f32; 3],
    medium: u32,
    power: [f32; 3],
    /// 0: density and albedo at the origin; 1: a flight; 2: the transmittance; 3: stored steps.
    what: u32,
}

/// Words of an answer; for steps: their number, three words, and the words of each.
const WORDS: usize = 16 + 6 * MOST;
/// Most steps.
const MOST: usize = 100;

const ANSWERS: Program = Program {
    name: "volumes",
    texts: &[
        ARITHMETIC,
        GROUPS,
        EACH,
        WIDE,
        MATH,
        SAMPLER,
        WARP,
        VECTORS,
        TEXELS,
        BSDF,
        PHASE,
        MEDIUM,
        CAMERA,
        TEXTURE,
        EMISSION,
        WORLD,
        VOLUMES,
        WALK,
        "struct Query { origin: vec3f, length: f32, dir: vec3f, medium: u32, power: vec3f, what: u32 }
        @group(0) @binding(0) var<storage, read> queries: array<Query>;
        @group(0) @binding(1) var<storage, read> stream: Stream;
        @group(0) @binding(2) var<storage, read_write> answers: array<f32>;
        const WORDS = 616u;
        fn tell(at: u32, v: vec3f) {
            answers[at] = v.x;
            answers[at + 1u] = v.y;
            answers[at + 2u] = v.z;
        }
        fn each(i: u32) {
            if (i >= arrayLength(&queries)) { return; }
            let query = queries[i];
            let at = WORDS * i;
            var s = sampler_random(stream, vec2u(i, 0u));
            if (query.what == 0u) {
                let record = volumes[query.medium];
                let p = moved_by(record + TO_SAMPLES, query.origin);
                answers[at] = density_at(record, p);
                tell(at + 1u, albedo_at(record, p));
                return;
            }
            let is_flight = query.what == 1u;
            var w = walk_begins(
                query.medium, query.origin, query.dir, query.length, is_flight, query.what == 3u, query.power, &s,
            );
            var count = 0u;
            if (w.is != NO_WALK) {
                loop {
                    let more = walk_on(&w, &s);
                    if (w.has_step && count < 100u && query.what == 3u) {
                        let to = at + 16u + 6u * count;
                        answers[to] = w.distance;
                        tell(to + 1u, w.value);
                        answers[to + 4u] = w.depth;
                        answers[to + 5u] = w.decay;
                    }
                    count += u32(w.has_step);
                    if (!more) { break; }
                }
            }
            answers[at] = f32(count);
            tell(at + 1u, select(walked_transmittance(w), w.value, is_flight));
            answers[at + 4u] = w.distance;
            answers[at + 5u] = f32(w.scattered);
            answers[at + 6u] = f32(w.is);
            answers[at + 7u] = w.range.x;
            answers[at + 8u] = w.range.y;
            answers[at + 9u] = next_1d(&s);
        }",
    ],
};

/// Clumps with empty space between them, and a constant brick.
fn clumps(size: IVec3, origin: IVec3, most: f32) -> RawDensity {
    let bricks = (size + 7) / 8;
    let mut cores = BTreeMap::new();
    for i in 0..bricks.element_product() {
        let at = IVec3::new(i % bricks.x, i / bricks.x % bricks.y, i / (bricks.x * bricks.y));
        let core = match i % 5 {
            0 => Core::Constant(0.3 * most),
            1 => continue,
            _ => Core::Samples(Box::new(std::array::from_fn(|s| {
                let s = s as i32;
                let p = (at * 8 + IVec3::new(s & 7, s >> 3 & 7, s >> 6)).as_vec3();
                let [a, b, c] = [0.7 * p.x, 0.5 * p.y + 1.0, 0.9 * p.z].map(sin_cos);
                let wave = a.0 + b.0 + c.1;
                most * (wave / 3.0).max(0.0)
            }))),
        };
        cores.insert((at + (origin >> 3i32)).to_array(), core);
    }
    let samples = [origin, origin + size - 1];
    RawDensity {
        cores,
        samples,
        domain: [samples[0].as_dvec3() - 0.5, samples[1].as_dvec3() + 0.5],
        to_object: DAffine3::from_scale(DVec3::splat(2.0 / f64::from(size.max_element()))),
    }
}

/// With all estimators, colours and albedos, some rotated and stretched; a constant one among them.
pub fn media() -> Vec<medium::Medium> {
    let turned = DAffine3::from_translation(DVec3::new(0.3, -0.2, 0.1))
        * DAffine3::from_mat3(DMat3::from_rotation_y(0.4) * DMat3::from_diagonal(DVec3::new(1.0, 1.4, 0.7)));
    let bricks = |raw: &RawDensity| Arc::new(Bricks::new(raw).unwrap());
    let small = bricks(&clumps(IVec3::new(19, 30, 12), IVec3::new(-5, 3, 16), 1.0));
    let large = bricks(&clumps(IVec3::new(40, 25, 33), IVec3::ZERO, 4.0));
    let cloud = |sigma: [[f32; 3]; 2], estimator, bricks: &Arc<Bricks>, map| {
        let phase = Phase::HenyeyGreenstein { g: 0.4 };
        Heterogeneous::new(sigma.map(Rgb::from_array), phase, estimator, bricks.clone(), map)
    };
    let grey = [[0.1; 3], [1.5; 3]];
    let coloured = [[0.0, 0.5, 0.1], [3.0, 1.0, 0.4]];
    let dense = [[0.0; 3], [40.0, 20.0, 30.0]];
    let albedo = |channels: usize| {
        let each = (0..channels as i32).map(|c| {
            let mut raw = clumps(IVec3::new(9, 14, 8), IVec3::new(-3, c, 2), 1.0);
            raw.domain = [DVec3::splat(-100.0), DVec3::splat(100.0)];
            Bricks::new(&raw).unwrap()
        });
        Arc::new(each.collect::<Vec<_>>())
    };
    let identity = DAffine3::IDENTITY;
    let residual = Estimator::ResidualRatioTracking;
    let all = [
        cloud(grey, residual, &small, identity),
        cloud(coloured, Estimator::RatioTracking, &small, turned),
        cloud(dense, residual, &large, turned),
        cloud(coloured, residual, &large, identity).with_albedo(albedo(3)),
        cloud(grey, Estimator::RatioTracking, &large, turned).with_albedo(albedo(1)),
        cloud(coloured, Estimator::FreeFlight { distances: 4 }, &large, turned),
    ];
    let mut media: Vec<medium::Medium> = all.into_iter().map(medium::Medium::Heterogeneous).collect();
    media.insert(3, medium::Medium::Homogeneous(scenes::fog(Phase::Isotropic)));
    media
}

fn answers(world: &FlatWorld, queries: &[Query]) -> Option<Vec<Vec<f32>>> {
    let tested = tested()?;
    let device = &tested.device;
    let needs = Needs {
        varies: true,
        ..Needs::ALL
    };
    let kernel = tested.kernel_for(&ANSWERS, "main", needs);
    let buffers = world.upload(device).unwrap();
    let source = device.buffer("queries", queries).unwrap();
    let stream = device.buffer("stream", &[Stream::new(9, 2, Purpose::Test)]).unwrap();
    let results = device.empty("answers", (4 * WORDS * queries.len()) as u64).unwrap();
    let mut work = device.work();
    let groups = crate::device::Groups::Count(queries.len().div_ceil(64) as u32);
    let all = [&source, &stream, &results, &buffers.media, &buffers.volumes];
    work.run(&kernel, &all, groups).unwrap();
    work.submit().unwrap();
    let words: Vec<f32> = device.read(&results, WORDS * queries.len()).unwrap();
    Some(words.chunks(WORDS).map(<[f32]>::to_vec).collect())
}

pub fn world() -> (Vec<medium::Medium>, FlatWorld) {
    let mut scene = scenes::empty();
    let media = media();
    for (i, medium) in media.iter().enumerate() {
        let id = scenes::add_medium(&mut scene, &format!("medium {i}"), medium.clone());
        let object = scenes::add(&mut scene, "", scenes::even(scenes::diffuse(scenes::GREY)));
        scene.objects[object as usize].boundary = Some(Boundary {
            interior: id,
            exterior: None,
        });
    }
    (media, FlatWorld::new(&Scene::new(scene), u64::MAX).unwrap())
}

/// Rays around the clumps, many through them, some along axes; of any length.
fn queries(media: &[medium::Medium], what: u32, count: usize) -> Vec<Query> {
    let mut chance = Chance::new(u64::from(what));
    let varying: Vec<u32> = (0..)
        .zip(media)
        .filter(|(_, m)| matches!(m, medium::Medium::Heterogeneous(_)))
        .map(|(i, _)| i)
        .collect();
    (0..count)
        .map(|_| {
            let inside = Vec3::new(chance.unit(), chance.unit(), chance.unit()) * 2.0 - 0.3;
            let dir = chance.direction();
            let back = chance.of(&[0.0, 0.0, 0.7, 4.0]);
            Query {
                origin: (inside - dir * back).to_array(),
                length: chance.of(&[f32::INFINITY, 10.0, 0.5, 1e-3]),
                dir: dir.to_array(),
                medium: chance.of(&varying),
                power: [1.0, chance.of(&[0.0, 0.5]), chance.of(&[0.1, 2.0])],
                what,
            }
        })
        .collect()
}

fn of(media: &[medium::Medium], query: &Query) -> (Heterogeneous, Ray) {
    let medium::Medium::Heterogeneous(medium) = &media[query.medium as usize] else {
        panic!("none that is even is asked")
    };
    let ray = Ray {
        origin: query.origin.into(),
        dir: query.dir.into(),
    };
    (medium.clone(), ray)
}

/// The same bits.
#[test]
fn densities_are_the_renderers() {
    let (media, world) = world();
    let queries = queries(&media, 0, 20_000);
    let Some(got) = answers(&world, &queries) else { return };
    let (mut empty, mut full) = (0, 0);
    for (query, got) in queries.iter().zip(&got) {
        let (medium, ray) = of(&media, query);
        let density = medium.density(ray.origin);
        let p = medium.to_samples().transform_point3(ray.origin).to_array().map(|x| [x]);
        let albedo = medium.albedo().map_or([1.0; 3], |albedo| albedo.at(&p).map(|[x]| x));
        assert_eq!(got[0].to_bits(), density.to_bits(), "{query:?}");
        assert_eq!(
            [got[1], got[2], got[3]].map(f32::to_bits),
            albedo.map(f32::to_bits),
            "{query:?}"
        );
        match density == 0.0 {
            true => empty += 1,
            false => full += 1,
        }
    }
    assert!(empty > 1000 && full > 1000, "{empty} {full}");
}

/// How far a walk's results are from the renderer's. Distances of events are rounded to single precision here, which
/// sometimes moves one to another span or changes the event.
fn near(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-4 * (1e-2 + a.abs().max(b.abs())) || a == b
}

/// Asserts that all but a few agree.
fn most_agree(what: &str, agree: impl Iterator<Item = (bool, String)>) {
    let all: Vec<(bool, String)> = agree.collect();
    let other: Vec<&String> = all.iter().filter(|(is, _)| !is).map(|(_, text)| text).collect();
    println!("{what}: {} of {} are others", other.len(), all.len());
    for text in other.iter().take(3) {
        println!("  {text}");
    }
    assert!(
        other.len() <= all.len() / 200,
        "{what}: {} of {}",
        other.len(),
        all.len()
    );
}

#[test]
fn flights_end_where_the_renderers_do() {
    let (media, world) = world();
    let queries = queries(&media, 1, 20_000);
    let Some(got) = answers(&world, &queries) else { return };
    let mut counts = [0; 3];
    let agree = (0_u64..).zip(queries.iter().zip(&got)).map(|(i, (query, got))| {
        let (medium, ray) = of(&media, query);
        let mut sampler = Sampler::new(9, 2, Purpose::Test, i);
        let flight = match medium.track(&ray, query.length) {
            Some(track) => medium.sample_flight(&track, query.power.into(), &mut sampler),
            None => {
                counts[2] += 1;
                Flight::Passed { weight: Rgb::ONE }
            }
        };
        let (scattered, distance, weight) = match flight {
            Flight::Scattered { distance, weight } => (true, distance, weight),
            Flight::Passed { weight } => (false, got[4], weight),
        };
        counts[usize::from(scattered)] += 1;
        let agrees = (got[5] == 1.0) == scattered
            && near(got[4], distance)
            && (0..3).all(|c| near(got[1 + c], weight[c]))
            && got[9] == sampler.next_1d();
        (agrees, format!("{query:?}: {:?}, not {flight:?}", &got[..10]))
    });
    let agree: Vec<_> = agree.collect();
    most_agree("flights", agree.into_iter());
    assert!(counts.iter().all(|count| *count > 2000), "{counts:?}");
}

#[test]
fn transmittance_is_estimated_as_the_renderer_does() {
    let (media, world) = world();
    let queries: Vec<Query> = (queries(&media, 2, 20_000).into_iter())
        .filter(|query| query.medium != 6)
        .collect();
    let Some(got) = answers(&world, &queries) else { return };
    let mut seen = 0;
    let agree = (0_u64..).zip(queries.iter().zip(&got)).map(|(i, (query, got))| {
        let (medium, ray) = of(&media, query);
        let mut sampler = Sampler::new(9, 2, Purpose::Test, i);
        let tr = medium.transmittance(&ray, query.length, &mut sampler);
        seen += u32::from(tr != Rgb::ONE && tr != Rgb::ZERO);
        let agrees = (0..3).all(|c| near(got[1 + c], tr[c])) && got[9] == sampler.next_1d();
        (agrees, format!("{query:?}: {:?}, not {tr}", &got[..10]))
    });
    let agree: Vec<_> = agree.collect();
    most_agree("transmittance", agree.into_iter());
    assert!(seen > 2000, "{seen}");
}

#[test]
fn functions_of_the_distance_are_the_renderers() {
    let (media, world) = world();
    let queries: Vec<Query> = (queries(&media, 3, 5_000).into_iter())
        .filter(|query| query.medium != 6)
        .collect();
    let Some(got) = answers(&world, &queries) else { return };
    let (mut steps, mut none) = (0, 0);
    let agree = (0_u64..).zip(queries.iter().zip(&got)).map(|(i, (query, got))| {
        let (medium, ray) = of(&media, query);
        let mut sampler = Sampler::new(9, 2, Purpose::Test, i);
        let Some(track) = medium.track(&ray, query.length) else {
            none += 1;
            return (got[6] == 0.0, format!("{query:?} is not met"));
        };
        let mut functions = StepFunctions::default();
        let number = medium.walk(&track, &mut sampler, &mut functions);
        let function = functions.get(number);
        let own: Vec<(f32, Step)> = (0..).map_while(|n| function.step(n)).collect();
        steps += own.len();
        let same = |(n, (distance, step)): (usize, &(f32, Step))| {
            let words = &got[16 + 6 * n..][..6];
            near(words[0], *distance)
                && (0..3).all(|c| near(words[1 + c], step.value[c]))
                && near(words[4], step.depth)
                && near(words[5], step.decay)
        };
        let agrees = got[0] as usize == own.len()
            && own.iter().take(MOST).enumerate().all(same)
            && [got[7], got[8]] == track.range
            && got[9] == sampler.next_1d();
        (
            agrees,
            format!("{query:?}: {:?}, not {:?}", &got[..40], &own[..own.len().min(4)]),
        )
    });
    let agree: Vec<_> = agree.collect();
    most_agree("functions", agree.into_iter());
    assert!(steps > 5000 && none > 200, "{steps} {none}");
}
