//! The map: boxes and order.

use super::{PHOTON, lay_out, photons, sampler};
use crate::hierarchy::Bounds;
use crate::photons::{PhotonMap, SurfacePhoton};
use crate::testing::tested;
use beamfarm_render::math::Vec3;

fn bits(photons: &[SurfacePhoton]) -> Vec<[u32; 20]> {
    bytemuck::cast_slice(photons).to_vec()
}

/// All are there once, and neighbours near each other.
#[test]
fn photons_are_placed_in_the_order_of_the_hierarchy() {
    let Some(tested) = tested() else { return };
    let most = 5000;
    let map = PhotonMap::new(tested, most).unwrap();
    // The largest first: what it leaves is not looked at.
    for count in [most, 65, 64, 3, 1, 0, 4097] {
        let photons = photons(count, 0.1);
        let source: Vec<SurfacePhoton> = photons.iter().map(SurfacePhoton::from).collect();
        let ordered = lay_out(tested, &map, &photons);
        let (mut expected, mut got) = (bits(&source), bits(&ordered));
        expected.sort_unstable();
        got.sort_unstable();
        assert!(expected == got, "{count}");
        let way = |photons: &[SurfacePhoton]| -> f32 {
            let apart = |p: &[SurfacePhoton]| Vec3::from(p[0].point).distance(p[1].point.into());
            photons.windows(2).map(apart).sum()
        };
        assert!(count < 64 || way(&ordered) < 0.5 * way(&source), "{count}");
    }
}

/// At any scale and anywhere: what a box leaves out is further than the radius.
#[test]
fn boxes_hold_all_that_kernels_cover() {
    let Some(tested) = tested() else { return };
    let mut sampler = sampler(7);
    let photons: Vec<_> = (0..3000)
        .map(|i| {
            let scale = libm::exp10f((i % 60) as f32 - 30.0);
            let at = Vec3::new(sampler.next_1d(), sampler.next_1d() - 0.5, -sampler.next_1d());
            let radius = scale * libm::exp10f(-8.0 * sampler.next_1d());
            beamfarm_render::cpu::photon_map::SurfacePhoton {
                point: at * scale,
                radius,
                ..PHOTON
            }
        })
        .collect();
    let map = PhotonMap::new(tested, 3000).unwrap();
    lay_out(tested, &map, &photons);
    let boxes = tested.device.read::<Bounds>(&map.boxes, photons.len()).unwrap();
    for (photon, bounds) in photons.iter().zip(boxes) {
        for axis in 0..3 {
            let at = photon.point[axis];
            // The furthest numbers whose distance, as it is rounded, has a square that is less than the radius'.
            let is_covered = |x: f32| (at - x) * (at - x) < photon.radius * photon.radius;
            let mut low = at - photon.radius;
            let mut high = at + photon.radius;
            for _ in 0..4 {
                (low, high) = (low.next_down(), high.next_up());
            }
            for _ in 0..8 {
                assert!(!is_covered(low) || bounds.low[axis] <= low, "{photon:?} {bounds:?}");
                assert!(!is_covered(high) || bounds.high[axis] >= high, "{photon:?} {bounds:?}");
                (low, high) = (low.next_up(), high.next_down());
            }
            // And hardly more.
            let size = 2.0 * photon.radius * 1.001 + 1e-6 * at.abs() + 1e-37;
            assert!(bounds.high[axis] - bounds.low[axis] <= size, "{photon:?} {bounds:?}");
        }
    }
}
