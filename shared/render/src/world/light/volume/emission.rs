//! Emission of a medium, by place.

use crate::math::{PI, Rgb, Vec3};
use crate::world::medium::bricks::{BRICK, Bricks};
use glam::{Affine3A, DAffine3, UVec3};
use std::sync::Arc;

/// W/(m^2 K^4).
const STEFAN_BOLTZMANN: f32 = 5.670_374e-8;

/// Emission of a medium. Radiance along a ray grows by it, dL/dt = `color` x field x black body: W/(m^2 sr) per scene
/// unit, independent of absorption and scattering. That equals strength times colour of an Emission node in Cycles.
/// (pbrt-v4's `Le` is this over the absorption.) It is isotropic, so a volume dV emits 4 pi dV times it.
#[derive(Clone, Debug)]
pub struct VolumeEmission {
    /// W/(m^2 sr) per scene unit; with a temperature, the share of black-body emission per scene unit.
    pub color: Rgb,
    /// A spatially varying factor.
    pub field: Option<EmissionField>,
    /// Black bodies.
    pub heat: Option<Heat>,
}

/// A grid, zero outside its box.
#[derive(Clone, Debug)]
pub struct EmissionField {
    bricks: Arc<Bricks>,
    /// Render space to sample space.
    to_samples: Affine3A,
    to_render: DAffine3,
}

/// The temperature.
#[derive(Clone, Debug)]
pub struct Heat {
    /// Factor on `kelvin`, if it varies.
    pub field: Option<EmissionField>,
    /// Temperature, or that of a grid value of 1.
    pub kelvin: f32,
    /// Colours of black bodies.
    pub bodies: Arc<BlackBodies>,
}

/// Colours of black bodies by their temperature.
#[derive(Clone, Debug)]
pub struct BlackBodies {
    range: [f32; 2],
    /// Of luminance 1, equidistant in one over the temperature.
    colors: Vec<Rgb>,
}

impl EmissionField {
    /// `to_render`: from the grid's object space; it must be invertible.
    pub fn new(bricks: Arc<Bricks>, to_render: DAffine3) -> Self {
        let to_render = to_render * bricks.to_object();
        Self {
            bricks,
            to_samples: to_render.inverse().as_affine3a(),
            to_render,
        }
    }

    /// The value at a point of render space.
    #[inline]
    pub fn at(&self, point: Vec3) -> f32 {
        self.bricks.density(self.to_samples.transform_point3(point))
    }

    /// The largest value.
    pub fn max(&self) -> f32 {
        self.bricks.max()
    }

    /// Corners of the box in sample space, and the map from there to render space.
    pub(super) fn domain(&self) -> ([Vec3; 2], DAffine3) {
        (self.bricks.domain(), self.to_render)
    }

    /// Upper bound of the values between two corners of sample space.
    pub(super) fn bound(&self, low: Vec3, high: Vec3) -> f32 {
        let last = self.bricks.count() - 1;
        let brick = |p: Vec3| (p.max(Vec3::ZERO) / BRICK as f32).as_uvec3().min(last);
        // Slightly more: rounding may move points beyond.
        let (from, to) = (brick(low - 0.01), brick(high + 0.01));
        let mut most = 0.0f32;
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    most = most.max(self.bricks.range(UVec3::new(x, y, z)).majorant);
                }
            }
        }
        most
    }
}

impl BlackBodies {
    /// `colors`: of luminance 1, at two or more temperatures that cover this range in kelvin from lowest to highest,
    /// equidistant in one over the temperature.
    pub fn new(range: [f32; 2], colors: Vec<Rgb>) -> Self {
        Self { range, colors }
    }

    /// The radiance of a black body, sigma T^4 / pi in total, W/(m^2 sr), in the colour of its temperature, or of the
    /// nearest known one. Zero at zero and below.
    pub fn radiance(&self, kelvin: f32) -> Rgb {
        if kelvin.is_nan() || kelvin <= 0.0 {
            return Rgb::ZERO;
        }
        let squared = kelvin * kelvin;
        self.color(kelvin) * (STEFAN_BOLTZMANN / PI * squared * squared)
    }

    fn color(&self, kelvin: f32) -> Rgb {
        let [low, high] = self.range;
        let part = (1.0 / low - 1.0 / kelvin.clamp(low, high)) / (1.0 / low - 1.0 / high);
        let at = part.clamp(0.0, 1.0) * (self.colors.len() - 1) as f32;
        let below = (at as usize).min(self.colors.len() - 2);
        self.colors[below].lerp(self.colors[below + 1], at - below as f32)
    }
}

impl VolumeEmission {
    /// The same everywhere.
    pub fn even(color: Rgb) -> Self {
        Self {
            color,
            field: None,
            heat: None,
        }
    }

    /// W/(m^2 sr) per scene unit, at a point of render space.
    #[inline]
    pub fn at(&self, point: Vec3) -> Rgb {
        let field = self.field.as_ref().map_or(1.0, |field| field.at(point));
        if field == 0.0 {
            return Rgb::ZERO;
        }
        let emitted = self.color * field;
        match &self.heat {
            None => emitted,
            Some(heat) => {
                let factor = heat.field.as_ref().map_or(1.0, |field| field.at(point));
                emitted * heat.bodies.radiance(heat.kelvin * factor)
            }
        }
    }

    /// The emission, if it is constant.
    pub fn constant(&self) -> Option<Rgb> {
        match (&self.field, &self.heat) {
            (None, None) => Some(self.color),
            (None, Some(heat)) if heat.field.is_none() => Some(self.color * heat.bodies.radiance(heat.kelvin)),
            _ => None,
        }
    }

    /// The grid that bounds the emission, if any: the factor's, or else the temperature's.
    pub fn field(&self) -> Option<&EmissionField> {
        let of_heat = || self.heat.as_ref().and_then(|heat| heat.field.as_ref());
        self.field.as_ref().or_else(of_heat)
    }

    /// Approximate upper bound of the emission between two corners of the sample space of [`Self::field`]; zero only
    /// where the emission is zero.
    pub(super) fn bound(&self, low: Vec3, high: Vec3) -> Rgb {
        let field = self.field.as_ref().map_or(1.0, |field| field.bound(low, high));
        let emitted = self.color * field;
        match &self.heat {
            None => emitted,
            Some(heat) => {
                let factor = match (&heat.field, &self.field) {
                    (None, _) => 1.0,
                    (Some(of_heat), None) => of_heat.bound(low, high),
                    (Some(of_heat), Some(_)) => of_heat.max(),
                };
                emitted * heat.bodies.radiance(heat.kelvin * factor)
            }
        }
    }

    /// Approximate maximum over all places.
    pub fn max(&self) -> Rgb {
        let of = |field: &Option<EmissionField>| field.as_ref().map_or(1.0, EmissionField::max);
        let emitted = self.color * of(&self.field);
        match &self.heat {
            None => emitted,
            Some(heat) => emitted * heat.bodies.radiance(heat.kelvin * of(&heat.field)),
        }
    }
}
