use super::*;
use crate::device::Groups;
use crate::kernels::{
    ARITHMETIC, BSDF, CAMERA, DIRECT, EMISSION, GROUPS, MATH, MEDIUM, PHASE, Program, SAMPLER, TEXELS, TEXTURE,
    VECTORS, WARP, WIDE, WORLD,
};
use crate::sampler::Stream;
use crate::testing::{Chance, EACH, same_layout, tested};
use crate::world::tests::scenes::{add_light, empty};
use crate::world::{FlatWorld, NONE};
use beamfarm_render::math::Rgb;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::SceneDescription;

/// A program on top of everything that light sampling needs.
macro_rules! lit {
    ($name:literal, $($text:expr),+) => {
        Program {
            name: $name,
            texts: &[
                ARITHMETIC, GROUPS, EACH, WIDE, MATH, WARP, VECTORS, SAMPLER, TEXELS, BSDF, PHASE, MEDIUM, CAMERA,
                TEXTURE, EMISSION, WORLD, DIRECT, $($text),+
            ],
        }
    };
}

mod direct;
mod pictures;
mod scenes;
mod segment;
mod shadow;
use scenes::*;

const CHOICES: Program = lit!(
    "choices",
    "struct Place { point: vec3f, among: u32, normal: vec3f, has_normal: u32 }
        @group(0) @binding(0) var<storage, read> places: array<Place>;
        @group(0) @binding(1) var<storage, read> stream: Stream;
        @group(0) @binding(2) var<storage, read_write> words: array<array<u32, 64>>;
        fn each(i: u32) {
            if (i >= arrayLength(&places)) { return; }
            let place = places[i];
            let choice = light_choice(place.point, place.normal, place.has_normal == 1u, place.among);
            var s = sampler_even(stream, vec2u(i, 0u));
            if (i % 3u == 0u) { s = sampler_random(stream, vec2u(i, 0u)); }
            var next = 0u;
            var at = 0u;
            loop {
                let chosen = next_light(choice, &next, &s);
                if (chosen.light == NONE) { break; }
                let u = bitcast<vec3u>(draw_direct(chosen.light, &s));
                if (at < 48u) {
                    words[i][at] = chosen.light + 1u;
                    words[i][at + 1u] = bitcast<u32>(chosen.pmf);
                    words[i][at + 2u] = bitcast<u32>(chosen.u);
                    words[i][at + 3u] = u.x;
                    words[i][at + 4u] = u.y;
                    words[i][at + 5u] = u.z;
                }
                at += 6u;
            }
            let one = sample_light(choice, next_1d(&s));
            words[i][48] = one.light;
            words[i][49] = bitcast<u32>(one.pmf);
            words[i][50] = bitcast<u32>(one.u);
            let light = i % lighting.lights;
            words[i][51] = bitcast<u32>(light_pmf(choice, light));
            words[i][52] = bitcast<u32>(samples_of(choice, light));
        }"
);

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Place {
    point: [f32; 3],
    among: u32,
    normal: [f32; 3],
    has_normal: u32,
}

/// The renderer's choice at a place, in the kernel's format.
fn chosen(scene: &Scene, place: &Place, i: u32, stream: (u64, u64)) -> [u32; 64] {
    let selectors = [scene.aimed_at(), scene.selectors()][place.among as usize];
    let normal = (place.has_normal == 1).then_some(Vec3::from(place.normal));
    let choice = scene
        .light_sources()
        .choice_at(place.point.into(), normal, &selectors.all);
    let mut sampler = match i.is_multiple_of(3) {
        true => Sampler::new(stream.0, stream.1, Purpose::Test, i.into()),
        false => Sampler::even(stream.0, stream.1, Purpose::Test, i.into()),
    };
    let mut words = [0; 64];
    let mut at = 0;
    let description = scene.description();
    choice.each(&mut sampler, |chosen, sampler| {
        let (u, more) = description.lights[chosen.light].draw_direct(&description.objects, sampler);
        if at < 48 {
            words[at] = chosen.light as u32 + 1;
            let numbers = [chosen.pmf, chosen.u, u.x, u.y, more];
            words[at + 1..at + 6].copy_from_slice(&numbers.map(f32::to_bits));
        }
        at += 6;
    });
    let one = choice.sample(sampler.next_1d());
    words[48] = one.map_or(NONE, |one| one.light as u32);
    words[49] = one.map_or(0.0, |one| one.pmf).to_bits();
    words[50] = one.map_or(0.0, |one| one.u).to_bits();
    let light = i as usize % description.lights.len();
    words[51] = choice.pmf(light).to_bits();
    words[52] = choice.samples_of(light).to_bits();
    words
}

#[test]
fn lights_are_chosen_as_the_renderer_chooses_them() {
    let Some(tested) = tested() else { return };
    let device = &tested.device;
    let kernel = tested.kernel(&CHOICES, "main");
    let mut only_sky = empty();
    add_light(&mut only_sky, "sky", sky(VALUE));
    let mut two_skies = only_sky.clone();
    add_light(&mut two_skies, "other sky", sky(Rgb::ONE));
    let stream = (5, 77);
    let streams = device
        .buffer("stream", &[Stream::new(stream.0, stream.1, Purpose::Test)])
        .unwrap();
    for (name, description) in [
        ("all kinds", all_kinds()),
        ("pictures", pictures()),
        ("one", bulbs(1)),
        ("two", bulbs(2)),
        ("32", bulbs(32)),
        ("33", bulbs(33)),
        ("sky", only_sky),
        ("two skies", two_skies),
    ] {
        let scene = Scene::new(description);
        let world = FlatWorld::new(&scene, u64::MAX).unwrap();
        let buffers = world.upload(device).unwrap();
        let mut chance = Chance::new(3);
        let places: Vec<Place> = (0..1500)
            .map(|i| Place {
                point: (chance.direction() * (4.0 * chance.unit())).to_array(),
                among: i % 2,
                normal: chance.direction().to_array(),
                has_normal: i / 2 % 2,
            })
            .collect();
        let input = device.buffer("places", &places).unwrap();
        let output = device.empty("words", 256 * places.len() as u64).unwrap();
        let given = [
            &input,
            &streams,
            &output,
            &buffers.lights,
            &buffers.choices.sources,
            &buffers.choices.tables,
            &buffers.choices.lighting,
        ];
        let mut work = device.work();
        let groups = Groups::Count(places.len().div_ceil(64) as u32);
        work.run(&kernel, &given, groups).unwrap();
        work.submit().unwrap();
        let got = device.read::<[u32; 64]>(&output, places.len()).unwrap();
        let mut counts = [0; 9];
        for (i, (place, got)) in (0..).zip(places.iter().zip(&got)) {
            assert_eq!(*got, chosen(&scene, place, i, stream), "{name}: {place:?}");
            counts[(0..8).filter(|k| got[6 * k] > 0).count()] += 1;
        }
        // None, one and two of many.
        if name == "all kinds" {
            assert!(counts[..4].iter().all(|count| *count > 20), "{counts:?}");
        }
    }
}

#[test]
fn choices_lie_in_memory_as_kernels_have_them() {
    same_layout!(
        &CHOICES,
        LightSource {
            center,
            region,
            apex,
            softening,
            axis,
            intensity,
            emitted,
            width,
            unshadowing,
            only_sampled,
            table,
            class_bit,
            shape_class,
            hides,
            photon_hides
        }
    );
    same_layout!(
        &CHOICES,
        Lighting {
            lights,
            is_weighed,
            shadow_rays_walk,
            has_rules,
            camera_hides,
            gather_hides,
            unlit
        }
    );
}
