//! What of a picture is shown, as colours.

use super::heat;
use beamfarm_image::error::ImageError;
use beamfarm_image::film::Film;
use beamfarm_image::layer::{Layer, distance};
use beamfarm_image::merge::Average;
use beamfarm_image::png::{encode_png, encode_rgb};

/// False colours reach from 2^-8 to 2^8 of what would be white.
const STOPS: f32 = 8.0;

/// How exposed radiance becomes what the screen shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Curve {
    /// sRGB, clamped.
    #[default]
    Standard,
    /// sRGB of what [`filmic`] makes of each channel.
    Filmic,
}

impl Curve {
    /// As addresses name it.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "standard" => Some(Self::Standard),
            "filmic" => Some(Self::Filmic),
            _ => None,
        }
    }
}

/// What to show of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum View {
    /// The radiance, brighter by so many hundredths of a stop.
    Beauty { centistops: i32, curve: Curve },
    /// Its luminance on a logarithmic scale, likewise.
    FalseColour { centistops: i32 },
    /// Where the error is.
    Error,
    /// A layer, by its place among the job's; radiance likewise.
    Layer {
        place: usize,
        centistops: i32,
        curve: Curve,
    },
}

/// The PNG. `layers`: those of the job.
pub(crate) fn encode(average: &Average, layers: &[Layer], view: View) -> Result<Vec<u8>, ImageError> {
    let stops = |centistops: i32| centistops as f32 / 100.0;
    match view {
        View::Beauty { centistops, curve } => encode_radiance(&average.beauty, stops(centistops), curve),
        View::FalseColour { centistops } => false_colour(&average.beauty, stops(centistops)),
        View::Error => heat::encode(average),
        View::Layer {
            place,
            centistops,
            curve,
        } => match (layers.get(place), average.layers.get(place)) {
            (Some(layer), Some(film)) => encode_layer(layer, film, stops(centistops), curve),
            // Nobody is led here.
            _ => encode_radiance(&average.beauty, stops(centistops), curve),
        },
    }
}

fn encode_radiance(film: &Film, stops: f32, curve: Curve) -> Result<Vec<u8>, ImageError> {
    match curve {
        Curve::Standard => encode_png(film, stops),
        Curve::Filmic => {
            let scale = libm::exp2f(stops);
            let mut mapped = film.clone();
            for v in mapped.pixels.as_flattened_mut() {
                *v = filmic(*v * scale);
            }
            encode_png(&mapped, 0.0)
        }
    }
}

/// Hable 2010, "Uncharted 2: HDR Lighting", GDC: a shoulder that rolls lights off, and a toe, as film has them. With
///
/// ```text
/// h(x) = (x (a x + c b) + d e) / (x (a x + b) + d f) - e / f,
/// ```
///
/// this is h(2 x) / h(11.2), and 1 from x = 5.6 on. NaN is black.
fn filmic(exposed: f32) -> f32 {
    const BIAS: f32 = 2.0;
    const WHITE: f32 = 11.2;
    // Strength of the shoulder, strength and angle of the line, strength, numerator and denominator of the toe.
    let [a, b, c, d, e, f] = [0.15, 0.5, 0.1, 0.2, 0.02, 0.3];
    let h = |x: f32| (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f;
    let x = BIAS * exposed;
    if x > 0.0 { h(x.min(WHITE)) / h(WHITE) } else { 0.0 }
}

fn encode_layer(layer: &Layer, film: &Film, stops: f32, curve: Curve) -> Result<Vec<u8>, ImageError> {
    match layer {
        Layer::Normal => {
            let byte = |v: f32| (127.5 + 127.5 * v).clamp(0.0, 255.0) as u8;
            let data: Vec<u8> = film.pixels.as_flattened().iter().map(|v| byte(*v)).collect();
            encode_rgb(film.width, film.height, &data)
        }
        Layer::Albedo => encode_png(film, 0.0),
        // Which have no film, and so none is shown.
        Layer::Objects | Layer::Materials => encode_rgb(film.width, film.height, &vec![0; 3 * film.pixels.len()]),
        Layer::Alpha => encode_grey(film, |pixel| pixel[0]),
        Layer::Depth => {
            let most = film.pixels.iter().filter_map(distance);
            let most = most.fold(0.0, f32::max);
            encode_grey(film, |pixel| distance(pixel).map_or(1.0, |z| z / most))
        }
        // No motion is grey; the largest part of any vector is 0 or 1.
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
        // One number a pixel: against the largest.
        Layer::BeamDensity | Layer::Targets => {
            let most = film.pixels.iter().map(|[v, ..]| *v).fold(0.0, f32::max);
            let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
            encode_grey(film, |pixel| pixel[0] * scale)
        }
        Layer::Direct | Layer::Surface | Layer::Volume | Layer::Light(_) | Layer::Odd => {
            encode_radiance(film, stops, curve)
        }
    }
}

fn encode_grey(film: &Film, value: impl Fn(&[f32; 3]) -> f32) -> Result<Vec<u8>, ImageError> {
    let mut grey = film.clone();
    for pixel in &mut grey.pixels {
        *pixel = [value(pixel).min(1.0); 3];
    }
    encode_png(&grey, 0.0)
}

fn false_colour(film: &Film, stops: f32) -> Result<Vec<u8>, ImageError> {
    let data: Vec<u8> = film
        .pixels
        .iter()
        .flat_map(|[r, g, b]| {
            // Rec. 709.
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

    fn colours(view: View) -> Vec<u8> {
        let average = average(&[[1.0; 3], [0.0; 3]]);
        let png = encode(&average, &[Layer::Depth, Layer::Normal], view).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn each_view_shows_what_it_says() {
        let black = [0, 0, 0];
        let curve = Curve::Standard;
        let beauty = colours(View::Beauty { centistops: 0, curve });
        assert_eq!((&beauty[..3], &beauty[3..]), (&[255; 3][..], &black[..]));
        let depth = colours(View::Layer {
            place: 0,
            centistops: 0,
            curve,
        });
        // Half of the largest, as sRGB.
        assert!((187..=189).contains(&depth[0]) && depth[3..] == [255; 3], "{depth:?}");
        let normal = colours(View::Layer {
            place: 1,
            centistops: 0,
            curve,
        });
        assert_eq!(normal[..3], [255, 127, 0]);
        // White is in the middle of the scale, nothing at its lower end.
        let lights = colours(View::FalseColour { centistops: 0 });
        assert_eq!((&lights[..3], &lights[3..]), (&[125, 124, 120][..], &[0, 34, 78][..]));
    }

    /// Values of the formula in double precision, and what the screen gets of them.
    #[test]
    fn film_rolls_off() {
        for (exposed, expected) in [(0.0, 0.0), (0.18, 0.128_338), (1.0, 0.492_919), (5.6, 1.0)] {
            let found = filmic(exposed);
            assert!((found - expected).abs() < 1e-5, "{exposed}: {found}");
        }
        assert!((1..500).all(|i| filmic(i as f32 * 0.01) > filmic((i - 1) as f32 * 0.01)));
        for black in [f32::NAN, -1.0, f32::NEG_INFINITY] {
            assert!(filmic(black).abs() < 1e-6, "{black}");
        }
        assert!((filmic(f32::INFINITY) - 1.0).abs() < 1e-6);
        let view = |centistops| View::Beauty {
            centistops,
            curve: Curve::Filmic,
        };
        let (plain, brighter) = (colours(view(0)), colours(view(300)));
        assert!((183..=188).contains(&plain[0]), "{plain:?}");
        assert_eq!((&brighter[..3], &brighter[3..]), (&[255; 3][..], &[0; 3][..]));
    }
}
