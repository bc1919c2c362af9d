//! Materials as the scene says them.

use super::dielectric::Dielectric;
use super::microfacet::MIN_ALPHA;
use super::plastic::{Coat, Plastic, RoughCoat, RoughPlastic};
use super::principled::Principled;
use super::rough_dielectric::{MIN_CONTRAST, RoughDielectric};
use super::{Bsdf, Distribution, FOLLOWED_BELOW, NormalPerturbation};
use crate::math::{Rgb, Vec2, Vec3, luminance};
use crate::texture::Texture;

/// Largest part of a complex index of refraction; from here on a conductor is a mirror, and squares stay finite.
const MAX_INDEX: Rgb = Rgb::splat(1e6);

/// What a surface is made of, as the scene says it.
#[derive(Clone, Debug)]
pub struct Material {
    /// The kind and its parameters.
    pub kind: MaterialKind,
    /// Reflects on both sides (all that do not transmit; dielectrics and null have two sides by nature).
    pub two_sided: bool,
    /// Share of rays that the surface meets; the others go on as if it were not there. `None`: all of them.
    pub opacity: Option<Texture>,
    /// Bump or normal map.
    pub normal_perturbation: Option<NormalPerturbation>,
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
        /// Factors on what is reflected and transmitted.
        tint: Tint,
    },
    /// Thin sheet of a dielectric: light that it transmits keeps its direction.
    ThinDielectric {
        /// Index of refraction inside over the one outside.
        eta: f32,
        /// Factors on what is reflected and transmitted.
        tint: Tint,
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
    /// Microfacet conductor.
    RoughConductor {
        /// Distribution of its microfacets.
        distribution: Distribution,
        /// Roughness (not squared again), at least 1e-3 (less counts as that).
        alpha: f32,
        /// Real part of the index of refraction.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
        /// Factor on the reflection.
        reflectance: Texture,
    },
    /// Microfacet dielectric boundary. With indices within 1e-4 of each other it is `Null`.
    RoughDielectric {
        /// Distribution of its microfacets.
        distribution: Distribution,
        /// Roughness (not squared again), at least 1e-3 (less counts as that).
        alpha: f32,
        /// Index of refraction inside over the one outside.
        eta: f32,
        /// Factors on what is reflected and transmitted.
        tint: Tint,
    },
    /// Smooth dielectric coat over a diffuse base.
    Plastic {
        /// Albedo of the base in [0, 1].
        reflectance: Texture,
        /// Factor on the coat's reflection.
        specular_reflectance: Texture,
        /// The coat.
        coat: Coat,
    },
    /// Rough dielectric coat over a diffuse base.
    RoughPlastic {
        /// Albedo of the base in [0, 1].
        reflectance: Texture,
        /// Factor on the coat's reflection.
        specular_reflectance: Texture,
        /// The coat.
        coat: Box<RoughCoat>,
    },
    /// Burley's model of dielectrics and metals.
    Principled {
        /// Albedo of the base, and of metals at normal incidence, in [0, 1].
        base_color: Texture,
        /// From dielectric 0 to metal 1.
        metallic: f32,
        /// From 0 to 1; its square is the roughness of the microfacets.
        roughness: f32,
        /// Index of refraction inside over the one outside.
        eta: f32,
    },
    /// Nothing: the boundary of a medium, index-matched.
    Null,
}

/// Factors on the light that a dielectric reflects and transmits, each in [0, 1]; 1 where nature is to be followed.
#[derive(Clone, Debug)]
pub struct Tint {
    /// On the reflection.
    pub reflectance: Texture,
    /// On the transmission.
    pub transmittance: Texture,
}

impl Tint {
    /// Changes nothing.
    pub const NONE: Self = Self {
        reflectance: Texture::Constant(Rgb::ONE),
        transmittance: Texture::Constant(Rgb::ONE),
    };
}

impl Material {
    /// A whole and even surface.
    pub fn new(kind: MaterialKind, two_sided: bool) -> Self {
        Self {
            kind,
            two_sided,
            opacity: None,
            normal_perturbation: None,
        }
    }

    /// Whether a ray goes on as if nothing were there: at boundaries of media, and by chance where the surface is not
    /// opaque. `draw`: a uniform number.
    #[inline]
    pub fn is_passed(&self, uv: Vec2, draw: impl FnOnce() -> f32) -> bool {
        match &self.opacity {
            None => self.is_null(),
            Some(opacity) => draw() >= opacity_at(opacity, uv),
        }
    }
    /// The share of light that goes straight through, on average over [`Self::is_passed`].
    #[inline]
    pub fn transparency(&self, uv: Vec2) -> f32 {
        match &self.opacity {
            None => f32::from(self.is_null()),
            Some(opacity) => 1.0 - opacity_at(opacity, uv),
        }
    }
    /// Whether rays may pass.
    pub fn may_be_passed(&self) -> bool {
        self.is_null() || self.opacity.is_some()
    }
    /// Whether it varies with texture coordinates.
    pub fn reads_uv(&self) -> bool {
        let varies = |texture: &Texture| !matches!(texture, Texture::Constant(_));
        let by_kind = match &self.kind {
            MaterialKind::Dielectric { tint, .. }
            | MaterialKind::ThinDielectric { tint, .. }
            | MaterialKind::RoughDielectric { tint, .. } => varies(&tint.reflectance) || varies(&tint.transmittance),
            MaterialKind::Diffuse { reflectance }
            | MaterialKind::Conductor { reflectance, .. }
            | MaterialKind::Mirror { reflectance }
            | MaterialKind::RoughConductor { reflectance, .. } => varies(reflectance),
            MaterialKind::Plastic {
                reflectance,
                specular_reflectance,
                ..
            }
            | MaterialKind::RoughPlastic {
                reflectance,
                specular_reflectance,
                ..
            } => varies(reflectance) || varies(specular_reflectance),
            MaterialKind::Principled { base_color, .. } => varies(base_color),
            MaterialKind::Null => false,
        };
        by_kind || self.opacity.as_ref().is_some_and(varies) || self.normal_perturbation.is_some()
    }
    /// Whether light comes out on the other side, bent or not.
    pub fn transmits(&self) -> bool {
        let is_glass = matches!(
            self.kind,
            MaterialKind::Dielectric { .. }
                | MaterialKind::ThinDielectric { .. }
                | MaterialKind::RoughDielectric { .. }
        );
        is_glass || self.may_be_passed()
    }

    /// The scattering at a hit with these texture coordinates.
    #[inline]
    pub fn bsdf(&self, uv: Vec2) -> Bsdf<'_> {
        let two_sided = self.two_sided;
        match &self.kind {
            MaterialKind::Diffuse { reflectance } => {
                let reflectance = reflectance.eval(uv);
                if reflectance == Rgb::ZERO {
                    return Bsdf::Black;
                }
                Bsdf::Diffuse { reflectance, two_sided }
            }
            MaterialKind::Dielectric { eta, tint } => Bsdf::Dielectric(Dielectric {
                eta: *eta,
                reflectance: tint.reflectance.eval(uv),
                transmittance: tint.transmittance.eval(uv),
            }),
            MaterialKind::ThinDielectric { eta, tint } => Bsdf::ThinDielectric(Dielectric {
                eta: *eta,
                reflectance: tint.reflectance.eval(uv),
                transmittance: tint.transmittance.eval(uv),
            }),
            MaterialKind::Conductor { eta, k, reflectance } => Bsdf::Conductor {
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
                distribution,
                alpha,
                eta,
                k,
                reflectance,
            } => Bsdf::RoughConductor {
                distribution: *distribution,
                alpha: alpha.max(MIN_ALPHA),
                eta: eta.min(MAX_INDEX),
                k: k.min(MAX_INDEX),
                reflectance: reflectance.eval(uv),
                two_sided,
            },
            MaterialKind::RoughDielectric { eta, .. } if index_matched(*eta) => Bsdf::Null,
            MaterialKind::RoughDielectric {
                distribution,
                alpha,
                eta,
                tint,
            } => Bsdf::RoughDielectric(RoughDielectric {
                distribution: *distribution,
                alpha: alpha.max(MIN_ALPHA),
                eta: *eta,
                reflectance: tint.reflectance.eval(uv),
                transmittance: tint.transmittance.eval(uv),
            }),
            MaterialKind::Plastic {
                reflectance,
                specular_reflectance,
                coat,
            } => Bsdf::Plastic(Plastic::new(
                coat,
                reflectance.eval(uv),
                specular_reflectance.eval(uv),
                two_sided,
            )),
            MaterialKind::RoughPlastic {
                reflectance,
                specular_reflectance,
                coat,
            } => Bsdf::RoughPlastic(RoughPlastic::new(
                coat,
                reflectance.eval(uv),
                specular_reflectance.eval(uv),
                two_sided,
            )),
            MaterialKind::Principled {
                base_color,
                metallic,
                roughness,
                eta,
            } => Bsdf::Principled(Principled {
                base_color: base_color.eval(uv),
                metallic: *metallic,
                roughness: *roughness,
                eta: *eta,
                two_sided,
                lobes: [1.0; 2],
            }),
            MaterialKind::Null => Bsdf::Null,
        }
    }

    /// Whether [`Bsdf::is_glossy`] holds.
    pub fn is_glossy(&self) -> bool {
        self.bsdf(Vec2::ZERO).is_glossy()
    }

    /// Nothing but the boundary of a medium.
    pub fn is_null(&self) -> bool {
        matches!(self.kind, MaterialKind::Null)
    }
    /// Has an inside and an outside, between which light passes: two media may meet at it. Not where light also passes
    /// beside it.
    pub fn bounds_media(&self) -> bool {
        self.opacity.is_none()
            && matches!(
                self.kind,
                MaterialKind::Dielectric { .. } | MaterialKind::RoughDielectric { .. } | MaterialKind::Null
            )
    }
    /// Index of refraction on the side that a ray comes from over the one that it goes to. 1 for anything but
    /// dielectrics.
    pub fn eta_of_crossing(&self, from_inside: bool) -> f32 {
        match self.kind {
            MaterialKind::Dielectric { eta, .. } | MaterialKind::RoughDielectric { eta, .. } => {
                if from_inside {
                    eta
                } else {
                    1.0 / eta
                }
            }
            _ => 1.0,
        }
    }
    /// True where some light is scattered in discrete directions.
    pub fn has_delta(&self) -> bool {
        self.is_specular() || matches!(self.kind, MaterialKind::Plastic { .. })
    }
    /// True where no light is scattered except in discrete directions: camera paths go on through such a surface.
    #[inline]
    pub fn is_specular(&self) -> bool {
        match self.kind {
            MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::Mirror { .. }
            | MaterialKind::Null => true,
            MaterialKind::RoughDielectric { eta, .. } => index_matched(eta),
            MaterialKind::Diffuse { .. }
            | MaterialKind::RoughConductor { .. }
            | MaterialKind::Plastic { .. }
            | MaterialKind::RoughPlastic { .. }
            | MaterialKind::Principled { .. } => false,
        }
    }
    /// Whether paths follow what it scatters, see [`Bsdf::is_followed`].
    #[inline]
    pub fn is_followed(&self) -> bool {
        match self.kind {
            MaterialKind::RoughConductor { alpha, .. } => alpha < FOLLOWED_BELOW,
            MaterialKind::RoughDielectric { alpha, eta, .. } => alpha < FOLLOWED_BELOW && !index_matched(eta),
            _ => false,
        }
    }
    /// Whether it has a lobe that is followed beside a wide one, see [`Bsdf::narrow_and_wide`].
    pub fn has_narrow_lobe(&self) -> bool {
        self.bsdf(Vec2::ZERO).narrow_and_wide(Vec3::Z).is_some()
    }
    /// Whether camera paths may go on from it in another direction, before their first vertex.
    pub fn turns_paths(&self) -> bool {
        self.has_delta() && !self.is_null() || self.is_followed() || self.has_narrow_lobe()
    }
}

/// Luminance, exact for greys, so that what is opaque lets nothing through.
#[inline]
fn opacity_at(texture: &Texture, uv: Vec2) -> f32 {
    let c = texture.eval(uv);
    (c.x + luminance(c - c.x)).clamp(0.0, 1.0)
}

/// A rough boundary that does not scatter, for want of a difference between its sides.
#[inline]
fn index_matched(eta: f32) -> bool {
    (eta - 1.0).abs() < MIN_CONTRAST
}
