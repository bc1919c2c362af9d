//! How long beams take to be gathered along packets of camera segments, and transmittance to be walked:
//! `cargo bench -p beamfarm-scene --bench gather`.

// What criterion's macros make has no docs.
#![allow(missing_docs)]

use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{CameraSegment, CameraSegments, Gather, Vectors, Way};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::plan::aov::Part;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp::uniform_sphere;
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::medium::procedural::{Noise, Recipe};
use beamfarm_render::world::medium::transmittance::{Estimator, StepFunctions};
use beamfarm_render::world::medium::{Heterogeneous, Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

const BEAMS: usize = 4096;
/// Tiles of the camera, along each side of the picture.
const TILES: usize = 4;
/// Pixels of a tile, along each side.
const SIDE: usize = 32;
/// Extinction and scattering at density 1: grey.
const SIGMA: Rgb = Rgb::splat(0.5);

/// A cube of twice the side of the one that the beams start in, so that all of every beam and segment is in the medium.
fn density(noise: Option<Noise>) -> Arc<Bricks> {
    let recipe = Recipe {
        corners: [DVec3::splat(-2.0), DVec3::splat(2.0)],
        voxel: 1.0 / 32.0,
        height: None,
        blobs: Vec::new(),
        noise,
        graph: None,
    };
    let raw = recipe.sample().expect("a recipe within limits");
    Arc::new(Bricks::new(&raw).expect("samples within limits"))
}

fn lumps() -> Arc<Bricks> {
    density(Some(Noise {
        size: 0.5,
        octaves: 3,
        gain: 0.6,
        contrast: 3.0,
        seed: 5,
    }))
}

fn heterogeneous(density: &Arc<Bricks>, phase: Phase, estimator: Estimator) -> Heterogeneous {
    Heterogeneous::new(
        [Rgb::ZERO, SIGMA],
        phase,
        estimator,
        density.clone(),
        DAffine3::IDENTITY,
    )
}

fn beams(medium: &Medium) -> BeamMap {
    let mut steps = StepFunctions::default();
    let beam = |i: usize| {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, i as u64);
        let u = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
        let ray = Ray {
            origin: 2.0 * u - 1.0,
            dir: uniform_sphere(sampler.next_2d()),
        };
        let (segment, _) = medium.segment(&ray, 1.0, &mut sampler, &mut steps);
        let segment = segment.expect("a beam within the medium");
        PhotonBeam {
            origin: ray.origin,
            dir: ray.dir,
            length: 1.0,
            extent: segment.range,
            power: Rgb::splat(1.0 / BEAMS as f32),
            radius: 0.02,
            radius_slope: 0.0,
            medium: 0,
            group: None,
            wave: None,
            steps: segment.steps,
            walls: [0; 2],
        }
    };
    let beams = (0..BEAMS).map(beam).collect();
    BeamMap::new(Traced {
        beams,
        steps,
        walls: Vec::new(),
    })
}

/// The camera's segments, tile by tile in the order that passes have: every sixteen are a square.
fn tiles(medium: &Medium) -> Vec<CameraSegments> {
    let spread = |i: usize| (i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8) | (i >> 4 & 16);
    let tile = |tile: usize| {
        let corner = [tile % TILES * SIDE, tile / TILES * SIDE];
        let mut camera = CameraSegments::default();
        let mut sampler = Sampler::new(2, 0, Purpose::Test, tile as u64);
        for pixel in 0..SIDE * SIDE {
            let within = [spread(pixel), spread(pixel >> 1)];
            let at = |k: usize| (corner[k] + within[k]) as f32 / (TILES * SIDE) as f32 - 0.5;
            let ray = Ray {
                origin: Vec3::new(0.0, 0.0, -2.0),
                dir: Vec3::new(at(0), at(1), 2.0).normalize(),
            };
            let (segment, _) = medium.segment(&ray, 3.8, &mut sampler, &mut camera.steps);
            let segment = segment.expect("a ray through the medium");
            camera.segments.push(CameraSegment {
                ray,
                length: segment.range[1],
                beta: Rgb::ONE,
                medium: 0,
                pixel: pixel as u16,
                way: Way::default(),
                part: Part::Volume,
                wave: None,
                steps: segment.steps,
            });
        }
        camera
    };
    (0..TILES * TILES).map(tile).collect()
}

/// Per pair of beam and segment that contributes.
fn gathering(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("gather");
    let (constant, lumps) = (density(None), lumps());
    let phases = [
        ("isotropic", Phase::Isotropic),
        ("g 0.6", Phase::HenyeyGreenstein { g: 0.6 }),
    ];
    for (phase_name, phase) in phases {
        let homogeneous = Medium::Homogeneous(Homogeneous {
            sigma_a: Rgb::ZERO,
            sigma_s: SIGMA,
            phase,
        });
        let varying = |density: &Arc<Bricks>| Medium::Heterogeneous(heterogeneous(density, phase, Estimator::DEFAULT));
        let media = [
            ("homogeneous", homogeneous),
            ("constant density", varying(&constant)),
            ("lumps", varying(&lumps)),
        ];
        for (medium_name, medium) in &media {
            let map = beams(medium);
            let tiles = tiles(medium);
            let all = || -> u64 {
                tiles
                    .iter()
                    .map(|tile| {
                        let gather = Gather {
                            map: &map,
                            medium,
                            steps: &tile.steps,
                            scene: None,
                            group: None,
                            wave: None,
                            key: 0,
                            vectors: Vectors::widest(),
                        };
                        black_box(gather.along(&tile.segments)).evaluations
                    })
                    .sum()
            };
            group.throughput(Throughput::Elements(all()));
            group.bench_function(format!("{medium_name}, {phase_name}"), |b| b.iter(all));
        }
    }
    group.finish();
}

/// The most that the arithmetic allows: one block of rays that nearly coincide, which every beam crosses, so that no
/// lane is idle, nothing is rejected and everything stays in the nearest cache. Per pair; the group above, over this
/// one, is how much of the peak gathering reaches. By kind of vectors.
fn peak(criterion: &mut Criterion) {
    const BEAMS: usize = 256;
    const BLOCK: usize = 16;
    let mut group = criterion.benchmark_group("peak");
    for (name, phase) in [
        ("isotropic", Phase::Isotropic),
        ("g 0.6", Phase::HenyeyGreenstein { g: 0.6 }),
    ] {
        let medium = Medium::Homogeneous(Homogeneous {
            sigma_a: Rgb::ZERO,
            sigma_s: SIGMA,
            phase,
        });
        let beam = |i: usize| {
            let mut sampler = Sampler::new(5, 0, Purpose::Test, i as u64);
            let angle = 1.0 + sampler.next_1d();
            let dir = Vec3::new(1.0, angle - 1.5, 0.3).normalize();
            let z = 2.0 * sampler.next_1d() - 1.0;
            PhotonBeam {
                origin: Vec3::new(0.0, 0.0, z) - dir,
                dir,
                length: 2.0,
                extent: [0.0, 2.0],
                power: Rgb::ONE,
                radius: 0.1,
                radius_slope: 0.0,
                medium: 0,
                group: None,
                wave: None,
                steps: 0,
                walls: [0; 2],
            }
        };
        let map = BeamMap::new(Traced {
            beams: (0..BEAMS).map(beam).collect(),
            ..Traced::default()
        });
        let segment = |i: usize| CameraSegment {
            ray: Ray {
                origin: Vec3::new(0.0, 0.0, -2.0),
                dir: Vec3::new(i as f32 * 1e-4, 0.0, 1.0).normalize(),
            },
            length: 4.0,
            beta: Rgb::ONE,
            medium: 0,
            pixel: i as u16,
            way: Way::default(),
            part: Part::Volume,
            wave: None,
            steps: 0,
        };
        let segments: Vec<CameraSegment> = (0..BLOCK).map(segment).collect();
        let steps = StepFunctions::default();
        for vectors in Vectors::available() {
            let gather = Gather {
                map: &map,
                medium: &medium,
                steps: &steps,
                scene: None,
                group: None,
                wave: None,
                key: 0,
                vectors,
            };
            let all = || black_box(gather.along(&segments)).evaluations;
            assert_eq!(all(), (BEAMS * BLOCK) as u64, "every pair counts");
            group.throughput(Throughput::Elements(all()));
            group.bench_function(format!("{name}, {vectors:?}"), |b| b.iter(all));
        }
    }
    group.finish();
}

/// Per function of the distance that is kept.
fn walking(criterion: &mut Criterion) {
    const RAYS: usize = 64;
    let mut group = criterion.benchmark_group("walk");
    group.throughput(Throughput::Elements(RAYS as u64));
    let lumps = lumps();
    let rays: Vec<Ray> = (0..RAYS)
        .map(|i| Ray {
            origin: Vec3::ZERO,
            dir: uniform_sphere(Sampler::new(3, 0, Purpose::Test, i as u64).next_2d()),
        })
        .collect();
    let estimators = [
        Estimator::FreeFlight { distances: 1 },
        Estimator::FreeFlight { distances: 16 },
        Estimator::RatioTracking,
        Estimator::ResidualRatioTracking,
    ];
    for estimator in estimators {
        let medium = heterogeneous(&lumps, Phase::Isotropic, estimator);
        let mut sampler = Sampler::new(4, 0, Purpose::Test, 0);
        let mut steps = StepFunctions::default();
        group.bench_function(estimator.to_string(), |b| {
            b.iter(|| {
                steps.clear();
                for ray in &rays {
                    if let Some(track) = medium.track(ray, 10.0) {
                        black_box(medium.walk(&track, &mut sampler, &mut steps));
                    }
                }
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(50)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2));
    targets = gathering, peak, walking
}
criterion_main!(benches);
