//! Image-based lights: skies, projectors, and lamps of varying radiance.

use super::direct::{Query, answers, query, sampled};
use super::*;
use crate::world::lights::{self, AREA, ENVIRONMENT_MAP, PROJECTOR, TWO_SIDED_AREA};
use beamfarm_render::math::{PI, Vec2};
use beamfarm_render::world::light::{EmissionUniforms, LightHit, LightPoint};

const STARTS: Program = lit!(
    "starts of pictures",
    "@group(0) @binding(0) var<storage, read> numbers: array<array<f32, 5>>;
    @group(0) @binding(1) var<storage, read_write> starts: array<Emission>;
    fn each(i: u32) {
        if (i >= arrayLength(&numbers)) { return; }
        let u = numbers[i];
        let uniforms = EmissionUniforms(vec2f(u[0], u[1]), vec2f(u[2], u[3]), u[4]);
        starts[i] = emit(lights[i % lighting.lights], uniforms);
    }"
);

/// As the kernel writes it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Start {
    origin: [f32; 3],
    pdf_dir: f32,
    dir: [f32; 3],
    pdf_pos: f32,
    power: [f32; 3],
    triangle: u32,
    normal: [f32; 3],
    padding: f32,
}

fn near(a: Vec3, b: Vec3, room: f32) -> bool {
    (a - b).abs().max_element() <= room
}

fn bits(v: Vec3) -> [u32; 3] {
    v.to_array().map(f32::to_bits)
}

/// Whether the draws use no sine: all except directions.
fn is_exact(light: &lights::Light) -> bool {
    light.kind != ENVIRONMENT_MAP && light.radius == 0.0
}

/// Whether a number is at the edge of an image, where rounding decides.
fn is_at_seam(u: [f32; 2]) -> bool {
    u.iter().any(|u| !(1e-3..0.999).contains(u))
}

/// Share of values that may differ because rounding of sines moves a place over the edge of a pixel.
const OFF: f64 = 2e-3;

/// Without a sine, flux and densities are identical; places, directions and image values agree up to rounding.
#[test]
fn photons_of_pictures_are_the_renderers() {
    let Some(tested) = tested() else { return };
    let device = &tested.device;
    let scene = Scene::new(pictures());
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let buffers = world.upload(device).unwrap();
    let count = world.lights.len();
    let mut chance = Chance::new(10);
    let numbers: Vec<[f32; 5]> = (0..4000 * count)
        .map(|_| std::array::from_fn(|_| chance.unit()))
        .collect();
    let output = device
        .empty("starts", (size_of::<Start>() * numbers.len()) as u64)
        .unwrap();
    let given = [
        &device.buffer("numbers", &numbers).unwrap(),
        &output,
        &buffers.lights,
        &buffers.emitters,
        &buffers.choices.tables,
        &buffers.choices.lighting,
        &buffers.textures.textures,
        &buffers.textures.texels,
    ];
    let mut work = device.work();
    let groups = Groups::Count(numbers.len().div_ceil(64) as u32);
    work.run(&tested.kernel(&STARTS, "main"), &given, groups).unwrap();
    work.submit().unwrap();
    let got = device.read::<Start>(&output, numbers.len()).unwrap();
    let description = scene.description();
    let (objects, bounds) = (&*description.objects, &description.bounds);
    let mut off = 0;
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); count];
    for (i, (u, got)) in numbers.iter().zip(&got).enumerate() {
        let uniforms = EmissionUniforms {
            position: Vec2::new(u[0], u[1]),
            direction: Vec2::new(u[2], u[3]),
            primitive: u[4],
        };
        let number = i % count;
        let flat = &world.lights[number];
        let own = description.lights[number].sample_emission(objects, bounds, uniforms);
        let what = format!("light {number} {u:?}: {got:?}, and not {own:?}");
        let size = 1.0 + own.origin.length();
        assert!(near(got.origin.into(), own.origin, 2e-6 * size), "{what}");
        assert!(near(got.dir.into(), own.dir, 1e-6), "{what}");
        assert!(near(got.normal.into(), own.normal.unwrap_or_default(), 1e-6), "{what}");
        assert_eq!(got.triangle, own.primitive, "{what}");
        let is_same_place = match is_exact(flat) || own.normal.is_none() {
            true => got.pdf_pos == own.pdf_pos,
            false => (got.pdf_pos / own.pdf_pos - 1.0).abs() < 1e-6,
        };
        assert!(is_same_place, "{what}");
        let is_same_pdf = match flat.kind == ENVIRONMENT_MAP || own.normal.is_none() {
            true => got.pdf_dir == own.pdf_dir,
            false => (got.pdf_dir - own.pdf_dir).abs() < 1e-6,
        };
        assert!(is_same_pdf, "{what}");
        match is_exact(flat) {
            true => assert_eq!(bits(got.power.into()), bits(own.power), "{what}"),
            // Pixels of an image differ by less than its brightest.
            false => {
                let room =
                    1e-4 * (own.power.max_element() + description.lights[number].power(objects, bounds).length());
                off += u64::from(
                    !near(got.power.into(), own.power, room) && !is_at_seam([u[0], u[1]]) && !is_at_seam([u[2], u[3]]),
                );
            }
        }
        let power = Vec3::from(got.power);
        sums[number].0 += power;
        sums[number].1 += power * power;
    }
    assert!(off as f64 <= OFF * numbers.len() as f64, "{off}");
    // Extreme numbers are frequent, so means deviate from the emission, but not by much.
    for (number, (sum, _)) in sums.iter().enumerate() {
        let mean = *sum / 4000.0;
        let power = description.lights[number].power(objects, bounds);
        let ratio = mean.y / power.y;
        assert!((0.3..3.0).contains(&ratio), "light {number}: {mean} {power}");
    }
}

/// Light that reaches points, and its density.
#[test]
fn light_of_pictures_at_a_point_is_the_renderers() {
    let scene = Scene::new(pictures());
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let count = world.lights.len() as u32;
    let mut chance = Chance::new(4);
    let queries: Vec<Query> = (0..2000 * count)
        .map(|i| query(&scene, i % count, &mut chance))
        .collect();
    let Some(answers) = answers(&world, &queries) else {
        return;
    };
    let description = scene.description();
    let (objects, bounds) = (&*description.objects, &description.bounds);
    let (mut off, mut lit) = (0, vec![[0; 2]; count as usize]);
    for (query, got) in queries.iter().zip(&answers) {
        let flat = &world.lights[query.light as usize];
        let light = &description.lights[query.light as usize];
        let own = sampled(&scene, query);
        let what = format!("{} {query:?}: {got:?}, and not {own:?}", flat.kind);
        lit[query.light as usize][usize::from(own.is_some())] += 1;
        match own {
            None if is_exact(flat) => assert_eq!(got.pdf, 0.0, "{what}"),
            // From the side, or by rounding.
            None => off += u64::from(got.pdf > 0.0),
            Some(_) if got.pdf == 0.0 && !is_exact(flat) => off += 1,
            Some(own) => {
                assert_eq!((got.triangle, got.unmet == 1), (own.primitive, own.unmet), "{what}");
                let (wi, weight) = (Vec3::from(got.wi), Vec3::from(got.weight));
                let exact = wi == own.wi && (got.pdf, got.distance) == (own.pdf, own.distance);
                if is_exact(flat) {
                    assert!(exact && Vec3::from(got.normal) == own.normal, "{what}");
                    assert_eq!(bits(weight), bits(own.weight), "{what}");
                } else {
                    let is_map = flat.kind == ENVIRONMENT_MAP;
                    assert!(!is_map || got.pdf == own.pdf, "{what}");
                    let near_it = near(wi, own.wi, 1e-4)
                        && (is_map || (got.distance - own.distance).abs() < 1e-3 * (1.0 + own.distance))
                        && (got.pdf - own.pdf).abs() <= 0.02 * own.pdf;
                    let brightest = 20.0 * VALUE;
                    let same = near(weight * got.pdf / brightest, own.weight * own.pdf / brightest, 1e-4);
                    off += u64::from((!near_it || !same) && !is_at_seam([query.u[0], query.u[1]]));
                }
            }
        }
        let (at, wi, dir) = (query.point.into(), query.wi.into(), query.dir.into());
        let (normal, primitive, distance) = (query.normal.into(), query.triangle, query.distance);
        let hit = LightHit {
            normal,
            primitive,
            distance,
        };
        let own = [
            light.pdf_direct(objects, at, wi, distance.is_finite().then_some(hit)),
            light.photon_density(objects, bounds, at, wi, hit),
            light.emitted_density(objects, bounds, dir, LightPoint { normal, primitive }),
        ];
        let densities = [got.pdf_direct, got.photon_density, got.emitted_density];
        let same = |k: usize| match flat.radius > 0.0 && flat.kind != ENVIRONMENT_MAP {
            true => (densities[k] - own[k]).abs() <= 1e-4 * own[k].abs(),
            false => densities[k].to_bits() == own[k].to_bits(),
        };
        let both_nan = |k: usize| densities[k].is_nan() && own[k].is_nan();
        // Photons of a lamp that is not met are never requested.
        let is_asked = |k: &usize| *k != 1 || own[0] > 0.0 || ![AREA, TWO_SIDED_AREA].contains(&flat.kind);
        assert!(
            (0..3).filter(is_asked).all(|k| same(k) || both_nan(k)),
            "{what}: {densities:?}, and not {own:?}"
        );
    }
    assert!(off as f64 <= OFF * queries.len() as f64, "{off} of {}", queries.len());
    for (light, [dark, bright]) in lit.iter().enumerate() {
        let is_dark_somewhere = world.lights[light].kind == PROJECTOR;
        assert!(
            *bright > 200 && (*dark > 50 || !is_dark_somewhere),
            "light {light}: {dark} {bright}"
        );
    }
}

/// A sky's density integrates to one, and one over it at its samples has all directions as its mean; the mean sample is
/// the radiance of the whole sky. Within five standard errors.
#[test]
fn skies_are_drawn_by_their_density() {
    const COUNT: u32 = 100_000;
    let mut description = pictures();
    description.lights.truncate(1);
    description.objects.clear();
    let scene = Scene::new(description);
    let LightKind::Environment(sky) = &scene.description().lights[0].kind else {
        panic!("it is no sky")
    };
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
    let query = |_| {
        let u = sampler.next_2d();
        Query {
            u: [u.x, u.y, 0.0],
            wi: beamfarm_render::warp::uniform_sphere(sampler.next_2d()).to_array(),
            distance: f32::INFINITY,
            ..Query::zeroed()
        }
    };
    let queries: Vec<Query> = (0..COUNT).map(query).collect();
    let Some(answers) = answers(&world, &queries) else {
        return;
    };
    let within = |values: &mut dyn Iterator<Item = f32>, expected: f64| {
        let (mut sum, mut squares) = (0.0, 0.0);
        values.for_each(|x| (sum, squares) = (sum + f64::from(x), squares + f64::from(x) * f64::from(x)));
        let n = f64::from(COUNT);
        let mean = sum / n;
        let error = (squares / n - mean * mean).max(0.0).sqrt() / n.sqrt();
        assert!(
            (mean - expected).abs() < 5.0 * error,
            "{mean} +- {error}, not {expected}"
        );
    };
    within(&mut answers.iter().map(|got| 4.0 * PI * got.pdf_direct), 1.0);
    within(&mut answers.iter().map(|got| got.weight[0]), sky.fluence().x.into());
    let white = |got: &super::direct::Answer| match got.pdf > 0.0 {
        true => 1.0 / got.pdf,
        false => 0.0,
    };
    // All directions except those between four black pixels.
    let is_seen = |got: &super::direct::Answer| f64::from(u8::from(got.pdf_direct > 0.0));
    let seen = answers.iter().map(is_seen).sum::<f64>() / f64::from(COUNT);
    let room = 5.0 * (seen * (1.0 - seen) / f64::from(COUNT)).sqrt();
    let sum: f64 = answers.iter().map(|got| f64::from(white(got))).sum();
    let mean = sum / f64::from(COUNT) / f64::from(4.0 * PI);
    assert!((mean - seen).abs() < room + 0.02, "{mean} {seen}");
}
