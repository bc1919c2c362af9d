//! Surface photons: where light landed on surfaces that are not specular, and the density estimate over them.

use crate::math::{Rgb, Vec3};
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams};
use std::time::Duration;

/// What happened to a photon before it arrived: this decides which estimator counts it (see `transport`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Straight from the light, boundaries of media aside.
    Direct,
    /// From a specular surface.
    Specular,
    /// From a scattering in a medium.
    Scattered,
    /// From a surface that is not specular.
    Surface,
}

/// A photon on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePhoton {
    /// Where, render space.
    pub point: Vec3,
    /// Unit geometric normal there.
    pub ng: Vec3,
    /// Unit direction that the light came from.
    pub wi: Vec3,
    /// Flux, W, divided by the number of emitted paths.
    pub power: Rgb,
    /// Kernel radius, scene units.
    pub radius: f32,
    /// Its last scattering.
    pub arrival: Arrival,
    /// How well photons find this light, compared to gather rays: see `transport::surface`. Infinite where only photons do.
    pub odds: f32,
    /// Group of the light that it comes from, see [`crate::parts::LayerPlan::group`].
    pub group: u16,
}

impl Boundable for SurfacePhoton {
    fn aabb(&self) -> Aabb {
        let p = Vec3A::from(self.point);
        Aabb::new(p - self.radius, p + self.radius)
    }
}

/// The surface photons of a pass in a hierarchy of their kernels' bounds.
pub struct SurfacePhotonMap {
    photons: Vec<SurfacePhoton>,
    bvh: Bvh2,
}

/// Photons whose surface is turned away further than this (cosine) from the one looked at belong to another surface.
const MIN_NORMAL_COSINE: f32 = 0.7;
/// Photons further off the tangent plane than this share of their radius belong to another surface.
const MAX_PLANE_DISTANCE: f32 = 0.25;

impl SurfacePhotonMap {
    /// Build the map. Deterministic.
    pub fn new(photons: Vec<SurfacePhoton>) -> Self {
        let bvh = build_bvh2(
            &photons,
            BvhBuildParams {
                max_prims_per_leaf: 8,
                ..BvhBuildParams::fastest_build()
            },
            &mut Duration::default(),
        );
        let order = &bvh.primitive_indices;
        Self {
            photons: order.iter().map(|&i| photons[i as usize]).collect(),
            bvh,
        }
    }

    /// Calls `visit(photon, kernel)` for every photon whose kernel covers the surface point; `kernel` is the 2D
    /// Epanechnikov kernel, 1/area, which integrates to 1 over a disc of the photon's radius.
    pub fn gather(&self, point: Vec3, ng: Vec3, mut visit: impl FnMut(&SurfacePhoton, f32)) {
        self.bvh.point_traverse(Vec3A::from(point), |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let first = node.first_index as usize;
            for photon in &self.photons[first..first + node.prim_count as usize] {
                let offset = photon.point - point;
                let distance2 = offset.length_squared();
                let radius2 = photon.radius * photon.radius;
                if distance2 >= radius2
                    || photon.ng.dot(ng) < MIN_NORMAL_COSINE
                    || offset.dot(ng).abs() > MAX_PLANE_DISTANCE * photon.radius
                {
                    continue;
                }
                let x = distance2 / radius2;
                visit(photon, 2.0 / (std::f32::consts::PI * radius2) * (1.0 - x));
            }
            true
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_integrates_to_one_over_the_plane() {
        let photon = SurfacePhoton {
            point: Vec3::new(0.3, -0.2, 1.0),
            ng: Vec3::Z,
            wi: Vec3::Z,
            power: Rgb::ONE,
            radius: 0.25,
            arrival: Arrival::Specular,
            odds: f32::INFINITY,
            group: 0,
        };
        let map = SurfacePhotonMap::new(vec![photon]);
        let n = 400;
        let mut sum = 0.0;
        for i in 0..n * n {
            let (x, y) = ((i % n) as f32, (i / n) as f32);
            let p = Vec3::new((x + 0.5) / n as f32 - 0.2, (y + 0.5) / n as f32 - 0.7, 1.0);
            map.gather(p, Vec3::Z, |_, k| sum += k as f64);
        }
        assert!((sum / (n * n) as f64 - 1.0).abs() < 1e-3, "{sum}");
    }
}
