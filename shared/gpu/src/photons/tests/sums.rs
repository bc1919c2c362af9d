//! Sums over all photons in plain Rust, against the device's.

use super::{Each, PHOTON, REQUEST, asked, before, dir, estimated, lay_out, no_walls, photons, requests, sampler};
use crate::photons::{Counted, PhotonEstimate, PhotonMap, PhotonRequest, SurfacePhoton};
use crate::testing::tested;
use beamfarm_render::cpu::photon_map;
use beamfarm_render::math::{Rgb, Vec3};

fn bits(all: &[[f32; 4]]) -> Vec<[u32; 4]> {
    bytemuck::cast_slice(all).to_vec()
}

/// By visiting every photon. Returns the number of kernels that cover points.
fn compare(got: &[[f32; 4]], photons: &[SurfacePhoton], requests: &[PhotonRequest]) -> u32 {
    let each = Each::new(photons);
    let mut all = 0;
    for request in requests {
        let slot = request.slot as usize;
        let [r, g, b, rest] = before(slot);
        let (sum, covering) = each.sum(request, [r, g, b], |_, _| false);
        let expected = [sum[0], sum[1], sum[2], rest];
        assert_eq!(
            bits(&got[slot..=slot]),
            bits(&[expected]),
            "{request:?}: {:?}, expected {expected:?}",
            got[slot]
        );
        all += covering;
    }
    all
}

#[test]
fn sums_are_those_of_looking_at_each_photon() {
    let Some(tested) = tested() else { return };
    for (count, radius, asking, least) in [
        (0, 1.0, 65, 0),
        (1, 2.0, 400, 1),
        (3, 2.0, 400, 20),
        (64, 1.0, 300, 200),
        (65, 1.0, 300, 200),
        (5000, 0.3, 700, 3000),
    ] {
        let (photons, requests) = (photons(count, radius), requests(asking));
        let (got, ordered) = estimated(tested, &photons, &requests);
        let covering = compare(&got, &ordered, &requests);
        assert!(covering >= least, "{count}: {covering}");
    }
}

/// Far from the origin, where coordinates are rounded to a fraction of a kernel, and with NaN.
#[test]
fn sums_are_the_same_far_away_and_of_what_is_no_number() {
    let Some(tested) = tested() else { return };
    let away = Vec3::new(2000.0, -30.0, 700.0);
    let mut photons = photons(300, 0.5);
    photons.iter_mut().for_each(|photon| photon.point += away);
    photons[17].point.y = f32::NAN;
    photons[18].radius = f32::NAN;
    photons[19].radius = 0.0;
    photons[20].point.x = f32::INFINITY;
    photons[21].radius = f32::INFINITY;
    photons[22].ng.z = f32::NAN;
    let mut requests = requests(300);
    for request in &mut requests {
        request.point = (Vec3::from(request.point) + away).to_array();
    }
    requests[5].point[0] = f32::NAN;
    let (got, ordered) = estimated(tested, &photons, &requests);
    let is_number = |photon: &&SurfacePhoton| {
        let radius = photon.radius;
        radius.is_finite() && photon.point.iter().chain(&photon.ng).all(|x| x.is_finite())
    };
    // NaN covers nothing; the kernel of an infinite radius is zero everywhere.
    let ordered: Vec<SurfacePhoton> = ordered.iter().filter(is_number).copied().collect();
    assert_eq!(ordered.len(), 295);
    assert!(compare(&got, &ordered, &requests) > 200);
}

/// Independent of the other requests in the dispatch, and of their order.
#[test]
fn bits_do_not_depend_on_what_else_is_asked() {
    let Some(tested) = tested() else { return };
    let (photons, requests) = (photons(2000, 0.3), requests(301));
    let (first, _) = estimated(tested, &photons, &requests);
    let nothing = PhotonRequest {
        kind: Counted::Nothing as u32,
        ..REQUEST
    };
    let turned: Vec<PhotonRequest> = requests.iter().rev().flat_map(|r| [nothing, *r, nothing]).collect();
    let (second, _) = estimated(tested, &photons, &turned);
    assert!(bits(&first) == bits(&second));
}

/// On a plane of size one.
fn on_plane(count: u32, radius: f32) -> Vec<photon_map::SurfacePhoton> {
    let mut sampler = sampler(5);
    let photon = |_| photon_map::SurfacePhoton {
        point: Vec3::new(sampler.next_1d(), sampler.next_1d(), 0.0),
        power: Rgb::splat(0.1 + sampler.next_1d()),
        radius,
        ..PHOTON
    };
    (0..count).map(photon).collect()
}

fn from_plane(count: u32) -> Vec<PhotonRequest> {
    let mut sampler = sampler(6);
    let request = |slot| PhotonRequest {
        point: [sampler.next_1d(), sampler.next_1d(), 0.0],
        wo: dir(&mut sampler).with_z(0.5).normalize().to_array(),
        slot,
        ..REQUEST
    };
    (0..count).map(request).collect()
}

/// All photons cover every point, including the first ones.
#[test]
fn what_an_earlier_map_leaves_changes_nothing() {
    let Some(tested) = tested() else { return };
    let (requests, geometry) = (from_plane(65), no_walls(tested));
    let most = 5000;
    let estimate = PhotonEstimate::new(tested, &geometry, most).unwrap();
    let map = PhotonMap::new(tested, most).unwrap();
    for count in [5000, 65, 0, 3, 1] {
        let ordered = lay_out(tested, &map, &on_plane(count, 1.5));
        let got = asked(tested, &geometry, (&estimate, &map), &requests);
        assert_eq!(compare(&got, &ordered, &requests), 65 * count);
    }
}

/// More photons than some devices' loops may iterate; with equal radii, all cover every point.
#[test]
fn bits_are_the_same_by_one_dispatch_or_several() {
    let Some(tested) = tested() else { return };
    let (requests, count) = (from_plane(3), 70_000);
    let (geometry, map) = (no_walls(tested), PhotonMap::new(tested, count).unwrap());
    for (radius, covering, dispatches) in [(1.5, count..count + 1, &[][..]), (0.02, 40..150, &[2, u32::MAX])] {
        let ordered = lay_out(tested, &map, &on_plane(count, radius));
        let by = |at_once: u32| {
            let estimate = PhotonEstimate::with_parts(tested.into(), &geometry, count, at_once).unwrap();
            asked(tested, &geometry, (&estimate, &map), &requests)
        };
        let one = by(1);
        let found = compare(&one, &ordered, &requests) / 3;
        assert!(covering.contains(&found), "{radius}: {found}");
        for at_once in dispatches {
            assert!(bits(&by(*at_once)) == bits(&one), "{at_once}");
        }
    }
}
