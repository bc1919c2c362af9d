//! Radiance from beams along camera segments.
//!
//! A pair of beam and segment is counted by one of two estimates, by the angle between them:
//! - the 1D estimate of Jarosz et al. 2011 (A comprehensive theory of volumetric radiance estimation using photon points
//!   and beams, eq. 38, beams x beams 1D), everywhere but
//! - where the two are nearly parallel: there 1 / sin theta of the 1D estimate grows without bound, so that the beam is
//!   blurred over the disc across it in place of the line across both, and the segment's chord through that cone is
//!   integrated by stratified random points. Its value is bounded by the chord's length.
//!
//! Both are exact integrals of the same radiance in the limit of thin beams, and each pair of directions belongs to just
//! one of them, so nothing is lost or counted twice.

// Loops over lanes by number are what becomes vector code.
#![allow(clippy::needless_range_loop)]

use super::PhotonBeam;
use super::store::BeamMap;
use super::varying::Varying;
use crate::math::{PI, Ray, Rgb, Vec3, exp_neg, exp_rgb_neg, prefetch};
use crate::medium::Medium;
use crate::medium::transmittance::StepFunctions;
use crate::phase::{Phase, PhaseLobe};
use crate::sampler::mix64;

/// Segments that are evaluated side by side.
pub const LANES: usize = 8;

/// A value for each of them.
pub(super) type Lanes = [f32; LANES];

/// Below this sine of the angle between beam and segment the chord is integrated.
const NEARLY_PARALLEL_SIN: f32 = 0.1;
const NEARLY_PARALLEL_SIN2: f32 = NEARLY_PARALLEL_SIN * NEARLY_PARALLEL_SIN;

/// How many candidates ahead a beam is fetched from memory, and what is known along it.
const FETCH_BEAM: usize = 8;
const FETCH_STEPS: usize = 3;

/// Strata of a chord.
const CHORD_POINTS: u32 = 4;

/// A segment of a camera path inside a scattering medium.
#[derive(Clone, Copy, Debug)]
pub struct CameraSegment {
    /// The segment starts at the ray's origin.
    pub ray: Ray,
    /// Its length, finite.
    pub length: f32,
    /// Throughput from the film to the segment's start.
    pub beta: Rgb,
    /// Index into the scene's media.
    pub medium: u16,
    /// Which pixel, counted within the tile.
    pub pixel: u16,
    /// How many boundaries of media the path crossed straight on before this segment; `None`: it was reflected or
    /// refracted, so that neighbouring pixels' segments need not be near.
    pub straight: Option<u16>,
    /// Number of the segment's transmittance among the [`CameraSegments`]' functions, in a heterogeneous medium.
    pub steps: u32,
}

/// Segments of camera paths, and what is known along them.
#[derive(Clone, Debug, Default)]
pub struct CameraSegments {
    /// The segments.
    pub segments: Vec<CameraSegment>,
    /// Transmittance along those in heterogeneous media.
    pub steps: StepFunctions,
}

impl CameraSegments {
    /// Forget all of them.
    pub fn clear(&mut self) {
        self.segments.clear();
        self.steps.clear();
    }
}

/// Segments that may be given to [`gather`] at once: neighbours, so that most beams matter to few of them or to all.
pub const PACKET: usize = LANES * LANES;

/// Radiance along the segments of a packet, before their throughput.
#[derive(Clone, Debug, Default)]
pub struct PacketRadiance {
    groups: [GroupRadiance; LANES],
}

#[derive(Clone, Copy, Debug, Default)]
struct GroupRadiance {
    /// Red, green, blue, by lane.
    radiance: [Lanes; 3],
    /// Pairs that contributed.
    evaluations: u64,
}

impl PacketRadiance {
    /// Radiance along one of the segments.
    pub fn of(&self, segment: usize) -> Rgb {
        let radiance = &self.groups[segment / LANES].radiance;
        Rgb::from(radiance.map(|channel| channel[segment % LANES]))
    }

    /// Pairs of beam and segment that contributed.
    pub fn evaluations(&self) -> u64 {
        self.groups.iter().map(|group| group.evaluations).sum()
    }
}

/// Sums the beams' radiance along up to [`PACKET`] segments in one medium, in the order of `candidates`, which are indices
/// into the map's beams. `steps`: transmittance along the segments, in a heterogeneous medium. `key` addresses the random
/// numbers of chords.
pub fn gather(
    map: &BeamMap,
    medium: &Medium,
    segments: &[CameraSegment],
    steps: &StepFunctions,
    candidates: &[u32],
    key: u64,
) -> PacketRadiance {
    let packet = SegmentPacket::new(medium, map.steps(), segments, steps, key);
    let sigma_t = medium.sigma_t();
    let even = !matches!(medium, Medium::Heterogeneous(medium) if medium.albedo().is_some());
    let grey = even && sigma_t.x == sigma_t.y && sigma_t.y == sigma_t.z;
    let lobes = match medium.phase() {
        Phase::Isotropic => 0,
        Phase::HenyeyGreenstein { .. } => 1,
        Phase::Blend { .. } => 2,
    };
    let varying = matches!(medium, Medium::Heterogeneous(_));
    let sum = match (grey, lobes, varying) {
        (true, 0, false) => dispatch::<true, 0, false>,
        (true, 1, false) => dispatch::<true, 1, false>,
        (true, _, false) => dispatch::<true, 2, false>,
        (false, 0, false) => dispatch::<false, 0, false>,
        (false, 1, false) => dispatch::<false, 1, false>,
        (false, _, false) => dispatch::<false, 2, false>,
        (true, 0, true) => dispatch::<true, 0, true>,
        (true, 1, true) => dispatch::<true, 1, true>,
        (true, _, true) => dispatch::<true, 2, true>,
        (false, 0, true) => dispatch::<false, 0, true>,
        (false, 1, true) => dispatch::<false, 1, true>,
        (false, _, true) => dispatch::<false, 2, true>,
    };
    sum(map.beams(), &packet, candidates)
}

/// `LOBES` of the phase function are not isotropic. The same code at the widest vectors that the machine has. Only the
/// number of lanes per instruction differs: no operation is fused or reordered, so the bits are the same.
fn dispatch<const GREY: bool, const LOBES: usize, const VARYING: bool>(
    beams: &[PhotonBeam],
    packet: &SegmentPacket,
    candidates: &[u32],
) -> PacketRadiance {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<const GREY: bool, const LOBES: usize, const VARYING: bool>(
            beams: &[PhotonBeam],
            packet: &SegmentPacket,
            candidates: &[u32],
        ) -> PacketRadiance {
            packet.sum::<GREY, LOBES, VARYING>(beams, candidates)
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was just detected.
            return unsafe { avx2::<GREY, LOBES, VARYING>(beams, packet, candidates) };
        }
    }
    packet.sum::<GREY, LOBES, VARYING>(beams, candidates)
}

/// Groups of segments, and bounds of each group's lines: lane g of the bounds is group g.
struct SegmentPacket<'a> {
    groups: Vec<Group<'a>>,
    /// Transmittance along the beams.
    beam_steps: &'a StepFunctions,
    medium_id: u16,
    /// Middle of the origins and of the directions.
    origin: [Lanes; 3],
    dir: [Lanes; 3],
    /// Half the range of the directions.
    dir_range: [Lanes; 3],
    dir_deviation: Lanes,
    /// Minus infinity in unused lanes, so that nothing comes near them.
    origin_deviation: Lanes,
}

impl<'a> SegmentPacket<'a> {
    fn new(
        medium: &'a Medium,
        beam_steps: &'a StepFunctions,
        segments: &'a [CameraSegment],
        steps: &'a StepFunctions,
        key: u64,
    ) -> Self {
        let mut packet = Self {
            groups: Vec::with_capacity(LANES),
            beam_steps,
            medium_id: segments[0].medium,
            origin: [[0.0; LANES]; 3],
            dir: [[0.0; LANES]; 3],
            dir_range: [[0.0; LANES]; 3],
            dir_deviation: [0.0; LANES],
            origin_deviation: [f32::NEG_INFINITY; LANES],
        };
        for (g, group) in segments.chunks(LANES).take(LANES).enumerate() {
            let range = |of: fn(&Ray) -> Vec3| {
                let bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                let grow = |(min, max): (Vec3, Vec3), v: Vec3| (min.min(v), max.max(v));
                let (min, max) = group.iter().map(|s| of(&s.ray)).fold(bounds, grow);
                (0.5 * (min + max), 0.5 * (max - min))
            };
            let (origin, origin_range) = range(|ray| ray.origin);
            let (dir, dir_range) = range(|ray| ray.dir);
            for c in 0..3 {
                packet.origin[c][g] = origin[c];
                packet.dir[c][g] = dir[c];
                packet.dir_range[c][g] = dir_range[c];
            }
            packet.dir_deviation[g] = dir_range.length();
            packet.origin_deviation[g] = origin_range.length();
            packet
                .groups
                .push(Group::new(medium, beam_steps, group, steps, key));
        }
        packet
    }

    /// The groups, as bits, with a line that may come within the beam's radius of the beam's line. Two lines are
    /// |moment . dir| / |dir x beam.dir| apart, with the moment of the beam around the origin of the other.
    #[inline(always)]
    fn groups_near(&self, beam: &PhotonBeam) -> u32 {
        let (p, b) = (beam.origin, beam.dir);
        let radius = beam.max_radius();
        let magnitude = p.abs().max_element();
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.dir;
        let [hx, hy, hz] = &self.dir_range;
        let mut near = [0u32; LANES];
        for g in 0..LANES {
            let (wx, wy, wz) = (p.x - ox[g], p.y - oy[g], p.z - oz[g]);
            let mx = wy * b.z - wz * b.y;
            let my = wz * b.x - wx * b.z;
            let mz = wx * b.y - wy * b.x;
            let (ax, ay, az) = (mx.abs(), my.abs(), mz.abs());
            let least = (mx * dx[g] + my * dy[g] + mz * dz[g]).abs()
                - (ax * hx[g] + ay * hy[g] + az * hz[g]);
            let nx = dy[g] * b.z - dz[g] * b.y;
            let ny = dz[g] * b.x - dx[g] * b.z;
            let nz = dx[g] * b.y - dy[g] * b.x;
            let sin = (nx * nx + ny * ny + nz * nz).sqrt() + self.dir_deviation[g];
            let rounding = 1e-6 * (ax + ay + az + magnitude);
            near[g] = (least <= (radius + self.origin_deviation[g]) * sin + rounding) as u32;
        }
        let mut bits = 0;
        for (g, near) in near.into_iter().enumerate() {
            bits |= near << g;
        }
        bits
    }

    #[inline(always)]
    fn sum<const GREY: bool, const LOBES: usize, const VARYING: bool>(
        &self,
        beams: &[PhotonBeam],
        candidates: &[u32],
    ) -> PacketRadiance {
        let mut out = PacketRadiance::default();
        // First which of them matter, then what they add: both loops know what they will read next.
        let mut near = Vec::with_capacity(candidates.len());
        for (i, &index) in candidates.iter().enumerate() {
            // Candidates lie scattered in memory.
            if let Some(&next) = candidates.get(i + FETCH_BEAM) {
                prefetch(&beams[next as usize]);
            }
            let beam = &beams[index as usize];
            if beam.medium == self.medium_id {
                let groups = self.groups_near(beam);
                if groups != 0 {
                    near.push((index, groups, beam.steps));
                }
            }
        }
        for (i, &(index, groups, _)) in near.iter().enumerate() {
            if let Some(&(next, _, steps)) = near.get(i + FETCH_BEAM) {
                prefetch(&beams[next as usize]);
                if VARYING {
                    self.beam_steps.prefetch_number(steps);
                }
            }
            if VARYING && let Some(&(_, _, steps)) = near.get(i + FETCH_STEPS) {
                self.beam_steps.prefetch(steps);
            }
            let beam = &beams[index as usize];
            let (mut groups, mut step) = (groups, 0);
            while groups != 0 {
                let g = groups.trailing_zeros() as usize;
                groups &= groups - 1;
                let (group, sum) = (&self.groups[g], &mut out.groups[g]);
                let parallel = group.add_beam::<GREY, LOBES, VARYING>(beam, &mut step, sum);
                if parallel {
                    group.add_chords(beam, index, sum);
                }
            }
        }
        out
    }
}

/// Segments side by side, and what is constant over them.
struct Group<'a> {
    origin: [Lanes; 3],
    dir: [Lanes; 3],
    /// Zero in unused lanes, so that nothing is found there.
    length: Lanes,
    segments: &'a [CameraSegment],
    sigma_s: Rgb,
    sigma_t: Rgb,
    phase: Phase,
    lobes: [PhaseLobe; 2],
    /// In a heterogeneous medium.
    varying: Option<Varying<'a>>,
    key: u64,
}

impl<'a> Group<'a> {
    fn new(
        medium: &'a Medium,
        beam_steps: &'a StepFunctions,
        segments: &'a [CameraSegment],
        steps: &'a StepFunctions,
        key: u64,
    ) -> Self {
        let lane = |f: &dyn Fn(&CameraSegment) -> f32, unused: f32| {
            let mut lanes = [unused; LANES];
            for (lane, segment) in lanes.iter_mut().zip(segments) {
                *lane = f(segment);
            }
            lanes
        };
        Self {
            origin: [0, 1, 2].map(|c| lane(&|s| s.ray.origin[c], 0.0)),
            dir: [0, 1, 2].map(|c| lane(&|s| s.ray.dir[c], if c == 0 { 1.0 } else { 0.0 })),
            length: lane(&|s| s.length, 0.0),
            segments,
            sigma_s: medium.sigma_s(),
            sigma_t: medium.sigma_t(),
            phase: medium.phase(),
            lobes: medium.phase().lobes(),
            varying: match medium {
                Medium::Homogeneous(_) => None,
                Medium::Heterogeneous(medium) => {
                    Some(Varying::new(medium, segments, steps, beam_steps))
                }
            },
            key,
        }
    }

    /// Adds one beam by the 1D estimate. `step`: which of its steps was met before. True: some lane is nearly parallel to it.
    #[inline(always)]
    fn add_beam<const GREY: bool, const LOBES: usize, const VARYING: bool>(
        &self,
        beam: &PhotonBeam,
        step: &mut usize,
        out: &mut GroupRadiance,
    ) -> bool {
        let (p, b) = (beam.origin, beam.dir);
        let [start, end] = beam.extent;
        let max_radius = beam.max_radius();
        let max_radius2 = max_radius * max_radius;
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.dir;

        // Distance of the lines against the largest radius, without a division.
        let (mut nx, mut ny, mut nz) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (mut sin2, mut offset) = ([0.0; LANES], [0.0; LANES]);
        let (mut reached, mut near) = (0u32, 0u32);
        for l in 0..LANES {
            nx[l] = dy[l] * b.z - dz[l] * b.y;
            ny[l] = dz[l] * b.x - dx[l] * b.z;
            nz[l] = dx[l] * b.y - dy[l] * b.x;
            sin2[l] = nx[l] * nx[l] + ny[l] * ny[l] + nz[l] * nz[l];
            offset[l] = (p.x - ox[l]) * nx[l] + (p.y - oy[l]) * ny[l] + (p.z - oz[l]) * nz[l];
            let parallel = sin2[l] < NEARLY_PARALLEL_SIN2;
            let close = offset[l] * offset[l] < max_radius2 * sin2[l];
            near |= parallel as u32;
            reached |= (close && !parallel) as u32;
        }
        if reached == 0 {
            return near != 0;
        }

        let power = beam.power * self.sigma_s;
        // Plain loops over floats and whole numbers, one after another: this is what becomes vector code.
        let (mut along_segment, mut along_beam) = ([0.0; LANES], [0.0; LANES]);
        let (mut inv_sin2, mut inv_radius) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let (wx, wy, wz) = (p.x - ox[l], p.y - oy[l], p.z - oz[l]);
            inv_sin2[l] = 1.0 / sin2[l];
            along_segment[l] = ((wy * b.z - wz * b.y) * nx[l]
                + (wz * b.x - wx * b.z) * ny[l]
                + (wx * b.y - wy * b.x) * nz[l])
                * inv_sin2[l];
            along_beam[l] = ((wy * dz[l] - wz * dy[l]) * nx[l]
                + (wz * dx[l] - wx * dz[l]) * ny[l]
                + (wx * dy[l] - wy * dx[l]) * nz[l])
                * inv_sin2[l];
            inv_radius[l] = 1.0 / (beam.radius + beam.radius_slope * along_beam[l]);
        }
        let mut u2 = [0.0; LANES];
        let mut hit = [0u32; LANES];
        for l in 0..LANES {
            u2[l] = offset[l] * offset[l] * inv_sin2[l] * (inv_radius[l] * inv_radius[l]);
            let (t, s) = (along_segment[l], along_beam[l]);
            hit[l] = (sin2[l] >= NEARLY_PARALLEL_SIN2) as u32
                & (t > 0.0) as u32
                & (t < self.length[l]) as u32
                & (s > start) as u32
                & (s < end) as u32
                & (u2[l] < 1.0) as u32;
        }
        let count: u32 = hit.iter().sum();
        if count == 0 {
            return near != 0;
        }
        let mut value = [0.0; LANES];
        let mut depth = [0.0; LANES];
        for l in 0..LANES {
            let kernel = 0.75 * inv_radius[l] * (1.0 - u2[l]);
            let phase = if LOBES == 0 {
                1.0 / (4.0 * PI)
            } else {
                // Light that travels along the beam is turned towards the camera, against the segment.
                let cos = -(b.x * dx[l] + b.y * dy[l] + b.z * dz[l]);
                let [first, second] = &self.lobes;
                match LOBES {
                    1 => first.eval(cos),
                    _ => first.eval(cos) + second.eval(cos),
                }
            };
            let v = kernel * phase * inv_sin2[l].sqrt();
            value[l] = if hit[l] != 0 { v } else { 0.0 };
            depth[l] = if hit[l] != 0 {
                along_segment[l] + along_beam[l]
            } else {
                0.0
            };
        }
        out.evaluations += u64::from(count);
        let mut transmitted = [[1.0; LANES]; 3];
        if VARYING && let Some(varying) = &self.varying {
            let at = varying.attenuation::<GREY>(beam, &hit, &along_segment, &along_beam, step);
            for l in 0..LANES {
                let v = value[l] * at.density[l];
                value[l] = if GREY { v * at.transmitted[0][l] } else { v };
            }
            (transmitted, depth) = (at.transmitted, at.depth);
        }
        if GREY {
            for l in 0..LANES {
                let v = value[l] * exp_neg(-self.sigma_t.x * depth[l]);
                out.radiance[0][l] += v * power.x;
                out.radiance[1][l] += v * power.y;
                out.radiance[2][l] += v * power.z;
            }
        } else {
            for c in 0..3 {
                for l in 0..LANES {
                    let mut tr = exp_neg(-self.sigma_t[c] * depth[l]);
                    if VARYING {
                        tr *= transmitted[c][l];
                    }
                    out.radiance[c][l] += value[l] * tr * power[c];
                }
            }
        }
        near != 0
    }

    /// Adds the chord estimate of the lanes that are nearly parallel to the beam.
    #[cold]
    #[inline(never)]
    fn add_chords(&self, beam: &PhotonBeam, index: u32, out: &mut GroupRadiance) {
        for (l, segment) in self.segments.iter().enumerate() {
            let sin2 = segment.ray.dir.cross(beam.dir).length_squared();
            if sin2 >= NEARLY_PARALLEL_SIN2 {
                continue;
            }
            let u = mix64(self.key ^ mix64(((index as u64) << 32) | segment.pixel as u64));
            let u = (u >> 40) as f32 * (1.0 / (1u32 << 24) as f32);
            let value = self.chord_estimate(beam, l, u);
            if value != Rgb::ZERO {
                out.evaluations += 1;
                for c in 0..3 {
                    out.radiance[c][l] += value[c];
                }
            }
        }
    }

    /// Radiance of one beam, blurred over discs across it, along a segment. `u` in [0, 1) places the stratified points.
    fn chord_estimate(&self, beam: &PhotonBeam, lane: usize, u: f32) -> Rgb {
        let segment = &self.segments[lane];
        let ray = &segment.ray;
        // In the beam's frame the ray is at distance |across + t across_dir| from the axis, at s = along + t cos.
        let cos = ray.dir.dot(beam.dir);
        let offset = ray.origin - beam.origin;
        let along = offset.dot(beam.dir);
        let across = offset - beam.dir * along;
        let across_dir = ray.dir - beam.dir * cos;
        let radius = beam.max_radius();
        let Some((near, far)) = cylinder_range(across, across_dir, radius) else {
            return Rgb::ZERO;
        };
        // Both ends of the beam; cos is close to 1 or -1 here.
        let [start, end] = beam.extent;
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
            if x < 1.0 {
                let kernel = 2.0 / (PI * radius * radius) * (1.0 - x);
                sum += self.attenuation(beam, lane, t, s) * kernel;
            }
        }
        let phase = self.phase.eval_directions(beam.dir, -ray.dir);
        sum * beam.power * self.sigma_s * (phase * step)
    }

    /// Density and transmittance for a point at `t` along a segment and `s` along a beam.
    fn attenuation(&self, beam: &PhotonBeam, lane: usize, t: f32, s: f32) -> Rgb {
        match &self.varying {
            None => exp_rgb_neg(self.sigma_t * -(t + s)),
            Some(varying) => varying.attenuation_at(beam, lane, t, s),
        }
    }
}

/// Where a line is within `radius` of the axis.
fn cylinder_range(across: Vec3, across_dir: Vec3, radius: f32) -> Option<(f32, f32)> {
    let a = across_dir.length_squared();
    let c = across.length_squared() - radius * radius;
    let nearest = if a > 0.0 {
        -across.dot(across_dir) / a
    } else {
        0.0
    };
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
