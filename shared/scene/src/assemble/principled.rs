//! Principled materials.

use super::ior::{index_outside, relative_ior};
use super::relief::turned_by;
use super::texture::{scalar, texture};
use super::{Assets, Problem, required};
use crate::parse::{Fault, MaterialRecord, ScalarRecord};
use crate::values::{FilmIndex, Number, Spanned, Unit};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::{
    ClearCoat, CoatFacing, Extras, Fuzz, Interface, MaterialKind, Subsurface, ThinFilm,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};

/// The material with all its lobes.
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
        diffuse_roughness: number(&record.diffuse_roughness, 0.0)?,
        ..Extras::NONE
    };
    let interface = interface(record, assets)?;
    let extras = Extras {
        specular_color: match &record.specular_color {
            None => Texture::Constant(Rgb::ONE),
            Some(color) => texture(color.get_ref(), assets)?,
        },
        fuzz: fuzz(record, assets)?,
        coat: coat(record, assets)?,
        film: film(record, assets)?,
        subsurface: subsurface(record, &base_color, &interface, assets)?,
        ..extras
    };
    if let Some(rough) = &record.diffuse_roughness {
        // Burley's base has a lobe shape of its own.
        if record.multiple_scattering.as_ref().is_some_and(|b| !*b.get_ref()) {
            let message = "it goes with `multiple_scattering`, which is false";
            return Err(Fault::new(rough.span(), message).into());
        }
        if let Some(flatness) = &record.flatness {
            let message = "the shape of the base is given by `diffuse_roughness` or by `flatness`: one of the two ways";
            return Err(Fault::new(flatness.span(), message).into());
        }
    }
    if extras.transmits() {
        if let Some(two_sided) = record.two_sided.as_ref().filter(|two_sided| *two_sided.get_ref()) {
            let message = "with `spec_trans` the other side is the inside; expected false";
            return Err(Fault::new(two_sided.span(), message).into());
        }
        let over = [
            record.specular_color.as_ref().map(Spanned::span),
            record.coat_weight.as_ref().map(Spanned::span),
        ];
        if let Some(place) = over.into_iter().flatten().next() {
            return Err(Fault::new(place, "it does not go with `spec_trans`").into());
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

/// The fuzz layer, if there is one.
fn fuzz(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Option<Fuzz>, Problem> {
    let Some(weight) = &record.sheen_weight else {
        let rest = [
            record.sheen_roughness.as_ref().map(Spanned::span),
            record.sheen_color.as_ref().map(Spanned::span),
        ];
        return goes_with(rest, "sheen_weight");
    };
    let burley = [
        record.sheen.as_ref().map(Spanned::span),
        record.sheen_tint.as_ref().map(Spanned::span),
    ];
    if let Some(place) = burley.into_iter().flatten().next() {
        let message = "the sheen is given by `sheen_weight` or by `sheen`: one of the two ways";
        return Err(Fault::new(place, message).into());
    }
    let fuzz = Fuzz {
        weight: scalar(weight.get_ref(), assets)?,
        roughness: match &record.sheen_roughness {
            None => Scalar::constant(0.5),
            Some(roughness) => scalar(roughness.get_ref(), assets)?,
        },
        color: match &record.sheen_color {
            None => Texture::Constant(Rgb::ONE),
            Some(color) => texture(color.get_ref(), assets)?,
        },
    };
    Ok((!fuzz.weight.is_zero()).then_some(fuzz))
}

/// The clear coat, if there is one.
fn coat(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Option<ClearCoat>, Problem> {
    let Some(weight) = &record.coat_weight else {
        let rest = [
            record.coat_roughness.as_ref().map(Spanned::span),
            record.coat_ior.as_ref().map(Spanned::span),
            record.coat_levels.as_ref().map(Spanned::span),
            record.coat_bump.as_ref().map(Spanned::span),
            record.coat_normal_map.as_ref().map(Spanned::span),
        ];
        return goes_with(rest, "coat_weight");
    };
    if let Some(clearcoat) = &record.clearcoat {
        let message = "the coat is given by `coat_weight` or by `clearcoat`: one of the two ways";
        return Err(Fault::new(clearcoat.span(), message).into());
    }
    let coat = ClearCoat {
        weight: scalar(weight.get_ref(), assets)?,
        roughness: match &record.coat_roughness {
            None => Scalar::constant(0.0),
            Some(roughness) => scalar(roughness.get_ref(), assets)?,
        },
        eta: index_over(record, &record.coat_ior, 1.5)?,
        facing: coat_facing(record, assets)?,
    };
    Ok((!coat.weight.is_zero()).then_some(coat))
}

/// Where the coat's normal comes from.
fn coat_facing(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<CoatFacing, Problem> {
    let levels = record.coat_levels.as_ref().filter(|levels| *levels.get_ref());
    let own = turned_by(&record.coat_normal_map, &record.coat_bump, assets)?;
    match (own, levels) {
        (Some(_), Some(levels)) => {
            let message = "the coat's normal is that of the shape or one of `coat_bump` and `coat_normal_map`";
            Err(Fault::new(levels.span(), message).into())
        }
        (Some(own), None) => Ok(CoatFacing::Own(own)),
        (None, Some(_)) => Ok(CoatFacing::Shape),
        (None, None) => Ok(CoatFacing::Below),
    }
}

/// The thin film, if there is one.
fn film(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Option<ThinFilm>, Problem> {
    let Some(thickness) = &record.thin_film_thickness else {
        let rest = [
            record.thin_film_weight.as_ref().map(Spanned::span),
            record.thin_film_ior.as_ref().map(Spanned::span),
        ];
        return goes_with(rest, "thin_film_thickness");
    };
    let film = ThinFilm {
        weight: match &record.thin_film_weight {
            None => Scalar::constant(1.0),
            Some(weight) => scalar(weight.get_ref(), assets)?,
        },
        thickness: scalar(thickness.get_ref(), assets)?,
        eta: index_over(record, &record.thin_film_ior, 1.4)?,
    };
    Ok((!film.weight.is_zero() && !film.thickness.is_zero()).then_some(film))
}

/// `None`; an error if a field is given that needs the missing `field`.
fn goes_with<T, const N: usize>(rest: [Option<std::ops::Range<usize>>; N], field: &str) -> Result<Option<T>, Problem> {
    match rest.into_iter().flatten().next() {
        None => Ok(None),
        Some(place) => Err(Fault::new(place, format!("it goes with `{field}`, which is missing")).into()),
    }
}

/// The index of refraction of a layer over the surface, relative to the outside.
fn index_over(record: &MaterialRecord, given: &Option<Spanned<Number<FilmIndex>>>, default: f32) -> Result<f32, Fault> {
    let ior = given.as_ref().map_or(default, |ior| ior.get_ref().f32());
    // With a lower index than the outside's it would be no layer.
    Ok((ior / index_outside(record)?).max(1.0))
}

/// Subsurface scattering, if there is any.
fn subsurface(
    record: &MaterialRecord,
    base_color: &Texture,
    interface: &Interface,
    assets: &mut Assets<'_>,
) -> Result<Option<Subsurface>, Problem> {
    let Some(field) = &record.subsurface else {
        let rest = [
            record.subsurface_radius.as_ref().map(Spanned::span),
            record.subsurface_anisotropy.as_ref().map(Spanned::span),
        ];
        return goes_with(rest, "subsurface");
    };
    let weight = scalar(field.get_ref(), assets)?;
    let radius = required(&record.subsurface_radius, field, "subsurface_radius")?;
    let inside_has_use = [
        (
            record
                .two_sided
                .as_ref()
                .filter(|two_sided| *two_sided.get_ref())
                .map(Spanned::span),
            "false",
        ),
        (
            record.spec_trans.as_ref().map(Spanned::span),
            "one of `subsurface` and `spec_trans`",
        ),
    ];
    for (place, expected) in inside_has_use {
        if let Some(place) = place {
            let message = format!("with `subsurface` the other side is the medium beneath; expected {expected}");
            return Err(Fault::new(place, message).into());
        }
    }
    if weight.is_zero() {
        return Ok(None);
    }
    let g = record.subsurface_anisotropy.as_ref().map_or(0.0, |g| g.get_ref().f32());
    let radius = (radius.get_ref().rgb(), g);
    let eta = interface.eta(&TexturePoint::default());
    Ok(Some(Subsurface::new(weight, typical(base_color), radius, eta)))
}

/// The colour of the medium beneath: the mean, but not so dark that the surface would have to brighten it more than
/// twofold anywhere.
fn typical(color: &Texture) -> Rgb {
    let of = |colors: &[Rgb]| {
        let sum = colors.iter().fold([0.0; 3], |sum, color| {
            let color = color.to_array();
            std::array::from_fn(|i| sum[i] + f64::from(color[i]))
        });
        let mean = Rgb::from_array(sum.map(|sum| (sum / colors.len().max(1) as f64) as f32));
        let most = colors.iter().fold(Rgb::ZERO, |most, color| most.max(*color));
        mean.max(most / 4.0)
    };
    let found = match color {
        Texture::Constant(color) => *color,
        Texture::Image { image, .. } => of(&image.pixels),
        Texture::Checkerboard { colors, .. } => of(colors),
        Texture::VertexColors(_) => UNKNOWN,
        Texture::Graph(program) => UNKNOWN.min(Rgb::splat(program.range()[1])),
    };
    found.clamp(LEAST, Rgb::ONE)
}

/// The colour assumed when it is only known at a hit.
const UNKNOWN: Rgb = Rgb::splat(0.8);
/// Darker media return nothing visible.
const LEAST: Rgb = Rgb::splat(1e-3);

/// The interface by `specular`, which is the reflectance at normal incidence over 0.08, or by `ior`.
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
