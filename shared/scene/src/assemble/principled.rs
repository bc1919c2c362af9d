//! Principled materials.

use super::ior::relative_ior;
use super::texture::scalar;
use super::{Assets, Problem};
use crate::parse::{Fault, MaterialRecord, ScalarRecord};
use crate::values::{Spanned, Unit};
use beamfarm_render::world::bsdf::{Extras, Interface, MaterialKind};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};

/// All of its lobes.
pub fn kind(record: &MaterialRecord, base_color: Texture, assets: &mut Assets<'_>) -> Result<MaterialKind, Problem> {
    let mut number = |field: &Option<Spanned<ScalarRecord<Unit>>>, default: f32| match field {
        None => Ok(Scalar::constant(default)),
        Some(given) => scalar(given.get_ref(), assets),
    };
    let metallic = number(&record.metallic, 0.0)?;
    let roughness = number(&record.roughness, 0.5)?;
    let extras = Extras {
        spec_tint: number(&record.spec_tint, 0.0)?,
        spec_trans: number(&record.spec_trans, 0.0)?,
        sheen: number(&record.sheen, 0.0)?,
        sheen_tint: number(&record.sheen_tint, 0.0)?,
        clearcoat: number(&record.clearcoat, 0.0)?,
        clearcoat_gloss: number(&record.clearcoat_gloss, 0.0)?,
        flatness: number(&record.flatness, 0.0)?,
    };
    let interface = interface(record, assets)?;
    if extras.transmits() {
        if let Some(two_sided) = record.two_sided.as_ref().filter(|two_sided| *two_sided.get_ref()) {
            let message = "with `spec_trans` the other side is the inside; expected false";
            return Err(Fault::new(two_sided.span(), message).into());
        }
        if let (Interface::Specular(specular), Some(field)) = (&interface, &record.specular)
            && specular.varies()
        {
            let message = "with `spec_trans` the index of refraction is the same everywhere; expected a number";
            return Err(Fault::new(field.span(), message).into());
        }
    }
    Ok(MaterialKind::Principled {
        base_color,
        metallic,
        roughness,
        interface,
        extras: extras.are_some().then(|| Box::new(extras)),
    })
}

/// By `specular`, the reflectance at normal incidence over 0.08, or by `ior`.
fn interface(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Interface, Problem> {
    if record.ior.is_some() {
        if let Some(specular) = &record.specular {
            let message = "the reflection is given by `specular` or by `ior`: one of the two ways";
            return Err(Fault::new(specular.span(), message).into());
        }
        return Ok(Interface::Eta(relative_ior(record, None)?));
    }
    if let Some(exterior) = &record.exterior_ior {
        let message = "`exterior_ior` goes with `ior`, which is missing";
        return Err(Fault::new(exterior.span(), message).into());
    }
    let specular = match &record.specular {
        None => Scalar::constant(0.5),
        Some(specular) => scalar(specular.get_ref(), assets)?,
    };
    let varies = specular.varies();
    let interface = Interface::Specular(specular);
    Ok(match varies {
        true => interface,
        false => Interface::Eta(interface.eta(&TexturePoint::default())),
    })
}
