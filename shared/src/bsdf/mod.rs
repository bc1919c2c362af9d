//! Surface scattering.
//!
//! Directions are in the local frame of the hit, z the shading normal; all leave the surface. Values are per steradian and
//! hold no cosine.

mod albedo;
mod fresnel;
mod ggx;
mod presets;
mod rough_dielectric;

pub use fresnel::{fresnel_conductor, fresnel_dielectric};
pub use presets::{conductor_names, conductor_preset};

use crate::math::{Rgb, Vec2, Vec3};
use crate::texture::Texture;
use crate::warp;
use ggx::Ggx;
use rough_dielectric::{MIN_CONTRAST, RoughDielectric, radiance_scale};

/// Roughness below this would cost single precision its digits.
const MIN_ALPHA: f32 = 1e-3;
/// Largest part of a complex index of refraction; from here on a conductor is a mirror, and squares stay finite.
const MAX_INDEX: Rgb = Rgb::splat(1e6);

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
        /// GGX roughness (not squared again), at least 1e-3 (less counts as that).
        alpha: f32,
        /// Real part of the index of refraction.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
        /// Factor on the reflection.
        reflectance: Texture,
    },
    /// GGX microfacet dielectric boundary. With indices within 1e-4 of each other it is `Null`.
    RoughDielectric {
        /// GGX roughness (not squared again), at least 1e-3 (less counts as that).
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

/// A material with its textures looked up at one hit: all that scattering needs. See [`MaterialKind`] for the parameters.
/// Where `two_sided` is false, the side that z points away from is black.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(
    missing_docs,
    reason = "the fields are those of MaterialKind, with textures looked up"
)]
pub enum Bsdf {
    /// Absorbs everything.
    Black,
    /// Lambertian.
    Diffuse { reflectance: Rgb, two_sided: bool },
    /// Smooth dielectric boundary.
    Dielectric { eta: f32 },
    /// Smooth conductor.
    Conductor {
        eta: Rgb,
        k: Rgb,
        reflectance: Rgb,
        two_sided: bool,
    },
    /// Mirror without Fresnel.
    Mirror { reflectance: Rgb, two_sided: bool },
    /// GGX microfacet conductor.
    RoughConductor {
        alpha: f32,
        eta: Rgb,
        k: Rgb,
        reflectance: Rgb,
        two_sided: bool,
    },
    /// GGX microfacet dielectric boundary, not index-matched.
    RoughDielectric { alpha: f32, eta: f32 },
    /// Lets everything through.
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
    /// The scattering at a hit with these texture coordinates.
    #[inline]
    pub fn bsdf(&self, uv: Vec2) -> Bsdf {
        let two_sided = self.two_sided;
        match &self.kind {
            MaterialKind::Diffuse { reflectance } => {
                let reflectance = reflectance.eval(uv);
                if reflectance == Rgb::ZERO {
                    return Bsdf::Black;
                }
                Bsdf::Diffuse {
                    reflectance,
                    two_sided,
                }
            }
            MaterialKind::Dielectric { eta } => Bsdf::Dielectric { eta: *eta },
            MaterialKind::Conductor {
                eta,
                k,
                reflectance,
            } => Bsdf::Conductor {
                eta: eta.min(MAX_INDEX),
                k: k.min(MAX_INDEX),
                reflectance: reflectance.eval(uv),
                two_sided,
            },
            MaterialKind::Mirror { reflectance } => Bsdf::Mirror {
                reflectance: reflectance.eval(uv),
                two_sided,
            },
            MaterialKind::RoughConductor {
                alpha,
                eta,
                k,
                reflectance,
            } => Bsdf::RoughConductor {
                alpha: alpha.max(MIN_ALPHA),
                eta: eta.min(MAX_INDEX),
                k: k.min(MAX_INDEX),
                reflectance: reflectance.eval(uv),
                two_sided,
            },
            MaterialKind::RoughDielectric { eta, .. } if index_matched(*eta) => Bsdf::Null,
            MaterialKind::RoughDielectric { alpha, eta } => Bsdf::RoughDielectric {
                alpha: alpha.max(MIN_ALPHA),
                eta: *eta,
            },
            MaterialKind::Null => Bsdf::Null,
        }
    }

    /// Nothing but the boundary of a medium.
    pub fn is_null(&self) -> bool {
        matches!(self.kind, MaterialKind::Null)
    }
    /// Index of refraction on the side that a ray comes from over the one that it goes to. 1 for anything but dielectrics.
    pub fn eta_of_crossing(&self, from_inside: bool) -> f32 {
        match self.kind {
            MaterialKind::Dielectric { eta } | MaterialKind::RoughDielectric { eta, .. } => {
                if from_inside {
                    eta
                } else {
                    1.0 / eta
                }
            }
            _ => 1.0,
        }
    }
    /// True where no light is scattered except in discrete directions: camera paths go on through such a surface.
    #[inline]
    pub fn is_specular(&self) -> bool {
        match self.kind {
            MaterialKind::Dielectric { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::Mirror { .. }
            | MaterialKind::Null => true,
            MaterialKind::RoughDielectric { eta, .. } => index_matched(eta),
            MaterialKind::Diffuse { .. } | MaterialKind::RoughConductor { .. } => false,
        }
    }
}

/// A rough boundary that does not scatter, for want of a difference between its sides.
#[inline]
fn index_matched(eta: f32) -> bool {
    (eta - 1.0).abs() < MIN_CONTRAST
}

impl Bsdf {
    /// Scatters nothing.
    pub fn is_black(&self) -> bool {
        matches!(self, Self::Black)
    }
    /// BSDF value (1/sr, no cosine), zero for delta lobes. `wo`, `wi`: unit, both leave the surface, local frame with z the
    /// shading normal; `wo` points to where the path comes from.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        match *self {
            Self::Diffuse {
                reflectance,
                two_sided,
            } => {
                if reflects(wo, wi, two_sided) {
                    reflectance * std::f32::consts::FRAC_1_PI
                } else {
                    Rgb::ZERO
                }
            }
            Self::RoughConductor {
                alpha,
                eta,
                k,
                reflectance,
                two_sided,
            } => {
                if !reflects(wo, wi, two_sided) {
                    return Rgb::ZERO;
                }
                // Walter et al. 2007, eq. 20: F D G / (4 cos cos), with the cosines of G and the denominator cancelled.
                let ggx = Ggx { alpha };
                let m = half_vector(wo, wi);
                let d = ggx.density(m) / (ggx.extent(wo) * ggx.extent(wi));
                reflectance * fresnel_conductor(wo.dot(m).abs(), eta, k) * d
            }
            Self::RoughDielectric { alpha, eta } => RoughDielectric {
                ggx: Ggx { alpha },
                eta,
            }
            .eval(wo, wi, mode),
            Self::Black
            | Self::Dielectric { .. }
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::Null => Rgb::ZERO,
        }
    }

    /// Density in solid angle of [`Bsdf::sample`] choosing `wi`, zero for delta lobes. It integrates to the probability that
    /// the path is not absorbed.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match *self {
            Self::Diffuse { two_sided, .. } => {
                if reflects(wo, wi, two_sided) {
                    warp::cosine_hemisphere_pdf(wi.z.abs())
                } else {
                    0.0
                }
            }
            Self::RoughConductor {
                alpha, two_sided, ..
            } => {
                if !reflects(wo, wi, two_sided) {
                    return 0.0;
                }
                let ggx = Ggx { alpha };
                ggx.density(half_vector(wo, wi)) / (2.0 * ggx.extent(wo))
            }
            Self::RoughDielectric { alpha, eta } => RoughDielectric {
                ggx: Ggx { alpha },
                eta,
            }
            .pdf(wo, wi),
            Self::Black
            | Self::Dielectric { .. }
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::Null => 0.0,
        }
    }

    /// Draw `wi`. `u_lobe` chooses a lobe, `u` a direction in it; both uniform in [0, 1). None: absorbed.
    #[inline]
    pub fn sample(
        &self,
        wo: Vec3,
        u_lobe: f32,
        u: Vec2,
        mode: TransportMode,
    ) -> Option<BsdfSample> {
        match *self {
            Self::Black => None,
            Self::Diffuse {
                reflectance,
                two_sided,
            } => {
                let sign = lit_side(wo, two_sided)?;
                let wi = warp::cosine_hemisphere(u);
                let pdf = warp::cosine_hemisphere_pdf(wi.z);
                (pdf > 0.0).then(|| BsdfSample {
                    wi: wi * sign,
                    weight: reflectance,
                    pdf,
                    delta: false,
                    transmitted: false,
                })
            }
            Self::Dielectric { eta } => Some(sample_dielectric(eta, wo, u_lobe, mode)),
            Self::Conductor {
                eta,
                k,
                reflectance,
                two_sided,
            } => {
                lit_side(wo, two_sided)?;
                let fresnel = fresnel_conductor(wo.z.abs(), eta, k);
                Some(mirrored(wo, reflectance * fresnel, 1.0))
            }
            Self::Mirror {
                reflectance,
                two_sided,
            } => {
                lit_side(wo, two_sided)?;
                Some(mirrored(wo, reflectance, 1.0))
            }
            Self::RoughConductor {
                alpha,
                eta,
                k,
                reflectance,
                two_sided,
            } => {
                let sign = lit_side(wo, two_sided)?;
                let wo = wo * sign;
                let ggx = Ggx { alpha };
                let m = ggx.sample_visible(wo, u);
                let cos_o = wo.dot(m);
                let wi = (m * (2.0 * cos_o) - wo).normalize();
                // Light that would need a second bounce among the facets is lost.
                (cos_o > 0.0 && wi.z > 0.0).then(|| BsdfSample {
                    wi: wi * sign,
                    weight: reflectance * fresnel_conductor(cos_o, eta, k) * ggx.g1(wi),
                    pdf: ggx.density(m) / (2.0 * ggx.extent(wo)),
                    delta: false,
                    transmitted: false,
                })
            }
            Self::RoughDielectric { alpha, eta } => RoughDielectric {
                ggx: Ggx { alpha },
                eta,
            }
            .sample(wo, u_lobe, u, mode),
            Self::Null => Some(BsdfSample {
                wi: -wo,
                weight: Rgb::ONE,
                pdf: 1.0,
                delta: true,
                transmitted: true,
            }),
        }
    }
}

/// Both directions are on the same side, and that side reflects.
#[inline]
fn reflects(wo: Vec3, wi: Vec3, two_sided: bool) -> bool {
    (wo.z > 0.0 && wi.z > 0.0) || (two_sided && wo.z < 0.0 && wi.z < 0.0)
}

/// The sign that turns `wo` to the front, if the surface reflects on its side. Turning a direction through the origin is as
/// good as mirroring it, as nothing here depends on the azimuth.
#[inline]
fn lit_side(wo: Vec3, two_sided: bool) -> Option<f32> {
    if wo.z > 0.0 {
        Some(1.0)
    } else if two_sided && wo.z < 0.0 {
        Some(-1.0)
    } else {
        None
    }
}

/// The normal of the microfacet that reflects one of two directions on the same side into the other, on the side of +z.
#[inline]
fn half_vector(wo: Vec3, wi: Vec3) -> Vec3 {
    (wo + wi).normalize_or(Vec3::Z)
}

#[inline]
fn mirrored(wo: Vec3, weight: Rgb, pdf: f32) -> BsdfSample {
    BsdfSample {
        wi: Vec3::new(-wo.x, -wo.y, wo.z),
        weight,
        pdf,
        delta: true,
        transmitted: false,
    }
}

#[inline]
fn sample_dielectric(eta: f32, wo: Vec3, u_lobe: f32, mode: TransportMode) -> BsdfSample {
    let eta = if wo.z > 0.0 { eta } else { 1.0 / eta };
    let (reflectance, cos_t) = fresnel_dielectric(wo.z.abs().min(1.0), eta);
    if u_lobe < reflectance {
        return mirrored(wo, Rgb::ONE, reflectance);
    }
    let z = if wo.z > 0.0 { -cos_t } else { cos_t };
    BsdfSample {
        wi: Vec3::new(-wo.x / eta, -wo.y / eta, z).normalize(),
        weight: Rgb::splat(radiance_scale(eta, mode)),
        pdf: 1.0 - reflectance,
        delta: true,
        transmitted: true,
    }
}

#[cfg(test)]
mod tests;
