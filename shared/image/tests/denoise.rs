//! Denoised pictures of made-up noise, whose truth is known.

#![allow(clippy::unwrap_used)]

use beamfarm_image::denoise::{DenoiseError, Input, denoise};
use beamfarm_image::film::Film;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const WIDTH: u32 = 96;
const HEIGHT: u32 = 80;

/// A picture, and two halves of it with noise.
struct Noisy {
    truth: Film,
    albedo: Film,
    even: Film,
    odd: Film,
}

fn film(value: impl Fn(u32, u32) -> f32) -> Film {
    let mut film = Film::new(WIDTH, HEIGHT);
    for (i, pixel) in film.pixels.iter_mut().enumerate() {
        *pixel = [value(i as u32 % WIDTH, i as u32 / WIDTH); 3];
    }
    film
}

/// About a standard normal number: the sum of twelve even ones.
fn normal(rng: &mut Pcg64Mcg) -> f32 {
    let even = |rng: &mut Pcg64Mcg| (rng.next_u64() >> 40) as f32 / (1u64 << 24) as f32;
    (0..12).map(|_| even(rng)).sum::<f32>() - 6.0
}

impl Noisy {
    /// `error`: of each half, by radiance. `blur`: radius of the squares that noise is alike in.
    fn new(truth: Film, albedo: Film, error: impl Fn(f32) -> f32, blur: u32, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut half = || {
            let white: Vec<f32> = truth.pixels.iter().map(|_| normal(&mut rng)).collect();
            let mut half = truth.clone();
            for (i, pixel) in half.pixels.iter_mut().enumerate() {
                let (x, y) = (i as u32 % WIDTH, i as u32 / WIDTH);
                let columns = x.saturating_sub(blur)..WIDTH.min(x + blur + 1);
                let rows = y.saturating_sub(blur)..HEIGHT.min(y + blur + 1);
                let count = (columns.len() * rows.len()) as f32;
                let sum: f32 = rows
                    .flat_map(|y| columns.clone().map(move |x| (y * WIDTH + x) as usize))
                    .map(|i| white[i])
                    .sum();
                *pixel = pixel.map(|value| value + error(value) * sum / count.sqrt());
            }
            half
        };
        let (even, odd) = (half(), half());
        Self {
            truth,
            albedo,
            even,
            odd,
        }
    }

    fn beauty(&self) -> Film {
        let mut beauty = self.even.clone();
        for (pixel, odd) in beauty.pixels.iter_mut().zip(&self.odd.pixels) {
            *pixel = std::array::from_fn(|c| 0.5 * (pixel[c] + odd[c]));
        }
        beauty
    }

    fn denoised(&self) -> Film {
        let mut odd = self.odd.clone();
        odd.pixels.iter_mut().flatten().for_each(|value| *value *= 0.5);
        let input = Input {
            passes: 8,
            beauty: &self.beauty(),
            odd: &odd,
            albedo: &self.albedo,
            normal: &film(|_, _| 0.5),
            depth: &vec![3.0; (WIDTH * HEIGHT) as usize],
        };
        denoise(&input).unwrap()
    }

    /// Mean squared errors of the denoised picture and of the plain one.
    fn errors(&self) -> [f64; 2] {
        [self.denoised(), self.beauty()].map(|film| error(&film, &self.truth))
    }
}

fn error(film: &Film, truth: &Film) -> f64 {
    let both = film.pixels.as_flattened().iter().zip(truth.pixels.as_flattened());
    let squares = both.map(|(a, b)| f64::from(a - b) * f64::from(a - b));
    squares.sum::<f64>() / (3 * film.pixels.len()) as f64
}

/// The mean over pixels that `is_in` says.
fn mean(film: &Film, is_in: impl Fn(u32, u32) -> bool) -> f64 {
    let place = |i: usize| (i as u32 % WIDTH, i as u32 / WIDTH);
    let inside = film.pixels.iter().enumerate().filter(|(i, _)| {
        let (x, y) = place(*i);
        is_in(x, y)
    });
    let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), (_, pixel)| {
        (sum + f64::from(pixel[1]), count + 1.0)
    });
    sum / count
}

/// The mean of all pixels has the error 0.2 / sqrt(2 * 7680) = 0.0016: five of them. White noise, and noise that is
/// alike in 5 x 5 pixels.
#[test]
fn a_constant_picture_comes_out_smooth_and_unbiased() {
    for (blur, share) in [(0, 0.1), (2, 0.5)] {
        let noisy = Noisy::new(film(|_, _| 1.0), film(|_, _| 0.5), |v| 0.2 * v, blur, 1);
        let [denoised, plain] = noisy.errors();
        assert!(denoised < share * plain, "blur {blur}: {denoised} of {plain}");
        let [mean_of_plain, mean] = [noisy.beauty(), noisy.denoised()].map(|film| mean(&film, |_, _| true));
        assert!((mean - mean_of_plain).abs() < 5.0 * 0.0016, "{mean}, {mean_of_plain}");
    }
}

/// Skewed noise, as of random walks through media or of sparse photons: in each half, one pixel in eight has all the
/// light. The filters alone lose a seventh of it. The result keeps the light of the noisy picture within 2 %, and what
/// is black stays black.
#[test]
fn skewed_noise_keeps_its_light() {
    let is_lit = |x: u32, _: u32| x < 60;
    let truth = film(|x, y| if is_lit(x, y) { 1.0 } else { 0.0 });
    let mut noisy = Noisy::new(truth, film(|_, _| 0.5), |_| 0.0, 0, 9);
    let mut rng = Pcg64Mcg::seed_from_u64(10);
    for half in [&mut noisy.even, &mut noisy.odd] {
        for pixel in &mut half.pixels {
            let factor = if rng.next_u64().is_multiple_of(8) { 8.0 } else { 0.0 };
            *pixel = pixel.map(|value| value * factor);
        }
    }
    let [denoised, plain] = noisy.errors();
    assert!(denoised < 0.1 * plain, "{denoised} of {plain}");
    let (denoised, plain) = (noisy.denoised(), noisy.beauty());
    let ratio = mean(&denoised, is_lit) / mean(&plain, is_lit);
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    assert!(mean(&denoised, |x, _| x > 72) < 1e-3);
}

/// A firefly is in one half only. Its light does not come back.
#[test]
fn a_firefly_is_gone() {
    let mut noisy = Noisy::new(film(|_, _| 1.0), film(|_, _| 0.5), |v| 0.2 * v, 0, 11);
    noisy.even.pixels[(40 * WIDTH + 48) as usize] = [3000.0; 3];
    let denoised = noisy.denoised();
    let around = |x: u32, y: u32| x.abs_diff(48) < 16 && y.abs_diff(40) < 16;
    let ratio = mean(&denoised, around);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
}

/// Tiles of albedo 0.2 and 0.7, lit evenly, as noisy as they differ: both keep their radiance, up to the last pixel.
#[test]
fn an_edge_of_albedo_is_kept() {
    let tiles = |x: u32, y: u32| if (x / 8 + y / 8).is_multiple_of(2) { 0.2 } else { 0.7 };
    let noisy = Noisy::new(film(tiles), film(tiles), |v| 0.5 * v, 0, 2);
    let [denoised, plain] = noisy.errors();
    assert!(denoised < 0.1 * plain, "{denoised} of {plain}");
    let denoised = noisy.denoised();
    let at_edge = |x: u32, y: u32| x % 8 == 7 && (1..7).contains(&(y % 8));
    for dark in [true, false] {
        let mean = mean(&denoised, |x, y| at_edge(x, y) && (tiles(x, y) < 0.5) == dark);
        let expected = if dark { 0.2 } else { 0.7 };
        assert!((mean / expected - 1.0).abs() < 0.05, "{mean}, expected {expected}");
    }
}

/// A line of light, which no layer shows, with noise of 30 % that is alike in 3 x 3 pixels. Its energy is kept to 6 %:
/// what is lost is the bright end of the noise, which is taken for spikes. And it stays on the line.
#[test]
fn a_caustic_line_keeps_its_energy() {
    let is_on = |x: u32, y: u32| (x + y / 2).abs_diff(60) < 2;
    let line = |x: u32, y: u32| if is_on(x, y) { 5.0 } else { 0.5 };
    let noisy = Noisy::new(film(line), film(|_, _| 0.5), |v| 0.3 * v, 1, 3);
    let [denoised, plain] = noisy.errors();
    assert!(denoised < plain, "{denoised} of {plain}");
    let denoised = noisy.denoised();
    let near = |x: u32, y: u32| (x + y / 2).abs_diff(60) < 5;
    let ratio = mean(&denoised, near) / mean(&noisy.beauty(), near);
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    let ratio = mean(&denoised, is_on) / mean(&noisy.beauty(), is_on);
    assert!(ratio > 0.9, "{ratio}");
}

/// A picture that is as rough as its noise leaves a filter nothing: the average stays. Pixels of their own, and squares
/// of 3 x 3, with noise that is alike in as many.
#[test]
fn what_is_all_detail_is_no_worse_than_the_average() {
    for (seed, error, blur) in [
        (4, 0.1, 0),
        (5, 0.5, 0),
        (6, 2.0, 0),
        (4, 0.1, 1),
        (5, 0.5, 1),
        (6, 2.0, 1),
    ] {
        let mut rng = Pcg64Mcg::seed_from_u64(100 + seed);
        let detail: Vec<f32> = (0..WIDTH * HEIGHT).map(|_| 3.0 + normal(&mut rng)).collect();
        let side = 2 * blur + 1;
        let truth = film(|x, y| detail[(y / side * WIDTH + x / side) as usize]);
        let noisy = Noisy::new(truth, film(|_, _| 0.5), |_| error, blur, seed);
        let [denoised, plain] = noisy.errors();
        assert!(denoised < 1.02 * plain, "{error}, {blur}: {denoised} of {plain}");
    }
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let noisy = Noisy::new(film(|x, _| x as f32), film(|_, y| (y / 9) as f32), |v| 0.1 * v, 1, 7);
    let [one, four] = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| noisy.denoised())
    });
    assert!(one == four);
}

#[test]
fn black_stays_black_and_sizes_of_all_kinds_are_taken() {
    for (width, height) in [(1, 1), (1, 7), (5, 3), (33, 64), (65, 33)] {
        for value in [0.0, 1e22, 1e-30] {
            let mut film = Film::new(width, height);
            film.pixels.fill([value; 3]);
            let mut odd = film.clone();
            odd.pixels.iter_mut().flatten().for_each(|v| *v *= 0.5);
            let depth = vec![f32::INFINITY; film.pixels.len()];
            let layer = Film::new(width, height);
            let input = Input {
                passes: 2,
                beauty: &film,
                odd: &odd,
                albedo: &layer,
                normal: &layer,
                depth: &depth,
            };
            let denoised = denoise(&input).unwrap();
            for pixel in &denoised.pixels {
                assert!((pixel[0] - value).abs() <= 1e-5 * value, "{pixel:?}");
            }
        }
    }
}

#[test]
fn what_cannot_be_denoised_is_named() {
    let good = film(|_, _| 1.0);
    let depth = vec![1.0; good.pixels.len()];
    let input = |passes, odd, depth| {
        denoise(&Input {
            passes,
            beauty: &good,
            odd,
            albedo: &good,
            normal: &good,
            depth,
        })
    };
    assert_eq!(input(1, &good, &depth), Err(DenoiseError::Passes(1)));
    let small = Film::new(3, 2);
    let error = input(2, &small, &depth).unwrap_err().to_string();
    assert_eq!(error, "odd: 6 pixels, expected 7680");
    let error = input(2, &good, &depth[1..]).unwrap_err().to_string();
    assert_eq!(error, "depth: 7679 pixels, expected 7680");
    let mut bad = good.clone();
    bad.pixels[100][2] = f32::NAN;
    let error = input(2, &bad, &depth).unwrap_err().to_string();
    assert_eq!(error, "odd has a NaN or an infinity at x = 4, y = 1");
}

/// What a bright area has lost does not go to fireflies of dark pixels next to it.
#[test]
fn dark_pixels_near_a_lamp_stay_dark() {
    let is_lit = |x: u32, _: u32| x < 60;
    let is_dark = |x: u32, _: u32| x > 64;
    let truth = film(|x, y| if is_lit(x, y) { 100.0 } else { 0.01 });
    let mut noisy = Noisy::new(truth, film(|_, _| 0.5), |_| 0.0, 0, 11);
    let mut rng = Pcg64Mcg::seed_from_u64(12);
    for half in [&mut noisy.even, &mut noisy.odd] {
        for (i, pixel) in half.pixels.iter_mut().enumerate() {
            let factor = match is_lit(i as u32 % WIDTH, 0) {
                true if rng.next_u64().is_multiple_of(8) => 8.0,
                true => 0.0,
                false if rng.next_u64().is_multiple_of(100) => 3000.0,
                false => 0.7,
            };
            *pixel = pixel.map(|value| value * factor);
        }
    }
    let (denoised, plain) = (noisy.denoised(), noisy.beauty());
    let (after, before) = (mean(&denoised, is_dark), mean(&plain, is_dark));
    assert!(after < 0.3 * before, "{after} of {before}");
}
