//! Surface photons: where light landed on surfaces that are not specular, and the density estimate over them.

use crate::cpu::kernel;
use crate::math::{PI, Rgb, Vec3};
use crate::plan::aov::GroupNumber;
use crate::plan::weights::FoundBy;
use crate::wide::WideTree;
use crate::world::spectrum::WaveNumber;
use glam::{Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams};
use std::time::Duration;

/// What happened to a photon before it arrived; this decides which estimator counts it (see `transport`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Straight from the light, boundaries of media aside.
    Direct,
    /// By surfaces that paths follow: straight from the light or, where photons go on, from anywhere.
    Caustic,
    /// From a scattering in a medium whose light beams bring, then only by surfaces that paths follow.
    Scattered,
    /// From another surface, or from a medium of the other kind.
    Surface,
}

/// Which lobes of its surface see a photon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeenBy {
    /// Those that camera paths do not follow.
    Wide,
    /// The one that they follow.
    Followed,
    /// All lobes.
    All,
}

impl SeenBy {
    /// Whether the followed lobe, or else the other lobes, see it.
    #[inline]
    pub fn sees(self, followed: bool) -> bool {
        match self {
            Self::Wide => !followed,
            Self::Followed => followed,
            Self::All => true,
        }
    }
}

/// The walls that cross a kernel. A look-up uses them to decide whether to check for a wall in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Height above the surface at which to check, scene units; zero if no wall crosses.
    pub height: f32,
    /// If it is a number, all walls are where the offset from the photon times this is above 1.
    pub beyond: Vec3,
}

impl Crossing {
    /// No wall crosses.
    pub const NONE: Self = Self {
        height: 0.0,
        beyond: Vec3::ZERO,
    };

    /// Whether a wall may stand between the photon and a point at this offset.
    #[inline(always)]
    pub fn may_hide(&self, offset: Vec3) -> bool {
        // True also if the product is not a number.
        let is_before = self.beyond.dot(offset) < 1.0;
        self.height > 0.0 && !is_before
    }
}

/// A photon on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePhoton {
    /// Position, render space.
    pub point: Vec3,
    /// Unit geometric normal there.
    pub ng: Vec3,
    /// Unit direction that the light came from.
    pub wi: Vec3,
    /// Flux, W, divided by the number of emitted paths.
    pub power: Rgb,
    /// Kernel radius, scene units.
    pub radius: f32,
    /// The walls that cross the kernel.
    pub walls: Crossing,
    /// Its last scattering.
    pub arrival: Arrival,
    /// Which technique finds this light.
    pub found_by: FoundBy,
    /// Which lobes see it.
    pub lobes: SeenBy,
    /// Group of the light that it comes from; see [`crate::plan::aov::LayerPlan::group`].
    pub group: Option<GroupNumber>,
    /// The wavelength of its light, if it has one. The power does not contain its weight.
    pub wave: Option<WaveNumber>,
    /// Kind of the light that it comes from; see [`crate::world::mask::VisibilityMask::light_kind`].
    pub light_kind: u8,
}

impl Boundable for SurfacePhoton {
    fn aabb(&self) -> Aabb {
        let p = Vec3A::from(self.point);
        Aabb::new(p - self.radius, p + self.radius)
    }
}

/// The surface photons of a pass, in a tree over their kernels' bounds.
pub struct SurfacePhotonMap {
    tree: WideTree,
    /// The leaves of the tree.
    fours: Vec<Four>,
    /// In the order of the leaves.
    photons: Vec<SurfacePhoton>,
}

/// What decides whether the kernels of four photons cover a point.
struct Four {
    /// Index of the first photon.
    first: usize,
    point: [Vec4; 3],
    ng: [Vec4; 3],
    /// Squares of the radii; zero in unused places.
    radius2: Vec4,
    /// How far off the tangent plane a look-up may be.
    off_plane: Vec4,
}

/// A photon whose normal has a smaller cosine than this with the point's belongs to another surface.
pub(crate) const MIN_NORMAL_COSINE: f32 = 0.7;
/// A photon further off the tangent plane than this share of its radius belongs to another surface.
pub(crate) const MAX_PLANE_DISTANCE: f32 = 0.25;

impl SurfacePhotonMap {
    /// Build the map. Deterministic.
    pub fn new(photons: Vec<SurfacePhoton>) -> Self {
        let params = BvhBuildParams {
            max_prims_per_leaf: 1,
            ..BvhBuildParams::fastest_build()
        };
        let binary = build_bvh2(&photons, params, &mut Duration::default());
        let mut is_leaf = vec![false; binary.nodes.len()];
        if !photons.is_empty() {
            merge(&binary, 0, &mut is_leaf);
        }
        let mut fours: Vec<Four> = Vec::new();
        let mut in_order: Vec<SurfacePhoton> = Vec::with_capacity(photons.len());
        let tree = WideTree::new(&binary, &is_leaf, |index| {
            let mut four = Four {
                first: in_order.len(),
                ..Four::EMPTY
            };
            let mut parts = vec![index];
            let mut placed = 0;
            while let Some(index) = parts.pop() {
                let node = &binary.nodes[index];
                let first = node.first_index as usize;
                if !node.is_leaf() {
                    parts.extend([first + 1, first]);
                    continue;
                }
                let photon = photons[binary.primitive_indices[first] as usize];
                four.set(placed, &photon);
                placed += 1;
                in_order.push(photon);
            }
            fours.push(four);
            (fours.len() - 1) as u32
        });
        Self {
            tree,
            fours,
            photons: in_order,
        }
    }

    /// Calls `visit(photon, kernel)` for every photon whose kernel covers the surface point. `kernel` is the 2D
    /// Epanechnikov kernel in the photon's tangent plane, 1/area, times the cosine between the normals: over a bent
    /// surface it integrates to what the kernel's disc does over the surface's projection.
    pub fn gather(&self, point: Vec3, ng: Vec3, mut visit: impl FnMut(&SurfacePhoton, f32)) {
        self.tree.around_point(point, |leaf| {
            let four = &self.fours[leaf as usize];
            let (across2, cos, mut mask) = four.covering(point, ng);
            while mask != 0 {
                let i = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                let radius2 = four.radius2[i];
                let x = across2[i] / radius2;
                let photon = &self.photons[four.first + i];
                visit(photon, kernel::on_disc(x, PI * radius2) * cos[i]);
            }
        });
    }
}

/// Marks the nodes of a binary tree that hold up to four photons. Returns how many this node holds.
fn merge(binary: &Bvh2, index: usize, is_leaf: &mut [bool]) -> usize {
    let node = &binary.nodes[index];
    let first = node.first_index as usize;
    let photons = match node.is_leaf() {
        true => 1,
        false => merge(binary, first, is_leaf) + merge(binary, first + 1, is_leaf),
    };
    is_leaf[index] = photons <= 4;
    photons
}

impl Four {
    const EMPTY: Self = Self {
        first: 0,
        point: [Vec4::ZERO; 3],
        ng: [Vec4::ZERO; 3],
        radius2: Vec4::ZERO,
        off_plane: Vec4::ZERO,
    };

    fn set(&mut self, i: usize, photon: &SurfacePhoton) {
        for axis in 0..3 {
            self.point[axis][i] = photon.point[axis];
            self.ng[axis][i] = photon.ng[axis];
        }
        self.radius2[i] = photon.radius * photon.radius;
        self.off_plane[i] = MAX_PLANE_DISTANCE * photon.radius;
    }

    /// Squared distances to a point along the photons' tangent planes, cosines between the normals, and which of the
    /// kernels cover the point.
    #[inline(always)]
    fn covering(&self, point: Vec3, ng: Vec3) -> (Vec4, Vec4, u32) {
        let [px, py, pz] = self.point;
        let [nx, ny, nz] = self.ng;
        let (x, y, z) = (px - point.x, py - point.y, pz - point.z);
        let distance2 = x * x + y * y + z * z;
        let cos = nx * ng.x + ny * ng.y + nz * ng.z;
        let height = x * nx + y * ny + z * nz;
        let covering = distance2.cmplt(self.radius2)
            & cos.cmpge(Vec4::splat(MIN_NORMAL_COSINE))
            & height.abs().cmple(self.off_plane);
        (distance2 - height * height, cos, covering.bitmask())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;

    #[test]
    fn kernel_integrates_to_one_over_the_plane() {
        let photon = SurfacePhoton {
            point: Vec3::new(0.3, -0.2, 1.0),
            ng: Vec3::Z,
            wi: Vec3::Z,
            power: Rgb::ONE,
            radius: 0.25,
            walls: Crossing::NONE,
            arrival: Arrival::Caustic,
            found_by: FoundBy::Photons,
            lobes: SeenBy::Wide,
            group: None,
            wave: None,
            light_kind: 0,
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

    /// On a bent surface, with radii of all sizes, the map finds the same photons as a search through all of them.
    #[test]
    fn photons_are_those_found_one_by_one() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 1);
        for number in [0, 1, 3, 4, 5, 600] {
            let photons: Vec<SurfacePhoton> = (0..number)
                .map(|_| {
                    let n = warp::uniform_sphere(sampler.next_2d());
                    SurfacePhoton {
                        point: n,
                        ng: n,
                        wi: n,
                        power: Rgb::splat(sampler.next_1d()),
                        radius: 0.6 * sampler.next_1d(),
                        walls: Crossing::NONE,
                        arrival: Arrival::Surface,
                        found_by: FoundBy::Photons,
                        lobes: SeenBy::Wide,
                        group: None,
                        wave: None,
                        light_kind: 0,
                    }
                })
                .collect();
            let map = SurfacePhotonMap::new(photons.clone());
            for _ in 0..300 {
                let ng = warp::uniform_sphere(sampler.next_2d());
                let point = ng * 1.01;
                let mut found: Vec<u32> = Vec::new();
                map.gather(point, ng, |p, _| found.push(p.power.x.to_bits()));
                let covers = |p: &&SurfacePhoton| {
                    let offset = p.point - point;
                    offset.length() < p.radius
                        && p.ng.dot(ng) >= MIN_NORMAL_COSINE
                        && offset.dot(p.ng).abs() <= MAX_PLANE_DISTANCE * p.radius
                };
                let expected = photons.iter().filter(covers);
                let mut expected: Vec<u32> = expected.map(|p| p.power.x.to_bits()).collect();
                found.sort_unstable();
                expected.sort_unstable();
                assert_eq!(found, expected);
            }
        }
    }
}
