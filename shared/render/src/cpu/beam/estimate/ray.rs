//! The 1D estimate of one segment and several beams side by side, for segments that have few beams in common with their
//! neighbours.

// Loops over lane numbers compile to vector code.
#![allow(clippy::needless_range_loop)]

use super::super::PhotonBeam;
use super::super::lanes::{LANES, Lanes};
use super::super::store::{Bounds, Cluster, PieceList, PieceRange, ROUNDING};
use super::line::{Block, Meeting, Shared, any};
use super::search::Probe;
use super::{CameraSegment, NEARLY_PARALLEL_SIN, NEARLY_PARALLEL_SIN2};
use crate::math::{exp_neg, prefetch};

/// How many beams ahead to fetch from memory.
const FETCH: usize = 2 * LANES;

impl Probe for CameraSegment {
    /// With u from the segment's line to the middle, across the line, the lines are |u . (d x b)| / sin apart, and
    /// nearest at -u . b / sin^2 along the piece.
    #[inline(always)]
    fn may_meet_cluster(&self, cluster: &Cluster, lane: usize) -> bool {
        let pieces = Bounds::of_lane(&cluster.rows, lane);
        let ([px, py, pz], [bx, by, bz]) = (pieces.middle, pieces.dir);
        let (o, d) = (self.ray.origin, self.ray.dir);
        let rounding = ROUNDING * (o.x.abs() + o.y.abs() + o.z.abs());
        let ball = cluster.reach[0][lane] + rounding;
        let across = cluster.reach[1][lane] + rounding;
        let along = cluster.reach[2][lane] + rounding;
        let (wx, wy, wz) = (px - o.x, py - o.y, pz - o.z);
        let t = wx * d.x + wy * d.y + wz * d.z;
        let (ux, uy, uz) = (wx - t * d.x, wy - t * d.y, wz - t * d.z);
        let (nx, ny, nz) = (d.y * bz - d.z * by, d.z * bx - d.x * bz, d.x * by - d.y * bx);
        let offset = ux * nx + uy * ny + uz * nz;
        let cos = d.x * bx + d.y * by + d.z * bz;
        let sin2 = 1.0 - cos * cos;
        // Chords reach beyond the nearest points.
        let parallel_below = NEARLY_PARALLEL_SIN + 0.001 + cluster.ranges[1][lane];
        (ux * ux + uy * uy + uz * uz <= ball * ball)
            & (t + ball >= 0.0)
            & (t - ball <= self.length)
            & (offset.abs() <= across)
            & (((ux * bx + uy * by + uz * bz).abs() <= pieces.half * sin2 + along)
                | (sin2 <= parallel_below * parallel_below))
    }

    /// Uses the conditions of the estimate, times the sine squared, to avoid a division.
    #[inline(always)]
    fn may_meet(&self, piece: Bounds) -> bool {
        let (origin, dir) = (self.ray.origin, self.ray.dir);
        let meeting = Meeting::new(origin, dir, piece.middle, piece.dir);
        let [px, py, pz] = piece.middle;
        // How far rounding may move the middle.
        let rounding = ROUNDING * ((px - origin.x).abs() + (py - origin.y).abs() + (pz - origin.z).abs());
        let radius = 1.0001 * piece.radius + rounding;
        let sin2 = 1.00001 * meeting.sin2() + 1e-5;
        // Chords reach beyond the nearest points.
        let parallel = meeting.sin2() < NEARLY_PARALLEL_SIN2;
        let beyond = rounding + if parallel { NEARLY_PARALLEL_SIN * radius } else { 0.0 };
        (radius > 0.0)
            & (meeting.offset * meeting.offset <= 1.01 * radius * radius * sin2)
            & (meeting.t_sin2() + beyond > 0.0)
            & (meeting.t_sin2() - beyond < self.length * sin2)
            & (meeting.s_sin2().abs() - beyond <= piece.half * sin2)
    }
}

/// Beams side by side.
struct BeamLanes {
    origin: [Lanes; 3],
    dir: [Lanes; 3],
    radius: Lanes,
    radius_slope: Lanes,
    max_radius: Lanes,
    start: Lanes,
    end: Lanes,
    power: [Lanes; 3],
    steps: [u32; LANES],
    /// Where no wall is near.
    clear: [Lanes; 2],
}

impl BeamLanes {
    const NONE: Self = Self {
        origin: [[0.0; LANES]; 3],
        dir: [[1.0; LANES], [0.0; LANES], [0.0; LANES]],
        radius: [1.0; LANES],
        radius_slope: [0.0; LANES],
        // Never reached.
        max_radius: [0.0; LANES],
        start: [0.0; LANES],
        end: [0.0; LANES],
        power: [[0.0; LANES]; 3],
        steps: [0; LANES],
        clear: [[f32::NEG_INFINITY; LANES], [f32::INFINITY; LANES]],
    };

    /// Whether walls are near any of them.
    #[inline(always)]
    fn is_walled(&self) -> bool {
        let mut walled = [0u32; LANES];
        for l in 0..LANES {
            let clear = [self.clear[0][l], self.clear[1][l]];
            walled[l] = (clear != PieceRange::ALL_CLEAR) as u32;
        }
        any(&walled)
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, beam: &PhotonBeam, piece: PieceRange, clear: [f32; 2]) {
        for c in 0..3 {
            self.origin[c][lane] = beam.origin[c];
            self.dir[c][lane] = beam.dir[c];
            self.power[c][lane] = beam.power[c];
        }
        self.radius[lane] = beam.radius;
        self.radius_slope[lane] = beam.radius_slope;
        self.max_radius[lane] = beam.radius_at(piece.start).max(beam.radius_at(piece.end));
        (self.start[lane], self.end[lane]) = (piece.start, piece.end);
        self.steps[lane] = beam.steps;
        (self.clear[0][lane], self.clear[1][lane]) = (clear[0], clear[1]);
    }
}

impl Block<'_> {
    /// Adds beams to the block's only segment, in order, with the same bits as one by one. `near`: positions in the
    /// list.
    #[inline(always)]
    pub fn add_beams<const GREY: bool, const LOBES: usize, const VARYING: bool>(
        &mut self,
        shared: &Shared,
        beams: &[PhotonBeam],
        list: &PieceList,
        near: &[u32],
    ) {
        let piece_at = |at: u32| list.ranges()[at as usize];
        let mut lanes = BeamLanes::NONE;
        for (start, group) in (0..).step_by(LANES).zip(near.chunks(LANES)) {
            for (l, &at) in group.iter().enumerate() {
                if let Some(&next) = near.get(start + FETCH + l) {
                    prefetch(&beams[piece_at(next).beam as usize]);
                }
                let piece = piece_at(at);
                lanes.set(l, &beams[piece.beam as usize], piece, shared.clear(piece));
            }
            for l in group.len()..LANES {
                lanes.max_radius[l] = 0.0;
            }
            let beam_of = |l: usize| &beams[piece_at(group[l]).beam as usize];
            let (added, hit, chords) = match lanes.is_walled() {
                false => self.estimates::<GREY, LOBES, VARYING, false>(shared, &lanes, beam_of),
                true => self.estimates::<GREY, LOBES, VARYING, true>(shared, &lanes, beam_of),
            };
            for (l, &at) in group.iter().enumerate() {
                // These are zero where there is no hit.
                for c in 0..3 {
                    self.radiance[c][0] += added[c][l];
                }
                self.evaluations[0] += hit[l];
                if chords[l] != 0 {
                    self.add_chord(shared, beams, piece_at(at), 0);
                }
            }
        }
    }

    /// What each beam adds, which beams do, and which are nearly parallel to the segment.
    #[inline(always)]
    fn estimates<'b, const GREY: bool, const LOBES: usize, const VARYING: bool, const WALLED: bool>(
        &self,
        shared: &Shared,
        beams: &BeamLanes,
        beam_of: impl Fn(usize) -> &'b PhotonBeam,
    ) -> ([Lanes; 3], [u32; LANES], [u32; LANES]) {
        let segment = &self.segments[0];
        let (o, d) = (segment.ray.origin, segment.ray.dir);
        let [px, py, pz] = &beams.origin;
        let [bx, by, bz] = &beams.dir;
        let (mut hit, mut chords) = ([0u32; LANES], [0u32; LANES]);
        let (mut along_segment, mut along_beam) = ([0.0; LANES], [0.0; LANES]);
        let (mut value, mut depth) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let origin = [px[l], py[l], pz[l]];
            let meeting = Meeting::new(o, d, origin, [bx[l], by[l], bz[l]]);
            let (start, end) = (beams.start[l], beams.end[l]);
            chords[l] = meeting.is_chord(beams.max_radius[l], start, end) as u32;
            let at = meeting.nearest(beams.radius[l], beams.radius_slope[l]);
            let met = meeting.is_reached(beams.max_radius[l])
                & (at.t > 0.0)
                & (at.t < segment.length)
                & (at.s > start)
                & (at.s <= end)
                & (at.x < 1.0);
            let v = at.value * shared.phase::<LOBES>(meeting.cos);
            hit[l] = met as u32;
            along_segment[l] = if met { at.t } else { 0.0 };
            along_beam[l] = if met { at.s.max(0.0) } else { 0.0 };
            value[l] = if met { v } else { 0.0 };
            depth[l] = along_segment[l] + along_beam[l];
        }
        if WALLED {
            let mut asks = [0u32; LANES];
            for l in 0..LANES {
                let is_clear = (along_beam[l] > beams.clear[0][l]) & (along_beam[l] < beams.clear[1][l]);
                asks[l] = hit[l] & !is_clear as u32;
            }
            if any(&asks) {
                for l in 0..LANES {
                    if asks[l] != 0 && shared.is_hidden(beam_of(l), segment.ray.at(along_segment[l]), along_beam[l]) {
                        (hit[l], value[l]) = (0, 0.0);
                    }
                }
            }
        }
        let mut transmitted = [[1.0; LANES]; 3];
        if VARYING && let Some(varying) = &self.varying {
            let at = varying.along_first::<GREY>(&beams.steps, &hit, &along_segment, &along_beam);
            for l in 0..LANES {
                let v = value[l] * at.density[l];
                value[l] = if GREY { v * at.transmitted[0][l] } else { v };
            }
            (transmitted, depth) = (at.transmitted, at.depth);
        }
        let mut added = [[0.0; LANES]; 3];
        let (sigma_s, sigma_t) = (shared.sigma_s, shared.sigma_t);
        for l in 0..LANES {
            if GREY {
                let v = value[l] * exp_neg(-sigma_t.x * depth[l]);
                for c in 0..3 {
                    added[c][l] = v * (beams.power[c][l] * sigma_s[c]);
                }
            } else {
                for c in 0..3 {
                    let mut tr = exp_neg(-sigma_t[c] * depth[l]);
                    if VARYING {
                        tr *= transmitted[c][l];
                    }
                    added[c][l] = value[l] * tr * (beams.power[c][l] * sigma_s[c]);
                }
            }
        }
        (added, hit, chords)
    }
}
