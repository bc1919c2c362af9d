//! The mean over many sets of beams, against closed forms.

use super::{media, sampler, scatterings};
use crate::beams::{Beam, Brought, Gather, Pieces, Segment, Segments, Way};
use crate::testing::tested;

/// Parallel light through a medium: beams along z, from a rectangle that exceeds the examined region by the kernels'
/// width.
const LENGTH: f64 = 1.0;
const START: f64 = 2.0;
const SIDES: [f32; 2] = [1.8, 0.8];

/// Single scattering along a segment at an angle to the beams:
/// sigma_s phase(-cos) E integral of e^(-sigma_t (t + START + t cos)).
fn expected(medium: usize, channel: usize, cos: f64) -> f64 {
    let medium = &media()[medium];
    let sigma_s = f64::from(medium.sigma_s[channel]);
    let sigma_t = f64::from(medium.sigma_t()[channel]);
    let g = f64::from(medium.phase.mean_cosine());
    // Light travels against the segment.
    let x = 1.0 + g * g + 2.0 * g * cos;
    let phase = (1.0 - g * g) / (4.0 * std::f64::consts::PI * x * x.sqrt());
    let irradiance = 1.0 / f64::from(SIDES[0] * SIDES[1]);
    let rate = sigma_t * (1.0 + cos);
    let integral = if rate < 1e-9 {
        LENGTH
    } else {
        (1.0 - libm::exp(-rate * LENGTH)) / rate
    };
    sigma_s * phase * irradiance * libm::exp(-sigma_t * START) * integral
}

#[test]
fn means_of_many_sets_are_single_scattering() {
    let Some(tested) = tested() else { return };
    let device = &tested.device;
    let (sets, count) = (100u64, 400u32);
    // Crossing, and nearly parallel either way: below six degrees chords are integrated.
    let degrees = [90.0f64, 40.0, 140.0, 3.0, 177.0];
    let segments: Vec<Segment> = (0..3 * degrees.len() as u32)
        .map(|i| {
            let angle = degrees[i as usize / 3].to_radians();
            Segment {
                origin: [0.0, 0.0, START as f32],
                length: LENGTH as f32,
                dir: [libm::sin(angle) as f32, 0.0, libm::cos(angle) as f32],
                medium: i % 3,
                pixel: i,
                ..Segment::default()
            }
        })
        .collect();
    let pieces = Pieces::new(tested, 3 * count).unwrap();
    let gather = Gather::new(tested, 3 * count).unwrap();
    let beam_count = device.buffer("count of beams", &[3 * count]).unwrap();
    let segment_count = device.buffer("count of segments", &[segments.len() as u32]).unwrap();
    let segment_buffer = device.buffer("segments", &segments).unwrap();
    let media = device.buffer("media", &scatterings()).unwrap();
    let mut sums = vec![[[0.0f64; 2]; 3]; segments.len()];
    for set in 0..sets {
        let mut sampler = sampler(1000 + set);
        let beams: Vec<Beam> = (0..3 * count)
            .map(|i| {
                let [u, v] = sampler.next_2d().to_array();
                Beam {
                    origin: [(u - 0.2) * SIDES[0], (v - 0.5) * SIDES[1], 0.0],
                    radius: 0.08 + 0.04 * sampler.next_1d(),
                    dir: [0.0, 0.0, 1.0],
                    radius_slope: 0.02,
                    power: [1.0 / count as f32; 3],
                    length: 4.0,
                    extent: [-0.1, 4.0 + sampler.next_1d()],
                    medium: i % 3,
                    walls: 0,
                }
            })
            .collect();
        let of = Segments {
            count: &segment_count,
            segments: &segment_buffer,
            media: &media,
            key: &device.buffer("key", &[set]).unwrap(),
            varying: None,
            light_group: None,
        };
        let film = device.empty("gathered", 16 * segments.len() as u64).unwrap();
        let beam_buffer = device.buffer("beams", &beams).unwrap();
        let mut work = device.work();
        pieces.run(&mut work, &beam_count, &beam_buffer).unwrap();
        gather.run(&mut work, Way::ByTile, &of, &pieces, &film).unwrap();
        work.submit().unwrap();
        let film = device.read::<Brought>(&film, segments.len()).unwrap();
        for (sums, brought) in sums.iter_mut().zip(film) {
            for (sum, value) in sums.iter_mut().zip(brought.radiance) {
                sum[0] += f64::from(value);
                sum[1] += f64::from(value) * f64::from(value);
            }
        }
    }
    let n = sets as f64;
    for (segment, sums) in segments.iter().zip(&sums) {
        for (channel, [sum, squares]) in sums.iter().enumerate() {
            let mean = sum / n;
            let error = ((squares / n - mean * mean) / (n - 1.0)).sqrt();
            let expected = expected(segment.medium as usize, channel, f64::from(segment.dir[2]));
            let z = (mean - expected) / error;
            // Four standard errors, none above three per cent.
            assert!(
                z.abs() < 4.0,
                "{segment:?} {channel}: {mean} and not {expected}, z = {z}"
            );
            assert!(error < 0.03 * expected, "{segment:?} {channel}: {error} of {expected}");
        }
    }
}
