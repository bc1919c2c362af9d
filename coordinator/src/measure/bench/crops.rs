//! Crops of the images side by side, unscaled, with error maps.

use super::record::SceneFindings;
use crate::failure::Failure;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use beamfarm_image::film::Film;
use beamfarm_image::png::encode_png;
use beamfarm_image::view::View;

/// The same crop of all images.
pub struct Row {
    pub name: String,
    pub pictures: Vec<Picture>,
}

pub struct Picture {
    pub caption: String,
    /// A PNG as a data URI.
    pub source: String,
    pub width: u32,
    pub height: u32,
}

/// Side of a crop, pixels.
const SIDE: u32 = 176;
/// Relative error at the ends of the map's colour scale.
pub const SCALE: f32 = 0.5;

/// The crops of a scene: the requested ones, or the centre and the place where the first run's last image differs most.
pub fn rows(scene: &SceneFindings) -> Result<Vec<Row>, Failure> {
    let Some(first) = scene.runs.first() else {
        return Ok(Vec::new());
    };
    // Without a reference, configurations may differ in size.
    let size = [first.settings.width, first.settings.height];
    let mut corners = scene.crops.clone();
    if corners.is_empty() {
        corners.push(size.map(|side| side.saturating_sub(SIDE) / 2));
        let last = first.images.last();
        if let (Some(reference), Some((_, image))) = (&scene.reference, last) {
            corners.extend(worst(image, &reference.image, corners[0]));
        }
    }
    // Keep the crop within the image, and reduce it for small images, the same for all.
    let side = size.map(|side| side.min(SIDE));
    for at in &mut corners {
        *at = [0, 1].map(|i| at[i].min(size[i] - side[i]));
    }
    corners.dedup();
    let row = |at: &[u32; 2]| row(scene, size, side, *at);
    corners.iter().map(row).collect()
}

fn row(scene: &SceneFindings, size: [u32; 2], side: [u32; 2], at: [u32; 2]) -> Result<Row, Failure> {
    let cut = |image: &Film| crop(image, at, side);
    let mut pictures = Vec::new();
    let mut add = |caption: String, film: &Film, view: View| -> Result<(), Failure> {
        let bytes = encode_png(film, view)?;
        pictures.push(Picture {
            caption,
            source: format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes)),
            width: film.width,
            height: film.height,
        });
        Ok(())
    };
    for (i, run) in scene.runs.iter().enumerate() {
        // All steps of the first run, and the last of the others.
        let from = if i == 0 { 0 } else { run.images.len().saturating_sub(1) };
        for (passes, image) in &run.images[from..] {
            if [image.width, image.height] == size {
                let plural = if *passes == 1 { "" } else { "es" };
                let caption = format!("{}, {passes} pass{plural}", run.name);
                add(caption, &cut(image), scene.view)?;
            }
        }
    }
    for peer in &scene.peers {
        if let Some((image, _)) = &peer.image {
            add(peer.name.clone(), &cut(image), scene.view)?;
        }
    }
    if let Some(reference) = &scene.reference {
        let truth = cut(&reference.image);
        add("reference".into(), &truth, scene.view)?;
        let lasts = scene.runs.iter().filter_map(|run| {
            let (_, image) = run.images.last()?;
            Some((run.name.as_str(), image))
        });
        let others = scene
            .peers
            .iter()
            .filter_map(|peer| Some((peer.name.as_str(), &peer.image.as_ref()?.0)));
        for (name, image) in lasts.chain(others) {
            let map = error_map(&cut(image), &truth);
            add(format!("relative error of {name}"), &map, View::default())?;
        }
    }
    Ok(Row {
        name: format!("{} x {} pixels from ({}, {})", side[0], side[1], at[0], at[1]),
        pictures,
    })
}

fn crop(image: &Film, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> Film {
    let rows = image.pixels.chunks(image.width.max(1) as usize);
    let rows = rows.skip(y as usize).take(height as usize);
    Film {
        width,
        height,
        pixels: rows
            .flat_map(|row| &row[x as usize..(x + width) as usize])
            .copied()
            .collect(),
    }
}

/// Of the adjacent crops that cover the image and overlap little with `shown`, the one with the largest relMSE.
fn worst(image: &Film, reference: &Film, shown: [u32; 2]) -> Option<[u32; 2]> {
    let side = [image.width.min(SIDE), image.height.min(SIDE)];
    let columns = (0..image.width / side[0].max(1)).map(|i| i * side[0]);
    let corners = columns.flat_map(|x| (0..image.height / side[1].max(1)).map(move |i| [x, i * side[1]]));
    let error = |at: [u32; 2]| {
        let (image, reference) = (crop(image, at, side), crop(reference, at, side));
        let pairs = image.pixels.iter().flatten().zip(reference.pixels.iter().flatten());
        pairs
            .map(|(x, r)| f64::from((x - r) * (x - r) / (r * r + 0.01)))
            .sum::<f64>()
    };
    let new = |at: &[u32; 2]| (0..2).any(|i| at[i].abs_diff(shown[i]) > side[i] / 2);
    corners
        .filter(new)
        .map(|at| (at, error(at)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(at, _)| at)
}

/// Blue where the image is darker than the reference, red where it is brighter, white where they agree. The error is
/// that of the sum of the channels.
fn error_map(image: &Film, reference: &Film) -> Film {
    let mut map = Film::new(image.width, image.height);
    let pairs = image.pixels.iter().zip(&reference.pixels);
    for (out, (x, r)) in map.pixels.iter_mut().zip(pairs) {
        let (x, r) = (x.iter().sum::<f32>() / 3.0, r.iter().sum::<f32>() / 3.0);
        let relative = (x - r) / (r * r + 0.01).sqrt();
        *out = diverging(relative / SCALE);
    }
    map
}

/// Linear RGB of a number between -1 and 1.
fn diverging(v: f32) -> [f32; 3] {
    const WHITE: [f32; 3] = [0.92, 0.92, 0.92];
    let end: [f32; 3] = if v < 0.0 {
        [0.01, 0.10, 0.45]
    } else {
        [0.55, 0.04, 0.02]
    };
    let weight = v.abs().min(1.0);
    std::array::from_fn(|c| WHITE[c] + (end[c] - WHITE[c]) * weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(width: u32, height: u32) -> Film {
        let mut film = Film::new(width, height);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            *pixel = [i as f32; 3];
        }
        film
    }

    #[test]
    fn crops_are_cut_where_they_should() {
        let film = crop(&counted(5, 4), [1, 2], [3, 2]);
        let values: Vec<f32> = film.pixels.iter().map(|pixel| pixel[0]).collect();
        assert_eq!(values, [11.0, 12.0, 13.0, 16.0, 17.0, 18.0]);
        assert_eq!((film.width, film.height), (3, 2));
    }

    #[test]
    fn the_worst_part_is_found() {
        let reference = Film::new(2 * SIDE + 5, SIDE);
        let mut image = reference.clone();
        image.pixels[SIDE as usize + 3] = [1.0; 3];
        assert_eq!(worst(&image, &reference, [0, 0]), Some([SIDE, 0]));
        assert_eq!(worst(&image, &reference, [SIDE + 5, 0]), Some([0, 0]));
        assert_eq!(worst(&counted(3, 2), &counted(3, 2), [0, 0]), None);
    }

    #[test]
    fn errors_have_a_sign() {
        let [low, none, high] = [-2.0, 0.0, 1.0].map(diverging);
        assert!(low[2] > low[0] && high[0] > high[2] && none[0] == none[2]);
    }
}
