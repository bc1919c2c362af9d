//! The relative error of each pixel as colours from dark blue through grey to yellow. The scale also reads for people
//! with red-green or full colour blindness.

use beamfarm_image::error::ImageError;
use beamfarm_image::merge::Average;
use beamfarm_image::png::encode_rgb;

/// The ends of the scale: relative standard errors of 0.1 % and 100 %, as powers of ten.
const LOW: f64 = -3.0;
const HIGH: f64 = 0.0;
/// Nuñez, Anderton, Renslow 2018, "Optimizing colormaps with consideration for color vision deficiency": cividis, at
/// equal steps, sRGB.
const CIVIDIS: [[u8; 3]; 9] = [
    [0, 34, 78],
    [26, 56, 111],
    [66, 78, 108],
    [96, 101, 111],
    [125, 124, 120],
    [156, 149, 118],
    [190, 175, 109],
    [224, 203, 91],
    [254, 232, 56],
];

/// The error map as PNG.
pub(crate) fn encode(average: &Average) -> Result<Vec<u8>, ImageError> {
    let data: Vec<u8> = average
        .squared_errors()
        .into_iter()
        .flat_map(|square| colour(square.sqrt()))
        .collect();
    encode_rgb(average.beauty.width, average.beauty.height, &data)
}

/// The colour of a relative standard error.
pub(crate) fn colour(error: f64) -> [u8; 3] {
    // Zero error, in the black around a scene, maps to the lower end; infinite error to the upper end.
    along((libm::log10(error.max(0.0)) - LOW) / (HIGH - LOW))
}

/// The colour at a position on the scale, from 0 to 1.
pub(super) fn along(position: f64) -> [u8; 3] {
    let position = position.clamp(0.0, 1.0) * (CIVIDIS.len() - 1) as f64;
    let below = (position as usize).min(CIVIDIS.len() - 2);
    let share = position - below as f64;
    std::array::from_fn(|c| {
        let (low, high) = (CIVIDIS[below][c], CIVIDIS[below + 1][c]);
        (f64::from(low) + share * (f64::from(high) - f64::from(low)) + 0.5) as u8
    })
}

/// The scale as colours with positions between 0 and 320.
pub(crate) fn scale() -> Vec<(String, u32)> {
    let step = |i: u32| {
        let exponent = LOW + (HIGH - LOW) * (f64::from(i) + 0.5) / 64.0;
        let [r, g, b] = colour(libm::exp10(exponent));
        (format!("#{r:02x}{g:02x}{b:02x}"), 5 * i)
    };
    (0..64).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::film::Film;
    use beamfarm_image::merge::{Node, TreeSum};

    #[test]
    fn the_map_is_the_error_of_the_picture() {
        let mut sum = TreeSum::new(19, 11);
        for pass in 0..4u64 {
            let mut film = Film::new(19, 11);
            for (i, pixel) in film.pixels.iter_mut().enumerate() {
                let v = (i as u64 * 7 + pass * pass * 13) % 31;
                *pixel = [v as f32, 2.0 + v as f32 * 0.1, (v % 3) as f32];
            }
            sum.insert(Node::leaf(pass, film)).unwrap();
        }
        let average = sum.average().unwrap();
        let squares = average.squared_errors();
        let mean = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let expected = average.relative_standard_error();
        assert!((mean / expected - 1.0).abs() < 1e-12, "{mean} {expected}");
        assert!(encode(&average).unwrap().starts_with(b"\x89PNG"));
    }

    /// Rec. 601 luma rises monotonically, so that the scale reads without colour.
    #[test]
    fn brighter_is_worse() {
        let luma = |error: f64| {
            let [r, g, b] = colour(error).map(f64::from);
            0.299 * r + 0.587 * g + 0.114 * b
        };
        let errors: Vec<f64> = (0..=60).map(|i| libm::exp10(LOW + f64::from(i) * 0.05)).collect();
        assert!(errors.windows(2).all(|w| luma(w[0]) < luma(w[1])));
        assert_eq!(colour(0.0), CIVIDIS[0]);
        assert_eq!(colour(1e-9), CIVIDIS[0]);
        assert_eq!(colour(f64::INFINITY), CIVIDIS[8]);
        assert_eq!(colour(f64::NAN), CIVIDIS[0]);
    }

    #[test]
    fn one_pass_knows_no_error() {
        let mut sum = TreeSum::new(2, 1);
        sum.insert(Node::leaf(0, Film::new(2, 1))).unwrap();
        let average = sum.average().unwrap();
        assert!(average.squared_errors().iter().all(|square| *square == f64::INFINITY));
    }
}
