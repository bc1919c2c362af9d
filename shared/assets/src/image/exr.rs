//! OpenEXR: the display window of one layer.

use super::exr_layers::{Colour, Part, choose, layers};
use super::{check_claim, pixel_count};
use crate::Flaw;
use ::exr::prelude::{self as exr, ReadChannels, ReadLayers};
use beamfarm_image::exr::{check_claims, headers, not_read, without_panic};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::texture::Image;
use std::io::Cursor;

/// The most pixels around a small data window, which need no bytes in the file: 4096 x 4096.
const MAX_AROUND: usize = 1 << 24;

/// The image within the display window, black outside the data window, and a note. `layer`: the layer's name.
pub fn read(bytes: &[u8], layer: Option<&str>) -> Result<(Image, Option<String>), Flaw> {
    let message = |e: String| Flaw::from(format!("not a sound OpenEXR image: {e}"));
    if let Some(refusal) = not_read(bytes) {
        return Err(refusal.into());
    }
    check_claims(bytes, true).map_err(message)?;
    let headers = headers(bytes).map_err(message)?;
    let parts: Vec<Part> = headers.iter().map(Part::new).collect();
    let layers = layers(&parts);
    let (layer, note) = choose(&layers, layer)?;
    let header = headers
        .get(layer.part)
        .ok_or_else(|| message("a part is missing".into()))?;
    let mut channels = headers.iter().flat_map(|header| &header.channels.list);
    if channels.any(|channel| channel.sampling != exr::Vec2(1, 1)) {
        return Err(
            "its channels of colour have fewer pixels than its luminance, which is not read; convert it to RGB, \
                    for example by `magick in.exr out.exr`, or open it in Blender and save it as OpenEXR"
                .into(),
        );
    }
    let window = header.shared_attributes.display_window;
    let (width, height) = (window.size.width(), window.size.height());
    let count = pixel_count(width, height)?;
    if count > MAX_AROUND {
        check_claim(count, bytes)?;
    }
    let decode = || {
        exr::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .pedantic()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(|e| e.to_string())
    };
    let image = without_panic(decode).map_err(message)?;
    let part = image.layer_data.get(layer.part);
    let part = part.ok_or_else(|| message("a part is missing".into()))?;
    let names = &parts[layer.part].channels;
    let channel = |i: usize| {
        let found = part
            .channel_data
            .list
            .iter()
            .find(|c| names.get(i).is_some_and(|name| c.name.eq(name)));
        found.ok_or_else(|| message("a channel is missing".into()))
    };
    let value = |c: &exr::AnyChannel<exr::FlatSamples>, i| c.sample_data.value_by_flat_index(i).to_f32();
    let (picked, weights) = match layer.colour {
        Colour::Rgb([r, g, b]) => ([channel(r)?, channel(g)?, channel(b)?], None),
        Colour::Chroma { y, ry, by } => {
            let weights = luminance_weights(image.attributes.chromaticities.as_ref());
            ([channel(y)?, channel(ry)?, channel(by)?], Some(weights))
        }
    };
    let pixel = |i: usize| {
        let found = picked.map(|c| value(c, i));
        Rgb::from_array(weights.map_or(found, |weights| rgb_of_chroma(found, weights)))
    };
    // Offset of the display window within the data.
    let start = |display: i32, data: i32| i64::from(display) - i64::from(data);
    let at = part.attributes.layer_position;
    let [left, top] = [start(window.position.0, at.0), start(window.position.1, at.1)];
    let (columns, rows) = (part.size.width(), part.size.height());
    let within = |from: i64, i: usize, size: usize| usize::try_from(from + i as i64).ok().filter(|i| *i < size);
    let row = |y: usize| {
        let row = within(top, y, rows).map(|row| row * columns);
        (0..width).map(move |x| match (row, within(left, x, columns)) {
            (Some(row), Some(column)) => pixel(row + column),
            _ => Rgb::ZERO,
        })
    };
    let image = Image {
        alpha: Vec::new(),
        width: width as u32,
        height: height as u32,
        pixels: (0..height).flat_map(row).collect(),
    };
    Ok((image, note))
}

/// Luminance weights of red, green and blue for these primaries, or for those of Rec. 709.
fn luminance_weights(primaries: Option<&exr::attribute::Chromaticities>) -> [f32; 3] {
    const REC_709: [f32; 3] = [0.2126, 0.7152, 0.0722];
    let Some(given) = primaries else { return REC_709 };
    let xyz = |c: exr::Vec2<f32>| {
        let (x, y) = (f64::from(c.0), f64::from(c.1));
        glam::DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
    };
    let of_primaries = glam::DMat3::from_cols(xyz(given.red), xyz(given.green), xyz(given.blue));
    let weights = of_primaries.inverse() * xyz(given.white);
    match weights.is_finite() && weights.min_element() > 0.0 {
        true => weights.to_array().map(|w| w as f32),
        false => REC_709,
    }
}

/// RGB from Y, (R - Y) / Y and (B - Y) / Y.
fn rgb_of_chroma([y, ry, by]: [f32; 3], weights: [f32; 3]) -> [f32; 3] {
    let (r, b) = ((ry + 1.0) * y, (by + 1.0) * y);
    [r, (y - r * weights[0] - b * weights[2]) / weights[1], b]
}

#[cfg(test)]
pub mod tests;
