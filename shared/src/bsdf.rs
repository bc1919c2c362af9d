//! Surface scattering.

use crate::math::{Rgb, Vec2, Vec3};
use crate::texture::Texture;

/// What a surface is made of, as the scene says it.
#[derive(Clone, Debug)]
pub struct Material {
    /// The kind and its parameters.
    pub kind: MaterialKind,
    /// Reflects on both sides (diffuse, mirror and conductors; dielectrics and null have two sides by nature).
    pub two_sided: bool,
}

/// The kinds of surfaces. Inside is the side that the geometric normal points away from.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian.
    Diffuse {
        /// Albedo in [0, 1].
        reflectance: Texture,
    },
    /// Smooth dielectric boundary.
    Dielectric {
        /// Index of refraction inside over the one outside.
        eta: f32,
    },
    /// Smooth conductor (a perfect mirror where `k` is infinite is `Mirror`).
    Conductor {
        /// Real part of the index of refraction.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
        /// Factor on the reflection.
        reflectance: Texture,
    },
    /// Mirror without Fresnel.
    Mirror {
        /// Factor on the reflection.
        reflectance: Texture,
    },
    /// GGX microfacet conductor.
    RoughConductor {
        /// GGX roughness (not squared again), at least 1e-3.
        alpha: f32,
        /// Real part of the index of refraction.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
        /// Factor on the reflection.
        reflectance: Texture,
    },
    /// GGX microfacet dielectric boundary.
    RoughDielectric {
        /// GGX roughness (not squared again), at least 1e-3.
        alpha: f32,
        /// Index of refraction inside over the one outside.
        eta: f32,
    },
    /// Nothing: the boundary of a medium, index-matched.
    Null,
}

/// Which quantity a path carries. Radiance is compressed by refraction (divided by eta^2 of the step into the denser
/// side, times it on the way out); flux is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransportMode {
    /// Paths from the camera.
    Radiance,
    /// Photon paths from lights.
    Flux,
}

/// A material with its textures looked up at one hit: all that scattering needs.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf {
    /// Absorbs everything (the back of a one-sided surface, say).
    Black,
    /// Owned by bsdf.rs's author: extend.
    Null,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction that leaves the surface, local frame.
    pub wi: Vec3,
    /// f(wo, wi) |cos(wi)| / pdf, per channel.
    pub weight: Rgb,
    /// Density in solid angle; for a delta lobe, the probability of having chosen it.
    pub pdf: f32,
    /// The lobe is a delta: eval and pdf of this direction are zero.
    pub delta: bool,
    /// `wi` is on the other side of the surface than `wo`.
    pub transmitted: bool,
}

impl Material {
    /// The scattering at a hit. `outside`: the hit is seen from the side that the geometric normal points to.
    pub fn bsdf(&self, uv: Vec2) -> Bsdf {
        let _ = uv;
        unimplemented!()
    }
    /// True where no light is scattered except in discrete directions: camera paths go on through such a surface.
    pub fn is_specular(&self) -> bool {
        unimplemented!()
    }
}

impl Bsdf {
    /// BSDF value (1/sr, no cosine). `wo`, `wi`: unit, both leave the surface, local frame with z the shading normal.
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        let _ = (wo, wi, mode);
        unimplemented!()
    }
    /// Density in solid angle of `sample` choosing `wi`.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let _ = (wo, wi);
        unimplemented!()
    }
    /// Draw `wi`. `u_lobe` chooses a lobe, `u` a direction in it. None: absorbed.
    pub fn sample(
        &self,
        wo: Vec3,
        u_lobe: f32,
        u: Vec2,
        mode: TransportMode,
    ) -> Option<BsdfSample> {
        let _ = (wo, u_lobe, u, mode);
        unimplemented!()
    }
}
