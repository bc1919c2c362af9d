//! Sums along segments: by rays, by tiles, and over all pairs in plain Rust.

use super::{dir, point, sampler, scatterings};
use crate::beams::gather::Share;
use crate::beams::{Beam, Brought, Gather, Piece, Pieces, Segment, Segments, Way};
use crate::kernels::Needs;
use crate::self_test::Tested;
use crate::testing::tested;
use crate::twin::beams::brought;
use beamfarm_render::math::Vec3;

const KEY: u64 = 0xfeed_0123_89ab_4567;

/// In a cube of side two, in one medium or in four.
fn beams(count: u32, media: u32, radius: f32) -> Vec<Beam> {
    let mut sampler = sampler(u64::from(count));
    (0..count)
        .map(|i| {
            // Some share an origin, as from a lamp.
            let origin = if i % 3 == 0 {
                Vec3::new(0.1, 0.9, 0.2)
            } else {
                point(&mut sampler, 1.0)
            };
            let length = 1.5 * sampler.next_1d() * sampler.next_1d();
            Beam {
                origin: origin.to_array(),
                radius: radius * (0.5 + sampler.next_1d()),
                dir: dir(&mut sampler).to_array(),
                radius_slope: radius * 0.2 * sampler.next_1d(),
                power: [1.0, sampler.next_1d(), 0.3],
                length,
                extent: [-0.05 * sampler.next_1d(), length + 0.02],
                medium: i % media,
                walls: 0,
            }
        })
        .collect()
}

/// Segments from a pinhole camera, at most 64 by 64, every 64 consecutive ones from 8 x 8 pixels.
fn pinhole(side: u32, medium: u32) -> Vec<Segment> {
    let origin = Vec3::new(0.0, 0.0, 2.5);
    let of_tile = |tile: u32| (0..64).map(move |i| (tile, i));
    (0..side * side / 64)
        .flat_map(of_tile)
        .map(|(tile, i)| {
            let x = tile % (side / 8) * 8 + i % 8;
            let y = tile / (side / 8) * 8 + i / 8;
            let [x, y] = [x, y].map(|at| 2.0 * (at as f32 + 0.5) / side as f32 - 1.0);
            let to = Vec3::new(0.6 * x, 0.6 * y, -1.0);
            Segment {
                origin: origin.to_array(),
                length: 2.0 + x + y,
                dir: to.normalize().to_array(),
                medium,
                pixel: tile * 64 + i,
                ..Segment::default()
            }
        })
        .collect()
}

/// Between random points, some along axes, some of zero length.
fn turned(count: u32, media: u32) -> Vec<Segment> {
    let mut sampler = sampler(77);
    (0..count)
        .map(|i| {
            let along = [Vec3::X, -Vec3::Y, Vec3::Z][i as usize % 3];
            Segment {
                origin: point(&mut sampler, 1.2).to_array(),
                length: if i % 19 == 0 { 0.0 } else { 2.0 * sampler.next_1d() },
                dir: (if i % 11 == 0 { along } else { dir(&mut sampler) }).to_array(),
                medium: i % media,
                pixel: i,
                ..Segment::default()
            }
        })
        .collect()
}

trait Placed {
    fn origin(&mut self) -> &mut [f32; 3];
}

impl Placed for Beam {
    fn origin(&mut self) -> &mut [f32; 3] {
        &mut self.origin
    }
}

impl Placed for Segment {
    fn origin(&mut self) -> &mut [f32; 3] {
        &mut self.origin
    }
}

/// Far from the origin, where coordinates are rounded to a few ten-thousandths of a kernel.
fn moved<T: Placed>(mut all: Vec<T>) -> Vec<T> {
    for one in &mut all {
        let [x, y, z] = *one.origin();
        *one.origin() = [x + 200.0, y - 30.0, z + 120.0];
    }
    all
}

/// The result of both ways, and the pieces in their order.
fn gathered(tested: &Tested, beams: &[Beam], segments: &[Segment], ways: [Way; 2]) -> ([Vec<Brought>; 2], Vec<Piece>) {
    let gather = Gather::new(tested, beams.len() as u32 + 10).unwrap();
    gathered_by(tested, &gather, beams, segments, ways)
}

fn gathered_by(
    tested: &Tested,
    gather: &Gather,
    beams: &[Beam],
    segments: &[Segment],
    ways: [Way; 2],
) -> ([Vec<Brought>; 2], Vec<Piece>) {
    let device = &tested.device;
    let pieces = Pieces::new(tested, beams.len() as u32 + 10).unwrap();
    let beam_count = device.buffer("count of beams", &[beams.len() as u32]).unwrap();
    let beam_buffer = device.buffer("beams", beams).unwrap();
    let of = Segments {
        count: &device.buffer("count of segments", &[segments.len() as u32]).unwrap(),
        segments: &device.buffer("segments", segments).unwrap(),
        media: &device.buffer("media", &scatterings()).unwrap(),
        key: &device.buffer("key", &[KEY]).unwrap(),
        varying: None,
        light_group: None,
    };
    let mut work = device.work();
    pieces.run(&mut work, &beam_count, &beam_buffer).unwrap();
    let films = ways.map(|way| {
        let film = device.empty("gathered", 16 * segments.len() as u64).unwrap();
        gather.run(&mut work, way, &of, &pieces, &film).unwrap();
        film
    });
    work.submit().unwrap();
    let count = device.read::<u32>(pieces.count(), 1).unwrap()[0] as usize;
    (
        films.map(|film| device.read(&film, segments.len()).unwrap()),
        device.read(pieces.pieces(), count).unwrap(),
    )
}

fn bits(all: &[Brought]) -> Vec<[u32; 4]> {
    bytemuck::cast_slice(all).to_vec()
}

/// Over all pieces in their order, whether or not a ray comes near them.
fn sum(segment: &Segment, pieces: &[Piece]) -> Brought {
    let medium = scatterings()[segment.medium as usize];
    let mut sum = Brought::default();
    for piece in pieces.iter().filter(|piece| piece.medium == segment.medium) {
        let more = brought(segment, piece, &medium, KEY);
        if more.count > 0 {
            sum.radiance = [0, 1, 2].map(|i| sum.radiance[i] + more.radiance[i]);
            sum.count += 1;
        }
    }
    sum
}

#[test]
fn sums_by_rays_and_by_tiles_are_those_of_all_pairs() {
    let Some(tested) = tested() else { return };
    // The number selects every n-th segment for a sum in plain Rust.
    for (beams, segments, every) in [
        (beams(2000, 1, 0.03), pinhole(64, 0), 29),
        (beams(2000, 1, 0.03), turned(2000, 1), 17),
        (beams(2000, 1, 0.003), turned(2000, 1), 7),
        (moved(beams(400, 1, 0.1)), moved(turned(600, 1)), 1),
        (beams(400, 4, 0.1), pinhole(16, 3), 1),
        // More than some devices' loops may iterate.
        (beams(100_000, 1, 0.005), pinhole(64, 0), 1009),
        (beams(400, 4, 0.1), turned(301, 4), 1),
        (beams(1, 1, 0.5), turned(65, 1), 1),
        (beams(0, 1, 0.5), turned(65, 1), 1),
    ] {
        let ([rays, tiles], pieces) = gathered(tested, &beams, &segments, [Way::ByRay, Way::ByTile]);
        let wrong = bits(&rays).iter().zip(bits(&tiles)).position(|(a, b)| *a != b);
        assert_eq!(wrong.map(|i| (i, rays[i], tiles[i])), None);
        for (i, segment) in segments.iter().enumerate().step_by(every) {
            let expected = sum(segment, &pieces);
            assert_eq!(bits(&[rays[i]]), bits(&[expected]), "{i} {:?} {expected:?}", rays[i]);
        }
        let met: usize = rays.iter().map(|b| b.count as usize).sum();
        assert!(beams.len() < 2 || met > segments.len() / 20, "{met}");
    }
}

#[test]
fn bits_are_the_same_from_run_to_run() {
    let Some(tested) = tested() else { return };
    let (beams, segments) = (beams(700, 4, 0.05), turned(500, 4));
    let ([first, second], _) = gathered(tested, &beams, &segments, [Way::ByTile; 2]);
    let ([third, _], _) = gathered(tested, &beams, &segments, [Way::ByTile; 2]);
    assert!(bits(&first) == bits(&second) && bits(&first) == bits(&third));
}

#[test]
fn bits_are_the_same_by_one_dispatch_or_several() {
    let Some(tested) = tested() else { return };
    let (beams, segments) = (beams(3000, 4, 0.03), turned(500, 4));
    let ways = [Way::ByRay, Way::ByTile];
    let by = |level: u32, at_once: u32| {
        let gather = Gather::with_share(tested, Err(Needs::ALL), 3000, Share { level, at_once }).unwrap();
        let ([rays, tiles], pieces) = gathered_by(tested, &gather, &beams, &segments, ways);
        // Two parts and more.
        assert!(pieces.len() > 1 << 13);
        (bits(&rays), bits(&tiles))
    };
    let (rays, tiles) = by(5, u32::MAX);
    assert!(rays == tiles);
    for (level, at_once) in [(5, 1), (5, 2), (4, 3)] {
        assert!(by(level, at_once) == (rays.clone(), tiles.clone()), "{level} {at_once}");
    }
}
