//! Density and transmittance of a heterogeneous medium, for the segments of a block side by side.

// Loops over lane numbers compile to vector code.
#![allow(clippy::needless_range_loop)]

use super::super::PhotonBeam;
use super::super::lanes::{LANES, Lanes};
use super::CameraSegment;
use crate::math::{Rgb, exp_rgb_neg};
use crate::world::medium::bricks::Bricks;
use crate::world::medium::transmittance::{Step, StepFunction, StepFunctions};
use crate::world::medium::{Albedo, Heterogeneous};

/// Segments with more steps than this are bisected one by one; the others are looked up together.
const FEW_STEPS: usize = 64;

/// A block's segments in a heterogeneous medium.
pub(super) struct Varying<'a> {
    bricks: &'a Bricks,
    albedo: Option<&'a Albedo>,
    sigma_t: Rgb,
    /// The segments in the space of the samples.
    origin: [Lanes; 3],
    dir: [Lanes; 3],
    /// Transmittance along the segments.
    segments: [StepFunction<'a>; LANES],
    /// The same, step by step, if no segment has many.
    lanes: Vec<StepLanes>,
    /// Transmittance along the beams.
    beams: &'a StepFunctions,
}

/// Density and transmittance at points of a block's segments and one beam.
pub(super) struct Attenuation {
    /// Density at the points.
    pub density: Lanes,
    /// Product of both transmittances, and of the albedo where it varies, by channel.
    pub transmitted: [Lanes; 3],
    /// Density times length of both that is in closed form: exp(-sigma_t depth) is yet to be multiplied in.
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
            albedo: medium.albedo(),
            sigma_t: medium.sigma_t(),
            origin,
            dir,
            segments,
            lanes,
            beams,
        }
    }

    /// At the distances `t` along the segments and `s` along the beam, where `hit` is 1. With `GREY`, the red channel
    /// stands for all.
    #[inline(always)]
    pub fn attenuation<const GREY: bool>(
        &self,
        beam_steps: u32,
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

        // Along the segments: step by step, or by bisection.
        if self.lanes.is_empty() {
            for l in 0..LANES {
                if hit[l] != 0 {
                    let (value, depth) = self.segments[l].step_at(t[l]);
                    for c in 0..channels {
                        out.transmitted[c][l] = value[c];
                    }
                    out.depth[l] = depth;
                }
            }
        }
        let mut along = Linear::default();
        for step in &self.lanes {
            let mut beyond = [0u32; LANES];
            for l in 0..LANES {
                beyond[l] = mask(t[l] >= step.distance[l]);
            }
            along.select(&beyond, &step.depth);
            for c in 0..channels {
                select(&mut out.transmitted[c], &beyond, &step.value[c]);
            }
        }
        along.add_at(t, &mut out.depth);

        // Along the beam: neighbouring segments mostly meet the same step.
        let function = self.beams.get(beam_steps);
        let (mut nearest, mut farthest) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        for l in 0..LANES {
            let hit = mask(hit[l] != 0);
            nearest[l] = f32::from_bits((s[l].to_bits() & hit) | (nearest[l].to_bits() & !hit));
            farthest[l] = f32::from_bits((s[l].to_bits() & hit) | (farthest[l].to_bits() & !hit));
        }
        // By halving, which compiles to vector code.
        for half in [8, 4, 2, 1] {
            for l in 0..half {
                let (a, b) = (nearest[l], nearest[l + half]);
                nearest[l] = if a < b { a } else { b };
                let (a, b) = (farthest[l], farthest[l + half]);
                farthest[l] = if a > b { a } else { b };
            }
        }
        let (nearest, farthest) = (nearest[0], farthest[0]);
        let mut along = Linear::default();
        let mut transmitted = [[1.0; LANES]; 3];
        for (distance, step) in function.between(nearest, farthest, &mut 0) {
            let mut beyond = [0u32; LANES];
            for l in 0..LANES {
                beyond[l] = mask(s[l] >= *distance);
            }
            along.select(&beyond, &Linear::new(*distance, step).spread());
            for c in 0..channels {
                select(&mut transmitted[c], &beyond, &[step.value[c]; LANES]);
            }
        }
        along.add_at(s, &mut out.depth);
        for c in 0..channels {
            for l in 0..LANES {
                out.transmitted[c][l] *= transmitted[c][l];
            }
        }
        self.tint::<GREY>(&points, &mut out);
        out
    }

    /// As [`Self::attenuation`], for the first segment and several beams; valid where `hit` is 1.
    #[inline(always)]
    pub fn along_first<const GREY: bool>(
        &self,
        beam_steps: &[u32; LANES],
        hit: &[u32; LANES],
        t: &Lanes,
        s: &Lanes,
    ) -> Attenuation {
        let channels = if GREY { 1 } else { 3 };
        let mut points = [[0.0; LANES]; 3];
        for c in 0..3 {
            for l in 0..LANES {
                points[c][l] = self.origin[c][0] + self.dir[c][0] * t[l];
            }
        }
        let mut out = Attenuation {
            density: self.bricks.densities(&points),
            transmitted: [[1.0; LANES]; 3],
            depth: [0.0; LANES],
        };
        for l in 0..LANES {
            if hit[l] != 0 {
                let (along_segment, segment_depth) = self.segments[0].step_at(t[l]);
                let (along_beam, beam_depth) = self.beams.get(beam_steps[l]).step_at(s[l]);
                out.depth[l] = segment_depth + beam_depth;
                for c in 0..channels {
                    out.transmitted[c][l] = along_segment[c] * along_beam[c];
                }
            }
        }
        self.tint::<GREY>(&points, &mut out);
        out
    }

    /// Multiplies by the albedo where it varies.
    #[inline(always)]
    fn tint<const GREY: bool>(&self, points: &[Lanes; 3], out: &mut Attenuation) {
        if !GREY && let Some(albedo) = self.albedo {
            let albedo = albedo.at(points);
            for c in 0..3 {
                for l in 0..LANES {
                    out.transmitted[c][l] *= albedo[c][l];
                }
            }
        }
    }

    /// Density, albedo where it varies, and transmittance for a point at `t` along a segment and `s` along a beam.
    pub fn attenuation_at(&self, beam: &PhotonBeam, lane: usize, t: f32, s: f32) -> Rgb {
        let at = |c: usize| self.origin[c][lane] + self.dir[c][lane] * t;
        let point = [at(0), at(1), at(2)];
        let density = self.bricks.density(point.into());
        let scatters = match self.albedo {
            None => Rgb::splat(density),
            Some(albedo) => Rgb::from(albedo.at(&point.map(|x| [x])).map(|[x]| x)) * density,
        };
        let (tr_segment, decayed_segment) = self.segments[lane].step_at(t);
        let (tr_beam, decayed_beam) = self.beams.get(beam.steps).step_at(s);
        let decayed = exp_rgb_neg(self.sigma_t * -(decayed_segment + decayed_beam));
        tr_segment * tr_beam * decayed * scatters
    }
}

/// The n-th steps of a block's functions; at infinity in lanes that have none.
struct StepLanes {
    distance: Lanes,
    value: [Lanes; 3],
    depth: Linear<Lanes>,
}

impl StepLanes {
    fn new(functions: &[StepFunction; LANES], n: usize) -> Self {
        let mut lanes = Self {
            distance: [f32::INFINITY; LANES],
            value: [[1.0; LANES]; 3],
            depth: Linear::default(),
        };
        for (l, function) in functions.iter().enumerate() {
            if let Some((distance, step)) = function.step(n) {
                lanes.distance[l] = distance;
                for c in 0..3 {
                    lanes.value[c][l] = step.value[c];
                }
                let depth = Linear::new(distance, &step);
                (lanes.depth.offset[l], lanes.depth.slope[l]) = (depth.offset, depth.slope);
            }
        }
        lanes
    }
}

/// Density times length in closed form, as a function of the distance.
#[derive(Clone, Copy, Default)]
struct Linear<T> {
    offset: T,
    slope: T,
}

impl Linear<f32> {
    #[inline(always)]
    fn new(distance: f32, step: &Step) -> Self {
        Self {
            offset: step.depth - step.decay * distance,
            slope: step.decay,
        }
    }

    #[inline(always)]
    fn spread(self) -> Linear<Lanes> {
        Linear {
            offset: [self.offset; LANES],
            slope: [self.slope; LANES],
        }
    }
}

impl Linear<Lanes> {
    #[inline(always)]
    fn select(&mut self, which: &[u32; LANES], other: &Self) {
        select(&mut self.offset, which, &other.offset);
        select(&mut self.slope, which, &other.slope);
    }

    #[inline(always)]
    fn add_at(&self, distance: &Lanes, sum: &mut Lanes) {
        for l in 0..LANES {
            sum[l] += self.offset[l] + self.slope[l] * distance[l];
        }
    }
}

/// All bits set where true: unlike a branch, it compiles to vector code.
#[inline(always)]
fn mask(is: bool) -> u32 {
    (is as u32).wrapping_neg()
}

#[inline(always)]
fn select(lanes: &mut Lanes, which: &[u32; LANES], other: &Lanes) {
    for l in 0..LANES {
        let bits = (other[l].to_bits() & which[l]) | (lanes[l].to_bits() & !which[l]);
        lanes[l] = f32::from_bits(bits);
    }
}
