//! Walls that cross kernels of surface photons, against the processor's.

use super::walls::{furnished, of, uploaded};
use super::{dir, point, sampler};
use crate::beams::FlatWalls;
use crate::device::Groups;
use crate::kernels::{ARITHMETIC, CROSSING, GROUPS, HULL, NEAR, Program, RAYS, SHADE, VECTORS, WIDE};
use crate::testing::{same, tested};
use crate::world::geometry::tests::{Random, scenes};
use beamfarm_render::cpu::beam::walls::crossing;
use beamfarm_render::math::{Ray, Vec3};
use bytemuck::{Pod, Zeroable};

const CROSSINGS: Program = Program {
    name: "crossings",
    texts: &[
        ARITHMETIC,
        GROUPS,
        crate::testing::EACH,
        VECTORS,
        WIDE,
        RAYS,
        SHADE,
        NEAR,
        HULL,
        CROSSING,
        "struct Disc { point: vec3f, radius: f32, n: vec3f, height: f32 }
        @group(0) @binding(0) var<storage, read> discs: array<Disc>;
        @group(0) @binding(1) var<storage, read_write> results: array<Crossing>;
        fn each(i: u32) {
            if (i >= arrayLength(&discs)) { return; }
            results[i] = crossing_walls(discs[i].point, discs[i].n, discs[i].radius, discs[i].height);
        }",
    ],
};

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Disc {
    point: [f32; 3],
    radius: f32,
    n: [f32; 3],
    height: f32,
}

#[test]
fn walls_across_kernels_on_surfaces_are_the_processors() {
    let Some(tested) = tested() else { return };
    let mut random = Random(10);
    let all = [
        furnished(),
        of(scenes::mixed(&mut random, 1.0).objects),
        of(scenes::cubes(true).objects),
    ];
    let (mut crossed, mut everywhere) = (0, 0);
    for (number, scene) in (0..).zip(&all) {
        let mut sampler = sampler(980 + number);
        let objects = &scene.description().objects;
        let discs: Vec<Disc> = std::iter::repeat_with(|| {
            let (origin, dir) = (point(&mut sampler, 1.2), dir(&mut sampler));
            let hit = scene
                .geometry()
                .intersect(objects, &Ray { origin, dir }, 9.0, &|_| false)?;
            let radius = 0.02 + 0.4 * sampler.next_1d() * sampler.next_1d();
            Some(Disc {
                point: hit.point.to_array(),
                radius,
                n: (hit.ng * -hit.ng.dot(dir).signum()).to_array(),
                height: radius * (0.02 + 0.3 * sampler.next_1d()),
            })
        })
        .take(3000)
        .flatten()
        .take(500)
        .collect();
        assert!(discs.len() > 300);
        let device = &tested.device;
        let geometry = uploaded(tested, scene);
        let walls = FlatWalls::new(scene).unwrap().upload(device).unwrap();
        let kernel = geometry.kernel(tested, &CROSSINGS, "main");
        let input = device.buffer("discs", &discs).unwrap();
        let results = device.empty("crossings", 16 * discs.len() as u64).unwrap();
        let mut work = device.work();
        let buffers = [
            &[&input, &results][..],
            &geometry.in_order(),
            &[&walls.shapes, &walls.hull],
        ]
        .concat();
        work.run(&kernel, &buffers, Groups::Count(discs.len().div_ceil(64) as u32))
            .unwrap();
        work.submit().unwrap();
        let got = device.read::<[f32; 4]>(&results, discs.len()).unwrap();
        for (disc, got) in discs.iter().zip(got) {
            let [at, n] = [disc.point, disc.n].map(Vec3::from);
            let expected = crossing(scene, at, n, disc.radius, disc.height);
            let Vec3 { x, y, z } = expected.beyond + 0.0;
            assert!(
                same(&got.map(|x| x + 0.0), &[x, y, z, expected.height]),
                "{disc:?}: {got:?}, {expected:?}"
            );
            crossed += u32::from(expected.height > 0.0);
            everywhere += u32::from(x.is_nan());
        }
    }
    assert!(crossed > everywhere + 100 && everywhere > 100, "{crossed} {everywhere}");
}
