//! What `kernels/bsdf.wgsl` computes: the renderer's own bits, except for the directions that diffuse surfaces draw,
//! which use the kernels' sine and cosine.

use super::warp;
use beamfarm_render::math::{Vec2, Vec3};
use beamfarm_render::world::bsdf::{Bsdf, BsdfSample, TransportMode};

/// `bsdf_sample`, for a surface that [`Material`](crate::world::materials::Material) supports.
#[must_use]
pub fn sample(bsdf: &Bsdf<'_>, wo: Vec3, u_lobe: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
    let sample = bsdf.sample(wo, u_lobe, u, mode)?;
    if !matches!(bsdf, Bsdf::Diffuse { .. }) {
        return Some(sample);
    }
    let side = if wo.z > 0.0 { 1.0 } else { -1.0 };
    let wi = warp::cosine_hemisphere(u) * side;
    Some(BsdfSample { wi, ..sample })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Groups;
    use crate::kernels::{ARITHMETIC, BSDF, GROUPS, MATH, Program, TEXELS, VECTORS, WARP, WIDE};
    use crate::testing::{Chance, results, same, same_layout, tested};
    use crate::world::materials::{FlatMaterials, Material};
    use beamfarm_render::math::Rgb;
    use beamfarm_render::world::bsdf::{
        self, BsdfFlags, BumpShadowing, Coat, Distribution, Extras, Interface, MaterialDescription, MaterialKind,
        RoughCoat, Tint, fresnel_conductor, fresnel_dielectric,
    };
    use beamfarm_render::world::scalar::Scalar;
    use beamfarm_render::world::texture::{Texture, TexturePoint};
    use bytemuck::{Pod, Zeroable};

    const SURFACES: Program = Program {
        name: "surfaces",
        texts: &[
            ARITHMETIC,
            GROUPS,
            crate::testing::EACH,
            WIDE,
            MATH,
            WARP,
            VECTORS,
            TEXELS,
            BSDF,
            "struct Case { material: Material, wo: vec3f, u_lobe: f32, wi: vec3f, mode: u32, bumps: Shadowing, u: vec2f }
            struct Answer { sample: BsdfSample, value: vec3f, pdf: f32, drawn_value: vec3f, drawn_pdf: f32, lobe: vec4f, back: vec4f }
            @group(0) @binding(0) var<storage, read> cases: array<Case>;
            @group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
            fn each(i: u32) {
                if (i >= arrayLength(&cases)) { return; }
                let case_ = cases[i];
                let m = looked_up(case_.material);
                let sample = bsdf_sample(m, case_.wo, case_.u_lobe, case_.u, case_.mode, case_.bumps);
                var values: array<vec4f, 2>;
                for (var k = 0u; k < 2u; k++) {
                    let wi = select(case_.wi, sample.wi, k == 1u);
                    let value = bsdf_scatter(m, case_.wo, wi, case_.mode, false, case_.bumps).value;
                    values[k] = vec4f(value, bsdf_pdf(m, case_.wo, wi));
                }
                let lobe = one_lobe(m, case_.wo, case_.u_lobe);
                let followed = f32(u32(lobe.is_followed) + 2u * u32(is_glossy(m)) + 4u * u32(is_smooth(m)));
                answers[i] = Answer(
                    sample, values[0].xyz, values[0].w, values[1].xyz, values[1].w,
                    vec4f(followed, lobe.p, lobe.u, bsdf_pdf(lobe.material, case_.wo, case_.wi)),
                    vec4f(bsdf_scatter(m, case_.wo, case_.wi, case_.mode, true, case_.bumps).pdf, albedo_of(m)),
                );
            }",
        ],
    };

    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    #[repr(C)]
    struct Case {
        material: Material,
        wo: [f32; 3],
        u_lobe: f32,
        wi: [f32; 3],
        mode: u32,
        /// A normal and a squared roughness; negative: no map.
        bumps: [f32; 4],
        u: [f32; 2],
        padding: [u32; 2],
    }

    #[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
    #[repr(C)]
    struct Answer {
        wi: [f32; 3],
        sample_pdf: f32,
        weight: [f32; 3],
        flags: u32,
        value: [f32; 3],
        pdf: f32,
        drawn_value: [f32; 3],
        drawn_pdf: f32,
        /// Followed 1, glossy 2, smooth 4; then probability, remaining number, and density of the lobe.
        lobe: [f32; 4],
        /// Density in the other direction, and the albedo.
        back: [f32; 4],
    }

    const ETAS: [f32; 12] = [
        1.0,
        1.5,
        1.0 / 1.5,
        1.33,
        1.0 / 1.33,
        2.417,
        0.1,
        10.0,
        1.000_000_1,
        0.999_999_94,
        1.0003,
        1.1,
    ];
    const PARTS: [f32; 8] = [0.0, 1e-6, 0.143, 1.0, 1.44, 3.98, 100.0, 1e6];
    const ROUGHNESSES: [f32; 7] = [0.0, 1e-3, 0.02, 0.099, 0.1, 0.5, 1.0];
    const SHARES: [f32; 4] = [0.0, 0.3, 0.8, 1.0];
    const KINDS: usize = 13;

    fn color(chance: &mut Chance) -> Texture {
        Texture::Constant(Rgb::new(chance.unit(), chance.unit(), chance.unit()))
    }

    fn share(chance: &mut Chance) -> Scalar {
        Scalar::constant(chance.of(&SHARES))
    }

    fn distribution(chance: &mut Chance) -> Distribution {
        chance.of(&[Distribution::Ggx, Distribution::Beckmann])
    }

    fn material(chance: &mut Chance, kind: usize) -> bsdf::Material {
        let (reflectance, two_sided) = (color(chance), chance.of(&[false, true]));
        let eta = chance.of(&ETAS);
        let tint = Tint {
            reflectance: reflectance.clone(),
            transmittance: color(chance),
        };
        let parts = |chance: &mut Chance| Rgb::new(chance.of(&PARTS), chance.of(&PARTS), chance.of(&PARTS));
        let alpha = Scalar::constant(chance.of(&ROUGHNESSES));
        let interface = match chance.of(&[0, 1]) {
            0 => Interface::Eta(eta),
            _ => Interface::Specular(share(chance)),
        };
        let kind = match kind {
            0 => MaterialKind::Diffuse {
                reflectance: Texture::Constant(Rgb::ZERO),
            },
            1 => MaterialKind::Diffuse { reflectance },
            2 => MaterialKind::Dielectric { eta, tint },
            3 => MaterialKind::ThinDielectric { eta, tint },
            4 => MaterialKind::Conductor {
                eta: parts(chance),
                k: parts(chance),
                reflectance,
            },
            5 => MaterialKind::Mirror { reflectance },
            6 => MaterialKind::Null,
            7 => MaterialKind::RoughConductor {
                distribution: distribution(chance),
                alpha,
                eta: parts(chance),
                k: parts(chance),
                reflectance,
            },
            8 => MaterialKind::RoughDielectric {
                distribution: distribution(chance),
                alpha,
                eta,
                tint,
            },
            9 => MaterialKind::Plastic {
                reflectance,
                specular_reflectance: color(chance),
                coat: Coat::new(eta, chance.of(&[false, true])),
            },
            10 => MaterialKind::RoughPlastic {
                reflectance,
                specular_reflectance: color(chance),
                coat: Box::new(RoughCoat::new(
                    distribution(chance),
                    chance.of(&ROUGHNESSES),
                    chance.of(&[1.3, 1.5, 2.0]),
                    chance.of(&[false, true]),
                )),
            },
            kind => MaterialKind::Principled {
                base_color: reflectance,
                metallic: share(chance),
                roughness: alpha,
                interface,
                extras: (kind == 12).then(|| {
                    Box::new(Extras {
                        spec_tint: share(chance),
                        spec_trans: share(chance),
                        sheen: share(chance),
                        sheen_tint: share(chance),
                        clearcoat: share(chance),
                        clearcoat_gloss: share(chance),
                        flatness: share(chance),
                        ..Extras::NONE
                    })
                }),
            },
        };
        bsdf::Material::from(MaterialDescription {
            multiple_scattering: chance.of(&[false, true]),
            ..MaterialDescription::new(kind, two_sided)
        })
    }

    /// A direction, sometimes close to total reflection.
    fn outgoing(chance: &mut Chance, bsdf: &Bsdf<'_>) -> Vec3 {
        let dir = chance.direction();
        match bsdf {
            Bsdf::Dielectric(b) | Bsdf::ThinDielectric(b) if chance.of(&[false, false, true]) => {
                let eta = b.eta.min(1.0 / b.eta);
                let critical = (1.0 - eta * eta).max(0.0).sqrt();
                let less = chance.of(&[0, 1, 3]).min(critical.to_bits());
                let z = f32::from_bits(critical.to_bits() - less + chance.of(&[0, 1, 2, 100]));
                let z = z.min(1.0) * chance.of(&[1.0, -1.0]);
                Vec3::new((1.0 - z * z).max(0.0).sqrt(), 0.0, z)
            }
            _ => dir,
        }
    }

    fn mode(number: u32) -> TransportMode {
        match number {
            0 => TransportMode::Radiance,
            _ => TransportMode::Flux,
        }
    }

    struct Cases {
        materials: Vec<bsdf::Material>,
        flat: FlatMaterials,
        all: Vec<Case>,
    }

    impl Cases {
        fn new() -> Self {
            let mut chance = Chance::new(1);
            let materials: Vec<bsdf::Material> = (0..KINDS * 40).map(|i| material(&mut chance, i % KINDS)).collect();
            let flat = FlatMaterials::of(materials.iter().map(Some));
            let case = |i: usize| {
                let number = i % materials.len();
                let bsdf = materials[number].bsdf(&TexturePoint::default());
                let wo = outgoing(&mut chance, &bsdf);
                // Sometimes the mirror direction, where a lobe may be narrow.
                let mirrored = Vec3::new(-wo.x, -wo.y, wo.z) + 0.01 * chance.direction();
                let wi = match i % 3 {
                    0 => mirrored.normalize(),
                    _ => chance.direction(),
                };
                Case {
                    material: flat.records[number].surface,
                    wo: wo.to_array(),
                    u_lobe: chance.unit(),
                    wi: wi.to_array(),
                    mode: chance.of(&[0, 1]),
                    bumps: chance.direction().extend(chance.of(&[-1.0, 0.0, 0.2, 1.0])).to_array(),
                    u: chance.two().to_array(),
                    padding: [0; 2],
                }
            };
            let all = (0..12_000 * KINDS).map(case).collect();
            Self { materials, flat, all }
        }

        fn bsdf(&self, i: usize) -> Bsdf<'_> {
            self.materials[i % self.materials.len()].bsdf(&TexturePoint::default())
        }
    }

    /// The lobe that camera paths would choose, and its density.
    fn lobe(bsdf: &Bsdf<'_>, wo: Vec3, wi: Vec3, u: f32) -> [f32; 4] {
        let smooth = bsdf.has(BsdfFlags::SPECULAR);
        let flags = |followed: bool| {
            let glossy = bsdf.has(BsdfFlags::GLOSSY);
            f32::from(u8::from(followed) + 2 * u8::from(glossy) + 4 * u8::from(smooth))
        };
        let delta = bsdf.delta_probability(wo);
        if !smooth && delta > 0.0 {
            if u < delta {
                return [flags(true), 1.0, 0.0, bsdf.pdf(wo, wi)];
            }
            let rest = bsdf.without_delta();
            return [flags(false), 1.0 - delta, (u - delta) / (1.0 - delta), rest.pdf(wo, wi)];
        }
        if smooth || bsdf.has(BsdfFlags::FOLLOWED) {
            return [flags(true), 1.0, u, bsdf.pdf(wo, wi)];
        }
        match bsdf.narrow_and_wide(wo) {
            None => [flags(false), 1.0, u, bsdf.pdf(wo, wi)],
            Some((p, [narrow, _])) if u < p => [flags(true), p, u / p, narrow.pdf(wo, wi)],
            Some((p, [_, wide])) => [flags(false), 1.0 - p, (u - p) / (1.0 - p), wide.pdf(wo, wi)],
        }
    }

    #[test]
    fn surfaces_scatter_with_the_renderers_bits() {
        let Some(tested) = tested() else { return };
        let cases = Cases::new();
        let device = &tested.device;
        let input = device.buffer("cases", &cases.all).unwrap();
        let output = device
            .empty("answers", (cases.all.len() * size_of::<Answer>()) as u64)
            .unwrap();
        let textures = cases.flat.textures.upload(device, None).unwrap();
        let mut work = device.work();
        let kernel = tested.kernel(&SURFACES, "main");
        let groups = Groups::Count(cases.all.len().div_ceil(64) as u32);
        work.run(&kernel, &[&input, &output, &textures.texels], groups).unwrap();
        work.submit().unwrap();
        let answers: Vec<Answer> = device.read(&output, cases.all.len()).unwrap();
        let mut seen = vec![[0u32; 8]; KINDS];
        let mut others = 0;
        for (i, (case, got)) in cases.all.iter().zip(&answers).enumerate() {
            let bsdf = cases.bsdf(i);
            let (wo, wi, mode) = (Vec3::from(case.wo), Vec3::from(case.wi), mode(case.mode));
            let says = || format!("{bsdf:?} {case:?}: {got:?}");
            let [x, y, z, alpha2] = case.bumps;
            let bumps = (alpha2 >= 0.0).then(|| BumpShadowing::new(Vec3::new(x, y, z), alpha2));
            let value = bsdf.eval_bumped(bumps.as_ref(), wo, wi, mode).to_array();
            assert!(same(&got.value, &value), "{} {value:?}", says());
            let pdf = bsdf.pdf(wo, wi);
            assert!(same(&[got.pdf], &[pdf]), "{} {pdf}", says());
            let pdf = bsdf.pdf(wi, wo);
            assert!(same(&got.back[..1], &[pdf]), "{} {pdf}", says());
            let albedo = bsdf.albedo().to_array();
            assert!(same(&got.back[1..], &albedo), "{} {albedo:?}", says());
            let lobe = lobe(&bsdf, wo, wi, case.u_lobe);
            assert!(same(&got.lobe, &lobe), "{} {lobe:?}", says());
            seen[i % KINDS][got.flags as usize] += 1;

            let sample = bsdf.sample(wo, case.u_lobe, case.u.into(), mode);
            let drawn = Vec3::from(got.wi);
            let is_angle = !bsdf.has(BsdfFlags::SPECULAR) && got.flags & 2 == 0;
            let flags = sample.map_or(0, |s| 1 + 2 * u32::from(s.delta) + 4 * u32::from(s.transmitted));
            if got.flags != flags {
                // By rounding, at the threshold between lobes or absorption.
                assert!(is_angle, "{} {sample:?}", says());
                others += 1;
                continue;
            }
            let Some(sample) = sample else { continue };
            if !is_angle {
                assert!(same(&got.wi, &sample.wi.to_array()), "{} {sample:?}", says());
                assert!(same(&got.weight, &sample.weight.to_array()), "{} {sample:?}", says());
                assert!(same(&[got.sample_pdf], &[sample.pdf]), "{} {sample:?}", says());
                continue;
            }
            // At the edge of their disc, facets lose digits.
            let is_inside = case.u.iter().all(|u| (0.01..0.99).contains(u));
            let off = (drawn - sample.wi).abs().max_element();
            assert!(off < 2e-4 || !is_inside, "{} {sample:?}", says());
            assert!(drawn.is_normalized(), "{}", says());
            // At the drawn direction.
            let value = bsdf.eval_bumped(bumps.as_ref(), wo, drawn, mode).to_array();
            let pdf = bsdf.pdf(wo, drawn);
            assert!(same(&got.drawn_value, &value), "{} {value:?}", says());
            assert!(same(&[got.drawn_pdf], &[pdf]), "{} {pdf}", says());
        }
        assert!(others < cases.all.len() / 2000, "{others}");
        // All kinds absorb or scatter, and transmitting ones transmit.
        for (kind, seen) in seen.iter().enumerate() {
            let scattered: u32 = seen.iter().skip(1).sum();
            assert!(kind == 0 || scattered > 3_000, "{kind}: {seen:?}");
            assert!(
                ![2, 3, 6, 8, 12].contains(&kind) || seen[5] + seen[7] > 1000,
                "{kind}: {seen:?}"
            );
        }
    }

    /// Samples and densities agree: a drawn direction's weight is value over density.
    #[test]
    fn weights_of_samples_are_values_over_densities() {
        let Some(tested) = tested() else { return };
        let cases = Cases::new();
        let device = &tested.device;
        // Narrow lobes and weak refraction lose digits.
        let smooth_enough = |case: &&Case| {
            let bends = ![8, 12].contains(&case.material.kind) || (case.material.eta[0] - 1.0).abs() > 0.01;
            case.material.roughness > 0.15 && case.material.coat_alpha < 0.9 && bends
        };
        let chosen: Vec<Case> = cases.all.iter().filter(smooth_enough).copied().collect();
        let input = device.buffer("cases", &chosen).unwrap();
        let output = device
            .empty("answers", (chosen.len() * size_of::<Answer>()) as u64)
            .unwrap();
        let textures = cases.flat.textures.upload(device, None).unwrap();
        let mut work = device.work();
        let kernel = tested.kernel(&SURFACES, "main");
        let groups = Groups::Count(chosen.len().div_ceil(64) as u32);
        work.run(&kernel, &[&input, &output, &textures.texels], groups).unwrap();
        work.submit().unwrap();
        let answers: Vec<Answer> = device.read(&output, chosen.len()).unwrap();
        let mut compared = 0;
        for (case, got) in chosen.iter().zip(&answers) {
            let is_edge = case.u.iter().any(|u| !(0.01..0.99).contains(u));
            if is_edge || got.flags == 0 || got.flags & 2 != 0 || got.wi[2].abs() < 0.01 || case.wo[2].abs() < 0.01 {
                continue;
            }
            compared += 1;
            assert!((got.sample_pdf / got.drawn_pdf - 1.0).abs() < 1e-3, "{case:?} {got:?}");
            for channel in 0..3 {
                let expected = got.drawn_value[channel] * got.wi[2].abs() / got.drawn_pdf;
                assert!(
                    (got.weight[channel] - expected).abs() < 1e-3 * (1.0 + expected),
                    "{case:?} {got:?}"
                );
            }
        }
        assert!(compared > 3_000, "{compared}");
    }

    /// Around total reflection, at every index, from both sides: no path is refracted.
    #[test]
    fn total_reflection_is_among_the_cases() {
        let cases = Cases::new();
        let total = |(i, case): &(usize, &Case)| match cases.bsdf(*i) {
            Bsdf::Dielectric(b) => {
                let eta = if case.wo[2] > 0.0 { b.eta } else { 1.0 / b.eta };
                fresnel_dielectric(case.wo[2].abs().min(1.0), eta) == (1.0, 0.0)
            }
            _ => false,
        };
        assert!(cases.all.iter().enumerate().filter(total).count() > 300);
    }

    #[test]
    fn diffuse_directions_are_the_renderers() {
        let white = Bsdf::Diffuse {
            reflectance: Rgb::ONE,
            two_sided: true,
        };
        let mut chance = Chance::new(2);
        for _ in 0..20_000 {
            let (wo, u) = (chance.direction(), chance.two());
            let twin = sample(&white, wo, 0.0, u, TransportMode::Flux);
            let own = white.sample(wo, 0.0, u, TransportMode::Flux);
            assert_eq!(twin.is_some(), own.is_some());
            let (Some(twin), Some(own)) = (twin, own) else { continue };
            assert!((twin.wi - own.wi).abs().max_element() < 5e-7, "{wo} {u}");
        }
    }

    const FRESNEL: Program = Program {
        name: "fresnel",
        texts: &[
            ARITHMETIC,
            GROUPS,
            crate::testing::EACH,
            WIDE,
            MATH,
            WARP,
            VECTORS,
            TEXELS,
            BSDF,
            "struct Case { eta: vec3f, cosine: f32, k: vec3f, one: f32 }
            struct Answer { conductor: vec3f, padding: f32, dielectric: vec2f }
            @group(0) @binding(0) var<storage, read> cases: array<Case>;
            @group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
            fn each(i: u32) {
                if (i >= arrayLength(&cases)) { return; }
                let case_ = cases[i];
                answers[i].conductor = fresnel_conductor(case_.cosine, case_.eta, case_.k);
                answers[i].dielectric = fresnel_dielectric(case_.cosine, case_.one);
            }",
        ],
    };

    #[test]
    fn reflectances_have_the_renderers_bits() {
        let Some(tested) = tested() else { return };
        let mut chance = Chance::new(3);
        // Indices and cosine, for a conductor and a dielectric.
        let case = |_| {
            let mut part = || chance.of(&PARTS) * (0.5 + chance.unit());
            let (eta, k) = ([part(), part(), part()], [part(), part(), part()]);
            let cosine = chance.direction().z.abs();
            let factor = 0.5 + chance.unit();
            let one = chance.of(&ETAS) * chance.of(&[1.0, factor]);
            [eta[0], eta[1], eta[2], cosine, k[0], k[1], k[2], one]
        };
        let cases: Vec<[f32; 8]> = (0..200_000).map(case).collect();
        let got: Vec<[f32; 8]> = results(tested, &FRESNEL, &cases, cases.len(), cases.len());
        for (case, got) in cases.iter().zip(got) {
            let [e0, e1, e2, cosine, k0, k1, k2, one] = *case;
            let conductor = fresnel_conductor(cosine, Rgb::new(e0, e1, e2), Rgb::new(k0, k1, k2));
            let (reflectance, cos_t) = fresnel_dielectric(cosine, one);
            assert!(same(&got[..3], &conductor.to_array()), "{case:?}: {got:?} {conductor}");
            assert!(
                same(&got[4..6], &[reflectance, cos_t]),
                "{case:?}: {got:?} {reflectance} {cos_t}"
            );
        }
    }

    #[test]
    fn materials_lie_in_memory_as_kernels_have_them() {
        same_layout!(
            &SURFACES,
            Material {
                reflectance,
                kind,
                transmittance,
                bits,
                eta,
                roughness,
                k,
                table,
                metallic,
                spec_tint,
                spec_trans,
                flatness,
                sheen,
                sheen_tint,
                clearcoat,
                coat_alpha
            }
        );
    }
}
