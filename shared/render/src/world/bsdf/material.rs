//! Materials as scenes describe them.

use super::coat::{ClearCoat, CoatFacing};
use super::dispersion::Dispersion;
use super::energy::mean_of_conductor;
use super::flags::FOLLOWED_BELOW;
use super::microfacet::MIN_ALPHA;
use super::plastic::{Coat, RoughCoat};
use super::principled::{Extras, Interface};
use super::rough_dielectric::MIN_CONTRAST;
use super::{Anisotropy, Bsdf, BsdfFlags, Distribution, Fibre, NormalPerturbation, Subsurface, Tangent};
use crate::math::Rgb;
use crate::world::scalar::Scalar;
use crate::world::spectrum::Wave;
use crate::world::texture::Texture;
use std::ops::Deref;

/// Largest component of a complex index of refraction: above it a conductor is a mirror anyway, and squares stay
/// finite.
pub const MAX_INDEX: Rgb = Rgb::splat(1e6);

/// A surface's material and what follows from it. Dereferences to its description, which does not change.
#[derive(Clone, Debug)]
pub struct Material {
    description: MaterialDescription,
    flags: BsdfFlags,
    mean_fresnel: Option<Rgb>,
}

/// A surface's material, as the scene describes it.
#[derive(Clone, Debug)]
pub struct MaterialDescription {
    /// The kind and its parameters.
    pub kind: MaterialKind,
    /// Reflects on both sides. For materials that do not transmit; dielectrics and null are two-sided by nature.
    pub two_sided: bool,
    /// Share of rays that meet the surface; the others go on as if it were not there. `None`: all meet it.
    pub opacity: Option<Texture>,
    /// Bump or normal map.
    pub normal_perturbation: Option<NormalPerturbation>,
    /// For rough conductors, rough dielectrics and principled surfaces: light scatters among the microfacets until it
    /// leaves them, and the base beneath receives what they do not reflect. Otherwise light scatters once, and what
    /// would need more bounces is lost.
    pub multiple_scattering: bool,
    /// For dielectrics and principled surfaces that transmit light: the index by wavelength, if it varies. The kind
    /// holds the index at the d line.
    pub dispersion: Option<Box<Dispersion>>,
    /// Index of refraction outside, at the d line, which the relative index refers to.
    pub index_outside: f32,
    /// Lies on curves or similar shapes thinner than any kernel.
    pub thin: bool,
    /// For anisotropic rough conductors, rough dielectrics and principled surfaces.
    pub anisotropy: Option<Box<Anisotropy>>,
}

/// The kinds of surfaces. Inside is the side that the geometric normal points away from.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian.
    Diffuse {
        /// Albedo in [0, 1].
        reflectance: Texture,
    },
    /// Lambertian on both sides: leaves, paper, the skin of wax.
    Translucent {
        /// Reflected share, in [0, 1].
        reflectance: Texture,
        /// Transmitted share, in [0, 1]. Where the sum exceeds 1, both are scaled down.
        transmittance: Texture,
    },
    /// Diffuse and rough: Oren-Nayar.
    OrenNayar {
        /// Colour in [0, 1].
        reflectance: Texture,
        /// From 0, Lambertian, to 1.
        roughness: Scalar,
    },
    /// A layer of fine fibres.
    Sheen {
        /// Factor on the reflection, in [0, 1].
        reflectance: Texture,
        /// In [0, 1]: the rougher, the less grazing the angles at which it shows.
        roughness: Scalar,
    },
    /// Upright fibres, seen at grazing angles.
    Velvet {
        /// Factor on the reflection, in [0, 1].
        reflectance: Texture,
        /// How far they lean, in [0, 1].
        roughness: Scalar,
    },
    /// Smooth dielectric boundary.
    Dielectric {
        /// Index of refraction inside over the one outside.
        eta: f32,
        /// Factors on what is reflected and transmitted.
        tint: Tint,
    },
    /// Thin dielectric sheet: transmitted light keeps its direction.
    ThinDielectric {
        /// Index of refraction inside over the one outside.
        eta: f32,
        /// Factors on what is reflected and transmitted.
        tint: Tint,
    },
    /// Smooth conductor. A perfect mirror, with infinite `k`, is `Mirror`.
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
        /// Roughness (not squared again), at least 1e-3 (smaller values are raised to that).
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
        /// Roughness (not squared again), at least 1e-3 (smaller values are raised to that).
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
        /// Further lobes, if any.
        extras: Option<Box<Extras>>,
    },
    /// Hair, along the surface's u.
    Hair {
        /// What it absorbs.
        pigment: Pigment,
        /// Its shape.
        fibre: Fibre,
    },
    /// No surface: an index-matched boundary of a medium.
    Null,
    /// One of two materials, by chance: light meets the second with the weight as probability, the first otherwise.
    Blend {
        /// The first and the second.
        parts: Box<[Material; 2]>,
        /// Its luminance is the share of the second, in [0, 1].
        weight: Texture,
    },
}

/// What hair absorbs.
#[derive(Clone, Debug)]
pub enum Pigment {
    /// By absorption coefficients, per radius.
    Absorption(Texture),
    /// By its bulk colour, in [0, 1].
    Color(Texture),
}

impl Pigment {
    /// The texture behind it.
    pub fn texture(&self) -> &Texture {
        match self {
            Self::Absorption(texture) | Self::Color(texture) => texture,
        }
    }
}

/// Factors on the light that a dielectric reflects and transmits, each in [0, 1]; 1 is physical.
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

impl MaterialDescription {
    /// An opaque, unperturbed surface.
    pub fn new(kind: MaterialKind, two_sided: bool) -> Self {
        Self {
            kind,
            two_sided,
            opacity: None,
            normal_perturbation: None,
            multiple_scattering: false,
            dispersion: None,
            index_outside: 1.0,
            thin: false,
            anisotropy: None,
        }
    }

    /// The clear coat over it.
    fn coat(&self) -> Option<&ClearCoat> {
        match &self.kind {
            MaterialKind::Principled { extras, .. } => extras.as_ref()?.coat.as_ref(),
            _ => None,
        }
    }

    /// Whether the coat's normal differs from that of the layer below.
    fn faces_two_ways(&self) -> bool {
        self.coat().is_some_and(|coat| match coat.facing {
            CoatFacing::Below => false,
            CoatFacing::Shape => self.normal_perturbation.is_some(),
            CoatFacing::Own(_) => true,
        })
    }
}

impl MaterialKind {
    /// The flags of opaque, unperturbed surfaces of this kind.
    pub fn flags(&self) -> BsdfFlags {
        self.flags_of_mean(|alphas| alphas)
    }

    /// The same, given how the range of the microfacets' mean roughness follows from the kind's.
    fn flags_of_mean(&self, mean: impl Fn([f32; 2]) -> [f32; 2]) -> BsdfFlags {
        use BsdfFlags as F;
        match self {
            Self::Diffuse { reflectance } => F::WIDE | F::reading([reflectance]),
            Self::Translucent {
                reflectance,
                transmittance,
            } => F::WIDE | F::REFRACTS | F::BOUNDS_MEDIA | F::reading([reflectance, transmittance]),
            Self::OrenNayar { reflectance, roughness }
            | Self::Sheen { reflectance, roughness }
            | Self::Velvet { reflectance, roughness } => {
                F::WIDE | F::reading([reflectance]) | F::reading([roughness.texture()])
            }
            Self::Dielectric { tint, .. } => F::SMOOTH | F::REFRACTS | F::BENDS | F::BOUNDS_MEDIA | tint.flags(),
            Self::ThinDielectric { tint, .. } => F::SMOOTH | F::REFRACTS | tint.flags(),
            Self::Conductor { reflectance, .. } | Self::Mirror { reflectance } => F::SMOOTH | F::reading([reflectance]),
            Self::RoughConductor { alpha, reflectance, .. } => {
                F::of_lobe(mean(alpha.range())) | F::reading([alpha.texture()]) | F::reading([reflectance])
            }
            Self::RoughDielectric { alpha, eta, tint, .. } => {
                let lobe = match index_matched(*eta) {
                    true => F::SMOOTH,
                    false => F::of_lobe(mean(alpha.range())),
                };
                lobe | F::REFRACTS | F::BENDS | F::BOUNDS_MEDIA | F::reading([alpha.texture()]) | tint.flags()
            }
            Self::Plastic {
                reflectance,
                specular_reflectance,
                ..
            } => F::DELTA | F::WIDE | F::reading([reflectance, specular_reflectance]),
            Self::RoughPlastic {
                reflectance,
                specular_reflectance,
                coat,
            } => F::of_coat([coat.alpha(); 2]) | F::reading([reflectance, specular_reflectance]),
            Self::Principled {
                base_color,
                metallic,
                roughness,
                interface,
                extras,
            } => {
                let alphas = roughness
                    .range()
                    .map(|roughness| (roughness * roughness).max(MIN_ALPHA));
                let extras = extras.as_ref().map_or(F::empty(), |extras| extras.flags());
                let numbers = F::reading([metallic.texture(), roughness.texture()]) | interface.reads();
                F::of_coat(mean(alphas)) | extras | numbers | F::reading([base_color])
            }
            Self::Hair { pigment, .. } => F::WIDE | F::REFRACTS | F::ALONG_U | F::reading([pigment.texture()]),
            Self::Null => F::SMOOTH | F::PASSABLE | F::NULL | F::BOUNDS_MEDIA,
            Self::Blend { parts, weight } => parts[0].flags.blended(parts[1].flags) | F::reading([weight]),
        }
    }
}

impl Tint {
    fn flags(&self) -> BsdfFlags {
        BsdfFlags::reading([&self.reflectance, &self.transmittance])
    }
}

impl From<MaterialDescription> for Material {
    fn from(description: MaterialDescription) -> Self {
        use BsdfFlags as F;
        let mut flags = match &description.anisotropy {
            None => description.kind.flags(),
            Some(anisotropy) => {
                let of_kind = description.kind.flags_of_mean(|alphas| anisotropy.range(alphas));
                of_kind | anisotropy.flags()
            }
        };
        if let Some(opacity) = &description.opacity {
            flags -= F::BOUNDS_MEDIA;
            flags |= F::PASSABLE | F::reading([opacity]);
        }
        if let Some(map) = &description.normal_perturbation {
            flags |= map.reads();
        }
        flags |= F::FACES_TWO_WAYS.when(description.faces_two_ways());
        flags |= F::DISPERSES.when(description.dispersion.is_some());
        let mean_fresnel = match &description.kind {
            MaterialKind::RoughConductor { eta, k, .. } if description.multiple_scattering => {
                Some(mean_of_conductor(eta.min(MAX_INDEX), k.min(MAX_INDEX)))
            }
            _ => None,
        };
        if description.thin {
            flags = flags.thinned();
        }
        Self {
            description,
            flags,
            mean_fresnel,
        }
    }
}

impl From<Material> for MaterialDescription {
    fn from(material: Material) -> Self {
        material.description
    }
}

impl Deref for Material {
    type Target = MaterialDescription;

    #[inline(always)]
    fn deref(&self) -> &MaterialDescription {
        &self.description
    }
}

impl Material {
    /// An opaque, unperturbed surface.
    pub fn new(kind: MaterialKind, two_sided: bool) -> Self {
        MaterialDescription::new(kind, two_sided).into()
    }

    /// The same on something thinner than any kernel.
    pub fn thinned(&self) -> Self {
        let mut description = self.description.clone();
        description.thin = true;
        if let MaterialKind::Blend { parts, .. } = &mut description.kind {
            for part in &mut **parts {
                *part = part.thinned();
            }
        }
        description.into()
    }

    /// All its flags.
    #[inline]
    pub fn flags(&self) -> BsdfFlags {
        self.flags
    }
    /// Whether perturbed normals are bent until a mirror would reflect to the side that it is seen from.
    #[inline]
    pub fn reflects_upwards(&self) -> bool {
        self.has(BsdfFlags::DELTA | BsdfFlags::FOLLOWED | BsdfFlags::NARROW_LOBE) && !self.has(BsdfFlags::REFRACTS)
    }
    /// For a coat with a normal other than the layer below ([`BsdfFlags::FACES_TWO_WAYS`]): what turns each normal, and
    /// whether the part is a mirror, whose reflections all stay above the surface.
    pub(in crate::world) fn faces(&self) -> [(Option<&NormalPerturbation>, bool); 2] {
        let mirrors = |roughness: &Scalar| {
            let [least, _] = roughness.range();
            least * least < FOLLOWED_BELOW
        };
        let below = match &self.kind {
            MaterialKind::Principled { roughness, .. } => mirrors(roughness),
            _ => false,
        };
        let of_coat = self.coat().map_or((None, false), |coat| {
            let map = match &coat.facing {
                CoatFacing::Below => self.normal_perturbation.as_ref(),
                CoatFacing::Shape => None,
                CoatFacing::Own(map) => Some(map),
            };
            (map, mirrors(&coat.roughness))
        });
        [(self.normal_perturbation.as_ref(), below), of_coat]
    }
    /// Whether any of these flags holds.
    #[inline]
    pub fn has(&self, any: BsdfFlags) -> bool {
        self.flags.intersects(any)
    }
    /// The medium that light sinks into; for a blend, that of its first part that has one.
    pub fn subsurface(&self) -> Option<&Subsurface> {
        match &self.kind {
            MaterialKind::Principled { extras, .. } => extras.as_ref()?.subsurface.as_ref(),
            MaterialKind::Blend { parts, .. } => parts.iter().find_map(Self::subsurface),
            _ => None,
        }
    }
    /// Whether its microfacets, or those of a part, are anisotropic along the surface's u.
    pub fn lies_along_u(&self) -> bool {
        match &self.kind {
            MaterialKind::Blend { parts, .. } => parts.iter().any(Self::lies_along_u),
            _ => (self.anisotropy.as_ref()).is_some_and(|anisotropy| anisotropy.tangent == Tangent::U),
        }
    }
    /// The same surface without a medium beneath: light that would sink in scatters diffusely.
    pub fn without_subsurface(&self) -> Self {
        let mut description = MaterialDescription::from(self.clone());
        match &mut description.kind {
            MaterialKind::Principled { extras, .. } => {
                if let Some(given) = extras.as_mut().filter(|given| given.subsurface.is_some()) {
                    given.subsurface = None;
                    description.two_sided = true;
                    if !given.are_some() {
                        *extras = None;
                    }
                }
            }
            MaterialKind::Blend { parts, .. } => parts.iter_mut().for_each(|part| *part = part.without_subsurface()),
            _ => {}
        }
        description.into()
    }
    /// Only the boundary of a medium.
    #[inline]
    pub fn is_null(&self) -> bool {
        self.has(BsdfFlags::NULL)
    }
    /// Whether paths follow all scattering at this hit, as they follow mirrors.
    #[inline]
    pub fn follows(&self, bsdf: &Bsdf) -> bool {
        bsdf.has(BsdfFlags::FOLLOWED) || self.has(BsdfFlags::THIN)
    }
    /// True if light scatters only in discrete directions: camera paths continue through such a surface.
    #[inline]
    pub fn is_specular(&self) -> bool {
        self.has(BsdfFlags::SPECULAR)
    }
    /// Whether camera paths may leave it in another direction, before their first vertex.
    pub fn turns_paths(&self) -> bool {
        self.has(BsdfFlags::DELTA) && !self.is_null() || self.has(BsdfFlags::FOLLOWED | BsdfFlags::NARROW_LOBE)
    }
    /// For rough conductors with multiple scattering: reflectance for diffuse light.
    #[inline]
    pub fn mean_fresnel(&self) -> Option<Rgb> {
        self.mean_fresnel
    }
    /// Index inside over the one outside, for light with a wavelength, where that matters.
    #[inline]
    pub(super) fn eta_at(&self, wave: Option<Wave>) -> Option<f32> {
        let (dispersion, wave) = (self.dispersion.as_ref()?, wave?);
        Some(dispersion.eta(f64::from(wave.nm)))
    }
    /// Index of refraction on the side that a ray comes from over the one that it enters. 1 for anything that does not
    /// refract.
    pub fn eta_of_crossing(&self, from_inside: bool, wave: Option<Wave>) -> f32 {
        let of_line_d = || match &self.kind {
            MaterialKind::Dielectric { eta, .. } | MaterialKind::RoughDielectric { eta, .. } => *eta,
            MaterialKind::Principled { interface, .. } if self.has(BsdfFlags::BENDS) => interface.eta_of_glass(),
            MaterialKind::Diffuse { .. }
            | MaterialKind::Translucent { .. }
            | MaterialKind::OrenNayar { .. }
            | MaterialKind::Velvet { .. }
            | MaterialKind::Sheen { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::Mirror { .. }
            | MaterialKind::RoughConductor { .. }
            | MaterialKind::Plastic { .. }
            | MaterialKind::RoughPlastic { .. }
            | MaterialKind::Principled { .. }
            | MaterialKind::Hair { .. }
            | MaterialKind::Null
            | MaterialKind::Blend { .. } => 1.0,
        };
        let eta = self.eta_at(wave).unwrap_or_else(of_line_d);
        if from_inside { eta } else { 1.0 / eta }
    }
}

/// A rough boundary that does not scatter because its sides have nearly the same index.
#[inline]
pub(super) fn index_matched(eta: f32) -> bool {
    (eta - 1.0).abs() < MIN_CONTRAST
}
