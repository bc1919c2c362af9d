//! Light of single wavelengths, with the renderer's own bits.

use super::scenes::{add, dielectric, empty, even};
use crate::device::Groups;
use crate::kernels::{ARITHMETIC, BSDF, GROUPS, MATH, Needs, Program, TEXELS, VECTORS, WARP, WAVES, WIDE};
use crate::testing::{Chance, EACH, same, tested};
use crate::world::materials::{FlatMaterials, Material};
use crate::world::waves::{MOST_ROWS, MOST_WAVES, Waves};
use crate::world::{FlatWorld, Scene};
use beamfarm_render::math::Rgb;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{
    self, Dispersion, Distribution, Extras, Index, Interface, MaterialDescription, MaterialKind, Tint, TransportMode,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::spectrum::{WAVES as COUNT, WaveSet};
use beamfarm_render::world::texture::{Texture, TexturePoint};
use bytemuck::{Pod, Zeroable};

const FOUND: Program = Program {
    name: "found",
    texts: &[
        GROUPS,
        EACH,
        WAVES,
        "@group(0) @binding(0) var<storage, read> key: array<vec2u>;
        @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;
        fn each(i: u32) {
            if (i >= 81u) { return; }
            let path = i / 9u;
            let light = i % 9u;
            results[i] = vec4f(as_found(vec3f(0.3, 1.7, 0.001), path, light), f32(may_see(path, light)));
        }",
    ],
};

fn split(kind: MaterialKind, inside: Index, outside: Index) -> bsdf::Material {
    let description = MaterialDescription {
        dispersion: Some(Box::new(Dispersion { inside, outside })),
        ..even(kind)
    };
    description.into()
}

fn flint() -> Index {
    Index::of_abbe(1.62, 36.4)
}

fn water() -> Index {
    Index::preset("water").unwrap()
}

fn plan(scene: &Scene) -> RenderPlan {
    RenderPlan::new(scene, scene.description().defaults.job_settings())
}

/// Prisms of two kinds, one of them twice, and a blend that contains a third.
fn prisms() -> SceneDescription {
    let mut scene = empty();
    let clear = || dielectric(1.62, Tint::NONE);
    add(&mut scene, "prism", split(clear(), flint(), Index::Constant(1.0)));
    add(&mut scene, "window", even(clear()));
    let parts = [
        MaterialDescription::new(clear(), true).into(),
        split(clear(), flint(), water()),
    ];
    let blend = MaterialKind::Blend {
        parts: Box::new(parts),
        weight: Texture::Constant(Rgb::splat(0.5)),
    };
    add(&mut scene, "blend", even(blend));
    add(&mut scene, "drop", split(clear(), water(), Index::Constant(1.0)));
    add(&mut scene, "another", split(clear(), flint(), Index::Constant(1.0)));
    scene
}

#[test]
fn rows_are_of_what_splits_light() {
    let scene = Scene::new(prisms());
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let plan = plan(&scene);
    assert_eq!((usize::from(COUNT), plan.waves), (MOST_WAVES, COUNT));
    let waves = Waves::new(&scene, &plan, 3);
    let set = plan.wave_set(3).unwrap();
    assert_eq!(waves.count, u32::from(COUNT));
    let materials = &scene.description().materials;
    let mut rows = Vec::new();
    let mut of = |material: &bsdf::Material, number: usize| {
        let row = (world.materials.records[number].bits >> 8) as usize;
        rows.push(row);
        assert_eq!(row > 0, material.dispersion.is_some());
        if let Some(dispersion) = &material.dispersion {
            let expected: Vec<f32> = set.iter().map(|wave| dispersion.eta(f64::from(wave.nm))).collect();
            assert_eq!(waves.etas[row - 1].to_vec(), expected);
        }
    };
    for (number, material) in materials.iter().enumerate() {
        of(material, number);
        if let MaterialKind::Blend { parts, .. } = &material.kind {
            for (part, number) in parts.iter().zip(world.materials.records[number].parts) {
                of(part, number as usize);
            }
        }
    }
    rows.sort_unstable();
    rows.dedup();
    assert_eq!(rows, [0, 1, 2, 3]);
    assert!(waves.etas[3..].iter().flatten().all(|eta| *eta == 0.0));
}

#[test]
fn scenes_that_split_no_light_have_no_wavelengths() {
    let scene = Scene::new(empty());
    assert_eq!(Waves::new(&scene, &plan(&scene), 3), Waves::default());
    assert!(Waves::default().words().is_empty());
}

#[test]
fn more_substances_than_there_is_room_for_are_told() {
    let mut scene = empty();
    for i in 0..=MOST_ROWS {
        let inside = Index::of_abbe(1.5 + 0.01 * i as f64, 30.0);
        let glass = split(dielectric(1.5, Tint::NONE), inside, Index::Constant(1.0));
        add(&mut scene, &format!("glass {i}"), glass);
    }
    let reasons = FlatWorld::new(&Scene::new(scene), u64::MAX).unwrap_err();
    let reasons: Vec<String> = reasons.iter().map(ToString::to_string).collect();
    assert_eq!(
        reasons,
        ["pairs of substances that split light: there are 17, and 16 are the most"]
    );
}

/// With every wavelength and none: the visible light and its weight.
#[test]
fn light_is_found_as_on_a_processor() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(prisms());
    let plan = plan(&scene);
    let key = [vec![[7, 9]], Waves::new(&scene, &plan, 5).words()].concat();
    let set = plan.wave_set(5).unwrap();
    let needs = Needs {
        disperses: true,
        ..Needs::ALL
    };
    let device = &tested.device;
    let kernel = tested.kernel_for(&FOUND, "main", needs);
    let source = device.buffer("key", &key).unwrap();
    let found = device.empty("results", 81 * 16).unwrap();
    let mut work = device.work();
    work.run(&kernel, &[&source, &found], Groups::Count(2)).unwrap();
    work.submit().unwrap();
    let numbers: Vec<_> = set.iter().map(|wave| wave.number).collect();
    for (i, got) in device.read::<[f32; 4]>(&found, 81).unwrap().into_iter().enumerate() {
        let [path, light] = [i / 9, i % 9].map(|n| n.checked_sub(1).map(|n| numbers[n]));
        let factor = light.map_or(Rgb::ONE, |light| set.factor(light, path));
        if got[3] == 0.0 {
            assert_eq!(factor, Rgb::ZERO, "{path:?} {light:?}");
            continue;
        }
        let expected = Rgb::new(0.3, 1.7, 0.001) * factor;
        assert!(
            same(&got[..3], &expected.to_array()),
            "{path:?} {light:?}: {got:?} {expected}"
        );
    }
}

const BENT: Program = Program {
    name: "bent",
    texts: &[
        ARITHMETIC,
        GROUPS,
        EACH,
        WIDE,
        MATH,
        WARP,
        VECTORS,
        TEXELS,
        BSDF,
        "struct Case { material: Material, wo: vec3f, u_wave: f32, wi: vec3f, u_lobe: f32, u: vec2f, eta: f32 }
        struct Answer { wi: vec3f, flags: u32, weight: vec3f, wave: u32, value: vec3f, pdf: f32 }
        @group(0) @binding(0) var<storage, read> cases: array<Case>;
        @group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
        fn each(i: u32) {
            if (i >= arrayLength(&cases)) { return; }
            let c = cases[i];
            let m = bending(looked_up(c.material), c.eta);
            let sample = bsdf_sample(m, c.wo, c.u_lobe, c.u, RADIANCE, NO_SHADOWING);
            let wave = wave_by(c.u_wave, 8u);
            answers[i] = Answer(
                sample.wi, sample.flags, sample.weight, wave, bsdf_eval(m, c.wo, c.wi, FLUX), bsdf_pdf(m, c.wo, c.wi),
            );
        }",
    ],
};

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Case {
    material: Material,
    wo: [f32; 3],
    u_wave: f32,
    wi: [f32; 3],
    u_lobe: f32,
    u: [f32; 2],
    eta: f32,
    spare: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Answer {
    wi: [f32; 3],
    flags: u32,
    weight: [f32; 3],
    wave: u32,
    value: [f32; 3],
    pdf: f32,
}

fn bending_materials() -> Vec<bsdf::Material> {
    let glassy = MaterialKind::Principled {
        base_color: Texture::Constant(Rgb::new(0.9, 0.8, 0.7)),
        metallic: Scalar::constant(0.0),
        roughness: Scalar::constant(0.3),
        interface: Interface::Eta(1.62),
        extras: Some(Box::new(Extras {
            spec_trans: Scalar::constant(1.0),
            ..Extras::NONE
        })),
    };
    let frosted = MaterialKind::RoughDielectric {
        distribution: Distribution::Ggx,
        alpha: Scalar::constant(0.2),
        eta: 1.62,
        tint: Tint::NONE,
    };
    let kinds = [dielectric(1.62, Tint::NONE), frosted, glassy];
    kinds
        .map(|kind| split(kind, Index::of_abbe(1.62, 10.0), Index::Constant(1.0)))
        .to_vec()
}

/// For a wavelength and a uniform number: where light goes on, and how much goes in some direction. Directions drawn
/// from facets are the kernels'.
#[test]
fn light_is_bent_as_on_a_processor() {
    let Some(tested) = tested() else { return };
    let set = WaveSet::of_pass(COUNT, 3, 4);
    let materials = bending_materials();
    let flat = FlatMaterials::of(materials.iter().map(Some));
    let mut chance = Chance::new(77);
    let (mut cases, mut expected) = (Vec::new(), Vec::new());
    for i in 0..6000 {
        let material = &materials[i % materials.len()];
        let (wo, wi, u_wave) = (chance.direction(), chance.direction(), chance.unit());
        let (u, u_lobe) = (chance.two(), chance.unit());
        let wave = set.choose(u_wave);
        cases.push(Case {
            material: flat.records[i % materials.len()].surface,
            wo: wo.to_array(),
            u_wave,
            wi: wi.to_array(),
            u_lobe,
            u: u.to_array(),
            eta: material.dispersion.as_ref().unwrap().eta(f64::from(wave.nm)),
            spare: 0,
        });
        let bsdf = material.bsdf_for(&TexturePoint::default(), Some(wave));
        let sample = bsdf.sample(wo, u_lobe, u, TransportMode::Radiance);
        let value = bsdf.eval(wo, wi, TransportMode::Flux);
        expected.push((wave.number.index() as u32 + 1, sample, value, bsdf.pdf(wo, wi)));
    }
    let device = &tested.device;
    let kernel = tested.kernel(&BENT, "main");
    let source = device.buffer("cases", &cases).unwrap();
    let texels = device.buffer("texels", &[0u32; 3]).unwrap();
    let answers = device
        .empty("answers", (cases.len() * size_of::<Answer>()) as u64)
        .unwrap();
    let mut work = device.work();
    let groups = Groups::Count(cases.len().div_ceil(64) as u32);
    work.run(&kernel, &[&source, &answers, &texels], groups).unwrap();
    work.submit().unwrap();
    let got: Vec<Answer> = device.read(&answers, cases.len()).unwrap();
    let mut counts = [0; 2];
    for ((got, (wave, sample, value, pdf)), case) in got.iter().zip(&expected).zip(&cases) {
        assert_eq!(got.wave, *wave, "{}", case.u_wave);
        assert!(same(&got.value, &value.to_array()), "{got:?} {value}");
        assert!(same(&[got.pdf], &[*pdf]), "{got:?} {pdf}");
        counts[0] += u32::from(*value != Rgb::ZERO);
        if let Some(sample) = sample.filter(|sample| sample.delta) {
            let expected = [sample.wi.to_array(), sample.weight.to_array()].concat();
            assert!(same(&[got.wi, got.weight].concat(), &expected), "{got:?} {sample:?}");
            counts[1] += 1;
        }
    }
    assert!(counts.iter().all(|count| *count > 1000), "{counts:?}");
}
