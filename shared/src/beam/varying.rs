//! What a heterogeneous medium adds to the estimate: density and transmittance, for eight segments side by side.

use super::PhotonBeam;
use super::estimate::{CameraSegment, LANES, Lanes};
use crate::math::{Rgb, Vec3, exp_rgb_neg};
use crate::medium::Heterogeneous;
use crate::medium::bricks::Bricks;
use crate::medium::transmittance::{StepFunction, StepFunctions};

/// Segments with more steps than this are looked up by bisection, one by one; the others all at once.
const FEW_STEPS: usize = 64;

/// Segments of a group in a heterogeneous medium.
pub(super) struct Varying<'a> {
    bricks: &'a Bricks,
    sigma_t: Rgb,
    /// The segments in the samples' space.
    origin: [Lanes; 3],
    dir: [Lanes; 3],
    /// Transmittance along the segments.
    segments: [StepFunction<'a>; LANES],
    /// Distances of their steps: the n-th of each, infinite in lanes that have none. Empty when a segment has many.
    distances: Vec<Lanes>,
    /// Transmittance along the beams.
    beams: &'a StepFunctions,
}

/// Density and transmittance at points of eight segments and one beam.
pub(super) struct Attenuation {
    /// Density at the points.
    pub density: Lanes,
    /// Product of the two values, by channel.
    pub transmitted: [Lanes; 3],
    /// Density times length of both that is in closed form: exp(-sigma_t depth) is left to be multiplied.
    pub depth: Lanes,
}

impl<'a> Varying<'a> {
    pub fn new(
        medium: &'a Heterogeneous,
        group: &[CameraSegment],
        steps: &'a StepFunctions,
        beams: &'a StepFunctions,
    ) -> Self {
        let map = medium.to_samples();
        let (mut origin, mut dir) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        let mut segments = [StepFunction::EMPTY; LANES];
        for (l, segment) in group.iter().enumerate() {
            let (o, d) = (
                map.transform_point3(segment.ray.origin),
                map.transform_vector3(segment.ray.dir),
            );
            for c in 0..3 {
                origin[c][l] = o[c];
                dir[c][l] = d[c];
            }
            segments[l] = steps.get(segment.steps);
        }
        let most = segments.iter().map(StepFunction::steps).max().unwrap_or(0);
        let nth = |n: usize| segments.map(|f| f.distance(n).unwrap_or(f32::INFINITY));
        let distances = match most <= FEW_STEPS {
            true => (0..most).map(nth).collect(),
            false => Vec::new(),
        };
        Self {
            bricks: medium.bricks(),
            sigma_t: medium.sigma_t(),
            origin,
            dir,
            segments,
            distances,
            beams,
        }
    }

    /// At distances `t` along the segments and `s` along the beam, where `hit` is 1. With `GREY` the red
    /// channel stands for all.
    #[inline(always)]
    pub fn attenuation<const GREY: bool>(
        &self,
        beam: &PhotonBeam,
        hit: &[u32; LANES],
        t: &Lanes,
        s: &Lanes,
    ) -> Attenuation {
        let channels = if GREY { 1 } else { 3 };
        let mut points = [[0.0; LANES]; 3];
        for c in 0..3 {
            for l in 0..LANES {
                let t = if hit[l] != 0 { t[l] } else { 0.0 };
                points[c][l] = self.origin[c][l] + self.dir[c][l] * t;
            }
        }
        let mut out = Attenuation {
            density: self.bricks.densities(&points),
            transmitted: [[1.0; LANES]; 3],
            depth: [0.0; LANES],
        };

        // Along the beam, neighbouring segments mostly meet the same step.
        let function = self.beams.get(beam.steps);
        let (mut nearest, mut farthest) = (f32::INFINITY, f32::NEG_INFINITY);
        for l in 0..LANES {
            let (near, far) = if hit[l] != 0 {
                (s[l], s[l])
            } else {
                (f32::INFINITY, f32::NEG_INFINITY)
            };
            nearest = if near < nearest { near } else { nearest };
            farthest = if far > farthest { far } else { farthest };
        }
        for (distance, step) in function.between(nearest, farthest) {
            let value = step.value.to_array();
            for l in 0..LANES {
                let beyond = s[l] >= *distance;
                let depth = step.depth + step.decay * (s[l] - distance);
                out.depth[l] = if beyond { depth } else { out.depth[l] };
                for c in 0..channels {
                    let before = out.transmitted[c][l];
                    out.transmitted[c][l] = if beyond { value[c] } else { before };
                }
            }
        }

        // Along the segments: counted or bisected.
        let mut reached = [0u32; LANES];
        for distance in &self.distances {
            for l in 0..LANES {
                reached[l] = reached[l].wrapping_add((t[l] >= distance[l]) as u32);
            }
        }
        for l in 0..LANES {
            if hit[l] == 0 {
                continue;
            }
            let function = &self.segments[l];
            let (value, depth) = match self.distances.is_empty() {
                true => function.step_at(t[l]),
                false => function.after(reached[l] as usize, t[l]),
            };
            for c in 0..channels {
                out.transmitted[c][l] *= value[c];
            }
            out.depth[l] += depth;
        }
        out
    }

    /// Density and transmittance for a point at `t` along a segment and `s` along a beam.
    pub fn attenuation_at(&self, beam: &PhotonBeam, lane: usize, t: f32, s: f32) -> Rgb {
        let at = |c: usize| self.origin[c][lane] + self.dir[c][lane] * t;
        let density = self.bricks.density(Vec3::new(at(0), at(1), at(2)));
        let (tr_segment, decayed_segment) = self.segments[lane].step_at(t);
        let (tr_beam, decayed_beam) = self.beams.get(beam.steps).step_at(s);
        let decayed = exp_rgb_neg(self.sigma_t * -(decayed_segment + decayed_beam));
        tr_segment * tr_beam * decayed * density
    }
}
