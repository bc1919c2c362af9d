//! Builds one material from its fields.

use super::anisotropy::anisotropy;
use super::ior::{dispersion, index_outside, relative_ior};
use super::principled;
use super::relief::turned_by;
use super::texture;
use super::{Assets, Problem, required};
use crate::cie;
use crate::parse::{DistributionName, Fault, MaterialRecord, MaterialType, ScalarRecord, TextureRecord};
use crate::values::Spanned;
use crate::values::{NonNegative, Number, Unit, Vector};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::{
    BsdfFlags, Coat, Distribution, Fibre, Material, MaterialDescription, MaterialKind, Pigment, Tint, conductor_names,
    conductor_preset,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::Texture;

pub(super) fn opacity(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Option<Texture>, Problem> {
    let Some(opacity) = &record.opacity else {
        return Ok(None);
    };
    Ok(match texture::texture(opacity.get_ref(), assets)? {
        Texture::Constant(Rgb::ONE) => None,
        texture => Some(texture),
    })
}

pub(super) fn material(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Material, Problem> {
    let kind = kind(record, assets)?;
    let said = record.two_sided.as_ref().map(|b| *b.get_ref());
    let two_sided = match kind {
        MaterialKind::Dielectric { .. }
        | MaterialKind::ThinDielectric { .. }
        | MaterialKind::RoughDielectric { .. }
        | MaterialKind::Translucent { .. }
        | MaterialKind::Hair { .. }
        | MaterialKind::Blend { .. }
        | MaterialKind::Null => true,
        MaterialKind::Mirror { .. } | MaterialKind::Conductor { .. } | MaterialKind::RoughConductor { .. } => {
            said.unwrap_or(true)
        }
        MaterialKind::Diffuse { .. }
        | MaterialKind::OrenNayar { .. }
        | MaterialKind::Velvet { .. }
        | MaterialKind::Sheen { .. }
        | MaterialKind::Plastic { .. }
        | MaterialKind::RoughPlastic { .. }
        | MaterialKind::Principled { .. } => said.unwrap_or(false),
    };
    let scatters_on = matches!(
        kind,
        MaterialKind::RoughConductor { .. } | MaterialKind::RoughDielectric { .. } | MaterialKind::Principled { .. }
    );
    // A thin pane lets all wavelengths straight through, and the reflection of coats hardly depends on wavelength.
    let disperses = kind.flags().contains(BsdfFlags::BENDS);
    Ok(Material::from(MaterialDescription {
        opacity: opacity(record, assets)?,
        normal_perturbation: turned_by(&record.normal_map, &record.bump, assets)?,
        multiple_scattering: scatters_on && record.multiple_scattering.as_ref().is_none_or(|b| *b.get_ref()),
        dispersion: if disperses { dispersion(record)? } else { None },
        index_outside: if disperses { index_outside(record)? } else { 1.0 },
        anisotropy: anisotropy(record, assets)?.map(Box::new),
        ..MaterialDescription::new(kind, two_sided)
    }))
}

fn kind(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<MaterialKind, Problem> {
    let mut texture = |field: &Field, default| match field {
        None => Ok(Texture::Constant(Rgb::splat(default))),
        Some(given) => texture::texture(given.get_ref(), assets),
    };
    let nonlinear = record.nonlinear.as_ref().is_some_and(|b| *b.get_ref());
    Ok(match record.kind.get_ref() {
        MaterialType::Diffuse => {
            let reflectance = texture(&record.reflectance, 0.5)?;
            let roughness = roughness(record, 0.0, assets)?;
            match roughness.is_zero() {
                true => MaterialKind::Diffuse { reflectance },
                false => MaterialKind::OrenNayar { reflectance, roughness },
            }
        }
        MaterialType::Translucent => MaterialKind::Translucent {
            reflectance: texture(&record.reflectance, 0.0)?,
            transmittance: texture(&record.transmittance, 0.5)?,
        },
        MaterialType::Velvet => MaterialKind::Velvet {
            reflectance: texture(&record.reflectance, 0.5)?,
            roughness: roughness(record, 0.5, assets)?,
        },
        MaterialType::Sheen => MaterialKind::Sheen {
            reflectance: texture(&record.reflectance, 0.5)?,
            roughness: roughness(record, 0.5, assets)?,
        },
        MaterialType::Mirror => MaterialKind::Mirror {
            reflectance: texture(&record.reflectance, 1.0)?,
        },
        MaterialType::Dielectric => MaterialKind::Dielectric {
            eta: relative_ior(record, None)?,
            tint: tint(record, texture)?,
        },
        MaterialType::ThinDielectric => MaterialKind::ThinDielectric {
            eta: relative_ior(record, None)?,
            tint: tint(record, texture)?,
        },
        MaterialType::RoughDielectric => MaterialKind::RoughDielectric {
            distribution: distribution(record),
            eta: relative_ior(record, None)?,
            tint: tint(record, texture)?,
            alpha: alpha(record, assets)?,
        },
        MaterialType::Conductor => {
            let (eta, k) = metal(record)?;
            MaterialKind::Conductor {
                eta,
                k,
                reflectance: texture(&record.reflectance, 1.0)?,
            }
        }
        MaterialType::RoughConductor => {
            let (eta, k) = metal(record)?;
            MaterialKind::RoughConductor {
                distribution: distribution(record),
                eta,
                k,
                reflectance: texture(&record.reflectance, 1.0)?,
                alpha: alpha(record, assets)?,
            }
        }
        MaterialType::Plastic => {
            let eta = relative_ior(record, Some(POLYPROPYLENE))?;
            MaterialKind::Plastic {
                reflectance: texture(&record.reflectance, 0.5)?,
                specular_reflectance: texture(&record.specular_reflectance, 1.0)?,
                coat: Coat::new(eta, nonlinear),
            }
        }
        MaterialType::RoughPlastic => {
            let eta = relative_ior(record, Some(POLYPROPYLENE))?;
            let alpha = required(&record.alpha, &record.kind, "alpha")?;
            let ScalarRecord::Number(number) = alpha.get_ref() else {
                let message = "the roughness of a rough plastic is the same everywhere; expected a number";
                return Err(Fault::new(alpha.span(), message).into());
            };
            let alpha = number.f32();
            MaterialKind::RoughPlastic {
                reflectance: texture(&record.reflectance, 0.5)?,
                specular_reflectance: texture(&record.specular_reflectance, 1.0)?,
                coat: Box::new(assets.kept.coat(distribution(record), alpha, eta, nonlinear)),
            }
        }
        MaterialType::Principled => {
            let base_color = texture(&record.base_color, 0.5)?;
            principled::kind(record, base_color, assets)?
        }
        MaterialType::Hair => hair(record, texture)?,
        MaterialType::Blend => {
            return Err(Fault::new(record.kind.span(), "a blend is made of other materials").into());
        }
        MaterialType::Null => MaterialKind::Null,
    })
}

/// A colour or image with a reflectance or transmittance in [0, 1].
type Field = Option<Spanned<TextureRecord<Unit>>>;

fn tint(
    record: &MaterialRecord,
    mut texture: impl FnMut(&Field, f32) -> Result<Texture, Problem>,
) -> Result<Tint, Problem> {
    Ok(Tint {
        reflectance: texture(&record.specular_reflectance, 1.0)?,
        transmittance: texture(&record.specular_transmittance, 1.0)?,
    })
}

fn distribution(record: &MaterialRecord) -> Distribution {
    match record.distribution.as_ref().map(Spanned::get_ref) {
        None | Some(DistributionName::Ggx) => Distribution::Ggx,
        Some(DistributionName::Beckmann) => Distribution::Beckmann,
    }
}

fn roughness(record: &MaterialRecord, default: f32, assets: &mut Assets<'_>) -> Result<Scalar, Problem> {
    match &record.roughness {
        None => Ok(Scalar::constant(default)),
        Some(roughness) => texture::scalar(roughness.get_ref(), assets),
    }
}

/// The isotropic roughness, or the one along the tangent.
fn alpha(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Scalar, Problem> {
    if let Some(along) = &record.alpha_u {
        return texture::scalar(along.get_ref(), assets);
    }
    let alpha = required(&record.alpha, &record.kind, "alpha")?;
    texture::scalar(alpha.get_ref(), assets)
}

/// Hair by its colour, absorption or melanin.
fn hair(
    record: &MaterialRecord,
    mut texture: impl FnMut(&Field, f32) -> Result<Texture, Problem>,
) -> Result<MaterialKind, Problem> {
    /// Index of refraction of human hair.
    const KERATIN: f64 = 1.55;
    /// Eumelanin concentration of brown hair.
    const BROWN: f32 = 1.3;
    /// Absorption of the two pigments, per fibre radius (d'Eon et al. 2011; values of pbrt-v4).
    const EUMELANIN: Rgb = Rgb::new(0.419, 0.697, 1.37);
    const PHEOMELANIN: Rgb = Rgb::new(0.187, 0.4, 1.05);
    let number = |field: &Option<Spanned<Number<Unit>>>, default: f32| match field {
        Some(given) => given.get_ref().f32(),
        None => default,
    };
    let melanin = record.eumelanin.as_ref().or(record.pheomelanin.as_ref());
    let ways = [
        record.color.as_ref().map(Spanned::span),
        record.absorption.as_ref().map(Spanned::span),
        melanin.map(Spanned::span),
    ];
    let mut given = ways.iter().flatten();
    if let (Some(_), Some(second)) = (given.next(), given.next()) {
        let message =
            "hair is given by `color`, by `absorption`, or by `eumelanin` and `pheomelanin`: one of these ways";
        return Err(Fault::new(second.clone(), message).into());
    }
    let pigment = match (&record.color, &record.absorption) {
        (Some(_), _) => Pigment::Color(texture(&record.color, 0.5)?),
        (None, Some(absorption)) => Pigment::Absorption(Texture::Constant(absorption.get_ref().rgb())),
        (None, None) => {
            let amount =
                |field: &Option<Spanned<Number<NonNegative>>>| field.as_ref().map(|given| given.get_ref().f32());
            let default = if melanin.is_some() { 0.0 } else { BROWN };
            let (brown, red) = (amount(&record.eumelanin), amount(&record.pheomelanin));
            let absorption = EUMELANIN * brown.unwrap_or(default) + PHEOMELANIN * red.unwrap_or(0.0);
            Pigment::Absorption(Texture::Constant(absorption))
        }
    };
    Ok(MaterialKind::Hair {
        pigment,
        fibre: Fibre::new(
            [number(&record.beta_m, 0.3), number(&record.beta_n, 0.3)],
            record.tilt.as_ref().map_or(2.0, |tilt| tilt.get_ref().f32()),
            relative_ior(record, Some(KERATIN))?,
            1.0 - number(&record.coat, 0.0),
        ),
    })
}

/// Default index of refraction of plastics: polypropylene's.
const POLYPROPYLENE: f64 = 1.49;

fn metal(record: &MaterialRecord) -> Result<(Rgb, Rgb), Fault> {
    match (&record.preset, &record.eta, &record.k, &record.nk) {
        (None, None, None, Some(rows)) => tabulated(rows),
        (Some(preset), None, None, None) => conductor_preset(preset.get_ref()).ok_or_else(|| {
            let known = conductor_names().collect::<Vec<_>>().join(", ");
            Fault::new(
                preset.span(),
                format!("there is no metal \"{}\"; expected one of {known}", preset.get_ref()),
            )
        }),
        (None, Some(eta), Some(k), None) => {
            let (eta, k) = (eta.get_ref().rgb(), k.get_ref().rgb());
            if (eta + k).min_element() <= 0.0 {
                return Err(Fault::new(record.kind.span(), "eta and k are both 0 in one channel"));
            }
            Ok((eta, k))
        }
        _ => Err(Fault::new(
            record.kind.span(),
            "a conductor is given by `preset`, by `eta` and `k`, or by `nk`: one of these ways",
        )),
    }
}

/// Eta and k from rows of wavelength in nm, eta and k, in order of wavelength.
fn tabulated(rows: &Spanned<Vec<Vector>>) -> Result<(Rgb, Rgb), Fault> {
    let table: Vec<[f64; 3]> = rows.get_ref().iter().map(|row| row.0.to_array()).collect();
    let is_good = |[nm, eta, k]: &[f64; 3]| *nm > 0.0 && *eta >= 0.0 && *k >= 0.0 && eta + k > 0.0;
    if table.is_empty() || !table.iter().all(is_good) || !table.is_sorted_by(|a, b| a[0] < b[0]) {
        return Err(Fault::new(
            rows.span(),
            "expected rows [nm, eta, k] in the order of their wavelengths, with numbers that are not negative, and eta and \
             k not both 0",
        ));
    }
    let column = |at: usize| {
        let samples = table.iter().map(|row| (row[0], row[at])).collect();
        let color = cie::to_rgb(&cie::held(samples), cie::Kind::Unbounded);
        Rgb::from_array(color.map(|channel| channel as f32))
    };
    Ok((column(1), column(2)))
}
