//! What is shown of a picture, as colours.

use super::heat;
use beamfarm_image::error::ImageError;
use beamfarm_image::film::Film;
use beamfarm_image::layer::{Layer, distance};
use beamfarm_image::merge::Average;
use beamfarm_image::png::{encode_png, encode_rgb};
use beamfarm_image::view::View;

/// False colours span 2^-8 to 2^8 times the radiance that would be white.
const STOPS: f32 = 8.0;

/// What to show of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shown {
    /// The radiance.
    Beauty(View),
    /// Luminance on a logarithmic scale, brightened by `exposure` stops.
    FalseColour { exposure: f32 },
    /// The error map.
    Error,
    /// A layer, by its index among the job's; `view` is that of radiance.
    Layer { place: usize, view: View },
}

/// The picture as PNG. `layers`: those of the job.
pub(crate) fn encode(average: &Average, layers: &[Layer], shown: Shown) -> Result<Vec<u8>, ImageError> {
    match shown {
        Shown::Beauty(view) => encode_png(&average.beauty, view),
        Shown::FalseColour { exposure } => false_colour(&average.beauty, exposure),
        Shown::Error => heat::encode(average),
        Shown::Layer { place, view } => match (layers.get(place), average.layers.get(place)) {
            (Some(layer), Some(film)) => encode_layer(layer, film, view),
            // Unreachable from the page.
            _ => encode_png(&average.beauty, view),
        },
    }
}

fn encode_layer(layer: &Layer, film: &Film, view: View) -> Result<Vec<u8>, ImageError> {
    match layer {
        Layer::Normal => {
            let byte = |v: f32| (127.5 + 127.5 * v).clamp(0.0, 255.0) as u8;
            let data: Vec<u8> = film.pixels.as_flattened().iter().map(|v| byte(*v)).collect();
            encode_rgb(film.width, film.height, &data)
        }
        Layer::Albedo => encode_png(film, View::default()),
        // They have no film, so none is shown.
        Layer::Objects | Layer::Materials => encode_rgb(film.width, film.height, &vec![0; 3 * film.pixels.len()]),
        Layer::Alpha => encode_grey(film, |pixel| pixel[0]),
        Layer::Depth => {
            let most = film.pixels.iter().filter_map(distance);
            let most = most.fold(0.0, f32::max);
            encode_grey(film, |pixel| distance(pixel).map_or(1.0, |z| z / most))
        }
        // Zero motion is grey; the largest component of any vector maps to 0 or 1.
        Layer::Motion => {
            let most = film
                .pixels
                .iter()
                .flatten()
                .fold(0.0, |most: f32, part| most.max(part.abs()));
            let scale = if most > 0.0 { 127.5 / most } else { 0.0 };
            let byte = |v: f32| (127.5 + scale * v).clamp(0.0, 255.0) as u8;
            let data: Vec<u8> = film.pixels.as_flattened().iter().map(|v| byte(*v)).collect();
            encode_rgb(film.width, film.height, &data)
        }
        // One number per pixel, relative to the largest.
        Layer::BeamDensity | Layer::Targets => {
            let most = film.pixels.iter().map(|[v, ..]| *v).fold(0.0, f32::max);
            let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
            encode_grey(film, |pixel| pixel[0] * scale)
        }
        Layer::Direct | Layer::Surface | Layer::Volume | Layer::Light(_) | Layer::Odd => encode_png(film, view),
    }
}

fn encode_grey(film: &Film, value: impl Fn(&[f32; 3]) -> f32) -> Result<Vec<u8>, ImageError> {
    let mut grey = film.clone();
    for pixel in &mut grey.pixels {
        *pixel = [value(pixel).min(1.0); 3];
    }
    encode_png(&grey, View::default())
}

fn false_colour(film: &Film, stops: f32) -> Result<Vec<u8>, ImageError> {
    let data: Vec<u8> = film
        .pixels
        .iter()
        .flat_map(|[r, g, b]| {
            // Rec. 709 luminance.
            let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            let position = (libm::log2f(luminance.max(0.0)) + stops + STOPS) / (2.0 * STOPS);
            heat::along(f64::from(position))
        })
        .collect();
    encode_rgb(film.width, film.height, &data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::merge::{Node, TreeSum};
    use beamfarm_image::view::ViewTransform;

    fn average(pixels: &[[f32; 3]]) -> Average {
        let film = |values: &[[f32; 3]]| {
            let mut film = Film::new(values.len() as u32, 1);
            film.pixels.copy_from_slice(values);
            film
        };
        let mut sum = TreeSum::new(pixels.len() as u32, 1).with_layers(2);
        let layers = vec![film(&[[2.0, 1.0, 0.0], [4.0, 1.0, 0.0]]), film(&[[1.0, 0.0, -1.0]; 2])];
        sum.insert(Node::leaf(0, film(pixels)).with_layers(layers)).unwrap();
        sum.average().unwrap()
    }

    fn colours(shown: Shown) -> Vec<u8> {
        let average = average(&[[1.0; 3], [0.0; 3]]);
        let png = encode(&average, &[Layer::Depth, Layer::Normal], shown).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn each_view_shows_what_it_says() {
        let black = [0, 0, 0];
        let view = View::default();
        let beauty = colours(Shown::Beauty(view));
        assert_eq!((&beauty[..3], &beauty[3..]), (&[255; 3][..], &black[..]));
        let depth = colours(Shown::Layer { place: 0, view });
        // Half of the largest, as sRGB.
        assert!((187..=189).contains(&depth[0]) && depth[3..] == [255; 3], "{depth:?}");
        let normal = colours(Shown::Layer { place: 1, view });
        assert_eq!(normal[..3], [255, 127, 0]);
        // White is in the middle of the scale, zero at its lower end.
        let lights = colours(Shown::FalseColour { exposure: 0.0 });
        assert_eq!((&lights[..3], &lights[3..]), (&[125, 124, 120][..], &[0, 34, 78][..]));
    }

    /// Display values of the curve.
    #[test]
    fn film_rolls_off() {
        let shown = |exposure| {
            Shown::Beauty(View {
                transform: ViewTransform::Filmic,
                ..View::exposed(exposure)
            })
        };
        let (plain, brighter) = (colours(shown(0.0)), colours(shown(3.0)));
        assert!((183..=188).contains(&plain[0]), "{plain:?}");
        assert_eq!((&brighter[..3], &brighter[3..]), (&[255; 3][..], &[0; 3][..]));
    }
}
