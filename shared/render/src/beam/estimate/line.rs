//! One beam and the segments of a block, side by side.

// Loops over lanes by number are what becomes vector code.
#![allow(clippy::needless_range_loop)]

use super::super::lanes::{LANES, Lanes};
use super::super::store::PieceRange;
use super::block::{Block, Shared};
use super::kind::Kind;
use super::meeting::Meeting;
use super::pairs::{Cone, Pairs};
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

/// Values of [`Meeting`]s, one in each lane.
struct Meetings {
    cos: Lanes,
    offset: Lanes,
    w_dot_d: Lanes,
    w_dot_b: Lanes,
}

impl Meetings {
    #[inline(always)]
    fn set(&mut self, l: usize, meeting: Meeting) {
        self.cos[l] = meeting.cos;
        self.offset[l] = meeting.offset;
        self.w_dot_d[l] = meeting.w_dot_d;
        self.w_dot_b[l] = meeting.w_dot_b;
    }

    #[inline(always)]
    fn get(&self, l: usize) -> Meeting {
        Meeting {
            cos: self.cos[l],
            offset: self.offset[l],
            w_dot_d: self.w_dot_d[l],
            w_dot_b: self.w_dot_b[l],
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
        let mut meetings = Meetings {
            cos: [0.0; LANES],
            offset: [0.0; LANES],
            w_dot_d: [0.0; LANES],
            w_dot_b: [0.0; LANES],
        };
        let mut reached = [0u32; LANES];
        for l in 0..LANES {
            let meeting = self.meeting::<K>(line, l);
            meetings.set(l, meeting);
            chords[l] = meeting.is_chord(line.max_radius, cone.start, cone.end) as u32;
            reached[l] = meeting.is_reached(line.max_radius) as u32;
        }
        // Rays from everywhere mostly miss.
        if !K::PINHOLE && !any(&reached) {
            return;
        }
        let mut pairs = Pairs::new();
        for l in 0..LANES {
            let met = (meetings.get(l), reached[l]);
            pairs.set::<K>(l, shared, met, cone, self.length[l]);
        }
        for l in 0..LANES {
            self.evaluations[l] += pairs.hit[l];
        }
        // What varies costs more than to look whether it is needed.
        if K::VARYING && !any(&pairs.hit) {
            return;
        }
        if K::VARYING
            && let Some(varying) = &self.varying
        {
            let (t, s) = (&pairs.along_segment, &pairs.along_beam);
            let at = varying.attenuation::<K>(line.steps, &pairs.hit, t, s);
            pairs.attenuate::<K>(at);
        }
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
