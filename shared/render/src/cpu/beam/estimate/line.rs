//! The 1D estimate of one beam and a block of segments side by side.

// Loops over lane numbers compile to vector code.
#![allow(clippy::needless_range_loop)]

use super::super::PhotonBeam;
use super::super::lanes::{LANES, Lanes};
use super::super::store::{BeamMap, PieceRange};
use super::super::walls::{self, Plane};
use super::varying::Varying;
use super::{CameraSegment, Gather, NEARLY_PARALLEL_SIN, NEARLY_PARALLEL_SIN2};
use crate::cpu::kernel;
use crate::math::{PI, Rgb, Vec3, exp_neg};
use crate::world::Scene;
use crate::world::medium::Medium;
use crate::world::medium::transmittance::StepFunctions;
use crate::world::phase::{Phase, PhaseLobe};

/// What all segments share.
pub(super) struct Shared<'a> {
    /// The origin of all rays, if they share one.
    origin: Vec3,
    pub sigma_s: Rgb,
    pub sigma_t: Rgb,
    pub phase: Phase,
    lobes: [PhaseLobe; 2],
    /// Transmittance along the beams.
    pub beam_steps: &'a StepFunctions,
    map: &'a BeamMap,
    scene: Option<&'a Scene>,
    /// Some segment leaves the scene's bounding box.
    escapes: bool,
    pub key: u64,
}

/// How the lines of a beam and a segment lie to each other. Let w go from the segment's origin to the beam's, and d and
/// b be their directions. The lines are nearest at t = (w.d - c w.b) / sin^2 along the segment and s = (c w.d - w.b) /
/// sin^2 along the beam, and |w.(d x b)| / sin apart.
#[derive(Clone, Copy)]
pub(super) struct Meeting {
    /// d.b
    pub cos: f32,
    /// Distance between the lines, times the sine.
    pub offset: f32,
    pub w_dot_d: f32,
    pub w_dot_b: f32,
}

/// Where two lines are nearest.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    /// Along the segment.
    pub t: f32,
    /// Along the beam.
    pub s: f32,
    /// Distance over radius, squared.
    pub x: f32,
    /// Kernel over sine, m^-1, valid where x < 1.
    pub value: f32,
}

impl Meeting {
    /// The meeting of a segment with a beam.
    #[inline(always)]
    pub fn new(origin: Vec3, dir: Vec3, beam_origin: [f32; 3], beam_dir: [f32; 3]) -> Self {
        let ([px, py, pz], [bx, by, bz]) = (beam_origin, beam_dir);
        let (wx, wy, wz) = (px - origin.x, py - origin.y, pz - origin.z);
        let mx = by * wz - bz * wy;
        let my = bz * wx - bx * wz;
        let mz = bx * wy - by * wx;
        Self {
            cos: dir.x * bx + dir.y * by + dir.z * bz,
            offset: dir.x * mx + dir.y * my + dir.z * mz,
            w_dot_d: dir.x * wx + dir.y * wy + dir.z * wz,
            w_dot_b: wx * bx + wy * by + wz * bz,
        }
    }

    /// The sine squared.
    #[inline(always)]
    pub fn sin2(self) -> f32 {
        1.0 - self.cos * self.cos
    }

    /// Distance along the segment, times the sine squared.
    #[inline(always)]
    pub fn t_sin2(self) -> f32 {
        self.w_dot_d - self.cos * self.w_dot_b
    }

    /// Distance along the beam, times the sine squared.
    #[inline(always)]
    pub fn s_sin2(self) -> f32 {
        self.cos * self.w_dot_d - self.w_dot_b
    }

    /// Whether to integrate the chord: the lines are nearly parallel, and come within the radius of each other
    /// somewhere between `start` and `end` along the beam.
    #[inline(always)]
    pub fn is_chord(self, radius: f32, start: f32, end: f32) -> bool {
        let sin2 = self.sin2();
        // A chord reaches beyond the nearest points, by up to radius / sine.
        let beyond = NEARLY_PARALLEL_SIN * radius;
        // Leaves room for rounding in the sine of very small angles.
        (sin2 < NEARLY_PARALLEL_SIN2)
            & (self.offset * self.offset <= 1.01 * radius * radius * (sin2 + 1e-5))
            & (self.s_sin2() + beyond >= start * sin2)
            & (self.s_sin2() - beyond <= end * sin2)
    }

    /// Whether the 1D estimate is due and the lines come within `radius`. Needs no division.
    #[inline(always)]
    pub fn is_reached(self, radius: f32) -> bool {
        (self.offset * self.offset < radius * radius * self.sin2()) & (self.sin2() >= NEARLY_PARALLEL_SIN2)
    }

    /// The nearest points, for a beam's radius and its slope.
    #[inline(always)]
    pub fn nearest(self, radius: f32, radius_slope: f32) -> Nearest {
        // One division serves both 1 / sin^2 and 1 / radius.
        let sin2 = self.sin2();
        let s_sin2 = self.s_sin2();
        let r_sin2 = radius * sin2 + radius_slope * s_sin2;
        let inv = 1.0 / (sin2 * r_sin2);
        let inv_sin2 = inv * r_sin2;
        let inv_r_sin2 = inv * sin2;
        // (u / r)^2 with u = offset / sin.
        let x = self.offset * inv_r_sin2;
        let x = x * x * sin2;
        Nearest {
            t: self.t_sin2() * inv_sin2,
            s: s_sin2 * inv_sin2,
            x,
            value: kernel::on_line(x) * sin2.sqrt() * inv_r_sin2,
        }
    }
}

/// What the estimate needs from a beam, and from the origin that the segments share.
pub(super) struct BeamLine {
    origin: Vec3,
    dir: Vec3,
    /// From the shared origin to the beam's, and the product of that with the beam's direction.
    w: Vec3,
    w_dot_dir: f32,
    /// dir x w: its product with a segment's direction is the distance between the lines times the sine.
    moment: Vec3,
    max_radius: f32,
    radius: f32,
    radius_slope: f32,
    /// The beam's power times sigma_s.
    power: Rgb,
    pub steps: u32,
    piece: PieceRange,
}

/// Segments side by side, and what they gather.
pub(super) struct Block<'a> {
    dir: [Lanes; 3],
    origin: [Lanes; 3],
    /// Zero in unused lanes, so that nothing is found there.
    length: Lanes,
    /// Red, green, blue.
    pub radiance: [Lanes; 3],
    /// Pairs that contributed.
    pub evaluations: [u32; LANES],
    pub segments: &'a [CameraSegment],
    /// Only in a heterogeneous medium.
    pub varying: Option<Varying<'a>>,
}

impl<'a> Shared<'a> {
    /// What these segments share. The first one's origin counts if they share it.
    pub fn new(gather: &Gather<'a>, segments: &[CameraSegment]) -> Self {
        let (medium, origin) = (gather.medium, segments[0].ray.origin);
        let hull = gather.scene.filter(|scene| scene.is_closed).map(|scene| scene.hull);
        let leaves = |[low, high]: [Vec3; 2], segment: &CameraSegment| {
            let end = segment.ray.at(segment.length);
            let far = 1e-5 * (low.abs().max(high.abs())).max_element();
            (end.cmplt(low - far) | end.cmpgt(high + far)).any()
        };
        Self {
            origin,
            sigma_s: medium.sigma_s(),
            sigma_t: medium.sigma_t(),
            phase: medium.phase(),
            lobes: medium.phase().lobes(),
            beam_steps: gather.map.steps(),
            map: gather.map,
            scene: gather.scene,
            escapes: hull.is_some_and(|hull| segments.iter().any(|segment| leaves(hull, segment))),
            key: gather.key,
        }
    }

    /// The phase function, for the cosine between segment and beam. Light travelling along the beam turns towards the
    /// camera, against the segment.
    #[inline(always)]
    pub fn phase<const LOBES: usize>(&self, cos: f32) -> f32 {
        let [first, second] = &self.lobes;
        match LOBES {
            0 => 1.0 / (4.0 * PI),
            1 => first.eval(-cos),
            _ => first.eval(-cos) + second.eval(-cos),
        }
    }

    /// The range along a piece in which no wall matters.
    #[inline(always)]
    pub fn clear(&self, piece: PieceRange) -> [f32; 2] {
        match self.escapes {
            true => [f32::INFINITY, f32::NEG_INFINITY],
            false => piece.clear,
        }
    }

    /// Whether a wall stands between a point of a segment and what that point sees of a beam.
    #[inline(always)]
    pub fn is_hidden(&self, beam: &PhotonBeam, point: Vec3, s: f32) -> bool {
        let planes = self.map.walls_of(beam);
        let distance2 = beam.dir.cross(point - beam.origin).length_squared();
        let may_hide = |plane: &Plane| plane.is_near(s) && plane.reaches(distance2) && plane.hides(point.to_array());
        planes.iter().any(may_hide) && (self.scene).is_some_and(|scene| walls::hide(scene, beam, planes, point, s))
    }

    /// The line of a piece of a beam.
    #[inline(always)]
    pub fn line(&self, beams: &[PhotonBeam], piece: PieceRange) -> BeamLine {
        let beam = &beams[piece.beam as usize];
        let w = beam.origin - self.origin;
        let max_radius = beam.radius_at(piece.start).max(beam.radius_at(piece.end));
        BeamLine {
            origin: beam.origin,
            dir: beam.dir,
            w,
            w_dot_dir: w.dot(beam.dir),
            moment: beam.dir.cross(w),
            max_radius,
            radius: beam.radius,
            radius_slope: beam.radius_slope,
            power: beam.power * self.sigma_s,
            steps: beam.steps,
            piece,
        }
    }
}

impl<'a> Block<'a> {
    /// A block of at most `LANES` segments.
    pub fn new(gather: &Gather<'a>, segments: &'a [CameraSegment]) -> Self {
        let (mut dir, mut origin) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        let mut length = [0.0; LANES];
        dir[0] = [1.0; LANES];
        for (l, segment) in segments.iter().enumerate().take(LANES) {
            for c in 0..3 {
                dir[c][l] = segment.ray.dir[c];
                origin[c][l] = segment.ray.origin[c];
            }
            length[l] = segment.length;
        }
        Self {
            dir,
            origin,
            length,
            radiance: [[0.0; LANES]; 3],
            evaluations: [0; LANES],
            segments,
            varying: match gather.medium {
                Medium::Homogeneous(_) => None,
                Medium::Heterogeneous(medium) => {
                    let (steps, beams) = (gather.steps, gather.map.steps());
                    Some(Varying::new(medium, segments, steps, beams))
                }
            },
        }
    }

    /// Adds one beam, by the estimate that is due in each lane. `PINHOLE`: the segments share the origin that the line
    /// was computed for.
    #[inline(always)]
    pub fn add<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
        &mut self,
        shared: &Shared,
        beams: &[PhotonBeam],
        line: &BeamLine,
    ) {
        let mut chords = [0; LANES];
        let is_walled = shared.clear(line.piece) != PieceRange::ALL_CLEAR;
        let has_chords = match is_walled {
            false => self.add_beam::<GREY, LOBES, VARYING, PINHOLE, false>(shared, beams, line, &mut chords),
            true => self.add_beam::<GREY, LOBES, VARYING, PINHOLE, true>(shared, beams, line, &mut chords),
        };
        if has_chords {
            self.add_chords(shared, beams, line.piece, &chords);
        }
    }

    /// Adds one beam by the 1D estimate. `PINHOLE`: the segments share the origin that the line was computed for.
    /// `chords`: set for lanes nearly parallel to the beam and near it. `WALLED`: walls are near. Returns whether any
    /// chord is set.
    #[inline(always)]
    fn add_beam<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool, const WALLED: bool>(
        &mut self,
        shared: &Shared,
        beams: &[PhotonBeam],
        line: &BeamLine,
        chords: &mut [u32; LANES],
    ) -> bool {
        let (p, b) = (line.origin, line.dir);
        let (start, end) = (line.piece.start, line.piece.end);
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.dir;

        let (mut cos, mut offset) = ([0.0; LANES], [0.0; LANES]);
        let (mut w_dot_d, mut w_dot_b) = ([0.0; LANES], [line.w_dot_dir; LANES]);
        let mut reached = [0u32; LANES];
        for l in 0..LANES {
            let (mut wx, mut wy, mut wz) = (line.w.x, line.w.y, line.w.z);
            let (mut mx, mut my, mut mz) = (line.moment.x, line.moment.y, line.moment.z);
            if !PINHOLE {
                (wx, wy, wz) = (p.x - ox[l], p.y - oy[l], p.z - oz[l]);
                mx = b.y * wz - b.z * wy;
                my = b.z * wx - b.x * wz;
                mz = b.x * wy - b.y * wx;
                w_dot_b[l] = wx * b.x + wy * b.y + wz * b.z;
            }
            cos[l] = dx[l] * b.x + dy[l] * b.y + dz[l] * b.z;
            offset[l] = dx[l] * mx + dy[l] * my + dz[l] * mz;
            w_dot_d[l] = dx[l] * wx + dy[l] * wy + dz[l] * wz;
            let meeting = Meeting {
                cos: cos[l],
                offset: offset[l],
                w_dot_d: w_dot_d[l],
                w_dot_b: w_dot_b[l],
            };
            chords[l] = meeting.is_chord(line.max_radius, start, end) as u32;
            reached[l] = meeting.is_reached(line.max_radius) as u32;
        }
        // Rays with different origins mostly miss.
        if !PINHOLE && !any(&reached) {
            return any(chords);
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
            let at = meeting.nearest(line.radius, line.radius_slope);
            hit[l] = reached[l]
                & (at.t > 0.0) as u32
                & (at.t < self.length[l]) as u32
                & (at.s > start) as u32
                & (at.s <= end) as u32
                & (at.x < 1.0) as u32;
            let v = at.value * shared.phase::<LOBES>(cos[l]);
            along_segment[l] = if hit[l] != 0 { at.t } else { 0.0 };
            // Before its start, where its kernel reaches beyond the surface it starts on, the beam is as strong as at
            // the start.
            along_beam[l] = if hit[l] != 0 { at.s.max(0.0) } else { 0.0 };
            value[l] = if hit[l] != 0 { v } else { 0.0 };
            depth[l] = along_segment[l] + along_beam[l];
        }
        if WALLED {
            let [low, high] = shared.clear(line.piece);
            let mut asks = [0u32; LANES];
            for l in 0..LANES {
                asks[l] = hit[l] & ((along_beam[l] <= low) | (along_beam[l] >= high)) as u32;
            }
            if any(&asks) {
                let beam = &beams[line.piece.beam as usize];
                self.hide(shared, beam, &asks, &along_segment, &along_beam, &mut hit);
                for l in 0..LANES {
                    value[l] = if hit[l] != 0 { value[l] } else { 0.0 };
                }
            }
        }
        for l in 0..LANES {
            self.evaluations[l] += hit[l];
        }
        // Looking up density and transmittance costs more than checking whether they are needed.
        if VARYING && !any(&hit) {
            return any(chords);
        }
        let power = line.power;
        let mut transmitted = [[1.0; LANES]; 3];
        if VARYING && let Some(varying) = &self.varying {
            let at = varying.attenuation::<GREY>(line.steps, &hit, &along_segment, &along_beam);
            for l in 0..LANES {
                let v = value[l] * at.density[l];
                value[l] = if GREY { v * at.transmitted[0][l] } else { v };
            }
            (transmitted, depth) = (at.transmitted, at.depth);
        }
        let [red, green, blue] = &mut self.radiance;
        if GREY {
            for l in 0..LANES {
                let v = value[l] * exp_neg(-shared.sigma_t.x * depth[l]);
                red[l] += v * power.x;
                green[l] += v * power.y;
                blue[l] += v * power.z;
            }
        } else {
            let sigma_t = shared.sigma_t;
            let [tr_red, tr_green, tr_blue] = &transmitted;
            add::<VARYING>(red, &value, &depth, tr_red, sigma_t.x, power.x);
            add::<VARYING>(green, &value, &depth, tr_green, sigma_t.y, power.y);
            add::<VARYING>(blue, &value, &depth, tr_blue, sigma_t.z, power.z);
        }
        any(chords)
    }
}

impl Block<'_> {
    /// Clears those hits among `asks` where a wall hides the beam.
    #[inline(always)]
    fn hide(
        &self,
        shared: &Shared,
        beam: &PhotonBeam,
        asks: &[u32; LANES],
        t: &Lanes,
        s: &Lanes,
        hit: &mut [u32; LANES],
    ) {
        let ([ox, oy, oz], [dx, dy, dz]) = (&self.origin, &self.dir);
        let mut behind = [0u32; LANES];
        let planes = shared.map.walls_of(beam);
        for plane in planes {
            for l in 0..LANES {
                let point = [ox[l] + dx[l] * t[l], oy[l] + dy[l] * t[l], oz[l] + dz[l] * t[l]];
                behind[l] |= asks[l] & (plane.is_near(s[l]) & plane.hides(point)) as u32;
            }
        }
        if any(&behind) {
            for l in 0..LANES {
                let ray = &self.segments[l.min(self.segments.len() - 1)].ray;
                if behind[l] != 0 && shared.is_hidden(beam, ray.at(t[l]), s[l]) {
                    hit[l] = 0;
                }
            }
        }
    }
}

/// Whether any lane is set.
#[inline(always)]
pub(super) fn any(lanes: &[u32; LANES]) -> bool {
    let mut any = 0;
    for l in 0..LANES {
        any |= lanes[l];
    }
    any != 0
}

/// Adds one channel.
#[inline(always)]
fn add<const VARYING: bool>(
    sum: &mut Lanes,
    value: &Lanes,
    depth: &Lanes,
    transmitted: &Lanes,
    sigma_t: f32,
    power: f32,
) {
    for l in 0..LANES {
        let mut tr = exp_neg(-sigma_t * depth[l]);
        if VARYING {
            tr *= transmitted[l];
        }
        sum[l] += value[l] * tr * power;
    }
}
