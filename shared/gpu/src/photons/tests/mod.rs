//! Shared by the tests of photons: random photons and requests, the device's sums, and those in plain Rust.

mod kernel;
mod map;
mod sums;
mod walls;
mod weights;

use super::{Counted, PhotonEstimate, PhotonMap, PhotonRequest, PhotonRequests, SurfacePhoton};
use crate::hierarchy::{Bounds, Level};
use crate::kernels::{PHOTON_MAP, PHOTONS};
use crate::self_test::Tested;
use crate::sizes::Sizes;
use crate::testing::same_layout;
use crate::world::geometry::{FlatGeometry, GeometryBuffers};
use beamfarm_render::cpu::photon_map::{self, Arrival, Crossing, SeenBy, SurfacePhotonMap};
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::plan::weights::FoundBy;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::geometry::Geometry;

pub fn sampler(number: u64) -> Sampler {
    Sampler::new(1, 0, Purpose::Test, number)
}

pub fn dir(sampler: &mut Sampler) -> Vec3 {
    warp::uniform_sphere(sampler.next_2d())
}

/// A random element of a list.
pub fn of<T: Copy>(sampler: &mut Sampler, list: &[T]) -> T {
    list[sampler.next_u32() as usize % list.len()]
}

pub const PHOTON: photon_map::SurfacePhoton = photon_map::SurfacePhoton {
    point: Vec3::ZERO,
    ng: Vec3::Z,
    wi: Vec3::Z,
    power: Rgb::ONE,
    radius: 0.25,
    walls: Crossing::NONE,
    arrival: Arrival::Caustic,
    found_by: FoundBy::Photons,
    lobes: SeenBy::Wide,
    group: None,
    wave: None,
    light_kind: 0,
};

/// On a unit sphere, with radii up to one, light from both sides, and of all kinds.
pub fn photons(count: u32, radius: f32) -> Vec<photon_map::SurfacePhoton> {
    let mut sampler = sampler(count.into());
    let arrivals = [Arrival::Direct, Arrival::Caustic, Arrival::Scattered, Arrival::Surface];
    (0..count)
        .map(|_| {
            let n = dir(&mut sampler);
            let expected = 4.0 * sampler.next_1d();
            photon_map::SurfacePhoton {
                point: n,
                ng: n * of(&mut sampler, &[1.0, 1.0, -1.0]),
                wi: dir(&mut sampler),
                power: Rgb::new(0.01 + sampler.next_1d(), sampler.next_1d(), 0.3),
                radius: radius * sampler.next_1d(),
                arrival: of(&mut sampler, &arrivals),
                found_by: of(
                    &mut sampler,
                    &[FoundBy::Photons, FoundBy::Paths, FoundBy::Both(expected)],
                ),
                ..PHOTON
            }
        })
        .collect()
}

pub const REQUEST: PhotonRequest = PhotonRequest {
    point: [0.0; 3],
    kind: Counted::All as u32,
    ng: [0.0, 0.0, 1.0],
    density: 0.0,
    ns: [0.0, 0.0, 1.0],
    slot: 0,
    wo: [0.0, 0.0, 1.0],
    bits: 0,
    value: [1.0; 3],
    photon_scale: 1.0,
    shadowing: [0.0, 0.0, 0.0, -1.0],
};

/// Around the sphere, of all kinds, with and without separate shading normals.
pub fn requests(count: u32) -> Vec<PhotonRequest> {
    let mut sampler = sampler(1000 + u64::from(count));
    (0..count)
        .map(|i| {
            let n = dir(&mut sampler);
            let ng = n * of(&mut sampler, &[1.0, -1.0]);
            let ns = match i % 3 {
                0 => (ng + 0.7 * dir(&mut sampler) * sampler.next_1d()).normalize(),
                _ => ng,
            };
            let value = Rgb::new(sampler.next_1d(), 0.5, sampler.next_1d());
            PhotonRequest {
                point: (n * of(&mut sampler, &[1.0, 1.01, 1.1])).to_array(),
                kind: sampler.next_u32() % 5,
                ng: ng.to_array(),
                density: 3.0 * sampler.next_1d(),
                ns: ns.to_array(),
                // A different one for each.
                slot: count - 1 - i,
                wo: dir(&mut sampler).to_array(),
                value: if i % 13 == 0 { [0.0; 3] } else { value.to_array() },
                ..REQUEST
            }
        })
        .collect()
}

/// An empty scene.
pub fn no_walls(tested: &Tested) -> GeometryBuffers {
    let flat = FlatGeometry::new(&Geometry::new(&[]), &[], &|_| 0, u64::MAX).unwrap();
    flat.upload(&tested.device, None).unwrap()
}

/// Initial content of the radiance list.
pub fn before(slot: usize) -> [f32; 4] {
    [0.25, 0.0, slot as f32 * 0.125, -7.0]
}

/// The content of slots after the photons of a map are added, including the numbers that follow each vector.
pub fn asked(
    tested: &Tested,
    geometry: &GeometryBuffers,
    (estimate, map): (&PhotonEstimate, &PhotonMap),
    requests: &[PhotonRequest],
) -> Vec<[f32; 4]> {
    let device = &tested.device;
    let slots = requests.iter().map(|request| request.slot + 1).max().unwrap_or(0) as usize;
    let before: Vec<[f32; 4]> = (0..slots).map(before).collect();
    let of = PhotonRequests {
        count: &device.buffer("count of requests", &[requests.len() as u32]).unwrap(),
        requests: &device.buffer("requests", requests).unwrap(),
        surfaces: &device.buffer("surfaces", &[0u32; 24]).unwrap(),
        key: &device.buffer("key", &[0u32; 2]).unwrap(),
        texels: &device.buffer("texels", &[0u32; 3]).unwrap(),
        radiance: &device.buffer("radiance", &before).unwrap(),
        light_group: None,
    };
    let mut work = device.work();
    estimate.run(&mut work, &of, map, geometry).unwrap();
    work.submit().unwrap();
    device.read(of.radiance, slots).unwrap()
}

/// Lays out photons and returns them in the map's order.
pub fn lay_out(tested: &Tested, map: &PhotonMap, photons: &[photon_map::SurfacePhoton]) -> Vec<SurfacePhoton> {
    let device = &tested.device;
    let photons: Vec<SurfacePhoton> = photons.iter().map(SurfacePhoton::from).collect();
    let count = device.buffer("count of photons", &[photons.len() as u32]).unwrap();
    let source = device.buffer("photons", &photons).unwrap();
    let mut work = device.work();
    map.run(&mut work, &count, &source).unwrap();
    work.submit().unwrap();
    device.read(map.photons(), photons.len()).unwrap()
}

/// Both, without walls.
pub fn estimated(
    tested: &Tested,
    photons: &[photon_map::SurfacePhoton],
    requests: &[PhotonRequest],
) -> (Vec<[f32; 4]>, Vec<SurfacePhoton>) {
    let most = photons.len() as u32;
    let (geometry, map) = (no_walls(tested), PhotonMap::new(tested, most).unwrap());
    let ordered = lay_out(tested, &map, photons);
    let estimate = PhotonEstimate::new(tested, &geometry, most).unwrap();
    (asked(tested, &geometry, (&estimate, &map), requests), ordered)
}

/// In the processor's form.
fn back(photon: &SurfacePhoton) -> photon_map::SurfacePhoton {
    photon_map::SurfacePhoton {
        point: photon.point.into(),
        ng: photon.ng.into(),
        wi: photon.wi.into(),
        power: photon.power.into(),
        radius: photon.radius,
        walls: Crossing {
            height: photon.height,
            beyond: photon.beyond.into(),
        },
        arrival: [Arrival::Direct, Arrival::Caustic, Arrival::Scattered, Arrival::Surface]
            [(photon.arrival & 255) as usize],
        found_by: [FoundBy::Photons, FoundBy::Paths, FoundBy::Both(photon.expected)][photon.found_by as usize],
        ..PHOTON
    }
}

/// Photons, each alone in a processor's map.
pub struct Each(Vec<(photon_map::SurfacePhoton, SurfacePhotonMap)>);

impl Each {
    pub fn new(photons: &[SurfacePhoton]) -> Self {
        let photons = photons.iter().map(back);
        Self(photons.map(|p| (p, SurfacePhotonMap::new(vec![p]))).collect())
    }

    /// The sum for a request: each photon alone, in order. `is_hidden`: from a point. Also the number of kernels that
    /// cover the point.
    pub fn sum(
        &self,
        request: &PhotonRequest,
        before: [f32; 3],
        is_hidden: impl Fn(&photon_map::SurfacePhoton, Vec3) -> bool,
    ) -> ([f32; 3], u32) {
        let (mut sum, mut covering) = (Rgb::from_array(before), 0);
        let (point, ng) = (Vec3::from(request.point), Vec3::from(request.ng));
        if request.kind != Counted::Nothing as u32 && request.value != [0.0; 3] {
            for (photon, map) in &self.0 {
                map.gather(point, ng, |_, kernel| {
                    covering += 1;
                    if let Some(factor) = factor(request, photon)
                        && !is_hidden(photon, point)
                    {
                        sum +=
                            Rgb::from_array(request.value) * photon.power * (kernel * factor.cosines * factor.weight);
                    }
                });
            }
        }
        (sum.to_array(), covering)
    }
}

struct Factor {
    /// Shading cosine over geometric cosine.
    cosines: f32,
    weight: f32,
}

fn path_weight(photons: f32, paths: f32) -> f32 {
    let ratio = photons / paths;
    if ratio.is_nan() { 0.0 } else { 1.0 / (1.0 + ratio) }
}

/// A photon's factor without its kernel; none if it is zero.
fn factor(request: &PhotonRequest, photon: &photon_map::SurfacePhoton) -> Option<Factor> {
    let [ng, ns, wo] = [request.ng, request.ns, request.wo].map(Vec3::from);
    let is_even = ng == ns;
    let (cos_g, local_wo) = (ng.dot(photon.wi), wo.dot(ns));
    let wi = if is_even { cos_g } else { photon.wi.dot(ns) };
    // The side that the path comes from, by both normals.
    if wi * local_wo <= 0.0 || (!is_even && wi * cos_g <= 0.0) {
        return None;
    }
    let pdf = |cosine: f32| warp::cosine_hemisphere_pdf(cosine.abs());
    let balanced = || match photon.found_by {
        FoundBy::Photons => 1.0,
        FoundBy::Paths | FoundBy::PathsByRule => 0.0,
        FoundBy::Both(expected) => 1.0 - path_weight(expected, pdf(wi) / cos_g.abs()),
    };
    let cos_out = ng.dot(wo);
    let weight = match request.kind {
        1 => 1.0,
        2 => balanced(),
        3 if photon.arrival == Arrival::Surface => 0.0,
        3 => balanced(),
        4 if local_wo * cos_out > 0.0 => path_weight(1.0 * pdf(local_wo) / cos_out.abs(), request.density),
        4 => 1.0,
        _ => 0.0,
    };
    let cosines = if is_even { 1.0 } else { (wi / cos_g).min(10.0) };
    (weight != 0.0).then_some(Factor { cosines, weight })
}

#[test]
fn photons_and_requests_lie_in_memory_as_kernels_have_them() {
    assert_eq!(size_of::<SurfacePhoton>(), 80);
    for program in [PHOTON_MAP, PHOTONS] {
        same_layout!(&program, Sizes { groups, count });
        same_layout!(
            &program,
            SurfacePhoton {
                point,
                radius,
                ng,
                expected,
                wi,
                arrival,
                power,
                found_by,
                beyond,
                height
            }
        );
        same_layout!(
            &program,
            Bounds {
                low,
                spare_low,
                high,
                spare_high
            }
        );
    }
    same_layout!(&PHOTONS, Level { here, below });
    same_layout!(
        &PHOTONS,
        PhotonRequest {
            point,
            kind,
            ng,
            density,
            ns,
            slot,
            wo,
            bits,
            value,
            photon_scale,
            shadowing
        }
    );
}
