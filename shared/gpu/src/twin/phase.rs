//! What `kernels/phase.wgsl` and `kernels/medium.wgsl` compute: values, densities, transmittances and flights are the
//! renderer's own; directions use the kernels' sine and cosine.

use super::sin_cos;
use beamfarm_render::math::{Frame, PI, Vec2, Vec3};
use beamfarm_render::world::phase::Phase;

/// `phase_sample`: a new direction of travel from a phase function.
#[must_use]
pub fn sample(phase: Phase, dir: Vec3, u: Vec2) -> Vec3 {
    let (g, u) = match phase {
        Phase::Isotropic => (0.0, u),
        Phase::HenyeyGreenstein { g } => (g, u),
        Phase::Blend { weight, g } if u.x < weight => (g[1], u.with_x(u.x / weight)),
        Phase::Blend { weight, g } => (g[0], u.with_x((u.x - weight) / (1.0 - weight))),
    };
    let a = g.abs();
    let d = (1.0 - a) + 2.0 * a * (1.0 - u.x);
    let ratio = (1.0 - a) / d;
    let v = 2.0 * ratio * ratio * u.x * (1.0 + a * (1.0 - u.x));
    let sin_theta = (v * (2.0 - v)).max(0.0).sqrt();
    let (sine, cosine) = sin_cos(2.0 * PI * u.y);
    let cos_theta = if g < 0.0 { v - 1.0 } else { 1.0 - v };
    Frame::from_normal(dir)
        .to_world(Vec3::new(sin_theta * cosine, sin_theta * sine, cos_theta))
        .normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{ARITHMETIC, GROUPS, MATH, MEDIUM, PHASE, Program, VECTORS, WIDE};
    use crate::testing::{Chance, results, same, same_layout, tested};
    use crate::world::media::{self, Medium, PhaseLobe};
    use beamfarm_render::math::Rgb;
    use beamfarm_render::world::medium::{self, Flight, Homogeneous};
    use bytemuck::{Pod, Zeroable};

    const FOG: Program = Program {
        name: "fog",
        texts: &[
            ARITHMETIC,
            GROUPS,
            crate::testing::EACH,
            WIDE,
            MATH,
            VECTORS,
            PHASE,
            MEDIUM,
            "struct Case { medium: Medium, dir: vec3f, length: f32, other: vec3f, cosine: f32, power: vec3f, u: vec2f }
            struct Answer {
                flight: Flight, dir: vec3f, value: f32, transmittance: vec3f, of_directions: f32, peak: f32,
            }
            @group(0) @binding(0) var<storage, read> cases: array<Case>;
            @group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
            fn each(i: u32) {
                if (i >= arrayLength(&cases)) { return; }
                let case_ = cases[i];
                answers[i] = Answer(
                    sample_flight(case_.medium, case_.power, case_.length, case_.u),
                    phase_sample(case_.medium.phase, case_.dir, case_.u),
                    phase_eval(case_.medium.phase, case_.cosine),
                    transmittance(case_.medium, case_.length),
                    phase_eval_directions(case_.medium.phase, case_.dir, case_.other),
                    phase_peak(case_.medium.phase),
                );
            }",
        ],
    };

    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    #[repr(C)]
    struct Case {
        medium: Medium,
        dir: [f32; 3],
        length: f32,
        other: [f32; 3],
        cosine: f32,
        power: [f32; 3],
        padding: u32,
        u: [f32; 2],
        padding_2: [u32; 2],
    }

    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    #[repr(C)]
    struct Answer {
        weight: [f32; 3],
        distance: f32,
        scattered: u32,
        padding: [u32; 3],
        dir: [f32; 3],
        value: f32,
        transmittance: [f32; 3],
        of_directions: f32,
        peak: f32,
        padding_2: [u32; 3],
    }

    impl Answer {
        fn floats(&self) -> Vec<f32> {
            [
                &self.weight[..],
                &[self.distance, self.value, self.of_directions, self.peak],
                &self.dir,
                &self.transmittance,
            ]
            .concat()
        }
    }

    const COSINES: [f32; 11] = [
        -0.999_999, -0.999, -0.7, -1e-6, 0.0, 1e-6, 0.3, 0.7, 0.95, 0.999, 0.999_999,
    ];
    const SIGMAS: [f32; 8] = [0.0, 1e-30, 1e-4, 0.1, 1.0, 7.5, 2000.0, 1e20];
    const LENGTHS: [f32; 8] = [0.0, 1e-20, 1e-3, 0.5, 1.0, 30.0, 1e10, f32::INFINITY];

    /// One of each kind.
    fn phases(chance: &mut Chance) -> [Phase; 3] {
        let [g, first, second] = [0; 3].map(|_| chance.of(&COSINES));
        let weight = chance.of(&[1e-7, 0.1, 0.5, 1.0 - f32::EPSILON / 2.0]);
        let blend = Phase::blend(weight, [first, second]);
        [Phase::HenyeyGreenstein { g }, Phase::Isotropic, blend]
    }

    fn cases() -> Vec<(Homogeneous, Case)> {
        let mut chance = Chance::new(4);
        let case = |_| {
            let phases = phases(&mut chance);
            let spread = chance.of(&[0.0, 1.0]);
            let mut sigma = || {
                let size = chance.of(&SIGMAS);
                Rgb::splat(size) + spread * size * Rgb::new(chance.unit(), chance.unit(), 0.5)
            };
            let medium = Homogeneous {
                sigma_a: sigma(),
                sigma_s: sigma(),
                phase: chance.of(&phases),
            };
            let (dir, other, cosine) = (chance.direction(), chance.direction(), 2.0 * chance.unit() - 1.0);
            let light = [Rgb::ONE, Rgb::new(0.0, 1.0, 0.0), Rgb::new(0.7, 1.3, 0.0)];
            let light = chance.of(&light) + chance.of(&[0.0, 1.0]) * Rgb::new(chance.unit(), 0.1, chance.unit());
            let case = Case {
                medium: (&medium::Medium::Homogeneous(medium)).into(),
                dir: dir.to_array(),
                length: chance.of(&LENGTHS) * (0.5 + chance.unit()),
                other: chance.of(&[dir, -dir, other]).to_array(),
                cosine: chance.of(&[1.0, -1.0, 1.000_000_1, cosine]),
                power: light.to_array(),
                padding: 0,
                u: chance.two().to_array(),
                padding_2: [0; 2],
            };
            (medium, case)
        };
        (0..250_000).map(case).collect()
    }

    fn expected(medium: &Homogeneous, case: &Case) -> Answer {
        let [dir, other, power] = [case.dir, case.other, case.power].map(Vec3::from);
        let (weight, distance, scattered) = match medium.sample_flight(power, case.length, case.u) {
            Flight::Scattered { distance, weight } => (weight, distance, 1),
            Flight::Passed { weight } => (weight, case.length, 0),
        };
        Answer {
            weight: weight.to_array(),
            distance,
            scattered,
            padding: [0; 3],
            dir: sample(medium.phase, dir, case.u.into()).to_array(),
            value: medium.phase.pdf(case.cosine),
            transmittance: medium.transmittance(case.length).to_array(),
            of_directions: medium.phase.eval_directions(dir, other),
            peak: medium.phase.peak(),
            padding_2: [0; 3],
        }
    }

    #[test]
    fn media_scatter_with_the_renderers_bits() {
        let Some(tested) = tested() else { return };
        let cases = cases();
        let input: Vec<Case> = cases.iter().map(|(_, case)| *case).collect();
        let got: Vec<Answer> = results(tested, &FOG, &input, input.len(), input.len());
        let mut seen = [0; 2];
        for ((medium, case), got) in cases.iter().zip(&got) {
            let expected = expected(medium, case);
            assert_eq!(got.scattered, expected.scattered, "{medium:?} {case:?}");
            assert!(
                same(&got.floats(), &expected.floats()),
                "{medium:?} {case:?}: {got:?} {expected:?}"
            );
            seen[got.scattered as usize] += 1;
        }
        assert!(seen.iter().all(|count| *count > 50_000), "{seen:?}");
    }

    /// Directions differ only through the sine of the azimuth.
    #[test]
    fn directions_are_the_renderers() {
        let mut chance = Chance::new(5);
        for _ in 0..50_000 {
            let phases = phases(&mut chance);
            let (phase, dir, u) = (chance.of(&phases), chance.direction(), chance.two());
            let (own, twin) = (phase.sample(dir, u), sample(phase, dir, u));
            assert!(
                (own - twin).abs().max_element() < 1e-6,
                "{phase:?} {dir} {u}: {own} {twin}"
            );
        }
    }

    #[test]
    fn media_lie_in_memory_as_kernels_have_them() {
        same_layout!(
            &FOG,
            Medium {
                sigma_t,
                g,
                sigma_s,
                phase
            }
        );
        type Phase = media::Phase;
        same_layout!(
            &FOG,
            Phase {
                first,
                second,
                first_g,
                second_g,
                weight
            }
        );
        same_layout!(
            &FOG,
            PhaseLobe {
                scale,
                peak,
                slope,
                sign
            }
        );
    }
}
