//! What perturbs shading normals: a normal map, and bumps over it.

use super::texture::{self, graph};
use super::{Assets, Problem};
use crate::parse::{BumpRecord, Fault, ImageTextureRecord, NamedRecord, TextureRecord};
use crate::values::{Finite, NonNegative, Number, Spanned, Unit};
use beamfarm_render::world::bsdf::NormalPerturbation;

/// The normal map and bumps of a material.
pub(super) fn turned_by(
    normal_map: &Option<Spanned<TextureRecord<Unit>>>,
    bumps: &Option<Spanned<BumpRecord>>,
    assets: &mut Assets<'_>,
) -> Result<Option<NormalPerturbation>, Problem> {
    let mut layers = Vec::new();
    if let Some(map) = normal_map {
        if let TextureRecord::VertexColors(_) = map.get_ref() {
            return Err(Fault::new(map.span(), "colours of vertices are no normals; expected an image").into());
        }
        let mut map = map.get_ref().clone();
        if let TextureRecord::Image(image) = &mut map {
            image.raw = true;
        }
        let map = NormalPerturbation::NormalMap(texture::texture(&map, assets)?);
        layers.push((map, 1.0));
    }
    if let Some(place) = bumps {
        let bumps: Vec<_> = place.get_ref().all().collect();
        if bumps.len() > MOST_BUMPS {
            return Err(Fault::new(
                place.span(),
                format!("expected at most {MOST_BUMPS} bumps over each other"),
            )
            .into());
        }
        for record in bumps.into_iter().rev() {
            let strength = record
                .strength
                .as_ref()
                .map_or(1.0, |strength| strength.get_ref().f32());
            layers.push((bump(record, place, assets)?, strength));
        }
    }
    if layers.len() <= 1 && layers.iter().all(|(_, strength)| *strength == 1.0) {
        return Ok(layers.pop().map(|(only, _)| only));
    }
    Ok(Some(NormalPerturbation::Layers(layers)))
}

/// How many bumps may be layered.
const MOST_BUMPS: usize = 8;

/// One of the bumps.
fn bump(
    record: &BumpRecord,
    place: &Spanned<BumpRecord>,
    assets: &mut Assets<'_>,
) -> Result<NormalPerturbation, Problem> {
    let height = match (&record.image, &record.texture) {
        (Some(file), None) => {
            let image = ImageTextureRecord {
                file: file.clone(),
                raw: record.raw,
                channel: None,
                filter: record.filter,
                wrap: record.wrap,
                uv: record.uv.clone(),
                vector: None,
            };
            texture::image::<NonNegative>(&image, assets)?
        }
        (None, Some(texture)) => {
            let named = TextureRecord::<Finite>::Named(NamedRecord {
                texture: texture.clone(),
                output: record.output.clone(),
            });
            graph::texture(&named, graph::bounds::<Finite>(), true, assets)?
        }
        _ => {
            let message = "expected an `image` of heights, or a `texture`: exactly one of them";
            return Err(Fault::new(place.span(), message).into());
        }
    };
    Ok(NormalPerturbation::BumpMap {
        height,
        scale: record.scale.as_ref().map_or(1.0, Number::f32),
    })
}
