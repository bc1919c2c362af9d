//! What a heterogeneous medium adds to the estimate: density and transmittance, for eight segments side by side.

use super::PhotonBeam;
use super::estimate::{CameraSegment, LANES, Lanes};
use crate::math::{Rgb, Vec3, exp_rgb_neg};
use crate::medium::Heterogeneous;
use crate::medium::bricks::Bricks;
use crate::medium::transmittance::{Step, StepFunction, StepFunctions};

/// Segments with more steps than this are looked up by bisection, one by one; the others all at once.
const FEW_STEPS: usize = 16;

/// Segments of a group in a heterogeneous medium.
pub(super) struct Varying<'a> {
    bricks: &'a Bricks,
    sigma_t: Rgb,
    /// The segments in the samples' space.
    origin: [Lanes; 3],
    dir: [Lanes; 3],
    /// Transmittance along the segments.
    segments: [StepFunction<'a>; LANES],
    /// The same, step by step, when no segment has many.
    lanes: Vec<StepLanes>,
    /// Transmittance along the beams.
    beams: &'a StepFunctions,
}

/// The n-th steps of eight functions; infinitely far in lanes that have none.
#[derive(Clone, Copy)]
struct StepLanes {
    distance: Lanes,
    value: [Lanes; 3],
    decay: Lanes,
}

/// Density and transmittance at points of eight segments and one beam.
pub(super) struct Attenuation {
    /// Density at the points.
    pub density: Lanes,
    /// Product of the two values, by channel.
    pub transmitted: [Lanes; 3],
    /// Density times length that both have decayed by since: exp(-sigma_t depth) is left to be multiplied.
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
        let lanes = match most <= FEW_STEPS {
            true => (0..most).map(|n| StepLanes::new(&segments, n)).collect(),
            false => Vec::new(),
        };
        Self {
            bricks: medium.bricks(),
            sigma_t: medium.sigma_t(),
            origin,
            dir,
            segments,
            lanes,
            beams,
        }
    }

    /// At distances `t` along the segments and `s` along the beam, which are finite where `hit`. With `GREY` the red
    /// channel stands for all.
    #[inline(always)]
    pub fn attenuation<const GREY: bool>(
        &self,
        beam: &PhotonBeam,
        hit: &[bool; LANES],
        t: &Lanes,
        s: &Lanes,
    ) -> Attenuation {
        let channels = if GREY { 1 } else { 3 };
        let mut points = [[0.0; LANES]; 3];
        for c in 0..3 {
            for l in 0..LANES {
                let t = if hit[l] { t[l] } else { 0.0 };
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
            let (near, far) = if hit[l] {
                (s[l], s[l])
            } else {
                (f32::INFINITY, f32::NEG_INFINITY)
            };
            nearest = if near < nearest { near } else { nearest };
            farthest = if far > farthest { far } else { farthest };
        }
        for (distance, step) in function.between(nearest, farthest) {
            step_over::<GREY>(
                &mut out,
                s,
                &[*distance; LANES],
                &step.value.to_array().map(|v| [v; LANES]),
                &[step.decay; LANES],
            );
        }

        let mut along = Attenuation {
            density: [0.0; LANES],
            transmitted: [[1.0; LANES]; 3],
            depth: [0.0; LANES],
        };
        if self.lanes.is_empty() {
            for l in 0..LANES {
                if hit[l] {
                    let (value, depth) = self.segments[l].step_at(t[l]);
                    for c in 0..channels {
                        along.transmitted[c][l] = value[c];
                    }
                    along.depth[l] = depth;
                }
            }
        } else {
            for step in &self.lanes {
                step_over::<GREY>(&mut along, t, &step.distance, &step.value, &step.decay);
            }
        }
        for l in 0..LANES {
            for c in 0..channels {
                out.transmitted[c][l] *= along.transmitted[c][l];
            }
            out.depth[l] += along.depth[l];
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

/// Takes the lanes over a step that are beyond it.
#[inline(always)]
fn step_over<const GREY: bool>(
    out: &mut Attenuation,
    at: &Lanes,
    distance: &Lanes,
    value: &[Lanes; 3],
    decay: &Lanes,
) {
    for l in 0..LANES {
        let beyond = at[l] >= distance[l];
        let depth = decay[l] * (at[l] - distance[l]);
        out.depth[l] = if beyond { depth } else { out.depth[l] };
        out.transmitted[0][l] = if beyond {
            value[0][l]
        } else {
            out.transmitted[0][l]
        };
        if !GREY {
            out.transmitted[1][l] = if beyond {
                value[1][l]
            } else {
                out.transmitted[1][l]
            };
            out.transmitted[2][l] = if beyond {
                value[2][l]
            } else {
                out.transmitted[2][l]
            };
        }
    }
}

impl StepLanes {
    fn new(functions: &[StepFunction; LANES], n: usize) -> Self {
        let mut lanes = Self {
            distance: [f32::INFINITY; LANES],
            value: [[1.0; LANES]; 3],
            decay: [0.0; LANES],
        };
        for (l, function) in functions.iter().enumerate() {
            if let Some((distance, Step { value, decay })) = function.step(n) {
                lanes.distance[l] = distance;
                for c in 0..3 {
                    lanes.value[c][l] = value[c];
                }
                lanes.decay[l] = decay;
            }
        }
        lanes
    }
}
