//! Rough glass that keeps the energy that a single microfacet bounce loses. Reflection and transmission are both
//! brightened by the loss for the camera's direction, as in Cycles (after E. Turquin, Practical multiple scattering
//! compensation for microfacet models, 2019). White glass is white from everywhere. The lobe is not reciprocal, so
//! paths and photons both use the direction towards the camera.

mod tables;
#[cfg(test)]
mod tests;

use super::{Place, share_of};
use crate::math::{Rgb, Vec3};
use crate::world::bsdf::Distribution;
use crate::world::bsdf::microfacet::Facets;
use tables::{COSINES, ETAS, ROWS};

/// The tables' last index of refraction, as the square root of (eta - 1) / (eta + 1).
const MOST_Z: f32 = 0.7;

/// Shares by index of refraction, roughness, side (outside the denser one first) and cosine, followed by the mean for
/// diffuse light.
type Table = [[[[u16; COSINES + 1]; 2]; ROWS]; ETAS];

/// Share of light that glass with these facets keeps in one bounce, reflected or transmitted.
#[derive(Clone, Copy)]
pub(in crate::world::bsdf) struct GlassAlbedo {
    table: &'static Table,
    facets: Facets,
    /// The square root of the roughness, clamped to 1.
    root: f32,
    row: Place,
    eta: Place,
    /// The side that z points to is the less dense one.
    is_denser_inside: bool,
}

impl GlassAlbedo {
    /// `eta`: index of refraction on the side that z points away from over the other one.
    #[inline]
    pub fn of(facets: Facets, eta: f32) -> Self {
        let root = facets.alpha.sqrt().min(1.0);
        let contrast = ((eta - 1.0) / (eta + 1.0)).abs();
        Self {
            table: table_of(facets.distribution),
            facets,
            root,
            row: Place::of(root, ROWS),
            eta: Place::of((contrast.sqrt() / MOST_Z).min(1.0), ETAS),
            is_denser_inside: eta >= 1.0,
        }
    }

    /// Factor on the single-bounce value that stands in for further bounces. `camera`: the direction of view; `color`:
    /// what is left of light after a bounce.
    pub fn brightened(&self, camera: Vec3, color: Rgb) -> Rgb {
        let (albedo, mean) = (self.towards(camera), self.mean(camera.z));
        let further = color * mean / (Rgb::ONE - color * (1.0 - mean));
        Rgb::ONE + further * ((1.0 - albedo) / albedo)
    }

    /// The side that has this z.
    #[inline]
    fn side(&self, z: f32) -> usize {
        usize::from((z > 0.0) != self.is_denser_inside)
    }

    /// For diffuse light from the side that has this z.
    #[inline]
    fn mean(&self, z: f32) -> f32 {
        let side = self.side(z);
        self.eta
            .between(|eta| self.row.between(|row| share_of(self.table[eta][row][side][COSINES])))
    }

    /// For light from a direction on either side.
    #[inline]
    fn towards(&self, w: Vec3) -> f32 {
        let albedo = self.even(w);
        match self.facets.is_even() {
            true => albedo,
            false => self.drawn_out(albedo, w),
        }
    }

    /// For isotropic facets.
    #[inline]
    fn even(&self, w: Vec3) -> f32 {
        let side = self.side(w.z);
        let (cos, alpha) = (w.z.abs().min(1.0), self.root * self.root);
        let column = Place::of(cos * (1.0 + alpha) / (cos + alpha), COSINES);
        self.eta.between(|eta| {
            self.row
                .between(|row| column.between(|column| share_of(self.table[eta][row][side][column])))
        })
    }

    /// For anisotropic facets, as their losses elsewhere: at most those of the roughness in the direction's plane, and
    /// less towards the horizon.
    #[inline(never)]
    fn drawn_out(&self, albedo: f32, w: Vec3) -> f32 {
        let in_plane = Facets::even(self.facets.distribution, self.facets.alpha_towards(w));
        let root = in_plane.alpha.sqrt().min(1.0);
        let row = Place::of(root, ROWS);
        let in_plane = Self { root, row, ..*self }.even(w);
        let narrow = self.facets.aspect.min(1.0 / self.facets.aspect);
        let loss = 1.0 - albedo.max(in_plane);
        1.0 - loss * (1.0 - (1.0 - narrow) * (1.0 - w.z.abs().min(1.0)))
    }
}

fn table_of(distribution: Distribution) -> &'static Table {
    match distribution {
        Distribution::Ggx => &tables::GGX,
        Distribution::Beckmann => &tables::BECKMANN,
    }
}

/// The table of a distribution as devices store it: `ETAS` times `ROWS` times two sides times `COSINES` and a mean.
pub fn glass_numbers(distribution: Distribution) -> impl Iterator<Item = f32> {
    let numbers = table_of(distribution).as_flattened().as_flattened().as_flattened();
    numbers.iter().map(|number| share_of(*number))
}
