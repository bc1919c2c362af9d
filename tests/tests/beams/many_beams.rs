//! Gathering many beams: the bits depend neither on the machine's vector width nor on which segments look for beams
//! together, and no beam that an estimate would count is skipped. Segments share what one of them gathers; in the mean
//! that is what each gathers alone.

use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{CameraSegment, CameraSegments, Gather, Sharing, Vectors, Way};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::plan::aov::{GroupNumber, Part};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp::uniform_sphere;
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::medium::procedural::{Height, Recipe};
use beamfarm_render::world::medium::transmittance::{Estimator, StepFunctions};
use beamfarm_render::world::medium::{Heterogeneous, Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

const SIGMA_A: Rgb = Rgb::new(0.1, 0.0, 0.3);
const SIGMA_S: Rgb = Rgb::new(0.4, 0.2, 0.05);

fn fog(sigma_a: Rgb, sigma_s: Rgb, phase: Phase) -> Medium {
    Medium::Homogeneous(Homogeneous {
        sigma_a,
        sigma_s,
        phase,
    })
}

fn haze(phase: Phase) -> Medium {
    let recipe = Recipe {
        corners: [DVec3::splat(-3.0), DVec3::splat(3.0)],
        voxel: 0.25,
        height: Some(Height { base: -2.0, scale: 3.0 }),
        blobs: Vec::new(),
        noise: None,
        graph: None,
    };
    let raw = recipe.sample().expect("a recipe within limits");
    let bricks = Arc::new(Bricks::new(&raw).expect("samples within limits"));
    let estimator = Estimator::DEFAULT;
    let map = DAffine3::IDENTITY;
    Medium::Heterogeneous(Heterogeneous::new([SIGMA_A, SIGMA_S], phase, estimator, bricks, map))
}

/// One for each instance of the code: one extinction or three, none to two lobes, constant or varying density.
fn media() -> Vec<Medium> {
    let blend = Phase::blend(0.3, [0.8, -0.4]);
    let grey = Rgb::splat(0.3);
    [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.7 }, blend]
        .into_iter()
        .flat_map(|phase| [fog(grey, grey, phase), fog(SIGMA_A, SIGMA_S, phase), haze(phase)])
        .collect()
}

/// Beams all over a cube around the camera: some narrow, some wide, some behind it, some along its axis.
fn beams(medium: &Medium, count: u64) -> BeamMap {
    let mut steps = StepFunctions::default();
    let beams = (0..count)
        .filter_map(|i| {
            let mut sampler = Sampler::new(1, 0, Purpose::Test, i);
            let mut number = || sampler.next_1d();
            let origin = 3.0 * Vec3::new(number(), number(), number()) - 1.5;
            let axis = Vec3::new(0.05 * number(), 0.05 * number(), 1.0).normalize();
            let (length, radius) = (0.1 + 2.0 * number(), 0.001 + 0.06 * number() * number());
            let slope = 0.02 * number() - 0.004;
            let dir = match i % 8 {
                0 => axis,
                1 => -axis,
                _ => uniform_sphere(sampler.next_2d()),
            };
            let ray = Ray { origin, dir };
            let (segment, _) = medium.segment(&ray, length, &mut sampler, &mut steps);
            let segment = segment?;
            let [start, end] = segment.range;
            let radius = radius + slope.abs() * length;
            Some(PhotonBeam {
                origin,
                dir,
                length: end,
                extent: [start - radius, end + radius],
                power: Rgb::new(1.0, 0.5, 0.2),
                radius: 1.5 * radius,
                radius_slope: slope,
                medium: 0,
                group: GroupNumber::new(i as usize % 3),
                wave: None,
                steps: segment.steps,
                walls: [0; 2],
            })
        })
        .collect();
    BeamMap::new(Traced {
        beams,
        steps,
        walls: Vec::new(),
    })
}

/// A camera's rays, from one point or a lens, or in all directions, as behind rough glass.
fn segments(medium: &Medium, kind: u64) -> CameraSegments {
    const SIDE: usize = 24;
    let mut camera = CameraSegments::default();
    for i in 0..SIDE * SIDE {
        let mut sampler = Sampler::new(2, kind, Purpose::Test, i as u64);
        let at = |k: usize| [i % SIDE, i / SIDE][k] as f32 / SIDE as f32 - 0.5;
        let lens = 0.05 * Vec3::new(sampler.next_1d(), sampler.next_1d(), 0.0);
        let ray = match kind {
            0 => Ray {
                origin: Vec3::new(0.0, 0.0, -0.5),
                dir: Vec3::new(at(0), at(1), 1.0).normalize(),
            },
            1 => Ray {
                origin: lens,
                dir: Vec3::new(at(0), at(1), 1.0).normalize(),
            },
            _ => Ray {
                origin: lens,
                dir: uniform_sphere(sampler.next_2d()),
            },
        };
        let length = 0.5 + 2.0 * sampler.next_1d();
        let (segment, _) = medium.segment(&ray, length, &mut sampler, &mut camera.steps);
        let segment = segment.expect("a ray through the medium");
        camera.segments.push(CameraSegment {
            ray,
            length: segment.range[1],
            beta: Rgb::ONE,
            medium: 0,
            pixel: i as u16,
            way: Way::default(),
            part: Part::Volume,
            wave: None,
            steps: segment.steps,
        });
    }
    camera
}

fn bits(radiance: &[Rgb]) -> Vec<[u32; 3]> {
    radiance.iter().map(|v| v.to_array().map(f32::to_bits)).collect()
}

#[test]
fn every_kind_of_vectors_gives_the_same_bits() {
    for medium in media() {
        let map = beams(&medium, 3000);
        for kind in 0..3 {
            let camera = segments(&medium, kind);
            let gathered: Vec<_> = Vectors::available()
                .map(|vectors| {
                    let gather = Gather {
                        map: &map,
                        medium: &medium,
                        steps: &camera.steps,
                        scene: None,
                        group: None,
                        wave: None,
                        key: 7,
                        vectors,
                    };
                    let gathered = gather.along(&camera.segments);
                    (bits(&gathered.radiance), gathered.evaluations)
                })
                .collect();
            assert!(gathered[0].1 > 1000, "beams are met");
            for other in &gathered[1..] {
                assert_eq!(&gathered[0], other, "{medium:?}, rays {kind}");
            }
        }
    }
}

/// A bundle of segments must find what each of its segments finds alone, and that must be all there is.
#[test]
fn no_beam_is_passed_over() {
    let medium = fog(Rgb::splat(0.1), Rgb::splat(0.4), Phase::Isotropic);
    let map = beams(&medium, 4000);
    let steps = StepFunctions::default();
    for kind in 0..3 {
        let camera = segments(&medium, kind);
        let along = |map: &BeamMap, segments: &[CameraSegment]| {
            let gather = Gather {
                map,
                medium: &medium,
                steps: &steps,
                scene: None,
                group: None,
                wave: None,
                key: 7,
                vectors: Vectors::widest(),
            };
            gather.along(segments)
        };
        let together = along(&map, &camera.segments);
        // A single segment's bounds are the segment itself.
        let alone: Vec<Rgb> = camera
            .segments
            .iter()
            .flat_map(|segment| along(&map, std::slice::from_ref(segment)).radiance)
            .collect();
        assert_eq!(bits(&together.radiance), bits(&alone), "rays {kind}");

        // By definition: every pair whose lines come within the radius between their ends.
        let mut pairs = 0;
        for segment in &camera.segments {
            for beam in map.beams() {
                pairs += u64::from(meets(beam, segment));
            }
        }
        let found = together.evaluations;
        // Rounding at the rim of kernels; chords are counted by another rule (a hundredth of the directions).
        let difference = found.abs_diff(pairs) as f64 / pairs as f64;
        assert!(difference < 0.03, "rays {kind}: {found} found, {pairs} there");
    }
}

/// Rays through a square of pixels, past a tilted object that covers half of them.
fn picture(side: usize) -> Vec<CameraSegment> {
    let segment = |i: usize| {
        let mut sampler = Sampler::new(4, 0, Purpose::Test, i as u64);
        let mut at = |k: usize| ([i % side, i / side][k] as f32 + sampler.next_1d()) * 0.01;
        let (x, y) = (at(0) - 0.15, at(1) - 0.15);
        CameraSegment {
            ray: Ray {
                origin: Vec3::new(0.0, 0.0, -0.5),
                dir: Vec3::new(x, y, 1.0).normalize(),
            },
            length: if x < 0.02 { 2.0 } else { 1.2 + 6.0 * y.max(0.0) },
            beta: Rgb::ONE,
            medium: 0,
            pixel: i as u16,
            way: Way::default(),
            part: Part::Volume,
            wave: None,
            steps: 0,
        }
    };
    (0..side * side).map(segment).collect()
}

/// Each segment is given what one near it gathers; its own contribution keeps its bits. The sum over the picture is the
/// same in the mean.
#[test]
fn what_segments_share_is_what_one_of_them_gathers() {
    const SIDE: usize = 32;
    let segments = picture(SIDE);
    let place = |s: &CameraSegment| {
        let (x, y) = (s.pixel as usize % SIDE, s.pixel as usize / SIDE);
        (x as u32, y as u32)
    };
    let ends = |s: &CameraSegment| s.ray.at(s.length);
    let steps = StepFunctions::default();
    // Significance 1e-3.
    let mut suite = Suite::new(1e-3);
    for (phase, name) in [
        (Phase::Isotropic, "isotropic"),
        (Phase::HenyeyGreenstein { g: 0.7 }, "forward"),
    ] {
        let medium = fog(SIGMA_A, SIGMA_S, phase);
        let map = beams(&medium, 600);
        let gather = Gather {
            map: &map,
            medium: &medium,
            steps: &steps,
            scene: None,
            group: None,
            wave: None,
            key: 7,
            vectors: Vectors::widest(),
        };
        let radius = map.mean_radius(0);
        let alone = gather.along(&segments);
        let share = |radius, number| {
            let mut sampler = Sampler::new(5, number, Purpose::Sharing, 0);
            gather.along_shared(&Sharing::new(&segments, radius, place, &mut sampler))
        };
        let (needles, wide) = (share(1e-6, 0), share(radius, 0));
        assert_eq!(bits(&needles.radiance), bits(&alone.radiance), "{name}");
        assert!(
            2 * wide.evaluations < alone.evaluations,
            "{name}: {} evaluations, {} alone",
            wide.evaluations,
            alone.evaluations
        );
        for (i, value) in wide.radiance.iter().enumerate() {
            let given_by = |j: &usize| {
                bits(&alone.radiance[*j..=*j]) == bits(&[*value])
                    && ends(&segments[*j]).distance(ends(&segments[i])) <= 2.0 * radius
            };
            assert!((0..segments.len()).any(|j| given_by(&j)), "{name}: segment {i}");
        }
        let sum = |radiance: &[Rgb]| radiance.iter().map(|v| f64::from(v.element_sum())).sum();
        let expected: f64 = sum(&alone.radiance);
        let mut mean = MeanEstimate::new();
        for number in 0..400 {
            mean.add(sum(&share(radius, number).radiance));
        }
        suite.mean(name.to_owned(), &mean, expected);
    }
    suite.finish();
}

/// In double precision, from the nearest points of the two lines; for nearly parallel ones, from the nearest points of
/// the segments.
fn meets(beam: &PhotonBeam, segment: &CameraSegment) -> bool {
    let (p, b) = (beam.origin.as_dvec3(), beam.dir.as_dvec3());
    let (o, d) = (segment.ray.origin.as_dvec3(), segment.ray.dir.as_dvec3());
    let (w, c) = (p - o, b.dot(d));
    let sin2 = b.cross(d).length_squared();
    let t = (w.dot(d) - c * w.dot(b)) / sin2;
    let s = (c * w.dot(d) - w.dot(b)) / sin2;
    let radius = f64::from(beam.radius) + f64::from(beam.radius_slope) * s;
    let [start, end] = beam.extent.map(f64::from);
    let apart = ((p + b * s) - (o + d * t)).length();
    t > 0.0 && t < f64::from(segment.length) && s > start && s < end && apart < radius
}
