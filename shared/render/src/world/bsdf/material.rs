//! Materials as the scene says them.

use super::dispersion::Dispersion;
use super::microfacet::MIN_ALPHA;
use super::plastic::{Coat, RoughCoat};
use super::principled::{Extras, Interface};
use super::rough_dielectric::MIN_CONTRAST;
use super::{Distribution, FOLLOWED_BELOW, GLOSS, NormalPerturbation};
use crate::math::Rgb;
use crate::world::scalar::Scalar;
use crate::world::spectrum::Wave;
use crate::world::texture::Texture;

/// Largest part of a complex index of refraction; from here on a conductor is a mirror, and squares stay finite.
pub(super) const MAX_INDEX: Rgb = Rgb::splat(1e6);

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
    /// Of dielectrics and principled surfaces that light goes through: their index by wavelength, where that is not the
    /// same for all. The kind has that of the line d.
    pub dispersion: Option<Box<Dispersion>>,
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
        alpha: Scalar,
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
        alpha: Scalar,
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
        metallic: Scalar,
        /// From 0 to 1; its square is the roughness of the microfacets.
        roughness: Scalar,
        /// What the interface reflects.
        interface: Interface,
        /// Other lobes, where there are some.
        extras: Option<Box<Extras>>,
    },
    /// Nothing: the boundary of a medium, index-matched.
    Null,
    /// One of two materials, by chance: light meets the second as often as the weight says, the first otherwise.
    Blend {
        /// Both of them.
        parts: Box<[Material; 2]>,
        /// Its luminance is the share of the second, in [0, 1].
        weight: Texture,
    },
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
    fn is_any(&self, of: fn(&Texture) -> bool) -> bool {
        of(&self.reflectance) || of(&self.transmittance)
    }

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
            dispersion: None,
        }
    }

    /// Whether rays may pass.
    pub fn may_be_passed(&self) -> bool {
        self.is_null() || self.opacity.is_some() || self.is_part(&Self::may_be_passed)
    }
    /// Whether it varies over a surface, by UV or by the colours of vertices.
    pub fn varies(&self) -> bool {
        self.has(|texture| !matches!(texture, Texture::Constant(_)))
    }
    /// Whether it varies with texture coordinates.
    pub fn reads_uv(&self) -> bool {
        self.has(Texture::reads_uv)
    }
    /// Whether a texture of a number, which UV place, is in it, or one of a colour that is so.
    fn has(&self, varies: fn(&Texture) -> bool) -> bool {
        let by_kind = match &self.kind {
            MaterialKind::Dielectric { tint, .. } | MaterialKind::ThinDielectric { tint, .. } => tint.is_any(varies),
            MaterialKind::RoughDielectric { tint, alpha, .. } => tint.is_any(varies) || alpha.varies(),
            MaterialKind::Diffuse { reflectance }
            | MaterialKind::Conductor { reflectance, .. }
            | MaterialKind::Mirror { reflectance } => varies(reflectance),
            MaterialKind::RoughConductor { reflectance, alpha, .. } => varies(reflectance) || alpha.varies(),
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
            MaterialKind::Principled {
                base_color,
                metallic,
                roughness,
                interface,
                extras,
            } => {
                varies(base_color)
                    || metallic.varies()
                    || roughness.varies()
                    || interface.varies()
                    || extras.as_ref().is_some_and(|extras| extras.vary())
            }
            MaterialKind::Null => false,
            MaterialKind::Blend { weight, .. } => varies(weight) || self.is_part(&|part| part.has(varies)),
        };
        by_kind || self.opacity.as_ref().is_some_and(varies) || self.normal_perturbation.is_some()
    }
    /// Whether it varies with the colours of vertices.
    pub fn reads_colors(&self) -> bool {
        let by_kind = match &self.kind {
            MaterialKind::Dielectric { tint, .. }
            | MaterialKind::ThinDielectric { tint, .. }
            | MaterialKind::RoughDielectric { tint, .. } => {
                tint.reflectance.reads_colors() || tint.transmittance.reads_colors()
            }
            MaterialKind::Diffuse { reflectance }
            | MaterialKind::Conductor { reflectance, .. }
            | MaterialKind::Mirror { reflectance }
            | MaterialKind::RoughConductor { reflectance, .. } => reflectance.reads_colors(),
            MaterialKind::Plastic {
                reflectance,
                specular_reflectance,
                ..
            }
            | MaterialKind::RoughPlastic {
                reflectance,
                specular_reflectance,
                ..
            } => reflectance.reads_colors() || specular_reflectance.reads_colors(),
            MaterialKind::Principled { base_color, .. } => base_color.reads_colors(),
            MaterialKind::Null => false,
            MaterialKind::Blend { weight, .. } => weight.reads_colors() || self.is_part(&Self::reads_colors),
        };
        by_kind || self.opacity.as_ref().is_some_and(Texture::reads_colors)
    }
    /// Whether light comes out on the other side, bent or not.
    pub fn transmits(&self) -> bool {
        self.refracts() || self.may_be_passed() || self.is_part(&Self::transmits)
    }

    /// Whether light may be reflected and refracted by it, or go through a pane.
    pub fn refracts(&self) -> bool {
        match &self.kind {
            MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::RoughDielectric { .. } => true,
            MaterialKind::Principled { extras, .. } => extras.as_ref().is_some_and(|extras| extras.transmits()),
            _ => self.is_part(&Self::refracts),
        }
    }

    /// Whether [`Bsdf::is_glossy`](super::Bsdf::is_glossy) may hold.
    pub fn is_glossy(&self) -> bool {
        let has_gloss = |[low, high]: [f32; 2]| low <= *GLOSS.end() && high >= *GLOSS.start();
        match &self.kind {
            MaterialKind::RoughDielectric { eta, .. } if index_matched(*eta) => false,
            MaterialKind::RoughConductor { alpha, .. } | MaterialKind::RoughDielectric { alpha, .. } => {
                has_gloss(alpha.range())
            }
            MaterialKind::RoughPlastic { coat, .. } => has_gloss([coat.alpha(); 2]),
            MaterialKind::Principled { roughness, extras, .. } => {
                has_gloss(principled_alphas(roughness)) || extras.as_ref().is_some_and(|extras| extras.is_coated())
            }
            _ => self.is_part(&Self::is_glossy),
        }
    }

    /// Nothing but the boundary of a medium.
    pub fn is_null(&self) -> bool {
        matches!(self.kind, MaterialKind::Null)
    }
    /// Has an inside and an outside, between which light passes: two media may meet at it. Not where light also passes
    /// beside it.
    pub fn bounds_media(&self) -> bool {
        self.opacity.is_none()
            && match &self.kind {
                MaterialKind::Dielectric { .. } | MaterialKind::RoughDielectric { .. } | MaterialKind::Null => true,
                MaterialKind::Principled { .. } => self.refracts(),
                // All parts that let light through do.
                MaterialKind::Blend { parts, .. } => {
                    let mut bounding = parts.iter().map(|part| part.bounds_media());
                    let mut others = parts.iter().filter(|part| !part.bounds_media());
                    bounding.any(|bounds| bounds) && !others.any(|part| part.transmits())
                }
                _ => false,
            }
    }
    /// Whether it bends light of each wavelength by another angle; of a blend, whether some part does.
    #[inline]
    pub fn disperses(&self) -> bool {
        self.dispersion.is_some() || self.is_part(&Self::disperses)
    }
    /// Index inside over the one outside of light that has a wavelength, where that matters.
    #[inline]
    pub(super) fn eta_at(&self, wave: Option<Wave>) -> Option<f32> {
        let (dispersion, wave) = (self.dispersion.as_ref()?, wave?);
        Some(dispersion.eta(f64::from(wave.nm)))
    }
    /// Index of refraction on the side that a ray comes from over the one that it goes to. 1 for anything that does not
    /// bend light.
    pub fn eta_of_crossing(&self, from_inside: bool, wave: Option<Wave>) -> f32 {
        let eta = match (self.eta_at(wave), &self.kind) {
            (Some(eta), _) => eta,
            (_, MaterialKind::Dielectric { eta, .. } | MaterialKind::RoughDielectric { eta, .. }) => *eta,
            (_, MaterialKind::Principled { interface, .. }) if self.refracts() => interface.eta_of_glass(),
            _ => return 1.0,
        };
        if from_inside { eta } else { 1.0 / eta }
    }
    /// True where some light is scattered in discrete directions.
    pub fn has_delta(&self) -> bool {
        self.is_specular() || matches!(self.kind, MaterialKind::Plastic { .. }) || self.is_part(&Self::has_delta)
    }
    /// True where no light is scattered except in discrete directions: camera paths go on through such a surface.
    #[inline]
    pub fn is_specular(&self) -> bool {
        match &self.kind {
            MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::Mirror { .. }
            | MaterialKind::Null => true,
            MaterialKind::RoughDielectric { eta, .. } => index_matched(*eta),
            MaterialKind::Blend { parts, .. } => parts.iter().all(Self::is_specular),
            MaterialKind::Diffuse { .. }
            | MaterialKind::RoughConductor { .. }
            | MaterialKind::Plastic { .. }
            | MaterialKind::RoughPlastic { .. }
            | MaterialKind::Principled { .. } => false,
        }
    }
    /// Whether paths follow what it scatters, see [`Bsdf::is_followed`](super::Bsdf::is_followed), somewhere; of a
    /// blend, what some part does.
    #[inline]
    pub fn is_followed(&self) -> bool {
        match &self.kind {
            MaterialKind::RoughConductor { alpha, .. } => alpha.range()[0] < FOLLOWED_BELOW,
            MaterialKind::RoughDielectric { alpha, eta, .. } => {
                alpha.range()[0] < FOLLOWED_BELOW && !index_matched(*eta)
            }
            _ => self.is_part(&Self::is_followed),
        }
    }
    /// Whether it scatters light that paths do not follow, somewhere; of a blend, what some part does.
    pub fn is_wide(&self) -> bool {
        match &self.kind {
            MaterialKind::RoughConductor { alpha, .. } => alpha.range()[1] >= FOLLOWED_BELOW,
            MaterialKind::RoughDielectric { alpha, eta, .. } => {
                alpha.range()[1] >= FOLLOWED_BELOW && !index_matched(*eta)
            }
            MaterialKind::Blend { parts, .. } => parts.iter().any(Self::is_wide),
            _ => !self.is_specular(),
        }
    }
    /// Whether it has a lobe that is followed beside a wide one, see
    /// [`Bsdf::narrow_and_wide`](super::Bsdf::narrow_and_wide), somewhere.
    pub fn has_narrow_lobe(&self) -> bool {
        match &self.kind {
            MaterialKind::RoughPlastic { coat, .. } => coat.alpha() < FOLLOWED_BELOW,
            MaterialKind::Principled { roughness, extras, .. } => {
                principled_alphas(roughness)[0] < FOLLOWED_BELOW
                    || extras.as_ref().is_some_and(|extras| extras.is_coated())
            }
            _ => self.is_part(&Self::has_narrow_lobe),
        }
    }
    /// Whether camera paths may go on from it in another direction, before their first vertex.
    pub fn turns_paths(&self) -> bool {
        self.has_delta() && !self.is_null() || self.is_followed() || self.has_narrow_lobe()
    }
}

/// Least and largest roughness of the microfacets of a principled surface.
fn principled_alphas(roughness: &Scalar) -> [f32; 2] {
    roughness
        .range()
        .map(|roughness| (roughness * roughness).max(MIN_ALPHA))
}

/// A rough boundary that does not scatter, for want of a difference between its sides.
#[inline]
pub(super) fn index_matched(eta: f32) -> bool {
    (eta - 1.0).abs() < MIN_CONTRAST
}
