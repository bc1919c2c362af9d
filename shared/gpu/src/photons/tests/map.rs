//! The map: boxes and order.

use super::{PHOTON, dir, lay_out, photons, sampler};
use crate::hierarchy::{Bounds, Level};
use crate::photons::{PhotonMap, SurfacePhoton};
use crate::self_test::Tested;
use crate::testing::tested;
use beamfarm_render::cpu::photon_map;
use beamfarm_render::math::{PI, Vec3, sin_cos};

fn bits(photons: &[SurfacePhoton]) -> Vec<[u32; 20]> {
    bytemuck::cast_slice(photons).to_vec()
}

/// Every photon is there once, with neighbours close together.
#[test]
fn photons_are_placed_in_the_order_of_the_hierarchy() {
    let Some(tested) = tested() else { return };
    let most = 5000;
    let map = PhotonMap::new(tested, most).unwrap();
    // The largest first: its leftovers are ignored.
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

/// At any scale and place: a box excludes only what is farther than the radius.
#[test]
fn boxes_hold_all_that_kernels_cover() {
    let Some(tested) = tested() else { return };
    let mut sampler = sampler(7);
    let photons: Vec<_> = (0..3000)
        .map(|i| {
            let scale = libm::exp10f((i % 60) as f32 - 30.0);
            let at = Vec3::new(sampler.next_1d(), sampler.next_1d() - 0.5, -sampler.next_1d());
            let radius = scale * libm::exp10f(-8.0 * sampler.next_1d());
            photon_map::SurfacePhoton {
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
            // The farthest coordinates whose rounded squared distance is below the squared radius.
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
            // And hardly larger.
            let size = 2.0 * photon.radius * 1.001 + 5e-7 * at.abs() + 1e-37;
            assert!(bounds.high[axis] - bounds.low[axis] <= size, "{photon:?} {bounds:?}");
        }
    }
}

/// Where a ray from inside meets a room of size two, and the normal there.
fn on_wall(from: Vec3, dir: Vec3) -> (Vec3, Vec3) {
    let way = |axis: usize| (dir[axis].signum() - from[axis]) / dir[axis];
    let axis = (0..3).fold(0, |least, axis| if way(axis) < way(least) { axis } else { least });
    (from + dir * way(axis), Vec3::AXES[axis] * -dir[axis].signum())
}

/// Visited boxes, visited photons, and covering kernels, per point.
fn visited(tested: &Tested, photons: &[photon_map::SurfacePhoton], points: &[Vec3]) -> [f32; 3] {
    let most = photons.len() as u32;
    let map = PhotonMap::new(tested, most).unwrap();
    let ordered = lay_out(tested, &map, photons);
    let levels: Vec<Level> = map.hierarchy.levels().collect();
    let last = levels[levels.len() - 1];
    let nodes = tested
        .device
        .read::<Bounds>(map.hierarchy.nodes(), last.here as usize + 1)
        .unwrap();
    let mut counts = [0u32; 3];
    for point in points {
        let mut waiting = vec![(levels.len() - 1, 0)];
        while let Some((level, i)) = waiting.pop() {
            counts[0] += 1;
            let node = nodes[levels[level].here as usize + i];
            if !(0..3).all(|axis| node.low[axis] <= point[axis] && point[axis] <= node.high[axis]) {
                continue;
            }
            let (first, length) = match level {
                0 => (i * 4, ordered.len()),
                _ => (i * 4, (levels[level].here - levels[level - 1].here) as usize),
            };
            let children = first..(first + 4).min(length);
            if level > 0 {
                waiting.extend(children.map(|child| (level - 1, child)));
                continue;
            }
            for photon in &ordered[children] {
                counts[1] += 1;
                counts[2] += u32::from(point.distance(photon.point.into()) < photon.radius);
            }
        }
    }
    counts.map(|count| count as f32 / points.len() as f32)
}

/// In a room lit by a lamp below its ceiling, with radii equal to the spacing of photons; and with a caustic on the
/// ground, with ten times as many.
#[test]
fn few_boxes_and_photons_are_looked_at() {
    let Some(tested) = tested() else { return };
    let mut sampler = sampler(9);
    let lamp = Vec3::new(0.0, 0.9, 0.0);
    let count = 5000;
    let mut photons: Vec<photon_map::SurfacePhoton> = (0..count)
        .map(|_| {
            let wi = dir(&mut sampler);
            let (point, ng) = on_wall(lamp, wi);
            let density = count as f32 * wi.dot(ng).abs() / (4.0 * PI * point.distance_squared(lamp));
            photon_map::SurfacePhoton {
                point,
                ng,
                radius: (20.0 / (PI * density)).sqrt().min(0.5),
                ..PHOTON
            }
        })
        .collect();
    let mut points: Vec<Vec3> = (0..500).map(|_| on_wall(Vec3::ZERO, dir(&mut sampler)).0).collect();
    let [boxes, looked_at, covering] = visited(tested, &photons, &points);
    println!("lamp: {boxes} boxes, {looked_at} photons, {covering} of them cover a point");
    assert!(covering > 15.0, "{covering}");
    assert!(
        boxes < 6.0 * covering && looked_at < 3.5 * covering,
        "{boxes} {looked_at} {covering}"
    );

    let in_caustic = |u: f32, v: f32| {
        let (sin, cos) = sin_cos(2.0 * PI * v);
        let apart = 0.3 * u * u;
        (Vec3::new(0.2 + apart * cos, -1.0, apart * sin), 0.01 + 0.04 * apart)
    };
    for _ in 0..10 * count {
        let (point, radius) = in_caustic(sampler.next_1d(), sampler.next_1d());
        photons.push(photon_map::SurfacePhoton {
            point,
            ng: Vec3::Y,
            radius,
            ..PHOTON
        });
    }
    points.extend((0..100).map(|_| in_caustic(sampler.next_1d(), sampler.next_1d()).0));
    let [boxes, looked_at, covering] = visited(tested, &photons, &points);
    println!("caustic: {boxes} boxes, {looked_at} photons, {covering} of them cover a point");
    assert!(
        boxes < 3.0 * covering && looked_at < 3.0 * covering,
        "{boxes} {looked_at} {covering}"
    );
}
