//! The chord estimate, for segments that are nearly parallel to a beam.

use super::super::PhotonBeam;
use super::super::lanes::LANES;
use super::super::store::PieceRange;
use super::line::{Block, Shared};
use crate::cpu::kernel;
use crate::math::{PI, Rgb, Vec3, exp_rgb_neg};
use crate::sampler::mix64;

/// Strata along a chord.
const CHORD_POINTS: u32 = 2;

impl Block<'_> {
    /// Adds the chord estimate of these lanes, which are nearly parallel to the beam.
    #[cold]
    #[inline(never)]
    pub fn add_chords(&mut self, shared: &Shared, beams: &[PhotonBeam], piece: PieceRange, lanes: &[u32; LANES]) {
        // Unused lanes find nothing.
        for (l, chord) in lanes.iter().enumerate().take(self.segments.len()) {
            if *chord != 0 {
                self.add_chord(shared, beams, piece, l);
            }
        }
    }

    /// Adds the chord estimate of one lane.
    #[inline(never)]
    pub fn add_chord(&mut self, shared: &Shared, beams: &[PhotonBeam], piece: PieceRange, lane: usize) {
        let pixel = self.segments[lane].pixel;
        let u = mix64(shared.key ^ mix64(((piece.beam as u64) << 32) | pixel as u64));
        let u = (u >> 40) as f32 * (1.0 / (1u32 << 24) as f32);
        let beam = &beams[piece.beam as usize];
        let value = self.chord_estimate(shared, beam, piece, lane, u);
        if value != Rgb::ZERO {
            self.evaluations[lane] += 1;
            for c in 0..3 {
                self.radiance[c][lane] += value[c];
            }
        }
    }

    /// Radiance of one piece of a beam, blurred over discs across it, along a segment. `u` in [0, 1) places the
    /// stratified points.
    fn chord_estimate(&self, shared: &Shared, beam: &PhotonBeam, piece: PieceRange, lane: usize, u: f32) -> Rgb {
        let PieceRange { start, end, .. } = piece;
        let [low, high] = shared.clear(piece);
        let asks = |s: f32| s <= low || s >= high;
        let segment = &self.segments[lane];
        let ray = &segment.ray;
        // In the beam's frame, the ray is |across + t across_dir| from the axis, at s = along + t cos.
        let cos = ray.dir.dot(beam.dir);
        let offset = ray.origin - beam.origin;
        let along = offset.dot(beam.dir);
        let across = offset - beam.dir * along;
        let across_dir = ray.dir - beam.dir * cos;
        let radius = beam.radius_at(start).max(beam.radius_at(end));
        let Some((near, far)) = cylinder_range(across, across_dir, radius) else {
            return Rgb::ZERO;
        };
        // Both ends of the piece; cos is close to 1 or -1 here.
        let (s0, s1) = ((start - along) / cos, (end - along) / cos);
        let near = near.max(s0.min(s1)).max(0.0);
        let far = far.min(s0.max(s1)).min(segment.length);
        if near >= far {
            return Rgb::ZERO;
        }
        let step = (far - near) / CHORD_POINTS as f32;
        let mut sum = Rgb::ZERO;
        for i in 0..CHORD_POINTS {
            let t = near + step * (i as f32 + u);
            let s = (along + t * cos).clamp(start, end);
            let radius = beam.radius_at(s);
            let x = (across + across_dir * t).length_squared() / (radius * radius);
            if x < 1.0 && !(asks(s) && shared.is_hidden(beam, ray.at(t), s)) {
                let kernel = kernel::on_disc(x, PI * radius * radius);
                sum += self.attenuation(shared, beam, lane, t, s.max(0.0)) * kernel;
            }
        }
        let phase = shared.phase.eval_directions(beam.dir, -ray.dir);
        sum * beam.power * shared.sigma_s * (phase * step)
    }

    /// Density and transmittance for a point at `t` along a segment and `s` along a beam.
    fn attenuation(&self, shared: &Shared, beam: &PhotonBeam, lane: usize, t: f32, s: f32) -> Rgb {
        match &self.varying {
            None => exp_rgb_neg(shared.sigma_t * -(t + s)),
            Some(varying) => varying.attenuation_at(beam, lane, t, s),
        }
    }
}

/// The range along a line in which it is within `radius` of the axis.
fn cylinder_range(across: Vec3, across_dir: Vec3, radius: f32) -> Option<(f32, f32)> {
    let a = across_dir.length_squared();
    let c = across.length_squared() - radius * radius;
    let nearest = if a > 0.0 { -across.dot(across_dir) / a } else { 0.0 };
    if a < 1e-12 {
        return (c < 0.0).then_some((f32::NEG_INFINITY, f32::INFINITY));
    }
    let distance2 = (across + across_dir * nearest).length_squared();
    let half2 = (radius * radius - distance2) / a;
    if half2 <= 0.0 {
        return None;
    }
    let half = half2.sqrt();
    Some((nearest - half, nearest + half))
}
