//! Random numbers in kernels: addresses of streams. The numbers are those of the renderer.

use beamfarm_image::merge::{REPLICATION, replication};
use beamfarm_render::sampler::Purpose;
use bytemuck::{Pod, Zeroable};

/// A stream's address without the chunk, as in `kernels/sampler.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Stream {
    /// The job's seed, low word first, like all 64-bit integers.
    pub seed: [u32; 2],
    /// The pass.
    pub pass_index: [u32; 2],
    /// Its replication, by the first pass of that.
    pub replication: [u32; 2],
    /// The pass's place in its replication.
    pub place: u32,
    /// Purpose of the numbers.
    pub purpose: u32,
}

impl Stream {
    /// The address of a pass's numbers for a purpose.
    #[must_use]
    pub fn new(seed: u64, pass_index: u64, purpose: Purpose) -> Self {
        let words = |x: u64| [x as u32, (x >> 32) as u32];
        let first = replication(pass_index).start();
        Self {
            seed: words(seed),
            pass_index: words(pass_index),
            replication: words(first / REPLICATION),
            place: (pass_index - first) as u32,
            purpose: purpose as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{ARITHMETIC, GROUPS, MATH, Program, SAMPLER, WARP, WIDE};
    use crate::testing::{results, same_layout, tested};
    use crate::twin::warp;
    use beamfarm_render::math::Vec2;
    use beamfarm_render::sampler::Sampler;

    const DRAWS: Program = Program {
        name: "draws",
        texts: &[
            GROUPS,
            crate::testing::EACH,
            WIDE,
            SAMPLER,
            "@group(0) @binding(0) var<storage, read> streams: array<Stream>;
            @group(0) @binding(1) var<storage, read_write> results: array<u32>;
            var<private> at: u32;
            fn put(u: u32) { results[at] = u; at += 1u; }
            fn put_1d(s: ptr<function, Sampler>) { put(bitcast<u32>(next_1d(s))); }
            fn put_2d(s: ptr<function, Sampler>) { let u = bitcast<vec2u>(next_2d(s)); put(u.x); put(u.y); }
            fn some(first: Sampler) {
                var s = first;
                put_1d(&s); put_2d(&s); put_1d(&s);
                sampler_align(&s, 8u);
                put_2d(&s); put_2d(&s); put_1d(&s);
                sampler_align(&s, 16u);
                put_1d(&s);
                sampler_skip(&s, 2u);
                put_2d(&s); put(next_u32(&s));
            }
            fn each(i: u32) {
                if (i >= 16384u) { return; }
                let stream = streams[i % arrayLength(&streams)];
                at = i * 64u;
                let chunk = vec2u(i, i % 3u);
                some(sampler_random(stream, chunk));
                some(sampler_even(stream, chunk));
                some(sampler_of_paths(stream, i, 16384u));
                var s = sampler_even(stream, chunk);
                for (var k = 0u; k < 95u; k++) { _ = next_1d(&s); }
                put_2d(&s); put_2d(&s);
            }",
        ],
    };

    /// The bits of a few numbers.
    fn some(mut s: Sampler) -> Vec<u32> {
        let mut all = Vec::new();
        let mut put = |floats: &[f32]| all.extend(floats.iter().map(|f| f.to_bits()));
        put(&[s.next_1d()]);
        put(&s.next_2d().to_array());
        put(&[s.next_1d()]);
        s.align(8);
        put(&s.next_2d().to_array());
        put(&s.next_2d().to_array());
        put(&[s.next_1d()]);
        s.align(16);
        put(&[s.next_1d()]);
        s.next_2d_if(false);
        put(&s.next_2d().to_array());
        all.push(s.next_u32());
        all
    }

    #[test]
    fn numbers_are_the_renderers() {
        let Some(tested) = tested() else { return };
        let passes = [
            0,
            1,
            15,
            16,
            33,
            1000,
            1023,
            1 << 14,
            (1 << 14) + 77,
            u64::from(u32::MAX) + 5,
            u64::MAX,
        ];
        let seeds = [0, 7, u64::MAX - 3, 0x0123_4567_89ab_cdef];
        let purposes = [Purpose::Photons, Purpose::Camera, Purpose::Test];
        let addresses: Vec<(u64, u64, Purpose)> = passes
            .iter()
            .flat_map(|pass| seeds.map(|seed| (seed, *pass)))
            .flat_map(|(seed, pass)| purposes.map(|purpose| (seed, pass, purpose)))
            .collect();
        let streams: Vec<Stream> = addresses.iter().map(|(s, p, u)| Stream::new(*s, *p, *u)).collect();
        let got: Vec<u32> = results(tested, &DRAWS, &streams, 16384, 16384 * 64);
        for (i, got) in (0u32..).zip(got.chunks(64)) {
            let (seed, pass, purpose) = addresses[i as usize % addresses.len()];
            let chunk = u64::from(i) | u64::from(i % 3) << 32;
            let mut expected = some(Sampler::new(seed, pass, purpose, chunk));
            expected.extend(some(Sampler::even(seed, pass, purpose, chunk)));
            expected.extend(some(Sampler::of_paths(seed, pass, purpose, (i, 16384))));
            let mut even = Sampler::even(seed, pass, purpose, chunk);
            (0..95).for_each(|_| _ = even.next_1d());
            let last = [even.next_2d(), even.next_2d()];
            expected.extend(last.iter().flat_map(|u| u.to_array()).map(f32::to_bits));
            assert_eq!(got[..expected.len()], expected, "{seed} {pass} {purpose:?} {chunk}");
        }
    }

    #[test]
    fn streams_lie_in_memory_as_kernels_have_them() {
        same_layout!(
            &DRAWS,
            Stream {
                seed,
                pass_index,
                replication,
                place,
                purpose
            }
        );
    }

    const WARPS: Program = Program {
        name: "warps",
        texts: &[
            ARITHMETIC,
            GROUPS,
            crate::testing::EACH,
            WIDE,
            MATH,
            WARP,
            "@group(0) @binding(0) var<storage, read> points: array<vec2f>;
            @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;
            fn each(i: u32) {
                if (i >= arrayLength(&points)) { return; }
                let u = points[i];
                results[i * 5u] = vec4f(uniform_sphere(u), 0.0);
                results[i * 5u + 1u] = vec4f(cosine_hemisphere(u), 0.0);
                results[i * 5u + 2u] = vec4f(concentric_disk(u), 0.0, 0.0);
                results[i * 5u + 3u] = vec4f(uniform_cap(u, 0.25), 0.0);
                results[i * 5u + 4u] = vec4f(uniform_triangle(u), 0.0, 0.0);
            }",
        ],
    };

    const POINTS: u32 = 1 << 16;

    /// Points of the square: a grid with corners, then random ones.
    fn points() -> Vec<Vec2> {
        let top = 1.0 - 1.0 / (1u32 << 24) as f32;
        let axis = |i: u32| (i as f32 / 32.0).min(top);
        let grid = (0..=32).flat_map(move |i| (0..=32).map(move |j| Vec2::new(axis(i), axis(j))));
        let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
        grid.chain((0..POINTS).map(|_| sampler.next_2d())).collect()
    }

    fn warped(u: Vec2) -> [[f32; 4]; 5] {
        let flat = |p: Vec2| [p.x, p.y, 0.0, 0.0];
        [
            warp::uniform_sphere(u).extend(0.0).to_array(),
            warp::cosine_hemisphere(u).extend(0.0).to_array(),
            flat(warp::concentric_disk(u)),
            warp::uniform_cap(u, 0.25).extend(0.0).to_array(),
            flat(beamfarm_render::warp::uniform_triangle(u)),
        ]
    }

    #[test]
    fn warps_have_their_twins_bits() {
        let Some(tested) = tested() else { return };
        let points = points();
        let input: Vec<[f32; 2]> = points.iter().map(|u| u.to_array()).collect();
        let got: Vec<[f32; 4]> = results(tested, &WARPS, &input, points.len(), points.len() * 5);
        let bits = |values: &[[f32; 4]]| values.iter().map(|v| v.map(f32::to_bits)).collect::<Vec<_>>();
        for (u, got) in points.iter().zip(got.chunks(5)) {
            assert_eq!(bits(got), bits(&warped(*u)), "{u}");
        }
    }

    #[test]
    fn twins_are_the_renderers_distributions() {
        for u in points() {
            let [sphere, hemisphere, disk, cap, _] = warped(u);
            let near = |a: [f32; 4], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 5e-7);
            assert!(near(sphere, beamfarm_render::warp::uniform_sphere(u).to_array()), "{u}");
            assert!(
                near(hemisphere, beamfarm_render::warp::cosine_hemisphere(u).to_array()),
                "{u}"
            );
            assert!(
                near(disk, beamfarm_render::warp::concentric_disk(u).extend(0.0).to_array()),
                "{u}"
            );
            assert!(near(cap, beamfarm_render::warp::uniform_cap(u, 0.25).to_array()), "{u}");
        }
    }

    /// Chi-square of 8 x 8 equally likely cells, 63 degrees of freedom, below its mean plus five standard deviations.
    #[test]
    fn warps_are_distributed_as_they_say() {
        let chance = points().split_off(33 * 33);
        fn turn(x: f32, y: f32) -> f64 {
            (libm::atan2(y.into(), x.into()) / std::f64::consts::TAU).rem_euclid(1.0)
        }
        type Share = fn([[f32; 4]; 5]) -> [f64; 2];
        let shares: [(&str, Share); 5] = [
            ("sphere", |w| {
                let [x, y, z, _] = w[0];
                [f64::from(z) * 0.5 + 0.5, turn(x, y)]
            }),
            ("hemisphere", |w| {
                let [x, y, z, _] = w[1];
                [1.0 - f64::from(z * z), turn(x, y)]
            }),
            ("disk", |w| {
                let [x, y, ..] = w[2];
                [f64::from(x * x + y * y), turn(x, y)]
            }),
            ("cap", |w| {
                let [x, y, z, _] = w[3];
                [f64::from(1.0 - z) * 4.0, turn(x, y)]
            }),
            // Strips along one side: those up to b1 have 1 - (1 - b1)^2 of the area.
            ("triangle", |w| {
                let [b1, b2, ..] = w[4].map(f64::from);
                [1.0 - (1.0 - b1) * (1.0 - b1), b2 / (1.0 - b1)]
            }),
        ];
        for (name, share) in shares {
            let mut cells = [0.0f64; 64];
            for u in &chance {
                let [a, b] = share(warped(*u)).map(|x| ((x * 8.0) as usize).min(7));
                cells[a * 8 + b] += 1.0;
            }
            let expected = f64::from(POINTS) / 64.0;
            let chi: f64 = cells.iter().map(|n| (n - expected) * (n - expected) / expected).sum();
            assert!(chi < 63.0 + 5.0 * libm::sqrt(2.0 * 63.0), "{name}: {chi}");
        }
    }
}
