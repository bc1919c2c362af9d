//! Multiple scattering among microfacets, whose energy one bounce loses (Kulla & Conty 2017, "Revisiting physically
//! based shading at Imageworks"). A wide lobe restores it, and a diffuse base beneath the facets receives what they do
//! not reflect. Everything but [`glass`] is reciprocal.
//!
//! A *loss* is the share of light from a direction that one bounce among fully reflecting facets does not send back:
//! one minus their directional albedo. Losses and the mean Fresnel reflectance over the facets are interpolated
//! linearly in [`tables`].

mod glass;
mod tables;
#[cfg(test)]
mod tests;

pub(super) use glass::GlassAlbedo;
pub use glass::glass_numbers;

use super::Distribution;
use super::microfacet::Facets;
use crate::math::{Rgb, Vec3};
use crate::world::fresnel::fresnel_conductor;
use std::f32::consts::FRAC_1_PI;
use tables::{COSINES, ETAS, LAYER_COSINES, LAYER_ROWS, LAYERS, MEAN_FRESNEL, MEAN_LAYERS, MEANS, ROWS};

/// Scale from the tables' integers to shares.
const UNIT: f32 = 1.0 / 65535.0;
/// Index of refraction of the tables' last row: see [`Layer`].
const MOST_Z: f32 = 0.7;
/// Schlick's weight, averaged over diffuse light.
const MEAN_SCHLICK: f32 = 1.0 / 21.0;

/// A place between two entries of a table: the first one, and the fraction of the way to the next.
#[derive(Clone, Copy)]
struct Place {
    first: usize,
    on: f32,
}

impl Place {
    /// `x` in [0, 1] among `n` equidistant entries.
    #[inline]
    fn of(x: f32, count: usize) -> Self {
        let x = x * (count - 1) as f32;
        let first = (x as usize).min(count - 2);
        let on = x - first as f32;
        Self { first, on }
    }

    #[inline]
    fn between(self, value: impl Fn(usize) -> f32) -> f32 {
        value(self.first) * (1.0 - self.on) + value(self.first + 1) * self.on
    }
}

/// Losses are stored as square roots, which keeps the digits of small ones.
#[inline]
fn loss_of(number: u16) -> f32 {
    let root = f32::from(number) * UNIT;
    root * root
}

#[inline]
fn share_of(number: u16) -> f32 {
    f32::from(number) * UNIT
}

/// Losses of facets of one roughness.
#[derive(Clone, Copy)]
pub(super) struct Losses {
    table: &'static [[u16; COSINES]; ROWS],
    means: &'static [u16; MEANS],
    facets: Facets,
    alpha: f32,
    /// The square root of `alpha`, clamped to 1.
    root: f32,
    row: Place,
}

impl Losses {
    #[inline]
    pub fn of(facets: Facets) -> Self {
        let root = facets.alpha.sqrt().min(1.0);
        let (table, means) = match facets.distribution {
            Distribution::Ggx => (&tables::GGX, &tables::GGX_MEANS),
            Distribution::Beckmann => (&tables::BECKMANN, &tables::BECKMANN_MEANS),
        };
        Self {
            table,
            means,
            facets,
            alpha: root * root,
            root,
            row: Place::of(root, ROWS),
        }
    }

    /// The loss for light at this cosine.
    #[inline]
    pub fn at(&self, cos: f32) -> f32 {
        let cos = cos.min(1.0);
        let column = Place::of(cos * (1.0 + self.alpha) / (cos + self.alpha), COSINES);
        self.row
            .between(|row| column.between(|column| loss_of(self.table[row][column])))
    }

    /// The loss for light from a direction. The tables hold isotropic facets. Anisotropic ones use their mean
    /// roughness, as in Cycles, but never more than half a per cent of the light above what they lose, so that a
    /// furnace test stays at white: at most the loss of the roughness in the direction's plane, and less towards the
    /// horizon.
    #[inline]
    pub fn towards(&self, w: Vec3) -> f32 {
        let cos = w.z.abs();
        let loss = self.at(cos);
        match self.facets.is_even() {
            true => loss,
            false => self.at_most(loss, cos, w),
        }
    }

    #[inline(never)]
    fn at_most(&self, loss: f32, cos: f32, w: Vec3) -> f32 {
        let narrow = self.facets.aspect.min(1.0 / self.facets.aspect);
        loss.min(self.in_plane(w).at(cos)) * (1.0 - (1.0 - narrow) * (1.0 - cos.min(1.0)))
    }

    /// Isotropic facets of the roughness in a direction's plane.
    fn in_plane(&self, w: Vec3) -> Self {
        Self::of(Facets::even(self.facets.distribution, self.facets.alpha_towards(w)))
    }

    /// The loss for diffuse light.
    #[inline]
    pub fn mean(&self) -> f32 {
        Place::of(self.root, MEANS).between(|i| loss_of(self.means[i]))
    }

    /// Value of the lobe that restores losses, if every bounce reflects everything: its albedo is the loss. Takes the
    /// losses at both cosines.
    #[inline]
    pub fn returned(&self, [at_o, at_i]: [f32; 2]) -> f32 {
        let mean = self.mean();
        match mean > 0.0 {
            true => at_o * at_i / mean * FRAC_1_PI,
            false => 0.0,
        }
    }

    /// Share of light left on the bounces after the first. `mean_fresnel`: reflectance for diffuse light. Kulla & Conty
    /// 2017.
    #[inline]
    pub fn further_bounces(&self, mean_fresnel: Rgb) -> Rgb {
        let mean = self.mean();
        mean_fresnel * mean_fresnel * (1.0 - mean) / (Rgb::ONE - mean_fresnel * mean)
    }
}

/// Total reflection of a dielectric's GGX facets over all bounces.
#[derive(Clone, Copy)]
pub(super) struct Layer {
    pub losses: Losses,
    /// Reflectance at normal incidence.
    normal: f32,
    /// Reflectance of a bounce for diffuse light.
    pub mean_fresnel: f32,
    /// Share that further bounces keep.
    further: f32,
    row: Place,
    eta: Place,
}

impl Layer {
    /// `eta`: index inside over the one outside, at least 1.
    #[inline]
    pub fn of(facets: Facets, eta: f32) -> Self {
        let losses = Losses::of(facets);
        // Tables are indexed by the fourth root of the reflectance at normal incidence.
        let r = (eta - 1.0) / (eta + 1.0);
        let normal = r * r;
        let z = (r.sqrt() / MOST_Z).min(1.0);
        let eta = Place::of(z, ETAS);
        let mean_fresnel = above(normal, eta.between(|i| share_of(MEAN_FRESNEL[i])));
        Self {
            losses,
            normal,
            mean_fresnel,
            further: losses.further_bounces(Rgb::splat(mean_fresnel)).x,
            row: Place::of(losses.root, LAYER_ROWS),
            eta,
        }
    }

    /// The same facets with another reflectance at normal incidence, which still rises to one at grazing angles.
    #[inline]
    pub fn reflecting(self, normal: f32) -> Self {
        let mean_fresnel = above(normal, (self.mean_fresnel - self.normal) / (1.0 - self.normal));
        Self {
            normal,
            mean_fresnel,
            further: self.losses.further_bounces(Rgb::splat(mean_fresnel)).x,
            ..self
        }
    }

    /// Reflectance of one bounce for diffuse light, of facets with this reflectance at normal incidence.
    #[inline]
    pub fn mean_of(&self, normal: Rgb) -> Rgb {
        let share = (self.mean_fresnel - self.normal) / (1.0 - self.normal);
        normal + (Rgb::ONE - normal) * share
    }

    /// Value of the lobe of further bounces, for both cosines.
    #[inline]
    pub fn returned(&self, cosines: [f32; 2]) -> f32 {
        self.further * self.losses.returned(cosines.map(|cos| self.losses.at(cos)))
    }

    /// Its reflectance for light at this cosine, whose loss is known.
    #[inline]
    pub fn albedo(&self, cos: f32, loss: f32) -> f32 {
        let column = Place::of(cos.min(1.0).sqrt(), LAYER_COSINES);
        let share = self.eta.between(|eta| {
            self.row
                .between(|row| column.between(|column| share_of(LAYERS[eta][row][column])))
        });
        above(self.normal, share) * (1.0 - loss) + self.further * loss
    }

    /// Its reflectance for light from a direction whose loss is known. Anisotropic facets reflect at least as much as
    /// those of the roughness in the direction's plane, so that a base beneath never receives more than there is.
    #[inline]
    pub fn towards(&self, w: Vec3, loss: f32) -> f32 {
        let albedo = self.albedo(w.z.abs(), loss);
        match self.losses.facets.is_even() {
            true => albedo,
            false => self.at_least(albedo, w),
        }
    }

    #[inline(never)]
    fn at_least(&self, albedo: f32, w: Vec3) -> f32 {
        let losses = self.losses.in_plane(w);
        let in_plane = Self {
            losses,
            further: losses.further_bounces(Rgb::splat(self.mean_fresnel)).x,
            row: Place::of(losses.root, LAYER_ROWS),
            ..*self
        };
        let cos = w.z.abs();
        albedo.max(in_plane.albedo(cos, losses.at(cos)))
    }

    /// Its reflectance for diffuse light.
    #[inline]
    pub fn mean_albedo(&self) -> f32 {
        let share = (self.eta).between(|eta| self.row.between(|row| share_of(MEAN_LAYERS[eta][row])));
        self.mean_fresnel * share
    }

    /// Value of a white base beneath it, whose albedo is one minus that of the layer. Takes the layer's albedo at both
    /// cosines.
    #[inline]
    pub fn base(&self, [at_o, at_i]: [f32; 2]) -> f32 {
        (1.0 - at_o) * (1.0 - at_i) / (1.0 - self.mean_albedo()).max(f32::MIN_POSITIVE) * FRAC_1_PI
    }
}

/// Interpolates from `low` to one.
#[inline]
fn above(low: f32, share: f32) -> f32 {
    low + (1.0 - low) * share
}

/// Reflectance of Schlick's approximation for diffuse light, given that at normal incidence.
#[inline]
pub(super) fn mean_of_schlick(normal: Rgb) -> Rgb {
    normal * (1.0 - MEAN_SCHLICK) + MEAN_SCHLICK
}

/// Reflectance of a conductor for diffuse light.
pub(super) fn mean_of_conductor(eta: Rgb, k: Rgb) -> Rgb {
    const N: u32 = 64;
    let term = |i: u32| {
        let cos = (i as f32 + 0.5) / N as f32;
        fresnel_conductor(cos, eta, k) * cos
    };
    (0..N).map(term).sum::<Rgb>() * (2.0 / N as f32)
}

/// The tables as devices store them. Losses of a distribution: `ROWS` times `COSINES`, and `MEANS` means.
pub fn loss_numbers(distribution: Distribution) -> impl Iterator<Item = f32> {
    let (table, means) = match distribution {
        Distribution::Ggx => (&tables::GGX, &tables::GGX_MEANS),
        Distribution::Beckmann => (&tables::BECKMANN, &tables::BECKMANN_MEANS),
    };
    (table.as_flattened().iter().chain(means)).map(|number| loss_of(*number))
}

/// Tables of layers: `ETAS` times `LAYER_ROWS` times `LAYER_COSINES`, as many means without cosines, and as many mean
/// reflectances without rows.
pub fn layer_numbers() -> impl Iterator<Item = f32> {
    let layers = LAYERS.as_flattened().as_flattened().iter();
    let means = MEAN_LAYERS.as_flattened().iter();
    layers.chain(means).chain(&MEAN_FRESNEL).map(|number| share_of(*number))
}
