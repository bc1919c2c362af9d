//! Light that is scattered more than once among microfacets, which one bounce loses (Kulla & Conty 2017, "Revisiting
//! physically based shading at Imageworks"): a wide lobe brings it back, and a diffuse base beneath the facets gets
//! what these do not reflect. All of it is reciprocal but [`glass`].
//!
//! A *loss* is the share of light from a direction that one bounce among facets that reflect everything does not send
//! back: one less their directional albedo. Losses and Fresnel's mean over the facets are looked up in [`tables`],
//! between whose numbers the way is straight.

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

/// From whole numbers of the tables to shares.
const UNIT: f32 = 1.0 / 65535.0;
/// Of the tables' last index of refraction: see [`Layer`].
const MOST_Z: f32 = 0.7;
/// Schlick's weight, averaged over diffuse light.
const MEAN_SCHLICK: f32 = 1.0 / 21.0;

/// A place between two numbers of a table: the first, and how far it is on the way to the next.
#[derive(Clone, Copy)]
struct Place {
    first: usize,
    on: f32,
}

impl Place {
    /// `x` in [0, 1] of so many equidistant numbers.
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

/// Losses are kept as their roots: small ones keep their digits.
#[inline]
fn loss_of(number: u16) -> f32 {
    let root = f32::from(number) * UNIT;
    root * root
}

#[inline]
fn share_of(number: u16) -> f32 {
    f32::from(number) * UNIT
}

/// What facets of a roughness lose.
#[derive(Clone, Copy)]
pub(super) struct Losses {
    table: &'static [[u16; COSINES]; ROWS],
    means: &'static [u16; MEANS],
    facets: Facets,
    alpha: f32,
    /// The root of `alpha`, at most 1: what is rougher counts as that.
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

    /// The loss of light from a direction with this cosine.
    #[inline]
    pub fn at(&self, cos: f32) -> f32 {
        let cos = cos.min(1.0);
        let column = Place::of(cos * (1.0 + self.alpha) / (cos + self.alpha), COSINES);
        self.row
            .between(|row| column.between(|column| loss_of(self.table[row][column])))
    }

    /// The loss of light from a direction. Tables have that of facets that are alike in all directions. Of others it
    /// is that of their mean roughness, as Cycles has it, but nowhere above what they lose by half a per cent of the
    /// light, so that a furnace is not brighter than white: not above that of the roughness in the direction's plane,
    /// and less towards the horizon.
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

    /// Of even facets of the roughness in a direction's plane.
    fn in_plane(&self, w: Vec3) -> Self {
        Self::of(Facets::even(self.facets.distribution, self.facets.alpha_towards(w)))
    }

    /// The loss of diffuse light.
    #[inline]
    pub fn mean(&self) -> f32 {
        Place::of(self.root, MEANS).between(|i| loss_of(self.means[i]))
    }

    /// Value of the lobe that brings back what is lost, where all bounces reflect everything: its albedo is the loss.
    /// Of losses at both cosines.
    #[inline]
    pub fn returned(&self, [at_o, at_i]: [f32; 2]) -> f32 {
        let mean = self.mean();
        match mean > 0.0 {
            true => at_o * at_i / mean * FRAC_1_PI,
            false => 0.0,
        }
    }

    /// What is left of light on its bounces after the first: `mean_fresnel` is what one reflects of diffuse light.
    /// Kulla & Conty 2017.
    #[inline]
    pub fn further_bounces(&self, mean_fresnel: Rgb) -> Rgb {
        let mean = self.mean();
        mean_fresnel * mean_fresnel * (1.0 - mean) / (Rgb::ONE - mean_fresnel * mean)
    }
}

/// What GGX facets of a dielectric reflect in all, by as many bounces as it takes.
#[derive(Clone, Copy)]
pub(super) struct Layer {
    pub losses: Losses,
    /// Reflectance at normal incidence.
    normal: f32,
    /// What a bounce reflects of diffuse light.
    pub mean_fresnel: f32,
    /// What further bounces keep.
    further: f32,
    row: Place,
    eta: Place,
}

impl Layer {
    /// `eta`: index inside over the one outside, at least 1.
    #[inline]
    pub fn of(facets: Facets, eta: f32) -> Self {
        let losses = Losses::of(facets);
        // Tables go by the fourth root of the reflectance at normal incidence.
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

    /// The same facets of another reflectance at normal incidence, which goes to one at grazing angles alike.
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

    /// What one bounce reflects of diffuse light, of facets that reflect so much at normal incidence in the same way.
    #[inline]
    pub fn mean_of(&self, normal: Rgb) -> Rgb {
        let share = (self.mean_fresnel - self.normal) / (1.0 - self.normal);
        normal + (Rgb::ONE - normal) * share
    }

    /// Value of the lobe of further bounces, by both cosines.
    #[inline]
    pub fn returned(&self, cosines: [f32; 2]) -> f32 {
        self.further * self.losses.returned(cosines.map(|cos| self.losses.at(cos)))
    }

    /// What it reflects of light from a direction with this cosine, whose loss is known.
    #[inline]
    pub fn albedo(&self, cos: f32, loss: f32) -> f32 {
        let column = Place::of(cos.min(1.0).sqrt(), LAYER_COSINES);
        let share = self.eta.between(|eta| {
            self.row
                .between(|row| column.between(|column| share_of(LAYERS[eta][row][column])))
        });
        above(self.normal, share) * (1.0 - loss) + self.further * loss
    }

    /// What it reflects of light from a direction whose loss is known. Facets that are not alike in all directions
    /// reflect no less than those of the roughness in the direction's plane would: a base beneath gets no more than
    /// there is.
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

    /// What it reflects of diffuse light.
    #[inline]
    pub fn mean_albedo(&self) -> f32 {
        let share = (self.eta).between(|eta| self.row.between(|row| share_of(MEAN_LAYERS[eta][row])));
        self.mean_fresnel * share
    }

    /// Value of a white base beneath it, whose albedo is one less that of the layer. Of the latter at both cosines.
    #[inline]
    pub fn base(&self, [at_o, at_i]: [f32; 2]) -> f32 {
        (1.0 - at_o) * (1.0 - at_i) / (1.0 - self.mean_albedo()).max(f32::MIN_POSITIVE) * FRAC_1_PI
    }
}

/// So far from `low` to one.
#[inline]
fn above(low: f32, share: f32) -> f32 {
    low + (1.0 - low) * share
}

/// What Schlick's approximation reflects of diffuse light, by what it does at normal incidence.
#[inline]
pub(super) fn mean_of_schlick(normal: Rgb) -> Rgb {
    normal * (1.0 - MEAN_SCHLICK) + MEAN_SCHLICK
}

/// What a conductor reflects of diffuse light.
pub(super) fn mean_of_conductor(eta: Rgb, k: Rgb) -> Rgb {
    const N: u32 = 64;
    let term = |i: u32| {
        let cos = (i as f32 + 0.5) / N as f32;
        fresnel_conductor(cos, eta, k) * cos
    };
    (0..N).map(term).sum::<Rgb>() * (2.0 / N as f32)
}

/// The tables as devices have them. Losses of a distribution: `ROWS` times `COSINES`, and `MEANS` means.
pub fn loss_numbers(distribution: Distribution) -> impl Iterator<Item = f32> {
    let (table, means) = match distribution {
        Distribution::Ggx => (&tables::GGX, &tables::GGX_MEANS),
        Distribution::Beckmann => (&tables::BECKMANN, &tables::BECKMANN_MEANS),
    };
    (table.as_flattened().iter().chain(means)).map(|number| loss_of(*number))
}

/// Those of layers: `ETAS` times `LAYER_ROWS` times `LAYER_COSINES`, as many means without cosines, and as many
/// mean reflectances without rows.
pub fn layer_numbers() -> impl Iterator<Item = f32> {
    let layers = LAYERS.as_flattened().as_flattened().iter();
    let means = MEAN_LAYERS.as_flattened().iter();
    layers.chain(means).chain(&MEAN_FRESNEL).map(|number| share_of(*number))
}
