//! Single scattering in a medium, on a segment of a ray.

use super::shadow::ball;
use super::*;
use crate::kernels::{RAYS, SEGMENT, SHADOW, SURFACE, VOLUMES, WALK};
use crate::testing::results;
use crate::world::tests::scenes::{GREY, add_medium, add_object, diffuse, even};
use beamfarm_render::cpu::beam::estimate::CameraSegments;
use beamfarm_render::cpu::transport::{CameraTracer, PathContext};
use beamfarm_render::math::{self, Ray};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::aov::Recorder;
use beamfarm_render::plan::weights::Weights;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::geometry::Boundary;
use beamfarm_render::world::light::FogSegment;
use beamfarm_render::world::mask::Unruled;
use beamfarm_render::world::medium::{Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;

const FUNCTIONS: Program = Program {
    name: "functions",
    texts: &[
        ARITHMETIC,
        GROUPS,
        EACH,
        WIDE,
        MATH,
        "@group(0) @binding(0) var<storage, read> numbers: array<f32>;
        @group(0) @binding(1) var<storage, read_write> results: array<vec2f>;
        fn each(i: u32) {
            if (i >= arrayLength(&numbers)) { return; }
            let x = numbers[i];
            var y = x;
            if (y > 1.0) { y = 1.0; }
            results[i] = vec2f(one_minus_exp_neg(x), ln_of_one_minus(y));
        }",
    ],
};

#[test]
fn depths_have_the_renderers_bits() {
    let Some(tested) = tested() else { return };
    let edges = [
        0.0,
        1e-45,
        1e-38,
        f32::MIN_POSITIVE,
        1.0,
        88.0,
        200.0,
        f32::MAX,
        f32::INFINITY,
        f32::NAN,
    ];
    let patterns = (0..1u32 << 17).map(|i| f32::from_bits(i.wrapping_mul(0x9e37_79b9) >> 1));
    let even = (0..1u32 << 16).map(|i| i as f32 * 3e-4);
    let below_one = (0..1u32 << 16).map(|i| i as f32 / 65_536.0);
    let numbers: Vec<f32> = edges.into_iter().chain(patterns).chain(even).chain(below_one).collect();
    let got: Vec<[f32; 2]> = results(tested, &FUNCTIONS, &numbers, numbers.len(), numbers.len());
    for (x, got) in numbers.iter().zip(&got) {
        let expected = [math::one_minus_exp_neg(*x), math::ln_1p(-x.min(1.0))];
        let is_same = (0..2).all(|k| got[k].to_bits() == expected[k].to_bits() || got[k].is_nan());
        assert!(
            is_same && (x.is_nan() || !got[0].is_nan()),
            "{x:e}: {got:?}, not {expected:?}"
        );
    }
}

/// A query for both kernels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Query {
    pub origin: [f32; 3],
    pub length: f32,
    pub dir: [f32; 3],
    pub medium: u32,
    /// Negative: a shadow ray is requested.
    pub u_light: f32,
    pub u: f32,
    /// Position and light for a density, or the target of a shadow ray.
    pub t: f32,
    pub light: u32,
}

const QUERY: &str = "struct Query {
    origin: vec3f, length: f32, dir: vec3f, medium: u32, u_light: f32, u: f32, t: f32, light: u32,
}
@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read> stream: Stream;
";

const SEGMENTS: Program = lit!(
    "segments",
    RAYS,
    SURFACE,
    VOLUMES,
    WALK,
    SHADOW,
    SEGMENT,
    QUERY,
    "struct Answer {
        start: vec3f, light: u32, t: f32, pdf: f32, distance2: f32, radius2: f32, pdf_there: f32, next: f32,
    }
    @group(0) @binding(2) var<storage, read_write> answers: array<Answer>;
    fn each(i: u32) {
        if (i >= arrayLength(&queries)) { return; }
        let query = queries[i];
        let m = media[query.medium];
        let segment = FogSegment(
            Ray(query.origin, query.dir), query.length, scattering_sigma_t(m), m.phase, m.g, query.medium,
        );
        var s = sampler_even(stream, vec2u(i, 0u));
        let sample = sample_segment(segment, query.u_light, query.u, &s);
        var pdf = 0.0;
        if (query.light < lighting.lights) {
            let view = view_of_segment(light_sources[query.light], segment);
            pdf = pdf_in_segment(view, segment.sigma_t, query.t) * sample.pmf;
        }
        answers[i] = Answer(
            sample.start, select(NONE, sample.light, sample.pdf > 0.0), sample.t, sample.pdf, sample.distance2,
            sample.radius2, pdf, next_1d(&s),
        );
    }"
);

pub const SCATTERED: Program = lit!(
    "scattered",
    RAYS,
    SURFACE,
    VOLUMES,
    WALK,
    SHADOW,
    SEGMENT,
    QUERY,
    "@group(0) @binding(2) var<storage, read_write> answers: array<vec4f>;
    fn each(i: u32) {
        if (i >= arrayLength(&queries)) { return; }
        let query = queries[i];
        var s = sampler_even(stream, vec2u(i, 0u));
        let ray = Ray(query.origin, query.dir);
        let beta = vec3f(0.5, 1.0, 2.0);
        // What `single_scattering` does, or `unoccluded`: in one walk, since that is what compilers take long for.
        let is_shadow = query.u_light < 0.0;
        var found: ScatteredRay;
        if (is_shadow) {
            found.ray = ray;
            found.distance = query.t;
            found.light = query.light;
        } else {
            found = scattered_ray(ray, query.length, query.medium, beta, &s);
        }
        var radiance = vec3f(0.0);
        if (!found.is_dark) {
            let across = no_surface(found.ray);
            let arrived = walk_straight(
                found.ray, found.distance, query.medium, across, found.light, 0u, !found.by_phase, &s,
            );
            if (is_shadow) { radiance = arrived.transmittance; } else { radiance = scattered_light(found, arrived); }
        }
        answers[i] = vec4f(radiance, next_1d(&s));
    }"
);

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Answer {
    start: [f32; 3],
    light: u32,
    t: f32,
    pdf: f32,
    distance2: f32,
    radius2: f32,
    pdf_there: f32,
    next: f32,
    padding: [u32; 2],
}

const STREAM: (u64, u64) = (21, 5);
const BETA: Rgb = Rgb::new(0.5, 1.0, 2.0);

fn media() -> [Homogeneous; 4] {
    let of = |sigma_a, sigma_s, g| Homogeneous {
        sigma_a,
        sigma_s,
        phase: match g {
            0.0 => Phase::Isotropic,
            g => Phase::HenyeyGreenstein { g },
        },
    };
    [
        of(Rgb::splat(0.05), Rgb::splat(0.1), 0.0),
        of(Rgb::new(0.1, 0.5, 2.0), Rgb::new(0.2, 0.5, 0.0), 0.8),
        of(Rgb::ZERO, Rgb::splat(1e-4), -0.7),
        of(Rgb::splat(1.0), Rgb::new(3.0, 2.0, 4.0), 0.3),
    ]
}

/// The lights in a ball of fog, with balls of other media next to them and an object among them.
fn in_fog(mut scene: SceneDescription) -> SceneDescription {
    scene.materials.clear();
    scene.materials.push(even(diffuse(GREY)).into());
    scene.materials.push(even(MaterialKind::Null).into());
    scene.bounds.radius = 9.0;
    let ids = media().map(|m| add_medium(&mut scene, "fog", Medium::Homogeneous(m)));
    let mut add_ball = |middle: Vec3, radius: f32, interior, exterior| {
        let object = add_object(&mut scene, ball(middle, radius), 1) as usize;
        scene.objects[object].boundary = Some(Boundary { interior, exterior });
    };
    // Distant light is extinguished in an infinite medium.
    add_ball(Vec3::ZERO, 8.0, ids[0], None);
    for (inside, middle) in ids[1..].iter().zip([Vec3::Y * 5.0, Vec3::Z * 5.0, Vec3::Z * -5.0]) {
        add_ball(middle, 1.5, *inside, ids[0]);
    }
    add_object(&mut scene, ball(Vec3::new(0.3, 0.4, 0.1), 0.4), 0);
    scene
}

/// All lights together, each alone, and more than are weighed.
fn scenes() -> Vec<(String, Scene)> {
    let all = all_kinds();
    let pictures = pictures();
    let mut scenes = vec![
        ("all".to_owned(), all.clone()),
        ("pictures".to_owned(), pictures.clone()),
        ("many".to_owned(), bulbs(33)),
    ];
    let each = |all: SceneDescription| all.lights.clone().into_iter().map(move |light| (all.clone(), light));
    for (number, (all, light)) in each(all).chain(each(pictures)).enumerate() {
        let mut one = all.clone();
        let object = light.kind.object().map(|object| object as usize);
        one.lights = vec![light];
        one.objects = object.map(|object| one.objects[object].clone()).into_iter().collect();
        if let LightKind::Area { object, .. } = &mut one.lights[0].kind {
            *object = 0;
            one.objects[0].light = Some(0);
        }
        scenes.push((format!("light {number}"), one));
    }
    let scenes = scenes.into_iter();
    scenes.map(|(name, scene)| (name, Scene::new(in_fog(scene)))).collect()
}

/// Half of them pass through the middle of a spot's cone.
fn queries(scene: &Scene, count: u32, chance: &mut Chance) -> Vec<Query> {
    let query = |i: u32| {
        let origin = chance.direction() * (5.0 * chance.unit());
        let dir = match &chance.of(&scene.description().lights.iter().collect::<Vec<_>>()).kind {
            LightKind::Spot(spot) if i.is_multiple_of(2) => {
                let lit = spot.position + spot.frame.n * (0.2 + 3.0 * chance.unit());
                (lit - origin).normalize()
            }
            _ => chance.direction(),
        };
        Query {
            origin: origin.to_array(),
            length: chance.of(&[0.1, 1.0, 5.0, 20.0]) * (1.0 - 0.9 * chance.unit()),
            dir: dir.to_array(),
            medium: i / 2 % 4,
            u_light: chance.unit(),
            u: chance.unit(),
            t: 0.0,
            light: NONE,
        }
    };
    (0..count).map(query).collect()
}

fn fog_segment(query: &Query) -> FogSegment {
    let medium = media()[query.medium as usize];
    FogSegment {
        ray: Ray {
            origin: query.origin.into(),
            dir: query.dir.into(),
        },
        length: query.length,
        sigma_t: medium.scattering_sigma_t(),
        phase: medium.phase,
        g: medium.phase.mean_cosine(),
    }
}

pub fn run<T: Pod>(kernel: &crate::device::Kernel, scene: &Scene, queries: &[Query], has_rays: bool) -> Vec<T> {
    let device = &tested().unwrap().device;
    let world = FlatWorld::new(scene, u64::MAX).unwrap();
    let buffers = world.upload(device).unwrap();
    let streams = [Stream::new(STREAM.0, STREAM.1, Purpose::Test)];
    let input = device.buffer("queries", queries).unwrap();
    let stream = device.buffer("stream", &streams).unwrap();
    let output = device
        .empty("answers", (size_of::<T>() * queries.len()) as u64)
        .unwrap();
    let mut given = vec![&input, &stream, &output];
    let choices = &buffers.choices;
    if has_rays {
        given.extend(buffers.geometry.in_order());
        given.extend([
            &buffers.surfaces,
            &buffers.materials,
            &buffers.lights,
            &buffers.emitters,
            &buffers.media,
        ]);
        given.extend([&choices.sources, &choices.tables, &choices.lighting]);
        given.extend(buffers.shapes.in_order());
        given.extend(buffers.textures.in_order());
    } else {
        given.extend([
            &buffers.lights,
            &buffers.media,
            &choices.sources,
            &choices.tables,
            &choices.lighting,
        ]);
    }
    let mut work = device.work();
    let groups = Groups::Count(queries.len().div_ceil(64) as u32);
    work.run(kernel, &given, groups).unwrap();
    work.submit().unwrap();
    device.read(&output, queries.len()).unwrap()
}

#[test]
fn points_on_segments_are_the_renderers() {
    let Some(tested) = tested() else { return };
    let kernel = tested.kernel(&SEGMENTS, "main");
    let mut chance = Chance::new(6);
    let (mut lit, mut off) = (0, 0);
    for (name, scene) in scenes() {
        let mut queries = queries(&scene, 1000, &mut chance);
        let own: Vec<_> = (0..)
            .zip(&mut queries)
            .map(|(i, query)| {
                let mut sampler = Sampler::even(STREAM.0, STREAM.1, Purpose::Test, i);
                let start = |light: usize| match &scene.description().lights[light].kind {
                    LightKind::Spot(spot) if spot.radius > 0.0 => {
                        let place = sampler.next_2d();
                        Some(spot.start(place, sampler.next_1d()))
                    }
                    _ => None,
                };
                let (selector, segment) = (&scene.selectors().all, fog_segment(query));
                let sources = scene.light_sources();
                let sample = sources.sample(&segment, selector, query.u_light, query.u, |_| false, start);
                if let Some(sample) = &sample {
                    (query.t, query.light) = (sample.t, sample.light as u32);
                }
                (sample, sampler.next_1d())
            })
            .collect();
        let got: Vec<Answer> = run(&kernel, &scene, &queries, false);
        for ((query, got), (own, next)) in queries.iter().zip(&got).zip(&own) {
            let place = format!("{name} {query:?}: {got:?}, not {own:?}");
            assert_eq!(got.next, *next, "{place}");
            let Some(own) = own else {
                assert_eq!(got.light, NONE, "{place}");
                continue;
            };
            lit += 1;
            // Starting points on a ball are drawn with sines.
            if let Some(start) = own.start {
                assert!((Vec3::from(got.start) - start).abs().max_element() < 3e-4, "{place}");
                off += usize::from((got.t - own.t).abs() > 1e-2 * query.length);
                continue;
            }
            assert_eq!(got.light, own.light as u32, "{place}");
            assert_eq!(
                (got.pdf_there.to_bits(), got.radius2.to_bits()),
                (own.pdf.to_bits(), own.radius2.to_bits()),
                "{place}"
            );
            if own.distance2.is_infinite() {
                assert_eq!(
                    (got.t.to_bits(), got.pdf.to_bits()),
                    (own.t.to_bits(), own.pdf.to_bits()),
                    "{place}"
                );
                assert_eq!(got.distance2, own.distance2, "{place}");
            } else {
                off += usize::from((got.t - own.t).abs() > 1e-4 * query.length);
            }
        }
    }
    assert!(lit > 8000, "{lit}");
    // Near the tangent of a right angle.
    assert!(off * 200 < lit, "{off} of {lit}");
}

/// The renderer's result with the same numbers.
fn scattered(scene: &Scene, queries: &[Query]) -> Vec<(Rgb, f32)> {
    let plan = RenderPlan::provisional(scene, scene.description().defaults.job_settings());
    let tracer = CameraTracer {
        scene,
        plan: &plan,
        photons: None,
        weights: Weights::new(scene, &plan, 0),
        waves: None,
        mask: Unruled,
    };
    let media = media();
    let mut segments = CameraSegments::default();
    (0..)
        .zip(queries)
        .map(|(i, query)| {
            let sampler = Sampler::even(STREAM.0, STREAM.1, Purpose::Test, i);
            let mut context = PathContext::new(sampler, 0, &mut segments, Recorder::new(&plan.layers, None));
            let number = query.medium as u16;
            let ray = fog_segment(query).ray;
            let medium = (number, &media[usize::from(number)]);
            let radiance = tracer.single_scattering(&ray, query.length, medium, BETA, &mut context);
            (radiance, context.sampler.next_1d())
        })
        .collect()
}

#[test]
fn light_that_is_scattered_once_is_the_renderers() {
    let Some(tested) = tested() else { return };
    let mut chance = Chance::new(7);
    for (name, scene) in scenes() {
        let geometry = FlatWorld::new(&scene, u64::MAX)
            .unwrap()
            .upload(&tested.device)
            .unwrap()
            .geometry;
        let kernel = geometry.kernel(tested, &SCATTERED, "main");
        let queries = queries(&scene, 600, &mut chance);
        let got: Vec<[f32; 4]> = run(&kernel, &scene, &queries, true);
        let own = scattered(&scene, &queries);
        let is_parallel =
            |light: &light::Light| matches!(&light.kind, LightKind::Directional(sun) if sun.is_parallel());
        let exact = scene.description().lights.iter().all(is_parallel);
        let (mut lit, mut off) = (0, 0);
        for ((query, got), (own, next)) in queries.iter().zip(&got).zip(&own) {
            let radiance = Rgb::new(got[0], got[1], got[2]);
            let place = format!("{name} {query:?}: {radiance}, not {own}");
            assert_eq!(got[3], *next, "{place}");
            lit += usize::from(*own != Rgb::ZERO);
            if exact {
                assert_eq!(
                    radiance.to_array().map(f32::to_bits),
                    own.to_array().map(f32::to_bits),
                    "{place}"
                );
            } else {
                off += usize::from((radiance - *own).abs().max_element() > 1e-3 * own.max_element());
            }
        }
        assert!(lit > 20 && off * 50 <= lit, "{name}: {lit} lit, {off} off");
    }
}

/// The mean of many samples of a point light is an integral over the segment, computed without random numbers: within
/// five standard errors.
#[test]
fn light_of_a_point_is_all_there() {
    const COUNT: u32 = 20_000;
    let Some(tested) = tested() else { return };
    let mut description = empty();
    let position = Vec3::new(1.0, 2.0, 0.5);
    add_light(&mut description, "bulb", point_light(position));
    let medium = media()[1];
    let ids = media().map(|m| add_medium(&mut description, "fog", Medium::Homogeneous(m)));
    description.world_medium = ids[1];
    let scene = Scene::new(description);
    let ray = Ray {
        origin: Vec3::new(-1.0, 1.0, 0.0),
        dir: Vec3::new(1.0, 0.3, 0.2).normalize(),
    };
    let query = Query {
        origin: ray.origin.to_array(),
        length: 4.0,
        dir: ray.dir.to_array(),
        medium: 1,
        ..Query::zeroed()
    };
    let world = FlatWorld::new(&scene, u64::MAX)
        .unwrap()
        .upload(&tested.device)
        .unwrap();
    let kernel = world.geometry.kernel(tested, &SCATTERED, "main");
    let got: Vec<[f32; 4]> = run(&kernel, &scene, &vec![query; COUNT as usize], true);
    let (g, length) = (0.8f64, 4.0f64);
    for channel in 0..2 {
        let values = || got.iter().map(|answer| f64::from(answer[channel]));
        let n = f64::from(COUNT);
        let mean = values().sum::<f64>() / n;
        let error = (values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n / n).sqrt();
        let [sigma_t, sigma_s] = [medium.sigma_t(), medium.sigma_s].map(|c| f64::from(c[channel]));
        let at = |t: f64| {
            let way = position.as_dvec3() - ray.origin.as_dvec3() - ray.dir.as_dvec3() * t;
            let d = way.length();
            let cosine = way.dot(ray.dir.as_dvec3()) / d;
            let x = 1.0 + g * g - 2.0 * g * cosine;
            let phase = (1.0 - g * g) / (4.0 * std::f64::consts::PI * x * x.sqrt());
            sigma_s * libm::exp(-sigma_t * (t + d)) * phase / (d * d)
        };
        let steps = 10_000;
        let integral: f64 = (0..steps)
            .map(|i| at((f64::from(i) + 0.5) * length / f64::from(steps)))
            .sum();
        let expected = integral * length / f64::from(steps) * f64::from(VALUE[channel] * BETA[channel]);
        assert!(
            (mean - expected).abs() < 5.0 * error,
            "{mean} +- {error}, not {expected}"
        );
        // Tight enough to reveal any wrong factor.
        assert!(error < 0.01 * expected, "{mean} +- {error}");
    }
}
