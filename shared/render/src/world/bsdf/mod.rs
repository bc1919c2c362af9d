//! Surface scattering.
//!
//! Directions are in the local frame of the hit, with z the shading normal, and leave the surface. Values are per
//! steradian and exclude the cosine.

mod against;
mod albedo;
mod anisotropy;
mod beckmann;
mod blend;
mod bumped;
mod coat;
mod conductor;
mod dielectric;
mod dispersion;
mod energy;
mod film;
mod flags;
mod ggx;
mod hair;
mod layered;
mod lookup;
mod material;
mod microfacet;
mod microfibers;
mod oren_nayar;
mod perturbation;
mod plastic;
mod presets;
mod principled;
mod rough_dielectric;
mod subsurface;
mod translucent;
mod velvet;

pub use crate::world::fresnel::{fresnel_conductor, fresnel_dielectric};
pub use anisotropy::{Anisotropy, Stretch, Tangent};
pub use blend::share_of_rays;
pub use coat::{ClearCoat, CoatFacing};
pub use conductor::RoughConductor;
pub use dielectric::Dielectric;
pub use dispersion::{Dispersion, Index, LINE_D, index_names};
pub use energy::{glass_numbers, layer_numbers, loss_numbers};
pub use film::ThinFilm;
pub use flags::BsdfFlags;
pub use hair::{Fibre, Hair};
pub use layered::Layered;
pub use material::{MAX_INDEX, Material, MaterialDescription, MaterialKind, Pigment, Tint};
pub use microfacet::Distribution;
pub use microfibers::{Fuzz, Microfibers, Sheen};
pub use oren_nayar::OrenNayar;
pub use perturbation::{BumpShadowing, NormalPerturbation, Perturbed};
pub use plastic::{Coat, Plastic, RoughCoat, RoughPlastic};
pub use presets::{conductor_names, conductor_preset};
pub use principled::{Extras, Interface, Principled};
pub use rough_dielectric::RoughDielectric;
pub use subsurface::Subsurface;
pub use translucent::Translucent;
pub use velvet::Velvet;

use crate::math::{Rgb, Vec2, Vec3};
use crate::warp;
use dielectric::one_of;

/// Which quantity a path carries. Radiance is compressed by refraction (divided by eta^2 of the step into the denser
/// side, times it on the way out); flux is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransportMode {
    /// Paths from the camera.
    Radiance,
    /// Photon paths from lights.
    Flux,
}

impl TransportMode {
    /// The one of the two directions, where a path comes from and where it goes on, that leads to the camera.
    #[inline]
    fn towards_camera(self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Self::Radiance => wo,
            Self::Flux => wi,
        }
    }

    /// The other one, that leads to the light.
    #[inline]
    fn towards_light(self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.towards_camera(wi, wo)
    }
}

/// A material with its textures looked up at one hit: all that scattering needs. See [`MaterialKind`] for the
/// parameters. Where `two_sided` is false, the side that z points away from is black.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(
    missing_docs,
    reason = "the fields are those of MaterialKind, with textures looked up"
)]
pub enum Bsdf<'a> {
    /// Absorbs everything.
    Black,
    /// Lambertian.
    Diffuse { reflectance: Rgb, two_sided: bool },
    /// Lambertian on both sides.
    Translucent(Translucent),
    /// Diffuse and rough.
    OrenNayar(OrenNayar),
    /// Upright fibres.
    Velvet(Velvet),
    /// A layer of fine fibres.
    Sheen(Sheen),
    /// Smooth dielectric boundary.
    Dielectric(Dielectric),
    /// Thin sheet of a dielectric.
    ThinDielectric(Dielectric),
    /// Smooth conductor.
    Conductor {
        eta: Rgb,
        k: Rgb,
        reflectance: Rgb,
        two_sided: bool,
    },
    /// Mirror without Fresnel.
    Mirror { reflectance: Rgb, two_sided: bool },
    /// Microfacet conductor.
    RoughConductor(RoughConductor),
    /// Microfacet dielectric boundary, not index-matched.
    RoughDielectric(RoughDielectric),
    /// Smooth coat over a diffuse base.
    Plastic(Plastic),
    /// Rough coat over a diffuse base.
    RoughPlastic(RoughPlastic<'a>),
    /// Burley's model with one reflection and a diffuse base.
    Principled(Principled),
    /// Burley's model with all lobes.
    Layered(Layered),
    /// A fibre, along x of the frame.
    Hair(Hair),
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
    /// `wi` is on the other side of the surface from `wo`.
    pub transmitted: bool,
}

impl BsdfSample {
    /// A direction in a lobe that is no delta, given its density and the value there. None: it is never drawn.
    #[inline]
    fn in_lobe(wo: Vec3, wi: Vec3, pdf: f32, value: impl FnOnce() -> Rgb) -> Option<Self> {
        (pdf > 0.0).then(|| Self {
            wi,
            weight: value() * (wi.z.abs() / pdf),
            pdf,
            delta: false,
            transmitted: wo.z * wi.z < 0.0,
        })
    }
}

impl Bsdf<'_> {
    /// The surface's flags.
    #[inline(always)]
    pub fn flags(&self) -> BsdfFlags {
        use BsdfFlags as F;
        match self {
            Self::Black => F::empty(),
            Self::Diffuse { .. } | Self::OrenNayar(_) | Self::Velvet(_) | Self::Sheen(_) => F::WIDE,
            Self::Translucent(_) => F::WIDE | F::REFRACTS,
            Self::Dielectric(_) | Self::ThinDielectric(_) => F::SMOOTH | F::REFRACTS,
            Self::Conductor { .. } | Self::Mirror { .. } => F::SMOOTH,
            Self::RoughConductor(b) => F::of_lobe([b.alpha; 2]),
            Self::RoughDielectric(b) => F::of_lobe([b.alpha; 2]) | F::REFRACTS,
            Self::Plastic(_) => F::DELTA | F::WIDE,
            Self::RoughPlastic(b) => F::of_coat([b.alpha(); 2]),
            Self::Principled(b) => F::of_coat([b.alpha(); 2]),
            Self::Layered(b) => b.flags(),
            Self::Hair(_) => F::WIDE | F::REFRACTS | F::ALONG_U,
            Self::Null => F::SMOOTH | F::PASSABLE,
        }
    }
    /// Whether any of these flags holds.
    #[inline(always)]
    pub fn has(&self, any: BsdfFlags) -> bool {
        self.flags().intersects(any)
    }
    /// The same with a coat whose normal differs from the layer below: both normals in the frame of the hit, that of
    /// the layer below first.
    pub fn facing(self, normals: [Vec3; 2]) -> Self {
        match self {
            Self::Layered(b) => Self::Layered(b.facing(normals)),
            other => other,
        }
    }
    /// Probability of sampling a delta lobe where there are other lobes as well; 0 if all or none are deltas.
    #[inline]
    pub fn delta_probability(&self, wo: Vec3) -> f32 {
        match self {
            Self::Plastic(b) => b.mirror_probability(wo),
            Self::Black
            | Self::Diffuse { .. }
            | Self::Translucent(_)
            | Self::OrenNayar(_)
            | Self::Velvet(_)
            | Self::Sheen(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::RoughPlastic(_)
            | Self::Principled(_)
            | Self::Layered(_)
            | Self::Hair(_)
            | Self::Null => 0.0,
        }
    }
    /// The same without its delta lobe, where it has other lobes too.
    #[inline]
    pub fn without_delta(self) -> Self {
        match self {
            Self::Plastic(b) => Self::Plastic(b.without_mirror()),
            other => other,
        }
    }
    /// A rough specular lobe and the diffuse one beneath it, separately; their sum is the whole. None: no such pair.
    pub fn gloss_and_base(self) -> Option<[Self; 2]> {
        match self {
            Self::RoughPlastic(b) => Some(b.lobes().map(Self::RoughPlastic)),
            Self::Principled(b) => Some(b.lobes().map(Self::Principled)),
            Self::Layered(b) => match b.gloss_and_base() {
                Some(lobes) => Some(lobes.map(Self::Layered)),
                None => Some([Self::Black, self]),
            },
            Self::Black
            | Self::Diffuse { .. }
            | Self::Translucent(_)
            | Self::OrenNayar(_)
            | Self::Velvet(_)
            | Self::Sheen(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::Plastic(_)
            | Self::Hair(_)
            | Self::Null => None,
        }
    }
    /// A lobe that paths follow and a wide one: the probability of sampling the first, and both separately; their sum
    /// is the whole.
    #[inline]
    pub fn narrow_and_wide(&self, wo: Vec3) -> Option<(f32, [Self; 2])> {
        if !self.has(BsdfFlags::NARROW_LOBE) {
            return None;
        }
        match self {
            Self::RoughPlastic(b) => Some((b.specular_probability(wo), b.lobes().map(Self::RoughPlastic))),
            Self::Principled(b) => Some((b.specular_probability(wo), b.narrow_and_wide().map(Self::Principled))),
            Self::Layered(b) => b.narrow_and_wide(wo).map(|(p, lobes)| (p, lobes.map(Self::Layered))),
            Self::Black
            | Self::Diffuse { .. }
            | Self::Translucent(_)
            | Self::OrenNayar(_)
            | Self::Velvet(_)
            | Self::Sheen(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::Plastic(_)
            | Self::Hair(_)
            | Self::Null => None,
        }
    }
    /// The two ways that light takes at a smooth dielectric: samples whose `pdf` is the probability of each. None: not
    /// a smooth dielectric.
    #[inline]
    pub fn branches(&self, wo: Vec3, mode: TransportMode) -> Option<[BsdfSample; 2]> {
        match self {
            Self::Dielectric(b) => Some(b.boundary(wo, mode)),
            Self::ThinDielectric(b) => Some(b.sheet(wo)),
            Self::Black
            | Self::Diffuse { .. }
            | Self::Translucent(_)
            | Self::OrenNayar(_)
            | Self::Velvet(_)
            | Self::Sheen(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::Plastic(_)
            | Self::RoughPlastic(_)
            | Self::Principled(_)
            | Self::Layered(_)
            | Self::Hair(_)
            | Self::Null => None,
        }
    }
    /// Is black or diffuse, possibly under a smooth coat.
    #[inline]
    pub fn is_matt(&self) -> bool {
        !self.has(BsdfFlags::SPECULAR | BsdfFlags::ROUGH)
    }
    /// Scatters nothing.
    pub fn is_black(&self) -> bool {
        matches!(self, Self::Black)
    }
    /// BSDF value (1/sr, no cosine), zero for delta lobes. `wo`, `wi`: unit, both leave the surface, local frame with z
    /// the shading normal; `wo` points to where the path comes from.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        match *self {
            Self::Diffuse { reflectance, two_sided } => {
                if reflects(wo, wi, two_sided) {
                    reflectance * std::f32::consts::FRAC_1_PI
                } else {
                    Rgb::ZERO
                }
            }
            Self::RoughConductor(b) => b.eval(wo, wi),
            Self::Translucent(b) => b.eval(wo, wi),
            Self::OrenNayar(b) => b.eval(wo, wi),
            Self::Velvet(b) => b.eval(wo, wi),
            Self::Sheen(b) => b.eval(wo, wi, mode),
            Self::RoughDielectric(b) => b.eval(wo, wi, mode),
            Self::Plastic(b) => b.eval(wo, wi),
            Self::RoughPlastic(b) => b.eval(wo, wi),
            Self::Principled(b) => b.eval(wo, wi),
            Self::Layered(b) => b.eval(wo, wi, mode),
            Self::Hair(b) => b.eval(wo, wi, mode),
            Self::Black
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::Null => Rgb::ZERO,
        }
    }

    /// Density in solid angle of [`Bsdf::sample`] choosing `wi`, zero for delta lobes. It integrates to the probability
    /// that the path is not absorbed.
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
            Self::RoughConductor(b) => b.pdf(wo, wi),
            Self::Translucent(b) => b.pdf(wo, wi),
            Self::OrenNayar(b) => b.pdf(wo, wi),
            Self::Velvet(b) => b.pdf(wo, wi),
            Self::Sheen(b) => b.pdf(wo, wi),
            Self::RoughDielectric(b) => b.pdf(wo, wi),
            Self::Plastic(b) => b.pdf(wo, wi),
            Self::RoughPlastic(b) => b.pdf(wo, wi),
            Self::Principled(b) => b.pdf(wo, wi),
            Self::Layered(b) => b.pdf(wo, wi),
            Self::Hair(b) => b.pdf(wo, wi),
            Self::Black
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::Null => 0.0,
        }
    }

    /// Whether [`Self::sample`] uses `u_lobe`, and whether it uses `u`.
    #[inline]
    pub fn draws(&self) -> [bool; 2] {
        match self {
            Self::Black | Self::Conductor { .. } | Self::Mirror { .. } | Self::Null => [false, false],
            Self::Diffuse { .. } | Self::OrenNayar(_) | Self::Velvet(_) | Self::Sheen(_) => [false, true],
            Self::RoughConductor(b) => [b.mean_fresnel.is_some(), true],
            Self::Dielectric(_) | Self::ThinDielectric(_) => [true, false],
            Self::Translucent(_)
            | Self::RoughDielectric(_)
            | Self::Plastic(_)
            | Self::RoughPlastic(_)
            | Self::Principled(_)
            | Self::Layered(_)
            | Self::Hair(_) => [true, true],
        }
    }

    /// Draws `wi`. `u_lobe` chooses a lobe, `u` a direction in it; both uniform in [0, 1). None: absorbed.
    #[inline]
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        match *self {
            Self::Black => None,
            Self::Diffuse { reflectance, two_sided } => {
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
            Self::Dielectric(b) => Some(one_of(b.boundary(wo, mode), u_lobe)),
            Self::ThinDielectric(b) => Some(one_of(b.sheet(wo), u_lobe)),
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
            Self::Mirror { reflectance, two_sided } => {
                lit_side(wo, two_sided)?;
                Some(mirrored(wo, reflectance, 1.0))
            }
            Self::RoughConductor(b) => b.sample(wo, u_lobe, u),
            Self::Translucent(b) => b.sample(wo, u_lobe, u),
            Self::OrenNayar(b) => b.sample(wo, u),
            Self::Velvet(b) => b.sample(wo, u),
            Self::Sheen(b) => b.sample(wo, u, mode),
            Self::RoughDielectric(b) => b.sample(wo, u_lobe, u, mode),
            Self::Plastic(b) => b.sample(wo, u_lobe, u),
            Self::RoughPlastic(b) => b.sample(wo, u_lobe, u),
            Self::Principled(b) => b.sample(wo, u_lobe, u),
            Self::Layered(b) => b.sample(wo, u_lobe, u, mode),
            Self::Hair(b) => b.sample(wo, u_lobe, u, mode),
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

/// The sign that turns `wo` to the front, if the surface reflects on its side. Turning a direction through the origin
/// equals mirroring it, as nothing here depends on the azimuth.
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

#[cfg(test)]
mod tests;
