//! Biases that are known are found again in the average of passes, and nothing is said where nothing is known.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use beamfarm_image::bias::{BIAS_EXPONENTS, Bias, Channel, Finding, RadiusSums};
use beamfarm_image::film::Film;
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_image::radius::radius_scale;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const WIDTH: u32 = 40;
const HEIGHT: u32 = 33;

fn film(value: f32) -> Film {
    let mut film = Film::new(WIDTH, HEIGHT);
    film.pixels.fill([value, 2.0 * value, 3.0 * value]);
    film
}

fn average(films: impl Iterator<Item = (Film, f64)>) -> Average {
    let mut sum: Option<TreeSum> = None;
    for ((film, scale), pass) in films.zip(0u64..) {
        let sum = sum.get_or_insert_with(|| TreeSum::new(film.width, film.height));
        sum.insert(Node::leaf(pass, film).with_radius_scale(scale)).unwrap();
    }
    sum.unwrap().average().unwrap()
}

/// Of passes that are grey and alike everywhere.
fn bias(values: &[f32], alpha: f64) -> Bias {
    let scales = (1..).map(|n| radius_scale(f64::from(n), alpha));
    let films = values.iter().map(|value| film(*value));
    average(films.zip(scales)).bias.unwrap()
}

#[test]
fn each_exponent_is_extrapolated_exactly() {
    let r = |i: usize| radius_scale((i + 1) as f64, 0.5);
    for (e, exponent) in BIAS_EXPONENTS.into_iter().enumerate() {
        let term = |i: usize| 0.5 * libm::pow(r(i), exponent);
        let values: Vec<f32> = (0..33).map(|i| (3.0 - term(i)) as f32).collect();
        let bias = bias(&values, 0.5);
        let expected = -2.0 * (0..33).map(term).sum::<f64>() / 33.0;
        assert_eq!(bias.tiles.len(), 4);
        for part in bias.tiles.iter().chain([&bias.image]) {
            let estimate = part.mean();
            let fit = estimate.fits[e];
            assert!((fit.bias - expected).abs() < 1e-5, "{exponent}: {part:?}");
            assert!((estimate.mean - fit.bias - 6.0).abs() < 1e-5, "{part:?}");
            // The mean over exponents knows which one it is, or says how much they differ.
            let off = (estimate.bias - expected).abs();
            assert!(off < 3.0 * estimate.standard_error, "{exponent}: {part:?}");
            assert_eq!(part.finding, Finding::Biased);
        }
        let at: Vec<_> = bias.tiles.iter().map(|tile| (tile.x, tile.y)).collect();
        assert_eq!(at, [(0, 0), (32, 0), (0, 32), (32, 32)]);
    }
}

#[test]
fn sums_survive_as_bytes() {
    let mut sums = RadiusSums::leaf(&film(0.3), 0.7);
    sums.join(&RadiusSums::leaf(&film(0.4), 0.6), true);
    let bytes = sums.to_bytes();
    assert_eq!(bytes.len(), RadiusSums::byte_count(WIDTH, HEIGHT));
    let again = RadiusSums::from_bytes(&bytes).unwrap();
    assert_eq!(again, sums);
    assert!(again.is_sound(WIDTH, HEIGHT) && !again.is_sound(WIDTH, 65));
    for cut in [1, 8, 64] {
        assert_eq!(RadiusSums::from_bytes(&bytes[cut..]), None);
    }
}

#[test]
fn it_says_when_it_knows_nothing() {
    // Noise that alternates: no trend.
    let noise = |size: f32, count: usize| -> Vec<f32> {
        let sign = |i: usize| {
            if (i / 2 + i).is_multiple_of(2) { 1.0 } else { -1.0 }
        };
        (0..count).map(|i| 1.0 + size * sign(i)).collect()
    };
    let text = |values: &[f32]| {
        let bias = bias(values, 0.5);
        (bias.to_string(), bias.named().len())
    };
    let few = text(&noise(0.01, 15));
    assert_eq!(few, ("bias not known: fewer than 16 passes".into(), 0));
    // All pixels have the same noise, so the image has as much as one of them.
    let wild = text(&noise(5.0, 16));
    assert!(
        wild.0
            .starts_with("bias of the mean radiance: unknown; noise would hide one below ")
            && wild.1 == 0,
        "{wild:?}"
    );
    let mut trend = noise(0.01, 64);
    for (i, value) in trend.iter_mut().enumerate() {
        *value += (1.0 - 0.5 * radius_scale((i + 1) as f64, 0.5)) as f32;
    }
    let trend = bias(&trend, 0.5);
    assert!(trend.to_string().starts_with("bias of the mean radiance: -"), "{trend}");
    let tiles = trend.tiles_in_words().unwrap();
    assert!(
        tiles.starts_with("bias by tiles of 32 x 32 pixels: found in 4 of 4; worst -"),
        "{tiles}"
    );
    assert!(tiles.ends_with(" at (0, 32)"), "{tiles}");
    let black = text(&[0.0; 20]);
    assert_eq!(black, ("bias not known: the image is black".into(), 0));
    let same = average((0..32).map(|i| (film(1.0 + 0.01 * (i % 3) as f32), 0.5)));
    assert_eq!(
        same.bias.as_ref().unwrap().to_string(),
        "bias not known: all passes have the same radii"
    );
    assert_eq!(same.bias.unwrap().tiles_in_words(), None);
    let one = bias(&[1.0], 0.5);
    assert_eq!(one.image.mean().standard_error, f64::INFINITY);
}

#[test]
fn one_channel_is_seen_alone() {
    let mut rng = Pcg64Mcg::seed_from_u64(0);
    let films = (0..64u64).map(|i| {
        let r = radius_scale((i + 1) as f64, 0.5);
        let mut film = Film::new(64, 32);
        for (pixel, n) in film.pixels.iter_mut().zip(0u64..) {
            *pixel = [(); 3].map(|()| 0.9 + 0.2 * (rng.next_u32() as f32 / u32::MAX as f32));
            if n % 64 >= 32 {
                pixel[2] -= 0.02 * r as f32;
            }
        }
        (film, r)
    });
    let bias = average(films).bias.unwrap();
    let findings: Vec<_> = bias.tiles.iter().map(|tile| tile.finding).collect();
    assert_eq!(findings, [Finding::NotSeen, Finding::Biased]);
    assert_eq!(bias.tiles[1].clearest().0, Channel::Blue);
    let text = bias.tiles_in_words().unwrap();
    assert!(text.contains("1 of 2; worst blue -"), "{text}");
}
