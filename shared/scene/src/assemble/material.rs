//! Materials and their names.

use super::blend::Making;
use super::{Assets, Problem, required, unknown_name};
use super::{principled, texture};
use crate::parse::{
    DistributionName, Fault, ImageTextureRecord, MaterialRecord, MaterialType, ScalarRecord, TextureRecord,
};
use crate::values::Spanned;
use crate::values::{NonNegative, Number, Unit};
use beamfarm_render::bsdf::{
    Coat, Distribution, Material, MaterialKind, NormalPerturbation, Tint, conductor_names, conductor_preset,
};
use beamfarm_render::math::Rgb;
use beamfarm_render::scalar::Scalar;
use beamfarm_render::texture::Texture;
use std::collections::BTreeMap;

/// The scene's materials in the order of their names, then those for shapes that name none.
pub struct Materials {
    pub list: Vec<Material>,
    names: BTreeMap<String, u32>,
    /// What each is called that has a name.
    pub labels: BTreeMap<u32, String>,
    grey: Option<u32>,
    black: Option<u32>,
}

impl Materials {
    pub fn new(records: &BTreeMap<Spanned<String>, MaterialRecord>, assets: &mut Assets<'_>) -> Result<Self, Problem> {
        let mut materials = Self {
            list: Vec::new(),
            names: BTreeMap::new(),
            labels: BTreeMap::new(),
            grey: None,
            black: None,
        };
        materials.enter(records, assets)?;
        Ok(materials)
    }

    /// Add materials whose names are the only ones until [`Self::leave`].
    pub fn enter(
        &mut self,
        records: &BTreeMap<Spanned<String>, MaterialRecord>,
        assets: &mut Assets<'_>,
    ) -> Result<BTreeMap<String, u32>, Problem> {
        let mut names = BTreeMap::new();
        let mut making = Making::new(records);
        for name in records.keys() {
            let material = making.material(name, &mut Vec::new(), assets)?;
            names.insert(name.get_ref().clone(), self.list.len() as u32);
            self.labels.insert(self.list.len() as u32, name.get_ref().clone());
            self.list.push(material);
        }
        Ok(std::mem::replace(&mut self.names, names))
    }

    /// Back to the names that held before.
    pub fn leave(&mut self, names: BTreeMap<String, u32>) {
        self.names = names;
    }

    /// The material of a name.
    pub fn resolve(&self, name: &Spanned<String>) -> Result<u32, Fault> {
        match self.names.get(name.get_ref()) {
            Some(index) => Ok(*index),
            None => Err(unknown_name("material", name, self.names.keys().map(String::as_str))),
        }
    }

    /// The material of shapes that name none: black for those that emit, else grey.
    pub fn default(&mut self, emits: bool) -> u32 {
        let (slot, reflectance) = match emits {
            true => (&mut self.black, 0.0),
            false => (&mut self.grey, 0.5),
        };
        *slot.get_or_insert_with(|| {
            let reflectance = Texture::Constant(Rgb::splat(reflectance));
            let kind = MaterialKind::Diffuse { reflectance };
            self.list.push(Material::new(kind, false));
            (self.list.len() - 1) as u32
        })
    }
}

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
        | MaterialKind::Blend { .. }
        | MaterialKind::Null => true,
        MaterialKind::Mirror { .. } | MaterialKind::Conductor { .. } | MaterialKind::RoughConductor { .. } => {
            said.unwrap_or(true)
        }
        MaterialKind::Diffuse { .. }
        | MaterialKind::Plastic { .. }
        | MaterialKind::RoughPlastic { .. }
        | MaterialKind::Principled { .. } => said.unwrap_or(false),
    };
    Ok(Material {
        kind,
        two_sided,
        opacity: opacity(record, assets)?,
        normal_perturbation: normal_perturbation(record, assets)?,
    })
}

fn kind(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<MaterialKind, Problem> {
    let mut texture = |field: &Field, default| match field {
        None => Ok(Texture::Constant(Rgb::splat(default))),
        Some(given) => texture::texture(given.get_ref(), assets),
    };
    let nonlinear = record.nonlinear.as_ref().is_some_and(|b| *b.get_ref());
    Ok(match record.kind.get_ref() {
        MaterialType::Diffuse => MaterialKind::Diffuse {
            reflectance: texture(&record.reflectance, 0.5)?,
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
        MaterialType::Blend => {
            return Err(Fault::new(record.kind.span(), "a blend is made of other materials").into());
        }
        MaterialType::Null => MaterialKind::Null,
    })
}

pub(super) fn normal_perturbation(
    record: &MaterialRecord,
    assets: &mut Assets<'_>,
) -> Result<Option<NormalPerturbation>, Problem> {
    match (&record.bump, &record.normal_map) {
        (None, None) => Ok(None),
        (Some(bump), None) => {
            let bump = bump.get_ref();
            let image = ImageTextureRecord {
                file: bump.image.clone(),
                raw: bump.raw,
                channel: None,
                filter: bump.filter,
                wrap: bump.wrap,
                uv: bump.uv.clone(),
            };
            Ok(Some(NormalPerturbation::BumpMap {
                height: texture::image::<NonNegative>(&image, assets)?,
                scale: bump.scale.as_ref().map_or(1.0, Number::f32),
            }))
        }
        (None, Some(map)) => {
            let mut map = map.get_ref().clone();
            if let TextureRecord::Image(image) = &mut map {
                image.raw = true;
            }
            Ok(Some(NormalPerturbation::NormalMap(texture::texture(&map, assets)?)))
        }
        (Some(_), Some(map)) => Err(Fault::new(map.span(), "a surface has `bump` or `normal_map`, not both").into()),
    }
}

/// A colour or image that reflects or transmits from nothing to everything.
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

fn alpha(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Scalar, Problem> {
    let alpha = required(&record.alpha, &record.kind, "alpha")?;
    texture::scalar(alpha.get_ref(), assets)
}

/// Index of refraction of plastics where the scene names none: polypropylene's.
const POLYPROPYLENE: f64 = 1.49;

pub(super) fn relative_ior(record: &MaterialRecord, default: Option<f64>) -> Result<f32, Fault> {
    let (ior, span) = match (&record.ior, default) {
        (None, Some(ior)) => (ior, record.kind.span()),
        (ior, _) => {
            let ior = required(ior, &record.kind, "ior")?;
            (ior.get_ref().0, ior.span())
        }
    };
    let exterior = record.exterior_ior.as_ref().map_or(1.0, |ior| ior.get_ref().0);
    let eta = (ior / exterior) as f32;
    if !(1e-2..=1e2).contains(&eta) {
        return Err(Fault::new(
            span,
            format!("expected `ior` / `exterior_ior` from 0.01 to 100, found {eta}"),
        ));
    }
    Ok(eta)
}

fn metal(record: &MaterialRecord) -> Result<(Rgb, Rgb), Fault> {
    match (&record.preset, &record.eta, &record.k) {
        (Some(preset), None, None) => conductor_preset(preset.get_ref()).ok_or_else(|| {
            let known = conductor_names().collect::<Vec<_>>().join(", ");
            Fault::new(
                preset.span(),
                format!("there is no metal \"{}\"; expected one of {known}", preset.get_ref()),
            )
        }),
        (None, Some(eta), Some(k)) => {
            let (eta, k) = (eta.get_ref().rgb(), k.get_ref().rgb());
            if (eta + k).min_element() <= 0.0 {
                return Err(Fault::new(record.kind.span(), "eta and k are both 0 in one channel"));
            }
            Ok((eta, k))
        }
        _ => Err(Fault::new(
            record.kind.span(),
            "a conductor is given by `preset`, or by `eta` and `k`: one of the two ways",
        )),
    }
}
