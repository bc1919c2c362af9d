//! One beam and one segment in a varying density: the device and the processor's estimate, given the same transmittance
//! along both.

use super::estimate::{KEY, PAIRS, pair, quarters};
use super::sampler;
use crate::beams::{Brought, Piece, Scattering, Segment};
use crate::kernels::Needs;
use crate::testing::tested;
use crate::world::tests::volumes::world;
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{CameraSegment, Gather, Vectors};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::mix64;
use beamfarm_render::world::medium::transmittance::StepFunctions;
use beamfarm_render::world::medium::{Heterogeneous, Medium};
use bytemuck::{Pod, Zeroable};

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Pair {
    segment: Segment,
    piece: Piece,
    medium: Scattering,
    key: [u32; 2],
    spare: [u32; 2],
}

/// One estimate of the transmittance along a ray, with its steps as words.
fn function(medium: &Heterogeneous, ray: &Ray, length: f32, number: u64) -> (StepFunctions, u32, Vec<u32>) {
    let mut functions = StepFunctions::default();
    let id = match medium.track(ray, length) {
        Some(track) => medium.walk(&track, &mut sampler(number), &mut functions),
        None => functions.begin(),
    };
    let function = functions.get(id);
    let steps = (0..).map_while(|n| function.step(n));
    let words = steps.flat_map(|(distance, step)| {
        let [x, y, z] = step.value.to_array();
        [distance, x, y, z, step.depth, step.decay].map(f32::to_bits)
    });
    let words = words.collect();
    (functions, id, words)
}

#[test]
fn what_a_piece_brings_is_the_processors_where_the_density_varies() {
    let Some(tested) = tested() else { return };
    let (media, world) = world();
    let mut chance = sampler(17);
    let (mut pairs, mut own) = (Vec::new(), Vec::new());
    let (mut beam_words, mut segment_words) = (Vec::new(), Vec::new());
    const BEAMS: u32 = 12_000;
    beam_words.resize(2 * BEAMS as usize, 0);
    for i in 0..BEAMS {
        let number = i as usize % media.len();
        let Medium::Heterogeneous(medium) = &media[number] else {
            continue;
        };
        let (mut segment, mut piece) = pair(&mut chance, i);
        // Moves it to where the clumps are.
        let shift = |p: [f32; 3]| (Vec3::from(p) * 0.4 + Vec3::new(0.6, 0.9, 1.0)).to_array();
        (segment.origin, piece.origin) = (shift(segment.origin), shift(piece.origin));
        // Scaled along with it.
        for length in [
            &mut segment.length,
            &mut piece.start,
            &mut piece.end,
            &mut piece.radius,
            &mut piece.max_radius,
        ] {
            *length *= 0.4;
        }
        piece.medium = number as u32;
        segment.medium = number as u32;
        let rays = [(segment.origin, segment.dir), (piece.origin, piece.dir)].map(|(origin, dir)| Ray {
            origin: origin.into(),
            dir: dir.into(),
        });
        let (steps, of_segment, words) = function(medium, &rays[0], segment.length, u64::from(2 * i));
        (segment.steps, segment.step_count) = (segment_words.len() as u32, words.len() as u32 / 6);
        segment_words.extend(words);
        let (along_beam, of_beam, words) = function(medium, &rays[1], piece.end.max(0.0), u64::from(2 * i + 1));
        beam_words[2 * i as usize] = beam_words.len() as u32;
        beam_words[2 * i as usize + 1] = words.len() as u32 / 6;
        beam_words.extend(words);

        let beam = PhotonBeam {
            origin: piece.origin.into(),
            dir: piece.dir.into(),
            length: piece.end,
            extent: [piece.start, piece.end],
            power: piece.power.into(),
            radius: piece.radius,
            radius_slope: piece.radius_slope,
            medium: number as u16,
            group: None,
            wave: None,
            steps: of_beam,
            walls: [0; 2],
        };
        let map = BeamMap::new(Traced {
            beams: vec![beam],
            steps: along_beam,
            ..Traced::default()
        });
        let gather = Gather {
            map: &map,
            medium: &media[number],
            steps: &steps,
            scene: None,
            group: None,
            wave: None,
            key: KEY,
            vectors: Vectors::Baseline,
        };
        let mut camera = CameraSegment::new(rays[0], segment.length, Rgb::ONE, number as u16);
        camera.pixel = segment.pixel as u16;
        camera.steps = of_segment;
        own.push(gather.along(&[camera]).radiance[0]);
        for quarter in quarters(&piece) {
            // The processor addresses chords by the beam's number, which is 0 there: the same random numbers.
            let of_beam = |beam: u32| mix64(u64::from(beam) << 32 | u64::from(segment.pixel));
            let key = KEY ^ of_beam(0) ^ of_beam(i);
            pairs.push(Pair {
                segment,
                piece: Piece { beam: i, ..quarter },
                medium: Scattering::from(&media[number]),
                key: [key as u32, (key >> 32) as u32],
                spare: [0; 2],
            });
        }
    }
    let needs = Needs {
        varies: true,
        ..Needs::ALL
    };
    let kernel = tested.kernel_for(&PAIRS, "main", needs);
    let device = &tested.device;
    let volumes = device.buffer("volumes", &world.volumes).unwrap();
    let source = device.buffer("pairs", &pairs).unwrap();
    let results = device.empty("results", 16 * pairs.len() as u64).unwrap();
    let beam_steps = device.buffer("beams", &beam_words).unwrap();
    let segment_steps = device.buffer("segments", &segment_words).unwrap();
    let mut work = device.work();
    let groups = crate::device::Groups::Count(pairs.len().div_ceil(64) as u32);
    let buffers = [&source, &results, &volumes, &beam_steps, &segment_steps];
    work.run(&kernel, &buffers, groups).unwrap();
    work.submit().unwrap();
    let got: Vec<Brought> = device.read(&results, pairs.len()).unwrap();
    let (mut met, mut other) = ([0; 2], 0);
    for (four, (got, own)) in pairs.chunks(4).zip(got.chunks(4).zip(&own)) {
        let cosine = Vec3::from(four[0].segment.dir).dot(four[0].piece.dir.into());
        let sum = got.iter().map(|b| Rgb::from(b.radiance)).sum::<Rgb>();
        met[usize::from(1.0 - cosine * cosine < 0.01)] += u32::from(*own != Rgb::ZERO);
        let off = (sum - *own).abs().max_element();
        other += u32::from(off.is_nan() || off > 2e-5 * own.max_element());
    }
    println!("crossing and nearly parallel {met:?}, {other} others");
    assert!(met[0] > 100 && met[1] > 50, "{met:?}");
    // At a step of a function, rounding decides the side.
    assert!(other <= 3, "{other} of {met:?}");
}
