//! Textures.

pub(super) mod graph;

use super::kept::{Kept, Pinned};
use super::{Assets, Problem, asset_problem};
use crate::assets::image::Encoding;
use crate::parse::{Channel, Fault, ImageTextureRecord, ScalarRecord, TextureRecord, UvSteps};
use crate::transform;
use crate::values::{NonNegative, Range, Unit};
use beamfarm_render::math::{Rgb, Vec2, luminance};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Image, Texture};
use glam::{Affine2, DVec3};
use std::sync::Arc;

/// The texture of a record; pixels outside the range of the record's colours are an error.
pub fn texture<R: Range>(record: &TextureRecord<R>, assets: &mut Assets<'_>) -> Result<Texture, Problem> {
    if record.is_graph() {
        return graph::texture(record, graph::bounds::<R>(), false, assets);
    }
    match record {
        TextureRecord::Color(color) => Ok(Texture::Constant(color.rgb())),
        TextureRecord::Image(record) => image::<R>(record, assets),
        TextureRecord::VertexColors(None) => Ok(Texture::VertexColors(None)),
        TextureRecord::VertexColors(Some(record)) => {
            Ok(Texture::VertexColors(Some(Arc::new(image::<R>(record, assets)?))))
        }
        TextureRecord::Checkerboard { colors, uv } => Ok(Texture::Checkerboard {
            colors: [colors[0].rgb(), colors[1].rgb()],
            squares_from_uv: from_uv(uv.as_ref())?,
        }),
        // Graphs, handled above.
        TextureRecord::Node(_) | TextureRecord::Named(_) => Ok(Texture::Constant(Rgb::ZERO)),
    }
}

/// The texture of an emitter.
pub fn radiance(record: &TextureRecord<NonNegative>, assets: &mut Assets<'_>) -> Result<Texture, Problem> {
    if record.is_graph() {
        return texture(record, assets);
    }
    let mut image = |record: &ImageTextureRecord| of_image::<NonNegative>(record, true, assets);
    match record {
        TextureRecord::Image(record) => image(record),
        TextureRecord::VertexColors(Some(record)) => Ok(Texture::VertexColors(Some(Arc::new(image(record)?)))),
        other => texture(other, assets),
    }
}

/// An image whose pixels must lie in a range.
pub fn image<R: Range>(record: &ImageTextureRecord, assets: &mut Assets<'_>) -> Result<Texture, Problem> {
    of_image::<R>(record, false, assets)
}

fn of_image<R: Range>(record: &ImageTextureRecord, shines: bool, assets: &mut Assets<'_>) -> Result<Texture, Problem> {
    let encoding = match record.raw {
        true => Encoding::Raw,
        false => Encoding::Srgb,
    };
    let mut image = assets.image(&record.file, encoding, shines)?;
    if let Some(channel) = record.channel {
        let Kept { channels, clock, .. } = &mut *assets.kept;
        let key = (Pinned(image.clone()), channel);
        image = channels.get_or_make(clock, key, || Arc::new(one_channel(&image, channel)));
    }
    let Kept { in_range, clock, .. } = &mut *assets.kept;
    in_range.get_or(clock, (Pinned(image.clone()), R::EXPECTED), || {
        let holds = |p: &beamfarm_render::math::Rgb| p.to_array().into_iter().all(R::holds);
        let Some(i) = image.pixels.iter().position(|p| !holds(p)) else {
            return Ok(());
        };
        let (x, y) = (i as u32 % image.width, i as u32 / image.width);
        let flaw = format!(
            "the pixel in column {x}, row {y} (from zero) is {}; expected {} in each channel",
            image.pixels[i],
            R::EXPECTED
        );
        Err(asset_problem(&record.file.file, flaw))
    })?;
    Ok(Texture::Image {
        image,
        filter: record.filter.into(),
        wrap: record.wrap.into(),
        image_from_uv: from_uv(record.uv.as_ref())?,
    })
}

/// A number or a texture of numbers.
pub fn scalar<R: Range>(record: &ScalarRecord<R>, assets: &mut Assets<'_>) -> Result<Scalar, Problem> {
    let texture = match record {
        ScalarRecord::Number(number) => return Ok(Scalar::constant(number.f32())),
        ScalarRecord::Texture(record) if record.is_graph() => {
            graph::texture(record, graph::bounds::<Unit>(), true, assets)?
        }
        ScalarRecord::Texture(TextureRecord::Image(record)) => {
            let channel = record.channel.or(Some(Channel::Luminance));
            image::<Unit>(
                &ImageTextureRecord {
                    channel,
                    ..record.clone()
                },
                assets,
            )?
        }
        ScalarRecord::Texture(record) => texture(record, assets)?,
    };
    Ok(Scalar::of(match texture {
        Texture::Checkerboard {
            colors,
            squares_from_uv,
        } => Texture::Checkerboard {
            colors: colors.map(grey),
            squares_from_uv,
        },
        other => other,
    }))
}

/// A channel of an image instead of its three colours.
fn one_channel(image: &Image, channel: Channel) -> Image {
    let of = |pick: fn(&Rgb) -> Rgb| image.pixels.iter().map(pick).collect();
    Image {
        width: image.width,
        height: image.height,
        pixels: match channel {
            Channel::Red => of(|p| Rgb::splat(p.x)),
            Channel::Green => of(|p| Rgb::splat(p.y)),
            Channel::Blue => of(|p| Rgb::splat(p.z)),
            Channel::Luminance => of(|p| grey(*p)),
            Channel::Alpha if image.alpha.is_empty() => of(|_| Rgb::ONE),
            Channel::Alpha => image.alpha.iter().map(|a| Rgb::splat(*a)).collect(),
        },
        alpha: Vec::new(),
    }
}

/// A grey of the colour's luminance; greys stay exactly the same.
fn grey(color: Rgb) -> Rgb {
    Rgb::splat(color.x + luminance(color - color.x))
}

/// The transform of texture coordinates.
pub(super) fn from_uv(steps: Option<&UvSteps>) -> Result<Affine2, Fault> {
    let Some(steps) = steps else {
        return Ok(Affine2::IDENTITY);
    };
    let map = transform::compose_uv(steps)?;
    let [x, y, offset] = [map.matrix3.x_axis, map.matrix3.y_axis, map.translation];
    if [x, y, offset]
        .iter()
        .any(|v| v.abs().max_element() >= transform::LARGEST)
    {
        return Err(Fault::new(
            steps.span(),
            "the numbers of this transform are too large for single precision",
        ));
    }
    let column = |v: DVec3| Vec2::new(v.x as f32, v.y as f32);
    Ok(Affine2::from_cols(column(x), column(y), column(offset)))
}
