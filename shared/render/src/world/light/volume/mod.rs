//! Media that emit: fire, plasma, glow.
//!
//! As a light, such a medium has a grid of cells around it, in which points are drawn roughly in proportion to the
//! emission. Photons start at such points, in all directions. For a shaded point a direction towards such a point is
//! drawn, and all emission along the line arrives from that direction. The density of directions has a closed form, the
//! integral of density times squared distance along the line, so that MIS weighs drawn directions against rays that met
//! the medium by chance, as for every light. (Simon et al. 2017, *Line integration for rendering heterogeneous emissive
//! volumes*, also gives the reason: a single point of the line has unbounded variance nearby.)
//!
//! The radiance along a line has a closed form where medium and emission are constant. Otherwise it is the mean over
//! stratified points along the line, each in a part with an equal share of the density, times independent estimates of
//! the transmittance from point to point: unbiased.

mod cells;
mod emission;

pub use emission::{BlackBodies, EmissionField, Heat, VolumeEmission};

use super::{DirectSample, EmissionSample};
use crate::math::{PI, Ray, Rgb, Vec2, Vec3, mean, one_minus_exp_neg};
use crate::sampler::Sampler;
use crate::warp;
use crate::world::medium::Medium;
use cells::{Cells, grid};
use glam::DVec3;

/// Most cells along the longest side of a grid, and of the region around several objects.
const MOST_CELLS: u32 = 32;
const MOST_AROUND: u32 = 16;
/// Least side of a cell, in samples.
const LEAST_CELL: f32 = 2.0;
/// Lookups of the emission along each side of a cell.
const PLACES: u32 = 3;
/// Share of a cell's weight that is based on the upper bound of its emission.
const BY_BOUND: f32 = 0.05;
/// Margin of boxes around uniform emission, relative to their size.
const SLACK: f64 = 1e-4;
/// Points along a line: the least number, and the most when a path sees it.
const FEWEST_POINTS: u32 = 2;
const MOST_POINTS: u32 = 8;

/// Why a medium is no light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dark {
    /// It emits nothing.
    Nothing,
    /// It emits uniformly and fills no object.
    NoObject,
}

/// An emitting medium as a light.
#[derive(Clone, Debug)]
pub struct VolumeLight {
    /// Number of the medium; where media add up, so does their emission.
    pub medium: u16,
    emission: VolumeEmission,
    cells: Cells,
    /// Approximate power, W.
    power: Rgb,
    /// Unit of the weights of directions: approximately its radiance, W/(m^2 sr).
    unit: f32,
}

/// The box around an object filled by a medium, render space, and its volume.
#[derive(Clone, Copy, Debug)]
pub struct Filled {
    /// Lowest corner.
    pub low: Vec3,
    /// Highest corner.
    pub high: Vec3,
    /// Volume of the object, at most that of the box.
    pub volume: f64,
}

impl VolumeLight {
    /// `filled`: the objects that contain the medium; unused if a grid defines the emission.
    ///
    /// # Errors
    /// If the medium is no light.
    pub fn new(medium: u16, emission: VolumeEmission, filled: &[Filled]) -> Result<Self, Dark> {
        let (cells, power) = match (emission.field(), emission.constant()) {
            (Some(field), _) => in_field(&emission, field)?,
            (None, constant) => {
                let emitted = constant.unwrap_or(Rgb::ZERO);
                if emitted == Rgb::ZERO {
                    return Err(Dark::Nothing);
                }
                let volume: f64 = filled.iter().map(|filled| filled.volume).sum();
                (around(filled)?, emitted * (4.0 * PI * volume as f32))
            }
        };
        let (_, radius) = cells.ball();
        let unit = mean(power) / (4.0 * PI * radius * radius);
        Ok(Self {
            medium,
            emission,
            cells,
            power,
            unit: if unit.is_normal() { unit } else { 1.0 },
        })
    }

    /// The emission.
    pub fn emission(&self) -> &VolumeEmission {
        &self.emission
    }

    /// Total emission, W; a sum over cells where a grid defines the emission.
    pub fn power(&self) -> Rgb {
        self.power
    }

    /// Centre and radius of a ball around it.
    pub fn ball(&self) -> (Vec3, f32) {
        self.cells.ball()
    }

    /// Starts a photon path. There is no photon if the point is outside the medium, which the grid may exceed.
    pub(super) fn start(&self, position: Vec2, deep: f32, direction: Vec2) -> EmissionSample {
        let (origin, density) = self.cells.sample([position.x, position.y, deep]);
        let edge = libm::cbrtf(density);
        EmissionSample {
            origin,
            dir: warp::uniform_sphere(direction),
            normal: None,
            power: self.emission.at(origin) * (4.0 * PI / density),
            pdf_dir: warp::uniform_sphere_pdf(),
            // As if all points of its depth lay on a surface.
            pdf_pos: edge * edge,
            primitive: 0,
        }
    }

    /// A direction towards the medium. The weight is in the light's own unit, see [`Self::in_units`].
    pub(super) fn towards(&self, from: Vec3, u: Vec2, deep: f32) -> Option<DirectSample> {
        let (point, _) = self.cells.sample([u.x, u.y, deep]);
        let offset = point - from;
        let distance = offset.length();
        let wi = offset / distance;
        if !wi.is_finite() {
            return None;
        }
        let pdf = self.pdf_towards(from, wi);
        (pdf > 0.0 && pdf.is_finite()).then_some(DirectSample {
            wi,
            normal: -wi,
            primitive: 0,
            distance,
            weight: Rgb::splat(self.unit / pdf),
            pdf,
            unmet: false,
        })
    }

    /// Density per solid angle of drawing a direction from a point.
    pub(super) fn pdf_towards(&self, from: Vec3, wi: Vec3) -> f32 {
        let ray = Ray { origin: from, dir: wi };
        self.cells.line(&ray, f32::INFINITY).towards
    }

    /// Density of emitted photons that reach a point, per area across their direction and solid angle, over that of
    /// [`Self::pdf_towards`].
    pub(super) fn photon_density(&self, from: Vec3, wi: Vec3) -> f32 {
        let ray = Ray { origin: from, dir: wi };
        let line = self.cells.line(&ray, f32::INFINITY);
        0.25 / PI * line.across / line.towards
    }

    /// One unbiased estimate of the radiance that arrives at a ray's origin within `length`. The whole segment lies in
    /// the light's medium or in a sum that includes it. W/(m^2 sr).
    pub fn arriving(&self, medium: &Medium, ray: &Ray, length: f32, sampler: &mut Sampler) -> Rgb {
        if let (Medium::Homogeneous(medium), Some(emitted)) = (medium, self.emission.constant()) {
            let Some([start, end]) = self.cells.clip(ray, length) else {
                return Rgb::ZERO;
            };
            let gathered = |sigma_t: f32| match sigma_t > 0.0 {
                true => one_minus_exp_neg(sigma_t * (end - start)) / sigma_t,
                false => end - start,
            };
            let sigma_t = medium.sigma_t();
            let along = Rgb::new(gathered(sigma_t.x), gathered(sigma_t.y), gathered(sigma_t.z));
            return emitted * along * medium.transmittance(start);
        }
        let line = self.cells.line(ray, length);
        if line.across <= 0.0 {
            return Rgb::ZERO;
        }
        let points = line.cells.clamp(FEWEST_POINTS, MOST_POINTS);
        let share = line.across / points as f32;
        let next = |drawn: u32, sampler: &mut Sampler| (drawn as f32 + sampler.next_1d()) * share;
        let (mut drawn, mut at) = (0, next(0, sampler));
        let (mut before, mut last) = (0.0, 0.0);
        let (mut transmittance, mut sum) = (Rgb::ONE, Rgb::ZERO);
        self.cells.along(ray, length, |density, [start, end]| {
            let after = before + density * (end - start);
            while density > 0.0 && drawn < points && at < after {
                let t = (start + (at - before) / density).clamp(last, end);
                let from = Ray {
                    origin: ray.at(last),
                    dir: ray.dir,
                };
                if transmittance != Rgb::ZERO {
                    transmittance *= medium.transmittance(&from, t - last, sampler);
                    sum += self.emission.at(ray.at(t)) * transmittance / density;
                }
                last = t;
                drawn += 1;
                at = match drawn < points {
                    true => next(drawn, sampler),
                    false => f32::INFINITY,
                };
            }
            before = after;
        });
        sum * share
    }

    /// The same in the unit of the weights of directions.
    pub(crate) fn in_units(&self, radiance: Rgb) -> Rgb {
        radiance / self.unit
    }
}

/// Cells over the grid that defines a medium's emission, and its total emission.
fn in_field(emission: &VolumeEmission, field: &EmissionField) -> Result<(Cells, Rgb), Dark> {
    let ([low, high], to_render) = field.domain();
    let longest = (high - low).max_element();
    let most = ((longest / LEAST_CELL).ceil() as u32).clamp(1, MOST_CELLS);
    let (count, to_samples) = grid(low.as_dvec3(), high.as_dvec3(), most);
    let volume = (to_render * to_samples).matrix3.determinant().abs();
    let step = ((high - low) / count.as_vec3()).as_dvec3();
    let cells = (0..count.z).flat_map(|z| (0..count.y).flat_map(move |y| (0..count.x).map(move |x| (x, y, z))));
    let (mut power, mut weights) = (DVec3::ZERO, Vec::new());
    for (x, y, z) in cells {
        let corner = low.as_dvec3() + step * DVec3::new(x.into(), y.into(), z.into());
        let bound = emission.bound(corner.as_vec3(), (corner + step).as_vec3());
        if bound == Rgb::ZERO {
            weights.push(0.0);
            continue;
        }
        let place = |i: u32| (f64::from(i % PLACES) + 0.5) / f64::from(PLACES);
        let places = (0..PLACES.pow(3)).map(|i| {
            let within = DVec3::new(place(i), place(i / PLACES), place(i / PLACES.pow(2)));
            let at = to_render.transform_point3(corner + within * step);
            emission.at(at.as_vec3()).as_dvec3()
        });
        let here = places.sum::<DVec3>() / f64::from(PLACES.pow(3));
        power += here * volume;
        let weight = f64::from(1.0 - BY_BOUND) * here.element_sum() + f64::from(BY_BOUND * bound.element_sum());
        weights.push(weight);
    }
    match weights.iter().any(|weight| *weight > 0.0) {
        true => {
            // The lookups may miss emission: the power must not be zero.
            let power = (power * (4.0 * f64::from(PI)))
                .as_vec3()
                .max(Rgb::splat(f32::MIN_POSITIVE));
            Ok((Cells::new(count, to_render * to_samples, &weights), power))
        }
        false => Err(Dark::Nothing),
    }
}

/// Cells around objects that a medium fills.
fn around(filled: &[Filled]) -> Result<Cells, Dark> {
    let boxes: Vec<[DVec3; 2]> = (filled.iter())
        .map(|filled| {
            let (low, high) = (filled.low.as_dvec3(), filled.high.as_dvec3());
            let slack = DVec3::splat(SLACK * (high - low).max_element());
            [low - slack, high + slack]
        })
        .collect();
    let (first, rest) = boxes.split_first().ok_or(Dark::NoObject)?;
    let [low, high] = (rest.iter()).fold(*first, |[low, high], next| [low.min(next[0]), high.max(next[1])]);
    let most = if rest.is_empty() { 1 } else { MOST_AROUND };
    let (count, map) = grid(low, high, most);
    let step = (high - low) / count.as_dvec3();
    let overlap = |corner: DVec3| {
        let of = |[low, high]: &[DVec3; 2]| {
            let common = (corner + step).min(*high) - corner.max(*low);
            common.max(DVec3::ZERO).element_product()
        };
        boxes.iter().map(of).sum::<f64>()
    };
    let cells = (0..count.z).flat_map(|z| (0..count.y).flat_map(move |y| (0..count.x).map(move |x| (x, y, z))));
    let corner = |(x, y, z): (u32, u32, u32)| low + step * DVec3::new(x.into(), y.into(), z.into());
    let weights: Vec<f64> = cells.map(|cell| overlap(corner(cell))).collect();
    match weights.iter().any(|weight| *weight > 0.0) {
        true => Ok(Cells::new(count, map, &weights)),
        false => Err(Dark::NoObject),
    }
}
