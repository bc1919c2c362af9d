//! A piece's contribution to a segment: `kernels/estimate.wgsl`, step by step. For a single piece the bits also match
//! [`beamfarm_render::cpu::beam::estimate`].

use crate::beams::{Brought, Piece, Scattering, Segment};
use beamfarm_render::math::exp_neg;
use beamfarm_render::sampler::mix64;
use std::f32::consts::PI;

/// Below this sine of the angle between a beam and a segment, the chord is integrated.
const PARALLEL_SIN: f32 = 0.1;
const PARALLEL_SIN2: f32 = PARALLEL_SIN * PARALLEL_SIN;

type Vec3 = [f32; 3];

fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn each(of: impl Fn(usize) -> f32) -> Vec3 {
    [of(0), of(1), of(2)]
}

fn lobe_by_x([scale, ..]: [f32; 4], x: f32) -> f32 {
    scale / (x * x.sqrt())
}

/// Value at the cosine between the old and the new direction of travel.
fn lobe_value(lobe: [f32; 4], cos: f32) -> f32 {
    let [scale, peak, slope, sign] = lobe;
    if slope == 0.0 {
        return scale;
    }
    let apart = 1.0 - sign * cos;
    lobe_by_x(lobe, peak + slope * if apart > 0.0 { apart } else { 0.0 })
}

fn lobe_value_of_directions(lobe: [f32; 4], old: Vec3, new: Vec3) -> f32 {
    let [scale, peak, slope, sign] = lobe;
    if slope == 0.0 {
        return scale;
    }
    let apart = each(|i| old[i] - sign * new[i]);
    lobe_by_x(lobe, peak + 0.5 * slope * dot(apart, apart))
}

fn transmittance(sigma_t: Vec3, depth: f32) -> Vec3 {
    sigma_t.map(|sigma_t| exp_neg(-sigma_t * depth))
}

/// Zero where they do not meet. Both are assumed to be in `medium`.
#[must_use]
pub fn brought(segment: &Segment, piece: &Piece, medium: &Scattering, key: u64) -> Brought {
    let (d, b) = (segment.dir, piece.dir);
    let w = each(|i| piece.origin[i] - segment.origin[i]);
    let moment = [
        b[1] * w[2] - b[2] * w[1],
        b[2] * w[0] - b[0] * w[2],
        b[0] * w[1] - b[1] * w[0],
    ];
    let (cos, offset) = (dot(d, b), dot(d, moment));
    let (w_dot_d, w_dot_b) = (dot(d, w), dot(w, b));
    let sin2 = 1.0 - cos * cos;
    let s_sin2 = cos * w_dot_d - w_dot_b;
    let radius = piece.max_radius;
    if sin2 < PARALLEL_SIN2 {
        let beyond = PARALLEL_SIN * radius;
        let is_chord = offset * offset <= 1.01 * radius * radius * (sin2 + 1e-5)
            && s_sin2 + beyond >= piece.start * sin2
            && s_sin2 - beyond <= piece.end * sin2;
        if !is_chord {
            return Brought::default();
        }
        let radiance = chord(segment, piece, medium, key);
        let count = u32::from(radiance.iter().any(|x| *x > 0.0));
        return Brought { radiance, count };
    }
    let is_reached = offset * offset < radius * radius * sin2;
    if !is_reached {
        return Brought::default();
    }
    let r_sin2 = piece.radius * sin2 + piece.radius_slope * s_sin2;
    let inv = 1.0 / (sin2 * r_sin2);
    let inv_sin2 = inv * r_sin2;
    let inv_r_sin2 = inv * sin2;
    let x = offset * inv_r_sin2;
    let x = x * x * sin2;
    let t = (w_dot_d - cos * w_dot_b) * inv_sin2;
    let s = s_sin2 * inv_sin2;
    if !(t > 0.0 && t < segment.length && s > piece.start && s <= piece.end && x < 1.0) {
        return Brought::default();
    }
    let value = 0.75 * (1.0 - x) * sin2.sqrt() * inv_r_sin2;
    let value = value * (lobe_value(medium.lobes[0], -cos) + lobe_value(medium.lobes[1], -cos));
    let transmitted = transmittance(medium.sigma_t, t + if s > 0.0 { s } else { 0.0 });
    Brought {
        radiance: each(|i| value * transmitted[i] * (piece.power[i] * medium.sigma_s[i])),
        count: 1,
    }
}

fn chord(segment: &Segment, piece: &Piece, medium: &Scattering, key: u64) -> Vec3 {
    let u = mix64(key ^ mix64((u64::from(piece.beam) << 32) | u64::from(segment.pixel)));
    let u = (u >> 40) as f32 * (1.0 / (1u32 << 24) as f32);
    let cos = dot(segment.dir, piece.dir);
    let from = each(|i| segment.origin[i] - piece.origin[i]);
    let along = dot(from, piece.dir);
    let across = each(|i| from[i] - piece.dir[i] * along);
    let across_dir = each(|i| segment.dir[i] - piece.dir[i] * cos);
    let Some([near, far]) = cylinder_range(across, across_dir, piece.max_radius) else {
        return [0.0; 3];
    };
    let (s0, s1) = ((piece.start - along) / cos, (piece.end - along) / cos);
    let near = near.max(s0.min(s1)).max(0.0);
    let far = far.min(s0.max(s1)).min(segment.length);
    if near.partial_cmp(&far) != Some(std::cmp::Ordering::Less) {
        return [0.0; 3];
    }
    let step = (far - near) * 0.5;
    let mut sum = [0.0; 3];
    for i in 0..2 {
        let t = near + step * (i as f32 + u);
        let s = along + t * cos;
        let s = if s < piece.start { piece.start } else { s };
        let s = if s > piece.end { piece.end } else { s };
        let radius = piece.radius + piece.radius_slope * s;
        let at = each(|i| across[i] + across_dir[i] * t);
        let x = dot(at, at) / (radius * radius);
        if x < 1.0 {
            let kernel = 2.0 / (PI * radius * radius) * (1.0 - x);
            let transmitted = transmittance(medium.sigma_t, t + if s > 0.0 { s } else { 0.0 });
            sum = each(|i| sum[i] + transmitted[i] * kernel);
        }
    }
    let against = segment.dir.map(|x| -x);
    let phase = lobe_value_of_directions(medium.lobes[0], piece.dir, against)
        + lobe_value_of_directions(medium.lobes[1], piece.dir, against);
    each(|i| sum[i] * piece.power[i] * medium.sigma_s[i] * (phase * step))
}

/// The range of a line within `radius` of the axis.
fn cylinder_range(across: Vec3, across_dir: Vec3, radius: f32) -> Option<[f32; 2]> {
    let a = dot(across_dir, across_dir);
    if a < 1e-12 {
        return (dot(across, across) - radius * radius < 0.0).then_some([f32::MIN, f32::MAX]);
    }
    let nearest = -dot(across, across_dir) / a;
    let least = each(|i| across[i] + across_dir[i] * nearest);
    let half2 = (radius * radius - dot(least, least)) / a;
    (half2 > 0.0).then(|| {
        let half = half2.sqrt();
        [nearest - half, nearest + half]
    })
}
