//! One piece and one segment: the device, its twin, and the processor's estimate agree.

use super::{dir, dir_at, media, point, sampler, scatterings};
use crate::beams::{Brought, Piece, Scattering, Segment};
use crate::kernels::{
    ARITHMETIC, ATTENUATION, BEAM, ESTIMATE, GROUPS, MATH, OPEN, Program, SAMPLER, VECTORS, VOLUMES, WIDE,
};
use crate::testing::{results, tested};
use crate::twin::beams::brought;
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{CameraSegment, Gather, Vectors};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::Sampler;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::medium::transmittance::StepFunctions;
use bytemuck::{Pod, Zeroable};

pub(super) const KEY: u64 = 0x0123_4567_89ab_cdef;

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Pair {
    segment: Segment,
    piece: Piece,
    medium: Scattering,
    key: [u32; 2],
    spare: [u32; 2],
}

pub(super) const PAIRS: Program = Program {
    name: "pairs_of_beams_and_segments",
    texts: &[
        ARITHMETIC,
        GROUPS,
        crate::testing::EACH,
        WIDE,
        MATH,
        VECTORS,
        SAMPLER,
        BEAM,
        OPEN,
        VOLUMES,
        ATTENUATION,
        ESTIMATE,
        "struct Pair { segment: Segment, piece: Piece, medium: Scattering, key: vec2u }
        @group(0) @binding(0) var<storage, read> pairs: array<Pair>;
        @group(0) @binding(1) var<storage, read_write> results: array<Brought>;
        fn each(i: u32) {
            if (i >= arrayLength(&pairs)) { return; }
            results[i] = brought(pairs[i].segment, pairs[i].piece, pairs[i].medium, pairs[i].key, 0u);
        }",
    ],
};

/// A piece and a segment that mostly meet: crossing, nearly parallel either way, around the angle where chords begin,
/// at either's ends, with narrow kernels, of zero length.
pub(super) fn pair(sampler: &mut Sampler, number: u32) -> (Segment, Piece) {
    let beam_dir = dir(sampler);
    let sine = match number % 5 {
        0 | 1 => sampler.next_1d(),
        2 => 0.1 * sampler.next_1d(),
        3 => 0.1 + 1e-4 * (sampler.next_1d() - 0.5),
        _ => [0.0, 1e-7, 1e-4, 1.0][sampler.next_u32() as usize % 4],
    };
    let sign = if sampler.next_1d() < 0.5 { -1.0 } else { 1.0 };
    let segment_dir = sign * dir_at(sampler, beam_dir, sine);
    let radius = match number % 7 {
        0 => 1e-6,
        1 => 1.0,
        _ => 0.01 + 0.1 * sampler.next_1d(),
    };
    let length = |sampler: &mut Sampler| match sampler.next_u32() % 16 {
        0 => 0.0,
        1 => 1e-5,
        _ => 3.0 * sampler.next_1d(),
    };
    // At the ends, and slightly beyond.
    let along = |sampler: &mut Sampler, length: f32| match sampler.next_u32() % 8 {
        0 => 0.0,
        1 => length,
        2 => length * (1.0 + 1e-6),
        _ => (1.1 * sampler.next_1d() - 0.05) * length,
    };
    let (start, size) = (2.0 * sampler.next_1d() - 0.3, length(sampler));
    let segment_length = length(sampler);
    let (s, t) = (start + along(sampler, size), along(sampler, segment_length));
    let apart = dir_at(sampler, beam_dir, 1.0) * (1.1 * radius * sampler.next_1d());
    let apart = match beam_dir.cross(segment_dir).try_normalize() {
        Some(normal) if !number.is_multiple_of(3) => normal * apart.length(),
        _ => apart,
    };
    let meeting = point(sampler, 2.0);
    let radius_slope = 0.1 * radius * (2.0 * sampler.next_1d() - 1.0);
    let radius_at = |s: f32| radius + radius_slope * s;
    let piece = Piece {
        origin: (meeting - beam_dir * s).to_array(),
        start,
        dir: beam_dir.to_array(),
        end: start + size,
        power: [1.0, 0.5 + sampler.next_1d(), sampler.next_1d()],
        radius,
        radius_slope,
        max_radius: radius_at(start).max(radius_at(start + size)),
        beam: sampler.next_u32() % 1000,
        medium: number % 4,
    };
    let segment = Segment {
        origin: (meeting + apart - segment_dir * t).to_array(),
        length: segment_length,
        dir: segment_dir.to_array(),
        medium: number % 4,
        pixel: sampler.next_u32() % 4096,
        ..Segment::default()
    };
    (segment, piece)
}

fn is_nearly_parallel(segment: &Segment, piece: &Piece) -> bool {
    let [d, b] = [segment.dir, piece.dir].map(Vec3::from_array);
    let cos = d.x * b.x + d.y * b.y + d.z * b.z;
    1.0 - cos * cos < 0.1 * 0.1
}

#[test]
fn what_a_piece_brings_has_the_twins_bits() {
    let Some(tested) = tested() else { return };
    let (mut sampler, media) = (sampler(3), scatterings());
    let count = 250_000u32;
    let pairs: Vec<Pair> = (0..count)
        .map(|i| {
            let (segment, piece) = pair(&mut sampler, i);
            Pair {
                segment,
                piece,
                medium: media[i as usize % 4],
                key: [KEY as u32, (KEY >> 32) as u32],
                spare: [0; 2],
            }
        })
        .collect();
    let got: Vec<Brought> = results(tested, &PAIRS, &pairs, pairs.len(), pairs.len());
    let bits = |b: Brought| (b.radiance.map(f32::to_bits), b.count);
    let (mut crossing, mut parallel) = (0, 0);
    for (pair, got) in pairs.iter().zip(got) {
        let expected = brought(&pair.segment, &pair.piece, &pair.medium, KEY);
        assert_eq!(bits(got), bits(expected), "{got:?} {expected:?} {pair:?}");
        match is_nearly_parallel(&pair.segment, &pair.piece) {
            true => parallel += got.count,
            false => crossing += got.count,
        }
    }
    // Most of either kind meet, and many of either do not.
    assert!(crossing > count / 8 && parallel > count / 8, "{crossing} {parallel}");
    assert!(crossing + parallel < count * 9 / 10);
}

/// The processor cuts a single beam into four pieces.
pub(super) fn quarters(piece: &Piece) -> [Piece; 4] {
    let [start, size] = [piece.start, piece.end - piece.start];
    let at = |n: u8| match n {
        4 => piece.end,
        _ => start + size * (f32::from(n) / 4.0),
    };
    [0, 1, 2, 3].map(|n| {
        let radius_at = |s: f32| piece.radius + piece.radius_slope * s;
        Piece {
            start: at(n),
            end: at(n + 1),
            max_radius: radius_at(at(n)).max(radius_at(at(n + 1))),
            beam: 0,
            ..*piece
        }
    })
}

/// Bits agree where a single piece contributes; several are summed in another order.
#[test]
fn the_twin_is_the_processors_estimate() {
    let (mut sampler, media, scatterings) = (sampler(4), media(), scatterings());
    let steps = StepFunctions::default();
    let mut met = [0; 2];
    for i in 0..6000 {
        let (segment, piece) = pair(&mut sampler, i);
        let medium = i as usize % 4;
        let beam = PhotonBeam {
            origin: piece.origin.into(),
            dir: piece.dir.into(),
            length: piece.end,
            extent: [piece.start, piece.end],
            power: piece.power.into(),
            radius: piece.radius,
            radius_slope: piece.radius_slope,
            medium: 0,
            group: None,
            wave: None,
            steps: 0,
            walls: [0; 2],
        };
        let map = BeamMap::new(Traced {
            beams: vec![beam],
            ..Traced::default()
        });
        let homogeneous = Medium::Homogeneous(media[medium]);
        let gather = Gather {
            map: &map,
            medium: &homogeneous,
            steps: &steps,
            scene: None,
            group: None,
            wave: None,
            key: KEY,
            vectors: Vectors::Baseline,
        };
        let ray = Ray {
            origin: segment.origin.into(),
            dir: segment.dir.into(),
        };
        let mut camera = CameraSegment::new(ray, segment.length, Rgb::ONE, 0);
        camera.pixel = segment.pixel as u16;
        let gathered = gather.along(&[camera]);
        // A beam of zero length has no pieces there.
        let all = match piece.end > piece.start {
            true => quarters(&piece).map(|piece| brought(&segment, &piece, &scatterings[medium], KEY)),
            false => [Brought::default(); 4],
        };
        let expected = all.iter().fold(Rgb::ZERO, |sum, b| sum + Rgb::from_array(b.radiance));
        let count: u32 = all.iter().map(|b| b.count).sum();
        let got = gathered.radiance[0];
        assert_eq!(gathered.evaluations, u64::from(count), "{segment:?} {piece:?}");
        let off = (got - expected).abs().max_element();
        let bound = if count > 1 { 1e-6 * expected.max_element() } else { 0.0 };
        assert!(off <= bound, "{got} {expected} {segment:?} {piece:?}");
        met[usize::from(is_nearly_parallel(&segment, &piece))] += count;
    }
    assert!(met[0] > 500 && met[1] > 500, "{met:?}");
}
