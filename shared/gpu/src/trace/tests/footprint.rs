//! Footprints have the renderer's bits.

use crate::kernels::{ARITHMETIC, FOOTPRINT, GROUPS, Program, RAYS, VECTORS, WIDE};
use crate::testing::{Chance, EACH, results, same, tested};
use beamfarm_render::math::Vec3;
use beamfarm_render::plan::footprint::{Footprint, spread};
use bytemuck::{Pod, Zeroable};

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Way {
    dir: [f32; 3],
    radius: f32,
    out: [f32; 3],
    spread: f32,
    n: [f32; 3],
    curvature: f32,
    eta: f32,
    before: f32,
    pdf: f32,
    paths: f32,
}

const FOOTPRINTS: Program = Program {
    name: "footprints",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        VECTORS,
        RAYS,
        FOOTPRINT,
        EACH,
        "struct Way {
            dir: vec3f, radius: f32, out: vec3f, spread: f32, n: vec3f, curvature: f32,
            eta: f32, before: f32, pdf: f32, paths: f32,
        }
        @group(0) @binding(0) var<storage, read> ways: array<Way>;
        @group(0) @binding(1) var<storage, read_write> found: array<array<f32, 52>>;
        fn put(i: u32, at: u32, f: Footprint) {
            for (var k = 0u; k < 3u; k++) {
                found[i][at + k] = f.across_a[k];
                found[i][at + 3u + k] = f.across_b[k];
                found[i][at + 6u + k] = f.turn_a[k];
                found[i][at + 9u + k] = f.turn_b[k];
            }
            found[i][at + 12u] = footprint_radius(f) + f32(f.scattered);
        }
        fn each(i: u32) {
            if (i >= arrayLength(&ways)) { return; }
            let way = ways[i];
            let began = round_footprint(way.dir, way.radius, way.spread, 0u);
            let arrived = footprint_advanced(began, way.before);
            put(i, 0u, arrived);
            let reflected = footprint_reflected(arrived, way.dir, way.n, way.curvature);
            put(i, 13u, footprint_advanced(reflected, way.before));
            let refracted = footprint_refracted(arrived, way.dir, way.out, way.n, way.curvature, way.eta);
            put(i, 26u, footprint_advanced(refracted, way.before));
            put(i, 39u, footprint_scattered(reflected, way.out, way.pdf, way.paths, true));
        }",
    ],
};

fn all(footprint: &Footprint) -> [f32; 13] {
    let [[a, b], [c, d]] = footprint.displacements();
    let radius = footprint.radius() + f32::from(footprint.is_smooth());
    let mut all = [radius; 13];
    for (place, x) in all
        .iter_mut()
        .zip([a, b, c, d].iter().flat_map(|v: &Vec3| v.to_array()))
    {
        *place = x;
    }
    all
}

#[test]
fn footprints_are_the_renderers() {
    let Some(tested) = tested() else { return };
    let mut chance = Chance::new(3);
    let ways: Vec<Way> = (0..20_000)
        .map(|_| Way {
            dir: chance.direction().to_array(),
            radius: chance.of(&[0.0, 1e-3, 0.5, f32::INFINITY]),
            out: chance.direction().to_array(),
            spread: chance.of(&[0.0, 1e-4, 0.3]),
            n: chance.direction().to_array(),
            curvature: chance.of(&[0.0, 2.0, -0.3, 1e9]),
            eta: chance.of(&[1.5, 1.0 / 1.5, 1.0]),
            before: chance.of(&[0.0, 0.01, 3.0, 1e8]),
            pdf: chance.of(&[0.0, 0.08, 1.0, f32::INFINITY]),
            paths: chance.of(&[1.0, 1e5]),
        })
        .collect();
    let found: Vec<[f32; 52]> = results(tested, &FOOTPRINTS, &ways, ways.len(), ways.len());
    for (way, found) in ways.iter().zip(found) {
        let (dir, out, n) = (way.dir.into(), way.out.into(), way.n.into());
        let arrived = Footprint::new(dir, way.radius, way.spread).advanced(way.before);
        let reflected = arrived.reflected(dir, n, way.curvature);
        let refracted = arrived.refracted(dir, out, n, way.curvature, way.eta);
        let expected = [
            all(&arrived),
            all(&reflected.advanced(way.before)),
            all(&refracted.advanced(way.before)),
            all(&reflected.scattered(out, way.pdf, way.paths, true)),
        ];
        assert!(
            same(&found, expected.as_flattened()),
            "{way:?}: {found:?}, expected {expected:?}"
        );
    }
    assert_eq!(spread(0.0, 1.0), 0.5);
}
