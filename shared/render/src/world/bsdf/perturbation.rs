//! Bump and normal maps: images that turn the shading normal, as in Mitsuba 3.

use super::BsdfFlags;
use crate::math::{Frame, Vec2, Vec3, luminance};
use crate::world::geometry::SurfaceHit;
use crate::world::texture::graph::Space;
use crate::world::texture::{Texture, TexturePoint};

/// How an image perturbs shading normals.
#[derive(Clone, Debug)]
pub enum NormalPerturbation {
    /// Heights over the surface (Blinn 1978).
    BumpMap {
        /// Its luminance is the height, scene units.
        height: Texture,
        /// Factor on the height.
        scale: f32,
    },
    /// Normals relative to the surface's own: (x + 1) / 2 of the part along dp/du, across it (on meshes to the side to
    /// which v grows), and along the normal.
    NormalMap(Texture),
    /// Bump and normal maps, each applied to the normal that the ones before it produce, with a strength that blends
    /// the two normals, as Blender's Bump node does.
    Layers(Vec<(Self, f32)>),
}

/// Shadowing by the slopes of a bump or normal map, which shading with the perturbed normal alone omits.
/// [`super::Bsdf::eval_bumped`] decides which lobes it applies to.
#[derive(Clone, Copy, Debug)]
pub struct BumpShadowing {
    /// The normal before it was perturbed, in the frame of the hit.
    normal: Vec3,
    /// Square of the roughness of a surface with such slopes.
    alpha2: f32,
}

/// Least component of a perturbed normal along the surface's own.
const MIN_COSINE: f32 = 1e-3;
/// Least cosine between the surface's normal and the mirror reflection about a perturbed normal, and its share of the
/// reflected cosine where that is smaller.
const LEAST_REFLECTED: f32 = 0.01;
const SHARE_REFLECTED: f32 = 0.9;

/// The surface whose normal is perturbed.
#[derive(Clone, Copy, Debug)]
pub struct Perturbed<'a> {
    /// dp/du and dp/dv at the hit; for a normal map, the directions of its x and y if something else defines them.
    pub tangents: [Vec3; 2],
    /// What graphs need to know of it.
    pub space: Option<&'a Space>,
    /// Reflects as a mirror does: all reflections stay above it.
    pub mirrors: bool,
    /// Normal maps follow the direction in which v grows, also where UV are mirrored.
    pub along_v: bool,
}

impl NormalPerturbation {
    /// The textures that it looks up.
    pub fn textures(&self) -> Vec<&Texture> {
        match self {
            Self::BumpMap { height, .. } => vec![height],
            Self::NormalMap(map) => vec![map],
            Self::Layers(layers) => layers.iter().flat_map(|(layer, _)| layer.textures()).collect(),
        }
    }

    /// Flags for what it looks up.
    pub(super) fn reads(&self) -> BsdfFlags {
        (self.textures().into_iter()).fold(BsdfFlags::empty(), |flags, texture| {
            // The slope of a graph depends on the space around the hit.
            let is_graph = matches!(texture, Texture::Graph(_));
            flags | BsdfFlags::reading([texture]) | BsdfFlags::READS_PLACE.when(is_graph)
        })
    }

    /// The perturbed shading normal of a hit seen from `wo`, and the slopes' shadowing, whose normal is still in render
    /// space.
    pub fn normal(&self, hit: &SurfaceHit, of: &Perturbed<'_>, wo: Vec3) -> (Vec3, BumpShadowing) {
        let ns = hit.ns;
        let [s, t] = across(ns, of.tangents[0]);
        let to_local = |v: Vec3| Vec3::new(v.dot(s), v.dot(t), v.dot(ns));
        let n = match self {
            Self::Layers(layers) => to_local(layers.iter().fold(ns, |below, (layer, strength)| {
                let [s, t] = across(below, of.tangents[0]);
                let n = layer.local_normal(below, [s, t], hit, of).normalize_or(Vec3::Z);
                let turned = s * n.x + t * n.y + below * n.z;
                (turned * *strength + below * (1.0 - strength)).normalize_or(below)
            })),
            one => one.local_normal(ns, [s, t], hit, of),
        };
        let n = n.normalize_or(Vec3::Z);
        let mut n = Vec3::new(n.x, n.y, n.z.max(MIN_COSINE));
        // A normal that faces away is flipped (Schüssler et al. 2017).
        let local_wo = to_local(wo);
        if local_wo.z * local_wo.dot(n) <= 0.0 {
            n = Vec3::new(-n.x, -n.y, n.z);
        }
        let shadowing = BumpShadowing {
            normal: ns,
            alpha2: bump_alpha2(n),
        };
        let turned = (s * n.x + t * n.y + ns * n.z).normalize_or(ns);
        match of.mirrors {
            true => (reflecting_upwards(turned, hit.ng, wo), shadowing),
            false => (turned, shadowing),
        }
    }

    /// Applies one map to a normal, given two directions across it.
    #[inline]
    fn local_normal(&self, ns: Vec3, [s, t]: [Vec3; 2], hit: &SurfaceHit, of: &Perturbed<'_>) -> Vec3 {
        match self {
            Self::BumpMap { height, scale } => {
                let [du, dv] = of.tangents;
                let slope = match height {
                    Texture::Graph(_) => slope_beside(height, hit, of),
                    _ => height.gradient(hit.at.uv),
                };
                let slope: Vec2 = slope * *scale;
                let du = du + ns * (slope.x - ns.dot(du));
                let dv = dv + ns * (slope.y - ns.dot(dv));
                let n = du.cross(dv);
                let n = if n.dot(hit.ng) < 0.0 { -n } else { n };
                Vec3::new(n.dot(s), n.dot(t), n.dot(ns))
            }
            Self::NormalMap(map) => {
                let n = map.eval(&hit.at) * 2.0 - 1.0;
                match of.along_v && t.dot(of.tangents[1]) < 0.0 {
                    true => Vec3::new(n.x, -n.y, n.z),
                    false => n,
                }
            }
            // Layers are not nested.
            Self::Layers(_) => Vec3::Z,
        }
    }
}

/// Directions across a normal, the first of them along dp/du.
#[inline]
fn across(ns: Vec3, du: Vec3) -> [Vec3; 2] {
    let s = (du - ns * ns.dot(du)).normalize_or(ns.any_orthonormal_vector());
    [s, ns.cross(s)]
}

/// Derivatives of a graph's luminance by u and v: differences over a step to either side, along the surface.
fn slope_beside(height: &Texture, hit: &SurfaceHit, of: &Perturbed<'_>) -> Vec2 {
    let by = |axis: usize, tangent: Vec3| {
        let length = tangent.length();
        let (Some(space), true) = (of.space, length > 0.0) else {
            return 0.0;
        };
        // In UV.
        let step = space.step / length;
        let at = |side: f32| {
            let mut uv = hit.at.uv;
            uv[axis] += side * step;
            let place = space.moved(&hit.at.place, tangent * (side * step));
            luminance(height.eval(&TexturePoint { uv, place, ..hit.at }))
        };
        (at(1.0) - at(-1.0)) / (2.0 * step)
    };
    let [du, dv] = of.tangents;
    let slope = Vec2::new(by(0, du), by(1, dv));
    if slope.is_finite() { slope } else { Vec2::ZERO }
}

/// A normal bent towards the surface's own `ng` until a mirror reflects `wo` to the side that it comes from; below the
/// surface there is no light, and it would look black. Cycles does this for all its surfaces, with another bound.
fn reflecting_upwards(n: Vec3, ng: Vec3, wo: Vec3) -> Vec3 {
    let up = ng * ng.dot(wo).signum();
    let least = (SHARE_REFLECTED * up.dot(wo)).min(LEAST_REFLECTED);
    let reflected = n * (2.0 * n.dot(wo)) - wo;
    let height = up.dot(reflected);
    if height >= least {
        return n;
    }
    let lifted = (reflected + up * (least - height)).normalize_or(up);
    // On the side of the shading normal.
    let half = (wo + lifted).normalize_or(up);
    half * half.dot(n).signum()
}

/// Square of the roughness of a surface whose slopes are like that of a normal `n`, relative to the unperturbed one
/// (Conty Estevez et al. 2019).
#[inline]
pub(super) fn bump_alpha2(n: Vec3) -> f32 {
    let tan2 = (n.x * n.x + n.y * n.y) / (n.z * n.z);
    (0.125 * tan2).min(1.0)
}

impl BumpShadowing {
    /// From the unperturbed normal, in the frame of the hit, and the square of the slopes' roughness.
    pub fn new(normal: Vec3, alpha2: f32) -> Self {
        Self { normal, alpha2 }
    }

    /// For a normal whose perturbations are left to the surface's lobes ([`super::Layered`]).
    #[inline]
    pub(in crate::world) fn of_lobes(normal: Vec3) -> Self {
        Self { normal, alpha2: 0.0 }
    }

    /// The same for a hit with this frame.
    #[inline]
    pub(in crate::world) fn seen_in(self, frame: &Frame) -> Self {
        let normal = frame.to_local(self.normal);
        Self { normal, ..self }
    }

    /// Factor on the light from `wi`, in the frame of the hit (Conty Estevez et al. 2019).
    #[inline]
    pub fn factor(&self, wi: Vec3) -> f32 {
        if self.alpha2 == 0.0 {
            return 1.0;
        }
        let cos = wi.dot(self.normal).abs().min(1.0);
        let cos2 = cos * cos;
        let extent = cos + (cos2 + self.alpha2 * (1.0 - cos2)).sqrt();
        if extent > 0.0 { 2.0 * cos / extent } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;

    #[test]
    fn mirrors_reflect_to_the_side_that_they_are_seen_from() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let mut bent = 0;
        for _ in 0..20_000 {
            let [ng, n, wo] = [(); 3].map(|()| warp::uniform_sphere(sampler.next_2d()));
            // As shading normals are: above the surface, and seen from the same side.
            let n = n * n.dot(ng).signum();
            if n.dot(wo) * ng.dot(wo) <= 0.0 {
                continue;
            }
            let of = |n: Vec3| n * (2.0 * n.dot(wo)) - wo;
            let made = reflecting_upwards(n, ng, wo);
            let side = ng.dot(wo).signum();
            let least = (0.9 * side * ng.dot(wo)).min(0.01);
            assert!(made.is_normalized() && made.dot(n) > 0.0 && made.dot(wo) * side > 0.0);
            // Normalising shortens the lifted component, by half at most.
            assert!(side * ng.dot(of(made)) > 0.5 * least - 1e-6, "{ng} {n} {wo}");
            match side * ng.dot(of(n)) >= least {
                true => assert_eq!(made, n),
                false => bent += 1,
            }
        }
        assert!(bent > 1000, "{bent}");
    }
}
