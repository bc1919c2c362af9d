//! The 1D estimate: one beam and the segments of a block, side by side.

// Loops over lanes by number are what becomes vector code.
#![allow(clippy::needless_range_loop)]

use super::super::PhotonBeam;
use super::super::varying::Varying;
use super::{CameraSegment, Gather, LANES, Lanes, NEARLY_PARALLEL_SIN2};
use crate::math::{PI, Rgb, Vec3, exp_neg};
use crate::medium::Medium;
use crate::medium::transmittance::StepFunctions;
use crate::phase::{Phase, PhaseLobe};

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
    pub key: u64,
}

/// What the estimate needs of a beam, and of the origin that the segments share.
pub(super) struct BeamLine {
    origin: Vec3,
    dir: Vec3,
    /// From the shared origin to the beam's, and its product with the beam's direction.
    w: Vec3,
    w_dot_dir: f32,
    /// dir x w: its product with a segment's direction is the distance of the lines times the sine.
    moment: Vec3,
    max_radius2: f32,
    radius: f32,
    radius_slope: f32,
    start: f32,
    end: f32,
    /// Times sigma_s.
    power: Rgb,
    pub steps: u32,
    /// The beam's, in the map.
    index: u32,
}

/// Segments side by side, and what is gathered along them.
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
    /// In a heterogeneous medium.
    pub varying: Option<Varying<'a>>,
}

impl<'a> Shared<'a> {
    /// `origin`: of the rays, if they share one.
    pub fn new(gather: &Gather<'a>, origin: Vec3) -> Self {
        let medium = gather.medium;
        Self {
            origin,
            sigma_s: medium.sigma_s(),
            sigma_t: medium.sigma_t(),
            phase: medium.phase(),
            lobes: medium.phase().lobes(),
            beam_steps: gather.map.steps(),
            key: gather.key,
        }
    }

    #[inline(always)]
    pub fn line(&self, beam: &PhotonBeam, index: u32) -> BeamLine {
        let w = beam.origin - self.origin;
        let max_radius = beam.max_radius();
        BeamLine {
            origin: beam.origin,
            dir: beam.dir,
            w,
            w_dot_dir: w.dot(beam.dir),
            moment: beam.dir.cross(w),
            max_radius2: max_radius * max_radius,
            radius: beam.radius,
            radius_slope: beam.radius_slope,
            start: beam.extent[0],
            end: beam.extent[1],
            power: beam.power * self.sigma_s,
            steps: beam.steps,
            index,
        }
    }
}

impl<'a> Block<'a> {
    /// At most as many segments as there are lanes.
    pub fn new(gather: &Gather<'a>, segments: &'a [CameraSegment]) -> Self {
        let lane = |f: &dyn Fn(&CameraSegment) -> f32, unused: f32| {
            let mut lanes = [unused; LANES];
            for (lane, segment) in lanes.iter_mut().zip(segments) {
                *lane = f(segment);
            }
            lanes
        };
        Self {
            dir: [0, 1, 2].map(|c| lane(&|s| s.ray.dir[c], if c == 0 { 1.0 } else { 0.0 })),
            origin: [0, 1, 2].map(|c| lane(&|s| s.ray.origin[c], 0.0)),
            length: lane(&|s| s.length, 0.0),
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

    /// Adds one beam by the estimate that is due in each lane. `PINHOLE`: the segments share the origin that the line is
    /// for.
    #[inline(always)]
    pub fn add<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
        &mut self,
        shared: &Shared,
        beams: &[PhotonBeam],
        line: &BeamLine,
    ) {
        let mut chords = [0; LANES];
        if self.add_beam::<GREY, LOBES, VARYING, PINHOLE>(shared, line, &mut chords) {
            self.add_chords(shared, &beams[line.index as usize], line.index, &chords);
        }
    }

    /// Adds one beam by the 1D estimate. `PINHOLE`: the segments share the origin that the line is for. `chords`: which lanes are nearly parallel
    /// to the beam and near it. True: some are.
    ///
    /// With c the cosine between segment and beam, w from origin to origin, the nearest points of the lines are at
    /// t = (w.d - c w.b) / sin^2 along the segment and s = (c w.d - w.b) / sin^2 along the beam, |w.(d x b)| / sin apart.
    #[inline(always)]
    fn add_beam<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
        &mut self,
        shared: &Shared,
        line: &BeamLine,
        chords: &mut [u32; LANES],
    ) -> bool {
        let (p, b) = (line.origin, line.dir);
        let (start, end) = (line.start, line.end);
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.dir;

        // Distance of the lines against the largest radius, without a division.
        let (mut cos, mut sin2) = ([0.0; LANES], [0.0; LANES]);
        let (mut offset, mut w_dot_d) = ([0.0; LANES], [0.0; LANES]);
        let mut w_dot_b = [line.w_dot_dir; LANES];
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
            sin2[l] = 1.0 - cos[l] * cos[l];
            // With room for what the sine of the smallest angles is off by.
            chords[l] = (sin2[l] < NEARLY_PARALLEL_SIN2) as u32
                & (offset[l] * offset[l] <= 1.01 * line.max_radius2 * (sin2[l] + 1e-5)) as u32;
            reached[l] = (offset[l] * offset[l] < line.max_radius2 * sin2[l]) as u32
                & (sin2[l] >= NEARLY_PARALLEL_SIN2) as u32;
        }
        // Rays from everywhere mostly miss.
        if !PINHOLE && !any(&reached) {
            return any(chords);
        }

        let (mut along_segment, mut along_beam) = ([0.0; LANES], [0.0; LANES]);
        let (mut value, mut depth) = ([0.0; LANES], [0.0; LANES]);
        let mut hit = [0u32; LANES];
        for l in 0..LANES {
            // One division serves both 1 / sin^2 and 1 / radius.
            let s_sin2 = cos[l] * w_dot_d[l] - w_dot_b[l];
            let r_sin2 = line.radius * sin2[l] + line.radius_slope * s_sin2;
            let inv = 1.0 / (sin2[l] * r_sin2);
            let inv_sin2 = inv * r_sin2;
            let inv_r_sin2 = inv * sin2[l];
            let t = (w_dot_d[l] - cos[l] * w_dot_b[l]) * inv_sin2;
            let s = s_sin2 * inv_sin2;
            // (u / r)^2 with u = offset / sin.
            let x = offset[l] * inv_r_sin2;
            let x = x * x * sin2[l];
            hit[l] = reached[l]
                & (t > 0.0) as u32
                & (t < self.length[l]) as u32
                & (s > start) as u32
                & (s < end) as u32
                & (x < 1.0) as u32;
            let mut v = 0.75 * (1.0 - x) * sin2[l].sqrt() * inv_r_sin2;
            if LOBES > 0 {
                // Light that travels along the beam is turned towards the camera, against the segment.
                let [first, second] = &shared.lobes;
                v *= match LOBES {
                    1 => first.eval(-cos[l]),
                    _ => first.eval(-cos[l]) + second.eval(-cos[l]),
                };
            } else {
                v *= 1.0 / (4.0 * PI);
            }
            along_segment[l] = if hit[l] != 0 { t } else { 0.0 };
            along_beam[l] = if hit[l] != 0 { s } else { 0.0 };
            value[l] = if hit[l] != 0 { v } else { 0.0 };
            depth[l] = along_segment[l] + along_beam[l];
        }
        for l in 0..LANES {
            self.evaluations[l] += hit[l];
        }
        // What varies costs more than to look whether it is needed.
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

/// Whether any lane is set.
#[inline(always)]
fn any(lanes: &[u32; LANES]) -> bool {
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
