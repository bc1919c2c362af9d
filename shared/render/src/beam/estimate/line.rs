//! One beam and the segments of a block, side by side.

// Loops over lanes by number are what becomes vector code.
#![allow(clippy::needless_range_loop)]

use super::super::lanes::{LANES, Lanes};
use super::super::store::PieceRange;
use super::block::{Block, Shared};
use super::kind::Kind;
use super::meeting::Meeting;
use super::pairs::{Cone, Pair, Pairs, attenuated};
use crate::math::{Rgb, Vec3};

/// How many beams ahead what is known along a beam is fetched from memory.
const FETCH_NUMBER: usize = 8;
const FETCH_STEPS: usize = 3;

/// What the estimate needs of a piece of a beam, and of the origin that the segments share.
pub(super) struct BeamLine {
    origin: Vec3,
    dir: Vec3,
    /// From the shared origin to the beam's, and its product with the beam's direction.
    w: Vec3,
    w_dot_dir: f32,
    /// dir x w: its product with a segment's direction is the distance of the lines times the sine.
    moment: Vec3,
    max_radius: f32,
    radius: f32,
    radius_slope: f32,
    /// Times sigma_s.
    power: Rgb,
    steps: u32,
    piece: PieceRange,
}

impl BeamLine {
    /// Of a piece of one of the beams.
    #[inline(always)]
    pub fn new(shared: &Shared, piece: PieceRange) -> Self {
        let beam = &shared.beams[piece.beam as usize];
        let w = beam.origin - shared.origin;
        let max_radius = beam.radius_at(piece.start).max(beam.radius_at(piece.end));
        Self {
            origin: beam.origin,
            dir: beam.dir,
            w,
            w_dot_dir: w.dot(beam.dir),
            moment: beam.dir.cross(w),
            max_radius,
            radius: beam.radius,
            radius_slope: beam.radius_slope,
            power: beam.power * shared.sigma_s,
            steps: beam.steps,
            piece,
        }
    }

    #[inline(always)]
    fn cone(&self) -> Cone {
        Cone {
            radius: self.radius,
            radius_slope: self.radius_slope,
            start: self.piece.start,
            end: self.piece.end,
        }
    }
}

impl Block<'_> {
    /// Adds beams by the estimate that is due in each lane. `near`: positions among the lines, which are for the
    /// segments' origin where they share one.
    #[inline(always)]
    pub fn add_lines<K: Kind>(&mut self, shared: &Shared, lines: &[BeamLine], near: &[u32]) {
        for (i, &at) in near.iter().enumerate() {
            if K::VARYING {
                if let Some(&next) = near.get(i + FETCH_NUMBER) {
                    let steps = lines[next as usize].steps;
                    shared.beam_steps.prefetch_number(steps);
                }
                if let Some(&next) = near.get(i + FETCH_STEPS) {
                    shared.beam_steps.prefetch(lines[next as usize].steps);
                }
            }
            let line = &lines[at as usize];
            let mut chords = [0; LANES];
            self.add_line::<K>(shared, line, &mut chords);
            if any(&chords) {
                self.add_chords(shared, line.piece, &chords);
            }
        }
    }

    /// Adds one beam by the 1D estimate. `chords`: set to 1 in lanes that are nearly parallel to the beam and near it.
    #[inline(always)]
    fn add_line<K: Kind>(&mut self, shared: &Shared, line: &BeamLine, chords: &mut [u32; LANES]) {
        let cone = line.cone();
        let (mut cos, mut offset) = ([0.0; LANES], [0.0; LANES]);
        let (mut w_dot_d, mut w_dot_b) = ([0.0; LANES], [0.0; LANES]);
        let mut reached = [0u32; LANES];
        for l in 0..LANES {
            let meeting = self.meeting::<K>(line, l);
            (cos[l], offset[l]) = (meeting.cos, meeting.offset);
            (w_dot_d[l], w_dot_b[l]) = (meeting.w_dot_d, meeting.w_dot_b);
            chords[l] = meeting.is_chord(line.max_radius, cone.start, cone.end) as u32;
            reached[l] = meeting.is_reached(line.max_radius) as u32;
        }
        // Rays from everywhere mostly miss.
        if !K::PINHOLE && !any(&reached) {
            return;
        }
        let (mut along_segment, mut along_beam) = ([0.0; LANES], [0.0; LANES]);
        let (mut value, mut depth) = ([0.0; LANES], [0.0; LANES]);
        let mut hit = [0u32; LANES];
        for l in 0..LANES {
            let meeting = Meeting {
                cos: cos[l],
                offset: offset[l],
                w_dot_d: w_dot_d[l],
                w_dot_b: w_dot_b[l],
            };
            let pair = Pair::new::<K>(shared, meeting, reached[l], cone, self.length[l]);
            (hit[l], value[l]) = (pair.hit, pair.value);
            (along_segment[l], along_beam[l]) = (pair.along_segment, pair.along_beam);
            depth[l] = pair.along_segment + pair.along_beam;
        }
        for l in 0..LANES {
            self.evaluations[l] += hit[l];
        }
        // What varies costs more than to look whether it is needed.
        if K::VARYING && !any(&hit) {
            return;
        }
        let mut transmitted = [[1.0; LANES]; 3];
        if K::VARYING
            && let Some(varying) = &self.varying
        {
            let at = varying.attenuation::<K>(line.steps, &hit, &along_segment, &along_beam);
            value = attenuated::<K>(&value, &at);
            (transmitted, depth) = (at.transmitted, at.depth);
        }
        let pairs = Pairs {
            value: &value,
            transmitted: &transmitted,
            depth: &depth,
        };
        let power = line.power.to_array();
        let radiance = &mut self.radiance;
        pairs.add_to::<K>(shared, |c, _| power[c], |c, l, v| radiance[c][l] += v);
    }

    #[inline(always)]
    fn meeting<K: Kind>(&self, line: &BeamLine, l: usize) -> Meeting {
        let lane = |v: &[Lanes; 3]| Vec3::new(v[0][l], v[1][l], v[2][l]);
        let dir = lane(&self.dir);
        match K::PINHOLE {
            true => Meeting::from_origin(dir, line.dir, line.w, line.w_dot_dir, line.moment),
            false => Meeting::new(lane(&self.origin), dir, line.origin, line.dir),
        }
    }
}

/// Whether any lane is set.
#[inline(always)]
fn any(lanes: &[u32; LANES]) -> bool {
    let mut any = 0;
    for l in 0..LANES {
        any |= lanes[l];
    }
    any != 0
}
