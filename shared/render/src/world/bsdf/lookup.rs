//! A material with its textures looked up at one hit.

use super::dielectric::Dielectric;
use super::hair::Hair;
use super::layered::Layered;
use super::material::{MAX_INDEX, Pigment, index_matched};
use super::microfacet::MIN_ALPHA;
use super::microfibers::{Microfibers, Sheen};
use super::oren_nayar::OrenNayar;
use super::plastic::{Plastic, RoughPlastic};
use super::principled::Principled;
use super::rough_dielectric::RoughDielectric;
use super::translucent::Translucent;
use super::velvet::Velvet;
use super::{Bsdf, Material, MaterialKind, RoughConductor};
use crate::math::Rgb;
use crate::world::spectrum::Wave;
use crate::world::texture::TexturePoint;

impl Material {
    /// [`Self::bsdf`] for light of a wavelength, if it has one.
    #[inline]
    pub fn bsdf_for(&self, at: &TexturePoint, wave: Option<Wave>) -> Bsdf<'_> {
        let bsdf = self.bsdf(at);
        match self.eta_at(wave) {
            None => bsdf,
            Some(eta) => bsdf.bending(eta),
        }
    }

    /// The scattering at a hit with these texture coordinates, at the d line. Black for a blend: light meets one of its
    /// parts, see [`Self::met`].
    #[inline]
    pub fn bsdf(&self, at: &TexturePoint) -> Bsdf<'_> {
        let two_sided = self.two_sided;
        match &self.kind {
            MaterialKind::Diffuse { reflectance } => {
                let reflectance = reflectance.eval(at);
                if reflectance == Rgb::ZERO {
                    return Bsdf::Black;
                }
                Bsdf::Diffuse { reflectance, two_sided }
            }
            MaterialKind::Translucent {
                reflectance,
                transmittance,
            } => {
                let found = Translucent::new(reflectance.eval(at), transmittance.eval(at));
                match found.reflectance == Rgb::ZERO && found.transmittance == Rgb::ZERO {
                    true => Bsdf::Black,
                    false => Bsdf::Translucent(found),
                }
            }
            MaterialKind::OrenNayar { reflectance, roughness } => Bsdf::OrenNayar(OrenNayar {
                reflectance: reflectance.eval(at),
                roughness: roughness.eval(at),
                two_sided,
            }),
            MaterialKind::Sheen { reflectance, roughness } => Bsdf::Sheen(Sheen {
                fibers: Microfibers {
                    color: reflectance.eval(at),
                    roughness: roughness.eval(at),
                },
                two_sided,
            }),
            MaterialKind::Velvet { reflectance, roughness } => Bsdf::Velvet(Velvet {
                reflectance: reflectance.eval(at),
                roughness: roughness.eval(at).max(Velvet::LEAST),
                two_sided,
            }),
            MaterialKind::Dielectric { eta, tint } => Bsdf::Dielectric(Dielectric {
                eta: *eta,
                reflectance: tint.reflectance.eval(at),
                transmittance: tint.transmittance.eval(at),
            }),
            MaterialKind::ThinDielectric { eta, tint } => Bsdf::ThinDielectric(Dielectric {
                eta: *eta,
                reflectance: tint.reflectance.eval(at),
                transmittance: tint.transmittance.eval(at),
            }),
            MaterialKind::Conductor { eta, k, reflectance } => Bsdf::Conductor {
                eta: eta.min(MAX_INDEX),
                k: k.min(MAX_INDEX),
                reflectance: reflectance.eval(at),
                two_sided,
            },
            MaterialKind::Mirror { reflectance } => Bsdf::Mirror {
                reflectance: reflectance.eval(at),
                two_sided,
            },
            MaterialKind::RoughConductor {
                distribution,
                alpha,
                eta,
                k,
                reflectance,
            } => {
                let [alpha, aspect] = self.roughness(alpha.eval(at), at);
                Bsdf::RoughConductor(RoughConductor {
                    distribution: *distribution,
                    alpha,
                    aspect,
                    eta: eta.min(MAX_INDEX),
                    k: k.min(MAX_INDEX),
                    reflectance: reflectance.eval(at),
                    mean_fresnel: self.mean_fresnel(),
                    two_sided,
                })
            }
            MaterialKind::RoughDielectric { eta, .. } if index_matched(*eta) => Bsdf::Null,
            MaterialKind::RoughDielectric {
                distribution,
                alpha,
                eta,
                tint,
            } => {
                let [alpha, aspect] = self.roughness(alpha.eval(at), at);
                let (reflectance, transmittance) = (tint.reflectance.eval(at), tint.transmittance.eval(at));
                Bsdf::RoughDielectric(RoughDielectric {
                    distribution: *distribution,
                    alpha,
                    aspect,
                    eta: *eta,
                    reflectance,
                    transmittance,
                    kept: self.multiple_scattering.then_some(transmittance),
                })
            }
            MaterialKind::Plastic {
                reflectance,
                specular_reflectance,
                coat,
            } => Bsdf::Plastic(Plastic::new(
                coat,
                reflectance.eval(at),
                specular_reflectance.eval(at),
                two_sided,
            )),
            MaterialKind::RoughPlastic {
                reflectance,
                specular_reflectance,
                coat,
            } => Bsdf::RoughPlastic(RoughPlastic::new(
                coat,
                reflectance.eval(at),
                specular_reflectance.eval(at),
                two_sided,
            )),
            MaterialKind::Principled {
                base_color,
                metallic,
                roughness,
                interface,
                extras,
            } => {
                let (mut roughness, mut aspect) = (roughness.eval(at), 1.0);
                if let Some(anisotropy) = &self.anisotropy {
                    let [alpha, ratio] = anisotropy.stretched(roughness * roughness, at);
                    (roughness, aspect) = (alpha.sqrt(), ratio);
                }
                let base = Principled {
                    base_color: base_color.eval(at),
                    metallic: metallic.eval(at),
                    roughness,
                    aspect,
                    eta: interface.eta(at),
                    two_sided,
                    multiple: self.multiple_scattering,
                    lobes: Principled::ALL_LOBES,
                    lit: 1.0,
                };
                match extras {
                    None => Bsdf::Principled(base),
                    Some(extras) => Bsdf::Layered(Layered::new(base, extras, interface, at)),
                }
            }
            MaterialKind::Hair { pigment, fibre } => {
                let absorption = match pigment {
                    Pigment::Absorption(texture) => texture.eval(at),
                    Pigment::Color(texture) => fibre.absorption_of(texture.eval(at)),
                };
                Bsdf::Hair(Hair {
                    fibre: *fibre,
                    absorption,
                })
            }
            MaterialKind::Null => Bsdf::Null,
            MaterialKind::Blend { .. } => Bsdf::Black,
        }
    }
}

impl Material {
    /// Mean roughness at a hit, given the material's roughness there, and the aspect of its facets.
    #[inline]
    fn roughness(&self, alpha: f32, at: &TexturePoint) -> [f32; 2] {
        match &self.anisotropy {
            None => [alpha.max(MIN_ALPHA), 1.0],
            Some(anisotropy) => anisotropy.stretched(alpha, at),
        }
    }
}

impl Bsdf<'_> {
    /// The same with another index inside over the one outside, for surfaces that transmit light.
    fn bending(self, eta: f32) -> Self {
        match self {
            Self::Dielectric(b) => Self::Dielectric(Dielectric { eta, ..b }),
            Self::RoughDielectric(b) => Self::RoughDielectric(RoughDielectric { eta, ..b }),
            Self::Layered(b) => Self::Layered(b.bending(eta)),
            other => other,
        }
    }
}
