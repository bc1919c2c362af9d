//! MIS weights between photons and camera paths.

use super::{PHOTON, REQUEST, before, dir, estimated, sampler};
use crate::photons::{Counted, PhotonRequest};
use crate::testing::tested;
use beamfarm_render::cpu::photon_map::{Arrival, SurfacePhoton};
use beamfarm_render::math::{PI, Vec3};
use beamfarm_render::plan::weights::FoundBy;
use beamfarm_render::sampler::Sampler;

/// On the side of a normal.
fn above(sampler: &mut Sampler, n: Vec3) -> Vec3 {
    let dir = dir(sampler);
    dir * dir.dot(n).signum()
}

/// Weights of photons, each alone at the place of a request.
fn weights(all: &[(SurfacePhoton, PhotonRequest)]) -> Option<Vec<f32>> {
    let tested = tested()?;
    let radius = 0.25;
    // Each far from all others.
    let at = |i: usize| Vec3::new(i as f32, 0.0, 0.0);
    let photons: Vec<SurfacePhoton> = (all.iter().enumerate())
        .map(|(i, (photon, _))| SurfacePhoton {
            point: at(i),
            radius,
            ..*photon
        })
        .collect();
    let requests: Vec<PhotonRequest> = (all.iter().enumerate())
        .map(|(i, (_, request))| PhotonRequest {
            point: at(i).to_array(),
            slot: i as u32,
            ..*request
        })
        .collect();
    let (got, _) = estimated(tested, &photons, &requests);
    // In the second channel, which starts at zero.
    assert_eq!(before(3)[1], 0.0);
    Some(
        got.iter()
            .map(|radiance| radiance[1] * (PI * radius * radius / 2.0))
            .collect(),
    )
}

#[test]
fn photons_count_by_how_they_arrived_and_who_finds_them() {
    use Arrival::{Caustic, Direct, Scattered, Surface};
    use Counted::{All, First, Last, Later, Nothing};
    // Camera paths are drawn with 1 / pi per projected solid angle everywhere.
    let third = FoundBy::Both(2.0 / PI);
    // At the last vertex the density of photons is 1 / pi as well.
    let density = 3.0 / PI;
    let rows = [
        (Nothing, Direct, FoundBy::Photons, 0.0),
        (All, Direct, FoundBy::Photons, 1.0),
        (All, Surface, FoundBy::Paths, 1.0),
        (All, Surface, third, 1.0),
        (First, Caustic, FoundBy::Photons, 1.0),
        (First, Surface, FoundBy::Photons, 1.0),
        (First, Surface, FoundBy::Paths, 0.0),
        (First, Surface, third, 2.0 / 3.0),
        (First, Caustic, third, 2.0 / 3.0),
        (First, Scattered, FoundBy::Both(0.0), 0.0),
        (Later, Surface, FoundBy::Photons, 0.0),
        (Later, Surface, third, 0.0),
        (Later, Direct, FoundBy::Photons, 1.0),
        (Later, Caustic, third, 2.0 / 3.0),
        (Later, Scattered, FoundBy::Paths, 0.0),
        (Last, Surface, FoundBy::Photons, 3.0 / 4.0),
        (Last, Caustic, FoundBy::Paths, 3.0 / 4.0),
        (Last, Direct, third, 3.0 / 4.0),
    ];
    let all: Vec<_> = rows
        .iter()
        .map(|(kind, arrival, found_by, _)| {
            let photon = SurfacePhoton {
                arrival: *arrival,
                found_by: *found_by,
                wi: Vec3::new(0.6, 0.0, 0.8),
                ..PHOTON
            };
            let request = PhotonRequest {
                kind: *kind as u32,
                density,
                wo: [0.0, -0.8, 0.6],
                ..REQUEST
            };
            (photon, request)
        })
        .collect();
    let Some(got) = weights(&all) else { return };
    for (row, got) in rows.iter().zip(got) {
        assert!((got - row.3).abs() < 1e-6, "{row:?} {got}");
    }
}

/// Light from a surface y to a first vertex x: photons that have left y for x, and paths from x that end at y. Both
/// surfaces have separate shading normals, so that the two differ in probability.
#[test]
fn weights_of_both_techniques_sum_to_one() {
    let mut sampler = sampler(3);
    let mut all = Vec::new();
    let mut cosines = Vec::new();
    while all.len() < 4000 {
        let [x, y, to_x] = [(); 3].map(|_| dir(&mut sampler));
        // Both on the side that sees the other.
        let (x, y) = (-x * x.dot(to_x).signum(), y * y.dot(to_x).signum());
        let [x_s, y_s] = [x, y].map(|n| (n + 0.6 * dir(&mut sampler)).normalize());
        let (wo, wi) = (above(&mut sampler, x_s), above(&mut sampler, y_s));
        let is_seen = x_s.dot(-to_x) > 0.05 && y_s.dot(to_x) > 0.05 && y.dot(wi) > 0.1 && y_s.dot(wi) > 0.1;
        if !is_seen || x.dot(-to_x) < 0.1 {
            continue;
        }
        let pdf = |n: Vec3, dir: Vec3| n.dot(dir).abs() / PI;
        let expected = pdf(y_s, to_x) / to_x.dot(y).abs();
        let arrives = SurfacePhoton {
            ng: x,
            wi: -to_x,
            arrival: Arrival::Surface,
            found_by: FoundBy::Both(expected),
            ..PHOTON
        };
        let seen = PhotonRequest {
            kind: Counted::First as u32,
            ng: x.to_array(),
            ns: x_s.to_array(),
            wo: wo.to_array(),
            ..REQUEST
        };
        let ends = PhotonRequest {
            kind: Counted::Last as u32,
            ng: y.to_array(),
            ns: y_s.to_array(),
            wo: to_x.to_array(),
            density: pdf(x_s, -to_x) / x.dot(-to_x).abs(),
            ..REQUEST
        };
        all.extend([(arrives, seen), (SurfacePhoton { ng: y, wi, ..PHOTON }, ends)]);
        cosines.extend([x_s.dot(-to_x) / x.dot(-to_x), y_s.dot(wi) / y.dot(wi)]);
    }
    let Some(got) = weights(&all) else { return };
    let mut uneven = 0;
    for (pair, cosines) in got.chunks(2).zip(cosines.chunks(2)) {
        let [photons, path] = [0, 1].map(|i| pair[i] / cosines[i]);
        assert!((photons + path - 1.0).abs() < 1e-4, "{photons} {path}");
        uneven += u32::from((photons - path).abs() > 0.2);
    }
    assert!(uneven > 200, "{uneven}");
}

/// Seen from one side by its shading normal, from the other by its geometric one: photons do not go there.
#[test]
fn where_sides_differ_the_path_counts_alone() {
    let seen = |wo: [f32; 3]| PhotonRequest {
        kind: Counted::Last as u32,
        ng: [0.0, 0.0, 1.0],
        ns: [0.0, 0.6, 0.8],
        wo,
        density: 1.0 / PI,
        ..REQUEST
    };
    // With light along the shading normal, whose cosine there is 1 / 0.8 of the geometric one.
    let photon = SurfacePhoton {
        wi: Vec3::new(0.0, 0.6, 0.8),
        ..PHOTON
    };
    let along = PhotonRequest {
        wo: [0.0, 0.6, 0.8],
        ..seen([0.0; 3])
    };
    let all = [
        (photon, seen([0.0, 0.995, -0.0999])),
        (photon, along),
        // Grazing by the geometric normal: at most tenfold.
        (
            SurfacePhoton {
                wi: Vec3::new(0.0, 1.0, 0.01).normalize(),
                ..PHOTON
            },
            PhotonRequest {
                kind: Counted::All as u32,
                ..along
            },
        ),
    ];
    let Some(got) = weights(&all) else { return };
    let balanced = 1.0 / (1.0 + (1.0 / PI / 0.8) / (1.0 / PI));
    let expected = [1.25, 1.25 * balanced, 10.0];
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() < 1e-4 * expected, "{got} {expected}");
    }
}
