//! What `kernels/bsdf.wgsl` computes: the renderer's own bits, but for the directions that diffuse surfaces draw, which
//! have the sine and cosine of kernels.

use super::warp;
use beamfarm_render::math::{Vec2, Vec3};
use beamfarm_render::world::bsdf::{Bsdf, BsdfSample, TransportMode};

/// `bsdf_sample`. Of a surface that [`Material`](crate::world::materials::Material) has.
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
    use crate::kernels::{ARITHMETIC, BSDF, GROUPS, MATH, Program, VECTORS, WARP, WIDE};
    use crate::testing::{Chance, results, same, same_layout, tested};
    use crate::world::materials::Material;
    use beamfarm_render::math::Rgb;
    use beamfarm_render::world::bsdf::{Dielectric, fresnel_conductor, fresnel_dielectric};
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
            BSDF,
            "struct Case { material: Material, wo: vec3f, u_lobe: f32, wi: vec3f, mode: u32, u: vec2f }
            struct Answer { sample: BsdfSample, value: vec3f, pdf: f32 }
            @group(0) @binding(0) var<storage, read> cases: array<Case>;
            @group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
            fn each(i: u32) {
                if (i >= arrayLength(&cases)) { return; }
                let case_ = cases[i];
                answers[i] = Answer(
                    bsdf_sample(case_.material, case_.wo, case_.u_lobe, case_.u, case_.mode),
                    bsdf_eval(case_.material, case_.wo, case_.wi),
                    bsdf_pdf(case_.material, case_.wo, case_.wi),
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
        u: [f32; 2],
        padding: [u32; 2],
    }

    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    #[repr(C)]
    struct Answer {
        wi: [f32; 3],
        sample_pdf: f32,
        weight: [f32; 3],
        flags: u32,
        value: [f32; 3],
        pdf: f32,
    }

    impl Answer {
        fn floats(&self) -> [f32; 11] {
            let [a, b, c] = self.wi;
            let [d, e, f] = self.weight;
            let [g, h, i] = self.value;
            [a, b, c, self.sample_pdf, d, e, f, g, h, i, self.pdf]
        }
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

    fn color(chance: &mut Chance) -> Rgb {
        Rgb::new(chance.unit(), chance.unit(), chance.unit())
    }

    fn surface(chance: &mut Chance, kind: usize) -> Bsdf<'static> {
        let (reflectance, two_sided) = (color(chance), chance.of(&[false, true]));
        let dielectric = Dielectric {
            eta: chance.of(&ETAS),
            reflectance,
            transmittance: color(chance),
        };
        let parts = |chance: &mut Chance| Rgb::new(chance.of(&PARTS), chance.of(&PARTS), chance.of(&PARTS));
        match kind {
            0 => Bsdf::Black,
            1 => Bsdf::Diffuse { reflectance, two_sided },
            2 => Bsdf::Dielectric(dielectric),
            3 => Bsdf::ThinDielectric(dielectric),
            4 => Bsdf::Conductor {
                eta: parts(chance),
                k: parts(chance),
                reflectance,
                two_sided,
            },
            5 => Bsdf::Mirror { reflectance, two_sided },
            _ => Bsdf::Null,
        }
    }

    /// A direction, now and then next to where all light is reflected.
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

    fn cases() -> Vec<(Bsdf<'static>, Case)> {
        let mut chance = Chance::new(1);
        let case = |i: usize| {
            let bsdf = surface(&mut chance, i % 7);
            let case = Case {
                material: Material::new(&bsdf).unwrap(),
                wo: outgoing(&mut chance, &bsdf).to_array(),
                u_lobe: chance.unit(),
                wi: chance.direction().to_array(),
                mode: chance.of(&[0, 1]),
                u: chance.two().to_array(),
                padding: [0; 2],
            };
            (bsdf, case)
        };
        (0..350_000).map(case).collect()
    }

    fn expected(bsdf: &Bsdf<'_>, case: &Case) -> Answer {
        let (wo, wi, mode) = (Vec3::from(case.wo), Vec3::from(case.wi), mode(case.mode));
        let sample = sample(bsdf, wo, case.u_lobe, case.u.into(), mode);
        Answer {
            wi: sample.map_or([0.0; 3], |s| s.wi.to_array()),
            sample_pdf: sample.map_or(0.0, |s| s.pdf),
            weight: sample.map_or([0.0; 3], |s| s.weight.to_array()),
            flags: sample.map_or(0, |s| 1 + 2 * u32::from(s.delta) + 4 * u32::from(s.transmitted)),
            value: bsdf.eval(wo, wi, mode).to_array(),
            pdf: bsdf.pdf(wo, wi),
        }
    }

    #[test]
    fn surfaces_scatter_with_the_renderers_bits() {
        let Some(tested) = tested() else { return };
        let cases = cases();
        let input: Vec<Case> = cases.iter().map(|(_, case)| *case).collect();
        let got: Vec<Answer> = results(tested, &SURFACES, &input, input.len(), input.len());
        let mut seen = [0u32; 8];
        for ((bsdf, case), got) in cases.iter().zip(&got) {
            let expected = expected(bsdf, case);
            assert_eq!(got.flags, expected.flags, "{bsdf:?} {case:?}");
            assert!(
                same(&got.floats(), &expected.floats()),
                "{bsdf:?} {case:?}: {got:?} {expected:?}"
            );
            assert!(!got.floats().iter().any(|x| x.is_nan()), "{bsdf:?} {case:?}: {got:?}");
            seen[got.flags as usize] += 1;
        }
        // Absorbed, scattered, mirrored, let through: all of them often.
        assert!([0, 1, 3, 7].iter().all(|flags| seen[*flags] > 10_000), "{seen:?}");
    }

    /// By every total reflection, at every index, from both sides: no path is refracted.
    #[test]
    fn total_reflection_is_among_the_cases() {
        let total = |(bsdf, case): &&(Bsdf<'_>, Case)| match bsdf {
            Bsdf::Dielectric(b) => {
                let eta = if case.wo[2] > 0.0 { b.eta } else { 1.0 / b.eta };
                fresnel_dielectric(case.wo[2].abs().min(1.0), eta) == (1.0, 0.0)
            }
            _ => false,
        };
        assert!(cases().iter().filter(total).count() > 1000);
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
        // Indices and cosine, of a conductor and a dielectric.
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
                two_sided,
                eta,
                k
            }
        );
    }
}
