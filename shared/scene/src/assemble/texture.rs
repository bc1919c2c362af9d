//! Textures.

use super::kept::{Kept, Pinned};
use super::{Assets, Problem, asset_problem};
use crate::assets::image::Encoding;
use crate::parse::{Fault, ImageTextureRecord, TextureRecord, UvSteps};
use crate::transform;
use crate::values::Range;
use beamfarm_render::math::Vec2;
use beamfarm_render::texture::Texture;
use glam::{Affine2, DVec3};

/// The texture of a record; its pixels are within the range of the record's colours.
pub fn texture<R: Range>(record: &TextureRecord<R>, assets: &mut Assets<'_>) -> Result<Texture, Problem> {
    match record {
        TextureRecord::Color(color) => Ok(Texture::Constant(color.rgb())),
        TextureRecord::Image(record) => image::<R>(record, assets),
        TextureRecord::Checkerboard { colors, uv } => Ok(Texture::Checkerboard {
            colors: [colors[0].rgb(), colors[1].rgb()],
            squares_from_uv: from_uv(uv.as_ref())?,
        }),
    }
}

/// An image, its pixels within a range.
pub fn image<R: Range>(record: &ImageTextureRecord, assets: &mut Assets<'_>) -> Result<Texture, Problem> {
    let encoding = match record.raw {
        true => Encoding::Raw,
        false => Encoding::Srgb,
    };
    let image = assets.image(&record.file, encoding)?;
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
        Err(asset_problem(&record.file, flaw))
    })?;
    Ok(Texture::Image {
        image,
        filter: record.filter.into(),
        wrap: record.wrap.into(),
        image_from_uv: from_uv(record.uv.as_ref())?,
    })
}

/// The transform of texture coordinates.
fn from_uv(steps: Option<&UvSteps>) -> Result<Affine2, Fault> {
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
