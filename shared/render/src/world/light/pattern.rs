//! Emitters whose radiance a texture varies.
//!
//! Points on a mesh are drawn by triangle, in proportion to its emission as estimated on a lattice of samples. A share
//! by area covers what the samples miss, so that every emitting point can be drawn.

use crate::math::{Rgb, Vec2, Vec3, mean};
use crate::world::geometry::mesh::Mesh;
use crate::world::geometry::{Shape, SurfacePoint};
use crate::world::texture::graph::{Place, Space, Viewer};
use crate::world::texture::{Texture, TexturePoint};
use std::sync::Arc;

/// Share of points drawn by area alone.
const BY_AREA: f64 = 0.1;
/// Samples per surface, and the least number per triangle.
const SAMPLES: usize = 1 << 16;
const FEWEST: usize = 8;

/// Variation of radiance over a surface.
#[derive(Clone, Debug)]
pub struct Pattern {
    texture: Texture,
    /// Factor on the texture, W/(m^2 sr).
    scale: Rgb,
    /// Position data for the texture, if it is a graph.
    space: Option<Arc<Space>>,
    /// For a mesh: running sums of its triangles' probabilities; the last is 1.
    sums: Vec<f64>,
}

impl Pattern {
    /// Whether it varies with texture coordinates.
    pub(super) fn reads_uv(&self) -> bool {
        self.texture.reads_uv()
    }

    /// The texture.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Factor on the texture, W/(m^2 sr).
    pub fn scale(&self) -> Rgb {
        self.scale
    }

    /// For a mesh: running sums of its triangles' probabilities; the last is 1.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// The texture over a shape, times `scale`, and the mean radiance over the surface. `None`: it is black at all
    /// samples and in everything it is made of. `space`: position data of the shape for graphs. Graphs see the surface
    /// head-on wherever it is drawn, since light leaves in all directions.
    pub fn new(texture: Texture, scale: Rgb, shape: &Shape, space: Option<Arc<Space>>) -> Option<(Self, Rgb)> {
        if !texture.may_be_positive() || scale == Rgb::ZERO {
            return None;
        }
        let mut pattern = Self {
            texture,
            scale,
            space,
            sums: Vec::new(),
        };
        let count = shape.mesh().map_or(1, |mesh| mesh.triangles.len());
        let samples = (SAMPLES / count.max(1)).max(FEWEST);
        let found: Vec<[f64; 4]> = (0..count)
            .map(|part| pattern.mean_over(shape, part as u32, samples))
            .collect();
        let area: f64 = found.iter().map(|[.., area]| area).sum();
        let total = |channel: usize| found.iter().map(|part| part[channel] * part[3]).sum::<f64>() / area;
        let radiance = Rgb::from_array([0, 1, 2].map(|channel| total(channel) as f32));
        if shape.mesh().is_some() {
            let emitted = |[r, g, b, area]: &[f64; 4]| (r + g + b) * area;
            let all: f64 = found.iter().map(emitted).sum();
            let by_power = if all > 0.0 { (1.0 - BY_AREA) / all } else { 0.0 };
            let by_area = if all > 0.0 { BY_AREA / area } else { 1.0 / area };
            let mut sum = 0.0;
            pattern.sums = found
                .iter()
                .map(|part| {
                    sum += emitted(part) * by_power + part[3] * by_area;
                    sum
                })
                .collect();
            pattern.sums.iter_mut().for_each(|running| *running /= sum);
        }
        // The samples may miss emission: the light still counts, with little weight.
        let least = f32::MIN_POSITIVE.max(1e-6 * mean(scale));
        let radiance = if mean(radiance) > 0.0 {
            radiance
        } else {
            Rgb::splat(least)
        };
        Some((pattern, radiance))
    }

    /// Mean radiance over one triangle, or over the whole of another shape, and the area.
    fn mean_over(&self, shape: &Shape, part: u32, samples: usize) -> [f64; 4] {
        let mut sum = [0.0; 4];
        let mut weights = 0.0;
        for i in 0..samples {
            // The Kronecker lattice.
            let u = Vec2::new(i as f32 * 0.754_877_7, i as f32 * 0.569_840_3).fract();
            let (at, weight) = match shape.mesh() {
                Some(mesh) => (mesh.point_in(part, u, 0.0), 1.0),
                None => {
                    let at = shape.sample_area(u, 0.0);
                    (at, f64::from(1.0 / at.pdf_area))
                }
            };
            let radiance = self.radiance_of(shape, &at);
            for (sum, value) in sum.iter_mut().zip(radiance.to_array()) {
                *sum += f64::from(value) * weight;
            }
            weights += weight;
        }
        let area = shape.mesh().map_or(1.0, |mesh| triangle_area(mesh, part));
        [sum[0] / weights, sum[1] / weights, sum[2] / weights, area]
    }

    /// Radiance at a point, W/(m^2 sr).
    #[inline]
    pub fn radiance(&self, at: &TexturePoint) -> Rgb {
        match &self.texture {
            Texture::Graph(program) if program.reads().view => program.eval(&seen_from_above(at)) * self.scale,
            texture => texture.eval(at) * self.scale,
        }
    }

    /// Radiance at a drawn point of the shape.
    #[inline]
    pub fn radiance_of(&self, shape: &Shape, on: &SurfacePoint) -> Rgb {
        let normal = on.normal;
        let place = match &self.space {
            Some(space) => space.place(on.point, normal, normal, normal),
            None => Place::NOWHERE,
        };
        self.radiance(&shape.texture_point(on.point, on.primitive, on.weights, place))
    }

    /// Draws a point of the shape. `u_primitive` chooses a triangle.
    pub fn sample(&self, shape: &Shape, u: Vec2, u_primitive: f32) -> SurfacePoint {
        let Some(mesh) = shape.mesh() else {
            return shape.sample_area(u, u_primitive);
        };
        let x = f64::from(u_primitive);
        let triangle = self.sums.partition_point(|&sum| sum <= x).min(self.sums.len() - 1) as u32;
        mesh.point_in(triangle, u, self.pdf_in(mesh, triangle))
    }

    /// Density of [`Self::sample`] per area, at a point with this unit geometric normal in this triangle.
    #[inline]
    pub fn pdf_area(&self, shape: &Shape, normal: Vec3, primitive: u32) -> f32 {
        match shape.mesh() {
            Some(mesh) => self.pdf_in(mesh, primitive),
            None => shape.pdf_area(normal),
        }
    }

    fn pdf_in(&self, mesh: &Mesh, triangle: u32) -> f32 {
        let index = triangle as usize;
        let below = if index == 0 { 0.0 } else { self.sums[index - 1] };
        ((self.sums[index] - below) / triangle_area(mesh, triangle)) as f32
    }
}

/// Emission does not depend on the direction of view.
fn seen_from_above(at: &TexturePoint) -> TexturePoint {
    let place = Place {
        wo: at.place.normal,
        is_behind: false,
        viewer: Viewer::Other,
        ..at.place
    };
    TexturePoint { place, ..*at }
}

fn triangle_area(mesh: &Mesh, triangle: u32) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}
