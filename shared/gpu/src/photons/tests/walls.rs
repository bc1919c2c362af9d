//! Walls that cross kernels.

use super::{Each, PHOTON, REQUEST, asked, before, dir, lay_out, sampler};
use crate::photons::{PhotonEstimate, PhotonMap, PhotonRequest};
use crate::testing::tested;
use crate::world::NO_WALLS;
use crate::world::geometry::FlatGeometry;
use beamfarm_render::cpu::photon_map::{Crossing, SurfacePhoton};
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::world::geometry::{Geometry, Mesh, Object, Placement, Shape};
use std::sync::Arc;

/// An upright wall at a coordinate x, as wide as everything, from the ground to a height.
fn upright(x: f32, top: f32) -> Object {
    let positions = [[x, -3.0, 0.0], [x, 3.0, 0.0], [x, 3.0, top], [x, -3.0, top]].map(Vec3::from);
    Object::new(Shape::Mesh {
        mesh: Arc::new(Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }),
        placement: Placement::IDENTITY,
    })
}

/// A pane at 0.2, a wall at 0.5, a low wall at -0.5; photons at the origin and elsewhere, some of which know the walls.
#[test]
fn walls_hide_what_is_behind_them() {
    let Some(tested) = tested() else { return };
    let objects = [upright(0.2, 1.0), upright(0.5, 1.0), upright(-0.5, 0.1)];
    let geometry = Geometry::new(&objects);
    let is_pane = |object: u32| object == 0;
    let classes = |object: u32| if is_pane(object) { NO_WALLS } else { 3 };
    let flat = FlatGeometry::new(&geometry, &objects, &classes, u64::MAX).unwrap();
    let buffers = flat.upload(&tested.device, None).unwrap();
    // Whether walls occlude a point, by the same ray.
    let is_hidden = |photon: &SurfacePhoton, point: Vec3| {
        let way = point - photon.point;
        let n = photon.ng * photon.ng.dot(photon.wi).signum();
        let along = way - n * way.dot(n);
        let (from, length) = (photon.point + n * photon.walls.height, along.length());
        let ray = Ray {
            origin: from,
            dir: along / length,
        };
        let is_met = length > 0.0 && geometry.occluded(&objects, &ray, length, &is_pane);
        photon.walls.may_hide(way) && is_met
    };
    let crossing = |beyond: Vec3| Crossing { height: 0.2, beyond };
    let photon = SurfacePhoton { radius: 1.0, ..PHOTON };
    let request = |x: f32, y: f32, slot: u32| PhotonRequest {
        point: [x, y, 0.01],
        slot,
        ..REQUEST
    };
    let all = |photons: &[SurfacePhoton], requests: &[PhotonRequest]| {
        let map = PhotonMap::new(tested, photons.len() as u32).unwrap();
        let ordered = lay_out(tested, &map, photons);
        let estimate = PhotonEstimate::new(tested, &buffers, photons.len() as u32).unwrap();
        let got = asked(tested, &buffers, (&estimate, &map), requests);
        let each = Each::new(&ordered);
        for request in requests {
            let slot = request.slot as usize;
            let [r, g, b, _] = before(slot);
            let (sum, _) = each.sum(request, [r, g, b], is_hidden);
            let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
            assert_eq!(bits(&got[slot][..3]), bits(&sum), "{request:?}");
        }
        got
    };

    // Photons that know walls all around, one to the right, or none; and one from below, where there are none.
    let under = SurfacePhoton {
        walls: crossing(Vec3::NAN),
        wi: Vec3::NEG_Z,
        ..photon
    };
    let known = [Vec3::NAN, Vec3::new(2.0, 0.0, 0.0)].map(|beyond| SurfacePhoton {
        walls: crossing(beyond),
        ..photon
    });
    // Behind the pane, behind the wall, behind the low wall that photons look over, and in front of all.
    let places = [0.4, 0.6, -0.6, 0.1];
    let requests: Vec<PhotonRequest> = (0..).zip(places).map(|(slot, x)| request(x, 0.3, slot)).collect();
    let seen = |photon: SurfacePhoton, requests: &[PhotonRequest]| {
        let got = all(&[photon], requests);
        let seen = |(slot, radiance): (usize, &[f32; 4])| radiance[1] > before(slot)[1];
        got.iter().enumerate().map(seen).collect::<Vec<bool>>()
    };
    for photon in known {
        assert_eq!(seen(photon, &requests), [true, false, true, true]);
    }
    assert_eq!(seen(photon, &requests), [true; 4]);
    let from_below: Vec<PhotonRequest> = requests
        .iter()
        .map(|r| PhotonRequest {
            wo: [0.0, 0.0, -1.0],
            ..*r
        })
        .collect();
    assert_eq!(seen(under, &from_below), [true; 4]);

    // Many of all kinds.
    let mut sampler = sampler(6);
    let photons: Vec<SurfacePhoton> = (0..400)
        .map(|i| {
            let [x, y] = sampler.next_2d().to_array();
            let beyond = match i % 3 {
                0 => Vec3::NAN,
                _ => dir(&mut sampler) * 4.0 * sampler.next_1d(),
            };
            SurfacePhoton {
                point: Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 0.0),
                wi: dir(&mut sampler),
                walls: if i % 7 == 0 { Crossing::NONE } else { crossing(beyond) },
                radius: sampler.next_1d(),
                ..PHOTON
            }
        })
        .collect();
    let requests: Vec<PhotonRequest> = (0..300)
        .map(|slot| {
            let [x, y] = sampler.next_2d().to_array();
            PhotonRequest {
                wo: dir(&mut sampler).to_array(),
                ..request(2.0 * x - 1.0, 2.0 * y - 1.0, slot)
            }
        })
        .collect();
    all(&photons, &requests);
}
