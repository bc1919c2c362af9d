//! Light from everywhere: the orientation of its image, and that all of it is found.

use crate::surfaces::lights::setup::{RADIANCE, SAMPLES, SIGNIFICANCE, sky, speckled};
use beamfarm_harness::{Chi2, MeanEstimate, Suite, render};
use beamfarm_render::math::{PI, Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::light::Environment;
use beamfarm_render::world::texture::Image;
use glam::Mat3;
use std::sync::Arc;

#[test]
fn environment_sampling_follows_its_density() {
    let sky = sky(Some(speckled(9, 6, 50.0)));
    let test = Chi2 {
        depth: 7,
        ..Chi2::default()
    };
    let result = test.sphere(
        Vec3::Y,
        |rng| {
            sky.sample_direct(&[], Vec3::ZERO, rng.next_2d(), 0.0)
                .map(|sample| sample.wi)
        },
        |wi| sky.pdf_direct(&[], Vec3::ZERO, wi, None),
    );
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.chi2("sky", &result);
    suite.finish();
}

/// What Mitsuba 3.9.1's `envmap` returns for an image of 8 x 4 pixels with red = column + 1, green = row + 1.
#[test]
fn environment_is_oriented_as_mitsubas() {
    let pixels = (0..32)
        .map(|i| Rgb::new((i % 8 + 1) as f32, (i / 8 + 1) as f32, 1.0))
        .collect();
    let image = Image {
        alpha: Vec::new(),
        width: 8,
        height: 4,
        pixels,
    };
    let environment = Environment::new(Some(Arc::new(image)), Rgb::ONE, Mat3::IDENTITY);
    for (dir, red, green) in [
        ([0.0, 0.0, 1.0], 4.5, 2.5),
        ([1.0, 0.0, 0.0], 2.5, 2.5),
        ([0.0, 0.0, -1.0], 4.5, 2.5),
        ([-1.0, 0.0, 0.0], 6.5, 2.5),
        ([0.0, 1.0, 0.0], 4.5, 1.0),
        ([0.0, -1.0, 0.0], 4.5, 4.0),
        ([1.0, 1.0, 0.0], 2.5, 1.75),
        ([1.0, 1.0, 1.0], 3.5, 1.91226),
        ([0.3, -0.2, 0.6], 3.90967, 2.77669),
        ([-0.5, 0.9, -0.1], 6.75133, 1.49223),
    ] {
        let value = environment.radiance(Vec3::from(dir).normalize());
        let expected = Rgb::new(red, green, 1.0);
        assert!((value - expected).length() < 2e-5, "{dir:?}: {value}");
    }
}

#[test]
fn environment_is_sampled_wherever_it_shines() {
    let image = speckled(300, 120, 1e7);
    let environment = Environment::new(Some(Arc::new(image)), RADIANCE, Mat3::IDENTITY);
    let mut rng = Sampler::new(7, 0, Purpose::Test, 0);
    let mut fluence = MeanEstimate::new();
    for _ in 0..SAMPLES {
        let dir = warp::uniform_sphere(rng.next_2d());
        assert!(environment.radiance(dir) == Rgb::ZERO || environment.pdf(dir) > 0.0);
        let sample = environment.sample(rng.next_2d());
        assert!(sample.pdf > 0.0 && (sample.dir.length() - 1.0).abs() < 1e-6);
        // Within a cell, the interpolated radiance is at most four times its mean.
        let ratio = environment.radiance(sample.dir) / sample.pdf;
        assert!(ratio.max_element() < 16.0 * environment.fluence().max_element());
        fluence.add(f64::from(ratio.x));
    }
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.mean("fluence", &fluence, f64::from(environment.fluence().x));
    suite.finish();
    let black = Image {
        alpha: Vec::new(),
        width: 2,
        height: 2,
        pixels: vec![Rgb::ZERO; 4],
    };
    let black = Environment::new(Some(Arc::new(black)), RADIANCE, Mat3::IDENTITY);
    assert_eq!(black.fluence(), Rgb::ZERO);
    assert_eq!(black.pdf(Vec3::X), 0.25 / PI);
}

/// A sky of 1 with a bright spot of value `spot` in its upper half.
fn with_spot(spot: f32) -> Arc<Image> {
    let pixels = (0..64 * 32).map(|i| match (i % 64, i / 64) {
        (20..23, 9..11) => Rgb::new(spot, 0.8 * spot, 0.5 * spot),
        _ => Rgb::new(0.7, 0.9, 1.4),
    });
    Arc::new(Image {
        alpha: Vec::new(),
        width: 64,
        height: 32,
        pixels: pixels.collect(),
    })
}

/// Passes and path tracer read the same parts, so only the image can show whether both lack light.
#[test]
fn a_sky_and_its_sun_are_the_image() {
    let turned = Mat3::from_rotation_y(0.7);
    let image = with_spot(1e3);
    let all = Environment::new(Some(image.clone()), RADIANCE, turned);
    let parts = Environment::sky_and_suns(&image, RADIANCE, turned);
    let [even, sun] = parts.as_slice() else {
        panic!("{} parts", parts.len());
    };
    assert!(all.unevenness() > 100.0 && even.unevenness() < 16.0);
    assert!(even.fluence().min_element() > 0.05 * all.fluence().min_element());
    let close = |a: Rgb, b: Rgb| (a - b).abs().cmple(1e-5 * b.abs() + 1e-6).all();
    assert!(close(even.fluence() + sun.fluence(), all.fluence()));
    let mut rng = Sampler::new(8, 0, Purpose::Test, 0);
    let mut is_in_sun = 0;
    for i in 0..10_000 {
        let dir = match i % 2 {
            0 => warp::uniform_sphere(rng.next_2d()),
            _ => all.sample(rng.next_2d()).dir,
        };
        let [even, sun] = [even, sun].map(|part| part.radiance(dir));
        let sum = even + sun;
        assert!(close(sum, all.radiance(dir)), "{dir}: {sum}");
        assert!(even.min_element() >= 0.0 && sun.min_element() >= 0.0);
        is_in_sun += usize::from(sun != Rgb::ZERO);
    }
    assert!((1000..9000).contains(&is_in_sun));
}

/// Splitting an even image, or one that consists only of suns, gains nothing.
#[test]
fn even_skies_and_suns_alone_are_one_light() {
    let mut sun = Image::clone(&with_spot(1e3));
    for pixel in &mut sun.pixels {
        *pixel = if pixel.x < 1.0 { Rgb::ZERO } else { *pixel };
    }
    let mut black = sun.clone();
    black.pixels.fill(Rgb::ZERO);
    for image in [with_spot(5.0), with_spot(3e4), Arc::new(sun), Arc::new(black)] {
        let parts = Environment::sky_and_suns(&image, RADIANCE, Mat3::IDENTITY);
        assert_eq!(parts.len(), 1);
        let all = Environment::new(Some(image), RADIANCE, Mat3::IDENTITY);
        assert_eq!(parts[0].fluence(), all.fluence());
    }
}

/// Scattered rays alone find an even sky: where nothing blocks it, one of them finds all of its light.
#[test]
fn an_even_sky_over_an_open_floor_has_no_noise() {
    let floor = r#"
[image]
width = 8
height = 8
[camera]
origin = [0, 3, 0]
target = [0, 0, 0.1]
fov = 40
[[shapes]]
type = "rectangle"
material = "grey"
transform = [{ scale = 8 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[materials.grey]
type = "diffuse"
reflectance = [0.8, 0.6, 0.5]
[[lights]]
type = "environment"
radiance = [1, 2, 3]
"#;
    // A lamp in the same scene is sampled directly, and takes no share from the sky.
    let lamp = "[[lights]]\ntype = \"point\"\nposition = [0, -1, 0]\nintensity = 5\n";
    for surfaces in ["photons", "paths"] {
        for lamp in ["", lamp] {
            let toml = format!("{floor}{lamp}[render]\nsurfaces = \"{surfaces}\"\n");
            let scene = render::scene(&toml);
            let image = render::run(&scene, scene.description().defaults.job_settings(), 1);
            for pixel in &image.beauty.pixels {
                let expected = [0.8, 1.2, 1.5];
                let is_near = (pixel.iter().zip(expected)).all(|(value, expected)| (value - expected).abs() < 1e-5);
                assert!(is_near, "{pixel:?}, {surfaces}, {lamp}");
            }
        }
    }
}
